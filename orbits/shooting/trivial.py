"""The directions in which an orbit's multipliers are forced to be 1.

An integral I with gradient w has w M = w, a symmetry with generator g has M g = g. Candidates
come from the scene (`analysis.energy.integrals`, shifts, turns) and from the flow, and are
confirmed in two ways: by these equations on the monodromy matrix M itself, and by the vector field
f at points off the orbit, where w f = 0 and g commutes with f. (Where M happens to be the unit
matrix, as for an oscillator, the first alone would confirm everything.)
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.analysis.energy import integrals

#: A candidate integral or symmetry is confirmed if M keeps it to this relative error.
CONFIRMED = 1e-7
#: The vector field must keep it to this, off the orbit: rounding, as no integration is in it.
_EXACT = 1e-12
#: Relative: smaller singular values of a set of directions are rounding.
RANK = 1e-7
#: How far points off the orbit are, relative to each entry of the start. The nearer ones are there
#: for scenes that are not defined everywhere (populations below 0): points with NaN are left out.
_NEARBY = 0.1, 0.01, 0.001
_LEAST_ENTRY = 0.01  # of the largest entry: smaller ones, 0 too, are moved as if they had this size


def kernel(
    scene: Scene, y0: np.ndarray, m: np.ndarray, basis: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Orthonormal basis (d, n) of the common kernel of the confirmed integrals' gradients."""
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


def complement(scene: Scene, m: np.ndarray, kernel: np.ndarray, basis: np.ndarray):
    """Orthonormal basis (d, p) of what is left of the kernel beside the confirmed symmetries."""
    inside, names = [np.zeros(len(m))], []
    for name, g in symmetries(scene).items():
        g = basis.T @ g
        if _kept(m @ g - g, g, m):
            inside.append(g / np.linalg.norm(g))
            names.append(name)
    # A symmetry may change an integral (a turn changes a momentum that is not zero): only the
    # combinations that stay on the level set are directions of it.
    g = np.array(inside).T
    off = g - kernel @ (kernel.T @ g)
    _, s, vt = np.linalg.svd(off)
    tangent = g @ vt[int((s > RANK).sum()) :].T
    u, s, _ = np.linalg.svd(kernel.T @ tangent)
    return kernel @ u[:, _rank(s) :], names


def symmetries(scene: Scene) -> dict[str, np.ndarray]:
    """Directions (k,) at the scene's start that commute with the vector field, the flow's first.

    They are only judged by the vector field; a drive that depends on time breaks the flow's.
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
    """A few times (p,) and states (p, k) in general position near the start."""
    random = np.random.default_rng(0)
    size = np.maximum(np.abs(y0), _LEAST_ENTRY * np.abs(y0).max(initial=0.0))
    noise = np.outer(_NEARBY, size) * random.standard_normal((len(_NEARBY), len(y0)))
    ts = jnp.asarray(random.uniform(0.0, float(scene.t1), len(_NEARBY)))
    return ts, jax.vmap(scene.system.project)(ts, jnp.asarray(y0 + noise))


def _conserved(scene: Scene, t, y: Array) -> dict[str, Array]:
    """Candidates for integrals: energy, momenta, and what is conjugate to each coordinate."""
    found = integrals(scene, t, y)
    canonical = scene.system.canonical(t, y)
    if canonical is not None:
        labels, n = scene.system.labels(), len(y) // 2
        found |= {f"momentum of {labels[i][0]}": canonical[n + i] for i in range(n)}
    return found


def directions(scene: Scene, y: Array) -> dict[str, Array]:
    """Candidates for symmetries: those of space about the system, and a shift of each entry."""
    shifts = jnp.eye(len(y))
    names = (name for name, _ in scene.system.labels())
    moved = {f"shift of {name}": shifts[i] for i, name in enumerate(names)}
    return moved | scene.system.generators(y)


@jax.jit
def _integrals(scene: Scene, y0: Array, nearby: tuple[Array, Array]):
    """Gradients at the start of the candidates for integrals, and how fast they change nearby.

    The change is relative to gradient times rate: 0 for an integral, up to 1 for anything else.
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
    """Candidates for directions of symmetry at the start, and how far they fail to be nearby.

    That is the commutator with the vector field, relative to the sizes of its two terms.
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
