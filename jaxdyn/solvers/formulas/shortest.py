"""The formulas of a rate with the fewest products, by which series and evaluations take longest."""

import collections
import itertools

from jax.extend.core import ClosedJaxpr
from jaxtyping import Array

from jaxdyn.solvers.formulas.formulas import Formulas, formulas
from jaxdyn.solvers.formulas.graph import STEADY, Graph, Node, Number


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
            # Sines and cosines need each other, at the order before.
            waiting.append((node.partner, False))
        else:
            waiting.appendleft((node, True))
            waiting.extendleft((a, False) for a in node.args)
    return list(found)


def _factor_out(graph: Graph, products: list[Node]) -> None:
    """Factor the pair that most products share out of all of them, repeatedly."""
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


#: Number of sums of products of an operation at each order of a series.
_ONE_PRODUCT_EACH = ("product", "div", "sqrt", "log", "exp", "sin", "cos", "tanh")
_PRODUCTS = dict.fromkeys(_ONE_PRODUCT_EACH, 1) | {"pow": 2}


def shortest(program: ClosedJaxpr, t: Array, y: Array, smooth: bool) -> tuple[Formulas, list[Node]]:
    """The formulas with the fewest products, and their nodes in order.

    Args:
      program: see `formulas`.
      t: () time.
      y: (k,) state.
      smooth: of their `Graph`.
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
    """Number of sums of products of each order of a series: its cost."""
    return sum(_PRODUCTS.get(node.op, 0) for node in nodes if node.moving)


def is_guarded(nodes: list[Node]) -> bool:
    """Whether a formula has another case where a quantity equals some number exactly."""
    moving = (any(isinstance(a, Node) and a.moving for a in node.args) for node in nodes)
    return any(m and node.op in STEADY for m, node in zip(moving, nodes, strict=True))
