"""The directions in which an orbit's multipliers are 1 by integrals and symmetries.

An integral I with gradient w satisfies w M = w, a symmetry with generator g satisfies M g = g.
Candidates come from the scene (`analysis.energy.integrals`, translations, rotations) and from the
flow, and are confirmed in two ways: by these equations on the monodromy matrix M itself, and by the
vector field f at points off the orbit, where w f = 0 and g commutes with f. (Where M is the unit
matrix, as for an oscillator, the first test alone would confirm every candidate.)
"""

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
#: Of the largest entry of the start: the least size that an entry counts as.
_LEAST_ENTRY = 0.01


def kernel(
    scene: Scene, y0: np.ndarray, m: np.ndarray, basis: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Orthonormal basis (d, n) of the kernel of the confirmed integrals' gradients; their names."""
    rows, leaks = _integrals(scene, jnp.asarray(y0), _nearby(scene, y0))
    gradients, names = [np.zeros(len(m))], []
    for name, several in rows.items():
        leak = np.asarray(leaks[name]).reshape(-1)
        for i, row in enumerate(np.asarray(several).reshape(-1, len(y0)) @ basis):
            if leak[i] < _EXACT and _kept(row @ m - row, row, m):
                gradients.append(row / np.linalg.norm(row))
                names.append(name if several.ndim == 1 else f"{name} {'xyz'[i]}")
    _, s, vt = np.linalg.svd(np.array(gradients))
    return vt[_rank(s) :].T, names


def complement(
    scene: Scene, m: np.ndarray, kernel: np.ndarray, basis: np.ndarray, along: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Orthonormal basis (d, p) of the kernel without the confirmed symmetries; their names.

    So are directions (k, n) along a family confirmed, which M changes by a multiple of symmetries.
    """
    inside, names = [np.zeros(len(m))], []
    for name, g in symmetries(scene).items():
        g = basis.T @ g
        if _kept(m @ g - g, g, m):
            inside.append(g / np.linalg.norm(g))
            names.append(name)
    symmetric = np.linalg.pinv(np.array(inside), RANK) @ np.array(inside)
    for v in (basis.T @ along).T:
        change = m @ v - v
        if _kept(change - symmetric @ change, v, m):
            inside.append(v / np.linalg.norm(v))
            names.append("family")
    # A symmetry may change an integral (a rotation changes a non-zero momentum): only the
    # combinations that are tangent to the level set count.
    g = np.array(inside).T
    off = g - kernel @ (kernel.T @ g)
    _, s, vt = np.linalg.svd(off)
    tangent = g @ vt[int((s > RANK).sum()) :].T
    u, s, _ = np.linalg.svd(kernel.T @ tangent)
    return kernel @ u[:, _rank(s) :], names


def symmetries(scene: Scene) -> dict[str, np.ndarray]:
    """Directions (k,) at the scene's start that commute with the vector field, the flow's first.

    They are tested on the vector field alone. If it depends on time, the flow is not among them.
    """
    candidates, leaks = _symmetries(scene, scene.y0, _nearby(scene, np.asarray(scene.y0)))
    return {
        name: np.asarray(candidates[name]) for name in ("flow", *candidates) if leaks[name] < _EXACT
    }


def _kept(change: np.ndarray, direction: np.ndarray, m: np.ndarray) -> bool:
    size = np.linalg.norm(direction)
    return bool(size > 0 and np.linalg.norm(change) < CONFIRMED * np.linalg.norm(m) * size)


def _rank(s: np.ndarray) -> int:
    return int((s > RANK * s.max(initial=0.0)).sum())


def _nearby(scene: Scene, y0: np.ndarray) -> tuple[Array, Array]:
    """Times (p,) and states (p, k) in general position near the start."""
    random = np.random.default_rng(0)
    size = np.maximum(np.abs(y0), _LEAST_ENTRY * np.abs(y0).max(initial=0.0))
    count = len(_DISTANCES_OFF)
    noise = np.outer(_DISTANCES_OFF, size) * random.standard_normal((count, len(y0)))
    ts = jnp.asarray(random.uniform(0.0, float(scene.t1), count))
    return ts, jax.vmap(scene.system.project)(ts, jnp.asarray(y0 + noise))


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
def _integrals(scene: Scene, y0: Array, nearby: tuple[Array, Array]):
    """Gradients of the candidates for integrals at the start, and their rates of change nearby.

    The rates are relative to gradient times vector field: 0 for an integral, at most 1.
    """

    def leak(t, y):
        f = scene.rate(t, y)
        _, change = jax.jvp(lambda *at: _conserved(scene, *at), (t, y), (jnp.ones(()), f))
        rows = jax.jacfwd(lambda y: _conserved(scene, t, y))(y)
        size = {name: jnp.linalg.norm(row, axis=-1) for name, row in rows.items()}
        return jax.tree.map(lambda c, s: jnp.abs(c) / (s * jnp.linalg.norm(f)), change, size)

    rows = jax.jacfwd(lambda y: _conserved(scene, jnp.zeros(()), y))(y0)
    return rows, _largest(jax.vmap(leak)(*nearby))


@jax.jit
def _symmetries(scene: Scene, y0: Array, nearby: tuple[Array, Array]):
    """Candidates for directions of symmetry at the start, and their commutators nearby.

    The commutators with the vector field are relative to the sizes of their two terms.
    """

    def leak(t, y):
        f, slope = scene.rate(t, y), jax.jacfwd(scene.rate, argnums=1)(t, y)
        moves, change = jax.jvp(lambda y: directions(scene, y), (y,), (f,))
        found = {
            name: jnp.linalg.norm(change[name] - slope @ g)
            / (jnp.linalg.norm(change[name]) + jnp.linalg.norm(slope) * jnp.linalg.norm(g))
            for name, g in moves.items()
        }
        still = jnp.linalg.norm(f - scene.rate(jnp.zeros(()), y)) / jnp.linalg.norm(f)
        return {"flow": still, **found}

    flow = {"flow": scene.rate(jnp.zeros(()), y0)}
    return flow | directions(scene, y0), _largest(jax.vmap(leak)(*nearby))


def _largest(leaks):
    return jax.tree.map(lambda leak: jnp.nanmax(leak, axis=0), leaks)
