"""The command `orbits show`: the contents of a file of orbits, and a picture."""

import json
from pathlib import Path

from rich.markup import escape

import orbits
from jaxdyn import _text
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import JsonOption, LiveOption, PlotOption, TitleOption, check_title
from orbits.cli.bifurcations.shown import is_continuation, show_continuation
from orbits.cli.printed import print_family, print_reports
from orbits.cli.shared import OrbitFile, QuantityOption, draw


def show_command(
    file: OrbitFile,
    plot: PlotOption = None,
    quantity: QuantityOption = "period",
    title: TitleOption = None,
    live: LiveOption = None,
    as_object: JsonOption = False,
) -> None:
    """Print what a file of an orbit or of a family claims, without checking it, and draw it.

    Files of `orbits curve` and `orbits diagram` can be shown as well, even while they are written.
    """
    check_title(title, plot)
    with screen(f"reading {file}", as_object) as out:
        if is_continuation(file):
            if live:
                remedy = "In Python each family of it has `live(path)`."
                raise _text.fail("--live", "a file of an orbit or a family", "another", remedy)
            show_continuation(file, plot, title, out)
            return
        found = orbits.files.contents.contents(file)
        if as_object:
            out.result(json.loads(file.read_text()))
        if isinstance(found, orbits.files.family_files.Listing):
            _show_family(found, file, plot, quantity, title, out)
            _write_page(found, live, out)
        else:
            _show_orbit(found, file, plot, title, out)
            _write_page(found.orbit, live, out)


def _write_page(
    found: "orbits.Orbit | orbits.files.family_files.Listing", live: Path | None, out: Screen
) -> None:
    """Write the page on which it runs, if requested."""
    if live:
        with out.writing(live, "runs in"):
            found.live(live)


def _show_orbit(
    found: "orbits.files.contents.Claimed",
    file: Path,
    plot: Path | None,
    title: str | None,
    out: Screen,
) -> None:
    if not out.as_object:
        more = [found.refined, found.certificate]
        for text in (_heading(found.orbit, file), found.orbit.scene, *filter(None, more)):
            out.print(escape(str(text)))
        print_reports({file.name: found.report}, out)
        out.print(f"these are the claims of the file; `orbits verify {file}` recomputes them")
    draw([found.orbit], [""], plot, None, out, title)


def _show_family(
    found: "orbits.files.family_files.Listing",
    file: Path,
    plot: Path | None,
    quantity: str,
    title: str | None,
    out: Screen,
) -> None:
    if not out.as_object:
        first = found.members[0].orbit
        for text in (_heading(first, file, found), first.scene):
            out.print(escape(str(text)))
        print_family(found, out)
    if plot:
        with out.writing(plot, "drawn in"):
            orbits.drawing.family(found, plot, quantity=quantity, title=title)


def _heading(
    orbit: "orbits.Orbit", file: Path, family: "orbits.files.family_files.Listing | None" = None
) -> str:
    """The heading, with the contents of a file and how they were computed."""
    what = "Orbit" if family is None else "Family of orbits"
    ways = [f"integrated at rtol {_text.brief(orbit.rtol)}"]
    ways += ["by an implicit method"] * orbit.stiff
    ways += ["in logarithmic time"] * (orbit.s_period is not None)
    ways += [f"by collocation on {len(orbit.mesh)} intervals"] if orbit.mesh else []
    rows = [
        ("file", str(file)),
        ("along", "" if family is None else family.parameter or "its energy and period"),
        ("closing", orbit.closing.name),
        ("turned", _text.brief(orbit.angle, "rad") if orbit.closing.turns else ""),
        ("found", ", ".join(ways)),
    ]
    return _text.table(f"{what} of {_text.title_of(orbit.scene)}", rows)
