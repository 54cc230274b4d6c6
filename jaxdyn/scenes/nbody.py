"""Bodies that attract each other by Newton's law: course problems 16, 17, 28."""

import jax.numpy as jnp

from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Scene

#: Problem 28: a rough guess of a figure-eight, order x1 y1 x2 y2 x3 y3 vx1 vy1 ... [G = m = 1]
EIGHT_GUESS = (-0.755, 0.355, 1.155, -0.0755, -0.4055, -0.3055)
EIGHT_GUESS += (0.9955, 0.07855, 0.1055, 0.4755, -1.1055, -0.5355)
#: Problem 28: the period that goes with it.
EIGHT_GUESS_PERIOD = 8.0
#: Problem 17: Montgomery's eight as printed there, 8 digits.
EIGHT = (-0.97000436, 0.24308753, 0.97000436, -0.24308753, 0.0, 0.0)
EIGHT += (-0.93240737 / 2, -0.86473146 / 2, -0.93240737 / 2, -0.86473146 / 2)
EIGHT += (0.93240737, 0.86473146)
#: Its period, to the digits the printed start has.
EIGHT_PERIOD = 6.3259140


def three_body(y0=EIGHT, *, m=(1.0, 1.0, 1.0), G=1.0, t1=EIGHT_PERIOD) -> Scene:
    """Three bodies in a plane under Newtonian gravity (problems 17, 28).

    Args:
      y0: (12,) x1 y1 x2 y2 x3 y3 vx1 vy1 vx2 vy2 vx3 vy3; the figure-eight if left out.
      m: (3,) masses.
      G: gravitational constant.
      t1: span; one period of the eight if left out.
    """
    return Scene(FreePoints(m, d=2), (PairGravity(G),), y0=jnp.asarray(y0), t1=t1)
