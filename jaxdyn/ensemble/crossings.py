"""A watch that records the crossings of an event, in the lanes of an ensemble.

The search of `integrate.event_search` looks into a step by more steps from its start. In a lane
these are the lane's own steps, so that all lanes go on looking and stepping together, vectorised,
and none waits for another: the watch steers its run. A step that may hide crossings, as judged from
the values and slopes at both ends and at a node before (`stretches`), is taken again with half its
length. A step with a crossing is taken again up to where Newton's method expects it, until it ends
there; the run goes on from the crossing.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.integrate.event_search.event_values import (
    SIDE_ROUNDINGS,
    bends,
    first_side,
    looked,
)
from jaxdyn.integrate.event_search.stretches import Stretch
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.observing import Steered, Watch
from jaxdyn.scene import Field

_MAX_HALVINGS = 24  # of a step: in so short a stretch a value has no extremum except by rounding
#: Of a step: a look this close to the crossing is the last one. The remaining correction is linear
#: in time, with an error of the order of its square, below rounding.
_CLOSE = 2.0**-28
_LEAST_STRETCH = 0.25  # of the stretch before it: a shorter one does not tell third derivatives
_GUESSES = 5  # Newton steps for the zero of the polynomial through the ends of a step
_MAX_LOOKS = 60  # for one crossing


class _Node(NamedTuple):
    """The event at a time of the run."""

    t: Array  # () in the direction of the run
    g: Array  # () value
    slope: Array  # () of the value in that time


class Recorded(NamedTuple):
    """What the watch remembers.

    Attributes:
      ts: (rows,) times of the crossings; NaN after the last.
      ys: (rows, k) states then; NaN likewise.
      directions: (rows,) 1 where the value rose along the motion, -1 where it fell, else 0.
      count: () number of crossings.
      lost: () whether the event became NaN, which ended the run.
      search: state of the search.
    """

    ts: Array
    ys: Array
    directions: Array
    count: Array
    lost: Array
    search: "_Search"


class _Search(NamedTuple):
    before: _Node  # an earlier node
    here: _Node  # the node that the next step begins at
    side: Array  # () sign of the event just after it
    begun: Array  # () whether a step has been accepted
    noise: Array  # () values up to this are rounding
    speed: Array  # () at the start, one rounding of the slope
    bend: Array  # () one rounding of the second derivative
    halved: Array  # () how often the step has been halved
    looks: Array  # () for the crossing so far, 0 if none is looked for
    step: Array  # () length of the step that holds the crossing
    low: Array  # () bracket of the crossing, as time after the node
    high: Array


class EachCrossing(Watch):
    """Records the crossings of an event; ends the run at the last for which there is room.

    To be used alone: it decides where steps begin and end. A crossing is found if the value is
    smooth over a step and goes beyond zero by more than 4 roundings of the state.

    Attributes:
      field: the field of the motion.
      event: what crosses zero, with the direction that counts.
      most: () number of crossings after which the run ends.
      rows: number of crossings there is room for.
    """

    field: Field
    event: Event
    most: Array
    rows: int = eqx.field(static=True)
    direction: Array | float = 1.0

    def towards(self, direction):
        return EachCrossing(self.field, self.event, self.most, self.rows, direction)

    def start(self, t0, y0):
        at = self.field, (self.event,), self.direction * t0, y0
        there = looked(*at)
        here = _Node(t=t0, g=there.values[0], slope=self.direction * there.slopes[0])
        zero, none, no = jnp.zeros_like(t0), jnp.zeros((), int), jnp.zeros((), bool)
        search = _Search(
            before=here,
            here=here,
            side=zero,
            begun=no,
            noise=there.rounding[0] + jnp.abs(t0) * there.speeds[0],
            speed=there.speeds[0],
            bend=bends(*at)[0],
            halved=none,
            looks=none,
            step=zero,
            low=zero,
            high=zero,
        )
        return Recorded(
            ts=jnp.full(self.rows, jnp.nan),
            ys=jnp.full((self.rows, *y0.shape), jnp.nan),
            directions=jnp.zeros(self.rows, int),
            count=none,
            lost=no,
            search=search,
        )

    def see(self, keep, t0, y0, t1, y1, memory):
        remedy = "It decides where steps begin and end."
        raise _checks.fail("watch", "EachCrossing alone", "it among others", remedy)

    def steer(self, keep, t0, y0, t1, y1, memory, following):
        del y0
        fine, search = keep, memory.search
        there = looked(self.field, (self.event,), self.direction * t1, y1)
        end = _Node(t=t1, g=there.values[0], slope=self.direction * there.slopes[0])
        side = jnp.where(search.begun, search.side, self._first_side(t1 - t0, search))
        looking = search.looks > 0
        stepped = _stepped(search, side, end, self._wanted)
        closed = _looked(search, side, end, there.rounding[0])
        found = fine & looking & closed.arrived
        keep = fine & jnp.where(looking, closed.arrived, stepped.keep)
        h = jnp.where(looking, closed.h, stepped.h)
        # Longer than the step was it need not become: the control's own choice follows then.
        full = jnp.where(found, t1 + search.step, following)
        aim = jnp.where(fine, jnp.where(keep, full, t0 + h), following)
        towards = jnp.where(looking, -side, stepped.side)
        new = _following(search, keep, end, towards)
        begins = ~looking & ~stepped.keep & stepped.across
        new = new._replace(
            halved=jnp.where(keep | looking, 0, search.halved + (~begins).astype(int)),
            looks=jnp.where(keep, 0, jnp.where(looking, search.looks + 1, begins.astype(int))),
            step=jnp.where(begins, t1 - t0, search.step),
            low=jnp.where(begins, 0.0, closed.low),
            high=jnp.where(begins, t1 - t0, closed.high),
        )
        # Where the step control has rejected a step, the crossing is looked for afresh.
        kept = search._replace(looks=jnp.zeros_like(search.looks))
        new = jax.tree.map(lambda a, b: jnp.where(fine, a, b), new, kept)
        lost = fine & jnp.isnan(end.g)
        memory = self._record(memory, found, end, y1)._replace(search=new, lost=lost)
        return Steered(
            keep=keep, following=aim, memory=memory, stop=lost | (memory.count >= self.most)
        )

    @property
    def _wanted(self) -> Array:
        return jnp.asarray(float(self.event.direction))

    def _first_side(self, h: Array, search: _Search) -> Array:
        here = search.here
        rounding = {"speeds": search.speed, "bends": search.bend}
        return first_side(here.g, here.slope, h, search.noise, wanted=self._wanted, **rounding)

    def _record(self, memory: Recorded, found: Array, end: _Node, y: Array) -> Recorded:
        """With the crossing next to a look at its end, moved onto the event."""
        slope = jnp.where(found, end.slope, 1.0)
        late = -end.g / slope
        t = self.direction * (end.t + late)
        y = y + self.direction * self.field.rate(self.direction * end.t, y) * late
        y = self.field.project(t, y)
        row = found & (jnp.arange(self.rows) == memory.count)
        way = jnp.sign(slope).astype(int)
        return memory._replace(
            ts=jnp.where(row, t, memory.ts),
            ys=jnp.where(row[:, None], y[None], memory.ys),
            directions=jnp.where(row, way, memory.directions),
            count=memory.count + found.astype(int),
        )


class _Stepped(NamedTuple):
    """The verdict on a whole step."""

    keep: Array  # () no crossing that counts, and none hidden
    across: Array  # () exactly one, and it counts
    side: Array  # () at its end
    h: Array  # () length of the next step where it is not kept


def _stepped(search: _Search, side: Array, end: _Node, wanted: Array) -> _Stepped:
    here, before = search.here, search.before
    h = end.t - here.t
    # Before the first node the value goes on as a straight line.
    first = before.t == here.t
    back = _Node(here.t - h, here.g - h * here.slope, here.slope)
    before = jax.tree.map(lambda a, b: jnp.where(first, a, b), back, before)
    noise = SIDE_ROUNDINGS * search.noise
    after = jnp.where(jnp.abs(end.g) <= noise, side, jnp.sign(end.g))
    last, this = _stretch(before, here), _stretch(here, end)
    fourth = jnp.abs((this.third - last.third) / (0.5 * (last.width + this.width)))
    known = this.settled(fourth, side, after, noise) | (search.halved >= _MAX_HALVINGS)
    across = known & (side * after < 0) & ((wanted == 0) | (wanted == after))
    guess = _zero(before, here, end)
    return _Stepped(
        keep=(known & ~across) | jnp.isnan(end.g),
        across=across,
        side=after,
        h=jnp.where(across, guess, 0.5 * h),
    )


def _stretch(a: _Node, b: _Node) -> Stretch:
    return Stretch(a.g, b.g, a.slope, b.slope, b.t - a.t)


class _Closed(NamedTuple):
    """The verdict on a look for a crossing."""

    arrived: Array  # () the crossing is here
    low: Array  # () the bracket after it
    high: Array
    h: Array  # () time after the node of the next look


def _looked(search: _Search, side: Array, end: _Node, rounding: Array) -> _Closed:
    h = end.t - search.here.t
    before = jnp.sign(end.g) == side
    low, high = jnp.where(before, h, search.low), jnp.where(before, search.high, h)
    change = -end.g / jnp.where(end.slope == 0, 1.0, end.slope)
    near = (end.slope != 0) & (jnp.abs(change) <= _CLOSE * search.step)
    eps = jnp.finfo(h.dtype).eps
    fine = jnp.abs(high - low) <= 2 * eps * jnp.maximum(jnp.abs(h), jnp.abs(end.t))
    arrived = near | fine | (jnp.abs(end.g) <= 2 * rounding) | (search.looks >= _MAX_LOOKS)
    new = h + change
    inside = (new > low) & (new < high) & (end.slope != 0)
    return _Closed(arrived, low, high, jnp.where(inside, new, 0.5 * (low + high)))


def _following(search: _Search, keep: Array, end: _Node, side: Array) -> _Search:
    """The search from the end of a step that is kept, or as it was."""
    short = (end.t - search.here.t) < _LEAST_STRETCH * (search.here.t - search.before.t)

    def chosen(new, old):
        return jax.tree.map(lambda a, b: jnp.where(keep, a, b), new, old)

    before = jax.tree.map(lambda a, b: jnp.where(short, a, b), search.before, search.here)
    return search._replace(
        before=chosen(before, search.before),
        here=chosen(end, search.here),
        side=jnp.where(keep, side, search.side),
        begun=search.begun | keep,
    )


def _zero(before: _Node, here: _Node, end: _Node) -> Array:
    """() time after `here` of the zero between it and `end` of the quintic through all three.

    Newton's interpolation with double nodes; its zero by Newton's method within the bracket.
    """
    x = [node.t - here.t for node in (before, before, here, here, end, end)]
    table = [node.g for node in (before, before, here, here, end, end)]
    slopes = [node.slope for node in (before, here, end)]
    coefficients = [table[0]]
    for order in range(1, 6):
        table = [
            slopes[i // 2]
            if order == 1 and i % 2 == 0
            else (table[i + 1] - table[i]) / (x[i + order] - x[i])
            for i in range(6 - order)
        ]
        coefficients.append(table[0])
    h = end.t - here.t

    def newton(_, s):
        value, slope = coefficients[-1], jnp.zeros_like(s)
        for c, node in zip(coefficients[-2::-1], x[4::-1], strict=True):
            value, slope = c + (s - node) * value, value + (s - node) * slope
        new = s - value / jnp.where(slope == 0, 1.0, slope)
        return jnp.where((new > 0) & (new < h), new, 0.5 * s)

    first = h * here.g / jnp.where(here.g == end.g, 1.0, here.g - end.g)
    first = jnp.where((first > 0) & (first < h), first, 0.5 * h)
    for i in range(_GUESSES):
        first = newton(i, first)
    return first
