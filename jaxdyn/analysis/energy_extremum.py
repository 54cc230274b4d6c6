"""Stability of equilibria by the theorem of Lagrange and Dirichlet.

The Jacobian decides nothing at a centre. But where the energy is conserved and has a strict minimum
or maximum, a motion that begins nearby stays on a small closed surface about it, on which the
energy is constant: the equilibrium is stable.

Reference: Merkin (1997), Introduction to the Theory of Stability, section 3.2.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

#: Least eigenvalue of the energy's Hessian that counts as nonzero, and largest slope of the energy
#: that counts as zero; both in units in which the Hessian has the diagonal 1.
_LEAST, _FLAT = 1e-8, 1e-6
#: Largest rate of an energy that counts as conserved, relative to the terms of that rate.
_CONSERVED = 1e-9
#: Random displacements at which that rate is evaluated: their size, in sizes of the entries, and
#: their number.
_ASIDE, _PLACES = 0.2, 8


@eqx.filter_jit
def is_extremum_of_energy(field: Any, t: Array, y: Array, each: Array, time: Array) -> Array:
    """Whether () the energy is conserved and has a strict minimum or maximum at an equilibrium.

    Args:
      field: an object with ``rate(t, y)`` and ``energies(t, y)``, such as `jaxdyn.scene.Field`.
      t: () time.
      y: (k,) the equilibrium.
      each: (k,) sizes of the entries of motions near it.
      time: () the time of these motions.
    """
    if not jax.eval_shape(field.energies, t, y):
        return jnp.zeros((), bool)

    def energy(t, x):
        return jnp.stack(field.energies(t, y + each * x)).sum()

    def change(t, x):
        """The absolute rate of the energy at a displacement, and the size of its terms."""
        by_time, slope = jax.grad(energy, argnums=(0, 1))(t, x)
        parts = jnp.append(slope * field.rate(t, y + each * x) / each, by_time)
        return jnp.abs(parts.sum()), jnp.abs(parts).sum()

    zero, random = jnp.zeros_like(y), np.random.default_rng(0)
    aside = _ASIDE * random.standard_normal((_PLACES, y.shape[0]))
    times = t + time * random.uniform(0.0, 10.0, _PLACES)
    rates, terms = jax.vmap(change)(times, jnp.asarray(aside))
    hessian, slope = jax.hessian(energy, argnums=1)(t, zero), jax.grad(energy, argnums=1)(t, zero)
    scale = jnp.sqrt(jnp.abs(jnp.diagonal(hessian)))
    scale = jnp.where(scale > 0, scale, 1.0)
    values = jnp.linalg.eigvalsh(hessian / (scale[None] * scale[:, None]))
    is_flat = (jnp.abs(slope) <= _FLAT * scale**2).all()
    return (
        (rates <= _CONSERVED * terms).all()
        & is_flat
        & ((values > _LEAST).all() | (values < -_LEAST).all())
    )
