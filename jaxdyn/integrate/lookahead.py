"""Steps that do not pass over brief parts of a rate: those in time alone are seen ahead.

A method judges a step by what it sees of the rate at a handful of times, and misses a pulse between
them. So before a step is taken, bounds of each part of the rate that depends on time alone are
compared with samples of it (`plan.times`), and a step in which more may happen than is seen becomes
shorter. Parts that depend on time and state are looked at likewise after a step, and a step in
which something may be hidden is rejected.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.plan import Plan, plan_of
from jaxdyn.plan.in_branch import InBranch, Wrapper, without_wrappers
from jaxdyn.plan.times import furthest_seen, is_hidden, sizes
from jaxdyn.solvers.sizes import PART, AtStart, above_noise, sizes_at_start, state_of

#: Part of the size that a drive gives to an entry later: an entry that is smaller is at rest.
_REST = 1e-6


class Lookahead(eqx.Module):
    """How far a step may go, by the parts of a rate that depend on time alone.

    Attributes:
      plan: the plan of the rate.
      system: the field, of the plan's kind.
      outcomes: (e,) outcomes of the conditions of the rate.
      sizes: (u,) the largest sizes of the parts in the span, as far as they are known.
      direction: () 1, or -1 where the run counts time backwards.
    """

    plan: Plan = eqx.field(static=True)
    system: Any
    outcomes: Array
    sizes: Array
    direction: Array | float = 1.0

    def towards(self, direction: Array) -> "Lookahead":
        """The same for a run in this direction of time, in which times are direction * t."""
        return dataclasses.replace(self, direction=direction)

    def has_hidden(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array:
        """Whether () functions of time and state may have acted within a step, unseen."""
        ends = []
        for t, y in ((self.direction * t0, y0), (self.direction * t1, y1)):
            x = state_of(y)
            ends.append((t, x, self.system.rate(t, x)))
        return is_hidden(self.plan, self.system, self.outcomes, *ends)

    def until(self, t0: Array, t1: Array) -> Array:
        """() the end of a step from t0 that goes up to t1 unless something may be hidden in it."""
        if not self.plan.hides:
            return t1
        way = self.direction
        seen = furthest_seen(self.plan, self.system, way * t0, way * t1, self.outcomes, self.sizes)
        return jnp.where(way * seen == t1, t1, way * seen)


def _sizes_of_drives(look: Lookahead, t0: Array, t1: Array, y: Array, start: AtStart) -> AtStart:
    """What is known at a start, where a state (k,) at rest is moved by a drive later in the span.

    An entry without a size, or with a negligible one, is given a part of what the largest rates of
    the span make of it in the time of the motion; then others get a part of what these entries make
    of them. Measured by itself, the beginning of a pulse would be resolved down to its rounding.
    """
    low, high = jnp.minimum(t0, t1), jnp.maximum(t0, t1)
    found = look.plan.bounds_of_rate(look.system, low, high, y)
    most = jnp.maximum(jnp.abs(found.low), jnp.abs(found.high))

    def filled(sizes: Array, rates: Array) -> Array:
        rates = jnp.where(jnp.isfinite(rates), jnp.abs(rates), 0.0)
        later = PART * start.time * rates
        return jnp.where(sizes > _REST * later, sizes, later)

    sizes = filled(start.sizes, most)
    sizes = filled(sizes, look.system.rate(t0, y + sizes))
    return start._replace(sizes=look.system.groups.sizes(sizes))


def look_from_start(
    field: Any, t0: Array, y0: Array, t1: Array, tolerance: Array
) -> tuple[AtStart, Lookahead | None]:
    """What is known at the start of a motion, and what steps from there must not pass over."""
    start, look = sizes_at_start(field, t0, y0, t1), lookahead(field, len(y0), t0, t1)
    if look is not None and look.plan.hides and y0.ndim == 1:
        start = _sizes_of_drives(look, t0, t1, y0, start)
    return above_noise(start, tolerance), look


def lookahead(
    field: Any, k: int, t0: Array, t1: Array, largest: Array | None = None
) -> Lookahead | None:
    """What steps of a field with a state (k, ...) must not pass over; None if there is nothing.

    Args:
      field: see `integrate.flow`.
      k: number of entries of the state.
      t0: () start of the span.
      t1: () its end.
      largest: the `Lookahead.sizes`, where they are known.
    """
    system = without_wrappers(field)
    plan = plan_of(system, k)
    if not (plan.hides or plan.mixed):
        return None
    while isinstance(field, Wrapper):
        field = field.field
    known = isinstance(field, InBranch)
    outcomes = field.branch.outcomes if known else jnp.zeros(plan.size)
    if largest is None:
        largest = sizes(plan, system, t0, t1, outcomes)
    return Lookahead(plan, system, outcomes, largest)
