"""How well the constraints of a scene determine its motion: rank, redundancy, condition.

The conditions on the accelerations are G a = gamma (`formulations.constrained`). What counts are
the singular values of G M^(-1/2): one is near 0 where a condition nearly follows from others, or
nearly vanishes.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.formulations.constrained import DEPENDENT, Constrained
from jaxdyn.ledger import Ledger
from jaxdyn.scene import Field, Scene


class Conditioning(NamedTuple):
    """What is known of a scene's constraints at a state.

    Attributes:
      condition: () [1] largest over smallest singular value of the independent conditions. Of
        the 16 digits of an acceleration it costs log10 of it, of a force in the constraints
        twice that.
      rank: () how many conditions are independent.
      redundant: () how many more there are, which follow from them.
      determined: () whether they determine the motion: no rank is lost in just this pose, and
        they hold, which they do not where one contradicts another.
    """

    condition: Array
    rank: Array
    redundant: Array
    determined: Array


def conditioning(scene: Scene | Field, t, y: Array) -> Conditioning:
    """Rank and condition of a scene's constraints at a state; along a motion by `energy.along`.

    Args:
      scene: one with constraints.
      t: () time [s].
      y: (k,) state.
    Raises:
      ValueError: a scene without constraints.
    Limits: not for stepping loops (LAPACK). Conditions in different units make the condition
      number depend on these.
    Example:
      >>> from jaxdyn import constraints, scenes
      >>> bars = scenes.four_bar()
      >>> print(constraints.conditioning(bars, 0.0, bars.y0).rank)
      8
    """
    system = scene.system
    while isinstance(system, Ledger):
        y, system = y[: len(system.system.labels())], system.system
    if not isinstance(system, Constrained):
        name = type(system).__name__
        raise _checks.fail("scene", "one with constraints", name, 'Try formulation="constrained".')
    y = jnp.asarray(y, dtype=float)
    squares = jnp.linalg.eigvalsh(system.gram(t, y))
    independent = squares > DEPENDENT * squares[-1]
    rank = jnp.sum(independent)
    least = jnp.min(jnp.where(independent, squares, jnp.inf))
    condition = jnp.sqrt(squares[-1] / least)
    return Conditioning(condition, rank, len(squares) - rank, ~system.undetermined(t, y))
