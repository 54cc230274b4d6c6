"""The hard cases that measure themselves, and what they compare themselves with."""

import math

import mpmath
import pytest
from helpers import EXACT

from jaxdyn.hard import CASES, judge
from jaxdyn.hard.bodies import flip_period

#: Cases that compile little; the others are run with `-m slow`.
QUICK = ("failing-lanes", "norms-at-zero", "zeno")
LONG = sorted(set(CASES) - set(QUICK))


def _holds(name):
    verdict = judge(CASES[name])
    assert verdict.figures
    for figure in verdict.figures:
        assert figure.passed, figure


@pytest.mark.parametrize("name", QUICK)
def test_a_quick_case_holds(name):
    _holds(name)


@pytest.mark.slow
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
