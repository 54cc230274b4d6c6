"""Many motions of one scene: thousands to millions of starts or parameters, on every core.

`run` splits them into batches, distributes the batches over threads or devices, see `batches`, and
collects the results; `stream` does so for batches that come one by one and never holds more than
a few of them. The program, see `lanes`, has one shape for any number of motions: it compiles once
for each kind of scene.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np
from rich.progress import Progress

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.ensemble.batches import Job, cores, device_kind, mesh_of, rows
from jaxdyn.ensemble.lanes import Ends, Motions
from jaxdyn.integrate.fixed import FixedField
from jaxdyn.integrate.march import Watch
from jaxdyn.integrate.spans import MAX_STEPS, RTOL, SolverOptions, host_floats, limits
from jaxdyn.scene import Scene, check_scene
from jaxdyn.solvers import Solver
from jaxdyn.solvers.choice import check_method

_NO_DERIVATIVES = "Ensembles have no derivatives; take jax.vmap of jaxdyn.solve, which has them."


@check_first
def run(
    scene: Scene,
    y0s=None,
    t1=None,
    *,
    params: Scene | None = None,
    t0=0.0,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
    fixed: bool = False,
    watch: Watch | None = None,
    chunk: int | None = None,
    threads: int | None = None,
    devices: Sequence | None = None,
    progress: bool = False,
) -> Ends:
    """The ends of many motions of one scene, each with its own steps.

    Args:
      scene: the scene, with the numbers that all motions share.
      y0s: (n, k) starts; by default the starts of `params`.
      t1: () or (n,) end times [s], after or before t0; the scenes' own spans by default.
      params: the scene again, where any number may have a first axis of n entries, one per
        motion, e.g. ``jax.vmap(make_scene)(values)``.
      t0: () or (n,) start times [s].
      rtol: relative tolerance of one step.
      atol: absolute tolerance of one step, in the units of the state; by default a quarter of
        rtol times the largest size so far of the entries of its kind, whatever the units
        (`scales.Groups`).
      solver: see `simulate`; an explicit method.
      max_steps: largest number of steps of a motion.
      fixed: make the scene's numbers, which all motions must share, constants of the program: a
        few per cent faster, but new ones recompile.
      watch: an observer, see `watches`; it may stop a motion.
      chunk: rows passed to a core or device at once; by default 2048 to a core, and as many as
        keep it busy to another device.
      threads: number of batches in flight; by default one for each core of a CPU, and one for
        any other device.
      devices: share each chunk among these `jax.Device`; they may belong to several processes of
        `jax.distributed`, each of which makes the same call of `run` and gets all results.
      progress: show a bar.
    Returns:
      The `Ends`, in NumPy arrays. A motion that fails has a status and NaN; none raises, and
      none slows down the others.
    Raises:
      ValueError: `y0s`, `params`, `t0` or `t1` has a wrong shape, or a tolerance, `max_steps`,
        `chunk` or `threads` is out of range.
    Limits: explicit methods; no derivatives. A rate with conditions (`jnp.sign`, `jnp.where`) takes
      no `watch`, and its motions run one after the other; on a GPU it is slow. The result of a
      motion does not depend on the others, but its last digits depend on the machine and on JAX's
      version.
    Example:
      >>> import numpy as np
      >>> from jaxdyn import ensemble, scenes
      >>> scene = scenes.cannonball(drag=0.0)
      >>> y0s = np.asarray(scene.y0) * np.linspace(1.0, 2.0, 5)[:, None]
      >>> ensemble.run(scene, y0s, 1.0).y1.shape
      (5, 4)
    """
    motions, shared = _motions(scene, y0s, t0, t1, params, fixed, rtol)
    n = len(motions.y0)
    options = SolverOptions(rtol=rtol, atol=atol, solver=solver, max_steps=max_steps)
    job = _job(scene, shared, options, watch=watch, chunk=chunk, threads=threads, devices=devices)
    # There are enough batches to keep all threads busy to the end.
    batches = job.threads * math.ceil(n / (job.threads * job.rows))
    edges = np.linspace(0, n, batches + 1).astype(int)
    slices = [slice(a, b) for a, b in itertools.pairwise(edges) if b > a]
    parts = job.results(jax.tree.map(lambda x, s=s: x[s], motions) for s in slices)
    done = []
    with Progress(disable=not progress) as bar:
        task = bar.add_task("motions", total=n)
        for part in parts:
            done.append(part)
            bar.advance(task, len(part.status))
    return jax.tree.map(lambda *parts: np.concatenate(parts), *done)


@check_first
def stream(
    scene: Scene,
    batches: Iterable,
    t1=None,
    *,
    t0=0.0,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
    fixed: bool = False,
    watch: Watch | None = None,
    chunk: int | None = None,
    threads: int | None = None,
    devices: Sequence | None = None,
) -> Iterator[Ends]:
    """The ends of batches of starts, in order, as they finish; see `run`.

    Args:
      scene: the scene, with the numbers of all motions.
      batches: batches of starts (m, k), consumed lazily; a few are in flight, each on one core.
      t1: () end time [s].
      t0: () start time [s].
      rtol: relative tolerance.
      atol: absolute tolerance.
      solver: see `simulate`; an explicit method.
      max_steps: largest number of steps of a motion.
      fixed: make the scene's numbers constants of the program, see `solve`.
      watch: an observer.
      chunk: rows passed to a core or device at once, see `run`.
      threads: number of batches in flight.
      devices: share each chunk among these devices.
    Example:
      >>> import numpy as np
      >>> from jaxdyn import ensemble, scenes
      >>> scene = scenes.cannonball(drag=0.0)
      >>> starts = (np.asarray(scene.y0) * [[speed]] for speed in (1.0, 2.0))
      >>> [part.y1.shape for part in ensemble.stream(scene, starts, 1.0)]
      [(1, 4), (1, 4)]
    """
    _checks.check_on_host("ensemble", (scene, t0, t1, rtol), _NO_DERIVATIVES)
    shared = FixedField(scene.field) if fixed else scene.field
    options = SolverOptions(rtol=rtol, atol=atol, solver=solver, max_steps=max_steps)
    job = _job(scene, shared, options, watch=watch, chunk=chunk, threads=threads, devices=devices)
    return job.results(_motions(scene, y0s, t0, t1, None, fixed, rtol)[0] for y0s in batches)


def _job(
    scene: Scene, shared, options: SolverOptions, *, watch, chunk: int | None, threads, devices
) -> Job:
    if not isinstance(watch, Watch | None):
        raise _checks.fail("watch", "a Watch", repr(watch), "See jaxdyn.ensemble.watches.")
    if watch is not None:
        watch.check_functions()
    odd = [x for x in jax.tree.leaves(watch) if not eqx.is_array_like(x)]
    if odd:
        raise _checks.fail(
            "watch", "modules with numbers", odd[0], "Make functions in it modules with __call__."
        )
    remedy = "jax.devices() lists them."
    if devices is not None and not isinstance(devices, Sequence | np.ndarray):
        raise _checks.fail("devices", "a list of devices", repr(devices), remedy)
    if devices is not None and not len(devices):
        raise _checks.fail("devices", "at least one", "none", remedy)
    for device in () if devices is None else devices:
        if not isinstance(device, jax.Device):
            raise _checks.fail("devices", "a list of devices", repr(device), remedy)
    # Programs that communicate across devices or processes must run in one order everywhere.
    kind = device_kind(devices)
    threads = 1 if devices is not None else cores() if threads is None else threads
    chunk = rows(kind, len(scene.y0)) if chunk is None else chunk
    for name, number in {"chunk": chunk, "threads": threads}.items():
        _checks.whole(name, number)
    mesh = None if devices is None else mesh_of(devices)
    method = check_method(scene, options.solver, several=True)
    if not method.several:
        wanted = "a method that crosses several steps side by side"
        remedy = "Leave it out, or take jax.vmap of jaxdyn.solve with it."
        raise _checks.fail("solver", wanted, method.name, remedy)
    return Job(
        shared=shared,
        limits=limits(options),
        watch=watch,
        method=method,
        chunk=chunk,
        together=kind != "cpu",
        threads=threads,
        mesh=mesh,
    )


def _motions(
    scene: Scene, y0s, t0, t1, params: Scene | None, fixed: bool, rtol
) -> tuple[Motions, Any]:
    """The queue, and the field with None in place of the numbers that each motion has itself."""
    numbers = (scene, y0s, t0, t1, params, rtol)
    _checks.check_on_host("ensemble", numbers, _NO_DERIVATIVES)
    check_scene(scene, rtol)
    _checks.flag("fixed", fixed)
    given = scene if params is None else params
    starts = host_floats(given.y0 if y0s is None else y0s, "y0s")
    k = len(scene.y0)
    if starts.ndim != 2 or starts.shape[1] != k or not len(starts):
        remedy = f"Pass one row for each motion, with the {k} entries of the scene's state."
        raise _checks.fail("y0s", f"shape (n, {k})", f"shape {starts.shape}", remedy)
    n = len(starts)
    t1 = given.t1 if t1 is None else t1
    own = _has_own_numbers(scene, given, n)
    numbers, shared = eqx.partition(given.field, own.field)
    numbers = jax.tree.map(np.asarray, numbers)
    if fixed:
        if jax.tree.leaves(numbers):
            remedy = "Leave fixed out, or params."
            raise _checks.fail("fixed", "numbers that all motions share", "params", remedy)
        # A field without leaves: the shared part and each motion's own are the same.
        numbers = shared = FixedField(shared)
    return Motions(
        y0=starts, t0=_times("t0", t0, n), t1=_times("t1", t1, n), numbers=numbers
    ), shared


def _has_own_numbers(scene: Scene, given: Scene, n: int) -> Scene:
    """A tree like the scene that says whether each number has an entry for each motion."""
    if jax.tree.structure(scene) != jax.tree.structure(given):
        raise _checks.fail(
            "params",
            "a scene with the same system and effects",
            "another kind of scene",
            "Make it by jax.vmap of the function that made the scene, or equinox.tree_at.",
        )

    def own(path, x, many) -> bool:
        one, all_ = np.shape(x), np.shape(many)
        if all_ not in (one, (n, *one)):
            name = f"params{jax.tree_util.keystr(path)}"
            raise _checks.fail(name, f"shape {one} or {(n, *one)}", f"shape {all_}")
        return all_ != one

    return jax.tree_util.tree_map_with_path(own, scene, given)


def _times(name: str, t, n: int) -> np.ndarray:
    t = host_floats(t, name)
    if t.shape not in ((), (n,)):
        raise _checks.fail(
            name, f"shape () or ({n},)", f"shape {t.shape}", "Pass one for each motion."
        )
    return np.array(np.broadcast_to(t, (n,)))
