"""The three satellites of problems 55 and 57: a unit cube with balls of radius 1/2 on its faces.

All parts have density 1 and the cube has its corners at 0 and 1. These are the results for the
claims of the course:

- 55 iii says that two principal moments of A are equal, and 57 A.i that all three differ. They
  differ: 0.527, 0.795 and 1.051.
- 57 A.ii is false: the axis along the line through the centres of the two balls, (1, -1, 0), is
  that of the smallest moment. The intermediate axis is (1, 1, 0), and the largest moment is about
  z.
- 57 B.i and ii hold: two moments of B are equal and the axis of symmetry is (1, 1, 1); its
  moment is the largest.
- 57 C.i holds: every direction is principal for C, since by symmetry its three moments are equal.
"""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.formulations.rigid import pose
from jaxdyn.geometry.inertia import Body, box_of_density, sphere_of_density
from jaxdyn.integrate.spans import of_samples
from jaxdyn.integrate.trajectory import each_motion
from jaxdyn.sketch import Looks, Shape, arc, lines, traces

#: Tips of the two massless antennas, whose roots are at (0, 0, 0) and (0, 0, 0.5).
ANTENNAS = ((3.0, 3.0, 3.0), (2.0, 2.0, 0.5))


#: The faces of the cube that have a ball, by their outward normals.
FACES = {
    "A": ((1, 0, 0), (0, 1, 0)),
    "B": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "C": ((1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)),
}
#: Corners of a cube or box, with x changing fastest, and its edges as pairs of corners.
CUBE = tuple((i & 1, i >> 1 & 1, i >> 2 & 1) for i in range(8))
BOX_EDGES = tuple((i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit)
_ROOTS = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.5))  # roots of the antennas


def satellite_a(density=1.0) -> Body:
    """The satellite with balls on the faces towards +x and +y."""
    return _satellite(density, FACES["A"])


def satellite_b(density=1.0) -> Body:
    """The satellite with balls on the faces towards +x, +y and +z."""
    return _satellite(density, FACES["B"])


def satellite_c(density=1.0) -> Body:
    """The satellite with balls on all six faces."""
    return _satellite(density, FACES["C"])


#: The bodies by the names that the course gives them.
SATELLITES = {"A": satellite_a, "B": satellite_b, "C": satellite_c}


@each_motion
@of_samples
def antenna_trace(motion, name: str = "A", tip=ANTENNAS[0]) -> Array:
    """(s, 3) path in space of the tip of an antenna on a satellite (problems 55, 58) [m].

    Args:
      motion: a motion of `scenes.satellite` with the same name; its samples give the points of the
        path.
      name: "A", "B" or "C".
      tip: (3,) position in the axes of problem 55, from a corner of the cube [m]; one of
        `ANTENNAS`.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> motion = simulate(scenes.satellite("B"), 1.0, samples=5)
      >>> scenes.satellites.antenna_trace(motion, "B").shape
      (5, 3)
    """
    body = SATELLITES[_checks.choice("name", name, SATELLITES)]()
    arm = _checks.array("tip", tip, (3,), "Along the edges of the cube, in m.") - body.centre
    return jax.vmap(lambda t, y: pose(motion.scene, t, y).place(arm))(motion.ts, motion.ys)


def _satellite(density, faces: tuple[tuple[int, int, int], ...]) -> Body:
    return _of_density(_checks.numbers("density", density), faces)


@functools.partial(jax.jit, static_argnames="faces")  # one program, not one for each operation
def _of_density(density: Array, faces: tuple[tuple[int, int, int], ...]) -> Body:
    body = box_of_density(density, jnp.ones(3))
    for face in faces:
        body = body + sphere_of_density(density, 0.5).shifted(face)
    return body.shifted((0.5, 0.5, 0.5))


class SatelliteSketch(Looks):
    """Sketch of a satellite: its cube with the balls, the antennas and the paths of their tips."""

    name: str = eqx.field(static=True)

    def __call__(self, r: Array) -> tuple[Shape, ...]:
        """The shapes in the axes of the points r (6, 3), whose origin is the centre of mass."""
        del r
        centre = SATELLITES[_checks.choice("name", self.name, SATELLITES)]().centre
        x, y, z = jnp.eye(3) / 2
        corners = jnp.asarray(CUBE, float)
        shapes = [lines(corners, BOX_EDGES)]
        for face in FACES[self.name]:
            ball = jnp.full(3, 0.5) + jnp.asarray(face, float)
            circles = [arc(ball, *axes) for axes in ((x, y), (y, z), (z, x))]
            shapes.append(Shape("line", jnp.stack(circles)))
        roots, tips = jnp.asarray(_ROOTS), jnp.asarray(ANTENNAS)
        shapes.append(Shape("line", jnp.stack([roots, tips], axis=1)))
        shapes += traces(tips, ["antenna 1", "antenna 2"])
        return tuple(shape.place(-centre, jnp.eye(3)) for shape in shapes)
