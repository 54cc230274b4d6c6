"""Rates evaluated by their formulas, against the rates themselves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import gap

from jaxdyn import ode, solve
from jaxdyn.scenes import catalogue
from jaxdyn.solvers import NYSTROM12, VERNER9
from jaxdyn.solvers.formulas.simplified import simplified
from jaxdyn.solvers.method import operations

#: Composed scenes, whose rates shrink.
SHORTER = ("cart_pendulum", "double_pendulum", "pendulum", "plate", "polar_particle", "turntable")
ZERO = np.zeros(())


@pytest.mark.parametrize("name", catalogue.entries())
def test_every_rate_of_the_zoo_has_the_same_values(name):
    scene = catalogue.entries()[name].make()
    y = scene.y0 + 0.01 * np.random.default_rng(0).standard_normal(len(scene.y0))

    @jax.jit
    def both(scene, y):
        return scene.field.rate(ZERO, y), simplified(scene.field.rate)(ZERO, y)

    plain, found = both(scene, scene.system.project(ZERO, y))
    assert gap(found, plain) < 1e-12 * max(1.0, float(jnp.abs(plain).max()))


@pytest.mark.parametrize("name", SHORTER)
def test_rates_made_of_parts_shrink(name):
    scene = catalogue.entries()[name].make()
    rate = scene.field.rate
    assert operations(simplified(rate), ZERO, scene.y0) < 0.6 * operations(rate, ZERO, scene.y0)


def test_what_has_no_formulas_or_many_numbers_is_left_alone():
    def conditional(t, y):
        return jnp.where(y > 0.5, y, 2 * y)

    y = jnp.array([0.3, 0.7])
    assert gap(simplified(conditional)(ZERO, y), jnp.array([0.6, 0.7])) == 0
    for wide in (jnp.ones((2, 3)), jnp.arange(12.0)):
        rate = lambda t, y: y * 0.0 + 1.0 + y - y  # noqa: E731
        assert operations(simplified(rate), ZERO, wide) == operations(rate, ZERO, wide)
    assert simplified(lambda t, y: jnp.zeros(2))(ZERO, y).dtype == float


def test_rules_of_derivatives_that_a_rate_comes_with_are_kept():
    def rate(t, y):
        return jnp.stack([y[1], 0 * y[0]]) + jnp.stack([_square(y[0]), y[1] - y[1]])

    _square = jax.custom_jvp(lambda x: x * x)
    _square.defjvp(lambda x, dx: (x[0] * x[0], 7.0 * dx[0]))
    y = jnp.array([0.3, 0.7])
    slope = jax.jacfwd(lambda y: simplified(rate)(ZERO, y))(y)
    assert gap(slope, jnp.array([[7.0, 1.0], [0.0, 0.0]])) == 0


@pytest.mark.parametrize("name", SHORTER)
def test_their_derivatives_are_those_of_the_rate(name):
    scene = catalogue.entries()[name].make()

    @jax.jit
    def both(scene, y):
        return tuple(
            jax.jacfwd(lambda s, y, f=f: f(s.field.rate)(ZERO, y), argnums=(0, 1))(scene, y)
            for f in (lambda rate: rate, simplified)
        )

    y = scene.y0 + 0.01 * np.random.default_rng(0).standard_normal(len(scene.y0))
    plain, found = (jax.tree.leaves(x) for x in both(scene, y))
    for a, b in zip(plain, found, strict=True):
        assert gap(a, b) < 1e-11 * max(1.0, float(jnp.abs(a).max()))


def test_pairs_and_their_derivatives_agree_with_closed_forms():
    def rate(t, y, p):
        return jnp.stack([y[1] + 0 * jnp.sin(y[0]), -p * p * y[0] + y[0] - y[0]])

    def end(p, solver):
        scene = ode(rate, [1.0, 0.0], 2.0, params=p, second_order=True)
        return solve(scene, 2.0, solver=solver, rtol=1e-12).y1

    for solver in (VERNER9, NYSTROM12):
        assert gap(end(1.5, solver), jnp.array([np.cos(3.0), -1.5 * np.sin(3.0)])) < 1e-11
        slope = jax.jacfwd(end)(1.5, solver)
        exact = jnp.array([-2 * np.sin(3.0), -np.sin(3.0) - 3 * np.cos(3.0)])
        assert gap(slope, exact) < 1e-10
