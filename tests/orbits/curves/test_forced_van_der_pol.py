"""Edges of tongues of van der Pol's oscillator, forced, against averaged equations.

1:1, at small mu: x'' = mu (1 - x^2) x' - x + F cos(w t) with s = (1 - w^2) / (w mu) and
g = F / (2 w mu). To first order in mu the orbits of the drive's period are equilibria of
z' = z (1 - |z|^2) - i s z + i g: their folds meet in a cusp at s = 1 / sqrt(3), g = sqrt(8 / 27),
and a curve of Hopf points, torus points of the orbits, ends on the folds in a Bogdanov-Takens point
at s = g = 1 / 2: Guckenheimer and Holmes (1983), Nonlinear Oscillations, section 2.1.

1:3, at mu = 1 and small forces: a phase th of the free cycle, in units of time, changes by
1 + F Z(th) cos(w t), where Z is the part of the adjoint solution along the velocity. Averaged near
w = 3 w0 that locks for |w / (3 w0) - 1| < F |c|, with the third Fourier coefficient c of Z:
Kuramoto (1984), Chemical Oscillations, Waves, and Turbulence, section 3. An even one would be 0.
"""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

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


def adjoint(t, z):
    """The free oscillator at mu = 1, and its linearised equations, transposed and reversed."""
    x, v, a, b = z
    return [v, (1 - x * x) * v - x, b * (2 * x * v + 1), -a - b * (1 - x * x)]


def free_motion(z, span, ts=None):
    return solve_ivp(adjoint, span, z, "DOP853", ts, rtol=1e-12, atol=1e-13)


def third_harmonic(period, start):
    """c of the phase response, from another integrator."""
    pair = np.array([0.0, 1.0])
    for _ in range(4):  # backwards all solutions tend to the periodic one
        pair = free_motion([*start, *pair], (0, -period)).y[2:, -1]
    pair /= pair @ adjoint(0, [*start, 0, 0])[:2]
    times = np.arange(64) * period / 64
    back = free_motion([*start, *pair], (period, 0), times[::-1])
    return np.mean(back.y[3] * np.exp(6j * np.pi / period * back.t))


@pytest.mark.slow
def test_the_edges_of_the_third_tongue_are_those_of_the_phase_response():
    def rate(t, y, c):
        return [y[1], (1 - y[0] ** 2) * y[1] - y[0] + c[1] * jnp.cos(c[0] * t)]

    def make(w, force):
        return jaxdyn.ode(rate, [0.0, 0.0], 6 * jnp.pi / w, params=jnp.stack([w, force]))

    free = orbits.find(make(jnp.asarray(3.0), jnp.asarray(0.0)).starting([2.0, 0.0]), period=6.66)
    start, rates, force = np.asarray(free.y0), 6 * math.pi / free.period, 0.05
    c = third_harmonic(free.period, start)
    edges = []
    for sign in (1, -1):
        w = rates * (1 + sign * force * abs(c))
        phase = (math.pi * (sign < 0) + np.angle(c)) / rates % free.period
        y = free_motion([*start, 0.0, 0.0], (0, phase)).y[:2, -1]
        scene = make(jnp.asarray(w), jnp.asarray(force)).starting(y)
        guess = Orbit(scene, PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)
        folds = orbits.continue_curve(make, guess, (w, force), kind=Kind.FOLD, step=0.1, members=1)
        edges.append(folds.members[0].parameters[0] / rates - 1)
    # Terms of order F^2 move both edges alike.
    assert abs((edges[0] - edges[1]) / (2 * force * abs(c)) - 1) < 1e-5
    assert abs(edges[0] + edges[1]) < force**2 * 0.01


@pytest.mark.slow
def test_a_curve_ends_before_the_drive_vanishes():
    # Without a force any period closes, so nothing determines w at the tip of the tongue.
    def rate(t, y, c):
        w, force = c
        return [y[1], 0.5 * (1 - y[0] ** 2) * y[1] - y[0] + force * jnp.cos(w * t)]

    def make(w, force):
        return jaxdyn.ode(rate, [0.0, 0.0], 2 * jnp.pi / w, params=jnp.stack([w, force]))

    both = np.array([0.95903408, 0.09954733])
    scene = make(*jnp.asarray(both)).starting(jnp.array([1.99415215, -0.22736066]))
    fold = Orbit(scene, PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)
    within = ((0.8, 1.2), (0.0, 0.6))
    curve = orbits.continue_curve(
        make, fold, both, kind=Kind.FOLD, step=0.5, down=True, members=4, within=within
    )
    for member in curve.members:
        assert abs(member.orbit.period * member.parameters[0] - 2 * np.pi) < 1e-12
    assert curve.parameters[-1, 1] > 1e-3
    assert curve.end.endswith("on which no member was found")
