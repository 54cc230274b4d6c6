"""Stability of steady motions: precession, rolling round a circle, relative equilibria.

A motion is steady if it follows a symmetry of the scene: y(t) = exp(t xi) y(0), as a shift of
angles or places does, or a turn about an axis. In a frame that moves along, it is at rest, and
near it

    dx/dt = B x,    B = Df(y) - Dxi(y),    xi(y) = f(y).

The symmetries are found automatically: all fields xi(y) = c + M y with Df xi = M f at states near
y, tangent to the constraints. Displacements along a symmetry lead to the same motion elsewhere;
those that B maps to 0, up to a symmetry, to another steady motion nearby. Neither concerns
stability, and both are left out: the remaining eigenvalues are those in reduced coordinates.

Reference: Marsden (1992), Lectures on Mechanics, chapters 4 and 5; Neimark, Fufaev (1972),
Dynamics of Nonholonomic Systems, chapter 6.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.analysis.eigenvalues import with_bars
from jaxdyn.analysis.linearize import Linearization, classify
from jaxdyn.analysis.scales_at_rest import at_rest
from jaxdyn.scales import groups
from jaxdyn.scene import Field, Scene, check_scene

_MAX_ENTRIES = 40  # entries of a state: the symmetries have its square as unknowns
# Distance of the samples, relative to the size of the state. Near the state some fields are
# symmetries up to the square of the distance: for a top in quaternions the equations distinguish
# them by 5e-5 of their size, and its frequencies lose four digits (1e-11). At a distance of 1.0 it
# is 2e-4, and 6e-13, but there an upright disk, whose verdict is open, counts as stable [measured].
_SAMPLE_DISTANCE = 0.3
_MAX_SYMMETRY_DEFECT = 1e-10  # relative: residual of Df xi - M f at the samples, for a symmetry
_MAX_RATE_LEFT = 1e-8  # relative: part of the rate of a steady motion outside the symmetries
_MAX_GROWTH = 1e-6  # relative to Df: largest real part of eigenvalues of a norm-preserving symmetry
_RANK_TOLERANCE = 1e-8  # relative: largest singular value of a direction to another steady motion


@dataclasses.dataclass(frozen=True)
class SteadyMotion:
    """The linearised motions near a steady motion.

    Attributes:
      reduced: eigenvalues, error bars and verdict, in reduced coordinates: without
        displacements to the same motion elsewhere or to a steady one nearby. "stable" refers to
        the family of steady motions: perturbed motions return to one of them.
      symmetries: number of directions that lead to the same motion elsewhere.
      family: number of directions that lead to other steady motions nearby.
    """

    reduced: Linearization
    symmetries: int
    family: int

    @_text.never_raising
    def __repr__(self) -> str:
        found = self.reduced
        rows = [
            ("eigenvalues", with_bars(found.eigenvalues, found.bars)),
            ("symmetries", str(self.symmetries)),
            ("family", str(self.family)),
        ]
        return _text.table(f"Steady motion: {found.verdict}, {found.portrait}", rows)

    _repr_html_ = _text.html

    @property
    def frequencies(self) -> np.ndarray:
        """Angular frequencies [rad/s] of the oscillations about it, ascending."""
        im = np.imag(self.reduced.eigenvalues)
        return np.sort(im[im > self.reduced.bars])


@check_first
def linearize_steady(scene: Scene, y=None, t=0.0) -> SteadyMotion:
    """Eigenvalues of the motions near a steady motion, and the verdict; host only.

    Args:
      scene: an autonomous scene, with symmetries that are affine in its state: cyclic angles, turns
        of vectors, quaternions and matrices, shifts.
      y: (k,) state on the steady motion; the scene's start by default.
      t: () time [s] at which a non-autonomous scene is frozen.
    Raises:
      ValueError: the motion through y is not steady, or all nearby motions are steady.
    Limits: a conservative motion is "undecided" unless it is unstable: linearisation can find
      at most a "centre". Where the steady motion is a turn about either of two axes, as for an
      upright top, imaginary parts are those in one of the two frames. Symmetries of Euler angles
      are shifts only, "ZXZ" for precession about z; they are known to rounding. Those of
      quaternions and matrices are less accurate, since the rate may hardly distinguish them from
      other fields: for a fast top by 5e-5, so that its frequencies have relative errors of 1e-11,
      which the error bars cover, where Euler angles give 1e-14.
    Example:
      >>> from jaxdyn.scenes.bodies import top
      >>> fast, slow = (top(0.0, spin=spin, sequence="XYZ", representation="euler")
      ...               for spin in (200.0, 50.0))
      >>> linearize_steady(fast).reduced.portrait, linearize_steady(slow).reduced.verdict
      ('centre', 'unstable')
    """
    start = check_scene(scene).y0
    y = _checks.array("y", start if y is None else y, start.shape)
    t = _checks.array("t", t, ())
    if len(y) > _MAX_ENTRIES:
        raise _checks.fail("y", f"at most {_MAX_ENTRIES} entries", len(y))
    size = at_rest(scene.field, groups(scene.system), np.asarray(y), float(t)).sizes
    f, a, tangent = (np.asarray(x) for x in _linearization(scene.field, t, y, size))
    _checks.finite("rate", jnp.asarray([f.sum(), a.sum()]), "The rate has no derivative there.")
    tangent = _range(tangent)
    # They are found twice, with different samples: the difference estimates the error.
    frames = [_frame(scene.field, t, y, size, (f, a), seed) for seed in (1, 2)]
    (generator, directions), (other, _) = frames
    inside, b = tangent.T @ (a - generator) @ tangent, tangent.T @ directions
    error = np.linalg.norm(tangent.T @ (generator - other) @ tangent, 2)
    same = _range(b)
    beside = _complement(same)
    b = beside.T @ inside @ beside
    family = _kernel(b, _RANK_TOLERANCE)
    rest = _complement(family)
    if not rest.shape[1]:
        raise _checks.fail("y", "a steady motion with others nearby", "none")
    reduced = classify(rest.T @ b @ rest, error)
    return SteadyMotion(reduced, same.shape[1], family.shape[1])


@eqx.filter_jit
def _linearization(field: Field, t: Array, y: Array, size: Array) -> tuple[Array, Array, Array]:
    """(k,) rate, (k, k) its derivative and (k, k) projector along constraints, scaled by `size`."""

    def scaled(fn):
        return lambda z: fn(t, y + size * z) / size

    z = jnp.zeros_like(y)
    rate, onto = scaled(field.rate), scaled(field.project)
    return rate(z), jax.jacfwd(rate)(z), jax.jacfwd(onto)(z)


@eqx.filter_jit
def _linearizations(field: Field, t: Array, y: Array, size: Array, zs: Array) -> tuple[Array, ...]:
    """The `_linearization` at states (s, k) on the constraints near y + size z, and their z."""

    def sample(z):
        at = field.project(t, field.project(t, y + size * z))
        return (at - y) / size, *_linearization(field, t, at, size)

    return jax.vmap(sample)(zs)


def _frame(field: Field, t: Array, y: Array, size: Array, now: tuple, seed: int) -> tuple:
    """(k, k) derivative of the symmetry that the motion follows, and (k, g) directions of all."""
    f, a = now
    c, m = _symmetries(field, t, y, size, seed)
    weights = np.linalg.lstsq(c.T, f, rcond=_MAX_SYMMETRY_DEFECT)[0]
    left = np.abs(f - c.T @ weights).max()
    generator = np.tensordot(weights, m, axes=1)
    grows = np.abs(np.linalg.eigvals(generator).real).max() > _MAX_GROWTH * np.abs(a).max()
    if left > _MAX_RATE_LEFT * np.abs(f).max() or grows:
        share = left / np.abs(f).max()
        raise _checks.fail(
            "y",
            "a state on a steady motion",
            "one that grows" if grows else f"a rate off the symmetries by {share:.2g}",
            "See `precession.top_roots` and `precession.rolling_disk_circle`; of Euler angles only "
            "shifts are symmetries, of quaternions all turns.",
        )
    return generator, c.T


def _symmetries(field: Field, t: Array, y: Array, size: Array, seed: int):
    """(g, k) values c at y and (g, k, k) derivatives M of the symmetries, in units of sizes."""
    k = len(y)
    zs = _SAMPLE_DISTANCE * np.random.default_rng(seed).uniform(-1, 1, size=(2 * (k + 2), k))
    z, f, a, tangent = (np.asarray(x) for x in _linearizations(field, t, y, size, jnp.asarray(zs)))
    off = np.eye(k) - tangent
    # Rows of M f - Df (c + M z) = 0 and of (1 - P) (c + M z) = 0 for the unknowns c and M.
    moved = np.einsum("ip,sj->sipj", np.eye(k), f) - np.einsum("sip,sj->sipj", a, z)
    bound = np.einsum("sip,sj->sipj", off, z)
    parts = (-a, moved), (off, bound)
    rows = [np.concatenate([x, w.reshape(len(z), k, -1)], axis=2) for x, w in parts]
    rows = np.concatenate(rows).reshape(-1, k + k * k)
    rows = rows[np.isfinite(rows).all(axis=1)]
    largest = np.abs(rows).max(axis=1, keepdims=True)
    found = _kernel(
        rows / np.where(largest > _MAX_SYMMETRY_DEFECT, largest, 1.0), _MAX_SYMMETRY_DEFECT
    ).T
    return found[:, :k], found[:, k:].reshape(-1, k, k)


def _kernel(a: np.ndarray, part: float) -> np.ndarray:
    """(n, g) orthonormal columns that a matrix (m, n) maps to a small part of its norm."""
    _, s, vt = np.linalg.svd(a)
    s = np.append(s, np.zeros(a.shape[1] - len(s)))
    return vt[s <= part * s.max(initial=0.0)].T


def _range(a: np.ndarray) -> np.ndarray:
    """(n, r) orthonormal columns that span those of a projector, or of symmetries."""
    u, s, _ = np.linalg.svd(a)
    return u[:, : int(np.sum(s > _RANK_TOLERANCE * s.max(initial=0.0)))]


def _complement(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns orthogonal to given ones."""
    return np.linalg.svd(columns, full_matrices=True)[0][:, columns.shape[1] :]
