"""Taylor series: recurrences against mpmath, motions against pairs and closed forms."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import formulas_of, gap, kepler
from jax import lax

from jaxdyn import ensemble, ode, scenes, simulate
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Scene
from jaxdyn.solvers import (
    DOPRI8,
    TAYLOR12,
    TAYLOR14,
    TAYLOR16,
    TAYLOR20,
    VERNER9,
    Taylor,
    has_series,
)
from jaxdyn.solvers.choice import reason
from jaxdyn.solvers.formulas.formulas import products, topological_order
from jaxdyn.solvers.formulas.graph import NotElementary
from jaxdyn.solvers.taylor.terms import _CAUTION, solution
from jaxdyn.status import Status

ORDER = 12
#: dy/dt = f(t): f with jnp and the same with mpmath; all are smooth at AT.
AT = 0.6
FUNCTIONS = {
    "polynomial": (lambda t: 2.0 - t + 3 * t**2 - t**5, lambda t: 2 - t + 3 * t**2 - t**5),
    "negative power": (lambda t: t**-3, lambda t: t**-3),
    "high power": (lambda t: lax.integer_pow(t, 11), lambda t: t**11),
    "real power": (lambda t: (1 + t) ** 1.7, lambda t: (1 + t) ** mpmath.mpf(1.7)),
    "quotient": (lambda t: (1 + t) / (2 + t * t), lambda t: (1 + t) / (2 + t * t)),
    "root": (lambda t: jnp.sqrt(1 + t * t), lambda t: mpmath.sqrt(1 + t * t)),
    "inverse root": (lambda t: lax.rsqrt(1 + t), lambda t: 1 / mpmath.sqrt(1 + t)),
    "inverse cube": (
        lambda t: 1 / ((1 + t * t) * jnp.sqrt(1 + t * t)),
        lambda t: (1 + t * t) ** mpmath.mpf(-1.5),
    ),
    "inverse seventh": (
        lambda t: 2.0 / (jnp.sqrt(1 + t * t) * (1 + t * t) ** 3),
        lambda t: 2 * (1 + t * t) ** mpmath.mpf(-3.5),
    ),
    "two roots": (
        lambda t: 1 / (jnp.sqrt(1 + t) * jnp.sqrt(2 + t)),
        lambda t: 1 / (mpmath.sqrt(1 + t) * mpmath.sqrt(2 + t)),
    ),
    "exponential": (lambda t: jnp.exp(-t * t), lambda t: mpmath.exp(-t * t)),
    "logarithm": (lambda t: jnp.log(1 + t * t), lambda t: mpmath.log(1 + t * t)),
    "sine": (lambda t: jnp.sin(t * t), lambda t: mpmath.sin(t * t)),
    "cosine": (lambda t: jnp.cos(3 * t), lambda t: mpmath.cos(3 * t)),
    "both": (lambda t: jnp.sin(t) * jnp.cos(t) ** 2, lambda t: mpmath.sin(t) * mpmath.cos(t) ** 2),
    "hyperbolic tangent": (lambda t: jnp.tanh(2 * t), lambda t: mpmath.tanh(2 * t)),
    "square": (lambda t: jnp.square(jnp.sin(t)), lambda t: mpmath.sin(t) ** 2),
}


def series(rate, t, y, order=ORDER) -> np.ndarray:
    found = formulas_of(rate, jnp.asarray(t), jnp.asarray(y))
    found = solution(found, topological_order(found.graph, found.rates), order, jnp.ones(()))
    return np.array([[0.0 if x is None else float(x) for x in row] for row in found])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_coefficients_of_a_function_of_time_are_those_of_its_series(name):
    ours, theirs = FUNCTIONS[name]
    with mpmath.workdps(40):
        exact = [float(x) for x in mpmath.taylor(theirs, mpmath.mpf(AT), ORDER - 1)]
    found = series(lambda t, y: ours(t)[None], AT, [0.0])[0, 1:] * np.arange(1, ORDER + 1)
    assert np.abs(found - exact).max() <= 1e-13 * np.abs(exact).max()


def test_coefficients_of_solutions_are_known_ones():
    # tan t, its numbers; exp t; 1 / (1 - t).
    tangent = [0, 1, 0, 1 / 3, 0, 2 / 15, 0, 17 / 315, 0, 62 / 2835, 0, 1382 / 155925, 0]
    assert series(lambda t, y: 1 + y * y, 0.0, [0.0])[0] == pytest.approx(tangent, abs=1e-16)
    factorials = 1 / np.cumprod([1, *range(1, ORDER + 1)])
    assert series(lambda t, y: y, 0.0, [1.0])[0] == pytest.approx(factorials, rel=1e-15)
    assert series(lambda t, y: y * y, 0.0, [1.0])[0] == pytest.approx(np.ones(ORDER + 1))


MATRIX = np.arange(12.0).reshape(3, 4) / 7


def _matrix(t, y):
    x = jnp.stack([y, jnp.sin(y), y * y])  # (3, 4)
    both = jnp.einsum("ij,kj->ik", MATRIX, x)  # (3, 3)
    batch = jnp.einsum("bij,bjk->bik", jnp.stack([both, both.T]), jnp.ones((2, 3, 2)))
    return jnp.sum(batch, axis=(1, 2))[jnp.array([0, 1, 1, 0])]


def _moved(t, y):
    padded = jnp.pad(y, (1, 2), constant_values=t)
    turned = jnp.roll(padded, 2)[::-1].reshape(7, 1).T[0]
    put = lax.dynamic_update_slice(turned, jnp.array([3.0]), (jnp.array(2),))
    return lax.dynamic_slice(put, (jnp.array(1),), (4,)) + jnp.split(padded, [4])[0]


def _written(t, y):
    known = jnp.zeros((4, 2)).at[:, 0].set(y * t).at[jnp.array([2, 1]), 1].set(y[:2])
    beyond = y.at[9].set(3.0)  # changes nothing
    added = known.at[jnp.array([0, 3, 0])].add(jnp.stack([y[:2], y[2:], beyond[1:3]]))
    return added.sum(axis=1) + jax.grad(lambda y: jnp.prod(y[jnp.array([0, 2])]))(y)


def _looped(t, y):
    def body(carry, x):
        return carry * x + y, carry[0]

    last, seen = lax.scan(body, y, jnp.array([0.5, -1.0, 2.0]), reverse=True)
    return last + jnp.sum(seen)


def _chosen(t, y):
    steady = jnp.where(jnp.array([True, False, True, False]), y, 2 * y)
    return jnp.where(y == 0, 1.0, steady) * (y != 7.0).astype(float)


def _nothing_twice(t, y):
    # Equal terms, factors of 0, 1 and -1, quotients of steady numbers, a call, long sums.
    called = jax.jit(lambda x: x - 2 * x)(y)
    long = sum((k + 1.0) * jnp.roll(y, k) ** (k % 3) for k in range(12))
    return 0.0 * y + 3 * y - y / 2 + called * 1.0 - (-y) + 0.0 / 3.0 + long - long * 0.5


def _truths(t, y):
    zero, known = y == 0, jnp.array([True, False, True, False])
    mixed = jnp.concatenate([zero[:2], known[2:]]).astype(float)
    return jnp.where((y != 0.2) & known, y, 2 * y) * jnp.where(~zero | known, y, 1.0) + mixed


def _empty(t, y):
    # Sums of nothing, a loop of no rounds, a loop of numbers that are known.
    products = jnp.outer(y, y[:0])
    last, seen = lax.scan(lambda c, x: (c * x, c), y, jnp.zeros(0))
    known = lax.fori_loop(0, 2000, lambda i, x: x + 0.5 * i, 0.0)
    return products.sum(axis=1) + products.sum() + last + seen.sum(axis=0) + known * y


def _edges(t, y):
    cut = lax.pad(y[:3], 2.0 * t, ((-1, 0, 1),))
    far = lax.dynamic_slice(jnp.concatenate([y, y * y]), (jnp.array(7),), (4,))
    return cut + far + y.at[jnp.array([0, 9, -1, 2])].get(mode="clip")


@pytest.mark.sample("_written", "_looped", "_empty")
@pytest.mark.parametrize(
    "rate", [_matrix, _moved, _written, _looped, _chosen, _nothing_twice, _truths, _empty, _edges]
)
def test_arrays_taken_apart_have_the_same_rate_and_its_derivative(rate):
    t, y = jnp.asarray(0.3), jnp.array([0.2, -0.5, 0.7, 1.1])
    found = series(rate, t, y, order=4)
    f, df = jax.jvp(rate, (t, y), (jnp.ones(()), rate(t, y)))
    assert found[:, 1] == pytest.approx(np.asarray(f), rel=1e-13, abs=1e-14)
    assert 2 * found[:, 2] == pytest.approx(np.asarray(df), rel=1e-12, abs=1e-13)


def test_differences_keep_their_digits():
    # (y - 1)^2 is exact here; written out, all but four digits of it are rounding.
    def rate(t, y):
        x = y - 1.0
        return x / (x[0] * x[0] + x[1] * x[1]) ** 1.5

    t, y = jnp.asarray(0.3), jnp.array([1 + 1e-6, 1 - 2e-7])
    f, df = jax.jvp(rate, (t, y), (jnp.ones(()), rate(t, y)))
    found = series(rate, t, y, order=2)
    assert found[:, 1] == pytest.approx(np.asarray(f), rel=1e-13)
    assert 2 * found[:, 2] == pytest.approx(np.asarray(df), rel=1e-12)


@pytest.mark.parametrize("n", [2, 9, 17])
def test_whole_powers_have_their_series_at_zero(n):
    found = series(lambda t, y: lax.integer_pow(t[None], n), 0.0, [0.0], order=20)[0]
    assert found == pytest.approx(np.eye(21)[n + 1] / (n + 1), abs=1e-16)


@jax.jit
def _driven_by_a_whole_number(n, truth):
    found = formulas_of(
        lambda t, y: y * n.astype(float) + truth.astype(float), jnp.zeros(()), jnp.ones(1)
    )
    return solution(found, topological_order(found.graph, found.rates), 2, jnp.ones(()))[0]


def test_whole_numbers_and_truths_known_at_run_time_are_numbers_too():
    found = _driven_by_a_whole_number(jnp.array(3), jnp.array(True))
    assert [float(x) for x in found] == [1.0, 4.0, 6.0]


def _error_and_estimate(rate, h, y):
    """The error of a step of order 12, by 32 short ones of order 20, and its estimate."""
    zero, h, y = jnp.zeros(()), jnp.asarray(h), jnp.asarray(y)
    increment, found = TAYLOR12.advance(rate, zero, h, y)[:2]
    end = y
    for i in range(32):
        end = end + TAYLOR20.advance(rate, i * h / 32, h / 32, end).increment
    return float(jnp.abs(y + increment - end).max()), float(jnp.abs(found).max())


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (3, 7))])
def test_terms_that_symmetry_makes_vanish_do_not_hide_the_error(n):
    # With n = 7 neither x nor v has a term of order 11 or 12 about x = 0.
    error, found = _error_and_estimate(lambda t, y: jnp.stack([y[1], -(y[0] ** n)]), 0.3, [0.0, 1])
    assert error < 2 * found < _CAUTION * 1e-8


@pytest.mark.slow
def test_the_estimate_is_the_last_term_with_caution():
    # v = x' of the lemniscate sine x(t) = sl(k t) / k with k^4 = 1/2: its last term below t^13.
    _, found = _error_and_estimate(lambda t, y: jnp.stack([y[1], -(y[0] ** 3)]), 0.3, [0.0, 1])
    np.testing.assert_allclose(found, _CAUTION * 13 * 11 / 15600 / 8 * 0.3**12, rtol=0.01)


@pytest.mark.slow
def test_a_step_is_as_long_as_its_terms_allow():
    def spherical(t, y):  # it swings past the pole, where steps have to be ten times as short
        theta, _, u, w = y
        sine, cosine = jnp.sin(theta), jnp.cos(theta)
        return jnp.stack([u, w, w * w * sine * cosine - sine, -2 * u * w * cosine / sine])

    pendulum = ode(spherical, [1.0, 0.0, 0.0, 0.1], 20.0)
    runs = [solve(pendulum, 20.0, rtol=rtol, solver=TAYLOR14) for rtol in (1e-6, 1e-9, 1e-12)]
    assert [int(run.rejected) for run in runs] == [0, 0, 0]
    exact = solve(pendulum, 20.0, rtol=1e-14, solver=VERNER9).y1
    errors = [gap(run.y1, exact) for run in runs]
    assert errors[0] > 1e-9
    assert errors[1] < 1e-7
    assert errors[2] < 1e-10


@pytest.mark.sample("-100000.0")
@pytest.mark.parametrize("t1", [1e5, -1e5])
def test_the_times_of_shortened_steps_are_exact(t1):
    # Half a spacing of the time at each of 30 000 steps would add up to 1e-9.
    tick = ode(lambda t, y: jnp.cos(t)[None], [0.0], t1)
    found = solve(tick, t1, rtol=1e-9, solver=TAYLOR14)
    assert int(found.steps) > 10_000
    assert int(found.rejected) <= 1  # the first: at t = 0 the cosine does not change
    finer = solve(tick, t1, rtol=1e-13, solver=TAYLOR20)
    assert abs(float(finer.y1[0]) - np.sin(t1)) < 1e-13


@pytest.mark.parametrize("h", [1.0, 3.0, 30.0])
def test_a_shortened_step_is_that_step(h):
    # Only every eighth term of x is not zero: up to order 12 the last one is that of order 9.
    y, tolerance = jnp.array([0.0, 1.0]), jnp.array([1e-6, 1e-6])
    rate, zero = lambda t, y: jnp.stack([y[1], -(y[0] ** 7)]), jnp.zeros(())
    short = TAYLOR12.advance_within(rate, zero, jnp.asarray(h), y, tolerance)
    assert 0 < short.part < 1
    there = TAYLOR12.advance(rate, zero, short.part * h, y)
    assert gap(short.increment, there.increment) < 1e-14
    relative = there.error / (tolerance[1] + tolerance[0] * jnp.abs(y))
    np.testing.assert_allclose(short.square, jnp.mean(relative**2), rtol=1e-9)


def test_a_start_where_all_terms_vanish_is_left_by_short_steps():
    # No term of t^25 up to order 20 differs from 0: no limit of the step could be read off them.
    found = solve(ode(lambda t, y: (t**25)[None], [0.0], 2.0), 2.0, rtol=1e-12, solver=TAYLOR20)
    assert abs(float(found.y1[0]) / (2.0**26 / 26) - 1) < 1e-11


@pytest.mark.slow
def test_samples_and_ends_are_reached_by_shortened_steps():
    orbit = kepler(0.7)
    ts = jnp.linspace(0.0, float(orbit.t1), 40)
    there, pair = (
        solve(orbit, orbit.t1, ts=ts, solver=solver, rtol=1e-12) for solver in (TAYLOR14, VERNER9)
    )
    assert gap(there.ys, pair.ys) < 1e-10
    back = solve(orbit.starting(there.y1), -orbit.t1, solver=TAYLOR14, rtol=1e-12)
    assert gap(back.y1, orbit.y0) < 1e-9
    nothing = solve(orbit, 0.0, solver=TAYLOR14)
    assert gap(nothing.y1, orbit.y0) == 0


@pytest.mark.slow
def test_a_case_of_known_numbers_is_no_part_of_the_series():
    error, found = _error_and_estimate(lambda t, y: jnp.where(y == 0, 1.0, 2.0), 1.0, [0.0])
    assert error > 0.9
    assert found > 0.4


def test_equal_formulas_are_computed_once():
    def rate(t, y):
        c, s = jnp.cos(y[0]), jnp.sin(y[0])
        return jnp.stack([2.0 * c * s, s * c * 3.0 + 0.0 * y[1] ** 3])

    found = formulas_of(rate, jnp.zeros(()), jnp.ones(2))
    assert products(topological_order(found.graph, found.rates)) == 3  # cosine, sine, their product


def _r2(y):
    return y[0] * y[0] + y[1] * y[1]


INVERSE_CUBES = {
    "root": lambda y: y / (_r2(y) * jnp.sqrt(_r2(y))),
    "weight": lambda y: (1.0 / (_r2(y) * jnp.sqrt(_r2(y)))) * y,
    "cube": lambda y: y / jnp.sqrt(_r2(y)) ** 3,
    "power": lambda y: y / _r2(y) ** 1.5,
    "negative power": lambda y: y * _r2(y) ** -1.5,
    "inverse root": lambda y: y * (1.0 / jnp.sqrt(_r2(y))) ** 3,
}


@pytest.mark.parametrize("name", INVERSE_CUBES)
def test_an_inverse_cube_of_a_distance_is_one_power(name):
    rate, y = lambda t, y: 3.0 * INVERSE_CUBES[name](y), jnp.array([0.6, 0.8])
    found = formulas_of(rate, jnp.zeros(()), y)
    ops = [node.op for node in topological_order(found.graph, found.rates)]
    assert ops.count("pow") == 1
    assert {"sqrt", "div"}.isdisjoint(ops)
    by_logarithm = lambda t, y: 3.0 * y * jnp.exp(-1.5 * jnp.log(_r2(y)))  # noqa: E731
    zero = jnp.zeros(())
    assert series(rate, zero, y) == pytest.approx(series(by_logarithm, zero, y))
    scene = ode(lambda t, y: jnp.concatenate([y[2:], -rate(t, y[:2])]), [1, 0, 0, 1], 1.0)
    assert "root" not in reason(scene)  # infinite at 0, as the rate is: no case of its own


def test_a_difference_and_its_opposite_are_one_formula():
    def rate(t, y):
        a, b = y
        there, back = a - 2 * b, 2 * b - a
        return jnp.stack([jnp.sin(there) + there**2, jnp.sin(back) * jnp.cos(back) + back * back])

    y = np.array([0.3, 0.7])
    found = formulas_of(rate, jnp.zeros(()), jnp.asarray(y))
    ops = [node.op for node in topological_order(found.graph, found.rates)]
    assert (ops.count("sin"), ops.count("cos"), ops.count("product")) == (1, 1, 2)
    x = y[0] - 2 * y[1]
    exact = np.array([np.sin(x) + x * x, -np.sin(x) * np.cos(x) + x * x])
    assert series(rate, 0.0, y, order=1)[:, 1] == pytest.approx(exact, rel=1e-14)


def test_products_that_only_the_way_to_a_formula_had_are_not_taken_for_there():
    # u^2 sin(b - a): the squares' and the angles' products, and two of these.
    def rate(t, y):
        a, b, u = y
        turned = (u * jnp.sin(b)) * (u * jnp.cos(a)) - (u * jnp.cos(b)) * (u * jnp.sin(a))
        return jnp.stack([u, u, turned])

    y = np.array([0.3, 0.8, 1.5])
    found = formulas_of(rate, jnp.zeros(()), jnp.asarray(y))
    ops = [node.op for node in topological_order(found.graph, found.rates)]
    assert ops.count("product") == 5
    exact = y[2] ** 2 * np.sin(y[1] - y[0])
    assert series(rate, 0.0, y, order=1)[2, 1] == pytest.approx(exact, rel=1e-14)


def test_products_that_cancel_and_squares_that_sum_to_one_are_gone():
    def rate(t, y):
        a, u = y
        c, s = jnp.cos(a), jnp.sin(a)
        same = (u * c) * (u * s) - (u * u) * (s * c)
        return jnp.stack([same + u, s * (u * u * c + 0.5) - c * (u * u * s) + 3 * (c * c + s * s)])

    found = formulas_of(rate, jnp.zeros(()), jnp.ones(2))
    assert [node.op for node in topological_order(found.graph, found.rates)].count("product") == 0
    exact = np.array([1.0, 3.0 + 0.5 * np.sin(1.0)])
    assert series(rate, 0.0, np.ones(2), order=1)[:, 1] == pytest.approx(exact)


KEPT = {
    "oscillator": lambda: scenes.oscillator(),
    "pendulum": lambda: scenes.pendulum(angle=2.0),
    "double pendulum": lambda: scenes.double_pendulum(angles=(0.8, 0.5)),
    "rigid body": lambda: scenes.free_body((0.3, 1.0, 0.2)),
    "three bodies": lambda: scenes.three_body(),
    "drag": lambda: scenes.cannonball(drag=0.01, speed=100.0),
    "Lorenz": lambda: scenes.lorenz(),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", KEPT)
@pytest.mark.parametrize("back", [False, True])
def test_motions_are_those_of_a_pair(name, back):
    scene = KEPT[name]()
    # Backwards, drag and the Lorenz flow blow up.
    t1 = (-0.05 if name in ("drag", "Lorenz") else -1.5) if back else 1.5
    pair = solve(scene, t1, rtol=1e-14, solver=VERNER9)
    found = solve(scene, t1, ts=np.array([t1 / 3, t1 / 2]), rtol=1e-14, solver=TAYLOR16)
    middle = solve(scene, t1, ts=np.array([t1 / 3, t1 / 2]), rtol=1e-14, solver=DOPRI8)
    size = np.abs(np.asarray(pair.y1)).max()
    assert np.abs(found.y1 - pair.y1).max() <= 2e-12 * size
    assert np.abs(found.ys - middle.ys).max() <= 2e-12 * size


@pytest.mark.slow
def test_tolerance_is_kept_and_an_order_pays():
    scene = scenes.oscillator(t1=20.0)
    end = solve(scene, 20.0, rtol=1e-14, solver=VERNER9).y1
    steps = {}
    for method in (TAYLOR12, TAYLOR16):
        for rtol in (1e-6, 1e-9, 1e-12):
            found = solve(scene, 20.0, rtol=rtol, solver=method)
            steps[method, rtol] = int(found.steps)
            assert np.abs(found.y1 - end).max() <= 20 * rtol
    assert steps[TAYLOR16, 1e-12] < 0.7 * steps[TAYLOR12, 1e-12]


def test_from_rest_with_quadratic_drag_the_guard_of_the_root_is_no_part_of_the_series():
    # v = sqrt(g / c) tanh(sqrt(c g) t): the series from v = 0 knows nothing of drag.
    c, g = 0.3, 9.81
    scene = scenes.cannonball(speed=0.0, drag=c, g=g)
    found = solve(scene, 1.0, rtol=1e-12, solver=TAYLOR12)
    assert float(found.y1[3]) == pytest.approx(-np.sqrt(g / c) * np.tanh(np.sqrt(c * g)), rel=1e-10)


@pytest.mark.slow
def test_derivatives_are_those_of_the_variational_equations():
    scene = scenes.pendulum(angle=1.0)

    def end(y0, solver):
        return solve(scene.starting(y0), 2.0, rtol=1e-12, solver=solver).y1[0]

    found = jax.grad(lambda y: end(y, TAYLOR12))(scene.y0)
    other = jax.grad(lambda y: end(y, VERNER9))(scene.y0)
    assert np.abs(found - other).max() <= 1e-10
    many = jnp.stack([scene.y0, scene.y0 * 1.1])
    ends = np.asarray(jax.vmap(lambda y: end(y, TAYLOR12))(many))
    assert ends == pytest.approx([float(end(y, TAYLOR12)) for y in many], abs=1e-12)


def test_new_numbers_do_not_compile_again():
    traces = []

    @jax.jit
    def end(scene):
        traces.append(1)
        return solve(scene, 1.0, solver=TAYLOR12).y1

    for g in (9.81, 1.62):
        end(scenes.pendulum(g=g))
    assert len(traces) == 1


def _five_bodies():
    turns = 2 * np.pi * np.arange(5) / 5
    places = np.stack([np.cos(turns), np.sin(turns)], axis=1).ravel()
    y0 = np.concatenate([places, np.zeros(10)])
    return Scene(FreePoints(jnp.ones(5)), (PairGravity(1.0),), y0=y0, t1=0.1)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: scenes.pendulum(formulation="constrained"), "scene with short formulas, got one"),
        (_five_bodies, "products"),
    ],
)
def test_scenes_without_short_formulas_are_refused(make, why):
    scene = make()
    with pytest.raises(ValueError, match=why) as caught:
        simulate(scene, 0.1, solver=TAYLOR12)
    assert "solvers.VERNER9" in str(caught.value)


def test_scenes_of_more_numbers_than_one_function_takes_are_not_among_the_short_ones():
    three = scenes.three_body()
    assert has_series(three, three.y0)
    four = Scene(FreePoints(jnp.ones(4)), (PairGravity(1.0),), y0=np.arange(16.0), t1=0.1)
    assert not has_series(four, four.y0)


def test_a_rate_that_is_no_number_gives_no_number():
    for y in (-1.0, 0.0):
        found = TAYLOR12.advance(lambda t, y: jnp.log(y), *map(jnp.asarray, (0.0, 0.1, [y])))
        assert not np.isfinite(found.increment).any()


def test_a_step_of_no_length_changes_nothing():
    zero, y = jnp.zeros(()), jnp.array([0.3, 0.8])
    found = TAYLOR12.advance(lambda t, y: jnp.sin(t + y), zero, zero, y)
    assert not np.any(found.increment)
    assert not np.any(found.error)


def test_motions_side_by_side_are_refused():
    scene = scenes.pendulum()
    with pytest.raises(ValueError, match="several motions at once, got a Taylor series"):
        ensemble.run(scene, np.stack([scene.y0, scene.y0]), 0.1, solver=TAYLOR12)


@pytest.mark.parametrize("order", [3, 41, 2.5, True])
def test_an_order_out_of_range_is_refused(order):
    with pytest.raises(ValueError, match="order: expected"):
        Taylor(order)


def _exp2(t, y):
    return jnp.exp2(y)


def _friction(t, y):
    return jnp.abs(y)


def _unknown_loop(t, y):
    return lax.while_loop(lambda x: x[0] < 1, lambda x: x + 1, y)


def _moving_exponent(t, y):
    return y**y


def _places(t, y):
    return lax.dynamic_slice(y, (jnp.argmax(y),), (1,))


def _places_beyond(t, y):
    return y.at[jnp.array([3])].get(mode="fill", fill_value=0.0)


def _three_cases(t, y):
    return lax.select_n((3 * y).astype(int), y, 2 * y, 3 * y)


def _whole_division(t, y):
    return (jnp.where(y == 0, 3, 5) // 2) * y


def _fewer_bits(t, y):
    return y.astype(jnp.float32).astype(float)


def _fewer_bits_inside(t, y):
    x = lax.dot(y[None], y[:, None], preferred_element_type=jnp.float32)
    return x[0].astype(float)


def _compared_truths(t, y):
    return jnp.where((y == 0) == jnp.array([True]), y, 2 * y)


def _long_loop(t, y):
    return lax.fori_loop(0, 100_000, lambda i, x: x + y, y)


@pytest.mark.parametrize(
    ("rate", "why"),
    [
        (_places_beyond, "indices out of bounds"),
        (_three_cases, "conversion to int"),
        (_whole_division, "int"),
        (_fewer_bits, "conversion to float32"),
        (_fewer_bits_inside, "dot_general of float32"),
        (_compared_truths, "eq of bool"),
        (_long_loop, "a loop of 100000 rounds"),
        (_exp2, "exp2"),
        (_friction, "a condition on moving numbers"),
        (_unknown_loop, "while"),
        (_moving_exponent, "a moving exponent"),
        (_places, "argmax"),
    ],
)
def test_what_has_no_series_is_named(rate, why):
    with pytest.raises(NotElementary, match=why):
        formulas_of(rate, jnp.zeros(()), jnp.ones(1))


def _norm(x):
    return jnp.sqrt(x @ x)


@pytest.mark.sample("_norm")
@pytest.mark.parametrize("norm", [_norm, jnp.linalg.norm])
def test_a_speed_that_passes_zero_does_not_become_negative(norm):
    # Thrown straight up: where it turns, the series of the root of v^2 goes on with -|v|.
    c, g, v0, t1 = 0.3, 9.81, 20.0, 3.0

    def thrown(t, y):
        v = y[2:]
        return jnp.concatenate([v, -c * norm(v) * v - jnp.array([0.0, g])])

    k, limit = np.sqrt(g * c), np.sqrt(g / c)
    exact = -limit * np.tanh(k * t1 - np.arctan(v0 / limit))
    found = solve(ode(thrown, [0.0, 0.0, 0.0, v0], t1), t1)
    assert int(found.status) == Status.OK
    assert abs(found.y1[3] - exact) < 1e-9


@pytest.mark.sample("_norm")
@pytest.mark.parametrize("norm", [_norm, jnp.linalg.norm])
def test_a_puck_does_not_slide_back(norm):
    # At rest the direction v / |v| of its friction does not exist: there the motion ends.
    def sliding(t, y):
        v = y[2:]
        return jnp.concatenate([v, -2.5 * v / norm(v)])

    puck = ode(sliding, [0.0, 0.0, 3.0, 4.0], 3.0)
    moving = solve(puck, 1.5)
    np.testing.assert_allclose(moving.y1, [2.8125, 3.75, 0.75, 1.0], rtol=1e-12)
    stopped = solve(puck, 3.0, max_steps=1000)
    assert int(stopped.status) != Status.OK
    assert np.isnan(stopped.y1).all()
