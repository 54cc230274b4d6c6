"""Derivatives of formulas as formulas, in the same graph.

The graph is differentiated, not the program by JAX: so what is differentiated is exactly what is
evaluated, with no constant rounded on the way, and both share their nodes.
"""

from collections.abc import Callable

from jaxdyn.solvers.formulas.graph import STEADY, Graph, Node, NotElementary, Number


def gradients(graph: Graph, results: list[Number], by: list[Node]) -> list[list[Number]]:
    """The derivatives (m, n) of m results by n inputs; 0.0 where a result does not depend on one.

    Raises:
      NotElementary: an operation has no derivative here.
    """
    found: dict[Node, dict[Node, Number]] = {node: {node: 1.0} for node in by}
    for result in results:
        _visit(graph, result, found)
    each = (found[r] if isinstance(r, Node) else {} for r in results)
    return [[slopes.get(node, 0.0) for node in by] for slopes in each]


def _visit(graph: Graph, result: Number, found: dict[Node, dict[Node, Number]]) -> None:
    """Fill in the slopes of a node and of all that it depends on, operands first."""
    waiting: list[tuple[Number | None, bool]] = [(result, False)]
    while waiting:
        node, ready = waiting.pop()
        if not isinstance(node, Node) or node in found:
            continue
        if ready:
            found[node] = _slopes(graph, node, found)
        else:
            waiting.append((node, True))
            waiting.extend((a, False) for a in node.args)


def _slopes(graph: Graph, node: Node, found: dict) -> dict[Node, Number]:
    if node.op in STEADY or not any(found[a] for a in node.args if isinstance(a, Node)):
        return {}
    if node.op not in _RULES:
        raise NotElementary(f"the derivative of {node.op}")
    total: dict[Node, Number] = {}
    for operand, factor in _RULES[node.op](graph, node):
        for by, slope in found.get(operand, {}).items():
            total[by] = graph.add(total.get(by, 0.0), graph.mul(factor, slope))
    return {by: slope for by, slope in total.items() if isinstance(slope, Node) or slope != 0}


def _sum(graph: Graph, node: Node) -> list:
    return [pair for pair in zip(node.args[1::2], node.args[::2], strict=True)]


def _product(graph: Graph, node: Node) -> list:
    pairs = []
    for i, factor in enumerate(node.args):
        rest: Number = 1.0
        for j, other in enumerate(node.args):
            rest = rest if i == j else graph.mul(rest, other)
        pairs.append((factor, rest))
    return pairs


def _div(graph: Graph, node: Node) -> list:
    a, b = node.args
    return [(a, graph.div(1.0, b)), (b, graph.neg(graph.div(node, b)))]


def _pow(graph: Graph, node: Node) -> list:
    a, n = node.args
    return [(a, graph.mul(n, graph.div(node, a)))]


def _select(graph: Graph, node: Node) -> list:
    which, no, yes = node.args
    one, zero = 1.0, 0.0
    return [(no, graph.select(which, one, zero)), (yes, graph.select(which, zero, one))]


def _of_one(slope: Callable[[Graph, Node], Number]) -> Callable:
    return lambda graph, node: [(node.args[0], slope(graph, node))]


#: (operand, partial derivative) of each operand of an operation.
_RULES: dict[str, Callable[[Graph, Node], list]] = {
    **{"sum": _sum, "product": _product, "mul": _product, "div": _div, "pow": _pow},
    **{"select": _select},
    "scale": lambda graph, node: [(node.args[1], node.args[0])],
    "add": lambda graph, node: [(node.args[0], 1.0), (node.args[1], 1.0)],
    "sqrt": _of_one(lambda graph, node: graph.div(0.5, node)),
    "exp": _of_one(lambda graph, node: node),
    "log": _of_one(lambda graph, node: graph.div(1.0, node.args[0])),
    "sin": _of_one(lambda graph, node: graph.function("cos", node.args[0])),
    "cos": _of_one(lambda graph, node: graph.neg(graph.function("sin", node.args[0]))),
    "atan": _of_one(
        lambda graph, node: graph.div(1.0, graph.add(1.0, graph.mul(node.args[0], node.args[0])))
    ),
    "tanh": _of_one(lambda graph, node: graph.sub(1.0, graph.mul(node, node))),
}
