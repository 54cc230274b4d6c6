"""Results as plain data: the samples of a motion, a record for JSON, CSV files of anything."""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from jaxdyn._records.kinds import check_first
from jaxdyn._records.labelled import Labelled
from jaxdyn._text import second
from jaxdyn.accuracy.end_error import EndError
from jaxdyn.analysis.energy_change import energy_change
from jaxdyn.files.output_files import replace, table_path
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.status import Status


@check_first
def samples(motion: Trajectory | HybridTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Times (s,) [s] and states (s, k) of all phases, and after the last exit of a chain."""
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
    return [name if unit == "1" else f"{name} [{unit}]" for name, unit in labels]


@check_first
def arrived(motion: Trajectory | HybridTrajectory) -> bool:
    """Whether a motion reached the end of its span, or a terminal event."""
    if isinstance(motion, HybridTrajectory):
        done = motion.ended or motion.t >= motion.pieces[-1].scene.t1
        return motion.status == Status.OK and bool(done)
    return motion.ok


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
        "warning": " ".join(dict.fromkeys(p.warning for p in pieces if p.warning)),
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
      path: of the .csv file.
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
      path: of the .csv file.
      names: of the columns, with their units.
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


def _finite(values) -> list:
    found = np.asarray(values).astype(object)
    found[~np.isfinite(values)] = None
    return found.tolist()
