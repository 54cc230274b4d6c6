"""The hard cases that measure themselves, and what they compare themselves with."""

import math

import mpmath
import pytest
from helpers import EXACT

from jaxdyn.hard import CASES, judge
from jaxdyn.hard.cases.bodies import flip_period
from jaxdyn.hard.cases.shaken import averaged_limit, swing_period
from jaxdyn.hard.elliptic import complete

# Their numbers go to the edge of rounding, which is that of the programs that users run.
pytestmark = pytest.mark.usefixtures("optimised")
#: Cases that compile little; the others are run with `-m long`, or by `jaxdyn hard`.
QUICK = (
    "apsidal-angle",
    "failing-lanes",
    "grazing",
    "norms-at-zero",
    "zeno",
)
LONG = sorted(set(CASES) - set(QUICK))


def _holds(name):
    verdict = judge(CASES[name])
    assert verdict.figures
    for figure in verdict.figures:
        assert figure.passed, figure


@pytest.mark.sample("failing-lanes")
@pytest.mark.parametrize("name", QUICK)
def test_a_quick_case_holds(name):
    _holds(name)


@pytest.mark.long
@pytest.mark.parametrize("name", LONG)
def test_a_long_case_holds(name):
    _holds(name)


@pytest.mark.parametrize("wobble", [0.1, 0.01, 1e-6])
def test_the_period_of_the_flips_is_that_of_elliptic_functions(wobble):
    with mpmath.workdps(40):
        w2 = mpmath.mpf(wobble) ** 2
        h2, t2 = w2 + 4, w2 + 2
        k2 = (h2 - t2) / (3 * t2 - h2)
        rate = mpmath.sqrt((3 * t2 - h2) / 6)
        period = 4 * mpmath.ellipk(k2) / rate
    assert math.isclose(flip_period(wobble), float(period), rel_tol=EXACT)


@pytest.mark.parametrize("beside", [1.0, 1e-2, 1e-8])
def test_the_fall_from_beside_upright_takes_an_elliptic_integral(beside):
    with mpmath.workdps(40):
        wanted = mpmath.ellipk(mpmath.cos(mpmath.mpf(beside) / 2) ** 2)
    assert math.isclose(complete(math.sin(beside / 2)), float(wanted), rel_tol=EXACT)


@pytest.mark.parametrize("angle", [0.01, 0.3, 0.6])
def test_the_averaged_swing_has_the_period_of_its_energy(angle):
    g, length, frequency = 9.81, 1.0, 1e4
    speed = 1.5 * float(averaged_limit(frequency, uniform=False)) * frequency
    with mpmath.workdps(30):

        def energy(theta):
            pull = (mpmath.mpf(speed) * mpmath.sin(theta) / (2 * length)) ** 2
            return g / length * mpmath.cos(theta) + pull

        def slow(u):  # theta = angle sin(u)
            left = energy(mpmath.mpf(angle)) - energy(angle * mpmath.sin(u))
            return angle * mpmath.cos(u) / mpmath.sqrt(2 * left)

        period = 4 * mpmath.quad(slow, [0, mpmath.pi / 2], method="gauss-legendre")
    assert math.isclose(swing_period(speed, angle), float(period), rel_tol=EXACT)
