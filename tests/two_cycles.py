"""A planar system with two cycles in closed form; a module of its own, which workers import.

r' = -g r (r^2 - 1)(r^2 - 4), angle' = 1 + r^2: an unstable cycle at r = 1 of period pi, whose
multiplier is e^(6 pi g), and a stable one at r = 2 of period 2 pi / 5 and e^(-48 pi g / 5).
"""

import jax.numpy as jnp

from jaxdyn import Scene, System

G = 0.05


class TwoCycles(System):
    def labels(self):
        return (("x", "1"), ("y", "1"))

    def rate(self, t, y, effects):
        square = y @ y
        out = -G * (square - 1) * (square - 4)
        return out * y + (1 + square) * jnp.stack([-y[1], y[0]])


def two_cycles():
    return Scene(TwoCycles(), (), y0=jnp.array([1.5, 0.0]), t1=4.0)
