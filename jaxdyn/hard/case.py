"""A hard case: a scene that breaks naive codes, figures of merit, and their bounds.

A case runs its scenes and compares them with an independent result, a closed form or numbers of
high precision. The case holds if every figure is within its bound; NaN never is.
"""

import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Figure(NamedTuple):
    """A number that the verdict depends on.

    Attributes:
      what: meaning of the number, with the unit in brackets; errors without a unit are relative.
      value: the number.
      bound: its largest allowed value; None for a number that is only reported.
    """

    what: str
    value: float
    bound: float | None = None

    @property
    def passed(self) -> bool:
        """Whether the number is within its bound."""
        return self.bound is None or bool(self.value <= self.bound)


class Case(NamedTuple):
    """A hard case.

    Attributes:
      name: name of the case, as in `jaxdyn hard NAME`.
      holds: what must hold, in one sentence.
      measure: function that runs the case and returns its figures.
    """

    name: str
    holds: str
    measure: Callable[[], tuple[Figure, ...]]


class Verdict(NamedTuple):
    """The result of a case.

    Attributes:
      case: the case.
      figures: its figures.
      seconds: time that the case took, with compilation [s].
    """

    case: Case
    figures: tuple[Figure, ...]
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether all figures are within their bounds."""
        return all(figure.passed for figure in self.figures)


def judge(case: Case) -> Verdict:
    """Run a case and return its verdict.

    Example:
      >>> judge(Case("sum", "0.1 + 0.2 = 0.3", lambda: (Figure("error", 5e-17, 1e-16),))).passed
      True
    """
    start = time.perf_counter()
    figures = case.measure()
    return Verdict(case, figures, time.perf_counter() - start)


def absolute_error(found, wanted) -> float:
    """The largest difference between two arrays; NaN if their shapes differ."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    return float(np.max(np.abs(found - wanted))) if found.shape == wanted.shape else math.nan


def relative_error(found, wanted) -> float:
    """The largest relative difference between two arrays; NaN if their shapes differ."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    return float(np.max(np.abs(found / wanted - 1))) if found.shape == wanted.shape else math.nan
