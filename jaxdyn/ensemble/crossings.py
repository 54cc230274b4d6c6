"""A watch that records the crossings of an event, in the lanes of an ensemble.

The search of `integrate.event_search` samples a step by further steps from its start. In a lane
these are the lane's own steps, so that all lanes keep searching and stepping together, vectorised,
and none waits for another: the watch steers its run. A step that may hide crossings, as judged from
the values and slopes at both ends and at a node before (`are_settled`), is taken again with half
its length. A step with a crossing is taken again up to where Newton's method expects it, until it
ends there; the run continues from the crossing.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.integrate.event_search.crossings import Beginning, HermiteCubic
from jaxdyn.integrate.event_search.event_values import TimeDependence, sizes, values_and_signs
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.march import StepDecision, Watch
from jaxdyn.scene import Field

_GUESSES = 5  # Newton steps for the zero of the polynomial through the ends of a step


class Node(NamedTuple):
    """The event at a time of the run."""

    t: Array  # () in the direction of the run
    g: Array  # () value
    slope: Array  # () of the value in that time
    side: Array  # () its sign, 0 where rounding decides
    noise: Array  # () values up to this are rounding


def zero_between(before: Node, here: Node, end: Node) -> Array:
    """() time after `here` of the zero between it and `end` of the quintic through all three.

    It is Newton's interpolation with double nodes; Newton's method finds its zero in the bracket.
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


#: Most halvings of a step: in a stretch this short a value has no extremum except by rounding.
_MAX_HALVINGS = 24
_GROWTH = 3  # halvings that a step regains after one that is kept; a bit less than is possible
#: A trial step that ends this close to the crossing is the last one, as a part of the step. The
#: remaining correction is linear in time, with an error of the order of its square, below rounding.
_CLOSE = 2.0**-28
_LEAST_STRETCH = 0.25  # part of the stretch before: a shorter one shows no third derivatives
#: The linear correction leaves at most this part of the value at a simple zero. At a flat zero of
#: order n it leaves (1 - 1/n)^n, which is 1/4 or more.
_SIMPLE = 0.1
#: Most trial steps for one crossing; about four are usual. At a flat zero every second one halves
#: the bracket.
_MAX_TRIALS = 200


class CrossingRecord(NamedTuple):
    """What the watch remembers.

    Attributes:
      ts: (rows,) times of the crossings; NaN after the last.
      ys: (rows, k) states at these times; NaN likewise.
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
    before: Node  # an earlier node
    here: Node  # the node that the next step begins at
    side: Array  # () sign of the event just after it
    begun: Array  # () whether a step has been accepted
    beginning: Beginning  # what was seen at the start
    halved: Array  # () how often the step has been halved, less what it has grown
    trials: Array  # () number of trial steps to a crossing, 0 if none is being located
    step: Array  # () length of the step that holds the crossing
    low: Array  # () bracket of the crossing, as time after the node
    high: Array
    change: Array  # () length of the last correction


class EachCrossing(Watch):
    """A watch that records the crossings of an event; the run ends when there is no more room.

    It has to be used alone, since it decides where steps begin and end. A crossing is found if the
    value is smooth over a step and goes beyond zero by more than 4 roundings of the state.

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

    def start(self, t0, y0):
        start = Beginning.of(self.field, (self.event,), self.direction * t0, y0)
        zero, none, no = jnp.zeros_like(t0), jnp.zeros((), int), jnp.zeros((), bool)
        here = Node(t0, start.g[0], self.direction * start.slope[0], zero, start.noise[0])
        search = _Search(
            before=here,
            here=here,
            side=zero,
            begun=no,
            beginning=start,
            halved=none,
            trials=none,
            step=zero,
            low=zero,
            high=zero,
            change=zero,
        )
        return CrossingRecord(
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
        fine, search = keep, memory.search
        end, crossed = self._end(y0, t1, y1)
        first = search.beginning.sides((self.event,), self.direction * (t1 - t0), self._direction)
        side = jnp.where(search.begun, search.side, first[0])
        searching = search.trials > 0
        in_time = TimeDependence.of((self.event,), y1.shape[0])
        hidden = False
        if in_time is not None:
            hidden = in_time.hide(self.direction * t0, self.direction * t1)
        stepped = _step(search, side, end, self._direction, hidden)
        closed = _approach(search, side, end, crossed.simple)
        found = fine & searching & closed.arrived
        keep = fine & jnp.where(searching, closed.arrived, stepped.keep)
        h = jnp.where(searching, closed.h, stepped.h)
        # After a crossing the next step is as long as the one that held it: step control chooses
        # longer ones only afterwards.
        full = jnp.where(found, t1 + search.step, following)
        aim = jnp.where(fine, jnp.where(keep, full, t0 + h), following)
        towards = jnp.where(searching, -side, stepped.side)
        new = _following(search, keep, end, towards)
        begins = ~searching & ~stepped.keep & stepped.across
        halves = ~searching & ~begins
        new = new._replace(
            halved=jnp.maximum(search.halved + jnp.where(keep, -_GROWTH, halves.astype(int)), 0),
            trials=jnp.where(keep, 0, jnp.where(searching, search.trials + 1, begins.astype(int))),
            step=jnp.where(begins, t1 - t0, search.step),
            low=jnp.where(begins, 0.0, closed.low),
            high=jnp.where(begins, t1 - t0, closed.high),
            change=jnp.where(begins, t1 - t0, closed.change),
        )
        # Where step control has rejected a step, the search for a crossing begins afresh.
        kept = search._replace(trials=jnp.zeros_like(search.trials))
        new = jax.tree.map(lambda a, b: jnp.where(fine, a, b), new, kept)
        lost = fine & jnp.isnan(end.g)
        memory = _record(memory, found, crossed, -side)._replace(search=new, lost=lost)
        return StepDecision(
            keep=keep, following=aim, memory=memory, stop=lost | (memory.count >= self.most)
        )

    @property
    def _direction(self) -> Array:
        return jnp.asarray(float(self.event.direction))

    def _end(self, y0: Array, t1: Array, y1: Array) -> tuple[Node, "_NearbyCrossing"]:
        """The event at the end (t1, y1) of a step from y0, and the crossing if it is near there."""
        t, system = self.direction * t1, self.field.system
        rate = self.field.rate(t, y1)
        size = jnp.maximum(sizes(system, y0), sizes(system, y1))
        g, slope, side, noise = (x[0] for x in values_and_signs((self.event,), t, y1, rate, size))
        late = -g / jnp.where(slope == 0, 1.0, slope)
        y = self.field.project(t + late, y1 + rate * late)
        left = jnp.abs(self.event.value(t + late, y))
        simple = (slope != 0) & (left <= _SIMPLE * jnp.abs(g))
        end = Node(t1, g, self.direction * slope, side, noise)
        crossed = _NearbyCrossing(
            jnp.where(slope == 0, t, t + late), jnp.where(slope == 0, y1, y), simple
        )
        return end, crossed


class _NearbyCrossing(NamedTuple):
    """A crossing next to the end of a step, moved onto the event in a straight line."""

    t: Array  # ()
    y: Array  # (k,)
    simple: Array  # () whether the line leads there


def _record(
    memory: CrossingRecord, found: Array, crossed: _NearbyCrossing, side: Array
) -> CrossingRecord:
    """The memory with a crossing, if one is found, to this side () of the event."""
    row = found & (jnp.arange(len(memory.ts)) == memory.count)
    return memory._replace(
        ts=jnp.where(row, crossed.t, memory.ts),
        ys=jnp.where(row[:, None], crossed.y[None], memory.ys),
        directions=jnp.where(row, side.astype(int), memory.directions),
        count=memory.count + found.astype(int),
    )


class _StepVerdict(NamedTuple):
    """The verdict on a whole step."""

    keep: Array  # () whether it has no crossing that counts, and hides none
    across: Array  # () whether it has exactly one, which counts
    side: Array  # () sign of the value at its end
    h: Array  # () length of the next step if it is not kept


def _step(
    search: _Search, side: Array, end: Node, wanted: Array, hidden: Array | bool
) -> _StepVerdict:
    here, before = search.here, search.before
    h = end.t - here.t
    # Before the first node, the value is continued as a straight line.
    first = before.t == here.t
    back = here._replace(t=here.t - h, g=here.g - h * here.slope)
    before = jax.tree.map(lambda a, b: jnp.where(first, a, b), back, before)
    noise = jnp.maximum(here.noise, end.noise)
    after = jnp.where(end.side == 0, side, end.side)
    last, this = _cubic(before, here), _cubic(here, end)
    fourth = jnp.abs((this.third - last.third) / (0.5 * (last.width + this.width)))
    known = this.is_settled(fourth, side, after, noise) & ~jnp.asarray(hidden)
    known |= search.halved >= _MAX_HALVINGS
    across = known & (side * after < 0) & ((wanted == 0) | (wanted == after))
    guess = zero_between(before, here, end)
    return _StepVerdict(
        keep=(known & ~across) | jnp.isnan(end.g),
        across=across,
        side=after,
        h=jnp.where(across, guess, 0.5 * h),
    )


def _cubic(a: Node, b: Node) -> HermiteCubic:
    return HermiteCubic(a.g, b.g, a.slope, b.slope, b.t - a.t)


class _Approach(NamedTuple):
    """The verdict on a trial step to a crossing."""

    arrived: Array  # () whether it ends at the crossing
    low: Array  # () the bracket after it
    high: Array
    h: Array  # () length of the next trial step
    change: Array  # () by how much that differs from this one


def _approach(search: _Search, side: Array, end: Node, simple: Array) -> _Approach:
    h = end.t - search.here.t
    before = jnp.sign(end.g) == side
    low, high = jnp.where(before, h, search.low), jnp.where(before, search.high, h)
    change = -end.g / jnp.where(end.slope == 0, 1.0, end.slope)
    near = simple & (jnp.abs(change) <= _CLOSE * search.step)
    eps = jnp.finfo(h.dtype).eps
    fine = jnp.abs(high - low) <= 2 * eps * jnp.maximum(jnp.abs(h), jnp.abs(end.t))
    arrived = near | fine | (end.side == 0) | (search.trials >= _MAX_TRIALS)
    new = h + change
    halved = 2 * jnp.abs(change) <= search.change
    inside = (new > low) & (new < high) & (end.slope != 0) & halved
    new = jnp.where(inside, new, 0.5 * (low + high))
    return _Approach(arrived, low, high, new, jnp.abs(new - h))


def _following(search: _Search, keep: Array, end: Node, side: Array) -> _Search:
    """The search from the end of a step that is kept, or as it was."""
    too_short = (end.t - search.here.t) < _LEAST_STRETCH * (search.here.t - search.before.t)

    def chosen(new, old):
        return jax.tree.map(lambda a, b: jnp.where(keep, a, b), new, old)

    before = jax.tree.map(lambda a, b: jnp.where(too_short, a, b), search.before, search.here)
    return search._replace(
        before=chosen(before, search.before),
        here=chosen(end, search.here),
        side=jnp.where(keep, side, search.side),
        begun=search.begun | keep,
    )
