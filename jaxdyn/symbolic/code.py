"""Formulas as the source of a function, in several languages.

Arrays are split into numbers: the code consists of arithmetic on numbers, with each repeated
expression computed once, so that it needs only a library of elementary functions.
"""

import dataclasses
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.scene import Scene
from jaxdyn.solvers.formulas.formulas import objects, topological_order, trace
from jaxdyn.solvers.formulas.graph import (
    COMPARISONS,
    LOGIC,
    TESTS,
    Graph,
    Node,
    NotElementary,
    Number,
)
from jaxdyn.symbolic.parameters import parameters, rebuild

#: The largest number of nodes for which code is written.
_MOST_NODES = 20_000
#: Up to this many characters, an expression that is used once is written where it is used.
_LONGEST = 60

#: Operator precedences; a condition has the lowest.
_CHOICE, _LOGIC, _COMPARISON, _SUM, _PRODUCT, _SIGN, _WHOLE = range(7)


@dataclasses.dataclass(frozen=True)
class Language:
    """How formulas are written in a language.

    Attributes:
      calls: the text of each operation that is a call, or that is written in parentheses.
      choice: the text of a conditional expression, from condition, yes and no.
      logic: the texts of "and", "or" and "not".
      constants: the texts of infinity, minus infinity, NaN, True and False.
      let: the text that assigns a number to a name; {kind} is "double" or "int".
      layout: the text of a function; {body} has the lines that compute its {results}.
      comment: the beginning of a comment line.
      first: the first index of an array.
      lines: the text that returns the results.
    """

    calls: Mapping[str, str]
    choice: str
    logic: tuple[str, str, str]
    constants: tuple[str, str, str, str, str]
    let: str
    layout: str
    comment: str
    first: int = 0
    lines: Callable[[Sequence[str]], str] = ", ".join


def _calls(prefix: str, names: str, **others: str) -> dict[str, str]:
    """Functions of one argument with the names of JAX, and others."""
    return {name: f"{prefix}{name}({{0}})" for name in names.split()} | others


_EVERYWHERE = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp expm1 log1p sqrt"
_ARCS = {f"a{f}": f"arc{f}" for f in ("sin", "cos", "tan", "sinh", "cosh", "tanh")}

LANGUAGES = {
    "python": Language(
        calls=_calls(
            "math.",
            f"{_EVERYWHERE} log floor ceil cbrt exp2 erf",
            abs="abs({0})",
            max="max({0}, {1})",
            min="min({0}, {1})",
            sign="float(({0} > 0) - ({0} < 0))",
            rem="math.fmod({0}, {1})",
            atan2="math.atan2({0}, {1})",
            pow="math.pow({0}, {1})",
            logistic="(1.0 / (1.0 + math.exp(-({0}))))",
            is_finite="math.isfinite({0})",
            real="float({0})",
        ),
        choice="{1} if {0} else {2}",
        logic=(" and ", " or ", "not "),
        constants=("math.inf", "-math.inf", "math.nan", "True", "False"),
        let="    {name} = {value}",
        layout="import math\n\n\ndef {name}(t, y, p):\n{comments}{body}    return [{results}]\n",
        comment="    # ",
    ),
    "numpy": Language(
        calls=_calls(
            "np.",
            "sin cos tan sinh cosh tanh exp expm1 log1p sqrt log floor ceil cbrt exp2 abs sign",
            **{name: f"np.{text}({{0}})" for name, text in _ARCS.items()},
            max="np.maximum({0}, {1})",
            min="np.minimum({0}, {1})",
            rem="np.fmod({0}, {1})",
            atan2="np.arctan2({0}, {1})",
            pow="np.power({0}, {1})",
            logistic="(1.0 / (1.0 + np.exp(-({0}))))",
            is_finite="np.isfinite({0})",
            real="np.asarray({0}, float)",
            select="np.where({0}, {2}, {1})",
            **{"and": "np.logical_and({0}, {1})", "or": "np.logical_or({0}, {1})"},
            **{"not": "np.logical_not({0})"},
        ),
        choice="",
        logic=("", "", ""),
        constants=("np.inf", "-np.inf", "np.nan", "True", "False"),
        let="        {name} = {value}",
        # Both branches of a condition are evaluated.
        layout="import numpy as np\n\n\ndef {name}(t, y, p):\n{comments}"
        '    with np.errstate(all="ignore"):\n{body}'
        "        return np.stack(np.broadcast_arrays({results}))\n",
        comment="    # ",
    ),
    "javascript": Language(
        calls=_calls(
            "Math.",
            f"{_EVERYWHERE} log floor ceil cbrt abs sign",
            exp2="Math.pow(2, {0})",
            max="Math.max({0}, {1})",
            min="Math.min({0}, {1})",
            rem="(({0}) % ({1}))",
            atan2="Math.atan2({0}, {1})",
            pow="Math.pow({0}, {1})",
            logistic="(1 / (1 + Math.exp(-({0}))))",
            is_finite="Number.isFinite({0})",
            real="Number({0})",
        ),
        choice="{0} ? {1} : {2}",
        logic=(" && ", " || ", "!"),
        constants=("Infinity", "-Infinity", "NaN", "true", "false"),
        let="  const {name} = {value};",
        layout="function {name}(t, y, p) {{\n{comments}{body}  return [{results}];\n}}\n",
        comment="  // ",
    ),
    "c": Language(
        calls=_calls(
            "",
            f"{_EVERYWHERE} log floor ceil cbrt exp2 erf",
            abs="fabs({0})",
            # fmax and fmin of NaN and a number are the number.
            max="({0} > {1} || isnan({0}) ? {0} : {1})",
            min="({0} < {1} || isnan({0}) ? {0} : {1})",
            sign="({0} == 0 || isnan({0}) ? {0} : {0} > 0 ? 1.0 : -1.0)",
            rem="fmod({0}, {1})",
            atan2="atan2({0}, {1})",
            pow="pow({0}, {1})",
            logistic="(1.0 / (1.0 + exp(-({0}))))",
            is_finite="isfinite({0})",
            real="((double)({0}))",
        ),
        choice="{0} ? {1} : {2}",
        logic=(" && ", " || ", "!"),
        constants=("INFINITY", "-INFINITY", "NAN", "1", "0"),
        let="  const {kind} {name} = {value};",
        layout="#include <math.h>\n\nvoid {name}(double t, const double *y, const double *p, "
        "double *rates)\n{{\n{comments}{body}{results}\n}}\n",
        comment="  // ",
        lines=lambda found: "\n".join(f"  rates[{i}] = {x};" for i, x in enumerate(found)),
    ),
    "julia": Language(
        calls=_calls(
            "",
            f"{_EVERYWHERE} log floor ceil cbrt exp2 abs sign",
            max="max({0}, {1})",
            min="min({0}, {1})",
            rem="rem({0}, {1})",
            atan2="atan({0}, {1})",
            pow="({0})^({1})",
            logistic="(1.0 / (1.0 + exp(-({0}))))",
            is_finite="isfinite({0})",
            real="Float64({0})",
        ),
        choice="{0} ? {1} : {2}",
        logic=(" && ", " || ", "!"),
        constants=("Inf", "-Inf", "NaN", "true", "false"),
        let="    {name} = {value}",
        layout="function {name}(t, y, p)\n{comments}{body}    return [{results}]\nend\n",
        comment="    # ",
        first=1,
    ),
}


def code(
    scene: Scene,
    language: str,
    of: Callable[[Scene, Array, Array], Array] = Scene.rate,
    name: str = "rate",
) -> str:
    """The source of a function (t, y, p) of a scene, with all its parameters as inputs.

    The function takes the time, the state and the `parameters`, in this order, the latter two as
    arrays of floats, and returns an array; in C it fills the array `rates`. In NumPy the entries of
    y and of p may be arrays, for many states at once. Conditions of the rate are kept: at a switch
    the function uses the side on which the state lies.

    Args:
      scene: only its structure is used; its parameters are inputs of the code.
      language: "python", "numpy", "javascript", "c" or "julia".
      of: another function of (scene, t, y); its results are flattened into one array.
      name: name of the function.
    Raises:
      ValueError: the language is unknown; or `of` contains something without formulas, such as a
        loop of unknown length or a callback, or a function that the language does not have.
    Limits: plain Python raises an exception where a rate, or a number from which it is computed, is
      infinite or not a number. A table of `jnp.interp` with n knots is n comparisons; its knots
      must increase, and with a period be known numbers.
    Example:
      >>> from jaxdyn import scenes
      >>> from jaxdyn.symbolic.code import code
      >>> print(code(scenes.lorenz(), "javascript"))
      function rate(t, y, p) {
        // y: x, y, z
        // p: sigma, rho, beta
        return [p[0] * (y[1] - y[0]), -y[0] * (y[2] + -p[1]) - y[1], y[0] * y[1] + -p[2] * y[2]];
      }
      <BLANKLINE>
    """
    chosen = LANGUAGES[_checks.choice("language", language, LANGUAGES)]
    if not re.fullmatch(r"[A-Za-z_]\w*", name):
        raise _checks.fail("name", "a name of a function", repr(name))
    names = parameters(scene).names
    graph = Graph(expanding=False, smooth=False, most=_MOST_NODES, written=True)
    time, *rest = (
        graph.input(None, moving=i <= len(scene.y0)) for i in range(1 + len(scene.y0) + len(names))
    )
    state, numbers = rest[: len(scene.y0)], rest[len(scene.y0) :]

    def function(t, y, values):
        system, effects = rebuild(scene.field, values)
        moved = Scene(system, effects, y0=y, t1=scene.t1, name=scene.name)
        return jnp.ravel(of(moved, t, y))

    given = (
        objects(x, s) for x, s in (([time], ()), (state, (len(state),)), (numbers, (len(numbers),)))
    )
    try:
        (found,) = trace(graph, function, *given)
    except NotElementary as error:
        remedy = "Only what is arithmetic on numbers can be written in another language."
        raise _checks.fail("code", "a rate with formulas", str(error), remedy) from error
    inputs = {time: "t"}
    first = chosen.first
    inputs |= {node: f"y[{i + first}]" for i, node in enumerate(state)}
    inputs |= {node: f"p[{i + first}]" for i, node in enumerate(numbers)}
    body, results = _lines(graph, list(found), inputs, chosen, language)
    labels = [label for label, _ in scene.labels()]
    comments = [
        f"{key}: {', '.join(entries)}" for key, entries in (("y", labels), ("p", names)) if entries
    ]
    return chosen.layout.format(
        name=name,
        comments="".join(f"{chosen.comment}{line}\n" for line in comments),
        body="".join(f"{line}\n" for line in body),
        results=chosen.lines(results),
    )


def _lines(
    graph: Graph, results: list[Number], inputs: dict[Node, str], to: Language, language: str
) -> tuple[list[str], list[str]]:
    """The lines of code that compute some numbers, and the expressions for these."""
    nodes = topological_order(graph, results)
    uses = _uses(results, to)
    texts: dict[Node, tuple[str, int]] = {node: (text, _WHOLE) for node, text in inputs.items()}
    lines: list[str] = []

    def at(a: Number, least: int) -> str:
        text, precedence = texts[a] if isinstance(a, Node) else _number(a, to)
        return text if precedence >= least else f"({text})"

    for node in nodes:
        if node in texts or node not in uses:
            continue
        text, precedence = _operation(node, at, to, language)
        if uses[node] > 1 or len(text) > _LONGEST:
            name = f"v{len(lines) + 1}"
            kind = "int" if _is_condition(node) else "double"
            lines.append(to.let.format(kind=kind, name=name, value=text))
            text, precedence = name, _WHOLE
        texts[node] = text, precedence
    return lines, [at(x, _CHOICE) for x in results]


def _uses(results: list[Number], to: Language) -> Counter:
    """How often each node is used."""
    uses: Counter = Counter(x for x in results if isinstance(x, Node))
    waiting = list(uses)
    while waiting:
        node = waiting.pop()
        often = 2 if node.op in ("pow", "sign") or _repeats(node.op, to) else 1
        for a in node.args:
            if isinstance(a, Node):
                if a not in uses:
                    waiting.append(a)
                uses[a] += often
    return uses


def _repeats(op: str, to: Language) -> bool:
    """Whether the text of an operation contains its arguments more than once."""
    return to.calls.get(op, "").count("{0}") > 1


def _operation(node: Node, at: Callable, to: Language, language: str) -> tuple[str, int]:
    """The text of a node, and its precedence."""
    op, args = node.op, node.args
    if op in ("sum", "add"):
        pairs = (
            zip(args[::2], args[1::2], strict=True) if op == "sum" else ((a, None) for a in args)
        )
        return _sum(list(pairs), at), _SUM
    if op in ("scale", "mul", "product"):
        if -1.0 in args and len(args) == 2:
            (other,) = [a for a in args if isinstance(a, Node)]
            return _negate(at(other, _PRODUCT)), _SIGN
        return " * ".join(at(a, _PRODUCT) for a in args), _PRODUCT
    if op == "div":
        return f"{at(args[0], _PRODUCT)} / {at(args[1], _SIGN)}", _PRODUCT
    if op in COMPARISONS:
        sign = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}[op]
        return f"{at(args[0], _SUM)} {sign} {at(args[1], _SUM)}", _COMPARISON
    if op == "pow" and not isinstance(args[1], Node) and args[1] + 0.5 in (0.0, -1.0, -2.0):
        # A product is faster than the power, and more accurate.
        base = at(args[0], _WHOLE)
        factors = [base] * int(-args[1] - 0.5) + [to.calls["sqrt"].format(base)]
        below = " * ".join(factors)
        return f"1.0 / {f'({below})' if len(factors) > 1 else below}", _PRODUCT
    if op in to.calls:
        least = _WHOLE if op in ("sign", "pow") or _repeats(op, to) else _CHOICE
        return to.calls[op].format(*(at(a, least) for a in args)), _WHOLE
    if op == "select":
        which, no, yes = (at(a, _LOGIC) for a in args)
        return to.choice.format(which, yes, no), _CHOICE
    if op in LOGIC:
        words = dict(zip(("and", "or", "not"), to.logic, strict=True))
        parts = [at(a, _WHOLE) for a in args]
        return f"{words[op]}{parts[0]}" if op == "not" else words[op].join(parts), _LOGIC
    others = ", ".join(name for name, one in LANGUAGES.items() if op in one.calls)
    remedy = f"Take another language: {others}." if others else ""
    raise _checks.fail("language", f"one with the function {op}", language, remedy)


def _sum(pairs: list[tuple[Number, Node | None]], at: Callable) -> str:
    text = ""
    for factor, term in pairs:
        negative, size = False, factor
        if not isinstance(factor, Node) and factor < 0:
            negative, size = True, -factor
        if term is None:
            part = at(size, _PRODUCT)
        else:
            part = at(term, _PRODUCT)
            part = part if size == 1 else f"{at(size, _PRODUCT)} * {part}"
        if text:
            text += f" - {part}" if negative else f" + {part}"
        else:
            text = _negate(part) if negative else part
    return text


def _negate(text: str) -> str:
    # Two minus signs in a row are a decrement in C.
    return f"-({text})" if text.startswith("-") else f"-{text}"


def _number(a: float | int | bool, to: Language) -> tuple[str, int]:
    infinite, minus_infinite, nan, true, false = to.constants
    if isinstance(a, bool | np.bool_):
        return (true if a else false), _WHOLE
    if math.isnan(a):
        return nan, _WHOLE
    if math.isinf(a):
        return (infinite, _WHOLE) if a > 0 else (minus_infinite, _SIGN)
    return repr(float(a)), _WHOLE if math.copysign(1.0, a) > 0 else _SIGN


def _is_condition(node: Number) -> bool:
    if not isinstance(node, Node):
        return isinstance(node, bool)
    if node.op == "select":
        return _is_condition(node.args[1])
    return node.op in COMPARISONS or node.op in LOGIC or node.op in TESTS
