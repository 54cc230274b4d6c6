"""What an orbit must satisfy besides closing: a given energy, a given section, anything smooth.

Periodic orbits of conservative scenes come in families, and a condition picks one of a family.
Without it `find` takes the member through the given start, if that is periodic, else one near it.
"""

import abc
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn import Scene
from jaxdyn._checks import choice, fail, finite
from jaxdyn._floats import as_float
from jaxdyn.analysis import energy as energies


class Condition(eqx.Module):
    """One equation on an orbit; zero where it holds."""

    @abc.abstractmethod
    def value(self, scene: Scene, y0: Float[Array, " k"], period: Array) -> Array:
        """() by how much the condition fails."""

    def check(self, scene: Scene) -> None:
        """Raise ValueError if the condition makes no sense for the scene."""
        del scene


class Energy(Condition):
    """Kinetic plus potential energy is this [J]."""

    level: Array = eqx.field(converter=as_float)

    def value(self, scene, y0, period):
        del period
        return energies.energy(scene, jnp.zeros(()), y0) - self.level

    def check(self, scene):
        finite("energy", self.level, "It is the energy of the wanted orbit.")
        energies.energy(scene, jnp.zeros(()), scene.y0)  # refuses a scene without one


class Period(Condition):
    """The full period is this [time of the scene]."""

    length: Array = eqx.field(converter=as_float)

    def value(self, scene, y0, period):
        del scene, y0
        return period - self.length

    def check(self, scene):
        if not float(self.length) > 0:
            raise fail("period", "> 0", float(self.length), "It is a time.")


class Section(Condition):
    """The orbit starts where an entry of the state has this value: a phase condition.

    Where orbits come in families each of them may pass there, at other values of the other
    entries: hold these too, or the energy, for a definite member.
    """

    entry: int = eqx.field(static=True)
    level: Array = eqx.field(converter=as_float, default=0.0)

    def value(self, scene, y0, period):
        del scene, period
        return y0[self.entry] - self.level

    def check(self, scene):
        k = len(scene.y0)
        if not 0 <= self.entry < k:
            raise fail("entry", f"an entry of the state, 0 to {k - 1}", self.entry)


#: What `find` and the like accept: conditions, or names of entries of the start that stay.
Hold = Condition | str | Sequence[Condition | str]


def conditions(scene: Scene, hold: Hold) -> tuple[Condition, ...]:
    """The conditions that are meant; a name stands for that entry of the scene's start.

    Raises:
      ValueError: neither a condition nor the name of an entry, or one that does not fit the scene.
    """
    names = [label for label, _ in scene.system.labels()]
    given = tuple(hold) if isinstance(hold, list | tuple) else (hold,)
    found = []
    for one in given:
        if isinstance(one, str):
            entry = names.index(choice("hold", one, names))
            one = Section(entry, scene.y0[entry])
        if not isinstance(one, Condition):
            remedy = f"orbits.Energy(-1.0) is one, and so is the name of an entry: {names}."
            raise fail("hold", "a Condition", repr(one), remedy)
        one.check(scene)
        found.append(one)
    return tuple(found)
