"""Static and dynamic balance: the bearing forces of a body that spins about a fixed axis.

A body is statically balanced if its centre of mass is on the axis, so that no net force is needed,
and dynamically balanced if the axis is also a principal axis, so that no moment is needed. Every
body is dynamically balanced about its three principal axes through the centre of mass, in both
directions, and about no other line if its principal moments differ.

One of two bearings can carry the whole force of an unbalanced body. That requires vanishing
products of inertia about this bearing, which masses on both sides of the axis at different
distances from it can have.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool

from jaxdyn._arguments import arrays
from jaxdyn._numerics import square_norm
from jaxdyn.geometry.inertia import Body
from jaxdyn.geometry.vectors import Scalar, Vector, cross, dot

# Imbalance below this fraction of the largest that the mass and inertia could cause is rounding.
_MIN_IMBALANCE = 1e-12


class Bearings(NamedTuple):
    """Forces that two bearings provide for a steady spin, apart from other loads.

    The forces (3,) [N] at a and b on the body, their sum ``force`` (3,) [N] and their moment
    (3,) [N m] about a, and whether () the body is balanced ``statically`` (no net force: the
    centre is on the axis) and ``dynamically`` (no moment either: the axis is principal too).
    """

    at_a: Vector
    at_b: Vector
    force: Vector
    moment: Vector
    statically: Bool[Array, ""]
    dynamically: Bool[Array, ""]


@arrays
def bearing_forces(body: Body, r_a: Vector, r_b: Vector, spin: Scalar) -> Bearings:
    """Forces on a body that spins at a constant rate about the line through two bearings.

    F = m omega x (omega x r) and M = omega x (I_a omega). Neither bearing takes a moment, and M
    is normal to the axis, so F_b = M x n / length, and F_a is the rest.

    Args:
      body: the body in its current position.
      r_a: (3,) [m] the bearing a, the origin of positions and moments.
      r_b: (3,) [m] the other bearing b; the axis n points from a to b.
      spin: () [rad/s] angular velocity about n.
    """
    along = r_b - r_a
    length = jnp.sqrt(square_norm(along))
    n = along / length
    omega, d = spin * n, body.centre - r_a
    inertia = body.about(r_a)
    force = body.mass * cross(omega, cross(omega, d))
    moment = cross(omega, inertia @ omega)
    at_b = cross(moment, n) / length

    size = jnp.trace(inertia)
    eccentric = body.mass * square_norm(d - dot(n, d) * n)
    statically = eccentric <= (_MIN_IMBALANCE**2) * size
    tilted = square_norm(cross(n, inertia @ n))
    dynamically = statically & (tilted <= (_MIN_IMBALANCE * size) ** 2)
    return Bearings(
        at_a=force - at_b,
        at_b=at_b,
        force=force,
        moment=moment,
        statically=statically,
        dynamically=dynamically,
    )
