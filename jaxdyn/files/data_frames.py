"""Motions as data frames of pandas and datasets of xarray; both packages are optional."""

from typing import Any

import numpy as np

from jaxdyn import _checks, _labelled
from jaxdyn._checks import check_first
from jaxdyn._labelled import Labelled, Values
from jaxdyn._text import second
from jaxdyn.integrate.phase import END, HybridTrajectory
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene

_UNTRACED = "Convert what a compiled function returns."


@check_first
def dataset(motion: Trajectory | HybridTrajectory) -> Any:
    """The samples of a motion as a Dataset; see `Trajectory.to_xarray`."""
    _labelled.package("xarray", "to_xarray")
    _checks.check_untraced("motion", motion, _UNTRACED)
    if isinstance(motion, HybridTrajectory):
        return _labelled.to_dataset(_labelled_phases(motion))
    shape = motion.batch_shape
    scene = _first_scene(motion)
    axes = (*_axes(shape), "sample" if shape else "t")
    time = Values(axes, motion.ts, _units(scene)["t"])
    return _labelled.to_dataset(
        Labelled({"t": time}, _labelled.entries(axes, motion.ys, scene.labels()))
    )


def _labelled_phases(motion: HybridTrajectory) -> Labelled:
    """The samples of the phases in order, and the state after the last exit, if there is one."""
    frames = frame(motion)
    units = frames.attrs["units"]
    coordinates = {
        "t": Values(("t",), frames.index, units["t"]),
        "phase": Values(("t",), frames.pop("phase").to_numpy(str)),
    }
    return Labelled(coordinates, {x: Values(("t",), frames[x], units[x]) for x in frames})


@check_first
def frame(motion: Trajectory | HybridTrajectory) -> Any:
    """The samples of a motion as a DataFrame; see `Trajectory.to_pandas`."""
    pandas = _labelled.package("pandas", "to_pandas")
    _checks.check_untraced("motion", motion, _UNTRACED)
    if isinstance(motion, HybridTrajectory):
        return _frame_of_phases(pandas, motion)
    found = _table(pandas, motion)
    found.attrs["units"] = _units(_first_scene(motion))
    return found


def _frame_of_phases(pandas: Any, motion: HybridTrajectory) -> Any:
    """The frames of the phases in order, and the state after the last exit, if there is one."""
    parts = [_table(pandas, piece) for piece in motion.pieces]
    names = list(motion.names)
    if motion.ended:
        parts.append(_rows(pandas, motion.pieces[-1].scene, [float(motion.t)], motion.y[None]))
        names.append(END)
    units = {}
    for piece in motion.pieces:  # their coordinates may differ
        units |= _units(piece.scene)
    found = pandas.concat(parts)
    found["phase"] = np.repeat(names, [len(part) for part in parts])
    found.attrs["units"] = units
    return found


def _table(pandas: Any, motion: Trajectory) -> Any:
    """The frame of one motion, or of a batch, which is numbered along its axes."""
    shape, ts, ys = motion.batch_shape, np.asarray(motion.ts), np.asarray(motion.ys)
    scene = _first_scene(motion)
    if not shape:
        return _rows(pandas, scene, ts, ys)
    numbers = [x.ravel() for x in np.indices(ts.shape)[:-1]]
    index = pandas.MultiIndex.from_arrays([*numbers, ts.ravel()], names=[*_axes(shape), "t"])
    return _rows(pandas, scene, index, ys.reshape(-1, ys.shape[-1]))


def _first_scene(motion: Trajectory) -> Scene:
    """The scene of a motion, or of the first of a batch."""
    return motion.one(*(0 for _ in motion.batch_shape)).scene


def _axes(shape: tuple[int, ...]) -> list[str]:
    """The names of the axes of a batch."""
    return ["motion"] if len(shape) == 1 else [f"motion {i}" for i in range(len(shape))]


def _rows(pandas: Any, scene: Scene, index: Any, ys: Any) -> Any:
    index = pandas.Index(index, name="t") if not isinstance(index, pandas.Index) else index
    columns = [name for name, _ in scene.labels()]
    return pandas.DataFrame(np.asarray(ys), index=index, columns=columns)


def _units(scene: Scene) -> dict[str, str]:
    """The unit of time and of each entry of the state; "1" for none."""
    labels = scene.labels()
    return {"t": second(labels) or "1", **dict(labels)}
