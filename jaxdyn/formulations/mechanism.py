"""A mechanism: coordinates, the material points that they place, and their constraints.

It is written once and serves all formulations (newton_euler, lagrange, constrained), whose results
can be compared. A rigid body is represented by material points with its mass, centre and inertia
(`planar_body`, `inertia.equimomental`); kinetic energy, gravity and drawings then follow from the
positions of points alone.
"""

import abc
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._doors import renamed
from jaxdyn._numerics import materialize, runtime_one
from jaxdyn.joints import Joint, Part
from jaxdyn.scene import Effect, Points, System
from jaxdyn.sketch import Shape
from jaxdyn.system import Record, generalized_forces, total_force

#: Forms of the constraint of a rod, as scenes name them; see `stretch`.
TIES = ("length", "square")


@renamed(cut="bodies", held="joints", tied="constraints")
class Mechanism(Record):
    """Coordinates q (n,) and the material points that they place."""

    #: Whether some points may have no mass, as two of those of a flat body have none.
    massless: ClassVar[bool] = False
    #: Where the coordinates are singular; see `Effect.singular`.
    singular: ClassVar[str] = ""

    @abc.abstractmethod
    def coordinates(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each coordinate; a unit of "rad" makes it an angle that wraps."""

    @abc.abstractmethod
    def masses(self) -> Array:
        """(p,) masses of the material points [kg]."""

    @abc.abstractmethod
    def positions(self, t: Array, q: Array) -> Array:
        """(p, d) positions of the points [m]."""

    def constraints(self, t: Array, q: Array) -> Array | None:
        """(c,) values that must stay zero: lengths, closed loops, guides; None without any."""
        del t, q
        return None

    def rolling(self, t: Array, q: Array) -> Array | None:
        """(b, n) rows whose products with the velocities must stay zero: skates, rolling wheels."""
        del t, q
        return None

    def loses(self, t0: Array, q0: Array, t1: Array, q1: Array) -> Array | None:
        """Whether () a step from q0 to q1 passes a pose where q has several continuations."""
        del t0, q0, t1, q1
        return None

    def central(self) -> int:
        """How many of the first coordinates are the position of the common mass centre."""
        return 0

    def opened_form(self) -> "Embedding | None":
        """The same mechanism with constraints, in these coordinates and others that follow them.

        Where the map that places the points is long, printed equations have both; None otherwise.
        """
        return None

    def rods(self) -> tuple[str, ...]:
        """Names of the rods whose lengths (`stretch`) are the first of the constraints."""
        return ()

    def bodies(self, t: Array, q: Array) -> tuple[Part, ...]:
        """The bodies that it consists of, see `System.bodies`."""
        del t, q
        return ()

    def joints(self, t: Array, q: Array) -> tuple[Joint, ...]:
        """What holds the bodies, see `System.joints`."""
        del t, q
        return ()

    def sketch(self, t: Array, q: Array) -> tuple[Shape, ...]:
        """What a drawing shows besides the paths of the points, see `System.sketch`."""
        del t, q
        return ()

    def check(self) -> None:
        """Raise ValueError for invalid parameters, such as lengths that are not positive."""


class Embedding(NamedTuple):
    """The same mechanism in more coordinates, with constraints.

    Attributes:
      mechanism: the mechanism with the constraints.
      place: (t, q) -> its coordinates, for free coordinates q (n,).
    """

    mechanism: Mechanism
    place: Callable[[Array, Array], Array]


def stretch(square: Array, length: Array, squared: bool) -> Array:
    """Elongation of a rod [m], from the squared distance of its ends.

    If it is a constraint of `Constrained`, its multiplier is the force along the rod [N], positive
    where it pushes. Both forms vanish together and agree to first order; without projection they
    drift differently.

    Args:
      square: (...) squared distance of the ends [m^2].
      length: (...) length of the rod [m].
      squared: take (square - length^2) / (2 length), smooth everywhere and the form that textbooks
        differentiate; otherwise the distance minus the length.
    """
    if squared:
        return (square - length**2) / (2 * length)
    return jnp.sqrt(square) - length


def planar_body(centre: Array, angle: Array, gyration: Array) -> Array:
    """(2, 2) two points, each with half the mass, equivalent to a rigid body in the plane.

    At the radius of gyration on both sides of the centre they have the mass, the centre of
    mass and the moment of inertia of the body.

    Args:
      centre: (2,) centre of mass [m].
      angle: () angle of the line through them, from the x axis [rad].
      gyration: () sqrt(inertia / mass) [m].
    """
    arm = gyration * jnp.stack([jnp.cos(angle), jnp.sin(angle)])
    return jnp.stack([centre + arm, centre - arm])


class MechanismSystem(System):
    """What all formulations of a mechanism share: the state [q, v], labels, points, angles."""

    mechanism: eqx.AbstractVar[Mechanism]

    @property
    def accepts(self):
        return frozenset({"force", "generalized"})

    @property
    def singular(self):
        return self.mechanism.singular

    def labels(self):
        return with_rates(self.mechanism.coordinates())

    def points(self, t, y):
        q, v = jnp.split(y, 2)
        r, velocity = positions_and_velocities(self.mechanism, t, q, v)
        return Points(r, velocity, self.mechanism.masses())

    def loses(self, t0, y0, t1, y1):
        return self.mechanism.loses(t0, jnp.split(y0, 2)[0], t1, jnp.split(y1, 2)[0])

    def sketch(self, t, y):
        return self.mechanism.sketch(t, jnp.split(y, 2)[0])

    def bodies(self, t, y):
        return self.mechanism.bodies(t, jnp.split(y, 2)[0])

    def joints(self, t, y):
        return self.mechanism.joints(t, jnp.split(y, 2)[0])

    def check(self, t, y):
        del t, y
        self.mechanism.check()
        m = _masses(self.mechanism)
        if self.mechanism.massless and not _checks.is_traced(m):
            m = np.asarray(m).sum()
        _checks.positive("mass", m, "Masses are in kg.")


@jax.jit  # one program, not one for each operation
def _masses(mechanism: Mechanism) -> Array:
    return mechanism.masses()


def with_rates(coordinates: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
    """(name, unit) of coordinates, then of their rates; "1" for all where there are no units."""
    plain = all(unit == "1" for _, unit in coordinates)
    return (*coordinates, *((f"{x}_dot", "1" if plain else f"{unit}/s") for x, unit in coordinates))


@check_first
def positions_and_velocities(
    mechanism: Mechanism, t: Array, q: Array, v: Array
) -> tuple[Array, Array]:
    """(p, d) positions and velocities of the points."""
    return jax.jvp(mechanism.positions, (t, q), (jnp.ones_like(t), v))


def kinematic_jacobian(mechanism: Mechanism, t: Array, q: Array) -> Array:
    """(n, p d) velocities of the points for a unit rate of each coordinate."""

    def velocities(v: Array) -> Array:
        return jax.jvp(lambda q: mechanism.positions(t, q), (q,), (v,))[1]

    return jax.vmap(velocities)(jnp.eye(len(q))).reshape(len(q), -1)


def mass_matrix(mechanism: Mechanism, t: Array, q: Array) -> Array:
    """(n, n) matrix of the kinetic energy v^T M v / 2, for a map without explicit time."""
    return _inertia(mechanism, kinematic_jacobian(mechanism, t, q))


def mass_and_force(
    mechanism: Mechanism,
    t: Array,
    q: Array,
    v: Array,
    effects: tuple[Effect, ...],
) -> tuple[Array, Array]:
    """M (n, n) and f (n,) of the equations of motion M a = f; `newton_euler` derives them."""

    def velocities(t, q):
        return positions_and_velocities(mechanism, t, q, v)

    # One derivative of the velocities gives c as well; XLA shares what both passes compute.
    (r, velocity), (_, c) = jax.jvp(velocities, (t, q), (jnp.ones_like(t), v))
    m = mechanism.masses()
    force = total_force(effects, t, r, velocity, m, -m[:, None] * c)
    # J is materialised, or a loop over stages would compute it again for each entry of M: four to
    # six times slower (measured; materialising the force as well undoes the gain).
    j = materialize(kinematic_jacobian(mechanism, t, q), runtime_one(t))
    pulled = row_sums(j, force.ravel())
    if mechanism.central():
        applied = total_force(effects, t, r, velocity, m).sum(axis=0)
        pulled = jnp.concatenate([applied, pulled[mechanism.central() :]])
    return _inertia(mechanism, j), pulled + on_coordinates(t, q, v, effects)


@check_first
def pull_back(
    mechanism: Mechanism,
    t: Array,
    q: Array,
    v: Array,
    effects: tuple[Effect, ...],
) -> Array:
    """(n,) generalised forces of the effects' forces on the points."""
    r, velocity = positions_and_velocities(mechanism, t, q, v)
    m = mechanism.masses()
    force = total_force(effects, t, r, velocity, m)
    return row_sums(kinematic_jacobian(mechanism, t, q), force.ravel())


def on_coordinates(t: Array, q: Array, v: Array, effects: tuple[Effect, ...]) -> Array:
    """(n,) sum of the forces that act on the coordinates directly."""
    return sum(generalized_forces(effects, t, q, v), jnp.zeros_like(q))


def row_sums(j: Array, x: Array) -> Array:
    """(n,) J x for rows J (n, s) and x (s,); a sum for the reason at `weighted_gram`."""
    return jnp.sum(j * x[None, :], axis=-1)


def weighted_gram(j: Array, weights: Array) -> Array:
    """(n, n) matrix J W J^T for rows J (n, s) and weights (s,).

    It is a sum, not a matrix product: XLA turns some small products into custom fusions, which
    would prevent folding of the stepping loop.
    """
    return jnp.sum(j[:, None, :] * (weights[None, :] * j)[None, :, :], axis=-1)


def _inertia(mechanism: Mechanism, j: Array) -> Array:
    """(n, n) the mass matrix for velocities J (n, p d) of the points.

    If a mass centre is among the coordinates, its products with the others are 0. Their rounding
    would move a mass centre at rest by 1e-17, and the sizes of a motion are measured at its start.
    """
    mass = weighted_gram(j, _weights(mechanism, j))
    d = mechanism.central()
    if not d:
        return mass
    off = jnp.zeros((d, len(j) - d))
    total = mechanism.masses().sum() * jnp.eye(d)
    return jnp.block([[total, off], [off.T, mass[d:, d:]]])


def _weights(mechanism: Mechanism, j: Array) -> Array:
    """(p d,) the mass of the point of each component of the positions."""
    m = mechanism.masses()
    return jnp.repeat(m, j.shape[1] // m.shape[0])
