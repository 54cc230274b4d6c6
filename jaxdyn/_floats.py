"""Conversion of numbers to float arrays, the leaves of a scene."""

import reprlib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._text import fail

#: Puts a NumPy array on the device, in a fifth of the time of `jnp.asarray` (5 us of 29).
_placed = jax.jit(lambda x: x)


def float64(remedy: str = "Call jaxdyn.configure() first.") -> None:
    """Raise unless 64-bit floats are enabled."""
    if not jax.config.jax_enable_x64:
        raise fail("floats", "64-bit floats", "JAX's default of 32 bits", remedy)


def as_float(x: Any) -> Array:
    """A number or numbers as a 64-bit float array; the converter of fields that hold them.

    Measured data in fewer bits are converted, exactly.

    Raises:
      ValueError: complex numbers or dates, or JAX is set to 32-bit floats, in which numbers would
        lose half of their digits for good.
    """
    float64()
    refuse_unreal(x)
    if isinstance(x, jax.Array):
        return x if x.dtype == float and not x.weak_type else jnp.asarray(x, dtype=float)
    try:
        if is_plain(x) or (isinstance(x, np.ndarray | np.number) and x.dtype.kind in "fiu"):
            return _placed(np.asarray(x, float))
        return jnp.asarray(x, dtype=float)
    except OverflowError as error:
        raise too_large("number", x) from error


def too_large(name: str, x: Any) -> ValueError:
    """The error for a whole number beyond all floats."""
    return fail(name, "numbers of at most 1.8e308", reprlib.repr(x))


def refuse_unreal(x: Any, name: str = "number") -> None:
    """Raise ValueError for what has no number of its own, or two.

    NumPy's dates and durations have one in some unit; conversion drops the imaginary part of
    complex numbers.
    """
    kind = "c" if type(x) is complex else getattr(getattr(x, "dtype", None), "kind", "")
    if kind in ("m", "M"):
        remedy = "Subtract dates from each other, and divide by a unit: x / np.timedelta64(1, 's')."
        raise fail(name, "numbers", f"{x!r}, in units of NumPy", remedy)
    if kind == "c":
        raise fail(name, "real numbers", "complex ones", "Pass their real and imaginary parts.")


def refuse_narrow(x: Any, name: str, remedy: str = "Compute it in 64 bits.") -> None:
    """Raise ValueError for a result in floats of fewer than 64 bits.

    Data may come in them, and are converted; what is computed in them has lost half of its digits.
    """
    dtype = getattr(x, "dtype", None)
    if dtype is not None and jnp.issubdtype(dtype, jnp.floating) and dtype.itemsize < 8:
        raise fail(name, "64-bit floats", f"an array of {dtype}", remedy)


def is_plain(x: Any) -> bool:
    """Whether x is a number of Python, or a list or tuple of them; True and False are none."""
    kinds = {*map(type, x)} if isinstance(x, list | tuple) else {type(x)}
    return kinds <= {float, int}


def floats(*numbers: Any) -> tuple[Array, ...]:
    """Several numbers, each as a float array."""
    return tuple(map(as_float, numbers))
