"""Pages in a browser: motions that run or are played, equations, questions.

A running scene replaces a computed motion wherever that is possible and shorter: its rate and its
initial state take some kilobytes, and its parameters can be changed.
"""

import html
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import jax

from jaxdyn import player
from jaxdyn.course.page.content import Page, PlayedMotions
from jaxdyn.course.page.register import Problem
from jaxdyn.files.output_files import replace
from jaxdyn.formulations.prescribed import Prescribed
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.player.choices import of_motions
from jaxdyn.player.live_pages import SCRIPTS, fragment
from jaxdyn.player.pages import look, page, script
from jaxdyn.symbolic.equations import Equations, equations

_STYLE = """
.folded { margin: 1rem 0; }
.folded > summary { cursor: pointer; font-weight: 600; }
.formulas { overflow: auto hidden; padding: 4px 0; }
pre { white-space: pre-wrap; }
"""
_INDENTED = re.compile(r"^ {4}", re.MULTILINE)


class Display(NamedTuple):
    """Motions of a page in a browser.

    Attributes:
      look: the caption.
      html: a part of a page: a running scene, or a player of computed motions.
      runs: whether it is a running scene.
    """

    look: str
    html: str
    runs: bool


def displays(page: Page) -> list[Display]:
    """The motions of a page, each as a running scene where that is possible and shorter.

    The questions of the page are shown beside the first of them that runs.
    """
    found, asks = [], tuple(page.asks)
    for one in page.played:
        made = _display(one, asks)
        found.append(made)
        asks = () if made.runs else asks
    return found


def _display(played: PlayedMotions, asks: Sequence[player.Ask]) -> Display:
    data = player.export(played.motions, choose=played.choose)
    computed = player.fragment(data, played.look.replace("`", ""))
    if played.inexact:
        return Display(played.look, computed, runs=False)
    try:
        running = fragment(of_motions(played.motions, played.choose, played.ends), asks=asks)
    except ValueError:  # its phases, its kinds of scenes or its formulas do not suit a page
        running = None
    if running is None or len(running) > len(computed):
        return Display(played.look, computed, runs=False)
    return Display(played.look, running, runs=True)


def equations_of(page: Page) -> list[Equations]:
    """The equations of the motions that are played, in order, once for each system.

    Prescribed motions are left out, as are systems that have no formulas or whose equations would
    fill pages.
    """
    motions = [one for played in page.played for one in played.motions.values()]
    scenes = [one.scene for one in motions if isinstance(one, Trajectory)]
    moved = [scene for scene in scenes if not isinstance(scene.system, Prescribed)]
    kinds = {str(jax.tree.structure(scene.field)): scene for scene in reversed(moved)}
    found = {}
    for scene in reversed(kinds.values()):
        try:
            printed = equations(scene)
        except ValueError:
            continue
        found.setdefault(printed.text("motion"), printed)
    return list(found.values())


def formulas(page: Page) -> list[str]:
    """The equations of the motions that are played, as HTML: one text for each section."""
    return [
        found.mathml(section.name)
        for found in equations_of(page)
        for section in found.sections
        if section.name != "parameters"
    ]


def one_file(problem: Problem, found: Page, path: Path) -> player.PlayerPage:
    """Write a page as a single file: the problem, the motions, and, folded, answer and equations.

    Args:
      problem: the problem.
      found: the content of its page.
      path: a file to write to, .html.
    """
    motions = displays(found)
    answer = _paragraphs(f"{problem.answer}\n\n{problem.solution}")
    parts = [
        _paragraphs(problem.statement),
        *(f"{_paragraphs(one.look)}\n{one.html}" for one in motions),
        _fold("Answer", answer),
    ]
    written = formulas(found)
    if written:
        each = (f'<div class="formulas">{one}</div>' for one in written)
        parts.append(_fold("The equations", "\n".join(each)))
    kinds = [*SCRIPTS] * any(one.runs for one in motions)
    kinds += ["player"] * any(not one.runs for one in motions)
    style = look("player", "live") + _STYLE
    title = f"{problem.number}. {problem.title}"
    text = page(title, style, "\n".join(parts), script(*kinds))
    replace(path, text)
    return player.PlayerPage(text)


def _fold(title: str, content: str) -> str:
    return f'<details class="folded"><summary>{title}</summary>\n{content}\n</details>'


def _paragraphs(text: str) -> str:
    """Paragraphs and indented blocks as HTML."""
    blocks = (block for block in re.split(r"\n\s*\n", text.strip("\n")) if block.strip())
    return "\n".join(map(_block, blocks))


def _block(text: str) -> str:
    if text.startswith("    "):
        return f"<pre>{html.escape(_INDENTED.sub('', text))}</pre>"
    return f"<p>{html.escape(text)}</p>"
