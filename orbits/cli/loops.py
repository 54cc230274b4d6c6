"""The command `orbits loops`: how many loops closed orbits about a centre have, and one of them."""

import json
import math
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from jaxdyn._checks import fail
from jaxdyn.cli.shared import JsonOption, PlotOption
from jaxdyn.effects import PowerLaw
from orbits import loops
from orbits.cli.shared import NOT_FOUND, check_files, draw, numbers
from orbits.problem import Orbit, SearchError

_EXPONENTS = "-2.9,-2.5,-2,-1.5,-1,0,0.5,1,2,3,5,10,100,1000"


def loops_command(
    n: Annotated[
        str, typer.Option(metavar="A,B,...", help="Exponents of the force r^n.")
    ] = _EXPONENTS,
    turns: Annotated[int | None, typer.Option(help="Find the orbit with so many turns ...")] = None,
    count: Annotated[int | None, typer.Option("--loops", help="... and so many loops.")] = None,
    plot: PlotOption = None,
    as_object: JsonOption = False,
) -> None:
    """Least number of loops against the exponent; with --turns and --loops one orbit.

    A picture of the first has the apsidal angle against the exponent; one of an orbit that does
    not exist shows what moves there instead, mostly a rosette that fills its ring, and why.
    """
    check_files(plot, None, None)
    exponents = numbers("--n", n)
    if turns is None and count is None:
        _table(exponents, plot, as_object)
        return
    if turns is None or count is None:
        raise fail("--turns and --loops", "both or neither", "one", "An orbit has p and q.")
    if len(exponents) != 1:
        raise fail("--n", "one exponent with --turns and --loops", n, "Give it: --n=-1.")
    console = Console(stderr=as_object, highlight=False, soft_wrap=True)
    law = PowerLaw(1.0, exponents[0])
    try:
        orbit = loops.closed(law, turns, count)
    except SearchError as error:
        if as_object:
            print(json.dumps({"ok": False, "message": str(error)}))  # noqa: T201
        console.print(f"[red]no orbit[/red]: {error}")
        if plot:
            _draw_failure(law, turns, count, str(error), plot, console)
        raise typer.Exit(NOT_FOUND) from None
    _print(orbit, turns, count, exponents[0], plot, console)
    if as_object:
        wanted = {"n": exponents[0], "turns": turns, "loops": count, "period": orbit.period}
        start = [float(x) for x in orbit.y0]
        print(json.dumps({"ok": True, **wanted, "y0": start, "closure": orbit.residual}))  # noqa: T201


def _table(exponents: list[float], plot: Path | None, as_object: bool) -> None:
    moves = [n for n in exponents if n > -3]
    if plot and len(moves) < 2:
        remedy = "The picture goes from the smallest to the largest."
        raise fail("--n", "two exponents above -3 for a picture", f"{len(moves)}", remedy)
    found = loops.least(exponents)
    if as_object:
        names = ("n", "loops", "turns", "circle", "line")
        columns = {name: _column(getattr(found, name)) for name in names}
        print(json.dumps({**columns, "message": found.message}))  # noqa: T201
    else:
        console = Console(highlight=False, soft_wrap=True)
        table = Table("n", "least loops", "turns", "angle / pi near circles", "near lines")
        for i, n in enumerate(found.n):
            counts = (f"{found.loops[i]}", f"{found.turns[i]}") if found.loops[i] else ("-", "-")
            table.add_row(f"{n:g}", *counts, f"{found.circle[i]:.6g}", f"{found.line[i]:.6g}")
        console.print(table)
        console.print(found.message)
    if plot:
        from orbits import drawing

        drawing.loops(plot, lowest=min(moves), highest=max(moves))


def _draw_failure(law, turns: int, count: int, why: str, plot: Path, console: Console) -> None:
    from orbits import drawing

    try:
        scene = loops.rosette(law)
    except SearchError:
        console.print("there is nothing to draw: no motion stays between two radii")
        return
    drawing.rosette(scene, plot, f"turns / loops = {turns} / {count} does not exist. {why}")
    console.print(f"what moves there instead is drawn in {plot}")


def _print(
    orbit: Orbit, turns: int, count: int, n: float, plot: Path | None, console: Console
) -> None:
    x, speed = float(orbit.y0[0]), float(np.hypot(*orbit.y0[2:]))
    console.print(
        f"{count} loops in {turns} turns: from r = {x:.12g} across at {speed:.12g}, "
        f"period {orbit.period:.12g}, closed to {orbit.residual:.1e}"
    )
    draw([orbit], [f"r^{n:g}: {count} loops in {turns} turns"], plot, None, console)


def _column(values: np.ndarray) -> list:
    return [x if math.isfinite(x) else None for x in values.tolist()]
