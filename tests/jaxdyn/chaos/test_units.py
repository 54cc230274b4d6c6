"""No unit matters: exponents and indicators of chaos are the same in all units."""

import dataclasses

import numpy as np
import pytest
from units import in_units

import jaxdyn
from jaxdyn import chaos, scenes

#: Units of the entries, and of time.
UNITS = [([1e-12, 1e12, 1e-6], 1e-12), ([3e11, 2e-7, 1e12], 1e6)]
#: Rounding in another program, which these motions amplify.
SAME = 1e-6


def damped(t, y):
    """An oscillator with a hardening spring beside what it moves."""
    return [y[1], -y[0] - y[0] ** 3 - 0.1 * y[1], y[0] * y[1] - 0.5 * y[2]]


SCENE = jaxdyn.ode(damped, [1.0, 0.2, 0.5], 12.0)


@pytest.mark.slow
@pytest.mark.parametrize(("each", "time"), UNITS)
def test_exponents(each, time):
    plain = chaos.lyapunov_exponents(SCENE, transient=2.0, chunk=0.5)
    new, _, _ = in_units(SCENE, each, time)
    found = chaos.lyapunov_exponents(new, transient=2.0 * time, chunk=0.5 * time)
    np.testing.assert_allclose(found.exponents * time, plain.exponents, atol=SAME)
    np.testing.assert_allclose(found.bars * time, plain.bars, atol=SAME)
    assert abs(int(found.steps) - int(plain.steps)) <= 2


@pytest.mark.slow
@pytest.mark.parametrize(("each", "time"), UNITS)
def test_indicators(each, time):
    new, _, _ = in_units(SCENE, each, time)
    for plain, found in ((chaos.megno(SCENE), chaos.megno(new)),):
        for name, unit in (("megno", 1.0), ("mean", 1.0), ("exponent", 1 / time)):
            known = float(getattr(plain, name))
            assert float(getattr(found, name)) / unit == pytest.approx(known, abs=SAME)
    for index in (chaos.sali, lambda scene: chaos.gali(scene, count=3)):
        plain, found = index(SCENE), index(new)
        assert float(found.index) == pytest.approx(float(plain.index), rel=1e-4)
        assert float(found.time) / time == pytest.approx(float(plain.time))


def test_indicators_are_printed_in_the_unit_of_time_of_the_scene():
    moon = chaos.megno(scenes.restricted_three_body_in_space(system="earth-moon"))
    assert float(moon.time) == pytest.approx(2.75 * 27.851 / (2 * np.pi), rel=1e-4)  # a month
    assert f"exponent  {float(moon.exponent):.6g} 1/day\n" in repr(moon)
    assert f"time      {float(moon.time):.6g} day\n" in repr(moon)
    assert f"mean      {float(moon.mean):.6g}\n" in repr(moon)


def test_exponents_are_printed_in_the_unit_of_time_of_the_scene():
    found = chaos.lyapunov_exponents(scenes.oscillator(c=0.5), 100.0)
    assert " 1/s\n  exponent 2" in repr(found)
    assert "  divergence  -0.5 1/s\n" in repr(found)  # -c / m
    assert repr(found).count(" s, in chunks of ") == 1
    assert "unit" not in repr(found)
    assert "1/" not in repr(dataclasses.replace(found, time_unit=""))
