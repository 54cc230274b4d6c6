"""Kepler's equation: the true anomaly of a body from its mean anomaly, and back.

M = E - e sin E on an ellipse, and M = e sinh F - F on a hyperbola. Both sides are written as
(1 - e) E + e (E - sin E), of positive terms, so that no digits cancel near the pericentre of long
orbits. Newton's method begins above the solution, where the function is convex, so that it
converges to it from one side.

Reference: Curtis (2014), Orbital Mechanics for Engineering Students, sections 3.4 and 3.6.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._checks import numbers

#: Number of steps of Newton's method. From a bound that is at most 1.3 times too large, or from
#: M + e, it needs less than half of them.
_STEPS = 20
#: Below this angle x - sin x is the sum of a series, with this number of terms.
_SMALL, _TERMS = 1.0, 9


def true_anomaly(mean, e) -> Array:
    """(...) the true anomaly [rad] at a mean anomaly.

    From 0 to 2 pi on an ellipse, from -pi to pi on a hyperbola; NaN on a parabola, whose mean
    anomaly has another definition.

    Args:
      mean: (...) mean anomaly [rad]: on an ellipse 2 pi times the time since the pericentre over
        the period, on a hyperbola sqrt(mu / |a|^3) times that time.
      e: (...) eccentricity, not negative.
    Example:
      >>> from jaxdyn.analysis.kepler import mean_anomaly, true_anomaly
      >>> round(float(true_anomaly(1.0, 0.5)), 6)
      2.030806
      >>> round(float(mean_anomaly(true_anomaly(1.0, 0.5), 0.5)), 6)
      1.0
    """
    mean, e = jnp.broadcast_arrays(numbers("mean", mean), numbers("e", e))
    within, beyond = _eccentricities(e)
    turned = mean - 2 * jnp.pi * jnp.round(mean / (2 * jnp.pi))
    side = _side(turned)
    half = 0.5 * side * _eccentric(side * turned, within)
    ellipse = 2 * jnp.arctan2(
        jnp.sqrt(1 + within) * jnp.sin(half), jnp.sqrt(1 - within) * jnp.cos(half)
    )
    side = _side(mean)
    half = 0.5 * side * _hyperbolic(side * mean, beyond)
    hyperbola = 2 * jnp.arctan(jnp.sqrt((beyond + 1) / (beyond - 1)) * jnp.tanh(half))
    return _of_kind(e, jnp.mod(ellipse, 2 * jnp.pi), hyperbola)


def mean_anomaly(anomaly, e) -> Array:
    """(...) the mean anomaly [rad] at a true anomaly; see `true_anomaly`.

    From 0 to 2 pi on an ellipse; NaN beyond the asymptotes of a hyperbola.

    Args:
      anomaly: (...) true anomaly [rad].
      e: (...) eccentricity, not negative.
    """
    anomaly, e = jnp.broadcast_arrays(numbers("anomaly", anomaly), numbers("e", e))
    within, beyond = _eccentricities(e)
    half = 0.5 * anomaly
    eccentric = 2 * jnp.arctan2(
        jnp.sqrt(1 - within) * jnp.sin(half), jnp.sqrt(1 + within) * jnp.cos(half)
    )
    ellipse = (1 - within) * eccentric + within * _excess(eccentric, jnp.sin, -1.0)
    tangent = jnp.tan(jnp.where(e > 1, half, 0.0))  # of ellipses the derivative would be NaN
    hyperbolic = 2 * jnp.arctanh(jnp.sqrt((beyond - 1) / (beyond + 1)) * tangent)
    hyperbola = (beyond - 1) * hyperbolic + beyond * _excess(hyperbolic, jnp.sinh, 1.0)
    return _of_kind(e, jnp.mod(ellipse, 2 * jnp.pi), hyperbola)


def _eccentricities(e: Array) -> tuple[Array, Array]:
    """Those of ellipses and those of hyperbolas, with any number of the kind in place of others."""
    return jnp.where(e < 1, e, 0.5), jnp.where(e > 1, e, 2.0)


def _side(mean: Array) -> Array:
    """-1 before the pericentre, 1 after it; also at 0, where a sign of 0 has no derivative."""
    return jnp.where(mean < 0, -1.0, 1.0)


def _of_kind(e: Array, ellipse: Array, hyperbola: Array) -> Array:
    found = jnp.where(e < 1, ellipse, jnp.where(e > 1, hyperbola, jnp.nan))
    return jnp.where(e < 0, jnp.nan, found)


def _eccentric(mean: Array, e: Array) -> Array:
    """(...) the eccentric anomaly at a mean anomaly from 0 to pi."""

    def kepler(x):
        slope = (1 - e) + 2 * e * jnp.sin(0.5 * x) ** 2
        return (1 - e) * x + e * _excess(x, jnp.sin, -1.0), slope

    # x - sin x is at least x^3 / 12 up to pi.
    bounds = mean / (1 - e), jnp.cbrt(12 * mean / jnp.where(e > 0, e, 1e-300)), mean + e
    return _root(kepler, mean, jnp.minimum(jnp.minimum(*bounds[:2]), bounds[2]))


def _hyperbolic(mean: Array, e: Array) -> Array:
    """(...) the hyperbolic anomaly at a mean anomaly that is not negative."""

    def kepler(x):
        slope = (e - 1) + 2 * e * jnp.sinh(0.5 * x) ** 2
        return (e - 1) * x + e * _excess(x, jnp.sinh, 1.0), slope

    bounds = jnp.arcsinh(mean / (e - 1)), jnp.cbrt(6 * mean / e)
    return _root(kepler, mean, jnp.minimum(*bounds))


def _root(function: Callable, value: Array, above: Array) -> Array:
    """(...) where a convex increasing function has a value, from a bound above."""

    def step(x: Array) -> Array:
        found, slope = function(x)
        return x - (found - value) / slope

    x = jax.lax.fori_loop(0, _STEPS, lambda _, x: step(x), above)
    # Each of the last steps has one more derivative of the solution.
    return step(step(jax.lax.stop_gradient(x)))


def _excess(x: Array, function: Callable, sign: float) -> Array:
    """(...) x - sin x with the sign -1, or sinh x - x with the sign 1, without cancellation."""
    small = jnp.abs(x) < _SMALL
    square, series = jnp.where(small, x * x, 0.0), jnp.ones_like(x)
    for n in range(_TERMS, 0, -1):
        series = 1 + sign * square / ((2 * n + 2) * (2 * n + 3)) * series
    return jnp.where(small, x**3 / 6 * series, sign * (function(x) - x))
