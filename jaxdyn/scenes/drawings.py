"""Drawn shapes and boxes moved and turned without distortion: course problems 7, 47 and 49.

Nothing acts on them; their positions are given functions of time.
"""

import abc
import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, floats
from jaxdyn._numerics import square_norm
from jaxdyn.formulations.prescribed import Path, Prescribed
from jaxdyn.geometry.euler import SEQUENCES, matrix_from_euler
from jaxdyn.geometry.rotations import matrix_from_axis_angle
from jaxdyn.geometry.vectors import plane_rotation
from jaxdyn.scene import Scene
from jaxdyn.scenes.bodies import BoxSketch, box_points
from jaxdyn.scenes.ready_made import ready_made
from jaxdyn.sketch import line, lines, traces

#: A house of unit width about its middle: corners of walls and roof, then of the door; its lines.
HOUSE = ((-0.5, -0.6), (0.5, -0.6), (0.5, 0.2), (0.0, 0.7), (-0.5, 0.2))
HOUSE += ((-0.1, -0.6), (-0.1, -0.2), (0.1, -0.2), (0.1, -0.6))
HOUSE_LINES = ((0, 1), (1, 2), (2, 3), (3, 4), (4, 0), (2, 4), (5, 6), (6, 7), (7, 8))

_ANGLES = (("angle1", "rad"), ("angle2", "rad"), ("angle3", "rad"))
_OVERSHOOT = 1.3  # length of the drawn axis of a box over the diagonal of the box


class MovedShape(Path):
    """A flat drawing (p, 2) [m] that moves along a figure of eight and turns; see `moved_shape`."""

    outline: Array
    reach: Array
    frequency: Array
    spin: Array
    joined: tuple[tuple[int, int], ...] = eqx.field(static=True)

    def coordinates(self):
        return (("x", "m"), ("y", "m"), ("theta", "rad"))

    def masses(self):
        return _equal(self.outline)

    def path(self, t):
        across, up = self.reach
        w = self.frequency
        return jnp.stack([across * jnp.sin(w * t), up * jnp.sin(2 * w * t), self.spin * t])

    def positions(self, t, q):
        del t
        return q[None, :2] + self.outline @ plane_rotation(q[2]).T

    def sketch(self, t, q):
        return lines(self.positions(t, q), self.joined), *traces(q[None, :2], ["middle"])


class TurnedBox(Path):
    """A drawing (p, 3) [m] turned about an axis (3,) at a rate () [rad/s]; see `turned_box`."""

    outline: Array
    axis: Array
    turning: Array

    def coordinates(self):
        return (("angle", "rad"),)

    def masses(self):
        return _equal(self.outline)

    def path(self, t):
        return (self.turning * t)[None]

    def positions(self, t, q):
        del t
        return self.outline @ matrix_from_axis_angle(self.axis, q[0]).T

    def sketch(self, t, q):
        r = self.positions(t, q)
        return *BoxSketch()(r), line(*r[8:])

    def check(self):
        if not _checks.is_traced(self.axis) and not np.any(np.asarray(self.axis)):
            raise _checks.fail("axis", "a direction", "0, 0, 0")


class Angles(eqx.Module):
    """Three angles as functions of time; a module, so that files can refer to it."""

    @abc.abstractmethod
    def __call__(self, t: Array) -> Array:
        """(3,) angles at time t."""


class Swings(Angles):
    """Three angles, swing sin(frequency t) [rad]."""

    swings: Array
    frequencies: Array

    def __call__(self, t: Array) -> Array:
        """(3,) angles at time t."""
        return self.swings * jnp.sin(self.frequencies * t)


class Given(Angles):
    """Three angles given by a function of time; a module, since a scene is made of arrays."""

    function: Callable[[Array], Any] = eqx.field(static=True)

    def __call__(self, t: Array) -> Array:
        """(3,) angles at time t."""
        return _stack(self.function(t))


class GivenByModule(Angles):
    """Three angles given by a module, whose arrays are numbers of the scene."""

    module: Any

    def __call__(self, t: Array) -> Array:
        """(3,) angles at time t."""
        return _stack(self.module(t))


def _stack(angles) -> Array:
    return jnp.stack([jnp.asarray(angle, float) for angle in angles])


class MovedBox(Path):
    """A drawing (p, 3) [m] turned by three Euler angles that depend on time; see `moved_box`."""

    outline: Array
    angles: Angles
    sequence: str = eqx.field(static=True)

    def coordinates(self):
        return _ANGLES

    def masses(self):
        return _equal(self.outline)

    def path(self, t):
        return self.angles(t)

    def positions(self, t, q):
        del t
        return self.outline @ matrix_from_euler(q, self.sequence).T

    def sketch(self, t, q):
        return BoxSketch()(self.positions(t, q))


@ready_made()
def moved_shape(
    *, reach=(3.0, 1.5), frequency=1.0, spin=1.0, t1=2 * math.pi, corners=None, joined=None
) -> Scene:
    """A drawn house that moves along a figure of eight and turns (problem 7).

    Its middle is at (a sin w t, b sin 2 w t), and its angle is spin t.

    Args:
      reach: (2,) amplitudes a across and b up [m].
      frequency: w of the path [rad/s].
      spin: spin of the house [rad/s].
      t1: span [s].
      corners: (p, 2) corners of another drawing, about its middle [m]; the house by default.
      joined: pairs of corners joined by lines; a closed outline by default.
    Example:
      >>> triangle = moved_shape(corners=[[0, 1], [1, -1], [-1, -1]])
      >>> triangle.system.mechanism.joined
      ((0, 1), (1, 2), (2, 0))
    """
    if corners is None:
        corners, joined = HOUSE, HOUSE_LINES if joined is None else joined
    corners = _checks.array("corners", corners, (None, 2), "x and y of each, in m.")
    p = len(corners)
    around = tuple((i, (i + 1) % p) for i in range(p))
    pairs = around if joined is None else _check_pairs(joined, p)
    reach = _checks.array("reach", reach, (2,), "Across and up, in m.")
    outline, reach, frequency, spin = floats(corners, reach, frequency, spin)
    return _scene_on_path(MovedShape(outline, reach, frequency, spin, pairs), t1)


@ready_made()
def turned_box(
    *, axis=(1.0, 1.0, 1.0), sides=(3.0, 2.0, 1.0), rate=1.0, t1=2 * math.pi / 3
) -> Scene:
    """A box that turns at a constant rate about a drawn axis through its middle (problem 47).

    By default it turns by 120 degrees about (1, 1, 1), which takes x to y, y to z and z to x.

    Args:
      axis: (3,) direction of the axis, of any length.
      sides: (3,) sides along x, y and z at the start [m].
      rate: rate of turning [rad/s].
      t1: span [s].
    """
    axis = _checks.array("axis", axis, (3,), "A direction.")
    outline = _with_axis(box_points(1.0, sides).r, axis)
    return _scene_on_path(TurnedBox(outline, axis, as_float(rate)), t1)


@jax.jit  # one program, not one for each operation
def _with_axis(points: Array, axis: Array) -> Array:
    """(10, 3) the corners of a box, and the ends of an axis through its middle."""
    corners = points[:8]
    half = jnp.sqrt(square_norm(corners[0]))
    end = _OVERSHOOT * half * axis / jnp.sqrt(square_norm(axis))
    return jnp.concatenate([corners, jnp.stack([-end, end])])


@ready_made()
def moved_box(
    *,
    swings=(0.6, 0.9, 1.2),
    frequencies=(1.0, 2.0, 3.0),
    sides=(3.0, 2.0, 1.0),
    sequence: str = "xyz",
    t1=2 * math.pi,
    angles: Callable[[Array], Any] | None = None,
) -> Scene:
    """A box turned by three Euler angles that are given functions of time (problem 49).

    Each angle is swing sin(frequency t), or is given by `angles`. If two swings are 0 the box only
    rolls, pitches or yaws.

    Args:
      swings: (3,) amplitudes of the angles [rad].
      frequencies: (3,) frequencies of the angles [rad/s].
      sides: (3,) sides along x, y and z at the start [m].
      sequence: Euler angles; "xyz" are those of problem 48, about fixed x, then y, then z.
      t1: span [s].
      angles: t -> (3,) any other angles [rad] in place of the swings, computed with jax.numpy;
        a named function, since each lambda is compiled again, or an `equinox.Module` with
        `__call__`, whose arrays are numbers of the scene.
    Example:
      >>> import jax.numpy as jnp
      >>> def faster_and_faster(t):
      ...     return 0.1 * t**2, jnp.sin(t), 0.0 * t
      >>> scene = moved_box(angles=faster_and_faster)
    """
    _checks.choice("sequence", sequence, SEQUENCES)
    remedy = "One for each angle."
    swings = _checks.array("swings", swings, (3,), remedy)
    frequencies = _checks.array("frequencies", frequencies, (3,), remedy)
    corners = box_points(1.0, sides).r[:8]
    given = Swings(swings, frequencies) if angles is None else _angles(angles)
    return _scene_on_path(MovedBox(corners, given, sequence), t1)


def _angles(angles) -> Angles:
    if not callable(angles):
        raise _checks.fail("angles", "a function of time", angles, "Such as lambda t: (t, t, t).")
    given = GivenByModule(angles) if isinstance(angles, eqx.Module) else Given(angles)
    shape = jax.eval_shape(given, jnp.zeros(())).shape
    if shape != (3,):
        raise _checks.fail("angles", "a function that returns three angles", f"shape {shape}")
    return given


def _check_pairs(pairs, count: int) -> tuple[tuple[int, int], ...]:
    """Pairs of corners, checked against their number."""
    found = np.asarray(pairs)
    whole = found.ndim == 2 and found.shape[1] == 2 and np.issubdtype(found.dtype, np.integer)
    if not whole or found.min() < 0 or found.max() >= count:
        raise _checks.fail("joined", f"pairs of numbers from 0 to {count - 1}", pairs)
    return tuple((int(i), int(j)) for i, j in found)


def _scene_on_path(path: Path, t1) -> Scene:
    system = Prescribed(path)
    return Scene(system, y0=_begin(system), t1=t1)


@eqx.filter_jit  # one program, not one for each operation
def _begin(system: Prescribed) -> Array:
    return system.state(jnp.zeros(()))


def _equal(outline: Array) -> Array:
    """(p,) equal masses of the points, one kilogram in total; they have no influence."""
    return jnp.full(len(outline), 1 / len(outline))
