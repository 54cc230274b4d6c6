"""Operations of a traced program carried out by NumPy, where nothing has to be compiled.

JAX compiles each operation that it carries out, for each shape: 40 ms, some sixty times for the
formulas of a mechanism, more than all of the program that is made from them takes.
"""

import itertools
import operator
from collections.abc import Callable, Sequence

import numpy as np

#: Operations on known numbers, with the same results as in JAX to the last digit.
_CALCULATIONS: dict[str, Callable] = {
    **{"add": operator.add, "sub": operator.sub, "mul": operator.mul, "neg": operator.neg},
    **{"lt": operator.lt, "le": operator.le, "gt": operator.gt, "ge": operator.ge},
    **{"eq": operator.eq, "ne": operator.ne},
}


def rearranged(name: str, params: dict, args: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """What an operation makes of arrays, of any objects, if it only rearranges their entries.

    Args:
      name: of the operation.
      params: its parameters.
      args: arrays; of `dynamic_slice` the indices follow, known integers.
    Returns:
      The results; None for other operations.
    """
    x = args[0] if args else np.zeros(0)
    if name == "reshape" and params["dimensions"] is None:
        return [x.reshape(params["new_sizes"])]
    if name == "broadcast_in_dim" and len(args) == 1:
        shape, places = params["shape"], params["broadcast_dimensions"]
        sizes = dict(zip(places, x.shape, strict=True))
        rows = x.reshape([sizes.get(i, 1) for i in range(len(shape))])
        return [np.broadcast_to(rows, shape)]
    if name == "transpose":
        return [x.transpose(params["permutation"])]
    if name == "squeeze":
        return [x.squeeze(tuple(params["dimensions"]))]
    if name == "slice":
        low, high = params["start_indices"], params["limit_indices"]
        strides = params["strides"] or (1,) * len(low)
        return [x[(*map(slice, low, high, strides), ...)]]
    if name == "rev":
        return [np.flip(x, params["dimensions"])]
    if name == "concatenate":
        return [np.concatenate(args, params["dimension"])]
    if name == "stack":
        return [np.stack(args, params["axis"])]
    if name == "unstack":
        rows = np.moveaxis(x, params["axis"], 0)
        return [rows[i, ...] for i in range(len(rows))]
    if name == "split":
        ends = list(itertools.accumulate(params["sizes"]))
        return np.split(x, ends[:-1], params["axis"])
    if name == "dynamic_slice":
        sizes = params["slice_sizes"]
        # Out of bounds, a part of this size still lies within.
        starts = (
            int(np.clip(at, 0, most - size))
            for at, most, size in zip(args[1:], x.shape, sizes, strict=True)
        )
        return [x[(*(slice(a, a + size) for a, size in zip(starts, sizes, strict=True)), ...)]]
    return None


def calculated(eqn, args: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """The results of an equation of a jaxpr for known numbers; None for other operations."""
    name, kind = eqn.primitive.name, eqn.outvars[0].aval.dtype
    found = rearranged(name, eqn.params, args)
    if found is None and name == "iota":
        shape, along = eqn.params["shape"], eqn.params["dimension"]
        sizes = [-1 if i == along else 1 for i in range(len(shape))]
        found = [np.broadcast_to(np.arange(shape[along]).reshape(sizes), shape)]
    if found is None and name in _CALCULATIONS:
        with np.errstate(all="ignore"):
            found = [np.asarray(_CALCULATIONS[name](*args))]
    if found is None and name == "select_n" and len(args) == 3 and args[0].dtype == bool:
        found = [np.where(args[0], args[2], args[1])]
    if found is None and name == "convert_element_type" and kind in (np.float64, np.int64):
        found = [args[0]]
    # Python numbers in a program have the type of its results.
    return None if found is None else [np.asarray(x, kind) for x in found]
