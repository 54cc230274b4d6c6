"""Text for people: error messages, numbers with their units, records as tables and as HTML.

Descriptions of objects never raise: arrays that are long or traced are shown by their shape.
Neither JAX nor NumPy, which load slowly, is imported here.
"""

import base64
import collections
import dataclasses
import difflib
import enum
import functools
import inspect
import math
import numbers
import re
import reprlib
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import Any, ParamSpec, TypeVar

# ---- Messages of misuse: ``name: expected ..., got .... What to do.``, each a ValueError
#
# `jaxdyn._checks` has these functions too, and those that need arrays.


def fail(name: str, expected: str, got: Any, remedy: str = "") -> ValueError:
    """The ValueError with a message in this project's format."""
    return ValueError(f"{name}: expected {expected}, got {got}.{' ' + remedy if remedy else ''}")


def whole(name: str, x: Any, least: int = 1, most: int = 2**62, remedy: str = "") -> int:
    """x; raises unless it is a whole number from least to most."""
    if type(x) is int and least <= x <= most:
        return x
    if not isinstance(x, numbers.Integral) or isinstance(x, bool) or int(x) < least:
        raise fail(name, f"a whole number, at least {least}", reprlib.repr(x), remedy)
    if int(x) > most:
        raise fail(name, f"at most {most}", reprlib.repr(x), remedy)
    return int(x)


def check_digits(digits: float) -> None:
    """Check a number of digits that is asked of doubles."""
    if not 0 < digits <= 15:
        raise fail("digits", "above 0, at most 15", digits, "Doubles have just under 16.")


def flag(name: str, x: Any) -> bool:
    """x; raises unless it is True or False: other values would count as one of them."""
    if not isinstance(x, bool):
        raise fail(name, "True or False", repr(x))
    return x


def choice(name: str, x: str, choices: Iterable[str], listed_by: str = "") -> str:
    """x; raises unless it is among the choices, and suggests the nearest one.

    For a long list of choices, `listed_by` is the command that prints them.
    """
    choices = sorted(choices)
    if x not in choices:
        which = f"one of {', '.join(choices)}" if choices else "no name, since there is none"
        which = f"one that `{listed_by}` shows" if listed_by else which
        raise fail(name, which, repr(x), suggestion(str(x), choices))
    return x


def suggestion(word: str, known: Iterable[str]) -> str:
    """A question whether another name is meant; "" where none is similar.

    A name that differs in case comes first, then one that has the word among its parts, as
    ``continue_family`` has ``family``, then one that is spelled similarly.
    """
    known = sorted(known)
    near = [name for name in known if name.lower() == word.lower()]
    near = near or [name for name in known if word.lower() in name.lower().split("_")]
    near = near or difflib.get_close_matches(word, known, n=1)
    return f"Did you mean {near[0]!r}?" if near else ""


def number_of(n: int, noun: str, plural: str = "") -> str:
    """A number with its noun, e.g. "1 loop" or "2 families".

    Args:
      n: the number.
      noun: the singular.
      plural: the plural; the noun with an s by default.
    Example:
      >>> number_of(1, "loop"), number_of(0, "loop"), number_of(2, "family", "families")
      ('1 loop', '0 loops', '2 families')
    """
    return f"{n} {noun if n == 1 else plural or noun + 's'}"


# ---- Numbers with their units, and records as tables: the `__repr__` of scenes, motions, results

_MOST_NUMBERS = 6  # most numbers of an array that are shown
_MOST_ENTRIES = 12  # most entries of a state that are shown
#: Units as in docstrings are names, powers, products and quotients of these.
TOKEN = r"(?:kg|km|m|s|day|N|J|W|rad|Hz)"
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


def entries(
    labels: Sequence[tuple[str, str]], y: Any, digits: int = 6, most: int = _MOST_ENTRIES
) -> str:
    """The entries of a state (k,) by name, with units; the first `most` of a long state.

    Example:
      >>> import numpy as np
      >>> entries([("x", "m"), ("vx", "m/s")], np.array([1.0, -0.5]))
      'x = 1 m, vx = -0.5 m/s'
    """
    values = as_lists(y) if getattr(y, "shape", ()) == (len(labels),) else None
    if values is None:
        return brief(y)
    rows = zip(labels, values, strict=True)
    written = [f"{name} = {brief(float(x), unit, digits)}" for (name, unit), x in rows]
    more = len(written) - most
    return ", ".join([*written[:most], *([f"and {more} more"] if more > 0 else [])])


def title_of(scene: Any) -> str:
    """The name of a scene, or of its system."""
    return scene.name or type(scene.system).__name__


def name_of(function: Callable, otherwise: str = "") -> str:
    """The name of a function in words; `otherwise` for one without."""
    name = getattr(function, "__name__", "<lambda>")
    return otherwise if name == "<lambda>" else name.strip("_").replace("_", " ")


def words(x: Any) -> str:
    """The name of the class of an object as words, such as "uniform gravity"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(x).__name__.strip("_")).lower()


def with_unit(name: str, unit: str) -> str:
    """A name with its unit in brackets, as axes and columns have it; "1" and "" are no unit."""
    return name if unit in ("", "1") else f"{name} [{unit}]"


def second(labels: Sequence[tuple[str, str]]) -> str:
    """The unit of time for a state with these labels; "" where there are no units.

    It is that of their rates, "day" where one is in "km/day", else "s".
    """
    units = [unit for _, unit in labels if unit != "1"]
    rates = (unit.rpartition("/")[2] for unit in units if "/" in unit)
    return next((unit for unit in rates if unit.isalpha()), "s") if units else ""


def rad_per_second(labels: Sequence[tuple[str, str]]) -> str:
    """The unit of an angular frequency, e.g. "rad/s"; "" without a unit of time."""
    return frequency_scale(second(labels), hertz=False)[1]


def frequency_scale(time: str, *, hertz: bool) -> tuple[float, str]:
    """The factor by which an angular frequency is multiplied to be shown, and its unit then.

    Args:
      time: the unit of time; "" without one.
      hertz: whether it is shown in turns, not radians, per unit of time.
    Example:
      >>> frequency_scale("day", hertz=False), frequency_scale("s", hertz=True)[1]
      ((1.0, 'rad/day'), 'Hz')
    """
    if not hertz:
        return 1.0, f"rad/{time}" if time else ""
    return 1 / (2 * math.pi), "Hz" if time == "s" else f"1/{time}" if time else ""


def frequency(w: float, time: str) -> str:
    """An angular frequency and, if there is a unit of time, the frequency in turns per unit.

    Example:
      >>> frequency(2.0, "s")
      '2 rad/s (0.31831 Hz)'
    """
    units = [frequency_scale(time, hertz=hertz) for hertz in (False, True)]
    angular, plain = (brief(w * scale, unit) for scale, unit in units)
    return f"{angular} ({plain})" if time else angular


def in_si(labels: Sequence[tuple[str, str]]) -> bool:
    """Whether the units of a state with these labels are SI units."""
    speeds = {unit.rpartition("/")[0] for _, unit in labels if "/" in unit}
    return second(labels) == "s" and speeds <= {"m", "rad"}


def record(x: Any, named: Callable[[str], str] = str) -> str:
    """A module as its class name with its numbers, and their units from its docstring.

    Args:
      x: the module.
      named: what a unit is called: itself, or one in other units; "" for none.
    Example:
      >>> from jaxdyn import effects
      >>> record(effects.UniformGravity(9.81)), record(effects.UniformGravity(9.81), lambda _: "")
      ('UniformGravity(g = 9.81 m/s^2)', 'UniformGravity(g = 9.81)')
    """
    parts, entries = [], getattr(x, "parameter_names", dict)()
    for field in filter(lambda field: field.init and field.repr, dataclasses.fields(x)):
        inner = getattr(x, field.name, None)
        if field.name in entries:
            several = inner if getattr(inner, "ndim", 1) else [inner]
            pairs = zip(entries[field.name], several, strict=True)
            parts += [f"{name} = {part(one, '', named)}" for name, one in pairs]
            continue
        # Options at their defaults, and unset fields, are omitted.
        if inner is None or (field.metadata.get("static") and inner == field.default):
            continue
        unit = named(unit_of(type(x), field.name))
        parts.append(f"{field.name} = {part(inner, unit, named)}")
    return f"{type(x).__name__.strip('_')}({', '.join(parts)})"


def part(x: Any, unit: str, named: Callable[[str], str] = str) -> str:
    """The text of a field: a module as by `record`, collections by their entries, else numbers."""
    if dataclasses.is_dataclass(x):
        return record(x, named)
    if isinstance(x, tuple) and hasattr(x, "_fields"):
        inner = ", ".join(f"{name} = {part(one, '', named)}" for name, one in x._asdict().items())
        return f"{type(x).__name__}({inner})"
    if isinstance(x, dict):
        return "{" + ", ".join(f"{key}: {part(x[key], unit, named)}" for key in x) + "}"
    if isinstance(x, tuple | list):
        return _tuple_text(part(one, unit, named) for one in x)
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


@functools.cache
def meaning_of(kind: type, name: str) -> str:
    """What a field is, by the first words of its line in a class docstring; "" if there is none.

    Example:
      >>> from jaxdyn import effects
      >>> meaning_of(effects.HingeDamper, "c"), meaning_of(effects.HingeDamper, "i")
      ('damping of the hinge', '')
    """
    line = rf"^ +{name}: (?:\([^()]*\) )?((?:[^\[,;.]|,(?= of ))*)"
    texts = (cls.__dict__.get("__doc__") or "" for cls in kind.__mro__)
    found = next(filter(None, (re.search(line, text, re.MULTILINE) for text in texts)), None)
    return " ".join(found[1].split()).rstrip(" :") if found else ""


P = ParamSpec("P")

_MOST_ROWS = 8  # most rows of a list in a result
_WIDTH = 100  # characters of a line

#: Spaces without a line break: around an equals sign, between a number and the word or the unit
#: behind it, and within units.
_TOGETHER = re.compile(
    rf" (?==)|(?<==) |(?<=\d) (?=[^\W\d])|(?<=[\w)]) (?={TOKEN}(?:[/^* ,)]|$)|\w+(?:\^\d|/\w))"
)


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
    return table(type(self).__name__, field_rows(self))


def field_rows(self: Any) -> list[tuple[str, str]]:
    """Name and text of each field of a record of results, in the units of its scene, if any."""
    kind, tuples = type(self), isinstance(self, tuple)
    names = self._fields if tuples else [x.name for x in dataclasses.fields(self) if x.repr]
    named = getattr(getattr(self, "scene", self), "in_units", str)
    rows = [(name, _field(kind, name, getattr(self, name), named)) for name in names]
    if isinstance(getattr(kind, "message", None), property):
        rows.append(("message", self.message))
    return [row for row in rows if row[1] != "None"]


def _field(kind: type, name: str, x: Any, named: Callable[[str], str]) -> str:
    """A field of a record; codes by name if it is annotated like ``Annotated[Array, Status]``.

    For many codes, it says how often each occurs, the most frequent first.
    """
    code = (*getattr(inspect.get_annotations(kind).get(name), "__metadata__", ()), None)[0]
    values = as_lists(x) if code else None
    if code is None or values is None:
        return part(x, named(unit_of(kind, name)))
    if not isinstance(values, list):
        return code(values).name
    counts = collections.Counter(x.ravel().tolist()).most_common()
    return ", ".join(f"{n} {code(one).name}" for one, n in counts)


def shorten(rows: Sequence[tuple[str, str]], most: int = _MOST_ROWS) -> list[tuple[str, str]]:
    """The rows of a table; of more than `most` the first and the last, and the number between."""
    between = len(rows) - most
    if between <= 0:
        return list(rows)
    half = most // 2
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


# ---- Results for JSON, which has no NaN and no infinities: null stands for both


def with_null(value: Any) -> Any:
    """A value of lists, dictionaries and arrays with None for each number that is not finite.

    Arrays become nested lists.

    Example:
      >>> with_null({"error": float("nan"), "steps": (3, 4)})
      {'error': None, 'steps': [3, 4]}
    """
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {key: with_null(x) for key, x in value.items()}
    if isinstance(value, list | tuple):
        return [with_null(x) for x in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# ---- Tables as HTML, in notebooks, with a small picture where there is one to draw
#
# Whatever happens, a notebook shows something: the table alone if there is no picture, and other
# text unchanged. Colours are those of the notebook, light or dark.

T = TypeVar("T")

_LEFT = 'style="text-align: left; vertical-align: top"'
_HEAD = 'style="text-align: left; white-space: nowrap"'  # a narrow table would break it
_NARROW = 'style="max-width: 40em"'  # so that the picture is beside it
_ROW = 'style="display: flex; flex-wrap: wrap; gap: 1em; align-items: flex-start"'


def html(self: Any) -> str:
    """The table of `repr` as HTML: the `_repr_html_` of classes whose `repr` is one."""
    return _html_of_text(_description(self))


def with_picture(draw: Callable[[T], Any]) -> Callable[[T], str]:
    """Decorate a method that draws an object: its `_repr_html_`, the table beside that picture.

    Args:
      draw: the method; it returns a `jaxdyn.drawing.figures.Picture`.
    """

    @functools.wraps(draw)
    def shown(self: T) -> str:
        text = _description(self)
        try:
            data = base64.b64encode(draw(self).small()).decode()
        except Exception:  # nothing to draw, or nothing that can be drawn
            return _html_of_text(text)
        about = f"Picture of {text.splitlines()[0]}"
        image = f'<img alt="{escape(about)}" src="data:image/png;base64,{data}">'
        return f"<div {_ROW}>{_html_of_text(text)}{image}</div>"

    return shown


def _description(x: Any) -> str:
    """The text of an object, as the `Table` that its `__repr__` makes, if it makes one."""
    try:
        return inspect.unwrap(type(x).__repr__)(x)
    except Exception:  # which `never_raising` handles
        return repr(x)


def _html_of_text(text: str) -> str:
    if not isinstance(text, Table):
        return f"<pre>{escape(text)}</pre>"
    rows = "".join(
        f'<tr><th scope="row" {_LEFT}>{escape(name)}</th><td {_LEFT}>{escape(said)}</td></tr>'
        for name, said in text.rows
    )
    head = f"<caption {_HEAD}><strong>{escape(text.head)}</strong></caption>"
    return f"<table {_NARROW}>{head}<tbody>{rows}</tbody></table>"
