"""The shapes of drawings: how systems and effects describe their appearance.

The ``sketch`` of a system or an effect, in its own file, is a few of these, with corners that
follow the state; how they are drawn, on paper, in space or in an animation, is up to the drawing
code. A shape is a pytree: its corners are arrays, its kind and name static.

    line     rods, strings, edges: one or several lines of corners
    area     a closed figure, filled lightly: the body of a car
    solid    a closed figure, filled with ink: wheels, blades
    ground   a support or a guide of the motion: a ramp, a track, a wire; straight ones are drawn
             over the whole extent of the motion, others at their widest
    spring   from end to end, one or several
    dashpot  from end to end, one or several
    pin      a hinge or an anchor on the ground
    trace    a point that leaves a path; where a scene has any, only these are drawn
    mark     a fixed place with a name, such as a body: a dot where a motion comes near it
"""

import abc
from collections.abc import Sequence
from typing import Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import safe_norm

Kind = Literal["line", "area", "solid", "ground", "spring", "dashpot", "pin", "trace", "mark"]
#: Kinds of single points with a name, which have no outline.
NAMED: tuple[Kind, ...] = ("trace", "mark")
_CORNERS = 48  # corners of a drawn circle, a multiple of 4


class Shape(eqx.Module):
    """A shape of a kind with its corners (..., k, d) [m], and a name for the legend."""

    kind: Kind = eqx.field(static=True)
    at: Array
    name: str = eqx.field(static=True, default="")

    def place(self, r: Array, R: Array) -> "Shape":
        """The shape moved to a frame with origin r (d,) and axes the columns of R (d, d)."""
        return Shape(self.kind, r[(None,) * (self.at.ndim - 1)] + self.at @ R.T, self.name)


class Looks(eqx.Module):
    """The shapes of a body; a module, not a function, so that files can name it."""

    @abc.abstractmethod
    def __call__(self, r: Array) -> tuple[Shape, ...]:
        """Shapes in the body's own axes, from the positions r (p, 3) of its points there."""


def lines(r: Array, pairs: Sequence[tuple[int, int]]) -> Shape:
    """Lines that join pairs of the points r (n, d)."""
    return Shape("line", r[np.asarray(pairs, int).reshape(-1, 2)])


def line(*ends: Array) -> Shape:
    """A line through positions (d,)."""
    return Shape("line", jnp.stack(ends))


def pin(*places: Array) -> Shape:
    """A pin at each of some positions (d,)."""
    return Shape("pin", jnp.stack(places)[:, None])


def traces(r: Array, names: Sequence[str]) -> tuple[Shape, ...]:
    """A named path for each of the points r (n, d)."""
    return tuple(Shape("trace", r[i][None], name) for i, name in enumerate(names))


def mark(name: str, place: Array) -> Shape:
    """A fixed place (d,) with a name."""
    return Shape("mark", place[None], name)


def rectangle(kind: Kind, sides, centre=(0.0, 0.0)) -> Shape:
    """A rectangle in the plane with sides (2,) along x and y [m]."""
    half = jnp.stack([jnp.asarray(side, float) for side in sides]) / 2
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return Shape(kind, jnp.asarray(centre, float)[None] + half[None] * corners)


def frame(along: Array) -> Array:
    """(2, 2) axes in the plane, the first along a direction (2,)."""
    x, y = along / safe_norm(along)
    return jnp.stack([jnp.stack([x, -y]), jnp.stack([y, x])])


def arc(centre: Array, across: Array, up: Array, turn: float = 1.0) -> Array:
    """(k, d) corners of an arc about a centre, from centre + across through centre + up.

    Args:
      centre: (d,) [m].
      across: (d,) a radius [m].
      up: (d,) a radius perpendicular to it [m].
      turn: its angle, as a fraction of the full circle.
    """
    angle = 2 * np.pi * np.linspace(0.0, turn, round(_CORNERS * turn) + 1)[:, None]
    return centre[None] + np.cos(angle) * across[None] + np.sin(angle) * up[None]


def circle(centre: Array, radius: Array) -> Array:
    """(k, 2) corners of a circle in the plane."""
    one = np.eye(2)
    return arc(centre, radius * one[0], radius * one[1])
