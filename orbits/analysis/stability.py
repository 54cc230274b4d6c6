"""Floquet multipliers with error bars, unit multipliers split off, and an honest verdict.

Every integral and every continuous symmetry of a scene forces a multiplier to be exactly 1,
and an autonomous flow has one more along itself. In a conservative scene they come in
defective pairs, so an eigenvalue solver returns them only to the square root of the rounding:
a plain look at |multiplier| > 1 tosses a coin there. We take them out as a block first.

`trivial` finds those directions. M maps the common kernel N of the integrals' gradients to
itself, and the symmetries' generators inside it, G, to themselves; what is left, M on N / G,
has exactly the non-trivial multipliers for eigenvalues, well conditioned unless two of them meet.

Each gets an error bar: the change of M between two tolerances (with its rounding level and the
tolerance itself) times the condition number of the eigenvalue. The verdict is `undecided` where
the bars say so.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, Status
from jaxdyn._checks import untraced
from jaxdyn.integrate.trajectory import explained
from jaxdyn.status import IntegrationError
from orbits.analysis.monodromy import returned, tangents
from orbits.orbit import Orbit
from orbits.shooting import trivial

_COARSER = 100.0  # the second tolerance, as a multiple of the first
_COARSEST = 0.1  # limit of the second tolerance
_SAFETY = 3.0  # error bars are estimates; verdicts keep this factor away


@dataclasses.dataclass(frozen=True)
class Stability:
    """The linear stability of an orbit.

    Attributes:
      multipliers: (d,) all Floquet multipliers: the non-trivial ones, then the unit ones; one
        for each direction on the constraint surface, so d = k where there is none.
      nontrivial: (p,) those not forced to be 1.
      bars: (p,) their error bars.
      unit: how many are 1 because of an integral, a symmetry or the flow.
      reasons: the integrals and symmetries that were confirmed.
      exponents: rotation numbers nu in [0, 1/2] of the non-trivial multipliers
        exp(+-2 pi i nu), one for each pair, None for a real pair.
      verdict: "stable", "unstable" or "undecided".
      symplectic_defect: largest entry of M^T J M - J over |M|^2; None where the system has no
        canonical coordinates.
      determinant_defect: |det M - 1|, the same.
      monodromy: (d, d) the matrix M, in the basis `tangents`.
      status: of the integration over the period; unless it is OK every number is NaN and the
        verdict "undecided".
    """

    multipliers: np.ndarray
    nontrivial: np.ndarray
    bars: np.ndarray
    unit: int
    reasons: tuple[str, ...]
    exponents: tuple[float | None, ...]
    verdict: str
    symplectic_defect: float | None
    determinant_defect: float | None
    monodromy: np.ndarray
    status: Status = Status.OK

    @property
    def ok(self) -> bool:
        """Whether the motion was followed over its period."""
        return self.status == Status.OK

    @property
    def message(self) -> str:
        """How the integration over the period ended and what to try."""
        return self.status.message


def stability(orbit: Orbit, *, rtol: float | None = None, throw: bool = True) -> Stability:
    """The multipliers of an orbit, with error bars and a verdict.

    Args:
      orbit: what `find` returned.
      rtol: tolerance of the variational equations; the orbit's own if left out. A second run
        at a hundred times that gives the error bars.
      throw: raise if the motion cannot be followed over its period at one of the two tolerances
        (a collision, the step limit); with False look at `Stability.status`.
    Raises:
      ValueError: traced values.
      IntegrationError: the motion cannot be followed over its period (``throw=True``).
    Limits: linear stability only. "stable" for a conservative scene means all non-trivial
      multipliers lie on the unit circle and cannot leave it within their bars.
    """
    untraced("stability", orbit, "Differentiate orbits.solution(scene, orbit).multipliers().")
    rtol = orbit.rtol if rtol is None else rtol
    scene, y0 = orbit.scene, np.asarray(orbit.y0)
    basis = tangents(scene, y0)
    m, status = returned(orbit, rtol, basis)
    coarse, coarse_status = returned(orbit, min(_COARSER * rtol, _COARSEST), basis)
    status = max(status, coarse_status)
    if status != Status.OK:
        if throw:
            raise IntegrationError(explained(status, scene))
        return _unknown(len(m), status)
    kernel, reasons = trivial.kernel(scene, y0, m, basis)
    q, generators = trivial.complement(scene, m, kernel, basis)
    reduced = q.T @ m @ q
    error = float(np.linalg.norm(q.T @ (coarse - m) @ q, 2))
    error += float(np.finfo(float).eps * np.linalg.norm(m, 2))
    # Loose tolerances may lead to the same few steps and no difference at all.
    error += rtol * float(np.linalg.norm(reduced))
    nontrivial, bars = _eigenvalues(reduced, error)
    symplectic = _symplectic_defect(scene, y0, m, basis)
    conservative = symplectic is not None and symplectic < trivial.CONFIRMED
    unit = len(m) - len(nontrivial)
    return Stability(
        multipliers=np.concatenate([nontrivial, np.ones(unit)]),
        nontrivial=nontrivial,
        bars=bars,
        unit=unit,
        reasons=(*reasons, *generators),
        exponents=_rotation_numbers(nontrivial, bars),
        verdict=_verdict(nontrivial, bars, conservative),
        symplectic_defect=symplectic,
        determinant_defect=None if symplectic is None else float(abs(np.linalg.det(m) - 1)),
        monodromy=m,
    )


def _unknown(d: int, status: Status) -> Stability:
    """What is known where the motion was not followed over its period: nothing."""
    nothing = np.full(d, np.nan)
    return Stability(
        multipliers=nothing.astype(complex),
        nontrivial=nothing.astype(complex),
        bars=nothing,
        unit=0,
        reasons=(),
        exponents=(),
        verdict="undecided",
        symplectic_defect=None,
        determinant_defect=None,
        monodromy=np.full((d, d), np.nan),
        status=status,
    )


def _eigenvalues(matrix: np.ndarray, error: float) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues, largest first, and how far an error of the matrix of this norm moves them."""
    if not len(matrix):
        return np.zeros(0, complex), np.zeros(0)
    values, right = np.linalg.eig(matrix)
    try:
        left = np.linalg.inv(right)
        condition = np.linalg.norm(left, axis=1) * np.linalg.norm(right, axis=0)
    except np.linalg.LinAlgError:
        condition = np.full(len(values), np.inf)
    # First order in the error, or the square root of it where eigenvalues have met.
    bars = np.minimum(condition * error, np.sqrt(error * np.linalg.norm(matrix, 2)) + error)
    order = np.lexsort((-np.imag(values), -np.round(np.abs(values), 9)))
    return values[order].astype(complex), bars[order]


def _rotation_numbers(values: np.ndarray, bars: np.ndarray) -> tuple[float | None, ...]:
    """One entry a pair (lambda, 1 / lambda) or (lambda, conj lambda)."""
    left = list(range(len(values)))
    numbers: list[float | None] = []
    while left:
        i = left.pop(0)
        is_complex = abs(values[i].imag) > bars[i]
        if is_complex:
            partner = np.conj(values[i])
        else:
            partner = 1 / values[i] if values[i] else values[i]
        if left:
            left.pop(int(np.argmin([abs(values[j] - partner) for j in left])))
        numbers.append(float(abs(np.angle(values[i])) / (2 * np.pi)) if is_complex else None)
    return tuple(sorted(numbers, key=lambda nu: (nu is not None, nu or 0.0)))


def _verdict(values: np.ndarray, bars: np.ndarray, conservative: bool) -> str:
    if (np.abs(values) - 1 > _SAFETY * bars).any():
        return "unstable"
    if not conservative:
        return "stable" if (np.abs(values) - 1 < -_SAFETY * bars).all() else "undecided"
    # In a conservative scene each multiplier off the circle has its mirror 1 / conj(lambda) at
    # the same angle. One that is alone within its bar has none, so it is on the circle.
    for i, value in enumerate(values):
        others = np.abs(np.delete(values, i) - value)
        if (others < _SAFETY * (bars[i] + np.delete(bars, i))).any():
            return "undecided"
        if min(abs(value - 1), abs(value + 1)) < _SAFETY * bars[i]:
            return "undecided"
    return "stable"


def _symplectic_defect(
    scene: Scene, y0: np.ndarray, m: np.ndarray, basis: np.ndarray
) -> float | None:
    system, t, start = scene.system, jnp.zeros(()), jnp.asarray(y0)
    if system.canonical(t, start) is None or len(y0) % 2:
        return None
    c = np.asarray(jax.jacfwd(lambda y: system.canonical(t, y))(start))
    n = len(y0) // 2
    j = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    form = basis.T @ c.T @ j @ c @ basis
    return float(np.abs(m.T @ form @ m - form).max() / max(1.0, np.linalg.norm(m, 2) ** 2))
