"""A scene with an input that follows a signal in time."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.formulations.extended import Extended
from jaxdyn.scene import Field, Scene, check_scene
from jaxdyn.vibration.inputs import Input, check_input
from jaxdyn.vibration.signals import Signal, check_signal


class Driven(Extended):
    """A system with an input that follows a signal; its state is that of the inner system.

    The energy is that of the system without the input.

    Attributes:
      input: where the signal acts.
      signal: the value of the input in time.
    """

    input: Input
    signal: Signal

    def further(self):
        return ()

    @property
    def second_order(self):
        return self.system.second_order and not self.input.order

    def rate(self, t, y, effects):
        t = jnp.asarray(t, y.dtype)
        u = derivatives(self.signal, t, self.input.order)
        return self.input.rate(Field(self.system, effects), t, y, u)

    def canonical(self, t, y):
        return self.system.canonical(t, y)


def derivatives(signal: Signal, t: Array, order: int) -> Array:
    """(order + 1,) a signal and its derivatives at time t ()."""
    values, function = [jnp.asarray(signal(t))], signal
    for _ in range(order):

        def slope(t, before=function):
            return jax.jvp(before, (t,), (jnp.ones_like(t),))[1]

        values.append(slope(t))
        function = slope
    return jnp.stack(values)


@check_first
def drive(scene: Scene, input: str | Input, signal: Signal, t1=None) -> Scene:
    """A scene with an input that follows a signal, for `simulate` and other functions of scenes.

    Args:
      scene: the scene without the input.
      input: where it acts: the name of a coordinate for a force on it (in a plain `ode`, whose
        masses are not known, a force per mass), or `vibration.Force`, `Base`, `Motion` or
        `Parameter`.
      signal: how it changes in time: `vibration.Harmonic`, `Step`, `Pulse`, `Sweep`, `Imbalance`,
        `Table`.
      t1: () time span; that of the scene by default.
    Returns:
      The same scene with the input. `jax.grad` and `jax.vmap` apply to its parameters and to those
      of the signal.
    Raises:
      ValueError: the input does not suit the scene, a number of the signal is invalid, or the scene
        depends on the rate of a signal that jumps.
    Example:
      >>> import jaxdyn
      >>> from jaxdyn import scenes, vibration
      >>> rest = scenes.oscillator(k=4.0, x=0.0)
      >>> motion = jaxdyn.simulate(vibration.drive(rest, "x", vibration.Step(8.0)), jnp.pi / 2)
      >>> print(f"{motion['x'][-1]:.9f}")  # 2 (1 - cos 2 t)
      4.000000000
    """
    check_scene(scene)
    found, signal = check_input(scene, input), check_signal(signal)
    _check_jump(scene, found, signal)
    t1 = scene.t1 if t1 is None else _checks.array("t1", t1, ())
    system = Driven(scene.system, found, signal)
    return dataclasses.replace(scene, system=system, t1=t1)


def _check_jump(scene: Scene, found: Input, signal: Signal) -> None:
    """Raise ValueError if a scene depends on the rate of a signal that jumps, an impulse."""
    if not (signal.jumps and found.order):
        return

    def rate(u):
        return found.rate(scene.field, jnp.zeros(()), jnp.asarray(scene.y0), u)

    by_rates = jax.jacfwd(rate)(jnp.ones(found.order + 1))[:, 1:]
    if not _checks.is_traced(by_rates) and np.any(np.asarray(by_rates)):
        wanted = (
            f"one without a jump, since the scene of {type(found).__name__} depends on its rate"
        )
        remedy = "Use a vibration.Table with a short ramp."
        raise _checks.fail("signal", wanted, f"vibration.{type(signal).__name__}", remedy)


class Driving(NamedTuple):
    """What drives a scene: the unit of an input, "" if not known, and its signal."""

    unit: str
    signal: Signal


def driving(scene: Scene) -> dict[str, Driving]:
    """What drives a scene, by the names of its inputs, such as "force on x", in their order."""
    drives, system = [], scene.system
    while isinstance(system, Driven):
        drives.insert(0, system)
        system = system.system
    found: dict[str, Driving] = {}
    for one in drives:
        name, unit = one.input.named(scene)
        same = sum(other.partition(" (")[0] == name for other in found)
        found[f"{name} ({same + 1})" if same else name] = Driving(unit, one.signal)
    return found


@check_first
def strike(scene: Scene, input: str | Input, impulse) -> Scene:
    """A scene just after an impulse, so that its motion is the impulse response.

    Args:
      scene: the scene, with the initial state just before the impulse, e.g. an equilibrium.
      input: where the impulse acts; see `drive`.
      impulse: () the integral of the input over the short time in which it acts, e.g. [N s].
    Returns:
      The same scene with the state (k,) after the impulse.
    Raises:
      ValueError: the input does not suit the scene, or depends on the rate of the signal.
    Example:
      >>> from jaxdyn import scenes, vibration
      >>> print(vibration.strike(scenes.oscillator(m=2.0, x=0.0), "x", 1.0).y0)
      [0.  0.5]
    """
    check_scene(scene)
    found = check_input(scene, input)
    if found.order:
        remedy = "Use vibration.Pulse, with a duration."
        raise _checks.fail("input", "one that may jump", type(found).__name__, remedy)
    t, y = jnp.zeros(()), jnp.asarray(scene.y0)

    def rate(u):
        return found.rate(scene.field, t, y, u[None])

    jump = jax.jvp(rate, (jnp.zeros(()),), (jnp.ones(()),))[1]
    return scene.starting(y + _checks.array("impulse", impulse, ()) * jump)
