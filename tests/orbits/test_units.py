"""The same problems in other units of length, time and mass: the same answers, scaled.

Numbers of the units are traced, so that the problems of one kind share their programs.
"""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import Scene, scenes
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints

#: Units of the two entries of a state, and of time.
UNITS = [((1.0, 1.0), 1.0), ((1e-12, 3e8), 7e-15), ((2e12, 1e-9), 1e12), ((5e6, 4e-3), 1e-3)]
#: Units of length, time and mass.
MECHANICAL = [(1.0, 1.0, 1.0), (1e-12, 1e-12, 1e-12), (1.496e11, 5e6, 1.989e30), (1e12, 1.0, 1e-6)]
SOLVED = 1e-11


def in_units(rate):
    """A rate of a state and a parameter, in units that are parameters too."""

    def scaled(t, y, p):
        each, time, value = p
        return each * jnp.stack(rate(t / time, y / each, value)) / time

    return scaled


def made(rate, start, period, units, value=0.0):
    """The scene of a rate in some units."""
    each, time = units
    params = (np.array(each), time, value)
    return jaxdyn.ode(rate, np.array(start) * each, period * time, params=params)


@in_units
def van_der_pol(t, y, mu):
    return [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]


@in_units
def duffing(t, y, p):
    return [y[1], -y[0] - y[0] ** 3]


@in_units
def bautin(t, y, p):
    """r' = r (p + r^2 - r^4), angle' = 1: a Hopf point at p = 0, a fold of cycles at p = -1/4."""
    square = y @ y
    out = p + square - square**2
    return [out * y[0] - y[1], out * y[1] + y[0]]


@in_units
def saddle(t, y, p):
    x = y[0] - 1  # the saddle is not at 0, which has no size
    return [y[1], x - x**3]


@pytest.mark.parametrize("units", UNITS)
def test_a_cycle_is_found_with_its_multiplier(units):
    scene = made(van_der_pol, [2.1, 0.3], 6.2, units, 1.0)
    orbit = orbits.find(scene)
    plain = orbits.find(made(van_der_pol, [2.1, 0.3], 6.2, UNITS[0], 1.0))
    # How many steps a search takes where only rounding is left, up to a residual of 0, is chance.
    assert abs(orbit.iterations - plain.iterations) <= 3
    assert abs(orbit.period / units[1] / plain.period - 1) < SOLVED
    assert np.abs(np.asarray(orbit.y0) / units[0] - np.asarray(plain.y0)).max() < SOLVED
    linear, known = orbits.stability(orbit), orbits.stability(plain)
    assert (linear.verdict, linear.reasons) == (known.verdict, known.reasons)
    assert np.abs(linear.nontrivial - known.nontrivial).max() < 1e-11
    assert orbits.recheck(orbit).closure < SOLVED
    assert min(orbits.digits(orbit).y0, orbits.digits(orbit).period) > 11


@pytest.mark.parametrize("units", UNITS)
def test_what_is_held_stays_and_unit_multipliers_are_no_instability(units):
    scene = made(duffing, [1.0, 0.0], 4.9, units)
    orbit = orbits.find(scene, hold="y0")
    assert float(orbit.y0[0]) == units[0][0]
    assert abs(orbit.period / units[1] - 4.768022029102461) < SOLVED
    linear = orbits.stability(orbit)
    assert linear.verdict != "unstable"
    assert np.abs(linear.multipliers - 1).max() < 1e-6


def suns(length, time, mass):
    """The printed figure-eight of three bodies, in other units."""
    y0 = np.array(scenes.EIGHT) * np.repeat([length, length / time], 6)
    strength = length**3 / (mass * time**2)
    bodies = FreePoints(np.full(3, mass), d=2)
    return Scene(bodies, (PairGravity(strength),), y0=y0, t1=scenes.EIGHT_PERIOD * time)


@pytest.mark.slow
@pytest.mark.parametrize("units", MECHANICAL)
def test_the_eight_is_the_eight(units):
    time = units[1]
    orbit = orbits.find(suns(*units), closing=orbits.choreography(3))
    what = orbits.identify(orbit)
    assert what.choreography
    assert abs(what.scale_free - 9.2376812507) < 1e-9
    linear = orbits.stability(orbit)
    assert (linear.verdict, linear.unit, linear.integrals) == ("stable", 8, 4)
    assert orbits.recheck(orbit).closure < SOLVED
    assert orbits.analysis.closure(orbit) < SOLVED
    plain = orbits.find(suns(1.0, 1.0, 1.0), closing=orbits.choreography(3))
    assert orbits.same_orbit(orbit, plain)
    assert abs(orbit.period / time / plain.period - 1) < 1e-9


def makes(units, value):
    """The scene of each value of the parameter, whose unit is `value`."""

    def make(p):
        each, time = units
        params = (np.array(each), time, p / value)
        return jaxdyn.ode(bautin, np.array(each), 6.3 * time, params=params)

    return make


@pytest.mark.sample("units3-None")
@pytest.mark.parametrize("amplitude", [None, 0.05])
@pytest.mark.parametrize("units", UNITS)
def test_a_family_from_a_hopf_point_has_its_fold(units, amplitude):
    value = 3e7 if units[1] < 1 else 1.0
    make, each = makes(units, value), np.array(units[0])
    equilibria = jaxdyn.continue_equilibria(
        make, 0.3 * value, [0.0, 0.0], step=0.3, members=8, down=True
    )
    (point,) = equilibria.special
    assert abs(point.parameter / value) < 1e-12
    # In the unit of the second entry, which is displaced most relative to its size.
    amplitude = None if amplitude is None else amplitude * each[1]
    orbit, p = orbits.from_hopf(equilibria, point, amplitude=amplitude)
    radius = float(np.linalg.norm(np.asarray(orbit.y0) / each))
    assert abs(p / value - (radius**4 - radius**2)) < 1e-9
    if amplitude is None:
        assert 0.001 < radius < 0.1
        return
    family = orbits.continue_family(orbit, make, p, step=0.4, members=16, down=True)
    assert len(family.members) == 16
    fold = next(x for x in family.special if x.kind == orbits.Kind.FOLD)
    assert abs(fold.parameter / value + 0.25) < 1e-9
    verdicts = [member.stability.verdict for member in family.members]
    assert verdicts[0] == "unstable"
    assert verdicts[-1] == "stable"


@pytest.mark.parametrize("units", UNITS)
def test_a_manifold_leaves_its_equilibrium_alike(units):
    each, time = np.array(units[0]), units[1]
    found = orbits.manifold(made(saddle, [1.0, 0.0], 1.0, units), "unstable", time=9.0 * time)
    assert found.linear_error <= 1e-8
    assert found.ok.all()
    # On the homoclinic loop, whose energy is that of the saddle.
    x, v = np.moveaxis(found.samples / each, -1, 0)
    assert np.abs(v**2 - (x - 1) ** 2 + (x - 1) ** 4 / 2).max() < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_a_manifold_of_an_orbit_is_the_same(units):
    each, time = np.array(units[0]), units[1]
    # An unstable cycle: its manifold is the plane, and the strand goes to the stable one.
    scene = made(bautin, [0.46, 0.0], 2 * np.pi, units, -0.16)
    orbit = orbits.find(scene, hold="y1")
    assert orbits.stability(orbit).verdict == "unstable"
    found = orbits.manifold(orbit, "unstable", strands=2, time=80.0 * time)
    radii = np.linalg.norm(found.ends / each, axis=1)
    inner = 0.5 - np.sqrt(0.25 - 0.16)  # the squares of both radii
    assert abs(np.linalg.norm(np.asarray(orbit.y0) / each) ** 2 - inner) < SOLVED
    assert (np.minimum(np.abs(radii**2 - (1 - inner)), radii) < 1e-3).all()


def test_the_vibration_of_a_molecule_in_si():
    depth, width, rest, mass = 7.6e-19, 1.94e10, 0.74e-10, 8.37e-28  # Morse's potential of H2

    def rate(t, y):
        e = jnp.exp(-width * (y[0] - rest))
        return [y[1], -2 * depth * width * (1 - e) * e / mass]

    orbit = orbits.find(jaxdyn.ode(rate, [9e-11, 0.0], 8.5e-15), hold="y0")
    level = (1 - np.exp(-width * (9e-11 - rest))) ** 2
    exact = 2 * np.pi / (width * np.sqrt(2 * depth / mass)) / np.sqrt(1 - level)
    assert abs(orbit.period / exact - 1) < SOLVED
    assert float(orbit.y0[0]) == 9e-11
    assert orbits.recheck(orbit).closure < SOLVED


@pytest.mark.sample("1.001")
@pytest.mark.parametrize("off", [0.99, 1.001, 1.01])
def test_earth_and_moon_in_si_from_a_rough_period(off):
    strength, earth, moon, distance = 6.6743e-11, 5.972e24, 7.342e22, 3.844e8
    total = earth + moon
    turn = np.sqrt(strength * total / distance**3)
    x = np.array([-distance * moon / total, 0.0, distance * earth / total, 0.0])
    v = turn * np.array([0.0, x[0], 0.0, x[2]])
    bodies = FreePoints(np.array([earth, moon]), d=2)
    scene = Scene(bodies, (PairGravity(strength),), y0=np.append(x, v), t1=off * 2 * np.pi / turn)
    orbit = orbits.find(scene)
    assert abs(orbit.period * turn / (2 * np.pi) - 1) < SOLVED
    assert orbit.shift < 1.0  # metres
    assert orbits.recheck(orbit).closure < SOLVED
    assert "unstable" != orbits.stability(orbit).verdict
