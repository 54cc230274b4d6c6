"""Conditions on an orbit besides closing: a given energy, period, entry of the start, and others.

Periodic orbits of conservative scenes form families, of which a condition selects a member.
Without one, `find` returns the member through the given start, if that is periodic, and otherwise a
member near it.
"""

import abc
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene
from jaxdyn._checks import array, as_float, choice, fail, positive
from jaxdyn._records import Record
from jaxdyn.analysis import energy as energies


class Condition(Record):
    """One smooth equation on an orbit."""

    @abc.abstractmethod
    def value(self, scene: Scene, y0: Float[Array, " k"], period: Array) -> Array:
        """() the error of the condition, zero where it holds."""

    def fix(
        self, guess: np.ndarray, lower: np.ndarray, upper: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Bounds (k + 1,) of start and period that keep the condition where the guess satisfies it.

        An entry that bounds hold does not move at all, not even by rounding.
        """
        del guess
        return lower, upper

    def check(self, scene: Scene) -> None:
        """Raise ValueError if the condition does not apply to the scene."""
        del scene


def _hold(entry: int, level, guess: np.ndarray, lower: np.ndarray, upper: np.ndarray):
    """Bounds that hold one entry of start and period, if the guess has the level."""
    if guess[entry] == float(level):
        here = np.arange(len(guess)) == entry % len(guess)
        lower, upper = (np.where(here, guess, bound) for bound in (lower, upper))
    return lower, upper


class Energy(Condition):
    """The condition that the energy has a given value [J]."""

    level: Array = eqx.field(converter=as_float)

    def value(self, scene, y0, period):
        del period
        return energies.energy(scene, jnp.zeros(()), y0) - self.level

    def check(self, scene):
        array("energy", self.level, (), "It is the energy of the orbit.")
        energies.energy(scene, jnp.zeros(()), scene.y0)  # raises for a scene without one


class Period(Condition):
    """The condition that the full period has a given value [time of the scene]."""

    length: Array = eqx.field(converter=as_float)

    def value(self, scene, y0, period):
        del scene, y0
        return period - self.length

    def fix(self, guess, lower, upper):
        return _hold(-1, self.length, guess, lower, upper)

    def check(self, scene):
        positive("period", array("period", self.length, (), "It is a time."), "It is a time.")


class Section(Condition):
    """The phase condition that the orbit starts where an entry of the state has a given value.

    All members of a family may pass there, with different values of the other entries; to select
    one member, hold these too, or the energy.
    """

    entry: int = eqx.field(static=True)
    level: Array = eqx.field(converter=as_float, default=0.0)

    def value(self, scene, y0, period):
        del scene, period
        return y0[self.entry] - self.level

    def fix(self, guess, lower, upper):
        return _hold(self.entry, self.level, guess, lower, upper)

    def check(self, scene):
        k = len(scene.y0)
        if not (isinstance(self.entry, int) and 0 <= self.entry < k):
            raise fail("entry", f"an entry of the state, 0 to {k - 1}", repr(self.entry))
        array("level", self.level, (), "It is the value of the entry.")


#: What `find` and others accept as `hold`: conditions, or names of entries of the start.
Hold = Condition | str | Sequence[Condition | str]


def conditions(scene: Scene, hold: Hold) -> tuple[Condition, ...]:
    """The conditions in `hold`; the name of an entry stands for its value at the scene's start.

    Raises:
      ValueError: an element is neither a `Condition` nor the name of an entry of the state, or
        does not apply to the scene.
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
        one.check_functions()
        one.check(scene)
        found.append(one)
    return tuple(found)
