"""Records that hold functions which pickle cannot find by name: lambdas, inner functions.

Pickle stores the name of a function, and lambdas have none. They are stored by the package
cloudpickle, which stores their code.
"""

import dataclasses
import pickle
import types
from typing import Any

import equinox as eqx
import jax

from jaxdyn._text import fail


class Stored:
    """A function in a pickled record; a copy of the record shares it."""

    def __init__(self, function: types.FunctionType):
        self.function = function

    def __deepcopy__(self, memo: dict) -> "Stored":
        return self

    def __reduce__(self) -> tuple:
        try:
            import cloudpickle
        except ImportError as error:
            name = self.function.__qualname__
            remedy = "Define it by `def` at the top level of a module, or install cloudpickle."
            raise fail("pickle", "functions that have a name", name, remedy) from error
        return _load_function, (cloudpickle.dumps(self.function),)


def _load_function(code: bytes) -> Stored:
    return Stored(pickle.loads(code))


def state_of(record: Any) -> dict[str, Any]:
    """The fields of a record as pickle can store them."""
    names = [field.name for field in dataclasses.fields(record) if field.name in record.__dict__]
    return {name: _map_functions(_wrap, record.__dict__[name]) for name in names}


def fields_of(state: dict[str, Any]) -> dict[str, Any]:
    """The fields of a record that `state_of` was given."""
    return {name: _map_functions(_function, value) for name, value in state.items()}


def _map_functions(change: Any, value: Any) -> Any:
    """A field with its functions changed, in tuples, lists and dictionaries, too."""
    if isinstance(value, tuple | list | dict | types.FunctionType | Stored):
        return jax.tree.map(change, value, is_leaf=lambda x: isinstance(x, eqx.Module))
    return value


def _wrap(x: Any) -> Any:
    return Stored(x) if isinstance(x, types.FunctionType) and not _has_name(x) else x


def _function(x: Any) -> Any:
    return x.function if isinstance(x, Stored) else x


def _has_name(function: types.FunctionType) -> bool:
    try:
        return bool(pickle.dumps(function))
    except (pickle.PicklingError, AttributeError):
        return False
