"""A scene as a program for browsers: its rate and all that a page draws of it, in JavaScript.

The functions take the time, the state and the parameters of the scene, so that all of these can be
changed while it runs. An effect that is switched off is absent, as it is from a scene without it:
there is a rate for each choice of effects.

Of a shape with many corners only so many are computed from the state as determine the others, which
are sums of these with fixed weights: of a body that moves in the plane three, in space four.
"""

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
from jaxdyn._text.tables import unit_of
from jaxdyn.analysis.momenta import angular_momentum_about, centre_of_mass
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.player.choices import Ask, Choices, starts, starts_together
from jaxdyn.player.pages import embed
from jaxdyn.scene import Scene, check_scene
from jaxdyn.scenes.corners import has_corners, phases_of
from jaxdyn.symbolic.code import code
from jaxdyn.symbolic.parameters import leaves, parameters, rebuild
from jaxdyn.symbolic.symbols import places
from jaxdyn.system import Effect, Points, System

#: Effects up to which each can be switched by itself: there are two to this power rates.
_MOST_SWITCHED = 4
#: Of the size of a shape: its corners follow from some of them to this share.
_FOLLOWS = 1e-9
_SAMPLES = 16  # states and parameters at which that is tried
#: What may change sides in a rate.
_CONDITIONS = re.compile(r"\?|%|Math\.(?:sign|floor|ceil|max|min)\(")
_PARAMETER = re.compile(r"\bp\[(\d+)\]")
_REMEDY = "Play a computed motion instead: jaxdyn.simulate(scene).play(path)."


class Outline(NamedTuple):
    """A shape of a page.

    Attributes:
      kind: as of a `sketch.Shape`.
      lines: of several corners each.
      corners: of each line.
      computed: which of all its corners are computed.
      weights: (corners, computed) of the computed ones in all; None where all are.
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
    """A scene as an object of JavaScript, of which at first so many motions run.

    Its functions take (t, y, p). `variants` has one scene for each choice of effects, in the order
    of the binary numbers whose digits say which are on: its `energies`, and its `phases`, each with
    its `rate`, its exits, and `consistent`, the nearest state on the constraints, or null. `places`
    are those of the marked points and then of the computed corners of the shapes; `forces` are the
    material points and then the force of each effect on each of them, `spin` the angular momentum
    about the origin, the mass centre, and the angular momentum about it, or null each. The rest is
    data.

    Args:
      scene: the scene.
      motions: how many run at first.
      choices: scenes to choose from, or to run beside each other; the scene alone by default.
      asks: questions that stand beside it.
    Raises:
      ValueError: the scene is invalid, or its rate, or what ends a phase of it, has no formulas.
    """
    scene = check_scene(scene)
    outlines, marks, drawn = _drawing(scene)
    switches = _switches(scene)
    corners = _corners(scene)
    variants = [_variant(scene, off, corners) for off in _choices_of(switches)]
    rough = any(_CONDITIONS.search(text) for text in _functions([v["phases"] for v in variants]))
    found = {
        "data": _data(scene, marks, outlines)
        | {
            "switches": [{"name": name, "effects": list(of)} for name, of in switches]
            + [{"name": name, "effects": []} for name in corners],
            "rough": rough,
            "motions": motions,
        }
        | _offers(scene, choices or Choices({"": scene}), asks),
        "variants": variants,
        "places": _javascript(scene, drawn),
        "forces": _javascript(scene, _forces) if any(map(_pulls, scene.effects)) else None,
        "spin": _spin(scene),
        "consistent": None if has_corners(scene) else _consistent(scene, frozenset(), ""),
    }
    used = set(_PARAMETER.findall("".join(_functions(found))))
    for i, one in enumerate(found["data"]["parameters"]):
        one["used"] = str(i) in used
    functions: dict[str, int] = {}
    text = _expression(found, functions)
    return f"((f) => ({text}))([\n{','.join(functions)}])"


def _expression(found: Any, functions: dict[str, int]) -> str:
    """Data in JavaScript; each function is written once, with its number in `functions`."""
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
    """What a page says and draws of a scene."""
    return {
        "name": _text.title_of(scene),
        "entries": _entries(scene),
        "span": float(scene.t1),
        "second": _text.second(scene.labels()),
        "joule": _text.joule(scene.labels()),
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
    # Without the comments: names are a user's, and may contain anything.
    lines = source.splitlines()
    return Function("\n".join(line for line in lines if not line.startswith("  // ")))


def _names(scene: Scene) -> list[str]:
    """A name for each effect: its class, with a number where there are several."""
    kinds = [type(effect).__name__ for effect in scene.effects]
    return [
        f"{kind} {kinds[: i + 1].count(kind)}" if kinds.count(kind) > 1 else kind
        for i, kind in enumerate(kinds)
    ]


def _words(name: str) -> str:
    """The name of a class as words."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.strip("_")).lower()


def _switches(scene: Scene) -> list[tuple[str, tuple[int, ...]]]:
    """Which effects can be switched off: words and the effects, one each, or of many a kind."""
    if len(scene.effects) <= _MOST_SWITCHED:
        return [(_words(name), (i,)) for i, name in enumerate(_names(scene))]
    alike: dict[str, list[int]] = {}
    for i, effect in enumerate(scene.effects):
        alike.setdefault(_words(type(effect).__name__), []).append(i)
    found = [(words, tuple(places)) for words, places in alike.items()]
    return found if len(found) <= _MOST_SWITCHED else []


def _corners(scene: Scene) -> list[str]:
    """Which exits of phases can be switched off: what they are called."""
    exits = [way for phase in _phases(scene).values() for way in phase.exits]
    return [name for name in dict.fromkeys(way.event.called for way in exits) if name]


def _choices_of(switches: list[tuple[str, tuple[int, ...]]]) -> Iterator[frozenset[int]]:
    """The effects that are off, for each choice of what is switched on."""
    for on in range(2 ** len(switches)):
        off = (effects for s, (_, effects) in enumerate(switches) if not on >> s & 1)
        yield frozenset(itertools.chain.from_iterable(off))


def _without(scene: Scene, off: frozenset[int]) -> Scene:
    """A scene without some of its effects."""
    kept = tuple(effect for i, effect in enumerate(scene.effects) if i not in off)
    return Scene(scene.system, kept, y0=scene.y0, t1=scene.t1, name=scene.name)


def _variant(scene: Scene, off: frozenset[int], corners: list[str]) -> dict[str, Any]:
    """A scene without some of its effects: its energies and its phases."""

    def energies(moved: Scene, t: Array, y: Array) -> Array:
        return _row(moved.system.energies(t, y, _without(moved, off).effects))

    return {
        "energies": _javascript(scene, energies),
        "phases": [_phase(scene, off, name, corners) for name in _phases(_without(scene, off))],
    }


def _offers(scene: Scene, choices: Choices, asks: Sequence[Ask]) -> dict[str, Any]:
    """The starts to choose from, and the questions, as data."""

    def together(of: Scene | Mapping[str, Scene] | None) -> list[dict]:
        named = of if isinstance(of, Mapping) else {"": of} if of else {}
        return starts_together(scene, named)

    return {
        "starts": starts(scene, choices.scenes, choices.notes),
        "choose": choices.choose,
        "whole": choices.whole,
        "curve": choices.curve and choices.curve._asdict(),
        "asks": [
            {"question": ask.question, "answer": ask.answer, "starts": together(ask.scenes)}
            for ask in asks
        ],
    }


def _pulls(effect: Effect) -> bool:
    return "force" in effect.acts


def _forces(scene: Scene, t: Array, y: Array) -> Array:
    r, v, m = scene.system.points(t, y)
    return _row([r, *(effect.force(t, r, v, m) for effect in scene.effects if _pulls(effect))])


def _spins(scene: Scene) -> list[str]:
    """About what there is an angular momentum; of one point it is zero about the mass centre."""
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
    """Names of the terms of the energy, whose sum is the energy."""
    energies = scene.system.energies
    n = len(jax.eval_shape(lambda y: energies(jnp.zeros(()), y, scene.effects), scene.y0))
    named = ["kinetic energy", "potential energy"]
    return named if n == len(named) else [f"term {i + 1}" for i in range(n)]


def _phases(scene: Scene) -> dict[str, Phase]:
    """The phases of the motion; a smooth one has a single one, without exits."""
    return phases_of(scene) if has_corners(scene) else {"": Phase(scene, ())}


def _phase(scene: Scene, off: frozenset[int], name: str, corners: list[str]) -> dict[str, Any]:
    """A phase of a scene without some of its effects; phases are numbered, the end is -1."""

    def phases(moved: Scene) -> dict[str, Phase]:
        return _phases(_without(moved.starting(scene.y0), off))

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
        "consistent": _consistent(scene, off, name),
        "projects": _projects(here[name].scene.system),
        "exits": [way(number) for number in range(len(here[name].exits))],
    }


def _consistent(scene: Scene, off: frozenset[int], name: str) -> Function | None:
    """The function that takes a state to the nearest one on the constraints of a phase, if any."""
    if type(_phases(_without(scene, off))[name].scene.system).project is System.project:
        return None

    def nearest(moved: Scene, t: Array, y: Array) -> Array:
        system = _phases(_without(moved.starting(scene.y0), off))[name].scene.system
        # Also where steps do not: a start that is dragged is to be on them.
        return system.nearest(t, y) if isinstance(system, Constrained) else system.project(t, y)

    return _javascript(scene, nearest)


def _projects(system: System) -> bool:
    """Whether each step ends on the constraints."""
    if isinstance(system, Constrained):
        return system.drift == "projection"
    return type(system).project is not System.project


def _drawing(scene: Scene) -> tuple[list[Outline], list[str], Callable]:
    """The shapes, the names of the marked points, and the function of all their places."""
    shapes = eqx.filter_eval_shape(scene.sketch, jnp.zeros(()), scene.y0)
    named = [shape.name for shape in shapes if shape.kind == "trace"]
    n, d = jax.eval_shape(lambda y: scene.system.points(jnp.zeros(()), y).r, scene.y0).shape
    outlines = _outlines(scene) if n else []

    def function(moved: Scene, t: Array, y: Array) -> Array:
        if not n:
            return y[:3] if len(y) <= 3 else y[:2]
        found = moved.sketch(t, y)
        marks = [shape.at for shape in found if shape.kind == "trace"]
        rest = [shape.at for shape in found if shape.kind != "trace"]
        corners = [
            at.reshape(-1, d)[np.array(outline.computed)]
            for at, outline in zip(rest, outlines, strict=True)
        ]
        return _row([*(marks or [moved.system.points(t, y).r]), *corners])

    if not n:
        return [], [""], function
    return outlines, named or [f"body {i + 1}" if n > 1 else "" for i in range(n)], function


def _outlines(scene: Scene) -> list[Outline]:
    """The shapes of a scene but its traces, with the corners that determine the others."""
    rng = np.random.default_rng(0)
    y0, p0 = np.asarray(scene.y0), parameters(scene).values
    ys = y0 + 0.3 * (1.0 + np.abs(y0)) * rng.standard_normal((_SAMPLES, len(y0)))
    ps = p0 * rng.uniform(0.8, 1.25, (_SAMPLES, len(p0)))

    @jax.jit
    @jax.vmap
    def corners(y, p):
        system, effects = rebuild(scene.field, p)
        shapes = Scene(system, effects, y0=y, t1=scene.t1).sketch(jnp.asarray(0.3), y)
        return [shape.at for shape in shapes if shape.kind != "trace"]

    kinds = [shape.kind for shape in scene.sketch(jnp.zeros(()), scene.y0) if shape.kind != "trace"]
    return [
        _outline(kind, np.asarray(at))
        for kind, at in zip(kinds, corners(jnp.asarray(ys), jnp.asarray(ps)), strict=True)
    ]


def _outline(kind: str, at: np.ndarray) -> Outline:
    """A shape by its corners (s, ..., k, d) at some states."""
    *_, k, d = at.shape
    flat = np.moveaxis(at.reshape(_SAMPLES, -1, d), 0, 1).reshape(-1, _SAMPLES * d)
    n = len(flat)
    everything = Outline(kind, n // k, k, tuple(range(n)), None)
    size = np.abs(flat).max(initial=0.0)
    if n <= d + 1 or not 0 < size < np.inf:
        return everything
    # The corners that are least dependent on those before.
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
    """Names and units of the directions, how many there are, and whether they have one scale."""
    labels = scene.labels()
    d = jax.eval_shape(lambda y: scene.system.points(jnp.zeros(()), y).r, scene.y0).shape[1]
    if not scene.has_points:
        shown = labels[:3] if len(labels) <= 3 else labels[:2]
        return {"named": [_with_unit(*one) for one in shown], "equal": len(shown) == 3}
    units = dict(labels)
    named = [_with_unit(x, units.get(x, units.get(f"{x}1", "m"))) for x in "xyz"[:d]]
    if all(unit == "1" for _, unit in labels):
        named = list("xyz"[:d])
    return {"named": named, "equal": True}


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit != "1" else name


def _entries(scene: Scene) -> list[dict]:
    return [{"name": name, "unit": "" if unit == "1" else unit} for name, unit in scene.labels()]


def _groups(scene: Scene) -> dict:
    groups = scene.field.groups
    return {"of": list(groups.of), "most": [m if np.isfinite(m) else None for m in groups.most]}


def _parameters(scene: Scene) -> list[dict]:
    """Name, label, value and unit of each parameter, and how many belong to its array."""
    units = any(unit != "1" for _, unit in scene.labels())
    found = [
        {"unit": _unit(scene, leaf.path) if units else "", "of": leaf.value.size}
        for leaf in leaves(scene.field)
        for _ in range(leaf.value.size)
    ]
    known, words = parameters(scene), [_words(name) for name in _names(scene)]
    at = (place for leaf in leaves(scene.field) for place in places(leaf))
    return [
        {"name": name, "label": _label(name, place, words), "value": float(value), **one}
        for name, place, value, one in zip(known.names, at, known.values, found, strict=True)
    ]


def _label(name: str, place: str, effects: list[str]) -> str:
    """A parameter as people call it: that of an effect with the words for this in front.

    Its place in an array is counted from 1, or it is the name of an axis: `m 2`, `at 1, x`.
    """
    stem = re.sub(r"^effects\[(\d+)\]\.", lambda found: f"{effects[int(found[1])]}: ", name)
    stem = re.sub(r"\[[\d,]*\]$", "", stem)
    return f"{stem} {re.sub(r'(?=[xyz])', ', ', place).lstrip(', ')}".rstrip()


def _unit(scene: Scene, path: tuple[str, ...]) -> str:
    """The unit of a parameter, from the docstring of the class that has it; "" if it says none."""
    owner: Any = scene.field
    unit = ""
    for part in path:
        if part.startswith("["):
            owner = owner[int(part[1:-1])]
        elif isinstance(owner, dict):
            owner = owner[part]
        else:
            unit, owner = unit_of(type(owner), part), getattr(owner, part)
    return "" if unit == "1" else unit
