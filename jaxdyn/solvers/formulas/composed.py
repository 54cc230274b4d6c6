"""Functions made of others, for an arithmetic in which cancellation is no concern.

In doubles sinh x = (exp x - exp -x) / 2 is all rounding near 0; in balls more bits make up for it.
"""

from collections.abc import Callable

from jaxdyn.solvers.formulas.graph import Graph, Number


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
    """Half the angle, whose tangent has no jump but on the negative x axis."""
    r = graph.function("sqrt", graph.add(graph.mul(x, x), graph.mul(y, y)))
    half = graph.div(y, graph.add(r, x))
    return graph.mul(2.0, graph.function("atan", half))


def _asinh(graph: Graph, a: Number) -> Number:
    root = graph.function("sqrt", graph.add(1.0, graph.mul(a, a)))
    return graph.function("log", graph.add(a, root))


#: By the names of JAX's primitives.
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
