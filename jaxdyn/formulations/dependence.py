"""Which of the conditions G a = gamma depend on others, and whether more do so after a step.

Rows of G are compared in the metric of the kinetic energy, by elimination of G M^-1 G^T; a row is
dependent if too little of it remains once those before it have been eliminated. `constrained` says
what follows from that.
"""

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._numerics import Reduced, has_positive_minors, smooth, solve_psd

#: Squared sine of the angle to the others below which a condition counts as dependent: at 1e-6 rad,
#: rounding of 1e-16 still leaves ten digits of the acceleration.
DEPENDENT = 1e-12
#: The same at the end of a step; smaller, so that a motion that stops there is undetermined.
LOST = 0.25 * DEPENDENT
_MIN_CONDITION_CHANGE = 1e-5  # relative change of a dependent condition that counts as a change


@smooth  # a decision about rank
def independent(g: Array, reach: Array, b: Array, least: float = DEPENDENT) -> Reduced:
    """The multipliers (c, ...) for right sides b, those of dependent conditions set to 0."""
    gram = times(g, reach)
    size = jnp.sum(g * g, axis=1)
    # A row that nearly vanishes has the direction of its rounding errors.
    vanishes = size <= least * jnp.max(size, initial=0.0)
    return solve_psd(gram, b, jnp.where(vanishes, jnp.inf, least * jnp.diagonal(gram)))


def turns_over(start: tuple[Array, Array], end: tuple[Array, Array], kept: Array) -> Array:
    """Whether () conditions become dependent between two poses, or may; see `Constrained.loses`.

    Args:
      start: G and M^-1 G^T in the first pose.
      end: likewise in the second pose.
      kept: (c + b,) which conditions are independent. The others are left out: within a step,
        where redundant conditions do not hold exactly, they are not dependent either.
    """
    g0, g1 = (jnp.where(kept[:, None], g, 0.0) for g, _ in (start, end))
    reach = jnp.where(kept[None, :], start[1], 0.0)
    found = independent(g0, reach, times(g1, reach).T, LOST)
    x = jnp.where(kept[:, None] & kept[None, :], found.x, jnp.eye(len(kept)))
    return jnp.any(kept & ~found.kept) | ~has_positive_minors(x)


def times(g: Array, reach: Array) -> Array:
    """G (c, n) times M^-1 G^T (n, k)."""
    # It is a sum, for the reason given at mechanism.weighted_gram.
    return jnp.sum(g[:, :, None] * reach[None, :, :], axis=1)


def crossing(found: Reduced, turning: Array, allowed: Array) -> Array:
    """Whether () a dependent condition changes in allowed motions: several of them cross here.

    Args:
      found: the dependences among the conditions.
      turning: (c, n, n) derivatives of the rows of G in q.
      allowed: (n, n) a projector on the velocities that the conditions allow.
    """
    c = turning.shape[0]
    null = jnp.where(found.kept[:, None], 0.0, jnp.eye(c) - found.combination.T)
    curvature = jnp.sum(null[:, :, None, None] * turning[None], axis=1)
    size = jnp.sum(jnp.abs(null)[:, :, None, None] * jnp.abs(turning)[None], axis=1)
    for _ in range(2):  # along both of its directions
        curvature = jnp.sum(curvature[:, :, :, None] * allowed[None, None], axis=2).swapaxes(1, 2)
    return jnp.any(
        jnp.max(jnp.abs(curvature), axis=(1, 2))
        > _MIN_CONDITION_CHANGE * jnp.max(size, axis=(1, 2))
    )
