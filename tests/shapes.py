"""Checks the shapes that annotations name, such as Float[Array, "n d"], whenever the tests call.

`conftest` installs it by jaxtyping's import hook. Annotations without a shape are left to pyright:
many tests give arguments of a wrong type on purpose, to read the message.
"""

from collections.abc import Callable
from typing import Any, get_args

from beartype import beartype
from jaxtyping import AbstractArray


def checked(function: Callable) -> Callable:
    """The function, checking the arguments and results whose annotations name a shape."""
    hints = getattr(function, "__annotations__", {})
    function.__annotations__ = {name: hint for name, hint in hints.items() if _has_shape(hint)}
    return beartype(function) if function.__annotations__ else function


def _has_shape(hint: Any) -> bool:
    if isinstance(hint, type) and issubclass(hint, AbstractArray):
        return True
    return any(map(_has_shape, get_args(hint)))
