"""Fair times: interleaved runs, compile time apart, methods compared at equal true error.

All methods of a question run in turn in one process, so that whatever else the machine does
hits them alike; the minimum is what the method needs, the median what a user sees. Methods are
compared at equal error, never at equal tolerance: each is run at many tolerances, and the time
at a wanted error is read off its curve.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxdyn.timing import Times as Times
from jaxdyn.timing import at_error as at_error
from jaxdyn.timing import interleaved as interleaved
from jaxdyn.timing import seconds_of as seconds_of


class Row(NamedTuple):
    """One line of the result: the times of several methods for one thing, ours first."""

    name: str
    times: dict[str, Times]


#: A run: no arguments, returns the result as NumPy array when it is there.
Run = Callable[[], np.ndarray]


class Method(NamedTuple):
    """A way to solve a problem: from a tolerance to a run, and the tolerances to try.

    What `build` and the first run do besides is compiling and is timed apart.
    """

    build: Callable[[float], Run]
    tolerances: Sequence[float]


def work_precision(
    name: str,
    methods: Mapping[str, Method],
    truth: np.ndarray,
    wanted: Sequence[float],
    rounds: int,
) -> list[Row]:
    """A row for compiling, and one for each of the wanted true errors.

    Args:
      name: of the problem.
      methods: by name, ours first.
      truth: what every run should return. The error of a run is the largest over all entries,
        relative to the largest entry.
      wanted: true errors.
      rounds: how often to run everything.
    """
    compiling, runs = {}, {}
    for method, (build, tolerances) in methods.items():
        start = time.perf_counter()
        for i, tol in enumerate(tolerances):
            runs[method, tol] = build(tol)
            if i == 0:
                runs[method, tol]()
                seconds = time.perf_counter() - start
                compiling[method] = Times(seconds, seconds)
    scale = np.max(np.abs(truth))
    errors = {key: float(np.max(np.abs(run() - truth)) / scale) for key, run in runs.items()}
    times = interleaved(runs, rounds)

    def at(error: float, method: str) -> Times:
        keys = [key for key in runs if key[0] == method]
        return at_error([errors[k] for k in keys], [times[k] for k in keys], error)

    rows = [Row(f"{name}: build and first run", compiling)]
    return rows + [Row(f"{name}: error {e:.0e}", {m: at(e, m) for m in methods}) for e in wanted]
