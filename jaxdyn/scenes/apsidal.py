"""Angle and time from the nearest to the farthest point of an orbit about a centre of force.

With the depth x = log(r / r_max), w = 1 / r^2 and energy and angular momentum L the same at both
ends, the path of a point of mass m under the attraction f(r) is

    (dx/dtheta)^2 = ((w2 - w) P1 + (w - w1) P2) / (w (w2 - w1) L^2 / m),
    P1 = integral of (s - w1) (-H'(s)) ds from w1 to w,
    P2 = integral of (w2 - s) (-H'(s)) ds from w to w2,    H(1 / r^2) = r^3 f(r),

where w1 and w2 belong to r_max and r_min, and L^2 = m times the mean of H over w. All terms are
positive where such motions exist (r^3 f increases with r), so nothing cancels: neither near
circles, where differences of energies would, nor for radii many powers of ten apart. The
substitution x = -log(r_max / r_min) cos^2(phi / 2), as in Chebyshev's rules, removes the square
roots at both ends.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.polynomial import legendre

from jaxdyn import _checks
from jaxdyn._checks import floats
from jaxdyn.effects import CentralForce

_ROUNDING = 1e-14  # size of 3 + n below which it counts as 0
_PANELS = 128
_ORDER = 16
_NODES, _WEIGHTS = legendre.leggauss(_ORDER)
_PHI = (np.arange(_PANELS)[:, None] + 0.5 * (1 + _NODES)) * np.pi / _PANELS
_HALF = 0.5 * np.pi / _PANELS


def _integrals_to_nodes() -> np.ndarray:
    """(k, k) weights of the integral of a polynomial from -1 to each Gauss node."""
    # An interpolant is the sum over n of (n + 1/2) P_n(x) sum_j w_j P_n(x_j) y_j.
    values = legendre.legvander(_NODES, _ORDER)
    integrals = np.empty((_ORDER, _ORDER))
    integrals[:, 0] = 1 + _NODES
    for n in range(1, _ORDER):
        integrals[:, n] = (values[:, n + 1] - values[:, n - 1]) / (2 * n + 1)
    scaled = integrals * (np.arange(_ORDER) + 0.5)
    return scaled @ (values[:, :_ORDER] * _WEIGHTS[:, None]).T


_TO_NODES = _integrals_to_nodes()
_FROM_NODES = _TO_NODES[::-1, ::-1]  # to +1, by symmetry


class Apsides(NamedTuple):
    """A motion between two radii, from the nearest to the farthest point.

    Attributes:
      angle: () angle about the centre [rad].
      time: () duration [s].
      momentum: () angular momentum [kg m^2/s].
    """

    angle: Array
    time: Array
    momentum: Array


def apsides(law: CentralForce, depth, r_max=1.0, m=1.0) -> Apsides:
    """The angle and time between the nearest and the farthest point of an orbit of a given shape.

    Args:
      law: the force; its attraction and the derivative of the attraction are used.
      depth: () shape of the orbit, log(r_max / r_min), > 0. Near circles it retains digits that
        the ratio of the radii has lost.
      r_max: largest distance [m].
      m: mass [kg].
    Returns:
      The numbers; NaN where no orbit exists between these radii.
    Limits: smooth laws; a power law r^n to 1e-13 for -3 < n < 1000 and depths from 1e-8 to 100.
    Example:
      >>> import math
      >>> from jaxdyn.effects import PowerLaw
      >>> found = apsides(PowerLaw(1.0, -2.0), math.log(1e12))
      >>> round(float(found.angle / math.pi), 12), round(float(found.time), 9)  # half an ellipse
      (1.0, 1.110720735)
    """
    depth, r_max, m = floats(depth, r_max, m)
    below, above = depth * np.sin(0.5 * _PHI) ** 2, depth * np.cos(0.5 * _PHI) ** 2
    r = r_max * jnp.exp(-above)
    f, slope = jax.vmap(jax.vmap(lambda r: jax.jvp(law.attraction, (r,), (jnp.ones_like(r),))))(r)
    dx = 0.5 * depth * np.sin(_PHI)
    steepness = 3 * r * f + r * r * slope
    steepness = jnp.where(jnp.abs(steepness) > _ROUNDING * jnp.abs(r * f), steepness, 0.0) * dx
    far, near = -jnp.expm1(-2 * above), jnp.expm1(2 * below)  # (w - w1) / w, (w2 - w) / w
    parts = near * _up_to_end(steepness * far) + far * _from_start(steepness * near)
    gain = 2 * _HALF * jnp.sum(r * f * dx @ _WEIGHTS)
    # With a repulsion two signs change, which would give the angle for the attraction; for r^-3 the
    # slope of r^3 f vanishes.
    root = jnp.sqrt(jnp.where((gain > 0) & (parts > 0), parts / gain, jnp.nan))
    momentum = r_max * jnp.sqrt(m * gain / jnp.expm1(2 * depth))
    angle = _HALF * jnp.sum(dx / root @ _WEIGHTS)
    time = _HALF * jnp.sum(r * r * dx / root @ _WEIGHTS) * m / momentum
    return Apsides(angle, time, momentum)


def _from_start(values: Array) -> Array:
    """(p, k) integrals, over phi from 0 to each node, of a function with these values."""
    whole = jnp.cumsum(values @ _WEIGHTS)
    before = jnp.concatenate([jnp.zeros(1), whole[:-1]])
    return _HALF * (before[:, None] + values @ _TO_NODES.T)


def _up_to_end(values: Array) -> Array:
    """(p, k) integrals, over phi from each node to pi, of a function with these values."""
    whole = jnp.cumsum((values @ _WEIGHTS)[::-1])[::-1]
    after = jnp.concatenate([whole[1:], jnp.zeros(1)])
    return _HALF * (after[:, None] + values @ _FROM_NODES.T)


def apsidal_angle(law: CentralForce, r_min, r_max) -> Array:
    """() [rad] angle about the centre from the nearest to the farthest point of an orbit.

    The mass has no influence. An orbit with angle pi p / q, in lowest terms, closes after p turns
    with q loops.

    Args:
      law: see `apsides`.
      r_min: smallest distance [m].
      r_max: largest distance [m], > r_min.
    Returns:
      The angle; pi / 2 for a spring, pi for gravity, about pi / sqrt(3 + n) near a circle.
      NaN where no orbit exists between these radii.
    Limits: see `apsides`.
    Example:
      >>> from jaxdyn.effects import PowerLaw
      >>> print(round(float(apsidal_angle(PowerLaw(1.0, -2.0), 0.5, 1.0)), 12))
      3.14159265359
    """
    r_min, r_max = floats(r_min, r_max)
    if not _checks.is_traced((r_min, r_max)) and not bool((0 < r_min) & (r_min < r_max)):
        raise _checks.fail("r_max", f"above r_min = {r_min} > 0", r_max, "They are distances.")
    # log1p: the difference of near radii is exact, their ratio is not.
    return apsides(law, jnp.log1p((r_max - r_min) / r_min), r_max).angle


def apsidal_limits(n) -> tuple[np.ndarray | np.floating, np.ndarray]:
    """The apsidal angles over pi, under power laws r^n, of orbits near circles and near lines.

    The limits are 1 / sqrt(3 + n) near circles, and near lines 1/2 or, for n < -1, 1 / (3 + n).
    Between them the angle is a monotonic function of the shape, from circle to line, so each number
    strictly between the two belongs to exactly one shape, and any other number to none. For n = 1
    and n = -2 the limits are equal: all orbits close (Bertrand).

    Args:
      n: () or (m,) exponents.
    Returns:
      Both limits, of the shape of n; NaN for n <= -3, where no orbit exists between two radii.
    Reference: R. Castelli (2015), The monotonicity of the apsidal angle in power-law potential
      systems, Journal of Mathematical Analysis and Applications 428, 653-676.
    """
    n = np.asarray(n, float)
    bound = np.where(n > -3, 3 + n, np.nan)
    return 1 / np.sqrt(bound), np.where(n < -1, 1 / bound, 0.5 + 0 * bound)
