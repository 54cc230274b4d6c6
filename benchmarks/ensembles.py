"""How long does one of many motions take per core, at equal true error?

Run: ``python -m benchmarks ensembles``. Starts within 1e-3 of the figure-eight, one period,
12 numbers each. Times are those of the processor, for one motion: on one core, heyoka's batch
mode (its lanes in the vectors of the processor) and `vmap` of diffrax against ours. The errors
are the largest of a batch of 64, against heyoka with 64-bit mantissas.

Then it measures the cost of unequal motions: one in 20 of 4096 pairs of bodies has an eccentricity
of 0.999, whose close encounters take several times the steps of the others. "its own steps" is the
time of the same steps in ensembles of equal motions; the ratio shows how much time lanes lose by
waiting.

Both cores are used by two threads of one process, or by two devices of one, in fresh processes
with one and two of them.

Last numbers (2 cores, 2026-11), minima, with ours over the other's in brackets: error 1e-6 5.0 us,
heyoka with 8 lanes 7.5 (0.67), with 4 lanes 10.1 (0.50), diffrax 148 (0.03); 1e-9 7.0 us, 9.9
(0.71), 12.8 (0.55), 302 (0.02); 1e-12 9.3 us, 13.2 (0.70), 17.4 (0.53). heyoka is given each pair
of bodies once, see `benchmarks.figure_eight`. Two threads 1.8 times as fast as one, two devices 1.7
times. Unequal motions cost what their own steps do (1.0).
"""

import functools
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping

import jax
import numpy as np

import jaxdyn
from benchmarks import _peers
from benchmarks._timing import Row, Times, at_error
from benchmarks.problems import figure_eight, two_bodies
from jaxdyn import ensemble
from jaxdyn.scenes import three_body

ERRORS = (1e-6, 1e-9, 1e-12)
_TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
_CHECKED = 64  # motions compared with the reference
_MANY = 10_000
_SOME, _FEW = 2048, 512  # for us and heyoka; for diffrax, whose motions take ten times as long
_PAIRS, _HARD = 4096, 20
_ROUNDS, _QUICK_ROUNDS = 9, 2
_PROCESSES = 3  # with one device, and with two
_BARS = {"heyoka, 4 lanes": 0.6, "diffrax Dopri8, vmap": 0.1}
_BOTH_CORES = 1 / 1.8
_UNEQUAL = 1.3


def run(quick: bool = False) -> list[Row]:
    """Times of every method that is installed; `quick` for a rough estimate."""
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    return [*work_precision(rounds), _cores(rounds), _devices(rounds), unequal(rounds)]


def starts(n: int) -> np.ndarray:
    """(n, 12) starts near the figure-eight."""
    noise = np.random.default_rng(0).standard_normal((n, 12))
    return np.asarray(three_body().y0) + 1e-3 * noise


def work_precision(rounds: int, tolerances=_TOLERANCES, some=_SOME, few=_FEW) -> list[Row]:
    """One motion of many at equal true error, for all methods that are installed."""
    scene, y0s = three_body(), starts(some)
    methods: dict[str, Callable] = {
        "jaxdyn": lambda tol, y0s: ensemble.run(scene, y0s, rtol=tol, threads=1, fixed=True).y1,
        "diffrax Dopri8, vmap": functools.partial(_peers.diffrax_vmap, scene),
    }
    problem = figure_eight()
    if _peers.importable("heyoka"):
        for lanes in (4, 8):
            batch = functools.partial(_peers.heyoka_batch, problem, lanes)
            methods[f"heyoka, {lanes} lanes"] = batch
        truth = _peers.heyoka_precise(problem._replace(y0s=y0s[:_CHECKED]))
    else:
        truth = ensemble.run(scene, y0s[:_CHECKED], rtol=1e-15).y1
    size = {name: few if "vmap" in name else some for name in methods}
    runs, errors = {}, {}
    for name, method in methods.items():
        for tol in tolerances:
            way = functools.partial(method, tol)
            errors[name, tol] = float(np.abs(way(y0s[:_CHECKED]) - truth).max())
            runs[name, tol] = functools.partial(way, y0s[: size[name]])
    times = processor_times(runs, rounds)

    def at(error: float, name: str) -> Times:
        keys = [key for key in runs if key[0] == name]
        t = at_error([errors[k] for k in keys], [times[k] for k in keys], error)
        return Times(*(x / size[name] for x in t))

    bars = {name: bar for name, bar in _BARS.items() if name in methods}
    return [Row(f"a motion: error {e:.0e}", {m: at(e, m) for m in methods}, bars) for e in ERRORS]


def _cores(rounds: int) -> Row:
    """Wall time of the whole ensemble, by all cores and by one."""
    scene, y0s = three_body(), starts(_MANY)
    job = functools.partial(ensemble.run, scene, y0s, rtol=1e-12)
    ways = {"all cores": job, "one core": functools.partial(job, threads=1)}
    bars = {"one core": _BOTH_CORES}
    return Row(f"{_MANY} motions: wall time", _times(ways, rounds, time.perf_counter), bars)


def _devices(rounds: int) -> Row:
    """Wall time of the whole ensemble on two devices of one process, and on one."""
    seconds: dict[str, list[float]] = {"two devices": [], "one device": []}
    for _ in range(_PROCESSES):
        for name, n in zip(seconds, (2, 1), strict=True):
            environment = os.environ | {"JAX_NUM_CPU_DEVICES": str(n)}
            process = [sys.executable, "-m", "benchmarks.ensembles", str(rounds)]
            done = subprocess.run(
                process, env=environment, check=True, capture_output=True, text=True
            )
            seconds[name] += map(float, done.stdout.split())
    times = {name: Times(min(s), float(np.median(s))) for name, s in seconds.items()}
    return Row(f"{_MANY} motions on devices: wall time", times, {"one device": _BOTH_CORES})


def on_devices(rounds: int) -> list[float]:
    """Wall times [s] of the ensemble on all devices of this process."""
    job = functools.partial(
        ensemble.run, three_body(), starts(_MANY), rtol=1e-12, devices=jax.devices()
    )
    job()
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        job()
        seconds.append(time.perf_counter() - start)
    return seconds


def unequal(rounds: int, pairs: int = _PAIRS) -> Row:
    """One ensemble of unequal motions, against the same steps in ensembles of equal ones."""
    hard = np.arange(pairs) % _HARD == 7
    eccentric, plain = (np.asarray(two_bodies(e).y0) for e in (0.999, 0.3))
    mixed = np.where(hard[:, None], eccentric, plain)
    job = functools.partial(ensemble.run, two_bodies(0.3), rtol=1e-11, threads=1)
    runs = {
        "unequal": lambda: job(mixed),
        "hard": lambda: job(np.tile(eccentric, (pairs, 1))),
        "easy": lambda: job(np.tile(plain, (pairs, 1))),
    }
    times = processor_times(runs, rounds)
    part = hard.mean()
    own = (part * h + (1 - part) * e for h, e in zip(times["hard"], times["easy"], strict=True))
    both = {"jaxdyn": times["unequal"], "its own steps": Times(*own)}
    return Row("unequal motions", both, {"its own steps": _UNEQUAL})


def processor_times(runs: Mapping, rounds: int) -> dict:
    """`Times` of each run by the processor's clock, interleaved."""
    return _times(runs, rounds, time.process_time)


def _times(runs: Mapping, rounds: int, clock: Callable[[], float]) -> dict:
    """`Times` of each run by a clock, interleaved."""
    for run in runs.values():
        jax.block_until_ready(run())
    seconds: dict = {key: [] for key in runs}
    for _ in range(rounds):
        for key, run in runs.items():
            start = clock()
            run()
            seconds[key].append(clock() - start)
    return {key: Times(min(s), float(np.median(s))) for key, s in seconds.items()}


if __name__ == "__main__":
    jaxdyn.configure()
    print(*on_devices(int(sys.argv[1])))
