"""Keplerian elements of an orbit from a position and a velocity, and back.

References: Curtis (2014), Orbital Mechanics for Engineering Students, sections 4.4 and 4.6; Vallado
(2013), Fundamentals of Astrodynamics and Applications, algorithms 9 and 10.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn import _text
from jaxdyn._checks import array_of_shape, fail, numbers, positive
from jaxdyn._numerics import safe_norm

Vectors = Float[Array, "*b 3"]


class OrbitalElements(NamedTuple):
    """The Keplerian elements of an orbit, each (...).

    Attributes:
      a: semi-major axis, in the unit of positions; negative for a hyperbola, infinite for a
        parabola.
      e: eccentricity.
      inclination: angle between the orbital plane and the plane xy, from 0 to pi [rad].
      node: longitude of the ascending node, from 0 to 2 pi [rad].
      pericentre: argument of the pericentre, from 0 to 2 pi [rad].
      anomaly: true anomaly, from 0 to 2 pi [rad]; `kepler` has mean anomalies.
    """

    a: Array
    e: Array
    inclination: Array
    node: Array
    pericentre: Array
    anomaly: Array

    __repr__ = _text.fields
    _repr_html_ = _text.html


def orbital_elements(r, v, mu) -> OrbitalElements:
    """The Keplerian elements of the orbit through a position with a velocity.

    Units are any that agree. In a plane orbit without a node, of inclination 0 or pi, the node is 0
    and the pericentre is counted from the x axis; on a circle the pericentre is 0, and the anomaly
    is counted from the node. The other elements do not depend on these conventions.

    Args:
      r: (..., 3) position relative to the attracting body [m]; or (..., 2) in the plane xy.
      v: velocity relative to it [m/s], of the same shape.
      mu: (...) gravitational parameter, G times the sum of both masses [m^3/s^2].
    Raises:
      ValueError: `r` or `v` have other shapes, or `mu` is not positive.
    Limits: where an element is undefined or has a kink, as `e` on a circle and `inclination` in the
      plane, its derivatives are 0 or NaN. In a fall along a line all angles are NaN.
    Example:
      >>> from jaxdyn.analysis import orbital_elements
      >>> moon = orbital_elements([1.0, 0.0, 0.0], [0.0, 0.9, 0.9], 2.0)
      >>> [round(float(x), 6) for x in (moon.a, moon.e, moon.inclination)]
      [0.840336, 0.19, 0.785398]
    """
    positive("mu", mu, "It is G times a mass.")
    r = numbers("r", r)
    v = array_of_shape("v", v, r.shape, "That of r.")
    r, v = _in_space("r", r), _in_space("v", v)
    mu = jnp.broadcast_to(jnp.asarray(mu, float), r.shape[:-1])
    distance, h = safe_norm(r), jnp.cross(r, v)
    a = 1 / (2 / distance - jnp.sum(v * v, axis=-1) / mu)
    to_pericentre = jnp.cross(v, h) / mu[..., None] - r / distance[..., None]  # its length is e
    # `along` points to the ascending node; where there is none, along x.
    flat = (h[..., 0] == 0) & (h[..., 1] == 0)
    along = jnp.stack([-h[..., 1], h[..., 0], jnp.zeros_like(flat, float)], axis=-1)
    along = jnp.where(flat[..., None], jnp.zeros_like(h).at[..., 0].set(1.0), along)
    across = jnp.cross(h / safe_norm(h)[..., None], along)

    def angle(x):
        """The angle from the node in the sense of the motion; 0 for a vector of 0."""
        return jnp.arctan2(jnp.sum(x * across, axis=-1), jnp.sum(x * along, axis=-1))

    pericentre = angle(to_pericentre)
    return OrbitalElements(
        a=a,
        e=safe_norm(to_pericentre),
        inclination=jnp.arctan2(safe_norm(h[..., :2]), h[..., 2]),
        node=_turn(jnp.arctan2(along[..., 1], along[..., 0])),
        pericentre=_turn(pericentre),
        anomaly=_turn(angle(r) - pericentre),
    )


def position_and_velocity(elements: OrbitalElements, mu) -> tuple[Vectors, Vectors]:
    """The position (..., 3) and the velocity (..., 3) of a body with these elements.

    Args:
      elements: those that `orbital_elements` returns, but not of a parabola. From a mean anomaly
        `kepler.true_anomaly` finds the true one.
      mu: (...) gravitational parameter [m^3/s^2].
    Example:
      >>> from jaxdyn.analysis.elements import OrbitalElements, position_and_velocity
      >>> r, v = position_and_velocity(OrbitalElements(1.0, 0.5, 0.0, 0.0, 0.0, 0.0), 1.0)
      >>> r.tolist(), round(float(v[1]), 6)
      ([0.5, 0.0, 0.0], 1.732051)
    """
    positive("mu", mu, "It is G times a mass.")
    a, e, tilt, node, pericentre, anomaly = map(jnp.asarray, elements)
    p = a * (1 - e * e)
    speed, u = jnp.sqrt(mu / p), pericentre + anomaly
    zero = jnp.zeros_like(tilt + node)
    along = jnp.stack([jnp.cos(node) + zero, jnp.sin(node) + zero, zero], axis=-1)
    across = jnp.stack(
        [-jnp.sin(node) * jnp.cos(tilt), jnp.cos(node) * jnp.cos(tilt), jnp.sin(tilt) + zero],
        axis=-1,
    )

    def vector(x, y):
        return x[..., None] * along + y[..., None] * across

    r = p / (1 + e * jnp.cos(anomaly))
    rate = -speed * (jnp.sin(u) + e * jnp.sin(pericentre))
    return (
        vector(r * jnp.cos(u), r * jnp.sin(u)),
        vector(rate, speed * (jnp.cos(u) + e * jnp.cos(pericentre))),
    )


def _turn(angle: Array) -> Array:
    """An angle from 0 to 2 pi."""
    return jnp.mod(angle, 2 * jnp.pi)


def _in_space(name: str, x: Array) -> Vectors:
    """(..., 3) vectors of floats, with z = 0 where they are in a plane."""
    if x.ndim == 0 or x.shape[-1] not in (2, 3):
        raise fail(name, "shape (..., 3), or (..., 2) in a plane", f"shape {x.shape}")
    return jnp.pad(x, [(0, 0)] * (x.ndim - 1) + [(0, 3 - x.shape[-1])])
