"""The edge of the 1:1 tongue of van der Pol's oscillator, forced, against its averaged equations.

x'' = mu (1 - x^2) x' - x + F cos(w t) with s = (1 - w^2) / (w mu) and g = F / (2 w mu). To first
order in mu the orbits of the drive's period are equilibria of z' = z (1 - |z|^2) - i s z + i g:
their folds meet in a cusp at s = 1 / sqrt(3), g = sqrt(8 / 27), and a curve of Hopf points, torus
points of the orbits, ends on the folds in a Bogdanov-Takens point at s = g = 1 / 2: Guckenheimer
and Holmes (1983), Nonlinear Oscillations, section 2.1.
"""

import math

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from orbits import PLAIN, Kind, Orbit, Outcome


def tongue(mu):
    """(s, g) -> the forced oscillator."""

    def rate(t, y, c):
        s, g = c
        w = 0.5 * (jnp.sqrt((s * mu) ** 2 + 4) - s * mu)
        force = 2 * w * mu * g * jnp.cos(w * t)
        return [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0] + force]

    def make(s, g):
        w = 0.5 * (jnp.sqrt((s * mu) ** 2 + 4) - s * mu)
        return jaxdyn.ode(rate, [0.0, 0.0], 2 * jnp.pi / w, params=jnp.stack([s, g]))

    return make


def averaged(make, square, s):
    """The orbit near which the averaged equations have an equilibrium with |z|^2, and (s, g)."""
    g = math.sqrt(square * ((1 - square) ** 2 + s * s))
    z = g / (s - 1j * (1 - square))
    scene = make(jnp.asarray(s), jnp.asarray(g))
    start = [2 * z.real, -4 * math.pi / float(scene.t1) * z.imag]
    return Orbit(scene.starting(jnp.asarray(start)), PLAIN, 0.0, Outcome.FOUND, 0, 1e-13), (s, g)


def errors(mu):
    """How far the cusp and the end of the torus points are from those of the averaged equations."""
    make = tongue(mu)
    fold, both = averaged(make, 0.75, math.sqrt(0.3125))
    folds = orbits.continue_curve(make, fold, both, kind=Kind.FOLD, step=0.2, members=12)
    # Another one is on the other side of resonance.
    cusp = max((x for x in folds.special if x.kind == "cusp"), key=lambda x: x.parameters[0])
    ring, both = averaged(make, 0.5, 0.6)
    torus = orbits.continue_curve(make, ring, both, kind=Kind.TORUS, step=0.2, down=True)
    end = torus.special[-1]
    assert end.kind == "1:1 resonance"
    assert max(cusp.residual, end.residual) < 1e-9
    return np.array(
        [
            *(cusp.parameters - [1 / math.sqrt(3), math.sqrt(8 / 27)]),
            *(end.parameters - [0.5, 0.5]),
        ]
    )


@pytest.mark.long
def test_the_edge_of_the_tongue_is_that_of_the_averaged_equations():
    coarse, fine = errors(0.2), errors(0.1)
    # These leave out terms of order mu.
    assert np.abs(fine).max() < 0.02
    assert np.abs(2 * fine - coarse).max() < 0.003
