"""Pages that play motions, as single files that need no other files and no network."""

import functools
import html
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxdyn.drawing.titles import caption
from jaxdyn.files.output_files import page_path, replace
from jaxdyn.player.motion_data import export

_HERE = Path(__file__).parent
_FRAME = 720  # [px] height of a player in a notebook
_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>{look}
:root {{ color-scheme: light dark; }}
body {{ margin: 0 auto; max-width: 780px; padding: 0 10px; font-family: system-ui, sans-serif; }}
h1 {{ font-size: 1.2rem; font-weight: 600; }}
</style>
</head>
<body>
<main>
<h1>{title}</h1>
{fragment}
</main>
<script>{script}</script>
</body>
</html>
"""


class PlayerPage:
    """A page that plays motions; a notebook shows it, `text` is its HTML."""

    def __init__(self, text: str):
        self.text = text

    def __repr__(self) -> str:
        return f"PlayerPage({len(self.text) // 1000} kB of HTML): a notebook shows it"

    def _repr_html_(self) -> str:
        """A frame, which keeps the styles of the notebook and of the player separate."""
        held = html.escape(self.text, quote=True)
        style = f"width: 100%; height: {_FRAME}px; border: 0"
        return f'<iframe srcdoc="{held}" style="{style}" title="player"></iframe>'


def play(motions: Any, path=None, *, title: str = "", choose: str = "") -> PlayerPage:
    """A page that plays a motion, or several together, in a notebook or a browser.

    Args:
      motions: a result of `simulate` or `simulate_phases`, or a mapping of names to such.
      path: a file to write the page to, .html; it needs no other file.
      title: its heading; the scene with its parameters by default.
      choose: as in `export`.
    Returns:
      The page; a notebook shows it as the last value of a cell.
    Raises:
      ValueError: as `export`, or `path` cannot be written.
    Example:
      >>> from jaxdyn import player, scenes, simulate
      >>> player.play(simulate(scenes.pendulum(), 1.0, samples=50))  # doctest: +ELLIPSIS
      PlayerPage(... kB of HTML): a notebook shows it
    """
    path = None if path is None else page_path(path)
    several = list(motions.values()) if isinstance(motions, Mapping) else [motions]
    shown = export(motions, choose=choose)
    heading = title or caption(*several).replace(r"\$", "$")
    text = page(heading, look(), fragment(shown), script())
    if path is not None:
        replace(path, text)
    return PlayerPage(text)


def page(title: str, look: str, fragment: str, script: str) -> str:
    """The HTML of a page with a heading, the contents below it, a style sheet and a script."""
    return _PAGE.format(title=html.escape(title), look=look, fragment=fragment, script=script)


def fragment(shown: Mapping[str, Any], label: str = "A motion.") -> str:
    """The part of a page that becomes a player of an export; the page must contain `script`."""
    return (
        f'<div class="player" data-label="{html.escape(label, quote=True)}">'
        f'<script type="application/json">{embed(shown)}</script></div>'
    )


def embed(found: Any) -> str:
    """JSON that can be written into a script of a page, whatever its texts contain.

    A "<" could begin a tag that ends the script, or a comment that keeps it from ending.
    """
    return json.dumps(found, allow_nan=False).replace("<", "\\u003c")


@functools.cache
def script(*names: str) -> str:
    """The player's script, or others of this folder, after the one that they draw with."""
    files = ("canvas", *(names or ("player",)))
    return "\n".join((_HERE / f"{name}.js").read_text() for name in files)


@functools.cache
def look(*names: str) -> str:
    """The player's style sheet, or others of this folder."""
    return "\n".join((_HERE / f"{name}.css").read_text() for name in names or ("player",))
