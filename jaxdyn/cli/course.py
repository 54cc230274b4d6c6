"""The command `jaxdyn course`: runs the page of a problem, with numbers, checks, pictures."""

import textwrap
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

import jaxdyn
from jaxdyn._text import fail
from jaxdyn.cli import completion
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import JsonOption, PlayOption, PlotOption, open_page, output_option
from jaxdyn.files.output_files import page_path

_WIDTH = 100  # characters of a line, as in the statement
_FAILED = 1  # exit code: a check does not hold


def course_command(
    problem: Annotated[
        str,
        typer.Argument(
            metavar="PROBLEM",
            help="A number or a name, as in `list --problems`.",
            autocompletion=completion.problem,
        ),
    ],
    plot: PlotOption = None,
    play: PlayOption = False,
    live: Annotated[
        Path | None,
        output_option(page_path, "Write it as a page with its motions, a single file (.html)."),
    ] = None,
    code: Annotated[bool, typer.Option("--code", help="Print the page's code as well.")] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Run the checks that take long as well.")
    ] = False,
    as_object: JsonOption = False,
) -> None:
    """Run a problem of the course: its statement, the answer, numbers, checks and pictures."""
    page = _page(problem)
    with screen(f"running {page.name}", as_object) as out:
        found = jaxdyn.course.page.run(page.name, check=check, ask=live is not None)
        if as_object:
            printed = [one.text() for one in jaxdyn.course.page.equations_of(found.page)]
            record = jaxdyn.course.page.record(found) | {"equations": printed}
            out.result(page.as_dict() | record)
        else:
            _print(page, found, code, out)
        for path in jaxdyn.course.page.pictures(found.page, plot) if plot else ():
            out.print(f"drawn in {path}")
        if live:
            with out.writing(live, "shown in"):
                jaxdyn.course.page.one_file(page, found.page, live)
        for one in found.page.played if play else ():
            shown = jaxdyn.player.play(one.motions, title=page.title, choose=one.choose)
            out.print(open_page(shown, page.name))
        if not found.page.holds:
            raise typer.Exit(_FAILED)


def _page(problem: str) -> "jaxdyn.course.page.Problem":
    """The page with this number or name."""
    pages = jaxdyn.course.problems()
    found = {str(n): page for n, page in pages.items()} | {p.name: p for p in pages.values()}
    if problem not in found:
        raise fail(
            "problem",
            f"a number from 1 to {max(pages)} or a name that `jaxdyn list --problems` shows",
            repr(problem),
        )
    return found[problem]


def _print(
    page: "jaxdyn.course.page.Problem", found: "jaxdyn.course.page.Run", code: bool, out: Screen
) -> None:
    out.print(f"[bold]{page.number}. {escape(page.title)}[/bold] ({page.name})")
    answer = textwrap.fill(page.answer, _WIDTH)
    texts = (page.statement, answer, page.solution)
    out.print(escape("".join(f"{text}\n\n" for text in texts if text).removesuffix("\n")))
    if page.asks_for_equations:
        for printed in jaxdyn.course.page.equations_of(found.page):
            shown = (part.name for part in printed.sections if part.name != "parameters")
            out.print(escape("\n".join(map(printed.text, shown))) + "\n")
    for line in jaxdyn.course.page.report(found.page):
        out.print(line)
    out.print(f"Run in {found.seconds:.1f} s, including compilation.")
    if found.left:
        out.print(f"Further checks take longer: `jaxdyn course {page.number} --check`.")
    if code:
        out.print(f"\n{escape(page.code)}")
