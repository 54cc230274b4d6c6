"""Families of tori about an orbit: continuation in the amplitude by pseudo-arclength.

Each step predicts along the secant of the last two circles and solves the invariance equation
together with a condition that keeps the component along the secant. So the rotation may pass an
extremum, and the amplitude a fold. Lengths are in the units of the first torus (`Metric`).
"""

import collections
import dataclasses

import numpy as np

from jaxdyn import _checks, _text
from jaxdyn._records.kinds import check_first
from orbits.tori import circle
from orbits.tori.invariance import Metric, Unknowns
from orbits.tori.record import Torus, TorusOutcome
from orbits.tori.refinement import refined
from orbits.tori.torus import GOAL, MOST_MODES

_GROW, _SHRINK = 1.5, 0.5  # of the step after a torus, and after none
_ASTRAY = 0.5  # correction, as a share of the step, of a torus that is not of this family
_SHORTEST = 1e-3  # of the first step: shorter ones lead nowhere


@dataclasses.dataclass(frozen=True)
class TorusFamily:
    """Tori of one family, in order.

    Attributes:
      members: the tori.
      end: why it ends.
    """

    members: tuple[Torus, ...]
    end: str

    @_text.never_raising
    def __repr__(self) -> str:
        held = collections.Counter(t.held for t in self.members)
        rows = [
            ("amplitude", _text.extent(self.amplitudes)),
            ("rotation", _text.extent(self.rotations, unit="rad")),
            ("time", _text.extent(self.times)),
            ("held", ", ".join(held)),
            ("end", self.end),
        ]
        what = _text.counted(len(self.members), "torus", "tori")
        return _text.table(f"Family of {what} of {_text.called(self.members[0].scene)}", rows)

    _repr_html_ = _text.html

    @property
    def amplitudes(self) -> np.ndarray:
        """(n,) amplitudes of the members."""
        return np.array([torus.amplitude for torus in self.members])

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
    goal: float = GOAL,
    max_modes: int = MOST_MODES,
) -> TorusFamily:
    """The family of tori through a torus, in the direction of growing amplitude.

    Args:
      torus: what `orbits.torus` returned.
      members: largest number of tori, the first included.
      step: first step of the amplitude, in its units, the largest one too; half of the amplitude by
        default. A negative one follows the family towards the orbit.
      goal: largest error of invariance, in the sizes of the entries.
      max_modes: largest number of Fourier modes.
    Returns:
      The tori found, and why there are no more.
    Raises:
      ValueError: `torus` was not found, `members` is less than 2 or `step` is 0.
    Limits: host only. Steps jump over the gaps at resonances of high order, and end at wide ones.
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
    metric = Metric.of(torus.scene, torus.unknowns)
    # In units: of the harmonic of this torus.
    longest = abs(step) * metric.norm(circle.harmonic(torus.points)) / torus.amplitude
    found, tangent, length = [torus], _outwards(torus, step, metric), longest
    end = TorusOutcome.FOUND
    while len(found) < members:
        new = _next(found[-1], tangent, length, metric, goal, max_modes)
        # The first tangent is a guess: without the changes of the rotation and of the centre.
        if new.ok and len(found) > 1 and _strays(found[-1], new, tangent, length, metric):
            new = dataclasses.replace(new, outcome=TorusOutcome.NO_CONVERGENCE)
        if new.ok:
            tangent = _secant(found[-1], new, metric)
            found.append(new)
            length = min(_GROW * length, longest)
            continue
        end = new.outcome
        length *= _SHRINK
        if length < _SHORTEST * longest:
            break
    reached = len(found) == members
    said = f"{members} tori were asked for." if reached else f"{end.name}: {end.message}"
    return TorusFamily(tuple(found), said)


def _next(
    torus: Torus, tangent: Unknowns, length: float, metric: Metric, goal: float, max_modes: int
) -> Torus:
    """The torus a step further; not found if there is none."""
    now = torus.unknowns
    start = now.moved(length * tangent.packed())
    w = circle.harmonic(torus.points)
    w = w / np.linalg.norm(w)
    target = ("along", tangent, start, metric)
    return refined(torus, start, w, target, goal=goal, max_modes=max_modes)


def _strays(old: Torus, new: Torus, tangent: Unknowns, length: float, metric: Metric) -> bool:
    """Whether a step ended far from where its tangent led, on another solution."""
    expected = old.unknowns.moved(length * tangent.packed())
    return metric.size(_between(expected, new.unknowns)) > _ASTRAY * length


def _outwards(torus: Torus, step: float, metric: Metric) -> Unknowns:
    """The unit tangent of circles that grow, or shrink, about their mean."""
    out = torus.points - torus.points.mean(axis=0)
    return _unit(Unknowns(np.sign(step) * out, 0.0, 0.0), metric)


def _secant(old: Torus, new: Torus, metric: Metric) -> Unknowns:
    """The unit tangent from one torus to the next, with the points of the latter."""
    return _unit(_between(old.unknowns, new.unknowns), metric)


def _between(before: Unknowns, after: Unknowns) -> Unknowns:
    """The difference of two, with the points of the latter."""
    before = before.resampled(len(after.points))
    return Unknowns(*(b - a for a, b in zip(before, after, strict=True)))


def _unit(tangent: Unknowns, metric: Metric) -> Unknowns:
    return Unknowns(*(x / metric.size(tangent) for x in tangent))
