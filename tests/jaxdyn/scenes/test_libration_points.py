"""Libration points: published numbers, Euler's quintics, and the rate of the scene."""

import logging

import jax
import numpy as np
import pytest

from jaxdyn import scenes

#: The usual mass ratio of Moon and Earth, with L1, L2, L3 as printed in many places.
EARTH_MOON, PUBLISHED = 0.01215058560962404, (0.836915, 1.155682, -1.005063)
#: Sun and Jupiter, and the extremes.
MUS = (1e-9, 9.537e-4, EARTH_MOON, 0.5, 0.9)


def euler(mu):
    """x of L1, L2, L3 from Euler's quintics for the distance to the nearer mass."""
    far = 1 - mu
    quintics = [
        [1, -(3 - mu), 3 - 2 * mu, -mu, 2 * mu, -mu],
        [1, 3 - mu, 3 - 2 * mu, -mu, -2 * mu, -mu],
        [1, 2 + mu, 1 + 2 * mu, -far, -2 * far, -far],
    ]
    roots = [np.roots(c) for c in quintics]
    d1, d2, d3 = (r[(abs(r.imag) < 1e-9) & (r.real > 0)].real[0] for r in roots)
    return far - d1, far + d2, -mu - d3


def test_earth_and_moon_as_published():
    np.testing.assert_allclose(
        scenes.libration_points(EARTH_MOON)[:3, 0], PUBLISHED, rtol=0, atol=5.1e-7
    )


@pytest.mark.parametrize("mu", MUS)
def test_eulers_quintics_and_rest(mu):
    points = scenes.libration_points(mu)
    np.testing.assert_allclose(points[:3, 0], euler(mu), rtol=0, atol=1e-12)
    scene = scenes.restricted_three_body(mu=mu)
    for x, y in points:
        np.testing.assert_allclose(scene.rate(0.0, np.array([x, y, 0, 0])), 0, atol=3e-14)


def test_the_derivative_by_the_mass_in_both_modes():
    h = 1e-6
    apart = scenes.libration_points(0.1 + h) - scenes.libration_points(0.1 - h)
    for mode in (jax.jacfwd, jax.jacrev):
        slope = jax.jit(mode(scenes.libration_points))(0.1)
        np.testing.assert_allclose(slope, apart / (2 * h), rtol=0, atol=1e-8)


@pytest.mark.parametrize("mu", [0.0, 1.0, -0.1])
def test_shares_of_mass_out_of_range_are_refused(mu):
    with pytest.raises(ValueError, match="mu: expected between 0 and 1"):
        scenes.libration_points(mu)


def test_new_values_do_not_compile_again():
    points = scenes.libration_points
    points(0.1)
    with jax.log_compiles(), pytest.MonkeyPatch.context() as patch:
        said: list[str] = []
        patch.setattr(logging.Logger, "handle", lambda self, record: said.append(record.msg))
        points(0.2)
    assert not [text for text in said if text.startswith("Compiling")]
