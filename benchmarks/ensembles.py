"""What does one of many motions cost, per core, at equal true error?

Run: ``python -m benchmarks ensembles``. Starts within 1e-3 of the figure-eight, one period,
12 numbers each. Times are those of the processor, for one motion: on one core, heyoka's batch
mode (its lanes in the vectors of the processor) and `vmap` of diffrax against ours. The errors
are the largest of a batch of 64, against heyoka with 64-bit mantissas.

Then what unequal motions cost: one in 20 of 4096 pairs of bodies has an eccentricity of 0.999,
whose close encounters take several times the steps of the others. "its own steps" is what the
same steps cost in ensembles of equal motions; the ratio tells what lanes waste by waiting.

Last numbers (2 cores with other work on them, 2026-11), medians, with ours over the other's in
brackets: error 1e-6 9.5 us, heyoka with 8 lanes 13 (0.73), with 4 lanes 15 (0.62), diffrax 137
(0.07); 1e-9 12 us, 20 (0.61), 24 (0.51), 284 (0.04); 1e-12 17 us, 30 (0.58), 34 (0.50).
Unequal motions cost what their own steps do (1.0).
"""

import functools
import time
from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import _peers
from benchmarks._timing import Row, Times, at_error
from jaxdyn import Scene, ensemble
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scenes import three_body

ERRORS = (1e-6, 1e-9, 1e-12)
_TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
_CHECKED = 64  # motions that are compared with the reference
_MANY = 10_000
_SOME, _FEW = 2048, 512  # for us and heyoka; for diffrax, whose motions take ten times as long
_PAIRS, _HARD = 4096, 20
_ROUNDS, _QUICK_ROUNDS = 9, 2


def run(quick: bool = False) -> list[Row]:
    """Times of every method that is installed; `quick` for a rough look."""
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    return [*_work_precision(rounds), _cores(rounds), _unequal(rounds)]


def starts(n: int) -> np.ndarray:
    """(n, 12) starts near the figure-eight."""
    noise = np.random.default_rng(0).standard_normal((n, 12))
    return np.asarray(three_body().y0) + 1e-3 * noise


def _work_precision(rounds: int) -> list[Row]:
    scene, y0s = three_body(), starts(_SOME)
    period = float(scene.t1)
    methods: dict[str, Callable] = {
        "jaxdyn": lambda tol, y0s: ensemble.run(scene, y0s, rtol=tol, threads=1).y1,
        "diffrax Dopri8, vmap": functools.partial(_peers.diffrax_vmap, scene),
    }
    if _peers.importable("heyoka"):
        for lanes in (4, 8):
            methods[f"heyoka, {lanes} lanes"] = functools.partial(
                _peers.heyoka_batch, period, lanes
            )
        truth = _peers.heyoka_precise(period, y0s[:_CHECKED])
    else:
        truth = ensemble.run(scene, y0s[:_CHECKED], rtol=1e-15).y1
    size = {name: _FEW if "vmap" in name else _SOME for name in methods}
    runs, errors = {}, {}
    for name, method in methods.items():
        for tol in _TOLERANCES:
            way = functools.partial(method, tol)
            errors[name, tol] = float(np.abs(way(y0s[:_CHECKED]) - truth).max())
            runs[name, tol] = functools.partial(way, y0s[: size[name]])
    times = _processor_times(runs, rounds)

    def at(error: float, name: str) -> Times:
        keys = [key for key in runs if key[0] == name]
        t = at_error([errors[k] for k in keys], [times[k] for k in keys], error)
        return Times(*(x / size[name] for x in t))

    return [Row(f"a motion: error {e:.0e}", {m: at(e, m) for m in methods}) for e in ERRORS]


def _cores(rounds: int) -> Row:
    """Wall time of the whole ensemble, by all cores and by one."""
    scene, y0s = three_body(), starts(_MANY)
    job = functools.partial(ensemble.run, scene, y0s, rtol=1e-12)
    ways = {"all cores": job, "one core": functools.partial(job, threads=1)}
    return Row(f"{_MANY} motions: wall time", _times(ways, rounds, time.perf_counter))


def _unequal(rounds: int) -> Row:
    """One ensemble of unequal motions, against the same steps in ensembles of equal ones."""
    hard = np.arange(_PAIRS) % _HARD == 7
    eccentric, plain = (np.asarray(_pair(e).y0) for e in (0.999, 0.3))
    mixed = np.where(hard[:, None], eccentric, plain)
    job = functools.partial(ensemble.run, _pair(0.3), rtol=1e-11, threads=1)
    runs = {
        "unequal": lambda: job(mixed),
        "hard": lambda: job(np.tile(eccentric, (_PAIRS, 1))),
        "easy": lambda: job(np.tile(plain, (_PAIRS, 1))),
    }
    times = _processor_times(runs, rounds)
    part = hard.mean()
    own = (part * h + (1 - part) * e for h, e in zip(times["hard"], times["easy"], strict=True))
    return Row("unequal motions", {"jaxdyn": times["unequal"], "its own steps": Times(*own)})


def _pair(e: float) -> Scene:
    """Two bodies from their farthest points of ellipses of eccentricity e; period 2 pi."""
    r, v = 1 + e, np.sqrt((1 - e) / (1 + e))
    y0 = jnp.array([-r, 0.0, r, 0.0, 0.0, -v, 0.0, v]) / 2
    return Scene(FreePoints([0.5, 0.5]), (PairGravity(1.0),), y0=y0, t1=2 * np.pi)


def _processor_times(runs: Mapping, rounds: int) -> dict:
    return _times(runs, rounds, time.process_time)


def _times(runs: Mapping, rounds: int, clock: Callable[[], float]) -> dict:
    """`Times` of each run by a clock, all run in turn."""
    for run in runs.values():
        jax.block_until_ready(run())
    seconds: dict = {key: [] for key in runs}
    for _ in range(rounds):
        for key, run in runs.items():
            start = clock()
            run()
            seconds[key].append(clock() - start)
    return {key: Times(min(s), float(np.median(s))) for key, s in seconds.items()}
