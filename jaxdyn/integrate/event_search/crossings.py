"""Where functions of the state first cross zero along a motion: the search behind `events`.

In every accepted step values and slopes are sampled at a few places, reached by steps of the method
itself (an interpolant would be accurate to 7 digits only). `are_settled` decides between which of
these places a value may have crossed zero unseen; there the sampling is refined until the values
decide, or the spacing reaches its minimum. So a value that dips below zero and
comes back within a step is found, to rounding. The time found is polished to full precision.

A value that is within rounding of zero at the start is on the side to which the motion goes, see
`Beginning`. So a motion that starts on an event (after a bounce, say) has left it, and does not
meet it again until it returns. A search that continues from an event is given the side.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.integrate.event_search.event_values import (
    EventSampler,
    TimeDependence,
    count,
    curvature_rounding,
    directions,
    evaluate,
    values,
)
from jaxdyn.integrate.march import History, StepControl, Watch, march
from jaxdyn.solvers import Method
from jaxdyn.solvers.stepper import allowed_error
from jaxdyn.status import Status

# ---- Which side of an event a motion is on just after its start

#: Roundings of state and time by which a value at a start on an event may miss zero.
_START_ROUNDINGS = 16
#: Part of the first step within which the first terms of its series show how the motion continues.
_CLOSE = 2.0**-10


class Beginning(NamedTuple):
    """A motion at its start, and the E events there.

    Attributes:
      t: () time.
      y: (k,) state.
      rate: (k,) its rate.
      turn: (k,) the state's second derivative.
      g: (E,) values.
      slope: (E,) slopes in time.
      noise: (E,) rounding of the values there.
      speeds: (E,) one rounding of a slope.
      curvature_rounding: (E,) one rounding of a second derivative.
    """

    t: Array
    y: Array
    rate: Array
    turn: Array
    g: Array
    slope: Array
    noise: Array
    speeds: Array
    curvature_rounding: Array

    @classmethod
    def of(cls, field, events: tuple, t: Array, y: Array) -> "Beginning":
        """The beginning at (t, y); `field` has ``rate(t, y)`` and a ``system``."""
        rate = field.rate(t, y)
        here = evaluate(field, events, t, y)
        return cls(
            t=t,
            y=y,
            rate=rate,
            turn=jax.jvp(field.rate, (t, y), (jnp.ones_like(t), rate))[1],
            g=here.values,
            slope=here.slopes,
            noise=here.rounding + jnp.abs(t) * here.speeds,
            speeds=here.speeds,
            curvature_rounding=curvature_rounding(field, events, t, y),
        )

    def sides(self, events: tuple, h: Array, wanted: Array) -> Array:
        """(E,) signs just after the start, before a first step h ().

        If the motion starts on an event, the slope decides. Where the slope is zero as well, it
        depends on whether the value changes its sign there, as y^3 does: if so, the motion is
        leaving. If not, a crossing in the wanted direction counts: otherwise a ball that bounces by
        less than rounding would fall through the floor. If both directions are wanted, the motion
        has left.

        Args:
          events: as in `of`.
          h: () first step, negative backwards in time.
          wanted: (E,) signs after the crossings that count, 0 for both.
        """
        ahead = jnp.sign(h)
        rounding = _START_ROUNDINGS * (
            self.noise + jnp.abs(h) * self.speeds + h * h * self.curvature_rounding
        )
        moving = jnp.abs(self.slope) > _START_ROUNDINGS * self.speeds
        near = _CLOSE * jnp.stack([-h, h])
        before, after = jax.vmap(lambda h: self._near(events, h, rounding))(near)
        still = jnp.where(before * after < 0, after, -wanted)
        leaving = jnp.where(moving, ahead * jnp.sign(self.slope), still)
        return jnp.where(jnp.abs(self.g) <= rounding, leaving, jnp.sign(self.g))

    def _near(self, events: tuple, h: Array, noise: Array) -> Array:
        """(E,) signs a short time later, by the first terms of the series; 0 within rounding."""
        g = values(events, self.t + h, self.y + h * self.rate + 0.5 * h * h * self.turn)
        return jnp.where(jnp.abs(g) > noise, jnp.sign(g), 0.0)


# ---- Whether a smooth function can cross zero between sample points
#
# Between two neighbouring samples the function is the cubic with its values and slopes there, up to
# f'''' w^4 / 384 with w the width of the stretch. The size of f'''' follows from the differences of
# the third derivatives of neighbouring cubics. A cubic lies in the hull of its four Bernstein
# coefficients, and its slope in that of their differences. So a stretch is settled if the
# coefficients stay clear of zero by more than the error of the cubic, or are monotone, so that the
# values at the ends decide. Other stretches have to be sampled more closely.

#: Factor by which fourth derivatives may exceed their estimate from neighbouring cubics.
_FOURTH_SAFETY = 4.0
#: Error of a cubic with values and slopes at both ends: f'''' w^4 / 384 at most.
_CUBIC_ERROR_DIVISOR = 384.0


def are_settled(times: Array, g: Array, slope: Array, sides: Array, noise: Array) -> Array:
    """(s - 1, E) whether each of E functions crosses zero between samples only as its sides say.

    Args:
      times: (s,) times of the samples, increasing or decreasing; s > 2.
      g: (s, E) values.
      slope: (s, E) slopes in time.
      sides: (s, E) signs of the values; where a value is within rounding of zero, the sign before.
      noise: (s, E) values up to this are rounding.
    Limits: wrong for functions whose samples look smooth but which are not smooth in between.
    """
    width = jnp.diff(times)[:, None]
    parts = HermiteCubic(g[:-1], g[1:], slope[:-1], slope[1:], width)
    between = 0.5 * (width[1:] + width[:-1])
    fourth = jnp.max(jnp.abs(jnp.diff(parts.third, axis=0) / between), axis=0)
    return parts.is_settled(fourth[None], sides[:-1], sides[1:], jnp.maximum(noise[:-1], noise[1:]))


class HermiteCubic(NamedTuple):
    """Neighbouring samples of functions; all arrays of one shape.

    Attributes:
      g0: values at the first sample.
      g1: values at the second sample.
      slope0: slopes in time at the first sample.
      slope1: slopes at the second sample.
      width: the time between them, of either sign.
    """

    g0: Array
    g1: Array
    slope0: Array
    slope1: Array
    width: Array

    @property
    def third(self) -> Array:
        """The third derivative of the cubics."""
        rise = self.g1 - self.g0
        return (6 * self.width * (self.slope0 + self.slope1) - 12 * rise) / self.width**3

    def is_settled(self, fourth: Array, before: Array, after: Array, noise: Array) -> Array:
        """Whether the functions cross zero only where their signs at the samples differ.

        Args:
          fourth: size of the fourth derivatives.
          before: signs of the values at the first sample, see `are_settled`.
          after: signs at the second sample.
          noise: values up to this are rounding.
        """
        error = _FOURTH_SAFETY / _CUBIC_ERROR_DIVISOR * fourth * self.width**4
        d0, d1 = self.width * self.slope0, self.width * self.slope1
        b1, b2 = self.g0 + d0 / 3, self.g1 - d1 / 3
        middle = b2 - b1
        clear = (before == after) & (before * b1 > error) & (before * b2 > error)
        rises = (d0 >= -noise) & (middle > error) & (d1 >= -noise)
        falls = (d0 <= noise) & (middle < -error) & (d1 <= noise)
        largest = jnp.maximum(jnp.maximum(jnp.abs(b1), jnp.abs(b2)), error)
        largest = jnp.maximum(largest, jnp.maximum(jnp.abs(self.g0), jnp.abs(self.g1)))
        return clear | rises | falls | (largest <= noise)


# ---- The times of events, from brackets to full precision

_MIN_BRACKET_PART = 2.0**-80  # part of a bracket: an event this close to its beginning is there
#: Most Newton steps or bisections; about five are usual. At a flat zero every second one halves the
#: bracket.
_MAX_EVALUATIONS = 200
#: Part of a step over which a motion is a straight line, to rounding: its deviation from one is the
#: square of this.
_STRAIGHT = 1e-9
_SHORT = 2.0**-20  # part by which the last correction is shortened where the full one is too long


class Bracket(NamedTuple):
    """Times that enclose each of E events, and the sign of its value after it.

    Attributes:
      low: (E,) the earlier time; infinite where nothing was found.
      high: (E,) the later time.
      towards: (E,) sign of the value after the crossing.
    """

    low: Array
    high: Array
    towards: Array

    @classmethod
    def none(cls, like: Array) -> "Bracket":
        """The bracket of events that were not found."""
        nothing = jnp.full_like(like, jnp.inf)
        return cls(nothing, nothing, jnp.zeros_like(like))

    @property
    def found(self) -> Array:
        """(E,) whether an event was found."""
        return jnp.isfinite(self.low)


class _RootRefinement(NamedTuple):
    """The state of the polishing iteration."""

    n: Array  # () evaluations so far
    low: Array  # (E,) bracket as time after the node
    high: Array  # (E,)
    h: Array  # (E,) time of the next evaluation, or of the last one where done
    last: Array  # (E,) the last step of h
    back: Array  # (E,) length of the last step back, once Newton's method has converged
    converged: Array  # (E,) whether it has converged
    done: Array  # (E,)
    y: Array  # (k, E) the states at the last evaluation


def refine_roots(
    sampler: EventSampler, t0: Array, y0: Array, bracket: Bracket, on: Array | bool = True
) -> tuple[Array, Array]:
    """(E,) times after t0 at which events happen, inf if not, and the states (k, E) then.

    It is Newton's method safeguarded by the bracket, with a bisection where its steps do not halve.
    It has converged when a neighbour of the state, or of the time, is on the other side. The size
    of the value is no criterion: a value that is flat at its zero is tiny far from it. The low end
    may be the start of the motion, where the value is rounding noise, so its sign there is taken
    from the bracket, not evaluated. In the end, when only rounding remains, the search steps back
    to a state that is not beyond the event: a ball released below the floor, even by one rounding,
    may never come above it, and would fall through.

    Args:
      sampler: the events.
      t0: () time of the node.
      y0: (k,) state then.
      bracket: where each event is.
      on: (E,) whether the motion may have begun on an event whose bracket begins at the node. If it
        has not, and is beyond the event at once, the value has jumped there.
    """
    found, towards = bracket.found, bracket.towards
    first = jnp.where(found, bracket.low, 0.0)
    last = jnp.where(found, bracket.high, 0.0)
    eps = jnp.finfo(y0.dtype).eps
    least = _MIN_BRACKET_PART * jnp.abs(last - first)

    def refine(p: _RootRefinement) -> _RootRefinement:
        ahead = sampler.after(t0, y0, p.h)
        g, slope, side = (jnp.diagonal(x) for x in (ahead.g, ahead.slope, ahead.side))
        # A start on the event may be beyond it by rounding, and leave before it returns.
        leaves = on & (first == 0) & (slope * (p.high - p.low) * towards < 0)
        before = (jnp.sign(g) == -towards) | leaves
        low, high = jnp.where(before, p.h, p.low), jnp.where(before, p.high, p.h)
        new = p.h - g / jnp.where(slope == 0, 1.0, slope)
        change = jnp.where(slope == 0, jnp.inf, jnp.abs(new - p.h))
        # Times relative to the node are finer than absolute ones: short bounces are resolved.
        fine = jnp.maximum(2 * eps * jnp.abs(p.h), least)
        exact = (side == 0) | (change <= fine) | (jnp.abs(high - low) <= fine)
        converged = p.converged | exact
        good = ((new - low) * (new - high) < 0) & (2 * change <= p.last)
        new = jnp.where(good, new, 0.5 * (low + high))
        at_begin = jnp.abs(high - first) <= 16 * least
        done = converged & ((g == 0) | (before != at_begin))
        back = jnp.where(p.converged, 2 * p.back, fine)
        nearer = jnp.where(at_begin, high, p.h + jnp.clip(low - p.h, -back, back))
        new = jnp.where(done, p.h, jnp.where(converged, nearer, new))
        return _RootRefinement(
            n=p.n + 1,
            low=low,
            high=high,
            h=new,
            last=jnp.abs(new - p.h),
            back=back,
            converged=converged,
            done=done,
            y=ahead.y,
        )

    def going(p: _RootRefinement) -> Array:
        return (p.n < _MAX_EVALUATIONS) & (found & ~p.done).any()

    h = 0.5 * (first + last)
    far, no = jnp.full_like(h, jnp.inf), jnp.zeros_like(found)
    y = jnp.broadcast_to(y0[:, None], (*y0.shape, *h.shape))
    begin = _RootRefinement(
        n=jnp.zeros((), int),
        low=first,
        high=last,
        h=h,
        last=far,
        back=far,
        converged=no,
        done=no,
        y=y,
    )
    end = jax.lax.while_loop(going, refine, begin)
    return jnp.where(found, end.h, jnp.inf), end.y


def move_onto_event(
    sampler: EventSampler,
    which: Array,
    t0: Array,
    h: Array,
    y: Array,
    towards: Array,
    longest: Array,
) -> tuple[Array, Array]:
    """Time after t0 and state of an event, moved onto it without passing beyond it.

    A step ends within rounding of the event. Along a straight line from there the value comes
    nearer to zero than the rounding of a step: a motion that starts there is known to start on the
    event, whatever the size of the state has been. Where the value hardly changes, as the length of
    a slow link does, the line to zero would be long, and is followed no farther than a motion is
    straight.

    Args:
      sampler: the events.
      which: () index of the event.
      t0: () time of the node.
      h: () time after it; infinite if there is no event.
      y: (k,) state then, not beyond the event.
      towards: () sign of the value beyond it.
      longest: () a time that the motion takes in one step.
    """
    t = t0 + jnp.where(jnp.isfinite(h), h, 0.0)
    # The rate of the last evaluation is not used: there XLA computes a state anew for each of its
    # uses, so the rate may be that of a neighbour beyond a surface, where a power is not defined.
    rate = sampler.field.rate(t, y)

    def value(t, y):
        return values(sampler.events, t, y)[which]

    g, slope = jax.jvp(value, (t, y), (jnp.ones_like(t), rate))
    on = -g / jnp.where(slope == 0, 1.0, slope)
    on = jnp.where((slope != 0) & (on * h > 0), on, 0.0)  # else it is beyond, or there is none
    more = jnp.stack([(1 - _SHORT) * on, on])
    new = y[None] + more[:, None] * rate[None]
    left = -towards * jax.vmap(value)(t + more, new)
    # So short a part of a motion is straight; a second rate to verify it takes long to compile.
    straight = jnp.abs(on) <= _STRAIGHT * jnp.abs(longest)
    nearer = straight & (left >= 0) & (left <= jnp.abs(g))
    best_h, best_y = h, y
    for i in range(len(more)):
        best_h = jnp.where(nearer[i], h + more[i], best_h)
        best_y = jnp.where(nearer[i], new[i], best_y)
    return best_h, best_y


# ---- Where functions of the state first cross zero along a motion: the search behind `events`

#: Parts of a step, or of a panel of it, at which events are sampled besides its beginning. Not
#: evenly spaced, or a value with a period of a quarter of a step would look the same everywhere.
_LOOK_PLACES = np.array([0.23, 0.49, 0.77, 1.0])
_MIN_PANEL = (
    2.0**-24
)  # part of a step: between samples this close a value has no extremum except by rounding
#: Largest error of the step to an event, in tolerances. That step is a part of one whose error was
#: at most 1.
_TRUSTED_ERROR = 1e3
_SIMULTANEOUS = (
    1e-13  # relative difference of times after a node up to which events are simultaneous
)
_MAX_PANELS = 4096  # most panels in a step, for a value that oscillates near zero
_MAX_CLOCKED = 2**20  # likewise for a value with parts in time alone; with more the search fails
_PANEL_GROWTH = 4.0  # factor of the panel length after a settled panel


#: For each event the sign of its values just after the start, 0 if it is not known.
Sides = tuple[int | Array, ...]


class Crossing(NamedTuple):
    """The first crossing.

    Attributes:
      t: () time, infinite if there is none.
      y: (k,) state.
      event: () index of the event.
      status: () `Status` code.
      towards: () sign of its value after the crossing.
      steps: () number of steps of the search, also rejected ones.
      sizes: (k,) sizes of the motion so far, see `solvers.stepper`.
      sides: (E,) signs of the values at the end of the span; where something happened, a little
        after it, between two samples. For a value within rounding of zero it is the sign before, 0
        where none is known.
      crossed: (E,) whether each event happens between these samples.
    """

    t: Array
    y: Array
    event: Array
    status: Array
    towards: Array
    steps: Array
    sizes: Array
    sides: Array
    crossed: Array


def first_crossing(
    field,
    events,
    y0,
    t0,
    t1,
    limits,
    ts,
    sides: Sides,
    *,
    method: Method,
    before: History | None = None,
    on: Array | bool = True,
    decides: Array | bool = True,
):
    """The motion up to where the search ended, and the first crossing; without derivatives.

    Args:
      field: a module with ``rate(t, y)`` and ``project(t, y)``.
      events: modules with ``value(t, y)`` and ``direction``.
      y0: (k,) start.
      t0: () start time.
      t1: () end time, before or after t0.
      limits: see `flow`.
      ts: (s,) times of samples.
      sides: for each event the sign of its values just after the start, 0 if it is not known. A
        Python number other than 0 saves the evaluation at the start, a third of the program.
      method: see `flow`.
      before: see `march`.
      on: (E,) whether the motion may start on each event, see `refine_roots`.
      decides: whether a side that is not known is determined at the start; () or (m,) for the m
        values without a known side. If not, it is the first sign that the value has.
    """
    sampler = EventSampler(field, events, method)
    in_time = TimeDependence.of(events, len(y0))
    watch = _CrossingWatch(sampler, sides, in_time, decides=decides)
    out, seen, sizes = march(
        field, y0, t0, t1, ts, limits, method=method, watch=watch, before=before
    )
    hs, ys = refine_roots(sampler, seen.t0, seen.y0, seen.bracket, on)
    # The first of the events among those that happen at once.
    near = jnp.abs(hs) <= jnp.min(jnp.abs(hs)) * (1 + _SIMULTANEOUS)
    which = jnp.argmax(near)
    towards = seen.bracket.towards[which]
    longest = seen.bracket.high[which]
    h, y = move_onto_event(sampler, which, seen.t0, hs[which], ys[:, which], towards, longest)
    # Step control checks whole steps; the shorter step to the event is checked only here.
    there = jnp.where(jnp.isfinite(h), h, 0.0)
    step = method.in_loops(1).advance(field.rate, seen.t0, there, seen.y0)
    size = StepControl.norm(step.error / allowed_error(limits.tolerance, sizes, seen.y0, y))
    nonzero = jnp.isfinite(h) & (h != 0)
    unseen = (out.status == int(Status.OK)) & (seen.unseen | (nonzero & ~(size < _TRUSTED_ERROR)))
    status = jnp.where(unseen, int(Status.UNSEEN_WITHIN_STEP), out.status)
    status = jnp.where(jnp.isnan(seen.end.side).any(), int(Status.NOT_FINITE), status)
    found = Crossing(
        t=seen.t0 + h,
        y=y,
        event=which,
        status=status,
        towards=towards,
        steps=out.steps + out.rejected,
        sizes=sizes,
        sides=jnp.where(seen.bracket.found.any(), seen.bracket.towards, seen.end.side),
        crossed=seen.bracket.found,
    )
    return out, found


class _Samples(NamedTuple):
    """Events at one time, or at several along a first axis."""

    part: Array  # () time, as a part of the step
    g: Array  # (E,) values
    slope: Array  # (E,) in time
    side: Array  # (E,) sign of the value, or of the last one known; 0 where it stays at zero
    noise: Array  # (E,) values up to this are rounding


class _Memory(NamedTuple):
    """What the watch remembers; one entry for each of the E events."""

    end: _Samples  # at the last accepted node; NaN side once a value was NaN
    t0: Array  # () last accepted node before the events found
    y0: Array  # (k,)
    bracket: Bracket
    beginning: Beginning | None  # of the events whose sides may have to be determined
    begun: Array  # () whether a step has been accepted
    unseen: Array  # () whether more happened within a step than could be resolved


class _StepSearch(NamedTuple):
    """A step while it is searched panel by panel, each beginning where the last one ended."""

    n: Array  # () panels so far
    begin: _Samples
    end: Array  # () of the panel, as part of the step
    bracket: Bracket  # in parts of the step


def _is_known(side: int | Array) -> bool:
    """Whether a side is known when the program is made."""
    return isinstance(side, int) and side != 0


class _CrossingWatch(Watch):
    sampler: EventSampler
    sides: Sides
    in_time: TimeDependence | None
    direction: Array | float = 1.0
    decides: Array | bool = True

    @property
    def wanted(self) -> Array:
        """(E,) the signs after the crossings that count, 0 for both."""
        return directions(self.sampler.events)

    @property
    def looked_at(self) -> tuple:
        """The events whose sides at the start may have to be determined."""
        pairs = zip(self.sampler.events, self.sides, strict=True)
        return tuple(event for event, side in pairs if not _is_known(side))

    def start(self, t0, y0):
        field, t = self.sampler.field, self.direction * t0
        here = evaluate(field, self.sampler.events, t, y0)
        zero = jnp.zeros_like(here.values)
        end = _Samples(
            part=jnp.ones_like(t0),
            g=here.values,
            slope=here.slopes,
            side=zero,
            noise=here.rounding + jnp.abs(t) * here.speeds,
        )
        beginning = Beginning.of(field, self.looked_at, t, y0) if self.looked_at else None
        return _Memory(
            end=end,
            t0=t0,
            y0=y0,
            bracket=Bracket.none(zero),
            beginning=beginning,
            begun=jnp.zeros((), bool),
            unseen=jnp.zeros((), bool),
        )

    def see(self, keep, t0, y0, t1, y1, memory):
        del y1
        h = self.direction * (t1 - t0)
        begin = self.direction * t0
        side = jnp.where(memory.begun, memory.end.side, self._first_sides(memory.beginning, h))
        search = self._search_step(keep, begin, y0, h, memory, side)
        low, high, towards = search.bracket
        bracket = Bracket(low * h, high * h, towards)
        begun = jnp.ones((), bool)
        unseen = (search.n >= _MAX_CLOCKED) & ~search.bracket.found.any()
        seen = memory._replace(end=search.begin, t0=begin, y0=y0, bracket=bracket, begun=begun)
        seen = seen._replace(unseen=unseen)
        memory = jax.tree.map(lambda new, old: jnp.where(keep, new, old), seen, memory)
        over = memory.bracket.found.any() | jnp.isnan(memory.end.side).any()
        return memory, over | memory.unseen

    def _first_sides(self, beginning: Beginning | None, h: Array) -> Array:
        """(E,) signs just after the start, before a first step h ()."""
        looked_at, found, i = self.looked_at, jnp.zeros(0), 0
        if beginning is not None:
            found = beginning.sides(looked_at, h, directions(looked_at))
            if self.decides is not True:
                found = jnp.where(self.decides, found, 0.0)
        signs = []
        for event, side in zip(self.sampler.events, self.sides, strict=True):
            n = count(event)
            if _is_known(side):
                signs.append(jnp.full(n, float(side)))
            else:
                signs.append(jnp.where(side == 0, found[i : i + n], side))
                i += n
        return jnp.concatenate(signs)

    def _search_step(
        self, keep, t: Array, y: Array, h: Array, memory: _Memory, side: Array
    ) -> _StepSearch:
        """The step after all its panels, or after the one in which something happens first."""
        begin = memory.end._replace(part=jnp.zeros_like(t), side=side)
        start = _StepSearch(
            n=jnp.zeros((), int), begin=begin, end=jnp.ones_like(t), bracket=Bracket.none(side)
        )

        most = _MAX_PANELS if self.in_time is None else _MAX_CLOCKED

        def panel(search: _StepSearch) -> _StepSearch:
            samples = self._sample(t, y, h, search.begin, search.end)
            new = _judge(search, samples, h, self.wanted, most)
            if self.in_time is None:
                return new
            # If something may be hidden in the panel, half of it is searched first.
            begin = search.begin.part
            width = search.end - begin
            hidden = self.in_time.hide(t + begin * h, t + search.end * h) & (width > _MIN_PANEL)
            half = search._replace(n=search.n + 1, end=begin + 0.5 * width)
            return jax.tree.map(lambda a, b: jnp.where(hidden, a, b), half, new)

        def going(search: _StepSearch) -> Array:
            over = search.bracket.found | jnp.isnan(search.begin.side)
            return keep & (search.begin.part < 1) & (search.n < _MAX_CLOCKED) & ~over.any()

        return jax.lax.while_loop(going, panel, start)

    def _sample(self, t: Array, y: Array, h: Array, begin: _Samples, end: Array) -> _Samples:
        """The events at the beginning of a panel, at the places within it and at its end."""
        parts = begin.part + _LOOK_PLACES[:-1] * (end - begin.part)
        parts = jnp.concatenate([begin.part[None], parts, end[None]])
        g, slope, known, noise, _ = self.sampler.after(t, y, parts[1:] * h)
        sides = [begin.side]
        for side in known:
            sides.append(jnp.where(side == 0, sides[-1], side))
        pairs = (begin.g, g), (begin.slope, slope), (begin.noise, noise)
        g, slope, noise = (jnp.concatenate([a[None], b]) for a, b in pairs)
        return _Samples(part=parts, g=g, slope=slope, side=jnp.stack(sides), noise=noise)


def _judge(
    search: _StepSearch, samples: _Samples, h: Array, wanted: Array, most: int
) -> _StepSearch:
    """The next panel, or the first stretch of this one that has to be refined."""
    width = search.end - search.begin.part
    exhausted = (width < _MIN_PANEL) | (search.n >= most)
    s = samples.side
    known = are_settled(h * samples.part, samples.g, samples.slope, s, samples.noise) | exhausted
    across = (s[:-1] * s[1:] < 0) & ((wanted == 0)[None] | (wanted[None] == s[1:]))
    unclear, n = _first(~known), len(_LOOK_PLACES)
    hit = _first(across)
    into, found = (unclear < n) & (unclear <= hit), hit < unclear
    begin = jax.tree.map(lambda x: x[jnp.where(into, unclear, n)], samples)
    # The next panel takes in what would be a sliver at the end of the step.
    following = jnp.where(
        search.end + (_PANEL_GROWTH + 1) * width < 1, search.end + _PANEL_GROWTH * width, 1.0
    )
    end = jnp.where(into, samples.part[jnp.minimum(unclear, n - 1) + 1], following)
    at = jnp.minimum(hit, n - 1)
    here = found & across[at]
    low, high = (jnp.where(here, samples.part[at + i], jnp.inf) for i in (0, 1))
    return _StepSearch(n=search.n + 1, begin=begin, end=end, bracket=Bracket(low, high, s[at + 1]))


def _first(flags: Array) -> Array:
    """() index of the first row of (n, E) flags with a flag set, n if there is none."""
    rows = flags.any(axis=1)
    return jnp.where(rows.any(), jnp.argmax(rows), len(rows))
