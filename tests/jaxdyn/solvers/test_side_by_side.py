"""Functions along last axes against `jax.vmap`, operation by operation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxdyn.scenes import catalogue
from jaxdyn.solvers.side_by_side import MAX_APART, side_by_side

_MATRIX = np.arange(12.0).reshape(4, 3) - 5.0


@jax.custom_jvp
def _with_rule(x):
    return x * x


_with_rule.defjvp(lambda x, dx: (_with_rule(x[0]), 2 * x[0] * dx[0]))


def _loop(x):
    return lax.fori_loop(0, 3, lambda i, y: y * 0.5 + jnp.sin(y[::-1]) * i, x)


#: Functions of x (4,), with entries of both signs, and a number s.
FUNCTIONS = {
    "sums": lambda x, s: x.sum() + x.max() * x.min() + jnp.cumsum(x) + x.prod(),
    "functions": lambda x, s: jnp.exp(-x * x) + jnp.sin(x) * jnp.arctan2(x, s) + jnp.abs(x) ** 1.5,
    "powers": lambda x, s: x**3 - lax.rsqrt(x * x + 1) + lax.square(x),
    "reshape": lambda x, s: (x.reshape(2, 2).T @ x.reshape(2, 2)).ravel() * s,
    "stack": lambda x, s: jnp.stack([x[0] * s, x[2] - x[1], s, jnp.zeros(())])[::-1],
    "concatenate": lambda x, s: jnp.concatenate([x[1:], s[None] + x[:1]]),
    "unstack": lambda x, s: jnp.stack(jnp.unstack(x)[::-1]) * s,
    "sort": lambda x, s: jnp.sort(x) * s,
    "split": lambda x, s: jnp.concatenate(jnp.split(x, 2)[::-1]) * s,
    "transpose": lambda x, s: (x[:, None] * x[None, :] + s * jnp.eye(4)).T.sum(0),
    "broadcast": lambda x, s: jnp.broadcast_to(s, (4,)) + jnp.ones(4)[None, :].sum(0) * x,
    "matrix": lambda x, s: (x @ _MATRIX) @ _MATRIX.T + s,
    "choice": lambda x, s: jnp.where(x > s, x, -x) + jnp.where(s > 0, x, 2 * x),
    "clamp": lambda x, s: jnp.clip(x, -0.5, 0.5) + jnp.minimum(x, s),
    "truths": lambda x, s: jnp.where((x > 0) & ~jnp.isnan(x) | (x < s), x, 0.0),
    "whole numbers": lambda x, s: (jnp.floor(x).astype(int) + (x > 0).astype(int)).astype(float),
    "whole quotient": lambda x, s: lax.div((7 * x).astype(int), jnp.full(4, 2)).astype(float) + s,
    "nothing": lambda x, s: x + x[:0].sum() + jnp.zeros((0, 3)).sum(0)[0] + s,
    "known place": lambda x, s: lax.dynamic_slice(x, (1,), (2,)).sum() + x,
    "own place": lambda x, s: lax.dynamic_index_in_dim(x, (s > 0).astype(int)) + x,
    "update": lambda x, s: lax.dynamic_update_slice(x, s[None], (2,)),
    "gather": lambda x, s: x[jnp.array([3, 0, 0, 1])] * s,
    "pad": lambda x, s: jnp.pad(x, (1, 2))[2:6] + s,
    "jit": lambda x, s: jax.jit(lambda y: y * s)(x),
    "rule": lambda x, s: _with_rule(x) + s,
    "loop": lambda x, s: _loop(x) * s,
    "branch": lambda x, s: lax.cond(s > 0, jnp.sin, jnp.cos, x),
    "steps": lambda x, s: lax.scan(lambda c, y: (c + y, c * s), 0.0 * s, x)[1],
    "quotient": lambda x, s: x / (1.0 + x * x) / np.float64(3.0) + s / jnp.arange(1.0, 5.0),
    "steady": lambda x, s: jnp.linspace(0.0, 1.0, 4) * 2.0,
    "large": lambda x, s: (x[:, None] * jnp.arange(float(MAX_APART))[None])[:, 3] + s,
}


@pytest.mark.sample(
    "reshape-True",
    "stack-True",
    "concatenate-True",
    "unstack-True",
    "sort-False",
    "sort-True",
    "split-True",
    "transpose-True",
    "broadcast-True",
    "matrix-True",
    "choice-True",
    "nothing-True",
)
@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_it_agrees_with_vmap(name, apart):
    fn = FUNCTIONS[name]
    rng = np.random.default_rng(7)
    x, s = (jnp.asarray(a) for a in (rng.normal(size=(4, 5)), rng.normal(size=5)))
    expected = jax.vmap(fn, -1, -1)(x, s)
    found = side_by_side(fn, x, s, apart=apart)
    np.testing.assert_allclose(found, expected, rtol=1e-15, atol=1e-15)
    found = side_by_side(fn, x[..., None], s[..., None], axes=2, apart=apart)
    np.testing.assert_allclose(found[..., 0], expected, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("apart", [False, True])
def test_trees_go_in_and_come_out(apart):
    def fn(both):
        return {"sum": both[0] + both[1], "pair": (both[0], jnp.ones(2))}

    found = side_by_side(fn, (jnp.arange(3.0), jnp.ones(3)), apart=apart)
    np.testing.assert_array_equal(found["sum"], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(found["pair"][1], np.ones((2, 3)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["three_body", "two_springs", "double_pendulum", "rolling_disk", "top"]
)
@pytest.mark.parametrize("apart", [False, True])
def test_rates_of_scenes_agree_with_vmap(name, apart):
    zoo = catalogue.entries()
    scene = zoo[name].make()
    y = scene.y0[:, None] * jnp.array([[1.0, 1.01, 0.99]])
    expected = jax.vmap(lambda y: scene.rate(0.1, y), -1, -1)(y)
    found = side_by_side(lambda y: scene.rate(0.1, y), y, apart=apart)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


def test_it_may_be_differentiated():
    x = jnp.array([[0.3, 0.5], [0.2, 0.9]])
    expected = jax.jacfwd(lambda x: jax.vmap(jnp.sin, -1, -1)(x).sum())(x)
    found = jax.grad(lambda x: side_by_side(jnp.sin, x, apart=True).sum())(x)
    np.testing.assert_allclose(found, expected, rtol=1e-15)


def test_nothing_at_all_is_no_mistake():
    assert side_by_side(jnp.sort, jnp.zeros((0, 4))).shape == (0, 4)


@pytest.mark.parametrize(
    "args", [(), (jnp.zeros((3, 4)), jnp.zeros((3, 1))), (jnp.zeros(4), jnp.zeros(()))]
)
def test_arguments_without_common_lanes_are_refused(args):
    with pytest.raises(ValueError, match="args: expected arrays that share their last axes"):
        side_by_side(lambda *x: x, *args)
