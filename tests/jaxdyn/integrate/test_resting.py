"""Crossings of values that friction holds at zero for a while, in closed form."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import gap

import jaxdyn
from jaxdyn.integrate.events import Reaches, until


def pushed(t, y, p):
    """A block with dry friction f under the force cos(t) + b."""
    b, f = p
    return [y[1], jnp.cos(t) + b - f * jnp.sign(y[1])]


def found(x, way=0, t1=7.0):
    """The crossings of its velocity, which is x[2] at the start."""
    block = jaxdyn.ode(pushed, jnp.stack([0.0, x[2]]), 20.0, params=x[:2])
    return jaxdyn.crossings(block, Reaches(1, 0.0, way), t1, most=6)


def lands(x):
    """When it first stops, by Newton's method from between its start and the time after it."""
    b, f, v = x
    t = jnp.asarray(2.5)
    for _ in range(30):
        t = t - (v + jnp.sin(t) + (b - f) * t) / (jnp.cos(t) + b - f)
    return t


@pytest.mark.parametrize("way", [0, 1, -1])
def test_a_block_that_returns_crosses_back_when_it_is_let_go(way):
    # The force holds it up to cos(t) + b = f, and drives it in the same direction as before.
    for b, f, v in ((0.5, 0.8, 0.4), (0.45, 0.8, 0.1), (0.5, 0.81, 0.4 + 1e-9)):
        x = jnp.array([b, f, v])
        times = np.array([lands(x), 2 * np.pi - np.arccos(f - b)])
        kept = {0: slice(0, 2), 1: slice(1, 2), -1: slice(0, 1)}[way]
        crossed = found(x, way, 5.5)
        n = len(times[kept])
        assert int(crossed.count) == n
        assert crossed.directions[:n].tolist() == [-1, 1][kept]
        assert gap(crossed.ts[:n], times[kept]) < 1e-10


def test_a_block_that_goes_on_to_the_other_side_has_crossed_once():
    # The force is below -f from cos(t) = -f on.
    x = jnp.array([0.0, 0.8, 0.5])
    crossed = found(x, t1=4.0)
    assert crossed.directions.tolist() == [-1, 0, 0, 0, 0, 0]
    assert gap(crossed.ts[0], lands(x)) < 1e-10


@pytest.mark.parametrize("way", [0, 1, -1])
def test_a_block_that_starts_held_has_left(way):
    def rate(t, y, p):
        return [y[1], t - p * jnp.sign(y[1])]

    block = jaxdyn.ode(rate, [0.0, 0.0], 2.0, params=0.5)
    assert not until(block, Reaches(1, 0.0, way), 2.0).happened


@pytest.mark.slow
def test_derivatives_of_the_times_at_which_it_stops_and_is_let_go():
    x = jnp.array([0.5, 0.8, 0.4])
    slopes = jax.jit(jax.jacfwd(lambda x: found(x, t1=5.5).ts))(x)
    # cos(t) = f - b there
    free = np.array([-1.0, 1.0, 0.0]) / np.sqrt(1 - 0.3**2)
    assert gap(slopes[0], jax.jacfwd(lands)(x)) < 1e-8
    assert gap(slopes[1], free) < 1e-10
    assert (slopes[2:] == 0).all()
