"""The search for crossings: dips within a step, events at and just after the start."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED
from scipy import optimize

from jaxdyn import Scene, Status, scenes, solvers
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.event_search.crossings import are_settled
from jaxdyn.integrate.events import Event, Reaches, until
from jaxdyn.scene import Effect

G = 10.0
BALL = scenes.cannonball(g=G)
FALLS = Reaches(1, 0.0, -1)
DEPTHS = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 4e-15]


class Well(Effect):
    """A harmonic well, of another frequency along each axis."""

    velocity_dependent = False
    rates: jax.Array

    def potential(self, t, r, m):
        return 0.5 * jnp.sum((self.rates[None] * r) ** 2)


class Signal(Event):
    """The sum of two harmonic signals reaches a level."""

    weight: jax.Array
    level: jax.Array

    def value(self, t, y):
        return y[0] + self.weight * y[1] - self.level


class Turns(Event):
    """That sum has a minimum."""

    weight: jax.Array

    def value(self, t, y):
        return y[2] + self.weight * y[3]

    @property
    def direction(self):
        return 1


class Clock(Event):
    """cos(rate t) reaches a level, whatever the motion does."""

    rate: jax.Array
    level: jax.Array

    def value(self, t, y):
        return jnp.cos(self.rate * t) - self.level


class Shaken(Event):
    """The ball falls on a floor at size sin(rate t)."""

    size: jax.Array
    rate: jax.Array

    def value(self, t, y):
        return y[1] - self.size * jnp.sin(self.rate * t)

    @property
    def direction(self):
        return -1


def signals(rates, phases) -> Scene:
    """The motion x_i = cos(rate_i t + phase_i)."""
    rates, phases = np.asarray(rates, float), np.asarray(phases, float)
    y0 = jnp.concatenate([np.cos(phases), -rates * np.sin(phases)])
    return Scene(FreePoints(1.0, d=2), (Well(jnp.asarray(rates)),), y0=y0, t1=9.0)


def dips_found(scene, weight, solver, rtol):
    """Whether a level above the first minimum by each of DEPTHS is crossed before it."""
    weight = jnp.asarray(weight)
    low = until(scene, Turns(weight), rtol=rtol, solver=solver)
    least = Signal(weight, jnp.asarray(0.0)).value(low.t, low.y)
    stops = [until(scene, Signal(weight, least + d), rtol=rtol, solver=solver) for d in DEPTHS]
    # The signal may start below the higher levels; then it crosses them after the minimum. Places
    # have theirs where velocities are zero up to the error of a step.
    return [
        bool(s.happened) and abs(s.t - low.t) < 9 * np.sqrt(d) + 0.01 * rtol
        for s, d in zip(stops, DEPTHS, strict=True)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-12])
def test_dips_of_harmonic_signals_are_found_down_to_rounding(rtol):
    rng = np.random.default_rng(13)
    for weight in (0.0, 0.7):
        scene = signals([1.0, 3.7], rng.uniform(0, 2 * np.pi, 2))
        assert all(dips_found(scene, weight, solvers.NYSTROM12, rtol))


@pytest.mark.slow
@pytest.mark.parametrize("solver", [solvers.VERNER9, solvers.STOERMER14, solvers.DOPRI8])
def test_dips_are_found_by_other_methods_too(solver):
    scene = signals([1.0, 3.7], [2.0, 0.5])
    for rtol in (1e-3, 1e-9):
        assert all(dips_found(scene, 0.7, solver, rtol))


def test_dips_are_found_at_their_closed_form():
    rng = np.random.default_rng(14)
    for depth, phase in zip(10.0 ** rng.uniform(-11, -1, 12), rng.uniform(0, 2.5, 12), strict=True):
        scene = signals([1.0, 1.0], [phase, 0.0])
        stop = until(scene, Signal(jnp.asarray(0.0), jnp.asarray(depth - 1.0)), rtol=1e-13)
        exact = np.pi - 2 * np.arcsin(np.sqrt(depth / 2)) - phase
        assert abs(stop.t - exact) < 2e-14 / np.sqrt(depth) + SOLVED


def test_a_minimum_above_the_level_is_no_crossing():
    rng = np.random.default_rng(15)
    for gap, phase in zip(10.0 ** rng.uniform(-12, -1, 8), rng.uniform(0, 2.5, 8), strict=True):
        scene = signals([1.0, 1.0], [phase, 0.0])
        stop = until(scene, Signal(jnp.asarray(0.0), jnp.asarray(-1.0 - gap)), rtol=1e-13)
        assert not stop.happened


@pytest.mark.slow
def test_events_faster_than_the_motion_are_found():
    # A throw without drag is crossed in steps of seconds: they say nothing about the clock. Some
    # of these have whole periods in a quarter of a step, where evenly spaced looks see no change.
    for rate in (1.0, 2 * np.pi, 30.0, 1000.0):
        for depth in (1e-1, 1e-3, 1e-6, 1e-10, 1e-14):
            stop = until(BALL, Clock(jnp.asarray(rate), jnp.asarray(depth - 1.0)), 32.0)
            exact = np.arccos(depth - 1.0) / rate
            assert abs(stop.t - exact) < EXACT + 1e-15 / np.sqrt(depth)


@pytest.mark.slow
def test_an_event_too_fast_to_be_followed_ends_the_search():
    never = Clock(jnp.asarray(1e9), jnp.asarray(-1.5))
    stop = until(BALL, never, 32.0)
    assert not stop.happened
    assert int(stop.status) == Status.UNSEEN_WITHIN_STEP
    slow = until(BALL, Clock(jnp.asarray(1e3), jnp.asarray(-1.5)), 32.0)
    assert int(slow.status) == Status.OK


def first_landing(y, v, size, rate):
    """By a fine scan of the closed form, and bisection."""

    def gap(t):
        return y + v * t - G / 2 * t * t - size * np.sin(rate * t)

    t = np.linspace(0, 3, 300_001)
    k = np.argmax(gap(t) < 0)
    return optimize.root_scalar(gap, bracket=(t[k - 1], t[k]), xtol=1e-15).root


@pytest.mark.slow
def test_landings_on_a_shaken_floor():
    rng = np.random.default_rng(16)
    for rate in (3.0, 20.0, 100.0):
        for size, v in zip(rng.uniform(0, 0.3, 8), rng.uniform(2, 8, 8), strict=True):
            ball = BALL.starting(jnp.array([0.0, 1.0, 3.0, v]))
            stop = until(ball, Shaken(jnp.asarray(size), jnp.asarray(rate)), 9.0)
            # Floors this fast are nearly touched at times: roots are known to sqrt(rounding).
            assert abs(stop.t - first_landing(1.0, v, size, rate)) < 1e-9


def test_a_dip_backward_in_time():
    ball = BALL.starting(jnp.array([0.0, 0.0, 1.0, -5.0]))  # thrown up a second ago
    for depth in (1e-2, 1e-8, 1e-13):
        stop = until(ball, Reaches(1, G / 8 - depth), -3.0)
        assert abs(stop.t + 0.5 - np.sqrt(2 * depth / G)) < 1e-15 / np.sqrt(depth) + SOLVED


@pytest.mark.parametrize("t0", [0.0, 1.0, 1000.0])
def test_events_just_after_the_start_are_found(t0):
    # 100 roundings of time are more than rounding; one is not, and an event at the start is none.
    for after in (1e-3, 1e-6, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13):
        stop = until(BALL.starting(jnp.array([0.0, 7 * after, 3.0, -7.0])), FALLS, t0 + 9, t0=t0)
        if after > 100 * np.spacing(t0):
            assert stop.happened
            assert abs(stop.t - t0 - after) < 2 * np.spacing(t0) + 1e-9 * after + 10 * after**2
    assert not until(BALL.starting(jnp.array([0.0, 0.0, 3.0, -7.0])), FALLS, t0 + 9, t0=t0).happened


@pytest.mark.parametrize("t0", [-0.3, 0.0, 1.0])
def test_the_shortest_flights_end(t0):
    for y, v in [(0.0, 10.0**-n) for n in range(0, 40, 3)] + [(1e-17, 1e-9), (1e-17, 0.0)]:
        stop = until(BALL.starting(jnp.array([0.0, y, 3.0, v])), FALLS, t0 + 9, t0=t0)
        flight = (v + np.sqrt(v * v + 2 * G * y)) / G
        assert stop.happened
        assert abs(stop.t - t0 - flight) <= 2 * np.spacing(1.0) * (1 + flight)
        assert stop.y[3] < 0
    # Let go on the floor it is under it at once.
    stop = until(BALL.starting(jnp.array([0.0, 0.0, 3.0, 0.0])), FALLS, t0 + 9, t0=t0)
    assert stop.happened
    assert abs(stop.t - t0) <= np.spacing(1.0)


@pytest.mark.sample("1e-06", "0.0")
@pytest.mark.parametrize("keeps", [0.8, 0.1, 1e-6, 0.0])
def test_a_bouncing_ball_never_falls_through_the_floor(keeps):
    t, y = jnp.asarray(0.3), jnp.array([0.0, 0.0, 1.0, 5.0])
    for _ in range(250):
        stop = until(BALL.starting(y), FALLS, 50.0, t0=t)
        assert stop.happened
        assert abs(stop.y[1]) < 1e-40 or stop.y[1] > 0
        t, y = stop.t, stop.y * jnp.array([1, 1, 1, -keeps])
    # A bounce may begin some roundings above the floor, and to fall from there takes a while.
    rest = np.sqrt(2 * 8 * np.spacing(5.0**2 / (2 * G)) / G) if keeps < 1e-3 else SOLVED
    assert abs(t - 0.3 - 2 * 5.0 / G / (1 - keeps)) < rest


@pytest.mark.slow
def test_the_state_at_a_stop_is_not_beyond_it():
    rng = np.random.default_rng(17)
    for v, level in zip(rng.uniform(1, 9, 20), rng.uniform(-3, 0, 20), strict=True):
        ball = BALL.starting(jnp.array([0.0, 0.1, 1.0, v]))
        stop = until(ball, Reaches(1, level, -1), 9.0)
        assert 0 <= stop.y[1] - level < SOLVED
        stop = until(ball, Reaches(0, -level, 1), 9.0)
        assert -SOLVED < stop.y[0] + level <= 0


@pytest.mark.slow
def test_a_start_at_rest_on_an_event():
    free = Scene(FreePoints(1.0, d=2), (UniformGravity(-G),), y0=jnp.zeros(4), t1=2.0)
    # It rises: whatever way is wanted, it has left; where that way is up, it was crossed then.
    assert not until(free, Reaches(1, 0.0, -1)).happened
    assert not until(free, Reaches(1, 0.0)).happened
    up = until(free, Reaches(1, 0.0, 1))
    assert up.happened
    assert abs(up.t) < 1e-20
    # It stays.
    still = until(free, Reaches(0, 0.0, -1))
    assert not still.happened
    assert still.status == Status.OK


@pytest.mark.slow
def test_what_is_settled_has_no_hidden_crossings():
    rng = np.random.default_rng(18)
    times, fine = np.array([0.0, 0.23, 0.49, 0.77, 1.0]), np.linspace(0, 1, 4001)
    judge, unsettled = jax.jit(are_settled), 0
    for _ in range(300):
        a, w, p = rng.normal(size=3), rng.uniform(0, 8, 3), rng.uniform(0, 2 * np.pi, 3)
        shift = rng.uniform(-2, 2)

        def wave(t, a=a, w=w, p=p, shift=shift):
            return np.sum(a * np.sin(np.multiply.outer(t, w) + p), -1) + shift

        slope = np.sum(a * w * np.cos(np.multiply.outer(times, w) + p), -1)
        g = wave(times)
        sides = np.sign(g)[:, None]
        known = judge(times, g[:, None], slope[:, None], sides, np.zeros((5, 1)))[:, 0]
        for i, (begin, end) in enumerate(itertools.pairwise(times)):
            inside = np.sign(wave(fine[(fine >= begin) & (fine <= end)]))
            changes = np.count_nonzero(np.diff(inside))
            if known[i]:
                assert changes == int(sides[i, 0] != sides[i + 1, 0])
            unsettled += not known[i]
    assert unsettled < 120  # of 1200: it says so where there is something to look for
