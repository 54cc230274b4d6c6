"""A picture of a fit: the measurements, the fitted motion with its bands, and the residuals."""

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import _text
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish, style
from jaxdyn.drawing.panels import WIDTH
from jaxdyn.drawing.titles import readable, wrap
from jaxdyn.files.output_files import picture_path
from jaxdyn.fitting.result import LEVEL, Fit, with_bar

_TITLE = 0.75  # width of the title, as part of the figure, which has legends beside the panels
_PALE = "0.6"  # grey of the measurements
_HIGH, _LOW = 2.0, 1.0  # [in] heights of the two panels for a column
_SHADES = {"prediction": 0.15, "confidence": 0.35}  # opacities of the bands


def fit(found: Fit, path=None, *, interval: str = "confidence", title: str | None = None) -> Figure:
    """A picture of a fit: for each column the data with the motion, and the residuals below them.

    The band contains the motion without noise with a probability of 95 %, the wider band a
    measurement; residuals are in standard deviations of the noise.

    Args:
      found: result of `jaxdyn.fit`.
      path: file to write, .png, .pdf or .svg.
      interval: "confidence" for the first band, "prediction" for both.
      title: title of the picture; by default the parameters with their error bars, "" for none.
    Raises:
      ValueError: `path` cannot be written.
    """
    path = picture_path(path)
    outer, predicted, table = found.predict(interval=interval), found.predict(), found.table
    second = _text.second(found.scene.labels())
    columns = found.model.columns
    figure = blank(WIDTH, 0.8 + (_HIGH + _LOW) * len(columns))
    ratios = [_HIGH, _LOW] * len(columns)
    panels = figure.subplots(len(ratios), sharex=True, squeeze=False, height_ratios=ratios)[:, 0]
    for i, column in enumerate(columns):
        upper, lower = panels[2 * i : 2 * i + 2]
        colour = PALETTE[i % len(PALETTE)]
        values, bars = predicted[column.name]
        style(upper)
        style(lower)
        halves = {interval: outer[column.name][1], "confidence": bars}
        for kind, half in halves.items():
            low, high, shade = values - half, values + half, _SHADES[kind]
            label = f"{100 * LEVEL:g} % {kind}"
            upper.fill_between(
                predicted.ts, low, high, color=colour, alpha=shade, lw=0, label=label
            )
        # Many measurements would hide the fit, so they are drawn below it, and pale.
        upper.plot(predicted.ts, values, color=colour, lw=1.4, label="fit", zorder=3)
        upper.plot(table.ts, table.values[:, i], ".", color=_PALE, ms=4, label="measured")
        unit = "" if column.unit == "1" else f" [{column.unit}]"
        upper.set_ylabel(f"{column.name}{unit}")
        noise = found.noise[column.name]
        lower.axhspan(-found.quantile, found.quantile, color=colour, alpha=0.15, lw=0)
        lower.axhline(0.0, color=INK, lw=0.8)
        lower.plot(table.ts, found.residuals[:, i] / noise, ".", color=INK, ms=3)
        lower.set_ylabel("residual")
        largest = np.nanmax(np.abs(found.residuals[:, i] / noise), initial=4.0)
        lower.set_ylim(-1.1 * largest, 1.1 * largest)
        upper.margins(x=0)
        upper.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    panels[-1].set_xlabel(f"t [{second}]" if second else "t")
    above = _heading(found) if title is None else readable(title)
    panels[0].set_title(wrap(above, _TITLE * WIDTH), fontsize=10)
    return finish(figure, path)


def _heading(found: Fit) -> str:
    p = len(found.solution.x.theta)
    sd = np.sqrt(np.diag(found.covariance))
    numbers = zip(found.names[:p], found.values[:p], found.quantile * sd[:p], strict=True)
    words = [f"{name} = {with_bar(x, bar)}" for name, x, bar in numbers]
    return f"{', '.join(words)}   ({100 * LEVEL:g} %)"
