"""A torus of two frequencies about an elliptic periodic orbit, from the orbit's Floquet vector."""

import dataclasses
import math
from typing import NamedTuple

import jax
import numpy as np

from jaxdyn import Scene, _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.status import Code
from orbits.analysis.monodromy import return_in_basis, tangents_in
from orbits.analysis.stability import stability
from orbits.closing.given import is_driven
from orbits.closing.sizes import largest_entry, sizes
from orbits.orbit import Orbit, SearchError
from orbits.tori import circle
from orbits.tori.invariance import Conditions, Metric, Unknowns, error, mean_energy, solve

# ---- The record of a torus: its circle, its rotation, and the outcome of the search for it


class TorusOutcome(Code):
    """Outcome of a search for a torus."""

    FOUND = 0, "The circle is invariant."
    NO_CONVERGENCE = (
        1,
        "Newton's method did not converge: there is no such torus near this one. Take a smaller "
        "amplitude or step, or another rotation: close to a resonance tori break up. With damping "
        "there are no families of tori, and single ones are not looked for.",
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
      held: "energy", "time" or "drive", the quantity that is kept along the family of tori.
      rtol: tolerance of the integrations.
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

    @_text.never_raising
    def __repr__(self) -> str:
        w = ", ".join(f"{x:.12g}" for x in self.frequencies)
        rows = [
            ("frequencies", f"{w} rad per unit of time"),
            ("rotation", f"{self.rotation:.12g} rad in {self.time:.12g}"),
            ("amplitude", _text.brief(self.amplitude)),
            ("energy", "" if math.isnan(self.energy) else f"{self.energy:.12g}, held: {self.held}"),
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
        return self.outcome.message

    @property
    def frequencies(self) -> tuple[float, float]:
        """The two angular frequencies 2 pi / T and rho / T [rad per unit of time]."""
        return 2 * math.pi / self.time, self.rotation / self.time

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns for which Newton's method solved."""
        return Unknowns(self.points, self.rotation, self.time)

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
        """The row (N k + 2,) and its value."""
        del near
        return np.append(wave.real.ravel(), [0.0, 0.0]), self.amplitude * share


class HasRotation(NamedTuple):
    """The torus with a rotation [rad]."""

    rotation: float

    def row(self, near: Unknowns, wave: np.ndarray, share: float) -> Row:
        """The row (N k + 2,) and its value."""
        del near, share
        return np.append(np.zeros(wave.size), [1.0, 0.0]), self.rotation


class AcrossTangent(NamedTuple):
    """The torus in the plane through the start, across a unit tangent in a metric."""

    tangent: Unknowns
    metric: Metric

    def row(self, near: Unknowns, wave: np.ndarray, share: float) -> Row:
        """The row (N k + 2,) and its value."""
        del share
        along = self.metric.row(self.tangent.resample(len(wave)))
        return along, float(along @ near.pack())


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
    target: HasAmplitude | HasRotation | AcrossTangent,
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
    now, metric = start, Metric.of(like.scene, start)
    least = _COLLAPSED * metric.norm(circle.harmonic(start.points))
    while True:
        conditions = _conditions(like, now, start, w, target, metric)
        done = solve(like.scene, now, conditions, like.rtol, metric)
        found = _torus(like, done.unknowns)
        if not np.isfinite(done.residual):
            return dataclasses.replace(found, outcome=TorusOutcome.MOTION_ENDS)
        off, rounded = error(like.scene, done.unknowns, like.rtol, metric)
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
            return dataclasses.replace(found, outcome=TorusOutcome.NOT_SMOOTH)
        now = done.unknowns.resample(2 * min(math.ceil(_MORE * modes), max_modes) + 1)


def _torus(like: Torus, found: Unknowns) -> Torus:
    level = mean_energy(like.scene, found.points)[0] if like.scene.has_energy else math.nan
    size = float(np.linalg.norm(circle.harmonic(found.points)))
    return dataclasses.replace(
        like,
        points=found.points,
        time=found.time,
        rotation=found.rotation,
        amplitude=size,
        energy=like.energy if like.held == "energy" else level,
    )


def _conditions(
    like: Torus,
    now: Unknowns,
    start: Unknowns,
    w: np.ndarray,
    target: HasAmplitude | HasRotation | AcrossTangent,
    metric: Metric,
) -> Conditions:
    """The rows for a circle of as many points as `now`."""
    n, k = now.points.shape
    nothing = np.zeros(n * k)
    # The first harmonic along w fixes theta = 0 by its imaginary, the amplitude by its real part.
    share = metric.norm(w)  # norm of a unit of amplitude in the metric
    wave = 2 / n * np.exp(-1j * circle.angles(n))[:, None] * w.conj()[None] / metric.each**2 / share
    duration = np.append(nothing, [0.0, 1 / metric.time])
    near = start.resample(n)
    wanted, value = target.row(near, wave, share)
    rows, values = [np.append(wave.imag.ravel(), [0.0, 0.0]), wanted], [0.0, value]
    if like.held == "drive":
        rows, values = [*rows, duration], [*values, now.time / metric.time]
    else:
        # The circle is not moved along the flow.
        reference = near.points
        flow = np.asarray(_rates(like.scene, reference)) / metric.each
        flow = flow / (n * max(np.abs(flow).max(), np.finfo(float).tiny)) / metric.each
        rows = [*rows, np.append(flow.ravel(), [0.0, 0.0])]
        values = [*values, flow.ravel() @ reference.ravel()]
    if like.held == "time":
        rows, values = [*rows, duration], [*values, like.time / metric.time]
    level = like.energy if like.held == "energy" else None
    return Conditions(np.array(rows), np.array(values), level)


@jax.jit
def _rates(scene: Scene, points):
    return jax.vmap(lambda y: scene.rate(0.0, y))(points)


# ---- The search for a torus about an orbit

#: Default largest error of invariance, in the sizes of the entries.
GOAL = 1e-11
#: Number of modes of the first attempt, and the default of the largest number.
FEWEST_MODES, MOST_MODES = 6, 60
_ELLIPTIC = 1e-6  # distance of a multiplier from the unit circle below which it may be on it


@check_first
def torus(
    orbit: Orbit,
    amplitude: float,
    *,
    pair: int = 0,
    rotation: float | None = None,
    goal: float = GOAL,
    max_modes: int = MOST_MODES,
    throw: bool = True,
) -> Torus:
    """The invariant torus of a given amplitude about an elliptic periodic orbit.

    A pair of multipliers exp(+-i nu) of the orbit belongs to tori around it, one for each amplitude
    (and energy), on which the map over the time T turns a circle by rho, close to nu. The circle
    begins with the Floquet vector, and is solved as a Fourier series with as many modes as its
    coefficients need.

    Args:
      orbit: a periodic orbit. In a driven scene T is its period; otherwise T is free and the energy
        of the orbit is kept, or its period if the scene has no energy.
      amplitude: component of the circle's first harmonic along the Floquet vector, which has norm 1
        in the units of the state; the rest of the harmonic is orthogonal to that vector in the
        sizes of the entries. The tori of a family begin at 0, which is the orbit.
      pair: number of the pair of multipliers on the unit circle, in the order of
        `Stability.nontrivial`.
      rotation: angle rho to reach instead of the amplitude, which is then a guess [rad]. It should
        be close to that of a torus of the guessed amplitude, in the same sense.
      goal: largest error of invariance, in the sizes of the entries; where rounding of the circle
        alone makes a larger one, as about an unstable orbit, a few times that, up to 1e-8, is
        accepted.
      max_modes: largest number of Fourier modes.
      throw: raise unless a torus was found; with False check `Torus.outcome`.
    Returns:
      The torus, its rotation, and its error of invariance between the points of the circle.
    Raises:
      ValueError: `orbit` is not an orbit, or has no such pair of multipliers; `amplitude` or `goal`
        is not positive; `max_modes` is less than `FEWEST_MODES`.
      SearchError: no torus was found (``throw=True``).
    Limits: host only; scenes without damping and without constraints; tori of two frequencies, that
      of the orbit or the drive and one more. Where rho / 2 pi is close to a fraction with a small
      denominator, there is a gap in the family.
    Reference: Gomez & Mondelo (2001), Physica D 157, 283; Olikara & Scheeres (2012), Adv.
      Astronaut. Sci. 145, 911; Jorba (2001), Nonlinearity 14, 943.
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
    if not orbit.ok:
        raise _checks.fail("orbit", "a periodic orbit", orbit.outcome.name, orbit.message)
    nu, w = floquet_vector(orbit, pair)
    n = 2 * FEWEST_MODES + 1
    y0 = np.asarray(orbit.y0)
    turns = np.exp(1j * circle.angles(n))[:, None]
    start = Unknowns(y0 + amplitude * (turns * w).real, nu, orbit.period)
    unforced = "energy" if orbit.scene.has_energy else "time"
    held = "drive" if is_driven(orbit.scene) else unforced
    level = mean_energy(orbit.scene, y0[None])[0] if held == "energy" else math.nan
    target = HasAmplitude(amplitude) if rotation is None else HasRotation(float(rotation))
    blank = Torus(
        scene=orbit.scene,
        points=start.points,
        time=start.time,
        rotation=nu,
        amplitude=amplitude,
        energy=level,
        error=math.nan,
        outcome=TorusOutcome.NO_CONVERGENCE,
        held=held,
        rtol=orbit.rtol,
    )
    found = refine(blank, start, w, target, goal=goal, max_modes=max_modes)
    if throw and not found.ok:
        raise SearchError(found.message)
    return found


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
            "Tori surround elliptic orbits; orbits.stability has the multipliers.",
        )
    each = sizes(orbit.scene)
    basis = tangents_in(orbit.scene, each)
    m = return_in_basis(orbit, orbit.rtol, basis, each).m
    values, vectors = np.linalg.eig(m)
    i = int(np.argmin(np.abs(values - on_circle[pair])))
    w = each * (basis @ vectors[:, i])
    w = w / w[largest_entry(w, each)]
    return float(np.angle(on_circle[pair])), w / np.linalg.norm(w)
