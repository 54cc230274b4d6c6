"""Checks the shapes that annotations name, such as Float[Array, "n d"], where the tests call.

`conftest` installs it by jaxtyping's import hook. Annotations without a shape are left to pyright:
many tests give arguments of a wrong type on purpose, to read the message. NumPy arrays pass where
the shape is right, as they do in the library.

Only functions whose annotations name a shape are checked, each in its first calls in a test:
jaxtyping alone would check every call of every function, for a fifth of the time of all tests.
"""

import functools
import operator
from collections.abc import Callable
from types import UnionType
from typing import Any, Union, get_args, get_origin

import jaxtyping
import numpy as np
from beartype import beartype
from jaxtyping import AbstractArray, Array

_CALLS = 20  # number of calls of a function in a test that are checked

_jaxtyped = jaxtyping.jaxtyped
_left: dict[Callable, int] = {}  # calls in this test that are still to be checked


def install(modules: list[str]) -> None:
    """Check the functions of these modules, and of those below them, when they are imported."""
    jaxtyping.jaxtyped = _with_shapes
    jaxtyping.install_import_hook(modules, "shapes.checked")


def begin_test() -> None:
    """Check the first calls of each function again."""
    _left.clear()


def _with_shapes(*, typechecker: Any) -> Callable:
    """What the import hook decorates functions and classes with."""

    def decorated(what):
        if isinstance(what, type):
            return _jaxtyped(what, typechecker=typechecker)
        if not any(map(_has_shape, getattr(what, "__annotations__", {}).values())):
            return what
        watched = _jaxtyped(what, typechecker=typechecker)

        @functools.wraps(what)
        def called(*args, **kwargs):
            left = _left.get(what, _CALLS)
            _left[what] = left - 1
            return (watched if left > 0 else what)(*args, **kwargs)

        return called

    return decorated


def checked(function: Callable) -> Callable:
    """The function, checking the arguments and results whose annotations name a shape."""
    hints = getattr(function, "__annotations__", {})
    hints = {name: _with_numpy(hint) for name, hint in hints.items() if _has_shape(hint)}
    function.__annotations__ = hints
    return beartype(function) if hints else function


def _has_shape(hint: Any) -> bool:
    return _is_array(hint) or any(map(_has_shape, get_args(hint)))


def _is_array(hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, AbstractArray)


def _with_numpy(hint: Any) -> Any:
    """The annotation with NumPy arrays allowed wherever JAX arrays of the same shape are."""
    if _is_array(hint):
        return (
            hint.dtype[Array | np.ndarray | np.generic, hint.dim_str]
            if hint.array_type is Array
            else hint
        )
    if get_origin(hint) in (Union, UnionType):
        return functools.reduce(operator.or_, map(_with_numpy, get_args(hint)))
    return hint
