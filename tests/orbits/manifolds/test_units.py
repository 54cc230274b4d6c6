"""No unit matters: connections are the same in all units."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits

#: Units of the entries, of a parameter, and of time.
UNITS = [
    ([1e-12, 3e8], 1e12, 7e-15),
    ([2e12, 1e-9], 1e-12, 1e12),
    ([5e6, 4e-3], 1e6, 1e-3),
]
MIDDLE = 0.25  # root of the cubic between the equilibria


def front(y, c):
    """A travelling front of the equation of Nagumo, u' = u'' + u (1 - u) (u - a), at speed c."""
    u, v = y
    return [v, -c * v - u * (1 - u) * (u - MIDDLE)]


def scaled(t, y, numbers):
    value, each, time = numbers
    return each * jnp.stack(front(y / each, value)) / time


@pytest.mark.slow
@pytest.mark.parametrize("units", [([1.0, 1.0], 1.0, 1.0), *UNITS])
def test_a_connection_of_equilibria(units):
    each, own, time = np.array(units[0]), units[1], units[2]

    def make(c):
        return jaxdyn.ode(scaled, jnp.zeros(2), time, params=(c / own, each, time))

    a = make(0.35 * own).starting(each * np.array([1.0, 0.0]))
    found = orbits.connect(
        a,
        np.zeros(2),
        make=make,
        parameter=0.35 * own,
        branch="-",
        time=20.0 * time,  # later it leaves for infinity
        segments=8,
        error=1e-7,
    )
    assert found.ok, found
    # u = 1 / (1 + exp(x / sqrt(2))), c = (1 - 2 a) / sqrt(2).
    assert found.parameter / own == pytest.approx((1 - 2 * MIDDLE) / np.sqrt(2), abs=1e-9)
    assert found.parameter_error / own < 1e-6
    u, v = (found.states / each).T
    np.testing.assert_allclose(v, -u * (1 - u) / np.sqrt(2), atol=1e-6)
    assert found.error <= 1e-7
    assert "Heteroclinic" in repr(found)
