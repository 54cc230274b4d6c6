"""Energies and momenta of a scene, at a state and along a motion.

All look at the material points of the system, so they hold for any coordinates. What is
conserved depends on the effects: `drift` measures it.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.integrate.trajectory import Trajectory, each_motion
from jaxdyn.scene import Field, Scene


def potential(scene: Scene | Field, t, y: Array) -> Array:
    """Potential energy () [J]: the sum over the effects that have one."""
    r, _, m = scene.system.points(t, y)
    values = [effect.potential(t, r, m) for effect in scene.effects]
    return sum((v for v in values if v is not None), jnp.zeros(()))


def energy(scene: Scene | Field, t, y: Array) -> Array:
    """Kinetic plus potential energy () [J]."""
    return scene.system.kinetic(t, y) + potential(scene, t, y)


def momentum(scene: Scene | Field, t, y: Array) -> Array:
    """Linear momentum (d,) [kg m/s] of all material points."""
    _, v, m = scene.system.points(t, y)
    return jnp.sum(m[:, None] * v, axis=0)


def angular_momentum(scene: Scene | Field, t, y: Array) -> Array:
    """Angular momentum about the origin [kg m^2/s]: () in the plane, (3,) in space.

    Limits: zero-dimensional, () 0, for points on a line.
    """
    r, v, m = scene.system.points(t, y)
    if r.shape[1] == 1:
        return jnp.zeros(())
    if r.shape[1] == 2:
        return jnp.sum(m * (r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0]))
    return jnp.sum(m[:, None] * jnp.cross(r, v), axis=0)


def integrals(scene: Scene | Field, t, y: Array) -> dict[str, Array]:
    """The candidates for conserved quantities, each () or (d,), by name.

    Which of them are conserved depends on the effects; nothing here says so.
    """
    return {
        "energy": energy(scene, t, y),
        "momentum": momentum(scene, t, y),
        "angular momentum": angular_momentum(scene, t, y),
    }


def along(quantity, motion: Trajectory) -> Array:
    """(s, ...) values of a quantity of this file along a motion, e.g. ``along(energy, motion)``.

    Of a batch of motions (b, s, ...).

    Example:
      >>> from jaxdyn.analysis import energy
      >>> from jaxdyn import scenes, simulate
      >>> motion = simulate(scenes.cannonball(), 1.0)
      >>> energy.along(energy.momentum, motion).shape
      (200, 2)
    """
    return _along(motion, quantity)


@each_motion
def _along(motion: Trajectory, quantity) -> Array:
    return jax.vmap(lambda t, y: quantity(motion.scene, t, y))(motion.ts, motion.ys)


@each_motion
def drift(motion: Trajectory) -> Array:
    """Largest change of the energy along a motion () [1], relative to its kinetic and potential.

    max_i |E(t_i) - E(t_0)| / max_i (|T(t_i)| + |V(t_i)|); effects without a potential, such
    as drag, make it large, which is right. (b,) of a batch.

    Raises:
      ValueError: fewer than two samples, which show no change.
    """
    if len(motion.ts) < 2:
        raise _checks.fail("motion", "at least 2 samples", len(motion.ts), "Simulate with more.")
    total = along(energy, motion)
    v = along(potential, motion)
    size = jnp.max(jnp.abs(total - v) + jnp.abs(v))
    # Where nothing moves and nothing acts the size is 0, and so is the change.
    return jnp.max(jnp.abs(total - total[0])) / jnp.where(size == 0, 1.0, size)
