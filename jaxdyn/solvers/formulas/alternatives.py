"""Whole numbers that conditions decide, such as the place of a number in a table.

Formulas have real numbers and conditions only. A whole number with few possible values is carried
as these, with the conditions for each; an operation on it is carried out once for each value, as
for known numbers, and conditions choose among the results. So a table that `jnp.searchsorted` reads
becomes a choice among its entries, and `jnp.select` one among its cases.
"""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from jaxdyn.solvers.formulas.graph import Graph, Node, NotElementary, Number

#: Most values that are compared one after the other, which reads well; more are bisected.
LONGEST_CHAIN = 8


@dataclasses.dataclass(frozen=True, eq=False)
class Alternatives:
    """One of several known numbers: that of the first condition that holds, or else the last one.

    Attributes:
      conditions: one fewer than the values.
      values: whole numbers, or booleans.
      ordered: whether after one that holds all further conditions hold.
    """

    conditions: tuple[Number, ...]
    values: tuple[Any, ...]
    ordered: bool = False

    def choose(self, graph: Graph, cases: Sequence[Number]) -> Number:
        """The case, of one for each value, that belongs to the value taken."""

        def among(first: int, last: int) -> Number:
            if first == last:
                return cases[first]
            halve = self.ordered and last - first > LONGEST_CHAIN
            k = (first + last) // 2 if halve else first
            return graph.select(self.conditions[k], among(k + 1, last), among(first, k))

        return among(0, len(cases) - 1)


def first_that_holds(conditions: np.ndarray, axis: int) -> np.ndarray:
    """The index along an axis of the first condition that holds; 0 if none does."""
    rows = np.moveaxis(conditions, axis, 0)
    values = (*range(len(rows)), 0)
    found = np.empty(rows.shape[1:], object)
    for at in np.ndindex(found.shape):
        found[at] = Alternatives(tuple(rows[(i, *at)] for i in range(len(rows))), values)
    return found


def place(graph: Graph, knots: np.ndarray, x: np.ndarray, equal: bool) -> np.ndarray:
    """The number of knots below each number; with `equal` of those that are not above it."""
    values, op = tuple(range(len(knots) + 1)), "lt" if equal else "le"
    found = np.empty(x.shape, object)
    for at in np.ndindex(x.shape):
        conditions = tuple(graph.compare(op, x[at], knot) for knot in knots)
        found[at] = Alternatives(conditions, values, ordered=True)
    return found


def occur(args: Iterable[np.ndarray]) -> bool:
    """Whether there are alternatives among the entries of arrays."""
    return any(_alternatives(x) for x in args)


#: Operations on numbers one by one.
_ONE_BY_ONE = frozenset(
    "abs add and clamp convert_element_type div eq floor ge gt le lt max min mul ne neg not or pow "
    "rem round select_n sign sub xor".split()
)


def apply_to_each(
    graph: Graph, eqn, args: Sequence[np.ndarray], apply: Callable, moved: slice
) -> list[np.ndarray]:
    """The results of an operation on arrays with alternatives among their entries.

    Args:
      graph: where the results are.
      eqn: the operation.
      args: its arguments.
      apply: takes arguments without alternatives to the results.
      moved: the arguments that it only moves, such as the entries of a table.
    Raises:
      NotElementary: a result depends on several whole numbers that are not known.
    """
    known = {a.conditions: a for x in args for a in _alternatives(x)}
    tried = {
        conditions: [apply(_with_values(eqn, args, conditions, i)) for i in range(len(each.values))]
        for conditions, each in known.items()
    }
    found = []
    for n, depends in enumerate(_dependence(eqn, args, apply, known, moved)):
        result = np.empty(depends.shape, object)
        for at in np.ndindex(result.shape):
            if len(depends[at]) > 1:
                raise NotElementary(f"{eqn.primitive.name} of several places in tables")
            for conditions in depends[at] or list(known)[:1]:
                cases = [_entry(each[n], at) for each in tried[conditions]]
                result[at] = _combine(graph, known[conditions], cases)
        every = not any(isinstance(a, Node | Alternatives) for a in result.flat)
        found.append(result.astype(eqn.outvars[n].aval.dtype) if every else result)
    return found


def _alternatives(x: np.ndarray) -> list[Alternatives]:
    entries = x.flat if x.dtype == object else ()
    return [a for a in entries if isinstance(a, Alternatives)]


def _with_values(eqn, args: Sequence[np.ndarray], conditions: tuple, i: int) -> list[np.ndarray]:
    """The arguments, with the value i of the alternatives that some conditions decide."""

    def value(a):
        if not isinstance(a, Alternatives):
            return a
        return a.values[i if a.conditions == conditions else 0]

    given = []
    for x, var in zip(args, eqn.invars, strict=True):
        if not _alternatives(x):
            given.append(x)
            continue
        here = np.empty(x.shape, object)
        here.flat = [value(a) for a in x.flat]
        nodes = any(isinstance(a, Node) for a in here.flat)
        given.append(here if nodes else here.astype(var.aval.dtype))
    return given


def _dependence(
    eqn, args: Sequence[np.ndarray], apply: Callable, known: dict, moved: slice
) -> list[np.ndarray]:
    """For each result, and each entry of it, the conditions on which it depends."""

    def decided_by(a) -> frozenset:
        return frozenset([a.conditions]) if isinstance(a, Alternatives) else frozenset()

    shapes = [var.aval.shape for var in eqn.outvars]
    found = [np.full(shape, frozenset(known), object) for shape in shapes]
    if len(known) == 1:
        return found
    if eqn.primitive.name in _ONE_BY_ONE:
        (shape,) = shapes
        columns = [np.broadcast_to(x, shape).astype(object) for x in args]
        for at in np.ndindex(shape):
            found[0][at] = frozenset().union(*(decided_by(x[at]) for x in columns))
        return found
    if not args[moved] or any(_alternatives(x) for x in args[moved]):
        return found
    # Where an entry comes from shows with entries that all differ.
    numbers = list(args)
    numbers[moved] = [np.arange(float(x.size)).reshape(x.shape) for x in args[moved]]
    where = {
        conditions: [apply(_with_values(eqn, numbers, conditions, i)) for i in range(len(a.values))]
        for conditions, a in known.items()
    }
    for n, shape in enumerate(shapes):
        for at in np.ndindex(shape):
            found[n][at] = frozenset(
                conditions
                for conditions, many in where.items()
                if not all(each[n][at] == many[0][n][at] for each in many)
            )
    return found


def _entry(x: np.ndarray, at: tuple[int, ...]) -> Any:
    a = x[at]
    return a if isinstance(a, Node | Alternatives) or not hasattr(a, "item") else a.item()


def _combine(graph: Graph, index: Alternatives, cases: list) -> Any:
    """One number from its cases, one for each value of a whole number."""
    if any(isinstance(a, Alternatives) for a in cases):
        raise NotElementary("a place in a table that depends on another one")
    if any(isinstance(a, Node | float) for a in cases):
        return index.choose(graph, cases)
    same = all(a == cases[0] for a in cases)
    return cases[0] if same else dataclasses.replace(index, values=tuple(cases))
