"""Kepler's equation: roots by mpmath, motions, closed forms of derivatives."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

from jaxdyn import scenes, solve
from jaxdyn.analysis import orbital_elements
from jaxdyn.analysis.kepler import mean_anomaly, true_anomaly

ECCENTRICITIES = [0.0, 0.1, 0.7, 0.999, 1 - 1e-10, 1 + 1e-10, 1.001, 1.5, 20.0]
MEANS = [0.0, 1e-12, 1e-4, 0.3, 2.0, 3.14159]


def by_mpmath(mean, e):
    """The true anomaly to 40 digits: the eccentric one by bisection."""
    with mpmath.workdps(40):
        m, e = mpmath.mpf(mean), mpmath.mpf(e)
        sine, cosine = (mpmath.sin, mpmath.cos) if e < 1 else (mpmath.sinh, mpmath.cosh)
        low, high = mpmath.mpf(0), mpmath.mpf(10)
        for _ in range(150):
            middle = (low + high) / 2
            beyond = abs(middle - e * sine(middle)) > m
            low, high = (low, middle) if beyond else (middle, high)
        x = mpmath.sqrt(abs(1 - e * e)) * sine(low)
        return float(mpmath.atan2(x, (cosine(low) - e) * mpmath.sign(1 - e)))


@pytest.mark.parametrize("e", ECCENTRICITIES)
def test_anomalies_are_those_of_mpmath(e):
    wanted = [by_mpmath(mean, e) for mean in MEANS]
    found = true_anomaly(jnp.array(MEANS), e)
    assert_allclose(found, wanted, rtol=1e-13, atol=1e-300)
    assert_allclose(mean_anomaly(found, e), MEANS, rtol=1e-9 if abs(e - 1) < 1e-9 else 1e-12)
    back = true_anomaly(-jnp.array(MEANS), e)
    assert_allclose(back, np.mod(-found, 2 * np.pi) if e < 1 else -found, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("speed", [1.1, 1.8])
def test_the_mean_anomaly_of_a_motion_grows_with_the_time(speed):
    scene = scenes.power_law(k=1.0, n=-2.0, speed=speed)
    ts = jnp.array([0.5, 1.5, 4.0])
    run = solve(scene, 4.0, ts=ts)
    found = orbital_elements(run.ys[:, :2], run.ys[:, 2:], 1.0)
    means = mean_anomaly(found.anomaly, found.e)
    assert_allclose(means, ts / jnp.abs(found.a) ** 1.5, rtol=1e-11)


def test_derivatives_are_those_of_the_closed_form():
    """d nu / d M = (1 + e cos nu)^2 / |1 - e^2|^(3/2)."""
    for e in (0.0, 0.6, 1.7):
        for mean in (0.0, 0.4, -2.0):
            nu = true_anomaly(mean, e)
            wanted = (1 + e * jnp.cos(nu)) ** 2 / abs(1 - e * e) ** 1.5
            for mode in (jax.grad, jax.jacfwd):
                assert_allclose(mode(true_anomaly)(mean, e), wanted, rtol=1e-12)
            back = jax.grad(mean_anomaly)(nu, e)
            assert_allclose(back, 1 / wanted, rtol=1e-12)
    second = jax.grad(jax.grad(lambda m: true_anomaly(m, 0.6)))(0.4)
    slope = jax.grad(lambda m: true_anomaly(m, 0.6))
    assert_allclose(second, (slope(0.4 + 1e-5) - slope(0.4 - 1e-5)) / 2e-5, rtol=1e-8)


def test_what_has_no_anomaly_is_nan():
    assert np.isnan(true_anomaly(1.0, jnp.array([1.0, -0.1]))).all()
    assert np.isnan(mean_anomaly(3.0, 2.0))
    with pytest.raises(ValueError, match=r"^mean: expected"):
        true_anomaly("now", 0.1)
