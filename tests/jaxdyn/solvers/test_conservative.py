"""Solvers of fixed step: orders, symplecticity, reversal, energy over long runs, refusals."""

import jax
import numpy as np
import pytest
from helpers import EXACT, central_difference, gap, kepler, kepler_state

from jaxdyn import Status, scenes, simulate, solvers
from jaxdyn.analysis.energy import drift
from jaxdyn.effects import LinearDrag
from jaxdyn.integrate.simulation import solve

#: Each with a count of steps over a span of 5, where its error is well above rounding.
COUNTS = {
    solvers.VERLET: 200,
    solvers.BLANES_MOAN6: 20,
    solvers.KAHAN_LI8: 20,
    solvers.SOFRONIOU_SPALETTA10: 10,
    solvers.GAUSS8: 20,
    solvers.GAUSS12: 8,
}
#: Differences over half a radian from the near point of e = 0.3: h^4/30 of about 1e5.
SHORT = 1e-8
METHODS = pytest.mark.parametrize("method", COUNTS, ids=lambda m: m.name)


def _end(scene, t1, n, method):
    return solve(scene, t1, solver=method, dt=t1 / n).y1


@pytest.mark.sample("Blanes-Moan 6", "Gauss 12")
@METHODS
def test_the_error_falls_with_the_order(method):
    span, e, n = 5.0, 0.3, COUNTS[method]
    errors = [gap(_end(kepler(e), span, k * n, method), kepler_state(e, span)) for k in (1, 2)]
    assert errors[1] > EXACT
    assert np.log2(errors[0] / errors[1]) > method.order - 0.35


@METHODS
@pytest.mark.slow
def test_the_tangent_map_is_that_of_the_steps_and_symplectic(method):
    scene = kepler(0.3)
    end = jax.jit(lambda y: _end(scene.starting(y), 5.0, 40, method))
    tangent = jax.jacfwd(end)(scene.y0)
    zero, one = np.zeros((4, 4)), np.eye(4)
    J = np.block([[zero, one], [-one, zero]])  # equal masses: velocities go as momenta
    # Rounding of entries up to 10; Verlet's motion is off by 0.03 here, and is as symplectic.
    assert gap(tangent.T @ J @ tangent, J) < 100 * EXACT
    assert gap(tangent, jax.jacrev(end)(scene.y0)) < 10 * EXACT
    # Differences are right to h^4, of fifth derivatives that grow with the span: take a short one.
    soon = jax.jit(lambda y: _end(scene.starting(y), 0.5, 4, method))
    assert gap(jax.jacfwd(soon)(scene.y0), central_difference(soon, scene.y0)) < SHORT


@METHODS
def test_a_run_back_undoes_a_run(method):
    scene = kepler(0.3)
    there = _end(scene, 5.0, 40, method)
    back = solve(scene.starting(there), 0.0, t0=5.0, solver=method, dt=5.0 / 40).y1
    assert gap(back, scene.y0) < 100 * EXACT


def test_steps_are_equal_and_no_longer_than_dt():
    scene = kepler(0.3)
    for dt, n in ((1.0, 5), (0.99, 6), (5.0 / 7, 7), (9.0, 1)):
        out = solve(scene, 5.0, solver=solvers.VERLET, dt=dt)
        assert (int(out.steps), int(out.rejected), int(out.status)) == (n, 0, Status.OK)
        assert gap(out.y1, _end(scene, 5.0, n, solvers.VERLET)) == 0


def test_samples_lie_on_the_motion():
    ts = np.array([0.0, 0.33, 2.5, 4.99, 5.0])
    motion = simulate(kepler(0.3), 5.0, samples=ts, solver=solvers.KAHAN_LI8, dt=0.05)
    for t, y in zip(ts, motion.ys, strict=True):
        assert gap(y, kepler_state(0.3, t)) < 1e-11
    assert drift(motion) < 1e-12


@pytest.mark.slow
def test_energy_errors_stay_bounded_over_many_periods():
    scene, periods = kepler(0.5), 2000
    ts = 2 * np.pi * np.linspace(0.0, periods, 500)
    motion = simulate(
        scene, ts[-1], samples=ts, solver=solvers.KAHAN_LI8, dt=2 * np.pi / 100, max_steps=10**6
    )
    e = np.array(
        [0.5 * 0.5 * y[4:] @ y[4:] - 0.25 / np.hypot(*(y[2:4] - y[:2])) for y in motion.ys]
    )
    early, late = np.abs(e[:250] - e[0]).max(), np.abs(e[250:] - e[0]).max()
    assert late < 2 * early + 1e-14
    assert late < 1e-9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"solver": solvers.KAHAN_LI8},
            r"dt: expected a step, since those of Kahan-Li 8 are equal",
        ),
        (
            {"dt": 0.1},
            r"dt: expected none, since Taylor 16 chooses its steps by rtol, got 0\.1",
        ),
        ({"solver": solvers.VERLET, "dt": -0.1}, r"dt: expected > 0, got -0\.1\. It is the length"),
        ({"solver": solvers.VERLET, "dt": np.nan}, r"dt: expected finite numbers, got nan"),
        ({"solver": "best"}, r"solver: expected one of jaxdyn\.solvers, .* got 'best'"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        simulate(kepler(0.3), 1.0, **options)


def test_a_symplectic_solver_refuses_drag_and_names_the_remedy():
    scene = kepler(0.3) + LinearDrag(0.1)
    with pytest.raises(
        ValueError, match=r"^solver: expected one for forces that .*, got Verlet 2, .*GAUSS12"
    ):
        simulate(scene, 1.0, solver=solvers.VERLET, dt=0.1)


def test_too_many_fixed_steps_are_a_status():
    motion = simulate(kepler(0.3), 5.0, solver=solvers.VERLET, dt=0.01, max_steps=9, throw=False)
    assert motion.status_code == Status.STEP_LIMIT


@pytest.mark.parametrize("method", [solvers.GAUSS12, solvers.VERLET], ids=lambda m: m.name)
def test_steps_far_too_long_are_warned_of(method):
    # The equations of a step past the centre have a solution, which is none of the motion's.
    motion = simulate(kepler(0.9), 100.0, solver=method, dt=25.0, samples=20)
    assert motion.ok
    assert drift(motion) > 0.1
    assert "Make dt smaller" in motion.warning
    assert simulate(kepler(0.3), 20.0, solver=method, dt=0.1, samples=20).warning == ""


@pytest.mark.slow
def test_a_motion_at_rest_has_no_steps_too_long():
    scene = scenes.pendulum().starting([np.pi, 0.0])  # upright but for rounding
    assert simulate(scene, 1.0, solver=solvers.GAUSS12, dt=0.1, samples=5).warning == ""


@pytest.mark.slow
def test_a_million_steps_of_an_oscillator():
    oscillator = scenes.oscillator(k=4.0)
    motion = simulate(oscillator, 1e4, samples=2, solver=solvers.GAUSS8, dt=0.01)
    assert int(motion.steps) == 1_000_000
    x, v = oscillator.y0
    c, s = np.cos(2e4), np.sin(2e4)
    assert gap(motion.ys[-1], [x * c + v * s / 2, v * c - 2 * x * s]) < 1e-9
