"""Numbers, states and modules as text, with their units."""

import dataclasses
import enum
import functools
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

_MOST_NUMBERS = 6  # of an array that are shown
_MOST_ENTRIES = 12  # of a state that are shown
#: Units as in docstrings are names, powers, products and quotients of these.
TOKEN = r"(?:kg|m|s|N|J|W|rad|Hz)"
_UNIT = rf"\[((?:1|{TOKEN})(?:[ /*^()\d-]|{TOKEN})*)\]"


def brief(x: Any, unit: str = "", digits: int = 6) -> str:
    """One or a few numbers with their unit; of more numbers the shape.

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
        text = _nested(values, digits)
    return f"{text} {unit}" if unit and unit != "1" else text


def as_lists(x: Any) -> Any:
    """The numbers of an array as lists; None where they are not available."""
    try:
        return x.tolist()
    except (AttributeError, TypeError, RuntimeError):  # a shape alone, traced, deleted
        return None


def _nested(values: Any, digits: int) -> str:
    if isinstance(values, list):
        return _listed(_nested(x, digits) for x in values)
    return _figure(values, digits) if isinstance(values, float | complex) else str(values)


def _figure(x: float | complex, digits: int) -> str:
    return format(x + 0.0, f".{digits}g")  # not -0


def _listed(parts: Iterable[str]) -> str:
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


def called(scene: Any) -> str:
    """The name of a scene, or of its system."""
    return scene.name or type(scene.system).__name__


def second(labels: Sequence[tuple[str, str]]) -> str:
    """The unit of time for a state with these labels: "s", or "" where there are no units."""
    return "s" if any(unit != "1" for _, unit in labels) else ""


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
        return _listed(part(one, unit, units) for one in x)
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
