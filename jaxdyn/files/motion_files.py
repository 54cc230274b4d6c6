"""Motions as files: archives of NumPy with the samples and a record of the scene.

``numpy.load(path)["ys"]`` has the samples; names of the k-th phase of a chain begin with "k/". The
entry "motion.json" has the scene (for a batch, that of its first motion) and everything else that
is not an array.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import _checks, solvers
from jaxdyn._checks import check_first, fail
from jaxdyn.files import archives
from jaxdyn.files.codec import decode_scene, encode_scene
from jaxdyn.files.layout import Layout
from jaxdyn.integrate.errors import Estimate
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.solvers import Method
from jaxdyn.status import Status

LAYOUT = Layout("jaxdyn-motion", 2, "`motion.save`", {1: False})
RECORD = "motion.json"
_REMEDY = "Give the path of a file that `motion.save` wrote; if it is one, it is damaged."
#: Methods by their names in files.
_EXPORTED = (getattr(solvers, name) for name in solvers.__all__)
_METHODS = {x.name: x for x in _EXPORTED if isinstance(x, Method)}
#: Type and axes of each array of a motion, after the axes of a batch: s samples, k entries.
_ARRAYS = {
    "ts": ("float", "s"),
    "ys": ("float", "sk"),
    "steps": ("int", ""),
    "rejected": ("int", ""),
    "status": ("int", ""),
    "stiff": ("bool", ""),
    "switched": ("bool", ""),
    "dt": ("float", ""),
}
_ESTIMATE = {
    "ts": ("float", "s"),
    "ys": ("float", "sk"),
    "error": ("float", "sk"),
    "rounding": ("float", "sk"),
    "scale": ("float", "k"),
    "fineness": ("float", "2"),
    "wanted": ("float or int", ""),
}
_KINDS = {"float": "f", "int": "i", "bool": "b", "float or int": "fi"}
_ABSENT = {"dt", "error/wanted", "switched"}  # may be None, or missing in an old file
_MAY_BE_NAN = {"ys", "error/ys", "error/error", "error/rounding"}
_WORDS = ("kind", "solver", "other")  # fields of an estimate that are texts


@check_first
def save(path: str | Path, motion: Trajectory | HybridTrajectory) -> None:
    """Write a motion with its scene, atomically; see `Trajectory.save`."""
    _checks.check_untraced("motion", motion, "Save what a compiled function returns.")
    chain, pieces, arrays = None, {"": motion}, {}
    if isinstance(motion, HybridTrajectory):
        pieces = {f"{i}/": piece for i, piece in enumerate(motion.pieces)}
        arrays = {"t": np.asarray(motion.t), "y": np.asarray(motion.y)}
        chain = {
            "names": list(motion.names),
            "path": [list(step) for step in motion.path],
            "ended": bool(motion.ended),
            "status": motion.status.name,
        }
    for prefix, piece in pieces.items():
        found = _take(_arrays(piece), _first(piece).scene, piece.error is not None)
        arrays |= {prefix + name: x for name, x in found.items()}
    record = {"pieces": list(map(_record, pieces.values())), "chain": chain}
    archives.write(path, RECORD, LAYOUT.header | record, arrays)


def load(
    path: str | Path, scene: Scene | Mapping[str, Scene] | None = None
) -> Trajectory | HybridTrajectory:
    """The motion in a file that `motion.save` wrote, with its scene.

    Classes of the scene are looked up among those that are imported; nothing in a file is executed.

    Args:
      path: path of the .npz file.
      scene: for a scene that holds functions, such as `jaxdyn.ode`, a scene with these functions;
        its numbers are replaced by those of the file. For a chain of phases, scenes by the names of
        their phases. It is not used if the file has the whole scene.
    Returns:
      The motion, or the chain of phases, equal to the saved one to the bit.
    Raises:
      ValueError: `path` is not such a file of this version, it is damaged or edited, its scene
        names a class that is not imported, or 64-bit floats are off.
    """
    _checks.float64()
    record, arrays, digested = archives.read(path, RECORD, _REMEDY)
    LAYOUT.check(record, "path")
    if not digested and record["version"] not in LAYOUT.older:
        raise _refusal("a digest at its end", "none")
    try:
        motion = _decode(record, arrays, scene)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise _refusal("a complete motion", f"{type(error).__name__} {error}"[:80]) from error
    if arrays:
        raise _refusal("the entries of a motion", f"also {sorted(arrays)[0]!r}"[:80])
    return motion


def _refusal(expected: str, got: Any) -> ValueError:
    return fail("path", f"a motion file with {expected}", got, _REMEDY)


def _decode(
    record: dict[str, Any], arrays: dict[str, np.ndarray], given: Any
) -> Trajectory | HybridTrajectory:
    """The motion of a record; its arrays are taken out of `arrays`."""
    pieces, chain = record["pieces"], record["chain"]
    if chain is None:
        if len(pieces) != 1:
            raise _refusal("one motion, or a chain", f"{len(pieces)} motions")
        return _piece(pieces[0], arrays, given)
    found = []
    for i, piece in enumerate(pieces):
        own = {name: arrays.pop(name) for name in [*arrays] if name.startswith(f"{i}/")}
        own = {name.removeprefix(f"{i}/"): x for name, x in own.items()}
        one = given.get(chain["names"][i]) if isinstance(given, Mapping) else given
        found.append(_piece(piece, own, one))
        arrays |= {f"{i}/{name}": x for name, x in own.items()}  # what no motion has
    return _chain(chain, tuple(found), arrays)


def _first(piece: Trajectory) -> Trajectory:
    """The first motion of a batch."""
    return piece.one(*(0 for _ in piece.batch_shape))


def _leaves(scene: Scene) -> dict[str, Any]:
    """The numbers of a scene by their paths in it, such as "scene.system.m"."""
    found, _ = jax.tree_util.tree_flatten_with_path(scene)
    return {f"scene{jax.tree_util.keystr(keys)}": x for keys, x in found}


def _record(piece: Trajectory) -> dict[str, Any]:
    """The parts of a motion that are not arrays."""
    if piece.method is not None and _METHODS.get(piece.method.name) is not piece.method:
        remedy = "Save dataclasses.replace(motion, method=None), which only loses a warning."
        raise fail("method", "one of jaxdyn.solvers", piece.method.name, remedy)
    return {
        "scene": encode_scene(_first(piece).scene),
        "method": piece.method and piece.method.name,
        "error": piece.error and {word: getattr(piece.error, word) for word in _WORDS},
    }


def _arrays(piece: Trajectory) -> dict[str, np.ndarray]:
    """The arrays of a motion by name; for a batch, also those of the scene."""
    found = {name: getattr(piece, name) for name in _ARRAYS}
    if piece.error is not None:
        found |= {f"error/{name}": getattr(piece.error, name) for name in _ESTIMATE}
    if piece.batch_shape:
        found |= _leaves(piece.scene)
    return {name: np.asarray(x) for name, x in found.items() if x is not None}


def _shapes(
    scene: Scene, ts: np.ndarray, estimated: bool
) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Type and shape of each array of a motion or a batch, from its scene or its first scene."""
    *batch, s = ts.shape or (0,)
    sizes = {"s": s, "k": len(scene.y0), "2": 2}
    wanted = dict(_ARRAYS)
    if estimated:
        wanted |= {f"error/{name}": kind for name, kind in _ESTIMATE.items()}
    found = {name: (kind, tuple(sizes[i] for i in axes)) for name, (kind, axes) in wanted.items()}
    if batch:
        found |= {name: ("float", np.shape(x)) for name, x in _leaves(scene).items()}
    return {name: (kind, (*batch, *shape)) for name, (kind, shape) in found.items()}


def _take(arrays: dict[str, np.ndarray], scene: Scene, estimated: bool) -> dict[str, np.ndarray]:
    """The arrays of a motion of a scene, checked and taken out of `arrays`."""
    found = {}
    for name, (kind, shape) in _shapes(scene, arrays["ts"], estimated).items():
        if name in _ABSENT and name not in arrays:
            continue
        x = arrays.pop(name)
        if x.dtype.kind not in _KINDS[kind] or x.shape != shape or not x.size:
            raise fail(name, f"{kind} of shape {shape}", f"{x.dtype} of shape {x.shape}")
        if x.dtype.kind == "f" and name not in _MAY_BE_NAN and not np.isfinite(x).all():
            raise fail(name, "finite numbers", "others")
        found[name] = x
    status, ys = found["status"], found["ys"]
    if not np.isin(status, [*Status]).all():
        raise fail("status", f"codes from 0 to {max(Status):d}", status.max())
    if not (np.isfinite(ys) | (np.isnan(ys) & (status != Status.OK)[..., None, None])).all():
        raise fail("ys", "finite numbers, or NaN where a motion failed", "others")
    if min(found["steps"].min(), found["rejected"].min()) < 0:
        raise fail("steps", "counts >= 0", "others")
    return found


def _piece(
    record: dict[str, Any], arrays: dict[str, np.ndarray], given: Scene | None
) -> Trajectory:
    """One motion, or a batch, from its record and its arrays, which are taken out."""
    if record.keys() != {"scene", "method", "error"}:
        raise _refusal("scene, method and error of each motion", sorted(record))
    method, words = record["method"], record["error"]
    if method is not None and method not in _METHODS:
        raise _refusal("a method of jaxdyn.solvers", repr(method)[:40])
    scene = decode_scene(record["scene"], _REMEDY, given)
    found = {name: jnp.asarray(x) for name, x in _take(arrays, scene, words is not None).items()}
    if method is not None and "dt" not in found:
        raise _refusal("the step dt of a method of fixed step", "none")
    if found["ts"].ndim > 1:
        leaves = [found[name] for name in _leaves(scene)]
        scene = jax.tree.unflatten(jax.tree.structure(scene), leaves)
    error = None
    if words is not None:
        if words.keys() != {*_WORDS} or not all(isinstance(x, str) for x in words.values()):
            raise _refusal(f"the words {', '.join(_WORDS)} of an estimate", "others")
        error = Estimate(**{name: found.get(f"error/{name}") for name in _ESTIMATE}, **words)
    return Trajectory(
        scene=scene,
        **{name: found.get(name) for name in _ARRAYS},
        error=error,
        method=_METHODS.get(method),
    )


def _chain(
    record: dict[str, Any], pieces: tuple[Trajectory, ...], arrays: dict[str, np.ndarray]
) -> HybridTrajectory:
    """A chain from its record and its pieces."""
    if record.keys() != {"names", "path", "ended", "status"}:
        raise _refusal("names, path, end and status of a chain", sorted(record))
    names, path, ended = record["names"], record["path"], record["ended"]
    status, t, y = Status[record["status"]], arrays.pop("t"), arrays.pop("y")
    valid = (
        0 < len(pieces) == len(names)
        and not any(piece.batch_shape for piece in pieces)
        and isinstance(names, list)
        and all(isinstance(name, str) for name in names)
        and all([*map(type, step)] == [str, int] and step[1] >= 0 for step in path)
        and isinstance(ended, bool)
        and t.shape == ()
        and y.ndim == 1
        and t.dtype == y.dtype == float
        and (np.isfinite([t, *y]).all() or (status != Status.OK and not np.isinf([t, *y]).any()))
    )
    if not valid:
        raise _refusal("names, path, end and status of a chain that fit each other", "others")
    return HybridTrajectory(
        names=tuple(names),
        pieces=pieces,
        t=jnp.asarray(t),
        y=jnp.asarray(y),
        ended=ended,
        status=status,
        path=tuple(map(tuple, path)),
    )
