"""Expressions in the language of XPPAUT: how they are read, and their values.

The order of operations is XPPAUT's own, which differs from that of other languages. Comparisons
bind as tightly as powers, and both associate to the left: ``v*2>1`` is v (2 > 1), and ``2^3^2`` is
64. Then follow ``* / &`` and the signs, and last ``+ - |``. A condition is a number: 1 if it holds,
else 0. Angles are in radians, ``log`` is the natural logarithm, and ``mod(a, b)`` is the remainder
of a/b towards zero, plus b where that is negative. ``not`` after an operator other than ``+ - |``
is refused: there XPPAUT applies it to more than the next operand. The arguments of a function are
known in its own expression only, not in those of functions that it calls.

Reference: XPPAUT 6.11, with whose values the tests compare.
"""

import math
import operator
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import _checks

NAME = r"[a-z_]\w*"
_TOKEN = re.compile(
    rf"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)|(?P<name>{NAME})"
    r"|(?P<sign>\*\*|<=|>=|==|!=|[-+*/^<>&|(),~]))"
)
#: How tightly operators bind.
_SUM, _PRODUCT, _POWER = 1, 2, 3
_STRENGTH = {
    **dict.fromkeys(("+", "-", "|"), _SUM),
    **dict.fromkeys(("*", "/", "&"), _PRODUCT),
    **dict.fromkeys(("^", "**", "<", ">", "<=", ">=", "==", "!="), _POWER),
}
_NEGATIVE, _NOT, _IF = "negative", "not", "if"
#: Deepest nesting of operations: evaluation takes a frame of Python's stack for each.
DEEPEST = 200


class Call(NamedTuple):
    """An operation, or a function, of expressions.

    Attributes:
      name: the sign of the operation, or the name of the function.
      arguments: what it is applied to.
    """

    name: str
    arguments: tuple["Expression", ...]


#: A number, a name or a call.
Expression: TypeAlias = float | str | Call


class Function(NamedTuple):
    """A function that a text defines.

    Attributes:
      arguments: their names.
      body: its expression.
    """

    arguments: tuple[str, ...]
    body: Expression


def _holds(x: Any) -> Any:
    return jnp.asarray(x) != 0


def _number(condition: Any) -> Any:
    return jnp.where(condition, 1.0, 0.0)


def _remainder(a: Any, b: Any) -> Any:
    towards_zero = jnp.fmod(a, b)
    return jnp.where(towards_zero < 0, towards_zero + b, towards_zero)


def _quotient(a: Any, b: Any) -> Any:
    if isinstance(a, float) and isinstance(b, float):
        with np.errstate(all="ignore"):  # as for powers
            return float(np.float64(a) / b)
    return a / b


def _power(a: Any, b: Any) -> Any:
    if isinstance(a, float) and isinstance(b, float):
        with np.errstate(all="ignore"):  # NaN or infinite where Python has exceptions
            return float(np.float64(a) ** b)
    whole = isinstance(b, float) and b.is_integer()
    return a ** int(b) if whole else a**b  # whole powers of any base, with all derivatives


_OPERATIONS: dict[str, Callable] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": _quotient,
    "^": _power,
    "**": _power,
    _NEGATIVE: operator.neg,
    "&": lambda a, b: _number(_holds(a) & _holds(b)),
    "|": lambda a, b: _number(_holds(a) | _holds(b)),
    "<": lambda a, b: _number(a < b),
    "<=": lambda a, b: _number(a <= b),
    ">": lambda a, b: _number(a > b),
    ">=": lambda a, b: _number(a >= b),
    "==": lambda a, b: _number(a == b),
    "!=": lambda a, b: _number(a != b),
}
_SAME_NAME = "sin cos tan sinh cosh tanh exp sqrt abs log10 sign"
_FUNCTIONS: dict[str, Callable] = {
    **{name: getattr(jnp, name) for name in _SAME_NAME.split()},
    **{"asin": jnp.arcsin, "acos": jnp.arccos, "atan": jnp.arctan, "atan2": jnp.arctan2},
    **{"ln": jnp.log, "log": jnp.log, "max": jnp.maximum, "min": jnp.minimum},
    **{"mod": _remainder, "flr": jnp.floor, "erf": jax.scipy.special.erf},
    **{"erfc": jax.scipy.special.erfc, "lgamma": jax.scipy.special.gammaln},
    "heav": lambda x: _number(x >= 0),
    _NOT: lambda x: _number(~_holds(x)),
    _IF: lambda condition, yes, no: jnp.where(_holds(condition), yes, no),
}
_COUNTS = {"atan2": 2, "max": 2, "min": 2, "mod": 2, _IF: 3}
CONSTANTS = {"pi": math.pi}
#: What these functions would need, which no rate has.
_BEYOND = {
    **dict.fromkeys(("delay", "del_shft"), "a delay"),
    **dict.fromkeys(("ran", "normal", "poisson"), "noise"),
    **dict.fromkeys(("shift", "sum"), "a shift or a sum of states"),
}


class NotARate(ValueError):
    """An expression that needs more than the state and the time; its text says what."""


class BareNot(ValueError):
    """``not`` after an operator, where XPPAUT applies it to more than the next operand."""


def read(text: str) -> Expression:
    """The expression that a text, in lower case, stands for.

    Raises:
      ValueError: it is not an expression.
      NotARate: it needs more than the state and the time.
    """
    reader = _Reader(text)
    found = reader.expression(_SUM)
    reader.expect("")
    if _depth(found) > DEEPEST:
        raise ValueError("nesting")
    return found


class _Reader:
    """A reader of an expression: the right operand of each operator is what binds more tightly."""

    def __init__(self, text: str):
        self._tokens = _tokens(text.strip())
        self._open = 0
        self._next = next(self._tokens)

    def expression(self, least: int) -> Expression:
        """The expression that follows, with operators that bind at least as tightly as `least`."""
        self._open += 1
        if self._open > DEEPEST:
            raise ValueError("nesting")
        found = self._operand()
        while (strength := _STRENGTH.get(self._next[1], 0)) >= least and self._next[0] == "sign":
            sign = self._take()[1]
            if strength > _SUM:
                self._refuse_not()
            found = Call(sign, (found, self.expression(strength + 1)))
        self._open -= 1
        return found

    def _refuse_not(self) -> None:
        if self._next == ("name", _NOT):
            raise BareNot(_NOT)

    def expect(self, wanted: str) -> None:
        """Pass a sign, a word, or the end of the text."""
        if self._take()[1] != wanted:
            raise ValueError(wanted)

    def _take(self) -> tuple[str, str]:
        taken, self._next = self._next, next(self._tokens, ("end", ""))
        return taken

    def _operand(self) -> Expression:
        kind, text = self._take()
        match kind:
            case "number":
                return float(text)
            case "name" if text == _NOT:
                return Call(_NOT, (self.expression(_POWER),))
            case "name" if text == _IF:
                return Call(_IF, (self._within(), self._after("then"), self._after("else")))
            case "name" if text in _BEYOND and self._next[1] == "(":
                raise NotARate(_BEYOND[text])
            case "name":
                return Call(text, self._arguments()) if self._next[1] == "(" else text
        match text:
            case "-" | "~":
                self._refuse_not()
                return Call(_NEGATIVE, (self.expression(_PRODUCT + 1),))
            case "+":
                return self.expression(_PRODUCT + 1)
            case "(":
                return self._inside()
        raise ValueError(text)

    def _within(self) -> Expression:
        self.expect("(")
        return self._inside()

    def _inside(self) -> Expression:
        """What an open parenthesis encloses."""
        inside = self.expression(_SUM)
        self.expect(")")
        return inside

    def _after(self, word: str) -> Expression:
        self.expect(word)
        return self._within()

    def _arguments(self) -> tuple[Expression, ...]:
        self.expect("(")
        found = [self.expression(_SUM)]
        while self._next[1] == ",":
            self._take()
            found.append(self.expression(_SUM))
        self.expect(")")
        return tuple(found)


def _tokens(text: str) -> Iterator[tuple[str, str]]:
    """The kind and the text of each token, then the end."""
    at = 0
    while at < len(text):
        token = _TOKEN.match(text, at)
        if token is None:
            raise ValueError(text[at:])
        at = token.end()
        assert token.lastgroup is not None
        yield token.lastgroup, token[token.lastgroup]
    yield "end", ""


def _depth(expression: Expression) -> int:
    """How deeply operations are nested."""
    level, depth = [expression], 0
    while level := [part for one in level if isinstance(one, Call) for part in one.arguments]:
        depth += 1
    return depth


def parts(expression: Expression) -> Iterator[Expression]:
    """The expression and all its parts, to any depth."""
    waiting = [expression]
    while waiting:
        one = waiting.pop()
        yield one
        if isinstance(one, Call):
            waiting.extend(one.arguments)


def names(expression: Expression) -> set[str]:
    """The names of numbers and functions that an expression uses."""
    found = {x.name if isinstance(x, Call) else x for x in parts(expression)}
    return {name for name in found if isinstance(name, str)}


def follows_from(expression: Expression, known: Collection[str]) -> bool:
    """Whether an expression uses no names but known ones, constants and built-in functions."""
    built_in = (*CONSTANTS, *_OPERATIONS, *_FUNCTIONS)
    return all(name in known or name in built_in for name in names(expression))


def check_names(
    expression: Expression,
    known: Collection[str],
    functions: Mapping[str, Function],
    where: str,
) -> None:
    """Raise ValueError for a name that a text has not declared, or another number of arguments.

    Args:
      expression: the expression.
      known: names of numbers, besides those of constants.
      functions: the functions of the text.
      where: what the expression belongs to, for the message.
    """
    for part in parts(expression):
        if isinstance(part, str) and part not in known and part not in CONSTANTS:
            _checks.choice(f"name in {where}", part, dict.fromkeys((*known, *CONSTANTS)))
        if not isinstance(part, Call) or part.name in _OPERATIONS:
            continue
        if part.name not in functions:
            _checks.choice(f"function in {where}", part.name, {**_FUNCTIONS, **functions})
        own = functions.get(part.name)
        count = _COUNTS.get(part.name, 1) if own is None else len(own.arguments)
        if len(part.arguments) != count:
            wanted = f"{count} argument{'s' * (count > 1)} of {part.name}"
            raise _checks.fail(where, wanted, len(part.arguments))


def size(expression: Expression, sizes: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
    """Number of operations of an expression, and how deeply they are nested, functions written out.

    Args:
      expression: the expression.
      sizes: the same of the functions that it calls, by name.
    """
    called = [sizes.get(part.name, (0, 0)) for part in parts(expression) if isinstance(part, Call)]
    count = sum(1 + operations for operations, _ in called)
    return count, _depth(expression) + max((depth for _, depth in called), default=0)


def value(
    expression: Expression,
    known: Mapping[str, Any],
    functions: Mapping[str, Function],
    own: Mapping[str, Any] = MappingProxyType({}),
) -> Any:
    """The value of an expression.

    Args:
      expression: the expression.
      known: numbers by name.
      functions: the functions that the text defines.
      own: arguments of the function whose expression it is, by name.
    """
    if isinstance(expression, str):
        if expression in own:
            return own[expression]
        return CONSTANTS[expression] if expression in CONSTANTS else known[expression]
    if not isinstance(expression, Call):
        return expression
    name, given = expression.name, []
    for one in expression.arguments:  # a comprehension may take a stack frame of its own
        given.append(value(one, known, functions, own))
    if name in functions:
        arguments, body = functions[name]
        return value(body, known, functions, dict(zip(arguments, given, strict=True)))
    return (_OPERATIONS.get(name) or _FUNCTIONS[name])(*given)
