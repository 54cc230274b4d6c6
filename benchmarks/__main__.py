"""Run the benchmarks: ``python -m benchmarks [NAME...] [--quick] [--json FILE]``.

Prints one table of times and ratios, and what got slower since ``last_run.json``, the stored
result of a full run; ``--json benchmarks/last_run.json`` replaces it. Other methods are listed
there too: if they got slower as well, it was the machine.
"""

import json
import math
import os
import platform
from datetime import date
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

import jaxdyn
from benchmarks import command, effects_cost, ensembles, figure_eight, monodromy
from benchmarks._timing import Row

_STORED = Path(__file__).with_name("last_run.json")
#: A time that grew by more than this factor is reported.
_SLOWER = 1.3


class Name(StrEnum):
    """The benchmarks."""

    FIGURE_EIGHT = "figure-eight"
    MONODROMY = "monodromy"
    EFFECTS_COST = "effects-cost"
    ENSEMBLES = "ensembles"
    COMMAND = "command"


_RUN = {
    Name.FIGURE_EIGHT: figure_eight.run,
    Name.MONODROMY: monodromy.run,
    Name.EFFECTS_COST: effects_cost.run,
    Name.ENSEMBLES: ensembles.run,
    Name.COMMAND: command.run,
}


def main(
    names: Annotated[list[Name] | None, typer.Argument(help="Which; all if left out.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few rounds, for a rough look.")] = False,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the numbers.")] = None,
) -> None:
    """Times at equal true error, ours against others, and what got slower."""
    # No compile cache: the time of a first run is one of the questions.
    jaxdyn.configure(cache=False)
    rows = [row for name in names or list(Name) for row in _RUN[name](quick)]
    console = Console(width=100)
    console.print(table(rows))
    result = as_json(rows)
    if _STORED.is_file():
        stored = json.loads(_STORED.read_text())
        console.print(f"compared with {stored['date']} on {stored['machine']}:")
        for line in slower(result, stored) or ["nothing got slower"]:
            console.print(f"  {line}")
    if json_file:
        json_file.write_text(json.dumps(result, indent=1) + "\n")


def table(rows: list[Row]) -> Table:
    """Times of all rows, with the ratio of the first method of each to the others."""
    shown = Table(box=None)
    for column in ("", "method", "median", "minimum", "ours / it", "minima"):
        shown.add_column(
            column, no_wrap=True, justify="left" if column in ("", "method") else "right"
        )
    for row in rows:
        ours = next(iter(row.times.values()))
        name = row.name
        for method, it in row.times.items():
            ratios = ("", "")
            if it is not ours and not math.isnan(it.median):
                ratios = (f"{ours.median / it.median:.2g}", f"{ours.minimum / it.minimum:.2g}")
            shown.add_row(name, method, _time(it.median), _time(it.minimum), *ratios)
            name = ""
    return shown


def as_json(rows: list[Row]) -> dict:
    """Seconds by row and method, where there are any, with where and when."""
    machine = f"{platform.machine()}, {os.cpu_count()} cores"
    times = {
        row.name: {m: t._asdict() for m, t in row.times.items() if not math.isnan(t.median)}
        for row in rows
    }
    return {"date": f"{date.today():%Y-%m}", "machine": machine, "seconds": times}


def slower(result: dict, stored: dict) -> list[str]:
    """A line for each least time that grew by more than `_SLOWER`."""
    lines = []
    for row, methods in result["seconds"].items():
        before = stored["seconds"].get(row, {})
        for method in methods.keys() & before.keys():
            factor = methods[method]["minimum"] / before[method]["minimum"]
            if factor > _SLOWER:
                lines.append(f"{row}, {method}: {factor:.2f} times as long")
    return lines


def _time(seconds: float) -> str:
    if math.isnan(seconds):
        return "not reached"
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.2f} {unit}"
    return f"{seconds * 1e6:.1f} us"


if __name__ == "__main__":
    typer.run(main)
