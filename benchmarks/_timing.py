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

#: [s] A run that takes n times as long takes part in every n-th round only.
_SLOW = 1e-3


class Times(NamedTuple):
    """Wall time of one run [s]: the least and the median of all rounds."""

    minimum: float
    median: float


class Row(NamedTuple):
    """One line of the result: the times of several methods for one thing, ours first."""

    name: str
    times: dict[str, Times]


def first_call(run: Callable[[], object]) -> float:
    """Wall time [s] of a call, for a first one: compiling, mostly."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def interleaved(runs: Mapping, rounds: int) -> dict:
    """`Times` of each run, under its key.

    Args:
      runs: callables without arguments that return when their result is there.
      rounds: how often to go through all of them.
    """
    for run in runs.values():
        run()
    every = {key: 1 + int(first_call(run) / _SLOW) for key, run in runs.items()}
    seconds: dict = {key: [] for key in runs}
    for i in range(rounds):
        for key, run in runs.items():
            if i % every[key] == 0:
                seconds[key].append(first_call(run))
    return {key: Times(min(s), float(np.median(s))) for key, s in seconds.items()}


def at_error(errors: Sequence[float], times: Sequence[Times], wanted: float) -> Times:
    """Times at a wanted error, from pairs of error and time at several tolerances.

    Linear in the logarithms between the runs that are worth taking: those more accurate than
    every faster one. NaN where the wanted error is outside of them.
    """

    def interpolate(seconds) -> float:
        worth, least = [], np.inf
        for s, error in sorted(zip(seconds, errors, strict=True)):
            if error < least:
                worth.append((error, s))
                least = error
        x, y = np.log(np.array(worth[::-1])).T
        return float(np.exp(np.interp(np.log(wanted), x, y, left=np.nan, right=np.nan)))

    return Times(interpolate([t.minimum for t in times]), interpolate([t.median for t in times]))
