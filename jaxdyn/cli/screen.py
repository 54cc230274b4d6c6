"""The output of a command: its results, and its progress.

Results go to standard output. On a terminal, a line with a spinner on standard error shows
the current task and whether it is compiling; a task of known length has a progress bar, a rate and
the time left. There is no such line if the output is not a terminal, or with --json.
"""

import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.text import Text

import jaxdyn
from jaxdyn import _progress
from jaxdyn._text import with_null
from jaxdyn.files.output_files import unwritable

_REFRESHES = 5  # per second


class Screen:
    """The output of a command; made by `screen`."""

    def __init__(self, as_object: bool):
        self.as_object = as_object
        self._console = Console(stderr=as_object, highlight=False, soft_wrap=True)
        # Do not ask rich whether it is a terminal, since colours can be forced on a file.
        on_terminal = sys.stderr.isatty() and not Console(stderr=True).is_dumb_terminal
        self._live = _line() if on_terminal and not as_object else None

    def print(self, what) -> None:
        """Print text with markup, or a table; on standard error with --json."""
        with self._without_line():
            self._console.print(what)

    def result(self, record: dict) -> None:
        """Print one JSON object on standard output at once, since what follows may fail.

        Numbers that are not finite are null.
        """
        with self._without_line():
            print(json.dumps(with_null(record)), flush=True)  # noqa: T201

    def show_task(self, what: str, done: int = 0, total: int | None = None) -> None:
        """Show the current task and, with a total, how much of it is done."""
        if self._live is None:
            return
        task = self._live.tasks[0]
        if done == 0 or total != task.total:  # a new task
            self._live.reset(task.id, total=total)
        self._live.update(task.id, completed=done, description=what)

    @contextlib.contextmanager
    def writing(self, path: Path, said: str) -> Iterator[None]:
        """A context for writing a file: report it afterwards, or raise an error with one line.

        Raises:
          ValueError: `path` could not be written, for example because the disk is full.
        """
        self.show_task(f"writing {path}")
        try:
            yield
        except OSError as error:
            raise unwritable(path, error, "file") from error
        self.print(f"{said} {path}")

    @contextlib.contextmanager
    def _without_line(self) -> Iterator[None]:
        if self._live is None or not self._live.live.is_started:
            yield
            return
        self._live.stop()
        try:
            yield
        finally:
            self._live.start()


@contextlib.contextmanager
def screen(what: str, as_object: bool = False) -> Iterator[Screen]:
    """The screen of a running command, with JAX loaded and configured.

    Args:
      what: the task, e.g. "simulating car".
      as_object: whether the result is printed as a JSON object.
    """
    shown = Screen(as_object)
    shown.show_task(what)
    with shown._live or contextlib.nullcontext(), _progress.progress_to(shown.show_task):
        jaxdyn.configure()
        if shown._live is not None:
            shown._live.clock = jaxdyn.accuracy.timing.Clock()
        yield shown


class _Line(Progress):
    """A line that disappears when the work is done."""

    #: Knows whether JAX is compiling; none before JAX is loaded.
    clock = None


def _line() -> _Line:
    line = _Line(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        _Bar(),
        console=Console(stderr=True),
        transient=True,
        refresh_per_second=_REFRESHES,
        # Otherwise text for standard output would go to standard error.
        redirect_stdout=False,
        redirect_stderr=False,
    )
    line.columns = (*line.columns, _State(line))
    line.add_task("", total=None)
    return line


class _Bar(BarColumn):
    """A bar for tasks of known length."""

    def render(self, task: Task):
        return super().render(task) if task.total else Text()


class _State(ProgressColumn):
    """How much is done, at which rate, and the time left; or the time elapsed."""

    def __init__(self, line: _Line):
        super().__init__()
        self._line = line

    def render(self, task: Task) -> Text:
        compiling = "compiling, " if self._line.clock and self._line.clock.busy else ""
        if not task.total or not task.speed:
            return Text(f"{compiling}{task.elapsed or 0:.0f} s", style="dim")
        left = f", {task.time_remaining:.0f} s left" if task.time_remaining is not None else ""
        parts = f"{task.completed:.0f} of {task.total:.0f}, {task.speed:.3g} a second"
        return Text(f"{compiling}{parts}{left}", style="dim")
