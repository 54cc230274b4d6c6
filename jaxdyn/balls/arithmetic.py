"""Formulas evaluated in ball arithmetic: on numbers, on power series, on complex discs.

A ball [m +- r] of python-flint's `arb` contains the exact result of each operation whose operands
contain the exact operands (Johansson 2017, IEEE Transactions on Computers 66, 1281). A number
known to the program is the binary float that it is, exactly: 0.1 stands for 0.1000000000000000055,
and ``jnp.pi`` for the float nearest to pi.
"""

import contextlib
import dataclasses
import operator
from collections.abc import Callable, Iterator
from typing import Any

from jaxdyn._checks import fail
from jaxdyn.solvers.taylor.graph import COMPARISONS, LOGIC, TESTS, Graph, Node, Number
from jaxdyn.solvers.taylor.ordered import ordered

try:
    import flint
    from flint import acb, acb_poly, arb, arb_mat, arb_series
except ImportError as error:
    missing = "Install it: pip install 'jaxdyn[proof]'."
    raise fail("proof", "the package python-flint", "none", missing) from error

#: Kinds of numbers, for the other files.
__all__ = ["acb", "acb_poly", "arb", "arb_mat", "arb_series"]


@contextlib.contextmanager
def precision(bits: int, order: int = 1) -> Iterator[None]:
    """Calculate with this many bits, and with series up to this order."""
    before = flint.ctx.prec, flint.ctx.cap
    flint.ctx.prec, flint.ctx.cap = bits, order + 1
    try:
        yield
    finally:
        flint.ctx.prec, flint.ctx.cap = before


class Undecided(ArithmeticError):
    """Raised if a condition holds for some numbers of a ball and not for others."""


@dataclasses.dataclass(frozen=True)
class Functions:
    """The elementary functions of a kind of numbers.

    Attributes:
      analytic: whether the result must be NaN unless the function is analytic on the ball, as
        Cauchy's estimates need it.
    """

    analytic: bool = False

    def sqrt(self, x):
        """The root."""
        return x.sqrt(analytic=True) if self.analytic and isinstance(x, acb) else x.sqrt()

    def rsqrt(self, x):
        """One over the root."""
        return x.rsqrt(analytic=True) if self.analytic and isinstance(x, acb) else x.rsqrt()

    def log(self, x):
        """The logarithm."""
        return x.log(analytic=True) if self.analytic and isinstance(x, acb) else x.log()

    def tanh(self, x):
        """The hyperbolic tangent, which series lack."""
        return 1 - 2 / ((2 * x).exp() + 1)

    def power(self, x, n):
        """x to the power n; by roots where 2 n is whole."""
        if isinstance(n, float) and (2 * n).is_integer():
            half, odd = divmod(int(abs(2 * n)), 2)
            if not odd:
                return x**half if n >= 0 else 1 / x**half
            root = self.sqrt(x) if n >= 0 else self.rsqrt(x)
            return root * (root * root) ** half if half else root
        return (n * self.log(x)).exp()

    def apply(self, op: str, x):
        """An elementary function by its name."""
        own = getattr(self, op, None)
        return own(x) if own else getattr(x, op)()


REAL, COMPLEX = Functions(), Functions(analytic=True)


@dataclasses.dataclass(eq=False)
class Program:
    """Formulas in an order of computation.

    Attributes:
      results: what is computed: nodes and known numbers.
      nodes: all nodes that they depend on, operands first.
    """

    results: list[Number]
    nodes: list[Node]
    _steady: dict[int, dict[Node, Any]] = dataclasses.field(default_factory=dict)

    @classmethod
    def of(cls, graph: Graph, results: list[Number]) -> "Program":
        """The program of some results."""
        return cls(results, ordered(graph, results))

    def __call__(self, inputs: dict[Node, Any], functions: Functions = REAL) -> list:
        """The results for values of the inputs: arb, acb or series of them.

        Raises:
          Undecided: a condition holds for some of the numbers only.
        """
        values = self._constants() | inputs
        for node in self.nodes:
            if node not in values:
                values[node] = _value(node, values, functions)
        return [_at(r, values) for r in self.results]

    def _constants(self) -> dict[Node, Any]:
        """Values of the nodes that depend on no input, at the present precision."""
        bits = flint.ctx.prec
        if bits not in self._steady:
            values: dict[Node, Any] = {}
            for node in self.nodes:
                if not node.moving and node.op != "given" and _known(node, values):
                    values[node] = _value(node, values, REAL)
            self._steady[bits] = values
        return self._steady[bits]


def _known(node: Node, values: dict) -> bool:
    return all(a in values for a in node.args if isinstance(a, Node))


def _at(a: Number | None, values: dict):
    if isinstance(a, Node):
        return values[a]
    return a if isinstance(a, bool) else arb(a)


def _value(node: Node, values: dict, functions: Functions):
    op, args = node.op, node.args
    if op == "sum":
        return _sum(args, values)
    if op == "pow":
        exponent = args[1] if not isinstance(args[1], Node) else values[args[1]]
        return functions.power(_at(args[0], values), exponent)
    operands = [_at(a, values) for a in args]
    if op in _BINARY:
        return _BINARY[op](*operands)
    if op in COMPARISONS:
        moving = any(isinstance(a, Node) and a.moving for a in args)
        return _compared(op, *operands, at_one_point=not (functions.analytic and moving))
    if op in LOGIC:
        return _LOGIC[op](*operands)
    if op in TESTS:
        return operands[0].is_finite()
    if op == "select":
        return operands[2] if operands[0] else operands[1]
    if op == "real":
        return arb(int(operands[0]))
    return functions.apply(op, operands[0])


def _sum(args: tuple, values: dict):
    total = None
    for factor, term in zip(args[::2], args[1::2], strict=True):
        known = not isinstance(factor, Node)
        if term is None:
            part = _at(factor, values)
        elif known and abs(factor) == 1:
            part = values[term] if factor > 0 else -values[term]
        else:
            part = _at(factor, values) * values[term]
        total = part if total is None else total + part
    return total


def _compared(op: str, a, b, *, at_one_point: bool) -> bool:
    """A comparison that holds for all numbers of two balls, or for none.

    Of series it is that of their starts: a motion that leaves the case is noticed by the disc
    about the whole step, on which numbers are never equal (`at_one_point` is false).
    """
    a, b = (x[0] if isinstance(x, arb_series) else x for x in (a, b))
    if op in ("eq", "ne"):
        if not a.overlaps(b):
            return op == "ne"
        if at_one_point and a.is_exact() and b.is_exact():
            return op == "eq"
    elif a < b or a > b or (a.is_exact() and b.is_exact()):
        return bool(COMPARISONS[op](a, b))
    raise Undecided(f"whether {op} of {a} and {b}")


_BINARY: dict[str, Callable] = {
    **{"add": operator.add, "mul": operator.mul, "scale": operator.mul},
    **{"product": operator.mul, "div": operator.truediv},
}
_LOGIC = {"and": operator.and_, "or": operator.or_, "not": operator.not_}
