"""Comparisons at which a rate is continuous, proved from its program.

A contact written as ``where(x < 0, -k * x, 0)`` is as continuous as ``maximum(-k * x, 0)``: both
values are 0 where x = 0. This is proved, not read off numbers: every choice that a comparison a < b
decides has to be between two values that are equal wherever a = b, by rules such as these:

- where a = b, a and b are equal, a - b and b - a are 0;
- p q is 0 if p is 0 and q is finite; p + q = p if q is 0;
- the same continuous function of equal values has equal values.

Where these rules prove nothing, a jump is assumed, which takes longer to compile but is never
wrong.

A comparison a == b whose surface is also that of a jump gives the rate a value of its own there, as
static friction does. Motions are on such a surface up to rounding only, so it is reported.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn._numerics import is_smooth
from jaxdyn._programs import CALLS, inner_program, interpret

_ORDERS = {"lt": np.less, "le": np.less_equal, "gt": np.greater, "ge": np.greater_equal}
_LOGIC = frozenset({"and", "or", "xor", "not"})
#: Operations that move the entries of an array to other places.
_PLACES = frozenset({"broadcast_in_dim", "reshape", "squeeze", "slice", "concatenate", "stack"}) | {
    *("transpose", "reduce_sum", "rev")
}
_PRODUCTS = frozenset({"mul", "dot_general"})
_SUMS = frozenset({"add", "add_any"})
_COMMUTES = _SUMS | {"mul", "max", "min"}
#: Functions of one number that are continuous, finite for all numbers, and zero at zero.
_ODD = frozenset({"neg", "sin", "tanh", "sinh", "asinh", "atan", "abs", "square", "expm1", "erf"})
#: Likewise those that are not zero at zero.
_OTHER = frozenset({"cos", "cosh", "exp", "exp2", "logistic", "erfc"})
#: Lengths, which are not negative.
_LENGTHS = frozenset({"sqrt", "hypot"})
#: Continuous functions of each entry by itself.
_ENTRYWISE = _ODD | _OTHER | _COMMUTES | _LENGTHS | {"sub", "integer_pow", "select_n", "clamp"}
#: Functions that are finite where their operands are; some of them jump.
_FINITE = _ENTRYWISE | _PLACES | _PRODUCTS | _LOGIC | {"sign", *_ORDERS}
#: Largest depth of a proof that the two values of a choice are equal, in operations.
_DEEPEST = 40


@dataclasses.dataclass(frozen=True, eq=False)
class _Term:
    """A value of a program: an operation on others. The same one on the same values is one object.

    Attributes:
      op: name of the operation; "number" and "input" for what a program is given.
      args: its operands.
      number: the number of a "number", None if it has several.
      moves: whether it changes along a motion.
      scalar: whether it has one entry.
      power: the exponent of an "integer_pow".
      params: the parameters of the operation.
    """

    op: str
    args: tuple["_Term", ...] = ()
    number: float | None = None
    moves: bool = False
    scalar: bool = True
    power: int = 0
    params: str = ""


class Continuity(NamedTuple):
    """What is proved of a program where the outcomes of its comparisons change.

    Attributes:
      comparisons: ids of the comparisons at which all of its results are continuous.
      distinguishes: whether ``==`` tests for a surface at which the results jump, as in a law of
        friction that is larger at rest.
    """

    comparisons: frozenset[int] = frozenset()
    distinguishes: bool = False


def continuity(program: Any) -> Continuity:
    """Where the results of a program are continuous, as far as it is proved.

    Args:
      program: closed program of a rate, whose last two arguments are the time and the state.
    """
    graph = _Graph(program)
    continuous = {x: eqns for x, eqns in graph.comparisons.items() if graph.is_continuous_at(x)}
    jumps = [x for x in graph.live if x.op == "sign" or (x.op in _ORDERS and x not in continuous)]
    equal = [_difference(x) for x in graph.live if x.op in ("eq", "ne") and x.moves]
    return Continuity(
        frozenset().union(*continuous.values()),
        any(_is_same_surface(_difference(x), y) for x in jumps for y in equal),
    )


def _difference(term: "_Term") -> tuple["_Term", "_Term"]:
    """The values that are equal on the surface of a comparison or of a sign."""
    sides = term.args if len(term.args) == 2 else (term.args[0], _ZERO)
    for x, zero in (sides, sides[::-1]):
        if zero.number == 0 and x.op == "sub":
            return x.args[0], x.args[1]
    return sides[0], sides[1]


def _is_same_surface(a: tuple["_Term", "_Term"], b: tuple["_Term", "_Term"]) -> bool:
    return any(_same(a[0], x) and _same(a[1], y) for x, y in (b, b[::-1]))


class _Graph:
    """The values of a program on which its results depend, and what uses each of them."""

    def __init__(self, program: Any):
        self._terms: dict[tuple, _Term] = {}
        #: Comparisons, each with the ids of its operations.
        self.comparisons: dict[_Term, set[int]] = {}
        n = len(program.jaxpr.invars)
        inputs = [
            _Term("input", moves=i >= n - 2, scalar=not x.aval.shape)
            for i, x in enumerate(program.jaxpr.invars)
        ]
        self.results = interpret(program, inputs, self._apply, self._number)
        self.users: dict[_Term, list[_Term]] = {}
        #: The values on which the results depend.
        self.live: set[_Term] = set()
        pending = list(self.results)
        while pending:
            term = pending.pop()
            if term in self.live:
                continue
            self.live.add(term)
            for x in term.args:
                self.users.setdefault(x, []).append(term)
                pending.append(x)

    def _number(self, x: Any) -> _Term:
        if jnp.issubdtype(getattr(x, "dtype", float), jax.dtypes.extended):
            return _Term("number", scalar=False)  # a key of random numbers
        array = np.asarray(x)
        if array.size and array.dtype.kind in "fiub" and np.all(array == array.flat[0]):
            first = float(array.flat[0])
            return self._terms.setdefault(("number", first), _Term("number", number=first))
        return _Term("number", scalar=not array.shape)

    def _apply(self, eqn: Any, args: list[_Term]) -> list[_Term]:
        name, params = eqn.primitive.name, str(eqn.params)
        if name in CALLS:
            called = str(eqn.params.get("name", ""))
            if not is_smooth(called):
                # Also a function with a derivative of its own: only its value counts here.
                return interpret(inner_program(eqn), args, self._apply, self._number)
            name = called
        if name in _PLACES and len(args) == 1 and args[0].scalar and name != "reduce_sum":
            return list(args)  # a number and an array that has it in each entry are one value
        if name == "convert_element_type":
            if not _truncates(eqn):
                return list(args)
            name = "truncate"
        if name == "select_n" and (outcomes := _first_true(args)) is not None:
            return [self._first_case(outcomes, args[1:])]
        power = eqn.params["y"] if name == "integer_pow" else 0
        made = [
            self._term(name, args, f"{i} {params}", power, not var.aval.shape)
            for i, var in enumerate(eqn.outvars)
        ]
        if name in _ORDERS:
            self.comparisons.setdefault(made[0], set()).add(id(eqn))
        return made

    def _term(
        self, op: str, args: Sequence[_Term], params: str, power: int = 0, scalar: bool = True
    ) -> _Term:
        moves = any(x.moves for x in args)
        new = _Term(op, tuple(args), None, moves, scalar, power, params)
        return self._terms.setdefault((op, params, *map(id, args)), new)

    def _first_case(self, outcomes: Sequence[_Term], cases: Sequence[_Term]) -> _Term:
        """The case of the first outcome that holds, as in ``jnp.select``; else the first case."""
        value = cases[0]
        for outcome, case in list(zip(outcomes, cases, strict=True))[:0:-1]:
            value = self._term("select_n", [outcome, value, case], "")
        return value

    def is_continuous_at(self, comparison: _Term) -> bool:
        """Whether no result jumps where the outcome of a comparison changes."""
        surface = _Surface(*comparison.args, single=comparison.scalar)
        jumping, visited = [comparison], {comparison}
        while jumping:
            term = jumping.pop()
            if any(term is x for x in self.results):
                return False
            for user in self.users.get(term, ()):
                if user in visited or surface.absorbs(user, term):
                    continue
                if not surface.keeps_places(user):
                    return False
                visited.add(user)
                jumping.append(user)
        return True


_ZERO = _Term("number", number=0.0)


class _Surface:
    """The surface a = b of a comparison, and which values are equal on it.

    Args:
      a: a value of a program.
      b: the value with which it is compared.
      single: whether both have one entry; if not, each entry has a surface of its own.
    """

    def __init__(self, a: _Term, b: _Term, single: bool):
        self._sides = (a, b), (b, a)
        self._single = single
        self._found: dict[tuple[str, _Term, _Term], bool] = {}

    def equal(self, f: _Term, g: _Term, depth: int = _DEEPEST) -> bool:
        """Whether two values are proved to be equal on the surface."""
        if _same(f, g) or self._meet(f, g):
            return True
        if not depth:
            return False
        key = "equal", f, g
        if key not in self._found:
            rules = (
                self._by_cases,
                self._by_terms,
                self._by_ratio,
                self._by_zeros,
                self._by_operands,
            )
            self._found[key] = any(prove(f, g, depth - 1) for prove in rules)
        return self._found[key]

    def keeps_places(self, term: _Term) -> bool:
        """Whether each entry of a result belongs to the same surface as that of its operand."""
        return self._single or term.op in _ENTRYWISE or term.op in _LOGIC or term.op == "div"

    def absorbs(self, term: _Term, jumping: _Term) -> bool:
        """Whether an operation on a value that jumps on the surface has a continuous result."""
        others = [x for x in term.args if x is not jumping]
        if term.op == "select_n" and term.args[0] is jumping:
            return len(others) == 2 and self.equal(*others)
        if term.op == "mul" and len(others) == 1:
            return self._is_zero(others[0], _DEEPEST) and self._is_finite(jumping, _DEEPEST)
        return False

    def _meet(self, f: _Term, g: _Term) -> bool:
        return any(_same(f, x) and _same(g, y) for x, y in self._sides)

    def _by_cases(self, f: _Term, g: _Term, depth: int) -> bool:
        """By the cases of a choice: all of them, or the one that is taken on the surface."""
        for x, y in ((f, g), (g, f)):
            if x.op == "select_n":
                outcome = self._outcome(x.args[0])
                cases = x.args[1:] if outcome is None else (x.args[1 + outcome],)
                if all(self.equal(case, y, depth) for case in cases):
                    return True
        return False

    def _by_terms(self, f: _Term, g: _Term, depth: int) -> bool:
        """By leaving out a term that is zero."""
        for x, y in ((f, g), (g, f)):
            if x.op == "sub" or x.op in _SUMS:
                p, q = x.args
                if self._is_zero(q, depth) and self.equal(p, y, depth):
                    return True
                if x.op != "sub" and self._is_zero(p, depth) and self.equal(q, y, depth):
                    return True
        return False

    def _by_ratio(self, f: _Term, g: _Term, depth: int) -> bool:
        """As the ratio of equal values, which is 1."""
        for x, y in ((f, g), (g, f)):
            if x.op == "div" and y.number == 1:
                p, q = x.args
                if self._is_nonzero(q) and self.equal(p, q, depth):
                    return True
        return False

    def _by_zeros(self, f: _Term, g: _Term, depth: int) -> bool:
        return self._is_zero(f, depth) and self._is_zero(g, depth)

    def _by_operands(self, f: _Term, g: _Term, depth: int) -> bool:
        """As the same continuous function of operands that are equal."""
        if f.op != g.op or f.params != g.params or len(f.args) != len(g.args):
            return False
        if f.op == "div":
            continuous = self._is_nonzero(f.args[1]) and self._is_nonzero(g.args[1])
        else:
            continuous = f.op in _ENTRYWISE or (self._single and f.op in _PLACES | _PRODUCTS)
        if not continuous:
            return False
        orders = (f.args, f.args[::-1]) if f.op in _COMMUTES else (f.args,)
        return any(
            all(self.equal(x, y, depth) for x, y in zip(order, g.args, strict=True))
            for order in orders
        )

    def _outcome(self, condition: _Term) -> int | None:
        """The outcome of a comparison of two different numbers on the surface; None for another."""
        if condition.op not in _ORDERS:
            return None
        a, b = map(self._value, condition.args)
        return None if a is None or b is None or a == b else int(_ORDERS[condition.op](a, b))

    def _value(self, x: _Term) -> float | None:
        return next((y.number for side, y in self._sides if side is x), x.number)

    def _is_zero(self, x: _Term, depth: int) -> bool:
        if x.number == 0 or self._meet(x, _ZERO):
            return True
        if not depth or not x.args:
            return False
        key = "zero", x, x
        if key not in self._found:
            self._found[key] = self._vanishes(x, depth - 1)
        return self._found[key]

    def _vanishes(self, x: _Term, depth: int) -> bool:
        """Whether the values of its operands make a result zero."""
        p, q = (*x.args, *x.args)[:2]
        if x.op == "sub":
            return self.equal(p, q, depth)
        if x.op in _SUMS:
            both = self._is_zero(p, depth) and self._is_zero(q, depth)
            return both or self._opposite(p, q, depth) or self._opposite(q, p, depth)
        if x.op == "mul" or (x.op in _PRODUCTS and self._single):
            return any(
                self._is_zero(u, depth) and self._is_finite(v, depth) for u, v in ((p, q), (q, p))
            )
        if x.op == "div":
            return self._is_zero(p, depth) and self._is_nonzero(q)
        if x.op == "select_n":
            return self.equal(x, _ZERO, depth)
        if x.op in ("max", "min", "hypot") or (x.op in _PLACES and self._single):
            return all(self._is_zero(y, depth) for y in x.args)
        positive = x.power > 0 or (x.op == "pow" and q.number is not None and q.number > 0)
        return (x.op in _ODD or x.op == "sqrt" or positive) and self._is_zero(p, depth)

    def _opposite(self, p: _Term, q: _Term, depth: int) -> bool:
        """Whether p is proved to be -q on the surface."""
        if p.number is not None:
            return self.equal(q, _Term("number", number=-p.number), depth)
        ends = [p, *(y for x, y in self._sides if x is p)]
        return any(x.op == "neg" and self.equal(x.args[0], q, depth) for x in ends)

    def _is_finite(self, x: _Term, depth: int) -> bool:
        """Whether a value is finite on the surface, so that its product with zero is zero."""
        if not x.moves or x.op == "input":
            return True
        if x.op == "div":
            return self._is_nonzero(x.args[1]) and self._is_finite(x.args[0], depth - 1)
        if not (x.op in _FINITE and x.power >= 0 and depth):
            return False
        key = "finite", x, x
        if key not in self._found:
            self._found[key] = all(self._is_finite(y, depth - 1) for y in x.args)
        return self._found[key]

    def _is_nonzero(self, x: _Term) -> bool:
        """Whether a divisor is not zero on the surface.

        A parameter is not, or else the rate is infinite. Nor is a length on the surface where it
        equals a parameter, as that of a rope which becomes tight: if the parameter is zero, no
        motion crosses that surface.
        """
        steady = any(side is x and not y.moves for side, y in self._sides)
        return not x.moves or (x.op in _LENGTHS and steady)


def _first_true(args: Sequence[_Term]) -> Sequence[_Term] | None:
    """The outcomes of which the first that holds chooses the case; None for another choice.

    ``jnp.select`` chooses in this way; it puts an outcome that never holds before the others.
    """
    which = args[0]
    if which.op != "argmax" or which.args[0].op not in ("stack", "concatenate"):
        return None
    outcomes = which.args[0].args
    known = len(outcomes) == len(args) - 1 and outcomes[0].number == 0
    return outcomes if known and all(x.scalar for x in outcomes) else None


def _same(x: _Term, y: _Term) -> bool:
    return x is y or (x.number is not None and x.number == y.number)


def _truncates(eqn: Any) -> bool:
    """Whether a conversion turns floats into whole numbers."""
    old, new = eqn.invars[0].aval.dtype, eqn.params["new_dtype"]
    return jnp.issubdtype(old, jnp.floating) and not jnp.issubdtype(new, jnp.floating)
