"""Rates that are written as text, in the language of XPPAUT's ``.ode`` files.

A text declares parameters, starts and rates; nothing in it is run, so it may come from anywhere:

    # Lorenz
    par sigma=10, rho=28, beta=8/3
    init x=1, y=1
    x' = sigma*(y - x)
    dy/dt = x*(rho - z) - y
    z' = x*y - beta*z
    @ total=50
    done

The reader understands ``par``, ``number``, ``!`` (derived numbers), ``init``, ``x(0)=``, fixed
quantities, functions and ``if()then()else()``. It skips ``aux``, and the options for drawing and
integration other than ``total``. It refuses whatever is not an ordinary differential equation:
maps, delays, noise, tables, resets, arrays.

Reference: B. Ermentrout, Simulating, Analyzing, and Animating Dynamical Systems, SIAM (2002).
"""

import ast
import dataclasses
import functools
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn.scene import Scene, System

#: Length of a text, in characters: no model written by a person is longer.
_LONGEST = 200_000
_DEFAULT_SPAN = 20.0  # the default of XPPAUT
_SPAN = "total"
_PREFIX = "_"  # before each name, so that none is a keyword of Python

_OPERATORS: dict[type, Callable] = {
    **{ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul},
    **{ast.Div: operator.truediv, ast.Pow: operator.pow},
    **{ast.UAdd: operator.pos, ast.USub: operator.neg},
    ast.And: lambda a, b: _number(jnp.logical_and(_holds(a), _holds(b))),
    ast.Or: lambda a, b: _number(jnp.logical_or(_holds(a), _holds(b))),
    ast.Lt: lambda a, b: _number(a < b),
    ast.LtE: lambda a, b: _number(a <= b),
    ast.Gt: lambda a, b: _number(a > b),
    ast.GtE: lambda a, b: _number(a >= b),
    ast.Eq: lambda a, b: _number(a == b),
    ast.NotEq: lambda a, b: _number(a != b),
}
_SAME_NAME = "sin cos tan sinh cosh tanh exp sqrt abs log10 sign"
_FUNCTIONS: dict[str, Callable] = {
    **{name: getattr(jnp, name) for name in _SAME_NAME.split()},
    **{"asin": jnp.arcsin, "acos": jnp.arccos, "atan": jnp.arctan, "atan2": jnp.arctan2},
    **{"ln": jnp.log, "log": jnp.log, "max": jnp.maximum, "min": jnp.minimum},
    **{"mod": jnp.mod, "flr": jnp.floor, "erf": jax.scipy.special.erf},
    **{"erfc": jax.scipy.special.erfc, "lgamma": jax.scipy.special.gammaln},
    "heav": lambda x: _number(x >= 0),
    "not": lambda x: _number(~_holds(x)),
    "if": lambda condition, yes, no: jnp.where(_holds(condition), yes, no),
}
_CONSTANTS = {"pi": math.pi}

_NAME = r"[a-z]\w*"
_RATE = re.compile(rf"(?:d({_NAME})\s*/\s*dt|({_NAME})\s*')\s*=(.*)")
_START = re.compile(rf"({_NAME})\s*\(\s*0\s*\)\s*=(.*)")
_FUNCTION = re.compile(rf"({_NAME})\s*\(([^()]*)\)\s*=(.*)")
_FIXED = re.compile(rf"({_NAME})\s*=(.*)")
_KEYWORD = re.compile(r"([a-z]+)\b\s*(.*)")
#: Words that begin a line whose content changes no rate.
_LEFT_OUT = ("aux", "set", "only", "bdry", "b", "export", "option", "options")
_REFUSED = {
    **dict.fromkeys(("wiener", "markov"), "noise"),
    **dict.fromkeys(("table",), "a table"),
    **dict.fromkeys(("global",), "a reset of states"),
    **dict.fromkeys(("volt", "volterra", "solve", "special"), "more than rates"),
}


class Function(NamedTuple):
    """A function that a text defines.

    Attributes:
      arguments: their names.
      body: its expression.
    """

    arguments: tuple[str, ...]
    body: ast.expr


class Model(NamedTuple):
    """What a text declares.

    Attributes:
      numbers: parameters with their values.
      starts: starts of the states, in the order of the rates.
      span: the span [time].
      derived: derived quantities, in order: they may use those before.
      functions: functions by name.
      rates: rates of the states, in order.
    """

    numbers: Mapping[str, float]
    starts: Mapping[str, float]
    span: float
    derived: Mapping[str, ast.expr]
    functions: Mapping[str, Function]
    rates: Mapping[str, ast.expr]


class Written(System):
    """Rates that a text declares.

    Attributes:
      text: see the file's docstring.
      params: (p,) values of the parameters in the order in which they are declared.
    """

    text: str = eqx.field(static=True)
    params: Float[Array, " p"] = eqx.field(converter=as_float)

    def labels(self):
        return tuple((name, "1") for name in model(self.text).rates)

    def parameter_names(self):
        return {"params": tuple(model(self.text).numbers)}

    def rate(self, t, y, effects):
        del effects
        found = model(self.text)
        known = dict(zip(found.numbers, jnp.unstack(self.params), strict=True)) | {"t": t}
        known |= dict(zip(found.rates, jnp.unstack(y), strict=True))
        for name, node in found.derived.items():
            known[name] = _value(node, known, found.functions)
        rates = (_value(node, known, found.functions) for node in found.rates.values())
        return jnp.stack([jnp.asarray(x, y.dtype) for x in rates])

    def check(self, t, y):
        del t, y
        wanted = len(model(self.text).numbers)
        _checks.array("params", self.params, (wanted,), "One number for each parameter.")


@dataclasses.dataclass(frozen=True)
class Maker:
    """The scenes of a text, as a function of its parameters, starts and span.

    Attributes:
      text: a text in the language of ``.ode`` files.
      name: the name of the scenes.
    Raises:
      ValueError: a line is not understood, or declares something other than a differential
        equation.
    Example:
      >>> import jaxdyn
      >>> swing = Maker("par k=4; x'=v; v'=-k*x; init x=1")
      >>> swing.defaults
      {'k': 4.0, 'x': 1.0, 'v': 0.0, 'total': 20.0}
      >>> motion = jaxdyn.simulate(swing(k=1.0), jnp.pi)
      >>> round(float(motion["x"][-1]), 9)
      -1.0
    """

    text: str
    name: str = ""

    def __post_init__(self) -> None:
        model(self.text)

    @property
    def defaults(self) -> dict[str, float]:
        """The parameters, the start of each state by its name, and the span `total`."""
        found = model(self.text)
        return {**found.numbers, **found.starts, _SPAN: found.span}

    def __call__(self, **numbers: Any) -> Scene:
        """The scene with these numbers; the others are those of the text."""
        found, known = model(self.text), self.defaults
        for key in numbers:
            _checks.choice("number", key, known)
        chosen = known | numbers
        params = [as_float(chosen[key]) for key in found.numbers]
        system = Written(self.text, jnp.stack(params) if params else jnp.zeros(0))
        y0 = jnp.stack([as_float(chosen[key]) for key in found.rates])
        return Scene(system, y0=y0, t1=chosen[_SPAN], name=self.name)


@functools.lru_cache
def model(text: str) -> Model:
    """What a text declares.

    Raises:
      ValueError: see `Maker`.
    """
    if len(text) > _LONGEST:
        raise _checks.fail("text", f"at most {_LONGEST} characters", len(text))
    reader = _Reader()
    for line in _lines(text):
        if not reader.read(line):
            break
    return reader.model()


def _lines(text: str) -> list[str]:
    """The statements in small letters, without comments and without the line breaks in them."""
    joined = re.sub(r"\\[ \t]*\n", " ", text)
    lines = (part for line in joined.splitlines() for part in _statements(line))
    return [line.strip().lower() for line in lines if line.strip()]


def _statements(line: str) -> list[str]:
    """The statements of a line, which may be a comment, or contain several."""
    return [] if line.lstrip()[:1] in ("#", "%", '"') else line.partition("#")[0].split(";")


class _Reader:
    """A reader of a text, line by line."""

    def __init__(self) -> None:
        self.numbers: dict[str, float] = {}
        self.starts: dict[str, float] = {}
        self.span = _DEFAULT_SPAN
        self.derived: dict[str, ast.expr] = {}
        self.functions: dict[str, Function] = {}
        self.rates: dict[str, ast.expr] = {}

    def read(self, line: str) -> bool:
        """Read a line; the result says whether more may follow."""
        parts = _KEYWORD.fullmatch(line)
        word, rest = parts.groups() if parts else ("", "")
        pairs = "=" in rest and rest[0] not in "='(/"
        if line in ("done", "d"):
            return False
        if line[0] == "@":
            self.span = float(self._pairs(line, line[1:]).get(_SPAN, self.span))
        elif pairs and word.startswith(("p", "number")):
            self.numbers |= self._pairs(line, rest)
        elif pairs and word in ("i", "init"):
            self.starts |= self._pairs(line, rest)
        elif word in _REFUSED and rest[:1] not in ("=", "'"):
            raise _refusal(line, _REFUSED[word])
        elif not (word in _LEFT_OUT and rest[:1] not in ("=", "'", "(")):
            self._define(line)
        return True

    def _define(self, line: str) -> None:
        if "[" in line:
            raise _refusal(line, "an array")
        if found := _RATE.fullmatch(line):
            self.rates[found[1] or found[2]] = _expression(found[3], line)
        elif found := _START.fullmatch(line):
            self.starts[found[1]] = self._number(found[2], line)
        elif found := _FUNCTION.fullmatch(line):
            arguments = tuple(x.strip() for x in found[2].split(","))
            if not all(re.fullmatch(_NAME, x) for x in arguments) or "t" in arguments:
                raise _refusal(line, "a map or an integral equation")
            self.functions[found[1]] = Function(arguments, _expression(found[3], line))
        elif found := _FIXED.fullmatch(line.removeprefix("!").strip()):
            self.derived[found[1]] = _expression(found[2], line)
        else:
            raise _refusal(line, "")

    def _pairs(self, line: str, text: str) -> dict[str, float]:
        """Numbers by name, from "a=1, b=2" or "a=1 b=2"."""
        parts = re.split(rf"[,\s]+(?={_NAME}\s*=)", re.sub(r"\s*=\s*", "=", text.strip()))
        if line[0] == "@":
            parts = [x for x in parts if x.startswith(f"{_SPAN}=")]
        if not all("=" in x for x in parts):
            raise _refusal(line, "")
        split = (x.strip(" ,").partition("=") for x in parts)
        return {key.strip(): self._number(value, line) for key, _, value in split}

    def _number(self, text: str, line: str) -> float:
        return float(_value(_expression(text, line), self.numbers, {}))

    def model(self) -> Model:
        """The model that was read, checked."""
        if not self.rates:
            raise _checks.fail("text", "rates such as x' = -x", "none")
        for name in self.starts:
            _checks.choice("start", name, self.rates)
        twice = self.rates.keys() & {*self.numbers, *self.derived, *self.functions, "t", _SPAN}
        if twice:
            raise _checks.fail("text", "one meaning of each name", f"two of {min(twice)}")
        known = {**self.numbers, **dict.fromkeys(self.rates), "t": None, **_CONSTANTS}
        for name, node in self.derived.items():
            _check_names(node, known, self.functions, name)
            known[name] = None
        for name, node in self.rates.items():
            _check_names(node, known, self.functions, f"{name}'")
        for name, (arguments, body) in self.functions.items():
            _check_names(body, known | dict.fromkeys(arguments), self.functions, name)
        starts = {name: self.starts.get(name, 0.0) for name in self.rates}
        return Model(self.numbers, starts, self.span, self.derived, self.functions, self.rates)


def _refusal(line: str, what: str) -> ValueError:
    got = f"{what}: {line!r}" if what else repr(line)
    remedy = (
        "Write the rate as a function, for jaxdyn.ode." if what else "See jaxdyn.formulations.xpp."
    )
    return _checks.fail("text", "parameters, starts and rates", got, remedy)


def _expression(text: str, line: str) -> ast.expr:
    """The tree of an expression, in which each name has a prefix."""
    try:
        named = re.sub(rf"(?<![\w.]){_NAME}", lambda x: _PREFIX + x[0], text.strip())
        tree = ast.parse(_in_python(_with_choices(named)), mode="eval").body
        _check_form(tree)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise _refusal(line, "") from error
    return tree


def _with_choices(text: str) -> str:
    """if(a)then(b)else(c) as a call of three arguments, the innermost first."""
    text = re.sub(rf"\b{_PREFIX}(if|then|else)\s+\(", rf"{_PREFIX}\1(", text)
    while (at := text.rfind(f"{_PREFIX}if(")) >= 0:
        parts, end = [], at
        for word in ("if", "then", "else"):
            begin = f"{_PREFIX}{word}("
            if not text.startswith(begin, end):
                raise ValueError(word)
            close = _closing(text, end + len(begin))
            parts.append(text[end + len(begin) : close])
            end = close + 1
            end += len(text[end:]) - len(text[end:].lstrip())
        text = f"{text[:at]}{_PREFIX}IF({', '.join(parts)}){text[end:]}"
    return text.replace(f"{_PREFIX}IF(", f"{_PREFIX}if(")


def _in_python(text: str) -> str:
    for ours, theirs in (("^", "**"), ("&", " and "), ("|", " or ")):
        text = text.replace(ours, theirs)
    return text


def _closing(text: str, start: int) -> int:
    """The place where the parenthesis closes that opens before a given place."""
    depth = 1
    for i in range(start, len(text)):
        depth += (text[i] == "(") - (text[i] == ")")
        if not depth:
            return i
    raise ValueError("parenthesis")


def _check_form(node: ast.expr) -> None:
    """Raise ValueError unless a tree has numbers, names, operations and calls only."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return
        case ast.Name():
            return
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            _check_form(operand)
        case ast.BinOp(op=op, left=left, right=right) if type(op) in _OPERATORS:
            _check_form(left)
            _check_form(right)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
            _check_form(left)
            _check_form(right)
        case ast.Call(func=ast.Name(), args=parts, keywords=[]) | ast.BoolOp(values=parts):
            for one in parts:
                _check_form(one)
        case _:
            raise ValueError(ast.dump(node))


def _check_names(
    node: ast.expr, known: Mapping[str, Any], functions: Mapping[str, Function], where: str
) -> None:
    """Raise ValueError for a name that a text has not declared, or another number of arguments."""
    for part in ast.walk(node):
        if not isinstance(part, ast.Call):
            continue
        assert isinstance(part.func, ast.Name)
        name = part.func.id.removeprefix(_PREFIX)
        _checks.choice(f"function in {where}", name, {**_FUNCTIONS, **functions})
        if name in functions and len(part.args) != len(functions[name].arguments):
            wanted = f"{len(functions[name].arguments)} arguments of {name}"
            raise _checks.fail(where, wanted, len(part.args))
    called = {id(part.func) for part in ast.walk(node) if isinstance(part, ast.Call)}
    for part in ast.walk(node):
        if isinstance(part, ast.Name) and id(part) not in called:
            _checks.choice(f"name in {where}", part.id.removeprefix(_PREFIX), known)


def _value(node: ast.expr, known: Mapping[str, Any], functions: Mapping[str, Function]) -> Any:
    """The value of an expression for known numbers."""

    def of(part: ast.expr) -> Any:
        return _value(part, known, functions)

    match node:
        case ast.Constant(value=number):
            return float(number)  # pyright: ignore[reportArgumentType]
        case ast.Name(id=name):
            name = name.removeprefix(_PREFIX)
            return (
                _CONSTANTS[name]
                if name in _CONSTANTS
                else known[_checks.choice("name", name, known)]
            )
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATORS[type(op)](of(operand))
        case ast.BinOp(op=op, left=left, right=right):
            power = isinstance(op, ast.Pow) and isinstance(right, ast.Constant)
            if power and float(right.value).is_integer():  # of any base, with all derivatives
                return of(left) ** int(right.value)
            return _OPERATORS[type(op)](of(left), of(right))
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return _OPERATORS[type(op)](of(left), of(right))
        case ast.BoolOp(op=op, values=values):
            return functools.reduce(_OPERATORS[type(op)], map(of, values))
        case ast.Call(func=ast.Name(id=name), args=args):
            name, given = name.removeprefix(_PREFIX), [of(one) for one in args]
            if name not in functions:
                return _FUNCTIONS[name](*given)
            arguments, body = functions[name]
            return _value(body, {**known, **dict(zip(arguments, given, strict=True))}, functions)
    raise AssertionError(ast.dump(node))


def _holds(x: Any) -> Any:
    return jnp.asarray(x) != 0


def _number(condition: Any) -> Any:
    return jnp.where(condition, 1.0, 0.0)
