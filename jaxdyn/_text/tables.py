"""Records as tables: the `__repr__` of scenes, motions and results."""

import collections
import dataclasses
import functools
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ParamSpec

from jaxdyn._text.numbers import TOKEN, as_lists, part, unit_of

P = ParamSpec("P")

_MOST_ROWS = 8  # of a list in a result
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

    Of many codes, how often each occurs, the most frequent first.
    """
    code = (*getattr(inspect.get_annotations(kind).get(name), "__metadata__", ()), None)[0]
    values = as_lists(x) if code else None
    if code is None or values is None:
        return part(x, unit_of(kind, name), True)
    if not isinstance(values, list):
        return code(values).name
    counts = collections.Counter(x.ravel().tolist()).most_common()
    return ", ".join(f"{n} {code(one).name}" for one, n in counts)


def cut(rows: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Rows of a table; of many the first and the last, and the number between."""
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
