"""The switch from the default method to another, where it turns out not to suit the motion.

A stiff motion starts again with an implicit method. Where a series or an extrapolation cannot go
on, as where exp(x) overflows in a rate that stays finite, the pair tries before a failure is
reported.
"""

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.integrate.step_control import Limits
from jaxdyn.solvers import RADAU9, Method
from jaxdyn.status import Status

#: Net number of steps limited by stability after which a motion starts again. Fewer take less time
#: than compiling an implicit method, one or two seconds.
MOST_LIMITED = 1000


class HasStatus(Protocol):
    """What a run returns."""

    @property
    def status(self) -> Array:
        """() `Status` code."""
        ...


R = TypeVar("R", bound=HasStatus)


def run_or_switch(
    run: Callable[..., R], limits: Limits, method: Method, *, default: bool
) -> tuple[R, bool]:
    """The result of a run, and whether `RADAU9` took over because the motion is stiff.

    If the default is not a pair and its steps collapse, the pair for its tangents takes over first.

    The motion then starts again: continuing from where the explicit method stopped would save the
    steps so far, but take a second path for samples, events and failures.

    Args:
      run: takes `Limits`, and a `Method` as ``method``.
      limits: tolerances and the number of steps.
      method: the solver, or the default.
      default: whether another may take over: nobody asked for this one, and no value on which the
        run depends is traced.
    """
    if not default:
        return run(limits, method=method), False
    limited = limits.until_stiff(MOST_LIMITED)
    first = run(limited, method=method)
    if _checks.is_traced(first.status):
        # A trace is under way of which none of the values is a part.
        return run(limits, method=method), False
    # NumPy reads it: int() of a JAX array takes three times as long as an empty program.
    status = np.asarray(first.status).item()
    pair = method.for_tangents
    if status == Status.STEP_COLLAPSED and method is not pair:
        first = run(limited, method=pair)
        status = np.asarray(first.status).item()
    if status != Status.STIFF:
        return first, False
    return run(limits, method=RADAU9), True
