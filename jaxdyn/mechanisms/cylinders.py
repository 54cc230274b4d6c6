"""A cylinder that rolls, slips or flies, on a fixed cylinder or on a ramp: problems 37 and 38.

A cylinder of radius r has its centre of mass G at a distance d from its centre C. In contact
with a surface, C stays at the distance r from it. With n the normal and t the tangent of the
surface (in the direction of clockwise rolling), N the normal force and F the friction along t,

    m a_G = W + N n + F t,    I alpha = moment of both about G,

with accelerations that satisfy the conditions of `_Contact`. In rolling these determine F and N; in
slipping they determine N, and F = -mu N sign(slip). All phases have the same state
[x, y, phi, velocities] of G; `jaxdyn.scenes.phases_of` joins them.
"""

import dataclasses
import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.joints import along, body
from jaxdyn.scene import Points, System
from jaxdyn.sketch import Shape, circle, line, traces
from jaxdyn.system import total_force

#: Kinds of contact; a slip is named by the direction of the contact point along t.
CONTACTS = ("roll", "slip_on", "slip_back", "fly")
#: The sign of the slip in each kind of contact that slips.
SLIPS = {"slip_on": 1.0, "slip_back": -1.0}


_MAX_OVERLAP = 1e-9  # largest overlap at a start that is not refused, over the lengths involved


class _Contact(NamedTuple):
    """The conditions of contact on the velocities v (3,) and the accelerations a (3,).

    rows (2, 3): rows @ v = (speed of C away from the surface, slip of the contact point). Contact
      keeps the first at 0 and rolling keeps both at 0, hence rows @ a = bends (2,).
    """

    rows: Array
    bends: Array


class Cylinder(System):
    """A cylinder of radius r near a fixed convex surface: state [x, y, phi, vx, vy, omega] of G.

    phi is measured clockwise from the upward vertical to the arm from C to G.

    Attributes:
      m: () mass [kg].
      inertia: () moment of inertia about G [kg m^2].
      r: () radius [m].
      d: () distance of G from C [m].
      fixed: () radius of the fixed cylinder about the origin [m]; unused on a ramp.
      slope: () angle of a ramp through the origin, falling towards +x [rad]; unused elsewhere.
      mu: () coefficient of friction [1]; used by slips and impacts.
      contact: one of `CONTACTS`.
      flat: whether it is on a ramp.
    """

    m: Array
    inertia: Array
    r: Array
    d: Array
    fixed: Array
    slope: Array
    mu: Array
    contact: str = eqx.field(static=True)
    flat: bool = eqx.field(static=True)

    @property
    def accepts(self):
        return frozenset({"force"})

    def labels(self):
        q = (("x", "m"), ("y", "m"), ("phi", "rad"))
        return (*q, *((f"{name}_dot", f"{unit}/s") for name, unit in q))

    def points(self, t, y):
        del t
        arm = jnp.sqrt(self.inertia / self.m)
        e, turned = _axes(y[2])
        r = jnp.stack([y[:2] + arm * e, y[:2] - arm * e])
        swing = arm * y[5] * turned
        return Points(
            r, jnp.stack([y[3:5] + swing, y[3:5] - swing]), jnp.stack([self.m, self.m]) / 2
        )

    def sketch(self, t, y):
        """The rim, a line from the centre through G to a mark on the rim, and the surface."""
        del t
        c = y[:2] - self.d * _axes(y[2])[0]
        mark = c + self.r * _axes(y[2])[0]
        rim = Shape("area", circle(c, self.r))
        paths = traces(jnp.stack([y[:2], mark]), ["centre of mass", "mark on the rim"])
        if not self.flat:
            return Shape("ground", circle(0 * c, self.fixed)), rim, line(c, mark), *paths
        n = self._normal(c)
        foot = c - jnp.sum(c * n) * n
        along = 2 * self.r * jnp.stack([n[1], -n[0]])
        ramp = Shape("ground", jnp.stack([foot - along, foot + along]))
        return ramp, rim, line(c, mark), *paths

    def bodies(self, t, y):
        c = y[:2] - self.d * _axes(y[2])[0]
        outline = Shape("area", circle(c, self.r)), line(c, c + self.r * _axes(y[2])[0])
        return body("cylinder", self.points(t, y).m, outline)

    def joints(self, t, y):
        del t
        if self.contact == "fly":
            return ()
        c = y[:2] - self.d * _axes(y[2])[0]
        n = self._normal(c)
        foot, tangent = c - self.r * n, jnp.stack([n[1], -n[0]])
        return (
            along("normal force", 0, None, foot, n, 0),
            along("friction", 0, None, foot, tangent, 1),
        )

    def constraint_forces(self, t, y, effects):
        return self.reaction(t, y, effects)

    def rate(self, t, y, effects):
        force = self._load(t, y, effects)
        push = self._velocity_change(self._conditions(y).rows, self._reaction(y, force))
        return jnp.concatenate([y[3:], force / self._weights() + push])

    def reaction(self, t: Array, y: Array, effects=()) -> Array:
        """(2,) normal force and friction along t [N]."""
        return self._reaction(y, self._load(t, y, effects))

    def bounds(self, t, y, effects):
        if self.contact == "fly":
            return {"the landing on its surface": self.height(y)}
        return {"the lift-off from its surface": self.reaction(t, y, effects)[0]}

    def height(self, y: Array) -> Array:
        """() distance of the cylinder from the surface [m]."""
        c = y[:2] - self.d * _axes(y[2])[0]
        if self.flat:
            return jnp.sum(c * self._normal(c)) - self.r
        return jnp.sqrt(jnp.sum(c * c)) - self.r - self.fixed

    def slip(self, y: Array) -> Array:
        """() velocity of the contact point along t [m/s]; 0 for rolling."""
        return _dot(self._conditions(y).rows, y[3:])[1]

    def project(self, t, y):
        del t
        if self.contact == "fly":
            return y
        y = self._place(y)
        rows, _ = self._conditions(y)
        a, off = self._gram(rows), _dot(rows, y[3:])
        stop = -_both(a, off) if self.contact == "roll" else -off * np.eye(2)[0] / a[0, 0]
        return jnp.concatenate([y[:3], y[3:] + self._velocity_change(rows, stop)])

    def after_landing(self, y: Array) -> Array:
        """(6,) the state after an inelastic impact with Coulomb friction."""
        y = self._place(y)
        rows, _ = self._conditions(y)
        a, v = self._gram(rows), _dot(rows, y[3:])
        rolling = -_both(a, v)
        slip_sign = jnp.sign(v[1])
        slipping = -v[0] / (a[0, 0] - slip_sign * self.mu * a[0, 1])
        sticks = jnp.abs(rolling[1]) <= self.mu * rolling[0]
        impulse = jnp.where(
            sticks, rolling, slipping * jnp.stack([1.0 + 0 * slip_sign, -slip_sign * self.mu])
        )
        return jnp.concatenate([y[:3], y[3:] + self._velocity_change(rows, impulse)])

    def with_contact(self, contact: str) -> "Cylinder":
        """The same cylinder with another contact."""
        return dataclasses.replace(self, contact=contact)

    def check(self, t, y):
        _checks.positive("mass", self.m, "Masses are in kg.")
        _checks.positive("inertia", self.inertia, "Inertias are in kg m^2.")
        _checks.positive("r", self.r, "Radii are in m.")
        _checks.positive("fixed", self.fixed, "Radii are in m.")
        # They are Python floats, since each operation of JAX would be compiled by itself.
        d, r, slope, mu = map(float, (self.d, self.r, self.slope, self.mu))
        if not 0 <= d < r:
            raise _checks.fail("d", "from 0 to below the radius", d)
        if not abs(slope) < math.pi / 2:
            raise _checks.fail("slope", "below 90 degrees", slope, "It is in rad.")
        if not mu >= 0:
            raise _checks.fail("mu", ">= 0", mu)
        gap = float(_height(self, y))
        if gap < -_MAX_OVERLAP * max(r, float(np.max(np.abs(y[:2])))):
            surface = "the ramp" if self.flat else "the fixed cylinder"
            raise _checks.fail("y0", f"a cylinder outside {surface}", f"one {-gap:.6g} m inside")
        del t

    def _place(self, y: Array) -> Array:
        """(6,) the same state with the cylinder placed on the surface."""
        n = self._normal(y[:2] - self.d * _axes(y[2])[0])
        return jnp.concatenate([y[:2] - self.height(y) * n, y[2:]])

    def _weights(self) -> Array:
        return jnp.stack([self.m, self.m, self.inertia])

    def _normal(self, c: Array) -> Array:
        if self.flat:
            return jnp.stack([jnp.sin(self.slope), jnp.cos(self.slope)])
        return c / jnp.sqrt(jnp.sum(c * c))

    def _conditions(self, y: Array) -> _Contact:
        e, turned = _axes(y[2])
        c = y[:2] - self.d * e
        n = self._normal(c)
        t = jnp.stack([n[1], -n[0]])
        across, along = jnp.sum(turned * n), jnp.sum(turned * t)
        rows = jnp.stack(
            [
                jnp.concatenate([n, -self.d * across[None]]),
                jnp.concatenate([t, -(self.d * along + self.r)[None]]),
            ]
        )
        inward = -self.d * y[5] ** 2
        bends = jnp.stack([inward * jnp.sum(e * n), inward * jnp.sum(e * t)])
        if not self.flat:
            v_c = y[3:5] - self.d * y[5] * turned
            fall = jnp.sum(v_c * t) ** 2 / jnp.sqrt(jnp.sum(c * c))
            bends = bends - jnp.stack([fall, 0 * fall])
        return _Contact(rows, bends)

    def _load(self, t, y, effects) -> Array:
        """(3,) the force of the effects and their clockwise moment about G."""
        r, v, m = self.points(t, y)
        f = total_force(effects, t, r, v, m)
        lever = r - y[None, :2]
        moment = jnp.sum(lever[:, 1] * f[:, 0] - lever[:, 0] * f[:, 1])
        return jnp.concatenate([jnp.sum(f, axis=0), moment[None]])

    def _gram(self, rows: Array) -> Array:
        """(2, 2) the velocities in the two conditions that unit impulses along them cause."""
        return jnp.sum(rows[:, None, :] * (rows / self._weights()[None, :])[None, :, :], axis=-1)

    def _velocity_change(self, rows: Array, impulse: Array) -> Array:
        """(3,) the change of the velocities by impulses along n and t."""
        return jnp.sum(impulse[:, None] * rows, axis=0) / self._weights()

    def _reaction(self, y: Array, load: Array) -> Array:
        if self.contact == "fly":
            return jnp.zeros(2)
        rows, bends = self._conditions(y)
        a, needed = self._gram(rows), bends - _dot(rows, load / self._weights())
        if self.contact == "roll":
            return _both(a, needed)
        ratio = -SLIPS[self.contact] * self.mu
        normal = needed[0] / (a[0, 0] + ratio * a[0, 1])
        return jnp.stack([normal, ratio * normal])


@jax.jit
def _height(cylinder: Cylinder, y: Array) -> Array:
    return cylinder.height(y)


def _dot(rows: Array, v: Array) -> Array:
    return jnp.sum(rows * v[None, :], axis=-1)


def _both(a: Array, b: Array) -> Array:
    """(2,) the solution x of a x = b for a symmetric a (2, 2)."""
    det = a[0, 0] * a[1, 1] - a[0, 1] ** 2
    return jnp.stack([a[1, 1] * b[0] - a[0, 1] * b[1], a[0, 0] * b[1] - a[0, 1] * b[0]]) / det


def _axes(phi: Array) -> tuple[Array, Array]:
    """(2,) the arm's direction, clockwise from the vertical, and its derivative in phi."""
    return jnp.stack([jnp.sin(phi), jnp.cos(phi)]), jnp.stack([jnp.cos(phi), -jnp.sin(phi)])
