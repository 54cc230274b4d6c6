"""Shell completion besides commands and options: scenes, parameters, problems, hard cases.

Each function takes the text typed so far, and returns the words that begin with it, each with a
description that zsh and fish show beside it.
"""

from collections.abc import Iterable, Mapping

import typer
from rich.markup import escape

import jaxdyn
from jaxdyn.cli import docstrings

#: Those of `jaxdyn.symbolic.code`, which completion does not load.
LANGUAGES = ("python", "numpy", "javascript", "c", "julia")

#: Words, each with a description.
Words = list[tuple[str, str]]


def scene(incomplete: str) -> Words:
    """The scenes whose parameters are numbers."""
    return _beginning(incomplete, {name: x.summary for name, x in docstrings.scenes().items()})


def setting(context: typer.Context, incomplete: str) -> Words:
    """The parameters of the scene on the line, each up to its "="."""
    # An option that waits for its value ends the parsing of arguments, which remain unparsed.
    scenes, given = docstrings.scenes(), (context.params.get("name"), *context.args)
    known = next((scenes[name].parameters for name in given if name in scenes), {})
    return _beginning(incomplete, {f"{name}=": x.meaning for name, x in known.items()})


def problem(incomplete: str) -> Words:
    """The pages of the course, by name; numbers are typed faster than completed."""
    pages = jaxdyn.course.problems().values()
    return _beginning(incomplete, {page.name: page.title for page in pages})


def case(incomplete: str) -> Words:
    """The hard cases."""
    return _beginning(incomplete, docstrings.hard_cases())


def solver(incomplete: str) -> Words:
    """The values of --solver."""
    return _beginning(incomplete, ("auto", *docstrings.solver_names()))


def language(incomplete: str) -> Words:
    """The values of --code."""
    return _beginning(incomplete, LANGUAGES)


def _beginning(incomplete: str, known: Mapping[str, str] | Iterable[str]) -> Words:
    about = known if isinstance(known, Mapping) else dict.fromkeys(known, "")
    # Typer would take a unit such as [m] for a tag, and leave it out.
    return [(word, escape(text)) for word, text in about.items() if word.startswith(incomplete)]
