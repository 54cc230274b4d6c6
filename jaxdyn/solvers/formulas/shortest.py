"""The formulas of a rate with the fewest products, by which series and evaluations take longest."""

from jax.extend.core import ClosedJaxpr
from jaxtyping import Array

from jaxdyn.solvers.formulas.formulas import Formulas, formulas
from jaxdyn.solvers.formulas.nodes import STEADY, Node
from jaxdyn.solvers.formulas.topological_order import ordered

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
    best = found, ordered(found.graph, found.rates)
    if found.graph.expanded:
        plain = formulas(program, t, y, expanding=False, smooth=smooth)
        best = min(best, (plain, ordered(plain.graph, plain.rates)), key=lambda x: products(x[1]))
    return best


def products(nodes: list[Node]) -> int:
    """Number of sums of products of each order of a series: its cost."""
    return sum(_PRODUCTS.get(node.op, 0) for node in nodes if node.moving)


def is_guarded(nodes: list[Node]) -> bool:
    """Whether a formula has another case where a quantity equals some number exactly."""
    moving = (any(isinstance(a, Node) and a.moving for a in node.args) for node in nodes)
    return any(m and node.op in STEADY for m, node in zip(moving, nodes, strict=True))
