"""A torus of two frequencies about a periodic orbit, from the orbit's Floquet vector."""

import dataclasses
import functools
import math
from typing import NamedTuple

import numpy as np

from jaxdyn import Scene, _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.status import Code
from orbits.analysis.monodromy import return_in_basis, tangents_in
from orbits.analysis.stability import stability
from orbits.closing.given import is_driven
from orbits.closing.sizes import largest_entry, sizes
from orbits.families.family import Kind, Member, smooth_orbit
from orbits.orbit import Orbit, SearchError
from orbits.shooting.segment import Make, scene_of
from orbits.tori import circle
from orbits.tori.invariance import (
    Conditions,
    Flow,
    Metric,
    Unknowns,
    error,
    mean_energy,
    rates,
    solve,
)
from orbits.tori.transverse import moduli

# ---- The record of a torus: its circle, its rotation, and the outcome of the search for it

#: Resonances p:q that are named: up to this q, where q turns differ from p by less than the second.
_ORDERS, _NEAR = 7, 0.05


class TorusOutcome(Code):
    """Outcome of a search for a torus."""

    FOUND = 0, "The circle is invariant."
    NO_CONVERGENCE = (
        1,
        "Newton's method did not converge: there is no such torus near this one. Take a smaller "
        "amplitude or step, or another rotation: close to a resonance tori break up. With damping "
        "tori form families along a parameter only, from a torus point of a family of orbits.",
    )
    NOT_SMOOTH = (
        2,
        "The circle needs more Fourier modes than max_modes: it is close to a resonance or to the "
        "last torus before chaos. Take a smaller amplitude, or raise max_modes or the goal.",
    )
    MOTION_ENDS = (
        3,
        "A motion on the circle cannot be integrated over the return time: it runs into a "
        "singularity, or takes too many steps. Take a smaller amplitude.",
    )
    COLLAPSED = (
        4,
        "The circle shrank to a periodic orbit, which is invariant with any rotation. Take a "
        "smaller step or amplitude, or a rotation that tori of this family have.",
    )
    RESONANT = (
        5,
        "The circle needs more Fourier modes than max_modes, and its rotation is close to a simple "
        "fraction of a turn: at such a resonance motions lock to a periodic orbit, or chaos begins."
        " Where it is narrow, a longer step or a larger max_modes leads over it.",
    )


@dataclasses.dataclass(frozen=True)
class Torus:
    """An invariant torus, given by an invariant circle of the map over the time T.

    Attributes:
      scene: the scene.
      points: (N, k) the circle, at equally spaced angles.
      time: T, the time between returns to the circle: a period of the torus, which is that of the
        drive in a driven scene [time of the scene].
      rotation: angle rho by which the map turns the circle [rad]; its sign, which depends on the
        sense of theta, and multiples of 2 pi are arbitrary.
      amplitude: norm of the first harmonic of the circle [norm of a state]; a torus is asked for by
        the component of this harmonic along the orbit's Floquet vector.
      energy: mean energy of the circle; NaN for a scene without one.
      error: largest error of invariance, between the points, in the sizes of the entries.
      outcome: how the search ended; unless it is FOUND, this is the best iterate, not a torus.
      held: "energy", "time" or "drive", the quantity that is kept along the family of tori; "" for
        tori of an autonomous scene along a parameter.
      rtol: tolerance of the integrations.
      parameter: value of the parameter along which the family goes; NaN without one.
      make: the scene for each value of the parameter; None without one.
      unit: unit of the parameter, in which steps are measured.
    """

    scene: Scene
    points: np.ndarray
    time: float
    rotation: float
    amplitude: float
    energy: float
    error: float
    outcome: TorusOutcome
    held: str
    rtol: float
    parameter: float = math.nan
    make: Make | None = None
    unit: float = 1.0

    @_text.never_raising
    def __repr__(self) -> str:
        w = ", ".join(f"{x:.12g}" for x in self.frequencies)
        held = f", held: {self.held}" if self.held else ""
        rows = [
            ("parameter", "" if math.isnan(self.parameter) else f"{self.parameter:.12g}"),
            ("frequencies", f"{w} rad per unit of time"),
            ("rotation", f"{self.rotation:.12g} rad in {self.time:.12g}"),
            ("amplitude", _text.brief(self.amplitude)),
            ("energy", "" if math.isnan(self.energy) else f"{self.energy:.12g}{held}"),
            ("circle", f"{len(self.points) // 2} modes, invariant to {_text.brief(self.error)}"),
            ("outcome", f"{self.outcome.name}: {self.message}"),
        ]
        return _text.table(f"Torus of {_text.title_of(self.scene)}", rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import tori

        return tori.torus(self, title="")

    @property
    def ok(self) -> bool:
        """Whether this is a torus."""
        return self.outcome == TorusOutcome.FOUND

    @property
    def message(self) -> str:
        """How the search ended and what to try."""
        known = self.outcome == TorusOutcome.RESONANT and self.resonance
        return f"{self.outcome.message} It is {known}." if known else self.outcome.message

    @property
    def resonance(self) -> str:
        """The simple fraction of a turn that the rotation is close to, as ``1:3``, if any."""
        turn = self.rotation / (2 * math.pi) % 1.0
        near = (q for q in range(1, _ORDERS + 1) if abs(q * turn - round(q * turn)) < _NEAR)
        q = next(near, None)
        return "" if q is None else f"{round(q * turn)}:{q}"

    @property
    def frequencies(self) -> tuple[float, float]:
        """The two angular frequencies 2 pi / T and rho / T [rad per unit of time]."""
        return 2 * math.pi / self.time, self.rotation / self.time

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns for which Newton's method solved."""
        parameter = 0.0 if self.make is None else self.parameter
        return Unknowns(self.points, self.rotation, self.time, parameter)

    @property
    def flow(self) -> Flow:
        """The motions that are on it."""
        return Flow(self.scene, self.make, self.rtol)

    @functools.cached_property
    def moduli(self) -> np.ndarray:
        """(k - d,) moduli of the multipliers across the torus, over the time T, largest first.

        Below 1 motions beside the torus approach it. The d directions along it, 1 with a drive and
        2 without, are left out. They are NaN if this is not a torus.
        """
        if not self.ok:
            return np.full(self.points.shape[1] - (1 if self.held == "drive" else 2), np.nan)
        metric = Metric.of(self.scene, self.unknowns, self.unit)
        return moduli(self.flow, self.unknowns, metric)

    def at(self, theta) -> np.ndarray:
        """(s, k) states of the circle at angles theta (s,); in a driven scene, at time 0."""
        return circle.at(self.points, _checks.host_array("theta", theta, (None,)))


# ---- What singles a torus out in its family: one condition, as a row of `Conditions`
# `near` is the start of the search, with as many points as the circle. The sum of the points times
# the weights `wave` (N, k) is the component of the first harmonic along w in the metric, in which a
# unit of amplitude has the norm `share`.

Row = tuple[np.ndarray, float]


class HasAmplitude(NamedTuple):
    """The torus with an amplitude along w."""

    amplitude: float

    def row(self, near: Unknowns, wave: np.ndarray, share: float) -> Row:
        """The row (N k + 3,) and its value."""
        del near
        return Unknowns(wave.real).pack(), self.amplitude * share


class HasRotation(NamedTuple):
    """The torus with a rotation [rad]."""

    rotation: float

    def row(self, near: Unknowns, wave: np.ndarray, share: float) -> Row:
        """The row (N k + 3,) and its value."""
        del near, share
        return Unknowns(np.zeros(wave.shape), rotation=1.0).pack(), self.rotation


class HasParameter(NamedTuple):
    """The torus at a value of the parameter, which has a unit."""

    parameter: float
    unit: float

    def row(self, near: Unknowns, wave: np.ndarray, share: float) -> Row:
        """The row (N k + 3,) and its value."""
        del near, share
        row = Unknowns(np.zeros(wave.shape), parameter=1 / self.unit).pack()
        return row, self.parameter / self.unit


class AcrossTangent(NamedTuple):
    """The torus in the plane through the start, across a unit tangent in a metric."""

    tangent: Unknowns
    metric: Metric

    def row(self, near: Unknowns, wave: np.ndarray, share: float) -> Row:
        """The row (N k + 3,) and its value."""
        del share
        along = self.metric.row(self.tangent.resample(len(wave)))
        return along, float(along @ near.pack())


Target = HasAmplitude | HasRotation | HasParameter | AcrossTangent


# ---- The torus near a circle: the conditions that single it out, and the modes that it needs

_MORE = 1.5  # factor on the number of modes from attempt to attempt
#: An error of invariance up to this multiple of that by rounding of the points, and up to the
#: second number, is accepted: about a very unstable orbit rounding alone makes large errors.
_ROUNDINGS, _LOOSEST = 4.0, 1e-8
_COLLAPSED = 0.02  # share of the first amplitude below which a circle has become a point


def refine(
    like: Torus,
    start: Unknowns,
    w: np.ndarray,
    target: Target,
    *,
    goal: float,
    max_modes: int,
) -> Torus:
    """The torus near a start, with as many modes as it needs.

    Args:
      like: a torus of the same family, with the scene and the settings that both share.
      start: the first circle.
      w: (k,) complex direction of the first harmonic, which fixes the origin of theta.
      target: the condition that singles it out in the family.
      goal: largest error of invariance, see `torus`.
      max_modes: largest number of modes.
    """
    now, metric = start, Metric.of(like.scene, start, like.unit)
    least = _COLLAPSED * metric.norm(circle.harmonic(start.points))
    while True:
        conditions = _conditions(like, now, start, w, target, metric)
        done = solve(like.flow, now, conditions, metric)
        found = _torus(like, done.unknowns)
        if not np.isfinite(done.residual):
            return dataclasses.replace(found, outcome=TorusOutcome.MOTION_ENDS)
        off, rounded = error(like.flow, done.unknowns, metric)
        enough = max(goal, min(_ROUNDINGS * rounded, _LOOSEST))
        found = dataclasses.replace(found, error=off, outcome=TorusOutcome.NO_CONVERGENCE)
        if metric.norm(circle.harmonic(found.points)) < least:
            return dataclasses.replace(found, outcome=TorusOutcome.COLLAPSED)
        if off <= enough:
            return dataclasses.replace(found, outcome=TorusOutcome.FOUND)
        modes = len(now.points) // 2
        if done.residual > max(enough, off):
            return found
        if modes == max_modes or not np.isfinite(off):
            near = TorusOutcome.RESONANT if found.resonance else TorusOutcome.NOT_SMOOTH
            return dataclasses.replace(found, outcome=near)
        now = done.unknowns.resample(2 * min(math.ceil(_MORE * modes), max_modes) + 1)


def _torus(like: Torus, found: Unknowns) -> Torus:
    scene = scene_of(like.scene, like.make, found.parameter)
    level = mean_energy(scene, found.points)[0] if scene.has_energy else math.nan
    size = float(np.linalg.norm(circle.harmonic(found.points)))
    return dataclasses.replace(
        like,
        scene=scene,
        points=found.points,
        time=found.time,
        rotation=found.rotation,
        amplitude=size,
        energy=like.energy if like.held == "energy" else level,
        parameter=math.nan if like.make is None else found.parameter,
    )


def _conditions(
    like: Torus, now: Unknowns, start: Unknowns, w: np.ndarray, target: Target, metric: Metric
) -> Conditions:
    """The rows for a circle of as many points as `now`."""
    n, k = now.points.shape
    nothing = np.zeros((n, k))
    # The first harmonic along w fixes theta = 0 by its imaginary, the amplitude by its real part.
    share = metric.norm(w)  # norm of a unit of amplitude in the metric
    wave = 2 / n * np.exp(-1j * circle.angles(n))[:, None] * w.conj()[None] / metric.each**2 / share
    near = start.resample(n)
    rows = [(Unknowns(wave.imag).pack(), 0.0), target.row(near, wave, share)]
    if like.held != "drive":
        # The circle is not moved along the flow.
        reference = near.points
        flow = np.asarray(rates(like.scene, reference)) / metric.each
        flow = flow / (n * max(np.abs(flow).max(), np.finfo(float).tiny)) / metric.each
        rows.append((Unknowns(flow).pack(), float(flow.ravel() @ reference.ravel())))
    if like.make is None:
        rows.append((Unknowns(nothing, parameter=1.0).pack(), 0.0))
    if like.held == "time" or (like.held == "drive" and like.make is None):
        duration = Unknowns(nothing, time=1 / metric.time).pack()
        rows.append((duration, like.time / metric.time))
    each, values = zip(*rows, strict=True)
    return Conditions(
        rows=np.array(each),
        values=np.array(values),
        energy=like.energy if like.held == "energy" else None,
        in_step=like.held == "drive" and like.make is not None,
    )


# ---- The search for a torus about an orbit

#: Default largest error of invariance, in the sizes of the entries.
GOAL = 1e-11
#: Number of modes of the first attempt, and the default of the largest number.
FEWEST_MODES, MOST_MODES = 6, 60
_ELLIPTIC = 1e-6  # distance of a multiplier from the unit circle below which it may be on it


@check_first
def torus(
    orbit: Orbit | Member,
    amplitude: float,
    *,
    pair: int = 0,
    rotation: float | None = None,
    parameter: float | None = None,
    goal: float = GOAL,
    max_modes: int = MOST_MODES,
    throw: bool = True,
) -> Torus:
    """The invariant torus of a given amplitude about an elliptic periodic orbit.

    A pair of multipliers exp(+-i nu) of the orbit belongs to tori around it, one for each amplitude
    (and energy), on which the map over the time T turns a circle by rho, close to nu. The circle
    begins with the Floquet vector, and is solved as a Fourier series with as many modes as its
    coefficients need.

    With damping, tori begin at a torus point of a family of orbits (Neimark-Sacker bifurcation),
    and each amplitude belongs to another value of the family's parameter, which is found with it.

    Args:
      orbit: a periodic orbit, or a torus point, one of ``family.special``. In a driven scene T is
        its period, which changes with that of the drive; otherwise T is free, and of tori about an
        orbit one has its energy, or its period if the scene has no energy.
      amplitude: component of the circle's first harmonic along the Floquet vector, which has norm 1
        in the units of the state; the rest of the harmonic is orthogonal to that vector in the
        sizes of the entries. The tori of a family begin at 0, which is the orbit.
      pair: number of the pair of multipliers on the unit circle, in the order of
        `Stability.nontrivial`.
      rotation: angle rho to reach instead of the amplitude, which is then a guess [rad]. It should
        be close to that of a torus of the guessed amplitude, in the same sense.
      parameter: value of the family's parameter to reach instead, likewise; for a torus point.
      goal: largest error of invariance, in the sizes of the entries; where rounding of the circle
        alone makes a larger one, as about an unstable orbit, a few times that, up to 1e-8, is
        accepted.
      max_modes: largest number of Fourier modes.
      throw: raise unless a torus was found; with False check `Torus.outcome`.
    Returns:
      The torus, its rotation, its parameter, and its error of invariance between the points of the
      circle.
    Raises:
      ValueError: `orbit` is not an orbit, or has no such pair of multipliers; `amplitude` or `goal`
        is not positive; `max_modes` is less than `FEWEST_MODES`; `parameter` is given with
        `rotation`, or without a torus point.
      SearchError: no torus was found (``throw=True``).
    Limits: host only; scenes without constraints; tori of two frequencies, that of the orbit or the
      drive and one more. Where rho / 2 pi is close to a fraction with a small denominator, there is
      a gap in the family.
    Reference: Gomez & Mondelo (2001), Physica D 157, 283; Olikara & Scheeres (2012), Adv.
      Astronaut. Sci. 145, 911; Jorba (2001), Nonlinearity 14, 943; Schilder, Osinga & Vogt (2005),
      SIAM J. Appl. Dyn. Syst. 4, 459.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> stick = scenes.shaken_pendulum(angle=0.0, frequency=60.0)
      >>> swing = orbits.find(stick, period=6.28318530718 / 60)
      >>> found = orbits.torus(swing, 0.1)
      >>> found.ok, found.error < 1e-11
      (True, True)
    """
    _checks.check_on_host("orbit", orbit, "Tori are found on the host.")
    amplitude = float(_checks.positive("amplitude", amplitude, "It is the norm of a state."))
    _checks.positive("goal", goal, "It is an error in the sizes of the entries.")
    _checks.whole("max_modes", max_modes, FEWEST_MODES)
    blank = _orbit_itself(orbit)
    target = _target(blank, amplitude, rotation, parameter)
    about = orbit if isinstance(orbit, Orbit) else orbit.orbit
    nu, w = floquet_vector(smooth_orbit("orbit", about), pair)
    turns = np.exp(1j * circle.angles(2 * FEWEST_MODES + 1))[:, None]
    start = blank.unknowns._replace(points=blank.points + amplitude * (turns * w).real, rotation=nu)
    found = refine(blank, start, w, target, goal=goal, max_modes=max_modes)
    if throw and not found.ok:
        raise SearchError(found.message)
    return found


def _orbit_itself(about: Orbit | Member) -> Torus:
    """An orbit, or a torus point, as a circle of one point."""
    make, value, unit = None, math.nan, 1.0
    if isinstance(about, Member):
        make, value, unit = (
            about.point.equations.make,
            about.parameter,
            float(about.point.units[-2]),
        )
        if about.kind != Kind.TORUS or make is None:
            got = about.kind or "an ordinary member"
            remedy = (
                "The tori about an orbit of a conservative scene are those of the member's .orbit."
            )
            raise _checks.fail("orbit", "an orbit, or a torus point of a family", got, remedy)
    orbit = about if isinstance(about, Orbit) else smooth_orbit("orbit", about.orbit)
    if not orbit.ok:
        raise _checks.fail("orbit", "a periodic orbit", orbit.outcome.name, orbit.message)
    y0 = np.asarray(orbit.y0)[None]
    unforced = "" if make else "energy" if orbit.scene.has_energy else "time"
    held = "drive" if is_driven(orbit.scene) else unforced
    return Torus(
        scene=orbit.scene,
        points=y0,
        time=orbit.period,
        rotation=0.0,
        amplitude=0.0,
        energy=mean_energy(orbit.scene, y0)[0] if held == "energy" else math.nan,
        error=math.nan,
        outcome=TorusOutcome.NO_CONVERGENCE,
        held=held,
        rtol=orbit.rtol,
        parameter=value,
        make=make,
        unit=unit,
    )


def _target(
    blank: Torus, amplitude: float, rotation: float | None, parameter: float | None
) -> Target:
    """The condition on a torus that the arguments of `torus` set."""
    if parameter is not None:
        if blank.make is None or rotation is not None:
            got = "one for an orbit" if blank.make is None else "both"
            wanted = "the parameter of a torus point, or a rotation"
            raise _checks.fail("parameter", wanted, got, "Pass one of family.special.")
        return HasParameter(float(_checks.finite("parameter", parameter)), blank.unit)
    return HasAmplitude(amplitude) if rotation is None else HasRotation(float(rotation))


def floquet_vector(orbit: Orbit, pair: int) -> tuple[float, np.ndarray]:
    """The angle nu > 0 of a pair of multipliers on the unit circle, and its unit vector (k,)."""
    found = stability(orbit)
    on_circle = [z for z in found.nontrivial if z.imag > _ELLIPTIC and abs(abs(z) - 1) < _ELLIPTIC]
    _checks.whole("pair", pair, 0)
    if pair >= len(on_circle):
        raise _checks.fail(
            "orbit",
            f"at least {_text.number_of(pair + 1, 'pair')} of multipliers on the unit circle",
            f"{len(on_circle)}",
            "Tori surround elliptic orbits; with damping they begin at a torus point, one of "
            "family.special. orbits.stability has the multipliers.",
        )
    each = sizes(orbit.scene)
    basis = tangents_in(orbit.scene, each)
    m = return_in_basis(orbit, orbit.rtol, basis, each).m
    values, vectors = np.linalg.eig(m)
    i = int(np.argmin(np.abs(values - on_circle[pair])))
    w = each * (basis @ vectors[:, i])
    w = w / w[largest_entry(w, each)]
    return float(np.angle(on_circle[pair])), w / np.linalg.norm(w)
