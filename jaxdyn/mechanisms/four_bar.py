"""The four-bar linkage in its crank angle; `bars` has it as a chain and as bodies."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._numerics import square_norm
from jaxdyn.formulations.mechanism import Embedding, Mechanism
from jaxdyn.joints import pinned
from jaxdyn.mechanisms.bars import (
    Chain,
    bar_parts,
    bar_shapes,
    check_bars,
    hinges,
    row_masses,
    row_points,
)

#: Squared height of a triangle, over the square of its base, below which it counts as flat.
IN_LINE = 1e-14


class FourBar(Mechanism):
    """Crank, coupler and rocker between hinges at the origin and at `end`, in the crank angle.

    Coupler and rocker close the triangle on the line from the crank pin to the far hinge. The
    triangle can lie on either side of that line; a motion stays on its side. Where it cannot close
    (for a crank that does not turn fully) the positions are NaN.

    Attributes:
      m: (3,) masses of the crank, of the coupler and of the rocker [kg].
      l: (3,) lengths of the crank, of the coupler and of the rocker [m].
      end: (2,) far hinge [m].
      crossed: whether the coupler lies to the right of the line from the crank pin to the far
        hinge; otherwise it lies to the left.
    """

    m: Array
    l: Array  # noqa: E741 the course's name
    end: Array
    crossed: bool = eqx.field(static=True, default=False)
    singular: ClassVar[str] = (
        "Where coupler and rocker are in line, the crank does not determine how they continue. "
        "formulation='constrained' or 'loop' passes a dead centre of the crank; at a change point, "
        "where all bars are in line, the linkage may continue in two ways."
    )

    def coordinates(self):
        return (("theta1", "rad"),)

    def masses(self):
        return row_masses(self.m)

    def positions(self, t, q):
        del t
        return row_points(self._bars(q))

    def angles(self, t: Array, q: Array) -> Array:
        """(3,) angles of the bars from hanging down: the coordinates of a `Chain`."""
        del t
        x, y = self._bars(q).T
        return jnp.arctan2(x, -y)

    def free_bars(self, t: Array, q: Array) -> Array:
        """(9,) x, y and angle of each bar: the coordinates of `FreeBars`."""
        middles = self.positions(t, q)[4:]
        return jnp.concatenate([middles, self.angles(t, q)[:, None]], axis=1).ravel()

    def opened_form(self) -> Embedding:
        return Embedding(Chain(self.m, self.l, self.end), self.angles)

    def bodies(self, t, q):
        return bar_parts(self.m, self.positions(t, q)[:4])

    def joints(self, t, q):
        joints = self.positions(t, q)[:4]
        return *hinges(joints[:3]), pinned("hinge 4", 2, None, joints[3])

    def sketch(self, t, q):
        return bar_shapes(self.positions(t, q)[:4], self.end)

    def check(self):
        check_bars(self.m, self.l, self.end)

    def reach(self, angle: Array) -> Array:
        """() squared deviation of coupler and rocker from one line at an angle of the crank [1].

        It is negative where they do not reach the far hinge.
        """
        return self._triangle(self.end - self._crank(angle))[1]

    def loses(self, t0, q0, t1, q1):
        """Whether a step takes the crank past a change point, where the triangle may change sides.

        The distance from the crank pin to the far hinge is largest and smallest with the crank
        along the ground; if the triangle is flat there, it can open to either side.
        """
        del t0, t1
        ahead = jnp.arctan2(self.end[0], -self.end[1])
        along = ahead + jnp.array([0.0, jnp.pi])
        turns0, turns1 = (jnp.floor((q - along) / (2 * jnp.pi)) for q in (q0, q1))
        return jnp.any((turns0 != turns1) & (jax.vmap(self.reach)(along) <= IN_LINE))

    def _crank(self, angle: Array) -> Array:
        return self.l[0] * jnp.stack([jnp.sin(angle), -jnp.cos(angle)])

    def _bars(self, q: Array) -> Array:
        """(3, 2) the bars as vectors."""
        crank = self._crank(q[0])
        line = self.end - crank
        along, squared = self._triangle(line)
        side = -1.0 if self.crossed else 1.0
        coupler = along * line + side * jnp.sqrt(squared) * jnp.stack([-line[1], line[0]])
        return jnp.stack([crank, coupler, line - coupler])

    def _triangle(self, line: Array) -> tuple[Array, Array]:
        """End of the coupler along the line from the crank pin, and its squared height above it.

        They are fractions of the line's length and of its square, by the law of cosines.
        """
        r2 = square_norm(line)
        along = 0.5 * (1 + (self.l[1] ** 2 - self.l[2] ** 2) / r2)
        return along, self.l[1] ** 2 / r2 - along * along
