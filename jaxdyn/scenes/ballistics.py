"""A ball thrown with linear drag, in closed form: course problem 9.

With the relaxation time tau = m / c, the terminal velocity g tau and the launch speed in units of
it, u = v0 / (g tau), everything is a function of u and the launch angle.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import nan_unless

_NEWTON_STEPS = 7  # from the starts below five steps reach rounding; derivatives need one more


def cannonball_linear_exact(
    t, *, speed=10.0, angle=math.pi / 4, m=1.0, g=9.81, linear=1.0
) -> Array:
    """(..., 4) state x, y, vx, vy of the ball with linear drag at times t (...) (problem 9 a).

    With the relaxation time tau = m / c and the terminal velocity -g tau,

        x = tau vx0 (1 - e^(-t/tau)),   y = tau (vy0 + g tau) (1 - e^(-t/tau)) - g tau t.

    As the speed grows, the path tends to a triangle (9 d): a straight line at the launch angle, of
    length tau v0, and a fall that is vertical on that scale.

    Args:
      t: times [s].
      speed: launch speed [m/s].
      angle: launch angle above the horizontal [rad].
      m: mass [kg].
      g: gravity [m/s^2].
      linear: coefficient of the drag [kg/s], not 0.
    """
    t = jnp.asarray(t, dtype=float)
    tau = m / linear
    vx, vy = speed * jnp.cos(angle), speed * jnp.sin(angle)
    gone = -jnp.expm1(-t / tau)
    left = jnp.exp(-t / tau)
    # y = tau vy0 (1 - e^-s) - g tau^2 (s - 1 + e^-s), with the second term free of cancellation.
    fall = g * tau * tau * _exp_remainder(t / tau)
    x, y = tau * vx * gone, tau * vy * gone - fall
    return jnp.stack([x, y, vx * left, vy * left - g * tau * gone], axis=-1)


def flight_time(*, speed=10.0, angle=math.pi / 4, m=1.0, g=9.81, linear=1.0) -> Array:
    """() time [s] until the ball with linear drag is back at its launch height (problem 9 d).

    With p = u sin(angle), s = t / tau is the positive root of s / (1 - e^-s) = 1 + p. The
    left side is convex and increasing, so Newton's method from an upper bound of the root
    converges monotonically for any speed. For other drags use `events.until`.

    Args:
      speed: launch speed [m/s].
      angle: launch angle above the horizontal [rad].
      m: mass [kg].
      g: gravity [m/s^2], > 0.
      linear: coefficient of the drag [kg/s], > 0.
    Returns:
      The time; NaN for a ball that is thrown downwards.
    Raises:
      ValueError: `g`, `linear` or `m` is not positive.
    Example:
      >>> round(float(flight_time(speed=20.0, angle=1.0)), 12)
      2.490505966538
    """
    tau = _relaxation(m, g, linear)
    p = jnp.asarray(speed, dtype=float) * jnp.sin(angle) / (g * tau)
    up = p > 0
    p = nan_unless(up, p)
    s = jnp.minimum(2 * p, 1 + p)
    for _ in range(_NEWTON_STEPS):
        gone, rest = -jnp.expm1(-s), _exp_remainder(s)
        # (s / gone - 1 - p) over its slope, both multiplied by gone^2.
        s = s - gone * (rest - p * gone) / (s * gone - rest)
    return tau * s


def best_angle(*, speed=10.0, m=1.0, g=9.81, linear=1.0) -> Array:
    """() launch angle [rad] of the longest range with linear drag (problem 9 e).

    The range tau v0 cos(angle) (1 - e^-s) is stationary where sin(angle) = u / (e^s - 1), and with
    the equation of `flight_time` that leaves u^2 = e^s (s - 1 + e^-s) for the time of flight
    s tau. The logarithm of the right side is convex and increasing in log(s), so Newton's method
    works here, too. The angle is 45 degrees at u = 0; it decreases with u and tends to 0 like
    log(u^2) / u.

    Args:
      speed: launch speed [m/s].
      m: mass [kg].
      g: gravity [m/s^2], > 0.
      linear: coefficient of the drag [kg/s], > 0.
    Raises:
      ValueError: `g`, `linear` or `m` is not positive.
    Example:
      >>> round(float(best_angle(speed=100.0)), 4)
      0.2735
    """
    tau = _relaxation(m, g, linear)
    u = jnp.asarray(speed, dtype=float) / (g * tau)
    s = jnp.minimum(jnp.sqrt(2.0) * u, 1 + jnp.log1p(u * u))
    for _ in range(_NEWTON_STEPS):
        rest = _exp_remainder(s)
        excess = s + jnp.log(rest / (u * u))
        s = s * jnp.exp(-excess / (s - s * jnp.expm1(-s) / rest))
    return jnp.arcsin(u / jnp.expm1(s))


def _relaxation(m, g, linear) -> Array:
    """The relaxation time m / c [s], from checked numbers."""
    _checks.positive("g", g, "Without gravity it never comes down.")
    _checks.positive("linear", linear, "Without drag the path is a parabola.")
    return _checks.positive("m", m, "Masses are in kg.") / linear


def _exp_remainder(s: Array) -> Array:
    """s - 1 + e^-s, to full precision also for small s."""
    small = jnp.abs(s) < 0.5
    x = jnp.where(small, s, 0.0)
    series = jnp.ones_like(x)
    for k in range(14, 2, -1):  # Horner's rule: x^2/2 (1 - x/3 (1 - x/4 (...)))
        series = 1.0 - x / k * series
    return jnp.where(small, 0.5 * x * x * series, s + jnp.expm1(-s))
