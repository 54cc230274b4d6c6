"""The Henon-Heiles model: a planar well whose motions are regular or chaotic."""

from typing import ClassVar

import jax.numpy as jnp

from jaxdyn import _checks
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Effect, Scene
from jaxdyn.scenes.ready_made import ready_made


class TriangularWell(Effect):
    """The potential (x^2 + y^2) / 2 + x^2 y - y^3 / 3 for each point of a planar system."""

    velocity_dependent: ClassVar[bool] = False
    without_units: ClassVar[bool] = True

    def potential(self, t, r, m):
        del t, m
        x, y = r[:, 0], r[:, 1]
        return jnp.sum(0.5 * (x * x + y * y) + x * x * y - y**3 / 3)

    def check(self, points):
        if points.r.shape[1] != 2:
            raise _checks.fail(
                "TriangularWell", "points of the plane", f"{points.r.shape[1]} coordinates"
            )


@ready_made()
def henon_heiles(*, x=0.0, y=0.1, vx=0.49057788, vy=0.0, t1=30.0) -> Scene:
    """The Henon-Heiles model of a star in a galaxy, chaotic from an energy of about 1/9 on.

    Motions in the triangle between the three saddles with an energy below 1/6, the height of the
    saddles, stay there. Henon and Heiles (1964), Astronomical Journal 69, 73.

    Args:
      x: initial x [1].
      y: initial y [1].
      vx: initial vx [1].
      vy: initial vy [1].
      t1: span [1].
    """
    return Scene(FreePoints([1.0]), (TriangularWell(),), y0=jnp.stack([x, y, vx, vy]), t1=t1)
