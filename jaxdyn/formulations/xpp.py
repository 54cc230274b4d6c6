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

Names are case-insensitive, as in XPPAUT; the scene has them in lower case. The reader understands
``par``, ``number``, ``!`` (derived numbers), ``init``, ``x(0)=``, fixed quantities, functions, also
of the time, and rows of states such as ``x[1..9]'=x[j-1]-x[j]``, also in blocks that begin with
``%[1..9]`` and end with ``%``. Fixed quantities may be declared in any order; XPPAUT computes one
that is used before it is declared from the previous state. Expressions mean what they mean in
XPPAUT, see `jaxdyn.formulations.xpp_expressions`. Values of parameters and starts may be
expressions of parameters declared before, such as 8/3 above, of which XPPAUT reads only the 8.
Starts may also be expressions of derived numbers declared before. The reader skips ``aux``,
boundary conditions, and the options for drawing and integration other than ``total``. It refuses
whatever is not an ordinary differential equation: maps, also by ``@ meth=discrete``, delays, noise,
tables, resets, algebraic equations, libraries, other files.

Reference: B. Ermentrout, Simulating, Analyzing, and Animating Dynamical Systems, SIAM (2002).
"""

import dataclasses
import functools
import graphlib
import re
from collections import ChainMap
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn.formulations.xpp_expressions import (
    CONSTANTS,
    DEEPEST,
    NAME,
    BareNot,
    Expression,
    Function,
    NotARate,
    check_names,
    follows_from,
    names,
    read,
    size,
    value,
)
from jaxdyn.scene import Scene, System

#: Length of a text, in characters: no model written by a person is longer.
_LONGEST = 200_000
#: Number of statements of a text, with the rows of states written out.
_MOST_STATEMENTS = 10_000
#: Number of operations of all rates, with functions written out.
_MOST_OPERATIONS = 200_000
_DEFAULT_SPAN = 20.0  # the default of XPPAUT
_SPAN, _BEGIN, _STEP = "total", "t0", "dt"
_METHOD = re.compile(r"\bmeth\w*\s*=\s*(\w)")
#: Initials of the methods for differential equations; by any other, XPPAUT iterates rates as a map.
_METHODS = "emragvbqsc582y"

_RATE = re.compile(rf"(?:d({NAME})\s*/\s*dt|({NAME})\s*')\s*=(.*)")
_START = re.compile(rf"({NAME})\s*\(\s*0\s*\)\s*=(.*)")
_FUNCTION = re.compile(rf"({NAME})\s*\(([^()]*)\)\s*=(.*)")
_FIXED = re.compile(rf"({NAME})\s*=(.*)")
_KEYWORD = re.compile(r"([a-z]+)\b\s*(.*)")
_ROW = re.compile(r"\[\s*(\d+)\s*\.\.\s*(\d+)\s*\]")
#: The head of a block, whose statements are those of rows.
_BLOCK = re.compile(r"%\s*" + _ROW.pattern)
_PLACE = re.compile(r"\[(\d+)\]")
#: XPPAUT evaluates other indices differently from how they are written.
_IN_ROW = re.compile(r"\[(\d+|j(?:[+\-*]\d+)?)\]")
#: Words that begin a line whose content changes no rate.
_LEFT_OUT = ("aux", "set", "only", "o", "opt", "option", "options")
_END = ("done", "d")
_BOUNDARY = ("b", "bdry", "bndry")
_REFUSED = {
    **dict.fromkeys(("w", "wiener", "markov"), "noise"),
    **dict.fromkeys(("table", "tabular"), "a table"),
    **dict.fromkeys(("global",), "a reset of states"),
    **dict.fromkeys(("export",), "quantities from a library"),
    **dict.fromkeys(("volt", "volterra", "solve", "special"), "more than rates"),
}
#: Remedies where writing the rate as a function would not help.
_REMEDIES = {
    "noise": "No scene has noise.",
    "a delay": "No scene has delays.",
    "a map": "No scene is a map. See orbits.map_basins, which takes a function.",
    "a reset of states": "Write the rate as a function, and phases, see jaxdyn.integrate.phase.",
    "another file": "Put its lines here, or begin a comment in another way.",
}


class Model(NamedTuple):
    """What a text declares.

    Attributes:
      numbers: parameters with their values.
      starts: starts of the states, in the order of the rates.
      span: the span [time].
      derived: derived quantities, each after those that it uses.
      functions: functions by name.
      rates: rates of the states, in order.
    """

    numbers: Mapping[str, float]
    starts: Mapping[str, float]
    span: float
    derived: Mapping[str, Expression]
    functions: Mapping[str, Function]
    rates: Mapping[str, Expression]


class Written(System):
    """Rates that a text declares.

    Attributes:
      text: see the file's docstring.
      params: (p,) values of the parameters in the order in which they are declared.
    """

    text: str = eqx.field(static=True, repr=False)
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
            known[name] = value(node, known, found.functions)
        rates = (value(node, known, found.functions) for node in found.rates.values())
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
      ValueError: it is not a text; or a line is not understood, or declares something other than a
        differential equation.
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
        if not isinstance(self.text, str) or re.fullmatch(r"\S*\.ode", self.text):
            remedy = "Of a file, pass Path(file).read_text()."
            raise _checks.fail("text", "the text of a model", repr(self.text), remedy)
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
        chosen = {key: as_float(number) for key, number in (known | numbers).items()}
        for key, number in chosen.items():
            if jnp.shape(number):
                remedy = "Use jax.vmap for several."
                raise _checks.fail(key, "one number", f"shape {jnp.shape(number)}", remedy)
        params = [chosen[key] for key in found.numbers]
        system = Written(self.text, jnp.stack(params) if params else jnp.zeros(0))
        y0 = jnp.stack([chosen[key] for key in found.rates])
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


def _lines(text: str) -> Iterator[str]:
    """The statements in lower case, without comments and without the line breaks in them."""
    for count, statement in enumerate(_written_out(text)):
        if count >= _MOST_STATEMENTS:
            raise _checks.fail("text", f"at most {_MOST_STATEMENTS} statements", "more")
        if statement:
            yield statement


def _written_out(text: str) -> Iterator[str]:
    """The statements, with blocks and rows of states written out, between empty ones."""
    block: re.Match[str] | None = None
    within: list[str] = []
    lines = re.sub(r"\\[ \t]*\n", " ", text).lower().splitlines()
    for line in (*lines, "%"):  # the end of the text is the end of a block
        if line.startswith("#include"):
            raise _refusal(line, "another file")
        if line[:1] == "%" or line.strip() in _END:
            yield from _rows_of_block(block, within)
            block, within = _BLOCK.match(line), []
        for part in _statements(line):
            if block is None:
                yield from _rows(part.strip())
            else:
                within.append(part.strip())


def _rows_of_block(block: re.Match[str] | None, statements: list[str]) -> Iterator[str]:
    """The statements between %[1..9] and %, once for each number."""
    for j in () if block is None else _places(block):
        for statement in statements:
            yield from _rows(_IN_ROW.sub(functools.partial(_index, j), statement))


def _statements(line: str) -> list[str]:
    """The statements of a line, which may be a comment, or contain several."""
    return [] if line.lstrip()[:1] in ("#", "%", '"') else line.partition("#")[0].split(";")


def _rows(statement: str) -> Iterator[str]:
    """The statements of a row of states, such as x[1..9]'=x[j-1], or the statement itself."""
    row = _ROW.search(statement)
    if row is None or statement[0] == "@":
        yield _PLACE.sub(r"\1", statement)
        return
    for j in _places(row):
        written = f"{statement[: row.start()]}[j]{statement[row.end() :]}"
        yield _IN_ROW.sub(functools.partial(_index, j), written)


def _places(row: re.Match[str]) -> range:
    """The numbers of a row, which may descend."""
    first, last = int(row[1]), int(row[2])
    step = 1 if first <= last else -1
    return range(first, last + step, step)


def _index(j: int, found: re.Match[str]) -> str:
    """The number of a place in a row, such as [j+1]."""
    number = value(read(found[1]), {"j": float(j)}, {})
    before = found.string[: found.start()]
    if number < 0 and re.search(rf"{NAME}$", before):  # x-1 would be a difference
        raise _refusal(found.string, "a part of a row before its beginning")
    return format(number, ".0f")


class _Reader:
    """A reader of a text, line by line."""

    def __init__(self) -> None:
        self.numbers: dict[str, float] = {}
        self.starts: dict[str, float] = {}
        self.span = _DEFAULT_SPAN
        self.begin = 0.0
        self.derived: dict[str, Expression] = {}
        self.functions: dict[str, Function] = {}
        self.rates: dict[str, Expression] = {}
        self._computed: dict[str, float] = {}  # of the derived ones, those that are numbers
        self._names: set[str] = set()

    def read(self, line: str) -> bool:
        """Read a line; the result says whether more may follow."""
        parts = _KEYWORD.fullmatch(line)
        word, rest = parts.groups() if parts else ("", "")
        pairs = bool(rest) and rest[0] not in "='(/"
        if line in _END:
            return False
        begins = rest[:1] not in ("=", "'", "(")  # the word is not a name that the line declares
        if line[0] == "@":
            self.span = self._option(line, _SPAN, self.span)
            self.begin = self._option(line, _BEGIN, self.begin)
            if self._option(line, _STEP, 1.0) < 0:
                raise _refusal(line, "a run backwards in time")
            if not all(method in _METHODS for method in _METHOD.findall(line)[-1:]):
                raise _refusal(line, "a map")
        elif pairs and word.startswith(("p", "n")):
            for name, number in self._pairs(line, rest).items():
                self._declare(self.numbers, name, number)
        elif pairs and word in ("i", "init"):
            self.starts |= self._pairs(line, rest, self._computed)
        elif begins and rest and word in _REFUSED:
            raise _refusal(line, _REFUSED[word])
        elif begins and word in _LEFT_OUT:
            pass
        elif not (word in _BOUNDARY and "=" not in line):
            self._define(line)
        return True

    def _define(self, line: str) -> None:
        if "[" in line:
            raise _refusal(line, "an integral" if "int[" in line else "a part of a row")
        if "int{" in line:
            raise _refusal(line, "an integral")
        if re.match(r"0\s*=", line):
            raise _refusal(line, "an algebraic equation")
        if found := _RATE.fullmatch(line):
            self._declare(self.rates, found[1] or found[2], _expression(found[3], line))
        elif found := _START.fullmatch(line):
            self.starts[found[1]] = self._number(found[2], line, self._computed)
        elif found := _FUNCTION.fullmatch(line):
            arguments = tuple(x.strip() for x in found[2].split(","))
            if not all(re.fullmatch(NAME, x) for x in arguments):
                raise _refusal(line, "a map")
            function = Function(arguments, _expression(found[3], line))
            self._declare(self.functions, found[1], function)
        elif found := _FIXED.fullmatch(line.removeprefix("!").strip()):
            self._declare(self.derived, found[1], _expression(found[2], line))
            self._compute(found[1])
        else:
            raise _refusal(line, "")

    def _declare(self, place: dict[str, Any], name: str, what: Any) -> None:
        if name in self._names or name in ("t", _SPAN, *CONSTANTS):
            raise _checks.fail("text", "one meaning of each name", f"two of {name}")
        self._names.add(name)
        place[name] = what

    def _compute(self, name: str) -> None:
        """Keep the value of a derived quantity if it follows from numbers declared before."""
        found, known = self.derived[name], ChainMap(self._computed, self.numbers)
        if follows_from(found, known):
            check_names(found, known, {}, name)
            self._computed[name] = float(value(found, known, {}))

    def _pairs(
        self, line: str, text: str, more: dict[str, float] | None = None
    ) -> dict[str, float]:
        """Numbers by name, from "a=1, b=2" or "a=1 b=2"; a name alone has the value 0."""
        parts = re.split(
            rf"[,\s]+(?={NAME}\s*(?:=|,|$))", re.sub(r"\s*=\s*", "=", text.strip(" ,"))
        )
        split = [x.strip(" ,").partition("=") for x in parts]
        if not all(re.fullmatch(NAME, key) for key, _, _ in split):
            raise _refusal(line, "")
        return {key: self._number(number or "0", line, more) for key, _, number in split}

    def _option(self, line: str, name: str, otherwise: float) -> float:
        found = re.findall(rf"\b{name}\s*=\s*([^\s,]+)", line)
        return self._number(found[-1], line) if found else otherwise

    def _number(self, text: str, line: str, more: dict[str, float] | None = None) -> float:
        """The value of an expression of parameters, and of `more` numbers."""
        found, known = _expression(text, line), ChainMap(self.numbers, more or {})
        check_names(found, known, {}, line)
        return float(value(found, known, {}))

    def model(self) -> Model:
        """The model that was read, checked."""
        if not self.rates:
            raise _checks.fail("text", "rates such as x' = -x", "none")
        for name in self.starts:
            _checks.choice("start", name, self.rates)
        known = {*self.numbers, *self.rates, *self.derived, "t"}
        for name, expression in {**self.derived, **self.rates}.items():
            where = f"{name}'" if name in self.rates else name
            check_names(expression, known, self.functions, where)
        for name, (arguments, body) in self.functions.items():
            check_names(body, known | {*arguments}, self.functions, name)
        used = [names(x) for x in (*self.rates.values(), *self.derived.values())]
        used += [names(body) - {*arguments} for arguments, body in self.functions.values()]
        if self.begin != 0 and "t" in set().union(*used):
            remedy = f"Leave it out, and pass t0={self.begin:g} to `simulate`."
            raise _checks.fail("text", "a start at the time 0", f"t0={self.begin:g}", remedy)
        starts = {name: self.starts.get(name, 0.0) for name in self.rates}
        order = self._order()
        self._check_size(order)
        derived = {name: self.derived[name] for name in order if name in self.derived}
        return Model(self.numbers, starts, self.span, derived, self.functions, self.rates)

    def _order(self) -> list[str]:
        """The derived quantities and the functions, each after those that it uses."""
        uses = {name: names(expression) for name, expression in self.derived.items()}
        for name, (arguments, body) in self.functions.items():
            uses[name] = names(body) - {*arguments}
        graph = {name: used & uses.keys() for name, used in uses.items()}
        try:
            return list(graphlib.TopologicalSorter(graph).static_order())
        except graphlib.CycleError as error:
            circle = [f"{x}()" if x in self.functions else x for x in reversed(error.args[1])]
            wanted = "definitions that do not need themselves"
            raise _checks.fail("text", wanted, " needs ".join(circle)) from None

    def _check_size(self, order: list[str]) -> None:
        """Raise ValueError if rates with all functions written out are too large to evaluate."""
        sizes: dict[str, tuple[int, int]] = {}
        for name in order:
            if name in self.functions:
                sizes[name] = size(self.functions[name].body, sizes)
        whole = [size(x, sizes) for x in (*self.derived.values(), *self.rates.values())]
        if sum(count for count, _ in whole) > _MOST_OPERATIONS:
            wanted = f"at most {_MOST_OPERATIONS} operations, with functions written out"
            raise _checks.fail("text", wanted, "more")
        if max(depth for _, depth in whole) > DEEPEST:
            wanted = f"operations and functions within each other at most {DEEPEST} times"
            raise _checks.fail("text", wanted, "more")


def _refusal(line: str, what: str) -> ValueError:
    got = f"{what}: {line!r}" if what else repr(line)
    other = "Write the rate as a function, for jaxdyn.ode." if what else ""
    remedy = _REMEDIES.get(what) or other or "See jaxdyn.formulations.xpp."
    return _checks.fail("text", "parameters, starts and rates", got, remedy)


def _expression(text: str, line: str) -> Expression:
    try:
        return read(text)
    except NotARate as error:
        raise _refusal(line, str(error)) from None
    except BareNot as error:
        remedy = "Write (not(x))."
        wanted = "`not` in parentheses behind an operator"
        raise _checks.fail("text", wanted, repr(line), remedy) from error
    except ValueError as error:
        raise _refusal(line, "") from error
