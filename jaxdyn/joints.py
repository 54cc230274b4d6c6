"""Bodies cut free, and what holds them: what `analysis.free_body` asks of a system.

A system lists the bodies that it consists of (`Part`), where these are held, by what and in which
directions (`Joint`), and the forces of its own equations besides those of effects (`Load`). The
forces in the joints are not among these: they are the multipliers of a constrained formulation, or
follow from the accelerations.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.sketch import Shape


class Part(NamedTuple):
    """A body that a system consists of: a particle, or several points that move as a rigid body.

    Attributes:
      name: the body's name.
      points: indices of its material points; none for a body without mass.
      m: (p,) the mass of each point that belongs to it [kg]; bodies may share a point.
      rigid: whether it resists moments, so that the law of moments holds for it by itself.
      outline: shapes that show it alone; by default those of the sketch, or a dot.
      at: (d,) any place of a body without mass [m].
    """

    name: str
    points: tuple[int, ...]
    m: Array
    rigid: bool = False
    outline: tuple[Shape, ...] = ()
    at: Array | None = None


class Joint(NamedTuple):
    """A place where a body is held, by another one or by the ground.

    The force on it is the sum of unknowns x_k times `directions`; the other body has the
    opposite one.

    Attributes:
      name: the name of the force in it.
      on: index of the body.
      by: index of the body that holds it; None for the ground.
      at: (d,) its place [m].
      directions: (k, d) directions of the force, of length 1 where x is to be in N.
      multiplier: index of the first of the k multipliers, in a constrained formulation, that are
        these unknowns; None where they are not among them.
      other: (d,) the place on the other body [m], at the far end of a rod; by default the same.
    """

    name: str
    on: int
    by: int | None
    at: Array
    directions: Array
    multiplier: int | None = None
    other: Array | None = None


class Load(NamedTuple):
    """A force (d,) [N] on a body that the equations of a system contain, at a place (d,) [m]."""

    name: str
    on: int
    force: Array
    at: Array


def particles(m: Array, names: tuple[str, ...] = ()) -> tuple[Part, ...]:
    """Each of n points as a body of its own."""
    n = m.shape[0]
    called = names or (tuple(f"body {i + 1}" for i in range(n)) if n > 1 else ("body",))
    return tuple(Part(name, (i,), m[i : i + 1]) for i, name in enumerate(called))


def body(name: str, m: Array, outline: tuple[Shape, ...] = ()) -> tuple[Part, ...]:
    """All points, of masses m (n,), as one rigid body."""
    return (Part(name, tuple(range(m.shape[0])), m, True, outline),)


def pinned(name: str, on: int, by: int | None, at: Array, multiplier: int | None = None) -> Joint:
    """A hinge, or a pivot: a force in any direction."""
    return Joint(name, on, by, at, jnp.asarray(np.eye(at.shape[0])), multiplier)


def along(
    name: str, on: int, by: int | None, at: Array, direction: Array, multiplier: int | None = None
) -> Joint:
    """A force along a direction (d,), whose length does not matter without a multiplier."""
    if multiplier is None:
        direction = unit(direction)
    return Joint(name, on, by, at, direction[None], multiplier)


def rod(
    name: str, on: int, by: int | None, ends: tuple[Array, Array], multiplier: int | None = None
) -> Joint:
    """The force along a rod without mass, from its end (d,) on the body `by` to that on `on`."""
    near, far = ends
    return along(name, on, by, far, unit(far - near), multiplier)._replace(other=near)


def unit(x: Array) -> Array:
    """The unit vector along x (d,)."""
    return x / jnp.sqrt(jnp.sum(x * x))
