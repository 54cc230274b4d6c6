"""When a shaking base stabilises an inverted pendulum: chart and theory (problem 29).

Near upright, on a base at -A cos(w t),

    theta'' = (g + A w^2 cos(w t)) theta / L,

with L the length of the equivalent point pendulum, 2/3 of that of a uniform stick. With
tau = w t / 2 that is Mathieu's equation theta'' + (a - 2 q cos(2 tau)) theta = 0,

    a = -4 g / (L w^2),    q = 2 A / L

(the sign of q does not matter). It is stable between Mathieu's characteristic values a_0(q) and
b_1(q), and in thin tongues between a_n(q) and b_(n+1)(q) at large amplitudes. Fast shaking of
small amplitude, averaged over a period, is stable from (A w)^2 = 2 g L on (a_0 = -q^2 / 2).
"""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import as_float, floats
from jaxdyn.analysis.floquet import Chart, chart, edges
from jaxdyn.analysis.monodromy import RTOL
from jaxdyn.scene import Scene
from jaxdyn.scenes.pendula import shaken_pendulum


class Upright(eqx.Module):
    """A stick upright on a shaking base: (amplitude, frequency) -> scene and period."""

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
      amplitudes: (a,) of the base [m].
      frequencies: (b,) of the base, > 0 [rad/s].
      length: of the stick [m].
      g: gravity [m/s^2].
      uniform: whether the stick is uniform; otherwise a point mass at its end.
      rtol: relative tolerance of a step.
    Returns:
      Verdicts, multipliers and growth rates (a, b); `drawing.stability_chart` draws them.
    Raises:
      ValueError: `length` or a frequency is not positive, or a number is not finite.
    Example:
      >>> from jaxdyn.studies import upright
      >>> upright.upright_chart([0.05, 0.1], [20.0, 60.0]).verdict.tolist()
      [['unstable', 'unstable'], ['unstable', 'stable']]
    """
    _checks.positive("length", length, "Lengths are in m.")
    _checks.positive("frequencies", frequencies, "In rad/s.")
    make = Upright(as_float(length), as_float(g), uniform)
    return chart(make, amplitudes, frequencies, rtol=rtol)


def stability_edges(frequency, *, up_to=None, length=1.0, g=9.81, uniform=True) -> np.ndarray:
    """(n,) amplitudes [m] at which upright becomes stable, unstable, stable ..., in order.

    The first is where the shaking begins to stabilise the stick (Mathieu's a_0), the second where
    it destabilises it again (b_1).

    Args:
      frequency: of the base [rad/s].
      up_to: largest amplitude considered [m]; the length of the stick by default.
      length: of the stick [m].
      g: gravity [m/s^2].
      uniform: whether the stick is uniform; otherwise a point mass at its end.
    Raises:
      ValueError: `length` or `frequency` is not positive.
    Limits: see `floquet.edges`.
    Example:
      >>> from jaxdyn.studies import upright
      >>> [f"{edge:.7f}" for edge in upright.stability_edges(60.0)]
      ['0.0603848', '0.3072533']
    """
    _checks.positive("length", length, "Lengths are in m.")
    _checks.positive("frequency", frequency, "In rad/s.")
    make = Upright(as_float(length), as_float(g), uniform)
    return edges(make, (0.0, length if up_to is None else up_to), frequency)


def mathieu_numbers(
    amplitude, frequency, *, length=1.0, g=9.81, uniform=True
) -> tuple[Array, Array]:
    """a and q () of Mathieu's equation for a stick upright on a shaking base.

    Args:
      amplitude: of the base [m].
      frequency: of the base [rad/s].
      length: of the stick [m].
      g: gravity [m/s^2].
      uniform: whether the stick is uniform; otherwise a point mass at its end.
    """
    L = _reduced_length(length, uniform)
    amplitude, frequency = floats(amplitude, frequency)
    return -4 * g / (L * frequency**2), 2 * amplitude / L


def averaged_limit(frequency, *, length=1.0, g=9.81, uniform=True) -> Array:
    """() smallest stabilising amplitude [m], in the limit of fast shaking of small amplitude.

    sqrt(2 g L) / w. The true one is larger by a relative order of (A / L)^2.

    Args:
      frequency: of the base [rad/s].
      length: of the stick [m].
      g: gravity [m/s^2].
      uniform: whether the stick is uniform; otherwise a point mass at its end.
    """
    return jnp.sqrt(2 * g * _reduced_length(length, uniform)) / jnp.asarray(frequency, dtype=float)


def _reduced_length(length, uniform: bool) -> Array:
    return jnp.asarray(length, dtype=float) * (2 / 3 if uniform else 1.0)
