"""A picture of an invariant torus: its surface, and the invariant circle on it."""

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import _text, simulate
from jaxdyn._checks import check_first
from jaxdyn.drawing.contents import indices_of
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish, legend_below, legend_entries
from jaxdyn.drawing.solid import fill
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from orbits.tori.torus import Torus

_AROUND, _ALONG = 48, 60  # lines of the surface in its two directions
_RTOL = 1e-9
_SIDE = 5.6  # inches


@check_first
def torus(
    found: Torus, path=None, *, entries: tuple[str, ...] | None = None, title: str | None = None
) -> Figure:
    """A picture of a torus in three entries of the state, or in two and time.

    Args:
      found: what `orbits.torus` returned.
      path: file to write, .png, .pdf or .svg.
      entries: names of three entries of the state, or of two, which are drawn over the time of one
        return; the first ones by default.
      title: its title; the scene with its numbers by default, "" for none.
    Raises:
      ValueError: `entries` are not two or three names of entries, or `path` cannot be written.
    """
    path = picture_path(path)
    known = found.scene.labels()
    which = indices_of(entries, found.scene) or [*range(len(known))][:3]
    ts, states = _surface(found)
    shown, labels = states[..., which], [_text.with_unit(*known[i]) for i in which]
    if len(which) == 2:
        over = np.broadcast_to(ts, shown.shape[:2])
        shown, labels = np.concatenate([over[..., None], shown], axis=-1), ["t", *labels]
    figure = blank(_SIDE, _SIDE)
    ax: Any = figure.add_subplot(projection="3d")
    x, y, z = np.moveaxis(shown, -1, 0)
    ax.plot_surface(x, y, z, color=PALETTE[0], alpha=0.35, lw=0.2, rstride=1, cstride=1)
    ax.plot(x[:, 0], y[:, 0], z[:, 0], color=INK, lw=1.6, label="invariant circle")
    ax.set(**{f"{axis}label": label for axis, label in zip("xyz", labels, strict=True)})
    ax.set_title(heading(title, [found.scene], _SIDE), fontsize=10)
    legend_below(figure, legend_entries(ax))
    fill(figure)
    return finish(figure, path)


def _surface(found: Torus) -> tuple[np.ndarray, np.ndarray]:
    """Times (s,) within a return, and states (n, s, k) whose lines meet again after it."""
    ts = np.linspace(0.0, found.time, _ALONG)
    theta = np.linspace(0.0, 2 * math.pi, _AROUND, endpoint=False)
    flowed = np.array(
        [
            np.asarray(simulate(found.scene.starting(y), found.time, samples=ts, rtol=_RTOL).ys)
            for y in found.at(theta)
        ]
    )
    # A return rotates the circle by rho; rotated back in proportion to time, the lines close.
    return ts, _turn_back(flowed, found.rotation * ts / found.time)


def _turn_back(flowed: np.ndarray, back: np.ndarray) -> np.ndarray:
    """(n + 1, s, k) circles (n, s, k), each rotated back by its angle `back` (s,), and closed."""
    n = len(flowed)
    modes = np.fft.rfft(flowed, axis=0)
    turn = np.exp(-1j * np.arange(len(modes))[:, None] * back[None])
    turned = np.fft.irfft(modes * turn[..., None], n, axis=0)
    return np.concatenate([turned, turned[:1]])
