"""A vector field as scalar formulas, from its program with all arrays split.

A rate is written with arrays: stacked, sliced, multiplied with matrices that are mostly zeros.
`formulas` runs through its jaxpr with a `graph.Node` in place of each number: array operations then
cost nothing, and repeated computations become one node. Loops of known length are unrolled. Other
loops, linear algebra and callbacks cannot be represented, and raise `NotElementary`.

Known numbers are calculated by NumPy: JAX compiles each operation that it carries out, for each
shape, which takes 40 ms. Some sixty of them for the formulas of a mechanism would take longer than
the whole program that is made from them.
"""

import collections
import functools
import itertools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun
from jaxtyping import Array, PyTree

from jaxdyn._programs import CALLS, Loop, inner_program, interpret, loop, programs
from jaxdyn.solvers.formulas import alternatives
from jaxdyn.solvers.formulas.graph import (
    COMPARISONS,
    FUNCTIONS,
    LOGIC,
    ROUGH,
    STEADY,
    TESTS,
    Graph,
    Node,
    NotElementary,
    Number,
    Value,
    constant,
    value,
)
from jaxdyn.solvers.method import Rate

# ---- Functions composed of others, for an arithmetic in which cancellation does not matter
#
# In doubles sinh x = (exp x - exp -x) / 2 is all rounding near 0; ball arithmetic makes up for it
# by more bits.


def _half_sum(graph: Graph, a: Number, sign: float) -> Number:
    other = graph.function("exp", graph.neg(a))
    return graph.mul(0.5, graph.add(graph.function("exp", a), graph.mul(sign, other)))


def _tan(graph: Graph, a: Number) -> Number:
    return graph.div(graph.function("sin", a), graph.function("cos", a))


def _logistic(graph: Graph, a: Number) -> Number:
    return graph.div(1.0, graph.add(1.0, graph.function("exp", graph.neg(a))))


def _beside_circle(graph: Graph, a: Number) -> Number:
    """sqrt(1 - a^2)."""
    return graph.function("sqrt", graph.sub(1.0, graph.mul(a, a)))


def _asin(graph: Graph, a: Number) -> Number:
    return graph.function("atan", graph.div(a, _beside_circle(graph, a)))


def _acos(graph: Graph, a: Number) -> Number:
    half = graph.div(_beside_circle(graph, a), graph.add(1.0, a))
    return graph.mul(2.0, graph.function("atan", half))


def _atan2(graph: Graph, y: Number, x: Number) -> Number:
    """The angle as twice its half, whose tangent jumps on the negative x axis only."""
    r = graph.function("sqrt", graph.add(graph.mul(x, x), graph.mul(y, y)))
    half = graph.div(y, graph.add(r, x))
    return graph.mul(2.0, graph.function("atan", half))


def _asinh(graph: Graph, a: Number) -> Number:
    root = graph.function("sqrt", graph.add(1.0, graph.mul(a, a)))
    return graph.function("log", graph.add(a, root))


#: Functions composed of others, by the names of JAX's primitives.
COMPOSED: dict[str, Callable[..., Number]] = {
    "tan": _tan,
    "sinh": lambda graph, a: _half_sum(graph, a, -1.0),
    "cosh": lambda graph, a: _half_sum(graph, a, 1.0),
    "atan": lambda graph, a: graph.function("atan", a),
    "asin": _asin,
    "acos": _acos,
    "atan2": _atan2,
    "asinh": _asinh,
    "logistic": _logistic,
    "exp2": lambda graph, a: graph.function("exp", graph.mul(a, graph.function("log", 2.0))),
    "expm1": lambda graph, a: graph.sub(graph.function("exp", a), 1.0),
    "log1p": lambda graph, a: graph.function("log", graph.add(1.0, a)),
}


# ---- A vector field as scalar formulas, from its program with all arrays split

#: Operations on known numbers, with the same results as in JAX to the last digit.
_CALCULATIONS: dict[str, Callable] = {
    **{"add": operator.add, "sub": operator.sub, "mul": operator.mul, "neg": operator.neg},
    **{"lt": operator.lt, "le": operator.le, "gt": operator.gt, "ge": operator.ge},
    **{"eq": operator.eq, "ne": operator.ne},
}


def rearrange(name: str, params: dict, args: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """The results of an operation that only rearranges the entries of arrays, of any objects.

    Args:
      name: the name of the operation.
      params: its parameters.
      args: arrays; for `dynamic_slice` followed by the indices, known integers.
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


def calculate(eqn, args: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """The results of an equation of a jaxpr for known numbers; None for other operations."""
    name, kind = eqn.primitive.name, eqn.outvars[0].aval.dtype
    found = rearrange(name, eqn.params, args)
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
    # Python numbers in a program take the type of its results.
    return None if found is None else [np.asarray(x, kind) for x in found]


#: Operations that only rearrange some of their arguments, these; the others are known indices.
MOVES = {
    **dict.fromkeys(("reshape", "broadcast_in_dim", "transpose", "squeeze", "slice"), slice(None)),
    **dict.fromkeys(("concatenate", "rev", "split", "stack", "unstack", "pad"), slice(None)),
    **dict.fromkeys(("dynamic_slice", "gather"), slice(1)),
    **{"dynamic_update_slice": slice(2), "scatter": slice(0, None, 2)},
}


def objects(items: list, shape: tuple[int, ...]) -> np.ndarray:
    """An array of nodes and known numbers."""
    found = np.empty(len(items), object)
    found[:] = items
    return found.reshape(shape)


def elementwise(op: Callable, args: list[np.ndarray]) -> np.ndarray:
    """The results of an operation on numbers, entry by entry."""
    shape = np.broadcast_shapes(*(x.shape for x in args))
    columns = [np.broadcast_to(x, shape).ravel().tolist() for x in args]
    return objects(list(itertools.starmap(op, zip(*columns, strict=True))), shape)


def by_jax(primitive, params: dict, args: list[np.ndarray]) -> list[np.ndarray]:
    """The results of an operation on known numbers."""
    with jax.ensure_compile_time_eval():
        found = primitive.bind(*args, **params)  # `asarray` would be a program for each shape
    return [np.asarray(x) for x in (found if primitive.multiple_results else [found])]


def move(eqn, args: list[np.ndarray]) -> list[np.ndarray]:
    """The results of an operation of `MOVES`."""
    name, params = eqn.primitive.name, dict(eqn.params)
    moved = range(len(args))[MOVES[name]]
    entries = [args[i].astype(object) for i in moved]
    if any(x.dtype == object for i, x in enumerate(args) if i not in moved):
        raise NotElementary(f"{name} at indices known only at run time")
    given = list(args)
    given[MOVES[name]] = entries
    found = rearrange(name, params, given)
    if found is not None:
        return found
    # The operation is applied to the indices of all entries, to see where each goes.
    if name == "gather":
        params["fill_value"] = -1
    starts = itertools.accumulate((x.size for x in entries), initial=0)
    given[MOVES[name]] = [
        n + np.arange(x.size).reshape(x.shape) for n, x in zip(starts, entries, strict=False)
    ]
    pool = np.concatenate([x.ravel() for x in entries])
    found = by_jax(eqn.primitive, params, given)
    if any((x < 0).any() for x in found):
        raise NotElementary(f"{name} at indices out of bounds")
    return [np.asarray(pool[x], object) for x in found]


def add_at(graph: Graph, eqn, args: list[np.ndarray]) -> list[np.ndarray]:
    """An array with other numbers added to entries of it."""
    x, places, added = args
    if places.dtype == object:
        raise NotElementary("scatter-add at indices known only at run time")
    found = x.astype(object)
    for at in np.ndindex(added.shape):
        one, nothing = np.zeros(added.shape), np.zeros(x.shape)
        one[at] = 1.0
        (goes,) = by_jax(eqn.primitive, eqn.params, [nothing, places, one])
        for to in zip(*np.nonzero(goes), strict=True):
            found[to] = graph.add(found[to], added[at])
    return [found]


def convert(graph: Graph, x: np.ndarray, kind: np.dtype, wanted: np.dtype) -> np.ndarray:
    """An array converted to another type, which must be that of real numbers."""
    if kind == wanted:
        return x
    if wanted != np.float64:
        raise NotElementary(f"conversion to {wanted}")
    return elementwise(graph.real, [x])


def fold(op: Callable, of_none: Number, x: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """The results of an operation on two numbers, repeated along axes; `of_none` for no numbers."""
    kept = [i for i in range(x.ndim) if i not in axes]
    n = math.prod(x.shape[i] for i in axes)
    rows = np.transpose(x, [*kept, *axes]).reshape([*(x.shape[i] for i in kept), n])
    found = np.empty([x.shape[i] for i in kept], object)
    for at in np.ndindex(found.shape):
        found[at] = functools.reduce(op, rows[at]) if n else of_none
    return found


def multiply(graph: Graph, a, b, contracted, batched) -> np.ndarray:
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


class Formulas(NamedTuple):
    """The formulas of a rate.

    Attributes:
      graph: the graph of all of them.
      time: the node of t.
      states: (k) the nodes of y.
      rates: (k) the nodes of dy/dt.
    """

    graph: Graph
    time: Node
    states: list[Node]
    rates: list[Number]


#: Operations along axes: the operation on two numbers that each repeats, and its result for none.
_FOLDED = {
    "reduce_sum": ("add", 0.0),
    "reduce_max": ("max", -math.inf),
    "reduce_min": ("min", math.inf),
    "reduce_and": ("and", True),
    "reduce_or": ("or", False),
}
_SAME = {"stop_gradient", "copy", "copy_p", "optimization_barrier"}
#: Rounds up to which loops are unrolled: each is traced separately.
_LONGEST_LOOP = 1000
#: Number of nodes above which formulas are given up, even while they are read: reading this many
#: takes a fifth of a second, and a four-bar linkage has 2900.
_MOST_NODES = 5_000


def formulas(
    program: jax.extend.core.ClosedJaxpr,
    t: Array,
    y: Array,
    expanding: bool = True,
    smooth: bool = True,
) -> Formulas:
    """The formulas of a rate.

    Args:
      program: ``jax.make_jaxpr`` of (t, y) -> dy/dt, whose other numbers may be known only at run
        time.
      t: () time.
      y: (k,) state.
      expanding: see `Graph`.
      smooth: see `Graph`.
    Raises:
      NotElementary: an operation of the field cannot be represented.
    """
    graph = Graph(expanding=expanding, smooth=smooth, most=_MOST_NODES)
    return _formulas_of(graph, program, t, y)


def exact_formulas(field: Callable, numbers: PyTree, t: Array, y: Array) -> Formulas:
    """The formulas of a rate for an arithmetic of more digits than that of floats.

    No operation on known numbers is rounded: instead it stays a node. A known number is exactly
    that binary float.

    Args:
      field: (numbers, t, y) -> (m,), of any length m.
      numbers: the parameters, a pytree of known floats.
      t: () time.
      y: (k,) state.
    Raises:
      NotElementary: an operation of the field cannot be represented.
    """
    known = [np.asarray(x, float).astype(object) for x in jax.tree.leaves(numbers)]
    program = jax.make_jaxpr(lambda t, y, n: field(n, t, y))(t, y, numbers)
    return _formulas_of(Graph(exact=True), program, t, y, known)


def trace(graph: Graph, function: Callable, *inputs: np.ndarray) -> list[np.ndarray]:
    """What a function of arrays returns for arrays of nodes and known numbers.

    Args:
      graph: the graph of the nodes.
      function: a function of arrays of floats that returns a pytree of them.
      inputs: its arguments, arrays of objects.
    Returns:
      The leaves of the result, as arrays of objects too.
    Raises:
      NotElementary: an operation of the function cannot be represented.
    """
    shapes = [jax.ShapeDtypeStruct(x.shape, float) for x in inputs]
    program = jax.make_jaxpr(function)(*shapes)
    _check_program(program)
    return _interpret(graph, program, inputs)


def _formulas_of(graph: Graph, program, t: Array, y: Array, known: Sequence = ()) -> Formulas:
    _check_program(program)
    time = graph.input(t, moving=True)
    states = [graph.input(y[i], moving=True) for i in range(len(y))]
    inputs = [objects([time], ()), objects(states, y.shape), *known]
    (rates,) = _interpret(graph, program, inputs)
    return Formulas(graph=graph, time=time, states=states, rates=rates.tolist())


def _check_program(closed) -> None:
    """Raise for a program with effects, such as prints, or arrays of other than numbers."""
    if closed.effects:
        raise NotElementary("a program with effects")
    for jaxpr in programs(closed.jaxpr):
        for eqn in jaxpr.eqns:
            for kind in (x.aval.dtype for x in (*eqn.invars, *eqn.outvars)):
                if jnp.issubdtype(kind, jax.dtypes.extended):
                    raise NotElementary(f"{eqn.primitive.name} of {kind}")


def _inputs(graph: Graph, x) -> np.ndarray:
    """An array of known numbers as it is; for other numbers, one node for each."""
    if not isinstance(x, jax.core.Tracer):
        return _as_known(graph, np.asarray(x))
    flat = x.ravel()
    return objects([graph.input(flat[i]) for i in range(x.size)], x.shape)


def _as_known(graph: Graph, x: np.ndarray) -> np.ndarray:
    """Known numbers in the form that the graph needs: floats as objects if they must stay exact."""
    return x.astype(object) if graph.exact and x.dtype == np.float64 else x


#: The values of the variables of a program.
_Values = dict[Any, np.ndarray]


def _interpret(graph: Graph, closed, inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The results of a program."""
    apply, known = (functools.partial(part, graph) for part in (_apply, _inputs))
    return interpret(closed, inputs, apply, known)


def _results(graph: Graph, jaxpr, eqns: Sequence, values: _Values) -> list[np.ndarray]:
    """What a program returns, after these of its operations."""
    for eqn in eqns:
        _carry_out(graph, eqn, values)
    return _read(graph, values, jaxpr.outvars)


def _carry_out(graph: Graph, eqn, values: _Values) -> None:
    """Add the results of one equation of a jaxpr to the values."""
    found = _apply(graph, eqn, _read(graph, values, eqn.invars))
    values |= dict(zip(eqn.outvars, found, strict=True))


def _read(graph: Graph, values: _Values, atoms: Sequence) -> list[np.ndarray]:
    def read(atom):
        is_literal = isinstance(atom, jax.extend.core.Literal)
        return _as_known(graph, np.asarray(atom.val)) if is_literal else values[atom]

    return [read(atom) for atom in atoms]


def _apply(graph: Graph, eqn, args: list[np.ndarray]) -> list[np.ndarray]:
    """Results of one equation of a jaxpr."""
    name, params = eqn.primitive.name, eqn.params
    if name in CALLS:
        called = params.get("name")
        if called == _SEARCH and any(x.dtype == object for x in args):
            return [_search(graph, eqn, *args)]
        inner = inner_program(eqn)
        by = _by_pieces if graph.written and called == _TABLE else _interpret
        return by(graph, inner, args)
    moved = MOVES.get(name, slice(0))
    if alternatives.occur(x for i, x in enumerate(args) if i not in range(len(args))[moved]):
        apply = functools.partial(_apply, graph, eqn)
        return alternatives.apply_to_each(graph, eqn, args, apply, moved)
    if not any(x.dtype == object for x in args):
        known = calculate(eqn, args) or by_jax(eqn.primitive, params, args)
        return [_as_known(graph, x) for x in known]
    if name == "scan" and (known := loop(eqn)) is not None:
        return _unroll(graph, eqn, known, args)
    if name == "cond" and args[0].dtype != object:
        # This occurs where a program depends on the platform.
        return _interpret(graph, params["branches"][int(args[0])], args[1:])
    if name in MOVES:
        return move(eqn, args)
    if name in _SAME:
        return args
    if name == "convert_element_type":
        kinds = eqn.invars[0].aval.dtype, np.dtype(params["new_dtype"])
        return [convert(graph, args[0], *kinds)]
    if name == "scatter-add":
        return add_at(graph, eqn, args)
    of_conditions = bool(eqn.invars) and eqn.invars[0].aval.dtype == bool
    if graph.written and name in ("ne", "xor") and of_conditions:  # the former is in `jnp.mod`
        return [elementwise(functools.partial(_differ, graph), args)]
    if name == "argmax" and of_conditions:
        return [alternatives.first_that_holds(args[0], *params["axes"])]
    _check_kinds(eqn)
    if name in _FOLDED:
        binary, of_none = _FOLDED[name]
        op = _scalar(graph, binary, {}, 1)
        return [fold(op, of_none, args[0], tuple(params["axes"]))]
    if name == "dot_general":
        return [multiply(graph, *args, *params["dimension_numbers"])]
    return [elementwise(_scalar(graph, name, params, len(args) - 1), args)]


#: Functions of JAX by the names of their programs: `jnp.searchsorted`, and `jnp.interp`.
_SEARCH, _TABLE = "searchsorted", "_interp"


def _search(
    graph: Graph, eqn, knots: np.ndarray, x: np.ndarray, *tangents: np.ndarray
) -> np.ndarray:
    """The places of numbers in a table, as `jnp.searchsorted` finds them, also in a derivative."""
    if not graph.written or knots.ndim != 1:
        raise NotElementary(
            "a search in a table, as in jnp.interp: write its pieces with jnp.where"
        )
    # An example shows on which side of equal numbers it puts a number.
    others = (np.zeros(a.shape) for a in (x, *tangents))
    (example,) = by_jax(eqn.primitive, eqn.params, [np.arange(float(len(knots))), *others])
    return alternatives.place(graph, knots, x, equal=bool(example.flat[0]))


def _by_pieces(graph: Graph, closed, inputs: list) -> list[np.ndarray]:
    """The program of `jnp.interp`, or of its derivative, once for each result of its search.

    With a known result it is one piece of the table, or what holds beyond one of its ends;
    comparisons with the knots decide which. The knots may be known only at run time, but must
    increase, as for the search.
    """
    jaxpr = closed.jaxpr
    searches = [i for i, eqn in enumerate(jaxpr.eqns) if eqn.params.get("name") == _SEARCH]
    if len(searches) != 1:
        return _interpret(graph, closed, inputs)
    (i,) = searches
    consts = (_inputs(graph, c) for c in closed.consts)
    values: _Values = dict(zip((*jaxpr.constvars, *jaxpr.invars), (*consts, *inputs), strict=True))
    search, after = jaxpr.eqns[i], jaxpr.eqns[i + 1 :]
    for eqn in jaxpr.eqns[:i]:
        if eqn.primitive.name == "sort" and any(
            a.dtype == object for a in _read(graph, values, eqn.invars)
        ):
            raise NotElementary("jnp.interp with a period, in a table of parameters")
        _carry_out(graph, eqn, values)
    (place,), (knots, x, *_) = search.outvars, _read(graph, values, search.invars)
    if knots.ndim != 1 or any(v.aval.shape != x.shape for v in (place, *jaxpr.outvars)):
        return _results(graph, jaxpr, (search, *after), values)

    def compared(op: str, k: int) -> np.ndarray:
        return elementwise(functools.partial(graph.compare, op), [x, np.asarray(knots[k])])

    n = len(knots)
    for k in range(n):
        elementwise(lambda a, b: graph.keep(graph.sub(a, b)), [x, np.asarray(knots[k])])
    below, beyond = compared("lt", 0).ravel().tolist(), compared("gt", n - 1).ravel().tolist()

    def piece(k: int) -> list[np.ndarray]:
        # The program's own comparisons with the ends are known as well, but for the last.
        known = dict.fromkeys(below, k == 0) | (dict.fromkeys(beyond, False) if k < n else {})
        here = values | {place: np.full(x.shape, k, place.aval.dtype)}
        found = _results(graph, jaxpr, after, here)
        return [elementwise(lambda a: _decided(graph, a, known), [each]) for each in found]

    def choice(first: int, last: int) -> list[np.ndarray]:
        if first == last:
            return piece(first)
        k = first if last - first <= alternatives.LONGEST_CHAIN else (first + last) // 2
        pairs = zip(choice(k + 1, last), choice(first, k), strict=True)
        which = compared("lt", k)
        return [elementwise(graph.select, [which, *pair]) for pair in pairs]

    return choice(0, n)


def _decided(graph: Graph, a: Number, known: dict) -> Number:
    """A number, with conditions in it replaced where they are known."""
    if not isinstance(a, Node):
        return a
    if a in known:
        return known[a]
    if a.op != "select":
        return a
    return graph.select(*(_decided(graph, each, known) for each in a.args))


def _check_kinds(eqn) -> None:
    """Raise unless numbers are 64-bit floats; booleans may only be combined, or select."""
    name = eqn.primitive.name
    ours = eqn.invars[1:] if name == "select_n" else eqn.invars
    binary, _ = _FOLDED.get(name, (name, None))
    of_booleans = binary in LOGIC or (name == "select_n" and ours[0].aval.dtype == bool)
    wanted = bool if of_booleans else float
    results = eqn.outvars if name == "dot_general" else []
    for kind in {a.aval.dtype for a in (*ours, *results)}:
        if kind != wanted:
            raise NotElementary(f"{name} of {kind}")


def _unroll(graph: Graph, eqn, known: Loop, args: list[np.ndarray]) -> list[np.ndarray]:
    """A loop of known length."""
    body, length, n, m = known.body, known.length, known.consts, known.carry
    consts, carry, xs = args[:n], args[n : n + m], args[n + m :]
    if length > _LONGEST_LOOP:
        raise NotElementary(f"a loop of {length} rounds")
    if not length:
        return [*carry, *(np.zeros(a.aval.shape, a.aval.dtype) for a in eqn.outvars[m:])]
    rows = []
    for i in range(length):
        at = length - 1 - i if known.reverse else i
        row = [np.asarray(x[at]) for x in xs]
        found = _interpret(graph, body, [*consts, *carry, *row])
        carry = found[:m]
        rows.append(found[m:])
    if known.reverse:
        rows.reverse()
    return [*carry, *(np.stack(column) for column in zip(*rows, strict=True))]


def _scalar(graph: Graph, name: str, params: dict, cases: int) -> Callable:
    """The operation on numbers, for entries one by one."""
    if not graph.smooth and name in ROUGH:
        # The arguments stay as they are: y - x and -(x - y) differ in the sign of a zero, and with
        # it the angle of a vector by 2 pi.
        return functools.partial(graph.node, name)
    if name in ("add", "add_any"):
        return graph.add
    if name in ("sub", "mul", "div", "neg"):
        return getattr(graph, name)
    if name in FUNCTIONS:
        return functools.partial(graph.function, name)
    if graph.exact and name in COMPOSED:
        return functools.partial(COMPOSED[name], graph)
    if name in COMPARISONS or name in LOGIC or name in TESTS:
        return functools.partial(_condition, graph, name)
    if name == "select_n":
        return graph.select if cases == 2 else lambda which, *found: found[which]
    if name == "rsqrt":
        return lambda a: graph.div(1.0, graph.function("sqrt", a))
    if name in ("square", "integer_pow"):
        return lambda a: graph.power(a, params.get("y", 2))
    if name == "one_minus_square":  # a primitive in derivatives, from JAX 0.11 on
        return lambda a: graph.mul(graph.sub(1.0, a), graph.add(1.0, a))
    if name == "pow":
        return functools.partial(_power, graph)
    if name == "abs":
        return lambda a: graph.select(_condition(graph, "lt", a, 0.0), a, graph.neg(a))
    if name in ("max", "min"):
        better = "gt" if name == "max" else "lt"
        return lambda a, b: graph.select(_condition(graph, better, a, b), b, a)
    if name == "clamp":
        larger, smaller = (_scalar(graph, bound, {}, 1) for bound in ("max", "min"))
        return lambda low, a, high: smaller(larger(a, low), high)
    raise NotElementary(name)


def _condition(graph: Graph, op: str, *args: Number) -> Number:
    """A condition; in a series only equality of moving numbers: others may change in a step."""
    if graph.smooth and op not in LOGIC and op not in ("eq", "ne"):
        if any(isinstance(a, Node) and a.moving for a in args):
            raise NotElementary("a condition on moving numbers")
    return graph.compare(op, *args)


def _differ(graph: Graph, a: Number, b: Number) -> Number:
    """Whether only one of two conditions holds."""
    if not isinstance(b, Node):
        return graph.compare("not", a) if b else a
    return graph.select(a, b, graph.compare("not", b))


def _power(graph: Graph, a: Number, n: Number) -> Number:
    if graph.smooth and isinstance(n, Node) and n.moving:
        raise NotElementary("a power with a moving exponent")
    return graph.power(a, n)


# ---- The formulas of a rate with the fewest products, which are the cost of series and evaluations


def topological_order(graph: Graph, results: list[Number]) -> list[Node]:
    """Nodes that the results depend on, except inputs, each after its operands.

    Products of several factors are split into products of two.
    """
    _factor_out(graph, [node for node in _reachable(results) if node.op == "product"])
    return [node for node in _reachable(results) if node.op != "input"]


def _reachable(results: list[Number]) -> list[Node]:
    found: dict[Node, None] = {}
    waiting: collections.deque[tuple[Number | None, bool]] = collections.deque()
    waiting.extend((x, False) for x in results)
    while waiting:
        node, seen = waiting.popleft()
        if not isinstance(node, Node) or node in found:
            continue
        if seen:
            found[node] = None
            # Sines and cosines need each other at the previous order.
            waiting.append((node.partner, False))
        else:
            waiting.appendleft((node, True))
            waiting.extendleft((a, False) for a in node.args)
    return list(found)


def _factor_out(graph: Graph, products: list[Node]) -> None:
    """Factor out the pair that most products share, until no product has more than two factors."""
    long = {node: list(node.args) for node in products if len(node.args) > 2}
    there = {node.args for node in products}
    while long:
        counts = collections.Counter(
            pair for factors in long.values() for pair in set(itertools.combinations(factors, 2))
        )

        def cost(pair, counts=counts):
            # Pairs that are needed anyway cost nothing.
            return pair not in there, -counts[pair], [a.index for a in pair]

        first, second = min(counts, key=cost)
        pair = graph.node("product", first, second)
        there.add((first, second))
        for node, factors in long.items():
            while len(factors) > 2 and _both_in(first, second, factors):
                factors.remove(first)
                factors.remove(second)
                factors.append(pair)
                factors.sort(key=lambda node: node.index)
            node.args = tuple(factors)
        long = {node: factors for node, factors in long.items() if len(factors) > 2}


def _both_in(a: Node, b: Node, factors: list[Node]) -> bool:
    return factors.count(a) > 1 if a is b else a in factors and b in factors


#: For each operation, the number of sums of products at each order of a series.
_ONE_PRODUCT_EACH = ("product", "div", "sqrt", "log", "exp", "sin", "cos", "tanh")
_PRODUCTS = dict.fromkeys(_ONE_PRODUCT_EACH, 1) | {"pow": 2}


def shortest(program: ClosedJaxpr, t: Array, y: Array, smooth: bool) -> tuple[Formulas, list[Node]]:
    """The formulas with the fewest products, and their nodes in order.

    Args:
      program: see `formulas`.
      t: () time.
      y: (k,) state.
      smooth: see `Graph`.
    Raises:
      NotElementary: see `formulas`.
    """
    found = formulas(program, t, y, smooth=smooth)
    best = found, topological_order(found.graph, found.rates)
    if found.graph.expanded:
        plain = formulas(program, t, y, expanding=False, smooth=smooth)
        best = min(
            best, (plain, topological_order(plain.graph, plain.rates)), key=lambda x: products(x[1])
        )
    return best


def products(nodes: list[Node]) -> int:
    """The number of sums of products at each order of a series: its cost."""
    return sum(_PRODUCTS.get(node.op, 0) for node in nodes if node.moving)


def is_guarded(nodes: list[Node]) -> bool:
    """Whether a formula has another case where a quantity equals some number exactly."""
    guards = (node for node in nodes if node.op in STEADY)
    return any(isinstance(a, Node) and a.moving for node in guards for a in node.args)


# ---- A rate evaluated by its formulas: repeated parts are computed once, parts that cancel never

#: Length of a state up to which formulas are used if there are any. Longer ones may be points in
#: arrays, whose loops the compiler vectorises: three bodies in space take 1.2 times as long by
#: formulas, Pleiades 1.3 times.
_MOST_NUMBERS = 11
#: Entries of arrays for each moving number from which on formulas are used for longer states too:
#: 34 in a satellite, 7 in three bodies.
_LEAST_SAVING = 20
#: Length of a state up to which formulas are sought at all.
_MOST_LOOKED_AT = 24
#: Most operations of a rate: finding formulas for a thousand takes a tenth of a second.
_MOST_OPERATIONS = 1000
#: Likewise, the most entries of all arrays of a rate.
_MOST_ENTRIES = 10_000
#: Nodes of the formulas for each operation on arrays: more are loops over long arrays, which the
#: compiler vectorises (a network of 24 neurons takes ten times as long by formulas).
_MOST_GROWTH = 4
#: Most moving numbers: 153 (five links) take half the time; with 270 (a chain hung at both ends)
#: derivatives compile twice as long as by arrays, with 430 (a four-bar linkage) three times.
_MOST_MOVING = 200
#: Operations whose derivatives formulas do not have, such as those with rules of their own.
_OWN_DERIVATIVES = frozenset({"stop_gradient"})


def simplify(rate: Rate) -> Rate:
    """The same rate by its formulas, for short states and where it has any.

    Rates composed of parts, or derived from energies, contain products with zeros, sums that
    cancel, angles written twice; XLA removes little of that, and calculates what several entries
    share once for each of them. By formulas a step of a pair takes 0.3 (a cart with a pendulum) to
    0.6 (a double pendulum) of the time, and a step with tangents 0.03 (a triple pendulum) to 0.5,
    since loops over the unknowns of a linear system, as in a mass matrix, are written out.

    Conditions, and functions without a Taylor series, are evaluated as they are.

    Limits: rates with derivatives of their own (``jax.custom_jvp``, `stop_gradient`) are left as
      they are. The derivative of the largest of three or more numbers at a tie is a different
      subgradient. A product or quotient with a known 0 is 0, and terms that cancel are 0, even
      where the numbers are infinite or NaN. Zeros may lose their signs.
    """

    def by_formulas(t: Array, y: Array) -> Array:
        if y.ndim > 1 or len(y) > _MOST_LOOKED_AT:
            return rate(t, y)
        program = jax.make_jaxpr(rate)(t, y)
        found = _short_formulas(program, t, y)
        if found is None:
            # Repeating its operations takes a tenth of the time of tracing the rate again.
            (plain,) = jaxpr_as_fun(program)(t, y)
            return plain
        formulas, nodes = found
        if formulas.rates == formulas.states:
            return y
        values: dict[Node, Value] = {n: n.value for n in (formulas.time, *formulas.states)}

        def at(a: Number) -> Value:
            return values[a] if isinstance(a, Node) else constant(a)

        for node in nodes:
            values[node] = value(node, at)
        rates = (at(x) for x in formulas.rates)
        return jnp.stack([jnp.zeros_like(t) if x is None else jnp.asarray(x) for x in rates])

    return by_formulas


def _short_formulas(program: ClosedJaxpr, t: Array, y: Array) -> tuple[Formulas, list[Node]] | None:
    """The formulas of a rate, where they exist and are not much longer than its program."""
    found = [eqn for jaxpr in programs(program.jaxpr) for eqn in jaxpr.eqns]
    names = {eqn.primitive.name for eqn in found}
    if names & _OWN_DERIVATIVES or any(name.startswith("custom_") for name in names):
        return None
    arrays = ((*eqn.invars, *eqn.outvars) for eqn in found)
    sizes = sum(max((a.aval.size for a in every), default=0) for every in arrays)
    if len(found) > _MOST_OPERATIONS or sizes > _MOST_ENTRIES:
        return None
    try:
        formulas, nodes = shortest(program, t, y, smooth=False)
    except NotElementary:
        return None
    moving = sum(node.moving for node in nodes)
    if len(nodes) > _MOST_GROWTH * len(found) or moving > _MOST_MOVING:
        return None
    many = len(y) > _MOST_NUMBERS and sizes < _LEAST_SAVING * moving
    return None if many else (formulas, nodes)
