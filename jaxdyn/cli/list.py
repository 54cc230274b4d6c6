"""The command `jaxdyn list`: the scenes with their numbers, the course's problems."""

import json
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from jaxdyn import catalogue
from jaxdyn.cli.shared import JsonOption
from jaxdyn.course import PROBLEMS


def list_command(
    as_object: JsonOption = False,
    problems: Annotated[
        bool, typer.Option("--problems", help="The course's problems and what answers each.")
    ] = False,
) -> None:
    """Every scene with its course problems, its numbers, their defaults and units."""
    if problems:
        _list_problems(as_object)
        return
    zoo = catalogue.entries()
    if as_object:
        print(json.dumps({name: _described(entry) for name, entry in zoo.items()}))  # noqa: T201
        return
    table = Table("scene", "problems", "what it is, and its numbers")
    for name, entry in zoo.items():
        lines = [f"[bold]{escape(entry.summary)}[/bold]"]
        for p in entry.parameters:
            lines.append(escape(f"{p.name} = {_shown(p.default)}: {p.meaning}"))
        table.add_row(name, ", ".join(map(str, entry.problems)), "\n".join(lines), end_section=True)
    Console(highlight=False).print(table)


def _list_problems(as_object: bool) -> None:
    """The other way round: each problem with the public names that answer it."""
    if as_object:
        print(json.dumps({n: problem._asdict() for n, problem in PROBLEMS.items()}))  # noqa: T201
        return
    table = Table("problem", "what it is about", "jaxdyn names that answer it, and the answer")
    for n, problem in PROBLEMS.items():
        names = "\n".join([*problem.names, f"[italic]{escape(problem.answer)}[/italic]"])
        table.add_row(str(n), escape(problem.title), names, end_section=True)
    Console(highlight=False).print(table)


def _shown(default) -> str:
    if isinstance(default, tuple):
        return ", ".join(f"{x:.6g}" if isinstance(x, float) else str(x) for x in default)
    return f"{default:.6g}" if isinstance(default, float) else str(default)


def _described(entry: catalogue.Entry) -> dict:
    numbers = {p.name: {"default": p.default, "meaning": p.meaning} for p in entry.parameters}
    return {"summary": entry.summary, "problems": entry.problems, "parameters": numbers}
