"""The sizes of a state along a motion, relative to which a tolerance is absolute by default.

The error that a step may have in an entry is

    atol + share * size + rtol * |y|

with `atol` in the units of the state, where it is given, and otherwise a share of the size of the
entry, by default a quarter of `rtol`. Sizes are the largest so far of each group of entries
(`scales.Groups`). At the start, where an entry may be zero that others move at once, they are a
part of the scales that the rate shows there. So an entry that is zero, or rounding, for a while or
by symmetry does not require smaller steps.

Tangents of a state (k, columns) are as large as their column: the largest of its entries, each
measured in the size of the state's entry, whatever the units of entries and of perturbed numbers.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn.scales import LATER, Groups, at_start, notable, rounding

#: The part of the scales at the start that counts until the motion has shown its own. These scales
#: are what an entry reaches in the time of the motion, unless others stop it before.
PART = 0.1

#: Multiple of what rounding makes of an entry in a time of the motion that a step may be off by.
_NOISE = 32.0
#: The part of what a rejected step would have made of an entry at rest that becomes its size.
_GLIMPSE = 0.01


class AtStart(NamedTuple):
    """What is known at a start.

    Attributes:
      sizes: (k, ...) the sizes of the entries.
      time: () the time in which the motion changes.
      rate: (k,) the rate there, of the state alone; (k, ...) where steps have one length.
      noise: (k, ...) what rounding makes of the rate, if that is known.
    """

    sizes: Array
    time: Array
    rate: Array
    noise: Array | None = None


def sizes_at_start(field: Any, t0: Array, y0: Array, t1: Array) -> AtStart:
    """The sizes of a state (k, ...) at its start, and the rate and the time of its motion.

    Args:
      field: has ``rate`` and ``groups``; for a state with tangents also ``single``, the field of
        the state alone.
      t0: () start time.
      y0: (k, ...) start.
      t1: () end time.
    """
    with_tangents = field
    field, y = _alone(field, y0)
    scales, rate = at_start(field, field.groups, t0, y, t1)
    sizes = jnp.maximum(field.groups.sizes(jnp.abs(y)), PART * scales.sizes)
    if y0.ndim == 1:
        return AtStart(sizes, scales.time, rate, scales.noise)
    later = t0 + LATER * jnp.sign(t1 - t0) * scales.time
    rates, noise = _rates_beside(with_tangents, y0, jnp.stack([t0, later]), sizes, scales.time)
    wide = jnp.concatenate([sizes[:, None], PART * scales.time * rates], axis=1).reshape(y0.shape)
    of_state = jnp.zeros_like(y) if scales.noise is None else scales.noise
    noise = jnp.concatenate([of_state[:, None], noise], axis=1).reshape(y0.shape)
    return AtStart(grow(field.groups, wide, y0), scales.time, rate, noise)


def _rates_beside(
    field: Any, y: Array, ts: Array, sizes: Array, time: Array
) -> tuple[Array, Array]:
    """(k, c) sizes of the rates of tangents beside the start, and of their rounding.

    Tangents that begin as zero, in a force that is zero both there and a little later, may grow by
    any power of time. They have the size of what moves them a little further on: measured by
    themselves, each step would be too long, or, where that zero is rounding, too short. Tangents of
    tangents are moved by these, so there is one look for each level.

    Args:
      field: has ``rate``.
      y: (k, ...) the state with its tangents.
      ts: (2,) times of a look on one side and of one on the other.
      sizes: (k,) sizes of the state, which is moved by a part of them.
      time: () the time of the motion.
    """
    levels = y.ndim - 1
    flat, near = y.reshape(len(y), -1), rounding(y)
    ways = jnp.resize(jnp.array([1.0, -1.0, -1.0]), flat.shape)

    def look(carry: tuple[Array, ...], at: tuple[Array, ...]) -> tuple[tuple[Array, ...], None]:
        beside, rates, down, up, gap = carry
        t, side, rounded, begins = at
        grown = _of_tangents(sizes, PART * time * rates[:, 1:])
        beside = lax.select(begins, beside.at[:, 1:].set(grown), beside)
        moved = flat + side * jnp.concatenate([beside[:, :1], ways[:, 1:] * beside[:, 1:]], axis=1)
        moved = moved * (1.0 + near[:, None] * rounded)
        found = field.rate(t, moved.reshape(y.shape)).reshape(flat.shape)
        found = jnp.where(jnp.isfinite(found), found, 0.0)
        again, known = rounded > 0, lax.select(side < 0, down, up)
        gap = lax.select(again, jnp.maximum(gap, jnp.abs(found - known)), gap)
        rates = lax.select(again, rates, jnp.maximum(rates, jnp.abs(found)))
        down = lax.select(~again & (side < 0), found, down)
        up = lax.select(~again & (side > 0), found, up)
        return (beside, rates, down, up, gap), None

    # It is a loop so that the rate is compiled once.
    zero, looks = jnp.zeros_like(flat), 2 * levels + 2
    places = jnp.tile(ts, levels + 1), jnp.tile(jnp.array([-1.0, 1.0]), levels + 1)
    rounded = jnp.asarray(np.arange(looks) >= 2 * levels, float)
    begins = jnp.asarray((np.arange(looks) % 2 == 0) & (np.arange(looks) < 2 * levels))
    begin = zero.at[:, 0].set(PART * sizes), zero, zero, zero, zero
    (_, rates, _, _, gap), _ = lax.scan(look, begin, (*places, rounded, begins))
    rates, gap = (_of_tangents(sizes, x[:, 1:]) for x in (rates, gap))
    return rates, notable(gap, rates)


def above_noise(start: AtStart, tolerance: Array) -> AtStart:
    """What is known at a start, with sizes whose tolerances exceed what rounding does in a time.

    A body at rest in space may be moved by the rounding of its turning: no step is short enough to
    resolve that.
    """
    if start.noise is None:
        return start
    share, k = tolerance[2], len(start.sizes)
    least = jnp.where(share > 0, _NOISE * start.time * start.noise / share, 0.0).reshape(k, -1)
    flat = start.sizes.reshape(k, -1)
    state = jnp.maximum(flat[:, :1], least[:, :1])
    tangents = jnp.maximum(flat[:, 1:], _of_tangents(state[:, 0], least[:, 1:]))
    flat = jnp.concatenate([state, tangents], axis=1)
    return start._replace(sizes=flat.reshape(start.sizes.shape))


def state_of(y: Array) -> Array:
    """The state (k,) of a state with tangents (k, ...)."""
    return y.reshape(len(y), -1)[:, 0]


def groups_of(field: Any, y: Array) -> Groups:
    """The groups of the state alone."""
    return _alone(field, y)[0].groups


def _alone(field: Any, y: Array) -> tuple[Any, Array]:
    """The field of the state without its tangents, and the state (k,)."""
    while y.ndim > 1:
        field, y = field.single, y[..., 0]
    return field, y


def grow(groups: Groups, sizes: Array, y: Array) -> Array:
    """The sizes (k, ...) after a step to y (k, ...): nowhere smaller than before."""
    if y.ndim == 1:
        return jnp.maximum(sizes, groups.sizes(jnp.abs(y), in_loop=True))
    flat = sizes.reshape(len(y), -1), jnp.abs(y).reshape(len(y), -1)
    old, now = flat
    state = jnp.maximum(old[:, 0], groups.sizes(now[:, 0], in_loop=True))
    found = jnp.concatenate([state[:, None], _of_tangents(state, now[:, 1:])], axis=1)
    return jnp.maximum(old, found).reshape(y.shape)


def sizes_after_rejection(sizes: Array, tried: Array) -> Array:
    """The sizes (k, ...) after a step that is rejected, which changes them for entries at rest.

    An entry that was at rest so far gets a small part of what the step would have made of it:
    measured by itself, an entry that begins to move at once would have no size at any step.
    """
    found = jnp.where(jnp.isfinite(tried), tried, 0.0)
    return jnp.where(sizes > 0, sizes, _GLIMPSE * found)


def allowed_error(tolerance: Array, sizes: Array, y0: Array, y1: Array) -> Array:
    """The error (k, ...) that a step from y0 to y1 may have, with the sizes after it."""
    now = jnp.maximum(jnp.abs(y0), jnp.abs(y1))
    if y0.ndim > 1:
        state, flat = sizes.reshape(len(now), -1)[:, 0], now.reshape(len(now), -1)
        wide = jnp.concatenate([flat[:, :1], _of_tangents(state, flat[:, 1:])], axis=1)
        now = wide.reshape(now.shape)
    return absolute(tolerance, sizes) + tolerance[0] * now


def absolute(tolerance: Array, sizes: Array) -> Array:
    """The part (k, ...) of the error that a step may have that does not depend on the step.

    It is positive even for an entry that never moves, and has no error.
    """
    return tolerance[1] + tolerance[2] * sizes + jnp.finfo(sizes.dtype).tiny


def _of_tangents(state: Array, tangents: Array) -> Array:
    """Sizes (k, c) of tangents whose entries have magnitudes (k, c); see above.

    Where entries of the state have no size, and so never move, their tangents are as large as the
    largest of such tangents in their column. For a state at rest these are all, since a tangent
    may decay next to one that grows.
    """
    moves = (state > 0)[:, None]
    parts = jnp.where(moves, tangents / jnp.where(moves, state[:, None], 1.0), 0.0)
    still = jnp.max(jnp.where(moves, 0.0, tangents), axis=0)[None]
    return jnp.where(moves, state[:, None] * jnp.max(parts, axis=0)[None], still)
