"""Halo orbits of Earth and Moon in space: where the families begin, and one that is published."""

import math

import numpy as np
import pytest
from odes import jacobi, restricted

import jaxdyn
import orbits
from jaxdyn import scenes
from orbits import Kind

#: Share of the Moon as in JPL's catalogue of periodic orbits of three bodies
#: (ssd.jpl.nasa.gov/tools/periodic_orbits.html), and the largest Jacobi constants and periods of
#: its halo orbits there, where they leave the plane: of L1 and of L2.
MU = 0.01215058560962404
CATALOGUE = ((0, 3.174, 2.743), (1, 3.152, 3.415))
#: The orbit in which the Gateway is to fly, in 9:2 resonance with the months, as begun in studies
#: of it, for the mass ratio 1 / (1 + 81.30059); its stability index is given as 1.32, its least and
#: largest distances from the Moon as 3249 km and 71222 km at 384400 km between Earth and Moon.
GATEWAY_MU, GATEWAY_PERIOD = 1 / 82.30059, 1.5111111111111111
GATEWAY = (1.0220215127358174, 0.0, -0.1820967615242405, 0.0, -0.10325634106279382, 0.0)


def energy(t, y, mu):
    return -0.5 * jacobi(t, y, mu)


def lyapunov(point: int):
    """A small planar orbit about a libration point."""
    x = float(scenes.libration_points(MU)[point, 0])
    plane = scenes.restricted_three_body(mu=MU).starting([x, 0.0, 0.0, 0.0])
    values, vectors = np.linalg.eig(jaxdyn.linearize(plane, plane.y0).jacobian)
    turning = int(np.argmax(values.imag))
    vy = (vectors[3, turning] / vectors[0, turning]).real
    size = -0.003
    start = [x + size, 0.0, 0.0, 0.0, size * vy, 0.0]
    period = 2 * math.pi / values[turning].imag
    return orbits.find(jaxdyn.ode(restricted, start, period, params=MU, energy=energy), hold="y0")


@pytest.mark.slow
@pytest.mark.parametrize(("point", "constant", "period"), CATALOGUE)
def test_halo_orbits_leave_the_plane_where_the_catalogue_says(point, constant, period):
    family = orbits.continue_family(lyapunov(point), members=14, step=0.05)
    halo = next(m for m in family.special if m.kind == Kind.BRANCH)
    assert abs(-2 * halo.energy - constant) < 5e-4
    assert abs(halo.orbit.period - period) < 5e-4 + 1e-3 * point  # the last member, not the limit
    assert abs(halo.stability.nontrivial - 1).min() < 1e-6
    other, _ = orbits.switch_branch(family, halo, amplitude=0.02)
    assert np.abs(np.asarray(other.y0)[[2, 5]]).max() > 1e-3


@pytest.mark.slow
def test_axial_orbits_branch_off_by_plain_closing_alone():
    scene = scenes.restricted_three_body_in_space(mu=MU, x=0.786, z=0.0, vy=0.43, t1=3.9)
    mirror = orbits.closing.mirror(scene)
    symmetric = orbits.find(scene, closing=mirror, hold="x")
    found = {}
    for closing in (mirror, orbits.PLAIN):
        orbit = orbits.find(symmetric.scene, closing=closing, hold="x")
        family = orbits.continue_family(orbit, members=5, step=0.1)
        found[closing.name] = family, next(m for m in family.special if m.kind == Kind.BRANCH)
    (mirrored, special), (plain, same) = found.values()
    np.testing.assert_allclose(same.orbit.period, special.orbit.period, rtol=1e-10)
    with pytest.raises(orbits.SearchError, match=r"lack the symmetry .* again with plain closing"):
        orbits.switch_branch(mirrored, special)
    axial, _ = orbits.switch_branch(plain, same, amplitude=0.05)
    motion = np.asarray(jaxdyn.simulate(axial.scene, samples=201).ys)
    assert np.abs(motion[:, 2]).max() > 1e-3
    # It crosses the xz plane on the x axis, at right angles to it.
    crossings = jaxdyn.crossings(axial.scene, jaxdyn.integrate.events.Reaches(1)).ys
    np.testing.assert_allclose(crossings[:, [2, 3]], 0.0, atol=1e-9)


@pytest.mark.slow
def test_the_orbit_of_the_gateway():
    mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
    scene = jaxdyn.ode(restricted, GATEWAY, GATEWAY_PERIOD, params=GATEWAY_MU, energy=energy)
    held = orbits.Period(GATEWAY_PERIOD)
    orbit = orbits.find(scene, closing=orbits.reversal(mirror), hold=held)
    np.testing.assert_allclose(orbit.y0, GATEWAY, rtol=0, atol=4e-16)
    indices = [0.5 * abs(z + 1 / z) for z in orbits.stability(orbit).nontrivial]
    assert round(max(indices), 2) == 1.32
    motion = jaxdyn.simulate(orbit.scene, samples=2001, rtol=1e-12)
    r = 384400 * np.linalg.norm(
        np.asarray(motion.ys)[:, :3] - np.array([1 - GATEWAY_MU, 0, 0]), axis=1
    )
    assert abs(r.min() - 3249) < 2
    assert abs(r.max() - 71222) < 5


@pytest.mark.long
def test_northern_and_southern_halo_orbits_join_the_planar_family_at_one_place():
    family = orbits.continue_family(lyapunov(0), members=10, step=0.05)
    halo = next(m for m in family.special if m.kind == Kind.BRANCH)
    starts = [orbits.switch_branch(family, halo, amplitude=side)[0] for side in (0.02, -0.02)]
    north, south = (orbits.continue_family(start, members=5, step=0.05) for start in starts)
    found = orbits.graph([family, north, south])
    (place,) = found.places
    assert (place.families, place.times) == ((0, 1, 2), (1, 1, 1))
    assert found.components == [(0, 1, 2)]
    mirror = np.array([1, 1, -1, 1, 1, -1])
    for one, two in zip(north.members, south.members, strict=True):
        np.testing.assert_allclose(two.orbit.y0, mirror * np.asarray(one.orbit.y0), atol=1e-9)
