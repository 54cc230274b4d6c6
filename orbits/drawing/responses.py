"""Pictures of frequency responses and backbone curves, in the form used in engineering."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import Scene, _text
from jaxdyn._checks import check_first, choice, fail
from jaxdyn.drawing.bifurcations import draw_stretches, in_extents, smooth
from jaxdyn.drawing.figures import (
    INK,
    PALETTE,
    blank,
    finish,
    legend_below,
    legend_entries,
    mark,
    shades,
    style,
)
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path
from jaxdyn.vibration.inputs import Output
from orbits.analysis.quantities import amplitude, phase
from orbits.analysis.quantities import label as called
from orbits.drawing.families import MARKS, orbit_stretches
from orbits.families.family import Family, Member
from orbits.responses.backbone import Backbone
from orbits.responses.response import FrequencyResponse

_WIDTH = 6.8  # inches


@check_first
def frequency_response(
    found: FrequencyResponse,
    path=None,
    *,
    output: Output | None = None,
    backbone: Backbone | None = None,
    hertz: bool = False,
    title: str | None = None,
) -> Figure:
    """A picture of response curves: amplitude and phase over the forcing frequency.

    Stable responses are solid, unstable ones dashed; folds and other special points are marked.

    Args:
      found: result of `orbits.frequency_response`.
      path: file to write, .png, .pdf or .svg.
      output: the name of an entry of the state, or a function (t, y) -> (); by default that of the
        result.
      backbone: result of `orbits.backbone`, drawn through the curves.
      hertz: whether frequencies are in Hz, or in turns per unit of time, not in rad/s.
      title: its title; the scene by default, "" for none.
    Raises:
      ValueError: `path` cannot be written, or there is no such output.
    """
    path = picture_path(path)
    scene = found.curves[0].members[0].orbit.scene
    output, label = _output(output or found.output, scene)
    found = found.with_extremes(output)
    figure = blank(_WIDTH, 6.0)
    axes: Any = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    kinds: dict[str, Any] = {}
    scale, frequency = _frequency(scene, hertz)
    many = list(dict.fromkeys(found.levels))
    colours = dict(zip(many, shades(len(many)), strict=True))
    for level, curve in zip(found.levels, found.curves, strict=True):
        colour = colours[level]
        name = f"level {_text.brief(level)}"
        for ax, of in zip(axes, (amplitude, phase), strict=True):
            places = _places(curve, lambda m, of=of: of(m.orbit, output))
            if of is phase:
                places = _unwrap(curve, places)
            places = {key: (scale * w, height) for key, (w, height) in places.items()}
            _curve(ax, curve, places, colour, name, kinds)
    if backbone is not None:
        line = list(zip(scale * backbone.frequencies, backbone.amplitudes(output), strict=True))
        top = axes[0].get_ylim()[1]
        axes[0].plot(*smooth(axes[0], [line])[0].T, color=INK, lw=1.2, ls="-.", label="backbone")
        axes[0].set_ylim(top=top)
    axes[0].set(ylabel=f"amplitude {label}", xlim=scale * np.array(found.frequencies))
    axes[0].set_ylim(bottom=0.0)
    axes[1].set(xlabel=frequency, ylabel="phase lag [rad]")
    axes[1].set_yticks([0.0, math.pi / 2, math.pi], ["0", "pi/2", "pi"])
    axes[0].set_title(_title(title, scene), fontsize=10)
    for ax in axes:
        style(ax)
    legend_below(figure, [*legend_entries(*axes), *kinds.values()])
    return finish(figure, path)


@check_first
def backbone(
    found: Backbone | Sequence[Backbone],
    path=None,
    *,
    against: str | None = None,
    output: Output | None = None,
    hertz: bool = False,
    title: str | None = None,
) -> Figure:
    """A picture of backbone curves: frequency over energy, or amplitude over frequency.

    The energy is relative to the equilibrium. Stable vibrations are solid, unstable ones dashed;
    special points and internal resonances are marked, the latter with their ratio.

    Args:
      found: result of `orbits.backbone`, one or several of one scene.
      path: file to write, .png, .pdf or .svg.
      against: "energy" for the frequency over the energy, on a logarithmic scale; "amplitude" for
        the amplitude over the frequency, as response curves are drawn. By default the latter if
        there is an output, or no energy.
      output: the output whose amplitude is drawn; see `frequency_response`.
      hertz: see `frequency_response`.
      title: its title; the scene by default, "" for none.
    Raises:
      ValueError: `path` cannot be written, the scene has no energy, or there is no such output.
    """
    path, many = picture_path(path), [found] if isinstance(found, Backbone) else list(found)
    scene = many[0].family.members[0].orbit.scene
    if against is None:
        against = "energy" if output is None and scene.has_energy else "amplitude"
    choice("against", against, ("energy", "amplitude"))
    if against == "energy" and not scene.has_energy:
        raise fail("against", "amplitude, in a scene without an energy", against)
    output, label = _output(output, scene)
    scale, name = _frequency(scene, hertz)

    def place(member: Member, rest: float) -> tuple[float, float]:
        frequency = scale * 2 * math.pi / member.orbit.period
        if against == "energy":
            return member.energy - rest, frequency
        return frequency, amplitude(member.orbit, output)

    figure = blank(_WIDTH, 5.0)
    ax: Any = figure.add_subplot()
    if against == "energy":
        energy = _text.with_unit("energy", scene.in_units("J"))
        ax.set(xscale="log", xlabel=energy, ylabel=name)
    else:
        ax.set(xlabel=name, ylabel=f"amplitude {label}")
    kinds: dict[str, Any] = {}
    for one, colour in zip(many, itertools.cycle(PALETTE), strict=False):
        places = {id(m): place(m, one.rest) for m in (*one.family.members, *one.family.special)}
        _curve(ax, one.family, places, colour, f"mode {one.mode}", kinds)
        for resonance in one.resonances:
            x, y = place(resonance.member, one.rest)
            ax.plot(x, y, ".", color=INK, ms=5, zorder=5)
            ratio = f"{resonance.ratio.numerator}:{resonance.ratio.denominator}"
            ax.annotate(ratio, (x, y), (3, 4), textcoords="offset points", fontsize=7, color=INK)
    ax.set_title(_title(title, scene), fontsize=10)
    style(ax)
    legend_below(figure, [*legend_entries(ax), *kinds.values()])
    return finish(figure, path)


def _places(curve: Family, of: Callable[[Member], float]) -> dict[int, tuple[float, float]]:
    """The position in the picture of each member and special point of a curve, by its `id`."""
    return {id(m): (m.parameter, of(m)) for m in (*curve.members, *curve.special)}


def _unwrap(curve: Family, places: dict[int, tuple[float, float]]) -> dict:
    """The same positions, with angles that do not jump along the curve."""
    at = in_extents(curve.members, lambda m: m.point.place)
    angles = np.unwrap([places[id(m)][1] for m in curve.members])
    if angles.mean() < 0:
        angles = angles + 2 * np.pi
    found = {id(m): (m.parameter, x) for m, x in zip(curve.members, angles, strict=True)}
    for m in curve.special:
        near = min(curve.members, key=lambda x, m=m: np.linalg.norm(at(x) - at(m)))
        angle = places[id(m)][1]
        turns = round((found[id(near)][1] - angle) / (2 * np.pi))
        found[id(m)] = m.parameter, angle + 2 * np.pi * turns
    return found


def _curve(ax, curve: Family, places: dict, colour, name: str, kinds: dict) -> None:
    """Draw a curve with its stability, and its special points."""
    members = (*curve.members, curve.members[0]) if curve.closed else curve.members
    found = orbit_stretches(members, curve.special)
    draw_stretches(ax, found, lambda m: places[id(m)], name, color=colour, lw=1.6)
    for m in curve.special:
        ax.plot(*places[id(m)], MARKS[m.kind], color=colour, ms=5, mec=INK, mew=0.6, zorder=4)
        kinds.setdefault(str(m.kind), mark(MARKS[m.kind], str(m.kind)))


def _output(output: Output | None, scene: Scene) -> tuple[Output, str]:
    """The output that is drawn, and its name with its unit."""
    labels = dict(scene.labels())
    output = output or next(iter(labels))
    if callable(output):
        return output, called(output)
    return output, _text.with_unit(output, labels[choice("output", output, list(labels))])


def _title(title: str | None, scene: Scene) -> str:
    return readable(_text.title_of(scene) if title is None else title)


def _frequency(scene: Scene, hertz: bool) -> tuple[float, str]:
    """What angular frequencies are multiplied by, and what the result is called."""
    scale, unit = _text.frequency_scale(_text.second(scene.labels()), hertz=hertz)
    return scale, _text.with_unit("frequency", unit)
