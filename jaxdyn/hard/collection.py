"""All hard cases by name; a new one is an entry in `CASES` of the file of its topic."""

from collections.abc import Iterable

from jaxdyn import _checks
from jaxdyn.hard.case import Case
from jaxdyn.hard.cases import (
    bodies,
    centres,
    chaos,
    contact,
    coordinates,
    dependent,
    drift,
    encounters,
    friction,
    long,
    rest,
    separatrix,
    shaken,
    singular,
    stiff,
)

TOPICS = (
    encounters,
    singular,
    drift,
    dependent,
    coordinates,
    contact,
    friction,
    stiff,
    rest,
    shaken,
    separatrix,
    bodies,
    centres,
    chaos,
    long,
)
CASES = {case.name: case for topic in TOPICS for case in topic.CASES}


def chosen(names: Iterable[str]) -> tuple[Case, ...]:
    """The cases with the given names, or all cases.

    Raises:
      ValueError: a name is not that of a case; the nearest is suggested.
    """
    names = tuple(names) or tuple(CASES)
    return tuple(CASES[_checks.choice("case", name, CASES, "jaxdyn hard --list")] for name in names)
