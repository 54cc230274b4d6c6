"""No unit matters: curves of special orbits in two parameters are the same in all units."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from orbits import PLAIN, Kind, Orbit, Outcome

#: Units of the entries of the state, of the parameters, and of time.
UNITS = [
    ([1e6, 1e-3, 1e-9], [1e9, 1e-7], 1e-6),
    ([1e-9, 1e-9, 1e-9], [1e-12, 1e12], 1e6),
    ([1e9, 2e12, 1e-12], [3e7, 1e9], 1e12),
]
PLAIN_UNITS = ([1.0, 1.0, 1.0], [1.0, 1.0], 1.0)
SAME = 1e-9


def carried(t, y, p, q):
    """Bogdanov and Takens's normal form about a point that moves round a circle."""
    u, v = y[0] - jnp.cos(t), y[1] - jnp.sin(t)
    return [v - jnp.sin(t), p + q * u + u**2 - u * v + jnp.cos(t)]


def cusped(t, y, p, q):
    """Cycles with folds at 27 p^2 = 4 q^3."""
    x, u, z = y
    r = 0.2 * (1 - x**2 - u**2)
    return [r * x - (1 + z) * u, r * u + (1 + z) * x, p + q * z - z**3]


def shaken(t, y, a, q):
    """A pendulum on a shaken pivot, damped."""
    return [y[1], -(a - 2 * q * jnp.cos(2 * t)) * jnp.sin(y[0]) - 0.01 * y[1]]


def follow(rate, units, y0, period, parameters, **options):
    k = len(y0)
    each, own, time = np.array(units[0][:k]), np.array(units[1]), units[2]

    def scaled(t, y, numbers):
        values, each, time = numbers
        return each * jnp.stack(rate(t / time, y / each, *values)) / time

    def make(p, q):
        values = jnp.stack([p / own[0], q / own[1]])
        return jaxdyn.ode(scaled, np.zeros(k), period * time, params=(values, each, time))

    both = own * np.array(parameters)
    scene = make(*jnp.asarray(both)).starting(each * np.array(y0), period * time)
    orbit = Orbit(scene, PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)
    return orbits.continue_curve(make, orbit, tuple(both), **options)


def assert_alike(there, here, units):
    k = len(here.members[0].orbit.y0)
    each, own, time = np.array(units[0][:k]), np.array(units[1]), units[2]
    assert len(there.members) == len(here.members)
    assert (there.end, there.before) == (here.end, here.before)
    np.testing.assert_allclose(there.parameters / own, here.parameters, atol=SAME)
    np.testing.assert_allclose(there.periods / time, here.periods, rtol=SAME)
    for one, other in zip(there.points, here.points, strict=True):
        assert (one.kind, one.orbit.iterations) == (other.kind, other.orbit.iterations)
        start = np.asarray(other.orbit.y0)
        np.testing.assert_allclose(np.asarray(one.orbit.y0) / each, start, atol=SAME)
        values = other.multipliers.values
        np.testing.assert_allclose(one.multipliers.values, values, atol=1e-6)
        assert one.residual < 1e-10


SLOW = [UNITS[0], *(pytest.param(x, marks=pytest.mark.slow) for x in UNITS[1:])]


@pytest.mark.slow
@pytest.mark.parametrize("units", SLOW)
def test_torus_points_and_resonances(units):
    of = {"y0": [1.0, 0.0], "period": 2 * np.pi, "parameters": (0.0, -0.2)}
    of |= {"kind": Kind.TORUS, "step": 0.08}
    here, there = (follow(carried, u, **of) for u in (PLAIN_UNITS, units))
    assert_alike(there, here, units)
    kinds = ["1:3 resonance", "1:4 resonance", "1:1 resonance"]
    assert [x.kind for x in there.special] == kinds
    found = [x.parameters[1] / units[1][1] for x in there.special]
    np.testing.assert_allclose(found, [-1 / 9, -1 / 16, 0.0], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_folds_of_cycles_and_their_cusp(units):
    z = 0.3
    of = {"y0": [1.0, 0.0, z], "period": 2 * np.pi / (1 + z)}
    of |= {"parameters": (-2 * z**3, 3 * z**2), "kind": Kind.FOLD, "down": True, "step": 0.1}
    here, there = (follow(cusped, u, **of, members=9) for u in (PLAIN_UNITS, units))
    assert_alike(there, here, units)
    (cusp,) = there.special
    assert cusp.kind == "cusp"
    np.testing.assert_allclose(cusp.parameters / units[1], 0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_doublings_of_a_rest(units):
    of = {"y0": [0.0, 0.0], "period": np.pi, "parameters": (1.25, 0.27), "kind": Kind.DOUBLING}
    here, there = (follow(shaken, u, **of, members=5) for u in (PLAIN_UNITS, units))
    assert_alike(there, here, units)
