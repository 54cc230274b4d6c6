"""Numbers for which something holds of an orbit or a special point, against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import scenes
from orbits.targets import DesignOutcome, design


def pendulum(numbers):
    return scenes.pendulum(length=numbers[0], angle=1.0)


@pytest.fixture(scope="module")
def swing():
    return orbits.find(pendulum(jnp.array([1.0])), period=2.2, hold="theta")


def period_of(orbit):
    return orbit.period - 2.0


def test_the_length_of_a_pendulum_of_a_wanted_period(swing):
    found = design(pendulum, period_of, [1.0], swing, hold="theta")
    # T = 4 sqrt(l / g) K(sin(1/2)^2)
    exact = 9.81 * (2.0 / (4 * ellipk(np.sin(0.5) ** 2))) ** 2
    assert found.ok
    assert found.numbers[0] == pytest.approx(exact, rel=1e-10)
    assert found.found.y0[0] == pytest.approx(1.0, abs=1e-14)


def test_what_bounds_do_not_allow_ends_at_the_least(swing):
    found = design(pendulum, period_of, [1.0], swing, hold="theta", lower=[0.9], throw=False)
    assert found.outcome == DesignOutcome.LEAST
    assert found.numbers[0] == 0.9
    with pytest.raises(orbits.SearchError, match="The requirement cannot be met near here"):
        design(pendulum, period_of, [1.0], swing, hold="theta", lower=[0.9])


@pytest.fixture(scope="module")
def hopf():
    make = lorenz(jnp.array([10.0, 8 / 3]))
    return jaxdyn.continue_equilibria(make, 20.0, [7.0, 7.0, 19.0], within=(2, 30)).special[0]


def lorenz(numbers):
    return lambda rho: scenes.lorenz(sigma=numbers[0], beta=numbers[1], rho=rho)


def test_a_hopf_point_where_it_is_wanted_with_a_wanted_frequency(hopf):
    def wanted(point):
        return jnp.stack([point.parameter - 30.0, point.frequency - 11.0])

    s, b = design(lorenz, wanted, [10.0, 8 / 3], hopf).numbers
    assert s * (s + b + 3) / (s - b - 1) == pytest.approx(30.0, rel=1e-10)
    assert 2 * b * s * (s + 1) / (s - b - 1) == pytest.approx(121.0, rel=1e-10)


@pytest.mark.slow
def test_what_cannot_be_reached_is_said(hopf):
    # No positive sigma and beta have one at rho = 3.
    found = design(
        lorenz, lambda point: point.parameter - 3.0, [10.0, 8 / 3], hopf, throw=False, steps=10
    )
    assert not found.ok
    assert np.isfinite(found.numbers).all()
    assert "Design" in repr(found)
    one = design(
        lorenz, lambda point: point.parameter - 30.0, [10.0, 8 / 3], hopf, steps=1, throw=False
    )
    assert one.outcome == DesignOutcome.STEP_LIMIT


def van_der_pol(t, y, n):
    del t
    return [y[1], n[0] * (1 - y[0] ** 2) * y[1] - n[1] * y[0]]


@pytest.mark.slow
def test_period_and_multiplier_of_a_cycle():
    def make(n):
        return jaxdyn.ode(van_der_pol, [2.0, 0.0], 6.66, params=n)

    def wanted(orbit):
        return jnp.stack([orbit.period - 5.0, orbit.multipliers()[0].real - 0.01])

    found = design(make, wanted, [1.3, 1.0], orbits.find(make(jnp.array([1.3, 1.0]))))
    assert found.found.period == pytest.approx(5.0, abs=1e-10)
    assert orbits.stability(found.found).nontrivial[0] == pytest.approx(0.01, abs=1e-10)


def test_misuse(swing, hopf):
    with pytest.raises(ValueError, match="guess: expected within its bounds"):
        design(pendulum, period_of, [1.0], swing, upper=0.5)
    with pytest.raises(ValueError, match="near: expected an orbit, or a fold or a Hopf point"):
        design(pendulum, period_of, [1.0], swing.scene)
    with pytest.raises(ValueError, match="wanted: expected a number or numbers"):
        design(pendulum, lambda orbit: jnp.zeros((2, 2)), [1.0], swing, hold="theta")
    with pytest.raises(ValueError, match="wanted: expected finite numbers with derivatives"):
        design(pendulum, lambda orbit: jnp.nan * orbit.period, [1.0], swing, hold="theta")
