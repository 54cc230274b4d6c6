"""The doubling curve of Duffing's oscillator in a double well, against SciPy's integrator.

x'' + d x' - x + x^3 = F cos(w t): Guckenheimer and Holmes (1983), Nonlinear Oscillations,
section 2.2. An orbit within one well doubles its period as F grows.
"""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from orbits import Kind

DAMPING, TURN = 0.25, 2 * math.pi


def duffing(w, force):
    def rate(t, y, c):
        return [y[1], -DAMPING * y[1] + y[0] - y[0] ** 3 + c[1] * jnp.cos(c[0] * t)]

    return jaxdyn.ode(rate, [1.0, 0.0], TURN / w, params=[w, force])


def by_scipy(point):
    """The state after a period, less the start, and the monodromy matrix."""
    w, force = point.parameters

    def rate(t, z):
        x, v, a, b, c, d = z
        k = 1 - 3 * x**2
        forward = [v, -DAMPING * v + x - x**3 + force * np.cos(w * t)]
        return [*forward, b, k * a - DAMPING * b, d, k * c - DAMPING * d]

    start = [*point.orbit.y0, 1.0, 0.0, 0.0, 1.0]
    end = solve_ivp(rate, (0, TURN / w), start, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return end[:2] - np.asarray(point.orbit.y0), end[2:].reshape(2, 2).T


@pytest.mark.slow
def test_multipliers_on_the_doubling_curve_of_duffings_double_well():
    near = orbits.find(duffing(1.0, 0.1817), y0=[0.375, 0.362])
    curve = orbits.continue_curve(
        duffing, near, (1.0, 0.1817), kind=Kind.DOUBLING, within=((0, 2), (0, 1)), members=6
    )
    assert np.ptp(curve.parameters[:, 0]) > 0.05
    for point in curve.members[::2]:
        closing, monodromy = by_scipy(point)
        assert np.abs(closing).max() < 1e-11
        # Liouville: the product of the multipliers is exp(-d T), and one of them is -1.
        shrinking = math.exp(-DAMPING * TURN / point.parameters[0])
        assert abs(np.linalg.det(monodromy) - shrinking) < 1e-11
        assert abs(np.trace(monodromy) + 1 + shrinking) < 1e-10
