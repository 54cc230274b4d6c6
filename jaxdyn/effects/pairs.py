"""Sums over all pairs of bodies, a few bodies at a time against all.

Arrays of n x n pairs fall out of the caches, and a last axis of 3 coordinates keeps XLA from using
the vector units. Here each pass of a loop takes the pairs of four bodies with all others, with
coordinates apart and bodies last: 1.1 to 1.4 ns an ordered pair from 16 to 1024 bodies, against
19 ns for arrays (n, n, 3), and no array is larger than n. [measured: a core with 512-bit
vectors, gravity in space, in a compiled loop; one body a pass takes 1.3 to 2.4 ns, sixteen up to 8.
Each pair once would halve the square roots, but adds to entries one by one.]
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

_ROWS = 4  # bodies a pass


def sum_over_bodies(
    add: Callable[[Array, Array, list[Array], Array], Array], r: Array, m: Array, start: Array
) -> Array:
    """What each of n bodies adds to totals of all n, summed.

    Args:
      add: (total, mass, d, r2) -> total, where a body of mass (n,) lies at displacements d, a
        list of (n,), and squared distances r2 (n,) from each of the bodies. From itself it lies
        at squared distance 1 with mass 0.
      r: (n, d) positions [m].
      m: (n,) masses [kg].
      start: (..., n) totals to begin with.
    Returns:
      (..., n) totals.
    Limits: derivatives in reverse mode compute each pass again instead of storing n x n arrays.
    """
    n, columns, numbers = len(m), list(r.T), jnp.arange(len(m))

    def one(total: Array, body: tuple[Array, Array, Array]) -> Array:
        number, place, mass = body
        d = [x - column for x, column in zip(place, columns, strict=True)]
        itself = numbers == number
        r2 = jnp.where(itself, 1.0, sum(x * x for x in d))
        return add(total, jnp.where(itself, 0.0, mass), d, r2)

    def several(total: Array, bodies: tuple[Array, Array, Array]) -> tuple[Array, None]:
        for i in range(len(bodies[0])):
            total = one(total, jax.tree.map(lambda x, i=i: x[i], bodies))
        return total, None

    bodies, whole = (numbers, r, m), n - n % _ROWS
    blocks = jax.tree.map(lambda x: x[:whole].reshape(-1, _ROWS, *x.shape[1:]), bodies)
    total, _ = jax.lax.scan(jax.checkpoint(several, prevent_cse=False), start, blocks)
    return several(total, jax.tree.map(lambda x: x[whole:], bodies))[0]
