"""Connections of equilibria: closed forms, a published parameter, and another route to it."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from jaxdyn import scenes

#: Homoclinic to the origin of the Lorenz system at sigma = 10, beta = 8/3: Sparrow (1982), The
#: Lorenz Equations, 13.926; Doedel, Krauskopf & Osinga (2006), Nonlinearity 19, 2947, 13.9265.
SPARROW = 13.926
ORIGIN = np.zeros(3)
UPRIGHT = scenes.pendulum().starting([-math.pi, 0.0])


def lorenz(rho):
    return scenes.lorenz(rho=rho, y0=ORIGIN)


def turned(rho):
    """The side (+1 or -1) to which SciPy's motion from the origin turns at its first return."""
    s, b = 10.0, 8 / 3

    def rate(t, y):
        return [s * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - b * y[2]]

    grows = (-(s + 1) + math.sqrt((s + 1) ** 2 + 4 * s * (rho - 1))) / 2
    v = np.array([1, 1 + grows / s, 0]) / math.hypot(1, 1 + grows / s)

    def away(t, y):
        return abs(y[0]) - 3.0 if t > 3 else -1.0

    away.terminal = True
    e = 1e-6
    # On the manifold z = c e^2 to second order.
    z = v[0] * v[1] * e**2 / (2 * grows + b)
    run = solve_ivp(rate, (0, 40), [*(e * v[:2]), z], "DOP853", events=away, rtol=1e-13, atol=1e-16)
    return math.copysign(1.0, run.y_events[0][0][0])


def bisected():
    low, high = 13.9, 13.95
    sides = turned(low)
    assert turned(high) != sides
    while high - low > 2e-11:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if turned(middle) == sides else (low, middle)
    return 0.5 * (low + high)


@pytest.fixture(scope="module")
def separatrix():
    return orbits.connect(UPRIGHT, [math.pi, 0.0])


@pytest.mark.slow
def test_the_separatrix_of_a_pendulum(separatrix):
    assert separatrix.ok
    assert separatrix.residual < 1e-12
    theta, speed = separatrix.states.T
    w = abs(jaxdyn.linearize(separatrix.scene, [0.0, 0.0]).eigenvalues[0])
    assert np.abs(speed - 2 * w * np.cos(theta / 2)).max() < 10 * separatrix.error
    # theta = 4 atan(exp(w t)) - pi, with t = 0 half way.
    t = separatrix.ts - 0.5 * separatrix.time
    exact = 4 * np.arctan(np.exp(w * t)) - np.pi
    np.testing.assert_allclose(theta, exact, rtol=0, atol=10 * separatrix.error)
    assert math.isnan(separatrix.parameter)


@pytest.mark.slow
def test_numbers_are_printed(separatrix):
    text = str(separatrix)
    for part in ("Heteroclinic connection of pendulum", "time", "step-off", "residual", "FOUND"):
        assert part in text


@pytest.mark.slow
def test_the_homoclinic_orbit_of_lorenz_by_another_route():
    found = orbits.connect(lorenz(14.0), ORIGIN, make=lorenz, parameter=14.0)
    assert found.ok
    assert found.residual < 1e-12
    assert abs(found.parameter - SPARROW) < 1e-3
    assert abs(found.parameter - 13.926557407) < 1e-9
    assert abs(found.parameter - bisected()) < 1e-10 + found.parameter_error
    assert found.parameter_error < 1e-8
    other = orbits.connect(lorenz(14.0), ORIGIN, make=lorenz, parameter=14.0, branch="-")
    assert abs(other.parameter - found.parameter) < found.parameter_error + other.parameter_error
    mirrored = other.states * [-1, -1, 1]
    np.testing.assert_allclose(mirrored, found.states, rtol=0, atol=1e-6)


def pushed(mu):
    return jaxdyn.ode(lambda t, y, mu: [y[1], y[0] - y[0] ** 2 + mu * y[1]], [0, 0.0], params=mu)


@pytest.mark.slow
@pytest.mark.parametrize("mu", [-0.1, 0.1])
def test_a_strand_that_comes_near_and_goes_elsewhere_is_a_guess(mu):
    # With -0.1 it falls into x = 1, with 0.1 it goes to infinity in finite time; with 0 it returns.
    found = orbits.connect(pushed(mu), np.zeros(2), make=pushed, parameter=mu)
    assert found.ok
    assert abs(found.parameter) < 1e-13
    assert_allclose(np.max(found.states[:, 0]), 1.5, rtol=1e-4)  # x^2 / 2 = x^3 / 3


@pytest.mark.slow
def test_a_parameter_that_energy_leaves_free_is_not_found():
    def longer(length):
        return scenes.pendulum(length=length).starting([-math.pi, 0.0])

    found = orbits.connect(longer(1.0), [math.pi, 0.0], make=longer, parameter=1.0)
    assert found.outcome == orbits.manifolds.ConnectionOutcome.DEPENDENT
    assert math.isnan(found.parameter)
    assert "Leave out `make`" in found.message


def runaway(t, y):
    return jnp.stack([y[1], y[0] + y[0] ** 3])


RUNAWAY = jaxdyn.ode(runaway, [0.0, 0.0], 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("a", "b", "options", "outcome", "said"),
    [
        (lorenz(13.9), ORIGIN, {}, "NO_CONVERGENCE", "closer to it"),
        (lorenz(1.3), ORIGIN, {}, "NO_APPROACH", "does not come closer"),
        (RUNAWAY, [0.0, 0.0], {}, "MOTION_ENDS", "Take a shorter time"),
        (UPRIGHT, [math.pi, 0.0], {"error": 1e-40}, "ERROR_LIMIT", "Ask for a larger error"),
    ],
)
def test_no_connection_is_an_outcome(a, b, options, outcome, said):
    found = orbits.connect(a, b, **options)
    assert found.outcome.name == outcome
    assert said in found.message
    assert math.isnan(found.time)
    assert not len(found.states)
    assert outcome in str(found)


@pytest.mark.parametrize(
    ("a", "b", "options", "said"),
    [
        (lorenz(14.0), ORIGIN, {"make": lorenz}, "parameter: expected given together"),
        (lorenz(14.0), ORIGIN, {"branch": "up"}, "branch: expected"),
        (lorenz(14.0), ORIGIN, {"error": -1.0}, "error: expected > 0"),
        (lorenz(14.0), ORIGIN, {"segments": 1}, "segments: expected"),
        (lorenz(14.0), ORIGIN, {"time": 0.0}, "time: expected > 0"),
        (lorenz(14.0), np.zeros(2), {}, "b: expected shape"),
        (lorenz(0.5), ORIGIN, {}, "one unstable eigenvalue"),
        (
            lorenz(14.0),
            [math.sqrt(104 / 3), math.sqrt(104 / 3), 13.0],
            {"make": lorenz, "parameter": 14.0},
            "not stable",
        ),
        (UPRIGHT, [0.0, 0.0], {}, "b: expected an equilibrium with a stable eigenvalue"),
        (
            scenes.pendulum(g=0.0),
            [0.0, 0.0],
            {},
            "a: expected a state near an isolated equilibrium",
        ),
        (scenes.pinned_chain(), np.zeros(2), {}, "a: expected a scene without constraints"),
        (scenes.shaken_pendulum(angle=0.0), np.zeros(2), {}, "a: expected an autonomous scene"),
    ],
)
def test_misuse_is_refused(a, b, options, said):
    with pytest.raises(ValueError, match=said):
        orbits.connect(a, b, **options)
