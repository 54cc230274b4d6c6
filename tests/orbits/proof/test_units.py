"""No unit matters: digits and proofs are the same in all units.

Units are powers of 2, so that all numbers of a scene stand for the same motion exactly.
"""

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import jaxdyn
import orbits
from orbits.proof import checking

UNITS = [([2.0**40, 2.0**-30], 2.0**50), ([2.0**-50, 2.0**20], 2.0**-40)]
PICO = ([1.0, 1.0], 2.0**-40)  # about picoseconds
SLOW = [UNITS[0], pytest.param(UNITS[1], marks=pytest.mark.slow)]
ONE = ([1.0, 1.0], 1.0)
DIGITS = 30


def van_der_pol(y):
    return [y[1], (1 - y[0] ** 2) * y[1] - y[0]]


def duffing(y):
    return [y[1], -y[0] - y[0] ** 3]


def brusselator(y):
    return [1 + y[0] ** 2 * y[1] - 4 * y[0], 3 * y[0] - y[0] ** 2 * y[1]]


def level(t, y, numbers):
    each, _ = numbers
    x, v = y[0] / each[0], y[1] / each[1]
    return (2 * v**2 + 2 * x**2 + x**4) / 4


def orbit_of(rate, units, start, period, **options):
    each, time = np.array(units[0]), units[1]

    def scaled(t, y, numbers):
        each, time = numbers
        return each * jnp.stack(rate(y / each)) / time

    energy = level if rate is duffing else None
    new = jaxdyn.ode(
        scaled, np.array(start) * each, period * time, params=(each, time), energy=energy
    )
    return orbits.find(new, **options)


@pytest.mark.parametrize("units", SLOW)
def test_a_cycle_without_an_integral(units):
    of = van_der_pol, [2.00861986087484, 0.0], 6.66328685932
    plain, orbit = orbit_of(*of[:1], ONE, *of[1:]), orbit_of(*of[:1], units, *of[1:])
    here, there = (orbits.refine(x, DIGITS) for x in (plain, orbit))
    assert (there.digits, there.held) == (here.digits, here.held)
    with mpmath.workdps(DIGITS + 10):
        scaled = mpmath.mpf(there.period) / mpmath.mpf(units[1])
        assert abs(scaled - mpmath.mpf(here.period)) < mpmath.mpf(10) ** (2 - DIGITS)
        known = "6.6632868593231301896996820305"
        assert abs(scaled - mpmath.mpf(known)) < 1e-16
    ours, theirs = orbits.prove(plain), orbits.prove(orbit)
    assert ours.proved
    assert theirs.proved
    assert (theirs.verdict, theirs.verdict_proved) == (ours.verdict, ours.verdict_proved)
    assert float(theirs.radius) == float(ours.radius)
    assert checking.certificate_mismatch(orbit, theirs.as_json()) == ""
    assert checking.refined_mismatch(orbit, there.as_json()) == ""


@pytest.mark.slow
def test_a_cycle_in_picoseconds():
    # Coefficients of its series grow by 1e12 each: the radius of convergence has to follow.
    of = brusselator, [3.24037263990900873, 1.864318195868502], 7.15691992117988
    ours, theirs = (orbits.prove(orbit_of(of[0], units, *of[1:])) for units in (ONE, PICO))
    assert ours.proved
    assert theirs.proved
    with mpmath.workdps(DIGITS + 10):
        one, pico = (mpmath.mpf(x.period.mid) for x in (ours, theirs))
        assert abs(pico / mpmath.mpf(PICO[1]) - one) < 1e-25


@pytest.mark.parametrize("units", SLOW)
def test_a_swing_whose_equations_depend_on_each_other_by_the_energy(units):
    of = duffing, [1.0, 0.0], 4.768
    plain, orbit = (orbit_of(duffing, u, *of[1:], hold="y0") for u in (ONE, units))
    ours, theirs = orbits.prove(plain), orbits.prove(orbit)
    assert ours.proved
    assert theirs.proved
    assert theirs.held[0][0] == ours.held[0][0]
    assert "conserves: energy" in theirs.reason
    wrong = orbits.refine(orbit, DIGITS).as_json()
    # A change by 1e-20 of the size of an entry, whatever its unit.
    with mpmath.workdps(DIGITS + 10):
        moved = mpmath.mpf(wrong["y0"][0]) * (1 + mpmath.mpf("1e-20"))
        wrong["y0"] = [mpmath.nstr(moved, DIGITS), *wrong["y0"][1:]]
    assert checking.refined_mismatch(orbit, wrong) == "y0"


@pytest.mark.slow
def test_records_of_earlier_versions_have_no_units():
    plain = orbit_of(van_der_pol, ONE, [2.00861986087484, 0.0], 6.66328685932)
    record = orbits.prove(plain).as_json()
    earlier = {name: x for name, x in record.items() if name != "units"}
    assert checking.certificate_mismatch(plain, earlier) == ""
    with pytest.raises(ValueError, match="units: expected 2 positive numbers"):
        checking.certificate_mismatch(plain, {**record, "units": [1.0, 0.0]})
