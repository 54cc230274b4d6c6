"""Systems and effects: the two interfaces that make up a scene.

A `System` defines coordinates and their motion; an `Effect` acts on material points, or on
coordinates directly. `jaxdyn.scene` combines them, and exports both. Like everything that is made
or read in every call, both are a `Record`. Every formulation sums its effects by functions of
`_shapes`.
"""

import abc
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn import _checks, _text
from jaxdyn._records import Record as Record
from jaxdyn._shapes import check_potential, potential_energy
from jaxdyn.joints import Joint, Load, Part
from jaxdyn.sketch import Shape


class Points(NamedTuple):
    """Material points: positions r (n, d) [m], velocities v (n, d) [m/s], masses m (n,) [kg]."""

    r: Array
    v: Array
    m: Array


class Effect(Record):
    """An action on material points: a force, or a potential whose force is minus its gradient.

    A new effect overrides `potential` or `force` (or both) and sets `velocity_dependent`;
    all other methods follow. An effect that a scene does not have is absent from the compiled
    program, not multiplied by zero.
    """

    #: Whether the force depends on velocities. Where no effect of a scene does, the
    #: integrator uses a Nystrom pair, about twice as fast.
    velocity_dependent: ClassVar[bool] = True
    #: Where the force has no value or no direction, and the remedy: a sentence for the message
    #: of a motion that ends there; empty for a force that is smooth everywhere.
    singular: ClassVar[str] = ""
    #: What its force is called in a free-body diagram; by default the words of its class name.
    called: ClassVar[str] = ""

    def potential(self, t: Array, r: Array, m: Array) -> Array | None:
        """Potential energy () [J] of points at r (n, d); None if there is none."""
        del t, r, m
        return None

    def force(self, t: Array, r: Array, v: Array, m: Array) -> Array:
        """Forces (n, d) [N] on the points."""
        del v
        if self.acts == {"generalized"}:
            return jnp.zeros_like(r)
        return -jax.grad(self._potential, argnums=1)(t, r, m)

    def acceleration(self, t: Array, r: Array, v: Array, m: Array) -> Array:
        """Accelerations (n, d) [m/s^2] of the points by a force proportional to their mass.

        Gravity is such a force: what it does to a point does not depend on the mass of that point,
        and is known even where the mass is zero. Such an effect overrides this method, and `force`
        by the masses times its result; where both are overridden, this one moves free points.
        """
        return self.force(t, r, v, m) / m[:, None]

    def generalized(self, t: Array, q: Array, v: Array) -> Array | None:
        """Forces (n,) on the coordinates themselves, e.g. a motor's torque; None by default."""
        del t, q, v
        return None

    def sketch(self, t: Array, r: Array) -> tuple[Shape, ...]:
        """The shapes of the effect on points at r (n, d) in drawings: a spring, an anchor."""
        del t, r
        return ()

    def pieces(self, m: Array) -> tuple["Effect", ...]:
        """The effects that it is the sum of, one for each force that a free-body diagram shows.

        For a network of springs they are the springs. m (n,) are the masses of the points.
        """
        del m
        return (self,)

    def attack(self, t: Array, q: Array, v: Array) -> Array | None:
        """Point (d,) [m] where a force of `generalized` on a rigid body acts; None by default."""
        del t, q, v
        return None

    @property
    def without_units(self) -> bool:
        """Whether its numbers are without units, as with G = 1; host only."""
        return False

    @property
    def acts(self) -> frozenset[str]:
        """What its methods act on, "force" for points, "generalized" for coordinates.

        A potential is a force on points. The answer follows from what a class overrides.
        """
        cls = type(self)
        on_points = cls.force is not Effect.force or cls.potential is not Effect.potential
        on_coordinates = cls.generalized is not Effect.generalized
        return frozenset(["force"] * on_points + ["generalized"] * on_coordinates)

    @property
    def accelerates(self) -> bool:
        """Whether its force is proportional to mass, that is, it overrides `acceleration`."""
        # A subclass that overrides the force alone has another acceleration.
        given = ({"acceleration", "force"} & vars(cls).keys() for cls in type(self).__mro__)
        first = next(names for names in given if names)
        return "acceleration" in first and type(self).acceleration is not Effect.acceleration

    @_text.never_raising
    def __repr__(self) -> str:
        return _text.record(self)

    def _potential(self, t: Array, r: Array, m: Array) -> Array:
        value = self.potential(t, r, m)
        if value is None:
            raise _checks.fail(
                type(self).__name__, "a `force` or a `potential`", "neither", "Override one."
            )
        return check_potential(self, value)

    def check(self, points: Points) -> None:
        """Raise ValueError for numbers that are invalid with these points."""
        del points


class System(Record):
    """Coordinates, and how forces on material points move them."""

    @_text.never_raising
    def __repr__(self) -> str:
        return _text.record(self)

    @abc.abstractmethod
    def labels(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each of the k entries of the state."""

    @abc.abstractmethod
    def rate(self, t: Array, y: Float[Array, " k"], effects: tuple[Effect, ...]) -> Array:
        """Time derivative (k,) of the state."""

    def points(self, t: Array, y: Float[Array, " k"]) -> Points:
        """The material points, used by effects, energies and drawings; none by default."""
        del t, y
        return Points(jnp.zeros((0, 0)), jnp.zeros((0, 0)), jnp.zeros(0))

    def sketch(self, t: Array, y: Float[Array, " k"]) -> tuple[Shape, ...]:
        """Shapes in drawings besides the paths of the material points; see `sketch`."""
        del t, y
        return ()

    def cut(self, t: Array, y: Float[Array, " k"]) -> tuple[Part, ...]:
        """The bodies that it consists of, for free-body diagrams; () where they are not known."""
        del t, y
        return ()

    def held(self, t: Array, y: Float[Array, " k"]) -> tuple[Joint, ...]:
        """What holds the bodies: hinges, rods, wires, contacts."""
        del t, y
        return ()

    def loads(self, t: Array, y: Float[Array, " k"]) -> tuple[Load, ...]:
        """The forces that its equations contain besides those of effects and joints."""
        del t, y
        return ()

    def constraint_forces(
        self, t: Array, y: Float[Array, " k"], effects: tuple[Effect, ...]
    ) -> Array | None:
        """(c,) forces in the constraints where the equations contain them; None elsewhere."""
        del t, y, effects
        return None

    @property
    def accepts(self) -> frozenset[str]:
        """Which methods of its effects `rate` uses, "force", "generalized", both, or none.

        An effect that acts in another way would be ignored; `Scene.check` raises for it.
        """
        return frozenset()

    @property
    def singular(self) -> str:
        """Where the coordinates or equations are singular; see `Effect.singular`."""
        return ""

    def coordinates(self, y: Float[Array, " k"]) -> tuple[Array, Array]:
        """q and the velocities v passed to an effect's `generalized`, conjugate to its forces."""
        q, v = jnp.split(y, 2)
        return q, v

    @property
    def second_order(self) -> bool:
        """True where y = [q, v] with dq/dt = v, and dv/dt depends on v only through effects."""
        return False

    def kinetic(self, t: Array, y: Float[Array, " k"]) -> Array:
        """Kinetic energy () [J] of the material points; a system without any must override it."""
        _, v, m = self.points(t, y)
        if not len(m):
            remedy = "It has no material points; `energies` tells whether an energy is known."
            raise _checks.fail("kinetic", "material points", type(self).__name__, remedy)
        return 0.5 * jnp.sum(m[:, None] * v * v)

    def energies(
        self, t: Array, y: Float[Array, " k"], effects: tuple[Effect, ...]
    ) -> tuple[Array, ...]:
        """The terms () [J] whose sum is the energy; () for a system without an energy.

        By default the kinetic energy of the material points and the potential energy of the
        effects, if there are points.
        """
        r, _, m = self.points(t, y)
        return (self.kinetic(t, y), potential_energy(effects, t, r, m)) if len(m) else ()

    def integrals(self, t: Array, y: Float[Array, " k"]) -> dict[str, Array]:
        """Further candidates for conserved quantities, () or (d,) each, by name.

        Energy and the momenta of material points are always included.
        """
        del t, y
        return {}

    def difference(self, y1: Array, y0: Array) -> Array:
        """y1 - y0 (k,) as a small displacement; entries with the unit "rad" wrap, as angles.

        States are arrays of JAX or of NumPy.
        """
        d, angles = y1 - y0, [unit == "rad" for _, unit in self.labels()]
        if not any(angles):
            return d
        return jnp.where(jnp.array(angles), (d + jnp.pi) % (2 * jnp.pi) - jnp.pi, d)

    def project(self, t: Array, y: Array) -> Array:
        """The nearest state that satisfies the system's constraints; applied after each step."""
        del t
        return y

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () constraints leave the acceleration undetermined; None without constraints.

        Evaluated at the start and the end of a motion; `loses` watches over the way between.
        """
        del t, y
        return None

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """Whether () a step from y0 to y1 passes a state of `undetermined`, or may; else None.

        Such a step is repeated with a shorter one, which ends before that state.
        """
        del t0, y0, t1, y1
        return None

    def canonical(self, t: Array, y: Array) -> Array | None:
        """Canonical coordinates [q, p] (k,) of a state, None if there are none.

        Used to test whether a monodromy matrix is symplectic.
        """
        del t, y
        return None

    def generators(self, y: Array) -> dict[str, Array]:
        """Generators (k,) of motions of space relative to the system, by name.

        Candidates for symmetries; whether a scene has one depends on its effects, and is tested
        where they are used.
        """
        del y
        return {}

    def check(self, t: Array, y: Array) -> None:
        """Raise ValueError for invalid numbers."""
        del t, y

    def check_effects(self, t: Array, y: Array, effects: tuple[Effect, ...]) -> None:
        """Raise ValueError for effects that it cannot have."""
        del t, y, effects
