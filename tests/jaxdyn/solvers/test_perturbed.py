"""Random changes of each step against what rounding does to motions known in closed form."""

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from closed_forms import known
from helpers import EXACT, SOLVED, gap, kepler

import jaxdyn
from jaxdyn import accuracy, scenes
from jaxdyn.accuracy.convergence import fixed_steps
from jaxdyn.integrate import errors
from jaxdyn.integrate.simulation import solve
from jaxdyn.solvers import VERNER9
from jaxdyn.solvers.perturbed import QUIET, Noise, RoundedField

KNOWN = known()


def noise(size, seed=0):
    return Noise(np.asarray(size), np.asarray(seed, np.uint64))


def test_no_noise_changes_nothing():
    scene = kepler(0.5)
    still = solve(scene, 6.0, rtol=1e-13, noise=QUIET)
    assert gap(still.y1, solve(scene, 6.0, rtol=1e-13).y1) < EXACT
    assert gap(solve(scene, 6.0, rtol=1e-13, noise=noise(0.0, 7)).y1, still.y1) == 0.0


def test_changes_are_random_and_in_proportion_to_the_noise():
    scene = kepler(0.5)
    plain = solve(scene, 20.0, rtol=1e-13, noise=QUIET).y1
    small, large = (
        np.array(
            [solve(scene, 20.0, rtol=1e-13, noise=noise(size, n)).y1 - plain for n in range(8)]
        )
        for size in (1e-9, 1e-7)
    )
    # Other signs for each step and seed, as large ones as small ones.
    assert np.ptp(small[:, 0]) > np.abs(small[:, 0]).mean()
    spreads = np.sqrt(np.mean(np.square(large), axis=0) / np.mean(np.square(small), axis=0))
    assert (50 < spreads).all()
    assert (spreads < 200).all()


def test_a_rounded_state_is_projected_and_nothing_else_is():
    at = jnp.asarray(0.3)
    free = kepler(0.5)
    field = RoundedField(free.field, noise(1e-9))
    assert gap(field.project(at, free.y0), free.y0) == 0.0
    rod = scenes.pendulum(formulation="constrained", angle=1.0)
    off = RoundedField(rod.field, noise(1e-9)).project(at, rod.y0) - rod.y0
    assert 1e-11 < abs(off).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flipping body", "ellipse 0.9", "central gravity"])
def test_half_a_spacing_of_noise_spreads_motions_as_rounding_does(name):
    case = KNOWN[name]
    exact = case.exact(np.array([case.t1]))[0]
    missed, moved = [], []
    for seed, rtol in enumerate(np.geomspace(3e-15, 3e-14, 60)):
        y1, other = (
            np.asarray(solve(case.scene, case.t1, rtol=rtol, noise=n).y1)
            for n in (QUIET, noise(1e-9, seed))
        )
        missed.append(y1[case.entries] - exact)
        moved.append((other - y1)[case.entries])
    spread, model = (np.sqrt(np.mean(np.square(x), axis=0)).max() for x in (missed, moved))
    # A body rounds a little less: its moments of inertia are subtracted before they are multiplied.
    assert 0.4 < spread / (0.5 * np.finfo(float).eps / 1e-9 * model) < 2.0


def pushed(t, y):
    """x'' = cos t, by the time itself."""
    return [y[1], jnp.cos(t)]


# Its rounding is that of programs as users compile them.
@pytest.mark.long
def test_the_rounding_of_large_times_is_seen():
    t0, span = 1e4, np.array([10.0, 20.0, 30.0])
    scene = jaxdyn.ode(pushed, [1.0, 0.0])
    found = accuracy.estimate(scene, t0 + 30, t0=t0, samples=t0 + span, rtol=1e-13, solver=VERNER9)
    with mpmath.workdps(40):
        c, s = mpmath.cos(t0), mpmath.sin(t0)
        exact = [[1 + c - mpmath.cos(t0 + t) - s * t, mpmath.sin(t0 + t) - s] for t in span]
    missed = np.abs(np.asarray(found.ys) - np.array(exact, float)).max()
    assert missed > 1e-12  # a thousand spacings of the state
    assert 0.2 < found.error.max() / missed < 5

    def run(scene, tolerance, noise):
        at = {"rtol": tolerance[0], "solver": VERNER9, "noise": noise}
        return solve(scene, t0 + 30, t0=t0, ts=t0 + span, **at)

    own = errors.rounding(run, scene, np.asarray(found.ys), np.array([1e-13]), draws=8)
    assert 0.2 < own.max() / missed < 5
    # Times are rounded independently, so a thousand times as many steps lose fewer digits.
    assert found.rounding.max() < 0.5 * missed


def test_plain_sums_are_rounded_as_states_are():
    """Steps are so short that rounding is their only error, and their sums are not compensated."""
    scene, t1 = scenes.oscillator(), 1.0
    plain = fixed_steps(scene, t1, steps=100_000, method=VERNER9)
    moved = [
        fixed_steps(scene, t1, steps=100_000, method=VERNER9, noise=noise(1e-9, seed)) - plain
        for seed in range(3)
    ]
    model = 0.5 * np.finfo(float).eps / 1e-9 * float(np.sqrt(np.mean(np.square(moved))))
    missed = gap(plain, np.array([np.cos(1.0), -np.sin(1.0)]))
    assert SOLVED > missed > 10 * np.finfo(float).eps
    assert 0.1 < model / missed < 10
    assert errors.FINEST < model
