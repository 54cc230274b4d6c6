"""Where functions of the state first cross zero along a motion: the search behind `events`.

Every accepted step is looked at in five places, reached by steps of the method itself (an
interpolant would be good to 7 digits only), at values and at slopes: two crossings within a
step are found wherever the slope shows that the value turned towards zero. A motion that starts
on an event (after a bounce, say) has left it, and does not meet it again at once. The time found
is polished until it does not change any more.
"""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.flow import Settings, march
from jaxdyn.scene import Field
from jaxdyn.solvers import Pair
from jaxdyn.status import Status
from jaxdyn.stepping import Watch

_LOOKS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # parts of a step at which events are looked at
_AT_START = 1e-9  # an event nearer than this part of the first step was where the motion began
_ROUNDINGS = 64  # of state and time that the value at a start on an event may be off zero
_TURNS = 4  # how often a turning point is looked for anew, if its value was not beyond zero
_POLISH = 60  # bisections at most; Newton's steps end it after about five


class Crossing(NamedTuple):
    """The first crossing: its time (infinite if there is none), the state, which, `Status`."""

    t: Array
    y: Array
    event: Array
    status: Array


def first_crossing(field, events, y0, t0, t1, tolerance, *, settings: Settings):
    """The state (k,) where the search ended, and the first crossing; no derivatives.

    Args:
      field: a module with ``rate(t, y)`` and ``project(t, y)``.
      events: modules with ``value(t, y)`` and ``direction``.
      y0: (k,) start.
      t0: () start time.
      t1: () end time, before or after t0.
      tolerance: (2,) see `flow`.
      settings: see `flow`.
    """
    watch = _Lookout(field, events, settings.pair)
    out, seen = march(field, y0, t0, t1, jnp.zeros(0), tolerance, settings=settings, watch=watch)
    hs, ys = _polished(watch, seen)
    which = jnp.argmin(jnp.abs(hs))
    status = jnp.where(jnp.isnan(seen.side).any(), int(Status.NOT_FINITE), out.status)
    return out.y1, Crossing(seen.t0 + hs[which], ys[:, which], which, status)


class _Seen(NamedTuple):
    """What the watch remembers; one entry for each of the E events."""

    side: Array  # (E,) sign of each value so far, 0 before the first step, NaN once it was NaN
    t0: Array  # () last accepted node before the events found
    y0: Array  # (k,)
    low: Array  # (E,) bracket as time after t0; inf where nothing was found
    high: Array  # (E,)
    towards: Array  # (E,) sign of the value after the crossing
    noise: Array  # (E,) values up to this are rounding


class _Lookout(Watch):
    field: Field
    events: tuple  # of modules with value(t, y) and direction
    pair: Pair = eqx.field(static=True)
    direction: Array | float = 1.0

    def towards(self, direction):
        return _Lookout(self.field, self.events, self.pair, direction)

    def start(self, t0, y0):
        nothing = jnp.full(len(self.events), jnp.inf)
        zero = jnp.zeros_like(nothing)
        return _Seen(zero, t0, y0, nothing, nothing, nothing, self._noise(t0, y0))

    def _noise(self, t0: Array, y0: Array) -> Array:
        """(E,) how large a value may be where the state and the time are right to rounding."""
        parts = _parts(self.field, self.events, self.direction * t0, y0)
        return _off(parts, jnp.abs(y0), jnp.abs(t0))

    def see(self, keep, t0, y0, t1, y1, memory):
        del y1
        h = self.direction * (t1 - t0)
        begin = self.direction * t0
        wanted = jnp.array([[event.direction for event in self.events]])
        sides, turn, beyond = self._surveyed(begin, y0, h, memory)
        low, high, towards = _brackets(sides, turn, beyond, wanted)
        found = jnp.isfinite(low) & keep
        low, high = (jnp.where(found, x * h, jnp.inf) for x in (low, high))
        seen = _Seen(sides[-1], begin, y0, low, high, towards, memory.noise)
        memory = jax.tree.map(lambda new, old: jnp.where(keep, new, old), seen, memory)
        return memory, found.any() | jnp.isnan(memory.side).any()

    def _surveyed(self, t: Array, y: Array, h: Array, memory: _Seen) -> tuple[Array, ...]:
        """(5, E) sides at the looks, (4, E) a turn in each quarter, and if it is beyond zero."""
        looks = jnp.broadcast_to(_LOOKS[:, None], (len(_LOOKS), len(self.events)))

        def survey(carry):
            # One loop for the looks and the turns, so that the step is compiled once.
            n, ends, sides, turn, beyond = carry
            parts = jnp.where(n == 0, looks, jnp.concatenate([turn, turn[-1:]]))
            g, slope = self._looked(t, y, parts * h)
            slope = slope * h
            first = _Ends(looks[:-1], looks[1:], g[:-1], g[1:], slope[:-1], slope[1:])
            later = ends.around(turn, g[:-1], slope[:-1])
            ends = jax.tree.map(lambda a, b: jnp.where(n == 0, a, b), first, later)
            sides = jnp.where(n == 0, _sides(memory, g, slope), sides)
            beyond = beyond | (
                (n > 0) & ends.hide(sides) & (sides[:-1] * g[:-1] < -memory.noise[None])
            )
            return n + 1, ends, sides, jnp.where(beyond, turn, ends.turn()), beyond

        def unclear(carry):
            n, ends, sides, _, beyond = carry
            return (n == 0) | ((n <= _TURNS) & (ends.hide(sides) & ~beyond).any())

        none = jnp.zeros_like(looks[1:])
        start = (0, _Ends(*[none] * 6), jnp.zeros_like(looks), none, none > 0)
        _, _, sides, turn, beyond = jax.lax.while_loop(unclear, survey, start)
        return sides, turn, beyond

    def _looked(self, t: Array, y: Array, hs: Array) -> tuple[Array, Array]:
        """(s, E) each event's value and slope in time at its own times t + hs (s, E)."""
        e = len(self.events)
        g, slope, _ = self.look(t, y, hs.ravel())
        own = (jnp.diagonal(x.reshape(-1, e, e), axis1=1, axis2=2) for x in (g, slope))
        return tuple(own)

    def look(self, t: Array, y: Array, hs: Array) -> tuple[Array, Array, Array]:
        """(s, E) values and slopes and (k, s) states, after one step of each length hs (s,)."""
        # One step of a state with s columns: a batch of steps would scatter into its stages.
        rates = jax.vmap(self.field.rate, in_axes=(0, -1), out_axes=-1)
        ys = jnp.broadcast_to(y[:, None], (*y.shape, *hs.shape))
        increment, _ = self.pair.step(lambda t, y: rates(t[0], y), t, hs[None], ys, loops=1)
        ts = t + hs
        x = jax.vmap(self.field.project, in_axes=(0, -1), out_axes=-1)(ts, ys + increment)

        def along(t, y, rate):
            ahead = (jnp.ones_like(t), rate)
            return jax.jvp(functools.partial(values, self.events), (t, y), ahead)

        g, slope = jax.vmap(along, in_axes=(0, -1, -1))(ts, x, rates(ts, x))
        return g, slope, x


class _Ends(NamedTuple):
    """(4, E) the stretches in which turns are looked for: parts of the step, values, slopes."""

    low: Array
    high: Array
    g0: Array
    g1: Array
    d0: Array  # slopes by the part of the step
    d1: Array

    def hide(self, sides: Array) -> Array:
        """Whether the value comes towards zero and leaves it again on the same side."""
        s = sides[:-1]
        return (s == sides[1:]) & (s * self.d0 < 0) & (s * self.d1 > 0)

    def around(self, part: Array, g: Array, slope: Array) -> "_Ends":
        """The half of each stretch that still has the turn in it, cut at a place inside."""
        after = slope * self.d0 > 0
        ends = (self.low, part), (part, self.high), (self.g0, g), (g, self.g1)
        low, high, g0, g1 = (jnp.where(after, b, a) for a, b in ends)
        return _Ends(
            low, high, g0, g1, jnp.where(after, slope, self.d0), jnp.where(after, self.d1, slope)
        )

    def turn(self) -> Array:
        """Where the cubic with these values and slopes turns, as part of the step."""
        width = self.high - self.low
        d0, d1, rise = width * self.d0, width * self.d1, self.g1 - self.g0
        a = 3 * (d0 + d1) - 6 * rise
        b = 6 * rise - 4 * d0 - 2 * d1
        root = jnp.sqrt(jnp.maximum(b * b - 4 * a * d0, 0.0))
        q = -0.5 * (b + jnp.where(b >= 0, root, -root))
        first = q / jnp.where(a == 0, 1.0, a)
        second = d0 / jnp.where(q == 0, 1.0, q)
        good = (first > 0) & (first < 1) & (a != 0)
        return self.low + width * jnp.where(good, first, jnp.clip(second, 0.0, 1.0))


def _sides(memory: _Seen, g: Array, slope: Array) -> Array:
    """(5, E) on which side of each event the motion is at the looks.

    A value within rounding of zero is still on the side it was on. Counting an exact zero as
    crossed would see crossings in the rounding just after a start on the event.
    """
    side = memory.side
    sides = [jnp.where(side == 0, _first_side(g, slope, memory.noise), side)]
    for value in g[1:]:
        sides.append(jnp.where(jnp.abs(value) <= memory.noise, sides[-1], jnp.sign(value)))
    return jnp.stack(sides)


def _first_side(g: Array, slope: Array, noise: Array) -> Array:
    """(E,) on which side of each event the motion is just after its start.

    Where it starts on the event the slope says so, and where the slope is zero as well (it
    lifts off with no speed) the first look that is clear of rounding.
    """
    near = _AT_START * jnp.maximum(jnp.abs(slope[0]), jnp.abs(slope[1]))
    side = jnp.zeros_like(noise)
    for value in g[:0:-1]:
        side = jnp.where(jnp.abs(value) > noise, jnp.sign(value), side)
    side = jnp.where(jnp.abs(slope[0]) > noise, jnp.sign(slope[0]), side)
    side = jnp.where(jnp.abs(g[0]) > jnp.maximum(near, noise), jnp.sign(g[0]), side)
    return jnp.where(side == 0, 1.0, side)


def _brackets(sides, turn, beyond, wanted) -> tuple[Array, Array, Array]:
    """(E,) parts of the step between which each event first happens, inf if not; side after."""
    low = jnp.broadcast_to(_LOOKS[:-1, None], turn.shape)
    high = jnp.broadcast_to(_LOOKS[1:, None], turn.shape)
    s = sides[:-1]
    across = (s * sides[1:] < 0) & ((wanted == 0) | (wanted == sides[1:]))
    out = beyond & ((wanted == 0) | (wanted == -s))  # to the other side, before the turn
    back = beyond & (wanted == s)  # and back again, after it
    hit = across | out | back
    first, pick = jnp.argmax(hit, axis=0), jnp.arange(hit.shape[1])

    def chosen(x):
        return jnp.where(hit.any(axis=0), x[first, pick], jnp.inf)

    lows, highs = jnp.where(back, turn, low), jnp.where(out, turn, high)
    return chosen(lows), chosen(highs), chosen(jnp.where(back, s, -s))


def _polished(watch: _Lookout, seen: _Seen) -> tuple[Array, Array]:
    """(E,) times after the last node at which events happen, inf if not, and the states (k, E).

    Newton's method kept in its bracket. The low end may be where the motion began, with a
    value of rounding noise: so the side that is left is known, not looked up there.
    """
    t0, found = seen.t0, jnp.isfinite(seen.low)

    def body(carry):
        n, low, high, h, _, _ = carry
        g, slope, y = watch.look(t0, seen.y0, h)
        g, slope = jnp.diagonal(g), jnp.diagonal(slope)
        before = jnp.sign(g) == -seen.towards
        low, high = jnp.where(before, h, low), jnp.where(before, high, h)
        new = h - g / jnp.where(slope == 0, 1.0, slope)
        inside = (new - low) * (new - high) < 0
        new = jnp.where(inside & (slope != 0) & (n % 8 != 7), new, 0.5 * (low + high))
        change = jnp.where(g == 0, 0.0, jnp.abs(new - h))
        done = change <= _spacing(h, t0)
        return n + 1, low, high, jnp.where(done, h, new), change, y

    def going(carry):
        n, _, _, h, change, _ = carry
        return (n < _POLISH) & (found & (change > _spacing(h, t0))).any()

    low, high = jnp.where(found, seen.low, 0.0), jnp.where(found, seen.high, 0.0)
    like = jnp.broadcast_to(seen.y0[:, None], (*seen.y0.shape, *low.shape))
    start = (0, low, high, 0.5 * (low + high), jnp.full_like(low, jnp.inf), like)
    _, _, _, h, _, y = jax.lax.while_loop(going, body, start)
    return jnp.where(found, h, jnp.inf), y


class _Parts(NamedTuple):
    """What the values are made of where the motion is at (t, y)."""

    values: Array  # (E,)
    rows: Array  # (E, k) sizes of the derivatives by the state
    slopes: Array  # (E,) along the motion
    speeds: Array  # (E,) sizes of what the slopes are sums of


def _parts(field, events: tuple, t: Array, y: Array) -> _Parts:
    rate, fn = field.rate(t, y), functools.partial(values, events)
    by_time, rows = jax.jacfwd(fn, argnums=(0, 1))(t, y)
    terms = jnp.concatenate([by_time[:, None], rows * rate[None]], axis=-1)
    return _Parts(fn(t, y), jnp.abs(rows), jnp.sum(terms, -1), jnp.sum(jnp.abs(terms), -1))


def _off(parts: _Parts, state: Array, time: Array) -> Array:
    """(E,) how far values may be off where so large a state and time are right to rounding."""
    moved = jnp.sum(parts.rows * state[None], -1) + time * parts.speeds
    return _ROUNDINGS * jnp.finfo(state.dtype).eps * moved


def coincident(field, events: tuple, y0: Array, t0: Array, t: Array, y: Array, direction) -> Array:
    """(E,) whether each event happens at (t, y) of the motion from (t0, y0), but for rounding."""
    parts = _parts(field, events, t, y)
    here = jnp.abs(parts.values) <= _off(parts, jnp.abs(y0) + jnp.abs(y), jnp.abs(t0) + jnp.abs(t))
    wanted = jnp.array([event.direction for event in events])
    return here & ((wanted == 0) | (wanted * direction * parts.slopes > 0))


def _spacing(h: Array, t0: Array) -> Array:
    return 0.5 * jnp.finfo(h.dtype).eps * jnp.maximum(jnp.abs(h), jnp.abs(t0))


def values(events: tuple, t: Array, y: Array) -> Array:
    """(E,) values of all events."""
    return jnp.stack([event.value(t, y) for event in events])
