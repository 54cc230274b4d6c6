"""What stands above a picture where nothing else is asked for: the scene and its numbers."""

import dataclasses
import re
import textwrap
from collections.abc import Sequence

import equinox as eqx
import numpy as np

from jaxdyn.integrate.phases import Chain, pieces_of
from jaxdyn.integrate.simulation import Trajectory
from jaxdyn.scene import Scene

_CHARACTER = 0.078  # inches of a title in 10 points
_KEPT = "\0=\0"
_MOST = 4  # entries of an array that are still written out


def caption(motion: Trajectory | Chain) -> str:
    """What moves and what acts on it, with their numbers."""
    return describe(pieces_of(motion)[0].scene)


def heading(lines: Sequence[str], width: float) -> str:
    """The lines that say something, folded for a figure of this width [in]."""
    kept = (line.replace(" = ", _KEPT) for line in lines if line)  # not parted at its ends
    folded = "\n".join(textwrap.fill(line, int(width / _CHARACTER)) for line in kept)
    return folded.replace(_KEPT, " = ")


def describe(scene: Scene) -> str:
    """A scene in a line.

    Example:
      >>> from jaxdyn import scenes
      >>> describe(scenes.pendulum(length=2.0))
      'Stick (m = 1, l = 2), uniform gravity (g = 9.81)'
    """
    system = getattr(scene.system, "mechanism", scene.system)
    return ", ".join([_part(system), *(_part(effect).lower() for effect in scene.effects)])


def _part(module: eqx.Module) -> str:
    """The class of a part of a scene in words, with its numbers."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(module).__name__.strip("_")).capitalize()
    fields = [(field.name, getattr(module, field.name)) for field in dataclasses.fields(module)]
    numbers = [
        f"{name} = {_number(x)}" for name, x in fields if eqx.is_array(x) and x.size <= _MOST
    ]
    return f"{words} ({', '.join(numbers)})" if numbers else words


def _number(x) -> str:
    """A number or a few in four digits."""
    values = ", ".join(f"{value:.4g}" for value in np.asarray(x).ravel())
    return f"({values})" if x.size > 1 else values
