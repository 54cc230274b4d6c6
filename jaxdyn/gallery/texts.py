"""Text for pages: Markdown, code in colour, cross-references to the API reference."""

import functools
import html
import re
import textwrap

from markdown_it import MarkdownIt
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import get_lexer_by_name

_UNITS = ("s", 1.0), ("ms", 1e-3), ("us", 1e-6)
_EXAMPLE = re.compile(r"^ *>>> .*(?:\n.*\S.*)*", re.MULTILINE)  # up to an empty line
_STYLES = "default", "github-dark"  # on light and on dark ground: of each colour enough contrast
_NAME = re.compile(r"<code>((?:jaxdyn|orbits)(?:\.\w+)+)(\([^<]*\))?</code>")


def colour(code: str, language: str = "python") -> str:
    """Code in colour, as HTML."""
    inner = highlight(code, get_lexer_by_name(language), HtmlFormatter(nowrap=True))
    return f'<pre class="code"><code>{inner}</code></pre>'


def code_style() -> str:
    """The style sheet of coloured code, light and dark."""
    light, dark = (HtmlFormatter(style=name).get_style_defs(".code") for name in _STYLES)
    return f"{light}\n@media (prefers-color-scheme: dark) {{\n{dark}\n}}"


def markdown(text: str) -> str:
    """Markdown as HTML, with tables and code in colour."""
    return _renderer().render(text)


def prose(text: str) -> str:
    """A docstring's paragraphs as HTML: ``code`` and `code` are code, indented blocks stay."""
    return markdown(_EXAMPLE.sub(_fence, text.replace("``", "`")))


def _fence(found: re.Match) -> str:
    """An example as a block of its own; Markdown would take its >>> for a quotation."""
    return f"```pycon\n{textwrap.dedent(found[0])}\n```"


def duration(seconds: float) -> str:
    """A time with its unit."""
    # What would round to 1000 of a unit is 1 of the next.
    unit, size = next((u, s) for u, s in _UNITS if seconds >= 0.9995 * s or u == "us")
    return f"{seconds / size:.3g} {unit}"


def link(text: str, urls: dict[str, str], root: str = "") -> str:
    """HTML whose code that names something public links to the reference."""

    def link(found: re.Match) -> str:
        url = urls.get(found[1])
        return f'<a href="{root}{url}">{found[0]}</a>' if url else found[0]

    return _NAME.sub(link, text)


@functools.cache
def _renderer() -> MarkdownIt:
    return MarkdownIt("commonmark", {"html": False, "highlight": _block}).enable("table")


def _block(code: str, language: str, _attributes: str) -> str:
    """A fenced block; what begins with <pre is taken as it is."""
    return colour(code, language) if language else f"<pre>{html.escape(code)}</pre>"
