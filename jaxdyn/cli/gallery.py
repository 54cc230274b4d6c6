"""The command `jaxdyn gallery`: builds the static site of the course, guides and reference."""

import importlib.util
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

import jaxdyn
from jaxdyn._text import fail, number_of
from jaxdyn.cli.screen import screen

_FAILED = 1  # exit code: a page could not run, or a check does not hold
_NEEDED = "jinja2"  # of the extra that the site needs


def gallery_command(
    out: Annotated[Path, typer.Option(help="The folder to write to.")] = Path("site"),
    only: Annotated[
        str | None, typer.Option(help="Run just these: numbers or names, such as 28,31.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; one for each core.")] = None,
) -> None:
    """Build the site: the course with players, orbits, hard cases, guides, reference."""
    if importlib.util.find_spec(_NEEDED) is None:
        raise fail("gallery", "jinja2", "none", "pip install 'jaxdyn[docs]' installs it.")
    with screen("starting") as shown:
        wanted = () if only is None else only.replace(",", " ").split()
        if only is not None and not wanted:
            raise fail("--only", "numbers or names", repr(only))
        found = jaxdyn.gallery.build(out, only=wanted, workers=workers)
        shown.print(f"{number_of(len(found.pages), 'page')} in {found.folder / 'index.html'}")
        for name, error in found.failed.items():
            shown.print(f"[red]failed[/red] {name}: {escape(error)}")
        for name in found.untrue:
            shown.print(f"[red]a check fails[/red] on the page {name}")
        if found.failed or found.untrue:
            raise typer.Exit(_FAILED)
