"""At which comparisons a rate is proved to be continuous, and what follows for its motions."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn.plan import plan_of

NUMBERS = {"k": 10.0, "c": 0.3, "gap": 0.1}


def _length(e):
    return jnp.sqrt(e.x * e.x + e.v * e.v)


class _Names:
    def __init__(self, t, y, p):
        self.t, self.x, self.v = t, y[0], y[1]
        self.k, self.c, self.gap = p["k"], p["c"], p["gap"]
        self.d = jnp.stack([self.x, self.x - self.gap, self.x + self.v])


def _scene(force, numbers=NUMBERS, start=(1.0, 0.2), t1=5.0):
    def rate(t, y, p):
        return jnp.array([y[1], force(_Names(t, y, p))])

    return jaxdyn.ode(rate, list(start), t1, params=numbers)


def _plan(force):
    return plan_of(_scene(force).field, 2)


CONTINUOUS = {
    "contact": lambda e: jnp.where(e.x < 0, -e.k * e.x, 0.0),
    "contact, the other way round": lambda e: jnp.where(e.x >= 0, 0.0, -e.k * e.x),
    "contact beyond a gap": lambda e: jnp.where(e.x < e.gap, -e.k * (e.x - e.gap), 0.0),
    "contact at -gap": lambda e: jnp.where(e.x > -e.gap, 0.0, -e.k * (e.x + e.gap)),
    "cubic": lambda e: jnp.where(e.x - e.gap < 0, -e.k * (e.x - e.gap) ** 3, 0.0),
    "Hunt and Crossley": lambda e: jnp.where(e.x < 0, -e.k * e.x * (1 + e.c * e.v), 0.0),
    "two stiffnesses": lambda e: -jnp.where(e.x > 0, e.k, e.c) * e.x,
    "two lines": lambda e: -jnp.where(e.x < e.gap, e.k * e.x, e.k * e.gap + e.c * (e.x - e.gap)),
    "outcome as a factor": lambda e: (e.x < 0).astype(float) * (-e.k * e.x),
    "rope": lambda e: jnp.where(
        _length(e) > e.gap, -e.k * (_length(e) - e.gap) * e.x / _length(e), 0.0
    ),
    "rope by a ratio": lambda e: jnp.where(
        jnp.hypot(e.x, e.v) > e.gap, -e.k * (1 - e.gap / jnp.hypot(e.x, e.v)) * e.x, 0.0
    ),
    "drag": lambda e: jnp.where(e.v < 0, e.c * e.v**2, -e.c * e.v**2),
    "gradient of a potential": lambda e: (
        -jax.grad(lambda x: jnp.where(x < 0, 0.5 * e.k * x**2, 0.0))(e.x)
    ),
    "dead zone": lambda e: (
        -e.k * jnp.where(e.x > 0.1, e.x - 0.1, jnp.where(e.x < -0.1, e.x + 0.1, 0.0))
    ),
    "dead zone by select": lambda e: (
        -e.k * jnp.select([e.x > 0.1, e.x < -0.1], [e.x - 0.1, e.x + 0.1], 0.0)
    ),
    "entries of an array": lambda e: jnp.sum(jnp.where(e.d < 0, -e.k * e.d, 0.0)),
    "both conditions": lambda e: jnp.where((e.x < 0) & (e.v < 0), e.k * e.x * e.v, 0.0),
}

JUMPING = {
    "damper that lets go": lambda e: jnp.where(e.x < 0, -e.k * e.x - e.c * e.v, 0.0),
    "two stiffnesses beside the origin": lambda e: -jnp.where(e.x > e.gap, e.k, e.c) * e.x,
    "friction": lambda e: -e.c * jnp.where(e.v > 0, 1.0, -1.0),
    "preload": lambda e: (e.x < 0).astype(float) * (-e.k * e.x - e.c),
    "dead zone whose width may be negative": lambda e: jnp.where(
        e.x > e.gap, e.x - e.gap, jnp.where(e.x < -e.gap, e.x + e.gap, 0.0)
    ),
    "zero times infinity": lambda e: jnp.where(e.x < 0, e.x * (1 / e.x), 0.0),
    "whole numbers": lambda e: jnp.where(e.x < 0, 0.0, e.x + (e.x + 0.5).astype(int).astype(float)),
    "an inner choice at the same place": lambda e: jnp.where(
        e.x < 0.1, e.k, jnp.where(e.x <= 0.1, e.k, e.c)
    ),
    "another use of the outcome": lambda e: (
        jnp.where(e.x < 0, -e.k * e.x, 0.0) + jnp.where(e.x < 0, e.c, 0.0)
    ),
    "entries of an array in another order": lambda e: jnp.sum(
        jnp.where(e.d < 0, -e.k * e.d[::-1], 0.0)
    ),
    "a length of zero": lambda e: jnp.where(e.x < e.gap, (e.x - e.gap) / e.x, 0.0),
    "lax.cond": lambda e: jax.lax.cond(e.x < 0, lambda: -e.c, lambda: 0.0),
}


@pytest.mark.parametrize("name", CONTINUOUS)
def test_continuous_rates_have_no_surface_to_slide_on(name):
    plan = _plan(CONTINUOUS[name])
    assert plan.on_state
    assert plan.most_surfaces == 0


@pytest.mark.parametrize("name", JUMPING)
def test_other_rates_may_jump(name):
    assert _plan(JUMPING[name]).most_surfaces > 0


def test_of_two_conditions_only_the_one_that_jumps_is_a_surface():
    plan = _plan(lambda e: jnp.where((e.x < 0) & (e.v < 0), -e.k * e.x, 0.0))
    np.testing.assert_array_equal(plan.jumping, [1])


@pytest.mark.parametrize("name", CONTINUOUS)
def test_what_is_proved_holds_for_other_numbers(name):
    """Along lines through the state no step of 1e-9 changes the force by more than a continuous
    one can, which is 1e-4 for the steepest of them, a root."""
    draw = np.random.default_rng(4)

    @jax.jit
    @functools.partial(jax.vmap, in_axes=(0, None, None))
    def evaluate(x, numbers, line):
        return CONTINUOUS[name](_Names(0.0, line[0] + x * line[1], numbers))

    x = np.linspace(-1.0, 1.0, 2001)
    for _ in range(10):
        given = dict(zip(NUMBERS, draw.normal(size=3), strict=True)), draw.normal(size=(2, 2))
        low, high = x[:-1], x[1:]
        for _ in range(25):  # halve each interval, and keep the half in which the force changes
            middle = 0.5 * (low + high)
            below, at, above = (evaluate(x, *given) for x in (low, middle, high))
            left = np.abs(at - below) > np.abs(above - at)
            low, high = np.where(left, low, middle), np.where(left, middle, high)
        assert np.nanmax(np.abs(evaluate(high, *given) - evaluate(low, *given))) < 1e-4


@pytest.mark.parametrize("name", ["dead zone", "dead zone by select"])
def test_period_in_a_dead_zone(name):
    """Half an oscillation at each end, and the way between them at constant speed."""
    rate = np.sqrt(NUMBERS["k"])
    period = 2 * np.pi / rate + 4 * 0.1 / (0.9 * rate)
    run = jaxdyn.simulate(_scene(CONTINUOUS[name], start=(1.0, 0.0), t1=period))
    np.testing.assert_allclose(run.ys[-1], [1.0, 0.0], atol=1e-11)


def test_slope_of_a_period_with_two_stiffnesses():
    """The state after the period pi / sqrt(k) + pi / sqrt(c) moves by -acceleration times its
    change, here with k."""
    k, c = NUMBERS["k"], NUMBERS["c"]
    period = np.pi / np.sqrt(k) + np.pi / np.sqrt(c)

    def end(k):
        numbers = NUMBERS | {"k": k}
        scene = _scene(CONTINUOUS["two stiffnesses"], numbers, start=(1.0, 0.0), t1=period)
        return jaxdyn.simulate(scene).ys[-1]

    np.testing.assert_allclose(end(k), [1.0, 0.0], atol=1e-11)
    slope = -k * np.pi / (2 * k**1.5)  # the force -k times minus the change of the period
    np.testing.assert_allclose(jax.jacfwd(end)(k), [0.0, slope], atol=1e-10)


AT_REST = {
    "where v == 0": lambda e: jnp.where(e.v == 0, 5.0, 3.0) * jnp.sign(e.v),
    "where v - k == 0": lambda e: jnp.where(e.v - e.k == 0, 5.0, 3.0) * jnp.sign(e.k - e.v),
    "where v != k": lambda e: jnp.where(e.v != e.k, 3.0, 5.0) * jnp.where(e.v < e.k, -1.0, 1.0),
}
ELSEWHERE = {
    "friction": lambda e: -3.0 * jnp.sign(e.v),
    "a length that may be 0": lambda e: -3.0 * e.v / jnp.where(_length(e) == 0, 1.0, _length(e)),
    "another surface": lambda e: jnp.where(e.x == 0, 5.0, 3.0) * jnp.sign(e.v),
    "a contact": lambda e: jnp.where(e.x == 0, 0.0, jnp.where(e.x < 0, -e.k * e.x, 0.0)),
    "of time": lambda e: jnp.mod(e.t, 1.0),  # whose program compares with 0
    "of a number": lambda e: jnp.where(e.k == 0, 5.0, 3.0) * jnp.sign(e.v),
}


@pytest.mark.parametrize(
    ("name", "asks"), [*((x, True) for x in AT_REST), *((x, False) for x in ELSEWHERE)]
)
def test_a_value_on_a_surface_at_which_the_rate_jumps_is_noticed(name, asks):
    plan = _plan((AT_REST | ELSEWHERE)[name])
    assert plan.distinguishes == asks
    assert ("friction that is larger at rest" in plan.caveat) == asks
