"""Pictures of the cost of accuracy, and of error against tolerance."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.accuracy.work_precision import Curve, WorkPrecision
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish, legend_below, legend_entries, style
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path

_MARKERS = "osD^vPX"
_PANEL = 3.4  # inches
_WIDE = 60.0  # ratio of the ends of an axis above which only powers of ten are labelled


@check_first
def work_precision(
    found: WorkPrecision,
    path=None,
    *,
    title: str | None = None,
    solvers: Sequence[str] = (),
) -> Figure:
    """A picture of error against time, and against right-hand sides, one curve per solver.

    Args:
      found: result of `work_precision.work_precision`.
      path: file to write, .png, .pdf or .svg.
      title: title of the picture.
      solvers: names of solvers in the order of their colours, for several pictures in which each
        solver has one colour; others follow, in the order of `found`.
    Raises:
      ValueError: `path` cannot be written.
    """
    path = picture_path(path)
    figure = blank(2 * _PANEL + 0.8, _PANEL + 1.0)
    left, right = _panels(figure, 2)
    order = list(dict.fromkeys((*solvers, *(curve.solver for curve in found.curves))))
    for curve in found.curves:
        i = order.index(curve.solver)
        errors = [rung.error for rung in curve.rungs]
        left.loglog([1e6 * rung.times.median for rung in curve.rungs], errors, **_style(i, curve))
        right.loglog([rung.evaluations for rung in curve.rungs], errors, **_style(i, curve))
    left.set(xlabel="time [us]", ylabel=f"relative error of the {found.quantity}")
    right.set(xlabel="right-hand sides evaluated")
    for ax in (left, right):
        low, high = ax.get_xlim()
        subs = (1.0, 2.0, 5.0) if high < _WIDE * low else (1.0,)
        ax.xaxis.set_major_locator(LogLocator(subs=subs))
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
    figure.suptitle(readable(title), fontsize=11)
    legend_below(figure, legend_entries(left))
    return finish(figure, path)


@check_first
def judgement(found: Mapping[str, WorkPrecision], path=None) -> Figure:
    """A picture of the error obtained against the tolerance requested.

    On the dashed line the two are equal. A solver whose curve is parallel to it follows the
    tolerance: a tenth of the tolerance gives a tenth of the error. Where a curve is above the line,
    the errors of the steps accumulated; a flat end is due to rounding. Solvers with a fixed step
    have no tolerance and are left out.

    Args:
      found: results of `work_precision.work_precision`, by the names of the scenes.
      path: file to write, .png, .pdf or .svg.
    Raises:
      ValueError: `found` is empty, a scene has no solver with a tolerance, or `path` cannot be
        written.
    """
    path = picture_path(path)
    if not found:
        raise _checks.fail("found", "at least one scene", "none")
    curves = {name: [c for c in one.curves if c.adaptive] for name, one in found.items()}
    for name, adaptive in curves.items():
        if not adaptive:
            remedy = "Draw solvers of fixed step with drawing.work_precision."
            raise _checks.fail("found", "solvers with a tolerance", f"none for {name}", remedy)
    figure = blank(_PANEL * len(found) + 0.8, _PANEL + 1.0)
    axes = _panels(figure, len(found))
    # A solver that does not suit every scene keeps its colour in all panels.
    solvers = list(dict.fromkeys(c.solver for each in curves.values() for c in each))
    for ax, (name, each) in zip(axes, curves.items(), strict=True):
        for curve in each:
            asked = [rung.fineness for rung in curve.rungs]
            errors = [rung.error for rung in curve.rungs]
            ax.loglog(asked, errors, **_style(solvers.index(curve.solver), curve))
        ends = np.array(ax.get_xlim())
        ax.loglog(ends, ends, "--", color=INK, lw=1.0, zorder=1, label="error = tolerance")
        ax.set_xlim(*ends[::-1])
        ax.set(xlabel="requested tolerance", title=name)
    axes[0].set_ylabel("relative error")
    legend_below(figure, legend_entries(*axes))
    return finish(figure, path)


def _panels(figure: Figure, n: int) -> list[Any]:
    axes = figure.subplots(1, n, sharey=True, squeeze=False)[0]
    for ax in axes:
        style(ax)
    return list(axes)


def _style(i: int, curve: Curve) -> dict:
    shade = PALETTE[i % len(PALETTE)]
    marker = _MARKERS[i % len(_MARKERS)]
    return {"color": shade, "marker": marker, "ms": 4.5, "lw": 1.5, "label": curve.solver}
