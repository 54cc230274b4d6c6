"""A scene as a program for browsers: its rate and its drawing, in JavaScript.

The functions take the time, the state and the parameters of the scene, so that all of these can be
changed while it runs. An effect that is switched off is absent, as in a scene without it: there is
a rate for each combination of effects.

For a shape with many corners, only as many are computed from the state as determine the others,
which are sums of these with fixed weights: three for a body in the plane, four in space.
"""

import dataclasses
import itertools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn.analysis.momenta import angular_momentum_about, centre_of_mass
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.plan import plan_of
from jaxdyn.player.choices import Ask, Choices, starts, starts_together
from jaxdyn.player.pages import embed
from jaxdyn.scene import Scene, check_scene
from jaxdyn.scenes.corners import has_corners, phases_of
from jaxdyn.sketch import NAMED
from jaxdyn.symbolic.code import code
from jaxdyn.symbolic.parameters import (
    Leaf,
    descriptions,
    leaves,
    parameters,
    rebuild,
    with_parameters,
)
from jaxdyn.symbolic.symbols import is_of_user, places
from jaxdyn.system import Effect, Points, System

#: Up to this many effects have switches of their own; the number of rates is two to this power.
_MOST_SWITCHED = 4
#: Relative to the size of a shape: how accurately its corners must follow from some of them.
_FOLLOWS = 1e-9
_SAMPLES = 16  # states and parameters at which that is tested
#: The conditions of a rate.
_CONDITIONS = re.compile(r"\?|%|Math\.(?:sign|floor|ceil|max|min)\(")
_PARAMETER = re.compile(r"\bp\[(\d+)\]")
#: How a check words the bound of a number.
_BOUND = re.compile(r"expected (> 0|>= 0|between 0 and 1)")
_REMEDY = "Play a computed motion instead: jaxdyn.simulate(scene).play(path)."


class Outline(NamedTuple):
    """A shape of a page.

    Attributes:
      kind: kind of the `sketch.Shape`.
      lines: number of lines, of several corners each.
      corners: number of corners of each line.
      computed: the corners that are computed.
      weights: (corners, computed) weights of the computed corners in all; None if all are computed.
    """

    kind: str
    lines: int
    corners: int
    computed: tuple[int, ...]
    weights: np.ndarray | None


class Function(str):
    """The text of a function in JavaScript."""


def model(
    scene: Scene, motions: int = 1, choices: Choices | None = None, asks: Sequence[Ask] = ()
) -> str:
    """A scene as an object in JavaScript, with the number of motions that run at first.

    Its functions take (t, y, p). `variants` has one scene for each combination of effects, in the
    order of the binary numbers whose digits say which are on: its `energies`, and its `phases`,
    each with its `rate`, its exits, `consistent`, the nearest state on the constraints, or null,
    and `outcomes`, of its conditions on time alone, or null. `places` returns the positions of the
    marked points, followed by those of the computed corners of the shapes. `forces` returns the
    material points, followed by the force of each effect on each of them. `spin` returns the
    angular momentum about the origin, the mass centre, and the angular momentum about it, or null
    for each. The rest is data.

    Args:
      scene: the scene.
      motions: number of motions that run at first.
      choices: scenes to select from, or to run side by side; only the scene itself by default.
      asks: questions beside it.
    Raises:
      ValueError: the scene is invalid, or its rate or an exit of a phase has no formulas.
    """
    scene, choices = check_scene(scene), choices or Choices({"": scene})
    outlines, marks, drawn = _drawing(scene)
    switches = _switches(scene)
    corners, phases = _corners(scene), _phases(scene)
    variants = [_variant(scene, off, corners, choices.ends) for off in _choices_of(switches)]
    rough = any(_CONDITIONS.search(text) for text in _functions([v["phases"] for v in variants]))
    found = {
        "data": _data(scene, marks, outlines)
        | {
            "switches": [{"name": name, "effects": list(of)} for name, of in switches]
            + [{"name": name, "effects": []} for name in corners],
            "rough": rough,
            "motions": motions,
        }
        | _offers(scene, choices, asks),
        "variants": variants,
        "places": _javascript(scene, drawn),
        "forces": _javascript(scene, _forces) if any(map(_pulls, scene.effects)) else None,
        "spin": _spin(scene),
        # A start off the constraints of one of several phases belongs to another one.
        "consistent": _consistent(scene, frozenset(), *phases) if len(phases) == 1 else None,
    }
    used = set(_PARAMETER.findall("".join(_functions(found))))
    for i, one in enumerate(found["data"]["parameters"]):
        one["used"] = str(i) in used
        one["bound"] = _bound(scene, i) if one["used"] else ""
    functions: dict[str, int] = {}
    text = _expression(found, functions)
    return f"((f) => ({text}))([\n{','.join(functions)}])"


def _expression(found: Any, functions: dict[str, int]) -> str:
    """Data in JavaScript; each function is written once, under its number in `functions`."""
    if isinstance(found, Function):
        return f"f[{functions.setdefault(found, len(functions))}]"
    if isinstance(found, dict):
        parts = (f"{embed(key)}: {_expression(x, functions)}" for key, x in found.items())
        return "{" + ", ".join(parts) + "}"
    if isinstance(found, list | tuple):
        return "[" + ", ".join(_expression(x, functions) for x in found) + "]"
    return embed(found)


def _functions(found: Any) -> Iterator[Function]:
    """The functions in some data."""
    if isinstance(found, Function):
        yield found
    elif isinstance(found, dict | list):
        for one in found.values() if isinstance(found, dict) else found:
            yield from _functions(one)


def _data(scene: Scene, marks: list[str], outlines: list[Outline]) -> dict[str, Any]:
    """The texts and the drawing of a scene, as data."""
    return {
        "name": _text.title_of(scene),
        "entries": _entries(scene),
        "span": float(scene.t1),
        "second": _text.second(scene.labels()),
        "joule": scene.in_units("J"),
        "parameters": _parameters(scene),
        "groups": _groups(scene),
        "terms": _terms(scene),
        "marks": marks,
        "forces": [
            {"name": _words(name), "effect": i}
            for i, (name, effect) in enumerate(zip(_names(scene), scene.effects, strict=True))
            if _pulls(effect)
        ],
        "spins": _spins(scene),
        "axes": _axes(scene),
        "shapes": [_shape(outline) for outline in outlines],
        "singular": scene.singular,
    }


def _javascript(scene: Scene, of: Callable[[Scene, Array, Array], Array]) -> Function:
    """A function of a scene in JavaScript."""
    try:
        source = code(scene, "javascript", of=of, name="f")
    except ValueError as error:
        what = str(error).partition(", got ")[2] or str(error)
        raise _checks.fail("live", "a scene with formulas", what.rstrip("."), _REMEDY) from error
    # Without comments, since names come from the user and may contain anything.
    lines = source.splitlines()
    return Function("\n".join(line for line in lines if not line.startswith("  // ")))


def _names(scene: Scene) -> list[str]:
    """A name for each effect: its class, with a number if there are several."""
    kinds = [type(effect).__name__ for effect in scene.effects]
    return [
        f"{kind} {kinds[: i + 1].count(kind)}" if kinds.count(kind) > 1 else kind
        for i, kind in enumerate(kinds)
    ]


def _words(name: str) -> str:
    """The name of a class as words."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.strip("_")).lower()


def _switches(scene: Scene) -> list[tuple[str, tuple[int, ...]]]:
    """The switches of effects: a name and the effects, one each, or a kind if there are many."""
    if len(scene.effects) <= _MOST_SWITCHED:
        return [(_words(name), (i,)) for i, name in enumerate(_names(scene))]
    alike: dict[str, list[int]] = {}
    for i, effect in enumerate(scene.effects):
        alike.setdefault(_words(type(effect).__name__), []).append(i)
    found = [(words, tuple(places)) for words, places in alike.items()]
    return found if len(found) <= _MOST_SWITCHED else []


def _corners(scene: Scene) -> list[str]:
    """The names of the exits of phases that can be switched off."""
    exits = [way for phase in _phases(scene).values() for way in phase.exits]
    return [name for name in dict.fromkeys(way.event.called for way in exits) if name]


def _choices_of(switches: list[tuple[str, tuple[int, ...]]]) -> Iterator[frozenset[int]]:
    """The effects that are off, for each combination of switches."""
    for on in range(2 ** len(switches)):
        off = (effects for s, (_, effects) in enumerate(switches) if not on >> s & 1)
        yield frozenset(itertools.chain.from_iterable(off))


def _without(scene: Scene, off: frozenset[int]) -> Scene:
    """A scene without some of its effects."""
    kept = tuple(effect for i, effect in enumerate(scene.effects) if i not in off)
    return dataclasses.replace(scene, effects=kept)


def _variant(
    scene: Scene, off: frozenset[int], corners: list[str], ends: Event | None
) -> dict[str, Any]:
    """A scene without some of its effects: its energies and its phases."""
    names = _phases(_without(scene, off))

    def energies(moved: Scene, t: Array, y: Array) -> Array:
        return _row(moved.system.energies(t, y, _without(moved, off).effects))

    return {
        "energies": _javascript(scene, energies),
        "phases": [_phase(scene, off, name, corners, ends) for name in names],
    }


def _offers(scene: Scene, choices: Choices, asks: Sequence[Ask]) -> dict[str, Any]:
    """The initial states to select from, and the questions, as data."""

    def together(of: Scene | Mapping[str, Scene] | None) -> list[dict]:
        named = of if isinstance(of, Mapping) else {"": of} if of else {}
        return starts_together(scene, named)

    return {
        "starts": starts(scene, choices.scenes, choices.notes),
        "choose": choices.choose,
        "whole": choices.whole,
        "curve": choices.curve and choices.curve._asdict(),
        "special": [[i, label] for i, label in choices.special.items()],
        "asks": [
            {"question": ask.question, "answer": ask.answer, "starts": together(ask.scenes)}
            for ask in asks
        ],
    }


def _pulls(effect: Effect) -> bool:
    return "force" in effect.acts


def _forces(scene: Scene, t: Array, y: Array) -> Array:
    r, v, m = scene.system.points(t, y)
    at = scene.system.places(t, y)
    return _row([at, *(effect.force(t, r, v, m) for effect in scene.effects if _pulls(effect))])


def _spins(scene: Scene) -> list[str]:
    """The points of reference of angular momenta; a single point has none about the centre."""
    n, d = jax.eval_shape(lambda y: scene.system.points(jnp.zeros(()), y).r, scene.y0).shape
    return ["origin", "mass centre"][: min(n, 2)] if d > 1 else []


def _spin(scene: Scene) -> Function | None:
    """The angular momentum about the origin, the mass centre, and the momentum about that."""
    if not _spins(scene):
        return None

    def momenta(moved: Scene, t: Array, y: Array) -> Array:
        about = [(_origin, "absolute"), (centre_of_mass, "relative")]
        first, second = (angular_momentum_about(moved, t, y, *one) for one in about)
        return _row([first, centre_of_mass(t, moved.points(t, y)), second])

    return _javascript(scene, momenta)


def _origin(t: Array, points: Points) -> Array:
    del t
    return jnp.zeros(points.r.shape[1])


def _row(parts) -> Array:
    return jnp.concatenate([jnp.zeros(0), *(jnp.ravel(jnp.asarray(part, float)) for part in parts)])


def _terms(scene: Scene) -> list[str]:
    """The names of the terms whose sum is the energy."""
    energies = scene.system.energies
    n = len(jax.eval_shape(lambda y: energies(jnp.zeros(()), y, scene.effects), scene.y0))
    named = ["kinetic energy", "potential energy"]
    return named if n == len(named) else [f"term {i + 1}" for i in range(n)]


def _phases(scene: Scene, ends: Event | None = None) -> dict[str, Phase]:
    """The phases of the motion; a smooth motion has one, with at most one exit."""
    exits = () if ends is None else (Exit(ends, END),)
    return phases_of(scene) if has_corners(scene) else {"": Phase(scene, exits)}


def _phase(
    scene: Scene, off: frozenset[int], name: str, corners: list[str], ends: Event | None
) -> dict[str, Any]:
    """A phase of a scene without some of its effects; phases are numbered, and the end is -1."""

    def phases(moved: Scene) -> dict[str, Phase]:
        return _phases(_without(moved.starting(scene.y0), off), ends)

    here = phases(scene)
    order = list(here)

    def way(number: int) -> dict[str, Any]:
        known = here[name].exits[number]

        def javascript(of: Callable[[Exit, Phase, Array, Array], Any]) -> Function:
            def function(moved: Scene, t: Array, y: Array) -> Array:
                phase = phases(moved)[name]
                return _row(of(phase.exits[number], phase, t, y))

            return _javascript(scene, function)

        def slope(way: Exit, phase: Phase, t: Array, y: Array) -> tuple[Array]:
            moves = jnp.ones_like(t), phase.scene.rate(t, y)
            return (jax.jvp(way.event.value, (t, y), moves)[1],)

        def choice(way: Exit, phase: Phase, t: Array, y: Array) -> tuple[Array]:
            assert way.choose is not None
            return (way.choose(t, y),)

        return {
            "direction": known.event.direction,
            "side": known.side,
            "switch": corners.index(known.event.called) if known.event.called else -1,
            "to": [-1 if to == END else order.index(to) for to in known.names],
            "value": javascript(lambda way, phase, t, y: (way.event.value(t, y),)),
            "slope": javascript(slope),
            "after": javascript(lambda way, phase, t, y: (way.lasts(t, y), way.change(t, y))),
            "choose": known.choose and javascript(choice),
        }

    return {
        "name": name,
        "rate": _javascript(scene, lambda moved, t, y: phases(moved)[name].scene.rate(t, y)),
        "outcomes": _outcomes(scene, lambda moved: phases(moved)[name].scene),
        "consistent": _consistent(scene, off, name),
        "projects": _projects(here[name].scene.system),
        "exits": [way(number) for number in range(len(here[name].exits))],
    }


def _outcomes(scene: Scene, phase: Callable[[Scene], Scene]) -> Function | None:
    """The outcomes of the conditions on time alone in the rate of a phase, if there are any."""

    def outcomes(moved: Scene, t: Array, y: Array) -> Array:
        field = phase(moved).field
        return plan_of(field, len(y)).time_conditions(field, t, None).outcomes

    here = plan_of(phase(scene).field, len(scene.y0))
    return _javascript(scene, outcomes) if here.of_time.any() else None


def _consistent(scene: Scene, off: frozenset[int], name: str) -> Function | None:
    """The function that maps a state to the nearest one on the constraints of a phase, if any."""
    if type(_phases(_without(scene, off))[name].scene.system).project is System.project:
        return None

    def nearest(moved: Scene, t: Array, y: Array) -> Array:
        system = _phases(_without(moved.starting(scene.y0), off))[name].scene.system
        # Also if steps are not projected, since a start that is dragged has to be on them.
        return system.nearest(t, y) if isinstance(system, Constrained) else system.project(t, y)

    return _javascript(scene, nearest)


def _projects(system: System) -> bool:
    """Whether each step ends on the constraints."""
    if isinstance(system, Constrained):
        return system.drift == "projection"
    return type(system).project is not System.project


def _drawing(scene: Scene) -> tuple[list[Outline], list[str], Callable]:
    """The shapes, the names of the marked points, and the function for all their positions."""
    shapes = eqx.filter_eval_shape(scene.sketch, jnp.zeros(()), scene.y0)
    named = [shape.name for shape in shapes if shape.kind == "trace"]
    n, d = jax.eval_shape(lambda y: scene.system.points(jnp.zeros(()), y).r, scene.y0).shape
    outlines = _outlines(scene) if n else []

    def function(moved: Scene, t: Array, y: Array) -> Array:
        if not n:
            return y[:3] if len(y) <= 3 else y[:2]
        found = moved.sketch(t, y)
        marks = [shape.at for shape in found if shape.kind == "trace"]
        rest = [shape.at for shape in found if shape.kind not in NAMED]
        corners = [
            at.reshape(-1, d)[np.array(outline.computed)]
            for at, outline in zip(rest, outlines, strict=True)
        ]
        return _row([*(marks or [moved.system.places(t, y)]), *corners])

    if not n:
        return [], [""], function
    return outlines, named or ([*scene.point_names] if n > 1 else [""]), function


def _outlines(scene: Scene) -> list[Outline]:
    """The shapes of a scene that have outlines, with the corners that determine the others."""
    rng = np.random.default_rng(0)
    y0, p0 = np.asarray(scene.y0), parameters(scene).values
    ys = y0 + 0.3 * (1.0 + np.abs(y0)) * rng.standard_normal((_SAMPLES, len(y0)))
    ps = p0 * rng.uniform(0.8, 1.25, (_SAMPLES, len(p0)))

    @jax.jit
    @jax.vmap
    def corners(y, p):
        system, effects = rebuild(scene.field, p)
        shapes = Scene(system, effects, y0=y, t1=scene.t1).sketch(jnp.asarray(0.3), y)
        return [shape.at for shape in shapes if shape.kind not in NAMED]

    shapes = scene.sketch(jnp.zeros(()), scene.y0)
    kinds = [shape.kind for shape in shapes if shape.kind not in NAMED]
    return [
        _outline(kind, np.asarray(at))
        for kind, at in zip(kinds, corners(jnp.asarray(ys), jnp.asarray(ps)), strict=True)
    ]


def _outline(kind: str, at: np.ndarray) -> Outline:
    """A shape from its corners (s, ..., k, d) at some states."""
    *_, k, d = at.shape
    flat = np.moveaxis(at.reshape(_SAMPLES, -1, d), 0, 1).reshape(-1, _SAMPLES * d)
    n = len(flat)
    everything = Outline(kind, n // k, k, tuple(range(n)), None)
    size = np.abs(flat).max(initial=0.0)
    if n <= d + 1 or not 0 < size < np.inf:
        return everything
    # Choose the corners that depend least on those chosen before.
    factors: Any = scipy.linalg.qr(flat.T, mode="economic", pivoting=True)
    _, triangle, order = factors
    sizes = np.abs(np.diag(triangle))
    rank = int((sizes > _FOLLOWS * sizes[0]).sum())
    if rank > d + 1:
        return everything
    computed = np.sort(order[:rank])
    weights = np.linalg.lstsq(flat[computed].T, flat.T, rcond=None)[0].T
    return Outline(kind, n // k, k, tuple(computed.tolist()), weights)


def _shape(outline: Outline) -> dict:
    """A shape as data."""
    weights = None if outline.weights is None else np.round(outline.weights, 9).tolist()
    return {
        "kind": outline.kind,
        "lines": outline.lines,
        "corners": outline.corners,
        "computed": len(outline.computed),
        "weights": weights,
    }


def _axes(scene: Scene) -> dict:
    """Names and units of the axes, their number, and whether they have equal scales."""
    labels = scene.labels()
    d = jax.eval_shape(lambda y: scene.system.points(jnp.zeros(()), y).r, scene.y0).shape[1]
    if not scene.has_points:
        shown = labels[:3] if len(labels) <= 3 else labels[:2]
        return {"named": [_with_unit(*one) for one in shown], "equal": len(shown) == 3}
    units = dict(labels)
    length = scene.in_units("m")
    named = [_with_unit(x, units.get(x, units.get(f"{x}1", length))) for x in "xyz"[:d]]
    if all(unit == "1" for _, unit in labels):
        named = list("xyz"[:d])
    return {"named": named, "equal": True}


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit != "1" else name


def _entries(scene: Scene) -> list[dict]:
    return [{"name": name, "unit": "" if unit == "1" else unit} for name, unit in scene.labels()]


def _groups(scene: Scene) -> dict:
    groups = scene.field.groups
    return {
        "of": list(groups.group_of),
        "most": [m if np.isfinite(m) else None for m in groups.most],
    }


def _parameters(scene: Scene) -> list[dict]:
    """Name, label, value, unit and meaning of each parameter, and the size of its array."""
    found = [
        {**one._asdict(), "of": leaf.value.size}
        for leaf in leaves(scene.field)
        for one in descriptions(scene, leaf)
    ]
    known, words = parameters(scene), [_words(name) for name in _names(scene)]
    at = ((leaf, place) for leaf in leaves(scene.field) for place in places(leaf))
    return [
        {"name": name, "label": _label(name, leaf, place, words), "value": float(value), **one}
        for name, (leaf, place), value, one in zip(
            known.names, at, known.values, found, strict=True
        )
    ]


def _bound(scene: Scene, i: int) -> str:
    """The bound of a parameter, in the words by which a negative one is refused; "" for none."""
    values = parameters(scene).values.copy()
    values[i] = -abs(values[i]) or -1.0
    try:
        with_parameters(scene, values).check()
    except ValueError as error:
        found = _BOUND.search(str(error))
        return found[1] if found else ""
    return ""


def _label(name: str, leaf: Leaf, place: str, effects: list[str]) -> str:
    """The label of a parameter: the name of its effect, if any, in front.

    Its place in an array is counted from 1, or it is the name of an axis: `m 2`, `at 1, x`. Of
    numbers in the `params` of a user it is that of Python: `params[1]`.
    """
    if is_of_user(leaf):
        return name
    stem = re.sub(r"^effects\[(\d+)\]\.", lambda found: f"{effects[int(found[1])]}: ", name)
    stem = re.sub(r"\[[\d,]*\]$", "", stem) if leaf.value.ndim else stem
    return f"{stem} {re.sub(r'(?=[xyz])', ', ', place).lstrip(', ')}".rstrip()
