"""Numbers with their units, and records as tables: the `__repr__` of scenes, motions, results."""

import collections
import dataclasses
import enum
import functools
import inspect
import math
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ParamSpec

_MOST_NUMBERS = 6  # most numbers of an array that are shown
_MOST_ENTRIES = 12  # most entries of a state that are shown
#: Units as in docstrings are names, powers, products and quotients of these.
TOKEN = r"(?:kg|m|s|N|J|W|rad|Hz)"
_UNIT = rf"\[((?:1|{TOKEN})(?:[ /*^()\d-]|{TOKEN})*)\]"


def brief(x: Any, unit: str = "", digits: int = 6) -> str:
    """One or a few numbers with their unit; for more numbers, their shape.

    Example:
      >>> brief(0.1), brief(9.81, "m/s^2")
      ('0.1', '9.81 m/s^2')
      >>> import numpy as np
      >>> brief(np.array([1.0, 2.5]), "kg"), brief(np.ones((100, 2)))
      ('(1, 2.5) kg', 'shape (100, 2)')
    """
    shape = getattr(x, "shape", None)
    if shape is None:
        plain = x.name if isinstance(x, enum.Enum) else str(x)
        text = _figure(x, digits) if isinstance(x, float | complex) else plain
    else:
        values = as_lists(x) if math.prod(shape) <= _MOST_NUMBERS else None
        if values is None:
            return f"shape {tuple(shape)}" if shape else "traced"
        text = _figures(values, digits)
    return f"{text} {unit}" if unit and unit != "1" else text


def as_lists(x: Any) -> Any:
    """The numbers of an array as lists; None where they are not available."""
    try:
        return x.tolist()
    except (AttributeError, TypeError, RuntimeError):  # a shape alone, traced, deleted
        return None


def _figures(values: Any, digits: int) -> str:
    if isinstance(values, list):
        return _tuple_text(_figures(x, digits) for x in values)
    return _figure(values, digits) if isinstance(values, float | complex) else str(values)


def _figure(x: float | complex, digits: int) -> str:
    return format(x + 0.0, f".{digits}g")  # not -0


def _tuple_text(parts: Iterable[str]) -> str:
    parts = list(parts)
    return "(" + ", ".join(parts) + ("," if len(parts) == 1 else "") + ")"


def extent(*arrays: Any, unit: str = "") -> str:
    """The range of all numbers of some arrays, or their common value.

    Example:
      >>> import numpy as np
      >>> extent(np.zeros(3), np.array([1.0, 2.0]), unit="s"), extent(np.array(5))
      ('0 to 2 s', '5')
    """
    flat = [as_lists(x) for x in arrays]
    if None in flat:
        return "traced"
    while isinstance(flat[0], list):
        flat = [x for row in flat for x in row]
    known = [x for x in flat if x == x] or flat
    low, high = brief(min(known)), brief(max(known))
    return brief(max(known), unit) if low == high else f"{low} to {brief(max(known), unit)}"


def entries(labels: Sequence[tuple[str, str]], y: Any) -> str:
    """The entries of a state (k,) by name, with units; the first ones of a long state.

    Example:
      >>> import numpy as np
      >>> entries([("x", "m"), ("vx", "m/s")], np.array([1.0, -0.5]))
      'x = 1 m, vx = -0.5 m/s'
    """
    values = as_lists(y) if getattr(y, "shape", ()) == (len(labels),) else None
    if values is None:
        return brief(y)
    rows = zip(labels, values, strict=True)
    written = [f"{name} = {brief(float(x), unit)}" for (name, unit), x in rows]
    more = len(written) - _MOST_ENTRIES
    return ", ".join([*written[:_MOST_ENTRIES], *([f"and {more} more"] if more > 0 else [])])


def title_of(scene: Any) -> str:
    """The name of a scene, or of its system."""
    return scene.name or type(scene.system).__name__


def words(x: Any) -> str:
    """The name of the class of an object as words, such as "uniform gravity"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(x).__name__.strip("_")).lower()


def second(labels: Sequence[tuple[str, str]]) -> str:
    """The unit of time for a state with these labels; "" where there are no units.

    It is that of their rates, "day" where one is in "km/day", else "s".
    """
    units = [unit for _, unit in labels if unit != "1"]
    rates = (unit.rpartition("/")[2] for unit in units if "/" in unit)
    return next((unit for unit in rates if unit.isalpha()), "s") if units else ""


def joule(labels: Sequence[tuple[str, str]]) -> str:
    """The unit of energy for a state with these labels: "J", or "" where they are not SI units."""
    speeds = {unit.rpartition("/")[0] for _, unit in labels if "/" in unit}
    return "J" if second(labels) == "s" and speeds <= {"m", "rad"} else ""


def record(x: Any, units: bool = True) -> str:
    """A module as its class name with its numbers, and their units from its docstring.

    Example:
      >>> from jaxdyn import effects
      >>> record(effects.UniformGravity(9.81)), record(effects.UniformGravity(9.81), units=False)
      ('UniformGravity(g = 9.81 m/s^2)', 'UniformGravity(g = 9.81)')
    """
    parts = []
    for field in filter(lambda field: field.init, dataclasses.fields(x)):
        inner = getattr(x, field.name, None)
        # Options at their defaults, and unset fields, are omitted.
        if inner is None or (field.metadata.get("static") and inner == field.default):
            continue
        unit = unit_of(type(x), field.name) if units else ""
        parts.append(f"{field.name} = {part(inner, unit, units)}")
    return f"{type(x).__name__.strip('_')}({', '.join(parts)})"


def part(x: Any, unit: str, units: bool) -> str:
    if dataclasses.is_dataclass(x):
        return record(x, units)
    if isinstance(x, tuple) and hasattr(x, "_fields"):
        named = x._asdict().items()
        inner = ", ".join(f"{name} = {part(one, '', units)}" for name, one in named)
        return f"{type(x).__name__}({inner})"
    if isinstance(x, dict):
        return "{" + ", ".join(f"{key}: {part(x[key], unit, units)}" for key in x) + "}"
    if isinstance(x, tuple | list):
        return _tuple_text(part(one, unit, units) for one in x)
    return getattr(x, "__name__", None) or brief(x, unit)


@functools.cache
def unit_of(kind: type, name: str) -> str:
    """The unit after the name of a field in a class docstring, or at the end of its line."""
    here = rf"(?<![\w^*/]){name}(?: \([^()]*\))? {_UNIT}"
    line = rf"^ +{name}: [^\n]*{_UNIT}"
    for cls in kind.__mro__:
        text = cls.__dict__.get("__doc__") or ""
        found = re.search(here, text) or re.search(line, text, re.MULTILINE)
        if found:
            return found[1]
    return ""


P = ParamSpec("P")

_MOST_ROWS = 8  # most rows of a list in a result
_WIDTH = 100  # characters of a line

#: Spaces without a line break: around an equals sign, and before and within units.
_TOGETHER = re.compile(rf" (?==)|(?<==) |(?<=[\w)]) (?={TOKEN}(?:[/^* ,)]|$))")


def never_raising(written: Callable[P, str]) -> Callable[P, str]:
    """A `__repr__` that falls back on that of Equinox, with types and shapes.

    Error messages may show modules with arrays in any condition: traced, deleted, replaced.
    """

    @functools.wraps(written)
    def safe(*args: P.args, **kwargs: P.kwargs) -> str:
        try:
            return str(written(*args, **kwargs))  # whoever takes a text may not take a `Table`
        except Exception:
            # Imported only when needed: it would slow down the help of commands.
            return sys.modules["equinox"].tree_pformat(args[0])

    return safe


@never_raising
def fields(self: Any) -> str:
    """A record of results as a table of its fields: the `__repr__` of their classes."""
    kind, tuples = type(self), isinstance(self, tuple)
    names = self._fields if tuples else [field.name for field in dataclasses.fields(self)]
    rows = [(name, _field(kind, name, getattr(self, name))) for name in names]
    if isinstance(getattr(kind, "message", None), property):
        rows.append(("message", self.message))
    return table(kind.__name__, [row for row in rows if row[1] != "None"])


def _field(kind: type, name: str, x: Any) -> str:
    """A field of a record; codes by name if it is annotated like ``Annotated[Array, Status]``.

    For many codes, it says how often each occurs, the most frequent first.
    """
    code = (*getattr(inspect.get_annotations(kind).get(name), "__metadata__", ()), None)[0]
    values = as_lists(x) if code else None
    if code is None or values is None:
        return part(x, unit_of(kind, name), True)
    if not isinstance(values, list):
        return code(values).name
    counts = collections.Counter(x.ravel().tolist()).most_common()
    return ", ".join(f"{n} {code(one).name}" for one, n in counts)


def shorten(rows: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """The rows of a table; of many rows the first and the last, and the number between them."""
    between = len(rows) - _MOST_ROWS
    if between <= 0:
        return list(rows)
    half = _MOST_ROWS // 2
    return [*rows[:half], ("...", f"{between} more"), *rows[-half:]]


class Table(str):
    """A table as text; `html` takes its heading and its rows.

    Attributes:
      head: its first line.
      rows: name and text of each row, without line breaks.
    """

    head: str
    rows: list[tuple[str, str]]


def table(head: str, rows: Iterable[tuple[str, str]]) -> Table:
    """A heading and rows of name and text; empty rows are omitted.

    Example:
      >>> print(table("Two balls", [("mass", "1 kg"), ("colour", ""), ("radius", "0.1 m")]))
      Two balls
        mass    1 kg
        radius  0.1 m
    """
    kept = [(name, text) for name, text in rows if text]
    width = max((len(name) for name, _ in kept), default=0) + 4
    lines = [
        textwrap.fill(
            _TOGETHER.sub("\0", text),
            _WIDTH,
            initial_indent=f"  {name}".ljust(width),
            subsequent_indent=" " * width,
            break_long_words=False,
            break_on_hyphens=False,
        )
        for name, text in kept
    ]
    written = Table("\n".join([head, *lines]).replace("\0", " "))
    written.head, written.rows = head, kept
    return written
