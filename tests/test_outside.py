"""Orbits from outside the course, which prove that nothing is special-cased."""

import jax.numpy as jnp
import numpy as np
import odes
import pytest
from closed_forms import HenonHeiles
from helpers import SOLVED
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import Scene, scenes
from jaxdyn.analysis import energy
from jaxdyn.formulations.newton import FreePoints


@pytest.mark.slow
def test_the_shortest_orbit_of_lorenz():
    # Two turns, AB; period by D. Viswanath, Physica D 190 (2004) 115.
    guess = [-13.763610682134, -19.578751942452, 27.0]
    orbit = orbits.find(scenes.lorenz(), guess, 1.5586, hold=orbits.Section(2, 27.0))
    assert abs(orbit.period - 1.5586522107161747) < SOLVED
    linear = orbits.stability(orbit)
    assert linear.verdict == "unstable"
    # The product of all multipliers is exp(divergence x period), divergence -(10 + 1 + 8/3).
    product = float(np.prod(linear.multipliers).real)
    assert abs(np.log(abs(product)) + (41 / 3) * orbit.period) < 1e-3  # the small one: 1e-9 of |M|


@pytest.mark.slow
def test_the_straight_mode_of_henon_and_heiles():
    scene = Scene(FreePoints(1.0), (HenonHeiles(),), y0=[0.0, 0.3, 0.0, 0.05], t1=6.4)
    orbit = orbits.find(scene)
    x, y, vx, vy = np.asarray(orbit.y0)
    assert abs(x) + abs(vx) < 1e-14
    level = 0.5 * vy**2 + 0.5 * y**2 - y**3 / 3
    a, b, c = np.sort(np.roots([2 / 3, -1.0, 0.0, 2 * level]).real)
    exact = 4 * np.sqrt(1.5 / (c - a)) * ellipk((b - a) / (c - a))
    assert abs(orbit.period - exact) < 1e-11
    linear = orbits.stability(orbit)
    assert (linear.unit, linear.verdict) == (2, "stable")  # along the flow and the energy


@pytest.mark.slow
def test_a_halo_orbit():
    # K. Howell, Celestial Mechanics 32 (1984) 53, table of the L1 family for mu = 0.04.
    mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
    scene = jaxdyn.ode(odes.restricted, [0.723, 0.0, 0.04, 0.0, 0.198, 0.0], 2.6, params=0.04)
    halo = orbits.find(scene, closing=orbits.reversal(mirror), hold=orbits.Section(2, 0.04))
    assert abs(float(halo.y0[0]) - 0.723268) < 1e-6
    assert abs(float(halo.y0[4]) - 0.198019) < 1e-6
    assert abs(halo.period / 2 - 1.300177) < 1e-6
    large = orbits.stability(halo).nontrivial[0].real
    assert abs(0.5 * (large + 1 / large) - 1181.69) < 0.5  # from a start of six digits
    assert halo.residual < SOLVED


@pytest.mark.slow
def test_normal_modes_of_a_double_pendulum_go_on_from_the_linear_ones():
    scene = scenes.double_pendulum()
    modes = orbits.discovery.seeds.modes(scene, jnp.zeros(4), amplitude=0.05)
    slow = max(modes, key=lambda guess: guess.period)
    orbit = orbits.find(scene, slow.y0, slow.period)
    family = orbits.continue_family(orbit, members=4, step=0.1)
    rest = float(energy.energy(scene, jnp.zeros(()), jnp.zeros(4)))
    assert (np.diff(family.energies) > 0).all() or (np.diff(family.energies) < 0).all()
    assert family.energies.max() - rest > 0.05
    assert max(member.orbit.residual for member in family.members) < SOLVED
