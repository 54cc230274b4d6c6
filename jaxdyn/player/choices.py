"""Alternatives and questions on a page on which a scene runs: initial states and parameters.

The scenes of a page share its formulas and differ in the numbers that these take. Scenes with the
same functions do so by construction; those whose functions were made anew, such as a lambda in the
function that makes them, do if the same formulas are read from them.
"""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_kind
from jaxdyn._records import PASS_AS_PARAMS, notes_on
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory, single
from jaxdyn.scene import Effect, Scene, check_scene
from jaxdyn.scenes.corners import has_corners
from jaxdyn.symbolic.code import code
from jaxdyn.symbolic.parameters import parameters

_PLAYED = "Play it: motion.play(path)."
_ONE_KIND = "scenes that differ in their numbers, their starts and in effects left out"
_APART = "Put it on a page of its own."


class Ask(NamedTuple):
    """A question beside a running scene, with its answer folded.

    Attributes:
      question: such as "What happens when it starts upright?"
      answer: the answer.
      scenes: the same scene with the initial state and parameters that show it, or several by name
        to run side by side, perhaps without some effects; None if the page itself shows it.
    """

    question: str
    answer: str
    scenes: Scene | Mapping[str, Scene] | None = None


class Curve(NamedTuple):
    """Two numbers for each of several scenes, as points of a plot in which one is selected.

    Attributes:
      labels: labels of the horizontal and the vertical axis, with units.
      across: (n) horizontal coordinates.
      up: (n) vertical coordinates.
      kinds: (n) words that determine the colours.
    """

    labels: tuple[str, str]
    across: Sequence[float]
    up: Sequence[float]
    kinds: Sequence[str]


class Choices(NamedTuple):
    """Scenes of one kind, selected by a slider or running side by side.

    Attributes:
      scenes: scenes by name.
      choose: the parameter whose values are the names, with its unit; empty if all run together.
      notes: a remark on each; () for none.
      whole: whether the path of each over its span is drawn at once, as for an orbit.
      curve: a plot to select from, or None.
      ends: an event that ends each of the motions, which are smooth, such as landing; or None.
      special: labels of the scenes that are marked at the slider, by their number.
    """

    scenes: Mapping[str, Scene]
    choose: str = ""
    notes: Sequence[str] = ()
    whole: bool = False
    curve: Curve | None = None
    ends: Event | None = None
    special: Mapping[int, str] = MappingProxyType({})


def complete(choices: Choices) -> Scene:
    """The first of the scenes with the most effects; the others may lack some of these.

    Raises:
      ValueError: there are no scenes, one is invalid, they are not of one kind, or scenes that run
        together lack different effects.
    """
    if not choices.scenes:
        raise _checks.fail("scenes", "at least one scene", "none")
    scenes = [check_scene(scene) for scene in choices.scenes.values()]
    whole = max(scenes, key=lambda scene: len(scene.effects))
    if not choices.choose:
        starts_together(whole, choices.scenes)
    return whole


def starts_together(whole: Scene, scenes: Mapping[str, Scene]) -> list[dict]:
    """The initial states of scenes that run side by side.

    Raises:
      ValueError: one is not of the kind of `whole`, or they lack different effects.
    """
    found = starts(whole, scenes)
    if any(one["off"] != found[0]["off"] for one in found):
        remedy = "Name the parameter in which they differ: choose=."
        wanted = "scenes with the same effects, to run together"
        raise _checks.fail("scenes", wanted, "different ones", remedy)
    return found


def starts(whole: Scene, scenes: Mapping[str, Scene], notes: Sequence[str] = ()) -> list[dict]:
    """The differences of scenes from another one, each with its remark."""
    said = notes or [""] * len(scenes)
    named = zip(scenes.items(), said, strict=True)
    return [start(whole, scene, name, note) for (name, scene), note in named]


def start(whole: Scene, scene: Scene, name: str, note: str = "") -> dict[str, Any]:
    """The difference of a scene from another one: start, span, parameters, effects that are off.

    Raises:
      ValueError: the scenes are not of the same kind.
    """
    off, same = _missing(whole.effects, scene.effects, _alike), _alike
    if off is None:
        off, same = _missing(whole.effects, scene.effects, _same_shape), _same_shape
    if off is None or not _same_shape(whole.system, scene.system) or len(whole.y0) != len(scene.y0):
        raise _checks.fail("scenes", _ONE_KIND, "another kind", _APART)
    given = iter(scene.effects)
    effects = [one if i in off else next(given) for i, one in enumerate(whole.effects)]
    full = Scene(scene.system, tuple(effects), y0=scene.y0, t1=scene.t1)
    if same is _same_shape or not _alike(whole.system, scene.system):
        _check_formulas(whole, full)
    return {
        "name": name,
        "note": note,
        "start": np.asarray(scene.y0).tolist(),
        "span": float(scene.t1),
        "parameters": parameters(full).values.tolist(),
        "off": sorted(off),
    }


def _missing(
    whole: Sequence[Effect], kept: Sequence[Effect], same: Callable[[Any, Any], bool]
) -> frozenset[int] | None:
    """The indices of the effects that are left out of the whole; None if others are added."""
    off, left = [], list(kept)
    for i, effect in enumerate(whole):
        if left and same(effect, left[0]):
            left.pop(0)
        else:
            off.append(i)
    return None if left else frozenset(off)


def _alike(one: Any, other: Any) -> bool:
    """Whether two objects differ only in numbers."""
    return jax.tree.structure(one) == jax.tree.structure(other) and _same_shape(one, other)


def _same_shape(one: Any, other: Any) -> bool:
    """Whether two objects of one class have as many numbers, whatever their functions are."""
    shapes, others = ([np.shape(x) for x in jax.tree.leaves(each)] for each in (one, other))
    return type(one) is type(other) and shapes == others


def _check_formulas(whole: Scene, scene: Scene) -> None:
    """Raise ValueError if a page of one scene does not show another one, with its parameters."""
    if whole.labels() == scene.labels() and _formulas(whole) == _formulas(scene):
        return
    then, now = _captured(whole), _captured(scene)
    changed = [name for name in then if then[name] != now.get(name)]
    if not changed or then.keys() != now.keys():
        raise _checks.fail("scenes", _ONE_KIND, "other formulas", _APART)
    expected = "functions that captured the same numbers"
    got = f"another value of {', '.join(map(repr, changed))}"
    raise _checks.fail("scenes", expected, got, PASS_AS_PARAMS)


def _formulas(scene: Scene) -> list[str]:
    """What a page evaluates, with the parameters as inputs: rate, energies, shapes."""
    notes = notes_on(scene)
    if notes is not None and _formulas in notes:
        return notes[_formulas]

    def energies(moved: Scene, t: Array, y: Array) -> Array:
        return _row(y, moved.system.energies(t, y, moved.effects))

    def shapes(moved: Scene, t: Array, y: Array) -> Array:
        return _row(y, [shape.at for shape in moved.sketch(t, y)])

    found = [code(scene, "javascript", of=of) for of in (Scene.rate, energies, shapes)]
    if notes is not None:
        notes[_formulas] = found
    return found


def _row(y: Array, parts: Sequence[Array]) -> Array:
    return jnp.concatenate([y[:0], *map(jnp.ravel, parts)])


def _captured(scene: Scene) -> dict[str, list[bytes]]:
    """Digests of the numbers that the functions of a scene captured, by their names."""
    found: dict[str, list[bytes]] = {}
    for part in (scene.system, *scene.effects):
        for name, digest in part.captured or ():
            found.setdefault(name, []).append(digest)
    return found


def of_motions(motions: Mapping[str, Any], choose: str, ends: Event | None) -> Choices:
    """The scenes of computed motions, with their initial states and spans.

    Args:
      motions: results of `simulate` or `simulate_phases`, by name.
      choose: as in `Choices`.
      ends: as in `Choices`.
    Raises:
      ValueError: a motion cannot run on a page: it is a batch, ended early, began at a time other
        than 0, was integrated with equal steps, or has phases that no ready-made scene has.
    """
    scenes = {name: _scene_of(one) for name, one in motions.items()}
    return Choices(scenes, choose, ends=ends)


def _scene_of(motion: Any) -> Scene:
    """The scene of a motion, with its initial state and span."""
    check_kind("motion", motion, (Trajectory, HybridTrajectory))
    pieces = pieces_of(motion)
    first, last = pieces[0], pieces[-1]
    smooth = isinstance(motion, Trajectory)
    # A smooth motion of a scene with corners ignores these, but a page would not.
    if has_corners(first.scene) == smooth:
        raise _checks.fail("motion", "all phases of a ready-made scene, if any", "others", _PLAYED)
    single(first)
    t0, t1 = float(first.ts[0]), float(last.ts[-1])
    if first.dt is not None:
        raise _checks.fail("motion", "one of controlled steps", "one of equal ones", _PLAYED)
    if not (t0 == 0 < t1 and np.isfinite(last.ys[-1]).all()):
        raise _checks.fail("motion", "one from time 0 to its end", f"{t0} to {t1}", _PLAYED)
    return first.scene.starting(first.ys[0], t1)
