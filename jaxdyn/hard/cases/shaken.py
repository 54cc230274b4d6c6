"""Kapitza's pendulum, on a base that shakes ten thousand times in one swing.

Averaged over a period of the base (Landau, Lifshitz, Mechanics, section 30) it moves as if a spring
of stiffness m (A w)^2 / (2 L^2) pulled it to the vertical, besides gravity, up to relative errors
of (A / L)^2. The shaking adds a ripple of -(A / L) sin(theta) cos(w t) to the slow angle.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, floats
from jaxdyn.analysis.floquet import Chart, chart, edges
from jaxdyn.analysis.monodromy import RTOL, monodromy
from jaxdyn.hard.case import Case, Figure, absolute_error
from jaxdyn.integrate.simulation import simulate
from jaxdyn.scene import Effect, Scene
from jaxdyn.scenes.pendula import shaken_pendulum

_RTOL = 1e-12
_G, _LENGTH, _FAST = 9.81, 1.0, 1e4
_ABOVE = 1.5  # amplitude over the smallest stabilising amplitude
_SLOW = math.sqrt(_G / _LENGTH * (_ABOVE**2 - 1))  # angular frequency of small swings [rad/s]
_SAMPLES = 201
_NODES = 64


class UprightingSpring(Effect):
    """A spring of stiffness k [N/m] that pulls towards the vertical through the origin."""

    k: jax.Array
    velocity_dependent = False

    def potential(self, t, r, m):
        del t, m
        return 0.5 * self.k * jnp.sum(r[:, 0] ** 2)


def shaken(amplitude: float, frequency: float, angle: float = 0.0) -> Scene:
    """Kapitza's pendulum as a point mass on a massless stick, from an angle off upright."""
    numbers = {"length": _LENGTH, "g": _G, "uniform": False}
    return shaken_pendulum(amplitude=amplitude, frequency=frequency, angle=angle, **numbers)


def swing_period(speed: float, angle: float) -> float:
    """The period [s] of slow swings up to an angle, for a base with the largest speed A w = speed.

    With sin(theta) = sin(angle) sin(u) the energy gives a smooth function of u, whose mean over a
    quarter period the midpoint rule computes to rounding.
    """
    u = (np.arange(_NODES) + 0.5) * math.pi / (2 * _NODES)
    cosine = np.sqrt(1 - (math.sin(angle) * np.sin(u)) ** 2)
    held = (speed / (2 * _LENGTH)) ** 2 - _G / _LENGTH / (cosine + math.cos(angle))
    return float(2 * math.pi * np.mean(1 / (cosine * np.sqrt(2 * held))))


class Upright(eqx.Module):
    """A stick upright on a shaking base, as a function (amplitude, frequency) -> scene, period."""

    length: Array
    g: Array
    uniform: bool = eqx.field(static=True)

    def __call__(self, amplitude: Array, frequency: Array) -> tuple[Scene, Array]:
        """The scene at rest upright, and the period of its base."""
        numbers = {"length": self.length, "g": self.g, "uniform": self.uniform}
        scene = shaken_pendulum(angle=0.0, amplitude=amplitude, frequency=frequency, **numbers)
        return scene, 2 * math.pi / frequency


def upright_chart(
    amplitudes, frequencies, *, length=1.0, g=9.81, uniform=True, rtol: float = RTOL
) -> Chart:
    """Stability of an inverted pendulum on a shaking base, by Floquet multipliers.

    Args:
      amplitudes: (a,) amplitudes of the base [m].
      frequencies: (b,) frequencies of the base, > 0 [rad/s].
      length: length of the stick [m].
      g: gravity [m/s^2].
      uniform: whether the stick is uniform; otherwise a point mass at its end.
      rtol: relative tolerance of a step.
    Returns:
      Verdicts, multipliers and growth rates (a, b); `drawing.stability_chart` draws them.
    Raises:
      ValueError: `length` or a frequency is not positive, or a number is not finite.
    """
    _checks.positive("length", length, "Lengths are in m.")
    _checks.positive("frequencies", frequencies, "In rad/s.")
    make = Upright(as_float(length), as_float(g), uniform)
    return chart(make, amplitudes, frequencies, rtol=rtol)


def stability_edges(frequency, *, up_to=None, length=1.0, g=9.81, uniform=True) -> np.ndarray:
    """(n,) amplitudes [m] at which upright becomes stable and unstable in turn, in order.

    The first is where the shaking begins to stabilise the stick (Mathieu's a_0), the second where
    it destabilises it again (b_1).

    Args:
      frequency: frequency of the base [rad/s].
      up_to: largest amplitude considered [m]; the length of the stick by default.
      length: length of the stick [m].
      g: gravity [m/s^2].
      uniform: whether the stick is uniform; otherwise a point mass at its end.
    Raises:
      ValueError: `length` or `frequency` is not positive.
    Limits: see `floquet.edges`.
    """
    _checks.positive("length", length, "Lengths are in m.")
    _checks.positive("frequency", frequency, "In rad/s.")
    make = Upright(as_float(length), as_float(g), uniform)
    return edges(make, (0.0, length if up_to is None else up_to), frequency)


def mathieu_numbers(
    amplitude, frequency, *, length=1.0, g=9.81, uniform=True
) -> tuple[Array, Array]:
    """The numbers a and q () of Mathieu's equation for a stick upright on a shaking base.

    Args:
      amplitude: amplitude of the base [m].
      frequency: frequency of the base [rad/s].
      length: length of the stick [m].
      g: gravity [m/s^2].
      uniform: whether the stick is uniform; otherwise a point mass at its end.
    """
    L = reduced_length(length, uniform)
    amplitude, frequency = floats(amplitude, frequency)
    return -4 * g / (L * frequency**2), 2 * amplitude / L


def averaged_limit(frequency, *, length=1.0, g=9.81, uniform=True) -> Array:
    """() smallest stabilising amplitude [m], in the limit of fast shaking of small amplitude.

    It is sqrt(2 g L) / w. The true amplitude is larger by a relative order of (A / L)^2.

    Args:
      frequency: frequency of the base [rad/s].
      length: length of the stick [m].
      g: gravity [m/s^2].
      uniform: whether the stick is uniform; otherwise a point mass at its end.
    """
    return jnp.sqrt(2 * g * reduced_length(length, uniform)) / jnp.asarray(frequency, dtype=float)


def reduced_length(length, uniform: bool) -> Array:
    """() length [m] of the point-mass pendulum that swings as the stick does."""
    return jnp.asarray(length, dtype=float) * (2 / 3 if uniform else 1.0)


def _swings() -> tuple[Figure, ...]:
    frequency = _FAST * _SLOW
    amplitude = _ABOVE * float(averaged_limit(frequency, length=_LENGTH, g=_G, uniform=False))
    start, ripple = 0.3, amplitude / _LENGTH
    # The start is an extremum of the ripple; the slow angle is larger there.
    angle = start + ripple * math.sin(start)
    period = swing_period(amplitude * frequency, angle)
    shakes = np.round(np.linspace(0, 1.1 * period * frequency / (2 * math.pi), _SAMPLES))
    ts = 2 * math.pi / frequency * shakes
    fast = simulate(shaken(amplitude, frequency, start), ts[-1], samples=ts, rtol=_RTOL)
    pull = UprightingSpring(jnp.asarray((amplitude * frequency / _LENGTH) ** 2 / 2))
    slow = simulate(shaken(0.0, 1.0, angle) + pull, ts[-1], samples=ts, rtol=_RTOL)
    theta = np.asarray(slow.ys[:, 0])
    wanted = theta - ripple * np.sin(theta)
    returned = simulate(slow.scene, period, samples=1, rtol=_RTOL).ys[-1]
    return (
        Figure("angle, from the averaged one [rad]", absolute_error(fast.ys[:, 0], wanted), 1e-6),
        Figure("A / L", ripple),
        Figure("averaged swing, from its period", absolute_error(returned, slow.ys[0]), 1e-9),
        Figure("shakes", float(shakes[-1])),
        Figure("steps a shake", int(fast.steps) / float(shakes[-1])),
        Figure("steps averaged", int(slow.steps)),
    )


def _threshold() -> tuple[Figure, ...]:
    """The figures of the threshold: upright is stable if the trace of the monodromy is below 2."""
    frequency = _FAST * _SLOW
    limit = float(averaged_limit(frequency, length=_LENGTH, g=_G, uniform=False))

    @jax.jit
    def excess(amplitude):
        M = monodromy(shaken(amplitude, frequency), period=2 * math.pi / frequency)
        return jnp.trace(M) - 2

    low, high = 0.9 * limit, 1.1 * limit
    ends = float(excess(low)), float(excess(high))
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return (
        Figure("amplitude that holds, from sqrt(2 g L) / w", abs(high / limit - 1), 1e-6),
        Figure("stable below it", float(not ends[0] > 0), 0),
        Figure("unstable above it", float(not ends[1] < 0), 0),
        Figure("that amplitude [m]", high),
    )


CASES = (
    Case("kapitza", "A base shakes 10 000 times in one swing; the slow swing is right.", _swings),
    Case("kapitza-threshold", "Upright becomes stable where averaging predicts it.", _threshold),
)
