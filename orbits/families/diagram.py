"""A bifurcation diagram: equilibria, orbits that begin at their Hopf points, and their branches.

Each family begins at a special point of an earlier one. A family that cannot be followed is kept as
a failure with its reason, beside all that was found.
"""

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from jaxdyn import _progress, _text
from jaxdyn._checks import fail, whole
from jaxdyn._doors import renamed
from jaxdyn._records import with_captures
from jaxdyn.continuation.checkpoint import EQUILIBRIA, OTHER, Log, lock, open_log, walks_in
from jaxdyn.continuation.equilibria import continue_equilibria
from jaxdyn.continuation.equilibria import switch_branch as other_equilibria
from jaxdyn.continuation.family import Equilibrium, EquilibriumFamily
from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.loading import equilibria as equilibria_of
from jaxdyn.files.codec import decode
from jaxdyn.integrate.simulation import simulate
from jaxdyn.status import IntegrationError
from orbits.families.checkpoint import ORBITS, family_of
from orbits.families.continuation import continue_family, switch_branch
from orbits.families.family import Family, Member
from orbits.families.hopf import from_hopf, in_sizes
from orbits.orbit import SearchError
from orbits.shooting.segment import Make

_SAME = 1e-6  # distance in units of the family below which two special points are one
_MET = 1e-4  # the same for branch points of orbits, in parameter and period
_NEAR = 1e-2  # the same for a Hopf point and orbits that have shrunk to it
_ROUNDING = 1e-12  # two values of the parameter that differ by less, in units, are one
_SAMPLES = 200  # samples of an orbit, for the extremes of an entry
#: Names in the file of a diagram.
DOUBLINGS, FAILURE = "doublings", "failure"
#: The errors of a search or a continuation where there is nothing to find.
_FAILURES = (ValueError, SearchError, IntegrationError)


@dataclasses.dataclass(frozen=True)
class Failure:
    """A family that was not found.

    Attributes:
      point: the special point at which it should begin.
      reason: what was tried, and why it failed.
    """

    point: Equilibrium | Member
    reason: str

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [("parameter", _text.brief(self.point.parameter)), ("reason", self.reason)]
        return _text.table(f"Not followed: {self.point.kind}", rows)

    _repr_html_ = _text.html


@renamed(rests="equilibria")
@dataclasses.dataclass(frozen=True)
class Diagram:
    """The families of equilibria and of orbits over a parameter.

    Attributes:
      equilibria: families of equilibria.
      orbits: families of orbits.
      depths: for each family of orbits, the number of doublings that lead to it.
      failures: the families that were not found.
    """

    equilibria: tuple[EquilibriumFamily, ...]
    orbits: tuple[Family, ...]
    depths: tuple[int, ...]
    failures: tuple[Failure, ...]

    @_text.never_raising
    def __repr__(self) -> str:
        equilibria = [
            f"{x.name} at {_text.brief(x.parameter)}"
            for family in self.equilibria
            for x in family.special
        ]
        special = [
            f"{x.kind} at {_text.brief(x.parameter)}"
            for family in self.orbits
            for x in family.special
        ]
        failed = [f"{x.point.kind} at {_text.brief(x.point.parameter)}" for x in self.failures]
        rows = [
            ("equilibria", _text.number_of(len(self.equilibria), "family", "families")),
            ("special", ", ".join(equilibria)),
            ("orbits", _text.number_of(len(self.orbits), "family", "families")),
            ("special", ", ".join(special)),
            ("not followed", ", ".join(failed)),
        ]
        return _text.table("Bifurcation diagram", rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import diagrams

        return diagrams.diagram(self, title="")


def diagram(
    make: Make,
    parameter: float,
    start,
    *,
    within: tuple[float, float],
    depth: int = 1,
    step: float = 0.05,
    members: int = 200,
    orbit_step: float | None = None,
    orbit_members: int = 40,
    amplitude: float | None = None,
    report: Callable[[EquilibriumFamily | Family | Failure], None] = lambda found: None,
    path: str | Path | Log | None = None,
) -> Diagram:
    """The bifurcation diagram of a scene over a parameter.

    It has the families of equilibria in both directions from the start and through branch points,
    the families of orbits from each Hopf point, those of twice the period from each doubling, both
    halves of the other family from each branch point of orbits, and so on.

    Args:
      make: the scene for each value of the parameter; see `continue_equilibria`.
      parameter: its value at the start.
      start: (k,) state near an equilibrium; or (k/2,) coordinates of a state at rest.
      within: bounds on the parameter.
      depth: largest number of successive doublings that are followed; 0 for none. Branch points of
        orbits are followed at any depth.
      step: length of the first step along equilibria.
      members: largest number of members of a family of equilibria.
      orbit_step: length of the first step along orbits; `step` by default.
      orbit_members: largest number of members of a family of orbits.
      amplitude: distance from a special point at which a new family begins, in the sizes of the
        entries; by default 0.01, or less where no orbit is found there.
      report: called with each family and failure as it is found.
      path: file (.jsonl) to which each member is written as it is found; the same call resumes from
        it where it was interrupted. See `orbits.families.load`.
    Returns:
      All families, and those that could not be followed, with the reason.
    Raises:
      ValueError: there is no equilibrium near `start`, or a number is out of range; see
        `continue_equilibria`.
    Limits: host only. Doublings of a family of orbits that closes by a symmetry are not followed.
    Example:
      >>> import jaxdyn, orbits
      >>> def make(mu):
      ...     return jaxdyn.ode(
      ...         lambda t, y, mu: [y[1], mu * y[1] - y[0] ** 2 * y[1] - y[0]],
      ...         [0.0, 0.0], 10.0, params=mu)
      >>> found = orbits.diagram(make, -0.5, [0.0, 0.0], within=(-1, 1), orbit_members=5)
      >>> len(found.equilibria), [len(family.members) for family in found.orbits]
      (2, [5])
    """
    depth = whole("depth", depth, least=0)
    log = open_log(path)
    options = {"step": step, "members": members, "within": within, "path": log}
    orbit_options = {"step": orbit_step or step, "members": orbit_members, "within": within}
    found = _Orbits(make, orbit_options, amplitude, report, log)
    with lock(log):
        return _follow(found, parameter, start, depth, options)


def _follow(found: "_Orbits", parameter: float, start, depth: int, options: dict) -> Diagram:
    """The diagram; its families of orbits are collected in `found`."""
    make, report, log = found.make, found.report, found.log
    equilibria = []
    _progress.report_progress("following equilibria")
    for down in (False, True):
        equilibria.append(continue_equilibria(make, parameter, start, down=down, **options))
        report(equilibria[-1])
    _branches(equilibria, found, options)
    for family in equilibria:
        for point in family.special:
            if point.kind == Kind.HOPF:
                found.from_hopf(family, point, depth)
    if log is not None:
        for failure in found.failures:
            log.note({FAILURE: failure.reason, **place_of(failure.point)})
    return Diagram(
        equilibria=tuple(equilibria),
        orbits=tuple(family for family, _ in found.families),
        depths=tuple(doublings for _, doublings in found.families),
        failures=tuple(found.failures),
    )


def _branches(equilibria: list, found: "_Orbits", options: dict) -> None:
    """Follow the other families through all branch points; each one is visited once."""
    seen: list[Equilibrium] = []
    for family in equilibria:  # grows on the way
        for point in family.special:
            if point.kind != Kind.BRANCH or any(_near(point, x) for x in seen):
                continue
            seen.append(point)
            for down in (False, True):
                try:
                    equilibria.append(other_equilibria(family, point, down=down, **options))
                except ValueError as error:
                    found.fail(point, str(error))
                    break
                found.report(equilibria[-1])


def _near(a: Equilibrium, b: Equilibrium) -> bool:
    return bool(np.linalg.norm((a.x - b.x) / _units(a)) < _SAME)


def _units(point: Equilibrium) -> np.ndarray:
    """(k + 1,) the units of state and parameter."""
    assert point.units is not None  # it was found here
    return point.units[:-1]


def _coincide(a: Member, b: Member) -> bool:
    """Whether two branch points are one, which each family locates to few digits."""
    apart = abs(a.parameter - b.parameter) / a.point.units[-2]
    return max(apart, abs(a.orbit.period / b.orbit.period - 1)) < _MET


def _parameter_unit(point: Equilibrium | Member) -> float:
    return point.point.units[-2] if isinstance(point, Member) else _units(point)[-1]


def _shrunk_to(end: Member, point: Equilibrium) -> bool:
    """Whether the orbits of a family have shrunk to a Hopf point."""
    *entry_sizes, parameter = _units(point)
    off = (np.asarray(end.orbit.y0) - point.state) / np.maximum(entry_sizes, end.point.sizes)
    turns = end.orbit.period * point.frequency / (2 * np.pi)
    apart = abs(end.parameter - point.parameter) / parameter
    return max(apart, abs(turns - 1), float(np.linalg.norm(off))) < _NEAR


class _Orbits:
    """The families of orbits of a diagram, collected as they are found."""

    def __init__(self, make: Make, options: dict, amplitude: float | None, report, log: Log | None):
        self.make, self.options, self.report, self.log = make, options, report, log
        self.amplitude = amplitude
        self.families: list[tuple[Family, int]] = []
        self.failures: list[Failure] = []
        self.seen: list[Equilibrium] = []
        self.branches: list[Member] = []

    def fail(self, point: Equilibrium | Member, reason: str) -> None:
        """Record that the family that begins at a special point was not found."""
        self.failures.append(Failure(point, reason))
        self.report(self.failures[-1])

    def from_hopf(self, equilibria: EquilibriumFamily, point: Equilibrium, depth: int) -> None:
        """Follow the orbits that begin at a Hopf point, and their doublings."""
        if any(_near(point, x) for x in self.seen) or self._has_reached(point):
            return
        self.seen.append(point)
        _progress.report_progress(f"following orbits from {point.parameter:.6g}")
        size = self.amplitude
        amplitude = None if size is None else in_sizes(equilibria, point, size)
        begin = functools.partial(from_hopf, equilibria, point, amplitude=amplitude)
        self._follow(point, begin, 0, depth)

    def _has_reached(self, point: Equilibrium) -> bool:
        """Whether a family of orbits has ended at this Hopf point."""
        ends = [x for family, _ in self.families for x in family.special if x.kind == Kind.REST]
        return any(_shrunk_to(x, point) for x in ends)

    def _follow(self, point, begin: Callable, doublings: int, depth: int) -> None:
        try:
            orbit, value = begin()
            # Follow the family away from the point, to the side on which the first orbit lies. If
            # all orbits have one parameter, the default leads away.
            apart = (value - point.parameter) / _parameter_unit(point)
            down = None if abs(apart) <= _ROUNDING else bool(apart < 0)
            log = None if self.log is None else self.log.with_note(**{DOUBLINGS: doublings})
            options = self.options | {"down": down, "path": log}
            family = continue_family(orbit, self.make, value, **options)
        except _FAILURES as error:
            self.fail(point, str(error))
            return
        self.families.append((family, doublings))
        self.report(family)
        if len(family.members) == 1 < self.options["members"]:
            self.fail(point, f"Of its family one orbit was found: {family.end}")
        for special in family.special:
            double = special.kind == Kind.DOUBLING
            if not (double and doublings < depth) and not self._new_branch(special):
                continue
            _progress.report_progress(f"following a {special.kind} at {special.parameter:.6g}")
            # Both halves of a doubled family are the same orbits, half a period later.
            for opposite in (False,) if double else (False, True):
                begin = functools.partial(
                    switch_branch, family, special, amplitude=self.amplitude, opposite=opposite
                )
                self._follow(special, begin, doublings + double, depth)

    def _new_branch(self, special: Member) -> bool:
        """Whether it is a branch point that no other family has passed."""
        if special.kind != Kind.BRANCH or any(_coincide(special, x) for x in self.branches):
            return False
        self.branches.append(special)
        return True


def place_of(point: Equilibrium | Member) -> dict[str, Any]:
    """The kind and the parameter of a special point, as a file of the diagram has them."""
    return {"kind": str(point.kind), "parameter": float(point.parameter)}


def extremes(member: Member, entry: int) -> tuple[float, float]:
    """The smallest and the largest value of an entry of the state along an orbit."""
    values = np.asarray(simulate(member.orbit.scene, samples=_SAMPLES).ys)[:, entry]
    return float(values.min()), float(values.max())


# ---- Bifurcation diagrams, and families in a parameter, read from a file


def load(path: str | Path, make: Make) -> Diagram:
    """The families of equilibria and of orbits in a file, which may still be being written.

    Args:
      path: path of the file that `orbits.diagram`, `orbits.continue_family` or
        `jaxdyn.continue_equilibria` wrote with ``path=``.
      make: the scene for each value of the parameter, as it was given to them: files hold only
        numbers.
    Returns:
      All families as a diagram; for an interrupted run, what it had found.
    Raises:
      ValueError: the file is of another kind, was edited or damaged, has a family without a
        parameter or with conditions, or does not hold equilibria and orbits of these scenes.
    """
    walks, notes = walks_in(path, (EQUILIBRIA, ORBITS))  # a file of another kind has another make
    make = with_captures(make, "parameter")
    equilibria = tuple(equilibria_of(walk, make) for walk in walks if walk.begin.what == EQUILIBRIA)
    around = [walk for walk in walks if walk.begin.what == ORBITS]
    depths = [decode(walk.begin.note.get(DOUBLINGS, 0), int, DOUBLINGS, OTHER) for walk in around]
    families = tuple(family_of(walk, make) for walk in around)
    special = [point for family in (*equilibria, *families) for point in family.special]
    failures = []
    for note in (note for note in notes if FAILURE in note):
        at = [x for x in special if place_of(x).items() <= note.items()]
        if not at:
            raise fail("file", "failures at special points", "others", OTHER)
        failures.append(Failure(at[0], decode(note[FAILURE], str, FAILURE, OTHER)))
    return Diagram(equilibria, families, tuple(depths), tuple(failures))
