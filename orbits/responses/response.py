"""The frequency response of a nonlinear scene: its forced vibrations over the forcing frequency.

A forced response is a periodic orbit with the period of the forcing; a response curve is a family
of such orbits over the frequency, followed by arclength through its folds, so that both branches
and the unstable one between them are found. Multipliers decide the stability of each response;
where they leave the unit circle other than at a fold, quasi-periodic (torus) or period-doubled
responses begin.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from scipy.optimize import minimize_scalar

from jaxdyn import Scene, _labelled, _text
from jaxdyn._checks import array, check_callable, check_kind, check_on_host, fail, positive, whole
from jaxdyn._labelled import Labelled, Values
from jaxdyn._text import number_of
from jaxdyn.analysis.linearize import check_equilibrium
from jaxdyn.continuation.kinds import Kind
from jaxdyn.scene import check_scene
from jaxdyn.vibration import forcing
from jaxdyn.vibration.inputs import Input, Output, check_input
from jaxdyn.vibration.signals import Harmonic
from jaxdyn.vibration.transfer import transfer_function
from orbits.analysis.quantities import amplitude, phase
from orbits.closing.given import drive_period, is_driven, turns_in
from orbits.families.bifurcations import zero_between
from orbits.families.continuation import continue_family
from orbits.families.family import Family, Member
from orbits.families.steps import OrbitChart
from orbits.families.surface import OrbitSurface
from orbits.orbit import Orbit, SearchError
from orbits.shooting.finding import GOAL, find
from orbits.shooting.segment import Make, OwnNumber

_PARTS = (0.03, 0.1, 0.3, 0.6, 1.0)  # fractions of a level at which responses are found in turn
_ABOVE, _LEVELS = 5.0, 200  # highest level, and most members, of a family over the level
_ROUNDING = 1e-9  # relative distance below which two values of the parameter are the same
_SAME = 1e-6  # starts that differ less, relative to the sizes, belong to the same response
# Tolerances of the place of a peak, in steps along the curve: within the curve, and at its end.
_PEAK = {"xtol": 1e-6, "maxiter": 40}
_PEAK_AT_END = {"xatol": 1e-6, "maxiter": 40}
_NO_FIRST = (
    "No response was found at either end of the range of frequencies. Begin further away from "
    "resonances, or with a smaller level."
)


@dataclasses.dataclass(frozen=True)
class FrequencyResponse:
    """Response curves: families of forced responses, for each level of the forcing.

    Attributes:
      levels: (n,) amplitude of the forcing on each curve. A level has two curves, its two branches,
        if a resonance continues beyond the range.
      curves: the families; their parameter is the angular frequency of the forcing [rad/s].
      frequencies: the range in which they were followed.
      output: the entry of the state that tables and pictures show by default: the driven one, or
        the first where none is driven.
    """

    levels: tuple[float, ...]
    curves: tuple[Family, ...]
    frequencies: tuple[float, float]
    output: str

    @_text.never_raising
    def __repr__(self) -> str:
        scene = self.curves[0].members[0].orbit.scene
        rows, time = [], _text.second(scene.labels())
        for level, curve in zip(self.levels, self.curves, strict=True):
            special = [f"{m.kind} at {_text.frequency(m.parameter, time)}" for m in curve.special]
            unstable = sum(m.stability.verdict == "unstable" for m in curve.members)
            text = f"{number_of(len(curve.members), 'response')}, {unstable} unstable"
            rows.append((f"level {_text.brief(level)}", ", ".join([text, *special])))
            rows.append(("", f"to {curve.end}"))
        return _text.table(f"Frequency response of {_text.title_of(scene)}", rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import responses

        return responses.frequency_response(self, title="")

    def to_pandas(self, output: Output | None = None, *, hertz: bool = False) -> Any:
        """The `table` as a pandas DataFrame; ``frame.attrs["units"]`` has the units.

        Raises:
          ValueError: there is no such output, or pandas is not installed.
        """
        return _labelled.frame(self.table(output, hertz=hertz))

    def to_xarray(self, output: Output | None = None, *, hertz: bool = False) -> Any:
        """The `table` as an xarray Dataset; ``attrs["units"]`` of each variable has its unit.

        Raises:
          ValueError: there is no such output, or xarray is not installed.
        """
        return _labelled.to_dataset(self.table(output, hertz=hertz))

    @property
    def folds(self) -> tuple[tuple[Member, ...], ...]:
        """The folds of each curve, where a slow sweep jumps."""
        return tuple(
            tuple(m for m in curve.special if m.kind == Kind.FOLD) for curve in self.curves
        )

    def peaks(self, output: Output | None = None) -> tuple[Member, ...]:
        """The largest response of each curve, between its members.

        Args:
          output: see `table`.
        Raises:
          ValueError: there is no such output, or it has no value on a curve.
        Limits: its amplitude has ten digits, its frequency five, since the curve is flat there.
        """
        return tuple(_peak(curve, output or self.output)[1] for curve in self.curves)

    def with_extremes(self, output: Output | None = None) -> "FrequencyResponse":
        """The same result with the extremes of the curves, such as antiresonances, among members.

        Args:
          output: see `table`.
        Raises:
          ValueError: see `peaks`.
        """
        curves = []
        for curve in self.curves:
            members = [*curve.members]
            for place, extreme in reversed(_extremes(curve, output or self.output)):
                if extreme is not members[min(place, len(members) - 1)]:
                    members.insert(place, extreme)
            curves.append(dataclasses.replace(curve, members=tuple(members)))
        return dataclasses.replace(self, curves=tuple(curves))

    def table(self, output: Output | None = None, *, hertz: bool = False) -> Labelled:
        """A row for each response and each special point, in order along each curve.

        The columns are level, frequency [rad/s], amplitude and phase lag [rad] of an output,
        verdict, and the kind of special points.

        Args:
          output: the name of an entry of the state, or a function (t, y) -> (); by default that
            of the result.
          hertz: whether frequencies are in Hz, or in turns per unit of time.
        Raises:
          ValueError: there is no such output.
        """
        labels = dict(self.curves[0].members[0].orbit.scene.labels())
        output = output or self.output
        scale, frequency = _text.frequency_scale(_text.second([*labels.items()]), hertz=hertz)
        rows = [
            (
                level,
                scale * member.parameter,
                amplitude(member.orbit, output),
                phase(member.orbit, output),
                member.stability.verdict,
                str(member.kind or ""),
            )
            for level, curve in zip(self.levels, self.curves, strict=True)
            for member in in_order(curve)
        ]
        unit = labels.get(output, "1") if isinstance(output, str) else "1"
        units = {"level": "", "frequency": frequency or "1", "amplitude": unit, "phase": "rad"}
        units |= {"verdict": "", "kind": ""}
        columns = zip(*rows, strict=True)
        named = {
            name: Values(("response",), list(column), units[name])
            for name, column in zip(units, columns, strict=True)
        }
        return Labelled({}, named)


#: An amplitude counts as an extreme if it differs from its neighbours by this share of itself.
_STANDS_OUT = 1e-2


def _peak(curve: Family, output: Output) -> tuple[int, Member]:
    """The response of a curve with the largest amplitude, and the number of members before it.

    A response whose output is NaN is no peak.
    """
    heights = _heights(curve, output)
    if not np.isfinite(heights).any():
        raise fail("output", "one with a value somewhere on the curve", "NaN everywhere")
    return _extreme(curve, output, int(np.nanargmax(heights)), 1.0)


def _extremes(curve: Family, output: Output) -> list[tuple[int, Member]]:
    """The peak of a curve and its other extreme amplitudes, in order, each as from `_peak`."""
    heights = _heights(curve, output)
    found = [_peak(curve, output)]
    for sign in (1.0, -1.0):
        beside = np.maximum(sign * heights[:-2], sign * heights[2:])
        middle = sign * heights[1:-1]
        for i in np.flatnonzero(middle - beside > _STANDS_OUT * np.abs(middle)) + 1:
            if sign < 0 or i != np.nanargmax(heights):
                found.append(_extreme(curve, output, int(i), sign))
    return sorted(found, key=lambda pair: pair[0])


def _heights(curve: Family, output: Output) -> np.ndarray:
    return np.array([amplitude(member.orbit, output) for member in curve.members])


def _extreme(curve: Family, output: Output, top: int, sign: float) -> tuple[int, Member]:
    """The response near a member whose amplitude times a sign is largest.

    The first item is the number of members before it.
    """
    members = curve.members

    def height(member: Member | None) -> float:
        found = math.nan if member is None else sign * amplitude(member.orbit, output)
        return -math.inf if math.isnan(found) else found

    surface = OrbitSurface(curve.equations, members[top].orbit.rtol, GOAL)
    # Steps along the curve from the highest member, backwards and onwards.
    found: dict[float, tuple[float, Member | None]] = {
        float(n): (height(members[top + n]), members[top + n])
        for n in (-1, 0, 1)
        if 0 <= top + n < len(members)
    }

    def lower(steps: float) -> float:
        if steps not in found:
            a = top + math.floor(steps)
            chart = OrbitChart(surface.at(members[a].point), members[a])
            between = chart.between(members[a], members[a + 1], steps - math.floor(steps))
            found[steps] = height(between), between
        return -found[steps][0]

    known = sorted(found)
    if len(known) == 3 and found[0.0][0] > max(found[-1.0][0], found[1.0][0]):
        minimize_scalar(lower, bracket=known, method="brent", options=_PEAK)
    else:
        for a, b in itertools.pairwise(known):
            minimize_scalar(lower, bounds=(a, b), method="bounded", options=_PEAK_AT_END)
    steps = max(found, key=lambda steps: found[steps][0])
    best = found[steps][1]
    assert best is not None
    return top + math.ceil(steps), best


def in_order(curve: Family) -> list[Member]:
    """The members of a family with its special points where they are between them."""
    found, waiting = [curve.members[0]], list(curve.special)
    for before, after in zip(curve.members, curve.members[1:], strict=False):
        while waiting and _is_on_step(before, after, waiting[0]):
            found.append(waiting.pop(0))
        found.append(after)
    return [*found, *waiting]


def _is_on_step(before: Member, after: Member, point: Member) -> bool:
    """Whether a special point lies on the step from one member to the next."""
    here, there = before.point.place, after.point.place
    size = np.maximum(np.abs(here), np.abs(there))
    units = np.where(size > 0, size, 1.0)
    step = (there - here) / units
    share = float(step @ ((point.point.place - here) / units) / (step @ step))
    return share <= 1.0


def frequency_response(
    scene: Scene,
    drive: str | Input | Callable[..., Scene],
    frequencies: tuple[float, float],
    *,
    levels: float | Sequence[float] = 1.0,
    isolas: int = 0,
    step: float = 0.1,
    members: int = 400,
    report: Callable[[Member], None] = lambda member: None,
) -> FrequencyResponse:
    """The forced responses of a scene over the forcing frequency, at several levels.

    The forcing is ``level * cos(omega t)``.

    Args:
      scene: the scene without forcing, which starts in equilibrium.
      drive: where the forcing acts: the name of a coordinate for a force on it (in a plain `ode`,
        whose masses are not known, a force per mass), or `vibration.Force`, `Base`, `Motion` or
        `Parameter`; or a function of (omega, level), or of omega alone, that returns the forced
        scene, whose rate has the period 2 pi / omega.
      frequencies: lowest and highest angular frequency [rad/s].
      levels: amplitude of the forcing, or several amplitudes.
      isolas: number of frequencies at which responses are also followed over the level, besides
        that of the peak, to find curves that are detached at a level (isolas). 0 searches for none;
        with 1 only the frequency of the peak is tried.
      step: length of the first step along a curve; see `orbits.continue_family`.
      members: largest number of responses of a curve.
      report: called with each response as it is found.
    Returns:
      A family for each level, from one end of the range to the other, or two; then its isolas.
    Raises:
      ValueError: the scene does not start in equilibrium, `drive` does not suit it, or the
        frequencies or levels are out of range.
      SearchError: no response was found to begin with.
    Limits: host only. An isola is found if it contains one of the frequencies tried, and the
      responses there are connected with those to a weak forcing over levels up to five times the
      level. Responses of another period are not found; `orbits.switch_branch` leads to those that
      branch off, and `orbits.basins` at one frequency finds stable ones. If `drive` is a function,
      a program is compiled for each level, and for each call if it defines the rate inside.
    Example:
      >>> import jaxdyn, orbits
      >>> def rate(t, y):
      ...     x, v = y
      ...     return [v, -0.1 * v - x - 0.2 * x**3]
      >>> duffing = jaxdyn.ode(rate, [0.0, 0.0], names=["x", "v"])
      >>> found = orbits.frequency_response(duffing, "x", (0.7, 1.5), levels=0.3)
      >>> [round(fold.parameter, 5) for fold in found.folds[0]]
      [1.33262, 1.19395]
    """
    check_on_host("frequency_response", (scene, levels), "See orbits.differentiable.")
    check_scene(scene)
    low, high = _range(frequencies)
    positive("step", step, "It is a length in the space of the unknowns.")
    whole("members", members)
    whole("isolas", isolas, 0)
    many = np.atleast_1d(np.asarray(array("levels", np.atleast_1d(levels), (None,)), float))
    if not len(many) or not (many > 0).all():
        raise fail("levels", "one amplitude > 0 or several", many.tolist())
    if (own_period := drive_period(scene)) is not None:
        came = f"one of period {own_period:.6g}"
        raise fail("scene", "one without a forcing of its own", came, "Leave that one out.")
    check_equilibrium(scene, jnp.asarray(scene.y0))
    is_function = callable(drive) and not isinstance(drive, Input)
    forced = _by_function(drive, scene) if is_function else _by_input(drive, scene)
    if isolas and forced.over_levels is None:
        remedy = "Then responses can be followed over the level."
        raise fail("drive", "a function of (omega, level)", "one of omega alone", remedy)

    def follow(orbit: Orbit, make: Make, start: float, *, down: bool | None = None) -> Family:
        return continue_family(
            orbit,
            make,
            start,
            within=(low, high),
            down=bool(start == high) if down is None else down,
            step=step,
            members=members,
            report=report,
        )

    names = [name for name, _ in scene.labels()]
    output = drive if isinstance(drive, str) and drive in names else names[0]
    found = []
    for level in many.tolist():
        curves = _curves(forced, level, (low, high), follow)
        if isolas:
            at = _frequencies(curves, (low, high), isolas, output)
            curves += _isolas(forced, level, at, curves, follow)
        found += [(level, curve) for curve in curves]
    of_levels, curves = zip(*found, strict=True)
    return FrequencyResponse(of_levels, curves, (low, high), output)


def _curves(
    forced: "_Forced",
    level: float,
    ends: tuple[float, float],
    follow: Callable[[Orbit, Make, float], Family],
) -> list[Family]:
    """The curves of a level: one from end to end, or two where a resonance passes an end."""
    orbit, make, start = _first(forced, level, ends)
    first = follow(orbit, make, start)
    (other,) = (x for x in ends if x != start)
    beyond = _near(forced, other, level)
    if not beyond.ok or _passes(first, beyond, other):
        return [first]
    return [first, follow(beyond, make, other)]


def _passes(curve: Family, orbit: Orbit, omega: float) -> bool:
    """Whether a curve leads to a response at a frequency."""
    for there in _crossings(curve, omega):
        apart = (np.asarray(there.orbit.y0) - np.asarray(orbit.y0)) / there.point.sizes
        if np.abs(apart).max() < _SAME:
            return True
    return False


def _crossings(curve: Family, value: float) -> list[Member]:
    """The responses of a family at a value of its parameter."""
    surface = OrbitSurface(curve.equations, curve.members[0].orbit.rtol, GOAL)
    found = []
    at = [np.isclose(m.parameter, value, rtol=_ROUNDING, atol=0.0) for m in curve.members]
    found += [m for m, there in zip(curve.members, at, strict=True) if there]
    for (a, here), (b, there) in itertools.pairwise(zip(curve.members, at, strict=True)):
        if not (here or there) and (a.parameter - value) * (b.parameter - value) < 0:
            zero = zero_between(surface.at(a.point), a, b, lambda _, m: m.parameter - value)
            found.append(zero)
    return [member for member in found if member is not None]


# ---- Isolas: curves that are detached at a level
#
# At a fixed frequency the responses are a curve over the level, which begins at those to a weak
# forcing. If the isola joins the main response curve at a higher level, the curve over the level
# turns there and returns to the requested level on the isola.


def _frequencies(
    curves: list[Family], ends: tuple[float, float], count: int, output: str
) -> list[float]:
    """The frequencies at which responses are followed over the level."""
    peaks = [_peak(curve, output)[1].parameter for curve in curves]
    inside = [x for x in peaks if not np.isclose(x, ends, rtol=_ROUNDING, atol=0.0).any()]
    return inside + np.linspace(*ends, count + 1)[1:-1].tolist()


def _isolas(
    forced: "_Forced",
    level: float,
    frequencies: list[float],
    known: list[Family],
    follow: Callable[..., Family],
) -> list[Family]:
    """The curves of a level that are not among the known ones."""
    found: list[Family] = []
    for omega in frequencies:
        for orbit in _responses(forced, level, omega):
            if any(_passes(one, orbit, omega) for one in (*known, *found)):
                continue
            curve = follow(orbit, forced.make(level), omega, down=False)
            if not curve.closed:  # it leads from end to end of the range, so follow all of it
                last = curve.members[-1]
                back = last.parameter > omega
                curve = follow(last.orbit, forced.make(level), last.parameter, down=back)
            found.append(curve)
    return found


def _responses(forced: "_Forced", level: float, omega: float) -> list[Orbit]:
    """The responses at a level and a frequency that are connected with those to a weak forcing."""
    assert forced.over_levels is not None
    weak = _PARTS[0] * level
    first = _near(forced, omega, weak)
    if not first.ok:
        return []
    over = forced.over_levels(omega)
    within = (-_ABOVE * level, _ABOVE * level)
    family = continue_family(first, over, weak, within=within, members=_LEVELS)
    found = []
    for member in _crossings(family, level):
        scene = forced.scene(omega, level).starting(member.orbit.y0)
        found.append(find(scene, period=2 * np.pi / omega, throw=False))
    return [orbit for orbit in found if orbit.ok]


def _range(frequencies) -> tuple[float, float]:
    both = np.asarray(array("frequencies", frequencies, (2,), "The lowest and the highest."), float)
    if not 0 < both[0] < both[1]:
        raise fail("frequencies", "two positive ones, the lower one first", both.tolist())
    return float(both[0]), float(both[1])


@dataclasses.dataclass(frozen=True)
class _Forced:
    """The forcing of a scene.

    Attributes:
      scene: (omega, level) -> the forced scene.
      make: level -> the scene as a function of omega.
      linear: (omega) -> (k,) complex response per unit of the level.
      over_levels: omega -> the scene as a function of the level; None if the level is fixed.
    """

    scene: Callable[[float, float], Scene]
    make: Callable[[float], Make]
    linear: Callable[[float], np.ndarray]
    over_levels: Callable[[float], Make] | None


def _level(scene: Scene) -> Array:
    return scene.system.signal.amplitude  # pyright: ignore[reportAttributeAccessIssue]


def _omega(scene: Scene) -> Array:
    return scene.system.signal.omega  # pyright: ignore[reportAttributeAccessIssue]


def _by_input(drive, scene: Scene) -> _Forced:
    found = check_input(scene, drive)
    linear = transfer_function(scene, found, _whole)

    def forced(omega: float, level: float) -> Scene:
        return forcing.drive(scene, found, Harmonic(level, omega), 2 * np.pi / omega)

    along, over = OwnNumber(_omega), OwnNumber(_level)
    return _Forced(
        scene=forced,
        make=lambda level: along,
        linear=lambda omega: np.asarray(linear.at(omega)),
        over_levels=lambda omega: over,
    )


def _by_function(drive: Callable[..., Scene], scene: Scene) -> _Forced:
    alone = _takes_omega_alone(drive)

    def forced(omega, level) -> Scene:
        made = drive(omega) if alone else drive(omega, level)
        check_kind("drive(omega, level)", made, (Scene,))
        return made.starting(scene.y0, 2 * jnp.pi / omega)

    def make(level: float) -> Make:
        return lambda omega: forced(omega, level)

    at_rest = jnp.asarray(scene.y0)

    def linear(omega: float) -> np.ndarray:
        """The response to the first harmonic of the forcing at the equilibrium."""
        ts = jnp.asarray(np.arange(_SAMPLES) * (2 * np.pi / omega / _SAMPLES))
        pushed = np.asarray(_rates(forced(omega, 1.0), ts, at_rest))
        first = 2 * np.exp(-2j * np.pi * np.arange(_SAMPLES) / _SAMPLES) @ pushed / _SAMPLES
        a = np.asarray(_slope(forced(omega, 1.0), ts, at_rest))
        try:
            return np.linalg.solve(1j * omega * np.eye(len(a)) - a, first)
        except np.linalg.LinAlgError:  # at a resonance without damping
            return np.full(len(a), np.nan)

    def over_levels(omega: float) -> Make:
        return lambda level: forced(omega, level)

    return _Forced(forced, make, linear, None if alone else over_levels)


def _takes_omega_alone(drive: Callable[..., Scene]) -> bool:
    try:
        check_callable("drive", drive, "omega", "level")
    except ValueError as refused:
        try:
            check_callable("drive", drive, "omega")
        except ValueError:
            raise refused from None
        return True
    return False


_SAMPLES = 64  # per period of the forcing, for its first harmonic


@jax.jit
def _rates(scene: Scene, ts: Array, y: Array) -> Array:
    return jax.vmap(scene.rate, (0, None))(ts, y)


@jax.jit
def _slope(scene: Scene, ts: Array, y: Array) -> Array:
    """(k, k) the mean Jacobian over a period."""
    return jnp.mean(jax.vmap(jax.jacfwd(scene.rate, argnums=1), (0, None))(ts, y), axis=0)


def _whole(t: Array, y: Array) -> Array:
    del t
    return y


def _first(forced: _Forced, level: float, ends: tuple[float, float]) -> tuple[Orbit, Make, float]:
    """A response at one end of the range, the family that it belongs to, and that frequency."""
    for omega in ends:
        _check_forced(forced.scene(omega, level), omega)
        orbit = _near(forced, omega, level)
        # If the response is far from linear, start from responses to weaker forcing.
        for part in () if orbit.ok else _PARTS:
            orbit = _near(forced, omega, part * level, orbit if orbit.ok else None)
        if orbit.ok:
            return orbit, forced.make(level), omega
    raise SearchError(_NO_FIRST)


def _check_forced(scene: Scene, omega: float) -> None:
    """Raise ValueError unless the rate of a scene has the period of this angular frequency."""
    period = 2 * np.pi / omega
    wanted = f"a scene whose rate has the period 2 pi / omega, {period:.6g} for omega = {omega:g}"
    if not is_driven(scene):
        raise fail(
            "drive", wanted, "one that does not depend on time", "Does the forcing enter it?"
        )
    found = drive_period(scene)
    if found is not None and not turns_in(period, found):
        remedy = "omega is an angular frequency, 2 pi times the number of cycles per unit of time."
        raise fail("drive", wanted, f"one of period {found:.6g}", remedy)


def _near(forced: _Forced, omega: float, level: float, beside: Orbit | None = None) -> Orbit:
    """The response near another one, or near the linear one, or near rest if that is infinite."""
    scene = forced.scene(omega, level)
    rest = np.asarray(scene.y0)
    linear = rest + level * forced.linear(omega).real
    linear = linear if np.isfinite(linear).all() else rest
    start = linear if beside is None else beside.y0
    return find(scene.starting(start), period=2 * np.pi / omega, throw=False)
