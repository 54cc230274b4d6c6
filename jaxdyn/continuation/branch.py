"""The branch engine: the interface of problems, predictor, locator, step control, and the loop.

A branch is a curve of solutions: equilibria or orbits in a parameter, folds in two parameters,
tori. To follow one, pose it as a `BranchProblem`, which has a `Chart` near each member: the
unknowns in units in which lengths and angles are meaningful, and the equations for Newton's method.
Everything else is implemented here, once: a step predicts along the tangent and corrects in the
plane across it (Keller's pseudo-arclength continuation); steps are shorter where none succeeds and
longer where Newton's method converges easily; a special point between two neighbours is located
where a test changes sign, by the Illinois method; and a branch is kept in a file, from which an
interrupted run resumes (`checkpoint`).

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
_TRIALS = 60  # most points along the branch to locate a special one

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


class Chart(abc.ABC, Generic[Member]):
    """A branch near one of its members, with unknowns in the units of that member.

    A method that fails returns a text that says why, in place of a result.

    Attributes:
      measured: the unknowns that lengths and angles are measured in.
      reach: longest correction, in lengths of the step; a longer one leads to another branch.
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
        """(n,) the direction of the branch at a solution, with the sense that it has at `last`."""
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

    def step(self, last: Member, length: float) -> Step[Member] | str:
        """The member one step further along the branch, or back."""
        here = self.place(last)
        predicted = here.x + length * here.tangent
        found = self.correct(last, predicted, predicted)
        if isinstance(found, str):
            return found
        off = float(np.linalg.norm((found.x - predicted)[self.measured]))
        if not off <= self.reach * abs(length):
            return "Newton's method does not converge nearby"
        tangent = self.tangent(last, found)
        if isinstance(tangent, str):
            return tangent
        if self.cosine(last, found, tangent) < self.turn:
            return "the branch turns within the shortest step, or meets another one"
        new = self.member(last, found, tangent)
        if isinstance(new, str):
            return new
        return Step(new, self.growth(last, new, found.iterations, off / abs(length)))

    def along(self, a: Member, b: Member) -> float:
        """The distance from one member to another, along the tangent of the first."""
        here, there = self.place(a), self.place(b)
        return float(here.tangent[self.measured] @ (there.x - here.x)[self.measured])

    def between(self, a: Member, b: Member, share: float) -> Member | None:
        """The member after a fraction of the way from one to another; None if there is none."""
        here, there = self.place(a), self.place(b)
        plane = here.x + share * self.along(a, b) * here.tangent
        # It starts on the chord: the equations may be singular at a special point itself.
        found = self.correct(a, here.x + share * (there.x - here.x), plane)
        if isinstance(found, str):
            return None
        tangent = self.tangent(a, found)
        new = tangent if isinstance(tangent, str) else self.member(a, found, tangent)
        return None if isinstance(new, str) else new

    def at_end(self, a: Member, b: Member, share: float) -> bool:
        """Whether the position after a fraction of the way from one to another is one of them."""
        size = 1.0 + np.linalg.norm(self.place(a).x[self.measured])
        return not min(share, 1 - share) * abs(self.along(a, b)) > self.resolution * size

    def locate(
        self, test: Callable[[Member], float], a: Member, b: Member, *, first: bool = False
    ) -> Member | None:
        """The member between two neighbours where a test is zero, by the Illinois method.

        None if the test has no zero there (`changes_sign`). Where the bracket cannot be divided
        further, it is the best member found; the caller has to say whether its test is small
        enough.
        """
        left, right, side = test(a), test(b), 0
        if not changes_sign(left, right, first):
            return None
        best, least = (a, abs(left)) if abs(left) < abs(right) else (b, abs(right))
        for _ in range(_TRIALS):
            share = left / (left - right)
            if least == 0 or self.at_end(a, b, share):
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
        """Why the branch ends without a new member; "" if it does not."""
        del new, special
        return ""

    def end_after(self, new: Member) -> str:
        """Why the branch ends with a new member; "" if it does not."""
        del new
        return ""

    def lost(self, reason: str) -> str:
        """Why the branch ends if no member is found, however short the step."""
        return f"nothing was found beyond: {reason}"

    def ready(self, member: Member) -> Member:
        """The same member, in the form from which the next step starts."""
        return member

    def identity(self, first: Member, member: Member) -> np.ndarray:
        """(n,) numbers that distinguish a member from others: its place, in units of the first."""
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
            if advance.member is None:
                end = advance.end
                break
            report(advance.member)
            if after := problem.end_after(advance.member):
                end = after
                break
        if checkpoint is not None:
            checkpoint.finish(end)
    return _branch(first, found, end)


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
        yield advance
        last, length = advance.member, advance.step
    while True:
        advance = _advance(problem, first, last, length, step)
        if checkpoint is not None:
            checkpoint.add(advance)
        yield advance
        last, length = advance.member, advance.step


def _advance(problem: BranchProblem, first, last, length: float, step: float) -> Advance:
    """The next step, which is shortened while no member is found at its length."""
    chart = problem.chart(last)
    here = chart.inward(last)
    while isinstance(new := chart.step(here, length), str):
        length *= _SHRINK
        if length < problem.shortest * step:
            return Advance(None, [], length, problem.lost(new))
    again = problem.again(chart, first, here, new.member)
    until = new.member if again is None else again
    special = problem.special(chart, here, until, last is first)
    special = [chart.outward(x) for x in special]
    member = chart.outward(new.member)
    end = problem.end_before(member, special) or ("" if again is None else CLOSED)
    length = min(new.factor * length, problem.longest * step)
    return Advance(None if end else problem.ready(member), special, length, end)


def changes_sign(left: float, right: float, first: bool = False) -> bool:
    """Whether a test has a zero between two members.

    A zero at a member counts for the step that leads there, and with `first` also one at the first.
    """
    return left * right < 0 or right == 0 != left or (first and left == 0 != right)


def check_bounds(name: str, bounds: Sequence) -> None:
    """Raise ValueError unless these are two bounds, the lower one first."""
    if not (len(bounds) == 2 and bounds[0] < bounds[1]):
        raise fail(name, "two bounds, the lower one first", bounds)


def outside(values, within: Sequence, of: str = "") -> str:
    """Why a branch ends, if a number, or one of several, is beyond its bounds; else "".

    NaN is a number that the branch does not have, as the energy where there is none.
    """
    low, high = np.transpose(within)
    beyond = np.any((values < low) | (values > high))
    return f"the bounds {of}{_plain(within)}" if beyond else ""


def _plain(bounds: Any) -> Any:
    """Bounds, or tuples of them, in numbers of Python, which print alike."""
    return tuple(map(_plain, bounds)) if np.ndim(bounds) else np.asarray(bounds).item()
