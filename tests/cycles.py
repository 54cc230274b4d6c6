"""Systems whose limit cycles, their bifurcations and branches are known in closed form."""

import abc

import jax
import jax.numpy as jnp

from jaxdyn import Scene, System


class Plane(System):
    """Entries named x0, x1, ..., without material points."""

    a: jax.Array

    @property
    def size(self) -> int:
        return 2

    def labels(self):
        return tuple((f"x{i}", "1") for i in range(self.size))


def _turning(y, grow):
    """dr/dt = r grow, dphi/dt = 1 in the first two entries."""
    return jnp.stack([grow * y[0] - y[1], grow * y[1] + y[0]])


class Bautin(Plane):
    """dr/dt = r (a + r^2 - r^4): cycles at r^2 = (1 +- sqrt(1 + 4 a)) / 2, a fold at a = -1/4."""

    def rate(self, t, y, effects):
        r2 = jnp.sum(y * y)
        return _turning(y, self.a + r2 - r2 * r2)


class Pitchfork(Plane):
    """r = 1 and dz/dt = a z - z^3: a branch point at a = 0, branches z = +-sqrt(a)."""

    @property
    def size(self):
        return 3

    def rate(self, t, y, effects):
        plane = _turning(y[:2], 1 - jnp.sum(y[:2] ** 2))
        return jnp.append(plane, self.a * y[2] - y[2] ** 3)


class Moebius(Plane):
    """r = 1 with a band about it that is twisted by half a turn: a period doubling at a = 0.

    u + i w = exp(i phi / 2) (p + i q), dp/dt = a p - p^3, dq/dt = -q; branch p = sqrt(a).
    """

    @property
    def size(self):
        return 4

    def rate(self, t, y, effects):
        plane = _turning(y[:2], 1 - jnp.sum(y[:2] ** 2))
        r = jnp.sqrt(jnp.sum(y[:2] ** 2))
        c, s, (u, w) = y[0] / r, y[1] / r, y[2:]
        # Products of cos and sin of half the angle, which are smooth: p times them, q times them.
        pc, ps = 0.5 * (u * (1 + c) + w * s), 0.5 * (u * s + w * (1 - c))
        p2 = 0.5 * (u * u * (1 + c) + w * w * (1 - c)) + u * w * s
        grow = self.a - p2
        du = -0.5 * w + grow * pc - (u - pc)
        dw = 0.5 * u + grow * ps - (w - ps)
        return jnp.concatenate([plane, jnp.stack([du, dw])])


class Beside(Plane):
    """r = 1, and two entries beside that cycle whose rate does not depend on it."""

    @property
    def size(self):
        return 4

    def rate(self, t, y, effects):
        plane = _turning(y[:2], 1 - jnp.sum(y[:2] ** 2))
        return jnp.concatenate([plane, self.beside(y[2:])])

    @abc.abstractmethod
    def beside(self, z):
        """(2,) rate of the two entries."""


class Torus(Beside):
    """Two entries turning at 0.3 and growing at a - z^2: a torus is born at a = 0."""

    def beside(self, z):
        return (self.a - jnp.sum(z * z)) * z + 0.3 * jnp.stack([-z[1], z[0]])


class Spiral(Beside):
    """Multipliers exp(2 pi (0.5 +- sqrt(a))), which meet off the unit circle at a = 0."""

    def beside(self, z):
        return 0.5 * z + jnp.stack([z[1], self.a * z[0]])


def cycle(kind, a, y0):
    """A scene of one of these systems, of period 2 pi."""
    return Scene(kind(jnp.asarray(a, float)), y0=y0, t1=2 * jnp.pi)
