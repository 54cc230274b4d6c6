"""What is said of a problem of the course: the names that answer it, and the answer in short."""

from typing import NamedTuple


class Problem(NamedTuple):
    """A problem: its title, the public names that answer it, and a summary of the answer."""

    title: str
    names: tuple[str, ...]
    answer: str


def problem(title: str, names: str, answer: str) -> Problem:
    """A `Problem` from its names in one text, separated by spaces."""
    return Problem(title=title, names=tuple(names.split()), answer=answer)
