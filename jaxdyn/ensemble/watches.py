"""Observers of running motions: close returns, a stopping condition, several together.

A `Watch` sees every accepted step of a motion and reduces the steps to a few numbers, so that a
long run need not be stored. These are for `ensemble.run`; `events` has its own.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn._checks import as_float, fail, floats
from jaxdyn.integrate.march import Watch
from jaxdyn.scene import Field, Scene, System

_NEWTON_STEPS = 4  # steps of Newton's method for the least distance within a step


class Gap(eqx.Module):
    """The distance of two states: `System.difference` with weighted entries.

    Use another module with the same call where returns count modulo something: a turn, a
    permutation of bodies.

    Attributes:
      system: the system of the states.
      weight: (k,) or () factors of the entries, e.g. 1 / scale; 0 leaves one out.
    """

    system: System
    weight: Array = eqx.field(converter=as_float, default=1.0)

    def __call__(self, y: Float[Array, " k"], start: Float[Array, " k"]) -> Array:
        """(m,) entries of the distance from start to y."""
        return self.weight * self.system.difference(y, start)


class ClosestReturn(NamedTuple):
    """The closest return so far, one for each window of time.

    Attributes:
      distance: () or (w,) its distance from the start; infinite if there was none.
      after: () or (w,) its time after the start; NaN if there was none.
    """

    distance: Array
    after: Array


class _Returning(NamedTuple):
    best: ClosestReturn
    t0: Array  # () start time
    start: Array  # (k,) start
    gap: Array  # (m,) gap at the last node, and its slope
    slope: Array


class CloseReturn(Watch):
    """The closest return to the start: the least of the local minima of |gap|.

    Between two steps the gap is the cubic with its values and slopes at both ends, which is
    accurate to some 1e-4 of its size at the steps of tight tolerances: enough for an initial
    guess. A motion that only leaves its start has no return: the distance is infinite, the time
    NaN. Two returns within one step of the method count as one or none.

    Attributes:
      field: the field of the motion.
      later: () or (w,) time after the start from which on returns count; each of several windows
        has its own closest return, so that a near one does not hide the others.
      close: () the first return as close as this is taken. Without it, a periodic motion may be
        found to return after several periods, all being equally close up to rounding.
      gap: `Gap` or a custom module, (y, start) -> (m,).
      before: () or (w,) time after the start until which returns count.
    """

    field: Field
    later: Array
    close: Array
    gap: Callable[[Array, Array], Array]
    before: Array
    direction: Array | float = 1.0

    @classmethod
    def of(
        cls, scene: Scene, later=0.0, close=0.0, gap: Callable | None = None, before=jnp.inf
    ) -> "CloseReturn":
        """The watch for a scene; all entries of the state have equal weight by default."""
        gap = Gap(scene.system) if gap is None else gap
        later, close, before = floats(later, close, before)
        return cls(scene.field, later, close, gap, before)

    def start(self, t0, y0):
        shape = jnp.broadcast_shapes(self.later.shape, self.before.shape)
        best = ClosestReturn(jnp.full(shape, jnp.inf), jnp.full(shape, jnp.nan))
        gap, slope = self._gap_and_slope(t0, y0, y0)
        return _Returning(best=best, t0=t0, start=y0, gap=gap, slope=slope)

    def see(self, keep, t0, y0, t1, y1, memory):
        del y0
        gap, slope = self._gap_and_slope(t1, y1, memory.start)
        h = t1 - t0
        cubic = _Cubic.through(memory.gap, h * memory.slope, gap, h * slope)
        s, distance = cubic.nearest()
        best = memory.best
        after = t0 + s * h - memory.t0
        better = keep & (distance < best.distance) & (after >= self.later) & (after < self.before)
        better = better & (best.distance > self.close)
        best = ClosestReturn(
            jnp.where(better, distance, best.distance), jnp.where(better, after, best.after)
        )
        gap, slope = jnp.where(keep, gap, memory.gap), jnp.where(keep, slope, memory.slope)
        return _Returning(
            best=best, t0=memory.t0, start=memory.start, gap=gap, slope=slope
        ), jnp.zeros_like(keep)

    def _gap_and_slope(self, t: Array, y: Array, start: Array) -> tuple[Array, Array]:
        """(m,) the gap and its slope in the direction of the run, where t is negated."""
        rate = self.direction * self.field.rate(self.direction * t, y)
        return jax.jvp(lambda y: self.gap(y, start), (y,), (rate,))


class _Cubic(NamedTuple):
    """The cubic w0 + w1 s + w2 s^2 + w3 s^3 for 0 <= s <= 1, each (m,)."""

    w0: Array
    w1: Array
    w2: Array
    w3: Array

    @classmethod
    def through(cls, w: Array, d: Array, w_end: Array, d_end: Array) -> "_Cubic":
        """The cubic with these values and slopes at both ends."""
        rise = w_end - w
        return cls(w, d, 3 * rise - 2 * d - d_end, d + d_end - 2 * rise)

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Half the square of the length, and its first two derivatives."""
        w = self.w0 + s * (self.w1 + s * (self.w2 + s * self.w3))
        d = self.w1 + s * (2 * self.w2 + s * 3 * self.w3)
        dd = 2 * self.w2 + s * 6 * self.w3
        return 0.5 * jnp.sum(w * w), jnp.sum(w * d), jnp.sum(d * d + w * dd)

    def nearest(self) -> tuple[Array, Array]:
        """Where the length has a minimum inside, and the length there; infinite if it has none."""
        zero, one = jnp.zeros_like(self.w0[0]), jnp.ones_like(self.w0[0])
        (_, before, _), (_, after, _) = self.at(zero), self.at(one)
        inside = (before < 0) & (after >= 0)

        def newton(_, bracket):
            low, high, s = bracket
            _, slope, curvature = self.at(s)
            low, high = jnp.where(slope < 0, s, low), jnp.where(slope < 0, high, s)
            new = s - slope / jnp.where(curvature == 0, 1.0, curvature)
            return low, high, jnp.where((new >= low) & (new <= high), new, 0.5 * (low + high))

        first = before / jnp.where(inside, before - after, 1.0)
        s = jax.lax.fori_loop(0, _NEWTON_STEPS, newton, (zero, one, first))[2]
        return s, jnp.where(inside, jnp.sqrt(2 * self.at(s)[0]), jnp.inf)


class Until(Watch):
    """Ends a motion with the first accepted step at whose end the condition holds.

    It is for motions that are not worth continuing (an escape, a near collision); for the time of
    the event itself use `events`.

    Attributes:
      condition: a module, (t, y) -> () bool.
    """

    condition: Callable[[Array, Array], Array]
    direction: Array | float = 1.0

    def start(self, t0, y0):
        del y0
        return jnp.zeros_like(t0, dtype=bool)

    def see(self, keep, t0, y0, t1, y1, memory):
        """Remembers whether it has stopped the motion."""
        del t0, y0
        stop = memory | (keep & self._holds(self.direction * t1, y1))
        return stop, stop

    def _holds(self, t: Array, y: Array) -> Array:
        """() whether the condition holds.

        Raises:
          ValueError: it is no condition.
        """
        if not callable(self.condition):
            given = type(self.condition).__name__
            remedy = "jaxdyn.until finds the times of events."
            raise fail("condition", "a module with __call__(self, t, y)", given, remedy)
        holds = jnp.asarray(self.condition(t, y))
        if holds.shape or holds.dtype != bool:
            given = f"{holds.dtype} of shape {holds.shape}"
            raise fail("condition", "one True or False", given, "Compare: return y[0] > 1.0.")
        return holds


class Together(Watch):
    """Several watches of one motion; the memory is the tuple of their memories."""

    watches: tuple[Watch, ...]

    def __init__(self, *watches: Watch):
        self.watches = watches

    def towards(self, direction):
        return Together(*(watch.towards(direction) for watch in self.watches))

    def start(self, t0, y0):
        return tuple(watch.start(t0, y0) for watch in self.watches)

    def see(self, keep, t0, y0, t1, y1, memory: Any):
        seen = [
            watch.see(keep, t0, y0, t1, y1, own)
            for watch, own in zip(self.watches, memory, strict=True)
        ]
        stop = jnp.stack([stop for _, stop in seen]).any()
        return tuple(own for own, _ in seen), stop
