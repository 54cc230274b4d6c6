"""What a page on which a scene runs offers besides it: other starts and numbers, and questions."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxdyn import _checks
from jaxdyn._checks import check_kind
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory, single
from jaxdyn.scene import Effect, Scene, check_scene
from jaxdyn.scenes.corners import has_corners
from jaxdyn.symbolic.parameters import parameters

_PLAYED = "Play it: motion.play(path)."
_ONE_KIND = "scenes that differ in their numbers, their starts and in effects left out"


class Ask(NamedTuple):
    """A question beside a scene that runs, with its answer folded.

    Attributes:
      question: as of a course: "What happens when it starts upright?"
      answer: what does.
      scenes: the same scene with the start and the numbers that show it, or several by name to run
        beside each other, perhaps without some effects; None where the page as it stands shows it.
    """

    question: str
    answer: str
    scenes: Scene | Mapping[str, Scene] | None = None


class Curve(NamedTuple):
    """Two numbers of each scene of several, to be drawn over each other and to choose from.

    Attributes:
      labels: of the number across and of that upwards, with units.
      across: (n) of each.
      up: (n) of each.
      kinds: (n) words, each of which has a colour.
    """

    labels: tuple[str, str]
    across: Sequence[float]
    up: Sequence[float]
    kinds: Sequence[str]


class Choices(NamedTuple):
    """Scenes of one kind to choose from by a slider, or to run beside each other.

    Attributes:
      scenes: by name.
      choose: what the names are values of, with its unit; empty where all run together.
      notes: what is said of each; () for nothing.
      whole: whether the path of each over its span, that of an orbit, is drawn at once.
      curve: a picture to choose from, or None.
    """

    scenes: Mapping[str, Scene]
    choose: str = ""
    notes: Sequence[str] = ()
    whole: bool = False
    curve: Curve | None = None


def complete(choices: Choices) -> Scene:
    """The first of the scenes that has the most effects: the others lack some of these.

    Raises:
      ValueError: there is none, one is invalid, they are not of one kind, or those that run
        together lack different effects.
    """
    if not choices.scenes:
        raise _checks.fail("scenes", "at least one scene", "none")
    scenes = [check_scene(scene) for scene in choices.scenes.values()]
    whole = max(scenes, key=lambda scene: len(scene.effects))
    if not choices.choose:
        starts_together(whole, choices.scenes)
    return whole


def starts_together(
    whole: Scene, scenes: Mapping[str, Scene], notes: Sequence[str] = ()
) -> list[dict]:
    """The starts of scenes that run beside each other.

    Raises:
      ValueError: one is not of the kind of `whole`, or they lack different effects.
    """
    found = starts(whole, scenes, notes)
    if any(one["off"] != found[0]["off"] for one in found):
        remedy = "Name what they differ in: choose=."
        wanted = "scenes with the same effects, to run together"
        raise _checks.fail("scenes", wanted, "different ones", remedy)
    return found


def starts(whole: Scene, scenes: Mapping[str, Scene], notes: Sequence[str] = ()) -> list[dict]:
    """What makes scenes of another one, each with what is said of it."""
    said = notes or [""] * len(scenes)
    named = zip(scenes.items(), said, strict=True)
    return [start(whole, scene, name, note) for (name, scene), note in named]


def start(whole: Scene, scene: Scene, name: str, note: str = "") -> dict[str, Any]:
    """What makes a scene of another one: start, span, parameters, and which effects are off.

    Raises:
      ValueError: it is not of its kind.
    """
    off = _missing(whole.effects, scene.effects)
    if off is None or not _alike(whole.system, scene.system) or len(whole.y0) != len(scene.y0):
        raise _checks.fail("scenes", _ONE_KIND, "another kind", "Put it on a page of its own.")
    given = iter(scene.effects)
    effects = [one if i in off else next(given) for i, one in enumerate(whole.effects)]
    full = Scene(scene.system, tuple(effects), y0=scene.y0, t1=scene.t1)
    return {
        "name": name,
        "note": note,
        "start": np.asarray(scene.y0).tolist(),
        "span": float(scene.t1),
        "parameters": parameters(full).values.tolist(),
        "off": sorted(off),
    }


def _missing(whole: Sequence[Effect], kept: Sequence[Effect]) -> frozenset[int] | None:
    """The places of the effects that are left out of the whole; None where others are added."""
    off, left = [], list(kept)
    for i, effect in enumerate(whole):
        if left and _alike(effect, left[0]):
            left.pop(0)
        else:
            off.append(i)
    return None if left else frozenset(off)


def _alike(one: Any, other: Any) -> bool:
    """Whether two objects differ in nothing but numbers."""
    same = jax.tree.structure(one) == jax.tree.structure(other)
    sizes = ([np.shape(x) for x in jax.tree.leaves(each)] for each in (one, other))
    return same and next(sizes) == next(sizes)


def of_motions(motions: Mapping[str, Any], choose: str = "", notes: Sequence[str] = ()) -> Choices:
    """The scenes of computed motions, from their starts over their spans.

    Args:
      motions: by name, what `simulate` or `simulate_phases` returned.
      choose: as in `Choices`.
      notes: as in `Choices`.
    Raises:
      ValueError: a motion cannot run on a page: it is a batch, did not arrive, began at another
        time than 0, was integrated in equal steps, or has phases that no ready-made scene has.
    """
    return Choices({name: _scene_of(one) for name, one in motions.items()}, choose, notes)


def _scene_of(motion: Any) -> Scene:
    """The scene of a motion, with its start and span."""
    check_kind("motion", motion, (Trajectory, HybridTrajectory))
    pieces = pieces_of(motion)
    first, last = pieces[0], pieces[-1]
    smooth = isinstance(motion, Trajectory)
    # A smooth motion of a scene that has corners leaves these out, and a page would not.
    if has_corners(first.scene) == smooth:
        raise _checks.fail("motion", "all phases of a ready-made scene, if any", "others", _PLAYED)
    single(first)
    t0, t1 = float(first.ts[0]), float(last.ts[-1])
    if first.dt is not None:
        raise _checks.fail("motion", "one of controlled steps", "one of equal ones", _PLAYED)
    if not (t0 == 0 < t1 and np.isfinite(last.ys[-1]).all()):
        raise _checks.fail("motion", "one from time 0 to its end", f"{t0} to {t1}", _PLAYED)
    return Scene(
        first.scene.system, first.scene.effects, y0=first.ys[0], t1=t1, name=first.scene.name
    )
