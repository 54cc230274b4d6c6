"""Text for people: error messages, numbers with their units, records as tables and as HTML.

`messages` is for misuse, `tables` for numbers and the `__repr__` of scenes, motions and results,
`html` for notebooks, `null` for other programs. Descriptions of objects never raise: arrays that
are long or traced are shown by their shape. Neither JAX nor NumPy, which load slowly, is imported
here.

May import: nothing.

To add a kind of text, write a function in the file of its kind, and its name below.
"""

from jaxdyn._text.html import html, with_picture
from jaxdyn._text.messages import choice, fail, flag, number_of, whole
from jaxdyn._text.null import with_null
from jaxdyn._text.tables import (
    brief,
    entries,
    extent,
    fields,
    joule,
    never_raising,
    record,
    second,
    shorten,
    table,
    title_of,
    words,
)

__all__ = [
    "brief",
    "choice",
    "entries",
    "extent",
    "fail",
    "fields",
    "flag",
    "html",
    "joule",
    "never_raising",
    "number_of",
    "record",
    "second",
    "shorten",
    "table",
    "title_of",
    "whole",
    "with_null",
    "with_picture",
    "words",
]
