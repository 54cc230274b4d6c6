"""No unit matters: what is found at and near equilibria is the same in all units."""

import jax.numpy as jnp
import numpy as np
import pytest
from units import in_units

import jaxdyn
from jaxdyn import Scene
from jaxdyn.analysis import floquet
from jaxdyn.analysis.equilibria import equilibria, equilibrium
from jaxdyn.analysis.linearize import linearize, modes
from jaxdyn.analysis.steady import linearize_steady
from jaxdyn.effects import PairGravity, SpringNetwork
from jaxdyn.formulations.newton import FreePoints

#: Units of length, time and mass: small ones, astronomical ones, and a mixture.
UNITS = [(1e-12, 1e-12, 1e-12), (1.496e11, 5e6, 1.989e30), (1e12, 1e-6, 1e-12), (1e-6, 1e12, 1e6)]
#: Another program's rounding, amplified by conditions of some 10.
SAME = 1e-12


def buckled(t, y, p):
    """Two wells and the hill between them; the last entry is moved by the first."""
    return [y[1], y[0] - y[0] ** 3 - p * y[1], y[0] * y[1] + 1.0 - y[2]]


BUCKLED = jaxdyn.ode(buckled, [0.7, 0.1, 0.3], 10.0, params=0.2)
#: Units of the entries, and of time.
MIXED = [([1e-12, 1e12, 1e-6], 1e-12), ([1e6, 1e-12, 1e12], 1e6), ([3e11, 2e-7, 1e-12], 1e12)]


@pytest.mark.slow
@pytest.mark.parametrize(("each", "time"), MIXED)
def test_equilibria_and_their_stability(each, time):
    plain = equilibria(BUCKLED, [-2.0, -1, -3], [2.0, 1, 3], starts=64)
    new, y, _ = in_units(BUCKLED, each, time)
    found = equilibria(new, y * [-2.0, -1, -3], y * [2.0, 1, 3], starts=64)
    assert (len(found), found.complete, found.kinds) == (3, plain.complete, plain.kinds)
    assert found.certainty == plain.certainty
    np.testing.assert_allclose(found.states / y, plain.states, atol=SAME)
    for there, here in zip(found.linearizations, plain.linearizations, strict=True):
        assert (there.verdict, there.portrait) == (here.verdict, here.portrait)
        np.testing.assert_allclose(there.eigenvalues * time, here.eigenvalues, atol=SAME)
        assert (there.bars * time < 1e-12).all()


@pytest.mark.parametrize(("each", "time"), MIXED)
def test_the_equilibrium_near_a_state(each, time):
    new, y, _ = in_units(BUCKLED, each, time)
    for start in ([0.8, 0.0, 0.0], [0.1, 0.0, 0.9], [0.0, 0.0, 1.0]):
        exact = [round(start[0]), 0.0, 1.0]
        np.testing.assert_allclose(equilibrium(new, y * start) / y, exact, atol=SAME)
    # None: the rate's derivative is singular.
    flat = in_units(jaxdyn.ode(lambda t, y: [y[0] ** 2, y[1] - y[0]], [1.0, 1.0]), each[:2], time)
    assert np.isnan(equilibrium(flat.scene, flat.y * 0.3)).all()


def hung(length, time, mass):
    """Two masses that hang from each other on springs, a unit of length long when at rest."""
    g, k = 2.0 * length / time**2, 9.0 * mass / time**2
    springs = SpringNetwork(((0, 1),), k, length)
    masses = mass * np.array([1.0, 3.0])
    return Scene(FreePoints(masses, 1), (springs,), y0=length * np.array([0.0, 1.0, 0, 0])), g


@pytest.mark.parametrize("units", UNITS)
def test_modes(units):
    length, time, _ = units
    scene, _ = hung(*units)
    found = modes(scene)
    np.testing.assert_allclose(found.squares * time**2, [0.0, 12.0], atol=SAME)
    # Not at rest, by parts of the length and the speed that are 1e-5.
    for off in (length * np.array([1e-5, 0, 0, 0]), length / time * np.array([0, 0, 1e-4, 0])):
        with pytest.raises(ValueError, match="an equilibrium"):
            modes(scene, scene.y0 + off)
    modes(scene, scene.y0 * (1 + 1e-9))


def pair(length, time, mass):
    """Two equal bodies that circle each other in 2 pi units of time."""
    y0 = np.array([-0.5, 0, 0.5, 0, 0, -0.5, 0, 0.5]) * np.repeat([length, length / time], 4)
    gravity = PairGravity(length**3 / mass / time**2)
    return Scene(FreePoints(mass * np.array([0.5, 0.5]), 2), (gravity,), y0=y0, t1=time)


@pytest.mark.parametrize(
    "units", [UNITS[1], *(pytest.param(x, marks=pytest.mark.slow) for x in UNITS[:1] + UNITS[2:])]
)
def test_the_motions_near_a_circle_of_two_bodies(units):
    _, time, _ = units
    scene, plain = pair(*units), pair(1.0, 1.0, 1.0)
    here, there = linearize(plain, plain.y0), linearize(scene, scene.y0)
    # Those that are 0 are rounding, which decides on their order and on that of the pairs +-i.
    gaps = np.abs(there.eigenvalues[:, None] * time - here.eigenvalues)
    assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-7
    assert sorted((gaps < 1e-7).sum(axis=0)) == sorted((gaps < 1e-7).sum(axis=1))  # as often
    assert (there.verdict, there.portrait) == (here.verdict, here.portrait)
    here, there = linearize_steady(plain), linearize_steady(scene)
    assert (there.symmetries, there.family) == (here.symmetries, here.family)
    assert (there.reduced.verdict, there.reduced.portrait) == ("undecided", "centre")
    np.testing.assert_allclose(there.frequencies * time, [1.0], atol=1e-7)


def swung(t, y, p):
    return [y[1], -(1.0 + p * jnp.cos(2 * t)) * y[0] - 0.02 * y[1]]


@pytest.mark.sample("each0-1e-12-0.2", "each1-1000000.0-0.01", "each2-1000000000000.0-0.01")
@pytest.mark.parametrize("pumped", [0.01, 0.2])
@pytest.mark.parametrize(("each", "time"), MIXED)
def test_multipliers(each, time, pumped):
    scene = jaxdyn.ode(swung, [0.0, 0.0], np.pi, params=pumped)
    plain = floquet.multipliers(scene, np.pi, rtol=1e-12)
    new, _, _ = in_units(scene, each[:2], time)
    found = floquet.multipliers(new, np.pi * time, rtol=1e-12)
    assert found.verdict == plain.verdict == ("stable" if pumped < 0.04 else "unstable")
    np.testing.assert_allclose(found.multipliers, plain.multipliers, atol=1e-10)
    with pytest.raises(ValueError, match="repeats"):
        floquet.multipliers(new.starting(new.y0 + 1e-3 * np.array(each[:2])), np.pi * time)
