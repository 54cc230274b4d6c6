"""Positions and velocities in the formats of astronomers: tables, JPL Horizons and REBOUND.

A vector table of Horizons is the text that its web page, its e-mail service and its programming
interface return for "Vector Table", with or without "CSV format": lines between $$SOE and $$EOE.
REBOUND (Rein and Liu, 2012) is optional; a simulation is read by its attributes.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxdyn import _checks, _labelled
from jaxdyn._checks import check_first
from jaxdyn._text import fail
from jaxdyn._units import conversion
from jaxdyn.effects import PairGravity
from jaxdyn.files.input_files import MAX_BYTES, content
from jaxdyn.files.tables import Columns, read_csv
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Scene, check_units
from jaxdyn.scenes.nbody import gravitational_constant, n_body

_NUMBER = r"[+-]?\d+\.?\d*(?:[EeDd][+-]?\d+)?"
_BEGIN, _END = "$$SOE", "$$EOE"
_NAMES = ("X", "Y", "Z", "VX", "VY", "VZ")
_ENTRY = re.compile(rf"\b(?P<name>V?[XYZ])\s*=\s*(?P<value>{_NUMBER})")
_TIME = re.compile(rf"^\s*(?P<time>{_NUMBER})\s*(?:=|,)")
_HORIZONS = "Save the text of a Vector Table (table type 2 or 3) of ssd.jpl.nasa.gov/horizons."


class Ephemeris(NamedTuple):
    """Positions and velocities of a body at some times.

    Attributes:
      name: name of the body in the table.
      units: units of the table: "AU-D", "KM-S" or "KM-D".
      ts: (s,) Julian dates, in barycentric dynamical time [day].
      r: (s, 3) positions.
      v: (s, 3) velocities.
    """

    name: str
    units: str
    ts: np.ndarray
    r: np.ndarray
    v: np.ndarray


def read_horizons(path: str | Path) -> Ephemeris:
    """The vector table of JPL Horizons in a text file.

    Args:
      path: path of the file.
    Raises:
      ValueError: `path` cannot be read, is not such a table, or has several.
    """
    data = content(path, MAX_BYTES, _HORIZONS, "path")
    text = data.decode("utf-8", errors="replace")
    before, begin, rest = text.partition(_BEGIN)
    body, end, _ = rest.partition(_END)
    if not (begin and end):
        raise fail("path", f"a table between {_BEGIN} and {_END}", str(path), _HORIZONS)
    if tables := rest.count(_BEGIN):
        remedy = "Save the table of each body in a file of its own."
        raise fail("path", "one table", f"{tables + 1} in {path}", remedy)
    name = re.search(r"Target body name:\s*(.+?)\s*(?:\(|\{|$)", before, re.MULTILINE)
    units = re.search(r"Output units\s*:\s*([A-Z]+-[A-Z]+)", before)
    ts, rows = _columns(before, body) if "=" not in body else _blocks(body)
    if not ts or any(len(row) != len(_NAMES) for row in rows):
        wanted = "six numbers, positions and velocities, at each time"
        raise fail("path", wanted, str(path), _HORIZONS)
    states = np.array(rows, float)
    return Ephemeris(
        name=name[1] if name else Path(path).stem,
        units=units[1] if units else "",
        ts=np.array(ts, float),
        r=states[:, :3],
        v=states[:, 3:],
    )


def _columns(before: str, body: str) -> tuple[list[float], list[list[float]]]:
    """Times and states from lines "date, calendar date, x, y, z, vx, vy, vz, ...".

    The line of names above them gives the columns: one of delta-T may come before x.
    """
    heads = [[cell.strip() for cell in line.split(",")] for line in before.splitlines()]
    named = [head for head in heads if {*_NAMES} <= {*head}]
    places = [named[-1].index(name) for name in _NAMES] if named else list(range(2, 8))
    ts, rows = [], []
    for line in filter(str.strip, body.splitlines()):
        cells = [cell.strip() for cell in line.split(",")]
        state = [cells[i] for i in places if i < len(cells)]
        if not all(re.fullmatch(_NUMBER, cell) for cell in (cells[0], *state)):
            raise fail("path", "numbers in columns", repr(line)[:60], _HORIZONS)
        ts.append(_number(cells[0]))
        rows.append([_number(cell) for cell in state])
    return ts, rows


def _blocks(body: str) -> tuple[list[float], list[list[float]]]:
    """Times and states from blocks of lines that begin with a date, followed by X = ...

    With "Vector table labels" off, the X = is missing.
    """
    ts: list[float] = []
    rows: list[dict[str, float]] = []
    for line in body.splitlines():
        if time := _TIME.match(line):
            ts.append(_number(time["time"]))
            rows.append({})
        elif rows:
            named = {x["name"]: _number(x["value"]) for x in _ENTRY.finditer(line)}
            # Without labels the numbers stand alone, in the same order.
            bare = [] if "=" in line else [_number(x) for x in re.findall(_NUMBER, line)]
            rows[-1] |= named or dict(zip(_NAMES[len(rows[-1]) :], bare, strict=False))
    return ts, [[row[name] for name in _NAMES if name in row] for row in rows]


def _number(text: str) -> float:
    return float(text.replace("D", "E").replace("d", "e"))


#: Other names of columns in tables of bodies, in small letters.
_ALSO = {"mass": "m", "mu": "gm", "body": "name"}
_BODIES = "columns of numbers x, y, z, vx, vy, vz, and m or GM"
_GIVE_UNITS = 'Pass units=("AU", "Msun", "day"), or those in which the scene is to be.'


def read_bodies(path: str | Path, *, units: Sequence[str] = (), G=None, t1=1.0) -> Scene:
    r"""The scene of the bodies in a text file, under their gravity: a table with a line for each.

    The table has the columns x, y, z, vx, vy, vz, and m or GM, in any order; without z and vz the
    bodies move in a plane. Their names are in a column "name", or in the only one of text if they
    differ. Other columns are ignored; small and capital letters are alike. `jaxdyn.read_csv` says
    what else a file may have. `scenes.barycentric` brings the centre of mass to rest at the origin.

    Args:
      path: path of the file.
      units: names of the units of length, mass and time of the scene; see `scenes.n_body`. Columns
        with a unit in brackets behind their name are converted to these; others are taken to be in
        them.
      G: gravitational constant in these units; by default that of nature.
      t1: span.
    Raises:
      ValueError: `path` cannot be read, a column is missing, has gaps or a unit that is not known,
        or neither units nor G are given.
    Example:
      >>> import tempfile, jaxdyn
      >>> with tempfile.TemporaryDirectory() as folder:
      ...     with open(f"{folder}/bodies.txt", "w") as file:
      ...         _ = file.write("name m x y vx vy [km/s]\nSun 1 0 0 0 0\nEarth 0 1 0 0 29.8\n")
      ...     scene = jaxdyn.read_bodies(f"{folder}/bodies.txt", units=("AU", "Msun", "day"))
      >>> [name for name, _ in scene.labels()][:3], float(scene.y0[-1].round(4))
      (['x_Sun', 'y_Sun', 'x_Earth'], 0.0172)
    """
    if not len(units) and G is None:
        raise fail("units", "names of the units of length, mass and time", "none", _GIVE_UNITS)
    if len(units):
        check_units(units)
    strength = gravitational_constant(units) if G is None else G
    table = read_csv(path)
    named = {_ALSO.get(name.lower(), name.lower()): name for name in table}
    axes = "xyz" if {"z", "vz"} & {*named} else "xy"
    masses = "gm" if "gm" in named else "m"
    wanted = dict.fromkeys(axes, (1, 0, 0)) | {f"v{x}": (1, 0, -1) for x in axes}
    wanted[masses] = (3, 0, -2) if masses == "gm" else (0, 1, 0)
    if missing := [name for name in wanted if name not in named]:
        came = f"{', '.join(table)} in {path}"
        raise fail("path", _BODIES, came, f"Of these {missing[0]} is missing.")
    found = {name: _in_units(table, named[name], units, powers) for name, powers in wanted.items()}
    m = found[masses]
    scene = n_body(
        np.stack([found[x] for x in axes], axis=1),
        np.stack([found[f"v{x}"] for x in axes], axis=1),
        m=m / strength if masses == "gm" else m,
        G=strength,
        names=_names_of_bodies(table, named),
        t1=t1,
        units=units,
    )
    scene.check()  # here, where a message can still be about the file
    return scene


def _in_units(
    table: Columns, name: str, units: Sequence[str], powers: tuple[int, ...]
) -> np.ndarray:
    """A column in powers of the units of length, mass and time; a unit in brackets is converted."""
    column, given = table[name], table.units.get(name, "")
    if column.dtype.kind != "f":
        raise fail(f"column {name}", "numbers", "text", "Leave gaps empty, without a mark.")
    if np.isnan(column).any():
        remedy = "Write 0 for the mass of a test particle."
        came = f"a gap for body {np.flatnonzero(np.isnan(column))[0] + 1}"
        raise fail(f"column {name}", "a number for each body", came, remedy)
    if not given:
        return column
    if not len(units):
        raise fail("units", "the units of the scene", f"{name} in {given}", _GIVE_UNITS)
    up, down = (
        " ".join(
            unit if n * sign == 1 else f"{unit}^{n * sign}"
            for unit, n in zip(units, powers, strict=True)
            if n * sign > 0
        )
        for sign in (1, -1)
    )
    wanted = f"{up}/{down}" if down else up
    return column * conversion(f"column {name}", given, wanted)


def _names_of_bodies(table: Columns, named: Mapping[str, str]) -> list[str]:
    """The names of the bodies, which may be numbers; none without such a column."""
    texts = [name for name, column in table.items() if column.dtype.kind == "U"]
    differ = len(texts) == 1 and len({*table[texts[0]].tolist()}) == len(table[texts[0]])
    if "name" in named:
        texts = [named["name"]]
    elif not differ:
        return []
    return [x if isinstance(x, str) else f"{x:.15g}" for x in table[texts[0]].tolist()]


def from_rebound(sim: Any, t1=1.0, *, units: Sequence[str] = ()) -> Scene:
    """The scene of a simulation of REBOUND: its bodies in their present state, under its gravity.

    Args:
      sim: a `rebound.Simulation`, with point masses and Newtonian gravity.
      t1: span, in the units of the simulation.
      units: names of the units of length, mass and time of the simulation, such as
        ("AU", "Msun", "day"); see `Scene`. They are not converted.
    Raises:
      ValueError: `sim` has no bodies, is not a simulation, or its gravity is not that of point
        masses in free space.
    Limits: forces that were added in Python or C, and those of REBOUNDx, are not carried over.
    """
    try:
        bodies, G = list(sim.particles), float(sim.G)
        # Its variational particles, as `init_megno` adds them, come last.
        bodies = bodies[: len(bodies) - int(getattr(sim, "N_var", 0))]
        r = np.array([[p.x, p.y, p.z] for p in bodies], float)
        v = np.array([[p.vx, p.vy, p.vz] for p in bodies], float)
        m = np.array([p.m for p in bodies], float)
    except AttributeError as error:
        raise fail("sim", "a rebound.Simulation", type(sim).__name__) from error
    if not len(bodies):
        raise fail("sim", "a simulation with bodies", "none")
    if (gravity := getattr(sim, "gravity", "basic")) == "none":
        raise fail("sim", "Newtonian gravity", repr(gravity))
    if (boundary := getattr(sim, "boundary", "none")) in ("periodic", "shear"):
        raise fail("sim", "bodies in free space", f"a boundary {boundary!r}")
    if softening := float(getattr(sim, "softening", 0.0)):
        raise fail("sim", "Newtonian gravity", f"a softening of {softening:g}")
    if (active := int(getattr(sim, "N_active", -1))) >= 0 and m[active:].any():
        remedy = "Set these masses to 0."
        raise fail("sim", "bodies that all attract", f"masses beyond N_active = {active}", remedy)
    return n_body(r, v, m=m, G=G, t1=t1, units=units)


@check_first
def to_rebound(scene: Scene) -> Any:
    """A simulation of REBOUND with the bodies of a scene, from its start, under its gravity.

    Args:
      scene: a scene of free points in space or in a plane, with one `PairGravity`.
    Returns:
      A `rebound.Simulation` whose integrator is REBOUND's default.
    Raises:
      ValueError: REBOUND is not installed, or the scene has other effects, or softened gravity.
    """
    kinds = [type(effect).__name__ for effect in scene.effects]
    if not isinstance(scene.system, FreePoints) or kinds != ["PairGravity"]:
        got = f"{type(scene.system).__name__} with {', '.join(kinds) or 'no effect'}"
        raise _checks.fail("scene", "free points under PairGravity alone", got)
    gravity = scene.effects[0]
    assert isinstance(gravity, PairGravity)
    sim = _labelled.package("rebound", "to_rebound").Simulation()
    sim.G = float(gravity.G)
    r, v, m = (np.asarray(x) for x in scene.points(0.0, scene.y0))
    flat = np.zeros((len(m), 3 - r.shape[1]))
    for mass, place, velocity in zip(m, np.c_[r, flat], np.c_[v, flat], strict=True):
        x, y, z, vx, vy, vz = map(float, (*place, *velocity))
        sim.add(m=float(mass), x=x, y=y, z=z, vx=vx, vy=vy, vz=vz)
    return sim
