"""One particle, thrown: course problems 1, 9, 12, 27."""

import math

from jaxdyn.effects import QuadraticDrag, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Scene


def cannonball(*, speed=10.0, angle=math.pi / 4, m=1.0, g=9.81, drag=0.0, t1=1.0) -> Scene:
    """A ball thrown from the origin over level ground, x to the right and y up.

    Args:
      speed: launch speed [m/s].
      angle: launch angle above the horizontal [rad].
      m: mass [kg].
      g: gravity [m/s^2].
      drag: coefficient c of the drag c |v| v [kg/m]; exactly 0 leaves the effect out.
      t1: span [s].
    """
    y0 = (0.0, 0.0, speed * math.cos(angle), speed * math.sin(angle))
    scene = Scene(FreePoints(m, d=2), (UniformGravity(g),), y0=y0, t1=t1)
    return scene + QuadraticDrag(drag) if drag else scene
