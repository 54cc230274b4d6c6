"""Problem 24: the awkward coordinate agrees with the angle up to its edge, which is an event."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap

from jaxdyn import Status, simulate
from jaxdyn.integrate import events
from jaxdyn.scenes import pendulum, sideways_edge, sideways_pendulum

NOW = jnp.zeros(())


def test_sideways_pendulum_swings_as_the_angle_does():
    sideways = simulate(sideways_pendulum(), samples=9, rtol=1e-13)
    angle = simulate(pendulum(), samples=9, rtol=1e-13)
    assert gap(sideways["x"], jnp.sin(angle["theta"])) < 1e-10
    # x'' from x^2 + y^2 = l^2, by hand, of l = 1.
    x, v, y = 0.6, 0.7, -0.8
    by_hand = -x * (v * v / y**2 + 9.81 * -y)
    scene = sideways_pendulum()
    assert gap(scene.rate(NOW, jnp.array([x, v]))[1], by_hand) < EXACT * 20


def test_sideways_pendulum_ends_with_a_status_at_its_edge():
    fast = simulate(sideways_pendulum(rate=6.0), samples=9, throw=False)
    assert int(fast.status) == Status.STEP_COLLAPSED
    assert bool(jnp.isnan(fast.ys[-1]).all())
    beyond = simulate(sideways_pendulum().starting([1.2, 0.0]), samples=9, throw=False)
    assert int(beyond.status) == Status.NOT_FINITE
    assert bool(jnp.isnan(beyond.ys[-1]).all())


@pytest.mark.slow
@pytest.mark.parametrize(("margin", "tolerance"), [(0.3, 1e-13), (1e-3, 1e-12), (1e-4, 1e-10)])
@pytest.mark.parametrize("side", [1, -1])
def test_the_edge_is_where_the_angle_says(margin, tolerance, side):
    numbers = {"length": 0.8, "g": 5.0, "angle": side * 0.4, "rate": side * 6.0}
    stop = sideways_edge(sideways_pendulum(**numbers), margin=margin, rtol=1e-14)
    assert stop.happened
    level = events.Reaches(0, side * np.arccos(margin), side)
    by_angle = events.until(pendulum(**numbers), level, rtol=1e-14)
    assert abs(float(stop.t - by_angle.t)) < tolerance
    theta, rate = by_angle.y
    there = 0.8 * jnp.stack([jnp.sin(theta), jnp.cos(theta) * rate])
    assert gap(stop.y, there) < tolerance


def test_a_swing_that_stays_below_has_no_edge():
    stop = sideways_edge(sideways_pendulum(angle=1.4), 5.0)
    assert not stop.happened
    assert float(stop.t) == 5.0


@pytest.mark.slow
def test_the_time_of_the_edge_is_differentiable():
    def time(rate):
        return sideways_edge(sideways_pendulum(rate=rate), margin=0.3, rtol=1e-13).t

    def time_by_angle(rate):
        level = events.Reaches(0, np.arccos(0.3), 1)
        return events.until(pendulum(rate=rate), level, rtol=1e-13).t

    assert abs(float(jax.grad(time)(6.0) - jax.grad(time_by_angle)(6.0))) < 1e-10


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sideways_edge(pendulum()), "scene: expected a sideways_pendulum"),
        (
            lambda: sideways_edge(sideways_pendulum(), margin=1.0),
            "margin: expected between 0 and 1",
        ),
    ],
)
def test_what_the_edge_refuses(call, message):
    with pytest.raises(ValueError, match=message):
        call()
