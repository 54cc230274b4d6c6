"""A planar body on skates, and its equations of motion derived by hand: course problem 39."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import solve_spd
from jaxdyn.formulations.mechanism import Mechanism, MechanismSystem, planar_body
from jaxdyn.joints import along, body
from jaxdyn.sketch import frame, line, rectangle, traces

#: Condition number above which the skates count as having a common normal, a repeated condition.
_WORST_CONDITION = 1e6


class Skated(Mechanism):
    """A planar body on skates.

    Attributes:
      m: () mass [kg].
      inertia: () moment of inertia about the centre of mass [kg m^2].
      at: (s, 2) positions of the skates from the centre of mass, in body axes [m].
      headings: (s,) directions of their blades in body axes [rad].
    """

    m: Array
    inertia: Array
    at: Array
    headings: Array

    def coordinates(self):
        return (("x", "m"), ("y", "m"), ("theta", "rad"))

    def masses(self):
        return jnp.stack([self.m, self.m]) / 2

    def positions(self, t, q):
        del t
        return planar_body(q[:2], q[2], jnp.sqrt(self.inertia / self.m))

    def rolling(self, t, q):
        del t
        angle = q[2] + self.headings
        return jnp.stack([-jnp.sin(angle), jnp.cos(angle), self._arms()], axis=-1)

    def bodies(self, t, q):
        del t, q
        return body("body", self.masses())

    def joints(self, t, q):
        del t
        turn = frame(jnp.stack([jnp.cos(q[2]), jnp.sin(q[2])]))
        found = []
        for i, (at, heading) in enumerate(zip(self.at, self.headings, strict=True)):
            angle = q[2] + heading
            across = jnp.stack([-jnp.sin(angle), jnp.cos(angle)])
            name = f"skate {i + 1}" if len(self.at) > 1 else "skate"
            found.append(along(name, 0, None, q[:2] + turn @ at, across, i))
        return tuple(found)

    def sketch(self, t, q):
        place, turn = q[:2], frame(jnp.stack([jnp.cos(q[2]), jnp.sin(q[2])]))
        size = jnp.sqrt(self.inertia / self.m)
        # This marks the centre of mass; a circle would look like the mark of an end.
        shapes = [rectangle("area", (0.25 * size, 0.25 * size))]
        for at, heading in zip(self.at, self.headings, strict=True):
            blade = rectangle("solid", (0.6 * size, 0.08 * size))
            blade_axes = frame(jnp.stack([jnp.cos(heading), jnp.sin(heading)]))
            shapes += [line(jnp.zeros(2), at), blade.place(at, blade_axes)]
        shapes += traces(self.at, [f"skate {i + 1}" for i in range(len(self.at))])
        return tuple(shape.place(place, turn) for shape in shapes)

    def twists(self) -> Array:
        """(s, 3) the conditions in body axes: rows whose product with (vx, vy, omega) is zero."""
        return self.rolling(jnp.zeros(()), jnp.zeros(3))

    def check(self):
        _checks.positive("mass", self.m, "Masses are in kg.")
        _checks.positive("inertia", self.inertia, "Inertias are in kg m^2.")
        scale = np.array([1.0, 1.0, np.sqrt(self.m / self.inertia)])
        condition = np.linalg.cond(np.asarray(_twists(self)) * scale)
        if not condition < _WORST_CONDITION:
            raise _checks.fail(
                "skates",
                "conditions that differ",
                f"skates on a common normal line (condition number {condition:.3g})",
                "They state the same condition twice, and their two forces are not unique: "
                "move or turn one, or leave it out.",
            )

    def _arms(self) -> Array:
        x, y = self.at[:, 0], self.at[:, 1]
        return x * jnp.cos(self.headings) + y * jnp.sin(self.headings)


@jax.jit  # one program, not one for each operation
def _twists(body: Skated) -> Array:
    return body.twists()


class LagrangeSkates(MechanismSystem):
    """Lagrange's equations of a body on skates, with multipliers, derived by hand: state [q, v].

    L = m (x'^2 + y'^2) / 2 + I theta'^2 / 2 does not depend on q, so m x'' = Q_x, m y'' = Q_y,
    I theta'' = Q_theta. A skate's force lambda across its blade does the virtual work
    lambda (-sin a dx + cos a dy + arm dtheta), a = theta + heading, which gives the Q. Its
    condition -sin a x' + cos a y' + arm theta' = 0, differentiated once, closes the system:

        -sin a x'' + cos a y'' + arm theta'' = theta' (cos a x' + sin a y').
    """

    mechanism: Skated

    @property
    def accepts(self):
        return frozenset()  # the equations of problem 39 contain no other forces

    def rate(self, t, y, effects):
        del effects
        body = self.mechanism
        _, v = jnp.split(y, 2)
        b = body.rolling(t, y[:3])
        # cos a = b[:, 1] and sin a = -b[:, 0].
        needed = v[2] * (b[:, 1] * v[0] - b[:, 0] * v[1])
        reach = b / jnp.stack([body.m, body.m, body.inertia])[None, :]
        multipliers = solve_spd(jnp.sum(b[:, None, :] * reach[None, :, :], axis=-1), needed)
        return jnp.concatenate([v, jnp.sum(multipliers[:, None] * reach, axis=0)])
