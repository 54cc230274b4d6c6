"""Pages on which orbits run: one beside a neighbouring motion, or those of a family."""

import collections
import math
from collections.abc import Sequence

import numpy as np

from jaxdyn import Scene, _text, scenes
from jaxdyn._checks import check_first, fail
from jaxdyn.files.output_files import page_path
from jaxdyn.player import PlayerPage
from jaxdyn.player.choices import Choices, Curve
from jaxdyn.player.live_pages import write_page
from jaxdyn.scenes.corners import has_corners
from orbits.families.family import Family
from orbits.files.family_files import Entry, Listing, listing, parameter_name
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit

_MOST_MEMBERS = 150  # on a page, which has the start and the parameters of each
_DIGITS = 8  # digits of a period


@check_first
def orbit_page(orbit: Orbit | HybridOrbit, path=None) -> PlayerPage:
    """A page on which an orbit runs; beside a smooth one, a motion that starts 0.1 percent away.

    Args:
      orbit: from `find` or `find_hybrid`.
      path: a file to write the page to, .html.
    Raises:
      ValueError: as `Orbit.live` and `HybridOrbit.live`.
    """
    path = None if path is None else page_path(path)
    if not orbit.ok:
        raise fail("orbit", "one that was found", orbit.outcome.name, orbit.message)
    chain = isinstance(orbit, HybridOrbit)
    scene = _scene_of_chain(orbit) if chain else orbit.scene
    name = _text.title_of(scene).replace("_", " ")
    # A chain starts at an event; a start beside it may lie beyond the event.
    return write_page(
        Choices({"": scene}, whole=True),
        path,
        title=f"Orbit of {name}",
        motions=1 if chain else 2,
    )


def _scene_of_chain(orbit: HybridOrbit) -> Scene:
    """The scene of a chain, whose phases the page runs.

    Raises:
      ValueError: its legs are not phases of a ready-made scene.
    """
    scene = orbit.legs[0].scene.starting(orbit.y0, orbit.period)
    known = scenes.phases_of(scene) if has_corners(scene) else {}
    if not orbit.path or not {name for name, _ in orbit.path} <= set(known):
        remedy = "Draw it with orbits.drawing.orbits."
        raise fail("orbit", "a chain of phases of a ready-made scene", "other legs", remedy)
    return scene


@check_first
def family_page(family: Family | Listing, path=None) -> PlayerPage:
    """A page on which the orbits of a family run, selected by a slider or in a plot.

    A motion whose start differs by a thousandth runs beside the orbit, and stays close if the orbit
    is stable. From a family of more than 150 orbits, 150 are selected evenly, with the first and
    the last. All special points of the family are there too, marked at the slider and in the plot.

    Args:
      family: a family, or a list of one, from `family_files.load`.
      path: a file to write the page to, .html.
    Raises:
      ValueError: its orbits are chains of legs, they cannot run on a page, or `path` cannot be
        written.
    """
    path = None if path is None else page_path(path)
    if isinstance(family, Family):
        family = listing(family, parameter_name(family))
    number = min(len(family.members), _MOST_MEMBERS)
    places = np.linspace(0, len(family.members) - 1, number).round().astype(int)
    selected = [family.members[i] for i in places]
    first = selected[0].orbit
    if isinstance(first, HybridOrbit):
        remedy = "It is drawn by orbits.drawing.family."
        raise fail("family", "orbits of one smooth motion", "chains of legs", remedy)
    entries = _with_special(selected, family.special)
    what, unit, across = _across(family, entries)
    periods = [entry.orbit.period for entry in entries]
    verdicts = [entry.verdict for entry in entries]
    time = _text.second(first.scene.labels())
    # The number makes names unique: the value may be the same, for example on both sides of a fold.
    numbered = zip(_numbers(entries), across, strict=True)
    names = [f"{number}, {what} = {_text.brief(x, unit)}" for number, x in numbered]
    kinds = ["" if entry.kind is None else str(entry.kind) for entry in entries]
    notes = [
        f"period {_text.brief(period, time, digits=_DIGITS)}, {verdict}"
        for period, verdict in zip(periods, verdicts, strict=True)
    ]
    axes = _text.with_unit(what, unit), _text.with_unit("period", time)
    colours = [kind or verdict for kind, verdict in zip(kinds, verdicts, strict=True)]
    choices = Choices(
        dict(zip(names, (entry.orbit.scene for entry in entries), strict=True)),
        choose="member",
        notes=notes,
        whole=True,
        curve=Curve(axes, across, periods, colours),
        special={i: kind for i, kind in enumerate(kinds) if kind},
    )
    count = _text.number_of(len(family.members), "orbit")
    shown = f", {len(selected)} of them" if len(selected) < len(family.members) else ""
    name = _text.title_of(first.scene).replace("_", " ")
    return write_page(choices, path, title=f"Family of {count} of {name}{shown}", motions=2)


def _numbers(entries: Sequence[Entry]) -> list[str]:
    """Numbers of the orbits; each kind of special point has its own: 7, 8, fold 1, 9."""
    counts: collections.Counter[str] = collections.Counter()
    found = []
    for entry in entries:
        kind = "" if entry.kind is None else f"{entry.kind} "
        counts[kind] += 1
        found.append(f"{kind}{counts[kind]}")
    return found


def _with_special(members: Sequence[Entry], special: Sequence[Entry]) -> list[Entry]:
    """The members, with each special point inserted where the detour through it is least."""
    found = [*members]
    points = np.array([_place(entry) for entry in [*members, *special]])
    points = np.nan_to_num(points)  # a family without a parameter or energy has NaN throughout
    sizes = np.ptp(points, axis=0)
    points = points / np.where(sizes == 0, 1.0, sizes)
    places = {id(entry): point for entry, point in zip([*members, *special], points, strict=True)}
    for entry in special:
        line = np.array([places[id(one)] for one in found])
        away = np.linalg.norm(line - places[id(entry)], axis=1)
        steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
        # Before the first member the detour is the distance to it, and so after the last.
        detours = np.concatenate([away[:1], away[:-1] + away[1:] - steps, away[-1:]])
        found.insert(int(np.argmin(detours)), entry)
    return found


def _place(entry: Entry) -> list[float]:
    """The numbers by which an orbit is placed among those of its family."""
    return [entry.parameter, entry.energy, entry.orbit.period, *np.asarray(entry.orbit.y0).tolist()]


def _across(family: Listing, entries: Sequence[Entry]) -> tuple[str, str, list[float]]:
    """The quantity that distinguishes the members of a family: name, unit and values."""
    if family.parameter is not None:
        return family.parameter, "", [entry.parameter for entry in entries]
    if not math.isnan(entries[0].energy):
        unit = entries[0].orbit.scene.in_units("J")
        return "energy", unit, [entry.energy for entry in entries]
    return "number", "", [float(i + 1) for i in range(len(entries))]
