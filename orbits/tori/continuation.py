"""Families of tori: continuation in the amplitude, with a parameter or not, by pseudo-arclength.

This is a problem of the branch engine: each step predicts along the secant of the last two circles
and solves the invariance equation together with a condition that keeps the component along the
secant. So the rotation may pass an extremum, and the amplitude or the parameter a fold. Lengths are
in the units of the first torus (`Metric`).
"""

import collections
import dataclasses
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.continuation.branch import (
    ANYWHERE,
    Bounded,
    BranchProblem,
    Chart,
    Correction,
    Place,
    check_bounds,
    follow,
    inside,
)
from jaxdyn.continuation.checkpoint import OTHER, Codec, Log
from jaxdyn.files.codec import decode_fields, encode
from orbits.shooting.segment import scene_of
from orbits.tori import circle
from orbits.tori.invariance import Metric, Unknowns
from orbits.tori.torus import GOAL, MOST_MODES, AcrossTangent, Torus, refine

_ASTRAY = 0.5  # a larger correction, as a share of the step, leads to a torus of another family
#: What the file of a continuation calls a family of tori.
TORI = "tori"
_SAME = (
    "scene",
    "outcome",
    "held",
    "rtol",
    "make",
    "unit",
)  # fields that are equal for the tori of a family


@dataclasses.dataclass(frozen=True)
class TorusFamily:
    """Tori of one family, in order.

    Attributes:
      members: the tori.
      end: why the family ends.
    """

    members: tuple[Torus, ...]
    end: str

    @_text.never_raising
    def __repr__(self) -> str:
        held = collections.Counter(t.held for t in self.members)
        rows = [
            ("parameter", _text.extent(self.parameters) if self.members[0].make else ""),
            ("amplitude", _text.extent(self.amplitudes)),
            ("rotation", _text.extent(self.rotations, unit="rad")),
            ("time", _text.extent(self.times)),
            ("held", ", ".join(filter(None, held))),
            ("end", self.end),
        ]
        what = _text.number_of(len(self.members), "torus", "tori")
        return _text.table(f"Family of {what} of {_text.title_of(self.members[0].scene)}", rows)

    _repr_html_ = _text.html

    @property
    def amplitudes(self) -> np.ndarray:
        """(n,) amplitudes of the members."""
        return np.array([torus.amplitude for torus in self.members])

    @property
    def parameters(self) -> np.ndarray:
        """(n,) values of the parameter of the members; NaN without one."""
        return np.array([torus.parameter for torus in self.members])

    @property
    def rotations(self) -> np.ndarray:
        """(n,) rotations of the members [rad]."""
        return np.array([torus.rotation for torus in self.members])

    @property
    def times(self) -> np.ndarray:
        """(n,) return times of the members [time of the scene]."""
        return np.array([torus.time for torus in self.members])


@check_first
def continue_tori(
    torus: Torus,
    *,
    members: int = 10,
    step: float | None = None,
    within: tuple[float, float] = ANYWHERE,
    goal: float = GOAL,
    max_modes: int = MOST_MODES,
    path: str | Path | Log | None = None,
) -> TorusFamily:
    """The family of tori through a torus, in the direction of growing amplitude.

    The tori of a torus point go on along the parameter of its family.

    Args:
      torus: what `orbits.torus` returned.
      members: largest number of tori, the first included.
      step: first and largest step of the amplitude, in its units; half of the amplitude by default.
        A negative step follows the family towards the orbit.
      within: bounds on the parameter; a family that leaves them ends with the torus on the bound.
      goal: largest error of invariance, in the sizes of the entries.
      max_modes: largest number of Fourier modes.
      path: file (.jsonl) to which each torus is written as it is found; the same call resumes from
        it where it was interrupted.
    Returns:
      The tori found, and why there are no more.
    Raises:
      ValueError: `torus` was not found, `members` is less than 2, `step` is 0, or `within` are not
        bounds around the parameter of the torus.
    Limits: host only. Steps jump over the gaps at resonances of high order, and the family ends at
      a wide gap, as where motions lock to a periodic orbit (`TorusOutcome.RESONANT`).
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> stick = scenes.shaken_pendulum(angle=0.0, frequency=60.0)
      >>> swing = orbits.find(stick, period=6.28318530718 / 60)
      >>> family = orbits.continue_tori(orbits.torus(swing, 0.1), members=3)
      >>> bool((family.rotations[1:] < family.rotations[:-1]).all())  # slower where it swings more
      True
    """
    if not torus.ok:
        raise _checks.fail("torus", "one that was found", torus.outcome.name, torus.message)
    members = _checks.whole("members", members, 2)
    step = 0.5 * torus.amplitude if step is None else float(_checks.array("step", step, ()))
    if step == 0:
        raise _checks.fail("step", "a number other than 0", step)
    check_bounds("within", within)
    if within != ANYWHERE and not inside(torus.parameter, within):
        wanted = f"bounds around the parameter of the torus, {torus.parameter:.6g}"
        raise _checks.fail("within", wanted, tuple(within), "Only tori of a torus point have one.")
    problem = _Problem(torus, within, goal, max_modes)
    metric = problem.metric
    # The length of the step in units is that of the change of this torus's harmonic.
    length = abs(step) * metric.norm(circle.harmonic(torus.points)) / torus.amplitude
    # The first tangent is that of circles that grow, or shrink, about their mean.
    out = np.sign(step) * (torus.points - torus.points.mean(axis=0))
    first = _Place(torus, _unit(Unknowns(out), metric), guessed=True)
    found = follow(problem, first, length, members, lambda place: None, path)
    return TorusFamily(tuple(place.torus for place in found.members), found.end)


class _Place(NamedTuple):
    """A torus on its family.

    Attributes:
      torus: the torus.
      tangent: the secant from the torus before, of unit length.
      guessed: whether the tangent is the guess for the first torus, which leaves out the changes of
        the rotation and of the centre.
    """

    torus: Torus
    tangent: Unknowns
    guessed: bool


class _Chart(Chart[_Place]):
    """A family of tori near one of them, in the units of the first one."""

    turn = -math.inf  # no limit: a secant turns only as far as the corrector moves

    def __init__(self, problem: "_Problem", member: _Place):
        self.problem, self.metric = problem, problem.metric
        self.reach = math.inf if member.guessed else _ASTRAY
        self.n = len(member.torus.points)

    def place(self, member: _Place) -> Place:
        return Place(*(self._coordinates(x) for x in (member.torus.unknowns, member.tangent)))

    def _coordinates(self, x: Unknowns) -> np.ndarray:
        return self.metric.coordinates(x if len(x.points) == self.n else x.resample(self.n))

    def correct(self, last: _Place, start, plane) -> Correction | str:
        torus, begin = last.torus, self.metric.unknowns(start)
        w = circle.harmonic(torus.points)
        w = w / np.linalg.norm(w)
        target = AcrossTangent(last.tangent, self.metric)
        goal, max_modes = self.problem.goal, self.problem.max_modes
        found = refine(torus, begin, w, target, goal=goal, max_modes=max_modes)
        if not found.ok:
            return f"{found.outcome.name}: {found.message}"
        return Correction(self._coordinates(found.unknowns), 0, found)

    def tangent(self, last: _Place, found: Correction) -> np.ndarray:
        secant = found.x - self.place(last).x
        return secant / np.linalg.norm(secant)

    def member(self, last: _Place, found: Correction, tangent: np.ndarray) -> _Place:
        before = last.torus.unknowns.resample(len(found.solution.points))
        pairs = zip(before, found.solution.unknowns, strict=True)
        secant = Unknowns(*(new - old for old, new in pairs))
        return _Place(found.solution, _unit(secant, self.metric), guessed=False)


class _Problem(BranchProblem[_Place]):
    """The family of a torus."""

    what = TORI
    shortest, longest = 1e-3, 1.0  # shorter steps make no progress; longer ones need more modes

    def __init__(self, torus: Torus, within: tuple[float, float], goal: float, max_modes: int):
        self.first, self.within, self.goal, self.max_modes = torus, within, goal, max_modes
        self.metric = Metric.of(torus.scene, torus.unknowns, torus.unit)

    def chart(self, member: _Place) -> _Chart:
        return _Chart(self, member)

    def bounded(self, chart: _Chart, member: _Place) -> list[Bounded]:
        del chart
        return [Bounded(member.torus.parameter, self.within, units=self.first.unit)]

    def codec(self) -> Codec:
        def pack(member: _Place) -> dict[str, Any]:
            return encode(member._replace(torus=encode(member.torus, _SAME)))

        def unpack(record: Any) -> _Place:
            fields = decode_fields(record, _Place, "file", OTHER, raw=("torus",))
            known = decode_fields(fields["torus"], Torus, "file", OTHER, _SAME)
            scene = scene_of(self.first.scene, self.first.make, known["parameter"])
            fields["torus"] = dataclasses.replace(self.first, **known, scene=scene)
            return _Place(**fields)

        return Codec(pack, unpack)

    def about(self) -> dict[str, Any]:
        return {"goal": float(self.goal), "max_modes": self.max_modes, "held": self.first.held}

    def lost(self, reason: str) -> str:
        return reason


def _unit(tangent: Unknowns, metric: Metric) -> Unknowns:
    size = float(np.linalg.norm(metric.coordinates(tangent)))
    return Unknowns(*(x / size for x in tangent))
