"""Orbits to many digits, against closed forms and published digits."""

import dataclasses
import functools
from typing import Any

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.ball_arithmetic.arithmetic import arb, arb_mat, precision
from jaxdyn.ball_arithmetic.motion import bits_of
from orbits.proof import refinement
from orbits.proof.refined import Refined

DIGITS = 60


def _agree(text: str, exact: Any, digits: int) -> bool:
    return abs(mpmath.mpf(text) - exact) < abs(exact) * mpmath.mpf(10) ** (1 - digits)


@functools.cache
def _swing():
    return orbits.find(scenes.pendulum(angle=2.0), period=2.7, hold="theta")


def test_the_swing_of_a_pendulum_has_the_digits_of_the_elliptic_integral():
    found = orbits.refine(_swing(), DIGITS)
    with mpmath.workdps(DIGITS + 20):
        k = mpmath.sin(mpmath.mpf(1)) ** 2
        exact = 4 * mpmath.ellipk(k) / mpmath.sqrt(mpmath.mpf(9.81))
        assert _agree(found.period, exact, DIGITS)
    assert found.held == ("theta", "theta_dot")
    assert found.digits == DIGITS


def _viswanathan():
    # Viswanathan 2004, Physica D 190, 115: the orbit AB of the Lorenz system, 8/3 being a float
    # here, so that only the digits that beta has can agree.
    y0 = [-13.763610682134, -19.578751942452, 27.0]
    return orbits.find(scenes.lorenz(y0=y0, t1=1.5586522107162), hold="z")


@pytest.mark.slow
def test_an_orbit_of_lorenz_has_the_published_digits():
    found = orbits.refine(_viswanathan(), 40)
    assert found.period.startswith("1.558652210716")
    assert found.digits == 40


def test_a_cycle_is_refined_without_an_integral():
    field = jaxdyn.ode(lambda t, y: [y[1], (1 - y[0] ** 2) * y[1] - y[0]], [2.0, 0.0], 6.66)
    cycle = orbits.find(field, period=6.66)
    found = orbits.refine(cycle, 40)
    # The period of van der Pol's oscillator at mu = 1 (Andersen, Geer 1982, SIAM J. Appl. Math.).
    assert found.period.startswith("6.66328685")
    with mpmath.workdps(60):
        (real, imaginary) = found.multipliers[0]
        assert mpmath.mpf(imaginary) == 0
        assert abs(mpmath.mpf(real) - float(orbits.stability(cycle).nontrivial[0].real)) < 1e-9


def test_more_digits_decide_what_doubles_leave_open():
    # Loosely integrated, as a long orbit is at best, it may have its multiplier 1.0035 at 1.
    scene = scenes.henon_heiles().starting([0.0, 0.0, 0.4, 0.0])
    orbit = orbits.find(scene, period=6.3)
    loose, tight = orbits.stability(orbit, rtol=1e-3), orbits.stability(orbit)
    assert loose.verdict == "undecided"
    assert "orbits.refine(orbit, 30).stability()" in loose.message
    assert loose.message in " ".join(str(loose).split())
    found = orbits.refine(orbit, 20).stability()
    assert (found.verdict, found.unit) == (tight.verdict, tight.unit) == ("unstable", 2)
    assert (found.bars < tight.bars).all()
    assert (np.abs(found.nontrivial - tight.nontrivial) < tight.bars).all()
    assert found.message == tight.message == jaxdyn.Status.OK.message


def test_a_multiplier_that_is_one_besides_those_that_must_be_decides_nothing():
    # To all digits a circle about the sun has four multipliers 1, two of them by chance.
    circle = orbits.find(scenes.power_law(n=-2.0, speed=1.0), period=6.28, hold=["x", "vy"])
    linear = orbits.stability(circle)
    assert (linear.verdict, len(linear.nontrivial)) == ("undecided", 2)
    assert "to all digits" in linear.message
    assert "orbits.refine(orbit, 60).stability()" in linear.message
    # `refine` counts them as those that must be 1.
    blank = {"period": "", "y0": (), "held": (), "residual": "0"}
    found = Refined(orbit=circle, digits=30, multipliers=(), exponents=(), **blank)
    assert found.stability().verdict == "undecided"


def test_multipliers_that_only_come_near_are_told_apart_by_more_digits():
    # As of I.A^ic_47 in the tables of Li and Liao, two of whose multipliers are exp(+-1.4e-14 i).
    angles = 1.3, 1.4e-14
    with precision(bits_of(68)):
        blocks = [[[1, 1], [0, 1]]]
        blocks += [[[arb(a).cos(), -arb(a).sin()], [arb(a).sin(), arb(a).cos()]] for a in angles]
        rows = np.full((6, 6), 0, object)
        for n, block in enumerate(blocks):
            rows[2 * n : 2 * n + 2, 2 * n : 2 * n + 2] = block
        near = arb_mat(rows.tolist())
        assert len(refinement._multipliers(near, 30)[0]) == 2
        values, exponents = refinement._multipliers(near, 60)
    found = [complex(*map(float, z)) for z in values]
    np.testing.assert_allclose(np.angle(found), [*angles, *np.negative(angles)[::-1]], rtol=1e-12)
    np.testing.assert_allclose([float(x) for x in exponents], np.array(angles) / (2 * np.pi))
    assert len(values[0][1]) > 60  # digits, those that both lose beside each other are not shown
    assert len(values[1][0]) < 60 - 14
    values, exponents = values[1:3], exponents[1:]
    circle = orbits.find(scenes.power_law(n=-2.0, speed=1.0), period=6.28, hold=["x", "vy"])
    blank = {"period": "", "y0": (), "held": (), "residual": "0"}
    found = Refined(orbit=circle, digits=60, multipliers=values, exponents=exponents, **blank)
    assert found.stability().verdict == "stable"
    # Nearer than doubles tell apart.
    same = dataclasses.replace(found, multipliers=(("1", "0"), ("1", "0"))).stability()
    assert same.verdict == "undecided"
    assert not np.isfinite(same.bars).any()


@pytest.mark.parametrize("digits", [14, 1001, 20.5])
def test_digits_out_of_range_are_refused(digits):
    with pytest.raises(ValueError, match="digits"):
        orbits.refine(_swing(), digits)


def test_a_rate_without_formulas_is_refused_by_name():
    scene = jaxdyn.ode(lambda t, y: [y[1], -y[0] - jnp.floor(y[1]) * 0.0], [1.0, 0.0], 6.28)
    orbit = dataclasses.replace(_swing(), scene=scene)
    with pytest.raises(ValueError, match="floor"):
        orbits.refine(orbit)
