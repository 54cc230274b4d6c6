"""Frequency analysis against known sums, closed forms, and what it must refuse."""

import math

import numpy as np
import pytest
from helpers import gap, refusal
from scipy.special import ellipk

import jaxdyn
from jaxdyn import scenes
from jaxdyn.chaos import frequencies

DT = 0.25
TIMES = DT * np.arange(4096)


def test_a_complex_sum_of_oscillations_is_taken_apart():
    w = np.array([1.0, math.sqrt(2), -1 / math.sqrt(3), 2 + math.sqrt(2), 2 - math.sqrt(0.5)])
    a = np.array([1.0, 0.3j, 0.1 - 0.1j, 0.01, 1e-4])
    found = frequencies(np.exp(1j * TIMES[:, None] * w) @ a, dt=DT)
    assert gap(found.frequencies, w) < 1e-12
    assert gap(found.amplitudes, a) < 1e-12
    assert (found.bars < 1e-10).all()
    assert found.residual < 1e-12


def test_a_real_signal_has_positive_frequencies_and_a_mean():
    signal = 3 + 0.5 * np.cos(TIMES) + 0.2 * np.sin(math.pi / 3 * TIMES + 1)
    found = frequencies(signal, dt=DT)
    assert gap(found.frequencies, [0, 1, math.pi / 3]) < 1e-12
    assert gap(np.abs(found.amplitudes), [3, 0.5, 0.2]) < 1e-12
    assert abs(np.angle(found.amplitudes[2]) - (1 - math.pi / 2)) < 1e-11


def test_bars_hold_where_there_are_more_oscillations_than_asked_for():
    w = 1.0 + np.array([0.0, 0.05, 0.11, 0.18])
    a = np.array([1.0, 0.5, 0.25, 0.125])
    found = frequencies(np.exp(1j * TIMES[:, None] * w) @ a, dt=DT, count=2)
    assert len(found.frequencies) == 2
    assert (np.abs(found.frequencies - w[:2]) < found.bars).all()
    assert found.residual > 0.1


@pytest.mark.slow
def test_a_pendulum_has_odd_multiples_of_its_frequency():
    motion = jaxdyn.simulate(scenes.pendulum(angle=2.0), 400.0, samples=4001, rtol=1e-13)
    found = frequencies(motion, motion.scene.labels()[0][0], count=4)
    exact = math.pi / 2 * math.sqrt(9.81) / ellipk(math.sin(1.0) ** 2)
    assert abs(found.frequencies[0] - exact) < 1e-11
    assert gap(found.frequencies, exact * np.array([1, 3, 5, 7])) < 1e-6
    assert found.residual < 1e-4


def quartic(t, y):
    """Attraction r + r^3 towards the origin."""
    del t
    pull = 1 + y[0] ** 2 + y[1] ** 2
    return [y[2], y[3], -pull * y[0], -pull * y[1]]


@pytest.mark.slow
def test_a_rosette_has_the_frequencies_of_its_quadratures():
    x, v = 1.0, 0.7
    energy, momentum = 0.5 * v**2 + x**2 / 2 + x**4 / 4, x * v
    # With s = r^2: s'^2 = -2 s^3 - 4 s^2 + 8 E s - 4 L^2 = 2 (s - s1) (s2 - s) (s - s3).
    s3, s1, s2 = np.sort(np.roots([-2, -4, 8 * energy, -4 * momentum**2]).real)
    angle = np.linspace(0, 2 * math.pi, 400, endpoint=False)
    s = 0.5 * (s1 + s2) + 0.5 * (s2 - s1) * np.sin(angle)
    rates = 1 / np.sqrt(2 * (s - s3))
    period, turned = 2 * math.pi * rates.mean(), 2 * math.pi * (momentum * rates / s).mean()
    radial, angular = 2 * math.pi / period, turned / period
    motion = jaxdyn.simulate(jaxdyn.ode(quartic, [x, 0.0, 0.0, v]), 500.0, samples=5001, rtol=1e-13)
    r = np.asarray(motion.ys)
    found = frequencies(r[:, 0] + 1j * r[:, 1], dt=0.1, count=6)
    k = np.round((found.frequencies - angular) / radial)
    assert set(k[:3]) == {0, -1, 1}
    assert gap(found.frequencies[:2], (angular + k * radial)[:2]) < 1e-10


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"signal": np.ones(8), "dt": 1.0}, "signal: expected at least 16 samples"),
        ({"signal": np.ones((20, 2)), "dt": 1.0}, "signal: expected at least 16 samples"),
        ({"signal": np.full(20, np.nan), "dt": 1.0}, "signal: expected finite samples"),
        ({"signal": np.ones(20)}, "dt: expected the time between samples"),
        ({"signal": np.ones(20), "dt": 0.0}, "dt: expected > 0"),
        ({"signal": np.ones(20), "dt": 1.0, "count": 0}, "count: expected a whole number"),
        ({"signal": np.ones(20), "dt": 1.0, "entry": "x"}, "entry: expected none for samples"),
    ],
)
def test_misuse_is_refused(arguments, message):
    assert refusal(lambda: frequencies(**arguments)).startswith(message)


def test_motions_are_checked():
    motion = jaxdyn.simulate(scenes.lorenz(), samples=[0.0, *np.linspace(1.0, 2.0, 30)])
    assert refusal(lambda: frequencies(motion, "w")).startswith("entry: expected one of x, y, z")
    assert refusal(lambda: frequencies(motion, "x")).startswith("signal: expected equally spaced")


def test_a_motion_backwards_has_the_frequencies_and_bars_of_its_samples():
    scene = scenes.oscillator(k=4.0, x=1.0)
    found = frequencies(jaxdyn.simulate(scene, -100.0, samples=1001), "x", count=1)
    assert abs(found.frequencies[0] - 2.0) < 1e-10
    assert abs(found.amplitudes[0] - 1.0) < 1e-10
    assert (found.bars > 0).all()


def test_no_frequency_is_found_twice_where_samples_are_few():
    signal = np.random.default_rng(0).normal(size=40)
    found = frequencies(signal, dt=1.0, count=30)
    assert np.diff(np.sort(found.frequencies)).min() > 0.1


def test_no_motion_has_no_frequency():
    found = frequencies(np.zeros(100), dt=1.0)
    assert len(found.frequencies) == 0
    assert found.residual == 0.0
