"""Values of events along a motion, their slopes, and their rounding errors."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.plan import Plan, plan_of
from jaxdyn.plan.times import hides_in_time
from jaxdyn.scene import Field, System
from jaxdyn.solvers import Method

#: Roundings of a state within which the sign of a value is not known.
_SIDE_ROUNDINGS = 4
#: Directions in which neighbours of a state are evaluated, on both sides.
_NEIGHBOUR_PAIRS = 3
#: Largest change that the steepest slope of a part in time may make between a few samples, in
#: multiples of the range of these: little more than a period of a sine.
_FEW_WAVES = 4.0
#: Roundings of state and time within which two events count as simultaneous.
_COINCIDENCE_ROUNDINGS = 64
#: Roundings of time and state by which a condition at a jump may miss its change.
_JUMP_ROUNDINGS = 64
#: Part of the change of a value across a condition that its slopes leave over where it jumps.
_LEAST_JUMP = 0.5


class EventValues(NamedTuple):
    """The E events at a point (t, y) of a motion.

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
    return jnp.concatenate([jnp.atleast_1d(event.value(t, y)) for event in events])


def count(event) -> int:
    """Number of values of an event: the conditions of a rate have several."""
    return getattr(event, "count", 1)


def directions(events: tuple) -> Array:
    """(E,) the signs after the crossings that count, 0 for both."""
    return jnp.concatenate([jnp.full(count(event), float(event.direction)) for event in events])


def sizes(system: System, y: Array) -> Array:
    """(k,) the magnitudes to whose rounding the entries of a state are known.

    This is the entry's own magnitude; with constraints it is the largest with the same unit, since
    a projection mixes them: a velocity of 1e-33 m/s off the surface, beside one of 1 m/s along it,
    is zero.
    """
    if type(system).project is System.project:
        return jnp.abs(y)
    units = np.array([unit for _, unit in system.labels()])
    return jnp.max(jnp.where(units[:, None] == units[None, :], jnp.abs(y)[None, :], 0.0), axis=1)


def evaluate(field, events: tuple, t: Array, y: Array, size: Array | float = 0.0) -> EventValues:
    """The events of a motion at (t, y) whose entries were once as large as `size`."""
    here, (by_time, rows) = value_and_jacfwd(lambda t, y: values(events, t, y), (0, 1))(t, y)
    terms = jnp.concatenate([by_time[:, None], rows * field.rate(t, y)[None]], axis=-1)
    eps = jnp.finfo(y.dtype).eps
    known = jnp.maximum(sizes(field.system, y), size)
    return EventValues(
        values=here,
        slopes=jnp.sum(terms, -1),
        rounding=eps * jnp.sum(jnp.abs(rows * known[None]), -1),
        speeds=eps * jnp.sum(jnp.abs(terms), -1),
    )


def curvature_rounding(field, events: tuple, t: Array, y: Array) -> Array:
    """(E,) one rounding of the second derivatives along the motion; 0 where they do not exist."""

    def along(fn):
        return lambda t, y: jax.jvp(fn, (t, y), (jnp.ones_like(t), field.rate(t, y)))[1]

    second = along(along(functools.partial(values, events)))(t, y)
    return jnp.finfo(y.dtype).eps * jnp.where(jnp.isfinite(second), jnp.abs(second), 0.0)


def sides(events: tuple, t: Array, y: Array, size: Array, here: Array) -> tuple[Array, Array]:
    """(E,) signs of the values, 0 where rounding decides, and (E,) how much that changes values.

    A sign is known if all neighbours of the state have it. No bound on the value itself would do:
    y^5 is below every bound long before y is zero to rounding. A few neighbours are evaluated
    instead of the derivatives with respect to all entries: that costs less where there are many
    entries, and includes the rounding within the value.

    Args:
      events: modules with ``value(t, y)``.
      t: () time.
      y: (k,) state.
      size: (k,) magnitudes to whose rounding the state is known.
      here: (E,) the values.
    """
    shifts = _SIDE_ROUNDINGS * jnp.finfo(y.dtype).eps * _neighbours(len(y))
    ts, ys = t + shifts[:, 0] * t, y[None] + shifts[:, 1:] * size[None]
    others = jax.vmap(functools.partial(values, events))(ts, ys)
    others = jnp.where(jnp.isfinite(others), others, here[None])
    side = jnp.sign(here)
    known = (jnp.sign(others) == side[None]).all(axis=0) | jnp.isnan(here)
    return jnp.where(known, side, 0.0), jnp.max(jnp.abs(others - here[None]), axis=0)


@functools.cache
def _neighbours(k: int) -> np.ndarray:
    """(2 p, 1 + k) shifts of time and state of size one; no two entries cancel in all of them."""
    rng = np.random.default_rng(0)
    shifts = rng.uniform(0.75, 1.25, (_NEIGHBOUR_PAIRS, 1 + k))
    shifts[1:] *= rng.choice([-1.0, 1.0], shifts[1:].shape)
    return np.concatenate([shifts, -shifts])


def values_and_signs(
    events: tuple, t: Array, y: Array, rate: Array, size: Array
) -> tuple[Array, ...]:
    """(E,) each: values, slopes along a motion of this rate, and the two results of `sides`."""
    ahead = (jnp.ones_like(t), rate)
    g, slope = jax.jvp(functools.partial(values, events), (t, y), ahead)
    return g, slope, *sides(events, t, y, size, g)


class TimeDependence(eqx.Module):
    """How the values of events depend on time alone, which no step of the motion measures.

    Attributes:
      events: modules with ``value(t, y)``.
      plan: the plan of their values.
    """

    events: tuple
    plan: Plan = eqx.field(static=True)

    @classmethod
    def of(cls, events: tuple, k: int) -> "TimeDependence | None":
        """That of some events of a state (k,); None if they hide nothing, or have conditions."""
        plan = plan_of(_Values(events), k, waves=True)
        return cls(events, plan) if plan.hides and not plan.size else None

    def hide(self, t0: Array, t1: Array) -> Array:
        """Whether () the values may vary more between two times than a few samples show."""
        system, none = _Values(self.events), jnp.zeros(0)
        return hides_in_time(self.plan, system, t0, t1, none, jnp.zeros(()), _FEW_WAVES)


class _Values(eqx.Module):
    """Values of events, in the form of a field with a rate."""

    events: tuple

    def rate(self, t: Array, y: Array) -> Array:
        return values(self.events, t, y)


class EventSamples(NamedTuple):
    """The E events at s times ahead of a node.

    Attributes:
      g: (s, E) values.
      slope: (s, E) their slopes in time.
      side: (s, E) their signs, 0 where rounding decides.
      noise: (s, E) how much rounding changes the values.
      y: (k, s) states.
    """

    g: Array
    slope: Array
    side: Array
    noise: Array
    y: Array


class EventSampler(eqx.Module):
    """Events of a motion at any time after a node, by one step of the method from there.

    Attributes:
      field: has ``rate(t, y)``, ``project(t, y)`` and a ``system``.
      events: modules with ``value(t, y)`` and ``direction``.
      method: the method that takes the step.
    """

    field: Field
    events: tuple
    method: Method = eqx.field(static=True)

    def after(self, t: Array, y: Array, hs: Array) -> EventSamples:
        """The events after one step of each length hs (s,) from (t, y)."""
        rates = jax.vmap(self.field.rate, in_axes=(0, -1), out_axes=-1)
        ts = t + hs
        ys = y[:, None] + self._increments(rates, t, y, hs)
        x = jax.vmap(self.field.project, in_axes=(0, -1), out_axes=-1)(ts, ys)
        start = sizes(self.field.system, y)

        def along(t, y, rate):
            size = jnp.maximum(start, sizes(self.field.system, y))
            return values_and_signs(self.events, t, y, rate, size)

        seen = jax.vmap(along, in_axes=(0, -1, -1))(ts, x, rates(ts, x))
        return EventSamples(*seen, y=x)

    def _increments(self, rates, t: Array, y: Array, hs: Array) -> Array:
        """(k, s) increments of one step of each length hs (s,)."""
        method = self.method.in_loops(1)
        if not method.several:
            step = lambda h: method.advance(self.field.rate, t, h, y).increment  # noqa: E731
            return jax.vmap(step, out_axes=-1)(hs)
        # One step of a state with s columns: vmapped steps would scatter into their stages.
        ys = jnp.broadcast_to(y[:, None], (*y.shape, *hs.shape))
        return method.advance(lambda t, y: rates(t[0], y), t, hs[None], ys).increment


def jumping_conditions(
    events: tuple, t: Array, y: Array, rate: Array, t0: Array
) -> list[Array | None]:
    """For each of E events the condition at which its value jumps over zero at (t, y), or -1.

    Args:
      events: modules with ``value(t, y)``.
      t: () time at which the search has found it.
      y: (k,) state that it has found: another integration would miss the condition by more.
      rate: (k,) its rate.
      t0: () time at which the motion started.
    Returns:
      The () number of the condition among those of the value; None for a value that has none.
    """
    t, y, rate, t0 = jax.lax.stop_gradient((t, y, rate, t0))
    known = _JUMP_ROUNDINGS * jnp.finfo(y.dtype).eps
    time = jnp.abs(t) + jnp.abs(t0)

    def jumping(event) -> Array | None:
        system = _Values((event,))
        plan = plan_of(system, len(y))
        if not plan.size:
            return None
        margins = functools.partial(_margins_of_value, event)
        here = margins(t, y)
        by_time, rows = jax.jacfwd(margins, (0, 1))(t, y)
        along = jnp.abs(by_time + rows @ rate)
        # An entry that is zero is known no better than the time.
        noise = known * (time * (jnp.abs(by_time) + along) + jnp.abs(rows) @ jnp.abs(y))
        may = (jnp.abs(here) <= noise) & (along > 0) & ~jnp.asarray(plan.bends)
        off = jnp.where(may, (jnp.abs(here) + noise) / along, 0.0)
        h = 2 * jnp.max(off) + known * time
        both = jnp.stack([-h, h])

        def near(h: Array) -> tuple[Array, Array]:
            ahead = (jnp.ones_like(t), rate)
            return jax.jvp(system.rate, (t + h, y + h * rate), ahead)

        (before, after), slopes = (x[:, 0] for x in jax.vmap(near)(both))
        change = after - before
        left = jnp.abs(change - h * jnp.sum(slopes))
        jumps = (before * after < 0) & (left > _LEAST_JUMP * jnp.abs(change))
        nearest = jnp.argmin(jnp.where(may, jnp.abs(here) / along, jnp.inf))
        return jnp.where(jumps & may.any(), nearest, -1)

    return [jumping(event) for event in events]


def crossing_values(events: tuple, jumping: list[Array | None], t: Array, y: Array) -> Array:
    """(E,) functions, smooth at a crossing, that are zero there: the values themselves, or margins.

    Args:
      events: modules with ``value(t, y)``.
      jumping: the conditions at which they jump, see `jumping_conditions`.
      t: () time.
      y: (k,) state.
    """
    found = []
    for event, which in zip(events, jumping, strict=True):
        value = event.value(t, y)
        if which is not None:
            value = jnp.where(which < 0, value, _margins_of_value(event, t, y)[which])
        found.append(value)
    return jnp.stack(found)


def _margins_of_value(event, t: Array, y: Array) -> Array:
    """(e,) how far each condition of a value is from changing."""
    system = _Values((event,))
    return plan_of(system, len(y)).evaluate(system, t, y)[1].margins


def time_tangent(
    value: Callable, event: Any, d_event: Any, t: Array, y: Array, dy: Array, rate: Array, happened
) -> Array:
    """The tangent of the time of an event, by the implicit function theorem.

    Args:
      value: (event, t, y) -> the function that is zero.
      event: the event, or several.
      d_event: the tangent of its numbers.
      t: the time at which it happens; one or several, as its value is.
      y: the state then.
      dy: the tangent of the state at that time, kept fixed.
      rate: the rate of the state.
      happened: whether the event happened.
    Raises:
      ValueError: the value has no slope whatever the numbers, as jnp.signbit has none.
    """
    _, rise = eqx.filter_jvp(value, (event, t, y), (d_event, jnp.zeros_like(t), dy))
    along = functools.partial(value, event)
    _, slope = eqx.filter_jvp(along, (t, y), (jnp.ones_like(t), rate))
    if slope is None:
        raise _checks.fail(
            "derivative of the time of an event",
            "an event whose value has a slope where it crosses zero",
            "one that is constant on both sides, and whose conditions cannot be read",
            "Its time has no derivative. Make what changes its sign the event: y[0] - level, not "
            "jnp.signbit(y[0] - level).",
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
    here = evaluate(field, events, t, y, sizes(field.system, y0))
    time = jnp.abs(t0) + jnp.abs(t)
    off = _COINCIDENCE_ROUNDINGS * (here.rounding + time * here.speeds)
    wanted = directions(events)
    return (jnp.abs(here.values) <= off) & ((wanted == 0) | (wanted * direction * here.slopes > 0))
