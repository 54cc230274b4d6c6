"""Estimates of errors after up to a thousand periods, where motions are known in closed form."""

import pytest
from calibrated import assert_calibrated, calibration, quotient
from closed_forms import long_spans

from jaxdyn import accuracy, simulate

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("optimised")]

LONG = long_spans()


def test_estimates_are_errors():
    assert_calibrated(calibration(accuracy.estimate, LONG, (1e-9, 1e-12, 1e-14, 1e-15)))


@pytest.mark.filterwarnings("ignore:12 digits were requested")
@pytest.mark.parametrize("name", LONG)
def test_digits_are_claimed_as_they_are(name):
    case = LONG[name]
    motion = simulate(case.scene, case.t1, samples=case.samples, digits=12, throw=False)
    assert 0.1 < quotient(case, motion.error)
    assert motion.error.digits >= 12 or "12 digits were requested" in motion.warning
