"""No unit matters: what begins at a Hopf point, diagrams, their graphs, and what is one orbit."""

import jax.numpy as jnp
import numpy as np
import pytest
from odes import brusselator, pitchfork_of_cycles

import jaxdyn
import orbits
from orbits.discovery import seeds
from orbits.families.graph import Place, _same

#: Units of the entries of the state, of the parameter, and of time.
UNITS = [
    ([1e9, 1e9, 1e-9], 1e-6, 1e6),
    ([1e-9, 1e3, 1e12], 1e9, 1e-12),
    ([1e6, 1e-3, 1e-12], 1.0, 1e9),
]
ONE = ([1.0, 1.0, 1.0], 1.0, 1.0)
SLOW = [UNITS[0], *(pytest.param(x, marks=pytest.mark.slow) for x in UNITS[1:])]


def makes(rate, units, k):
    """The scene of each value of the parameter."""
    each, own, time = np.array(units[0][:k]), *units[1:]

    def scaled(t, y, numbers):
        value, each, time = numbers
        return each * jnp.stack(rate(t / time, y / each, value)) / time

    def make(p):
        return jaxdyn.ode(scaled, np.zeros(k), 6.0 * time, params=(p / own, each, time))

    return make


def feeding(t, y, b):
    return brusselator(t, y, (1.0, b))


@pytest.mark.slow
@pytest.mark.parametrize("units", SLOW)
def test_an_orbit_begins_at_a_hopf_point_in_the_same_phase(units):
    found = []
    for now in (ONE, units):
        each, own, _ = now
        start = np.array([1.0, 1.5]) * each[:2]
        equilibria = jaxdyn.continue_equilibria(
            makes(feeding, now, 2), 1.5 * own, start, step=0.3, within=(own, 3 * own)
        )
        orbit, value = orbits.from_hopf(equilibria, equilibria.special[0])
        found.append(np.append(np.asarray(orbit.y0) / each[:2], value / own))
    np.testing.assert_allclose(found[1], found[0], atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_a_diagram_and_its_graph(units):
    diagrams = []
    for now in (ONE, units):
        own = now[1]
        options = {"within": (-0.2 * own, 0.4 * own), "orbit_members": 14, "orbit_step": 0.1}
        make = makes(pitchfork_of_cycles, now, 3)
        diagrams.append(orbits.diagram(make, -0.1 * own, np.zeros(3), **options))
    here, there = diagrams
    assert [len(x.members) for x in there.orbits] == [len(x.members) for x in here.orbits]
    assert (there.depths, there.failures) == (here.depths, here.failures)
    for ours, theirs in zip(here.orbits, there.orbits, strict=True):
        np.testing.assert_allclose(theirs.parameters / units[1], ours.parameters, atol=1e-7)
        np.testing.assert_allclose(theirs.periods / units[2], ours.periods, rtol=1e-7)
    found = [orbits.graph(x).places for x in diagrams]
    for one, other in zip(*found, strict=True):
        assert (one.kind, one.families, one.times) == (other.kind, other.families, other.times)
    hopf, branch = found[1]
    assert branch.families == (0, 1, 2)
    assert hopf.equilibria == (0,)


def cycle(units, sign):
    make, each = makes(pitchfork_of_cycles, units, 3), np.array(units[0])
    start = each * np.array([np.sqrt(0.3), 0.0, sign * np.sqrt(0.1)])
    return orbits.find(make(0.3 * units[1]), start, 2 * np.pi * units[2])


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_cycles_that_differ_in_an_entry_of_another_unit_are_two(units):
    up, down = cycle(units, 1.0), cycle(units, -1.0)
    assert not orbits.same_orbit(up, down)
    turned = np.roll(np.asarray(up.y0)[:2] / np.array(units[0])[:2], 1) * [1.0, -1.0]
    start = np.append(turned * np.array(units[0])[:2], up.y0[2])
    again = orbits.find(up.scene, start, up.period)
    assert orbits.same_orbit(up, again)
    assert not orbits.same_orbit(down, again)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_rests_are_one_place_where_they_are_near_in_their_sizes(unit):
    def place(x):
        scene = jaxdyn.ode(lambda t, y: [y[1], -y[0]], [x * unit, 0.0], 6.0)
        orbit = orbits.Orbit(scene, orbits.PLAIN, 0.0, orbits.Outcome.FOUND, 0, 1e-13)
        none = np.array([unit, unit, unit])
        return Place("Hopf point", orbit, 0.3 * unit, np.nan, (), (), units=none)

    assert _same(place(1.0), place(1.0001))
    assert not _same(place(1.0), place(1.01))


def in_well(t, y, numbers):
    """Two coupled oscillators, an equilibrium at (1, 2)."""
    each, time = numbers
    a, b, u, v = y / each
    x, z = a - 1, b - 2
    rates = jnp.stack([u, v, -4 * x - x**3 - 0.3 * z, -9 * z - 0.3 * x])
    return each * rates / time


def linear(t, y, numbers):
    """The same near 0 without a force that bends: no size follows from it."""
    each, time = numbers
    x, z, u, v = y / each
    return each * jnp.stack([u, v, -4 * x - 0.3 * z, -9 * z - 0.3 * x]) / time


@pytest.mark.parametrize("scales", [[1e9, 1e-6, 1e3, 1e12], [1e-12, 1.0, 1e6, 1e-3]])
def test_seeds_of_a_linear_scene_at_0(scales):
    found = []
    for each, time in ((np.ones(4), 1.0), (np.array(scales), 1e-6)):
        scene = jaxdyn.ode(linear, np.zeros(4), time, params=(each, time))
        several = seeds.modes(scene, np.zeros(4), 1.0)
        found.append([np.append(s.y0 / each, s.period / time) for s in several])
    for one, other in zip(*found, strict=True):
        assert one[-1] == pytest.approx(other[-1], rel=1e-12)
        # In the unit of another entry, but of the same one.
        ratio = other[:-1] / np.abs(other[:-1]).max()
        np.testing.assert_allclose(one[:-1] / np.abs(one[:-1]).max(), ratio, atol=1e-10)


@pytest.mark.parametrize("scales", [[1e9, 1e-6, 1e3, 1e12], [1e-12, 1.0, 1e6, 1e-3]])
def test_seeds_of_small_oscillations(scales):
    found = []
    for each, time in ((np.ones(4), 1.0), (np.array(scales), 1e-6)):
        rest = each * np.array([1.0, 2.0, 0.0, 0.0])
        scene = jaxdyn.ode(in_well, rest, time, params=(each, time))
        seeds_here = [s for i in (0, 1) for s in [seeds.modes(scene, rest, 0.1 * each[2 + i])[i]]]
        found.append([np.append((s.y0 - rest) / each, s.period / time) for s in seeds_here])
    np.testing.assert_allclose(found[1], found[0], atol=1e-10)
