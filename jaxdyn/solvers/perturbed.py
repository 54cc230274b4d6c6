"""A field with random perturbations of each step, which shows the effect of rounding, magnified.

The sums of steps are compensated, so digits are lost in finding an increment: at every step a rate
is evaluated at a state, a time and numbers that are each rounded. A `RoundedField` perturbs them by
a given relative amount instead, constant over the stages of a step, so that the method keeps its
order and the choice of steps is not affected. As long as motions stay close, the effect is
proportional to that amount: perturbations of 1e-9 show the effect of rounding of 1e-16. Terms of a
rate that cancel for every state are not covered: their rounding is relative to the terms.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array

from jaxdyn.scene import FieldAround

#: Constants of the generator splitmix64 (Steele, Lea, Flood, 2014, OOPSLA, 453).
_GOLDEN = 0x9E3779B97F4A7C15
_MIX = ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB))
_LAST_SHIFT, _SIGN_SHIFT = 31, 63


class Noise(NamedTuple):
    """Relative size of the perturbations of a step, and the seed."""

    size: Array | float
    seed: Array | int


#: No perturbation: the field itself, evaluated by the program that is compiled for other noise.
QUIET = Noise(np.zeros(()), np.zeros((), np.uint64))


class RoundedField(eqx.Module, FieldAround):
    """A field whose steps start from a slightly perturbed state, time and numbers.

    Attributes:
      field: anything with ``rate``, ``project`` and ``undetermined``.
      noise: the perturbations.
    """

    field: Any
    noise: Noise

    def around(self, change: Callable, branch: Any) -> "RoundedField":
        """The same noise of the field in a branch of its conditions; see `plan.branch`."""
        return RoundedField(change(self.field, branch), self.noise)

    def project(self, t: Array, y: Array) -> Array:
        """A perturbed state (k,), projected onto the constraints; y itself without constraints."""
        off = self.noise.size * _signs(self.noise.seed, t, y.size).reshape(y.shape) * y
        return self.field.project(t, y + off) - off


def perturbed_start(field: Any, t: Array, y: Array) -> tuple[Any, Array, Array]:
    """The field, the time and the state with which the increment of a step from (t, y) is found.

    They are unchanged unless the field is a `RoundedField`.
    """
    if not isinstance(field, RoundedField):
        return field, t, y
    numbers, rest = eqx.partition(field.field, eqx.is_inexact_array)
    flat, tree = ravel_pytree(numbers)
    flat = flat.astype(float)  # an empty array is float32 by default
    signs = _signs(field.noise.seed, t, 1 + y.size + flat.size)
    factors = 1.0 + field.noise.size * signs
    off = factors[1 : 1 + y.size].reshape(y.shape)
    return eqx.combine(tree(flat * factors[1 + y.size :]), rest), t * factors[0], y * off


def _signs(seed: Array | int, t: Array, n: int) -> Array:
    """(n,) random signs +-1, from the bits of the time."""
    z = jax.lax.bitcast_convert_type(t, jnp.uint64) + jnp.asarray(seed, jnp.uint64)
    z = z * np.uint64(_GOLDEN) + jnp.arange(1, n + 1, dtype=jnp.uint64) * np.uint64(_GOLDEN)
    for shift, factor in _MIX:
        z = (z ^ (z >> np.uint64(shift))) * np.uint64(factor)
    z = z ^ (z >> np.uint64(_LAST_SHIFT))
    return 1.0 - 2.0 * (z >> np.uint64(_SIGN_SHIFT)).astype(float)
