"""Measured tables: times, and columns of entries of the state, positions of points, or functions.

A column is identified by its name: the name of an entry of the state means that entry. Otherwise
"x", "y" and "z" mean the position of the scene's point, numbered ("x1", "y2") if there are several;
any other name needs a function (`observe=`). Gaps are NaN.
"""

import reprlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._text import second
from jaxdyn._units import conversion, measure
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene

TIME, _LONG = "t", "time"  # names of the column of times
_NO_NUMBERS = "bcmM"  # kinds of arrays that NumPy would convert: bool, complex, durations, dates
_AXES = "xyz"
_NO_UNIT = "1"
_NONE = ("", "-", _NO_UNIT)  # how tables say that a column has no unit
_REMEDY = (
    'The times are in a column "t" or "time". '
    'For example {"t": times, "angle": values}, a DataFrame, or jaxdyn.read_csv(path).'
)


class Measured(NamedTuple):
    """A table: times (s,) in order and columns (s, c), NaN where nothing was measured.

    Attributes:
      rows: (s,) index of each row in the data, whose empty rows are left out.
      count: number of rows of the data.
      units: units of the columns and of "t" by name, as far as they are known.
      replaced: units of columns that were replaced by others without a unit.
    """

    ts: np.ndarray
    values: np.ndarray
    names: tuple[str, ...]
    rows: np.ndarray
    count: int
    units: dict[str, str]
    replaced: dict[str, str]

    def in_units_of(self, scene: Scene, columns: Sequence["Column"]) -> "Measured":
        """The table in the units of a scene, as far as both are known.

        Raises:
          ValueError: a unit of the table measures another quantity than that of the scene, or the
            unit of a column that was replaced is not known.
        """
        wanted = {column.name: column.unit for column in columns}
        wanted |= {TIME: second(scene.labels()) or _NO_UNIT}
        sizes = {name: self._size(name, unit) for name, unit in wanted.items()}
        values = self.values * np.array([sizes[name] for name in self.names])
        return self._replace(ts=self.ts * sizes[TIME], values=values, units=self.units | wanted)

    def _size(self, name: str, wanted: str) -> float:
        given = self.units.get(name, _NO_UNIT)
        former = self.replaced.get(name, wanted) if name not in self.units else wanted
        if wanted != _NO_UNIT and former not in _NONE and not _alike(former, wanted):
            remedy = f'Write data.units["{name}"] = "{wanted}", or the unit that it has.'
            came = f"none, since it replaced a column in {former}"
            raise _checks.fail(f"column {name}", "its unit", came, remedy)
        if wanted == _NO_UNIT or given in _NONE:
            return 1.0
        return conversion(f"column {name}", given, wanted)


def _alike(unit: str, other: str) -> bool:
    """Whether two units are the same, by whatever names."""
    return unit == other or (measure(unit) == measure(other) is not None)


class Column(NamedTuple):
    """The quantity that a column measures, which is one of three kinds; static.

    Attributes:
      name: name of the column.
      unit: unit of an entry of the state; "1" for others.
      entry: index of the entry of the state.
      place: point and axis.
      function: (scene, t, y) -> ().
    """

    name: str
    unit: str = _NO_UNIT
    entry: int | None = None
    place: tuple[int, int] | None = None
    function: Callable | None = None

    def value(self, scene: Scene, t: Array, y: Array) -> Array:
        """The measured quantity () of a state y (k,)."""
        if self.entry is not None:
            return y[self.entry]
        if self.place is not None:
            return scene.points(t, y).r[self.place]
        assert self.function is not None
        return jnp.asarray(self.function(scene, t, y), float).reshape(())


def read_measurements(data: Any, columns: Any = None) -> Measured:
    """The table of measurements from data in any of the accepted forms.

    Args:
      data: columns by name with the times as "t": a mapping of arrays, a DataFrame (whose index may
        be the times), a Trajectory.
      columns: names of the columns to use; all except "t" by default.
    Raises:
      ValueError: there are no times or no columns, lengths differ, a time is not a number, or
        nothing is measured.
    """
    units = _units(data)
    if isinstance(data, Trajectory):
        names = [name for name, _ in data.scene.labels()]
        data = {TIME: data.ts} | {name: data[name] for name in names}
    elif getattr(getattr(data, "index", None), "name", None) == TIME:
        data = data.reset_index()
    if not (isinstance(data, Mapping) or hasattr(data, "columns")):
        raise _checks.fail("data", "columns by name", type(data).__name__, _REMEDY)
    given = {str(name): data[name] for name in data}
    if TIME not in given and _LONG in given:
        given = {TIME if name == _LONG else name: x for name, x in given.items()}
    if TIME not in given:
        raise _checks.fail("data", "a column 't' with the times", sorted(given), _REMEDY)
    if columns is None:
        columns = [name for name in given if name != TIME]
    names = tuple(_checks.choice("columns", name, given) for name in columns)
    if not names:
        raise _checks.fail("data", "a column besides the times", "none", _REMEDY)
    ts = _checks.host_array("t", _floats("t", given[TIME]), (None,))
    values = [_numbers(name, given[name], len(ts)) for name in names]
    order = np.argsort(ts, kind="stable")
    table = np.stack(values, axis=1)[order]
    if not np.isfinite(table).any():
        raise _checks.fail("data", "measured values", "NaN alone")
    kept = np.isfinite(table).any(axis=1)
    replaced = dict(getattr(data, "replaced", {})) if isinstance(data, dict) else {}
    return Measured(ts[order][kept], table[kept], names, order[kept], len(ts), units, replaced)


def _units(data: Any) -> dict[str, str]:
    """The units that data state, by name: those of a motion, a file or a DataFrame."""
    if isinstance(data, Trajectory):
        labels = data.scene.labels()
        return {TIME: second(labels) or _NO_UNIT} | dict(labels)
    columns = isinstance(data, dict)  # not a DataFrame, where `units` may be a column
    stated = getattr(data, "units", None) if columns else getattr(data, "attrs", {}).get("units")
    known = {} if stated is None else stated
    if not (isinstance(known, Mapping) and all(isinstance(x, str) for x in known.values())):
        remedy = 'Write data.attrs["units"] = {"theta": "deg"}.'
        raise _checks.fail("data", "units by the name of the column", stated, remedy)
    return dict(known)


def _floats(name: str, given: Any) -> np.ndarray:
    """The values of a column, which may be numbers in an array of objects, or as text."""
    try:
        found = np.asarray(given)
        if found.dtype.kind in _NO_NUMBERS:
            raise TypeError
        return np.asarray(found, float)
    except (TypeError, ValueError) as error:
        remedy = "" if name == TIME else "Name the columns to use: columns=[...]."
        raise _checks.fail(f"column {name}", "numbers", reprlib.repr(given), remedy) from error


def _numbers(name: str, given: Any, count: int) -> np.ndarray:
    values = _floats(name, given)
    _checks.check_shape(f"column {name}", values.shape, (count,), "One for each time.")
    if np.isinf(values).any():
        raise _checks.fail(f"column {name}", "numbers, or NaN for gaps", "infinity")
    return values


def columns_of(
    scene: Scene, names: tuple[str, ...], observe: Mapping[str, Callable] | None
) -> tuple[Column, ...]:
    """The quantity of a scene that each column measures.

    Raises:
      ValueError: the scene has nothing of that name.
    """
    labels, functions = scene.labels(), dict(observe or {})
    entries = {name: (i, unit) for i, (name, unit) in enumerate(labels)}
    length = _NO_UNIT if not second(labels) else scene.units[0] if scene.units else "m"
    points = scene.points(jnp.zeros(()), scene.y0).r.shape if scene.has_points else (0, 0)
    places = {}
    for i in range(points[0]):
        for axis, letter in enumerate(_AXES[: points[1]]):
            places[letter if points[0] == 1 else f"{letter}{i + 1}"] = (i, axis)
    found = []
    for name in names:
        if name in functions:
            found.append(Column(name, function=functions[name]))
        elif name in entries:
            found.append(Column(name, entries[name][1], entry=entries[name][0]))
        elif name in places:
            found.append(Column(name, length, place=places[name]))
        else:
            try:
                _checks.choice("name of a column", name, {*entries, *places, *functions})
            except ValueError as error:
                remedy = (
                    "Rename it, or name the columns to use, columns=[...]. Another quantity of the "
                    "scene is defined by observe={...}."
                )
                raise ValueError(f"{error} {remedy}") from None
    return tuple(found)
