"""Step control: steps follow the tolerance, samples find their nodes, singularities end it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cycles import Moebius, cycle
from helpers import gap, kepler, kepler_state
from odes import FLAME_LENGTH, FLAME_MODES, ROD_MODES, flame, heated

import jaxdyn
from jaxdyn import scenes
from jaxdyn.analysis.regularized import regularize
from jaxdyn.integrate.march import Samples, StepControl
from jaxdyn.integrate.simulation import solve
from jaxdyn.scales import Groups
from jaxdyn.solvers import KAHAN_LI8, VERNER9
from jaxdyn.solvers.stepper import allowed_error, grow


@pytest.mark.parametrize("solver", [None, VERNER9], ids=["Nystrom", "Verner"])
def test_the_error_follows_the_tolerance(solver):
    exact = kepler_state(0.3, 5.0)
    for rtol in (1e-6, 1e-9, 1e-12):
        error = gap(solve(kepler(0.3), 5.0, rtol=rtol, solver=solver).y1, exact)
        # Some ten steps, whose errors grow with the motion, at 0.75^11 = 0.04 of the
        # tolerance each; much less would waste steps.
        assert 1e-4 * rtol < error < 100 * rtol


def test_the_absolute_tolerance_counts_where_the_state_is_small():
    loose = solve(kepler(0.3), 5.0, rtol=1e-12, atol=1e-4)
    tight = solve(kepler(0.3), 5.0, rtol=1e-12, atol=1e-12)
    assert loose.steps < 0.7 * tight.steps


def test_most_steps_are_accepted_on_an_eccentric_orbit():
    out = solve(kepler(0.9), 20 * np.pi, rtol=1e-10)
    assert gap(out.y1, kepler(0.9).y0) < 1e-6
    assert out.rejected < 0.5 * out.steps  # the step changes by a factor of 30 each half turn


def test_steps_do_not_depend_on_the_direction_or_the_origin_of_time():
    scene = kepler(0.3)
    mirrored = scene.starting(jnp.concatenate([scene.y0[:4], -scene.y0[4:]]))
    there, back = solve(scene, 5.0, rtol=1e-12), solve(mirrored, -5.0, rtol=1e-12)
    mirror = jnp.concatenate([jnp.ones(4), -jnp.ones(4)])
    np.testing.assert_array_equal(back.y1 * mirror, there.y1)
    assert (back.steps, back.rejected) == (there.steps, there.rejected)
    later = solve(scene, 1005.0, t0=1000.0, rtol=1e-12)
    assert abs(int(later.steps) - int(there.steps)) <= 1
    assert gap(later.y1, there.y1) < 1e-11  # t has 13 digits behind the point there


@pytest.mark.parametrize("second_order", [False, True])
def test_the_rounding_of_a_late_time_asks_for_no_steps(second_order):
    w, t0, span = 1.3, 1e4, 20.0
    force = 1 / (1 - w**2)  # the amplitude of cos(w t)

    def of_cosine(start, t):
        x, v = start[0] - force * np.cos(w * t0), start[1] + force * w * np.sin(w * t0)
        s = t - t0
        return x * np.cos(s) + v * np.sin(s) + force * np.cos(w * t)

    if second_order:
        scene = jaxdyn.lagrangian(
            lambda t, q, v: 0.5 * (v @ v - q @ q) + q[0] * jnp.cos(w * t), [0.3], [0.1]
        )
    else:
        scene = jaxdyn.ode(lambda t, y: jnp.stack([y[1], -y[0] + jnp.cos(w * t)]), [0.3, 0.1])
    out = solve(scene, t0 + span, t0=t0, rtol=1e-15, solver=VERNER9)
    assert out.steps < 1200  # 67,634 if the noise of the force is not known
    assert gap(out.y1[0], of_cosine([0.3, 0.1], t0 + span)) < 4e-12  # two roundings of t


def test_a_force_that_begins_at_a_late_start_is_no_rounding():
    for begins in (jnp.greater, jnp.greater_equal):

        def rate(t, y, begins=begins):
            return jnp.stack([y[1], -y[0] + jnp.where(begins(t, 1e4), 1.0, 0.0)])

        out = solve(jaxdyn.ode(rate, [0.3, 0.1]), 1e4 + 20, t0=1e4, rtol=1e-12, solver=VERNER9)
        assert gap(out.y1[0], 1 - 0.7 * np.cos(20.0) + 0.1 * np.sin(20.0)) < 1e-11


def test_a_given_absolute_tolerance_is_in_the_units_of_the_state():
    tolerance, y = jnp.array([0.1, 1.0, 0.0]), jnp.array([10.0, -20.0])
    np.testing.assert_allclose(allowed_error(tolerance, y, y, 0 * y), [2.0, 3.0], rtol=1e-15)


def test_the_default_one_is_in_the_sizes_of_the_motion():
    tolerance, y = jnp.array([0.1, 0.0, 0.1]), jnp.array([10.0, 0.0])
    np.testing.assert_allclose(allowed_error(tolerance, jnp.array([30.0, 2.0]), y, y), [4.0, 0.2])
    alone, together = Groups((0, 1), (np.inf, np.inf)), Groups((0, 0), (np.inf, np.inf))
    np.testing.assert_array_equal(grow(alone, jnp.array([3.0, 1.0]), -y), [10.0, 1.0])
    np.testing.assert_array_equal(grow(together, jnp.array([3.0, 1.0]), -y), [10.0, 10.0])


def test_tangents_are_measured_by_the_largest_entry_of_their_column_in_the_sizes_of_the_state():
    groups = Groups((0, 1, 2), (np.inf,) * 3)
    sizes = jnp.zeros((3, 2)).at[:, 0].set(jnp.array([10.0, 0.1, 0.0]))
    y = jnp.array([[10.0, 100.0], [-0.1, 2.0], [0.0, 5.0]])
    # The second entry is 20 sizes; the third never moves, and is measured by itself.
    found = grow(groups, sizes, y)
    np.testing.assert_allclose(found, [[10.0, 200.0], [0.1, 2.0], [0.0, 5.0]])
    tolerance = jnp.array([0.1, 1.0, 0.0])
    wide = allowed_error(tolerance, found, y, 0 * y)
    np.testing.assert_allclose(wide, [[2.0, 21.0], [1.01, 1.2], [1.0, 1.5]])


def test_the_worst_column_counts_by_its_mean_square():
    assert float(StepControl.norm(jnp.array([[1.0, 0.0], [1.0, 3.0]]))) == np.sqrt(4.5)


def test_samples_are_ends_of_shorter_steps():
    ts = jnp.array([0.0, 0.5, 0.6, 0.6, 2.0, 9.0])
    y = jnp.array([1.0, 2.0])
    samples = Samples.empty(ts, jnp.array(0.0), y)
    np.testing.assert_array_equal(samples.ys[:, 0], [1.0, *[np.nan] * 5])  # the start is known
    samples, to = samples.towards(ts, jnp.array(0.0), jnp.array(0.4))
    assert to == 0.4
    samples, to = samples.towards(ts, jnp.array(0.4), jnp.array(2.0))
    assert to == 0.5
    samples = samples.take(ts, to, 2 * y)
    samples, to = samples.towards(ts, jnp.array(0.4), samples.aim)
    assert to == 0.6
    samples = samples.take(ts, to, 3 * y)  # both that are equal
    samples, to = samples.towards(ts, jnp.array(0.4), samples.aim)
    assert to == 2.0  # one at the end is the step itself
    samples = samples.take(ts, to, 4 * y)
    np.testing.assert_array_equal(samples.ys[:, 0], [1.0, 2.0, 3.0, 3.0, 4.0, np.nan])


@pytest.mark.parametrize(("solver", "dt"), [(None, None), (KAHAN_LI8, 0.0871)])
def test_samples_neither_change_the_steps_nor_count_as_steps(solver, dt):
    scene, rtol = kepler(0.3), 1e-12
    plain = solve(scene, 5.0, rtol=rtol, solver=solver, dt=dt)
    ts = jnp.sort(jnp.concatenate([jnp.linspace(0.0, 5.0, 40), jnp.array([1e-9, 5.0 - 1e-13])]))
    for end in (5.0, -5.0):
        out = solve(scene, end, ts=end / 5.0 * ts, rtol=rtol, solver=solver, dt=dt)
        assert (out.steps, out.rejected) == (plain.steps, plain.rejected)
        exact = jnp.stack([kepler_state(0.3, float(t)) for t in end / 5.0 * ts])
        assert gap(out.ys, exact) < (1e-11 if dt is None else 1e-7)
        if end > 0:
            assert gap(out.y1, plain.y1) < 1e-14  # two programs, which round differently


def test_samples_out_of_order_are_refused_where_they_cannot_be_checked():
    ts = jnp.array([2.0, 1.0, 3.0])
    ys = solve(kepler(0.3), 5.0, ts=ts).ys
    np.testing.assert_array_equal(jnp.isnan(ys[:, 0]), [False, True, False])


def at_rest_but_for_rounding():
    # The slider's acceleration cancels, to a rounding that grows from 0 as the table turns.
    scene = scenes.turntable(speed=0.0, formulation="lagrange")
    plain = jaxdyn.ode(lambda t, y: scene.rate(t, y), scene.y0)
    return [pytest.param(scene, id="units"), pytest.param(plain, id="no units")]


@pytest.mark.parametrize("scene", at_rest_but_for_rounding())
def test_an_entry_that_rounding_alone_moves_asks_for_no_steps(scene):
    out = solve(scene, 10.0, rtol=1e-13, max_steps=1000)
    np.testing.assert_allclose(out.y1, [10.0, 0.0, 1.0, 0.0], rtol=1e-12, atol=1e-13)
    assert out.steps < 20


def test_a_tangent_that_rounding_alone_moves_asks_for_no_steps():
    # In logarithmic time G acts through the energy at the start alone: elsewhere it cancels.
    three = scenes.three_body()
    three = three.starting(three.y0 + np.linspace(0.0, 0.1, 12))

    def slow(G):
        return regularize(eqx.tree_at(lambda scene: scene.effects[0].G, three, G))

    def end(G):
        return solve(slow(G), 3.0, max_steps=1000).y1

    def from_start(y0):
        return solve(slow(0.7).starting(y0), 3.0).y1

    start, moved = jax.jvp(lambda G: slow(G).y0, (0.7,), (1.0,))
    _, by_G = jax.jvp(end, (0.7,), (1.0,))
    _, expected = jax.jvp(from_start, (start,), (moved,))
    np.testing.assert_allclose(by_G, expected, rtol=1e-8)


def front(y0, *, together):
    names = [(f"a{i}", "1/s") for i in range(len(y0))] if together else None
    return jaxdyn.ode(flame, y0, 1.0, names=names, params=FLAME_LENGTH)


def test_small_modes_ask_for_no_steps_that_the_rounding_of_large_ones_undoes():
    # Their steps are compared with those of modes that are all measured by the largest.
    y0 = np.zeros(2 * FLAME_MODES)
    y0[[0, 1, FLAME_MODES, FLAME_MODES + 1]] = 0.1, -0.4, 0.2, 0.1
    few = {"solver": VERNER9, "max_steps": 20_000}
    for rtol in (1e-6, 1e-12):  # all other modes begin at zero, and what moves them is rounding
        alone, together = (
            solve(front(y0, together=one), 1.0, rtol=rtol, **few) for one in (False, True)
        )
        assert alone.steps < 10 * together.steps
        assert gap(alone.y1, together.y1) < 10 * rtol
    late = solve(front(y0, together=True), 60.0, rtol=1e-12, **few).y1  # modes of 0.4 to 1e-6
    for rtol in (1e-14, 1e-15):
        alone, together = (
            solve(front(late, together=one), 1.0, rtol=rtol, **few) for one in (False, True)
        )
        assert alone.steps < 10 * together.steps
        assert gap(alone.y1, together.y1) < 1e-14


def test_rounding_that_grows_with_the_motion_asks_for_no_steps():
    # Modes of even order stay zero by symmetry, and what rounding makes of them grows with the cube
    # of the odd ones, by 1e9.
    y0 = np.zeros(2 * ROD_MODES)
    y0[0] = 1e-3
    end = solve(jaxdyn.ode(heated, y0, 1.0, params=0.0), 20.0, solver=VERNER9, max_steps=20_000)
    assert end.status == 0
    assert gap(heated(0.0, end.y1, 0.0), 0 * y0) < 1e-10  # at rest
    assert gap(end.y1[1::2], jnp.zeros(ROD_MODES)) < 1e-12


@pytest.mark.slow
def test_tangents_of_tangents_that_rounding_alone_moves_ask_for_no_steps():
    # Two entries are zero, and the number changes nothing in the others: of the derivatives by it
    # and the start only those of these two entries are not zero.
    y0 = jnp.array([1.0, 0.0, 0.0, 0.0])

    def slope(c):
        def monodromy(a):
            def end(y):
                return solve(cycle(Moebius, a + c * c - 0.09, y), 2 * np.pi, max_steps=1000).y1

            return jax.jacfwd(end)(y0)

        return jax.jvp(monodromy, (0.0,), (1.0,))[1]

    first, second = jax.jvp(slope, (0.3,), (1.0,))
    # The part of the entry along the band is - exp(2 pi a).
    exact = np.zeros((4, 4))
    exact[2, 2] = -2 * np.pi
    np.testing.assert_allclose(first, exact, atol=1e-9)
    exact[2, 2] = -0.6 * (2 * np.pi) ** 2
    np.testing.assert_allclose(second, exact, atol=1e-8)


@pytest.mark.parametrize("limit", [10.0, 3e3, 1e6])
def test_a_drive_that_grows_up_to_a_far_limit_is_measured_where_it_is(limit):
    # y' = t^4 - y from 0, whose rate at the limit is up to 1e20 times that at the times asked for.
    scene = jaxdyn.ode(lambda t, y: t**4 - y, [0.0], t1=limit)
    ts = np.array([1.0, 10.0])
    exact = ts**4 - 4 * ts**3 + 12 * ts**2 - 24 * ts + 24 - 24 * np.exp(-ts)
    found = jaxdyn.solve(scene, limit, ts=ts)
    np.testing.assert_allclose(np.asarray(found.ys)[:, 0], exact, rtol=1e-13)
