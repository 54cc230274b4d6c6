"""A function vectorised along the last axes of its arguments, without transposes.

``jax.vmap`` moves the new axis to the front at each reshape, stack and contraction. A step of
many motions is then full of transposes, and its inner loops run over the two or three entries of
a vector instead of over the motions: it takes 1.3 to 2 times as long (measured, three bodies).
Here the axis stays last, at each operation of the function's program.

Small arrays may also be split into scalars, with one program for each entry. This removes all
operations that only assemble and split arrays, which XLA on CPU compiles to a branch for each
entry that it copies.
"""

import functools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._programs import CALLS, bind, inner_program, interpret
from jaxdyn.solvers.formulas.formulas import rearrange

#: Elementwise operations, all arguments of one shape.
_ELEMENTWISE = {
    *("add", "add_any", "sub", "mul", "div", "neg", "max", "min", "abs", "sign", "square"),
    "one_minus_square",
    *("pow", "integer_pow", "sqrt", "rsqrt", "cbrt", "exp", "exp2", "log", "log1p", "expm1"),
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh"),
    *("eq", "ne", "lt", "le", "gt", "ge", "and", "or", "not", "xor", "is_finite"),
    *("select_n", "clamp", "floor", "ceil", "round", "rem", "nextafter"),
    *("convert_element_type", "stop_gradient", "copy", "real", "imag", "complex"),
}
#: Operations along named axes, counted from the first.
_ALONG_AXES = {
    *("concatenate", "stack", "unstack", "split", "squeeze", "rev"),
    *("cumsum", "cumprod", "cummax", "cummin"),
    *("reduce_sum", "reduce_max", "reduce_min", "reduce_prod", "reduce_and", "reduce_or"),
}
#: Operations that only rearrange entries.
_MOVES = {
    *("reshape", "broadcast_in_dim", "transpose", "squeeze", "slice", "rev"),
    *("concatenate", "stack", "unstack", "split"),
}
#: Largest number of entries of an array that is split.
MAX_APART = 48


def side_by_side(fn: Callable, *args: Any, axes: int = 1, apart: bool = False) -> Any:
    """The results of fn for each entry of the last axes of all arguments, along the same axes.

    Args:
      fn: a pure function of trees of arrays; values it captures are shared by all lanes.
      *args: trees of arrays (..., *lanes).
      axes: number of lane axes. Where there are fewer than some 25 lanes, add a second axis of
        length 1: XLA on CPU unrolls a short innermost loop into scalars before it vectorises.
      apart: split arrays of up to 48 entries into scalars.
    Returns:
      The result of fn, each array with the lanes as last axes.
    Raises:
      ValueError: the last axes of the arguments differ.
    Limits: custom derivative rules within fn are lost. When arrays are split, a quotient by a
      number shared by all lanes is a product with its inverse, which beyond 1e308 is 0.
    Example:
      >>> import jax.numpy as jnp
      >>> from jaxdyn.solvers.side_by_side import side_by_side
      >>> side_by_side(jnp.cross, jnp.eye(3), jnp.eye(3)[::-1]).shape
      (3, 3)
    """
    flat, tree = jax.tree.flatten(args)
    shapes = {x.shape[max(x.ndim - axes, 0) :] for x in flat}
    if len(shapes) != 1 or len(lanes := shapes.pop()) != axes:
        found = " and ".join(str(x.shape) for x in flat)
        raise _checks.fail("args", f"arrays that share their last axes ({axes})", found)
    one = [jax.ShapeDtypeStruct(x.shape[: x.ndim - axes], x.dtype) for x in flat]
    closed, shape = jax.make_jaxpr(fn, return_shape=True)(*jax.tree.unflatten(tree, one))
    work = _Lanes(lanes, apart)
    found = work.interpret(closed, [_Wide(x) for x in flat])
    return jax.tree.unflatten(jax.tree.structure(shape), [work.wide(x) for x in found])


class _Wide(NamedTuple):
    """An array (..., *lanes). Arrays without lanes are shared by all of them."""

    array: Array


class _Apart(NamedTuple):
    """An array of objects, each of shape () or (*lanes)."""

    entries: np.ndarray


_Value = Array | _Wide | _Apart


class _Lanes:
    """The interpreter of operations along lanes."""

    def __init__(self, lanes: tuple[int, ...], apart: bool):
        self.lanes = lanes
        self.most = MAX_APART if apart else 0

    def interpret(self, closed, inputs: list[_Value]) -> list[_Value]:
        """The results of a program."""
        return interpret(closed, inputs, self._apply, lambda x: jnp.asarray(x, x.dtype))

    def wide(self, x: _Value) -> Array:
        """x with the lanes as last axes."""
        if isinstance(x, _Wide):
            return x.array
        if isinstance(x, _Apart):
            rows = jnp.stack([jnp.broadcast_to(entry, self.lanes) for entry in x.entries.flat])
            return rows.reshape(*x.entries.shape, *self.lanes)
        return jnp.broadcast_to(
            x.reshape(*x.shape, *(1 for _ in self.lanes)), (*x.shape, *self.lanes)
        )

    def _entries(self, x: _Value) -> np.ndarray:
        if isinstance(x, _Apart):
            return x.entries
        array = x.array if isinstance(x, _Wide) else x
        shape = array.shape[: array.ndim - len(self.lanes)] if isinstance(x, _Wide) else array.shape
        return _objects([array[at] for at in np.ndindex(shape)], shape)

    def _apply(self, eqn, args: list[_Value]) -> list[_Value]:
        """Results of one equation of a program."""
        name = eqn.primitive.name
        if name in CALLS:
            return self.interpret(inner_program(eqn), args)
        if not any(isinstance(x, _Wide | _Apart) for x in args):
            return list(bind(eqn, args))
        sizes = [math.prod(a.aval.shape) for a in (*eqn.invars, *eqn.outvars)]
        if 0 < min(sizes) and max(sizes) <= self.most:
            found = self._entry_by_entry(eqn, args)
            if found is not None:
                return [_Apart(x) for x in found]
        return [_Wide(x) for x in self._whole(eqn, args)]

    def _entry_by_entry(self, eqn, args: list[_Value]) -> list[np.ndarray] | None:
        name = eqn.primitive.name
        if name in _ELEMENTWISE:
            columns = np.broadcast_arrays(*map(self._entries, args))
            rows = zip(*(x.flat for x in columns), strict=True)
            return [_objects([self._scalar(eqn, row) for row in rows], columns[0].shape)]
        if name in _MOVES:
            return rearrange(name, eqn.params, [self._entries(x) for x in args])
        if name == "reduce_sum":
            axes, shape = eqn.params["axes"], eqn.outvars[0].aval.shape
            first = np.moveaxis(self._entries(args[0]), axes, range(len(axes)))
            rows = first.reshape(-1, math.prod(shape)).T
            return [_objects([functools.reduce(operator.add, row) for row in rows], shape)]
        return None

    def _scalar(self, eqn, entries: Sequence[Array]) -> Array:
        differ = any(x.ndim for x in entries)
        if eqn.primitive.name == "div" and entries[0].ndim and not entries[1].ndim:
            if jnp.issubdtype(entries[1].dtype, jnp.inexact):
                # This is what XLA does for arrays: one division for all lanes.
                return entries[0] * (1.0 / entries[1])
        return bind(eqn, [jnp.broadcast_to(x, self.lanes) if differ else x for x in entries])[0]

    def _whole(self, eqn, args: list[_Value]) -> Sequence[Array]:
        name, params, n = eqn.primitive.name, eqn.params, len(self.lanes)
        if name in _ELEMENTWISE:
            # Including conditions and bounds, which may be scalars.
            shape = (*eqn.outvars[0].aval.shape, *self.lanes)
            return bind(eqn, [jnp.broadcast_to(self.wide(x), shape) for x in args])
        if name in _ALONG_AXES:
            return bind(eqn, [self.wide(x) for x in args])
        if name == "slice":
            low, high = params["start_indices"], params["limit_indices"]
            strides = params["strides"] or (1,) * len(low)
            x = self.wide(args[0])
            return [lax.slice(x, (*low, *(0,) * n), (*high, *self.lanes), (*strides, *(1,) * n))]
        if name == "reshape":
            return [lax.reshape(self.wide(args[0]), (*params["new_sizes"], *self.lanes))]
        if name == "broadcast_in_dim":
            shape = (*params["shape"], *self.lanes)
            places = (*params["broadcast_dimensions"], *range(len(params["shape"]), len(shape)))
            return [lax.broadcast_in_dim(self.wide(args[0]), shape, places)]
        if name == "transpose":
            order = params["permutation"]
            return [lax.transpose(self.wide(args[0]), (*order, *range(len(order), len(order) + n)))]
        return self._map(eqn, args)

    def _map(self, eqn, args: list[_Value]) -> list[Array]:
        """Any other operation, by `jax.vmap`, with all lanes in one axis."""
        count = math.prod(self.lanes)
        differ = [isinstance(x, _Wide | _Apart) for x in args]
        arrays = [self.wide(x) if there else x for x, there in zip(args, differ, strict=True)]
        joined = [
            x.reshape(*x.shape[: x.ndim - len(self.lanes)], count) if there else x
            for x, there in zip(arrays, differ, strict=True)
        ]
        axes = [-1 if there else None for there in differ]
        found = jax.vmap(lambda *xs: bind(eqn, list(xs)), in_axes=axes, out_axes=-1)(*joined)
        return [x.reshape(*x.shape[:-1], *self.lanes) for x in found]


def _objects(items: Sequence, shape: tuple[int, ...]) -> np.ndarray:
    found = np.empty(len(items), object)
    for i, item in enumerate(items):
        found[i] = item
    return found.reshape(shape)
