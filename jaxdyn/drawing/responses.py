"""A picture of frequency response functions: magnitude and phase over frequency."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from jaxdyn import _checks
from jaxdyn._text import frequency_scale, with_unit
from jaxdyn.drawing.figures import INK, blank, finish, legend_below, legend_entries, shades, style
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path
from jaxdyn.vibration.transfer import TransferFunction

_FEW_DECADES = 300.0  # ratio of numbers below which ticks between powers of 10 have labels
_NARROW = 4.0  # ratio of frequencies below which their scale is linear


def bode(
    omega,
    values,
    path=None,
    *,
    names: Sequence[str] = (),
    magnitude: str | None = None,
    frequency: str | None = None,
    hertz: bool = False,
    title: str | None = None,
) -> Figure:
    """A Bode plot: magnitudes on logarithmic scales, and phases in degrees.

    Frequencies in a narrow range have a linear scale.

    Args:
      omega: (s,) angular frequencies, > 0 [rad/s].
      values: the result of `vibration.transfer_function`, whose names and units are then shown; or
        (s,) or (s, n) complex responses at these frequencies, as of `vibration.receptance`.
      path: file to write, .png, .pdf or .svg.
      names: names of the n responses.
      magnitude: name of the magnitude, with its unit; by default that of the transfer function.
      frequency: name of the frequency, with its unit.
      hertz: whether the axis has the frequencies in Hz, or in turns per unit of time.
      title: title of the picture.
    Raises:
      ValueError: `path` cannot be written, a frequency is not positive, or shapes do not fit.
    """
    path = picture_path(path)
    _checks.check_untraced("bode", (omega, values), "Draw what a compiled function returns.")
    omega = np.asarray(_checks.positive("omega", omega, "The axis is logarithmic."))
    known, time = "magnitude", "s"
    if isinstance(values, TransferFunction):
        known, time = with_unit(values.name, values.unit), values.time
        values = values.at(omega)
    scale, unit = frequency_scale(time, hertz=hertz)
    omega = scale * omega
    values = np.asarray(values).reshape(len(omega), -1)
    if names and len(names) != values.shape[1]:
        raise _checks.fail("names", f"{values.shape[1]}, one for each response", len(names))
    figure = blank(6.8, 5.4)
    axes: Any = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for i, colour in enumerate(shades(values.shape[1])):
        label = names[i] if names else "_"
        axes[0].loglog(omega, np.abs(values[:, i]), color=colour, lw=1.6, label=label)
        phases = np.degrees(np.unwrap(np.angle(values[:, i])))
        axes[1].semilogx(omega, phases, color=colour, lw=1.6, label=label)
    axes[0].set(ylabel=known if magnitude is None else magnitude)
    frequency = with_unit("frequency", unit) if frequency is None else frequency
    axes[1].set(xlabel=frequency, ylabel="phase [deg]")
    if omega.max() < _NARROW * omega.min():
        axes[1].set_xscale("linear")
    elif omega.max() < _FEW_DECADES * omega.min():  # the powers of 10 alone would be too few
        _label_between(axes[1].xaxis)
    sizes = np.abs(values[values != 0])
    if sizes.size and sizes.max() < _FEW_DECADES * sizes.min():
        _label_between(axes[0].yaxis)
    axes[1].yaxis.get_major_locator().set_params(steps=[1, 1.8, 4.5, 9, 10])
    axes[0].set_title(readable(title), fontsize=10)
    for ax in axes:
        style(ax)
        ax.tick_params(which="minor", colors=INK, labelsize=9)
    if names:
        legend_below(figure, legend_entries(*axes))
    return finish(figure, path)


def _label_between(axis: Any) -> None:
    """Label ticks between the powers of 10 of a logarithmic axis."""
    axis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("{x:g}")
