"""Stiff motions: Radau against closed forms and SciPy, stiffness noticed, the switch to Radau."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap, kepler, kepler_state

import jaxdyn
from jaxdyn import Status, scenes, simulate, solvers
from jaxdyn.hard.cases.stiff import joined_by_spring, mass_centre
from jaxdyn.integrate.events import Reaches, until
from jaxdyn.integrate.simulation import _compiled_flow, solve
from jaxdyn.solvers.choice import default_solver


def chased(t, y, k):
    """x chases cos t at rate k, z chases y = e^-t at rate 1000: closed forms for any k."""
    fast = -k * (y[0] - jnp.cos(t)) - jnp.sin(t)
    return [fast, -y[1], -1e3 * (y[2] - y[1]) - y[1]]


def van_der_pol(t, y, mu):
    """x'' = mu ((1 - x^2) x' - x), as in Hairer and Wanner, IV.1 and IV.10."""
    return [y[1], mu * ((1 - y[0] * y[0]) * y[1] - y[0])]


CHASED = jaxdyn.ode(chased, [3.0, 1.0, 2.0], params=1e8)
CHASED_END = np.array([np.cos(2.0), np.exp(-2.0), np.exp(-2.0)])
#: x, v at t = 1 of mu = 1e6 from (2, -0.66): SciPy's Radau at rtol 1e-12, atol 1e-14.
VAN_DER_POL = jaxdyn.ode(van_der_pol, [2.0, -0.66], params=1e6)
VAN_DER_POL_END = np.array([-1.8636460061388465, 0.7535432683993802])


@pytest.mark.parametrize("method", [solvers.RADAU5, solvers.RADAU9], ids=lambda m: m.name)
def test_the_error_falls_with_the_order(method):
    span, e = 2.0, 0.3
    field, n = kepler(e).rate, {5: 40, 9: 8}[method.order]

    @jax.jit
    def end(n):
        h = span / n
        step = lambda i, y: y + method.advance(field, i * h, h, y).increment  # noqa: E731
        return jax.lax.fori_loop(0, n, step, kepler(e).y0)

    errors = [gap(end(k * n), kepler_state(e, span)) for k in (1, 2)]
    assert errors[1] > 1e-14
    assert np.log2(errors[0] / errors[1]) > method.order - 0.35


@pytest.mark.parametrize("k", [1e2, 1e5, 1e8])
def test_a_fast_part_costs_nothing_once_it_is_over(k):
    out = solve(
        jaxdyn.ode(chased, [3.0, 1.0, 2.0], params=k), 2.0, solver=solvers.RADAU9, rtol=1e-12
    )
    assert gap(out.y1, CHASED_END) < SOLVED
    assert int(out.steps) < 600


def test_van_der_pol_through_its_jumps():
    out = solve(VAN_DER_POL, 1.0, solver=solvers.RADAU9, rtol=1e-11)
    assert gap(out.y1, VAN_DER_POL_END) < 1e-9


def test_steps_do_not_shrink_for_the_rounding_of_their_iterations():
    out = solve(VAN_DER_POL, 1.0, solver=solvers.RADAU9, rtol=1e-15)
    assert out.status == Status.OK
    assert int(out.steps) < 4000  # 1980 at 1e-14
    assert gap(out.y1, VAN_DER_POL_END) < 1e-9


#: At t = 40 by SciPy's Radau with rtol 1e-12 and atol 1e-16; at 1e11 from the test set of Hairer
#: and Wanner (problem ROBER).
ROBERTSON = {
    40.0: (0.715827068719415, 9.1855347645582e-06, 0.28416374574582),
    1e11: (2.083340149701255e-08, 8.333360770334713e-14, 0.9999999791665050),
}


def robertson(t, y):
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return [back - slow, slow - back - fast, fast]


@pytest.mark.parametrize("t1", ROBERTSON)
@pytest.mark.parametrize(
    ("solver", "rtol", "digits"),
    [
        (None, 1e-11, 1e-9),
        (None, 1e-6, 1e-4),
        (solvers.RADAU9, 1e-4, 1e-2),
        (solvers.RADAU5, 1e-6, 1e-4),
    ],
)
def test_a_first_step_that_is_far_too_long_is_rejected(solver, rtol, digits, t1):
    # It led to where rates are 1e30, and their rounding counted as the error that it may have.
    scene = jaxdyn.ode(robertson, [1.0, 0.0, 0.0], t1)
    motion = simulate(scene, samples=2, rtol=rtol, solver=solver)
    np.testing.assert_allclose(motion.ys[-1], ROBERTSON[t1], rtol=digits)


def test_a_first_step_that_is_too_long_for_an_explicit_method_is_rejected():
    scene = jaxdyn.ode(robertson, [1.0, 0.0, 0.0], 3.0)
    motion = simulate(scene, samples=2, rtol=1e-4, solver=solvers.DOPRI8)
    exact = simulate(scene, samples=2, solver=solvers.RADAU9)
    np.testing.assert_allclose(motion.ys[-1], exact.ys[-1], rtol=1e-2)


def test_derivatives_of_a_stiff_motion():
    # Where x ends does not depend on its start, y and z end in proportion to that of y.
    end = lambda y: solve(CHASED.starting(y), 2.0, solver=solvers.RADAU9, rtol=1e-12).y1  # noqa: E731
    wanted = np.zeros((3, 3))
    wanted[1:, 1] = np.exp(-2.0)
    assert gap(jax.jit(jax.jacfwd(end))(CHASED.y0), wanted) < SOLVED


@pytest.mark.slow
def test_an_event_of_a_stiff_motion():
    # z starts 1 off y = e^-t; that difference is over long before the event.
    halved = until(CHASED, Reaches(2, 0.5, -1), 9.0, rtol=1e-12, solver=solvers.RADAU5)
    assert gap(halved.t, np.log(2.0)) < SOLVED
    assert gap(halved.y, np.array([np.cos(np.log(2.0)), 0.5, 0.5])) < SOLVED


@pytest.mark.slow
def test_crossings_of_a_stiff_motion_and_their_derivatives():
    options = {"rtol": 1e-12, "solver": solvers.RADAU9}
    found = jaxdyn.crossings(CHASED, Reaches(0, 0.0), 9.0, **options)
    assert gap(found.ts, (np.arange(3) + 0.5) * np.pi) < SOLVED
    assert found.directions.tolist() == [-1, 1, -1]
    # -log of the level, as z follows e^-t.
    falls = lambda z: jaxdyn.crossings(CHASED, Reaches(2, z, -1), 9.0, most=2, **options).ts[0]  # noqa: E731
    time, slope = jax.jvp(falls, (jnp.asarray(0.5),), (jnp.ones(()),))
    assert gap(time, np.log(2.0)) < SOLVED
    assert gap(slope, -2.0) < SOLVED


def test_stiffness_is_noticed_and_said():
    # So few steps are over before another method is compiled.
    motion = simulate(CHASED, 2e-5, samples=2, rtol=1e-6)
    assert bool(motion.stiff)
    assert not motion.switched
    assert motion.warning.startswith("The scene is stiff")
    assert motion.warning.endswith("Pass solver=solvers.RADAU9.")


@pytest.mark.sample("kepler-1e-06", "ball-1e-13")
@pytest.mark.parametrize("rtol", [1e-2, 1e-6, 1e-13])
@pytest.mark.parametrize(
    "scene",
    [kepler(0.9), scenes.cannonball(drag=0.3), scenes.three_body()],
    ids=["kepler", "ball", "eight"],
)
def test_other_motions_are_not_called_stiff(scene, rtol):
    motion = simulate(scene, 20.0, samples=2, rtol=rtol)
    assert not bool(motion.stiff)
    assert motion.warning == ""


def test_a_fixed_step_too_long_for_its_equations_is_a_status():
    motion = simulate(CHASED, 2.0, solver=solvers.GAUSS8, dt=0.1, throw=False)
    assert motion.status_code == Status.STEP_TOO_LONG
    assert jnp.isnan(motion.ys[1:]).all()


def test_the_default_switches_where_it_is_stiff_and_only_there():
    out = solve(CHASED, 2.0, rtol=1e-10)
    assert bool(out.stiff)
    assert gap(out.y1, CHASED_END) < 1e-9
    assert int(out.steps) < 600
    plain = simulate(kepler(0.3), 5.0, samples=2)
    assert not bool(plain.stiff)
    assert not plain.switched


def test_the_switch_is_said_and_compiles_only_what_it_needs():
    motion = simulate(CHASED, 2.0, samples=2, rtol=1e-8)
    assert "RADAU9, which is implicit, took over" in motion.warning
    assert bool(motion.stiff)
    assert gap(motion.ys[-1], CHASED_END) < 1e-7
    chosen = simulate(CHASED, 2.0, samples=2, rtol=1e-8, solver=solvers.RADAU9)
    assert jnp.array_equal(chosen.ys, motion.ys)
    assert (int(chosen.steps), chosen.warning) == (int(motion.steps), "")
    # A method that is asked for goes on, in the program of the default.
    programs = _compiled_flow._cache_size()
    explicit = simulate(CHASED, 1e-4, samples=2, solver=default_solver(CHASED))
    assert _compiled_flow._cache_size() == programs
    assert int(explicit.steps) > 1000
    assert not explicit.switched


def test_the_limit_of_steps_holds_before_and_after_the_switch():
    few = simulate(CHASED, 2.0, samples=2, max_steps=100, throw=False)
    assert (few.status_code, bool(few.switched)) == (Status.STEP_LIMIT, False)
    more = simulate(CHASED, 1e8, samples=2, max_steps=1500, rtol=1e-14, throw=False)
    assert (more.status_code, bool(more.switched)) == (Status.STEP_LIMIT, True)


def test_inside_a_trace_the_method_stays_and_that_is_said():
    span = 2e-5
    motion = jax.jit(lambda y: simulate(CHASED.starting(y), span, samples=2))(CHASED.y0)
    assert bool(motion.stiff)
    assert not np.any(motion.switched)
    assert motion.warning.endswith("Pass solver=solvers.RADAU9.")
    # Also in one that the arguments are not part of.
    same = jax.jit(lambda: solve(CHASED, span).y1)()
    assert gap(same, motion.ys[-1]) < SOLVED


@pytest.mark.slow
def test_digits_of_a_stiff_motion():
    motion = simulate(CHASED, 2.0, samples=2, digits=9)
    assert gap(motion.ys[-1], CHASED_END) < 1e-9
    assert motion.error is not None
    assert motion.error.solver == solvers.RADAU9.name
    assert "took over" in motion.warning


@pytest.mark.slow
def test_estimates_are_those_of_the_method_that_takes_over():
    found = jaxdyn.accuracy.estimate(CHASED, 2.0, samples=2, rtol=1e-8)
    assert (found.solver, found.other) == (solvers.RADAU9.name, solvers.RADAU9.name)
    assert np.abs(found.ys[-1] - CHASED_END).max() < 10 * found.error[-1].max()


@pytest.mark.slow
def test_events_and_crossings_switch_too():
    stop = until(CHASED, Reaches(2, 0.5, -1), 9.0)
    assert gap(stop.t, np.log(2.0)) < 1e-9
    found = jaxdyn.crossings(CHASED, Reaches(2, 0.5, -1), 9.0)
    assert gap(found.ts, [np.log(2.0)]) < 1e-9


@pytest.mark.slow
def test_the_switch_is_kept_in_files(tmp_path):
    motion = simulate(scenes.two_springs(c_a=1e6), 1e-2, samples=2)
    assert motion.switched
    motion.save(tmp_path / "stiff.npz")
    back = jaxdyn.load(tmp_path / "stiff.npz")
    assert back.warning == motion.warning


@pytest.mark.parametrize(
    ("k", "solver"),
    [(1e8, solvers.RADAU9), (1e12, solvers.RADAU9), (1e10, diffrax.Kvaerno5())],
    ids=["1e8", "1e12", "diffrax"],
)
def test_a_link_that_rounding_moves_at_rest_loses_nothing(k, solver):
    # Pushed from rest: all that the rate says at first is the rounding of a stiff link.
    motion = simulate(joined_by_spring(k), 20.0, samples=1, rtol=1e-8, solver=solver)
    one, other = motion.ys[-1, :2]
    assert abs((one + 2 * other) / 3 - mass_centre(20.0)) < (
        1e-11 if solver is solvers.RADAU9 else 1e-6
    )
