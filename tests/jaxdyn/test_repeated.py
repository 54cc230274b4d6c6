"""Functions that draw random numbers or read a clock are refused, wherever they are given."""

import random
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import scenes
from jaxdyn.integrate import events

_RNG = np.random.default_rng(0)
DRAWN = {
    "numpy": lambda: np.random.normal(),
    "python": lambda: random.random(),
    "generator": lambda: _RNG.normal(),
    "generator of arrays": lambda: _RNG.normal(size=1)[0],
    "new generator": lambda: np.random.default_rng().normal(),
    "clock": lambda: time.perf_counter(),
}
MESSAGE = (
    r"expected a function of its arguments alone, got one that gives other numbers when it is "
    r"called again\. What it draws at random or reads from a clock would be the same in every step"
)


@pytest.mark.parametrize("draw", DRAWN.values(), ids=DRAWN.keys())
def test_a_rate_that_draws_is_refused(draw):
    with pytest.raises(ValueError, match=rf"^Ode\.rate: {MESSAGE}: draw it before"):
        jaxdyn.ode(lambda t, y: -y + draw(), [1.0])


class Shaken(jaxdyn.Effect):
    velocity_dependent = False

    def force(self, t, r, v, m):
        return r * random.random()


class Wandering(jaxdyn.System):
    def labels(self):
        return (("y", "1"),)

    def rate(self, t, y, effects):
        return y + random.random()


def test_so_are_effects_systems_and_events():
    with pytest.raises(ValueError, match=rf"^Shaken\.force: {MESSAGE}"):
        jaxdyn.simulate(scenes.oscillator() + Shaken(), 1.0)
    with pytest.raises(ValueError, match=rf"^Wandering\.rate: {MESSAGE}"):
        jaxdyn.simulate(jaxdyn.Scene(Wandering(), y0=[1.0]), 1.0)
    drawn = events.When(lambda t, y: y[0] - random.random())
    with pytest.raises(ValueError, match=rf"^When\.value: {MESSAGE}"):
        jaxdyn.until(scenes.oscillator(), drawn, 1.0)


COUNTED = {"calls": 0}


def _counting(t, y):
    COUNTED["calls"] += 1
    return -y


def _in_branches(t, y):
    return jnp.where(y > 0, jax.nn.relu(-y), jax.lax.cond(t > 0, jnp.sin, jnp.cos, y))


def _from_a_seed(t, y):
    return -y * np.random.default_rng(0).normal(size=1)


@pytest.mark.parametrize("rate", [_counting, _in_branches, _from_a_seed])
def test_what_gives_the_same_numbers_is_taken(rate):
    assert jaxdyn.ode(rate, [1.0]).second_order is False
