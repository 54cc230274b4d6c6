"""The kind of the first argument of public functions: a scene, a motion, an orbit, a family.

One decorator serves all of them, so that a scene given in place of an orbit is refused with what to
call first. It also notices functions whose captured numbers have changed since a scene was made.
"""

import collections.abc
import functools
import inspect
import types
import typing
from collections.abc import Callable
from typing import Any, TypeVar, cast

from jaxdyn._text import fail

_LONGEST = 60  # characters of a value in a message
F = TypeVar("F", bound=Callable)

#: What to do with what was given instead, by the names of both kinds.
_REMEDIES = {
    ("Scene", "Orbit"): "Find one first: orbits.find(scene).",
    ("Scene", "Trajectory"): "Simulate it first: jaxdyn.simulate(scene).",
    ("Scene", "Family"): "Find an orbit, then continue it: orbits.continue_family(orbit).",
    ("Scene", "EquilibriumFamily"): "Follow one: jaxdyn.continue_equilibria(make, parameter).",
    ("Scene", "Torus"): "Find an orbit, then orbits.torus(orbit).",
    ("Scene", "Manifold"): "Compute it first: orbits.manifold(scene).",
    ("Orbit", "Scene"): "Pass orbit.scene.",
    ("Orbit", "Trajectory"): "Pass orbit.trajectory().",
    ("Orbit", "Family"): "Continue it first: orbits.continue_family(orbit).",
    ("Orbit", "Torus"): "Compute one first: orbits.torus(orbit).",
    ("Orbit", "Manifold"): "Compute it first: orbits.manifold(orbit).",
    ("Orbit", "Report"): "Make one first: orbits.report(orbit).",
    ("Trajectory", "Scene"): "Pass motion.scene.",
    ("Trajectory", "Orbit"): "Find one first: orbits.find(motion.scene).",
    ("HybridTrajectory", "Trajectory"): "Pass one of motion.pieces.",
    ("HybridTrajectory", "Scene"): "Pass the scene of one of motion.pieces.",
    ("Family", "Orbit"): "Pass the orbit of one of family.members.",
    ("Family", "Scene"): "Pass the scene of an orbit of one of family.members.",
    ("SearchResult", "Orbit"): "Pass one of result.orbits.",
    ("Outcome", "Orbit"): "Pass the orbit itself.",
}


def check_first(function: F) -> F:
    """A decorator that raises ValueError unless the first argument is of the annotated kind."""
    first, *_ = inspect.signature(function).parameters.values()
    kinds, of_sequences = _kinds(first.annotation)
    several = first.kind is inspect.Parameter.VAR_POSITIONAL

    @functools.wraps(function)
    def checked(*args, **kwargs):
        if args or first.name in kwargs:
            for x in args if several else (args[0] if args else kwargs[first.name],):
                if type(x) not in kinds:
                    check_kind(first.name, x, kinds, of_sequences)
                check_functions(x)
        return function(*args, **kwargs)

    vars(checked)["first_kinds"] = (*kinds, *(of_sequences and (list, tuple)))
    return cast(F, checked)


def check_kind(name: str, x: Any, kinds: tuple[type, ...], of: tuple[type, ...] = ()) -> None:
    """Raise ValueError unless x is of one of these kinds, or a list or tuple of the kinds `of`."""
    if isinstance(x, kinds):
        return
    if of and isinstance(x, list | tuple):
        for i, one in enumerate(x):
            check_kind(f"{name}[{i}]", one, of)
        return
    wanted = " or ".join(f"{_article(kind)} {kind.__name__}" for kind in kinds or of)
    called = getattr(x, "__name__", None) if callable(x) else None
    if called:
        needs = "..." if _needs_arguments(x) else ""
        raise fail(name, wanted, called, f"Call it: {called}({needs}).")
    given = type(x).__name__
    remedies = (_REMEDIES.get((given, kind.__name__)) for kind in kinds or of)
    remedy = next(filter(None, remedies), "")
    text = repr(x)
    short = len(text) <= _LONGEST and "\n" not in text and not remedy
    raise fail(name, wanted, text if short else f"{_article(type(x))} {given}", remedy)


def _needs_arguments(function: Callable) -> bool:
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:  # some builtins have none
        return False
    single = (p for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD))
    return any(p.default is p.empty for p in single)


def check_functions(x: Any) -> None:
    """Raise ValueError if a number that a function in x, or in its scene, captured has changed."""
    owner = x if hasattr(x, "check_functions") else getattr(x, "scene", None)
    check = getattr(owner, "check_functions", None)
    if check is not None:
        check()


def _kinds(annotation: Any) -> tuple[tuple[type, ...], tuple[type, ...]]:
    """The classes that an annotation names, and those of the entries of its sequences."""
    kinds, entries = [], []
    for part in _parts(annotation):
        if typing.get_origin(part) is collections.abc.Sequence:
            entries += _parts(typing.get_args(part)[0])
        else:
            kinds.append(typing.get_origin(part) or part)
    return tuple(kinds), tuple(entries)


def _parts(annotation: Any) -> tuple[Any, ...]:
    return typing.get_args(annotation) if isinstance(annotation, types.UnionType) else (annotation,)


def _article(kind: type) -> str:
    return "an" if kind.__name__[0] in "AEIOU" else "a"
