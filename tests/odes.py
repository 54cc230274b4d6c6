"""Differential equations that are no mechanism, as functions for `jaxdyn.ode`."""

import jax.numpy as jnp
import numpy as np


def van_der_pol(t, y, mu):
    """x'' = mu (1 - x^2) x' - x."""
    x, v = y
    return [v, mu * (1 - x * x) * v - x]


#: Period of its cycle for mu = 1, and where that passes v = 0.
VAN_DER_POL = 6.6632868593231301896996820305
VAN_DER_POL_X = 2.00861986087484313650940188


def stuart_landau(t, y, p):
    """r' = r (a - r^2), angle' = w + b r^2 in the plane; each entry after that decays, z' = c z.

    A cycle of radius sqrt(a) and period 2 pi / (w + a b), whose multipliers are exp(-2 a T) and
    exp(c T).
    """
    a, b, w, *decays = p
    r2 = y[0] ** 2 + y[1] ** 2
    grow, turn = a - r2, w + b * r2
    plane = [grow * y[0] - turn * y[1], grow * y[1] + turn * y[0]]
    return [*plane, *(c * z for c, z in zip(decays, y[2:], strict=True))]


def lorenz(t, y, p):
    """The equations of `scenes.lorenz`."""
    u, v, w = y
    return [p["sigma"] * (v - u), u * (p["rho"] - w) - v, u * v - p["beta"] * w]


def roessler(t, y, c):
    """Roessler (1976), Phys. Lett. A 57, 397, with a = b = 0.2."""
    return [-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - c)]


def pitchfork_of_cycles(t, y, mu):
    """r' = (mu - r^2) r beside z' = (r^2 - 0.2) z - z^3: cycles r^2 = mu with z^2 = mu - 0.2."""
    x, y_, z = y
    r = x * x + y_ * y_
    return [(mu - r) * x - y_, (mu - r) * y_ + x, (r - 0.2) * z - z**3]


def brusselator(t, y, p):
    """An equilibrium at (a, b / a); a cycle about it where b > 1 + a^2."""
    a, b = p
    u, v = y
    return [a + u * u * v - (b + 1) * u, b * u - u * u * v]


def populations(t, y, p):
    """Lotka and Volterra's prey and predators."""
    prey, predators = y
    a, b, c, d = p
    return [prey * (a - b * predators), predators * (d * prey - c)]


def populations_integral(t, y, p):
    """What they conserve."""
    prey, predators = y
    a, b, c, d = p
    return d * prey - c * jnp.log(prey) + b * predators - a * jnp.log(predators)


def restricted(t, y, mu):
    """The circular restricted three-body problem in its rotating frame, in the plane or in space.

    Masses 1 - mu at x = -mu and mu at x = 1 - mu.
    """
    r, v = jnp.split(y, 2)
    one, two = _from_both(r, mu)
    pull = (1 - mu) * one / jnp.sum(one * one) ** 1.5 + mu * two / jnp.sum(two * two) ** 1.5
    zero = jnp.zeros(len(r) - 2)
    turning = jnp.concatenate([jnp.stack([r[0] + 2 * v[1], r[1] - 2 * v[0]]), zero])
    return jnp.concatenate([v, turning - pull])


def jacobi(t, y, mu):
    """Jacobi's integral of the restricted problem."""
    r, v = jnp.split(y, 2)
    one, two = _from_both(r, mu)
    near = (1 - mu) / jnp.sqrt(jnp.sum(one * one)) + mu / jnp.sqrt(jnp.sum(two * two))
    return jnp.sum(r[:2] ** 2) + 2 * near - jnp.sum(v * v)


def restricted_lagrangian(t, r, v, mu):
    """The Lagrangian of the restricted problem in the plane."""
    one, two = _from_both(r, mu)
    near = (1 - mu) / jnp.sqrt(jnp.sum(one * one)) + mu / jnp.sqrt(jnp.sum(two * two))
    return 0.5 * ((v[0] - r[1]) ** 2 + (v[1] + r[0]) ** 2) + near


def _from_both(r, mu):
    x = jnp.eye(len(r))[0]
    return r + mu * x, r - (1 - mu) * x


#: A rotation of space in which no entry is simple.
ASKEW = np.linalg.qr(np.array([[1.0, 2.0, 3.0], [-1.0, 1.0, 0.5], [0.3, -2.0, 1.0]]))[0]


def askew(t, y, growth):
    """A circle in a plane, r' = r (1 - r^2), with z' = growth z across it, in rotated axes."""
    x, v, z = jnp.asarray(ASKEW.T) @ y
    s = 1 - x * x - v * v
    return jnp.asarray(ASKEW) @ jnp.stack([x * s - v, v * s + x, growth * z])


#: Modes of a flame front on a circle, and its length.
FLAME_MODES, FLAME_LENGTH = 15, 22.0
FLAME_ORDERS = np.arange(1.0, FLAME_MODES + 1)
#: (48, 30) u at 48 places from the real and imaginary parts: products of two are not aliased.
_PHASES = np.outer(2 * np.pi * np.arange(48) / 48, FLAME_ORDERS)
_WAVES = 2 * np.hstack([np.cos(_PHASES), -np.sin(_PHASES)])
_PROJECTION = _WAVES.T / (2 * 48)


def flame_phase(y, length):
    """The derivative of a_k exp(i k angle) by the angle."""
    del length
    real, imaginary = y[:FLAME_MODES], y[FLAME_MODES:]
    return jnp.concatenate([-FLAME_ORDERS * imaginary, FLAME_ORDERS * real])


def flame(t, y, length):
    """Kuramoto and Sivashinsky's u_t = -u u_x - u_xx - u_xxxx with mean 0, in Fourier modes.

    a_k' = (q_k^2 - q_k^4) a_k - i q_k / 2 times the k-th mode of u^2.
    """
    del t
    u, q = _WAVES @ y, 2 * jnp.pi / length
    square = jnp.tile((q * FLAME_ORDERS) ** 2, 2)
    return (square - square**2) * y - 0.5 * q * flame_phase(_PROJECTION @ (u * u), length)


#: Sine modes of a rod, and (23, 8) their values at places: products of three are not aliased.
ROD_MODES = 8
_ROD = np.sin(np.outer(np.pi * np.arange(1, 24) / 24, np.arange(1.0, ROD_MODES + 1)))


def heated(t, y, w):
    """A_t = A_xx + (3 + i w) A - |A|^2 A on a rod of length pi with A = 0 at its ends, in modes.

    Modes of even order stay zero where they begin so. A real A that is at rest for w = 0 turns.
    """
    real, imaginary = jnp.split(y, 2)
    a, b = _ROD @ real, _ROD @ imaginary
    grows, square = 3.0 - np.arange(1.0, ROD_MODES + 1) ** 2, a * a + b * b
    down = _ROD.T @ jnp.stack([square * a, square * b], 1) / 12
    return jnp.concatenate(
        [grows * real - w * imaginary - down[:, 0], grows * imaginary + w * real - down[:, 1]]
    )
