"""Checks of the shape and the precision of what the methods of a system and its effects return.

An array of the wrong shape is often broadcast silently: one force of shape (d,) on n points would
act on each of them. Shapes are known as soon as a function is traced, so these checks need no
values and run once per kind of scene. Every formulation sums its effects by the functions at the
end, so a force of the wrong shape is found wherever a rate is traced.
"""

import functools
from collections.abc import Callable, Iterable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import refuse_narrow
from jaxdyn._records import check_repeatable

_NEEDS_VALUES = (
    jax.errors.TracerArrayConversionError,
    jax.errors.TracerIntegerConversionError,
    jax.errors.ConcretizationTypeError,
)
_TRACEABLE = "Use jax.numpy instead of numpy and math, and jnp.where instead of `if`."
#: Messages of NumPy and of JAX where an entry of an array is assigned.
_FILLED = ("setting an array element", "JAX arrays are immutable")
_RETURN = (
    "Return a list such as [y[1], -y[0]] instead of filling an array entry by entry, or write "
    "d = d.at[0].set(y[1]) with an array d of jax.numpy."
)
_ENERGY = "An energy is one number."
_FORCE = "One row for each point; jnp.broadcast_to(f, r.shape) repeats one force."
_GENERALIZED = "One for each velocity of the system."


def check_field(field: Any, t: Array, y: Array) -> None:
    """Raise ValueError if a method of the system or an effect returns a wrong shape."""
    points = jax.eval_shape(field.system.points, t, y)
    check_points(field.system, t, y, points)
    for effect in field.effects:
        check_effect(effect, field.system, t, y, points)
    check_energies(field.system, field.effects, t, y, points)
    check_rate(field.system, field.effects, t, y)


def check_points(system: Any, t: Array, y: Array, points: Any) -> None:
    """Raise ValueError unless a system's material points have their shapes."""
    name, r = f"{type(system).__name__}.points", jnp.shape(points.r)
    if len(r) != 2:
        raise _checks.fail(name, "r of shape (n, d)", f"shape {r}", "One row for each point.")
    for part, x, wanted in (("v", points.v, r), ("m", points.m, r[:1])):
        if jnp.shape(x) != wanted:
            raise _checks.fail(
                name,
                f"{part} of shape {wanted}",
                f"shape {jnp.shape(x)}",
                f"r has shape {r}: {r[0]} points in {r[1]} dimensions.",
            )


def check_energies(system: Any, effects: tuple, t: Array, y: Array, points: Any) -> None:
    """Raise ValueError unless a system's energies are numbers and its integrals have one axis."""
    name, remedy = type(system).__name__, _ENERGY
    if len(points.m):
        check_value(f"{name}.kinetic", (), remedy, system.kinetic, t, y)
    terms = jax.eval_shape(lambda t, y: system.energies(t, y, effects), t, y)
    for i in range(len(terms)):
        one = functools.partial(lambda i, t, y: system.energies(t, y, effects)[i], i)
        check_value(f"{name}.energies", (), remedy, one, t, y)
    for key, value in jax.eval_shape(system.integrals, t, y).items():
        if value.ndim > 1:
            got = f"shape {value.shape} of {key!r}"
            raise _checks.fail(f"{name}.integrals", "numbers or vectors", got)


def check_rate(system: Any, effects: tuple, t: Array, y: Array) -> None:
    """Raise ValueError unless a system's rate and difference have the shape of the state."""
    name, remedy = type(system).__name__, "One for each entry of the state."
    check_value(f"{name}.rate", y.shape, remedy, lambda t, y: system.rate(t, y, effects), t, y)
    check_value(f"{name}.difference", y.shape, remedy, system.difference, y, y)
    check_repeatable(system, "rate", t, y, effects)


def check_effect(effect: Any, system: Any, t: Array, y: Array, points: Any) -> None:
    """Raise ValueError if a method of an effect returns a wrong shape; None is allowed."""
    name, (r, v, m) = type(effect).__name__, points
    if "generalized" in effect.acts:
        q, rates = system.coordinates(y)
        where = f"{name}.generalized"
        check_value(where, rates.shape, _GENERALIZED, effect.generalized, t, q, rates)
        check_repeatable(effect, "generalized", t, q, rates)
    if "force" not in effect.acts:
        return
    check_value(f"{name}.potential", (), _ENERGY, effect.potential, t, r, m)
    check_value(f"{name}.force", r.shape, _FORCE, effect.force, t, r, v, m)
    check_repeatable(effect, "force", t, r, v, m)


def check_force(effect: Any, force: Array, shape: tuple[int, ...]) -> Array:
    """The force (n, d) of an effect; raises ValueError for another shape."""
    _check_shape(f"{type(effect).__name__}.force", shape, _FORCE, force)
    return force


def check_generalized(effect: Any, force: Array, shape: tuple[int, ...]) -> Array:
    """The force (n,) of an effect on coordinates; raises ValueError for another shape."""
    _check_shape(f"{type(effect).__name__}.generalized", shape, _GENERALIZED, force)
    return force


def check_potential(effect: Any, value: Array) -> Array:
    """The potential () of an effect; raises ValueError for another shape."""
    _check_shape(f"{type(effect).__name__}.potential", (), _ENERGY, value)
    return value


def check_value(
    name: str, shape: tuple[int, ...], remedy: str, function: Callable, *args: Array
) -> None:
    """Raise ValueError unless a function of arrays returns real numbers of this shape, or None."""
    try:
        found = jax.eval_shape(function, *args)
    except _NEEDS_VALUES as error:
        got = f"one that needs their values ({type(error).__name__})"
        raise _checks.fail(name, "a function of traced arrays", got, _TRACEABLE) from error
    except (TypeError, ValueError) as error:
        if not str(error).startswith(_FILLED):
            raise
        got = f"one that fills an array ({error})"[:100]
        raise _checks.fail(name, "a function that returns new numbers", got, _RETURN) from error
    if found is None:
        return
    _check_shape(name, shape, remedy, found)
    if not (jnp.issubdtype(found.dtype, jnp.floating) or jnp.issubdtype(found.dtype, jnp.integer)):
        raise _checks.fail(name, "real numbers", f"an array of {found.dtype}", remedy)


def _check_shape(name: str, shape: tuple[int, ...], remedy: str, found: Any) -> None:
    got = () if isinstance(found, int | float) else getattr(found, "shape", None)
    if got is None:
        raise _checks.fail(name, f"an array of shape {shape}", type(found).__name__, remedy)
    if got != shape:
        raise _checks.fail(name, f"shape {shape}", f"shape {got}", remedy)
    refuse_narrow(found, name)


def total_force(effects: Iterable[Any], t: Array, r: Array, v: Array, m: Array, start=None):
    """Sum (n, d) [N] of the forces of effects on points at r (n, d), added to `start`."""
    forces = (check_force(e, e.force(t, r, v, m), r.shape) for e in effects)
    return sum(forces, jnp.zeros_like(r) if start is None else start)


def generalized_forces(effects: Iterable[Any], t: Array, q: Array, v: Array) -> list[Array]:
    """The forces (n,) on coordinates of those effects that have one."""
    forces = ((e, e.generalized(t, q, v)) for e in effects)
    return [check_generalized(e, f, v.shape) for e, f in forces if f is not None]


def potential_energy(effects: Iterable[Any], t: Array, r: Array, m: Array) -> Array:
    """Sum () [J] of the potentials of the effects that have one, for points at r (n, d)."""
    values = ((e, e.potential(t, r, m)) for e in effects)
    known = (check_potential(e, value) for e, value in values if value is not None)
    return sum(known, jnp.zeros(()))
