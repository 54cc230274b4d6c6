"""Values of events along a motion, their slopes, and their rounding errors."""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.scene import Field
from jaxdyn.solvers import Method

#: Roundings of state and time by which a value at a start on an event may miss zero.
_START_ROUNDINGS = 16
#: Roundings of the state below which a later value has not changed its side.
SIDE_ROUNDINGS = 4
#: Roundings of state and time within which two events count as simultaneous.
_COINCIDENCE_ROUNDINGS = 64


class Looked(NamedTuple):
    """The E events at a point (t, y) of a motion, one entry each.

    Attributes:
      values: (E,) what crosses zero.
      slopes: (E,) their slopes in time along the motion.
      rounding: (E,) their change by one rounding of the state.
      speeds: (E,) their change by one rounding of a unit of time; one rounding of a slope.
    """

    values: Array
    slopes: Array
    rounding: Array
    speeds: Array


def values(events: tuple, t: Array, y: Array) -> Array:
    """(E,) values of all events."""
    return jnp.stack([event.value(t, y) for event in events])


def looked(field, events: tuple, t: Array, y: Array) -> Looked:
    """The events of a motion at (t, y); `field` has ``rate(t, y)``."""
    rows, terms = _terms(field, events, t, y)
    eps = jnp.finfo(y.dtype).eps
    return Looked(
        values=values(events, t, y),
        slopes=jnp.sum(terms, -1),
        rounding=eps * jnp.sum(jnp.abs(rows * y[None]), -1),
        speeds=eps * jnp.sum(jnp.abs(terms), -1),
    )


def bends(field, events: tuple, t: Array, y: Array) -> Array:
    """(E,) one rounding of the second derivatives along the motion; 0 where they do not exist."""
    ahead = (jnp.ones_like(t), field.rate(t, y))
    _, second = jax.jvp(lambda t, y: _terms(field, events, t, y)[1].sum(-1), (t, y), ahead)
    return jnp.finfo(y.dtype).eps * jnp.where(jnp.isfinite(second), jnp.abs(second), 0.0)


def first_side(g, slope, h, noise, *, speeds: Array, bends: Array, wanted: Array) -> Array:
    """(E,) the side of each event the motion is just after its start.

    If the motion starts on an event, the slope decides. Where the slope is zero as well, a
    crossing in the wanted direction counts: otherwise a ball that bounces by less than
    rounding would fall through the floor. Without a wanted direction the motion has left.

    Args:
      g: (E,) values at the start.
      slope: (E,) slopes in the direction of the run.
      h: () first step.
      noise: (E,) rounding of the values.
      speeds: (E,) one rounding of a slope.
      bends: (E,) one rounding of a second derivative.
      wanted: (E,) signs after the crossings that count, 0 for both.
    """
    moved = noise + jnp.abs(h) * speeds + h * h * bends
    on = jnp.abs(g) <= _START_ROUNDINGS * moved
    moving = jnp.abs(slope) > _START_ROUNDINGS * speeds
    return jnp.where(on, jnp.where(moving, jnp.sign(slope), -wanted), jnp.sign(g))


def _terms(field, events: tuple, t: Array, y: Array) -> tuple[Array, Array]:
    """(E, k) derivatives of the values by the state; (E, 1 + k) the terms of their slopes."""
    by_time, rows = jax.jacfwd(functools.partial(values, events), argnums=(0, 1))(t, y)
    return rows, jnp.concatenate([by_time[:, None], rows * field.rate(t, y)[None]], axis=-1)


class Sight(eqx.Module):
    """Events of a motion at any time after a node, by one step of the method from there.

    Attributes:
      field: has ``rate(t, y)`` and ``project(t, y)``.
      events: modules with ``value(t, y)`` and ``direction``.
      method: the method that takes the step.
    """

    field: Field
    events: tuple
    method: Method = eqx.field(static=True)

    def after(self, t: Array, y: Array, hs: Array) -> tuple[Array, Array, Array]:
        """(s, E) values and slopes and (k, s) states, after one step of each length hs (s,)."""
        rates = jax.vmap(self.field.rate, in_axes=(0, -1), out_axes=-1)
        ts = t + hs
        ys = y[:, None] + self._increments(rates, t, y, hs)
        x = jax.vmap(self.field.project, in_axes=(0, -1), out_axes=-1)(ts, ys)

        def along(t, y, rate):
            ahead = (jnp.ones_like(t), rate)
            return jax.jvp(functools.partial(values, self.events), (t, y), ahead)

        g, slope = jax.vmap(along, in_axes=(0, -1, -1))(ts, x, rates(ts, x))
        return g, slope, x

    def _increments(self, rates, t: Array, y: Array, hs: Array) -> Array:
        """(k, s) increments of one step of each length hs (s,)."""
        method = self.method.in_loops(1)
        if not method.several:
            step = lambda h: method.advance(self.field.rate, t, h, y).increment  # noqa: E731
            return jax.vmap(step, out_axes=-1)(hs)
        # One step of a state with s columns: vmapped steps would scatter into their stages.
        ys = jnp.broadcast_to(y[:, None], (*y.shape, *hs.shape))
        return method.advance(lambda t, y: rates(t[0], y), t, hs[None], ys).increment


def time_slope(rise, slope, happened):
    """The derivative of the time of an event by what changed its value by `rise`.

    Args:
      rise: the derivative of the value at a fixed time; None if it is 0 for all numbers.
      slope: that along the motion, None likewise.
      happened: whether the event did.
    Raises:
      ValueError: the slope is 0 whatever the numbers, as that of a sign is.
    """
    if slope is None:
        raise _checks.fail(
            "derivative of the time of an event",
            "an event whose value has a slope where it crosses zero",
            "one that is constant on both sides, as by jnp.sign, jnp.where or a comparison",
            "Its time has no derivative. Make what changes its sign the event: y[0] - level, not "
            "jnp.sign(y[0] - level).",
        )
    if rise is None:
        return jnp.zeros_like(slope)
    return -rise / jnp.where(happened, slope, 1.0)


def coincident(field, events: tuple, y0: Array, t0: Array, t: Array, y: Array, direction) -> Array:
    """(E,) whether each event happens at (t, y) of the motion from (t0, y0), to rounding.

    Args:
      field: has ``rate(t, y)``.
      events: modules with ``value(t, y)`` and ``direction``.
      y0: (k,) start.
      t0: () start time.
      t: () time of an event.
      y: (k,) state then.
      direction: () 1 forwards in time, -1 backwards.
    """
    here = looked(field, events, t, y)
    start = looked(field, events, t0, y0)
    time = jnp.abs(t0) + jnp.abs(t)
    off = _COINCIDENCE_ROUNDINGS * (here.rounding + start.rounding + time * here.speeds)
    wanted = jnp.array([event.direction for event in events], float)
    return (jnp.abs(here.values) <= off) & ((wanted == 0) | (wanted * direction * here.slopes > 0))
