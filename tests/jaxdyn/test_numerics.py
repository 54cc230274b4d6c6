"""The numerical tricks do what their docstrings claim, also after compilation."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdyn import _numerics
from jaxdyn._numerics import (
    first_only,
    in_one_kernel,
    materialize,
    nan_unless,
    rough_power,
    runtime_one,
    safe_norm,
    safe_sqrt,
    solve_psd,
    solve_spd,
    square_norm,
    taylor_coefficients,
    two_sum,
    value_and_jacfwd,
)

RNG = np.random.default_rng(1)


@pytest.mark.parametrize("jac", [jax.jacfwd, jax.jacrev])
def test_safe_sqrt_is_the_root_with_a_finite_slope_at_zero(jac):
    x = jnp.array([0.0, 1e-300, 0.25, 4.0])
    np.testing.assert_array_equal(safe_sqrt(x), np.sqrt(x))
    slope = jnp.diagonal(jac(safe_sqrt)(x))
    np.testing.assert_allclose(slope, [0.0, 5e149, 1.0, 0.25], rtol=1e-15)
    assert jnp.isfinite(jac(jac(safe_sqrt))(jnp.array([0.0]))).all()


def test_a_value_comes_with_its_derivatives_from_one_run():
    runs = []

    def product(x, y):
        runs.append(x)
        return {"product": x * y[0]}

    x, y = jnp.array([1.0, 2.0]), jnp.array([3.0])
    value, slopes = value_and_jacfwd(product, (0, 1))(x, y)
    assert len(runs) == 1
    np.testing.assert_array_equal(value["product"], [3.0, 6.0])
    by_x, by_y = slopes["product"]
    np.testing.assert_array_equal(by_x, np.diag([3.0, 3.0]))
    np.testing.assert_array_equal(by_y, [[1.0], [2.0]])
    np.testing.assert_array_equal(value_and_jacfwd(jnp.sin)(x)[1], np.diag(np.cos(x)))


@pytest.mark.parametrize("x", [math.nan, -1.0, -math.inf])
def test_safe_sqrt_hides_no_bad_argument(x):
    assert jnp.isnan(safe_sqrt(jnp.array(x)))
    assert jnp.isnan(jax.grad(safe_sqrt)(x))


@pytest.mark.parametrize("jac", [jax.jacfwd, jax.jacrev])
def test_what_is_not_known_has_no_finite_derivative(jac):
    def inverse(x):
        return nan_unless(x > 0, 1 / x)

    x = jnp.array([2.0, -2.0])
    np.testing.assert_array_equal(inverse(x), [0.5, np.nan])
    np.testing.assert_array_equal(jnp.diagonal(jac(inverse)(x)), [-0.25, np.nan])


@pytest.mark.parametrize("jac", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("d", [1, 2, 3])
def test_safe_norm_is_the_length_with_gradient_zero_at_the_origin(jac, d):
    x = jnp.asarray(RNG.normal(size=(5, d)))
    np.testing.assert_allclose(safe_norm(x), np.linalg.norm(x, axis=1), rtol=1e-15)
    np.testing.assert_allclose(square_norm(x), np.sum(x * x, axis=1), rtol=1e-15)
    unit = x[0] / jnp.linalg.norm(x[0])
    np.testing.assert_allclose(jac(safe_norm)(x[0]), unit, atol=1e-15)
    np.testing.assert_array_equal(jac(safe_norm)(jnp.zeros(d)), np.zeros(d))
    assert jnp.isnan(safe_norm(jnp.full(d, jnp.nan)))


def _sums(x: jax.Array, n: int) -> tuple[jax.Array, jax.Array]:
    """Naive and compensated sum of n increments h * x in a loop that XLA folds."""
    # The product is there on purpose: a compiler that contracts it into the sum in one place
    # and not in the other would spoil the compensation.
    h = x * 0.5

    def body(_, carry):
        naive, total, left_out = carry
        naive = naive + h * x
        total, left_out = two_sum(total, left_out, h * x)
        return naive, total, left_out

    naive, total, _ = jax.lax.fori_loop(0, n, body, (x * 0, x * 0, x * 0))
    return naive, total


@pytest.mark.parametrize("wrap", [jax.jit, lambda f: jax.jit(jax.vmap(f))], ids=["jit", "vmap"])
def test_two_sum_survives_compilation(wrap):
    n = 1_000_000
    x = jnp.array([0.1, 0.3, 0.7])
    if wrap is jax.jit:
        x = x[1]
    naive, total = wrap(lambda x: _sums(x, n))(x)
    exact = np.asarray(x) * 0.5 * np.asarray(x) * n
    # One rounding of the sum and one of the product, whatever n; naively it is thousands.
    assert np.max(np.abs(total - exact) / exact) < 3e-16
    assert np.min(np.abs(naive - exact) / exact) > 1e-12


def test_two_sum_returns_what_rounding_left_out():
    total, carry = two_sum(jnp.array(1.0), jnp.array(0.0), jnp.array(1e-17))
    assert (float(total), float(carry)) == (1.0, 1e-17)


def test_materialize_changes_no_bit():
    x = jnp.asarray(RNG.normal(size=50) * 10.0 ** RNG.integers(-300, 300, 50))
    kept = jax.jit(lambda x, t: materialize(x, runtime_one(t)))(x, -3.7)
    np.testing.assert_array_equal(kept, x)


@pytest.mark.parametrize("unknown", [True, False])
def test_in_one_kernel_is_the_plain_call(unknown):
    def fn(x, tree, n):
        total = jax.lax.fori_loop(0, n, lambda i, y: y + jnp.sin(i * tree["a"]), x)
        return {"sum": total, "count": n + 1, "small": total < tree["a"]}

    args = (jnp.arange(3.0), {"a": jnp.array(0.3)}, jnp.array(4))
    plain = jax.jit(fn)(*args)
    packed = jax.jit(lambda *a: in_one_kernel(fn, a[1:], a[0]))(jnp.array(unknown), *args)
    assert jax.tree.structure(plain) == jax.tree.structure(packed)
    for a, b in zip(jax.tree.leaves(plain), jax.tree.leaves(packed), strict=True):
        np.testing.assert_array_equal(a, b)
        assert a.dtype == b.dtype


def test_in_one_kernel_is_a_loop_that_the_compiler_keeps():
    fn = jax.jit(lambda x: in_one_kernel(lambda x: jnp.sin(x) * 2, (x,), x[0] > 0))
    assert " while(" in fn.lower(jnp.ones(3)).compile().as_text()


def test_in_one_kernel_leaves_large_functions_as_they_are(monkeypatch):
    def fn(x):
        return jnp.sin(x) * 2 + 1

    def loops():
        program = jax.make_jaxpr(lambda x: in_one_kernel(fn, (x,), x[0] > 0))(jnp.ones(3))
        return "while" in str(program)

    assert loops()
    monkeypatch.setattr(_numerics, "_LARGEST_KERNEL", 2)
    assert not loops()
    np.testing.assert_array_equal(in_one_kernel(fn, (jnp.ones(3),), True), fn(jnp.ones(3)))


def test_in_one_kernel_traces_a_function_once():
    traced = []

    def fn(x):
        traced.append(x)
        return 2 * x

    # 0.5 has a weak type, which ends with the first sum.
    jax.jit(lambda x: in_one_kernel(fn, (x,), jnp.array(True)))(0.5)
    assert len(traced) == 1


def test_in_one_kernel_lets_nan_through():
    x = jnp.array([jnp.nan, 1.0])
    np.testing.assert_array_equal(in_one_kernel(jnp.sqrt, (x,), x[0] > 0), x)


@pytest.mark.sample("9-jacfwd")
@pytest.mark.parametrize("jac", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("n", [1, 3, 4, 9])  # written out, and as a loop
def test_elimination_solves_and_differentiates_at_every_size(n, jac):
    g = RNG.normal(size=(n, n + 2))
    a, b = g @ g.T, RNG.normal(size=(n, 2))
    inverse = np.linalg.inv(a)
    kept = solve_psd(a, b, 1e-12 * np.diagonal(a))
    assert kept.kept.all()
    for x in (solve_spd(a, b), kept.x):
        np.testing.assert_allclose(x, inverse @ b, rtol=1e-9, atol=1e-11)
    # d(a^-1 b) along da is -a^-1 da a^-1 b.
    slope = jac(lambda s: solve_spd(a + s * np.eye(n), b))(0.0)
    np.testing.assert_allclose(slope, -inverse @ inverse @ b, rtol=1e-8, atol=1e-9)


def test_a_loop_of_elimination_leaves_dependent_rows_out_as_written_out_code_does():
    g = RNG.normal(size=(5, 9))
    g[2], g[4] = g[0] - g[1], 2 * g[3]
    a = g @ g.T
    found = solve_psd(a, a @ np.ones(5), 1e-10 * np.diagonal(a))
    assert found.kept.tolist() == [True, True, False, True, False]
    np.testing.assert_allclose(a @ found.x, a @ np.ones(5), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(found.combination[:, 2], [1, -1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.combination[:, 4], [0, 0, 0, 2, 0], atol=1e-12)


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_elimination_is_as_right_for_large_and_small_matrices(size):
    # In units of other sizes the same equations have the same digits.
    half = np.random.default_rng(4).normal(size=(3, 3))
    a, b = half @ half.T + 3 * np.eye(3), np.array([1.0, -2.0, 0.5])
    exact = np.linalg.solve(a, b)
    loose = solve_psd(jnp.asarray(size * a), jnp.asarray(size * b), jnp.zeros(3))
    for x in (solve_spd(jnp.asarray(size * a), jnp.asarray(size * b)), loose.x):
        np.testing.assert_allclose(x, exact, rtol=2e-15)


@pytest.mark.parametrize(
    ("n", "most"), [(-1 / 2, 0.02), (-1 / 5, 0.01), (-1 / 28, 0.01), (-1 / 80, 0.01), (1 / 8, 0.01)]
)
def test_rough_power_is_right_to_a_few_percent_and_always_finite(n, most):
    x = np.append(10.0 ** np.linspace(-300, 300, 10_001), 1.0)
    rough = jax.jit(jax.vmap(lambda x: rough_power(x, n)))
    assert np.abs(np.asarray(rough(x)) / x**n - 1).max() < most
    assert np.isfinite(np.asarray(rough(jnp.array([0.0, jnp.inf, jnp.nan])))).all()
    assert rough(jnp.array([0.0]))[0] > 1e3 if n < 0 else True
    with jax.enable_x64(False):
        x = np.append(10.0 ** np.linspace(-37, 37, 10_001), 1.0).astype(np.float32)
        narrow = jax.jit(jax.vmap(lambda x: rough_power(x, n)))(x)
    assert narrow.dtype == np.float32
    assert np.abs(np.asarray(narrow, float) / np.asarray(x, float) ** n - 1).max() < most


def test_the_series_of_a_function_are_those_of_its_closed_form():
    series = taylor_coefficients(lambda e: jnp.stack([jnp.exp(-2 * e), jnp.sin(e)]), 4)
    np.testing.assert_allclose(series[:, 0], [1, -2, 2, -4 / 3, 2 / 3], rtol=1e-15)
    np.testing.assert_allclose(series[:, 1], [0, 1, 0, -1 / 6, 0], atol=1e-16)


@pytest.mark.parametrize("first", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("second", [jax.jacfwd, jax.jacrev])
def test_what_has_first_derivatives_only_has_no_finite_second_ones(first, second):
    def f(x):
        return first_only(x - jnp.array([1.0, 2.0]) * x[0]) @ jnp.array([1.0, 1.0])

    x = jnp.array([3.0, 6.0])
    np.testing.assert_allclose(jax.jit(first(f))(x), [-2.0, 1.0])
    assert np.isnan(second(first(f))(x)).all()
