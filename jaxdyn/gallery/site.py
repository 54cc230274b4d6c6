"""The static site, which Sphinx builds from records of pages that were run in parallel."""

import io
import multiprocessing
import os
import re
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

from sphinx.application import Sphinx

from jaxdyn import _checks
from jaxdyn._config import configure
from jaxdyn._progress import report_progress
from jaxdyn._text import whole
from jaxdyn.course.page import Problem, problems
from jaxdyn.files.output_files import unwritable, writable
from jaxdyn.gallery import exhibits, tutorials
from jaxdyn.gallery.compiling import configure_quickly
from jaxdyn.gallery.formulas import formulas_record
from jaxdyn.gallery.problems import problem_record
from jaxdyn.gallery.records import SOURCES, current, keep, pictures, stored_record
from jaxdyn.gallery.sources import Sources

_FORMULAS = "formulas"  # the name of the record with the equations of ready-made scenes
_CONF = Path(__file__).parent / "docs"
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_MOST_WORKERS = 61  # limit of a pool of processes on Windows


class BuiltSite(NamedTuple):
    """A site that was built.

    Attributes:
      folder: where it is.
      pages: its pages, relative to the folder.
      failed: the pages that could not be run, with the error; they are left out.
      untrue: the pages on which a check does not hold.
      warnings: the warnings of Sphinx about the sources, such as broken links.
    """

    folder: Path
    pages: tuple[str, ...]
    failed: dict[str, str]
    untrue: tuple[str, ...]
    warnings: tuple[str, ...] = ()


def build(folder, *, only: Collection[int | str] = (), workers: int | None = None) -> BuiltSite:
    """Build the site: the course, the exhibits, tutorials, guides and reference.

    Only pages whose sources changed since the last build are run, in separate processes. Sphinx
    builds the site from their records.

    Args:
      folder: output folder; created if it is missing.
      only: numbers or names of problems, names of exhibits, of tutorials ("tutorials/proof"), or
        "formulas" for those of ready-made scenes. Only these are run; others are shown as they were
        built before, or left out.
      workers: number of processes, 1 to 61; one per core by default.
    Raises:
      ValueError: `only` is a string or contains an unknown page, `workers` is out of range, or
        `folder` cannot be written.
    """
    folder = Path(folder)
    jobs = _jobs(only)
    if workers is not None:
        whole("workers", workers, most=_MOST_WORKERS)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(folder, error, "folder") from error
    writable(folder / "index.html", "folder", (".html",))
    failed = _run(jobs, folder, workers or min(os.cpu_count() or 1, _MOST_WORKERS))
    report_progress("writing pages")
    names = [*_names().values(), *exhibits.PARTS, *tutorials.files(), _FORMULAS]
    records = {name: stored_record(folder, name) for name in names}
    found = {name: r for name, r in records.items() if r is not None and name not in failed}
    # Use the problem as recorded when its page ran: a page that was not run again may be older
    # than its file.
    fields = Problem._fields
    shown = [
        (Problem(**{key: r["problem"][key] for key in fields}), r)
        for r in found.values()
        if "problem" in r
    ]
    parts = {
        page: [found[name] for name in names if name in found]
        for page, names in exhibits.EXHIBITS.items()
    }
    sources = Sources(folder / SOURCES)
    sources.course(shown)
    sources.exhibits({page: exhibits.join(of) for page, of in parts.items() if of})
    sources.tutorials({name: r["notebook"] for name, r in found.items() if "notebook" in r})
    sources.texts()
    sources.reference(found.get(_FORMULAS, {}).get("formulas", {}))
    sources.finish()
    # Sphinx changes the defaults of the functions that it reads, so it gets its own process.
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        pages, warnings = pool.submit(sphinx, sources.folder, folder).result()
    untrue = tuple(name for name, record in found.items() if not record.get("holds", True))
    return BuiltSite(folder, pages, failed, untrue, warnings)


def sphinx(sources: Path, folder: Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Run Sphinx on the sources of a site; returns its pages, relative to it, and its warnings."""
    captured = io.StringIO()
    app = Sphinx(
        sources, _CONF, folder, folder / ".doctrees", "html", status=None, warning=captured
    )
    app.build()
    made = {*app.env.found_docs, "genindex", "py-modindex", "search"}
    warnings = _COLOURS.sub("", captured.getvalue()).strip().splitlines()
    return tuple(f"{name}.html" for name in sorted(made)), tuple(warnings)


def _names() -> dict[str, str]:
    """The name of each problem's page by its number, as text."""
    return {str(problem.number): problem.name for problem in problems().values()}


def _jobs(only: Collection[int | str]) -> list[str]:
    """The names of the pages to run, starting with those that take longest."""
    if isinstance(only, str):
        raise _checks.fail("only", "a list of numbers or names", repr(only))
    names = _names()
    known = [*exhibits.EXHIBITS, *tutorials.files(), _FORMULAS, *names.values()]
    for one in only:
        if str(one) not in names:
            _checks.choice("only", str(one), known, "jaxdyn list --problems")
    chosen = [names.get(str(one), str(one)) for one in only] or known
    jobs = [job for name in chosen for job in exhibits.EXHIBITS.get(name, [name])]
    return list(dict.fromkeys(jobs))


def _run(jobs: Collection[str], folder: Path, workers: int) -> dict[str, str]:
    """Run the pages that have changed in parallel; returns the errors of failed ones by name."""
    jobs = [name for name in jobs if current(folder, name, _source(name)) is None]
    report_progress("running pages", 0, len(jobs))
    failed = {}
    timed = [name for name in jobs if name in exhibits.PARTS and exhibits.PARTS[name].timed]
    quick = [name for name in jobs if name not in timed]
    done = 0
    for names, prepare in ((timed, configure), (quick, configure_quickly)):
        if names:
            for name, error in _each(names, folder, min(workers, len(names)), prepare):
                done += 1
                report_progress(f"running pages, {name} done", done, len(jobs))
                if error is not None:
                    failed[name] = f"{type(error).__name__}: {error}"
    return failed


def _each(
    names: Collection[str], folder: Path, workers: int, prepare: Callable[[], None]
) -> Iterator[tuple[str, BaseException | None]]:
    """Yield each page as it is done, with its error, or None."""
    # JAX's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, prepare)
    try:
        running: dict[Future, str] = {pool.submit(make, name, folder): name for name in names}
        for future in as_completed(running):
            yield running[future], future.exception()
    finally:
        pool.shutdown(cancel_futures=True)  # Ctrl-C does not wait for the others


def make(name: str, folder: Path) -> None:
    """Run a problem or a part of an exhibit, unless its record is up to date."""
    pages = {problem.name: problem for problem in problems().values()}

    def run():
        if name in pages:
            return problem_record(pages[name], pictures(folder))
        if name == _FORMULAS:
            return formulas_record()
        if name in tutorials.files():
            return tutorials.tutorial_record(tutorials.files()[name])
        return exhibits.PARTS[name].make(pictures(folder))

    keep(folder, name, _source(name), run)


def _source(name: str) -> Path:
    """The source file of a problem or a tutorial; for other pages, the file of the exhibits."""
    here = Path(exhibits.__file__)
    if name in exhibits.PARTS or name == _FORMULAS:
        return here
    return tutorials.files().get(name, here.parents[1] / "course" / f"{name}.py")
