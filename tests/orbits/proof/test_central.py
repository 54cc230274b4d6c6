"""Orbits about a centre of force: their theorems away from the centre, against Kepler's law."""

import dataclasses
import functools

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import orbits
from jaxdyn.ball_arithmetic.arithmetic import arb
from jaxdyn.ball_arithmetic.field import ball_field, scene_formulas
from jaxdyn.effects import PowerLaw
from orbits.proof.posing import equations_of
from orbits.proof.theorems import Theorems, missing
from orbits.targets import loops


@functools.cache
def _ellipse():
    return loops.closed(PowerLaw(1.0, -2.0), 1, 1)


@functools.cache
def _rosette():
    return loops.closed(PowerLaw(1.0, -1.0), 2, 3)


def test_ellipses_need_the_laplace_vector_and_rosettes_do_not():
    ellipse, rosette = map(equations_of, (_ellipse(), _rosette()))
    assert (missing(ellipse), missing(rosette)) == ("", "")
    # Three of the four are independent: Laplace's vector has a length by the other two.
    assert len(ellipse.integrals) == 3
    assert any("Laplace" in name for name in ellipse.integrals)
    assert sorted(rosette.integrals) == ["angular momentum", "energy"]


def test_nothing_is_proved_where_the_centre_is_not_excluded():
    formulas, _ = scene_formulas(_ellipse().scene)
    field = ball_field(formulas)
    assert field.cases
    known = Theorems.of(formulas, field)
    turn, still = np.kron(np.eye(2), [[0, -1], [1, 0]]), np.zeros(4)
    assert known.is_generator(turn, still)
    assert known.is_symmetry(np.diag([1, -1, 1, -1]), 1)
    assert not known.is_symmetry(np.diag([1, -1, 1, 1]), 1)
    # A shift moves the centre, where the formulas have another case.
    assert not known.is_generator(np.zeros((4, 4)), np.array([1.0, 0, 0, 0]))
    assert "eq" in missing(_without_tubes())


def _without_tubes():
    system = equations_of(_rosette())
    formulas, _ = scene_formulas(_ellipse().scene)
    return dataclasses.replace(system, formulas=formulas)


def test_formulas_have_the_values_of_the_force():
    scene = _rosette().scene
    field = ball_field(scene_formulas(scene)[0])
    y = [0.3, -0.7, 0.2, 0.4]
    found = [float(x) for x in field.rate(arb(0), [arb(x) for x in y])]
    assert np.allclose(found, scene.rate(0.0, jnp.array(y)), rtol=1e-15)


@pytest.mark.slow
def test_an_ellipse_is_proved_with_the_period_of_keplers_law():
    orbit = _ellipse()
    proof = orbits.prove(orbit)
    assert proof.proved
    start = dict(proof.held)
    with mpmath.workdps(50):
        size = 1 / (2 / mpmath.mpf(start["x"]) - mpmath.mpf(start["vy"]) ** 2)
        exact = 2 * mpmath.pi * size ** mpmath.mpf(1.5)
        gap = abs(mpmath.mpf(proof.period.mid) - exact)
        assert gap <= mpmath.mpf(proof.period.rad) < mpmath.mpf(10) ** -24
    digits = orbits.refine(orbit, 40)
    with mpmath.workdps(60):
        assert abs(mpmath.mpf(digits.period) - exact) < mpmath.mpf(10) ** -39 * exact


@pytest.mark.long
def test_a_rosette_is_proved():
    proof = orbits.prove(_rosette())
    assert (proof.proved, proof.verdict) == (True, "stable")
    assert abs(float(proof.period.mid) - _rosette().period) < 1e-9
