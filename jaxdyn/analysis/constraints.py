"""The constraints of a scene: their forces, rank and conditioning.

`tensions` has the forces along rods, `reactions` the force of all constraints on each point,
`multipliers` the unknowns of a constrained formulation, `conditioning` rank and redundancy. The
conditions on the accelerations are G a = gamma (`formulations.constrained`). Their conditioning is
that of G M^(-1/2): a singular value is near 0 where a condition nearly follows from others, or
nearly vanishes.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.formulations.dependence import DEPENDENT
from jaxdyn.formulations.extended import innermost
from jaxdyn.integrate.spans import of_samples
from jaxdyn.integrate.trajectory import Trajectory, each_motion
from jaxdyn.scene import Field, Scene, System
from jaxdyn.system import total_force


class Conditioning(NamedTuple):
    """Rank and condition of a scene's constraints at a state.

    Attributes:
      condition: () [1] ratio of the largest to the smallest singular value of independent
        conditions. Accelerations lose log10 of it of their 16 digits, constraint forces twice that.
      rank: () number of independent conditions.
      redundant: () number of further conditions, which follow from these.
      determined: () whether they determine the motion: the rank is not lost in just this pose,
        and they are consistent.
    """

    condition: Array
    rank: Array
    redundant: Array
    determined: Array


@check_first
@each_motion
def multipliers(motion: Trajectory) -> Array:
    """(s, c) Lagrange multipliers along a motion: of constraints, then of rolling conditions.

    Raises:
      ValueError: the scene is not in a constrained formulation.
    """
    return _multipliers(motion, _constrained_system(motion.scene.system))


@check_first
@each_motion
def tensions(motion: Trajectory) -> dict[str, Array]:
    """(s,) tension of each rod along a motion [N], by its name; negative where the rod pushes.

    Args:
      motion: a motion of a scene whose constraints are rods' lengths, in a constrained formulation.
    Raises:
      ValueError: the scene has no such constraints.
    Example:
      >>> from jaxdyn.analysis import constraints
      >>> from jaxdyn import scenes, simulate
      >>> hanging = scenes.pendulum(m=2.0, angle=0.0, formulation="constrained")
      >>> round(float(constraints.tensions(simulate(hanging, 0.1, samples=2))["stick"][0]), 9)
      19.62
    """
    system = _constrained_system(motion.scene.system)
    names = system.mechanism.rods()
    if not names:
        name = type(system.mechanism).__name__
        remedy = "`reactions` has the force of the constraints on each point."
        raise _checks.fail("motion", "constraints that are lengths of rods", name, remedy)
    return _tensions(motion, system)


@check_first
@each_motion
@of_samples
@eqx.filter_jit
def reactions(motion: Trajectory) -> Array:
    """(s, n, d) force of the constraints on each material point along a motion [N].

    It is the mass times the acceleration minus the forces of the effects: the pull of rods, the
    push of wires and hinges. It holds for every formulation, also in minimal coordinates. The
    points of rigid bodies represent their mass, so for them only the sum and the moment of these
    forces are meaningful. Forces on coordinates (motors) count as reactions.
    """
    scene = motion.scene

    def at(t, y):
        t = jnp.asarray(t, float)
        look = jax.jvp(scene.system.points, (t, y), (jnp.ones_like(t), scene.rate(t, y)))
        (r, v, m), (_, a, _) = look
        return m[:, None] * a - total_force(scene.effects, t, r, v, m)

    return jax.vmap(at)(motion.ts, motion.ys)


@of_samples
@eqx.filter_jit
def _multipliers(motion: Trajectory, system: Constrained) -> Array:
    k = len(system.labels())
    forces = jax.vmap(lambda t, y: system.constraint_forces(t, y[:k], motion.scene.effects))
    return forces(motion.ts, motion.ys)


@of_samples
@eqx.filter_jit
def _tensions(motion: Trajectory, system: Constrained) -> dict[str, Array]:
    names, forces = system.mechanism.rods(), _multipliers(motion, system)
    return dict(zip(names, -forces[:, : len(names)].T, strict=True))


def _constrained_system(system: System) -> Constrained:
    system = innermost(system)
    if not isinstance(system, Constrained):
        name = type(system).__name__
        raise _checks.fail("scene", "one with constraints", name, 'Try formulation="constrained".')
    return system


@check_first
def conditioning(scene: Scene | Field, t, y: Array) -> Conditioning:
    """Rank and condition of a scene's constraints at a state; along a motion by `energy.along`.

    Args:
      scene: one with constraints.
      t: () time [s].
      y: (k,) state.
    Raises:
      ValueError: the scene has no constraints.
    Limits: not for stepping loops (LAPACK). Conditions in different units make the condition
      number depend on these.
    Example:
      >>> from jaxdyn.analysis import constraints
      >>> from jaxdyn import scenes
      >>> bars = scenes.four_bar()
      >>> print(constraints.conditioning(bars, 0.0, bars.y0).rank)
      8
    """
    _checks.float64()
    system = _constrained_system(scene.system)
    y = jnp.asarray(y, dtype=float)[: len(system.labels())]
    squares = jnp.linalg.eigvalsh(system.gram(t, y))
    independent = squares > DEPENDENT * squares[-1]
    rank = jnp.sum(independent)
    least = jnp.min(jnp.where(independent, squares, jnp.inf))
    condition = jnp.sqrt(squares[-1] / least)
    return Conditioning(
        condition=condition,
        rank=rank,
        redundant=len(squares) - rank,
        determined=~system.undetermined(t, y),
    )
