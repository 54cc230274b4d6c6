"""Messages of misuse: ``name: expected ..., got .... What to do.``, each a ValueError.

`jaxdyn._checks` has these functions too, and those that need arrays.
"""

import difflib
import numbers
import reprlib
from collections.abc import Iterable
from typing import Any


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
        near = difflib.get_close_matches(str(x), choices, n=1)
        hint = f"Did you mean {near[0]!r}?" if near else ""
        which = f"one of {', '.join(choices)}" if choices else "no name, since there is none"
        which = f"one that `{listed_by}` shows" if listed_by else which
        raise fail(name, which, repr(x), hint)
    return x


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
