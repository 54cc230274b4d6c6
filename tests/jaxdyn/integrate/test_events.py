"""until(): when something happens, and the state then, with derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import DIFFED, EXACT, SOLVED, central_difference, gap, primitives
from numpy.testing import assert_allclose

import jaxdyn
from jaxdyn import Scene, Status, crossings, scenes
from jaxdyn.effects import LinearDrag, PairGravity, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.events import Event, Every, Reaches, When, until
from jaxdyn.integrate.simulation import solve

G, V = 10.0, 10.0
RISE = V / np.sqrt(2)  # vertical speed of a throw at 45 degrees
BALL = scenes.cannonball(g=G, speed=V)
FALLS = Reaches(1, 0.0, -1)


def thrown(v, c, g=G):
    """A throw with linear drag from the origin at velocity v (2,)."""
    y0 = jnp.concatenate([jnp.zeros(2), v])
    return Scene(FreePoints(1.0, d=2), (UniformGravity(g), LinearDrag(c)), y0=y0, t1=9.0)


def landing_by_hand(vy, c):
    """(t, x / vx, vy) of the landing, by Newton's method on the closed form of the height."""
    t = 2 * vy / G
    for _ in range(60):
        fall = np.exp(-c * t)
        height = (vy + G / c) * (1 - fall) / c - G * t / c
        t = t - height / ((vy + G / c) * fall - G / c)
    fall = np.exp(-c * t)
    return t, (1 - fall) / c, (vy + G / c) * fall - G / c


@jax.jit
def landing(p):
    """(t, x, vx, vy) of the landing for p = (vx, vy, c)."""
    stop = until(thrown(p[:2], p[2]), FALLS, rtol=1e-13)
    return jnp.concatenate([stop.t[None], stop.y[:1], stop.y[2:]])


P = jnp.array([3.0, 5.0, 0.5])


def test_a_throw_lands_at_its_closed_form():
    stop = until(BALL, FALLS, 9.0)
    assert stop.happened
    assert stop.message == "Event 0 happened at t = 1.41421."
    early = until(BALL, FALLS, 0.5)
    assert early.message == "No event happened up to the end of the span, t = 0.5."
    failed = until(BALL, FALLS, 9.0, max_steps=1)
    assert failed.message == Status.STEP_LIMIT.message
    assert stop.event == 0
    assert stop.status == Status.OK
    assert abs(stop.t - 2 * RISE / G) < EXACT
    assert gap(stop.y, [2 * RISE**2 / G, 0.0, RISE, -RISE]) < SOLVED


def test_which_motions_of_a_batch_had_an_event():
    starts = jnp.array([[0.0, 0.0, 1.0, speed] for speed in (1.0, 3.0, 5.0)])
    stops = jax.vmap(lambda y0: until(BALL.starting(y0), FALLS, 0.5))(starts)
    assert stops.happened.tolist() == [2 * speed / G < 0.5 for speed in (1.0, 3.0, 5.0)]


def test_a_throw_with_drag_lands_at_its_closed_form():
    t, x, vy = landing_by_hand(5.0, 0.5)
    assert gap(landing(P), [t, 3.0 * x, 3.0 * (1 - 0.5 * x), vy]) < SOLVED


@pytest.mark.slow
def test_derivatives_are_those_of_the_closed_form():
    forward = jax.jacfwd(landing)(P)
    _, x, v = landing_by_hand(5.0, 0.5)
    # dt/dvy by the implicit function theorem on the height (vy + g/c)(1 - e)/c - g t/c = 0.
    assert abs(forward[0, 1] - (-x / v)) < SOLVED
    assert gap(forward[:, 0], [0.0, x, 1 - 0.5 * x, 0.0]) < SOLVED
    assert gap(forward, central_difference(landing, P)) < DIFFED
    assert gap(forward, jax.jacrev(landing)(P)) < SOLVED


@pytest.mark.slow
def test_second_derivatives_follow_the_theorem_too():
    # t = 2 vy / g without drag, and the range x = 2 vx vy / g.
    def reach(v):
        return until(BALL.starting(jnp.concatenate([jnp.zeros(2), v])), FALLS, 9.0).y[0]

    hessian = jax.jacfwd(jax.jacrev(reach))(jnp.array([2.0, 3.0]))
    assert gap(hessian, 2 / G * np.array([[0.0, 1.0], [1.0, 0.0]])) < SOLVED


@pytest.mark.slow
def test_derivatives_in_level_and_times():
    def crossing(x):
        level, t0, t1 = x
        stop = until(BALL, Reaches(0, level), t1, t0=t0)
        return jnp.concatenate([stop.t[None], stop.y[:2]])

    expected = np.array([[1 / RISE, 1, 0], [1, 0, 0], [1 - G * 3 / RISE**2, 0, 0]])
    assert gap(jax.jacfwd(crossing)(jnp.array([3.0, 0.5, 9.0])), expected) < SOLVED
    # Not reached: the end of the span moves with t1, and the state with it.
    late = np.array([[0, 0, 1], [0, -RISE, RISE], [0, -(RISE - G), RISE - G]])
    assert gap(jax.jacfwd(crossing)(jnp.array([99.0, 0.5, 1.5])), late) < SOLVED


@pytest.mark.slow
def test_batches_are_loops():
    ps = jnp.stack([P, P + 1.0, 2 * P])
    assert gap(jax.vmap(landing)(ps), jnp.stack([landing(p) for p in ps])) < SOLVED
    levels = jnp.array([1.0, 2.0, 99.0])
    stops = jax.vmap(lambda level: until(BALL, Reaches(1, level), 2.0))(levels)
    np.testing.assert_array_equal(stops.event, [0, 0, -1])
    assert gap(stops.t[:2], (RISE - np.sqrt(RISE**2 - 2 * G * levels[:2])) / G) < SOLVED
    assert stops.t[2] == 2.0


@pytest.mark.parametrize("below", [1e-1, 1e-3, 1e-6, 1e-9, 1e-12])
def test_two_crossings_within_a_step_are_found(below):
    # The polynomial motion is done in a few huge steps; the top of the throw is inside one.
    level = RISE**2 / (2 * G) - below
    stop = until(BALL, Reaches(1, level), 9.0, rtol=1e-6)
    # The height near the top is known to 1e-16, so the time to sqrt of that.
    assert abs(stop.t - (RISE / G - np.sqrt(2 * below / G))) < 1e-15 / np.sqrt(below) + SOLVED
    down = until(BALL, Reaches(1, level, -1), 9.0, rtol=1e-6)
    assert abs(down.t - (RISE / G + np.sqrt(2 * below / G))) < 1e-15 / np.sqrt(below) + SOLVED


def test_a_top_just_short_of_the_level_is_no_crossing():
    stop = until(BALL, Reaches(1, RISE**2 / (2 * G) + 1e-12), 9.0, rtol=1e-6)
    assert not stop.happened


def kepler_height(t, y):
    """Height of the second body over a line far out on its orbit."""
    del t
    return y[2] - 1.29 / 2


@pytest.mark.slow
def test_a_shallow_double_crossing_of_a_curved_orbit_is_found():
    # x of the second body is (cos E - e) / 2 on an ellipse, largest at E = 0 mod 2 pi.
    e = 0.3
    y0 = [0.35, 0.0, -0.35, 0.0, 0.0, -0.5 * np.sqrt(1.3 / 0.7), 0.0, 0.5 * np.sqrt(1.3 / 0.7)]
    scene = Scene(FreePoints([0.5, 0.5]), (PairGravity(1.0),), y0=y0)
    stop = until(scene, When(kepler_height), 9.0, rtol=1e-6, max_steps=200)
    tight = until(scene, When(kepler_height), 9.0, rtol=1e-13)
    # The second body starts at its nearest point on the other side: largest x at half a period.
    anomaly = np.pi - np.arccos(1.29 - e)
    exact = anomaly - e * np.sin(anomaly)
    assert abs(tight.t - exact) < 10 * SOLVED
    assert abs(stop.t - exact) < 1e-4


def test_direction_is_that_of_the_motion():
    up, down, both = (until(BALL, Reaches(1, 1.0, way), 9.0).t for way in (1, -1, 0))
    half = np.sqrt(RISE**2 - 2 * G)
    assert abs(up - (RISE - half) / G) < EXACT
    assert abs(down - (RISE + half) / G) < EXACT
    assert both == up


@pytest.mark.slow
def test_backward_in_time():
    # Backwards the ball comes from below: the height falls as the motion goes.
    start = BALL.starting([0.0, 1.0, 1.0, 1.0])
    expected = (1 - np.sqrt(1 + 2 * G)) / G  # of 1 + t - 5 t^2 = 0
    for way in (-1, 0):
        stop = until(start, Reaches(1, 0.0, way), -9.0)
        assert abs(stop.t - expected) < EXACT
        assert abs(stop.y[1]) < EXACT
    assert not until(start, Reaches(1, 0.0, 1), -9.0).happened

    def crossing(y):
        stop = until(BALL.starting(jnp.stack([0.0, y, 1.0, 1.0])), FALLS, -9.0)
        return stop.t

    slope = 1 - G * expected
    assert abs(jax.grad(crossing)(1.0) - (-1 / slope)) < SOLVED


def test_a_motion_that_starts_on_an_event_has_left_it():
    first = until(BALL, FALLS, 9.0)
    again = BALL.starting(first.y * jnp.array([1, 1, 1, -0.8]))
    for way in (-1, 0):
        stop = until(again, Reaches(1, 0.0, way), 9.0)
        assert abs(stop.t - 0.8 * 2 * RISE / G) < SOLVED
    # The same a little inside the ground, as rounding leaves it.
    inside = again.starting(again.y0.at[1].set(-1e-15))
    assert abs(until(inside, FALLS, 9.0).t - 0.8 * 2 * RISE / G) < SOLVED
    # After a tiny bounce late in the day, whose first step is a tiny part of it.
    late = again.starting([2.0, -5e-18, 1.0, 0.01])
    assert abs(until(late, FALLS, 9.0, t0=1.996).t - 1.998) < SOLVED
    # At rest on the level with a force away from it: it never comes back.
    assert not until(BALL.starting([0.0, 0.0, 1.0, 0.0]), Reaches(1, 0.0), 2.0).happened


@pytest.mark.slow
def test_the_earliest_of_several_events_wins_in_any_order():
    wall, floor, roof = Reaches(0, 3.0, 1), FALLS, Reaches(1, 99.0)
    for events in ((wall, floor, roof), (roof, floor, wall), (floor, roof, wall)):
        stop = until(BALL, events, 9.0)
        assert events[int(stop.event)] is wall
        assert abs(stop.t - 3.0 / RISE) < EXACT
    near = Reaches(0, 2 * RISE**2 / G - 1e-9, 1)  # a nanometre before the landing
    assert until(BALL, (FALLS, near), 9.0).event == 1


def billiard(distance, v, walls):
    """Where a ball at velocity v (2,) meets two walls, each `distance` (2,) away from it."""
    free = Scene(FreePoints(1.0, d=2), (UniformGravity(0.0),), y0=jnp.zeros(4), t1=99.0)
    corner = jnp.asarray(walls, dtype=float)
    start = jnp.concatenate([corner - jnp.asarray(distance), jnp.asarray(v, dtype=float)])
    return until(free.starting(start), (Reaches(0, corner[0], 1), Reaches(1, corner[1], 1), FALLS))


def test_events_at_one_time_are_all_reported():
    rng = np.random.default_rng(5)
    for v, walls in zip(rng.uniform(0.1, 3, (9, 2)), rng.uniform(-4, 4, (9, 2)), strict=True):
        t = rng.uniform(0.1, 5)
        corner = billiard(t * v, v, walls)
        assert abs(corner.t - t) < SOLVED
        np.testing.assert_array_equal(corner.coincident, [True, True, False])
        assert corner.message.endswith(" at the same time.")
        # A wall that is 1e-11 s further away is not met at that time.
        beside = billiard((t + np.array([0.0, 1e-11])) * v, v, walls)
        assert beside.event == 0
        np.testing.assert_array_equal(beside.coincident, [True, False, False])
    # A ball that rolls along a wall only touches it.
    assert not billiard([1.0, 0.0], [1.0, 0.0], [1.0, 1.0]).coincident[1]


def test_without_an_event_the_span_ends():
    stop = until(BALL, Reaches(1, 99.0), 0.5)
    assert not stop.happened
    assert not stop.coincident.any()
    assert stop.t == 0.5
    assert gap(stop.y[:2], [RISE * 0.5, RISE * 0.5 - G / 8]) < SOLVED
    assert stop.status == Status.OK


@pytest.mark.slow
def test_a_failure_before_the_event_gives_no_numbers():
    fall = Scene(FreePoints([1.0, 1.0]), (PairGravity(),), y0=[-0.5, 0, 0.5, 0, 0, 0, 0, 0])
    # They collide at pi/4; nothing that comes later may be reported.
    stop = until(fall, Reaches(0, 9.0), 2.0)
    assert stop.status == Status.STEP_COLLAPSED
    assert not stop.happened
    assert np.isnan(stop.t)
    assert np.isnan(stop.y).all()
    assert until(BALL, FALLS, 9.0, rtol=1e-12, max_steps=1).status == Status.STEP_LIMIT
    # An event before the collision is found all the same.
    half = until(fall, Reaches(0, -0.25, 1), 2.0)
    assert abs(half.t - (np.pi / 8 + 0.25)) < SOLVED


def root_of_height(t, y):
    """Not a number below the ground."""
    del t
    return jnp.sqrt(y[1] + 1.0) - 0.5


def test_an_event_that_is_no_number_is_a_failure():
    stop = until(BALL, When(root_of_height, 1), 9.0)
    assert stop.status == Status.NOT_FINITE
    assert np.isnan(stop.t)


traced = []


class Beyond(Event):
    """The ball is past a distance; notes each time it is traced."""

    level: jax.Array

    def value(self, t, y):
        del t
        traced.append(y)
        return y[0] - self.level


def test_new_numbers_do_not_recompile():
    until(BALL, Beyond(jnp.asarray(1.0)), 9.0)
    once = len(traced)
    for level, speed in ((2.0, 5.0), (0.3, 7.0)):
        ball = scenes.cannonball(speed=speed)
        stop = until(ball, Beyond(jnp.asarray(level)), 8.0, rtol=1e-9)
        assert abs(stop.t - level / (speed / np.sqrt(2))) < SOLVED
    assert len(traced) == once


def test_the_search_calls_no_library_and_sorts_nothing():
    found = primitives(lambda s: until(s, FALLS, 9.0), BALL)
    plain = primitives(lambda s: solve(s, 9.0), BALL)
    for name in ("scatter", "sort", "custom_call", "pure_callback", "lu"):
        assert found.count(name) == plain.count(name)


def test_no_event_is_refused():
    with pytest.raises(ValueError, match="events: expected at least one, got none"):
        until(BALL, ())
    message = r"^events: expected events, got height\. Write When\(fn\), with a named fn\.$"
    for given in (height, (FALLS, height)):
        with pytest.raises(ValueError, match=message):
            until(BALL, given)
    with pytest.raises(ValueError, match=r"^scene: expected a Scene, got cannonball\. Call it"):
        until(scenes.cannonball, FALLS)


def test_a_value_that_is_no_number_is_refused():
    message = r"^When: expected one number as its value, got shape \(2,\)\. Split it\.$"
    with pytest.raises(ValueError, match=message):
        until(BALL, When(place))


def height(t, y):
    return y[1]


def place(t, y):
    return y[:2]


def test_an_entry_that_is_none_and_a_direction_that_is_none_are_refused():
    ball = scenes.cannonball()
    with pytest.raises(ValueError, match=r"entry: expected an entry of the state, 0 to 3, got 9"):
        until(ball, Reaches(9, 0.0, -1), 1.0)
    with pytest.raises(ValueError, match="entry: expected an entry of the state, 0 to 3, got vy"):
        until(ball, Reaches("vy", 0.0), 1.0)
    with pytest.raises(ValueError, match=r"direction: expected 1, -1, or 0 for both, got 5"):
        until(ball, Reaches(1, 0.0, 5), 1.0)


STEPPED = [
    lambda t, y: jnp.sign(y[0] - 0.5),
    lambda t, y: jnp.where(y[0] > 0.5, 1.0, -1.0),
    lambda t, y: jnp.asarray(y[0] > 0.5, float) - 0.5,
]


def first_time(find, event, k):
    scene = scenes.oscillator(k=k, x=1.0)
    if find is until:
        return until(scene, event, 3.0).t
    return crossings(scene, event, 3.0, most=1).ts[0]


@pytest.mark.sample("crossings-<lambda>2")
@pytest.mark.parametrize("value", STEPPED)
@pytest.mark.parametrize("find", [until, crossings])
def test_the_time_of_a_step_has_the_derivative_of_its_condition(value, find):
    """x = cos(sqrt(k) t) falls to 1/2 at arccos(1/2) / sqrt(k)."""
    time, slope = jax.value_and_grad(lambda k: first_time(find, When(value), k))(1.0)
    assert abs(time - np.arccos(0.5)) < 1e-9
    assert abs(slope + 0.5 * np.arccos(0.5)) < 1e-9


def signbit(t, y):
    return 0.5 - jnp.asarray(jnp.signbit(y[0] - 0.5), float)


@pytest.mark.parametrize("find", [until, crossings])
def test_the_time_of_a_step_that_cannot_be_read_has_no_derivative_and_says_so(find):
    assert abs(first_time(find, When(signbit), 1.0) - np.arccos(0.5)) < 1e-9
    message = r"^derivative of the time of an event: .* constant on both sides.*not jnp\.sign"
    with pytest.raises(ValueError, match=message):
        jax.grad(lambda k: first_time(find, When(signbit), k))(1.0)


@pytest.mark.slow
def test_the_time_of_a_stroboscope_does_not_depend_on_the_motion():
    def stop(k):
        return until(scenes.oscillator(k=k, x=1.0), Every(0.5), 3.0, rtol=1e-13)

    assert jax.grad(lambda k: stop(k).t)(1.0) == 0.0
    # x = cos(sqrt(k) t)
    assert abs(jax.grad(lambda k: stop(k).y[0])(1.0) + 0.25 * np.sin(0.5)) < SOLVED


def sliding(t, y, p):
    return [y[1], -p * jnp.sign(y[1])]


def test_derivatives_of_an_event_at_which_friction_begins_to_stick():
    """A block that slides with speed v stops after v / p at v^2 / (2 p), and stays there: its
    deceleration up to then counts, not the one of 0 after it."""

    def stop(p):
        scene = jaxdyn.ode(sliding, [0.0, 3.0], 10.0, params=p)
        found = until(scene, Reaches(1, 0.0, -1), 10.0)
        return jnp.stack([found.t, found.y[0]])

    assert_allclose(stop(2.0), [1.5, 2.25], rtol=1e-14)
    assert_allclose(jax.jacfwd(stop)(2.0), [-0.75, -1.125], rtol=1e-13)


@pytest.mark.slow
def test_second_derivatives_of_an_event_at_which_friction_begins_to_stick():
    def time(p, v):
        scene = jaxdyn.ode(sliding, jnp.stack([0.0, v]), 10.0, params=p)
        return until(scene, Reaches(1, 0.0, -1), 10.0).t

    p, v = 2.0, 3.0
    expected = [[2 * v / p**3, -1 / p**2], [-1 / p**2, 0.0]]
    assert_allclose(jax.grad(time, argnums=(0, 1))(p, v), [-v / p**2, 1 / p], rtol=1e-13)
    found = jax.hessian(lambda x: time(x[0], x[1]))(jnp.array([p, v]))
    assert_allclose(found, expected, atol=1e-12)
