"""The times of events, from brackets to full precision."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.integrate.event_search.event_values import Sight, values

_MIN_BRACKET_PART = 2.0**-80  # of a bracket: an event this close to its beginning happens there
#: Newton steps or bisections at most; about five are usual. At a flat zero every second look halves
#: the bracket.
_MAX_LOOKS = 200
_SHORT = 2.0**-20  # by this part the last correction falls short where the full one is too much


class Bracket(NamedTuple):
    """Times that enclose each of E events, and the sign after it.

    Attributes:
      low: (E,) the earlier time; infinite where nothing was found.
      high: (E,) the later one.
      towards: (E,) sign of the value after the crossing.
    """

    low: Array
    high: Array
    towards: Array

    @classmethod
    def none(cls, like: Array) -> "Bracket":
        """Nothing was found."""
        nothing = jnp.full_like(like, jnp.inf)
        return cls(nothing, nothing, jnp.zeros_like(like))

    @property
    def found(self) -> Array:
        """(E,) whether something was."""
        return jnp.isfinite(self.low)


class _Polish(NamedTuple):
    """The state of the polishing iteration."""

    n: Array  # () evaluations so far
    low: Array  # (E,) bracket as time after the node
    high: Array  # (E,)
    h: Array  # (E,) time of the next evaluation, or of the last one where done
    last: Array  # (E,) the last step of h
    back: Array  # (E,) length of the last step back, once Newton's method has converged
    arrived: Array  # (E,) whether it has
    done: Array  # (E,)
    y: Array  # (k, E) the states at the last look


def polish(sight: Sight, t0: Array, y0: Array, bracket: Bracket) -> tuple[Array, Array]:
    """(E,) times after t0 at which events happen, inf if not, and the states (k, E) then.

    Newton's method safeguarded by its bracket: bisection where its steps are not halved. The search
    has arrived where a neighbour of the state is on the other side, or two times are: the size of
    the value does not tell, since a value that is flat at its zero is tiny far from it. The low
    end may be the start of the motion, with a value of rounding noise, so the sign there is known
    from the bracket, not evaluated. In the end, when only rounding remains, it steps back to a
    state that is not beyond the event: a ball released below the floor, even by one rounding, may
    never come above it, and would fall through.
    """
    found, towards = bracket.found, bracket.towards
    first = jnp.where(found, bracket.low, 0.0)
    last = jnp.where(found, bracket.high, 0.0)
    eps = jnp.finfo(y0.dtype).eps
    least = _MIN_BRACKET_PART * jnp.abs(last - first)

    def look(p: _Polish) -> _Polish:
        ahead = sight.after(t0, y0, p.h)
        g, slope, side = (jnp.diagonal(x) for x in (ahead.g, ahead.slope, ahead.side))
        # A start on the event may be beyond it by rounding, and leave before it returns.
        leaves = (first == 0) & (slope * (p.high - p.low) * towards < 0)
        before = (jnp.sign(g) == -towards) | leaves
        low, high = jnp.where(before, p.h, p.low), jnp.where(before, p.high, p.h)
        new = p.h - g / jnp.where(slope == 0, 1.0, slope)
        change = jnp.where(slope == 0, jnp.inf, jnp.abs(new - p.h))
        # Times relative to the node are finer than absolute ones: short bounces are resolved.
        fine = jnp.maximum(2 * eps * jnp.abs(p.h), least)
        exact = (side == 0) | (change <= fine) | (jnp.abs(high - low) <= fine)
        arrived = p.arrived | exact
        good = ((new - low) * (new - high) < 0) & (2 * change <= p.last)
        new = jnp.where(good, new, 0.5 * (low + high))
        at_begin = jnp.abs(high - first) <= 16 * least
        done = arrived & ((g == 0) | (before != at_begin))
        back = jnp.where(p.arrived, 2 * p.back, fine)
        nearer = jnp.where(at_begin, high, p.h + jnp.clip(low - p.h, -back, back))
        new = jnp.where(done, p.h, jnp.where(arrived, nearer, new))
        return _Polish(
            n=p.n + 1,
            low=low,
            high=high,
            h=new,
            last=jnp.abs(new - p.h),
            back=back,
            arrived=arrived,
            done=done,
            y=ahead.y,
        )

    def going(p: _Polish) -> Array:
        return (p.n < _MAX_LOOKS) & (found & ~p.done).any()

    h = 0.5 * (first + last)
    far, no = jnp.full_like(h, jnp.inf), jnp.zeros_like(found)
    y = jnp.broadcast_to(y0[:, None], (*y0.shape, *h.shape))
    begin = _Polish(
        n=jnp.zeros((), int),
        low=first,
        high=last,
        h=h,
        last=far,
        back=far,
        arrived=no,
        done=no,
        y=y,
    )
    end = jax.lax.while_loop(going, look, begin)
    return jnp.where(found, end.h, jnp.inf), end.y


def land(
    sight: Sight, which: Array, t0: Array, h: Array, y: Array, towards: Array
) -> tuple[Array, Array]:
    """Time after t0 and state of an event, moved onto it as far as it is not beyond then.

    A step ends within rounding of the event. In a straight line from there the value can be brought
    nearer to zero than the rounding of a step: a motion that starts there is known to start on the
    event, without knowing how large the state has been.

    Args:
      sight: the events.
      which: () index of the event.
      t0: () time of the node.
      h: () time after it; infinite if there is no event.
      y: (k,) state then, not beyond the event.
      towards: () sign of the value beyond it.
    """
    t = t0 + jnp.where(jnp.isfinite(h), h, 0.0)
    rate = sight.field.rate(t, y)

    def value(t, y):
        return values(sight.events, t, y)[which]

    g, slope = jax.jvp(value, (t, y), (jnp.ones_like(t), rate))
    on = -g / jnp.where(slope == 0, 1.0, slope)
    on = jnp.where((slope != 0) & (on * h > 0), on, 0.0)  # else it is beyond, or there is none
    best_h, best_y = h, y
    for more in ((1 - _SHORT) * on, on):
        new = y + more * rate
        left = -towards * value(t + more, new)
        nearer = (left >= 0) & (left <= jnp.abs(g))
        best_h, best_y = jnp.where(nearer, h + more, best_h), jnp.where(nearer, new, best_y)
    return best_h, best_y
