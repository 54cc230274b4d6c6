"""A rate evaluated by its formulas: repeated parts are computed once, parts that cancel never."""

import collections
import itertools

import jax
import jax.numpy as jnp
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun
from jaxtyping import Array

from jaxdyn.solvers.formulas.formulas import Formulas, formulas
from jaxdyn.solvers.formulas.graph import STEADY, Graph, Node, NotElementary, Number
from jaxdyn.solvers.formulas.values import Value, constant, value
from jaxdyn.solvers.method import Rate, programs

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
    moving = (any(isinstance(a, Node) and a.moving for a in node.args) for node in nodes)
    return any(m and node.op in STEADY for m, node in zip(moving, nodes, strict=True))


# ---- A rate evaluated by its formulas: repeated parts are computed once, parts that cancel never

#: Length of a state up to which formulas are used if there are any. Longer ones may be points in
#: arrays, whose loops the compiler vectorises: three bodies in space take 1.2 times as long by
#: formulas, Pleiades 1.3 times.
_MOST_NUMBERS = 11
#: Entries of arrays for each moving number from which on formulas are used for longer states too:
#: 34 in a satellite, 7 in three bodies.
_LEAST_SAVING = 20
#: Length of a state up to which formulas are looked for at all.
_MOST_LOOKED_AT = 24
#: Most operations of a rate: finding formulas for a thousand takes a tenth of a second.
_MOST_OPERATIONS = 1000
#: Likewise, the most entries of all arrays of a rate.
_MOST_ENTRIES = 10_000
#: Nodes of the formulas for each operation on arrays: more are loops over long arrays, which the
#: compiler vectorises (a network of 24 neurons takes ten times as long by formulas).
_MOST_NODES = 4
#: Most moving numbers: 153 (five links) take half the time; with 270 (a chain hung at both ends)
#: derivatives compile twice as long as by arrays, with 430 (a four-bar linkage) three times.
_MOST_MOVING = 200
#: Operations whose derivatives formulas do not have, such as those with rules of their own.
_AGREED = frozenset({"stop_gradient"})


def simplify(rate: Rate) -> Rate:
    """The same rate by its formulas, for short states and where it has any.

    Rates composed of parts, or derived from energies, contain products with zeros, sums that
    cancel, angles written twice; XLA removes little of that, and calculates what several entries
    share once for each of them. By formulas a step of a pair takes 0.3 (a cart with a pendulum) to
    0.6 (a double pendulum) of the time, and a step with tangents 0.03 (a triple pendulum) to 0.5,
    since loops over the unknowns of a linear system, as in a mass matrix, are written out.

    Conditions, and functions without a Taylor series, are evaluated as they stand.

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
    if names & _AGREED or any(name.startswith("custom_") for name in names):
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
    if len(nodes) > _MOST_NODES * len(found) or moving > _MOST_MOVING:
        return None
    many = len(y) > _MOST_NUMBERS and sizes < _LEAST_SAVING * moving
    return None if many else (formulas, nodes)
