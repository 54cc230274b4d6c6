"""The waist of the library: what moves, what acts on it, and the two together.

A `System` knows its coordinates and how forces move them. An `Effect` acts on material
points. A `Scene` is a system with its effects, a start and a span of time worth looking at;
``scene.rate(t, y)`` is its vector field. Everything to the right of this file (integration,
linearisation, orbits, pictures) sees only these three interfaces.

Conventions: the state ``y`` is one flat float64 array of shape ``(k,)``; where a system is of
second order it is ``[q, v]`` with ``dq/dt = v``. All three are pytrees whose numbers are array
leaves, so ``jit``, ``grad`` and ``vmap`` go through the scene itself and a new value never
recompiles. Constructors check nothing, since they also run inside traces; entry points call
``scene.check()``.
"""

import abc
import dataclasses
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn import _checks, _shapes
from jaxdyn.sketch import Shape


class Points(NamedTuple):
    """Material points: positions r (n, d) [m], velocities v (n, d) [m/s], masses m (n,) [kg]."""

    r: Array
    v: Array
    m: Array


class Effect(eqx.Module):
    """What acts on material points: a force, or a potential whose force is minus its gradient.

    A new effect overrides `potential` or `force` (or both) and sets `velocity_dependent`;
    everything else follows. An effect that a scene does not have is absent from the compiled
    program, not multiplied by zero.
    """

    #: Whether the force depends on velocities. Where no effect of a scene does, the
    #: integrator takes a Nystrom pair, about twice as fast.
    velocity_dependent: ClassVar[bool] = True
    #: Where the force has no value or no direction, and what to do about it: a sentence for the
    #: message of a motion that ends there; empty for a force that is smooth everywhere.
    singular: ClassVar[str] = ""

    def potential(self, t: Array, r: Array, m: Array) -> Array | None:
        """Potential energy () [J] of points at r (n, d); None where there is none."""
        del t, r, m
        return None

    def force(self, t: Array, r: Array, v: Array, m: Array) -> Array:
        """Forces (n, d) [N] on the points."""
        del v
        if self.acts == {"generalized"}:
            return jnp.zeros_like(r)
        return -jax.grad(self._potential, argnums=1)(t, r, m)

    def generalized(self, t: Array, q: Array, v: Array) -> Array | None:
        """Forces (n,) on the coordinates themselves, e.g. a motor's torque; None by default."""
        del t, q, v
        return None

    def sketch(self, t: Array, r: Array) -> tuple[Shape, ...]:
        """What a drawing shows of the effect on points at r (n, d): a spring, an anchor."""
        del t, r
        return ()

    @property
    def without_units(self) -> bool:
        """Whether its numbers are those of a world without units, as G = 1; host only."""
        return False

    @property
    def acts(self) -> frozenset[str]:
        """What it acts on, by its methods: "force" for points, "generalized" for coordinates.

        A potential is a force on points. It follows from what a class overrides.
        """
        cls = type(self)
        on_points = cls.force is not Effect.force or cls.potential is not Effect.potential
        on_coordinates = cls.generalized is not Effect.generalized
        return frozenset(["force"] * on_points + ["generalized"] * on_coordinates)

    def _potential(self, t: Array, r: Array, m: Array) -> Array:
        value = self.potential(t, r, m)
        if value is None:
            raise _checks.fail(
                type(self).__name__, "a `force` or a `potential`", "neither", "Override one."
            )
        return value

    def check(self, points: Points) -> None:
        """Raise ValueError for numbers that make no sense with these points."""
        del points


class System(eqx.Module):
    """What moves: coordinates, and how forces on material points move them."""

    @abc.abstractmethod
    def labels(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each of the k entries of the state."""

    @abc.abstractmethod
    def rate(self, t: Array, y: Float[Array, " k"], effects: tuple[Effect, ...]) -> Array:
        """Time derivative (k,) of the state."""

    @abc.abstractmethod
    def points(self, t: Array, y: Float[Array, " k"]) -> Points:
        """The material points: effects, energies and drawings look here."""

    def sketch(self, t: Array, y: Float[Array, " k"]) -> tuple[Shape, ...]:
        """What a drawing shows besides the paths of the material points; see `sketch`."""
        del t, y
        return ()

    @property
    def obeys(self) -> frozenset[str]:
        """Which methods of its effects `rate` uses: "force", "generalized", both, or none.

        An effect that acts in another way would be left out silently; `Scene.check` refuses it.
        """
        return frozenset()

    @property
    def singular(self) -> str:
        """Where the coordinates or equations end; see `Effect.singular`."""
        return ""

    def coordinates(self, y: Float[Array, " k"]) -> tuple[Array, Array]:
        """q and the velocities v that an effect's `generalized` is given; its work is that on v."""
        q, v = jnp.split(y, 2)
        return q, v

    @property
    def second_order(self) -> bool:
        """True where y = [q, v] with dq/dt = v, and dv/dt is free of v but for the effects."""
        return False

    def kinetic(self, t: Array, y: Float[Array, " k"]) -> Array:
        """Kinetic energy () [J]."""
        _, v, m = self.points(t, y)
        return 0.5 * jnp.sum(m[:, None] * v * v)

    def difference(self, y1: Array, y0: Array) -> Array:
        """y1 - y0 (k,) as a small displacement; systems with angles wrap them."""
        return y1 - y0

    def project(self, t: Array, y: Array) -> Array:
        """The nearest state that satisfies the system's constraints; applied after each step."""
        del t
        return y

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () the constraints leave the motion open at a state; None without constraints.

        Looked at where a motion starts and where it ends.
        """
        del t, y
        return None

    def canonical(self, t: Array, y: Array) -> Array | None:
        """Canonical coordinates [q, p] (k,) of a state, None where there are none.

        The orbit finder tests with them whether a monodromy matrix is symplectic.
        """
        del t, y
        return None

    def generators(self, y: Array) -> dict[str, Array]:
        """Directions (k,) in which space could be moved about the system, by name.

        Candidates for symmetries; whether a scene has one depends on its effects, and the
        orbit finder tests it.
        """
        del y
        return {}

    def check(self, t: Array, y: Array) -> None:
        """Raise ValueError for numbers that make no sense."""
        del t, y


class Field(NamedTuple):
    """A system with its effects, without a start: what integrators and Jacobians need.

    A tuple, not a module: it is made at each call of a solver, in a tenth of the time.
    """

    system: System
    effects: tuple[Effect, ...]

    def rate(self, t: Array, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The vector field dy/dt."""
        return self.system.rate(t, y, self.effects)

    def project(self, t: Array, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The nearest state that satisfies the system's constraints."""
        return self.system.project(t, y)

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () the constraints leave the motion open at a state (k,)."""
        return self.system.undetermined(t, y)


class Scene(eqx.Module):
    """A system, the effects that act on it, its start y0 (k,) and a span t1 [s] worth seeing.

    Its name stands above pictures. It is static, so functions that are compiled for a scene are
    compiled once for each name.
    """

    system: System
    effects: tuple[Effect, ...]
    y0: Array
    t1: Array
    name: str = eqx.field(static=True, default="")

    def __init__(
        self,
        system: System,
        effects: tuple[Effect, ...] = (),
        *,
        y0: Any,
        t1: Any = 1.0,
        name: str = "",
    ):
        self.system = system
        self.effects = tuple(effects)
        self.y0 = _checks.numbers("y0", y0)
        self.t1 = _checks.numbers("t1", t1)
        self.name = name

    @property
    def field(self) -> Field:
        """The scene without its start and span."""
        return Field(self.system, self.effects)

    def rate(self, t: Array, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The vector field dy/dt."""
        return self.field.rate(t, y)

    def sketch(self, t: Array, y: Float[Array, " k"]) -> tuple[Shape, ...]:
        """What a drawing shows of the system and of the effects; see `sketch`."""
        r = self.system.points(t, y).r
        on_points = (effect.sketch(t, r) for effect in self.effects)
        return (*self.system.sketch(t, y), *(shape for shapes in on_points for shape in shapes))

    @property
    def second_order(self) -> bool:
        """True where y = [q, v] and the acceleration does not depend on v."""
        return self.system.second_order and not any(e.velocity_dependent for e in self.effects)

    @property
    def singular(self) -> str:
        """Where its motions may run into a singularity: what its parts say of it."""
        said = (part.singular for part in (self.system, *self.effects))
        return " ".join(dict.fromkeys(text for text in said if text))

    def __add__(self, effect: Effect) -> "Scene":
        """The same scene with one more effect."""
        if not isinstance(effect, Effect):
            return NotImplemented
        return dataclasses.replace(self, effects=(*self.effects, effect))

    def without(self, kind: type[Effect]) -> "Scene":
        """The same scene with all effects of this kind left out."""
        kept = tuple(e for e in self.effects if not isinstance(e, kind))
        if len(kept) == len(self.effects):
            has = ", ".join(type(e).__name__ for e in self.effects) or "none"
            raise _checks.fail("without", f"an effect of the scene ({has})", kind.__name__)
        return dataclasses.replace(self, effects=kept)

    def starting(self, y0, t1=None) -> "Scene":
        """The same scene from another start, and over another span if given."""
        return dataclasses.replace(self, y0=y0, t1=self.t1 if t1 is None else t1)

    def labels(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each entry of the state, "1" for all units where there are none."""
        named = self.system.labels()
        if any(effect.without_units for effect in self.effects):
            return tuple((name, "1") for name, _ in named)
        return named

    def check(self) -> None:
        """Raise ValueError if a number makes no sense; traced numbers pass."""
        if not isinstance(self.name, str):
            raise _checks.fail("name", "text", repr(self.name))
        k = len(self.system.labels())
        if not k:
            raise _checks.fail("system", "something that moves", "a state without entries")
        _checks.array("y0", self.y0, (k,), f"One entry for each of {self._names()}.")
        if len(self.effects) > _MOST_EFFECTS:
            raise _checks.fail(
                "effects",
                f"at most {_MOST_EFFECTS}",
                len(self.effects),
                "Each is compiled by itself. Write one Effect for all of a kind, whose numbers are "
                "arrays with a row for each, as effects.SpringNetwork is.",
            )
        for effect in self.effects:
            self._check_obeyed(effect)
        t, y = jnp.zeros(()), jnp.asarray(self.y0, float)
        if _checks.is_traced(self):
            _check_shapes(self.field, t, y)
            return
        self.system.check(t, y)
        points = _points(self.system, t, y)
        for effect in self.effects:
            effect.check(points)
        for effect, depends in zip(self.effects, _probed(self.field, t, y), strict=True):
            if depends:
                # A wrong claim would give wrong trajectories silently.
                raise _checks.fail(
                    type(effect).__name__,
                    "a velocity-independent force, as velocity_dependent = False says",
                    "one that depends on velocities",
                    "Set velocity_dependent = True in the class.",
                )

    def _names(self) -> str:
        return ", ".join(name for name, _ in self.system.labels())

    def _check_obeyed(self, effect: Effect) -> None:
        if not isinstance(effect, Effect):
            raise _checks.fail("effects", "effects", repr(effect), "Make an Effect of it.")
        ignored = effect.acts - self.system.obeys
        if ignored:
            obeyed = " and ".join(_ACTIONS[way] for way in sorted(self.system.obeys))
            raise _checks.fail(
                type(effect).__name__,
                f"what moves a {type(self.system).__name__}: {obeyed or 'no effects at all'}",
                " and ".join(_ACTIONS[way] for way in sorted(ignored)),
                "It would be left out silently. Leave it out, or take another formulation.",
            )


#: Compiling takes some 0.06 s an effect, and more than in proportion to their number [measured: 200
#: drags 12 s, on a loaded core]; this many take a minute.
_MOST_EFFECTS = 500

#: What an effect's methods do, in words.
_ACTIONS = {"force": "forces on points", "generalized": "forces on coordinates"}


def checked(scene: Any) -> Scene:
    """The scene, if it is one and its numbers make sense: what entry points begin with."""
    if not isinstance(scene, Scene):
        name = getattr(scene, "__name__", None)
        remedy = f"Call it: {name}()." if callable(scene) and name else ""
        raise _checks.fail("scene", "a Scene", name or repr(scene), remedy)
    scene.check()
    return scene


def _check_shapes(field: Field, t: Array, y: Array) -> None:
    """Raise ValueError if what the system or an effect returns has the wrong shape."""
    points = jax.eval_shape(field.system.points, t, y)
    _shapes.check_points(field.system, t, y, points)
    for effect in field.effects:
        _shapes.check_effect(effect, field.system, t, y, points)
    _shapes.check_rate(field.system, field.effects, t, y)


@eqx.filter_jit
def _points(system: System, t: Array, y: Array) -> Points:
    points = system.points(t, y)
    _shapes.check_points(system, t, y, points)
    return points


@eqx.filter_jit
def _probed(field: Field, t: Array, y: Array) -> tuple[Array | bool, ...]:
    """Whether each force that claims to be velocity-independent changes for NaN velocities.

    It then becomes NaN, or takes the other branch of a comparison. Compiled, because a force step
    by step on the host takes milliseconds; shapes are checked as it is traced.
    """
    _check_shapes(field, t, y)
    r, v, m = field.system.points(t, y)

    def depends(effect: Effect) -> Array | bool:
        if effect.velocity_dependent:
            return False
        probed, plain = (effect.force(t, r, u, m) for u in (v * jnp.nan, v))
        return ~jnp.array_equal(probed, plain, equal_nan=True)

    return tuple(depends(effect) for effect in field.effects)
