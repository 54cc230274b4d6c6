"""Numeric arguments of public functions: lists become arrays, and shapes are checked.

There are two decorators, since functions declare their arguments in two ways: tools for vectors and
matrices by annotations, functions that make a scene by defaults.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar, cast

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import is_plain

T = TypeVar("T")
F = TypeVar("F", bound=Callable)


def arrays(function: Callable[..., T]) -> Callable[..., T]:
    """The function with arguments annotated as arrays converted to 64-bit float arrays.

    Numbers and (nested) lists are accepted too. An annotation with axes, such as
    ``Float[Array, "3"]``, also fixes the shape, except for axes named by a letter. An argument
    annotated as a record, such as a `Body`, must be one.

    Example:
      >>> from jaxtyping import Array, Float
      >>> @arrays
      ... def first(r: Float[Array, "3"]) -> Array:
      ...     return r[0]
      >>> float(first([1, 2, 3]))
      1.0
    """
    signature = inspect.signature(function)
    kinds = {p.name: p.annotation for p in signature.parameters.values()}
    shapes = {name: _shape_of(kind) for name, kind in kinds.items() if _is_array(kind)}
    records = {name: kind for name, kind in kinds.items() if _is_record(kind)}

    @functools.wraps(function)
    def converted(*args, **kwargs):
        _checks.float64()
        given = signature.bind(*args, **kwargs)
        for name, x in given.arguments.items():
            if name in shapes:
                given.arguments[name] = _convert(name, x, shapes[name])
            elif name in records and not isinstance(x, records[name]):
                raise _checks.fail(name, f"a {records[name].__name__}", type(x).__name__)
        return function(*given.args, **given.kwargs)

    return converted


def like_defaults(*rows: str, but: tuple[str, ...] = ()) -> Callable[[F], F]:
    """The decorator that raises unless a number has the shape of the parameter's default.

    It also raises for a keyword that the function does not have, and suggests the nearest.

    Args:
      rows: parameters whose number of rows may differ from that of their defaults; all must have
        as many rows as the first one.
      but: parameters with more than one valid shape, which the function itself checks.
    """

    def decorated(function: F) -> F:
        signature = inspect.signature(function)
        defaults = {p.name: p.default for p in signature.parameters.values()}
        numbers = {name: x for name, x in defaults.items() if _is_numeric(x) and name not in but}
        shapes = {name: np.shape(x) for name, x in numbers.items()}

        @functools.wraps(function)
        def checked(*args, **kwargs):
            for name in kwargs.keys() - defaults.keys():
                _checks.choice(f"keyword of {function.__name__}", name, defaults)
            given = signature.bind(*args, **kwargs).arguments if args or kwargs else {}
            if not given.keys() & shapes.keys():
                return function(*args, **kwargs)  # the defaults have the right shapes
            got = shapes | {name: _shape(name, given[name]) for name in shapes if name in given}
            n = got[rows[0]][:1] if rows else ()
            for name, shape in shapes.items():
                many = name in rows
                remedy = f"One for each entry of {rows[0]}." if many and name != rows[0] else ""
                wanted = (*(n or (None,)), *shape[1:]) if many else shape
                _checks.check_shape(name, got[name], wanted, remedy)
            return function(*args, **kwargs)

        return cast(F, checked)

    return decorated


def _is_array(annotation: Any) -> bool:
    return Array in (annotation, getattr(annotation, "array_type", None))


def _is_record(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, eqx.Module)


def _shape_of(annotation: Any) -> tuple | None:
    """The shape that an annotation of jaxtyping names, as `_checks.check_shape` takes it."""
    axes = getattr(annotation, "dim_str", None)
    if axes is None:
        return None
    return tuple(... if x == "..." else int(x) if x.isdigit() else None for x in axes.split())


def _convert(name: str, x: Any, shape: tuple | None) -> Array:
    return _checks.numbers(name, x) if shape is None else _checks.array_of_shape(name, x, shape)


def _is_numeric(default: Any) -> bool:
    """Whether a default is a number or (nested) numbers."""
    leaves = jax.tree.leaves(default)
    return bool(leaves) and all(
        isinstance(x, int | float | np.ndarray) and not isinstance(x, bool) for x in leaves
    )


def _shape(name: str, x: Any) -> tuple[int, ...]:
    return np.shape(x) if is_plain(x) else _checks.numbers(name, x).shape
