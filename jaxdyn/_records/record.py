"""`Record`, the class of systems, effects, events and other parts of a scene, with functions."""

import dataclasses
import pickle
import types
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax

from jaxdyn._records.captured import Captured, captures_of_record, check_captured
from jaxdyn._text import fail

# ---- Records that hold functions which pickle cannot find by name: lambdas, inner functions
#
# Pickle stores the name of a function, and lambdas have none. They are stored by the package
# cloudpickle, which stores their code.


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
    """The fields of a record from what `state_of` returned."""
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


# ---- `Record`, the class of systems, effects, events and other parts of a scene, with functions

if TYPE_CHECKING:

    class Record(eqx.Module):
        """What type checkers see of the class below."""

        captured: Captured | None = eqx.field(static=True, init=False, repr=False)

        @property
        def converted(self) -> list[Any]: ...

        def check_functions(self) -> None: ...

else:

    class _RecordMeta(type(eqx.Module)):
        def __init__(cls, *args, **kwargs):
            super().__init__(*args, **kwargs)
            fields = dataclasses.fields(cls)
            cls._field_names = frozenset(f.name for f in fields if f.init)
            cls._converters = tuple(
                (f.name, f.metadata["converter"]) for f in fields if "converter" in f.metadata
            )
            checks = (owner.__dict__.get("__check_init__") for owner in cls.__mro__)
            cls._own_checks = tuple(check for check in checks if check)

        def __call__(cls, *args, **kwargs):
            made = object.__new__(cls)  # raises TypeError for abstract classes
            cls.__init__(made, *args, **kwargs)
            values = made.__dict__
            missing = cls._field_names - values.keys()
            if missing or cls.__abstractvars__:
                names = ", ".join(sorted(missing | cls.__abstractvars__))
                raise TypeError(f"{cls.__name__} has no value for {names}")
            for name, convert in cls._converters:
                values[name] = convert(values[name])
            values["captured"] = captures_of_record(made)
            for check in cls._own_checks:
                check(made)
            return made

    class Record(eqx.Module, metaclass=_RecordMeta):
        """An equinox module without what equinox does at each access and each assignment.

        An equinox module returns its methods as pytrees, and notices assignments: a record of
        three fields takes 11 us to make and 1 us per attribute, but here 2 us and 0.03 us
        [measured; an empty compiled call takes 5 us]. Methods are those of Python:
        ``jax.jit(scene.rate)``
        is compiled for this scene alone; `Scene.vector_field` is a pytree, and compiled once
        for all scenes of a kind.

        Attributes:
          captured: what the user's functions in it captured when it was made, with which programs
            are compiled; None without such functions. See `_records.captured`.
        """

        captured: Captured | None = eqx.field(static=True, init=False, repr=False)

        __getattribute__ = object.__getattribute__

        def __setattr__(self, name: str, value: Any) -> None:
            # The constructor assigns each field once; nothing else assigns.
            if name not in type(self)._field_names or name in self.__dict__:
                raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
            self.__dict__[name] = value

        def __getstate__(self) -> dict[str, Any]:
            return state_of(self)

        def __setstate__(self, state: dict[str, Any]) -> None:
            self.__dict__.update(fields_of(state))

        @property
        def converted(self) -> list[Any]:
            """The numbers that were converted when it was made; others are as they were given."""
            return [self.__dict__[name] for name, _ in type(self)._converters]

        def check_functions(self) -> None:
            """Raise ValueError if a number that one of its functions captured has changed since.

            Unlike its own numbers, which cannot change, these are checked in every call.
            """
            check_captured(self)
