"""A system with further entries in its state: work, time, an angle that is swept.

Its state is [y, x]: y is the state of the system inside, x has entries that are integrated with it.
Whatever a scene asks of a system, the system inside answers at y; a subclass names the further
entries and defines the rate of the whole state.
"""

import abc

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.system import System


class Extended(System):
    """A system whose state [y, x] has further entries x after those of another system.

    Attributes:
      system: the system inside, with the state y.
    """

    system: System

    @abc.abstractmethod
    def further(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each of the further entries."""

    def time(self, t: Array, y: Array) -> Array:
        """() time [s] of the system inside."""
        del y
        return t

    def parts(self, y: Array) -> tuple[Array, Array]:
        """The state inside and the further entries."""
        k = len(self.system.labels())
        return y[:k], y[k:]

    def inside(self, t: Array, y: Array) -> tuple[Array, Array]:
        """Time and state of the system inside."""
        return self.time(t, y), self.parts(y)[0]

    def labels(self):
        return (*self.system.labels(), *self.further())

    def base_units(self):
        return self.system.base_units()

    def parameter_names(self):
        return self.system.parameter_names()

    @property
    def accepts(self):
        return self.system.accepts

    @property
    def singular(self):
        return self.system.singular

    @property
    def second_order(self):
        return False  # the state is not [q, v] any more

    def points(self, t, y):
        return self.system.points(*self.inside(t, y))

    def places(self, t, y):
        return self.system.places(*self.inside(t, y))

    def sketch(self, t, y):
        return self.system.sketch(*self.inside(t, y))

    def bodies(self, t, y):
        return self.system.bodies(*self.inside(t, y))

    def joints(self, t, y):
        return self.system.joints(*self.inside(t, y))

    def loads(self, t, y):
        return self.system.loads(*self.inside(t, y))

    def constraint_forces(self, t, y, effects):
        return self.system.constraint_forces(*self.inside(t, y), effects)

    def coordinates(self, y):
        return self.system.coordinates(self.parts(y)[0])

    def kinetic(self, t, y):
        return self.system.kinetic(*self.inside(t, y))

    def bounds(self, t, y, effects):
        return self.system.bounds(*self.inside(t, y), effects)

    def energies(self, t, y, effects):
        return self.system.energies(*self.inside(t, y), effects)

    def integrals(self, t, y):
        return self.system.integrals(*self.inside(t, y))

    def difference(self, y1, y0):
        # Further entries accumulate from the start, such as angles beyond a turn: they do not wrap.
        (a, x1), (b, x0) = self.parts(y1), self.parts(y0)
        return jnp.concatenate([self.system.difference(a, b), x1 - x0])

    def project(self, t, y):
        if type(self.system).project is System.project:
            return y
        return jnp.concatenate([self.system.project(*self.inside(t, y)), self.parts(y)[1]])

    def undetermined(self, t, y):
        return self.system.undetermined(*self.inside(t, y))

    def loses(self, t0, y0, t1, y1):
        return self.system.loses(*self.inside(t0, y0), *self.inside(t1, y1))

    def canonical(self, t, y):
        del t, y  # the further entries have no momenta
        return None

    def generators(self, y):
        inner, rest = self.parts(y)
        still = jnp.zeros_like(rest)
        moves = self.system.generators(inner)
        return {name: jnp.concatenate([move, still]) for name, move in moves.items()}

    def check(self, t, y):
        self.system.check(*self.inside(t, y))

    def check_effects(self, t, y, effects):
        self.system.check_effects(*self.inside(t, y), effects)


def innermost(system: System) -> System:
    """The system inside all extensions; itself without any."""
    while isinstance(system, Extended):
        system = system.system
    return system
