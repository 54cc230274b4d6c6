"""Scenes that vibrate, with what is known of them."""

import jax.numpy as jnp

import jaxdyn
from jaxdyn import scenes

#: Stiffness, mass and damping of one mass.
K, M, C = 9.0, 2.0, 0.6


def one(k=K, m=M, c=C):
    return scenes.oscillator(k=k, m=m, c=c, x=0.0)


def quarter_car(road, rate):
    """A body on a damped spring on a wheel, whose tyre has some damping too."""

    def moved(t, y, p):
        x1, x2, v1, v2 = y
        u, du = p
        f = 20 * (x1 - x2) + 2 * (v1 - v2)
        return [v1, v2, -f, (f - 200 * (x2 - u) - 0.5 * (v2 - du)) / 0.1]

    names = ["x1", "x2", "v1", "v2"]
    return jaxdyn.ode(moved, jnp.zeros(4), 20.0, params=(road, rate), names=names)
