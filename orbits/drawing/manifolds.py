"""A picture of stable and unstable manifolds, with the orbits that they belong to."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import _text, simulate
from jaxdyn._checks import check_first, fail
from jaxdyn.drawing.contents import indices_of
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish, legend_below, legend_entries, style
from jaxdyn.drawing.solid import fill
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from orbits.manifolds.manifold import Manifold

_COLOURS = {"unstable": PALETTE[1], "stable": PALETTE[0]}
_WIDTH, _HEIGHT = 6.4, 5.6  # inches
_SAMPLES, _RTOL = 400, 1e-10  # samples of the orbits, and their tolerance


@check_first
def manifold(
    found: Manifold | Sequence[Manifold],
    path=None,
    *,
    entries: tuple[str, ...] | None = None,
    title: str | None = None,
) -> Figure:
    """A picture of the strands of one or several manifolds, stable ones blue, unstable ones red.

    Args:
      found: what `orbits.manifold` returned, or several of one scene.
      path: file to write, .png, .pdf or .svg.
      entries: names of two or three entries of the state; the first two by default.
      title: its title; the scene with its numbers by default, "" for none.
    Raises:
      ValueError: `entries` are not two or three names of entries, there is nothing to draw, or
        `path` cannot be written.
    """
    path = picture_path(path)
    several = [found] if isinstance(found, Manifold) else list(found)
    if not any(one.ok.any() for one in several):
        got = several[0].message if several else "none"
        raise fail("found", "manifolds with strands that reached their end", got)
    scene = several[0].scene
    which = indices_of(entries, scene) or [0, 1]
    figure = blank(_WIDTH, _HEIGHT)
    ax: Any = figure.add_subplot(projection="3d" if len(which) == 3 else None)
    for one in several:
        _draw(ax, one, which)
    for one in {id(one.orbit): one for one in several}.values():
        _draw_base(ax, one, which)
    labels = [_text.with_unit(*scene.labels()[i]) for i in which]
    ax.set(**{f"{axis}label": label for axis, label in zip("xyz", labels, strict=False)})
    ax.set_title(heading(title, [scene], _WIDTH), fontsize=10)
    if len(which) == 2:
        style(ax)
    legend_below(figure, legend_entries(ax))
    fill(figure)
    return finish(figure, path)


def _draw(ax, one: Manifold, which: list[int]) -> None:
    """Draw the strands."""
    label = f"{one.kind} manifold"
    for strand in one.samples[one.ok]:
        ax.plot(*strand[:, which].T, color=_COLOURS[one.kind], lw=0.6, alpha=0.7, label=label)
        label = "_"


def _draw_base(ax, one: Manifold, which: list[int]) -> None:
    """Draw the orbit or the equilibrium to which the strands belong."""
    if one.orbit is None:
        ax.plot(*one.base[:1, which].T, "o", color=INK, ms=5, label="equilibrium")
        return
    motion = simulate(one.orbit.scene, samples=_SAMPLES, rtol=_RTOL)
    ax.plot(*np.asarray(motion.ys)[:, which].T, color=INK, lw=2.0, label="orbit")
