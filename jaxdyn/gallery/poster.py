"""Fifty periodic orbits of three equal bodies: a poster, and animated miniatures.

`jaxdyn/data/plane_orbits.json` has their initial states, found by `orbits.search_plane`: those with
a published name, the stable ones, and the shortest of the others. Their periods, stability and
words are computed when the page is built.
"""

import importlib.resources
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import orbits
from jaxdyn import scenes, simulate
from jaxdyn._progress import each
from jaxdyn.drawing.figures import INK, PALETTE, blank
from jaxdyn.gallery.pictures import write
from jaxdyn.player.choices import Choices
from jaxdyn.player.model import model
from jaxdyn.scene import Scene
from orbits.discovery import plane, seeds

_COLUMNS = 10
_SIDE, _TEXT = 1.5, 0.35  # [in] of a panel, and of the text above it
_MARGIN = 1.05
_SAMPLES = 2000  # per orbit; with fewer, its loops would show corners


class PosterOrbit(NamedTuple):
    """An orbit of the poster: name, lines of its caption, its scene, its paths (s, 3, 2)."""

    name: str
    lines: tuple[str, ...]
    scene: Scene
    r: np.ndarray
    verdict: str


def record(pictures: Path) -> dict[str, Any]:
    """Close all orbits of the poster, draw them, and return the record of the page."""
    shown = [_close(row, i) for i, row in enumerate(each(starts(), "closing orbits"))]
    figure = _poster(shown)
    look = "All orbits over one period, each at its own scale."
    drawing = write(figure, pictures, "poster", look) | {"other": "poster.pdf"}
    figure.savefig(pictures / "poster.pdf")
    stable = sum(one.verdict == "stable" for one in shown)
    text = (
        f"{len(shown)} periodic orbits of three equal bodies with zero angular momentum, which "
        "start from a line. `orbits search` finds them from random velocities. Each was computed "
        f"again for this page to a closing error below 1e-9, and {stable} are linearly stable. The "
        "word says which body passes between the two others, as a word in Montgomery's free group."
    )
    # Only the initial states are written; the page computes the paths, which take fifty times
    # as much space.
    choices = Choices({one.name: one.scene for one in shown}, "orbit")
    return {"title": "Periodic orbits of three bodies", "text": text} | {
        "drawings": [drawing],
        "minis": [{"name": one.name, "lines": one.lines} for one in shown],
        "model": model(shown[0].scene, choices=choices),
    }


def starts() -> list[dict[str, Any]]:
    """The stored initial states: velocities a and b, period T, published name or ""."""
    file = importlib.resources.files("jaxdyn") / "data" / "plane_orbits.json"
    return json.loads(file.read_text())["orbits"]


def _close(row: dict[str, Any], number: int) -> PosterOrbit:
    """One orbit, with its closing error and its stability computed again."""
    start = seeds.rows(np.array([[row["a"], row["b"]]]))[0]
    scene = scenes.three_body().starting(start, row["T"])
    orbit = orbits.find(scene, period=row["T"], closing=orbits.reversal(plane.IN_LINE))
    stability, word = orbits.stability(orbit), orbits.analysis.word(orbit)
    motion = simulate(orbit.scene, orbit.period, samples=_SAMPLES + 1, rtol=1e-10)
    lines = (
        f"T = {float(orbit.period):.6f}, {stability.verdict}",
        word if len(word) <= 24 else f"{word[:21]}... ({len(word)} letters)",
    )
    name = row["name"] or f"orbit {number + 1}"
    return PosterOrbit(name, lines, orbit.scene, np.asarray(motion.r), stability.verdict)


def _poster(shown: list[PosterOrbit]):
    """All orbits in a grid, each at its own scale."""
    rows = -(-len(shown) // _COLUMNS)
    figure = blank(_COLUMNS * _SIDE, rows * (_SIDE + _TEXT))
    panels = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for ax in panels:
        ax.set_axis_off()
    for ax, one in zip(panels, shown, strict=False):
        for body, colour in zip(np.moveaxis(one.r, 1, 0), PALETTE, strict=False):
            ax.plot(*body.T, color=colour, lw=0.9)
            ax.plot(*body[0], "o", color=colour, ms=3)
        reach = _MARGIN * np.abs(one.r).max()  # their mass centre rests at the origin
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        ax.set_title(one.name, fontsize=7, y=1.0, pad=9)
        small = {"fontsize": 5.5, "color": INK, "ha": "center", "transform": ax.transAxes}
        ax.text(0.5, 1.0, one.lines[0], **small)
    figure.suptitle(f"{len(shown)} periodic orbits of three equal bodies", fontsize=12)
    return figure
