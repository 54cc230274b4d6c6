"""How a page is run: by `jaxdyn course`, by ``python -m``, and by the tests."""

import importlib
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.markup import escape

from jaxdyn._config import configure
from jaxdyn._text import with_null
from jaxdyn.course.page.content import Check, Number, Page

_DIGITS = 9


class Run(NamedTuple):
    """A page that has run.

    Attributes:
      page: its content.
      seconds: how long it took [s], including compilation.
      left: whether it has a function `check`, for checks that take long, which did not run.
    """

    page: Page
    seconds: float
    left: bool = False


def run(name: str, *, check: bool = True, ask: bool = True) -> Run:
    """Run the page of a name, such as "figure_eight".

    Args:
      name: the name of the page.
      check: whether to run its long checks as well.
      ask: whether to add its questions, which are shown in a browser only.
    """
    return _time(importlib.import_module(f"jaxdyn.course.{name}"), check, ask)


def _time(module: ModuleType, check: bool, ask: bool) -> Run:
    page, begin = Page(), time.perf_counter()
    module.solve(page)
    questions = getattr(module, "ask", None)
    if questions and ask:
        questions(page)
    longer = getattr(module, "check", None)
    if longer and check:
        longer(page)
    return Run(page, time.perf_counter() - begin, left=bool(longer) and not check)


def report(page: Page) -> list[str]:
    """The lines of a report on a page, with rich's markup."""
    wide = max((len(number.name) for number in page.numbers), default=0)
    lines = [f"  {escape(n.name):{wide}}  {escape(text_of_number(n))}" for n in page.numbers]
    for check in page.checks:
        mark = "[green]holds[/green]" if check.holds else "[red]fails[/red]"
        figure = f"{check.route}, {check.figure}" if check.figure else check.route
        lines.append(f"  {mark}  {escape(check.statement)} ({escape(figure)})")
    return lines


def record(found: Run) -> dict:
    """The results of a run, for a JSON object."""
    return {
        "numbers": [{"name": n.name, "value": text_of_number(n)} for n in found.page.numbers],
        "checks": [_check(check) for check in found.page.checks],
        "holds": found.page.holds,
        "seconds": round(found.seconds, 3),
    }


def _check(check: Check) -> dict:
    """A check for a JSON object, which has no NaN."""
    return with_null(check._asdict()) | {"figure": check.figure}


def text_of_number(number: Number) -> str:
    """The value of a number with its unit."""
    if isinstance(number.value, str):
        return f"{number.value} {number.unit}".rstrip()
    values = np.asarray(number.value)
    text = [f"{x:.{_DIGITS}g}" for x in values.ravel()]
    return f"{', '.join(text)} {number.unit}".rstrip()


def pictures(page: Page, path: Path) -> list[Path]:
    """Write the pictures of a page, the first as `path`, the others numbered; returns the paths."""
    paths = []
    for i, drawing in enumerate(page.drawings):
        one = path if i == 0 else path.with_stem(f"{path.stem}_{i + 1}")
        drawing.figure.savefig(one)
        paths.append(one)
    return paths


def show(solve: Callable[[Page], None]) -> None:
    """Run a page as a script, with all checks: print its results, draw it in this folder.

    Raises:
      SystemExit: 1 if a check fails.
    """
    configure()
    console = Console(highlight=False, soft_wrap=True)
    page = _time(sys.modules[solve.__module__], check=True, ask=False).page
    for line in report(page):
        console.print(line)
    for path in pictures(page, Path(f"{Path(solve.__code__.co_filename).stem}.png")):
        console.print(f"drawn in {path}")
    if not page.holds:
        raise SystemExit(1)
