"""The sources of the site, as Sphinx reads them: written from records, guides and docstrings.

A file is written only where its text has changed, so that Sphinx makes just those pages again.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from nbformat import v4

from jaxdyn.course.page import TOPICS, Problem
from jaxdyn.files.output_files import replace
from jaxdyn.gallery import reference
from jaxdyn.gallery.texts import duration, first, prose
from jaxdyn.player.live_pages import SCRIPTS

_HERE = Path(__file__).parent
#: A link to a guide or a tutorial, as a file.
_LINK = re.compile(r"\((?:\.\./(guides|tutorials)/)?\d+_(\w+)\.md\)")
#: Folders of texts that are pages without further processing.
_TEXTS = "guides", "entrances"


class Sources:
    """A folder that the sources of pages are written to.

    Attributes:
      folder: where.
      pages: the names of the pages so far.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self.pages: set[str] = set()
        self._templates = Environment(
            loader=PackageLoader("jaxdyn.gallery"),
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        self._templates.filters |= {
            "prose": prose,
            "first": first,
            "line": lambda text: " ".join(text.split()),
            "duration": duration,
        }

    def write(self, name: str, text: str) -> None:
        """Write the source of a page, given with its ending."""
        path = self.folder / name
        self.pages.add(name.rpartition(".")[0])
        if not path.exists() or path.read_text() != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            replace(path, text)

    def fill(self, name: str, template: str, **content: Any) -> None:
        """Fill a template and write it as the source of a page."""
        self.write(name, self._templates.get_template(template).render(**content))

    def course(self, shown: Sequence[tuple[Problem, dict]]) -> None:
        """Write the pages of the problems, and the page with a card for each."""
        for problem, record in shown:
            content = {"problem": problem, "record": record, "scripts": _scripts(record["played"])}
            self.fill(f"course/{problem.name}.md", "problem.md", **content)
        cards = [
            {"problem": problem, "picture": next((d["file"] for d in record["drawings"]), None)}
            for problem, record in shown
        ]
        self.fill(
            "course/index.md",
            "course.md",
            cards=cards,
            topics=[t for t in TOPICS if any(problem.topic == t for problem, _ in shown)],
            checks=[check["holds"] for _, record in shown for check in record["checks"]],
        )

    def exhibits(self, records: Mapping[str, dict]) -> None:
        """Write the pages of the exhibits, and their table of contents."""
        for name, record in records.items():
            self.fill(
                f"{name}.md",
                "exhibit.md",
                record=record,
                verdicts=[case["holds"] for topic in record["cases"] for case in topic["cases"]],
            )
        self.fill("exhibits.md", "exhibits.md", exhibits=records)

    def texts(self) -> None:
        """Write the guides and the entrances, which are Markdown already, without their numbers.

        They link the tutorials that were written before, and the table of these for others.
        """
        for folder in _TEXTS:
            pages = []
            for path in sorted((_HERE / folder).glob("*.md")):
                name, text = path.stem.partition("_")[2], path.read_text()
                self.write(f"{folder}/{name}.md", _LINK.sub(self._linked, text))
                title, _, rest = text.removeprefix("# ").partition("\n")
                pages.append((name, title, first(rest)))
            self.fill(f"{folder}/index.md", f"{folder}.md", pages=pages)

    def _linked(self, link: re.Match) -> str:
        """A link to a guide or a tutorial, as a page."""
        folder, name = link.groups()
        if folder == "tutorials":
            page = f"{name}.ipynb" if f"tutorials/{name}" in self.pages else "index.md"
            return f"(../tutorials/{page})"
        return f"(../guides/{name}.md)"

    def tutorials(self, notebooks: Mapping[str, dict]) -> None:
        """Write the tutorials that have run, as notebooks, and their table of contents."""
        names = [name.rpartition("/")[2] for name in notebooks]
        for name, notebook in zip(names, notebooks.values(), strict=True):
            link = f"{{download}}`Download this notebook <{name}.ipynb>`"
            last = v4.new_markdown_cell(link, id="download")
            text = json.dumps(notebook | {"cells": [*notebook["cells"], last]})
            self.write(f"tutorials/{name}.ipynb", _LINK.sub(self._linked, text))
        self.fill("tutorials/index.md", "tutorials.md", names=names)

    def reference(self, formulas: Mapping[str, str]) -> None:
        """Write the API reference: a page for each folder, and for each class that has methods."""
        for name, text in reference.pages(formulas).items():
            self.write(f"reference/{name}.rst", text)
        chapters = {name: reference.summary(name) for name in reference.chapters()}
        self.fill("reference/index.md", "reference.md", chapters=chapters)

    def finish(self) -> None:
        """Write the first page, and remove files of earlier pages that are gone."""
        self.fill("index.md", "index.md")
        for path in self.folder.rglob("*.*"):
            ours = path.suffix in (".md", ".rst", ".ipynb")
            if ours and str(path.relative_to(self.folder).with_suffix("")) not in self.pages:
                path.unlink()


def _scripts(played: Sequence[dict]) -> list[str]:
    """The scripts that a page needs for scenes that run and for motions that are played."""
    running = [*SCRIPTS] * any(one["runs"] for one in played)
    return ["canvas", *running, *["player"] * any(not one["runs"] for one in played)]
