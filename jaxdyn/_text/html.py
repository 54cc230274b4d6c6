"""Tables as HTML, in notebooks, with a small picture where there is one to draw.

Whatever happens, a notebook shows something: without a picture the table alone, and text that is
no table as it is. Colours are those of the notebook, light or dark.
"""

import base64
import functools
import inspect
from collections.abc import Callable
from html import escape
from typing import Any, TypeVar

from jaxdyn._text.tables import Table

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
