"""Events whose value is flat where it is zero, in any unit: the sign decides, not the size."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED

import jaxdyn
from jaxdyn import ensemble, ode, scenes
from jaxdyn.ensemble.crossings import EachCrossing
from jaxdyn.integrate.events import Event, Reaches, When, until

G = 10.0
BALL = scenes.cannonball(g=G).starting([0.0, 1.0, 3.0, 7.0])
LANDING = (7 + np.sqrt(49 + 2 * G)) / G
LEVEL = 1.7
PASSED = (7 - np.sqrt(49 + 2 * G * (1 - LEVEL))) / G


class Power(Event):
    """scale (y - level)^n, with the sign kept for even n."""

    n: int
    level: jax.Array
    scale: jax.Array

    def value(self, t, y):
        x = y[1] - self.level
        return self.scale * x * jnp.abs(x) ** (self.n - 1)


def power(n, level=0.0, scale=1.0):
    return Power(n, jnp.asarray(level), jnp.asarray(scale))


def fifth_power(t, y):
    del t
    return y[0] ** 5


def expanded_cube(t, y):
    """(y - 1)^3, with rounding of 1e-16: so y is known to 1e-5."""
    del t
    x = y[1]
    return ((x - 3.0) * x + 3.0) * x - 1.0


@pytest.mark.sample(
    "1-1.0",
    "1-1000000000000.0",
    "2-1.0",
    "2-1000000000000.0",
    "9-1.0",
    "9-1000000000000.0",
)
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize("n", [1, 2, 3, 5, 9])
def test_a_flat_event_is_found_to_rounding_of_the_state(n, scale):
    stop = until(BALL, power(n, 0.0, scale), 9.0)
    assert abs(stop.t - LANDING) < EXACT
    assert 0 <= stop.y[1] < 100 * EXACT  # not beyond the floor
    stop = until(BALL, power(n, LEVEL, scale), 9.0)
    assert abs(stop.t - PASSED) < EXACT
    assert -100 * EXACT < stop.y[1] - LEVEL <= 0


@pytest.mark.slow
def test_the_fifth_power_of_a_falling_height():
    fall = ode(free_fall, [100.0, 0.0], 9.0)
    stop = until(fall, When(fifth_power))
    assert abs(stop.t - np.sqrt(20.0)) < EXACT
    assert 0 <= stop.y[0] < 1e3 * EXACT


def free_fall(t, y):
    """A fall from rest."""
    del t
    return jnp.stack([y[1], jnp.full_like(y[0], -10.0)])


@pytest.mark.slow
def test_a_value_with_rounding_of_its_own_is_found_within_it():
    stop = until(BALL.starting([0.0, 3.0, 1.0, 0.0]), When(expanded_cube), 9.0)
    assert abs(stop.t - np.sqrt(2 * 2 / G)) < 1e-5


@pytest.mark.parametrize("n", [3, 5])
def test_shallow_dips_of_a_flat_value_are_found(n):
    top = 1 + 49 / (2 * G)
    for below in (1e-2, 1e-6, 1e-10):
        stop = until(BALL, power(n, top - below), 9.0, rtol=1e-6)
        assert abs(stop.t - (0.7 - np.sqrt(2 * below / G))) < 1e-15 / np.sqrt(below) + SOLVED
    assert not until(BALL, power(n, top + 1e-12), 9.0).happened


@pytest.mark.slow
def test_flat_events_backwards_in_jit_and_in_batches():
    start = BALL.starting([0.0, 1.0, 1.0, 1.0])
    stop = until(start, power(3), -9.0)
    assert abs(stop.t - (1 - np.sqrt(1 + 2 * G)) / G) < EXACT
    assert stop.y[1] >= 0
    levels = jnp.array([0.5, LEVEL, 3.0])
    found = jax.jit(jax.vmap(lambda level: until(BALL, Power(5, level, level), 9.0).t))(levels)
    assert np.abs(found[1] - PASSED) < EXACT
    alone = [until(BALL, power(5, level, level), 9.0).t for level in levels]
    assert np.max(np.abs(found - jnp.stack(alone))) < EXACT


@pytest.mark.slow
def test_derivatives_at_a_flat_event_are_those_of_the_motion_or_no_number():
    slope = jax.grad(lambda v: until(BALL.starting(jnp.stack([0.0, 1.0, 3.0, v])), power(3), 9.0).t)
    exact = LANDING / np.sqrt(49 + 2 * G)
    assert abs(slope(7.0) - exact) < SOLVED


@pytest.mark.slow
def test_flat_crossings_are_all_found_with_their_directions():
    scene = scenes.oscillator(k=1.0, m=1.0, x=1.0, v=0.0)
    plain = jaxdyn.crossings(scene, Reaches(0, 0.3), 20.0)
    flat = jaxdyn.crossings(scene, When(cube_above), 20.0)
    np.testing.assert_array_equal(flat.directions, plain.directions)
    assert np.max(np.abs(flat.ts - plain.ts)) < SOLVED
    n = len(plain.ts)
    watch = EachCrossing(scene.field, When(cube_above), jnp.asarray(n), n)
    lanes = ensemble.run(scene, jnp.stack([scene.y0, scene.y0]), 20.0, watch=watch).seen
    np.testing.assert_array_equal(lanes.directions[1], plain.directions)
    assert np.max(np.abs(lanes.ts[1] - plain.ts)) < SOLVED


def cube_above(t, y):
    del t
    return (y[0] - 0.3) ** 3
