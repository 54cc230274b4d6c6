"""Text for people: error messages, numbers with their units, records as tables and as HTML.

`messages` is for misuse, `tables` for numbers and the `__repr__` of scenes, motions and results,
`html` for notebooks. Descriptions of objects never raise: arrays that are long
or traced are shown by their shape. Neither JAX nor NumPy, which load slowly, is imported here.

May import: nothing.

One more kind of text is a function in the file of its kind, and its name below.
"""

from jaxdyn._text.html import html, pictured
from jaxdyn._text.messages import choice, counted, fail, flag, whole
from jaxdyn._text.tables import (
    brief,
    called,
    cut,
    entries,
    extent,
    fields,
    never_raising,
    record,
    second,
    table,
)

__all__ = [
    "brief",
    "called",
    "choice",
    "counted",
    "cut",
    "entries",
    "extent",
    "fail",
    "fields",
    "flag",
    "html",
    "never_raising",
    "pictured",
    "record",
    "second",
    "table",
    "whole",
]
