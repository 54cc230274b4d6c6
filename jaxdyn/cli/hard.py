"""The command `jaxdyn hard`: lists the hard cases, or runs them and prints their verdicts."""

import math
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

import jaxdyn
from jaxdyn._text import choice
from jaxdyn.cli import completion, docstrings
from jaxdyn.cli.screen import Screen, screen

_FAILED = 1  # exit code: a figure exceeds its bound


def hard_command(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Cases to run; all if none is named.", autocompletion=completion.case),
    ] = None,
    only_list: Annotated[bool, typer.Option("--list", help="List the cases.")] = False,
    as_object: Annotated[bool, typer.Option("--json", help="One JSON object per figure.")] = False,
) -> None:
    """Run cases that break naive codes; print the figures of each, their bounds and a verdict."""
    known = docstrings.hard_cases()
    for name in names or ():
        choice("case", name, known, "jaxdyn hard --list")
    if only_list:
        table = Table("case", "what must hold")
        for name, holds in known.items():
            table.add_row(name, escape(holds))
        Screen(as_object).print(table)
        return
    with screen("looking the cases up", as_object) as out:
        cases = jaxdyn.hard.chosen(names or ())
        held, seconds = [], 0.0
        for done, case in enumerate(cases):
            out.show_task(f"running {case.name}", done, len(cases))
            verdict = jaxdyn.hard.judge(case)
            held.append(verdict.passed)
            seconds += verdict.seconds
            if as_object:
                for row in rows(verdict):
                    out.result(row)
            else:
                _print(verdict, out)
        if as_object:
            out.result(total(held, seconds))
        else:
            out.print(f"{sum(held)} of {len(held)} cases hold ({seconds:.1f} s)")
        if not all(held):
            raise typer.Exit(_FAILED)


def rows(verdict: "jaxdyn.hard.Verdict") -> list[dict]:
    """One record for each figure of a case; `bound` and `pass` are null for one without a bound."""
    return [
        {
            "name": verdict.case.name,
            "what": figure.what,
            "figure": figure.value,
            "bound": figure.bound,
            "pass": None if figure.bound is None else figure.passed,
            "seconds": round(verdict.seconds, 3),
        }
        for figure in verdict.figures
    ]


def total(held: list[bool], seconds: float) -> dict:
    """The last record of a run: the number of cases that fail, and the time."""
    failed = held.count(False)
    return {
        "name": "total",
        "what": f"cases that fail, of {len(held)}",
        "figure": failed,
        "bound": 0,
        "pass": failed == 0,
        "seconds": round(seconds, 3),
    }


def _print(verdict: "jaxdyn.hard.Verdict", out: Screen) -> None:
    colour, word = ("green", "holds") if verdict.passed else ("red", "fails")
    out.print(
        f"[bold]{verdict.case.name}[/bold] [{colour}]{word}[/{colour}] "
        f"({verdict.seconds:.1f} s): {escape(verdict.case.holds)}"
    )
    for figure in verdict.figures:
        value = f"{figure.value:.6g}" if math.isfinite(figure.value) else "not reached"
        bound = "" if figure.bound is None else f"at most {figure.bound:g}"
        mark = "" if figure.passed else " [red]too large[/red]"
        out.print(f"  {escape(figure.what):40} {value:>14}  {bound}{mark}")
