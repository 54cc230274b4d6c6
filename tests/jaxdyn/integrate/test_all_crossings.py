"""jaxdyn.crossings: all crossings of a motion, with their derivatives."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap, refusal
from odes import lorenz

import jaxdyn
from jaxdyn import Status, scenes
from jaxdyn.integrate.events import Event, Every, Reaches, until

TIGHT = {"rtol": 1e-13}
RISES, FALLS, BOTH = (Reaches(0, 0.0, way) for way in (1, -1, 0))
SWING = scenes.oscillator(k=4.0, m=1.0)  # x = cos 2t


def released(k, t1=9.0):
    """The crossings of an oscillator of stiffness k and mass 1 that is released at x = 1."""
    swing = scenes.oscillator(k=k, m=1.0)
    return jaxdyn.crossings(swing, BOTH, t1, most=8, **TIGHT)


@pytest.mark.slow
def test_an_oscillator_crosses_every_half_period_in_turn():
    found = jaxdyn.crossings(SWING, BOTH, 9.0, **TIGHT)
    times = (np.arange(6) + 0.5) * np.pi / 2
    assert gap(found.ts, times) < SOLVED
    assert gap(found.ys, np.stack([0 * times, -2 * np.sin(2 * times)], -1)) < SOLVED
    assert found.directions.tolist() == [-1, 1] * 3
    assert (int(found.count), found.status) == (6, Status.OK)
    assert found.message.startswith("6 crossings.")
    for event, kept in ((FALLS, slice(0, None, 2)), (RISES, slice(1, None, 2))):
        assert gap(jaxdyn.crossings(SWING, event, 9.0, **TIGHT).ts, times[kept]) < SOLVED


def test_backwards_in_time_the_directions_are_those_along_the_motion():
    found = jaxdyn.crossings(SWING, BOTH, -4.0, **TIGHT)
    assert gap(found.ts, -(np.arange(3) + 0.5) * np.pi / 2) < SOLVED
    assert found.directions.tolist() == [-1, 1, -1]


def test_more_crossings_than_one_call_of_the_program_finds():
    found = jaxdyn.crossings(SWING, BOTH, 250.0, **TIGHT)
    assert gap(found.ts, (np.arange(159) + 0.5) * np.pi / 2) < 100 * SOLVED  # rounding grows with t


def test_a_start_on_the_event_is_no_crossing_and_a_motion_without_one_has_none():
    at_zero = SWING.starting([0.0, 1.0])
    assert (
        gap(jaxdyn.crossings(at_zero, BOTH, 4.0, **TIGHT).ts, np.pi / 2 * np.arange(1, 3)) < 1e-12
    )
    none = jaxdyn.crossings(SWING, Reaches(0, 2.0), 4.0)
    assert none.ts.shape == (0,)
    assert none.ys.shape == (0, 2)
    assert none.status == Status.OK


@pytest.mark.slow
def test_rows_that_are_not_needed_are_nan_and_rows_limit_the_search():
    found = released(4.0)
    assert int(found.count) == 6
    assert np.isnan(found.ts[6:]).all()
    assert np.isnan(found.ys[6:]).all()
    assert found.directions[6:].tolist() == [0, 0]
    first = jaxdyn.crossings(SWING, BOTH, 9.0, most=2, **TIGHT)
    assert gap(first.ts, found.ts[:2]) == 0.0


def times(k):
    return released(k).ts[:6]


#: Times (n + 1/2) pi / sqrt(k) of the oscillator at k = 4, and their derivatives by k.
TIMES = (np.arange(6) + 0.5) * np.pi * np.array([4.0**-0.5, -0.5 * 4.0**-1.5])[:, None]


@pytest.mark.slow
def test_derivatives_are_those_of_the_closed_form_in_both_modes():
    k = jnp.asarray(4.0)
    assert gap(times(k), TIMES[0]) < SOLVED
    assert gap(jax.jacfwd(times)(k), TIMES[1]) < SOLVED
    assert gap(jax.jacrev(times)(k), TIMES[1]) < SOLVED


@pytest.mark.slow
def test_derivatives_of_a_batch_and_second_ones():
    batch = jax.jit(jax.vmap(jax.jacfwd(times)))(jnp.array([9.0, 4.0]))
    assert gap(batch, TIMES[1] * np.array([[8 / 27], [1.0]])) < SOLVED
    second = jax.jacfwd(jax.jacrev(times))(jnp.asarray(4.0))
    assert gap(second, TIMES[1] * -1.5 / 4) < SOLVED


def test_derivatives_of_states_are_along_the_event_and_follow_its_level():
    def states(level):
        return jaxdyn.crossings(SWING, Reaches(0, level), 9.0, most=4, **TIGHT).ys

    level = jnp.asarray(0.5)
    v = -2 * np.sin(np.arccos(0.5)) * np.array([1, -1, 1, -1])
    assert gap(states(level)[:, 1], v) < SOLVED
    # v^2 = 4 (1 - x^2)
    assert gap(jax.jacrev(states)(level), np.stack([np.ones(4), -4 * 0.5 / v], -1)) < SOLVED


@pytest.mark.slow
def test_derivatives_are_zero_in_rows_without_a_crossing():
    slopes = jax.jacfwd(lambda k: released(k, 1.0).ts)(jnp.asarray(4.0))
    assert gap(slopes[1:], np.zeros(7)) == 0.0
    assert gap(jax.jacfwd(lambda k: released(k, 0.1).ts)(jnp.asarray(4.0)), np.zeros(8)) == 0.0


def test_crossings_are_those_of_calls_of_until_in_turn():
    scene = jaxdyn.ode(
        lorenz, [1.0, 1.0, 20.0], 5.0, params={"sigma": 10.0, "rho": 28.0, "beta": 8 / 3}
    )
    event = Reaches(2, 27.0)
    found = jaxdyn.crossings(scene, event, 5.0, **TIGHT)
    assert int(found.count) > 10
    t, y = 0.0, scene.y0
    for row in range(int(found.count)):
        stop = until(scene.starting(y), event, 5.0, t0=t, **TIGHT)
        t, y = stop.t, stop.y
        assert gap(t, found.ts[row]) == 0.0
        assert gap(y, found.ys[row]) == 0.0


def test_a_motion_that_fails_keeps_the_crossings_before():
    def escapes(t, y):
        return [y[0] * y[0], 2 * jnp.pi * y[2], -2 * jnp.pi * y[1]]

    scene = jaxdyn.ode(escapes, [0.4, 1.0, 0.0], 9.0)  # infinite at t = 2.5
    found = jaxdyn.crossings(scene, Reaches(1, 0.0), throw=False)
    assert gap(found.ts[:4], [0.25, 0.75, 1.25, 1.75]) < 1e-9
    assert found.status == Status.STEP_COLLAPSED
    assert "Stop earlier" in found.message
    with pytest.raises(jaxdyn.IntegrationError, match="Stop earlier"):
        jaxdyn.crossings(scene, Reaches(1, 0.0))


def test_the_limit_of_steps_is_that_of_the_whole_motion():
    few = 600
    found = jaxdyn.crossings(SWING, BOTH, 1e300, max_steps=few, throw=False)
    n = int(found.count)
    assert found.status == Status.STEP_LIMIT
    assert 64 < n < few  # more than one call of the program finds, each after some steps
    assert gap(found.ts, (np.arange(n) + 0.5) * np.pi / 2) < 1e-9
    with pytest.raises(jaxdyn.IntegrationError, match="Raise max_steps"):
        jaxdyn.crossings(SWING, BOTH, 1e300, max_steps=few)

    @jax.jit
    def counted(most):
        return jaxdyn.crossings(SWING, BOTH, 1e300, most=70, max_steps=most)

    for most in (few // 2, few):
        by_rows = counted(most)
        assert by_rows.status == (Status.STEP_LIMIT if most < few else Status.OK)
        assert gap(by_rows.ts[: int(by_rows.count)], found.ts[: int(by_rows.count)]) < SOLVED
    assert int(by_rows.count) == 70
    halves = jax.vmap(counted)(jnp.array([few // 2, few]))
    assert halves.status.tolist() == [Status.STEP_LIMIT, Status.OK]


def test_misuse_is_refused():
    assert "Write When(fn)" in refusal(lambda: jaxdyn.crossings(SWING, lambda t, y: y[0]))  # type: ignore[arg-type]
    assert "most: expected a whole number" in refusal(lambda: jaxdyn.crossings(SWING, BOTH, most=0))
    traced = refusal(lambda: jax.jit(lambda t: jaxdyn.crossings(SWING, BOTH, t).ts)(1.0))
    assert "Pass most=" in traced


def square(t, y):
    return [y[1], jnp.where(jnp.mod(t, 7.0) < 1.0, 0.0, 1.0) - 2.0 * y[0]]


def test_an_event_at_the_time_of_a_switch_happens():
    # A stroboscope of a square wave: the piece before ends on the event, the next begins on it.
    scene = jaxdyn.ode(square, [0.1, 0.0], 30.0)
    for period, count in ((7.0, 4), (3.5, 8)):
        found = jaxdyn.crossings(scene, Every(jnp.asarray(period)), 30.0)
        np.testing.assert_allclose(found.ts, period * np.arange(1, count + 1), rtol=1e-14)
    assert float(jaxdyn.until(scene, Every(jnp.asarray(7.0)), 30.0).t) == pytest.approx(7.0)
    back = jaxdyn.until(scene, Every(jnp.asarray(7.0)), 0.0, t0=30.0)
    assert float(back.t) == pytest.approx(28.0)


def test_an_event_at_the_time_of_a_break_happens():
    scene = jaxdyn.ode(lambda t, y: [y[1], -y[0]], [1.0, 0.0], 10.0)
    stop = jaxdyn.until(scene, Every(jnp.asarray(2.0)), 10.0, breaks=[1.0, 2.0])
    assert float(stop.t) == pytest.approx(2.0)


def rubbed(t, y, p):
    k, friction = p
    return [y[1], -k * y[0] - friction * jnp.sign(y[1])]


def turns(x, most):
    """Times and places at which a block on a spring of stiffness k, with dry friction f, turns."""
    start, k, friction = x
    block = jaxdyn.ode(rubbed, jnp.stack([start, 0.0]), 20.0, params=jnp.stack([k, friction]))
    found = jaxdyn.crossings(block, Reaches(1, 0.0), 20.0, most=most, **TIGHT)
    return jnp.stack([found.ts, found.ys[:, 0]], 1)


def turns_exactly(x, n):
    """It turns after each half period, nearer by 2 f / k."""
    start, k, friction = x
    return jnp.stack(
        [n * jnp.pi / jnp.sqrt(k), (-1.0) ** n * (start - 2 * n * friction / k)], axis=-1
    )


@pytest.mark.slow
@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev, jax.hessian])
def test_derivatives_where_the_friction_of_a_block_turns_round_and_sticks(derivative):
    """The block arrives with one friction and leaves with another, or stays; the derivatives are
    those of the arrival."""
    x, n = jnp.array([1.0, 1.0, 0.15]), jnp.array([1.0, 2.0, 3.0])
    found = derivative(lambda x: turns(x, most=4))(x)
    assert gap(found[:3], derivative(turns_exactly)(x, n)) < 10 * SOLVED
    assert (found[3] == 0).all()  # it sticks at the third one


def square_wave(t, y, p):
    """A filter whose input is 3 in the first p[0] of each period p[1]."""
    return [-y[0] + 3.0 * jnp.where(jnp.mod(t, p[1]) < p[0], 1.0, 0.0)]


class SlopeOfFilter(Event):
    p: jax.Array
    way: int = eqx.field(static=True, default=0)

    def value(self, t, y):
        return square_wave(t, y, self.p)[0]

    @property
    def direction(self):
        return self.way


SWITCHED = jnp.array([0.7, 2.0])


def filtered(p):
    return jaxdyn.ode(square_wave, [0.476], 4.2, params=p)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("t1", "ts", "slopes"),
    [
        (4.2, [0.7, 2.0, 2.7, 4.0], [[1, 0], [0, 1], [1, 1], [0, 2]]),
        (-4.2, [0.0, -1.3, -2.0, -3.3, -4.0], [[0, 0], [1, -1], [0, -1], [1, -2], [0, -2]]),
    ],
)
def test_a_value_that_jumps_over_zero_where_the_rate_switches_crosses_it_there(t1, ts, slopes):
    def times(p):
        found = jaxdyn.crossings(filtered(p), SlopeOfFilter(p), t1, most=len(ts))
        return found.ts, (found.ts, found.directions)

    d_found, (found, directions) = jax.jacfwd(times, has_aux=True)(SWITCHED)
    assert gap(found, ts) < 1e-14
    assert directions.tolist() == [(-1) ** (i + 1) for i in range(len(ts))]
    assert gap(d_found, slopes) < 1e-12


@pytest.mark.parametrize(
    ("way", "t1", "t", "slope"), [(-1, 4.2, 0.7, [1, 0]), (1, -4.2, -1.3, [1, -1])]
)
def test_the_first_jump_in_the_wanted_direction_ends_the_motion(way, t1, t, slope):
    found, slopes = jax.value_and_grad(lambda p: until(filtered(p), SlopeOfFilter(p, way), t1).t)(
        SWITCHED
    )
    assert abs(found - t) < 1e-14
    assert gap(slopes, slope) < 1e-12


class JumpsAt(Event):
    """A value with slopes on both sides of a level of the position, which say nothing of it."""

    level: jax.Array

    def value(self, t, y):
        return jnp.where(y[0] > self.level, 1.0 + t, y[1] - 2.0)


def test_times_of_jumps_at_a_level_of_the_state_are_those_of_the_level():
    """x = sin(w t) / w is at 1/2 at t = pi/6 and 5 pi/6 for w = sqrt(k) = 1."""

    def times(k, level):
        scene = scenes.oscillator(k=k, x=0.0, v=1.0)
        ts = jaxdyn.crossings(scene, JumpsAt(level), 3.0, most=2).ts
        return ts, ts

    (by_k, by_level), ts = jax.jacfwd(times, (0, 1), has_aux=True)(1.0, 0.5)
    speeds = np.sqrt(0.75) * np.array([1.0, -1.0])
    assert gap(ts, np.pi * np.array([1, 5]) / 6) < 1e-9
    assert gap(by_level, 1 / speeds) < 1e-9
    assert gap(by_k, 0.5 * (0.5 / speeds - ts)) < 1e-9


def pushed_back(t, y, p):
    return [y[1], jnp.where(y[0] < p, -1.0, 2.0)]


class Pushes(Event):
    p: jax.Array

    def value(self, t, y):
        return pushed_back(t, y, self.p)[1]


@pytest.mark.slow
@pytest.mark.parametrize(("start", "way"), [([0.0, 2.0], 1), ([2.0, 3.0], -1)])
def test_an_acceleration_jumps_over_zero_where_a_position_switches_it(start, way):
    """x = 2 t - t^2 / 2 up to x = p, or x = 2 + 3 t + t^2 back to it."""

    def time(p):
        scene = jaxdyn.ode(pushed_back, start, 3.0, params=p)
        t = until(scene, Pushes(p), way * 3.0).t
        return t, t

    slope, t = jax.grad(time, has_aux=True)(1.0)
    exact, speed = (2 - 2**0.5, 2**0.5) if way > 0 else ((5**0.5 - 3) / 2, 5**0.5)
    assert abs(t - exact) < 1e-12
    assert abs(slope - 1 / speed) < 1e-12


def with_friction(t, y, p):
    return [y[1], -y[0] - p * jnp.sign(y[1])]


class ForceWithFriction(Event):
    p: jax.Array

    def value(self, t, y):
        return with_friction(t, y, self.p)[1]


@pytest.mark.slow
def test_a_force_that_jumps_over_zero_where_friction_turns_round():
    """x = p + (x0 - p) cos t: the force is zero at pi / 2, and turns round where v = 0, at pi."""

    def times(x0, p):
        scene = jaxdyn.ode(with_friction, jnp.stack([x0, 0.0 * x0]), 8.0, params=p)
        ts = jaxdyn.crossings(scene, ForceWithFriction(p), 8.0, most=2).ts
        return ts, ts

    slopes, ts = jax.jacfwd(times, (0, 1), has_aux=True)(jnp.asarray(2.5), jnp.asarray(1.0))
    assert gap(ts, np.pi * np.array([0.5, 1.0])) < 1e-12
    assert gap(np.stack(slopes), np.zeros((2, 2))) < 1e-11
