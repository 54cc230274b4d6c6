"""The branch engine: the interface of problems, predictor, locator, step control, and the loop.

A branch is a curve of solutions: equilibria or orbits in a parameter, folds in two parameters,
tori. To follow one, pose it as a `BranchProblem`, which has a `Chart` near each member: the
unknowns in units in which lengths and angles are meaningful, and the equations for Newton's method.
Everything else is implemented here, once: a step predicts along the tangent and corrects in the
plane across it (Keller's pseudo-arclength continuation); steps are shortened where one fails and
lengthened where Newton's method converges easily; a special point between two neighbours is located
where a test changes sign, by the Illinois method, and so is the member on the bound at which a
branch ends; and a branch is kept in a file, from which an interrupted run resumes (`checkpoint`).

Reference: Keller (1977), in Rabinowitz (ed.), Applications of Bifurcation Theory, 359; Dowell,
Jarratt (1971), BIT 11, 168, for the Illinois method.
"""

import abc
import functools
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from jaxdyn._checks import fail
from jaxdyn.continuation.checkpoint import (
    Advance,
    Begin,
    Checkpoint,
    Codec,
    Log,
    SavedBranch,
    resume,
)

#: The default bounds on a parameter: none.
ANYWHERE = (-math.inf, math.inf)
_INTERRUPTED = "an interruption"
#: The end of a branch that closes upon itself.
CLOSED = "the first one again: it is closed"
_EASY = 4  # with at most this many Newton steps the next step may be longer
_GROW, _SHRINK = 1.5, 0.5
_CAREFUL = 1 / 16  # part of the first step down to which a doubtful step is shortened
_TRIALS = 60  # largest number of trial points to locate a special point
#: Relative distances of a number from a bound: that to which the member on it is located; that
#: which counts as rounding; that within which a last member, or a special point, counts as on it.
_MET, _ROUNDING, _ON_BOUND = 1e-13, 1e-12, 1e-9
_LEAST = 1e-3  # part of its unit: a smaller number counts as of this size

Member = TypeVar("Member")


class Place(NamedTuple):
    """The position of a member, in the units of a chart.

    Attributes:
      x: (n,) its unknowns.
      tangent: (n,) direction of the branch there; its measured part has unit length.
    """

    x: np.ndarray
    tangent: np.ndarray


class Correction(NamedTuple):
    """The result of a corrector.

    Attributes:
      x: (n,) the unknowns, in the units of the chart.
      iterations: number of Newton steps.
      solution: the member itself, or data from which the chart makes a tangent and a member.
    """

    x: np.ndarray
    iterations: int
    solution: Any


class Step(NamedTuple, Generic[Member]):
    """A step that succeeded.

    Attributes:
      member: the new member.
      factor: the factor by which the next step may be longer.
    """

    member: Member
    factor: float


class Bounded(NamedTuple):
    """One or several numbers of a member that have bounds; NaN for one that the branch lacks.

    Attributes:
      values: the number, or (n,) several.
      within: its bounds, or a pair for each of several.
      of: what they are bounds on, such as "on the energy, "; "" for the parameters.
      units: units of the numbers, () or (n,): near 0 accuracy is relative to these.
    """

    values: Any
    within: Sequence
    of: str = ""
    units: Any = 0.0

    @property
    def reason(self) -> str:
        """Why a branch ends on the bounds."""
        return bounds_reason(self.within, self.of)

    @property
    def edges(self) -> Iterator[tuple[float, float]]:
        """For each finite bound, how far the number is beyond it, and the larger of both sizes."""
        values = np.ravel(self.values)
        least = _LEAST * np.broadcast_to(self.units, values.shape)
        for sign, bounds in zip((-1.0, 1.0), np.reshape(self.within, (-1, 2)).T, strict=True):
            known = np.isfinite(bounds)
            beyond = sign * (values - bounds)[known]
            sizes = np.maximum(np.maximum(np.abs(values), np.abs(bounds)), least)[known]
            yield from zip(beyond.tolist(), sizes.tolist(), strict=True)


class Chart(abc.ABC, Generic[Member]):
    """A branch near one of its members, with unknowns in the units of that member.

    A method that fails returns the reason as text in place of a result.

    Attributes:
      measured: index of the unknowns in which lengths and angles are measured.
      reach: longest correction, in lengths of the step; a longer one may reach another branch.
      turn: smallest cosine between the tangents of neighbours.
      resolution: relative distance within which two members are the same, for the locator.
    """

    measured: Any = slice(None)
    reach: float = 1.0
    turn: float = 0.9  # 26 degrees
    resolution: float = 1e-15

    @abc.abstractmethod
    def place(self, member: Member) -> Place:
        """The position of a member."""

    @abc.abstractmethod
    def correct(self, last: Member, start: np.ndarray, plane: np.ndarray) -> Correction | str:
        """The solution near a start (n,), in the plane through a point (n,) across the tangent."""

    def tangent(self, last: Member, found: Correction) -> np.ndarray | str:
        """(n,) the tangent of the branch at a solution, oriented as at `last`."""
        del last
        return self.place(found.solution).tangent

    def member(self, last: Member, found: Correction, tangent: np.ndarray) -> Member | str:
        """The member at a solution."""
        del last, tangent
        return found.solution

    def inward(self, member: Member) -> Member:
        """A member in the units of this chart."""
        return member

    def outward(self, member: Member) -> Member:
        """A member of this chart in the units of the branch."""
        return member

    def cosine(self, last: Member, found: Correction, tangent: np.ndarray) -> float:
        """The cosine of the angle between the tangents at a member and at a solution."""
        del found
        a, b = self.place(last).tangent[self.measured], tangent[self.measured]
        return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))

    def growth(self, last: Member, new: Member, iterations: int, bent: float) -> float:
        """The factor by which the next step may be longer.

        Args:
          last: the member before the step.
          new: the member after it.
          iterations: number of Newton steps.
          bent: length of the correction, in lengths of the step.
        """
        del last, new, bent
        return _GROW if iterations <= _EASY else 1.0

    def is_in_doubt(self, last: Member, new: Member) -> bool:
        """Whether a step may have led to another part of the branch, or to another branch."""
        del last, new
        return False

    def step(self, last: Member, length: float) -> Step[Member] | str:
        """The member one step further along the branch, or back."""
        here = self.place(last)
        predicted = here.x + length * here.tangent
        found = self.correct(last, predicted, predicted)
        if isinstance(found, str):
            return found
        correction = float(np.linalg.norm((found.x - predicted)[self.measured]))
        if not correction <= self.reach * abs(length):
            return "Newton's method does not converge nearby"
        tangent = self.tangent(last, found)
        if isinstance(tangent, str):
            return tangent
        if self.cosine(last, found, tangent) < self.turn:
            return "the branch turns within the shortest step, or meets another one"
        new = self.member(last, found, tangent)
        if isinstance(new, str):
            return new
        return Step(new, self.growth(last, new, found.iterations, correction / abs(length)))

    def along(self, a: Member, b: Member) -> float:
        """The distance from one member to another, along the tangent of the first."""
        here, there = self.place(a), self.place(b)
        return float(here.tangent[self.measured] @ (there.x - here.x)[self.measured])

    def between(self, a: Member, b: Member, share: float) -> Member | None:
        """The member at a fraction of the way from one to another; None if there is none."""
        here, there = self.place(a), self.place(b)
        plane = here.x + share * self.along(a, b) * here.tangent
        # It starts on the chord, since the equations may be singular at a special point itself.
        found = self.correct(a, here.x + share * (there.x - here.x), plane)
        if isinstance(found, str):
            return None
        tangent = self.tangent(a, found)
        new = tangent if isinstance(tangent, str) else self.member(a, found, tangent)
        return None if isinstance(new, str) else new

    def at_end(self, a: Member, b: Member, share: float, resolution: float | None = None) -> bool:
        """Whether the position at a fraction of the way from one to another is that of an end."""
        size = 1.0 + np.linalg.norm(self.place(a).x[self.measured])
        least = (resolution or self.resolution) * size
        return not min(share, 1 - share) * abs(self.along(a, b)) > least

    def locate(
        self,
        test: Callable[[Member], float],
        a: Member,
        b: Member,
        *,
        first: bool = False,
        enough: float | None = None,
    ) -> Member | None:
        """The member between two neighbours where a test is zero, by the Illinois method.

        None if the test has no zero there (`changes_sign`). Where the bracket cannot be divided
        further, it is the best member found; the caller must check that its test is small enough.
        A test of a number of the member itself, not of its motion, can be more accurate than
        `resolution`: with `enough`, the search goes on until the test is as small as that.
        """
        goal, resolution = (0.0, None) if enough is None else (enough, Chart.resolution)
        left, right, side = test(a), test(b), 0
        if not changes_sign(left, right, first):
            return None
        best, least = (a, abs(left)) if abs(left) < abs(right) else (b, abs(right))
        for _ in range(_TRIALS):
            share = left / (left - right)
            if least <= goal or self.at_end(a, b, share, resolution):
                break
            point = self.between(a, b, share)
            if point is None or math.isnan(value := test(point)):
                break
            if abs(value) < least:
                best, least = point, abs(value)
            if value * left > 0:
                a, left, right = point, value, right * (0.5 if side < 0 else 1.0)
                side = -1
            else:
                b, right, left = point, value, left * (0.5 if side > 0 else 1.0)
                side = 1
        return best


class BranchProblem(abc.ABC, Generic[Member]):
    """The branch that is followed: its members, special points, end, and how it is saved.

    Attributes:
      what: the kind of walk, as files name it.
      shortest: smallest step, relative to the first one.
      longest: largest step, likewise.
    """

    what: str
    shortest: float = 1e-4
    longest: float = 10.0

    @abc.abstractmethod
    def chart(self, member: Member) -> Chart[Member]:
        """The branch near a member."""

    @abc.abstractmethod
    def codec(self) -> Codec:
        """How members are saved in files."""

    def special(self, chart: Any, a: Member, b: Member, first: bool) -> list[Member]:
        """The special points between two neighbours in a chart, in order; `first`: also at `a`."""
        del chart, a, b, first
        return []

    def again(self, chart: Any, first: Member, a: Member, b: Member) -> Member | None:
        """The first member of all, if it is met again between two neighbours; None if not."""
        del chart, first, a, b

    def end_before(self, new: Member, special: list[Member]) -> str:
        """Why the branch ends before a new member; "" if it does not."""
        del new, special
        return ""

    def bounded(self, chart: Any, member: Member) -> list[Bounded]:
        """The numbers of a member of a chart that have bounds, which the branch does not leave."""
        del chart, member
        return []

    def lost(self, reason: str) -> str:
        """Why the branch ends if no member is found, however short the step."""
        return f"nothing was found beyond: {reason}"

    def ready(self, member: Member) -> Member:
        """The same member, in the form from which the next step starts."""
        return member

    def identity(self, first: Member, member: Member) -> np.ndarray:
        """(n,) numbers that identify a member: its place, in the units of the first member."""
        chart = self.chart(first)
        return np.concatenate(chart.place(chart.inward(member)))

    def about(self) -> dict[str, Any]:
        """Further data that distinguish the branch from others, and are needed to read it."""
        return {}


class Branch(NamedTuple):
    """A branch that was followed.

    Attributes:
      members: the members, one for each step.
      special: the special points between them.
      before: the number of members before each special point.
      end: why it ends.
    """

    members: tuple
    special: tuple
    before: tuple[int, ...]
    end: str


def follow(
    problem: BranchProblem[Member],
    first: Member,
    step: float,
    most: int,
    report: Callable[[Member], None],
    path: str | Path | Log | None = None,
) -> Branch:
    """At most `most` members from the first one on; the first step has the length `step`.

    A branch that leaves its bounds ends with the member on the bound that it meets first.

    A file at `path` saves each member as it is found, and provides those that an earlier run found.
    """
    about = {} if path is None else problem.about()
    place = functools.partial(problem.identity, first)
    begin = Begin(problem.what, step, place(first), first, about)
    with resume(path, begin, problem.codec(), place) as (first, checkpoint):
        report(first)
        found, end = [], f"the number of members requested, {most}"
        for advance in itertools.islice(_advances(problem, first, step, checkpoint), most - 1):
            found.append(advance)
            if advance.member is not None:
                report(advance.member)
            if advance.end:
                end = advance.end
                break
        if checkpoint is not None:
            checkpoint.finish(end)
    return _branch(first, found, end)


def begin_within(
    problem: BranchProblem[Member], chart: Chart[Member], start: Member, first: Member
) -> Member:
    """The first member of a branch, in a chart, that leads from a special point to a member.

    That is the member, or the one on the bound that is met on the way to it; or the special point,
    if that is on the bound.
    """
    _, until, _ = _Edge(problem, chart, start, first).cut([], first)
    return start if until is None else until


def read(walk: SavedBranch, codec: Codec) -> Branch:
    """The branch in a file."""
    return _branch(*walk.read(codec), walk.end or _INTERRUPTED)


def _branch(first: Any, advances: list[Advance], end: str) -> Branch:
    special, before = [], []
    for n, advance in enumerate(advances, 1):
        special += advance.special
        before += [n] * len(advance.special)
    members = [advance.member for advance in advances if advance.member is not None]
    return Branch((first, *members), tuple(special), tuple(before), end)


def _advances(
    problem: BranchProblem, first, step: float, checkpoint: Checkpoint | None
) -> Iterator[Advance]:
    """The steps from the first member on: those of the file, then new ones."""
    last, length = first, step
    for advance in () if checkpoint is None else checkpoint.advances:
        yield _of_file(problem, last, advance)
        last, length = advance.member, advance.step
    while True:
        advance, kept = _advance(problem, first, last, length, step)
        if checkpoint is not None and kept:
            checkpoint.add(advance)
        yield advance
        last, length = advance.member, advance.step


def _advance(
    problem: BranchProblem, first, last, length: float, step: float
) -> tuple[Advance, bool]:
    """The next step, shortened until it finds a member, and whether to save it in the file.

    A step without a member because of the bounds is not saved, as wider bounds may lead on.
    """
    chart = problem.chart(last)
    here = chart.inward(last)
    new = chart.step(here, length)
    while isinstance(new, str) or (
        length > _CAREFUL * step and chart.is_in_doubt(here, new.member)
    ):
        length *= _SHRINK
        if isinstance(new, str) and length < problem.shortest * step:
            return Advance(None, [], length, problem.lost(new)), True
        new = chart.step(here, length)
    again = problem.again(chart, first, here, new.member)
    until = new.member if again is None else again
    special = problem.special(chart, here, until, last is first)
    special, until, end = _Edge(problem, chart, here, new.member).cut(special, until)
    special = [chart.outward(x) for x in special]
    if until is None:
        # The bounds are not the reason where the branch ends before this point in any case.
        why = problem.end_before(chart.outward(new.member), special) or end
        return Advance(None, special, length, why), False
    member = chart.outward(until)
    before = problem.end_before(member, special)
    if not (before or end or again is None):
        before = CLOSED
    length = min(new.factor * length, problem.longest * step)
    if before:
        return Advance(None, special, length, before), True
    return Advance(problem.ready(member), special, length, end), True


def _of_file(problem: BranchProblem, last, advance: Advance) -> Advance:
    """A step from the file, cut at the bounds, which may differ from those of its own run."""
    if advance.member is None:
        return advance
    chart = problem.chart(last)
    here, new = chart.inward(last), chart.inward(advance.member)
    edge = _Edge(problem, chart, here, new)
    special, until, end = edge.cut([chart.inward(x) for x in advance.special], new)
    if until is new:
        return advance._replace(end=edge.met(new) if advance.end else "")
    member = None if until is None else problem.ready(chart.outward(until))
    return Advance(member, advance.special[: len(special)], advance.step, end)


class _Edge(Generic[Member]):
    """The bounds of a branch between a member and the next one."""

    def __init__(self, problem: BranchProblem[Member], chart: Chart[Member], here, new):
        self.problem, self.chart, self.here = problem, chart, here
        self.reasons = [x.reason for x in problem.bounded(chart, here) for _ in x.edges]
        sizes = np.max([[size for _, size in self._edges(x)] for x in (here, new)], axis=0)
        self.sizes = np.where(sizes > 0, sizes, 1.0)

    def cut(self, special: list[Member], new: Member) -> tuple[list[Member], Member | None, str]:
        """The special points within the bounds, the last member there, and why the branch ends.

        Special points are in order: if a branch leaves the bounds and returns within a step, one
        of them is beyond the bounds. If the branch does not leave them, the last member is the new
        one and the reason "". The last member is None if it is the one at which the step begins.
        """
        for n, point in enumerate(special):
            until, end = self._towards(point, _ON_BOUND)
            if end:
                return special[:n], until, end
        return special, *self._towards(new, _ROUNDING)

    def _towards(self, point: Member, off: float) -> tuple[Member | None, str]:
        """The last member within the bounds on the way to a point; see `cut`.

        The point is within the bounds if it is beyond them by no more than `off`.
        """
        end = ""
        for i, reason in enumerate(self.reasons):
            if not self._beyond(point)[i] > off:
                continue
            if not self._beyond(self.here)[i] < -_ROUNDING:
                return None, reason
            found = self.chart.locate(
                lambda x, i=i: float(self._beyond(x)[i]), self.here, point, enough=_MET
            )
            if found is None or not abs(self._beyond(found)[i]) <= _ON_BOUND:
                return None, f"{reason}, on which no member was found"
            if found is self.here:
                return None, reason
            point, end, off = found, reason, _ROUNDING
        return point, end

    def met(self, point: Member) -> str:
        """Which bounds a point is on; "" if none."""
        on = np.abs(self._beyond(point)) <= _ON_BOUND
        return next((reason for reason, is_on in zip(self.reasons, on, strict=True) if is_on), "")

    def _beyond(self, point: Member) -> np.ndarray:
        """(m,) how far beyond each bound a point is, relative to the size of the number."""
        return np.array([beyond for beyond, _ in self._edges(point)]) / self.sizes

    def _edges(self, point: Member) -> list[tuple[float, float]]:
        return [edge for x in self.problem.bounded(self.chart, point) for edge in x.edges]


def changes_sign(left: float, right: float, first: bool = False) -> bool:
    """Whether a test has a zero between two members.

    A zero at a member counts for the step that leads there, and with `first` also one at the first.
    """
    return left * right < 0 or right == 0 != left or (first and left == 0 != right)


def check_bounds(name: str, bounds: Sequence) -> None:
    """Raise ValueError unless these are two bounds, the lower one first."""
    if not (np.shape(bounds) == (2,) and bounds[0] < bounds[1]):
        raise fail(name, "two bounds, the lower one first", bounds)


def inside(value: float, within: Sequence) -> bool:
    """Whether a number is within its bounds up to rounding."""
    low, high = within
    off = _ROUNDING * max((abs(x) for x in within if math.isfinite(x)), default=0.0)
    return low - off <= value <= high + off


def bounds_reason(within: Sequence, of: str = "") -> str:
    """Why a branch ends on its bounds; see `Bounded`."""
    return f"the bounds {of}{_plain(within)}"


def _plain(bounds: Any) -> Any:
    """Bounds, or tuples of them, as Python numbers, which all print alike."""
    return tuple(map(_plain, bounds)) if np.ndim(bounds) else np.asarray(bounds).item()
