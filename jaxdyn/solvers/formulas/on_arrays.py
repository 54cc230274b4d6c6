"""Operations on arrays of numbers of a `graph`: each as what becomes of its entries."""

import functools
import itertools
import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn.solvers.formulas.graph import Graph
from jaxdyn.solvers.formulas.nodes import NotElementary, Number
from jaxdyn.solvers.formulas.on_numpy import rearranged

#: Operations that only rearrange their first arguments; the others are known indices.
MOVES = {
    **dict.fromkeys(("reshape", "broadcast_in_dim", "transpose", "squeeze", "slice"), None),
    **dict.fromkeys(("concatenate", "rev", "split", "stack", "unstack", "pad"), None),
    **{"dynamic_slice": 1, "gather": 1, "dynamic_update_slice": 2},
}


def objects(items: list, shape: tuple[int, ...]) -> np.ndarray:
    """An array of nodes and known numbers."""
    found = np.empty(len(items), object)
    found[:] = items
    return found.reshape(shape)


def elementwise(op: Callable, args: list[np.ndarray]) -> np.ndarray:
    """An operation on numbers, for entries one by one."""
    shape = np.broadcast_shapes(*(x.shape for x in args))
    columns = [np.broadcast_to(x, shape).ravel().tolist() for x in args]
    return objects(list(itertools.starmap(op, zip(*columns, strict=True))), shape)


def by_jax(primitive, params: dict, args: list[np.ndarray]) -> list[np.ndarray]:
    """The results of an operation on known numbers."""
    with jax.ensure_compile_time_eval():
        found = primitive.bind(*map(jnp.asarray, args), **params)
    return [np.asarray(x) for x in (found if primitive.multiple_results else [found])]


def moved(eqn, args: list[np.ndarray]) -> list[np.ndarray]:
    """What one of `MOVES` makes of its arguments."""
    name, params = eqn.primitive.name, dict(eqn.params)
    n = MOVES[name] or len(args)
    entries, places = args[:n], args[n:]
    if any(x.dtype == object for x in places):
        raise NotElementary(f"{name} at indices known only at run time")
    found = rearranged(name, params, [*(x.astype(object) for x in entries), *places])
    if found is not None:
        return found
    # It is applied to the indices of all entries, to see where each goes.
    if name == "gather":
        params["fill_value"] = -1
    starts = itertools.accumulate((x.size for x in entries), initial=0)
    numbers = [
        n + np.arange(x.size).reshape(x.shape) for n, x in zip(starts, entries, strict=False)
    ]
    pool = np.concatenate([x.astype(object).ravel() for x in entries])
    found = by_jax(eqn.primitive, params, [*numbers, *places])
    if any((x < 0).any() for x in found):
        raise NotElementary(f"{name} at indices out of bounds")
    return [np.asarray(pool[x], object) for x in found]


def converted(graph: Graph, x: np.ndarray, kind: np.dtype, wanted: np.dtype) -> np.ndarray:
    """An array of another type: real numbers."""
    if kind == wanted:
        return x
    if wanted != np.float64:
        raise NotElementary(f"conversion to {wanted}")
    return elementwise(graph.real, [x])


def folded(op: Callable, of_none: Number, x: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Sums along axes, or what another operation makes of several numbers."""
    kept = [i for i in range(x.ndim) if i not in axes]
    n = math.prod(x.shape[i] for i in axes)
    rows = np.transpose(x, [*kept, *axes]).reshape([*(x.shape[i] for i in kept), n])
    found = np.empty([x.shape[i] for i in kept], object)
    for at in np.ndindex(found.shape):
        found[at] = functools.reduce(op, rows[at]) if n else of_none
    return found


def multiplied(graph: Graph, a, b, contracted, batched) -> np.ndarray:
    """Products of matrices: batch axes, then free ones of a, then free ones of b."""

    def as_matrices(x, batch, last):
        free = [i for i in range(x.ndim) if i not in (*batch, *last)]
        parts = [[x.shape[i] for i in part] for part in (batch, free, last)]
        moved = np.transpose(x.astype(object), [*batch, *free, *last])
        return moved.reshape([math.prod(p) for p in parts]), parts

    a, (batch, free_a, _) = as_matrices(a, batched[0], contracted[0])
    b, (_, free_b, _) = as_matrices(b, batched[1], contracted[1])
    found = np.empty((a.shape[0], a.shape[1], b.shape[1]), object)
    for i, j, k in np.ndindex(found.shape):
        found[i, j, k] = functools.reduce(graph.add, map(graph.mul, a[i, j], b[i, k]), 0.0)
    return found.reshape([*batch, *free_a, *free_b])
