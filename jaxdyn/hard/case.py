"""What a hard case is: a scene that breaks naive codes, figures of how well it goes, bounds.

A case measures itself: it runs its scenes and compares them with what is known another way, a
closed form or numbers of high precision. It holds where every figure is within its bound; NaN is
within none.
"""

import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Figure(NamedTuple):
    """One number that a verdict rests on.

    Attributes:
      what: its meaning, with the unit in brackets; errors are relative where none is given.
      value: what was found.
      bound: the most that it may be; None for a number that is told, not judged.
    """

    what: str
    value: float
    bound: float | None = None

    @property
    def passed(self) -> bool:
        """Whether it is within its bound."""
        return self.bound is None or bool(self.value <= self.bound)


class Case(NamedTuple):
    """A hard case.

    Attributes:
      name: what it is called.
      holds: what must hold, in one sentence.
      measure: runs it.
    """

    name: str
    holds: str
    measure: Callable[[], tuple[Figure, ...]]


class Verdict(NamedTuple):
    """How a case went.

    Attributes:
      case: which.
      figures: what was found.
      seconds: time it took, with compilation.
    """

    case: Case
    figures: tuple[Figure, ...]
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether all figures are within their bounds."""
        return all(figure.passed for figure in self.figures)


def judge(case: Case) -> Verdict:
    """Run a case.

    Example:
      >>> judge(Case("sum", "0.1 + 0.2 = 0.3", lambda: (Figure("error", 5e-17, 1e-16),))).passed
      True
    """
    start = time.perf_counter()
    figures = case.measure()
    return Verdict(case, figures, time.perf_counter() - start)


def absolute_error(found, wanted) -> float:
    """Largest difference of two arrays; NaN where their shapes differ."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    return float(np.max(np.abs(found - wanted))) if found.shape == wanted.shape else math.nan


def relative_error(found, wanted) -> float:
    """Largest difference of two arrays over what is wanted; NaN where their shapes differ."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    return float(np.max(np.abs(found / wanted - 1))) if found.shape == wanted.shape else math.nan
