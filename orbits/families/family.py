"""A family of periodic orbits: its members, and the special points between them."""

import collections
import dataclasses
import math
from typing import Any

import numpy as np

from jaxdyn import Scene, _labelled, _text
from jaxdyn._checks import fail
from jaxdyn._labelled import Labelled, Values, entries
from jaxdyn._text import number_of, second
from jaxdyn.continuation.branch import CLOSED
from jaxdyn.continuation.kinds import Kind as Kind
from orbits.analysis.quantities import Quantity, label, quantity, unit
from orbits.analysis.stability import Stability
from orbits.families.surface import Point
from orbits.hybrid.equations import ChainEquations
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit
from orbits.shooting.equations import Equations


@dataclasses.dataclass(frozen=True)
class Member:
    """One orbit of a family.

    Attributes:
      orbit: the orbit.
      parameter: its value of the family's parameter; NaN in a family of one scene, where
        `energy` says where on the family it is.
      energy: energy of the scene at the start; NaN without one.
      stability: multipliers and verdict.
      point: the orbit's point on the surface of solutions.
      tangent: (n,) vector along the family there, of unit length in the units of the point.
      alike: (n, p) directions to other orbits of the same scene, orthonormal in these units, one
        for each integral that the scene does not name.
      kind: kind of special point, if it is one.
    """

    orbit: Orbit | HybridOrbit
    parameter: float
    energy: float
    stability: Stability
    point: Point
    tangent: np.ndarray
    alike: np.ndarray
    kind: Kind | None = None

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            *_ranges(first_scene(self.orbit), {k: [x] for k, x in self._numbers().items()}),
            ("stability", self.stability.verdict),
        ]
        what = "Member" if self.kind is None else str(self.kind).capitalize()
        return _text.table(f"{what} of a family of {_text.title_of(first_scene(self.orbit))}", rows)

    def _numbers(self) -> dict[str, float]:
        return {"parameter": self.parameter, "period": self.orbit.period, "energy": self.energy}

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import periodic

        return periodic.orbits([self.orbit], title="")


@dataclasses.dataclass(frozen=True)
class Family:
    """The orbits of a family, in order.

    Attributes:
      members: the orbits, one per step.
      special: folds, branch points, period doublings, torus points, Krein collisions, an
        equilibrium and a grazed event, between members.
      end: why the family ends.
      equations: the closing equations that the members solve.
    """

    members: tuple[Member, ...]
    special: tuple[Member, ...]
    end: str
    equations: Equations | ChainEquations

    @_text.never_raising
    def __repr__(self) -> str:
        scene = first_scene(self.members[0].orbit)
        verdicts = collections.Counter(member.stability.verdict for member in self.members)
        ranges = {"parameter": self.parameters, "period": self.periods, "energy": self.energies}
        special = [f"{m.kind} at {where(m)}" for m in self.special]
        rows = [
            *_ranges(scene, ranges),
            ("stability", ", ".join(f"{n} {verdict}" for verdict, n in verdicts.items())),
            ("special", ", ".join(special)),
            ("end", self.end),
        ]
        what = f"{number_of(len(self.members), 'orbit')} of {_text.title_of(scene)}"
        return _text.table(f"Family of {what}", rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import families

        return families.family(self, title="")

    def live(self, path=None):
        """A page on which its orbits run, one of them chosen by a slider or in a picture.

        The page shows the path, period and stability of each, and a motion that starts a thousandth
        away from it; of more than 150 orbits, 150 are chosen evenly.

        Args:
          path: a file to write the page to, .html; it needs no other file.
        Raises:
          ValueError: its orbits are chains of legs, they cannot run on a page, or `path` cannot be
            written.
        """
        from orbits.drawing import pages

        return pages.family_page(self, path)

    def to_pandas(self, *quantities: str | Quantity) -> Any:
        """The members as a pandas DataFrame, with a column for each of further quantities.

        Args:
          quantities: names such as "amplitude x", see `orbits.drawing.family`, or functions from an
            orbit to a number.
        Raises:
          ValueError: pandas is not installed, or there is no such quantity.
        """
        return _labelled.frame(self._to_labelled(*quantities))

    def to_xarray(self, *quantities: str | Quantity) -> Any:
        """The members as an xarray Dataset; see `to_pandas`.

        Args:
          quantities: see `to_pandas`.
        """
        return _labelled.to_dataset(self._to_labelled(*quantities))

    def _to_labelled(self, *quantities: str | Quantity) -> Labelled:
        further, scene = {}, first_scene(self.members[0].orbit)
        for one in quantities:
            of_orbit = quantity(one)
            values = [float(of_orbit(member.orbit)) for member in self.members]
            known = unit(one, scene) if isinstance(one, str) else ""
            name = label(one)
            if name in further:
                raise fail("quantities", "functions of different names", f"{name} twice")
            further[name] = Values(("member",), values, known)
        labels, axes = scene.labels(), ("member",)
        time = second(labels)
        verdicts = [member.stability.verdict for member in self.members]
        alone = bool(np.isnan(self.parameters).all())  # a family in energy
        return Labelled(
            {} if alone else {"parameter": Values(axes, self.parameters)},
            {
                "period": Values(axes, self.periods, time or "1"),
                "energy": Values(axes, self.energies, scene.in_units("J") or "1"),
                "verdict": Values(axes, verdicts),
                **entries(axes, [member.orbit.y0 for member in self.members], labels),
                **further,
            },
        )

    @property
    def closed(self) -> bool:
        """Whether the family closes upon itself."""
        return self.end == CLOSED

    @property
    def parameters(self) -> np.ndarray:
        """(n,) parameters of the members; NaN in a family of one scene, see `energies`."""
        return np.array([member.parameter for member in self.members])

    @property
    def periods(self) -> np.ndarray:
        """(n,) periods of the members [time of the scene]."""
        return np.array([member.orbit.period for member in self.members])

    @property
    def energies(self) -> np.ndarray:
        """(n,) energies of the members; NaN where the scene has none."""
        return np.array([member.energy for member in self.members])


def first_scene(orbit: Orbit | HybridOrbit) -> Scene:
    """The scene of an orbit, or of the first leg of a chain."""
    return orbit.legs[0].scene if isinstance(orbit, HybridOrbit) else orbit.scene


def smooth_orbit(name: str, orbit: Orbit | HybridOrbit) -> Orbit:
    """The orbit, unless it is a chain of legs.

    Raises:
      ValueError: it is a chain of legs.
    """
    if isinstance(orbit, HybridOrbit):
        raise fail(
            name, "an orbit of one smooth motion", "a chain of legs", "It is not for chains."
        )
    return orbit


def _ranges(scene: Scene, of: dict[str, Any]) -> list[tuple[str, str]]:
    """The ranges from the first to the last member, as text by name; empty for NaN."""
    units = units_of(scene)
    found = []
    for name, values in of.items():
        x = np.asarray(values, float)
        ends = dict.fromkeys((_text.brief(float(x[0])), _text.brief(float(x[-1]))))
        text = f"{' to '.join(ends)} {units.get(name, '')}".rstrip()
        found.append((name, "" if np.isnan(x).all() else text))
    return found


def units_of(scene: Scene) -> dict[str, str]:
    """The units of the period and of the energy; "" where there are none."""
    return {"period": second(scene.labels()), "energy": scene.in_units("J")}


def where(found: Any) -> str:
    """Where an orbit is on its family: its parameter, else its energy, else its period.

    It may be any record with `parameter`, `energy` and `orbit`.
    """
    numbers = {"parameter": found.parameter, "energy": found.energy, "period": found.orbit.period}
    name, x = next((name, x) for name, x in numbers.items() if not math.isnan(x))
    return f"{name} {_text.brief(x, units_of(first_scene(found.orbit)).get(name, ''))}"
