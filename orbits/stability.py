"""Floquet multipliers with error bars, unit multipliers split off, and an honest verdict.

Every integral and every continuous symmetry of a scene forces a multiplier to be exactly 1,
and an autonomous flow has one more along itself. In a conservative scene they come in
defective pairs, so an eigenvalue solver returns them only to the square root of the rounding:
a plain look at |multiplier| > 1 tosses a coin there. We take them out as a block first.

An integral I with gradient w has w M = w, a symmetry with generator g has M g = g. Candidates
come from the system (momenta, energy, shifts, turns) and from the flow, and are confirmed in two
ways: by these equations on the monodromy matrix M itself, and by the vector field f at points
off the orbit, where w f = 0 and g commutes with f. (Where M happens to be the unit matrix, as
for an oscillator, the first alone would confirm everything.) M maps the common kernel N of the
gradients to itself, and the generators inside it, G, to themselves; what is left, M on N / G,
has exactly the non-trivial multipliers for eigenvalues, well conditioned unless two of them meet.

Each gets an error bar: the change of M between two tolerances (with its rounding level and the
tolerance itself) times the condition number of the eigenvalue. The verdict is `undecided` where
the bars say so.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.energy import integrals
from jaxdyn.simulate import solve
from orbits.problem import Orbit

#: A candidate integral or symmetry is confirmed if M keeps it to this relative error.
CONFIRMED = 1e-7
_COARSER = 100.0  # the second tolerance, as a multiple of the first
_COARSEST = 0.1  # limit of the second tolerance
_NEARBY = 3, 0.1  # how many points off the orbit, and how far, relative to the start
_RANK = 1e-7  # relative: smaller singular values of a set of directions are rounding
_SAFETY = 3.0  # error bars are estimates; verdicts keep this factor away


@dataclasses.dataclass(frozen=True)
class Stability:
    """The linear stability of an orbit.

    Attributes:
      multipliers: (k,) all Floquet multipliers: the non-trivial ones, then the unit ones.
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
      monodromy: (k, k) the matrix M.
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


def monodromy(scene: Scene, y0=None, period=None, *, rtol: float = 1e-13) -> Array:
    """Derivative (k, k) of the state after one period with respect to the start.

    From the variational equations, with the tangents in the error norm.
    """
    scene = scene if y0 is None else scene.starting(y0)
    return _monodromy(scene, scene.t1 if period is None else period, rtol)


def stability(orbit: Orbit, *, rtol: float | None = None) -> Stability:
    """The multipliers of an orbit, with error bars and a verdict.

    Args:
      orbit: what `find` returned.
      rtol: tolerance of the variational equations; the orbit's own if left out. A second run
        at a hundred times that gives the error bars.
    Raises:
      ValueError: the motion ends (a collision) before the period is over.
    Limits: linear stability only. "stable" for a conservative scene means all non-trivial
      multipliers lie on the unit circle and cannot leave it within their bars.
    """
    rtol = orbit.rtol if rtol is None else rtol
    scene, y0 = orbit.scene, np.asarray(orbit.y0)
    m = np.asarray(monodromy(scene, rtol=rtol))
    coarse = np.asarray(monodromy(scene, rtol=min(_COARSER * rtol, _COARSEST)))
    if not (np.isfinite(m).all() and np.isfinite(coarse).all()):
        raise fail("orbit", "a motion that lasts for its period", "one that does not")
    kernel, reasons = _kernel(scene, y0, m)
    q, generators = _complement(scene, y0, m, kernel)
    reduced = q.T @ m @ q
    error = float(np.linalg.norm(q.T @ (coarse - m) @ q, 2))
    error += float(np.finfo(float).eps * np.linalg.norm(m, 2))
    # Loose tolerances may lead to the same few steps and no difference at all.
    error += rtol * float(np.linalg.norm(reduced))
    nontrivial, bars = _eigenvalues(reduced, error)
    symplectic = _symplectic_defect(scene, y0, m)
    conservative = symplectic is not None and symplectic < CONFIRMED
    unit = len(y0) - len(nontrivial)
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


@jax.jit
def _monodromy(scene: Scene, period, rtol) -> Array:
    return jax.jacfwd(lambda y: solve(scene.starting(y), period, rtol=rtol).y1)(scene.y0)


def _kernel(scene: Scene, y0: np.ndarray, m: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Orthonormal basis (k, n) of the common kernel of the confirmed integrals' gradients."""
    rows, leaks = _integrals(scene, jnp.asarray(y0), _nearby(scene, y0))
    gradients, names = [np.zeros(len(y0))], []
    for name, several in rows.items():
        leak = np.asarray(leaks[name]).reshape(-1)
        for i, row in enumerate(np.asarray(several).reshape(-1, len(y0))):
            if leak[i] < CONFIRMED and _kept(row @ m - row, row, m):
                gradients.append(row / np.linalg.norm(row))
                names.append(name if several.ndim == 1 else f"{name} {'xyz'[i]}")
    _, s, vt = np.linalg.svd(np.array(gradients))
    return vt[_rank(s) :].T, names


def _complement(scene: Scene, y0: np.ndarray, m: np.ndarray, kernel: np.ndarray):
    """Orthonormal basis (k, p) of what is left of the kernel beside the confirmed symmetries."""
    candidates, leaks = _symmetries(scene, jnp.asarray(y0), _nearby(scene, y0))
    inside, names = [np.zeros(len(y0))], []
    for name, g in candidates.items():
        g = np.asarray(g)
        if leaks[name] < CONFIRMED and _kept(m @ g - g, g, m):
            inside.append(g / np.linalg.norm(g))
            names.append(name)
    # A symmetry may change an integral (a turn changes a momentum that is not zero): only the
    # combinations that stay on the level set are directions of it.
    g = np.array(inside).T
    off = g - kernel @ (kernel.T @ g)
    _, s, vt = np.linalg.svd(off)
    tangent = g @ vt[int((s > _RANK).sum()) :].T
    u, s, _ = np.linalg.svd(kernel.T @ tangent)
    return kernel @ u[:, _rank(s) :], names


def _kept(change: np.ndarray, direction: np.ndarray, m: np.ndarray) -> bool:
    size = np.linalg.norm(direction)
    return bool(size > 0 and np.linalg.norm(change) < CONFIRMED * np.linalg.norm(m) * size)


def _rank(s: np.ndarray) -> int:
    return int((s > _RANK * s.max(initial=0.0)).sum())


def _nearby(scene: Scene, y0: np.ndarray) -> tuple[Array, Array]:
    """A few times (p,) and states (p, k) in general position near the start."""
    count, far = _NEARBY
    random = np.random.default_rng(0)
    noise = far * np.abs(y0).max(initial=0.0) * random.standard_normal((count, len(y0)))
    ts = random.uniform(0.0, float(scene.t1), count)
    ts = jnp.asarray(ts)
    return ts, jax.vmap(scene.system.project)(ts, jnp.asarray(y0 + noise))


@jax.jit
def _integrals(scene: Scene, y0: Array, nearby: tuple[Array, Array]):
    """Gradients at the start of the candidates for integrals, and how fast they change nearby.

    The change is relative to gradient times rate: 0 for an integral, up to 1 for anything else.
    """

    def leak(t, y):
        f = scene.rate(t, y)
        _, change = jax.jvp(lambda *at: integrals(scene, *at), (t, y), (jnp.ones(()), f))
        rows = jax.jacrev(lambda y: integrals(scene, t, y))(y)
        size = {name: jnp.linalg.norm(row, axis=-1) for name, row in rows.items()}
        return jax.tree.map(lambda c, s: jnp.abs(c) / (s * jnp.linalg.norm(f)), change, size)

    rows = jax.jacrev(lambda y: integrals(scene, jnp.zeros(()), y))(y0)
    return rows, _largest(jax.vmap(leak)(*nearby))


@jax.jit
def _symmetries(scene: Scene, y0: Array, nearby: tuple[Array, Array]):
    """Candidates for directions of symmetry at the start, and how far they fail to be nearby.

    That is the commutator with the vector field, relative to the sizes of its two terms.
    """

    def leak(t, y):
        f, slope = scene.rate(t, y), jax.jacfwd(scene.rate, argnums=1)(t, y)
        moves, change = jax.jvp(scene.system.generators, (y,), (f,))
        found = {
            name: jnp.linalg.norm(change[name] - slope @ g)
            / (jnp.linalg.norm(change[name]) + jnp.linalg.norm(slope) * jnp.linalg.norm(g))
            for name, g in moves.items()
        }
        still = jnp.linalg.norm(f - scene.rate(jnp.zeros(()), y)) / jnp.linalg.norm(f)
        return {"flow": still, **found}

    flow = {"flow": scene.rate(jnp.zeros(()), y0)}
    return flow | scene.system.generators(y0), _largest(jax.vmap(leak)(*nearby))


def _largest(leaks):
    return jax.tree.map(lambda leak: leak.max(axis=0), leaks)


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


def _symplectic_defect(scene: Scene, y0: np.ndarray, m: np.ndarray) -> float | None:
    system, t, start = scene.system, jnp.zeros(()), jnp.asarray(y0)
    if system.canonical(t, start) is None or len(y0) % 2:
        return None
    c = np.asarray(jax.jacfwd(lambda y: system.canonical(t, y))(start))
    n = len(y0) // 2
    j = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    form = c.T @ j @ c
    return float(np.abs(m.T @ form @ m - form).max() / max(1.0, np.linalg.norm(m, 2) ** 2))
