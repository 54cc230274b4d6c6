"""Results as plain data: samples, a record for JSON, CSV files; and reading of tables."""

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxdyn._checks import check_first
from jaxdyn._labelled import Labelled
from jaxdyn._text import fail, second, with_unit
from jaxdyn._units import measure
from jaxdyn.accuracy.end_error import EndError
from jaxdyn.analysis.energy_change import energy_change
from jaxdyn.files.input_files import MAX_BYTES, content
from jaxdyn.files.output_files import replace, table_path
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory


@check_first
def samples(motion: Trajectory | HybridTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Times (s,) [s] and states (s, k) of all phases, and the state after a chain's last exit."""
    pieces = pieces_of(motion)
    ts = [np.asarray(piece.ts) for piece in pieces]
    ys = [np.asarray(piece.ys) for piece in pieces]
    if isinstance(motion, HybridTrajectory) and motion.ended:
        ts, ys = [*ts, np.asarray(motion.t)[None]], [*ys, np.asarray(motion.y)[None]]
    return np.concatenate(ts), np.concatenate(ys)


@check_first
def columns(motion: Trajectory | HybridTrajectory) -> list[str]:
    """Name and unit of each entry of the state, e.g. "vx [m/s]"."""
    labels = pieces_of(motion)[0].scene.labels()
    return [with_unit(name, unit) for name, unit in labels]


@check_first
def record(motion: Trajectory | HybridTrajectory, end: EndError) -> dict:
    """A motion as a record for JSON: samples, phases, error estimate, change of its energy.

    Args:
      motion: one motion, or a chain of phases.
      end: the result of `end_error` for it.
    Raises:
      ValueError: a batch of motions.
    """
    pieces = pieces_of(motion)
    change = energy_change(motion)
    in_phases = isinstance(motion, HybridTrajectory)
    phases = zip(motion.names, pieces, motion.times, strict=True) if in_phases else ()
    ts, ys = samples(motion)
    return {
        "status": motion.status.name if in_phases else motion.status_code.name,
        "message": motion.message,
        "warning": motion.warning,
        "t": _finite(ts),
        "labels": columns(motion),
        "y": _finite(ys),
        "error": _finite(end.error),
        "phases": [
            {"name": phase, "t0": float(piece.ts[0]), "t1": t1} for phase, piece, t1 in phases
        ],
        "energy_drift": change and change.size,
        "energy_changed_by": change and change.causes,
        "energy_message": change and change.message,
        "steps": sum(int(piece.steps) for piece in pieces),
        "rejected": sum(int(piece.rejected) for piece in pieces),
    }


def write_csv(path: str | Path, motion: Trajectory | HybridTrajectory) -> Path:
    """Write a CSV file with a line for each sample: time and state, with all digits.

    Its first line has the columns with their units; samples that were not reached are empty.

    Args:
      path: path of the .csv file.
      motion: one motion, or a chain of phases.
    Raises:
      ValueError: `path` cannot be written, or `motion` is a batch.
      OSError: writing failed.
    """
    ts, ys = samples(motion)
    time = second(pieces_of(motion)[0].scene.labels())
    names = [f"t [{time}]" if time else "t", *columns(motion)]
    return write_columns(path, names, _finite(np.c_[ts, ys]))


def write_columns(path: str | Path, names: Sequence[str], rows: Iterable[Sequence]) -> Path:
    """Write a CSV file of rows under the names of their columns; None is an empty cell.

    Args:
      path: path of the .csv file.
      names: names of the columns, with their units.
      rows: numbers or texts.
    Raises:
      ValueError: `path` cannot be written.
      OSError: writing failed.
    """
    path, text = table_path(path), io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(names)
    table.writerows(["" if x is None else x for x in row] for row in rows)
    replace(path, text.getvalue())
    return path


def write_labelled(path: str | Path, labelled: Labelled) -> Path:
    """Write a CSV file of numbers along one axis, with a column for each; see `write_columns`."""
    named = labelled.coordinates | labelled.variables
    names = [name if x.unit in ("", "1") else f"{name} [{x.unit}]" for name, x in named.items()]
    return write_columns(path, names, zip(*(list(x.array) for x in named.values()), strict=True))


#: Names of the column of times, in lower case.
_TIMES = ("t", "time")
#: The head of a column: a name, and its unit in brackets if there is one.
_HEAD = re.compile(r"(?P<name>.*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?")
#: Units that are converted to SI units and radians, alone or in quotients such as deg/s.
_CONVERTED = re.compile(r"deg(?:rees?)?|\N{DEGREE SIGN}|rpm|cm|mm|ms")
#: How Fortran marks the exponent of a number, as in 1.5D-3.
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
#: A number with a decimal comma that cannot be a separator of thousands.
_DECIMAL = re.compile(r"[+-]?(?![1-9]\d{0,2},\d{3}$)\d*,\d*(?:[eE][+-]?\d+)?")
#: A number with several points or commas.
_THOUSANDS = re.compile(r"[+-]?\d*([.,]\d*){2,}(?:[eE][+-]?\d+)?")
_MARKS = "Write one decimal point or comma in each number, and nothing between thousands."
#: Cells with commas that could be numbers, unlike "Moon, the".
_WITH_COMMA = re.compile(r"[-+\d.,eE]*,[-+\d.,eE]*")
#: A cell between spaces: in quotation marks, or a word with the unit in brackets that follows it.
_WORD = re.compile(r'"(?P<quoted>[^"]*)"(?=\s|$)|[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?|\S+')
_NO_TEXT = "Leave gaps empty. In a column of text nothing is a number, and it has no unit."
_TABLE = "A line of names such as t, x, y, then lines of numbers."


class Columns(dict[str, np.ndarray]):
    """Columns of a table by name.

    A copy has the units as well, and so has a union with other columns, ``table | {"x": x}``;
    ``dict(table)`` has no units. A column that is assigned, by ``table["x"] = 1000 * table["x"]``
    or a union, has none until one is stated: ``table.units["x"] = "m"``. Where the column that it
    replaces had another unit than the scene, `fit` asks for it.

    Attributes:
      units: the unit of each column by name, of those whose heads have one.
      replaced: the former units of columns that were replaced.
    """

    def __init__(self) -> None:
        super().__init__()
        self.units: dict[str, str] = {}
        self.replaced: dict[str, str] = {}

    def __setitem__(self, name: str, column: np.ndarray) -> None:
        """A column, whose unit is not known."""
        super().__setitem__(name, column)
        if name in self.units:
            self.replaced[name] = self.units.pop(name)

    def __reduce__(self) -> tuple:
        """How copies and files of pickle build it: its parts, since an assignment drops a unit."""
        return _columns, (dict(self), self.units, self.replaced)

    def copy(self) -> "Columns":
        """The same columns, with their units."""
        return self | {}

    def update(self, *others: Any, **columns: Any) -> None:
        """Other columns in place of those of their names, or beside them."""
        for name, column in dict(*others, **columns).items():
            self[name] = column
        for other in others:
            self.units |= getattr(other, "units", {})
            self.replaced |= getattr(other, "replaced", {})

    def __or__(self, other: Any) -> "Columns":
        """These columns and others, which replace those of their names."""
        both = Columns()
        both.update(self)
        both.update(other)
        return both

    def __ior__(self, other: Any) -> "Columns":
        """Other columns in place of those of their names, or beside them."""
        self.update(other)
        return self


def _columns(columns: dict, units: dict[str, str], replaced: dict[str, str]) -> Columns:
    found = Columns()
    found.update(columns)
    found.units, found.replaced = dict(units), dict(replaced)
    return found


def read_csv(path: str | Path, *, names: Sequence[str] | None = None) -> Columns:
    r"""The columns of a table in a text file, by name; from `write_csv` or other programs.

    Columns are separated by commas, semicolons, tabs or spaces. Numbers may have decimal commas,
    in quotes where commas separate columns too. Lines that begin with # or sep= are skipped, as are
    titles: lines before the names that have another number of columns, or empty ones. Where no line
    has the names, the last line above the table that begins with # has them, if it has as many. A
    unit in brackets behind a name is taken off: cm, mm, ms, degrees and rpm, also in quotients such
    as mm/s, become m, s, radians and rad/s; others stay, and `fit` converts them. "time" is called
    "t". A column in which nothing is a number, such as one of names, is one of text.
    `jaxdyn.read_bodies` makes a scene of a table of bodies.

    Args:
      path: path of the file.
      names: names of the columns, for a file without a line of names.
    Returns:
      Arrays (s,) by name, of floats with NaN for empty places or of text; its attribute `units` has
      the units. A column that is assigned later has none until one is stated, as in
      ``table.units["x"] = "m"``.
    Raises:
      ValueError: `path` cannot be read, a line has another number of columns, a column has numbers
        and text, or two columns have one name.
    Example:
      >>> import tempfile, jaxdyn
      >>> with tempfile.TemporaryDirectory() as folder:
      ...     with open(f"{folder}/track.csv", "w") as file:
      ...         _ = file.write("time (s),angle [deg]\n0.0,90\n0.1,\n")
      ...     table = jaxdyn.read_csv(f"{folder}/track.csv")
      >>> {name: column.round(4).tolist() for name, column in table.items()}
      {'t': [0.0, 0.1], 'angle': [1.5708, nan]}
    """
    data = content(path, MAX_BYTES, "Give the path of a table.", "path")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise fail("path", "a table as text", f"{path}, which is none", _TABLE) from error
    given, rows, decimal = _names_and_rows(text, names, path)
    heads = [_HEAD.fullmatch(name.strip()) for name in given]
    found = Columns()
    for i, name in enumerate(_column_names([head["name"] for head in heads if head])):
        head = heads[i]
        assert head is not None  # all text matches
        if name in found:
            raise fail("names", "different ones", f"{name} twice", "Is a line of names missing?")
        unit = (head["unit"] or "").strip()
        cells = [_cell(row, i, given, path) for row in rows]
        if name != _TIMES[0] and not unit and _is_text(cells):
            found[name] = np.array(cells, str)
            continue
        numbers = [
            _number(cell, (row.line, given[i].strip()), decimal, path)
            for row, cell in zip(rows, cells, strict=True)
        ]
        found[name], unit = _in_si(np.array(numbers, float), unit)
        if unit:
            found.units[name] = unit
    return found


def _names_and_rows(
    text: str, names: Sequence[str] | None, path: str | Path
) -> tuple[list[str], list["_Row"], bool]:
    """The names of columns in a text, the lines below them, and whether commas are decimal ones.

    Args:
      text: the text.
      names: names of the columns, for a text without a line of names.
      path: path of the file, for messages.
    """
    # A tab at an end of a line may stand beside an empty cell.
    every = [(i, line.strip(" ")) for i, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(i, line) for i, line in every if not line.startswith(("#", "sep="))]
    if not lines:
        raise fail("path", "a table as text", f"{path} without lines", _TABLE)
    above = every[every.index(lines[0]) - 1][1] if every[0] != lines[0] else ""
    lines = lines[_titles([line for _, line in lines]) :]
    separator = _separator(lines[0][1])
    rows = [_Row(i, _cells(line, separator)) for i, line in lines]
    if names is None:
        remark = above.lstrip("#").strip() if above.startswith("#") else ""
        names, rows = _take_names(rows, _cells(remark, separator) if remark else [], path)
    decimal = separator != "," or _commas_are_decimal(rows, path)
    # Some programs end each line with a separator.
    if names and not names[-1] and not any(row.cells[-1] for row in rows):
        names = names[:-1]
    ended = [row.cells[:-1] if not row.cells[-1] else row.cells for row in rows]
    rows = [
        row if len(row.cells) <= len(names) else _Row(row.line, cells)
        for row, cells in zip(rows, ended, strict=True)
    ]
    return list(names), rows, decimal


def _take_names(
    rows: list["_Row"], remark: list[str], path: str | Path
) -> tuple[list[str], list["_Row"]]:
    """The names of columns, from the first row or from the remark above it; and the other rows."""
    first = rows[0].cells
    named = len(remark) == len(first) and not any(map(_is_number, remark))
    if named and any(_is_number(cell.replace(",", ".")) for cell in first):
        return remark, rows
    if len(rows) == 1:
        raise fail("path", "lines of numbers below the names", f"none in {path}", _TABLE)
    if all(_is_number(name.replace(",", ".")) for name in first):
        raise fail("path", "a line of names first", repr(" ".join(first))[:42], "Pass names=[...].")
    return first, rows[1:]


def _column_names(names: Sequence[str]) -> list[str]:
    """The names of columns, "t" for the times; beside such a column T is a temperature."""
    timed = any(name == "t" or name.casefold() == "time" for name in names)
    may_be = [name.casefold() in _TIMES and not (timed and name == "T") for name in names]
    return ["t" if time else name for name, time in zip(names, may_be, strict=True)]


def _in_si(column: np.ndarray, unit: str) -> tuple[np.ndarray, str]:
    """A column and its unit, both in SI units if the unit contains one of `_CONVERTED`."""
    parts = re.split(r"[\s/*^\d-]+", unit)
    known = measure(unit)
    if known is None or not any(_CONVERTED.fullmatch(part) for part in parts):
        return column, unit
    up = [f"{base}^{n}" if n > 1 else base for base, n in known.powers if n > 0]
    down = [f"{base}^{-n}" if n < -1 else base for base, n in known.powers if n < 0]
    return column * known.size, "/".join([" ".join(up) or "1", *down])


def _titles(lines: Sequence[str]) -> int:
    """Number of lines above that of the names, the first with as many cells as lines of numbers."""
    first = (line for line in lines if _is_number(_first_cell(line).replace(",", ".")))
    # In a table whose first column is text, at least the last line is one of numbers.
    line = next(first, lines[-1])
    separator = _separator(line)
    count = len(_cells(line, separator))
    # A title may be filled up with empty cells, as ",mass A," of Tracker.
    heads = (_cells(one, separator) for one in lines)
    named = (
        i
        for i, names in enumerate(heads)
        if len(names) == count
        and all(name.strip() and not _is_number(name.replace(",", ".")) for name in names)
    )
    return next(named, 0)


def _first_cell(line: str) -> str:
    return _cells(line, _separator(line))[0]


class _Row(NamedTuple):
    """A line of a table: its number in the file, and its cells."""

    line: int
    cells: list[str]


def _commas_are_decimal(rows: list[_Row], path: str | Path) -> bool:
    """Whether numbers have decimal commas, in quotes, where commas separate the columns too."""
    cells = [(row.line, cell.strip()) for row in rows for cell in row.cells]
    with_commas = [(line, cell) for line, cell in cells if _WITH_COMMA.fullmatch(cell)]
    if with_commas and not any(_DECIMAL.fullmatch(cell) for _, cell in with_commas):
        line, cell = with_commas[0]
        came = f"{repr(cell)[:60]} in line {line}"
        remedy = "Is the comma a decimal one, or one between thousands? Write points, without it."
        raise fail("path", f"numbers in {path}", came, remedy)
    return bool(with_commas)


def _separator(line: str) -> str | None:
    return next((mark for mark in ";\t," if mark in line), None)


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is not None:
        return next(csv.reader([line], delimiter=separator))
    words = _WORD.finditer(line)
    return [word[0] if word["quoted"] is None else word["quoted"] for word in words]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _cell(row: _Row, i: int, names: Sequence[str], path: str | Path) -> str:
    """The text in column i of a row, which has as many cells as there are names."""
    line, cells = row
    if len(cells) != len(names):
        came = f"{len(cells)} in line {line}: {cells}"
        text = not all(_is_number(one) for one in cells if one)
        remedy = "Put text with spaces or separators in quotation marks." if text else ""
        raise fail("path", f"{len(names)} columns in each line of {path}", came[:90], remedy)
    return cells[i].strip()


def _is_text(cells: Sequence[str]) -> bool:
    """Whether a column has text, and nothing that is a number or may be meant as one."""
    return any(cells) and not any(
        _is_number(_FORTRAN.sub("e", cell.replace(",", "."))) or _THOUSANDS.fullmatch(cell)
        for cell in cells
    )


def _number(cell: str, where: tuple[int, str], decimal: bool, path: str | Path) -> float:
    """The number in a cell; NaN where it is empty.

    Args:
      cell: its text.
      where: the number of its line and the name of its column, for messages.
      decimal: whether commas are decimal ones.
      path: path of the file, for messages.
    """
    if not cell:
        return math.nan
    try:
        return float(cell)  # most are plain
    except ValueError:
        text = cell.replace(",", ".") if decimal else cell
    try:
        return float(_FORTRAN.sub("e", text))
    except ValueError:
        remedy = _MARKS if _THOUSANDS.fullmatch(cell) else _NO_TEXT
        line, name = where
        came = f"{repr(cell)[:60]} in line {line}, column {name}"
        raise fail("path", f"numbers in {path}", came, remedy) from None


def _finite(values) -> list:
    found = np.asarray(values).astype(object)
    found[~np.isfinite(values)] = None
    return found.tolist()
