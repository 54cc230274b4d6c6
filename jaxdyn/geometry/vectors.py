"""Vectors in space: cross products, lines, tetrahedra, a joint held by three rods.

Every function is for one object, with vectors of shape (3,); ``jax.vmap`` makes it one for many.
All work under jit and have finite derivatives, also where an answer does not exist: then a flag
says so, and the numbers beside it are NaN.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdyn._arguments import arrays
from jaxdyn._numerics import safe_norm, square_norm
from jaxdyn.geometry.indices import levi_civita

# A product of differences of points is called zero below this many roundings of the points.
_ZERO_PRODUCT = 8 * np.finfo(float).eps

Scalar = Float[Array, ""]
Vector = Float[Array, "3"]
# Components of one vector or, along further axes, of many.
Components = Float[Array, "3 ..."]


@arrays
def dot(a: Components, b: Components) -> Array:
    """Scalar product (), written out, since a call of `jnp.dot` costs more than three products."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@arrays
def cross(a: Components, b: Components) -> Components:
    """Cross product (3,) by components: (a2 b3 - a3 b2, a3 b1 - a1 b3, a1 b2 - a2 b1)."""
    return jnp.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


@arrays
def cross_by_indices(a: Vector, b: Vector) -> Vector:
    """Cross product (3,) as epsilon_ijk a_i b_j. `cross` is the one to use in programs."""
    return jnp.einsum("ijk,i,j->k", levi_civita(), a, b)


@arrays
def cross_by_geometry(a: Vector, b: Vector) -> Vector:
    """Cross product (3,) by its geometric meaning, without its components.

    b is projected onto the plane orthogonal to a, stretched by |a| and rotated by a quarter turn
    about a. The rotation needs a right-handed frame whose third axis is along a: a reflection of
    the coordinate axes that takes the third one to a, with one axis reversed, since two reflections
    make a rotation. `cross` is the one to use in programs.

    Limits: at a = 0, which has no orthogonal plane, the result is zero, with derivative zero
      instead of the right one.
    """
    length = safe_norm(a)
    n = a / jnp.where(length == 0, 1.0, length)
    side = jnp.where(n[2] < 0, -1.0, 1.0)  # reflect across the longer diagonal: no cancellation
    mirror = n + side * jnp.array([0.0, 0.0, 1.0])
    reflection = jnp.eye(3) - 2 * jnp.outer(mirror, mirror) / square_norm(mirror)
    e1, e2 = side * reflection[0], reflection[1]
    projected = b - dot(n, b) * n
    return length * (dot(projected, e1) * e2 - dot(projected, e2) * e1)


@arrays
def skew(a: Vector) -> Float[Array, "3 3"]:
    """The matrix S(a) with S(a) @ b = a x b; S_ij = -epsilon_ijk a_k."""
    zero = jnp.zeros_like(a[0])
    rows = [[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]]
    return jnp.stack([jnp.stack(row) for row in rows])


@arrays
def unskew(S: Float[Array, "3 3"]) -> Vector:
    """The vector a whose `skew` is the skew part (S - S^T) / 2 of a matrix."""
    return jnp.stack([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]]) / 2


@arrays
def plane_rotation(theta: Scalar) -> Float[Array, "2 2"]:
    """The matrix that turns vectors of the plane by the angle theta () [rad], x towards y."""
    c, s = jnp.cos(theta), jnp.sin(theta)
    return jnp.stack([jnp.stack([c, -s]), jnp.stack([s, c])])


class ClosestPoints(NamedTuple):
    """Shortest connection of two lines.

    It has the ``distance`` (), the end points ``on_ab`` (3,) and ``on_cd`` (3,), and the flag
    ``parallel`` (): the lines are parallel to within the rounding of their points, and the
    connection is then one of many.
    """

    distance: Array
    on_ab: Vector
    on_cd: Vector
    parallel: Bool[Array, ""]


@arrays
def closest_points(r_a: Vector, r_b: Vector, r_c: Vector, r_d: Vector) -> ClosestPoints:
    """Distance and closest points of two infinite lines, one through a and b, one through c and d.

    With n = (b - a) x (d - c) the distance is |n . (c - a)| / |n|; parallel lines have n = 0,
    and the connection that is returned for them ends at c.

    Args:
      r_a: (3,) a point of the first line.
      r_b: (3,) another point of the first line.
      r_c: (3,) a point of the second line.
      r_d: (3,) another point of the second line.
    Returns:
      Distance, closest points and whether the lines are parallel; NaN where a and b, or c and
      d, coincide and there is no line.
    Limits: differentiable except at the change to parallel; the derivative of the distance of lines
      that meet, where it has a kink, is 0.
    Example:
      >>> import jax.numpy as jnp
      >>> x, y, z = jnp.eye(3)
      >>> float(closest_points(0 * x, x, z, z + y).distance)
      1.0
    """
    u, v, w = r_b - r_a, r_d - r_c, r_c - r_a
    n = cross(u, v)
    size = jnp.max(jnp.abs(jnp.stack([r_a, r_b, r_c, r_d])))
    lengths = safe_norm(u), safe_norm(v)
    rounding = _ZERO_PRODUCT * (lengths[0] * lengths[1] + size * (lengths[0] + lengths[1]))
    parallel = safe_norm(n) <= rounding

    n = jnp.where(parallel, jnp.array([1.0, 0.0, 0.0]), n)  # any vector that can be divided by
    nn, uu = square_norm(n), square_norm(u)
    no_line = (uu == 0) | (square_norm(v) == 0)
    foot = dot(w, u) / jnp.where(no_line, 1.0, uu)  # foot of c on the line through a and b
    s = jnp.where(parallel, foot, dot(cross(w, v), n) / nn)
    t = jnp.where(parallel, 0.0, dot(cross(w, u), n) / nn)
    distance = jnp.where(parallel, safe_norm(w - foot * u), jnp.abs(dot(w, n)) / jnp.sqrt(nn))
    nan = jnp.where(no_line, jnp.nan, 0.0)
    return ClosestPoints(
        distance=distance + nan, on_ab=r_a + s * u + nan, on_cd=r_c + t * v + nan, parallel=parallel
    )


@arrays
def signed_volume(r_a: Vector, r_b: Vector, r_c: Vector, r_d: Vector) -> Array:
    """Volume () of a tetrahedron, positive where a, b, c turn counterclockwise seen from d.

    It is (b - a) x (c - a) . (d - a) / 6: a third of the base |(b - a) x (c - a)| / 2 times the
    height, the part of d - a along the normal of the base.
    """
    return dot(cross(r_b - r_a, r_c - r_a), r_d - r_a) / 6


@arrays
def tetrahedron_volume(r_a: Vector, r_b: Vector, r_c: Vector, r_d: Vector) -> Array:
    """Volume () >= 0 of a tetrahedron; its derivative is 0 where the four points are coplanar."""
    return jnp.abs(signed_volume(r_a, r_b, r_c, r_d))


class RodTensions(NamedTuple):
    """Tensions (3,) [N] in the rods to a, b and c; NaN where ``coplanar`` ()."""

    tensions: Vector
    coplanar: Bool[Array, ""]


@arrays
def rod_tensions(r_a: Vector, r_b: Vector, r_c: Vector, r_d: Vector, force: Vector) -> RodTensions:
    """Tensions in three massless rods from a, b and c that hold the joint d under a load.

    The part of the balance of forces at d normal to two rods leaves the third alone: with
    a, b, c counted from d the tension in the first is -|a| F . (b x c) / (a . (b x c)).

    Args:
      r_a: (3,) [m] the fixed end of the first rod.
      r_b: (3,) [m] the fixed end of the second rod.
      r_c: (3,) [m] the fixed end of the third rod.
      r_d: (3,) [m] the joint.
      force: (3,) [N] the load on the joint.
    Returns:
      The tensions, negative in a rod under compression; NaN and a flag where the rods lie in one
      plane (or one has no length), so that they do not hold every load in exactly one way.
    """
    a, b, c = r_a - r_d, r_b - r_d, r_c - r_d
    lengths = jnp.stack([safe_norm(a), safe_norm(b), safe_norm(c)])
    size = jnp.max(jnp.abs(jnp.stack([r_a, r_b, r_c, r_d])))
    box = dot(a, cross(b, c))
    areas = jnp.stack([lengths[1] * lengths[2], lengths[2] * lengths[0], lengths[0] * lengths[1]])
    rounding = _ZERO_PRODUCT * (jnp.prod(lengths) + size * jnp.sum(areas))
    coplanar = jnp.abs(box) <= rounding

    normals = jnp.stack([cross(b, c), cross(c, a), cross(a, b)])
    pulls = jnp.stack([dot(normal, force) for normal in normals])
    tensions = -lengths * pulls / jnp.where(coplanar, 1.0, box)
    return RodTensions(jnp.where(coplanar, jnp.nan, tensions), coplanar)
