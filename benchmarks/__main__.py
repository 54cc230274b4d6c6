"""Run the benchmarks: ``python -m benchmarks [NAME...] [--quick] [--json FILE]``.

``python -m benchmarks published [ROW...]``, ``python -m benchmarks verdicts`` and ``python -m
benchmarks coverage [CASE...]`` check results instead of times: against published numbers, against
higher precision, and against known parameters; see their files.

Prints a table of times and ratios after each part, with target ratios where there are any, and at
the end everything that got slower since ``last_run.json``, the stored result of a full run;
``--json benchmarks/last_run.json`` updates it with the present results. Other methods are listed
there too: if they got slower as well, the cause is the machine. ``ensembles --device gpu`` runs on
a GPU.
"""

import json
import math
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

import jaxdyn
from benchmarks import (
    _peers,
    bodies,
    calls,
    command,
    compile_time,
    coverage,
    default_method,
    device,
    digits,
    effects_cost,
    ensembles,
    families,
    figure_eight,
    gradient,
    monodromy,
    nonsmooth,
    published,
    systems,
    verdicts,
)
from benchmarks._timing import Curves, Row
from benchmarks.picture import STORED
from jaxdyn._checks import choice, fail
from jaxdyn.files.input_files import MAX_BYTES, content, parse_json
from jaxdyn.files.output_files import replace, writable

MISUSE = 2  # exit code: invalid input
#: A time that grew by more than this factor is reported.
_SLOWER = 1.3


#: The benchmarks by name.
RUNS = {
    "figure-eight": figure_eight.run,
    "systems": systems.run,
    "bodies": bodies.run,
    "default": default_method.run,
    "nonsmooth": nonsmooth.run,
    "monodromy": monodromy.run,
    "gradient": gradient.run,
    "calls": calls.run,
    "compile-time": compile_time.run,
    "effects-cost": effects_cost.run,
    "ensembles": ensembles.run,
    "command": command.run,
    "digits": digits.run,
    "families": families.run,
}

#: Benchmarks of results, not of times, which have their own options.
ANSWERS = {"coverage": coverage.main, "published": published.main, "verdicts": verdicts.main}


def command_of(arguments: Sequence[str]) -> tuple[Callable[..., None], list[str]]:
    """The requested command, and its arguments."""
    name, *rest = arguments or [""]
    return (ANSWERS[name], rest) if name in ANSWERS else (main, list(arguments))


def main(
    names: Annotated[
        list[str] | None, typer.Argument(help=f"Of {', '.join(RUNS)}; all by default.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few rounds: a rough estimate.")] = False,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the numbers.")] = None,
    kind: Annotated[str, typer.Option("--device", help="cpu, or gpu for ensembles.")] = "cpu",
    peak: Annotated[
        float, typer.Option(help="Double-precision rate of the GPU [TFLOP/s].")
    ] = device.PEAK,
) -> None:
    """Times at equal true error, ours against others, and everything that got slower."""
    # No compile cache: the time of a first run is one of the questions.
    jaxdyn.configure(cache=False)
    _peers.build_anew()
    # Read before it is written.
    stored = json.loads(STORED.read_text()) if STORED.is_file() else None
    console = Console(width=150)
    found: list[Row | Curves] = []
    begin = time.monotonic()
    try:
        before = _before(json_file) if json_file else {}
        for name, each in measure(names or list(RUNS), kind, peak, quick):
            _show(console, [row for one in each for row in one.rows])
            console.print(f"{name}: {time.monotonic() - begin:.0f} s from the start\n")
            found += each
            if json_file:  # now, so that an interrupted run keeps its measurements
                replace(json_file, json.dumps(merge(before, as_json(found)), indent=1) + "\n")
    except ValueError as misuse:
        typer.echo(misuse, err=True)
        raise typer.Exit(MISUSE) from None
    if stored:
        console.print(f"compared with {stored['date']} on {stored['machine']}:")
        for line in slower(as_json(found), stored) or ["nothing got slower"]:
            console.print(f"  {line}")


def _before(path: Path) -> dict:
    """The results in the file that will be written, if it exists."""
    remedy = "Name a new file, or one that a benchmark has written."
    if not writable(path, "--json").is_file():
        return {}
    found = parse_json(content(path, MAX_BYTES, remedy, "--json"), "results of benchmarks", remedy)
    if not isinstance(found, dict):
        raise fail("--json", "results of benchmarks", f"'{path}' with something else", remedy)
    return found


def measure(
    names: list[str], kind: str, peak: float, quick: bool
) -> Iterator[tuple[str, Sequence[Row | Curves]]]:
    """The results of the named benchmarks on a kind of device, each as soon as it is measured."""
    for name in names:
        choice("name", name, RUNS)
    if kind == "cpu":
        for name in names:
            yield name, RUNS[name](quick)
    elif names != ["ensembles"]:
        raise fail("--device", "cpu for all but ensembles", kind, "Name ensembles alone.")
    else:
        yield "ensembles", device.run(kind, peak, quick)


def _show(console: Console, rows: list[Row]) -> None:
    console.print(table(rows))
    for row in rows:
        if row.note:
            console.print(f"{row.name}: {row.note}")


def table(rows: list[Row]) -> Table:
    """Times of all rows, with the ratio of the first method of each to the others."""
    shown = Table(box=None)
    for column in ("", "method", "median", "minimum", "ours / it", "minima", "wanted"):
        shown.add_column(
            column, no_wrap=True, justify="left" if column in ("", "method") else "right"
        )
    for row in rows:
        ours = next(iter(row.times.values()))
        name = row.name
        for method, it in row.times.items():
            ratios = ("", "", "")
            if it is not ours and not math.isnan(it.median):
                ratio = ours.minimum / it.minimum
                ratios = (f"{ours.median / it.median:.2g}", f"{ratio:.2g}", _target(row, method))
            shown.add_row(name, method, _time(it.median), _time(it.minimum), *ratios)
            name = ""
    return shown


def _target(row: Row, method: str) -> str:
    """The target ratio of minima, and whether it is met."""
    if method not in row.bars:
        return ""
    ours, bar = next(iter(row.times.values())), row.bars[method]
    return f"{bar:.2g} {'kept' if ours.minimum <= bar * row.times[method].minimum else 'missed'}"


def as_json(found: Sequence[Row | Curves]) -> dict:
    """Seconds by row and method, errors with seconds, and the machine and date."""
    times = {
        row.name: {m: t._asdict() for m, t in row.times.items() if not math.isnan(t.median)}
        for each in found
        for row in each.rows
    }
    curves = {
        each.name: {
            method: [(p.error, p.times.minimum) for p in points]
            for method, points in each.points.items()
        }
        for each in found
        if isinstance(each, Curves)
    }
    names = [row.name for each in found for row in each.rows]
    assert len(set(names)) == len(names), "two results of one name: one would be lost"
    machine = f"{platform.machine()}, {os.cpu_count()} cores"
    when = f"{date.today():%Y-%m}"
    return {"date": when, "machine": machine, "seconds": times, "curves": curves}


def merge(before: dict, result: dict) -> dict:
    """A stored result, updated with new results."""
    parts = {part: before.get(part, {}) | result[part] for part in ("seconds", "curves")}
    return result | parts


def slower(result: dict, stored: dict) -> list[str]:
    """A line for each minimum time that grew by more than `_SLOWER`."""
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
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.{1 if unit == 'us' else 2}f} {unit}"
    return f"{seconds * 1e9:.2f} ns"


if __name__ == "__main__":
    asked, given = command_of(sys.argv[1:])
    program = typer.Typer(add_completion=False)
    program.command()(asked)
    program(given, prog_name="python -m benchmarks")
