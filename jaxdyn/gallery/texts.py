"""Text of pages: paragraphs of docstrings as Markdown, first sentences, times with units."""

import re
import textwrap

_UNITS = ("s", 1.0), ("ms", 1e-3), ("us", 1e-6)
_EXAMPLE = re.compile(r"^ *>>> .*(?:\n.*\S.*)*", re.MULTILINE)  # up to an empty line
_END = re.compile(r"(?<=\S)\. (?=[A-Z(`\"])")  # of a sentence; "n . v" is a product
_LINE = 110  # characters below a card


def prose(text: str) -> str:
    """A docstring as Markdown: ``code`` becomes `code`, and an example becomes a code block."""
    return _EXAMPLE.sub(_fence, text.replace("``", "`"))


def _fence(found: re.Match) -> str:
    """An example as a code block, since Markdown would read its >>> as a quotation."""
    return f"```pycon\n{textwrap.dedent(found[0])}\n```"


def first(text: str) -> str:
    """The first sentence of the first paragraph, cut at a word if it is long."""
    paragraph = text.strip().partition("\n\n")[0]
    sentence = _END.split(" ".join(paragraph.split()), maxsplit=1)[0].removesuffix(".")
    return sentence if len(sentence) <= _LINE else f"{sentence[:_LINE].rpartition(' ')[0]} ..."


def duration(seconds: float | None) -> str:
    """A time with its unit; None means that it was not reached."""
    if seconds is None:
        return "not reached"
    # A number that would round to 1000 of a unit is written as 1 of the next.
    unit, size = next((u, s) for u, s in _UNITS if seconds >= 0.9995 * s or u == "us")
    return f"{seconds / size:.3g} {unit}"
