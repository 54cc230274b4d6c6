"""Backbones of Duffing's equation and of two masses, against closed forms and harmonic balance."""

from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest
from harmonics import Balance
from numpy.testing import assert_allclose
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import scenes


def rate(t, y):
    return [y[1], -y[0] - y[0] ** 3]


def duffing(t, y):
    return 0.5 * (y[0] ** 2 + y[1] ** 2) + 0.25 * y[0] ** 4


def free(energy=duffing):
    return jaxdyn.ode(rate, [0.0, 0.0], names=["x", "v"], energy=energy)


def cubic(t, y):
    """Kerschen et al. (2009), section 2.1: two masses between three springs, one of them cubic."""
    x1, x2, v1, v2 = y
    return [v1, v2, -(2 * x1 - x2) - 0.5 * x1**3, -(2 * x2 - x1)]


def energy(t, y):
    x1, x2, v1, v2 = y
    return 0.5 * (v1**2 + v2**2) + x1**2 + x2**2 - x1 * x2 + x1**4 / 8


NAMES = ["x1", "x2", "v1", "v2"]


def two_masses():
    return jaxdyn.ode(cubic, np.zeros(4), names=NAMES, energy=energy, second_order=True)


@pytest.fixture(scope="module")
def modes():
    """Up to the 3:1 resonance, a hundred vibrations."""
    return [orbits.backbone(two_masses(), mode, energy=1e4) for mode in (1, 2)]


@pytest.fixture(scope="module")
def beginnings():
    """Up to the 2:1 resonances."""
    return [orbits.backbone(two_masses(), mode, energy=100.0) for mode in (1, 2)]


def test_duffings_backbone_is_the_elliptic_integral():
    found = orbits.backbone(free(), energy=10.0)
    a = found.amplitudes("x")
    m = a**2 / (2 * (1 + a**2))
    assert_allclose(found.frequencies, np.pi * np.sqrt(1 + a**2) / (2 * ellipk(m)), rtol=1e-10)
    assert_allclose(found.energies, a**2 / 2 + a**4 / 4, rtol=1e-10)
    assert found.energies[-2] < 10.0
    assert_allclose(found.energies[-1], 10.0, rtol=1e-12)
    without = orbits.backbone(free(None), frequencies=(0.5, 2.0))
    assert without.frequencies[-2] < 2.0
    assert_allclose(without.frequencies[-1], 2.0, rtol=1e-12)
    assert without.family.end == "the bounds on the frequency, (0.5, 2.0)"
    assert np.isnan(without.energies).all()


def test_without_an_energy_a_softening_backbone_grows_as_well():
    def softening(t, y):
        return [y[1], -y[0] + y[0] ** 3]

    plain = jaxdyn.ode(softening, [0.0, 0.0], names=["x", "v"])
    found = orbits.backbone(plain, frequencies=(0.7, 2.0))
    a = found.amplitudes("x")
    square = 1 - a**2 / 2
    assert_allclose(
        found.frequencies, np.pi * np.sqrt(square) / (2 * ellipk(a**2 / 2 / square)), rtol=1e-10
    )
    assert_allclose(found.frequencies[-1], 0.7, rtol=1e-12)


@pytest.mark.slow
def test_a_softening_backbone_goes_to_lower_frequencies():
    found = orbits.backbone(scenes.pendulum(angle=0.0, g=1.0, length=1.0), frequencies=(0.5, 2.0))
    a = found.amplitudes("theta")
    assert_allclose(found.frequencies, np.pi / (2 * ellipk(np.sin(a / 2) ** 2)), rtol=1e-10)
    assert_allclose(found.frequencies[-1], 0.5, rtol=1e-12)


def force(phase, x, v):
    del phase, v
    return jnp.stack([-(2 * x[0] - x[1]) - 0.5 * x[0] ** 3, -(2 * x[1] - x[0])])


@pytest.mark.slow
def test_the_modes_begin_at_the_linear_frequencies_and_are_those_of_harmonic_balance(modes):
    known = Balance(force, 2, 24)
    for found, linear in zip(modes, (1.0, np.sqrt(3)), strict=True):
        assert_allclose(found.linear, [1.0, np.sqrt(3)], rtol=1e-12)
        assert_allclose(found.frequencies[0], linear, rtol=1e-3)
        for member in found.family.members[3:14:5]:
            omega = 2 * np.pi / member.orbit.period
            motion = jaxdyn.simulate(member.orbit.scene, samples=257)
            waves = np.exp(-2j * np.pi * np.arange(256) / 256)
            first = 2 * waves @ np.asarray(motion.ys)[:-1, :2] / 256
            c = known.at(omega, known.start([first.real, -first.imag]))
            x, v = (np.asarray(z)[0] for z in known.motion(jnp.asarray(c), omega))
            assert_allclose(energy(0.0, [*x, *v]), member.energy, rtol=1e-9)


@pytest.mark.slow
def test_the_tongue_of_the_3_to_1_resonance_joins_both_modes(modes):
    """The in-phase mode leads to it, and returns at three periods of the other one."""
    slow, fast = modes
    three = next(r for r in slow.resonances if r.ratio == 3)
    assert three.mode == 2
    assert_allclose(three.frequency / (2 * np.pi), 0.2235, atol=5e-5)  # [Hz], as in the figure
    top, joined = [m for m in slow.family.special if m.kind == orbits.Kind.FOLD][:2]
    assert_allclose(top.energy, three.energy, rtol=1e-6)
    third = next(r for r in fast.resonances if r.ratio == Fraction(1, 3))
    assert third.mode == 1
    assert_allclose(3 * 2 * np.pi / joined.orbit.period, third.frequency, rtol=1e-4)
    assert slow.frequencies.max() < np.sqrt(2)  # the first mass held by a rigid spring
    assert (np.diff(fast.frequencies) > 0).all()


def test_ratios_are_those_of_the_linear_modes_and_pass_resonances(beginnings):
    slow, fast = beginnings
    assert_allclose(slow.ratios[0], np.sqrt(3), rtol=1e-3)
    assert_allclose(fast.ratios[0], 1 / np.sqrt(3), rtol=1e-3)
    first = next(r for r in slow.resonances if r.ratio == 2)
    branch = next(m for m in slow.family.special if m.kind == orbits.Kind.BRANCH)
    assert_allclose(first.frequency, 2 * np.pi / branch.orbit.period, rtol=1e-9)
    half = next(r for r in fast.resonances if r.ratio == Fraction(1, 2))
    assert_allclose(np.linalg.eigvals(half.member.stability.monodromy).real.min(), -1, atol=1e-5)
    assert "1:2 with mode 1 at 2.79314" in repr(fast)  # an ode without units


def test_the_table_has_amplitudes_of_all_coordinates(beginnings):
    pytest.importorskip("pandas")
    frame = beginnings[1].to_pandas()
    assert list(frame.columns)[-2:] == ["amplitude x1", "amplitude x2"]
    assert len(frame) == len(beginnings[1].family.members)


DAMPED = jaxdyn.ode(lambda t, y: [y[1], -y[0] - 0.1 * y[1]], [0.0, 0.0])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"mode": 2}, "mode: expected at most 1"),
        ({"energy": -1.0}, "energy: expected > 0"),
        ({"amplitude": 0.0}, "amplitude: expected > 0"),
        ({"frequencies": (2.0, 1.0)}, "frequencies: expected two bounds"),
        (
            {"frequencies": (1.1, 2.0)},
            "frequencies: expected bounds around the first vibration's, 1.000.*, got .1.1, 2.0",
        ),
        ({"scene": free(None), "energy": 1.0}, "energy: expected none for a scene without one"),
        ({"scene": free().starting([1.0, 0.0])}, "y: expected an equilibrium"),
        ({"scene": DAMPED}, "scene: expected modes that oscillate without damping, got none"),
    ],
)
def test_misuse_is_refused_with_what_to_do(options, said):
    with pytest.raises(ValueError, match=said):
        orbits.backbone(**{"scene": free()} | options)
