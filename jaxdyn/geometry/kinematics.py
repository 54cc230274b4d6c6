"""Accelerations of points in the plane by several routes: course problems 34a and 36.

Kinematics only: no masses, no forces. Every route gives the acceleration in fixed axes, so the
routes can be compared entry by entry.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn._arguments import arrays

Scalar = Float[Array, ""]
Plane = Float[Array, "2"]
Each = Float[Array, "n"]


@arrays
def by_derivatives(position: Callable[[Array], Array], q: Each, v: Each, a: Each) -> Array:
    """(d,) acceleration of a point by differentiating its position twice in time.

    Args:
      position: function q (n,) -> position (d,) in fixed axes.
      q: (n,) coordinates.
      v: (n,) their rates.
      a: (n,) their accelerations.
    """

    def velocity(q, v):
        return jax.jvp(position, (q,), (v,))[1]

    return jax.jvp(velocity, (q, v), (v, a))[1]


@arrays
def five_terms(
    origin: Plane, omega: Scalar, alpha: Scalar, r: Plane, v_rel: Plane, a_rel: Plane
) -> Array:
    """(2,) acceleration of a point that moves in a frame that moves and turns.

    a_origin + alpha x r + omega x (omega x r) + 2 omega x v_rel + a_rel.

    Args:
      origin: (2,) acceleration of the frame's origin [m/s^2].
      omega: () angular velocity of the frame [rad/s].
      alpha: () its angular acceleration [rad/s^2].
      r: (2,) vector from the frame's origin to the point, in fixed axes [m].
      v_rel: (2,) velocity seen from the frame [m/s].
      a_rel: (2,) acceleration seen from the frame [m/s^2].
    """
    return (
        origin + alpha * _quarter_turn(r) - omega**2 * r + 2 * omega * _quarter_turn(v_rel) + a_rel
    )


@arrays
def end_position(l: Each, q: Each) -> Array:  # noqa: E741 the course's name
    """(2,) end of a double pendulum, from its angles q (2,) from hanging down (problem 36)."""
    radial, _ = _polar_axes(q)
    return jnp.sum(l[:, None] * radial, axis=0)


@arrays
def end_acceleration(l: Each, q: Each, v: Each, a: Each) -> Array:  # noqa: E741
    """(2,) acceleration of the end of a double pendulum from its absolute angles (problem 36).

    Each link adds its acceleration in polar coordinates, seen from a frame that moves with the
    end of the link before it and does not turn: l (a e_theta - v^2 e_r).

    Args:
      l: (2,) lengths [m].
      q: (2,) angles from hanging down [rad].
      v: (2,) their rates [rad/s].
      a: (2,) their accelerations [rad/s^2].
    """
    radial, around = _polar_axes(q)
    return jnp.sum((l * a)[:, None] * around - (l * v * v)[:, None] * radial, axis=0)


@arrays
def end_acceleration_relative(l: Each, q: Each, v: Each, a: Each) -> Array:  # noqa: E741
    """(2,) the same acceleration from theta_1 and phi = theta_2 - theta_1, by the five terms.

    In a frame fixed to the first link the second one turns by phi alone.

    Args:
      l: (2,) lengths [m].
      q: (2,) theta_1 and phi [rad].
      v: (2,) their rates [rad/s].
      a: (2,) their accelerations [rad/s^2].
    """
    elbow = end_acceleration(l[:1], q[:1], v[:1], a[:1])
    radial, around = _polar_axes(q[0] + q[1])
    v_rel = l[1] * v[1] * around
    a_rel = l[1] * (a[1] * around - v[1] ** 2 * radial)
    return five_terms(elbow, v[0], a[0], l[1] * radial, v_rel, a_rel)


@arrays
def slot_position(d: Scalar, q: Plane) -> Array:
    """(2,) position of a mass in the slot of a turntable, from q = (theta, s) (problem 34 a i).

    The slot is level and the distance d below the centre at theta = 0; s counts along it from
    the point nearest to the centre.
    """
    along, across = _slot_axes(q[0])
    return q[1] * along - d * across


@arrays
def slot_acceleration(d: Scalar, q: Plane, v: Plane, a: Plane) -> Array:
    """(2,) acceleration of the mass in the slot by the rates of its axes i', j' (34 a ii).

    It follows from r = s i' - d j' with di'/dt = w j' and dj'/dt = -w i'.
    """
    along, across = _slot_axes(q[0])
    in_slot = a[1] + a[0] * d - v[0] ** 2 * q[1]
    return in_slot * along + (a[0] * q[1] + 2 * v[0] * v[1] + v[0] ** 2 * d) * across


@arrays
def slot_acceleration_five_terms(d: Scalar, q: Plane, v: Plane, a: Plane) -> Array:
    """(2,) acceleration of the mass in the slot by the five-term formula (34 a iii)."""
    along, _ = _slot_axes(q[0])
    r = slot_position(d, q)
    return five_terms(jnp.zeros(2), v[0], a[0], r, v[1] * along, a[1] * along)


def _polar_axes(angle: Array) -> tuple[Array, Array]:
    """(..., 2) e_r and e_theta for angles from hanging down."""
    s, c = jnp.sin(angle), jnp.cos(angle)
    return jnp.stack([s, -c], axis=-1), jnp.stack([c, s], axis=-1)


def _slot_axes(theta: Array) -> tuple[Array, Array]:
    along = jnp.stack([jnp.cos(theta), jnp.sin(theta)])
    return along, _quarter_turn(along)


def _quarter_turn(r: Array) -> Array:
    """(2,) k x r: a vector turned by a quarter, counterclockwise."""
    return jnp.stack([-r[1], r[0]])
