"""Point masses joined by massless rigid rods, in any dimension, with one tie for each rod."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import square_norm
from jaxdyn.formulations.mechanism import Mechanism, stretch
from jaxdyn.joints import particles, rod
from jaxdyn.sketch import line, lines

_AXES = "xyz"


class Rods(Mechanism):
    """Points in cartesian coordinates, with the lengths of the rods as ties.

    A multiplier is the force along its rod, positive where the rod pushes [N].

    Attributes:
      m: (n,) masses [kg].
      length: (c,) lengths of the rods [m].
      pairs: which points each rod joins.
      d: dimension of space.
      squared: whether the ties are on squared lengths; see `mechanism.stretch`.
    """

    m: Array
    length: Array
    pairs: tuple[tuple[int, int], ...] = eqx.field(static=True)
    d: int = eqx.field(static=True, default=2)
    squared: bool = eqx.field(static=True, default=False)

    def coordinates(self):
        points = range(1, self.m.shape[0] + 1)
        return tuple((f"{axis}{i}", "m") for i in points for axis in _AXES[: self.d])

    def masses(self):
        return self.m

    def positions(self, t, q):
        del t
        return q.reshape(-1, self.d)

    def constraints(self, t, q):
        i, j = np.array(self.pairs).T
        r = self.positions(t, q)
        return stretch(square_norm(r[j] - r[i]), self.length, self.squared)

    def rods(self):
        return tuple(f"rod {i + 1}-{j + 1}" for i, j in self.pairs)

    def bodies(self, t, q):
        del t, q
        return particles(self.m)

    def joints(self, t, q):
        r = self.positions(t, q)
        return tuple(
            rod(name, j, i, (r[i], r[j]), multiplier)
            for multiplier, (name, (i, j)) in enumerate(zip(self.rods(), self.pairs, strict=True))
        )

    def sketch(self, t, q):
        return (lines(self.positions(t, q), self.pairs),)

    def check(self):
        _checks.positive("length", self.length, "Lengths are in m.")


class TwoOnARod(Mechanism):
    """Two points on a rod, in any coordinates.

    Attributes:
      m: (2,) masses [kg].
      length: (1,) length of the rod [m].
    """

    m: Array
    length: Array

    def masses(self):
        return self.m

    def bodies(self, t, q):
        del t, q
        return particles(self.m)

    def joints(self, t, q):
        r = self.positions(t, q)
        return (rod("rod", 1, 0, (r[0], r[1])),)

    def sketch(self, t, q):
        return (line(*self.positions(t, q)),)

    def check(self):
        _checks.positive("length", self.length, "Lengths are in m.")


class Dumbbell(TwoOnARod):
    """Two points on a rod in the plane, described by x and y of the centre and the rod's angle."""

    def coordinates(self):
        return (("x", "m"), ("y", "m"), ("theta", "rad"))

    def positions(self, t, q):
        return self.place(t, q).reshape(2, 2)

    def place(self, t: Array, q: Array) -> Array:
        """(4,) x and y of both points: the coordinates of `Rods`."""
        del t
        along = self.length * jnp.stack([jnp.cos(q[2]), jnp.sin(q[2])])
        first = q[:2] - self.m[1] / jnp.sum(self.m) * along
        return jnp.concatenate([first, first + along])


class Coupled(TwoOnARod):
    """Two points on a rod along a line, described by the position of the first."""

    def coordinates(self):
        return (("x1", "m"),)

    def positions(self, t, q):
        return self.place(t, q)[:, None]

    def place(self, t: Array, q: Array) -> Array:
        """(2,) the positions of both points: the coordinates of `Rods`."""
        del t
        return jnp.stack([q[0], q[0] + self.length])
