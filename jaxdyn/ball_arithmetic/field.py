"""A rate and its derivatives as programs for ball arithmetic."""

import dataclasses
import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.ball_arithmetic.arithmetic import REAL, Functions
from jaxdyn.ball_arithmetic.derivative import gradients
from jaxdyn.ball_arithmetic.program import Program
from jaxdyn.solvers.formulas.formulas import Formulas, exact_formulas
from jaxdyn.solvers.formulas.graph import Graph, Node, NotElementary, Number

_REMEDY = (
    "Digits and proofs need a rate of + - * / powers, roots, exp, log, circular and hyperbolic "
    "functions and their inverses, without conditions on what moves and without linear algebra."
)


@dataclasses.dataclass(eq=False)
class BallField:
    """The rate of a scene in ball arithmetic.

    Attributes:
      graph: the graph of all formulas.
      time: the node of t.
      states: (k) the nodes of y.
      rates: program of the k rates.
      slopes: program of the k rates, then their derivatives (k, k), row by row.
    """

    graph: Graph
    time: Node
    states: list[Node]
    rates: Program
    slopes: Program

    @property
    def k(self) -> int:
        """Number of entries of the state."""
        return len(self.states)

    @property
    def cases(self) -> list[Node]:
        """Comparisons of moving numbers in the rate, which a disc must prove to be unequal."""
        nodes = (node for node in self.rates.nodes if node.op in ("eq", "ne"))
        return [n for n in nodes if any(isinstance(a, Node) and a.moving for a in n.args)]

    def inputs(self, t, y: list) -> dict:
        """The inputs of the programs."""
        return {self.time: t, **dict(zip(self.states, y, strict=True))}

    def rate(self, t, y: list, functions: Functions = REAL) -> list:
        """(k) the rates."""
        return self.rates(self.inputs(t, y), functions)


def scene_formulas(scene: Scene, *others) -> tuple[Formulas, list[list[Number]]]:
    """The exact formulas of a scene's rate, and of other functions (scene, t, y) -> (m,).

    Raises:
      ValueError: the rate, or another function, is not made of elementary functions.
    """
    numbers, rest = eqx.partition(scene, eqx.is_inexact_array_like)
    sizes: list[int] = []

    def all_of_them(numbers, t, y):
        whole = eqx.combine(numbers, rest)
        parts = [whole.rate(t, y), *(jnp.ravel(other(whole, t, y)) for other in others)]
        sizes[:] = [len(part) for part in parts]
        return jnp.concatenate(parts)

    try:
        found = exact_formulas(all_of_them, numbers, np.zeros(()), jnp.asarray(scene.y0))
    except NotElementary as error:
        name = scene.name or type(scene.system).__name__
        raise fail(
            "scene", "a rate of elementary functions", f"{error} ({name})", _REMEDY
        ) from error
    ends = np.cumsum([0, *sizes])
    parts = [found.rates[a:b] for a, b in itertools.pairwise(ends)]
    return found._replace(rates=parts[0]), parts[1:]


def ball_field(formulas: Formulas) -> BallField:
    """The field that formulas define.

    Raises:
      ValueError: a rate has no derivative in formulas.
    """
    graph, states, rates = formulas.graph, formulas.states, list(formulas.rates)
    slopes = [s for row in gradients(graph, rates, states) for s in row]
    # This program comes first: both split the same products, and it has all of them.
    both = Program.of(graph, [*rates, *slopes])
    return BallField(
        graph=graph,
        time=formulas.time,
        states=states,
        rates=Program.of(graph, rates),
        slopes=both,
    )
