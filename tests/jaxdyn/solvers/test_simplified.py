"""Rates evaluated by their formulas, against the rates themselves."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import ZOO, gap

from benchmarks.classics import links
from jaxdyn import ode, solve
from jaxdyn.scenes import catalogue
from jaxdyn.solvers import NYSTROM12, VERNER9
from jaxdyn.solvers.formulas.formulas import simplify
from jaxdyn.solvers.method import operations

#: Composed scenes, whose rates shrink.
SHORTER = (
    *("cart_pendulum", "double_pendulum", "pendulum", "plate", "polar_particle", "turntable"),
    *("dumbbell", "one_skate", "satellite"),
)
ZERO = np.zeros(())


@pytest.mark.sample(*ZOO)
@pytest.mark.parametrize("name", catalogue.entries())
def test_every_rate_of_the_zoo_has_the_same_values(name):
    scene = catalogue.entries()[name].make()
    y = scene.y0 + 0.01 * np.random.default_rng(0).standard_normal(len(scene.y0))

    @jax.jit
    def both(scene, y):
        rate, project = scene.field.rate, scene.system.project
        near = project(ZERO, y)
        plain = rate(ZERO, near), near
        return plain, (simplify(rate)(ZERO, near), simplify(project)(ZERO, y))

    for plain, found in zip(*both(scene, y), strict=True):
        assert gap(found, plain) < 1e-12 * max(1.0, float(jnp.abs(plain).max()))


@pytest.mark.parametrize("name", SHORTER)
def test_rates_made_of_parts_shrink(name):
    scene = catalogue.entries()[name].make()
    rate = scene.field.rate
    assert operations(simplify(rate), ZERO, scene.y0) < 0.6 * operations(rate, ZERO, scene.y0)


def test_five_links_shrink_too():
    scene = links().scene
    rate = scene.field.rate
    assert operations(simplify(rate), ZERO, scene.y0) < 0.6 * operations(rate, ZERO, scene.y0)


def test_what_has_no_formulas_or_many_numbers_is_left_alone():
    def conditional(t, y):
        return jnp.where(y > 0.5, y, 2 * y)

    y = jnp.array([0.3, 0.7])
    assert gap(simplify(conditional)(ZERO, y), jnp.array([0.6, 0.7])) == 0
    bodies = catalogue.entries()["three_body"].make()
    rows = lambda t, y: y * 0.0 + 1.0 + y - y  # noqa: E731
    for rate, wide in ((rows, jnp.ones((2, 3))), (bodies.field.rate, bodies.y0)):
        found, plain = (str(jax.make_jaxpr(f)(ZERO, wide)) for f in (simplify(rate), rate))
        assert found.count(" mul ") == plain.count(" mul ")
    assert simplify(lambda t, y: jnp.zeros(2))(ZERO, y).dtype == float


def test_a_state_that_is_left_as_it_is_is_not_taken_apart():
    program = jax.make_jaxpr(simplify(lambda t, y: 0.5 * (y + y)))(ZERO, jnp.ones(5)).jaxpr
    assert program.outvars == program.invars[1:]


@pytest.mark.sample("<lambda>0", "<lambda>1", "<lambda>2", "<lambda>6")
@pytest.mark.parametrize(
    "bent",
    [
        lambda x: jnp.where(x[0] + x[0] > x[1], x[0] * x[1], x[1] / x[0]),
        lambda x: jnp.where(jnp.any(x > 0.5) & ~jnp.all(x > 0.5), jnp.tan(x[0]), x[1]),
        lambda x: jnp.max(jnp.abs(x - 0.3)) + jnp.min(x) - jnp.maximum(x[1], 2.0),
        lambda x: (
            jnp.arctan2(x[0], x[1]) + jnp.arcsin(x[0]) + jnp.expm1(x[1]) * jnp.floor(4 * x[1])
        ),
        lambda x: jnp.cbrt(x[0]) + jnp.sinh(x[1]) * jnp.arccosh(1.0 + x[0]) + x[0] % x[1],
        lambda x: x[0] ** x[1] + jnp.sum(jnp.diagonal(jnp.outer(x, x))) + jnp.sum(x[:0]),
        lambda x: jax.lax.cond(True, lambda: x[0] * x[1], lambda: jnp.where(x[0] > 1.0, 1.0, 0.0)),
    ],
)
def test_what_has_no_series_is_evaluated_as_it_stands(bent):
    def rate(t, y):
        return jnp.stack([bent(y), y[0] + y[0] - y[1]])

    for y in (jnp.array([0.3, 0.7]), jnp.array([0.6, 0.2]), jnp.array([0.3, 0.3])):
        for f in (lambda rate, y: rate(ZERO, y), jax.jacfwd(lambda rate, y: rate(ZERO, y), 1)):
            assert gap(f(simplify(rate), y), f(rate, y)) < 1e-14


def test_an_angle_of_level_points_is_pi_and_not_minus_pi():
    def rate(t, y):
        angle = jnp.arctan2(y[3] - y[1], y[2] - y[0])
        zeros = jnp.arctan2(jnp.array(0.0), y[0]) + 2 * jnp.arctan2(jnp.array(-0.0), y[0])
        return jnp.stack([angle, zeros, y[0] - y[2], y[0] * y[2]])

    y = jnp.array([-1.0, 0.0, -2.0, 0.0])
    assert gap(simplify(rate)(ZERO, y), jnp.array([np.pi, -np.pi, 1.0, 2.0])) < 1e-15


def _printing(t, y):
    jax.debug.print("y[0] = {}", y[0])
    return -y


def _drawing(t, y):
    return -y * jax.random.uniform(jax.random.key(3), y.shape)


def _long(t, y):
    def body(i, x):
        return jnp.where(x > 0.5, jnp.maximum(0.1, 0.99 * x), 1.01 * x) * jnp.cos(x + i)

    return jax.lax.fori_loop(0, 900, lambda i, x: jax.lax.fori_loop(0, 20, body, x), y)


@pytest.mark.sample("_drawing-random_bits", "_long-scan")
@pytest.mark.parametrize(
    ("rate", "kept"), [(_printing, "debug_"), (_drawing, "random_bits"), (_long, "scan")]
)
def test_programs_that_are_no_formulas_are_left_alone(rate, kept):
    y = jnp.array([0.3, 0.7])
    assert kept in str(jax.make_jaxpr(simplify(rate))(ZERO, y))
    assert np.isfinite(solve(ode(rate, y, 0.1), 0.1).y1).all()


@pytest.mark.parametrize("kept", ["own rule", "within checkpoint", "stopped"])
def test_derivatives_that_a_rate_comes_with_are_kept(kept):
    square = jax.custom_jvp(lambda x: x * x)
    square.defjvp(lambda x, dx: (x[0] * x[0], 7.0 * dx[0]))
    bent, slope = {
        "own rule": (square, 7.0),
        "within checkpoint": (jax.checkpoint(square), 7.0),
        "stopped": (lambda x: jax.lax.stop_gradient(x) * x, 0.3),
    }[kept]

    def rate(t, y):
        return jnp.stack([y[1] + bent(y[0]), y[1] - y[1]])

    found = jax.jacfwd(lambda y: simplify(rate)(ZERO, y))(jnp.array([0.3, 0.7]))
    assert gap(found, jnp.array([[slope, 1.0], [0.0, 0.0]])) == 0


@pytest.mark.parametrize("n", [6, 7, 8])
def test_a_long_sum_and_itself_are_twice_the_sum(n):
    # As in the reverse derivative of a square; with a constant it is longer than sums get.
    def rate(t, y):
        w = 1.0 + functools.reduce(jnp.add, [y[0] ** k for k in range(1, n + 1)])
        return jnp.stack([w + w, jax.grad(lambda x: 0.5 * (1.0 + x @ x) * (1.0 + x @ x))(y)[1]])

    y = jnp.array([0.3, 0.7])
    assert gap(simplify(rate)(ZERO, y), rate(ZERO, y)) < 1e-15 * n


def test_arrays_that_are_many_numbers_stay_arrays():
    weights = np.random.default_rng(0).standard_normal((24, 4))
    rate = lambda t, y: weights.T @ jnp.tanh(weights @ y)  # noqa: E731
    program = str(jax.make_jaxpr(simplify(rate))(ZERO, jnp.ones(4)))
    assert (program.count("tanh"), program.count("dot_general")) == (1, 2)


@pytest.mark.sample("pendulum", "polar_particle")
@pytest.mark.parametrize("name", SHORTER)
def test_their_derivatives_are_those_of_the_rate(name):
    scene = catalogue.entries()[name].make()

    @jax.jit
    def both(scene, y):
        return tuple(
            jax.jacfwd(lambda s, y, f=f: f(s.field.rate)(ZERO, y), argnums=(0, 1))(scene, y)
            for f in (lambda rate: rate, simplify)
        )

    y = scene.y0 + 0.01 * np.random.default_rng(0).standard_normal(len(scene.y0))
    plain, found = (jax.tree.leaves(x) for x in both(scene, y))
    for a, b in zip(plain, found, strict=True):
        assert gap(a, b) < 1e-11 * max(1.0, float(jnp.abs(a).max()))


@pytest.mark.slow
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
