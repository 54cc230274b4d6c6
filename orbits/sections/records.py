"""Crossings of a section as plain data: a record for JSON, and a CSV file."""

from collections.abc import Sequence
from pathlib import Path

from jaxdyn._checks import check_first
from jaxdyn._text import with_null
from jaxdyn.files.tables import write_columns
from jaxdyn.status import Status
from orbits.sections.coordinates import names_of
from orbits.sections.tables import SectionPoints


@check_first
def as_json(points: SectionPoints) -> dict:
    """The crossings as a record for JSON; unknown numbers are None."""
    rows = zip(points.counts.tolist(), points.status.tolist(), strict=True)
    starts = [
        {
            "status": Status(code).name,
            "count": n,
            "energy": points.energies[i],
            "energy_drift": points.drift[i],
            "t": points.ts[i, :n].tolist(),
            "y": points.ys[i, :n].tolist(),
            "direction": points.directions[i, :n].tolist(),
        }
        for i, (n, code) in enumerate(rows)
    ]
    record = {
        "labels": names_of(points.scene),
        "coordinates": list(points.names),
        "message": points.message,
        "starts": starts,
    }
    return with_null(record)


def write_csv(path: str | Path, tables: Sequence[SectionPoints]) -> Path:
    """Write a CSV file with a line for each crossing, with all digits.

    Its columns are the number of the section and of the start, from 0, the energy of the start,
    the time, the direction, and the state.

    Args:
      path: path of the .csv file.
      tables: one or several sections of one scene.
    Raises:
      ValueError: `path` cannot be written.
      OSError: writing failed.
    """
    names = ["section", "start", "energy", "t", "direction", *names_of(tables[0].scene)]
    rows = (
        [number, start, with_null(points.energies[start]), t, direction, *y]
        for number, points in enumerate(tables)
        for start, n in enumerate(points.counts)
        for t, direction, y in zip(
            points.ts[start, :n].tolist(),
            points.directions[start, :n].tolist(),
            points.ys[start, :n].tolist(),
            strict=True,
        )
    )
    return write_columns(path, names, rows)
