"""The command `orbits loops`: closed orbits about a centre, by their numbers of loops and turns."""

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

import jaxdyn
import orbits
from jaxdyn._text import fail, number_of
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import JsonOption, PlotOption, TitleOption, check_title
from orbits.cli.shared import NOT_FOUND, draw, numbers

_EXPONENTS = "-2.9,-2.5,-2,-1.5,-1,0,0.5,1,2,3,5,10,100,1000"


def loops_command(
    n: Annotated[
        str, typer.Option(metavar="A,B,...", help="Exponents of the force r^n.")
    ] = _EXPONENTS,
    turns: Annotated[
        int | None, typer.Option(help="Find the orbit with this many turns ...")
    ] = None,
    count: Annotated[int | None, typer.Option("--loops", help="... and this many loops.")] = None,
    plot: PlotOption = None,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """The smallest number of loops for each exponent; with --turns and --loops, one orbit.

    Without these options, the picture shows the apsidal angle against the exponent. For an orbit
    that does not exist it shows the actual motion, mostly a rosette that fills a ring, and why.
    """
    check_title(title, plot)
    exponents = numbers("--n", n)
    if turns is None and count is None:
        _table(exponents, plot, title, as_object)
        return
    if turns is None or count is None:
        raise fail("--turns and --loops", "both or neither", "one", "An orbit has p and q.")
    if len(exponents) != 1:
        raise fail("--n", "one exponent with --turns and --loops", n, "Pass it as --n=-1.")
    wanted = f"{number_of(count, 'loop')} in {number_of(turns, 'turn')}"
    with screen(f"looking for an orbit with {wanted}", as_object) as out:
        law = jaxdyn.effects.PowerLaw(1.0, exponents[0])
        try:
            orbit = orbits.targets.loops.closed(law, turns, count)
        except orbits.SearchError as error:
            if as_object:
                out.result({"ok": False, "message": str(error)})
            out.print(f"[red]no orbit[/red]: {error}")
            if plot:
                why = f"turns / loops = {turns} / {count} does not exist. {error}"
                _draw_failure(law, plot, why if title is None else title, out)
            raise typer.Exit(NOT_FOUND) from None
        if as_object:
            found = {"n": exponents[0], "turns": turns, "loops": count, "period": orbit.period}
            start = [float(x) for x in orbit.y0]
            out.result({"ok": True, **found, "y0": start, "closure": orbit.residual})
        x, speed = float(orbit.y0[0]), math.hypot(*map(float, orbit.y0[2:]))
        out.print(
            f"{wanted}: from r = {x:.12g} across at {speed:.12g}, "
            f"period {orbit.period:.12g}, closed to {orbit.residual:.1e}"
        )
        draw([orbit], [f"r^{exponents[0]:g}: {wanted}"], plot, None, out, title)


def _table(exponents: list[float], plot: Path | None, title: str | None, as_object: bool) -> None:
    moves = [n for n in exponents if n > -3]
    if plot and len(moves) < 2:
        remedy = "The picture goes from the smallest to the largest."
        raise fail("--n", "two exponents above -3 for a picture", f"{len(moves)}", remedy)
    with screen("counting loops", as_object) as out:
        found = orbits.targets.loops.fewest(exponents)
        if as_object:
            names = ("n", "loops", "turns", "circle", "line")
            columns = {name: getattr(found, name) for name in names}
            out.result({**columns, "message": found.message})
        else:
            table = Table("n", "least loops", "turns", "angle / pi near circles", "near lines")
            for i, n in enumerate(found.n):
                known = found.loops[i]
                counts = (f"{found.loops[i]}", f"{found.turns[i]}") if known else ("-", "-")
                table.add_row(f"{n:g}", *counts, f"{found.circle[i]:.6g}", f"{found.line[i]:.6g}")
            out.print(table)
            out.print(found.message)
        if plot:
            with out.writing(plot, "drawn in"):
                orbits.drawing.loops(plot, lowest=min(moves), highest=max(moves), title=title)


def _draw_failure(law, plot: Path, title: str, out: Screen) -> None:
    try:
        scene = orbits.targets.loops.rosette(law)
    except orbits.SearchError:
        out.print("there is nothing to draw: no motion stays between two radii")
        return
    with out.writing(plot, "the actual motion is drawn in"):
        orbits.drawing.rosette(scene, plot, title)
