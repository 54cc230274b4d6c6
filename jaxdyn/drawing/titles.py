"""Default titles of pictures: the scene and its numbers."""

import dataclasses
import re
import textwrap
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from matplotlib.mathtext import MathTextParser

from jaxdyn._checks import check_first
from jaxdyn._text import words
from jaxdyn.formulations.extended import Extended
from jaxdyn.formulations.rigid import about_centre, inertia_matrix
from jaxdyn.geometry.inertia import MaterialPoints
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene, System
from jaxdyn.system import UNIT

_CHARACTER = 0.078  # width of a character of a title in 10 points [in]
_SPACE = "\0"  # stands for a space at which lines are not broken
_ONE = re.compile(r"\w+ = \([^()]*\)|\w+ = ")
_MOST = 4  # largest number of entries of an array that is written in full
_AT_ORIGIN = 1e-12  # distance over the size of a body below which a centre is at the origin


@check_first
def caption(*motions: Trajectory | HybridTrajectory) -> str:
    """The system and the effects, with the numbers that all motions share."""
    return describe(*scenes_of(motions))


def scenes_of(motions: Sequence[Trajectory | HybridTrajectory]) -> list[Scene]:
    """The scene of each motion; for a chain that of its first phase."""
    return [pieces_of(motion)[0].scene for motion in motions]


def heading(title: str | None, scenes: Sequence[Scene], width: float, *lines: str) -> str:
    """The heading of a picture: its title and further lines, wrapped to a width [in].

    Args:
      title: the title; None for a description of the scenes, "" for none.
      scenes: the scenes in the picture.
      width: width of the figure [in].
      lines: those that are not empty follow the title.
    """
    first = describe(*scenes) if title is None else readable(title)
    return "\n".join(wrap(line, width) for line in (first, *lines) if line)


def wrap(line: str, width: float) -> str:
    """A line wrapped to a width [in], but not between a number and its name or within an array."""
    kept = _ONE.sub(_without_breaks, line)
    return textwrap.fill(kept, int(width / _CHARACTER)).replace(_SPACE, " ")


def readable(title: str | None) -> str:
    """A title for Matplotlib, in which dollar signs that enclose no formula are shown as such."""
    title = title or ""
    try:
        MathTextParser("path").parse(title)
    except ValueError:
        return title.replace("$", r"\$")
    return title


def _without_breaks(found: re.Match) -> str:
    return found.group().replace(" ", _SPACE)


def describe(*scenes: Scene) -> str:
    """A one-line description of a scene, or of what several scenes have in common.

    Example:
      >>> from jaxdyn import scenes
      >>> describe(scenes.pendulum(length=2.0))
      'pendulum (m = 1, l = 2), uniform gravity (g = 9.81)'
      >>> describe(scenes.pendulum(length=2.0), scenes.pendulum(length=1.0))
      'pendulum (m = 1), uniform gravity (g = 9.81)'
    """
    systems, *effects = zip(*map(_parts, scenes), strict=False)
    names = " and ".join(dict.fromkeys(part.words for part in systems))
    shared = [_with_numbers(names, systems)]
    for alike in effects:
        if len({part.words for part in alike}) == 1:
            shared.append(_with_numbers(alike[0].words, alike))
    return ", ".join(shared)


class _Part(NamedTuple):
    """A system or an effect: its name, and its numbers."""

    words: str
    numbers: dict[str, np.ndarray]


def _parts(scene: Scene) -> list[_Part]:
    """The system, called by the scene's name if it has one, the effects, and what extends it."""
    system, extensions = scene.system, []
    while isinstance(system, Extended):
        extensions += _extension(system)
        system = system.system
    system = getattr(system, "mechanism", system)
    # A dollar sign would start a formula.
    name = scene.name.replace("$", r"\$") or words(system).capitalize()
    effects = [_Part(words(effect), _numbers(effect)) for effect in scene.effects]
    return [_Part(name, _numbers(system)), *effects, *extensions]


def _extension(system: Extended) -> list[_Part]:
    """What a system adds to the one that it extends, such as "harmonic force on x"."""
    fields = dataclasses.fields(system)
    added = [x for f in fields if isinstance(x := getattr(system, f.name), eqx.Module)]
    added = [x for x in added if x is not system.system]
    if not added:
        return []
    on = next((one for x in added if isinstance(one := getattr(x, "on", None), str)), "")
    called = " ".join(words(x) for x in reversed(added))
    numbers = {name: x for one in added for name, x in _numbers(one).items()}
    return [_Part(f"{called} on {on}" if on else called, numbers)]


def _with_numbers(words: str, parts: Sequence[_Part]) -> str:
    """The words with the numbers that are the same in all parts."""
    first, *others = parts
    shared = [
        f"{name} = {_text_of(x)}"
        for name, x in first.numbers.items()
        if all(name in part.numbers and np.array_equal(part.numbers[name], x) for part in others)
    ]
    return f"{words} ({', '.join(shared)})" if shared else words


def _numbers(part: eqx.Module | dict) -> dict[str, np.ndarray]:
    """The numbers of a part and of its fields, by name.

    Omitted are long arrays, units of the equations, and numbers that are 0 by default: a phase, an
    anchor at the origin.
    """
    if isinstance(part, dict):
        named = [(str(key), x) for key, x in part.items()]
    else:
        shown = [f for f in dataclasses.fields(part) if UNIT not in f.metadata]
        named = [(f.name, getattr(part, f.name)) for f in shown]
        none = {f.name for f in dataclasses.fields(part) if _is_zero(f.default)}
        named = [(name, x) for name, x in named if not (name in none and _is_zero(x))]
    found, entries = {}, part.parameter_names() if isinstance(part, System) else {}
    for name, x in named:
        if isinstance(x, MaterialPoints):
            found |= _inertia(x)
        elif name in entries and eqx.is_array(x) and x.size <= _MOST:
            found |= dict(zip(entries[name], np.ravel(x), strict=True))
        elif isinstance(x, eqx.Module | dict):
            found |= _numbers(x)
        elif eqx.is_array(x) and x.size <= _MOST:
            found[name] = np.asarray(x)
    return found


def _is_zero(x: Any) -> bool:
    numeric = isinstance(x, float | int | tuple | np.ndarray) or eqx.is_array(x)
    return bool(numeric and np.size(x) and not np.any(x))


def _inertia(matter: MaterialPoints) -> dict[str, np.ndarray]:
    """Mass, principal moments about the centre of mass, and that centre if it is not at 0."""
    centred = about_centre(matter)
    centre = np.asarray(matter.r - centred.r)[0]
    found = {
        "m": np.sum(matter.m),
        "moments": np.linalg.eigvalsh(inertia_matrix(centred)),
    }
    away = np.abs(centre).max() > _AT_ORIGIN * np.abs(matter.r).max()
    return found | ({"centre": centre} if away else {})


def _text_of(x) -> str:
    """The text of one or a few numbers, with four digits."""
    values = ", ".join(f"{value:.4g}" for value in np.ravel(x))
    return f"({values})" if np.size(x) > 1 else values
