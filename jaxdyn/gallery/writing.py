"""The pages of the site from their records: templates are filled, links are made."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from jaxdyn import player
from jaxdyn.course.page import TOPICS, Problem
from jaxdyn.files.output_files import replace
from jaxdyn.gallery import texts
from jaxdyn.gallery.reference import PACKAGES, Entry, chapters, urls

_HERE = Path(__file__).parent
_LINKS = (
    ("Course", "index.html"),
    ("Orbits", "poster.html"),
    ("Families", "families.html"),
    ("Hard cases", "hard.html"),
    ("Accuracy", "accuracy.html"),
    ("Guides", "guides/index.html"),
    ("Reference", "reference/index.html"),
)
_LINE = 110  # characters below a card
_END = re.compile(r"(?<=\S)\. (?=[A-Z(`\"])")  # of a sentence; "n . v" is a product
T = TypeVar("T")
_GUIDE = re.compile(r"\(\d+_(\w+)\.md\)")  # a link to another guide, as a file


class Site:
    """A folder that pages are written to.

    Attributes:
      folder: where.
      written: the pages so far, relative to it.
    """

    def __init__(self, folder: Path, exhibits: Iterable[str]):
        self.folder = folder
        present = {"index.html", *(f"{name}.html" for name in exhibits)}
        self._links = [(name, url) for name, url in _LINKS if url in present or "/" in url]
        self.written: list[str] = []
        self._urls = urls()
        loader = PackageLoader("jaxdyn.gallery")
        self._templates = Environment(
            loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True
        )

    def write(self, url: str, template: str, **content: Any) -> None:
        """Fill a template and write it as the page of a URL."""
        path = self.folder / url
        path.parent.mkdir(parents=True, exist_ok=True)
        common = {
            "about": "",
            "here": url,
            "links": self._links,
            "version": PACKAGES["jaxdyn"].__version__,
        }
        root = "../" * url.count("/")
        page = self._templates.get_template(template)
        replace(path, page.render(**(common | content), root=root))
        self.written.append(url)

    def text(self, html: str, root: str = "") -> Markup:
        """HTML whose names are links to the reference."""
        return Markup(texts.link(html, self._urls, root))

    def assets(self) -> None:
        """Write style sheets and scripts."""
        sheet = (_HERE / "site.css").read_text()
        replace(self.folder / "site.css", "\n".join((sheet, player.look(), texts.code_style())))
        replace(self.folder / "player.js", player.script())
        replace(self.folder / "minis.js", (_HERE / "minis.js").read_text())

    def index(self, shown: Sequence[tuple[Problem, dict]]) -> None:
        """The page with a card for each problem."""
        checks = [check["holds"] for _, record in shown for check in record["checks"]]
        cards = [
            {
                "name": problem.name,
                "number": problem.number,
                "title": problem.title,
                "topic": problem.topic,
                "line": _first(problem.answer),
                "picture": next(iter(record["drawings"]), None),
            }
            for problem, record in shown
        ]
        topics = [topic for topic in TOPICS if any(card["topic"] == topic for card in cards)]
        self.write(
            "index.html",
            "index.html",
            title="A course on dynamics, computed",
            cards=cards,
            topics=topics,
            checks=len(checks),
            holding=sum(checks),
        )

    def problem(self, problem: Problem, record: dict, before, after) -> None:
        """The page of a problem."""
        played = [
            {
                "look": self.text(texts.prose(one["look"]), "../"),
                "html": Markup(player.fragment(one["data"], one["look"].replace("`", ""))),
            }
            for one in record["played"]
        ]
        digits = record["digits"]
        for row in digits["rows"] if digits else ():
            row["time"] = (
                "not reached" if row["seconds"] is None else texts.duration(row["seconds"])
            )
        self.write(
            f"course/{problem.name}.html",
            "problem.html",
            title=problem.title,
            about=_first(problem.answer),
            problem=problem,
            statement=self.text(texts.prose(problem.statement), "../"),
            answer=self.text(texts.prose(problem.answer), "../"),
            solution=self.text(texts.prose(problem.solution), "../"),
            played=played,
            code=Markup(texts.colour(problem.code)),
            equations=[Markup(one) for one in record["equations"]],
            names=[(name, self._urls.get(name)) for name in problem.names],
            before=before,
            after=after,
            **{key: record[key] for key in ("drawings", "numbers", "checks", "seconds", "digits")},
        )

    def exhibit(self, name: str, record: dict) -> None:
        """The page of an exhibit."""
        minis, topics = record.get("minis", []), record.get("cases", [])
        self.write(
            f"{name}.html",
            "exhibit.html",
            title=record["title"],
            text=self.text(texts.markdown(record["text"])),
            drawings=record.get("drawings", []),
            tables=record.get("tables", []),
            topics=topics,
            verdicts=[case["holds"] for topic in topics for case in topic["cases"]],
            minis=minis,
            minis_data=Markup(player.embedded([one["path"] for one in minis])),
        )

    def guides(self) -> None:
        """The guides, and their table of contents."""
        rows = []
        for path in sorted((_HERE / "guides").glob("*.md")):
            text = _GUIDE.sub(r"(\1.html)", path.read_text())
            title, _, rest = text.removeprefix("# ").partition("\n")
            url = f"{path.stem.partition('_')[2]}.html"
            self.write(
                f"guides/{url}",
                "guide.html",
                title=title,
                text=self.text(texts.markdown(text), "../"),
            )
            rows.append((title, url, _first(rest.replace("`", ""))))
        about = "What people ask for first."
        self.write("guides/index.html", "contents.html", title="Guides", about=about, rows=rows)

    def reference(self) -> None:
        """The API reference, a page for each folder."""
        rows = []
        for chapter in chapters().values():
            url = f"{chapter.name}.html"
            self.write(
                f"reference/{url}",
                "reference.html",
                title=chapter.name,
                text=self.text(chapter.text, "../"),
                entries=[self._entry(entry) for entry in chapter.entries],
            )
            rows.append((chapter.name, url, chapter.line.replace("`", "")))
        about = "Every public name once, with shapes and units."
        self.write(
            "reference/index.html", "contents.html", title="Reference", about=about, rows=rows
        )

    def _entry(self, entry: Entry) -> dict[str, Any]:
        members = [self._entry(member) for member in entry.members]
        return entry._asdict() | {"html": self.text(entry.text, "../"), "members": members}


def _first(text: str) -> str:
    """The first sentence, cut at a word if it is long."""
    sentence = _END.split(" ".join(text.split()), maxsplit=1)[0].removesuffix(".")
    return sentence if len(sentence) <= _LINE else f"{sentence[:_LINE].rpartition(' ')[0]} ..."


def neighbours(found: Sequence[T]) -> list[tuple[T | None, T, T | None]]:
    """Each entry with the one before and the one after it."""
    return [
        (found[i - 1] if i else None, one, found[i + 1] if i + 1 < len(found) else None)
        for i, one in enumerate(found)
    ]
