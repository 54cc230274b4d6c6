"""A pendulum in an unsuitable coordinate, and where this becomes singular: course problem 24."""

import math

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first, floats
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.choice import route
from jaxdyn.integrate.events import Event, Stop, until
from jaxdyn.integrate.simulation import RTOL
from jaxdyn.mechanisms.sticks import Sideways
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made


class Edge(Event):
    """The mass of a sideways pendulum rises to a depth (over the length [1]) below the hinge."""

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
    """A pendulum in its horizontal position, an unsuitable coordinate (problem 24).

    This position, y in the course, is x here. It determines the position of the mass only below the
    hinge. A motion that swings up to the level of the hinge reaches abs(x) = length with zero rate,
    where the acceleration is 0 / 0 and the continuation is not determined; the motion ends there
    with a status and NaN. `sideways_edge` finds the time.

    Args:
      length: length of the rod [m].
      m: mass [kg].
      g: gravity [m/s^2].
      angle: angle at the start, from hanging down, less than a quarter turn [rad].
      rate: rate of the angle at the start [rad/s].
      formulation: "newton_euler" or "lagrange".
      t1: span [s].
    """
    if not _checks.is_traced(angle) and not abs(angle) < math.pi / 2:
        remedy = "Higher up the position does not say where the mass is; take `pendulum`."
        raise _checks.fail("angle", "less than a quarter turn", angle, remedy)
    q, v = length * jnp.sin(angle), length * jnp.cos(angle) * rate
    system, y0 = route(formulation, Sideways(*floats(m, length)), [q], [v], {})
    return Scene(system, (UniformGravity(g),), y0=y0, t1=t1)


@check_first
def sideways_edge(scene: Scene, t1=None, *, margin=1e-3, rtol: float = RTOL) -> Stop:
    """Time and state where a `sideways_pendulum` reaches the edge of its coordinate.

    The edge itself, abs(x) = length, is only touched, with an acceleration of 0 / 0. The event is
    therefore at a small depth below the hinge, margin times length. By comparison with a simulation
    of the angle, its time is accurate to 1e-14 at a margin of 1e-3 and to 1e-13 at 1e-4 (rtol
    1e-13, length 0.8 m).

    Args:
      scene: a `sideways_pendulum`.
      t1: () end of the span [s]; that of the scene by default.
      margin: ratio of the depth below the hinge to the length [1], between 0 and 1.
      rtol: see `simulate`.
    Returns:
      The stop: ``stop.event`` is -1 for a swing that stays below; the sign of x at the event
      gives the side.
    Raises:
      ValueError: `scene` is not a `sideways_pendulum`, or `margin` is not between 0 and 1.
    Example:
      >>> from jaxdyn.scenes import sideways_edge, sideways_pendulum
      >>> [sideways_edge(sideways_pendulum(rate=r)).happened for r in (1.0, 6.0)]
      [False, True]
    """
    stick = getattr(scene.system, "mechanism", None)
    if not isinstance(stick, Sideways):
        raise _checks.fail("scene", "a sideways_pendulum", type(scene.system).__name__)
    if not _checks.is_traced(margin) and not 0 < margin < 1:
        raise _checks.fail("margin", "between 0 and 1", margin, "It is a fraction of the length.")
    level = Edge(stick.l, jnp.asarray(margin, dtype=float))
    return until(scene, level, t1, rtol=rtol)
