"""The directions in which an orbit's multipliers are 1 by integrals and symmetries.

An integral I with gradient w satisfies w M = w, a symmetry with generator g satisfies M g = g.
Candidates come from the scene (`analysis.energy.integrals`, translations, rotations) and from the
flow, and are confirmed in two ways: by these equations on the monodromy matrix M itself, and by the
vector field f at points off the orbit, where w f = 0 and g commutes with f. (Where M is the unit
matrix, as for an oscillator, the first test alone would confirm every candidate.)

All norms are those of states in units of their sizes along the motion.

In the axes that turn with a relative orbit M turns the momenta into each other, and so the
translations: they are confirmed together, and have the multipliers exp(+-i angle).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.analysis.energy import integrals

#: Relative error to which M must preserve a candidate that is confirmed.
CONFIRMED = 1e-7
#: The same for the vector field, off the orbit: rounding only, as nothing is integrated.
_EXACT = 1e-12
#: Singular values of a set of directions below this share of the largest are rounding.
RANK = 1e-7
#: Distances of the points off the orbit, relative to each entry of the start. The nearer ones are
#: for scenes that are not defined everywhere (negative populations): points with NaN are ignored.
_DISTANCES_OFF = 0.1, 0.01, 0.001
#: Of the sizes along the motion: the least size that an entry of the start counts as.
_LEAST_ENTRY = 0.01


class _Local(NamedTuple):
    """Candidates and the vector field f at one state, with derivatives.

    Attributes:
      rate: (k,) f.
      still: (k,) f minus its value at time 0.
      slope: (k, k) derivative of f by the state.
      gradients: (..., k) derivatives of each candidate for an integral by the state.
      changes: (...) its rate of change along f.
      moves: (k,) each candidate for a symmetry.
      shears: (k,) its rate of change along f.
    """

    rate: Array
    still: Array
    slope: Array
    gradients: dict[str, Array]
    changes: dict[str, Array]
    moves: dict[str, Array]
    shears: dict[str, Array]


def kernel(
    scene: Scene, m: np.ndarray, doubt: float, basis: np.ndarray, each: np.ndarray
) -> tuple[np.ndarray, list[str], np.ndarray]:
    """Orthonormal basis (d, n) of the kernel of the confirmed integrals' gradients; their names.

    The map m (d, d), in a basis of states in sizes `each` (k,), has an error of norm `doubt`,
    about. Last the multipliers of those that are confirmed together.
    """
    y0 = np.asarray(scene.y0)
    leaks = _largest(_leaks, _nearby(scene, each), each)
    gradients, names, others = [np.zeros(len(m))], [], []
    for name, several in _at(scene, 0.0, y0).gradients.items():
        leak = leaks[name].reshape(-1)
        for i, row in enumerate((several.reshape(-1, len(y0)) * each) @ basis):
            if leak[i] < _EXACT and _kept(row @ m - row, row, m, doubt):
                gradients.append(row / np.linalg.norm(row))
                names.append(name if several.ndim == 1 else f"{name} {'xyz'[i]}")
            elif leak[i] < _EXACT:
                others.append(row / np.linalg.norm(row))
    together, multipliers = _kept_together(others, m, doubt)
    _, s, vt = np.linalg.svd(np.array([*gradients, *together]))
    return vt[_rank(s) :].T, names, multipliers


def complement(
    scene: Scene,
    m: np.ndarray,
    doubt: float,
    kernel: np.ndarray,
    basis: np.ndarray,
    each: np.ndarray,
    along: np.ndarray,
) -> tuple[np.ndarray, list[str], np.ndarray]:
    """Orthonormal basis (d, p) of the kernel without the confirmed symmetries; their names.

    So are directions (k, n) along a family confirmed, which M changes by a multiple of symmetries.
    Last the multipliers of those that are confirmed together. For the others see `kernel`.
    """
    inside, names, others = [np.zeros(len(m))], [], []
    for name, g in symmetries(scene, each).items():
        g = basis.T @ (g / each)
        if _kept(m @ g - g, g, m, doubt):
            inside.append(g / np.linalg.norm(g))
            names.append(name)
        elif np.linalg.norm(g) > 0:
            others.append(g / np.linalg.norm(g))
    symmetric = np.linalg.pinv(np.array(inside), RANK) @ np.array(inside)
    for v in (basis.T @ (along / each[:, None])).T:
        change = m @ v - v
        if _kept(change - symmetric @ change, v, m, doubt):
            inside.append(v / np.linalg.norm(v))
            names.append("family")
    together, multipliers = _kept_together(others, m.T, doubt)
    # A symmetry may change an integral (a rotation changes a non-zero momentum): only the
    # combinations that are tangent to the level set count.
    g = np.array([*inside, *together]).T
    off = g - kernel @ (kernel.T @ g)
    _, s, vt = np.linalg.svd(off)
    tangent = g @ vt[int((s > RANK).sum()) :].T
    u, s, _ = np.linalg.svd(kernel.T @ tangent)
    return kernel @ u[:, _rank(s) :], names, multipliers


def symmetries(scene: Scene, each: np.ndarray) -> dict[str, Any]:
    """Directions (k,) at the scene's start that commute with the vector field, the flow's first.

    They are tested on the vector field alone. If it depends on time, the flow is not among them.
    """
    y0 = np.asarray(scene.y0)
    here, leaks = _at(scene, 0.0, y0), _largest(_commutators, _nearby(scene, each), each)
    candidates = {"flow": here.rate, **here.moves}
    return {name: g for name, g in candidates.items() if leaks[name] < _EXACT}


def _kept(change: np.ndarray, direction: np.ndarray, m: np.ndarray, doubt: float) -> bool:
    size = np.linalg.norm(direction)
    most = max(CONFIRMED * float(np.linalg.norm(m)), doubt)
    return bool(size > 0 and np.linalg.norm(change) < most * size)


def _kept_together(
    rows: list[np.ndarray], m: np.ndarray, doubt: float
) -> tuple[list[np.ndarray], np.ndarray]:
    """The unit rows and their multipliers if m from the right keeps their span; else none."""
    if len(rows) > 1:
        a = np.array(rows)
        block = a @ m @ np.linalg.pinv(a, RANK)
        if all(_kept(off, row, m, doubt) for off, row in zip(a @ m - block @ a, a, strict=True)):
            return rows, np.linalg.eigvals(block)
    return [], np.zeros(0)


def _rank(s: np.ndarray) -> int:
    return int((s > RANK * s.max(initial=0.0)).sum())


def _nearby(scene: Scene, each: np.ndarray) -> list[_Local]:
    """The candidates at a few times and states in general position near the start."""
    random, y0 = np.random.default_rng(0), np.asarray(scene.y0)
    size = np.maximum(np.abs(y0), _LEAST_ENTRY * each)
    count = len(_DISTANCES_OFF)
    noise = np.outer(_DISTANCES_OFF, size) * random.standard_normal((count, len(y0)))
    ts = random.uniform(0.0, float(scene.t1), count)
    return [_at(scene, t, y) for t, y in zip(ts, y0 + noise, strict=True)]


def _conserved(scene: Scene, t, y: Array) -> dict[str, Array]:
    """Candidates for integrals: energy, momenta, and the momentum conjugate to each coordinate."""
    found = integrals(scene, t, y)
    canonical = scene.system.canonical(t, y)
    if canonical is not None:
        labels, n = scene.system.labels(), len(y) // 2
        found |= {f"momentum of {labels[i][0]}": canonical[n + i] for i in range(n)}
    return found


def directions(scene: Scene, y: Array) -> dict[str, Array]:
    """Candidates for symmetries: those of space, and a shift of each entry of the state."""
    shifts = jnp.eye(len(y))
    names = (name for name, _ in scene.system.labels())
    candidates = {f"shift of {name}": shifts[i] for i, name in enumerate(names)}
    return candidates | scene.system.generators(y)


@jax.jit
def _local(scene: Scene, t, y: Array) -> _Local:
    """The candidates at the state nearest to y that satisfies the constraints.

    One small program for all points: the norms and ratios are left to NumPy.
    """
    y = scene.system.project(t, y)
    f, slope = scene.rate(t, y), jax.jacfwd(scene.rate, argnums=1)(t, y)
    slopes = jax.jacfwd(lambda *at: _conserved(scene, *at), argnums=(0, 1))(t, y)
    moves, shears = jax.jvp(lambda y: directions(scene, y), (y,), (f,))
    return _Local(
        rate=f,
        still=f - scene.rate(jnp.zeros(()), y),
        slope=slope,
        gradients={name: by_y for name, (_, by_y) in slopes.items()},
        changes={name: by_t + by_y @ f for name, (by_t, by_y) in slopes.items()},
        moves=moves,
        shears=shears,
    )


def _at(scene: Scene, t, y: np.ndarray) -> _Local:
    """`_local` on the host."""
    return jax.tree.map(np.asarray, _local(scene, np.asarray(t, float), y))


def _leaks(at: _Local, each: np.ndarray) -> dict[str, np.ndarray]:
    """(...) rate of change of each integral over gradient times f: 0 if conserved, at most 1."""
    size = np.linalg.norm(at.rate / each)
    return {
        name: np.abs(at.changes[name]) / (np.linalg.norm(rows * each, axis=-1) * size)
        for name, rows in at.gradients.items()
    }


def _commutators(at: _Local, each: np.ndarray) -> dict[str, Any]:
    """() commutator of each direction with f over the size of its two terms; 0 for a symmetry."""
    slope, found = np.linalg.norm(at.slope * each / each[:, None]), {}
    for name, g in at.moves.items():
        shear = at.shears[name]
        size = np.linalg.norm(shear / each) + slope * np.linalg.norm(g / each)
        found[name] = np.linalg.norm((shear - at.slope @ g) / each) / size
    still = np.linalg.norm(at.still / each) / np.linalg.norm(at.rate / each)
    return {"flow": still, **found}


def _largest(measure: Callable, nearby: list[_Local], each: np.ndarray) -> dict[str, np.ndarray]:
    """The largest of each measure over several points, without those where it is NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        found = [measure(at, each) for at in nearby]
    return {name: np.fmax.reduce([leaks[name] for leaks in found]) for name in found[0]}
