"""No unit matters: tori are the same in all units of the entries of a state and of time."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from orbits.tori.torus import floquet_vector

#: Units of the entries, of time, and of the energy.
UNITS = [
    ([1e6, 1e6, 1e12, 1e12], 1e-6, 1e9),
    ([1e-9, 1e3, 1e-3, 1e-12], 1e12, 1e-12),
    ([1e9, 1e9, 1e3, 1e3], 1e6, 1.0),
]
ONE = (np.ones(4), 1.0, 1.0)
SAME = 1e-8


def henon_heiles(t, y):
    return [y[2], y[3], -y[0] - 2 * y[0] * y[1], -y[1] - y[0] ** 2 + y[1] ** 2]


def level(y):
    return (y @ y) / 2 + y[0] ** 2 * y[1] - y[1] ** 3 / 3


def upright(t, y):
    """A pendulum upright on a base that is shaken."""
    return [y[1], jnp.sin(y[0]) * (1 - 60 * jnp.cos(20 * t))]


def scaled(rate):
    def found(t, y, units):
        each, time, _ = units
        return each * jnp.stack(rate(t / time, y / each)) / time

    return found


def energy(t, y, units):
    return units[2] * level(y / units[0])


def found_in(units, orbit, plain, amplitude, **options):
    """The torus that has this amplitude in the first units."""
    each = np.asarray(units[0])
    nu, w = floquet_vector(plain, 0)
    again, _ = floquet_vector(orbit, 0)
    assert abs(again - nu) < SAME
    return orbits.torus(orbit, amplitude * float(np.linalg.norm(each * w)), **options)


def assert_alike(there, here, units, same=SAME):
    each, time, joule = units
    assert (there.outcome, there.held) == (here.outcome, here.held)
    assert there.points.shape == here.points.shape
    turned = there.at(phase(there) - phase(here) + 2 * np.pi * np.arange(7) / 7)
    np.testing.assert_allclose(turned / each, here.at(2 * np.pi * np.arange(7) / 7), atol=same)
    assert abs(there.rotation - here.rotation) < same
    assert abs(there.time / time - here.time) < same
    assert abs(there.energy / joule - here.energy) < same or np.isnan(here.energy)


def phase(torus):
    """The angle of the first harmonic's first entry, which tells circles apart that are shifted."""
    return -float(np.angle(orbits.tori.circle.harmonic(torus.points)[0]))


def conservative(units):
    each, time, _ = units
    speed = np.sqrt(2 * 0.1 - 0.3**2 + 2 * 0.3**3 / 3)
    start = np.array([0.0, 0.3, speed, 0.0]) * each
    new = jaxdyn.ode(scaled(henon_heiles), start, 6.0 * time, params=units, energy=energy)
    return orbits.find(new, hold=orbits.Energy(0.1 * units[2]))


@pytest.mark.slow
@pytest.mark.parametrize(
    "units", [UNITS[0], *(pytest.param(x, marks=pytest.mark.slow) for x in UNITS[1:])]
)
def test_tori_of_one_energy(units):
    units = (np.array(units[0]), *units[1:])
    plain, orbit = conservative(ONE), conservative(units)
    here, there = found_in(ONE, plain, plain, 0.05), found_in(units, orbit, plain, 0.05)
    assert_alike(there, here, units)
    ours, theirs = (orbits.continue_tori(x, members=3) for x in (here, there))
    assert theirs.end == ours.end
    for one, other in zip(theirs.members, ours.members, strict=True):
        assert_alike(one, other, units)


def driven(units):
    each, time = np.asarray(units[0][:2]), units[1]
    new = jaxdyn.ode(scaled(upright), [0.0, 0.0], np.pi / 10 * time, params=(each, time, 1.0))
    return orbits.find(new)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_driven_tori(units):
    each = np.array(units[0][:2])
    units = (each, *units[1:])
    ones = (np.ones(2), 1.0, 1.0)
    plain, orbit = driven(ones), driven(units)
    here, there = found_in(ones, plain, plain, 0.3), found_in(units, orbit, plain, 0.3)
    assert_alike(there, here, units)
    coarse = found_in(units, orbit, plain, 0.3, max_modes=6, goal=1e-15, throw=False)
    assert coarse.outcome.name == "NOT_SMOOTH"
