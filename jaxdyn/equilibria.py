"""All rest points of a scene in a box, each with its stability.

A rest point is a state with rate(y) = 0. The search starts Levenberg-Marquardt iterations from
the points of a low-discrepancy grid in the box, all at once, keeps what passes as a root, and
drops repetitions. It is a search: it finds every rest point whose basin of attraction one of
the starts hits, and cannot prove that there is no other. `Equilibria.found_by` says how many
starts led to each; where a count is 1 or 2, search again with more starts.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.linearize import Linearization, linearize
from jaxdyn.scene import Field, Scene, checked

_MOST_STARTS = 1_000_000  # which are worked on at once
_STEPS = 80
_DAMPING = 1e-3  # first damping of an iteration, relative to the largest entry of J^T J
_LESS, _MORE = 0.2, 5.0  # damping after a step that helped, and after one that did not
_CONVERGED = 1e-10  # relative: the last Newton step of a root over the size of the box
_SAME = 1e-6  # relative: roots nearer than this are one
_FLAT = 1e-9  # smallest over largest singular value of the Jacobian of a root that is isolated


@dataclasses.dataclass(frozen=True)
class Equilibria:
    """The rest points that a search found.

    Attributes:
      states: (e, k) rest points, ordered by their first coordinates.
      linearizations: what their eigenvalues say, in the same order.
      isolated: (e,) False where the Jacobian is singular to rounding: the point may belong
        to a curve of rest points, of which only samples are listed, or be about to split.
      found_by: (e,) how many starts led to each.
      residuals: (e,) largest entry of the rate there.
      starts: how many starts there were.
      lost: how many led to no rest point in the box.
    """

    states: np.ndarray
    linearizations: tuple[Linearization, ...]
    isolated: np.ndarray
    found_by: np.ndarray
    residuals: np.ndarray
    starts: int
    lost: int

    def __len__(self) -> int:
        return len(self.states)


def equilibria(scene: Scene, low, high, *, t=0.0, starts: int = 1024) -> Equilibria:
    """The rest points of a scene in a box, with their stability; host only.

    Args:
      scene: an autonomous scene, or one that is frozen at time t.
      low: lower corner of the box, (k,) for all entries of the state; or (k/2,) for the
        coordinates of a state [q, v], whose velocities are then 0.
      high: upper corner, the same.
      t: () time [s] at which the scene is frozen.
      starts: how many points of the box the search starts from.
    Returns:
      What was found: verified roots, no repetitions. There may be others.
    Raises:
      ValueError: a box that is none, or another number that makes no sense.
    Limits: roots on which the rate is not smooth (a spring pressed to a point) are missed;
      curves of rest points are sampled, see `Equilibria.isolated`.
    Example:
      >>> from jaxdyn.scenes.springs import two_springs
      >>> found = equilibria(two_springs(g=0.0), [-3, -3], [3, 3])
      >>> len(found)
      5
    """
    low, high = _box(low, high, len(checked(scene).y0))
    starts, t = _checks.whole("starts", starts, most=_MOST_STARTS), _checks.array("t", t, ())
    grid = low + (high - low) * low_discrepancy(starts, len(low))
    ys, steps, rates = (np.asarray(x) for x in _search(scene.field, jnp.asarray(grid), t))
    size = np.max(high - low)
    slack = _SAME * size
    with np.errstate(invalid="ignore"):
        inside = ((ys >= low - slack) & (ys <= high + slack)).all(axis=1)
        kept = np.flatnonzero(inside & (steps <= _CONVERGED * size))
    groups = _groups(scene, ys, kept[np.argsort(steps[kept], kind="stable")], slack)
    best = sorted((group[0] for group in groups), key=lambda i: tuple(np.round(ys[i], 6)))
    count = {group[0]: len(group) for group in groups}
    linear = tuple(linearize(scene.field, ys[i], t) for i in best)
    return Equilibria(
        states=ys[best],
        linearizations=linear,
        isolated=np.array([_isolated(x.jacobian) for x in linear], dtype=bool),
        found_by=np.array([count[i] for i in best], dtype=int),
        residuals=np.abs(rates[best]).max(axis=1, initial=0.0),
        starts=starts,
        lost=starts - len(kept),
    )


def low_discrepancy(n: int, d: int) -> np.ndarray:
    """(n, d) points that fill the unit cube evenly, always the same ones.

    The additive sequence with the powers of 1/phi_d, where phi_d^(d+1) = phi_d + 1.

    Reference: Roberts (2018), The unreasonable effectiveness of quasirandom sequences.
    """
    phi = 2.0
    for _ in range(60):
        phi = (1 + phi) ** (1 / (d + 1))
    return (0.5 + np.arange(1, n + 1)[:, None] * phi ** -np.arange(1.0, d + 1)[None, :]) % 1.0


def _box(low, high, k: int) -> tuple[np.ndarray, np.ndarray]:
    low = np.asarray(_checks.array("low", low, (None,)))
    high = np.asarray(_checks.array("high", high, low.shape))
    if (low > high).any() or (low == high).all():
        raise _checks.fail("high", f"above low = {low.tolist()}", high.tolist())
    if 2 * len(low) == k:
        low, high = (np.concatenate([x, np.zeros(len(x))]) for x in (low, high))
    if len(low) != k:
        raise _checks.fail("low", f"{k} entries, or {k // 2} for coordinates at rest", len(low))
    return low, high


@eqx.filter_jit
def _search(field: Field, grid: Array, t) -> tuple[Array, Array, Array]:
    """(s, k) ends of the iterations, (s,) size of a further Newton step, (s, k) rates there."""

    def rate(y):
        return field.rate(t, y)

    def improve(_, carry):
        y, damping = carry
        f, a = rate(y), jax.jacfwd(rate)(y)
        gram = a.T @ a
        weight = damping * (jnp.max(jnp.abs(gram)) + jnp.finfo(float).tiny)
        step = jnp.linalg.solve(gram + weight * jnp.eye(len(y)), a.T @ f)
        new = rate(y - step)
        better = jnp.sum(new * new) < jnp.sum(f * f)  # False for NaN
        return jnp.where(better, y - step, y), damping * jnp.where(better, _LESS, _MORE)

    def end(y):
        y, _ = jax.lax.fori_loop(0, _STEPS, improve, (y, jnp.asarray(_DAMPING)))
        # The normal equations square the condition number; a plain Newton step does not. The
        # shortest step: on a curve of rest points the matrix is singular.
        f, a = rate(y), jax.jacfwd(rate)(y)
        step = jnp.linalg.lstsq(a, f)[0]
        new = rate(y - step)
        better = jnp.sum(new * new) <= jnp.sum(f * f)
        return jnp.where(better, y - step, y), jnp.linalg.norm(step), jnp.where(better, new, f)

    return jax.vmap(end)(grid)


def _groups(scene: Scene, ys: np.ndarray, order: np.ndarray, slack: float) -> list[list[int]]:
    """Indices in groups of equal states, the best of each first."""
    groups: list[list[int]] = []
    if not len(order):
        return groups
    difference = jax.jit(jax.vmap(scene.system.difference, in_axes=(None, 0)))
    for i in order:
        if groups:
            heads = jnp.asarray(ys[[g[0] for g in groups]])
            apart = np.abs(np.asarray(difference(jnp.asarray(ys[i]), heads))).max(axis=1)
            if apart.min() <= slack:
                groups[int(apart.argmin())].append(int(i))
                continue
        groups.append([int(i)])
    return groups


def _isolated(a: np.ndarray) -> bool:
    values = np.linalg.svd(a, compute_uv=False)
    return bool(values[-1] > _FLAT * values[0])
