"""A disk that rolls or slides on a plane: course problem 60.

The lean theta is the angle between the disk's axis e_3' and the vertical, pi/2 for an upright disk;
the course calls it theta in the picture and phi in the question. The precession omega_p is about
the vertical, the spin omega_s (the course's "pitch rate") about e_3', so omega = omega_p k +
(d theta/dt) e_x' + omega_s e_3' with e_x' the horizontal k x e_3'.
Its steady motions are given by `precession.rolling_disk_circle` and the functions beside it.
"""

import functools
import math

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import floats
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.mechanisms.disk import FLAT, Disk
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made


@ready_made()
def rolling_disk(
    theta=1.2,
    *,
    precession=2.0,
    lean_rate=0.0,
    spin=3.0,
    m=1.0,
    radius=0.5,
    I1=None,
    g=9.81,
    rough: bool = True,
    t1=10.0,
) -> Scene:
    """A disk that rolls without slip, or slides without friction, on level ground (problem 60).

    A motion ends with a status where the disk comes within 1e-4 rad of lying flat.

    Args:
      theta: angle of the axis to the vertical, pi/2 upright [rad]; not 0, flat on the plane.
      precession: rate about the vertical [rad/s].
      lean_rate: rate of theta [rad/s].
      spin: spin about the axis, relative to the frame that precesses [rad/s].
      m: mass [kg].
      radius: radius [m].
      I1: moment about a diameter, half of that about the axis [kg m^2]; by default that of a
        uniform disk.
      g: gravity [m/s^2].
      rough: whether it rolls; otherwise it slides, and its centre starts with a vertical velocity.
      t1: span [s].
    """
    if not _checks.is_traced(theta) and not math.sin(theta) > FLAT:
        wanted = "a disk that does not lie flat, 0 < theta < pi"
        raise _checks.fail("theta", wanted, theta, "A disk that lies flat has no lowest point.")
    I1 = m * radius**2 / 4 if I1 is None else I1
    disk = Disk(m, radius, I1, rough=rough)
    y0 = _start(*floats(theta, precession, lean_rate, spin, radius), rough=rough)
    return Scene(Constrained(disk), (UniformGravity(g),), y0=y0, t1=t1)


@functools.partial(jax.jit, static_argnames="rough")  # one program, not one for each operation
def _start(theta, precession, lean_rate, spin, radius, *, rough: bool) -> Array:
    """(12,) the state of `rolling_disk`."""
    zero = jnp.zeros(())
    angles, rates = [zero, theta, zero], [precession, lean_rate, spin]
    # Rolling along x at phi = 0, by `Disk.rolling` and `Disk.constraints`.
    v = [-radius * (precession * jnp.cos(theta) + spin), -radius * jnp.sin(theta) * lean_rate]
    v = v if rough else [zero, zero]
    up = radius * jnp.sin(theta), radius * jnp.cos(theta) * lean_rate
    return jnp.stack([zero, zero, up[0], *angles, *v, up[1], *rates])
