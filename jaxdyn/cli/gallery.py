"""The command `jaxdyn gallery`: builds the site of course, tutorials, guides and reference."""

import importlib.util
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

import jaxdyn
from jaxdyn._text import fail, number_of
from jaxdyn.cli.screen import screen

_FAILED = 1  # exit code: a page could not run, a check does not hold, or Sphinx warns
#: Packages of the extra that the site needs.
_NEEDED = ("sphinx", "myst_nb", "pydata_sphinx_theme", "sphinx_copybutton", "sphinx_design")


def gallery_command(
    out: Annotated[Path, typer.Option(help="The folder to write to.")] = Path("site"),
    only: Annotated[
        str | None, typer.Option(help="Run only these: numbers or names, such as 28,31.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Number of processes; one per core.")] = None,
) -> None:
    """Build the site: the course with players, orbits, hard cases, tutorials, guides, reference."""
    missing = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        remedy = "pip install 'jaxdyn[docs]' installs it."
        raise fail("gallery", missing[0].replace("_", "-"), "none", remedy)
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
        for line in found.warnings:
            shown.print(f"[red]warning[/red] {escape(line)}")
        if found.failed or found.untrue or found.warnings:
            raise typer.Exit(_FAILED)
