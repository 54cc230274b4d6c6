"""Systems and effects: the two interfaces that make up a scene.

A `System` defines coordinates and their motion; an `Effect` acts on material points, or on
coordinates directly. `jaxdyn.scene` combines them, and exports both. Like everything that is made
or read in every call, both are a `Record`. The functions at the end check what their methods
return; every formulation sums its effects by them.
"""

import abc
import functools
from collections.abc import Callable, Iterable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn import _checks, _text
from jaxdyn._checks import refuse_narrow
from jaxdyn._doors import renamed
from jaxdyn._records import Record as Record
from jaxdyn._records import check_repeatable
from jaxdyn.joints import Joint, Load, Part
from jaxdyn.sketch import Shape

#: In the metadata of a field: it is a unit of the equations, which titles of pictures leave out.
UNIT = "unit"


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

    #: Whether the force depends on velocities. For a scene without such effects the default is a
    #: method about twice as fast.
    velocity_dependent: ClassVar[bool] = True
    #: Where the force has no value or no direction, and the remedy: a sentence for the message
    #: of a motion that ends there; empty for a force that is smooth everywhere.
    singular: ClassVar[str] = ""
    #: The name of its force in a free-body diagram; by default the words of its class name.
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
        """The effects of which it is the sum, one for each force that a free-body diagram shows.

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
        return _text.record(self, lambda _: "")  # only a scene knows its units

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


@renamed(cut="bodies", held="joints")
class System(Record):
    """Coordinates, and how forces on material points move them."""

    @_text.never_raising
    def __repr__(self) -> str:
        return _text.record(self, lambda _: "")  # only a scene knows its units

    @abc.abstractmethod
    def labels(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each of the k entries of the state."""

    def base_units(self) -> tuple[str, str, str] | None:
        """Names of its units of length, mass and time, where its equations are not in SI units.

        The mass is "" where energies are per mass. None, the default, leaves it to `labels` whether
        the units are m, kg and s.
        """
        return None

    def parameter_names(self) -> dict[str, tuple[str, ...]]:
        """For attributes that are arrays of parameters, the names of these; others have indices."""
        return {}

    @abc.abstractmethod
    def rate(self, t: Array, y: Float[Array, " k"], effects: tuple[Effect, ...]) -> Array:
        """Time derivative (k,) of the state."""

    def points(self, t: Array, y: Float[Array, " k"]) -> Points:
        """The material points, used by effects, energies and drawings; none by default."""
        del t, y
        return Points(jnp.zeros((0, 0)), jnp.zeros((0, 0)), jnp.zeros(0))

    def places(self, t: Array, y: Float[Array, " k"]) -> Array:
        """(n, d) where the points, and effects on them, are drawn; by default their positions."""
        return self.points(t, y).r

    def sketch(self, t: Array, y: Float[Array, " k"]) -> tuple[Shape, ...]:
        """Shapes in drawings besides the paths of the material points; see `sketch`."""
        del t, y
        return ()

    def bodies(self, t: Array, y: Float[Array, " k"]) -> tuple[Part, ...]:
        """The bodies that it consists of, for free-body diagrams; () where they are not known."""
        del t, y
        return ()

    def joints(self, t: Array, y: Float[Array, " k"]) -> tuple[Joint, ...]:
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

    def bounds(
        self, t: Array, y: Float[Array, " k"], effects: tuple[Effect, ...]
    ) -> dict[str, Array]:
        """Numbers () that fall below 0 where the equations cease to hold, by the name of a bound.

        A stop is an example: its name is "the stop" and its number the distance from it. A motion
        that passes one has a warning; `Phase` has the equations on both sides.
        """
        del t, y, effects
        return {}

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
            remedy = "It has no material points; `energies` says whether an energy is known."
            raise _checks.fail("kinetic", "material points", type(self).__name__, remedy)
        return 0.5 * jnp.sum(m[:, None] * v * v)

    def energies(
        self, t: Array, y: Float[Array, " k"], effects: tuple[Effect, ...]
    ) -> tuple[Array, ...]:
        """The terms () [J] whose sum is the energy; () for a system without an energy.

        By default they are the kinetic energy of the material points and the potential energy of
        the effects, if there are points.
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

        It is evaluated at the start and the end of a motion; `loses` checks the steps between.
        """
        del t, y
        return None

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """Whether () a step from y0 to y1 may pass a state of `undetermined`; None if none can.

        Such a step is repeated with a shorter one, which ends before that state.
        """
        del t0, y0, t1, y1
        return None

    def canonical(self, t: Array, y: Array) -> Array | None:
        """Canonical coordinates [q, p] (k,) of a state, None if there are none.

        They are used to test whether a monodromy matrix is symplectic.
        """
        del t, y
        return None

    def generators(self, y: Array) -> dict[str, Array]:
        """Generators (k,) of motions of space relative to the system, by name.

        They are candidates for symmetries: whether a scene has one depends on its effects, and is
        tested where they are used.
        """
        del y
        return {}

    def check(self, t: Array, y: Array) -> None:
        """Raise ValueError for invalid numbers."""
        del t, y

    def check_effects(self, t: Array, y: Array, effects: tuple[Effect, ...]) -> None:
        """Raise ValueError for effects that the system cannot have."""
        del t, y, effects


# ---- Checks of the shape and the precision of what the methods of a system and its effects return
#
# An array of the wrong shape is often broadcast silently: one force of shape (d,) on n points would
# act on each of them. Shapes are known as soon as a function is traced, so these checks need no
# values and run once per kind of scene. Every formulation sums its effects by the functions at the
# end, so a force of the wrong shape is found wherever a rate is traced.

_NEEDS_VALUES = (
    jax.errors.TracerArrayConversionError,
    jax.errors.TracerIntegerConversionError,
    jax.errors.ConcretizationTypeError,
)
_TRACEABLE = "Use jax.numpy instead of numpy and math, and jnp.where instead of `if`."
#: Messages of NumPy and of JAX where an entry of an array is assigned.
_FILLED = ("setting an array element", "JAX arrays are immutable")
_RETURN = (
    "Return a list such as [y[1], -y[0]] instead of filling an array entry by entry, or write "
    "d = d.at[0].set(y[1]) with an array d of jax.numpy."
)
_ENERGY = "An energy is one number."
_FORCE = "One row for each point; jnp.broadcast_to(f, r.shape) repeats one force."
_GENERALIZED = "One for each velocity of the system."


def check_field(field: Any, t: Array, y: Array) -> None:
    """Raise ValueError if a method of the system or an effect returns a wrong shape."""
    points = jax.eval_shape(field.system.points, t, y)
    check_points(field.system, t, y, points)
    for effect in field.effects:
        check_effect(effect, field.system, t, y, points)
    check_energies(field.system, field.effects, t, y, points)
    check_rate(field.system, field.effects, t, y)


def check_points(system: Any, t: Array, y: Array, points: Any) -> None:
    """Raise ValueError unless a system's material points have their shapes."""
    name, r = f"{type(system).__name__}.points", jnp.shape(points.r)
    if len(r) != 2:
        raise _checks.fail(name, "r of shape (n, d)", f"shape {r}", "One row for each point.")
    for part, x, wanted in (("v", points.v, r), ("m", points.m, r[:1])):
        if jnp.shape(x) != wanted:
            raise _checks.fail(
                name,
                f"{part} of shape {wanted}",
                f"shape {jnp.shape(x)}",
                f"r has shape {r}: {r[0]} points in {r[1]} dimensions.",
            )


def check_energies(system: Any, effects: tuple, t: Array, y: Array, points: Any) -> None:
    """Raise ValueError unless a system's energies are numbers and its integrals have one axis."""
    name, remedy = type(system).__name__, _ENERGY
    if len(points.m):
        check_value(f"{name}.kinetic", (), remedy, system.kinetic, t, y)
    terms = jax.eval_shape(lambda t, y: system.energies(t, y, effects), t, y)
    for i in range(len(terms)):
        one = functools.partial(lambda i, t, y: system.energies(t, y, effects)[i], i)
        check_value(f"{name}.energies", (), remedy, one, t, y)
    for key, value in jax.eval_shape(system.integrals, t, y).items():
        if value.ndim > 1:
            got = f"shape {value.shape} of {key!r}"
            raise _checks.fail(f"{name}.integrals", "numbers or vectors", got)


def check_rate(system: Any, effects: tuple, t: Array, y: Array) -> None:
    """Raise ValueError unless a system's rate and difference have the shape of the state."""
    name, remedy = type(system).__name__, "One for each entry of the state."
    check_value(f"{name}.rate", y.shape, remedy, lambda t, y: system.rate(t, y, effects), t, y)
    check_value(f"{name}.difference", y.shape, remedy, system.difference, y, y)
    check_repeatable(system, "rate", t, y, effects)


def check_effect(effect: Any, system: Any, t: Array, y: Array, points: Any) -> None:
    """Raise ValueError if a method of an effect returns a wrong shape; None is allowed."""
    name, (r, v, m) = type(effect).__name__, points
    if "generalized" in effect.acts:
        q, rates = system.coordinates(y)
        where = f"{name}.generalized"
        check_value(where, rates.shape, _GENERALIZED, effect.generalized, t, q, rates)
        check_repeatable(effect, "generalized", t, q, rates)
    if "force" not in effect.acts:
        return
    check_value(f"{name}.potential", (), _ENERGY, effect.potential, t, r, m)
    check_value(f"{name}.force", r.shape, _FORCE, effect.force, t, r, v, m)
    check_repeatable(effect, "force", t, r, v, m)


def check_force(effect: Any, force: Array, shape: tuple[int, ...]) -> Array:
    """The force (n, d) of an effect; raises ValueError for another shape."""
    _check_shape(f"{type(effect).__name__}.force", shape, _FORCE, force)
    return force


def check_generalized(effect: Any, force: Array, shape: tuple[int, ...]) -> Array:
    """The force (n,) of an effect on coordinates; raises ValueError for another shape."""
    _check_shape(f"{type(effect).__name__}.generalized", shape, _GENERALIZED, force)
    return force


def check_potential(effect: Any, value: Array) -> Array:
    """The potential () of an effect; raises ValueError for another shape."""
    _check_shape(f"{type(effect).__name__}.potential", (), _ENERGY, value)
    return value


def check_value(
    name: str, shape: tuple[int, ...], remedy: str, function: Callable, *args: Array
) -> None:
    """Raise ValueError unless a function of arrays returns real numbers of this shape, or None."""
    try:
        found = jax.eval_shape(function, *args)
    except _NEEDS_VALUES as error:
        got = f"one that needs their values ({type(error).__name__})"
        raise _checks.fail(name, "a function of traced arrays", got, _TRACEABLE) from error
    except (TypeError, ValueError) as error:
        if not str(error).startswith(_FILLED):
            raise
        got = f"one that fills an array ({error})"[:100]
        raise _checks.fail(name, "a function that returns new numbers", got, _RETURN) from error
    if found is None:
        return
    _check_shape(name, shape, remedy, found)
    if not (jnp.issubdtype(found.dtype, jnp.floating) or jnp.issubdtype(found.dtype, jnp.integer)):
        raise _checks.fail(name, "real numbers", f"an array of {found.dtype}", remedy)


def _check_shape(name: str, shape: tuple[int, ...], remedy: str, found: Any) -> None:
    got = () if isinstance(found, int | float) else getattr(found, "shape", None)
    if got is None:
        raise _checks.fail(name, f"an array of shape {shape}", type(found).__name__, remedy)
    if got != shape:
        raise _checks.fail(name, f"shape {shape}", f"shape {got}", remedy)
    refuse_narrow(found, name)


@eqx.filter_jit
def differences(system: System, ys: Array, others: Array) -> Array:
    """(..., k) by how much states differ from others, with further axes broadcast."""
    pairs = jnp.broadcast_arrays(ys, others)
    return jnp.vectorize(system.difference, signature="(k),(k)->(k)")(*pairs)


def total_force(effects: Iterable[Any], t: Array, r: Array, v: Array, m: Array, start=None):
    """Sum (n, d) [N] of the forces of effects on points at r (n, d), added to `start`."""
    forces = (check_force(e, e.force(t, r, v, m), r.shape) for e in effects)
    return sum(forces, jnp.zeros_like(r) if start is None else start)


def generalized_forces(effects: Iterable[Any], t: Array, q: Array, v: Array) -> list[Array]:
    """The forces (n,) on coordinates of those effects that have one."""
    forces = ((e, e.generalized(t, q, v)) for e in effects)
    return [check_generalized(e, f, v.shape) for e, f in forces if f is not None]


def potential_energy(effects: Iterable[Any], t: Array, r: Array, m: Array) -> Array:
    """Sum () [J] of the potentials of the effects that have one, for points at r (n, d)."""
    values = ((e, e.potential(t, r, m)) for e in effects)
    known = (check_potential(e, value) for e, value in values if value is not None)
    return sum(known, jnp.zeros(()))
