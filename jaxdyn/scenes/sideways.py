"""A pendulum by an awkward coordinate, and the edge where that ends: course problem 24."""

import math

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import floats
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.routes import route
from jaxdyn.integrate.events import Event, Stop, until
from jaxdyn.integrate.simulation import RTOL
from jaxdyn.mechanisms.sticks import Sideways
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made


class Edge(Event):
    """The mass of a sideways pendulum rises to a part of its length [1] below the hinge."""

    length: Array
    margin: Array

    def value(self, t, y):
        del t
        return 1 - (y[0] / self.length) ** 2 - self.margin**2

    @property
    def direction(self):
        return -1


@ready_made()
def sideways_pendulum(
    *,
    length=1.0,
    m=1.0,
    g=9.81,
    angle=1.0,
    rate=0.0,
    formulation="newton_euler",
    t1=10.0,
) -> Scene:
    """A pendulum by its horizontal position, an awkward coordinate (problem 24).

    The position, the course's y, is our x. It says where the mass is only while that hangs
    below the hinge. A motion that swings up to the level of the hinge comes to abs(x) = length with
    no speed, where the acceleration is 0 / 0 and the way on cannot be told from the way back: it
    ends there with a status, not with numbers. `sideways_edge` reports when.

    Args:
      length: of the rod [m].
      m: mass [kg].
      g: gravity [m/s^2].
      angle: at the start, from hanging down, less than a quarter turn [rad].
      rate: of the angle at the start [rad/s].
      formulation: "newton_euler" or "lagrange".
      t1: span [s].
    """
    if not _checks.is_traced(angle) and not abs(angle) < math.pi / 2:
        remedy = "Higher up the position does not say where the mass is; take `pendulum`."
        raise _checks.fail("angle", "less than a quarter turn", angle, remedy)
    q, v = length * jnp.sin(angle), length * jnp.cos(angle) * rate
    system, y0 = route(formulation, Sideways(*floats(m, length)), [q], [v], {})
    return Scene(system, (UniformGravity(g),), y0=y0, t1=t1)


def sideways_edge(scene: Scene, t1=None, *, margin=1e-3, rtol: float = RTOL) -> Stop:
    """When a `sideways_pendulum` comes to the edge of its coordinate, and the state then.

    The edge itself, abs(x) = length, is only touched, with an acceleration of 0 / 0. So the event
    is a small depth below the hinge, of margin times length. Against the angle the time is right
    to 1e-14 at a margin of 1e-3 and to 1e-13 at 1e-4 (rtol 1e-13, length 0.8 m).

    Args:
      scene: a `sideways_pendulum`.
      t1: () end of the span [s]; the scene's own if left out.
      margin: of the depth below the hinge to the length [1], between 0 and 1.
      rtol: see `simulate`.
    Returns:
      Where it stops: ``stop.event`` is -1 for a swing that stays below, and x > 0 or x < 0 at
      the event says on which side.
    Raises:
      ValueError: another scene, or a margin that is no part.
    Example:
      >>> from jaxdyn.scenes import sideways_edge, sideways_pendulum
      >>> [sideways_edge(sideways_pendulum(rate=r)).happened for r in (1.0, 6.0)]
      [False, True]
    """
    stick = getattr(scene.system, "mechanism", None)
    if not isinstance(stick, Sideways):
        raise _checks.fail("scene", "a sideways_pendulum", type(scene.system).__name__)
    if not _checks.is_traced(margin) and not 0 < margin < 1:
        raise _checks.fail("margin", "between 0 and 1", margin, "A part of the length.")
    level = Edge(stick.l, jnp.asarray(margin, dtype=float))
    return until(scene, level, t1, rtol=rtol)
