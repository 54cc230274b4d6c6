"""Coordinates that become singular during a motion, exchanged for others in time.

- Euler angles lock where the second turn makes the first and third axes parallel. Two sequences
  that differ only in their third turn never lock together: where ZXZ locks, ZXY is best.
- The x of a pendulum is singular at the level of its hinge, its y directly below and above the
  hinge. Four quarters, each with the coordinate that is regular there, cover the whole circle.
- Polar coordinates have no angle at the origin. Near it the particle is described by x and y.

Each such motion is a chain of phases (`jaxdyn.integrate.phases`) whose events are margins of the
coordinates, so the time of every exchange is reported. New coordinates remain good for a fraction
of a turn, so there is no switching back and forth.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.formulations.mechanism import MechanismSystem
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.formulations.polar import PolarParticle, polar_state
from jaxdyn.integrate.events import Event, Reaches
from jaxdyn.integrate.phase import Exit, Phase
from jaxdyn.integrate.phases import MAX_PHASES, HybridTrajectory, simulate_phases
from jaxdyn.integrate.simulation import RTOL
from jaxdyn.mechanisms.euler_body import EulerBody
from jaxdyn.mechanisms.sticks import Sideways
from jaxdyn.scene import Scene, System, check_scene

MARGIN = 0.5
_RETURN_RATIO = 1.2  # distance at which polar coordinates return over that at which x and y begin
_QUARTERS = {(0, -1): "below", (0, 1): "above", (1, -1): "left", (1, 1): "right"}


@check_first
def simulate_switching(
    scene: Scene,
    t1=None,
    *,
    t0: float = 0.0,
    samples: int = 100,
    rtol: float = RTOL,
    margin: float = MARGIN,
    max_phases: int = MAX_PHASES,
) -> HybridTrajectory:
    """The motion of a scene whose coordinates may become singular, in pieces with regular ones.

    Args:
      scene: a body in Euler angles (`EulerBody`), a `sideways_pendulum`, or a `polar_particle`.
      t1: () end time [s], after t0; that of the scene by default.
      t0: () start time [s].
      samples: number of samples of each piece.
      rtol: see `simulate`.
      margin: see `coordinate_phases`.
      max_phases: largest number of pieces.
    Returns:
      The pieces, each in its own coordinates; ``rigid.pose`` and ``piece.r`` do not depend on the
      coordinates. `HybridTrajectory.times` are the times of the exchanges; the last piece has the
      last state.
    Raises:
      ValueError: `scene` is of another kind, or `margin` is not between 0 and 0.7; see
        `simulate_phases` for the others.
    Example:
      >>> from jaxdyn import scenes
      >>> past = simulate_switching(scenes.polar_particle(position=(1.0, 0.0)), 2.0)
      >>> past.names
      ('polar', 'cartesian', 'polar')
    """
    phases = coordinate_phases(scene, margin)
    t1 = float(scene.t1 if t1 is None else t1)
    first = next(iter(phases))
    return simulate_phases(
        phases, first, scene.y0, t1, t0=t0, samples=samples, rtol=rtol, max_phases=max_phases
    )


@check_first
def coordinate_phases(scene: Scene, margin: float = MARGIN) -> dict[str, Phase]:
    """The phases, one for each choice of coordinates, for `simulate_phases`; the scene's own first.

    Args:
      scene: see `simulate_switching`.
      margin: margin of the coordinates at an exchange, between 0 and 0.7 [1]: the sine of the angle
        between the first and third axes of Euler angles; the depth below (or height above, or
        distance beside) the hinge over the length; or the distance from the origin over that at the
        start.
    Raises:
      ValueError: `scene` is of another kind, or `margin` is not between 0 and 0.7.
    """
    system = check_scene(scene).system
    if not 0 < margin < 0.7:
        remedy = "Above, the new coordinates could be as near to their end as the old ones."
        raise _checks.fail("margin", "between 0 and 0.7", margin, remedy)
    mechanism = system.mechanism if isinstance(system, MechanismSystem) else None
    if isinstance(mechanism, EulerBody):
        return _sequences(scene, mechanism, jnp.asarray(margin))
    if isinstance(mechanism, Sideways):
        return _quarters(scene, mechanism, margin)
    if isinstance(system, PolarParticle):
        return _around_the_origin(scene, margin * scene.y0[0])
    raise _checks.fail(
        "scene",
        "a body by Euler angles, a sideways_pendulum or a polar_particle",
        type(mechanism or system).__name__,
        "Other coordinates do not fail, or are not known here; integrate.phases.simulate_phases "
        "takes any phases.",
    )


# ---- Euler angles


class Locks(Event):
    """The sine of the angle between the first and third axes of Euler angles falls to a margin."""

    body: EulerBody
    margin: Array

    def value(self, t, y):
        del t
        middle = y[len(self.body.coordinates()) - 2]
        first, _, third = self.body.sequence
        sine = jnp.sin(middle) if first == third else jnp.cos(middle)
        return sine**2 - self.margin**2

    @property
    def direction(self):
        return -1


class InOtherAngles(eqx.Module):
    """The state with the same pose in the angles of another sequence."""

    old: EulerBody
    new: EulerBody

    def __call__(self, t: Array, y: Array) -> Array:
        """(k,) the state in the new angles."""
        del t
        return self.new.state(self.old.pose(*jnp.split(y, 2)))


@check_first
def complement(sequence: str) -> str:
    """The sequence that is best where this one locks.

    It differs in the third turn (for turns about the body's axes; in the first, for turns about
    those of the world). The axis of the first turn, fixed in space, has the cosines c and c' to the
    body's axes of the two last turns. One sequence locks at c^2 = 1, the other at c'^2 = 1, and
    c^2 + c'^2 <= 1.

    Example:
      >>> complement("ZXZ"), complement("XYZ"), complement("xyz")
      ('ZXY', 'XYX', 'zyz')
    """
    a, b, c = sequence if sequence.isupper() else sequence[::-1]
    (other,) = set("XYZ" if sequence.isupper() else "xyz") - {b, c}
    return a + b + other if sequence.isupper() else other + b + a


def _sequences(scene: Scene, body: EulerBody, margin: Array) -> dict[str, Phase]:
    by = complement(body.sequence)
    other = EulerBody(body.matter, by, pivoted=body.pivoted, drawn=body.drawn)

    def phase(old: EulerBody, new: EulerBody) -> Phase:
        return Phase(
            _with_mechanism(scene, old),
            (Exit(Locks(old, margin), new.sequence, InOtherAngles(old, new)),),
        )

    return {body.sequence: phase(body, other), other.sequence: phase(other, body)}


def _with_mechanism(scene: Scene, mechanism) -> Scene:
    return dataclasses.replace(scene, system=dataclasses.replace(scene.system, mechanism=mechanism))


# ---- A pendulum by x or y


class InOtherCoordinate(eqx.Module):
    """The state of the same point in its other cartesian coordinate."""

    system: System
    axis: int = eqx.field(static=True)

    def __call__(self, t: Array, y: Array) -> Array:
        """(2,) the coordinate and its rate."""
        r, v, _ = self.system.points(t, y)
        return jnp.stack([r[0, self.axis], v[0, self.axis]])


def _quarters(scene: Scene, stick: Sideways, margin: float) -> dict[str, Phase]:
    level = stick.l * (1 - margin**2) ** 0.5

    def phase(axis: int, side: int) -> Phase:
        # The side is an array, so that both sides share one compiled search.
        by = _with_mechanism(
            scene, Sideways(m=stick.m, l=stick.l, axis=axis, side=jnp.asarray(float(side)))
        )
        across = InOtherCoordinate(by.system, 1 - axis)
        exits = [
            Exit(Reaches(0, direction * level, direction), _QUARTERS[1 - axis, direction], across)
            for direction in (-1, 1)
        ]
        return Phase(by, tuple(exits))

    own = stick.axis, 1 if stick.side > 0 else -1
    order = (own, *(quarter for quarter in _QUARTERS if quarter != own))
    return {_QUARTERS[quarter]: phase(*quarter) for quarter in order}


# ---- Polar coordinates


class Leaves(Event):
    """A particle reaches a distance [m] from the origin on its way outwards."""

    far: Array

    def value(self, t, y):
        del t
        return jnp.sum(y[:2] ** 2) - self.far**2

    @property
    def direction(self):
        return 1


class ToCartesian(eqx.Module):
    """The state in x and y of a polar state."""

    particle: PolarParticle

    def __call__(self, t: Array, y: Array) -> Array:
        """(4,) position and velocity."""
        r, v, _ = self.particle.points(t, y)
        return jnp.concatenate([r[0], v[0]])


def to_polar(t: Array, y: Array) -> Array:
    """(4,) position and velocity in polar coordinates."""
    del t
    return polar_state(y[:2], y[2:])


def _around_the_origin(scene: Scene, near: Array) -> dict[str, Phase]:
    particle = scene.system
    plane = dataclasses.replace(scene, system=FreePoints(particle.m))
    enters = Exit(Reaches(0, near, -1), "cartesian", ToCartesian(particle))
    leaves = Exit(Leaves(_RETURN_RATIO * near), "polar", to_polar)
    return {"polar": Phase(scene, (enters,)), "cartesian": Phase(plane, (leaves,))}
