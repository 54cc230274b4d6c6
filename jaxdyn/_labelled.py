"""Results as tables of pandas and as data sets of xarray, which are optional.

A result gives the names, axes and units of its numbers as a `Labelled`, from which each of the two
libraries makes its own structure.
"""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from jaxdyn._text import fail


class Values(NamedTuple):
    """Some numbers of a result.

    Attributes:
      axes: names of the axes of `array`.
      array: the numbers, or texts.
      unit: "1" for none; "" for what is not a quantity, or has no known unit.
    """

    axes: tuple[str, ...]
    array: Any
    unit: str = ""


class Labelled(NamedTuple):
    """The numbers of a result with their names.

    Attributes:
      coordinates: coordinates by name; one with the name of an axis labels the places along it.
      variables: variables by name.
    """

    coordinates: dict[str, Values]
    variables: dict[str, Values]

    @property
    def units(self) -> dict[str, str]:
        """The units by name, of what has a unit."""
        named = self.coordinates | self.variables
        return {name: values.unit for name, values in named.items() if values.unit}


class _Result(Protocol):
    def _to_labelled(self) -> Labelled: ...


def to_pandas(self: _Result) -> Any:
    """The numbers as a pandas DataFrame: a row for each place along the axes.

    The index consists of the axes; every other number has a column, repeated along axes it lacks.
    ``frame.attrs["units"]`` has the units.

    Raises:
      ValueError: pandas is not installed.
    """
    return frame(self._to_labelled())


def to_xarray(self: _Result) -> Any:
    """The numbers as an xarray Dataset with named axes; ``attrs["units"]`` of each has its unit.

    Raises:
      ValueError: xarray is not installed.
    """
    return to_dataset(self._to_labelled())


def package(name: str, wanted_by: str) -> Any:
    """An optional package, imported now.

    Raises:
      ValueError: it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        remedy = f"Install it: pip install 'jaxdyn[{name}]'."
        raise fail(wanted_by, f"the package {name}", "none", remedy) from error


def entries(
    axes: Sequence[str], array: Any, labels: Sequence[tuple[str, str]]
) -> dict[str, Values]:
    """The entries of states, whose last axis has these names and units, each by its name."""
    array = np.asarray(array)
    return {name: Values(tuple(axes), array[..., i], unit) for i, (name, unit) in enumerate(labels)}


def frame(labelled: Labelled) -> Any:
    """What `to_pandas` returns."""
    pandas = package("pandas", "to_pandas")
    named = labelled.coordinates | labelled.variables
    sizes = _sizes(named)
    index = pandas.MultiIndex.from_product(
        [named[axis].array if axis in named else range(n) for axis, n in sizes.items()],
        names=[*sizes],
    )
    columns = {
        name: _broadcast(values, sizes).ravel()
        for name, values in named.items()
        if name not in sizes
    }
    found = pandas.DataFrame(columns, index=index if len(sizes) > 1 else index.get_level_values(0))
    found.attrs["units"] = labelled.units
    return found


def to_dataset(labelled: Labelled) -> Any:
    """What `to_xarray` returns."""
    xarray = package("xarray", "to_xarray")

    def made(named: Mapping[str, Values]) -> dict[str, tuple]:
        return {
            name: (x.axes, np.asarray(x.array), {"units": x.unit} if x.unit else {})
            for name, x in named.items()
        }

    return xarray.Dataset(made(labelled.variables), coords=made(labelled.coordinates))


def _sizes(named: Mapping[str, Values]) -> dict[str, int]:
    """The axes with their lengths, those of the numbers with most axes first."""
    found: dict[str, int] = {}
    for values in sorted(named.values(), key=lambda x: -len(x.axes)):
        for axis, n in zip(values.axes, np.shape(values.array), strict=True):
            found.setdefault(axis, n)
    return found


def _broadcast(values: Values, sizes: Mapping[str, int]) -> np.ndarray:
    """The numbers along all axes; they lie along some of them in the same order."""
    shape = [n if axis in values.axes else 1 for axis, n in sizes.items()]
    return np.broadcast_to(np.reshape(values.array, shape), [*sizes.values()])
