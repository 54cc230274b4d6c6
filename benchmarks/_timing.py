"""Fair timing: interleaved runs, separate compile time, methods compared at equal true error.

All methods of a question run in turn in one process, so that other load on the machine affects
them alike; the minimum is the time that the method needs, the median the time that a user
experiences. Methods are compared at equal error, never at equal tolerance: each is run at many
tolerances, and the time at a given error is read off its curve.
"""

import math
import os
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from jaxdyn.accuracy.timing import Times as Times
from jaxdyn.accuracy.timing import at_error as at_error
from jaxdyn.accuracy.timing import interleave as interleave
from jaxdyn.accuracy.timing import pareto_front
from jaxdyn.accuracy.timing import seconds_of as seconds_of


class Row(NamedTuple):
    """One line of the result.

    Attributes:
      name: name of the measurement.
      times: times of several methods, ours first.
      bars: target ratios of ours to a method's, by method.
      note: further remarks.
    """

    name: str
    times: dict[str, Times]
    bars: Mapping[str, float] = {}
    note: str = ""

    @property
    def rows(self) -> list["Row"]:
        """Itself."""
        return [self]


class Point(NamedTuple):
    """A run at one tolerance: the error it had, and its times."""

    error: float
    times: Times


class Curves(NamedTuple):
    """Error against time of several methods, ours first.

    Attributes:
      name: name of the problem.
      compiling: time of build and first run, by method; not for those built in parallel.
      points: by method, the runs that are more accurate than every faster one.
      wanted: true errors at which the methods are compared.
      bars: target ratios of ours to a method's there, by method.
    """

    name: str
    compiling: dict[str, Times]
    points: dict[str, list[Point]]
    wanted: Sequence[float]
    bars: Mapping[str, Sequence[float]]

    @property
    def rows(self) -> list[Row]:
        """A row for compiling, and one for each error compared at."""
        rows = [Row(f"{self.name}: build and first run", self.compiling)]
        for i, wanted in enumerate(self.wanted):
            times = {
                method: at_error([p.error for p in points], [p.times for p in points], wanted)
                for method, points in self.points.items()
            }
            bars = {method: bars[i] for method, bars in self.bars.items()}
            rows.append(Row(f"{self.name}: error {wanted:.0e}", times, bars))
        return rows


#: A run: without arguments, returns the result as a NumPy array.
Run = Callable[[], np.ndarray]


class Method(NamedTuple):
    """A way to solve a problem: a function from a tolerance to a run, and tolerances to try.

    If it has several solvers, a tolerance is a pair of solver and tolerance. The time of `build`
    and of the first run is compile time, and is reported separately.
    """

    build: Callable[[Any], Run]
    tolerances: Sequence[Any]


class _Built(NamedTuple):
    """Runs with their results by tolerance, and the time until the first of them had ended [s]."""

    seconds: float
    runs: dict[Any, tuple[Run, np.ndarray]]


def _build(method: Method) -> _Built:
    start, seconds, runs = time.perf_counter(), math.nan, {}
    for tol in method.tolerances:
        run = method.build(tol)
        runs[tol] = run, run()
        if len(runs) == 1:
            seconds = time.perf_counter() - start
    return _Built(seconds, runs)


def work_precision(
    name: str,
    methods: Mapping[str, Method],
    truth: np.ndarray,
    wanted: Sequence[float],
    rounds: int,
    bars: Mapping[str, Sequence[float]] | None = None,
    side_by_side: Collection[str] = (),
    slow: float = 1e-3,
) -> Curves:
    """Error against time of all methods.

    Args:
      name: name of the problem.
      methods: methods by name, ours first.
      truth: the exact result. The error of a run is the largest over all entries,
        relative to the largest entry.
      wanted: true errors to compare at.
      rounds: how many times to run everything.
      bars: see `Curves`.
      side_by_side: methods that are built in parallel on as many threads as there are cores, which
        saves time; their build times are not reported.
      slow: [s] see `interleave`.
    """
    built = {name: _build(methods[name]) for name in methods if name not in side_by_side}
    compiling = {name: Times(each.seconds, each.seconds) for name, each in built.items()}
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        waiting = {name: threads.submit(_build, methods[name]) for name in side_by_side}
        built |= {name: each.result() for name, each in waiting.items()}
    scale = np.max(np.abs(truth))
    errors, runs = {}, {}
    for method in methods:
        for tol, (run, first) in built[method].runs.items():
            error = float(np.max(np.abs(first - truth)) / scale)
            if np.isfinite(error):  # a run that fails has no error
                errors[method, tol], runs[method, tol] = error, run
    times = interleave(runs, rounds, slow)
    points = {}
    for method in methods:
        keys = [key for key in runs if key[0] == method]
        worth = pareto_front([errors[k] for k in keys], [times[k].minimum for k in keys])
        points[method] = [Point(errors[keys[i]], times[keys[i]]) for i in worth]
    return Curves(name, compiling, points, wanted, bars or {})
