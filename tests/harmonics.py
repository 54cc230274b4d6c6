"""Periodic vibrations by harmonic balance: a second route, without any integration in time.

x'' = force(t, x, x') with x a Fourier series of so many odd harmonics of omega; the force is
sampled over a period and expanded again. Newton's method on the coefficients.
"""

import jax
import jax.numpy as jnp
import numpy as np

_SAMPLES = 256
_STEPS = 60
_GOAL = 1e-12


class Balance:
    """The balance of (h, 2, n) coefficients of cosines and sines; `force` (phase, x, v) -> (n,)."""

    def __init__(self, force, n: int, harmonics: int):
        self.orders = jnp.asarray(2.0 * np.arange(harmonics) + 1.0)
        self.phases = jnp.asarray(np.arange(_SAMPLES) * (2 * np.pi / _SAMPLES))
        angles = self.orders[:, None] * self.phases[None]
        self.waves = jnp.stack([jnp.cos(angles), jnp.sin(angles)], axis=1)  # (h, 2, s)
        self.force, self.shape = force, (harmonics, 2, n)

    def motion(self, c, omega):
        """(s, n) places and velocities over a period."""
        c = c.reshape(self.shape)
        turned = jnp.stack([c[:, 1], -c[:, 0]], axis=1) * self.orders[:, None, None] * omega
        return (jnp.einsum("hps,hpn->sn", self.waves, x) for x in (c, turned))

    def residual(self, c, omega):
        x, v = self.motion(c, omega)
        force = jax.vmap(self.force)(self.phases, x, v)
        pushed = jnp.einsum("hps,sn->hpn", self.waves, force) * (2 / _SAMPLES)
        squares = (self.orders * omega)[:, None, None] ** 2
        return (squares * c.reshape(self.shape) + pushed).ravel()

    def start(self, first):
        """(h 2 n,) the coefficients with only these (2, n) of the first harmonic."""
        return np.zeros(self.shape) + np.eye(self.shape[0])[0][:, None, None] * np.asarray(first)

    def at(self, omega, guess):
        """(h 2 n,) the vibration with a frequency."""
        return newton(lambda c: self.residual(c, omega), np.ravel(guess))

    def fold(self, omega, guess):
        """The frequency of the fold near a guess, at which there are vibrations."""
        c = self.at(omega, guess)
        n = len(c)
        null = np.linalg.svd(np.asarray(jax.jacfwd(self.residual)(jnp.asarray(c), omega)))[2][-1]

        def whole(z):
            c, way, w = z[:n], z[n:-1], z[-1]
            value, change = jax.jvp(lambda c: self.residual(c, w), (c,), (way,))
            return jnp.concatenate([value, change, jnp.array([way @ null - 1.0])])

        return float(newton(whole, np.concatenate([c, null, [omega]]))[-1])


def newton(function, x):
    slope = jax.jit(jax.jacfwd(function))
    value = jax.jit(function)
    x = jnp.asarray(x, float)
    for _ in range(_STEPS):
        step = jnp.linalg.lstsq(slope(x), value(x))[0]
        x = x - step
        if float(jnp.abs(step).max()) < _GOAL * (1 + float(jnp.abs(x).max())):
            return np.asarray(x)
    raise AssertionError("harmonic balance does not converge")
