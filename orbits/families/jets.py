"""Taylor series of a return map along a curve of starts, to third order.

The coefficients of a motion in a small number e, y0 + e y1 + e^2 y2 + e^3 y3, are integrated
together as one system, with the exact coefficients of the rate. In an autonomous scene each motion
of the curve is then moved along the flow by a time, itself a series in e, to the plane through the
start of the orbit across its flow.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, System
from orbits.motion import quick_solve
from orbits.orbit import Orbit

ORDER = 3


def _coefficients(function, order: int = ORDER) -> Array:
    """(order + 1, k) Taylor coefficients at 0 of a function of one number."""
    values, factorial = [function], 1.0
    for _ in range(order):
        before = values[-1]

        def derivative(e, before=before):
            return jax.jvp(before, (e,), (jnp.ones(()),))[1]

        values.append(derivative)
    rows = []
    for n, value in enumerate(values):
        factorial *= max(n, 1)
        rows.append(value(jnp.zeros(())) / factorial)
    return jnp.stack(rows)


def _series(coefficients: Array, e: Array) -> Array:
    powers = jnp.stack([e**n if n else jnp.ones(()) for n in range(len(coefficients))])
    return powers @ coefficients


class Jets(System):
    """The Taylor coefficients in e of a motion of a scene, as one state (4 k,)."""

    scene: Scene

    def labels(self):
        # Coefficients of one entry are alike, also without a unit: some are zero, or rounding.
        known = [
            (name, f"that of {name}" if unit == "1" else unit) for name, unit in self.scene.labels()
        ]
        return tuple((f"{name} {n}", unit) for n in range(ORDER + 1) for name, unit in known)

    def rate(self, t, y, effects):
        del effects
        y = y.reshape(ORDER + 1, -1)
        return _coefficients(lambda e: self.scene.rate(t, _series(y, e))).ravel()


@jax.jit
def _carry(scene: Scene, curve: Array, period: Array, rtol) -> Array:
    run = quick_solve(Scene(Jets(scene), y0=curve.ravel()), period, rtol=rtol)
    return run.y1.reshape(curve.shape)


@jax.jit
def _return_curve(scene: Scene, curve: Array, each: Array) -> Array:
    """A curve of states (4, k) moved along the flow to the plane through the scene's start.

    It is across the flow there where entries are in sizes (k,).
    """
    y0 = scene.y0
    normal = scene.rate(jnp.zeros(()), y0) / each**2

    def rate(y):
        return scene.rate(jnp.zeros(()), y)

    def second(y):
        return jax.jvp(rate, (y,), (rate(y),))[1]

    def third(y):
        return jax.jvp(second, (y,), (rate(y),))[1]

    def moved(times, e):
        y, t = _series(curve, e), _series(times[:, None], e)[0]
        return y + t * (rate(y) + t / 2 * (second(y) + t / 3 * third(y)))

    times = jnp.zeros(ORDER + 1)
    for n in range(1, ORDER + 1):
        off = _coefficients(lambda e, times=times: moved(times, e) - y0)[n] @ normal
        times = times.at[n].set(-off / (rate(y0) @ normal))
    return _coefficients(lambda e: moved(times, e))


def basis(orbit: Orbit, driven: bool, each: np.ndarray) -> np.ndarray:
    """(k, d) coordinates of starts: all of them, or those across the flow.

    They are orthonormal where entries are in sizes `each` (k,).
    """
    if driven:
        return np.diag(each)
    flow = np.asarray(orbit.scene.rate(jnp.zeros(()), jnp.asarray(orbit.y0)))
    return each[:, None] * np.linalg.svd((flow / each)[None])[2][1:].T


def return_coefficients(
    orbit: Orbit, axes: np.ndarray, each: np.ndarray, u1, u2, rtol: float, driven: bool
) -> np.ndarray:
    """(3, d) coefficients of e, e^2, e^3 of the return of the starts e u1 + e^2 u2.

    Args:
      orbit: an orbit that returns after its period.
      axes: (k, d) `basis`.
      each: (k,) the sizes that it is in.
      u1: (d,) coordinates.
      u2: (d,) coordinates.
      rtol: tolerance of the integration.
      driven: whether the rate depends on time.
    """
    y0 = np.asarray(orbit.y0)
    curve = jnp.asarray(np.stack([y0, axes @ u1, axes @ u2, np.zeros(len(y0))]))
    end = _carry(orbit.scene, curve, jnp.asarray(orbit.period), rtol)
    if not driven:
        # Its constant is the start up to the closing error, which would move the plane.
        end = _return_curve(orbit.scene, end.at[0].set(jnp.asarray(y0)), jnp.asarray(each))
    return np.asarray(end[1:]) / each @ (axes / each[:, None])
