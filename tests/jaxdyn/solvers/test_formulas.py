"""Operations carried out by NumPy give what JAX gives, for numbers and for other objects."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxdyn._programs import CALLS, inner_program
from jaxdyn.solvers.formulas.formulas import calculate, rearrange

X = np.arange(24.0).reshape(2, 3, 4)
MOVES = [
    lambda x: lax.reshape(x, (4, 6)),
    lambda x: lax.broadcast_in_dim(x, (2, 5, 3, 4), (0, 2, 3)),
    lambda x: lax.broadcast_in_dim(x[:, :1], (2, 3, 4), (0, 1, 2)),
    lambda x: lax.transpose(x, (2, 0, 1)),
    lambda x: lax.squeeze(x[:1, :, 2:3], (0, 2)),
    lambda x: lax.slice(x, (0, 1, 0), (2, 3, 4), (1, 1, 2)),
    lambda x: lax.rev(x, (0, 2)),
    lambda x: lax.concatenate([x, x[:, 1:]], 1),
    lambda x: jnp.stack([x[0], x[1], x[0]], 1),
    lambda x: jnp.unstack(x, axis=1),
    lambda x: lax.split(x, (1, 2), 1),
    lambda x: lax.dynamic_slice(x, (0, 2, -1), (1, 2, 3)),
    lambda x: x[1, 2, 3],
]


def moved(closed, args) -> list:
    """The results of a program that only moves numbers; JAX 0.10.0 calls one for `unstack`."""
    values = dict(zip(closed.jaxpr.invars, args, strict=True))
    for eqn in closed.jaxpr.eqns:
        given = [np.asarray(a.val) if hasattr(a, "val") else values[a] for a in eqn.invars]
        if eqn.primitive.name in CALLS:
            found = moved(inner_program(eqn), given)
        else:
            found = rearrange(eqn.primitive.name, eqn.params, given)
        assert found is not None, eqn
        values |= dict(zip(eqn.outvars, found, strict=True))
    return [values[out] for out in closed.jaxpr.outvars]


@pytest.mark.parametrize("move", MOVES)
def test_rearrangements(move):
    closed = jax.make_jaxpr(move)(X)
    for kind in (float, object):
        results = moved(closed, [X.astype(kind)])
        for found, wanted in zip(results, jax.tree.leaves(move(X)), strict=True):
            assert found.shape == wanted.shape
            assert (found == np.asarray(wanted)).all()


def test_calculations_and_what_is_left_to_jax():
    def sums(x):
        n = lax.iota(int, 3)
        whole = lax.select(n < lax.full_like(n, 2), n + n, -n)
        grid = lax.broadcasted_iota(int, (2, 3), 1)
        return lax.convert_element_type(whole, float) * x, grid, x == x + x

    closed = jax.make_jaxpr(sums)(X[0, 0, :3])
    values = dict(zip(closed.jaxpr.invars, [X[0, 0, :3]], strict=True))
    for eqn in closed.jaxpr.eqns:
        args = [np.asarray(a.val) if hasattr(a, "val") else values[a] for a in eqn.invars]
        found = calculate(eqn, args)
        found = eqn.primitive.bind(*args, **eqn.params) if found is None else found
        found = found if isinstance(found, list) else [found]
        values |= dict(zip(eqn.outvars, found, strict=True))
    for out, wanted in zip(closed.jaxpr.outvars, sums(X[0, 0, :3]), strict=True):
        assert values[out].dtype == wanted.dtype
        assert (values[out] == wanted).all()
    (eqn,) = jax.make_jaxpr(jnp.sin)(1.0).jaxpr.eqns
    assert calculate(eqn, [np.ones(())]) is None
    assert rearrange("sin", {}, [np.ones(())]) is None
