"""The monodromy matrix: the linear map of perturbations over one period; symplectic forms."""

import itertools
import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import check_first
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.analysis.eigenvalues import norm
from jaxdyn.integrate.simulation import solve
from jaxdyn.integrate.spans import tolerances
from jaxdyn.scene import Scene, System

#: Default relative tolerance of a step.
RTOL = 1e-13
_COARSER = 100.0  # the second tolerance, as a multiple of the first
_COARSEST = 0.1  # limit of the second tolerance
#: A map whose `symplectic_defect` is below this is that of a conservative scene.
SYMPLECTIC = 1e-7
_STATES = 8  # number of states whose Jacobians determine a form
_MOST_ENTRIES = 16  # largest number of state entries; with 36 a search takes 0.7 s
_SPREAD = 0.3  # spread of the states, in parts of each entry's size
_LEAST_ENTRY = 0.1  # smaller entries, in parts of their size, are spread as if they were this
_NULL = 1e-9  # smaller singular values of the equations for a form, over the slopes, count as 0
_KEPT = 1e-12  # largest change of a form along the flow, relative to its terms, by rounding
_BALANCED = 3  # rounds of balancing of units
_VANISHES = 1e-14  # rows of a form below this part of the largest are rounding
_REGULAR = 1e-3  # least ratio of smallest to largest singular value of a nonsingular form
#: Weights by which independent forms are summed; several, since one sum may be singular.
WEIGHTS = ((1, 1, 1, 1, 1, 1), (1, 2, 3, 5, 7, 11), (3, -1, 2, 7, -5, 1))
_TANGENT = 1e-6  # directions of smaller singular values are those that a projection removes


@check_first
def monodromy(scene: Scene, y0=None, period=None, *, rtol: float = RTOL) -> Array:
    """Derivative (k, k) of the state after one period with respect to the start.

    It follows from the variational equations, with the tangents in the error norm.

    Args:
      scene: system, effects, start.
      y0: (k,) start; the scene's own by default.
      period: () the period [s]; the scene's span by default.
      rtol: relative tolerance of a step.
    Raises:
      ValueError: `rtol` is out of range.
    Example:
      >>> import math
      >>> from jaxdyn import scenes
      >>> from jaxdyn.analysis.monodromy import monodromy
      >>> M = monodromy(scenes.oscillator(k=1.0, m=1.0), period=math.pi)  # half a swing
      >>> [round(float(x), 9) for x in M.diagonal()]
      [-1.0, -1.0]
    """
    scene = scene if y0 is None else scene.starting(y0)
    tolerances(rtol, None)  # checked here, since it cannot be inside jit
    return end_and_derivative(scene, scene.t1 if period is None else period, rtol)[1]


@check_first
@jax.jit
def end_and_derivative(scene: Scene, period, rtol) -> tuple[Array, Array]:
    """(k,) the state after a period and (k, k) its derivative with respect to the start."""
    return value_and_jacfwd(lambda y: solve(scene.starting(y), period, rtol=rtol).y1)(scene.y0)


def coarser(rtol: float) -> float:
    """A second tolerance; the difference of the two runs estimates the error of the first."""
    return min(_COARSER * float(rtol), _COARSEST)


def uncertainty(fine: np.ndarray, coarse: np.ndarray, rtol) -> np.ndarray:
    """(...) estimated norm of the errors of matrices (..., k, k), from runs at `coarser(rtol)`.

    Limits: on nine scenes and at tolerances from 1e-13 to 1e-4 it was 8 to 2000 times the error
      (measured against runs at 3e-15).
    """
    # Two loose tolerances may lead to the same few steps and no difference.
    return norm(coarse - fine) + rtol * np.linalg.norm(fine, axis=(-2, -1))


@check_first
def symplectic_form(scene: Scene, y0: Array) -> Array | None:
    """(k, k) symplectic form that a conservative scene's maps preserve, at its time 0.

    None where there are no canonical coordinates.
    """
    t = np.zeros(())
    if jax.eval_shape(_canonical, scene, t, y0) is None or len(y0) % 2:
        return None
    return _form(scene, t, y0)


def form_change(scene: Scene, t, y: Array, each: np.ndarray) -> float:
    """How fast the `symplectic_form` changes along the flow: 0 for symplectic maps, else up to 1.

    It is the largest entry of its rate on tangents of the constraint surface, in sizes `each` (k,)
    of the entries, over the largest of its terms; NaN where there are no canonical coordinates.
    """
    if symplectic_form(scene, y) is None:
        return math.nan
    slopes, form_rate = map(np.asarray, _form_slopes(scene, t, y))
    basis = each[:, None] * np.linalg.qr(tangents(scene, np.asarray(y)) / each[:, None])[0]
    slopes, form_rate = (basis.T @ x @ basis for x in (slopes, form_rate))
    size = np.abs(slopes).max(initial=0.0) + np.abs(form_rate).max(initial=0.0)
    return float(np.abs(slopes - slopes.T + form_rate).max(initial=0.0) / (size or 1.0))


@jax.jit
def _canonical(scene: Scene, t, y0: Array) -> Array | None:
    return scene.system.canonical(t, y0)


@jax.jit
def _form(scene: Scene, t, y0: Array) -> Array:
    c = jax.jacfwd(_canonical, argnums=2)(scene, t, y0)
    q, p = jnp.split(c, 2)
    return q.T @ p - p.T @ q


@jax.jit
def _form_slopes(scene: Scene, t, y: Array) -> tuple[Array, Array]:
    """(k, k) J Df, and (k, k) the rate of J along the motion."""
    rate = scene.rate(t, y)
    form, form_rate = jax.jvp(lambda *at: _form(scene, *at), (t, y), (jnp.ones_like(t), rate))
    return form @ jax.jacfwd(scene.rate, argnums=1)(t, y), form_rate


@check_first
def invariant_form(scene: Scene, each: np.ndarray | None = None) -> np.ndarray | None:
    """(k, k) a constant symplectic form that the flow near the start preserves, or None.

    A flow preserves the form J if (Df)^T J + J Df = 0 everywhere: linear equations for the entries
    of an antisymmetric J, whose solutions at some random states, and times in the scene's span, are
    those everywhere. So the form is found from the rate alone, in any coordinates that are linear
    in canonical ones, such as positions and velocities of the restricted three-body problem in a
    rotating frame.

    If the sizes `each` (k,) of the entries are given, it is the form of states in these units. Its
    scale is arbitrary.

    Limits: host only; at most 16 entries; found to rounding, not proved.
    """
    if each is None:
        each = np.full(len(scene.y0), np.abs(np.asarray(scene.y0)).max(initial=0.0) or 1.0)
    slopes = slopes_nearby(scene, jnp.asarray(each), scene.t1)
    return None if slopes is None else preserved_form(np.asarray(slopes) * each / each[:, None])


@check_first
def slopes_nearby(scene: Scene, each: Array, span) -> Array | None:
    """(n, k, k) Jacobians of the rate at random states near the start and times in a span.

    None where their forms are not looked for: an odd number of entries, or more than 16. The sizes
    `each` (k,) of the entries scale the changes of the states.
    """
    k = len(scene.y0)
    if k % 2 or k > _MOST_ENTRIES:
        return None
    # Entries that are 0 or small are varied too: on or near an axis of symmetry the rate changes so
    # little that further forms are preserved to rounding.
    sizes = jnp.maximum(jnp.abs(scene.y0), _LEAST_ENTRY * each)
    random = np.random.default_rng(0)
    changes = _SPREAD * random.standard_normal((_STATES, k))
    ys = scene.y0[None] + sizes[None] * changes
    return _rate_slopes(scene, span * random.uniform(size=_STATES), ys)


def preserved_form(slopes: np.ndarray) -> np.ndarray | None:
    """(k, k) a symplectic form J with A^T J + J A = 0 for `slopes_nearby` A (n, k, k), or None."""
    k = slopes.shape[-1]
    slopes = slopes[np.isfinite(slopes).all(axis=(1, 2))]
    if len(slopes) <= _STATES // 2:
        return None
    # In units from one normal mode the other modes are small, and so are their entries of a form:
    # it would count as singular, and damping of these modes as rounding.
    units = np.ones(k)
    for _ in range(_BALANCED):
        forms = invariant_forms(list(slopes))
        more = balancing(np.linalg.norm(forms, axis=0))
        units, slopes = units * more, slopes * more / more[:, None]
    forms = invariant_forms(list(slopes))
    for weights in WEIGHTS:
        total = sum((w * form for w, form in zip(itertools.cycle(weights), forms)), 0 * slopes[0])
        s = np.linalg.svd(total, compute_uv=False)
        if s[-1] > _REGULAR * s[0]:
            by = total @ slopes
            change = np.abs(by - by.transpose(0, 2, 1)).max(axis=(1, 2))
            # Weak damping changes a form by less than `_NULL`, but by more than rounding.
            if (change > _KEPT * np.abs(by).max(axis=(1, 2))).any():
                return None
            return total / np.outer(units, units)
    return None


def balancing(sizes: np.ndarray) -> np.ndarray:
    """(k,) units in which the largest entry in each row of a form is 1; `sizes` are its |entries|.

    Rows that are only rounding are not scaled up.
    """
    units = np.ones(len(sizes))
    for _ in range(_BALANCED):
        rows = (units[:, None] * sizes * units).max(axis=1)
        units = units / np.sqrt(np.where(rows > _VANISHES * rows.max(initial=0.0), rows, 1.0))
    return units


def invariant_forms(slopes: Sequence[np.ndarray]) -> np.ndarray:
    """(n, k, k) independent antisymmetric J with A^T J + J A = 0 for each A (k, k)."""
    k = len(slopes[0])
    above = np.triu_indices(k, 1)
    units = np.zeros((len(above[0]), k, k))
    units[np.arange(len(units)), *above] = 1.0
    units -= units.transpose(0, 2, 1)
    several = np.asarray(slopes)[:, None]
    rows = (several.swapaxes(-1, -2) @ units + units @ several)[..., *above].swapaxes(-1, -2)
    # Not relative to each row: with two entries the only one is the trace, which may be rounding.
    sizes = abs(several[:, 0]).max(axis=(-2, -1), keepdims=True, initial=1e-300)
    equations = (rows / sizes).reshape(-1, len(units))
    # For many equations, the triangular factor has the same singular values and right vectors.
    _, s, right = np.linalg.svd(np.linalg.qr(equations, mode="r"))
    return np.einsum("nu,uij->nij", right[(s > _NULL).sum() :], units)


@jax.jit
def _rate_slopes(scene: Scene, ts: Array, ys: Array) -> Array:
    return jax.vmap(jax.jacfwd(scene.rate, argnums=1))(ts, ys)


def symplectic_defect(matrix: np.ndarray, form: np.ndarray) -> np.ndarray:
    """(...) largest entry of M^T J M - J over |J| |M|^2, for maps M and forms J (..., k, k)."""
    changed, size = np.swapaxes(matrix, -1, -2) @ form @ matrix - form, np.abs(form)
    largest = size.max(axis=(-2, -1)) * np.maximum(1.0, norm(matrix) ** 2)
    return np.abs(changed).max(axis=(-2, -1)) / np.where(largest > 0, largest, 1.0)


@check_first
def tangents(scene: Scene, y0: np.ndarray) -> np.ndarray:
    """Orthonormal basis (k, d) of the states near the start that satisfy the constraints."""
    if type(scene.system).project is System.project:
        return np.eye(len(y0))
    u, s, _ = np.linalg.svd(np.asarray(_projection(scene, jnp.asarray(y0))))
    return u[:, s > _TANGENT]


@jax.jit
def _projection(scene: Scene, y0: Array) -> Array:
    return jax.jacfwd(scene.system.project, argnums=1)(jnp.zeros(()), y0)
