"""Scenes: a system together with the effects that act on it.

A `System` defines coordinates and how forces move them. An `Effect` acts on material points; both
are defined in `jaxdyn.system`. A `Scene` is a system with its effects, a start and a default span
of time; ``scene.rate(t, y)`` is its vector field. All later layers (integration, linearisation,
orbits, pictures) use only these three interfaces.

Conventions: the state ``y`` is one flat float64 array of shape ``(k,)``; where a system is of
second order it is ``[q, v]`` with ``dq/dt = v``. All three are pytrees whose numbers are array
leaves, so ``jit``, ``grad`` and ``vmap`` go through the scene itself and a new value never
recompiles. Constructors check nothing, since they also run inside traces; entry points call
``scene.check()``.
"""

import contextlib
import dataclasses
import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import _checks, _text
from jaxdyn._checks import check_kind
from jaxdyn._records import Record, notes_on
from jaxdyn._units import in_base_units, measure
from jaxdyn.scales import Groups, groups
from jaxdyn.sketch import Shape
from jaxdyn.system import Effect, Points, System, check_field

# ---- A system with its effects, without a start: the interface to integrators and other libraries
#
# The compiled code of this library takes a `Field`; `VectorField` is the same rate as a function
# for other libraries.


class Field(NamedTuple):
    """A system with its effects, without a start: what integrators and Jacobians need.

    It is a tuple, not a module, since each call of a solver creates one, ten times as fast.
    """

    system: System
    effects: tuple[Effect, ...]

    def rate(self, t: Array, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The vector field dy/dt."""
        return self.system.rate(t, y, self.effects)

    def energies(self, t: Array, y: Float[Array, " k"]) -> tuple[Array, ...]:
        """The terms () whose sum is the energy, none without an energy; see `System.energies`."""
        return self.system.energies(t, y, self.effects)

    @property
    def groups(self) -> Groups:
        """Which entries of the state share a size."""
        return groups(self.system)

    def points(self, t: Array, y: Float[Array, " k"]) -> Points:
        """The material points; raises ValueError if the system has none."""
        points = self.system.points(t, y)
        if not len(points.m):
            raise _checks.fail("scene", "one with material points", type(self.system).__name__)
        return points

    def check_functions(self) -> None:
        """Raise ValueError if a number that a function captured has changed; see `Record`."""
        self.system.check_functions()
        for effect in self.effects:
            effect.check_functions()

    def project(self, t: Array, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The nearest state that satisfies the system's constraints."""
        return self.system.project(t, y)

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () the constraints leave the acceleration undetermined at a state (k,)."""
        return self.system.undetermined(t, y)

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """Whether () a step may pass a state that leaves the acceleration undetermined."""
        return self.system.loses(t0, y0, t1, y1)


class FieldAround:
    """A field around another, to which it leaves whatever it does not define itself.

    Attributes:
      field: the inner field.
    """

    field: Any

    @property
    def system(self) -> Any:
        """The system of the field."""
        return self.field.system

    @property
    def groups(self) -> Groups:
        """Which entries of the state share a size."""
        return self.field.groups

    def rate(self, t: Array, y: Array) -> Array:
        """The vector field dy/dt."""
        return self.field.rate(t, y)

    def project(self, t: Array, y: Array) -> Array:
        """The nearest state that satisfies the system's constraints."""
        return self.field.project(t, y)

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () the constraints leave the acceleration undetermined at a state (k,)."""
        return self.field.undetermined(t, y)

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """Whether () a step may pass a state that leaves the acceleration undetermined."""
        return self.field.loses(t0, y0, t1, y1)


class VectorField(eqx.Module):
    """The rate of a scene as a function: f(t, y), or f(t, y, args) for diffrax.

    NumPy in gives NumPy out, so that ``scipy.integrate.solve_ivp(scene.vector_field, ...)`` works.
    It is compiled once per kind of scene, whatever its numbers, and supports jit, grad and vmap.
    Equal fields, as of one scene, have the same hash, so that ``jax.jit(scene.vector_field)``
    compiles once.

    Attributes:
      field: the system and its effects.

    Example:
      >>> from scipy.integrate import solve_ivp
      >>> from jaxdyn import scenes
      >>> scene = scenes.oscillator()
      >>> run = solve_ivp(scene.vector_field, (0.0, 1.0), np.asarray(scene.y0), rtol=1e-10)
      >>> bool(abs(run.y[0, -1] - np.cos(1.0)) < 1e-6)
      True
    """

    field: Field

    def __call__(self, t: Any, y: Any, args: Any = None) -> Any:
        """Rates (k,) of the state y (k,) at time t; `args` is ignored."""
        del args
        _checks.float64(_checks.NARROW_RTOL)  # the tolerance is that of the other library
        self.field.check_functions()
        labels = self.field.system.labels()
        _checks.check_shape("y", np.shape(y), (len(labels),), "One entry for each of the state.")
        rate = _rate(self.field, _float(t), _float(y))
        given = isinstance(y, np.ndarray) and not _checks.is_traced(rate)
        return np.asarray(rate) if given else rate

    def _values(self) -> Any:
        """The values that define equality; None while a number is traced."""
        leaves, tree = jax.tree.flatten(self.field)
        if _checks.is_traced(leaves):
            return None
        arrays = [np.asarray(x) for x in leaves]
        return tree, tuple((x.shape, x.dtype.str, x.tobytes()) for x in arrays)

    def __hash__(self) -> int:
        return hash(self._values() or id(self))

    def __eq__(self, other: object) -> bool:
        if self is other or not isinstance(other, VectorField):
            return self is other
        values = self._values()
        return values is not None and values == other._values()


def _float(x: Any) -> Array | np.ndarray:
    # Other numbers become NumPy arrays: a conversion to JAX costs more than the rate.
    return jnp.asarray(x, float) if isinstance(x, jax.Array) else np.asarray(x, float)


@functools.partial(jax.jit, inline=True)
def _rate(field: Field, t: Array, y: Array) -> Array:
    return field.rate(t, y)


@jax.jit
def properties_at(field: Field, t: Array, y: Array) -> tuple:
    """The points, which forces depend on velocity against their claim, and whether dq/dt = v.

    One compiled call finds all three: each call takes as long as a short solve, and an uncompiled
    force takes milliseconds. Shapes are checked while it is traced.
    """
    points = field.system.points(t, y)
    check_field(field, t, y)
    depends = tuple(_depends_on_velocity(effect, t, points) for effect in field.effects)
    return points, depends, _is_second_order(field.system, t, y)


def _depends_on_velocity(effect: Effect, t: Array, points: Points) -> Array | bool:
    """Whether a force that claims to be velocity-independent changes if velocities are NaN.

    One that depends on them becomes NaN, or takes the other branch of a comparison.
    """
    if effect.velocity_dependent:
        return False
    r, v, m = points
    probed, plain = (effect.force(t, r, u, m) for u in (v * jnp.nan, v))
    return ~jnp.array_equal(probed, plain, equal_nan=True)


def _is_second_order(system: System, t: Array, y: Array) -> Array | bool:
    """Whether dq/dt = v and dv/dt is independent of v, where that is claimed; tested with NaN."""
    if len(y) % 2 or not system.second_order:
        return False
    q, v = jnp.split(y, 2)
    v = v + jnp.arange(1.0, len(v) + 1)  # at rest any multiple of v would pass as dq/dt
    rate, probed = (system.rate(t, jnp.concatenate([q, u]), ()) for u in (v, v * jnp.nan))
    same = jnp.array_equal(rate[len(v) :], probed[len(v) :], equal_nan=True)
    return same & jnp.array_equal(rate[: len(v)], v)


# ---- Scenes: a system together with the effects that act on it


class Scene(Record):
    """A system, the effects that act on it, its start y0 (k,) and a default span t1 [s].

    Its name is the title of pictures. Name and units are static, so functions that are compiled for
    a scene are compiled once for each name. Units of length, mass and time are given where they are
    not m, kg and s: with ``units=("AU", "Msun", "day")`` tables, pictures and files name those.
    Numbers are not converted: those of the effects, such as G, have to be in these units too.

    Example:
      >>> from jaxdyn import scenes
      >>> print(scenes.oscillator(k=2.0))
      Scene oscillator
        system   FreePoints(m = (1,) kg, d = 1)
        effects  Spring(k = 2 N/m, length = 0 m, anchor = 0 m)
        start    x = 1 m, vx = 0 m/s
        span     10 s
    """

    system: System
    effects: tuple[Effect, ...]
    y0: Array
    t1: Array
    name: str = eqx.field(static=True, default="")
    units: tuple[str, str, str] | None = eqx.field(static=True, default=None)

    def __init__(
        self,
        system: System,
        effects: tuple[Effect, ...] = (),
        *,
        y0: Any,
        t1: Any = 1.0,
        name: str = "",
        units: Sequence[str] | None = None,
    ):
        self.system = system
        self.effects = tuple(effects)
        self.y0 = _checks.numbers("y0", y0)
        self.t1 = _checks.numbers("t1", t1)
        self.name = name
        several = isinstance(units, Iterable) and not isinstance(units, str)
        names = units if units is None or several else (units,)  # "day" is not d, a and y
        self.units = None if names is None else cast(tuple[str, str, str], tuple(names))

    @_text.never_raising
    def __repr__(self) -> str:
        shape = self.y0.shape[:-1]
        one = jax.tree.map(lambda x: x[(0,) * len(shape)], self) if shape else self
        labels = one.labels()
        second = _text.second(labels)
        rows = [
            ("batch", f"of shape {shape}" if shape else ""),
            ("system", _text.record(self.system, one.in_units)),
            ("effects", ", ".join(_text.record(effect, one.in_units) for effect in self.effects)),
            ("start", _text.brief(self.y0) if shape else _text.entries(labels, self.y0)),
            ("span", _text.brief(self.t1, second)),
        ]
        return _text.table(f"Scene {self.name}".rstrip(), rows)

    @_text.with_picture
    def _repr_html_(self):
        from jaxdyn.drawing import space

        return space.pose(self)

    def live(self, path=None):
        """A page on which the scene runs, with its numbers to be changed: see `jaxdyn.player.live`.

        Args:
          path: a file to write the page to, .html; it needs no other file.
        Raises:
          ValueError: its rate has no formulas or too long ones, or `path` cannot be written.
        """
        from jaxdyn.player import live

        return live(self, path)

    @property
    def field(self) -> Field:
        """The scene without its start and span."""
        return Field(self.system, self.effects)

    def rate(self, t: Array, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The vector field dy/dt, compiled once for each kind of scene.

        Raises:
          ValueError: a number that a function captured has changed since the scene was made.
        """
        self.check_functions()
        return _rate(self.field, _float(t), _float(y))

    @property
    def vector_field(self) -> VectorField:
        """The `rate` as a function (t, y), for other libraries; see `VectorField`."""
        self.check()
        return VectorField(self.field)

    def term(self) -> diffrax.ODETerm:
        """The scene's rate as a term for ``diffrax.diffeqsolve``.

        Derivatives with respect to the scene's numbers are those of diffrax's adjoints. States are
        not projected onto constraints, which hold only to the tolerance.

        Example:
          >>> from jaxdyn import scenes
          >>> scene = scenes.oscillator()
          >>> run = diffrax.diffeqsolve(scene.term(), diffrax.Tsit5(), 0.0, 1.0, 0.01, scene.y0)
          >>> bool(abs(run.ys[0, 0] - jnp.cos(1.0)) < 1e-9)
          True
        """
        return diffrax.ODETerm(self.vector_field)

    def points(self, t: Array, y: Float[Array, " k"]) -> Points:
        """The material points; raises ValueError if the system has none."""
        return self.field.points(t, y)

    @property
    def has_points(self) -> bool:
        """Whether the system has material points."""
        return bool(jax.eval_shape(_points, self).m.shape[0])

    @property
    def has_energy(self) -> bool:
        """Whether the system has an energy; see `System.energies`."""
        return bool(jax.eval_shape(_energies, self))

    def sketch(self, t: Array, y: Float[Array, " k"]) -> tuple[Shape, ...]:
        """The shapes of the system and of the effects in drawings; see `sketch`."""
        r = self.system.places(t, y)
        on_points = (effect.sketch(t, r) for effect in self.effects)
        return (*self.system.sketch(t, y), *(shape for shapes in on_points for shape in shapes))

    @property
    def second_order(self) -> bool:
        """True where y = [q, v] and the acceleration does not depend on v."""
        return self.system.second_order and not any(e.velocity_dependent for e in self.effects)

    @property
    def singular(self) -> str:
        """Where its motions may run into a singularity, in the words of its parts."""
        said = (part.singular for part in (self.system, *self.effects))
        return " ".join(dict.fromkeys(text for text in said if text))

    def __add__(self, effect: Effect) -> "Scene":
        """The same scene with one more effect.

        Raises:
          ValueError: it is not an effect, or is one that the system would ignore.
        """
        check_kind("effect", effect, (Effect,))
        _check_accepted(self.system, effect)
        return dataclasses.replace(self, effects=(*self.effects, effect))

    def without(self, kind: type[Effect]) -> "Scene":
        """The same scene without all effects of this kind."""
        kept = tuple(e for e in self.effects if not isinstance(e, kind))
        if len(kept) == len(self.effects):
            has = ", ".join(type(e).__name__ for e in self.effects) or "none"
            raise _checks.fail("without", f"an effect of the scene ({has})", kind.__name__)
        return dataclasses.replace(self, effects=kept)

    def starting(self, y0, t1=None) -> "Scene":
        """The same scene from another start, and over another span if given.

        Args:
          y0: (k,) the start; or values () of some of its entries by name, while the others stay.
          t1: () span [s].
        Example:
          >>> from jaxdyn import scenes
          >>> scenes.pendulum().starting({"theta_dot": 2.0}).y0.tolist()[1]
          2.0
        """
        if isinstance(y0, Mapping):
            names = [name for name, _ in self.labels()]
            given = {_checks.choice("y0", x, names): _checks.array(x, y0[x], ()) for x in y0}
            y0 = jnp.stack([given.get(x, old) for x, old in zip(names, self.y0, strict=True)])
        return dataclasses.replace(self, y0=y0, t1=self.t1 if t1 is None else t1)

    def labels(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each entry of the state; the unit is "1" where there are no units."""
        named = self.system.labels()
        if self.units is not None:
            check_units(self.units)
            return tuple((name, in_base_units(unit, self.units)) for name, unit in named)
        if any(effect.without_units for effect in self.effects):
            return tuple((name, "1") for name, _ in named)
        return named

    @property
    def point_names(self) -> tuple[str, ...]:
        """The names of the material points; one that is a body by itself has the body's name."""
        count = _points(self).r.shape[0]
        parts = self.system.bodies(jnp.zeros(()), self.y0)
        named = {part.points[0]: part.name for part in parts if len(part.points) == 1}
        return tuple(named.get(i, f"body {i + 1}") for i in range(count))

    @property
    def base_units(self) -> tuple[str, str, str] | None:
        """Names of the units of length, mass and time; None if there are none or they are unknown.

        The mass is "" where energies are per mass.
        """
        labels = self.labels()
        if self.units is None:
            own = self.system.base_units()
            return own or (_SI if _text.in_si(labels) else None)
        return self.units if any(unit != "1" for _, unit in labels) else None

    def in_units(self, unit: str) -> str:
        """A unit made of m, kg and s, such as "J", in those of the scene; "" where not known.

        Example:
          >>> from jaxdyn import scenes
          >>> scenes.n_body(units=("AU", "Msun", "day")).in_units("J")
          'Msun AU^2/day^2'
        """
        names = self.base_units
        return "" if names is None else in_base_units(unit, names)

    def check(self) -> None:
        """Raise ValueError if a number is invalid; traced numbers pass."""
        if not isinstance(self.name, str):
            raise _checks.fail("name", "text", repr(self.name))
        if self.units is not None:
            check_units(self.units)
        self.check_functions()
        _checks.refuse_made_before("scene", self.y0, *self.system.converted)
        system = self.system
        named = system.labels()
        if not named:
            raise _checks.fail("system", "a system with a state", "one without entries")
        if np.shape(self.y0) != np.shape(named)[:1]:
            names = ", ".join(name for name, _ in named)
            _checks.array("y0", self.y0, (len(named),), f"One entry for each of {names}.")
        _checks.array("y0", self.y0, (len(named),))
        if len(self.effects) > _MOST_EFFECTS:
            raise _checks.fail(
                "effects",
                f"at most {_MOST_EFFECTS}",
                len(self.effects),
                "Each is compiled separately. Write one Effect for all of a kind, whose numbers "
                "are arrays with a row for each, as effects.SpringNetwork is.",
            )
        for effect in self.effects:
            _check_accepted(system, effect)
            _checks.refuse_made_before(type(effect).__name__, *effect.converted)
        if _checks.is_traced(self):
            check_field(self.field, jnp.zeros(()), jnp.asarray(self.y0, float))
            return
        # Within a jit that has captured the scene, its numbers would become traced ones without
        # this context. Elsewhere the context would only compile more programs.
        within = _checks.is_traced(jnp.zeros(()))
        with jax.ensure_compile_time_eval() if within else contextlib.nullcontext():
            self._check_values(np.zeros(()), np.asarray(self.y0, float))

    def _check_values(self, t: np.ndarray, y: np.ndarray) -> None:
        """The part of `check` that needs numbers: it evaluates the scene at its start."""
        system = self.system
        system.check(t, y)
        try:
            points, depends, second_order = properties_at(self.field, t, y)
        except (ValueError, TypeError, IndexError):
            # A shape or an index is wrong; if that is due to an effect, its check names the effect.
            _check_effects(self.effects, system.points(t, y))
            raise
        _check_effects(self.effects, points)
        system.check_effects(t, y, self.effects)
        # A wrong claim would silently give wrong trajectories.
        for effect, wrong in zip(self.effects, depends, strict=True):
            if wrong:
                raise _checks.fail(
                    type(effect).__name__,
                    "a velocity-independent force, as velocity_dependent = False says",
                    "one that depends on velocities",
                    "Set velocity_dependent = True in the class.",
                )
        if system.second_order and not second_order:
            raise _checks.fail(
                type(system).__name__,
                "a state [q, v] with dq/dt = v and dv/dt independent of v, as second_order says",
                "another rate",
                "Leave second_order out.",
            )


_SI = ("m", "kg", "s")


def check_units(units: Any) -> None:
    """Raise ValueError unless these are names of units of length, mass and time."""
    several = not isinstance(units, str) and len(units) == len(_SI)
    if not several or not all(isinstance(x, str) and x.isidentifier() for x in units):
        wanted = 'names of the units of length, mass and time, such as ("AU", "Msun", "day")'
        raise _checks.fail("units", wanted, repr(units))
    for name, base in zip(units, _SI, strict=True):
        known = measure(name)
        if known is not None and known.powers != ((base, 1),):
            remedy = "The order is length, mass, time."
            raise _checks.fail("units", f"a unit of the same kind as {base}", repr(name), remedy)


#: Compiling takes some 0.06 s per effect, and grows faster than the number of effects [measured:
#: 200 drags took 12 s, on a loaded core]; this many take a minute.
_MOST_EFFECTS = 500

#: What an effect's methods return, for messages.
_ACTIONS = {"force": "forces on points", "generalized": "forces on coordinates"}


@jax.jit  # traced once for scenes of a kind: asking for a shape then takes 0.03 ms instead of 3
def _points(scene: Scene) -> Points:
    return scene.system.points(jnp.zeros(()), scene.y0)


@jax.jit
def _energies(scene: Scene) -> tuple[Array, ...]:
    return scene.system.energies(jnp.zeros(()), scene.y0, scene.effects)


def _check_effects(effects: tuple[Effect, ...], points: Points) -> None:
    points = Points(*map(np.asarray, points))
    for effect in effects:
        try:
            effect.check(points)
        except ValueError as error:
            name = type(effect).__name__
            if str(error).startswith((name, "y0")):
                raise
            # Numbers of several effects may have one name.
            raise ValueError(f"{name}: {error}") from error


def _check_accepted(system: System, effect: Effect) -> None:
    if not isinstance(effect, Effect):
        raise _checks.fail("effects", "effects", repr(effect), "Write a subclass of Effect.")
    ignored = effect.acts - system.accepts
    if ignored:
        accepted = " and ".join(_ACTIONS[name] for name in sorted(system.accepts))
        raise _checks.fail(
            type(effect).__name__,
            f"an effect that {type(system).__name__} accepts: {accepted or 'none at all'}",
            " and ".join(_ACTIONS[name] for name in sorted(ignored)),
            "It would be ignored silently. Leave it out, or use another formulation.",
        )


def check_scene(scene: Any, rtol: Any = 0.0) -> Scene:
    """The scene, checked; entry points call this first, with the tolerance if one is asked for."""
    check_kind("scene", scene, (Scene,))
    _checks.float64(rtol)
    notes = notes_on(scene)
    if notes is None or "checked" not in notes:
        scene.check()
        if notes is not None:
            notes["checked"] = True
    else:
        scene.check_functions()
    return scene
