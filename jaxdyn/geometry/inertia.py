"""Mass, centre and inertia of rigid bodies: shapes, and bodies composed from them.

A `Body` is all that dynamics needs of a rigid body. Shapes are centred at the origin, with their
axis, if any, along z; ``rotated`` and ``shifted`` put them in place, in this order, and ``+`` welds
bodies together. Functions that take a density in place of a mass end in ``_of_density``.

All functions are differentiable and free of LAPACK, except the principal axes and what uses them
(`principal`, `is_flat`, `equivalent_box`), which must stay outside of stepping loops.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdyn import _checks
from jaxdyn._arguments import arrays
from jaxdyn._checks import as_float
from jaxdyn._numerics import safe_sqrt, square_norm
from jaxdyn.geometry.frames import check_rotation
from jaxdyn.geometry.vectors import Scalar, Vector, cross
from jaxdyn.system import Record

Matrix = Float[Array, "3 3"]

# Moments of inertia that differ by less than this fraction of the largest count as equal; the same
# margin decides whether a body is flat or physically realisable, since moments are rounded sums.
_EQUAL = 1e-12


class Body(Record):
    """Mass () [kg], centre of mass (3,) [m] and inertia (3, 3) [kg m^2] about that centre."""

    mass: Array = eqx.field(converter=as_float)
    centre: Vector = eqx.field(converter=as_float)
    inertia: Matrix = eqx.field(converter=as_float)

    @arrays
    def shifted(self, d: Vector) -> "Body":
        """The body moved by d (3,) [m]."""
        return Body(self.mass, self.centre + d, self.inertia)

    @arrays
    def rotated(self, R: Matrix) -> "Body":
        """The body turned about the origin by the rotation matrix R (3, 3).

        Raises:
          ValueError: R is not a rotation; under traces the body is NaN then.
        """
        R = check_rotation("R", R)
        return Body(self.mass, R @ self.centre, R @ self.inertia @ R.T)

    @arrays
    def about(self, p: Vector) -> Matrix:
        """Inertia (3, 3) about a point p (3,) [m], by the theorem of parallel axes."""
        return self.inertia + _steiner(self.mass, self.centre - p)

    def check(self) -> None:
        """Raise ValueError unless the mass is positive and the inertia is that of a real body.

        Traced values are not checked.
        """
        if _checks.is_traced(self):
            return
        _checks.positive("mass", self.mass, "Masses are in kg.")
        _checks.finite("centre", self.centre)
        inertia = np.asarray(_checks.finite("inertia", self.inertia))
        size = np.trace(inertia)
        if np.abs(inertia - inertia.T).max() > _EQUAL * abs(size):
            raise _checks.fail("inertia", "a symmetric matrix", inertia.tolist())
        moments = np.linalg.eigvalsh(inertia)
        if moments[0] + moments[1] - moments[2] < -_EQUAL * abs(size):
            remedy = "Check signs and units."
            wanted = "moments such that none is larger than the other two together"
            raise _checks.fail("inertia", wanted, moments.tolist(), remedy)

    def __add__(self, other: "Body") -> "Body":
        """Both bodies welded together; a part with negative mass is a hole."""
        if not isinstance(other, Body):
            return NotImplemented
        mass = self.mass + other.mass
        d = other.centre - self.centre
        apart = _steiner(self.mass * other.mass / mass, d)
        centre = self.centre + d * (other.mass / mass)
        return Body(mass, centre, self.inertia + other.inertia + apart)


def _steiner(m: Array, d: Vector) -> Matrix:
    return m * (square_norm(d) * jnp.eye(3) - d[:, None] * d[None, :])


# ---- shapes


@arrays
def point(mass: Scalar, at: Vector = (0.0, 0.0, 0.0)) -> Body:
    """A material point at (3,) [m]."""
    return Body(mass, at, jnp.zeros((3, 3)))


@arrays
def box(mass: Scalar, sides: Vector) -> Body:
    """A box with sides (3,) [m] along x, y, z; one zero side makes it a plate, two a rod."""
    squares = sides**2
    return Body(mass, jnp.zeros(3), jnp.diag(jnp.sum(squares) - squares) * (mass / 12))


@arrays
def plate(mass: Scalar, sides: Float[Array, "2"]) -> Body:
    """A thin rectangle in the x-y plane with sides (2,) [m]."""
    return box(mass, jnp.append(sides, 0.0))


@arrays
def sphere(mass: Scalar, radius: Scalar, inner: Scalar = 0.0) -> Body:
    """A ball, hollow up to the radius inner [m]; a thin shell where both are equal.

    I = 2/5 m (R^5 - r^5) / (R^3 - r^3), with the common factor R - r taken out.
    """
    R, r = radius, inner
    powers = R**4 + R**3 * r + R**2 * r**2 + R * r**3 + r**4
    moment = 0.4 * mass * powers / (R**2 + R * r + r**2)
    return Body(mass, jnp.zeros(3), moment * jnp.eye(3))


@arrays
def cylinder(mass: Scalar, radius: Scalar, length: Scalar, inner: Scalar = 0.0) -> Body:
    """A cylinder along z, hollow up to the radius inner [m]; a pipe where both are equal."""
    along = mass * (radius**2 + inner**2) / 2
    across = along / 2 + mass * length**2 / 12
    return Body(mass, jnp.zeros(3), jnp.diag(jnp.asarray([across, across, along])))


@arrays
def disk(mass: Scalar, radius: Scalar, inner: Scalar = 0.0) -> Body:
    """A thin disk in the x-y plane with a hole of radius inner [m]; a ring where both are equal."""
    return cylinder(mass, radius, 0.0, inner)


@arrays
def rod(mass: Scalar, length: Scalar) -> Body:
    """A thin rod along z."""
    return cylinder(mass, 0.0, length)


@arrays
def box_of_density(density: Scalar, sides: Vector) -> Body:
    """A `box` of a density [kg/m^3]."""
    return box(density * jnp.prod(sides), sides)


@arrays
def sphere_of_density(density: Scalar, radius: Scalar, inner: Scalar = 0.0) -> Body:
    """A `sphere` of a density [kg/m^3]."""
    return sphere(density * 4 / 3 * jnp.pi * (radius**3 - inner**3), radius, inner)


@arrays
def cylinder_of_density(
    density: Scalar, radius: Scalar, length: Scalar, inner: Scalar = 0.0
) -> Body:
    """A `cylinder` of a density [kg/m^3]."""
    mass = density * jnp.pi * (radius**2 - inner**2) * length
    return cylinder(mass, radius, length, inner)


# ---- principal axes, and bodies with the same inertia


class Principal(NamedTuple):
    """Principal moments (3,) [kg m^2], smallest first, and axes (3, 3), one in each column."""

    moments: Vector
    axes: Matrix


@arrays
@jax.jit  # or each operation would be compiled by itself at its first call
def principal(body: Body) -> Principal:
    """Principal moments and right-handed principal axes about the centre.

    Rounding decides nothing: where equal moments (to 1e-12) leave the axes free, those that
    diagonalise diag(1, 2, 3) within their space are taken, so a body with three equal moments has
    the axes x, y and z. The first component above 0.55 of the first and of the second axis is
    positive.

    Limits: not for stepping loops (LAPACK). The derivative of the axes is correct where the
      moments differ, and finite but meaningless where they do not.
    """
    fixed = jax.lax.stop_gradient(body.inertia)
    size = jnp.where(jnp.trace(fixed) == 0, 1.0, jnp.trace(fixed))  # 0: a point
    guess, V = jnp.linalg.eigh(fixed)
    differ = jnp.diff(guess) > _EQUAL * size
    group = jnp.concatenate([jnp.zeros(1), jnp.cumsum(differ, dtype=float)])
    same = group[:, None] == group[None, :]
    # Added to the inertia, this keeps its eigenspaces, separates groups in their order, and splits
    # each group; without it eigenvectors of equal moments have infinite derivatives.
    split = jnp.where(same, V.T @ jnp.diag(jnp.array([1.0, 2.0, 3.0])) @ V, 0.0)
    split = V @ (jnp.diag(10 * group) + split) @ V.T
    _, axes = jnp.linalg.eigh(body.inertia + jnp.where(jnp.all(differ), 0.0, size * split))
    first, second = _with_direction(axes[:, 0]), _with_direction(axes[:, 1])
    axes = jnp.stack([first, second, cross(first, second)], axis=1)
    return Principal(jnp.sum(axes * (body.inertia @ axes), axis=0), axes)


def _with_direction(axis: Vector) -> Vector:
    # A unit vector has a component above 0.577, and 0.55 is not a sine or cosine of 30, 45 or 60
    # degrees, for which rounding would decide.
    leading = axis[jnp.argmax(jnp.abs(axis) > 0.55)]
    return jnp.where(leading < 0, -axis, axis)


@arrays
def is_flat(body: Body) -> Bool[Array, ""]:
    """Whether the mass lies in one plane: two moments add up to the third (to 1e-12)."""
    moments = jnp.linalg.eigvalsh(body.inertia)
    return moments[0] + moments[1] - moments[2] <= _EQUAL * moments[2]


@arrays
def equivalent_box(body: Body) -> Vector:
    """Sides (3,) [m], along the principal axes, of the uniform box with the same inertia.

    They follow from I_1 = m (b^2 + c^2) / 12 and so on. The last side is 0 for a flat body; an
    inertia that no real body has gives NaN.
    """
    moments = jnp.linalg.eigvalsh(body.inertia)
    excess = jnp.sum(moments) - 2 * moments
    excess = jnp.where(jnp.abs(excess) <= _EQUAL * moments[2], 0.0, excess)
    return safe_sqrt(6 * excess / body.mass)


class MaterialPoints(NamedTuple):
    """Positions r (n, 3) [m] and masses m (n,) [kg]."""

    r: Array
    m: Array


@arrays
def equimomental(body: Body) -> MaterialPoints:
    """Six material points, a sixth of the mass each, with the body's mass, centre and inertia.

    With the second moments P = tr(I) / 2 - I = L L^T the points are at the centre plus and
    minus sqrt(3 / m) times each column of L. The root L is Cholesky's with the largest pivot
    first, so a body with principal axes x, y, z has its points on them; an eigenvector root
    would have them on the principal axes of all bodies, but no derivative for a sphere.

    Raises:
      ValueError: `body` is not physically realisable (see `Body.check`); NaN if it is traced.
    Limits: for an exactly flat body the points are differentiable only along changes that keep it
      flat, and those derivatives are returned; `scenes.bodies.jack` is smooth there too.
    """
    body.check()
    return _equimomental(body)


@jax.jit
def _equimomental(body: Body) -> MaterialPoints:
    P = jnp.trace(body.inertia) / 2 * jnp.eye(3) - body.inertia
    size = jnp.trace(P)
    columns = []
    for _ in range(3):
        k = jnp.argmax(jnp.diagonal(P))
        chosen = jnp.arange(3) == k
        column = jnp.sum(jnp.where(chosen[None, :], P, 0.0), axis=1)
        pivot = jnp.sum(jnp.where(chosen, column, 0.0))
        flat = pivot <= _EQUAL * size
        column = jnp.where(flat, 0.0, column / jnp.sqrt(jnp.where(flat, 1.0, pivot)))
        columns.append(column)
        P = P - column[:, None] * column[None, :]
    possible = jnp.max(jnp.abs(P)) <= _EQUAL * size
    arms = jnp.stack(columns) * jnp.sqrt(3 / jnp.where(possible, body.mass, jnp.nan))
    r = body.centre[None, :] + jnp.stack([sign * arm for arm in arms for sign in (1.0, -1.0)])
    return MaterialPoints(r, jnp.full(6, body.mass / 6))
