"""A scene as a program for browsers: its rate and all that a page draws of it, in JavaScript.

The functions take the time, the state and the parameters of the scene, so that all of these can be
changed while it runs. An effect that is switched off is absent, as it is from a scene without it:
there is a rate for each choice of effects.

Of a shape with many corners only so many are computed from the state as determine the others, which
are sums of these with fixed weights: of a body that moves in the plane three, in space four.
"""

import re
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._text.tables import unit_of
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.player.pages import embed
from jaxdyn.scene import Scene, check_scene
from jaxdyn.scenes.corners import has_corners, phases_of
from jaxdyn.symbolic.code import code
from jaxdyn.symbolic.parameters import leaves, parameters, rebuild
from jaxdyn.system import Effect, System

#: Effects up to which each can be switched by itself: there are two to this power rates.
_MOST_SWITCHED = 4
#: Of the size of a shape: its corners follow from some of them to this share.
_FOLLOWS = 1e-9
_SAMPLES = 16  # states and parameters at which that is tried
#: What may change sides in a rate.
_CONDITIONS = re.compile(r"\?|%|Math\.(?:sign|floor|ceil|max|min)\(")
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


def model(scene: Scene, motions: int = 1) -> str:
    """A scene as an object of JavaScript, of which at first so many motions run.

    Its functions of (t, y, p) are `energies` and in each of the `phases` `rates`, a list of each in
    the order of the binary numbers whose digits say which switches are on, and those of the exits;
    `places`, of the marked points and then of the computed corners of the shapes; `forces`, of the
    material points and then of the force of each effect on each of them, or null; and `consistent`,
    the nearest state on the constraints, or null. The rest is data.

    Raises:
      ValueError: the scene is invalid, or its rate, or what ends a phase of it, has no formulas.
    """
    scene = check_scene(scene)
    outlines, marks, drawn = _drawing(scene)
    switches = _switches(scene)
    phases = ",".join(_phase(scene, name, switches) for name in _phases(scene))
    functions = {
        "phases": f"[{phases}]",
        "energies": f"[{','.join(_rates(scene, switches, _energies))}]",
        "places": _javascript(scene, drawn),
        "forces": _javascript(scene, _forces) if any(map(_pulls, scene.effects)) else "null",
        "consistent": "null" if has_corners(scene) else _consistent(scene, ""),
    }
    data = {
        "name": _text.title_of(scene),
        "entries": _entries(scene),
        "start": np.asarray(scene.y0).tolist(),
        "span": float(scene.t1),
        "second": _text.second(scene.labels()),
        "parameters": _parameters(scene),
        "switches": [{"name": name, "effects": list(effects)} for name, effects in switches],
        "groups": _groups(scene),
        "rough": bool(_CONDITIONS.search(phases)),
        "terms": _terms(scene),
        "marks": marks,
        "forces": [
            {"name": _words(name), "effect": i}
            for i, (name, effect) in enumerate(zip(_names(scene), scene.effects, strict=True))
            if _pulls(effect)
        ],
        "axes": _axes(scene),
        "shapes": [_shape(outline) for outline in outlines],
        "singular": scene.singular,
        "motions": motions,
    }
    parts = [f"{name}: {text}" for name, text in ({"data": embed(data)} | functions).items()]
    return "{" + ",\n".join(parts) + "}"


def _javascript(scene: Scene, of: Callable[[Scene, Array, Array], Array]) -> str:
    """A function of a scene in JavaScript."""
    try:
        source = code(scene, "javascript", of=of, name="f")
    except ValueError as error:
        what = str(error).partition(", got ")[2] or str(error)
        raise _checks.fail("live", "a scene with formulas", what.rstrip("."), _REMEDY) from error
    # Without the comments: names are a user's, and may contain anything.
    lines = source.splitlines()
    return "\n".join(line for line in lines if not line.startswith("  // "))


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
    """What can be switched off: words and the effects, one each, or of many those of a kind."""
    if has_corners(scene):
        return []  # phases may need an effect
    if len(scene.effects) <= _MOST_SWITCHED:
        return [(_words(name), (i,)) for i, name in enumerate(_names(scene))]
    alike: dict[str, list[int]] = {}
    for i, effect in enumerate(scene.effects):
        alike.setdefault(_words(type(effect).__name__), []).append(i)
    found = [(words, tuple(places)) for words, places in alike.items()]
    return found if len(found) <= _MOST_SWITCHED else []


def _rates(scene: Scene, switches: list, of: Callable) -> list[str]:
    """A function of the scene for each choice of what is switched on."""

    def chosen(on: int) -> Callable:
        off = {i for s, (_, effects) in enumerate(switches) if not on >> s & 1 for i in effects}

        def function(moved: Scene, t: Array, y: Array) -> Array:
            kept = tuple(effect for i, effect in enumerate(moved.effects) if i not in off)
            fewer = Scene(moved.system, kept, y0=moved.y0, t1=moved.t1, name=moved.name)
            return of(fewer, t, y)

        return function

    return [_javascript(scene, chosen(on)) for on in range(2 ** len(switches))]


def _energies(scene: Scene, t: Array, y: Array) -> Array:
    return _row(scene.system.energies(t, y, scene.effects))


def _pulls(effect: Effect) -> bool:
    return "force" in effect.acts


def _forces(scene: Scene, t: Array, y: Array) -> Array:
    r, v, m = scene.system.points(t, y)
    return _row([r, *(effect.force(t, r, v, m) for effect in scene.effects if _pulls(effect))])


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


def _phase(scene: Scene, name: str, switches: list) -> str:
    """A phase as an object of JavaScript."""
    here = _phases(scene)
    rates = _rates(scene, switches, lambda s, t, y: _phases(s)[name].scene.rate(t, y))
    parts = {
        "name": embed(name),
        "rates": f"[{','.join(rates)}]",
        "consistent": _consistent(scene, name),
        "projects": str(_projects(here[name].scene.system)).lower(),
        "exits": f"[{','.join(_exit(scene, name, i) for i in range(len(here[name].exits)))}]",
    }
    return "{" + ", ".join(f"{key}: {text}" for key, text in parts.items()) + "}"


def _exit(scene: Scene, name: str, number: int) -> str:
    """An exit of a phase as an object of JavaScript; phases are numbered, the end is -1."""
    order = list(_phases(scene))
    way = _phases(scene)[name].exits[number]

    def written(of: Callable[[Exit, Phase, Array, Array], Any]) -> str:
        def function(moved: Scene, t: Array, y: Array) -> Array:
            phase = _phases(moved.starting(scene.y0))[name]
            return _row([of(phase.exits[number], phase, t, y)])

        return _javascript(scene, function)

    def slope(way: Exit, phase: Phase, t: Array, y: Array) -> Array:
        moves = jnp.ones_like(t), phase.scene.rate(t, y)
        return jax.jvp(way.event.value, (t, y), moves)[1]

    choose = way.choose
    parts = {
        "direction": str(way.event.direction),
        "side": str(way.side),
        "to": str([-1 if to == END else order.index(to) for to in way.names]),
        "value": written(lambda way, phase, t, y: way.event.value(t, y)),
        "slope": written(slope),
        "change": written(lambda way, phase, t, y: way.change(t, y)),
        "lasts": written(lambda way, phase, t, y: way.lasts(t, y)),
        "choose": "null" if choose is None else written(lambda way, phase, t, y: choose(t, y)),
    }
    return "{" + ", ".join(f"{key}: {text}" for key, text in parts.items()) + "}"


def _consistent(scene: Scene, name: str) -> str:
    """The function that takes a state to the nearest one on the constraints, or "null"."""
    if type(_phases(scene)[name].scene.system).project is System.project:
        return "null"

    def nearest(moved: Scene, t: Array, y: Array) -> Array:
        system = _phases(moved)[name].scene.system
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
    return [
        {"name": name, "label": _label(name, words), "value": float(value), **one}
        for name, value, one in zip(known.names, known.values, found, strict=True)
    ]


def _label(name: str, effects: list[str]) -> str:
    """A parameter as people call it: that of an effect with the words for this in front."""
    return re.sub(r"^effects\[(\d+)\]\.", lambda found: f"{effects[int(found[1])]}: ", name)


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
