"""Whether a bifurcation of an orbit is super- or subcritical: coefficients of its normal form.

With A, B and C the first three derivatives of the return map, |q| = 1 and p q = 1:

- Fold, A q = q, p A = p: a = p B(q, q) / 2. If a is not zero, two orbits meet.
- Branch point: c = p C(q, q, q) / 6 + p B(q, h) / 2 with (1 - A) h = B(q, q) up to q. Where a
  symmetry makes a vanish, it is a pitchfork, supercritical for c < 0.
- Period doubling, A q = -q, p A = -p: b = p C(q, q, q) / 6 + p B(q, h) / 2 with
  (1 - A) h = B(q, q); supercritical for b > 0.
- Torus point, A q = exp(i a) q: d = Re exp(-i a) (p C(q, q, q*) + 2 p B(q, g) + p B(q*, h)) / 2
  with (1 - A) g = B(q, q*), (exp(2 i a) - A) h = B(q, q); supercritical for d < 0.

Verdicts are reached with entries in units of their sizes along the orbit; the coefficients that are
returned are for unit vectors of the state itself. The terms with B and C are coefficients of the
series of the map along curves of starts such as e q + e^2 h / 2: no tensor is formed.

Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, sections 5.4 and
9.7.
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, System, _text
from jaxdyn._checks import check_first, check_on_host, fail
from jaxdyn._numerics import taylor_coefficients
from jaxdyn.analysis.monodromy import coarser
from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.normal_forms import solve_bordered
from orbits.analysis.stability import stability
from orbits.closing.closings import PLAIN
from orbits.closing.given import is_driven, refuse_constraints
from orbits.closing.sizes import sizes
from orbits.families.family import Member, smooth_orbit
from orbits.motion import quick_solve
from orbits.orbit import Orbit

# ---- Taylor series of a return map along a curve of starts, to third order
#
# The coefficients of a motion in a small number e, y0 + e y1 + e^2 y2 + e^3 y3, are integrated
# together as one system, with the exact coefficients of the rate. In an autonomous scene each
# motion of the curve is then moved along the flow by a time, itself a series in e, to the plane
# through the start of the orbit orthogonal to its flow.

ORDER = 3


def _series(coefficients: Array, e: Array) -> Array:
    powers = jnp.stack([e**n if n else jnp.ones(()) for n in range(len(coefficients))])
    return powers @ coefficients


class Jets(System):
    """The Taylor coefficients in e of a motion of a scene, as one state (4 k,)."""

    scene: Scene

    def labels(self):
        # Coefficients of one entry have the same size, also without a unit: some are only rounding.
        known = [
            (name, f"that of {name}" if unit == "1" else unit) for name, unit in self.scene.labels()
        ]
        return tuple((f"{name} {n}", unit) for n in range(ORDER + 1) for name, unit in known)

    def rate(self, t, y, effects):
        del effects
        y = y.reshape(ORDER + 1, -1)
        return taylor_coefficients(lambda e: self.scene.rate(t, _series(y, e)), ORDER).ravel()


@jax.jit
def _carry(scene: Scene, curve: Array, period: Array, rtol) -> Array:
    run = quick_solve(Scene(Jets(scene), y0=curve.ravel()), period, rtol=rtol)
    return run.y1.reshape(curve.shape)


@jax.jit
def _return_curve(scene: Scene, curve: Array, entry_sizes: Array) -> Array:
    """A curve of states (4, k) moved along the flow to the plane through the scene's start.

    The plane is orthogonal to the flow there, with entries in units of `entry_sizes` (k,).
    """
    y0 = scene.y0
    normal = scene.rate(jnp.zeros(()), y0) / entry_sizes**2

    def rate(y):
        return scene.rate(jnp.zeros(()), y)

    def second(y):
        return jax.jvp(rate, (y,), (rate(y),))[1]

    def third(y):
        return jax.jvp(second, (y,), (rate(y),))[1]

    def moved(times, e):
        y, t = _series(curve, e), _series(times[:, None], e)[0]
        return y + t * (rate(y) + t / 2 * (second(y) + t / 3 * third(y)))

    times = jnp.zeros(ORDER + 1)
    for n in range(1, ORDER + 1):
        off = taylor_coefficients(lambda e, times=times: moved(times, e) - y0, n)[n] @ normal
        times = times.at[n].set(-off / (rate(y0) @ normal))
    return taylor_coefficients(lambda e: moved(times, e), ORDER)


def basis(orbit: Orbit, driven: bool, entry_sizes: np.ndarray) -> np.ndarray:
    """(k, d) a basis of starts: of all if the orbit is driven, else of those across the flow.

    It is orthonormal with entries in units of `entry_sizes` (k,).
    """
    if driven:
        return np.diag(entry_sizes)
    flow = np.asarray(orbit.scene.rate(jnp.zeros(()), jnp.asarray(orbit.y0)))
    return entry_sizes[:, None] * np.linalg.svd((flow / entry_sizes)[None])[2][1:].T


# ---- Super- or subcritical: coefficients of the normal form of the map of an orbit

#: Largest distance of a multiplier from its value at the bifurcation; another multiplier as near
#: makes it a double one.
_CRITICAL = 1e-4
_RESONANT = 1e-3  # a smaller |exp(3 i a) - 1| or |exp(4 i a) - 1| means a strong resonance
_PHASES = 5  # equally spaced phases, which separate the harmonics of a series that are needed


@dataclasses.dataclass(frozen=True)
class Criticality:
    """The normal form of a bifurcation of an orbit.

    Attributes:
      kind: kind of the bifurcation.
      coefficient: the coefficient that decides the verdict, for unit eigenvectors; the cubic one
        for a branch point.
      bar: its error bar.
      quadratic: quadratic coefficient of a fold or branch point, else NaN.
      verdict: "supercritical", "subcritical", "fold", "transcritical" or "undecided".
      message: what the verdict means, or why there is none.
    """

    kind: Kind
    coefficient: float
    bar: float
    quadratic: float
    verdict: str
    message: str

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            ("coefficient", f"{self.coefficient:.10g} (+-{self.bar:.1g})"),
            ("quadratic", "" if np.isnan(self.quadratic) else f"{self.quadratic:.10g}"),
            ("meaning", self.message),
        ]
        return _text.table(f"{self.kind[0].upper()}{self.kind[1:]}: {self.verdict}", rows)

    _repr_html_ = _text.html


_MEANING = {
    "fold": "Two orbits meet, and none is left beyond.",
    "transcritical": "Two families cross.",
    "supercritical": "New motions exist where the orbit is unstable, and inherit its stability.",
    "subcritical": "New motions exist where the orbit is stable, and are unstable.",
    "undecided": "The coefficient is zero within its bar: a point of codimension two is near.",
    "resonance": "The rotation is in a strong resonance (1:3 or 1:4): the coefficient does not "
    "decide. Search for the orbits of three or four periods.",
    "double": "Two multipliers have the critical value, as where a rate conserves areas: the "
    "coefficient is not defined. Add a little damping.",
}


@check_first
def criticality(point: Member | Orbit, kind: Kind | str | None = None) -> Criticality:
    """The normal form of a fold, branch point, period doubling or torus point of an orbit.

    Args:
      point: one of ``family.special``, or an orbit at a bifurcation.
      kind: kind of the bifurcation; by default that of the point, required for an orbit.
    Returns:
      The coefficient with an error bar, and a verdict.
    Raises:
      ValueError: the orbit has no multiplier that belongs to the kind, has a first integral, closes
        only up to a rotation, or has constraints.
    Limits: host only. The motion is integrated over a whole period at once, so that the bar grows
      with the multipliers.
    Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, section 5.4.
    Example:
      >>> import jax.numpy as jnp, jaxdyn, orbits
      >>> def rate(t, y):  # a cycle of radius 1, and a cubic loss beside it
      ...     r = y[0] ** 2 + y[1] ** 2
      ...     return [y[0] * (1 - r) - y[1], y[1] * (1 - r) + y[0], -y[2] ** 3]
      >>> orbit = orbits.find(jaxdyn.ode(rate, [1.0, 0.0, 0.0], 6.28), hold="y2")
      >>> orbits.criticality(orbit, "branch point").verdict
      'supercritical'
    """
    check_on_host("point", point, "Normal forms are computed on the host.")
    orbit = point if isinstance(point, Orbit) else smooth_orbit("point", point.orbit)
    kind = point.kind if kind is None and isinstance(point, Member) else kind
    if kind not in _FORMS:
        remedy = "Choose one of family.special, or give kind=."
        expected = "a fold, branch point, period doubling or torus point"
        raise fail("kind", expected, kind or "an ordinary orbit", remedy)
    kind = Kind(kind)
    _check(orbit)
    moving = is_driven(orbit.scene)
    # The start of a member may be rounding, as that of a rest state in a driven scene.
    entry_sizes = point.point.sizes if isinstance(point, Member) else sizes(orbit.scene)
    rtol = orbit.rtol
    axes = basis(orbit, moving, entry_sizes)
    fine, coarse = (
        _form(kind, _Map(orbit, axes, entry_sizes, moving, tolerance))
        for tolerance in (rtol, coarser(rtol))
    )
    bars = [abs(a - b) + 1e-12 * abs(a) for a, b in zip(fine[:2], coarse[:2], strict=True)]
    return _judge(kind, fine, bars)


@dataclasses.dataclass(frozen=True)
class _Map:
    """The return map of an orbit: its series along curves, and its derivative.

    Attributes:
      orbit: an orbit that returns after its period.
      axes: (k, d) the `basis` of starts.
      entry_sizes: (k,) the sizes in which it is orthonormal.
      driven: whether the rate depends on time.
      rtol: tolerance of the integrations.
    """

    orbit: Orbit
    axes: np.ndarray
    entry_sizes: np.ndarray
    driven: bool
    rtol: float

    def along(self, u1: np.ndarray, u2: np.ndarray) -> np.ndarray:
        """(3, d) coefficients of e, e^2, e^3 of the return of the starts e u1 + e^2 u2."""
        orbit, axes, y0 = self.orbit, self.axes, np.asarray(self.orbit.y0)
        curve = jnp.asarray(np.stack([y0, axes @ u1, axes @ u2, np.zeros(len(y0))]))
        end = _carry(orbit.scene, curve, jnp.asarray(orbit.period), self.rtol)
        if not self.driven:
            # The constant term is the start up to the closing error, which would shift the plane.
            known = end.at[0].set(jnp.asarray(y0))
            end = _return_curve(orbit.scene, known, jnp.asarray(self.entry_sizes))
        return np.asarray(end[1:]) / self.entry_sizes @ (axes / self.entry_sizes[:, None])

    def derivative(self) -> np.ndarray:
        """(d, d) the derivative of the return map."""
        eye = np.eye(self.axes.shape[1])
        return np.stack([self.along(u, 0 * u)[0] for u in eye], axis=1)

    def length(self, q: np.ndarray) -> float:
        """The length of a vector with coordinates q (d,) in the state itself, not in sizes."""
        return float(np.linalg.norm(self.axes @ q))

    def critical(self, wanted=None) -> "_Critical":
        """The derivative, the critical multiplier, and its vectors."""
        a = self.derivative()
        values, vectors = np.linalg.eig(a)
        if wanted is None:
            off = np.where(values.imag > 0, np.abs(np.abs(values) - 1), np.inf)
        else:
            off = np.abs(values - wanted)
        i = int(np.argmin(off))
        if not off[i] <= _CRITICAL:
            expected = "on the unit circle" if wanted is None else f"of {wanted}"
            got = ", ".join(f"{z:.6g}" for z in values)
            raise fail("point", f"an orbit with a critical multiplier {expected}", got)
        q = vectors[:, i] / np.linalg.norm(vectors[:, i])
        if (np.abs(values - values[i]) <= _CRITICAL).sum() > 1:
            return _Critical(a, values[i], q, np.full(len(q), np.nan))
        p = np.linalg.inv(vectors)[i]
        p = p / (p @ q)
        if wanted is None:
            return _Critical(a, values[i], q, p)
        q, p = q.real / np.linalg.norm(q.real), p.real
        return _Critical(a, values[i], q, p / (p @ q))


class _Critical(NamedTuple):
    """A (d, d), the critical multiplier, q (d,), and p (d,), NaN where it is a double one."""

    a: np.ndarray
    value: complex
    q: np.ndarray
    p: np.ndarray


class _Form(NamedTuple):
    """The coefficient that decides, the quadratic one, |q|, and what makes it undefined, if so."""

    coefficient: float
    quadratic: float
    length: float
    obstacle: str = ""


def _fold(returns: _Map, critical: _Critical) -> _Form:
    _, _, q, p = critical
    quadratic = float(p @ returns.along(q, 0 * q)[1])
    return _Form(quadratic, quadratic, returns.length(q))


def _branch(returns: _Map, critical: _Critical) -> _Form:
    a, _, q, p = critical
    second = returns.along(q, 0 * q)[1]
    h = solve_bordered(np.eye(len(a)) - a, q, p, 2 * (second - (p @ second) * q))
    return _Form(float(p @ returns.along(q, h / 2)[2]), float(p @ second), returns.length(q))


def _doubling(returns: _Map, critical: _Critical) -> _Form:
    a, _, q, p = critical
    h = np.linalg.solve(np.eye(len(a)) - a, 2 * returns.along(q, 0 * q)[1])
    return _Form(float(p @ returns.along(q, h / 2)[2]), np.nan, returns.length(q))


def _torus(returns: _Map, critical: _Critical) -> _Form:
    a, value, q, p = critical
    turn, eye = value / abs(value), np.eye(len(a))
    turns = np.exp(2j * np.pi * np.arange(_PHASES) / _PHASES)
    seconds = np.stack([returns.along(2 * (z * q).real, 0 * q.real)[1] for z in turns])
    mixed = np.linalg.solve(eye - a, seconds.mean(axis=0))
    double = np.linalg.solve(turn**2 * eye - a, 2 * (turns**-2 @ seconds) / _PHASES)
    thirds = np.stack(
        [returns.along(2 * (z * q).real, (z * z * double).real + mixed)[2] for z in turns]
    )
    cubic = p @ (turns**-1 @ thirds) / _PHASES
    resonant = min(abs(turn**3 - 1), abs(turn**4 - 1)) <= _RESONANT
    obstacle = "resonance" if resonant else ""
    return _Form(float((cubic / turn).real), np.nan, returns.length(q), obstacle)


def _form(kind: Kind, returns: _Map) -> _Form:
    """The coefficients of a kind of bifurcation; NaN where its multiplier is a double one."""
    critical = returns.critical(_VALUES.get(kind))
    if np.isnan(critical.p).any():
        return _Form(np.nan, np.nan, returns.length(critical.q), "double")
    return _FORMS[kind](returns, critical)


_FORMS = {Kind.FOLD: _fold, Kind.BRANCH: _branch, Kind.DOUBLING: _doubling, Kind.TORUS: _torus}
#: The critical multiplier of each kind; at a torus point it is any on the unit circle.
_VALUES = {Kind.FOLD: 1.0, Kind.BRANCH: 1.0, Kind.DOUBLING: -1.0}
#: The sign of the coefficient of a supercritical bifurcation.
_SIGNS = {Kind.BRANCH: -1.0, Kind.DOUBLING: 1.0, Kind.TORUS: -1.0}


def _judge(kind: Kind, fine: _Form, bars: list[float]) -> Criticality:
    coefficient, quadratic, length, obstacle = fine
    bar, other = bars
    if obstacle:
        verdict, meaning = "undecided", obstacle
    elif kind == Kind.BRANCH and abs(quadratic) > other + _CRITICAL * abs(coefficient):
        verdict = meaning = "transcritical"
    elif not abs(coefficient) > bar:
        verdict = meaning = "undecided"
    elif kind == Kind.FOLD:
        verdict = meaning = "fold"
    else:
        is_super = coefficient * _SIGNS[kind] > 0
        verdict = meaning = "supercritical" if is_super else "subcritical"
    unit = length if kind == Kind.FOLD else length**2
    return Criticality(
        kind, coefficient / unit, bar / unit, quadratic / length, verdict, _MEANING[meaning]
    )


def _check(orbit: Orbit) -> None:
    if not orbit.ok:
        raise fail("point", "a periodic orbit", orbit.outcome.name, orbit.message)
    if orbit.closing.turns:
        remedy = "Write the scene in a frame that rotates with the orbit."
        raise fail("point", "an orbit that closes without a rotation", "a relative one", remedy)
    refuse_constraints("point", orbit.scene)
    known = stability(dataclasses.replace(orbit, closing=PLAIN), throw=False)
    if known.integrals:
        remedy = "Its bifurcations are those of conservative scenes; add a little damping."
        raise fail("point", "a scene without a first integral", ", ".join(known.reasons), remedy)
