"""When something happens: the first time a function of the state crosses zero.

`until` follows a motion to the first of several events. It looks at every accepted step and at
three states in between, taken by steps of the method itself (an interpolant would be good to
7 digits only), at values and at slopes: two crossings within a step are found wherever the
slope shows that the value turned towards zero. A motion that starts on an event (after a
bounce, say) has left it, and does not meet it again at once.

The time is polished until it does not change any more, and its derivatives, and those of the
state there, follow the implicit function theorem: dt = -dg / (dg/dt), dy = (dy)_t + f dt.
"""

import abc
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.flow import Flow, Settings, flow, march
from jaxdyn.scene import Field, Scene
from jaxdyn.simulate import MAX_STEPS, RTOL, chosen_pair, tolerances
from jaxdyn.solvers import Pair
from jaxdyn.status import Status
from jaxdyn.stepping import Watch

_LOOKS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # parts of a step at which events are looked at
_AT_START = 1e-9  # an event nearer than this part of the first step was where the motion began
_POLISH = 60  # bisections at most; Newton's steps end it after about five


class Event(eqx.Module):
    """A function of time and state whose zero is looked for."""

    @abc.abstractmethod
    def value(self, t: Array, y: Array) -> Array:
        """() the function; smooth, and of a size that means something."""

    @property
    def direction(self) -> int:
        """+1 for crossings upwards as the motion goes, -1 downwards, 0 both."""
        return 0


class When(Event):
    """The zeros of a named function ``fn(t, y)``; a lambda would be compiled anew each time."""

    fn: Callable[[Array, Array], Array] = eqx.field(static=True)
    way: int = eqx.field(static=True, default=0)

    def value(self, t, y):
        return self.fn(t, y)

    @property
    def direction(self):
        return self.way


class Reaches(Event):
    """An entry of the state reaches a level, e.g. ``Reaches(1, 0.0, -1)``: y falls to 0."""

    entry: int = eqx.field(static=True)
    level: Array = eqx.field(converter=jnp.asarray, default=0.0)
    way: int = eqx.field(static=True, default=0)

    def value(self, t, y):
        del t
        return y[self.entry] - self.level

    @property
    def direction(self):
        return self.way


class Stop(eqx.Module):
    """Where a motion was stopped.

    Attributes:
      t: () time of the event, or the end of the span if there was none.
      y: (k,) state then; NaN if the run failed.
      event: () index of the event, -1 for none.
      status: () `Status` code.
    """

    t: Array
    y: Array
    event: Array
    status: Array

    @property
    def happened(self) -> bool:
        """Whether it was an event that ended the motion; host only."""
        return bool(self.event >= 0)


def until(
    scene: Scene,
    events: Event | tuple[Event, ...],
    t1=None,
    *,
    t0=0.0,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Pair | None = None,
    max_steps: int = MAX_STEPS,
) -> Stop:
    """The first event of a motion: when, and the state then.

    Args:
      scene: system, effects, start.
      events: what to look for.
      t1: () end of the span [s], where the motion stops if nothing happened before; the
        scene's own span if left out.
      t0: () start time [s].
      rtol: see `simulate`.
      atol: see `simulate`.
      solver: see `simulate`.
      max_steps: see `simulate`.
    Limits: two crossings are missed if the value turns three times within a quarter of a step.
      Derivatives are of first order; at a grazing contact they are infinite.
    Example:
      >>> from jaxdyn import events, scenes
      >>> stop = events.until(scenes.cannonball(g=10.0, speed=10.0), events.Reaches(1, 0.0, -1), 9.0)
      >>> round(float(stop.t), 12)
      1.414213562373
    """
    events = (events,) if isinstance(events, Event) else tuple(events)
    if not events:
        raise _checks.fail("events", "at least one", "none", "simulate() runs to a time.")
    scene.check()
    settings = Settings(chosen_pair(scene, solver), max_steps)
    t0 = _checks.array("t0", t0, ())
    t1 = _checks.array("t1", scene.t1 if t1 is None else t1, ())
    tolerance = jnp.asarray(tolerances(rtol, atol))
    return _until(scene.field, events, scene.y0, t0, t1, tolerance, settings=settings)


@eqx.filter_jit
def _until(field, events, y0, t0, t1, tolerance, *, settings: Settings) -> Stop:
    which, t, status = _located(field, events, y0, t0, t1, tolerance, settings)
    end: Flow = flow(field, y0, t0, t, jnp.zeros(0), tolerance, settings=settings)
    y = end.y1

    # One Newton step from the located time: no change in value, the derivative of the implicit
    # function theorem.
    def miss(t, y):
        return jnp.stack([event.value(t, y) for event in events])[which]

    g, slope = jax.jvp(miss, (t, y), (jnp.ones_like(t), field.rate(t, y)))
    slope = jax.lax.stop_gradient(slope)
    happened = which >= 0
    shift = jnp.where(happened, -g / jnp.where(happened, slope, 1.0), 0.0)
    # Its value is rounding noise; its derivative is what counts.
    shift = shift - jax.lax.stop_gradient(shift)
    y = y + field.rate(t, y) * shift
    return Stop(t + shift, y, which, status)


class _Seen(NamedTuple):
    """What the watch remembers; one entry for each of the E events."""

    side: Array  # (E,) sign of each value so far, 0 before the first step
    t0: Array  # () last accepted node before the events found
    y0: Array  # (k,)
    low: Array  # (E,) bracket as time after t0; inf where nothing was found
    high: Array  # (E,)


class _EventWatch(Watch):
    field: Field
    events: tuple[Event, ...]
    pair: Pair = eqx.field(static=True)
    direction: Array | float = 1.0

    def towards(self, direction):
        return _EventWatch(self.field, self.events, self.pair, direction)

    def start(self, t0, y0):
        nothing = jnp.full(len(self.events), jnp.inf)
        return _Seen(jnp.zeros(len(self.events)), t0, y0, nothing, nothing)

    def see(self, keep, t0, y0, t1, y1, memory):
        del y1
        h = self.direction * (t1 - t0)
        begin = self.direction * t0
        wanted = jnp.array([event.direction for event in self.events])
        g, slope = self.looked(begin, y0, _LOOKS * h)
        slope = slope * self.direction
        side = jnp.where(memory.side == 0, _first_side(g, slope, jnp.abs(h)), memory.side)
        sides = [side]
        for value in g[1:]:
            # Landing on zero exactly counts as having crossed.
            sides.append(jnp.where(value == 0, -sides[-1], jnp.sign(value)))
        sides = jnp.stack(sides)
        turn, beyond = self._turns(begin, y0, h, g, slope, sides)
        low, high = _brackets(sides, turn, beyond, wanted)
        found = jnp.isfinite(low) & keep
        low, high = (jnp.where(found, x * h, jnp.inf) for x in (low, high))
        seen = _Seen(sides[-1], begin, y0, low, high)
        memory = jax.tree.map(lambda new, old: jnp.where(keep, new, old), seen, memory)
        return memory, found.any()

    def looked(self, t: Array, y: Array, hs: Array) -> tuple[Array, Array]:
        """(s, E) values and slopes at the times t + hs, by steps of the method from (t, y)."""

        def look(h):
            x = stepped(self.field, self.pair, t, y, h)
            rate = self.field.rate(t + h, x)
            return jax.jvp(self._values, (t + h, x), (jnp.ones_like(h), rate))

        return jax.vmap(look)(hs)

    def _values(self, t, y):
        return jnp.stack([event.value(t, y) for event in self.events])

    def _turns(self, t, y, h, g, slope, sides) -> tuple[Array, Array]:
        """(4, E) where in each quarter a value turns, and whether it is beyond zero there."""
        s = sides[:-1]
        hidden = (s == sides[1:]) & (s * slope[:-1] < 0) & (s * slope[1:] > 0)
        width = jnp.abs(h) * (_LOOKS[1] - _LOOKS[0])
        part = _cubic_extremum(g[:-1], g[1:], width * slope[:-1], width * slope[1:])
        turn = _LOOKS[:-1, None] + part * (_LOOKS[1:] - _LOOKS[:-1])[:, None]

        def investigate():
            values, _ = self.looked(t, y, (turn * h).ravel())
            e = len(self.events)
            own = jnp.diagonal(values.reshape(-1, e, e), axis1=1, axis2=2)
            return hidden & (s * own < 0)

        beyond = jax.lax.cond(hidden.any(), investigate, lambda: jnp.zeros_like(hidden))
        return turn, beyond


def stepped(field: Field, pair: Pair, t: Array, y: Array, h: Array) -> Array:
    """(k,) the state after one step of the method, projected like any other step."""
    increment, _ = pair.step(field.rate, t, h, y, rolled=True)
    return field.project(t + h, y + increment)


def _first_side(g: Array, slope: Array, h: Array) -> Array:
    """(E,) on which side of each event the motion is just after its start."""
    at_zero = jnp.abs(g[0]) <= _AT_START * h * jnp.maximum(jnp.abs(slope[0]), jnp.abs(slope[1]))
    later = jnp.where(slope[0] != 0, jnp.sign(slope[0]), jnp.sign(g[1]))
    side = jnp.where(at_zero, later, jnp.sign(g[0]))
    return jnp.where(side == 0, 1.0, side)


def _cubic_extremum(g0: Array, g1: Array, d0: Array, d1: Array) -> Array:
    """Where in (0, 1) the cubic with these end values and slopes turns, for d0 d1 < 0."""
    a = 3 * (d0 + d1) - 6 * (g1 - g0)
    b = 6 * (g1 - g0) - 4 * d0 - 2 * d1
    root = jnp.sqrt(jnp.maximum(b * b - 4 * a * d0, 0.0))
    q = -0.5 * (b + jnp.where(b >= 0, root, -root))
    first = q / jnp.where(a == 0, 1.0, a)
    second = d0 / jnp.where(q == 0, 1.0, q)
    return jnp.where((first > 0) & (first < 1) & (a != 0), first, jnp.clip(second, 0.0, 1.0))


def _brackets(sides, turn, beyond, wanted) -> tuple[Array, Array]:
    """(E,) the parts of the step between which each event happens first; inf where not."""
    low, high = _LOOKS[:-1, None], _LOOKS[1:, None]
    s = sides[:-1]
    across = (s != sides[1:]) & ((wanted == 0) | (wanted == sides[1:]))
    out = beyond & ((wanted == 0) | (wanted == -s))  # to the other side, before the turn
    back = beyond & (wanted == s)  # and back again, after it
    lows = jnp.where(back, turn, jnp.broadcast_to(low, turn.shape))
    highs = jnp.where(out, turn, jnp.broadcast_to(high, turn.shape))
    hit = across | out | back
    first = jnp.argmax(hit, axis=0)
    pick = jnp.arange(hit.shape[1])
    found = hit.any(axis=0)
    low, high = lows[first, pick], highs[first, pick]
    return jnp.where(found, low, jnp.inf), jnp.where(found, high, jnp.inf)


def _located(field, events, y0, t0, t1, tolerance, settings):
    """Index of the first event (-1 for none), its time or t1, and the status; no derivatives."""
    stopped = jax.lax.stop_gradient((field, events, y0, t0, t1, tolerance))
    field, events, y0, t0, t1, tolerance = stopped
    watch = _EventWatch(field, events, settings.pair)
    out, seen = march(field, y0, t0, t1, jnp.zeros(0), tolerance, settings=settings, watch=watch)
    hs = jax.vmap(lambda i, low, high: _polished(watch, seen, i, low, high))(
        jnp.arange(len(events)), seen.low, seen.high
    )
    which = jnp.argmin(jnp.abs(hs))
    happened = jnp.isfinite(hs[which]) & (out.status == Status.OK)
    t = jnp.where(happened, seen.t0 + hs[which], t1)
    return jnp.where(happened, which, -1), t, out.status


def _polished(watch: _EventWatch, seen: _Seen, i: Array, low: Array, high: Array) -> Array:
    """() time after the node at which event i happens: Newton's method kept in its bracket."""

    def value(h):
        g, slope = watch.looked(seen.t0, seen.y0, h[None])
        return g[0, i], slope[0, i]

    # The side that is left; at the low end the value itself may be rounding noise.
    side = -jnp.sign(value(high)[0])

    def body(carry):
        n, low, high, h, _ = carry
        g, slope = value(h)
        before = jnp.sign(g) == side
        low, high = jnp.where(before, h, low), jnp.where(before, high, h)
        new = h - g / jnp.where(slope == 0, 1.0, slope)
        inside = (new - low) * (new - high) < 0
        new = jnp.where(inside & (slope != 0) & (n % 8 != 7), new, 0.5 * (low + high))
        return n + 1, low, high, jnp.where(g == 0, h, new), jnp.abs(new - h) * (g != 0)

    def going(carry):
        n, low, high, h, change = carry
        tiny = 2 * jnp.finfo(h.dtype).eps * jnp.maximum(jnp.abs(h), jnp.abs(seen.t0))
        return (n < _POLISH) & (change > 0.25 * tiny) & jnp.isfinite(low)

    middle = 0.5 * (low + high)
    h = jax.lax.while_loop(going, body, (0, low, high, middle, jnp.abs(high - low)))[3]
    return jnp.where(jnp.isfinite(low), h, jnp.inf)
