"""Guesses for free: each leads to an orbit that is known by another route."""

import jax.numpy as jnp
import numpy as np
import pytest
from two_cycles import two_cycles

import orbits
from jaxdyn import scenes
from orbits.discovery import seeds


def test_a_pendulums_mode_leads_to_its_swings():
    scene = scenes.pendulum(length=1.0, g=1.0)
    (seed,) = seeds.modes(scene, [0.0, 0.0], 0.3)
    assert seed.period == pytest.approx(2 * np.pi, rel=1e-12)
    np.testing.assert_allclose(np.abs(seed.y0), [0.3, 0.0], atol=1e-15)
    orbit = orbits.find(scene, seed.y0, seed.period)
    # 4 K(sin(A / 2)), by the arithmetic-geometric mean.
    a, g = 1.0, np.cos(0.5 * amplitude(orbit))
    for _ in range(6):
        a, g = 0.5 * (a + g), np.sqrt(a * g)
    assert orbit.period == pytest.approx(2 * np.pi / a, rel=1e-11)
    assert amplitude(orbit) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("system", ["", "earth-moon"])
@pytest.mark.parametrize("point", ["L4", "L5"])
def test_motions_of_a_few_km_about_a_triangular_point_close_in_any_units(system, point):
    # In km the places are large and the velocities small; at z = 0 rounding in an eigenvector
    # would count as a motion.
    earth_moon = scenes.restricted_three_body_in_space(system="earth-moon").system
    scene = scenes.restricted_three_body_in_space(
        **({"system": system} if system else {"mu": float(earth_moon.mu)})
    )
    length, time = map(float, (earth_moon.distance, earth_moon.time) if system else (1, 1))
    found = seeds.modes(scene, scenes.libration_point(scene, point), 1e-5 * length)
    assert [np.count_nonzero(seed.y0[[2, 5]]) > 0 for seed in found] == [False, False, True]
    for seed, turn in zip(found, [0.29821, 0.95450, 1.0], strict=True):
        orbit = orbits.find(scene, seed.y0, seed.period)
        assert orbit.period == pytest.approx(2 * np.pi / turn * time, rel=1e-5)
        assert orbit.shift < 1e-4 * 1e-5 * length
        assert str(orbits.stability(orbit).verdict) == "stable"


def amplitude(orbit):
    """Largest angle of a pendulum with g = l, from its energy."""
    angle, speed = (float(x) for x in orbit.y0)
    return float(np.arccos(np.cos(angle) - 0.5 * speed**2))


def test_motions_that_grow_have_no_mode():
    assert seeds.modes(scenes.pendulum(), [np.pi, 0.0], 0.1) == []
    assert seeds.modes(scenes.oscillator(c=0.5), [0.0, 0.0], 0.1) == []
    with pytest.raises(ValueError, match="y: expected an equilibrium"):
        seeds.modes(scenes.pendulum(), [1.0, 0.0], 0.1)
    with pytest.raises(ValueError, match="amplitude: expected > 0"):
        seeds.modes(scenes.pendulum(), [0.0, 0.0], 0.0)


def test_a_long_run_returns_to_the_cycle():
    run = seeds.returns(two_cycles(), 20.0, longest=2.0, shortest=0.5)
    assert 1 <= len(run) <= 10
    orbit = orbits.find(two_cycles(), run[0].y0, run[0].period)
    assert orbit.period == pytest.approx(2 * np.pi / 5, rel=1e-11)
    with pytest.raises(ValueError, match="longest: expected above shortest"):
        seeds.returns(two_cycles(), 1.0, longest=2.0)
    said = "longest: expected at least 14.7, got 2.0. The run has 2048 samples, one every 4.89"
    with pytest.raises(ValueError, match=said):
        seeds.returns(two_cycles(), 1e4, longest=2.0)
    with pytest.raises(ValueError, match=r"longest: expected at least 0.0293, got"):
        seeds.returns(two_cycles(), 20.0, longest=0.02)
    assert isinstance(seeds.returns(two_cycles(), 20.0, longest=0.0294), list)


def test_starts_on_a_line_are_kept_by_the_reversal():
    reversal = orbits.point_symmetry([1, 0, 2], (-1, -1), reversing=True)
    low, high = np.full(12, 0.1), np.full(12, 0.5)
    low[:2], high[:2] = [-1.0, 0.0], [-1.0, 0.0]
    shape = [1] * 6 + [3, 2] + [1] * 4
    starts = seeds.line(reversal, low, high, shape)
    assert starts.shape == (6, 12)
    for y in starts:
        np.testing.assert_allclose(np.asarray(reversal.act(jnp.asarray(y))), y, atol=1e-15)
    with pytest.raises(ValueError, match="shape: expected 12 entries"):
        seeds.line(reversal, low, high, [1])


def test_a_published_row_is_the_eight():
    scene, seed = seeds.row(0.3471168881, 0.5327249454, 6.3259139829)
    orbit = orbits.find(scene, seed.y0, seed.period, closing=orbits.choreography(3))
    # The eight's line of starts is also one where the third body is in the middle.
    assert orbits.identify(orbit).choreography
    np.testing.assert_allclose(orbit.y0, seed.y0, atol=1e-8)
    np.testing.assert_array_equal(seeds.rows(np.array([[1.0, 2.0]]))[0, 6:], [1, 2, 1, 2, -2, -4])
