"""Host-side checks of arguments, with one message format.

Every message reads ``name: expected ..., got .... What to do.`` and is a ValueError. Values
that are traced (inside jit, grad or vmap) are unknown and pass.
"""

import math
import reprlib
from typing import Any

import jax
import numpy as np
from jaxtyping import Array

from jaxdyn._floats import as_float, is_plain, refuse_unreal
from jaxdyn._floats import float64 as float64
from jaxdyn._text import choice as choice
from jaxdyn._text import fail as fail
from jaxdyn._text import flag as flag
from jaxdyn._text import whole as whole

_NUMBERS = (float, int, np.ndarray, jax.Array, type(None))
_WITH_VALUES = frozenset({float, int, np.ndarray, type(None)})


def is_traced(x: Any) -> bool:
    """True while x is inside a jax transformation and has no known value."""
    # The usual cases, in a tenth of the time that a search through a pytree takes; a Tracer says
    # that it is a jax.Array.
    if type(x) in _WITH_VALUES:
        return False
    if isinstance(x, jax.core.Tracer):
        return True
    if isinstance(x, _NUMBERS):
        return False
    # Not `any` of a generator, which takes twice as long.
    for leaf in jax.tree.leaves(x):
        if isinstance(leaf, jax.core.Tracer):
            return True
    return False


def check_untraced(name: str, x: Any, remedy: str) -> None:
    """Raise for traced values, where they are needed on the host."""
    if is_traced(x):
        raise fail(name, "numbers", "values traced by jit, grad or vmap", remedy)


def array(name: str, x: Any, shape: tuple[int | None, ...], remedy: str = "") -> Array:
    """The input as a finite float array of this shape, where None allows any length."""
    return finite(name, array_of_shape(name, x, shape, remedy), remedy)


def host_array(name: str, x: Any, shape: tuple[int | None, ...], remedy: str = "") -> Any:
    """`array` as NumPy where x has a value: for further use on the host."""
    if is_traced(x):
        return array(name, x, shape, remedy)
    if type(x) is float and not shape and math.isfinite(x):
        return np.asarray(x)  # the usual case, in a fifth of the time
    refuse_unreal(x, name)
    try:
        _numeric(x)
        values = np.asarray(x, float)
    except (TypeError, ValueError, OverflowError) as error:
        raise fail(name, "numbers", reprlib.repr(x), remedy) from error
    check_shape(name, values.shape, shape, remedy)
    return finite(name, values, remedy)


def array_of_shape(name: str, x: Any, shape: tuple, remedy: str = "") -> Array:
    """The input as a float array of this shape; see `check_shape`."""
    x = numbers(name, x, remedy)
    check_shape(name, x.shape, shape, remedy)
    return x


def check_shape(name: str, got: tuple, shape: tuple, remedy: str = "") -> None:
    """Raise unless the shape is as given: None allows any length, a last ... any axes."""
    if got == shape:
        return
    front = shape[:-1] if shape[-1:] == (...,) else shape
    compared = got[: len(front)] if front != shape else got
    fits = len(compared) == len(front) and all(
        w is None or s == w for s, w in zip(compared, front, strict=True)
    )
    if not fits:
        words = ["any" if w is None else "..." if w is ... else str(w) for w in shape]
        wanted = ", ".join(words) + ("," if len(words) == 1 else "")
        raise fail(name, f"shape ({wanted})", f"shape {got}", remedy)


def numbers(name: str, x: Any, remedy: str = "") -> Array:
    """The input as a float array, of any shape and value."""
    float64()
    refuse_unreal(x, name)
    try:
        _numeric(x)
        return as_float(x)
    except (TypeError, ValueError, OverflowError) as error:
        raise fail(name, "numbers", reprlib.repr(x), remedy) from error


def _numeric(x: Any) -> None:
    """Raise TypeError unless x is numeric."""
    if is_plain(x) or getattr(x, "dtype", None) == np.float64:
        return
    # numpy would convert the text "1" and the boolean True to the number 1.
    for leaf in jax.tree.leaves(x):
        kind = getattr(leaf, "dtype", np.dtype(float)).kind
        if isinstance(leaf, str | bool | complex) or kind in "bcUSO":
            raise TypeError


def finite(name: str, x: Array, remedy: str = "") -> Array:
    """The array; raises if any entry is NaN or infinite."""
    if not is_traced(x):
        values = np.asarray(x)
        if not np.isfinite(values).all():
            bad = ~np.isfinite(values)
            where = "" if values.ndim == 0 else f" at index {np.argwhere(bad)[0].tolist()}"
            raise fail(name, "finite numbers", f"{values[bad][0]}{where}", remedy)
    return x


def positive(name: str, x: Any, remedy: str = "") -> Array:
    """x as an array; raises unless every entry is > 0."""
    return _above_zero(name, x, remedy, np.greater, "> 0")


def at_least_zero(name: str, x: Any, remedy: str = "") -> Array:
    """x as an array; raises unless every entry is >= 0."""
    return _above_zero(name, x, remedy, np.greater_equal, ">= 0")


def _above_zero(name: str, x: Any, remedy: str, holds, wanted: str) -> Array:
    x = numbers(name, x, remedy)
    if not is_traced(x):
        finite(name, x, remedy)
        values = np.asarray(x)
        if not (right := holds(values, 0)).all():
            raise fail(name, wanted, values[~right].ravel()[0], remedy)
    return x
