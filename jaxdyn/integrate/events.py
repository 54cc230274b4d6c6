"""When something happens: the first time a function of the state crosses zero.

`until` follows a motion to the first of several events, found by the folder `event_search`.
Derivatives, of any order, do not pass through the search: they follow the implicit function
theorem, dt = -dg / (dg/dt), dy = (dy)_t + f dt.
"""

import abc
import functools
from collections.abc import Callable
from typing import Annotated, Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import as_float, check_first
from jaxdyn._doors import renamed
from jaxdyn._numerics import in_one_kernel
from jaxdyn._records import Record, check_repeatable
from jaxdyn._text import number_of
from jaxdyn.integrate import resting
from jaxdyn.integrate.event_search.event_values import (
    coincident,
    crossing_values,
    jumping_conditions,
    time_tangent,
)
from jaxdyn.integrate.flow import flow, run_or_switch
from jaxdyn.integrate.pieces import Arrival, first_event
from jaxdyn.integrate.spans import MAX_STEPS, RTOL, SolverOptions, limits, span
from jaxdyn.plan.branch import in_branch
from jaxdyn.scene import Scene
from jaxdyn.solvers import Method, Solver
from jaxdyn.solvers.choice import check_method
from jaxdyn.status import Status


class Stop(eqx.Module):
    """Where a motion was stopped.

    Attributes:
      t: () time of the event, or the end of the span if there was none; NaN if the run failed.
      y: (k,) state then, on the event or a rounding before it, not beyond it. Only where the motion
        started on the event and meets it within 1e-30 of a step may it be beyond, by that much.
        NaN if the run failed.
      event: () index of the event, -1 for none.
      status: () `Status` code.
      coincident: (E,) whether each of the events happens at this time, to rounding; several do
        where a ball runs into a corner. `event` is one of them. All are False if there was none.
    """

    t: Array
    y: Array
    event: Array
    status: Annotated[Array, Status]
    coincident: Array

    __repr__ = _text.fields
    _repr_html_ = _text.html

    @property
    def happened(self) -> bool | np.ndarray:
        """Whether it was an event that ended the motion, (n,) for a batch of n; host only."""
        return bool(self.event >= 0) if np.ndim(self.event) == 0 else np.asarray(self.event) >= 0

    @property
    def message(self) -> str:
        """What ended the motion, and when; host only.

        For a batch, it says how many motions each of the events ended, and the first failure.
        """
        if self.status.ndim:
            return self._message_of_batch
        if self.status != Status.OK:
            return Status(int(self.status)).message
        if self.event < 0:
            return f"No event happened up to the end of the span, t = {float(self.t):.6g}."
        others = [str(i) for i in np.flatnonzero(self.coincident) if i != self.event]
        also = f", with {', '.join(others)} at the same time" if others else ""
        return f"Event {int(self.event)} happened at t = {float(self.t):.6g}{also}."

    @property
    def _message_of_batch(self) -> str:
        right = np.asarray(self.status) == Status.OK
        reached, counts = np.unique(np.asarray(self.event)[right], return_counts=True)
        parts = [
            f"{number_of(n, 'motion')}: " + (f"event {i}." if i >= 0 else "no event.")
            for i, n in zip(reached.tolist(), counts.tolist(), strict=True)
        ]
        bad = np.asarray(self.status)[~right]
        failed = (
            [f"{number_of(len(bad), 'motion')}: {Status(int(bad[0])).message}"] if bad.size else []
        )
        return " ".join([*parts, *failed])


class Event(Record):
    """A function of time and state whose zero is the event."""

    #: The name of an event that ends a phase, on a page on which the scene runs and where the event
    #: can be switched off: "impact on the table"; empty where no motion makes sense without it.
    called: ClassVar[str] = ""

    @abc.abstractmethod
    def value(self, t: Array, y: Array) -> Array:
        """() the function; finite, and smooth except where its conditions (`jnp.where`) change.

        If it jumps over zero, as an acceleration does when a force is switched, the event happens
        at the jump. Derivatives of the time are then those of the time when the condition changes.
        """

    @property
    def direction(self) -> int:
        """+1 for upward crossings along the motion, -1 for downward ones, 0 for both."""
        return 0

    def check(self, k: int) -> None:
        """Raise ValueError if this is not an event of a state of k entries."""
        leaves, tree = jax.tree.flatten(self)
        shape = _value_shape(tree, tuple(np.shape(leaf) for leaf in leaves), k)
        if shape:
            name = type(self).__name__
            raise _checks.fail(name, "one number as its value", f"shape {shape}", "Split it.")
        if self.direction not in (-1, 0, 1):
            raise _checks.fail("direction", "1, -1, or 0 for both", self.direction)


@functools.cache
def _value_shape(tree, shapes: tuple, k: int) -> tuple[int, ...]:
    """Shape of an event's value; cached, since tracing it takes as long as a short search."""
    leaves = [jax.ShapeDtypeStruct(shape, float) for shape in (*shapes, (), (k,))]
    event = jax.tree.unflatten(tree, leaves[:-2])
    check_repeatable(event, "value", *leaves[-2:])
    return jax.eval_shape(lambda event, t, y: event.value(t, y), event, *leaves[-2:]).shape


@renamed(way="direction")
class When(Event):
    """The zeros of a named function ``fn(t, y)``; a lambda would be compiled anew at each call.

    ``When(fn, direction=1)`` is where it rises through 0, -1 where it falls, 0 both.
    """

    fn: Callable[[Array, Array], Array] = eqx.field(static=True)
    direction: int = eqx.field(static=True, default=0)

    def value(self, t, y):
        return self.fn(t, y)


@renamed(way="direction")
class Reaches(Event):
    """An entry of the state reaches a level: ``Reaches(1, 0.0, direction=-1)``, y falls to 0."""

    entry: int = eqx.field(static=True)
    level: Array = eqx.field(converter=as_float, default=0.0)
    direction: int = eqx.field(static=True, default=0)

    def value(self, t, y):
        del t
        return y[self.entry] - self.level

    def check(self, k):
        if not isinstance(self.entry, int) or not 0 <= self.entry < k:
            remedy = "scene.labels() has their order, which for a dictionary is that of its keys."
            raise _checks.fail("entry", f"an entry of the state, 0 to {k - 1}", self.entry, remedy)
        super().check(k)


class Every(Event):
    """Each time a period [s] has passed since `phase` [s]: a stroboscope for driven scenes."""

    period: Array = eqx.field(converter=as_float)
    phase: Array = eqx.field(converter=as_float, default=0.0)

    def value(self, t, y):
        del y
        return jnp.sin(jnp.pi * (t - self.phase) / self.period)

    def check(self, k):
        del k
        _checks.positive("period", self.period, "It is a time.")


@check_first
def until(
    scene: Scene,
    events: Event | tuple[Event, ...],
    t1=None,
    *,
    t0=0.0,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
    max_step=None,
    breaks=(),
) -> Stop:
    """The first event of a motion: when, and the state then.

    An event happens at the first time after t0 at which its value has changed sign in the wanted
    direction. The sign decides, not the size: a value that is flat at its zero, such as y^5, is
    located to rounding of the state like y.

    A value within rounding of zero at the start (16 roundings of the state, and of its
    change over t0 and the first step) is on the side to which its slope points: leaving an event
    does not count as an event. If the value turns back, its return counts, however soon: at t0,
    if it takes less than the spacing of floating-point times. If the slope is within rounding of
    zero as well, the motion is leaving if the value changes its sign there, as y^3 does. If the
    value keeps its sign, the event happens at t0 if the value then goes in the wanted direction; if
    both directions are wanted, it does not happen.

    A value that reaches zero and is held there, as friction holds the velocity of a block, crosses
    zero when it arrives. If it later goes on to the other side, no event happens; if it returns, it
    crosses back when it is released. So directions alternate, and whether an event happens does not
    depend on what follows. A motion that starts held has left the event, to whichever side it goes.

    Args:
      scene: system, effects, start.
      events: one or several to search for.
      t1: () end of the span [s], where the motion stops if nothing happened before; the
        scene's own span by default.
      t0: () start time [s].
      rtol: see `simulate`.
      atol: see `simulate`.
      solver: see `simulate`.
      max_steps: see `simulate`.
      max_step: see `simulate`.
      breaks: see `simulate`.
    Raises:
      ValueError: no event is given, or `t1`, `t0`, `rtol`, `atol` or `max_steps` is out of range.
    Limits: two crossings in one step are found if the value is smooth and goes beyond zero by
      more than 4 roundings of the state, or of the value itself where it is computed with
      cancellation: (y - 1)^3 written out is known to 1e-5 of y. A pulse much shorter than a step,
      in a value that is smooth elsewhere, may be missed, since a step is sampled at five places
      only, unless these leave room for a crossing; so may dips late in a step in which the value
      turns near zero thousands of times. At a grazing contact derivatives are infinite, at a flat
      zero NaN where value and slope are both exactly zero. An event within rounding of the end of
      the span may count as after it: choose a later end. For the first event of many starts,
      ``orbits.section(scene, event, starts, crossings=1, t1=...)`` is many times faster than `vmap`
      of this search, without derivatives; the first of two events is the zero of their product.
    Example:
      >>> from jaxdyn.integrate import events
      >>> from jaxdyn import scenes
      >>> ball = scenes.cannonball(g=10.0, speed=10.0)
      >>> stop = events.until(ball, events.Reaches(1, 0.0, -1), 9.0)
      >>> round(float(stop.t), 12)
      1.414213562373
    """
    options = SolverOptions(rtol, atol, solver, max_steps, max_step, breaks)
    return stop_of(scene, events, t1, t0, options)


def stop_of(
    scene: Scene, events, t1, t0, options: SolverOptions, sides: tuple[int, ...] | None = None
) -> Stop:
    """The result of `until` for a motion that may begin on known sides of its events.

    Args:
      scene: see `until`.
      events: see `until`.
      t1: see `until`.
      t0: see `until`.
      options: see `until`.
      sides: signs of the values just after the start, 0 where they have to be determined; all of
        them by default.
    """
    t0, t1 = span(scene, t1, t0)
    events = as_events(events, len(scene.y0))
    sides = (0,) * len(events) if sides is None else sides
    method = check_method(scene, options.solver, several=True)
    run_limits = limits(options)
    traced = _checks.is_traced((scene, events, t0, t1, run_limits))

    def run(run_limits, method: Method) -> Stop:
        locate, convert = (_locate, jnp.asarray) if traced else (_compiled, np.asarray)
        run_limits = jax.tree.map(convert, run_limits)
        args = (scene.field, events, scene.y0, t0, t1, run_limits)
        return locate(*args, method=method, sides=sides)[0]

    return run_or_switch(run, run_limits, method, default=options.solver is None and not traced)[0]


def as_events(events, k: int) -> tuple[Event, ...]:
    """One or several events of a state of k entries as a tuple.

    Raises:
      ValueError: there is no event, or something else among them; one does not suit the state, or a
        number that its function captured has changed.
    """
    given: Any = (events,) if isinstance(events, Event) or callable(events) else tuple(events)
    if not given:
        raise _checks.fail("events", "at least one", "none", "simulate() runs to a time.")
    for event in given:
        if not isinstance(event, Event):
            got = getattr(event, "__name__", repr(event))
            raise _checks.fail("events", "events", got, "Write When(fn), with a named fn.")
        event.check_functions()
        _checks.refuse_made_before("event", *event.converted)
        event.check(k)
    return given


# Compiled within the rule of derivatives, as `flow` is.
@eqx.filter_custom_jvp
@eqx.filter_jit
def _locate(
    field, events, y0, t0, t1, limits, *, method: Method, sides: tuple[int, ...]
) -> tuple[Stop, Arrival | None]:
    search = functools.partial(_search, method=method, sides=sides)
    args = (field, events, y0, t0, t1, limits)
    return in_one_kernel(search, args, unknown=limits.tolerance[0] > 0)


@_locate.def_jvp
def _locate_jvp(primals, tangents, *, method, sides):
    field, events, y0, t0, _, limits = primals
    d_field, d_events, d_y0, d_t0, d_t1, _ = tangents
    stop, arrival = _locate(*primals, method=method, sides=sides)
    happened = stop.event >= 0
    advance = functools.partial(flow, method=method)

    def arriving(field):
        # Where a condition changes just then, as friction that begins to stick does when a speed
        # reaches 0, the motion that arrives is meant, not the one that goes on.
        return field if arrival is None else in_branch(field, arrival.branch)

    def state(field, y0, t0):
        start, none = t0, jnp.zeros(0)
        if arrival is not None:
            # While the motion is held, one branch has no sizes by which errors are measured.
            start = jnp.where(arrival.ended >= 0, stop.t, 0.5 * (arrival.since + stop.t))
            start = jax.lax.stop_gradient(start)
            y0 = advance(field, y0, t0, start, none, limits).y1
        return advance(arriving(field), y0, start, stop.t, none, limits).y1

    y, dy = eqx.filter_jvp(state, (field, y0, t0), (d_field, d_y0, d_t0))
    dy = jnp.zeros_like(y) if dy is None else dy
    f = arriving(field).rate(stop.t, y)
    # A value that jumps over zero does so where one of its conditions changes.
    jumping = jumping_conditions(events, stop.t, stop.y, f, t0)

    def value(events, t, y):
        return crossing_values(events, jumping, t, y)[stop.event]

    dt_of = functools.partial(time_tangent, value, events, d_events)
    dt = resting.time_tangent(dt_of, field, d_field, arrival, stop.t, y, dy, f, happened)
    dt = jnp.where(happened, dt, jnp.zeros_like(t0) if d_t1 is None else d_t1)
    d_stop = Stop(t=dt, y=dy + f * dt, event=None, status=None, coincident=None)
    return (stop, arrival), (d_stop, jax.tree.map(lambda _: None, arrival))


_compiled = eqx.filter_jit(_locate)


def _search(
    field, events, y0, t0, t1, limits, *, method: Method, sides: tuple[int, ...]
) -> tuple[Stop, Arrival | None]:
    out, found, arrival = first_event(field, events, y0, t0, t1, limits, sides, method=method)
    fine, happened = found.status == Status.OK, jnp.isfinite(found.t)
    t = jnp.where(fine, jnp.where(happened, found.t, t1), jnp.nan)
    y = jnp.where(fine, jnp.where(happened, found.y, out.y1), jnp.nan)
    event = jnp.where(happened & fine, found.event, -1)
    same = jnp.arange(len(events)) == event
    if len(events) > 1:  # this takes a fifth of a search's compile time
        direction = jnp.where(t1 > t0, 1.0, -1.0)
        same = same | (event >= 0) & coincident(field, events, y0, t0, t, y, direction)
    return Stop(t=t, y=y, event=event, status=found.status, coincident=same), arrival
