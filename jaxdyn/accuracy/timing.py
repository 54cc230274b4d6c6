"""Fair timing: interleaved runs, compared at equal error, with compile time separate.

All methods of a question run in turn in one process, so that other load on the machine affects
them alike; the minimum is the time that the method needs, the median the time that a user
experiences.
"""

import functools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxdyn._progress import each

#: Durations that JAX reports: lowering, which precedes XLA's compilation, and compiling.
_COMPILE_EVENTS = "/jax/core/compile/"
_BEGINS, _ENDS = "jaxpr_to_mlir_module_duration", "backend_compile_duration"


class Times(NamedTuple):
    """Wall time of one run [s]: the least and the median of all rounds."""

    minimum: float
    median: float


class Clock:
    """Wall-clock time since it was made, and the part of it spent compiling.

    JAX listeners cannot be removed, so one listener serves all clocks of a process.
    """

    def __init__(self):
        self._heard = _reports()
        self._start, self._before = time.perf_counter(), self._heard.seconds

    @property
    def seconds(self) -> float:
        """Time since it was made [s]."""
        return time.perf_counter() - self._start

    @property
    def compiling(self) -> float:
        """Part of `seconds` spent tracing and compiling [s]."""
        return self._heard.seconds - self._before

    @property
    def computing(self) -> float:
        """The rest of `seconds`, which time limits count [s]."""
        return self.seconds - self.compiling

    @property
    def busy(self) -> bool:
        """Whether a program is being compiled now."""
        return self._heard.busy


class _CompileReports:
    """JAX's reports since the first clock of the process was made."""

    def __init__(self):
        self.seconds, self.busy = 0.0, False
        jax.monitoring.register_event_duration_secs_listener(self._listen)

    def _listen(self, event: str, duration_secs: float, **_: Any) -> None:
        if event.startswith(_COMPILE_EVENTS):
            self.seconds += duration_secs
            self.busy = event.endswith(_BEGINS) or (self.busy and not event.endswith(_ENDS))


@functools.cache
def _reports() -> _CompileReports:
    return _CompileReports()


def seconds_of(run: Callable[[], object]) -> float:
    """Wall time [s] of one call."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def interleave(runs: Mapping, rounds: int, slow: float = 1e-3) -> dict:
    """The `Times` of each run, under its key.

    Args:
      runs: callables without arguments that return when their result is ready.
      rounds: number of rounds.
      slow: [s] a run that takes n times as long takes part in every n-th round only.
    """
    for run in runs.values():
        run()
    every = {key: 1 + int(seconds_of(run) / slow) for key, run in runs.items()}
    seconds: dict = {key: [] for key in runs}
    for i in each(range(rounds), "timing, round after round"):
        for key, run in runs.items():
            if i % every[key] == 0:
                if every[key] == 1:
                    # The processor's caches still hold code and data of the previous run.
                    run()
                seconds[key].append(seconds_of(run))
    return {key: Times(min(s), float(np.median(s))) for key, s in seconds.items()}


def pareto_front(errors: Sequence[float], seconds: Sequence[float]) -> list[int]:
    """Runs that are more accurate than every faster one, the most accurate first."""
    found, least = [], np.inf
    for i in np.lexsort((errors, seconds)).tolist():
        if errors[i] < least:
            found.append(i)
            least = errors[i]
    return found[::-1]


#: The value that an error of 0 counts as: a tenth of rounding.
_LEAST_ERROR = 1e-17


def at_error(errors: Sequence[float], times: Sequence[Times], wanted: float) -> Times:
    """Times at a given error, from pairs of error and time at several tolerances.

    They are interpolated linearly in the logarithms between the runs on the `pareto_front`. For
    larger errors it is the fastest of them; NaN for smaller errors than any run has, or without
    runs.
    """
    if not errors:
        return Times(math.nan, math.nan)

    def interpolate(seconds) -> float:
        worth = pareto_front(errors, seconds)
        x, y = np.log([[max(errors[i], _LEAST_ERROR), seconds[i]] for i in worth]).T
        return float(np.exp(np.interp(np.log(wanted), x, y, left=np.nan)))

    return Times(interpolate([t.minimum for t in times]), interpolate([t.median for t in times]))
