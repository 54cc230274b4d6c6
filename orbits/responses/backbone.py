"""Backbone curves: the free vibrations of a scene that begin as one of its linear modes.

By Lyapunov's centre theorem each linear mode of a conservative scene continues as a family of
periodic orbits over the energy, a nonlinear normal mode. Its frequency against amplitude or energy
is the backbone of the response curves of the forced scene.

Reference: Kerschen, Peeters, Golinval, Vakakis (2009), Nonlinear normal modes, part I, Mechanical
Systems and Signal Processing 23, 170.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from jaxdyn import Scene, _labelled, _text
from jaxdyn._checks import check_first, check_on_host, fail, positive, whole
from jaxdyn._labelled import Labelled, Values
from jaxdyn.analysis.energy import energy as energy_at
from jaxdyn.analysis.scales_at_rest import at_rest
from jaxdyn.continuation.branch import ANYWHERE, bounds_reason, check_bounds
from jaxdyn.scales import groups
from jaxdyn.scene import check_scene
from jaxdyn.vibration.inputs import Output
from orbits.analysis.quantities import amplitude as amplitude_of
from orbits.discovery.seeds import Seed, modes
from orbits.families.continuation import continue_family
from orbits.families.family import Family, Member
from orbits.orbit import Orbit, SearchError
from orbits.responses.resonances import Resonance, ratios, resonances
from orbits.shooting.finding import find

_SMALL = 0.02  # amplitude of the first vibration, relative to the sizes of the entries
_TRIES = 4  # amplitudes that are tried, each a third of the one before


@dataclasses.dataclass(frozen=True)
class Backbone:
    """A nonlinear normal mode: a family of free vibrations that begins at a linear mode.

    Attributes:
      mode: number of the linear mode, the slowest is 1.
      family: the vibrations, over the energy.
      linear: (m,) angular frequencies of all linear modes that oscillate [rad/s].
      rest: energy of the equilibrium; NaN in a scene without an energy.
      resonances: internal resonances with other modes, in order.
    """

    mode: int
    family: Family
    linear: np.ndarray
    rest: float
    resonances: tuple[Resonance, ...]

    @_text.never_raising
    def __repr__(self) -> str:
        scene = self.family.members[0].orbit.scene
        time = _text.second(scene.labels())
        ends = " to ".join(_text.frequency(float(self.frequencies[i]), time) for i in (0, -1))
        special = [
            f"{m.kind} at {_text.brief(2 * math.pi / m.orbit.period)}" for m in self.family.special
        ]
        rows = [
            ("linear", _text.frequency(float(self.linear[self.mode - 1]), time)),
            ("frequency", f"{ends}, {_text.number_of(len(self.family.members), 'vibration')}"),
            ("special", ", ".join(special)),
            ("resonances", ", ".join(map(repr, self.resonances))),
            ("end", self.family.end),
        ]
        return _text.table(f"Backbone of {_text.title_of(scene)}, mode {self.mode}", rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import responses

        return responses.backbone(self, title="")

    def to_pandas(self, *, hertz: bool = False) -> Any:
        """The `table` as a pandas DataFrame; ``frame.attrs["units"]`` has the units.

        Raises:
          ValueError: pandas is not installed.
        """
        return _labelled.frame(self.table(hertz=hertz))

    def to_xarray(self, *, hertz: bool = False) -> Any:
        """The `table` as an xarray Dataset; ``attrs["units"]`` of each variable has its unit.

        Raises:
          ValueError: xarray is not installed.
        """
        return _labelled.to_dataset(self.table(hertz=hertz))

    @property
    def frequencies(self) -> np.ndarray:
        """(n,) angular frequencies of the vibrations [rad/s]."""
        return 2 * np.pi / self.family.periods

    @property
    def energies(self) -> np.ndarray:
        """(n,) their energies above that of the equilibrium; NaN in a scene without one."""
        return self.family.energies - self.rest

    def amplitudes(self, output: Output) -> np.ndarray:
        """(n,) their amplitudes of an entry of the state, or of a function (t, y) -> ()."""
        return np.array([amplitude_of(m.orbit, output) for m in self.family.members])

    @property
    def ratios(self) -> np.ndarray:
        """(n, m - 1) frequencies of small vibrations in the other modes, relative to its own."""
        own = self.linear[self.mode - 1]
        return ratios(self.family, np.delete(self.linear, self.mode - 1) / own)

    def table(self, *, hertz: bool = False) -> Labelled:
        """A row for each vibration: frequency, energy above the equilibrium, amplitudes.

        Args:
          hertz: whether frequencies are in Hz, or in turns per unit of time, not in rad/s.
        """
        members, axes = self.family.members, ("vibration",)
        scene = members[0].orbit.scene
        labels = scene.labels()
        coordinates = labels[: len(labels) // 2]
        scale, unit = _text.frequency_scale(_text.second(labels), hertz=hertz)
        named = {
            "frequency": Values(axes, scale * self.frequencies, unit or "1"),
            "energy": Values(axes, self.energies, scene.in_units("J") or "1"),
            "verdict": Values(axes, [m.stability.verdict for m in members]),
        }
        named |= {
            f"amplitude {name}": Values(axes, self.amplitudes(name), unit)
            for name, unit in coordinates
        }
        return Labelled({}, named)


@check_first
def backbone(
    scene: Scene,
    mode: int = 1,
    *,
    amplitude: float | None = None,
    energy: float = math.inf,
    frequencies: tuple[float, float] = ANYWHERE,
    step: float = 0.05,
    members: int = 200,
    order: int = 1,
    report: Callable[[Member], None] = lambda member: None,
) -> Backbone:
    """The nonlinear normal mode that begins at a linear mode, towards larger energies.

    Args:
      scene: a conservative scene, which starts in equilibrium.
      mode: number of the linear mode; the slowest is 1.
      amplitude: amplitude of the first vibration in the entry that is displaced most; by default a
        fiftieth of its size.
      energy: largest energy, above that of the equilibrium.
      frequencies: bounds on the angular frequency [rad/s], around that of the linear mode.
      step: length of the first step; see `orbits.continue_family`.
      members: largest number of vibrations.
      order: largest value of the smaller one of p and q in the internal resonances p : q that are
        searched for; the larger one is at most five times that. 0 for none.
      report: called with each vibration as it is found.
    Returns:
      The family, its frequencies, energies and amplitudes, and its internal resonances.
    Raises:
      ValueError: the scene does not start in equilibrium, or has no such mode that oscillates, or
        `frequencies` are not around it.
      SearchError: no vibration was found near the equilibrium.
    Limits: host only. Where another linear frequency is a multiple of this one, a family need not
      exist, or there are several.
    Example:
      >>> import jaxdyn, orbits
      >>> def rate(t, y):
      ...     return [y[1], -y[0] - y[0] ** 3]
      >>> def energy(t, y):
      ...     return 0.5 * (y[0] ** 2 + y[1] ** 2) + 0.25 * y[0] ** 4
      >>> duffing = jaxdyn.ode(rate, [0.0, 0.0], names=["x", "v"], energy=energy)
      >>> found = orbits.backbone(duffing, energy=1.0)
      >>> float(found.frequencies[0].round(3)), bool(found.frequencies[-1] > 1.2)
      (1.0, True)
    """
    check_on_host("backbone", scene, "See orbits.differentiable, for each member.")
    check_scene(scene)
    whole("mode", mode)
    whole("members", members)
    whole("order", order, least=0)
    if not energy > 0:
        raise fail("energy", "> 0", energy, "It is above that of the equilibrium.")
    if math.isfinite(energy) and not scene.has_energy:
        raise fail("energy", "none for a scene without one", energy, "Use frequencies=.")
    if amplitude is not None:
        positive("amplitude", amplitude, "It is a displacement.")
    rest = np.asarray(scene.y0)
    small = modes(scene, rest, 1.0)
    if not small:
        remedy = "Leave damping out: a backbone is of free vibrations."
        raise fail("scene", "modes that oscillate without damping", "none", remedy)
    if mode > len(small):
        raise fail("mode", f"at most {len(small)}, the modes that oscillate", mode)
    orbit = _first(scene, small[mode - 1], amplitude)
    within, period = _periods(frequencies), float(orbit.period)
    if not within[0] <= period <= within[1]:
        wanted = f"bounds around the first vibration's, {2 * math.pi / period:.6g}"
        raise fail("frequencies", wanted, frequencies, "A backbone begins at its linear mode.")
    lowest = float(energy_at(scene, 0.0, rest)) if scene.has_energy else math.nan
    bounds = (-math.inf, lowest + energy) if math.isfinite(energy) else ANYWHERE
    family = continue_family(
        orbit,
        step=step,
        members=members,
        down=_shorter(orbit, rest, step),
        within=within,
        energies=bounds,
        report=report,
    )
    on_frequency = bounds_reason(frequencies, "on the frequency, ")
    end = family.end.replace(bounds_reason(within), on_frequency)  # not those on its period
    family = dataclasses.replace(family, end=end)
    linear = np.array([2 * np.pi / seed.period for seed in small])
    others = [n for n in range(1, len(linear) + 1) if n != mode]
    found = resonances(family, np.delete(linear, mode - 1) / linear[mode - 1], others, order)
    return Backbone(mode, family, linear, lowest, tuple(found))


def _first(scene: Scene, small: Seed, amplitude: float | None) -> Orbit:
    """A vibration near a linear mode, whose vector is `small.y0` minus the equilibrium."""
    rest = np.asarray(scene.y0)
    vector = small.y0 - rest
    sizes = np.asarray(at_rest(scene.field, groups(scene.system), rest).sizes)
    largest = int(np.argmax(np.abs(vector) / sizes))
    usual = _SMALL * sizes[largest] / abs(vector[largest])
    for share in 3.0 ** -np.arange(_TRIES):
        start = rest + (amplitude or usual) * share * vector
        hold = [scene.labels()[largest][0]]
        orbit = find(scene.starting(start), period=small.period, hold=hold, throw=False)
        if orbit.ok or amplitude is not None:
            break
    if not orbit.ok:
        raise SearchError(f"No vibration was found at this amplitude: {orbit.message}")
    return orbit


def _shorter(orbit: Orbit, rest: np.ndarray, step: float) -> bool:
    """Whether periods become shorter away from the equilibrium."""
    ends = continue_family(orbit, step=step, members=2, down=False).members
    if len(ends) < 2:
        return True
    units = ends[0].point.sizes  # those of a member follow its own size
    near, far = (_size(member, rest, units) for member in ends)
    return not far > near


def _size(member: Member, rest: np.ndarray, units: np.ndarray) -> float:
    """The size of a vibration: its energy, or the distance of its start from the equilibrium."""
    off = (np.asarray(member.orbit.y0) - rest) / units
    return float(np.linalg.norm(off)) if math.isnan(member.energy) else member.energy


def _periods(frequencies: tuple[float, float]) -> tuple[float, float]:
    check_bounds("frequencies", frequencies)
    low, high = frequencies
    return (
        2 * math.pi / high if math.isfinite(high) else -math.inf,
        2 * math.pi / low if low > 0 else math.inf,
    )
