"""Events whose values stay at zero for a while: a motion that is held on a surface, as by friction.

A value rests if it is a function that vanishes on the surfaces on which the motion slides, as a
velocity does while friction holds a block. Errors of the motion along them would give it random
signs, so it is not evaluated there: it counts as having the sign to which it was crossing, or 0 if
the motion starts at rest. Where a surface releases the motion, the branch that follows determines
the sign of the value without any rounding, since the motion goes on either behind that surface or
before it.
"""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import solve_spd, value_and_jacfwd
from jaxdyn.integrate.event_search import event_values
from jaxdyn.integrate.event_search.event_values import count, directions, sizes, values
from jaxdyn.integrate.event_search.event_values import sides as signs
from jaxdyn.plan import Plan, plan_of
from jaxdyn.plan.branch import Branch, InBranch
from jaxdyn.plan.plan import without_wrappers

#: Roundings of state and time by which a value at rest may miss zero.
_ROUNDINGS = 64
#: Part of the gradient of a value at rest that may be along the surfaces.
_ALONG = 1e-6


class Resting(eqx.Module):
    """An event whose values are replaced by constant signs while they rest.

    Attributes:
      event: the event.
      rests: (n,) whether each of its n values rests.
      side: (n,) the sign that replaces each value that rests.
    """

    event: Any
    rests: Array
    side: Array

    @property
    def count(self) -> int:
        """Number of its values."""
        return count(self.event)

    @property
    def direction(self) -> int:
        """The direction of the event."""
        return self.event.direction

    def value(self, t: Array, y: Array) -> Array:
        """(n,) the values."""
        return jnp.where(self.rests, self.side, self.event.value(t, y))


def in_margins(events: tuple, field: InBranch, held: Array, plan: Plan, t: Array, y: Array):
    """Values as linear combinations of the margins of the surfaces on which the motion is.

    Args:
      events: E events.
      field: the rate, in a branch with the outcomes for which the margins are meant.
      held: (w, e) the conditions that change on each surface, see `Branch.surfaces`.
      plan: the plan of the rate.
      t: () time.
      y: (k,) state.
    Returns:
      (E, w) the coefficients of the margins in each value, (E,) whether the value does not change
      along the surfaces, (E,) the value less this combination, and one rounding of a value for an
      entry (E, k) of size one and for the time (E,).
    """
    outcomes = field.branch.outcomes
    which, some = jnp.argmax(held, 1), held.any(1)

    def functions(t, y):
        margins = plan.state_margins(field.field, t, y, outcomes)[which]
        return jnp.concatenate([values(events, t, y), margins])

    here, (by_time, rows) = value_and_jacfwd(functions, (0, 1))(t, y)
    n, slopes = len(here) - len(which), jnp.concatenate([rows, by_time[:, None]], 1)
    slopes = jnp.where(jnp.append(jnp.ones(n, bool), some)[:, None], slopes, 0.0)
    most = jnp.max(jnp.abs(slopes), 0)
    slopes = slopes / jnp.where(most > 0, most, 1.0)[None]
    lengths = jnp.sqrt(jnp.sum(slopes**2, 1))
    units = slopes / jnp.where(lengths > 0, lengths, 1.0)[:, None]
    own, normals = units[:n], units[n:]
    gram = jnp.sum(normals[:, None] * normals[None], 2) + jnp.diag(jnp.where(some, 0.0, 1.0))
    parts = solve_spd(gram, jnp.sum(normals[:, None] * own[None], 2)).T
    rest = own - jnp.sum(parts[:, :, None] * normals[None], 1)
    along = jnp.sum(rest**2, 1) > _ALONG**2
    parts = parts * lengths[:n, None] / jnp.where(some, lengths[n:], 1.0)[None]
    off = here[:n] - jnp.sum(jnp.where(some[None], parts * here[n:][None], 0.0), 1)
    eps = jnp.finfo(y.dtype).eps
    roundings = eps * jnp.abs(rows[:n]), eps * jnp.abs(by_time[:n])
    return parts, (lengths[:n] > 0) & ~along, off, roundings


def rests(events: tuple, field: InBranch, plan: Plan, t: Array, y: Array, size: Array) -> Array:
    """(E,) whether the value of each event rests in a branch, for a motion of a size (k,)."""
    held = field.branch.surfaces
    _, normal, off, (by_state, by_time) = in_margins(events, field, held, plan, t, y)
    size = jnp.maximum(size, jnp.abs(y))
    noise = _ROUNDINGS * (jnp.sum(by_state * size[None], 1) + jnp.abs(t) * by_time)
    return held.any() & normal & (jnp.abs(off) <= noise)


def leaves(
    events: tuple, field: InBranch, old: Branch, plan: Plan, t: Array, y: Array
) -> tuple[Array, Array]:
    """Which values cease to rest where surfaces of the old branch release the motion.

    Args:
      events: E events.
      field: the rate in the branch that follows.
      old: the branch before.
      plan: the plan of the rate.
      t: () time.
      y: (k,) state.
    Returns:
      (E,) whether each value ceases to rest, and (E,) its sign afterwards, 0 if that is ambiguous.
    """
    free = old.surfaces & ~field.branch.surface[None]
    parts, normal, _, _ = in_margins(events, field, old.surfaces, plan, t, y)
    # In the branch that follows margins are positive. A coefficient that is rounding counts as 0.
    parts = jnp.where(free.any(1)[None], parts, 0.0)
    least = _ALONG * jnp.max(jnp.abs(parts), 1, keepdims=True)
    parts = jnp.where(jnp.abs(parts) > least, parts, 0.0)
    rise, fall = (parts > 0).any(1), (parts < 0).any(1)
    return normal & (rise | fall), rise.astype(float) - fall.astype(float)


def at_switch(field: InBranch, events: tuple, found, n: int, before: Array):
    """The events where the search ended a piece at a switch.

    An event that is there to rounding happens there: the motion in its branch goes beyond zero.

    Args:
      field: the field in the branch of the piece.
      events: E events.
      found: the `Crossing` that ended the piece, where there is one, of these and others.
      n: number E of their values.
      before: (E,) signs of the values at the start of the piece.
    Returns:
      () index of the event that happens first, or of what else ended the piece, and (E,) signs.
    """
    known = jnp.maximum(sizes(field.system, found.y), found.sizes)
    side, _ = signs(events, found.t, found.y, known, values(events, found.t, found.y))
    beyond = jnp.where(found.sides[:n] == 0, before, found.sides[:n])
    now = found.crossed[:n] & (side * beyond >= 0)
    index = jnp.where((found.event >= n) & now.any(), jnp.argmax(now), found.event)
    return index, jnp.where(side == 0, beyond, side)


def wanted(events: tuple, sides: Array) -> Array:
    """(E,) whether crossings to these sides (E,) count."""
    return (sides != 0) & ((directions(events) == 0) | (directions(events) == sides))


def held(events: tuple, which: Array, side: Array) -> tuple:
    """The events, with the values `which` (E,) that rest replaced by their signs `side` (E,)."""
    ends = np.cumsum([count(event) for event in events])[:-1]
    parts = zip(events, jnp.split(which, ends), jnp.split(side, ends), strict=True)
    return tuple(Resting(*part) for part in parts)


def time_tangent(
    by_value: Callable[..., Array],
    field: Any,
    d_field: Any,
    arrival: Any,
    t: Array,
    y: Array,
    dy: Array,
    rate: Array,
    happened: Array,
) -> Array:
    """The tangent of the time of an event: by its value, or by the margin that ended its rest.

    A value that has rested was zero before, to all orders, so it does not determine the time.

    Args:
      by_value: (t, y, dy, rate, happened) -> `event_values.time_tangent` of its value.
      field: the field.
      d_field: the tangent of its numbers.
      arrival: the last part of the way to the event, a `pieces.Arrival`; several for several times.
      t: () or (n,) the time.
      y: the state then.
      dy: its tangent at that time, kept fixed.
      rate: the rate of the state.
      happened: whether the event happened.
    """
    if arrival is None or not plan_of(without_wrappers(field), y.shape[-1]).most_surfaces:
        return by_value(t, y, dy, rate, happened)
    ended = arrival.ended >= 0

    def ends(field, t, y):
        one = functools.partial(_margin_at_end, field)
        return jax.vmap(one)(arrival, t, y) if t.ndim else one(arrival, t, y)

    by_end = event_values.time_tangent(ends, field, d_field, t, y, dy, rate, happened & ended)
    return jnp.where(ended, by_end, by_value(t, y, dy, rate, happened & ~ended))


def _margin_at_end(field: Any, arrival: Any, t: Array, y: Array) -> Array:
    """() the margin whose zero ended the rest of an event that happens as it does."""
    system = InBranch(without_wrappers(field), arrival.branch)
    return system.change(t, y, jnp.maximum(arrival.ended, 0), slid=True)
