"""Ways to act on a scene from outside: the inputs of transfer functions and of forced scenes.

An input determines the rate of a scene for a value u; how u depends on time is defined separately
(`signals`). An input may also depend on the derivative of u, as a base with a dashpot does.
"""

import abc
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import as_float
from jaxdyn._records import Record
from jaxdyn.analysis.linearize import is_second_order
from jaxdyn.effects.prescribed import ConstantForce
from jaxdyn.scene import Effect, Field, Scene


class Input(Record):
    """An input of a scene.

    A new input overrides `rate`, and `check` if it does not suit all scenes.

    Attributes:
      order: number of derivatives of the signal that it depends on.
    """

    order: ClassVar[int] = 0

    @abc.abstractmethod
    def rate(self, field: Field, t: Array, y: Array, u: Array) -> Array:
        """(k,) the rate of a scene for an input and its derivatives u (order + 1,)."""

    def named(self, scene: Scene) -> tuple[str, str]:
        """What it is called in tables and pictures of a scene, and its unit, "" if not known."""
        del scene
        return _text.words(self), ""

    def check(self, scene: Scene) -> None:
        """Raise ValueError unless the input suits a scene."""
        del scene


class Force(Input):
    """A force on a coordinate, or on a material point along a direction.

    Attributes:
      on: name of the coordinate, one of the first half of the labels of a state [q, v]; or the
        number of a material point. On an angle it is a torque. In a plain `ode`, whose masses are
        not known, it is a force per mass: an acceleration.
      direction: (d,) along which it acts on a point; None for a coordinate.

    Example:
      >>> from jaxdyn import scenes, vibration
      >>> pushed = vibration.Force(0, direction=[1.0])
      >>> h = vibration.receptance(scenes.oscillator(k=4.0, x=0.0), pushed, "x", 0.0)
      >>> float(abs(h))
      0.25
    """

    on: str | int = eqx.field(static=True)
    direction: Array | None = eqx.field(
        converter=lambda x: None if x is None else as_float(x), default=None
    )

    def rate(self, field, t, y, u):
        system = field.system
        if not isinstance(self.on, str):
            assert self.direction is not None
            pushed = ConstantForce(u[0] * self.direction, on=(self.on,))
            return system.rate(t, y, (*field.effects, pushed))
        n = len(y) // 2
        i = [name for name, _ in system.labels()].index(self.on)
        along = jnp.asarray(np.eye(n)[i])
        if "generalized" in system.accepts:
            return system.rate(t, y, (*field.effects, _OnCoordinates(u[0] * along)))
        if "force" in system.accepts:  # free points, whose coordinates are those of the points
            points = _OnPoints(u[0] * along)
            return system.rate(t, y, (*field.effects, points))
        return field.rate(t, y) + u[0] * jnp.concatenate([jnp.zeros(n), along])

    def named(self, scene):
        if not isinstance(self.on, str):
            return f"force on {scene.point_names[self.on]}", scene.in_units("N")
        labels = scene.labels()
        unit, time = dict(labels)[self.on], _text.second(labels)
        if not scene.system.accepts:
            known = unit != "1" and time
            return f"force per mass on {self.on}", f"{unit}/{time}^2" if known else ""
        quantity = {scene.in_units("m"): "N", "rad": "N m"}.get(unit)
        what = "torque" if unit == "rad" else "force"
        return f"{what} on {self.on}", scene.in_units(quantity) if quantity else ""

    def check(self, scene):
        system, names = scene.system, [name for name, _ in scene.labels()]
        if isinstance(self.on, str):
            if not is_second_order(scene, scene.y0):
                got = f"{type(system).__name__} of {', '.join(names)}"[:100]
                wanted = "a scene whose state is [q, v], with dq/dt = v"
                remedy = (
                    "Coordinates come first, then their rates; a dictionary is sorted by its keys. "
                    "vibration.Parameter takes any scene."
                )
                raise _checks.fail("Force", wanted, got, remedy)
            _checks.choice("Force.on", self.on, names[: len(names) // 2])
            if self.direction is not None:
                raise _checks.fail("Force.direction", "none for a coordinate", self.direction)
            return
        d = _points_of(scene, "Force", "Name a coordinate.")
        count = len(scene.points(jnp.zeros(()), scene.y0).m)
        if not 0 <= self.on < count:
            raise _checks.fail("Force.on", f"the number of a point, below {count}", self.on)
        if self.direction is None:
            raise _checks.fail("Force.direction", f"{d} components for a point", "none")
        _checks.array("Force.direction", self.direction, (d,), "One component for each axis.")


class Base(Input):
    """An acceleration of the base (the ground, a room, a table) along a direction.

    The positions of the scene are then relative to the base: anchors, pins and guides move with it,
    and an inertial force, minus the mass times the acceleration, acts on each point.

    Attributes:
      direction: (d,) direction of the acceleration; of length 1 if the signal is in m/s^2.
    """

    direction: Array = eqx.field(converter=as_float)

    def rate(self, field, t, y, u):
        inertia = _Inertia(-u[0] * self.direction)
        return field.system.rate(t, y, (*field.effects, inertia))

    def named(self, scene):
        return "acceleration of the base", scene.in_units("m/s^2")

    def check(self, scene):
        d = _points_of(scene, "Base", "vibration.Motion takes any scene that a function makes.")
        _checks.array("Base.direction", self.direction, (d,), "One component for each axis.")


class Parameter(Input):
    """A parameter of the scene that changes in time.

    Attributes:
      make: the scene for each value of the parameter; its initial state and span do not matter.
      value: () the value in the scene; the input is added to it.
    """

    make: Callable = eqx.field(static=True)
    value: Array = eqx.field(converter=as_float, default=0.0)

    def rate(self, field, t, y, u):
        del field
        return self.make(self.value + u[0]).rate(t, y)

    def check(self, scene):
        _checks.check_callable("Parameter.make", self.make, "value")
        _check_made("Parameter", scene, self.make(self.value))


class Motion(Input):
    """A displacement with its velocity on which the scene depends: a road, a table, a cam.

    Attributes:
      make: the scene for each displacement and velocity (u, du/dt).
    """

    make: Callable = eqx.field(static=True)
    order: ClassVar[int] = 1

    def rate(self, field, t, y, u):
        del field
        return self.make(u[0], u[1]).rate(t, y)

    def named(self, scene):
        del scene
        return "displacement", ""

    def check(self, scene):
        _checks.check_callable("Motion.make", self.make, "displacement", "velocity")
        _check_made("Motion", scene, self.make(jnp.zeros(()), jnp.zeros(())))


class _OnCoordinates(Effect):
    """Forces F (n,) on the coordinates of a mechanism."""

    F: Array
    velocity_dependent: ClassVar[bool] = False

    def generalized(self, t, q, v):
        del t, q, v
        return self.F


class _OnPoints(Effect):
    """Forces F (n d,) on all components of all points."""

    F: Array
    velocity_dependent: ClassVar[bool] = False

    def force(self, t, r, v, m):
        del t, v, m
        return self.F.reshape(r.shape)


class _Inertia(Effect):
    """The same acceleration a (d,) of all points."""

    a: Array
    velocity_dependent: ClassVar[bool] = False

    def force(self, t, r, v, m):
        return m[:, None] * self.acceleration(t, r, v, m)

    def acceleration(self, t, r, v, m):
        del t, v, m
        return jnp.broadcast_to(self.a, r.shape)


def check_input(scene: Scene, given: str | Input) -> Input:
    """The given input, or the force on the coordinate of that name, if it suits a scene.

    Raises:
      ValueError: it does not.
    """
    found = Force(given) if isinstance(given, str) else given
    if not isinstance(found, Input):
        remedy = 'Such as "x" for a force on that coordinate, vibration.Base, vibration.Parameter.'
        raise _checks.fail("input", "an input or the name of a coordinate", repr(given), remedy)
    found.check_functions()
    found.check(scene)
    return found


def _points_of(scene: Scene, name: str, remedy: str) -> int:
    """The number of dimensions of the points of a scene on which forces act."""
    if "force" not in scene.system.accepts:
        got = f"{type(scene.system).__name__}, which has none"
        raise _checks.fail(name, "a scene with material points that forces move", got, remedy)
    return scene.points(jnp.zeros(()), scene.y0).r.shape[1]


def _check_made(name: str, scene: Scene, made: Scene) -> None:
    if not isinstance(made, Scene) or made.labels() != scene.labels():
        got = type(made).__name__ if not isinstance(made, Scene) else "another one"
        raise _checks.fail(f"{name}.make", "a function that returns this scene", got)


# ---- The output of a response: an entry of the state, or a function of time and state

Output = str | Callable[[Array, Array], Array]


def output(name: str, what: Output, scene: Scene) -> Callable[[Array, Array], Array]:
    """The output as a function (t, y) -> () or (m,), from the name of an entry or a function.

    Raises:
      ValueError: there is no such entry, or the function returns neither of these.
    """
    names = [label for label, _ in scene.labels()]
    if callable(what):
        shape = jax.eval_shape(what, jnp.zeros(()), jnp.asarray(scene.y0, float)).shape
        if len(shape) > 1:
            got = f"one that returns the shape {shape}"
            raise _checks.fail(name, "a function (t, y) that returns () or (m,)", got)
        return what
    if not isinstance(what, str):
        wanted = "the name of an entry of the state, or a function (t, y)"
        raise _checks.fail(name, wanted, repr(what))
    i = names.index(_checks.choice(name, what, names))
    return lambda t, y: y[i]


def named_output(what: Output, scene: Scene) -> tuple[str, str]:
    """What an output is called, and its unit: "" where it is not known."""
    if isinstance(what, str):
        unit = dict(scene.labels())[what]
        return what, "" if unit == "1" else unit
    name = getattr(what, "__name__", "").strip("_")
    return name if name.isidentifier() else "output", ""
