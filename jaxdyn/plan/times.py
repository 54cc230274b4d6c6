"""What a step must not pass over: switching times, and brief parts of a rate such as pulses.

Both are found from bounds over an interval (`bounds`), so that a pulse or a switch is seen wherever
it is and however short, if the operations that it is made of have bounds.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxdyn.intervals import Interval
from jaxdyn.plan.plan import Plan

#: Places in a step at which parts in time are sampled, as fractions of it: neither simple fractions
#: nor its ends, since a method may evaluate those once or not at all.
_PLACES = np.array([0.103, 0.347, 0.611, 0.869])
#: Largest ratio of the range that a part may have in a step to the range of its samples. For a
#: method that sees an eighth of a variation its own error estimate is enough.
_MOST_UNSEEN = 8.0
#: Likewise for the change that its steepest slope would make: a sample may meet a pulse by chance.
MOST_STEEP = 60.0
#: Range that does not matter, relative to the size of a part in the step and in the whole span.
_SMALL_HERE, _SMALL_EVER = 1e-3, 1e-12
#: Range of the argument over which a function such as exp or tanh hides nothing from a step, and
#: the range over which a step sees too little of it.
_FEW_UNITS, _MANY_UNITS = 8.0, 60.0
#: Range of a function of time and state that does not matter, if the size of the function is 1.
_SMALL_MIXED = 1e-9
#: Largest number of halvings of a step: a pulse of 1e-9 of it is looked for.
_MOST_HALVINGS = 30
#: Least difference of two times that are distinguished, as a part of the span.
_LEAST = 2.0**-60
#: Number of times in an interval at which conditions without bounds are evaluated.
_SAMPLES = 65
#: Largest number of intervals that are searched for a switching time.
_MOST_INTERVALS = 100_000


def sizes(plan: Plan, system: PyTree, t0: Array, t1: Array, branch: Array) -> Array:
    """(u,) the largest size that each part in time may have in a span; 0 where it is unknown."""
    found, _ = plan.bounds_of_parts(system, jnp.minimum(t0, t1), jnp.maximum(t0, t1), branch)
    most = jnp.maximum(jnp.abs(found.low), jnp.abs(found.high))
    return jnp.where(jnp.isfinite(most), most, 0.0)


def hides_in_time(
    plan: Plan,
    system: PyTree,
    t0: Array,
    t1: Array,
    branch: Array,
    sizes: Array,
    steep: float = MOST_STEEP,
) -> Array:
    """Whether () parts in time may vary more in a step than a few samples show.

    They may where their bounds allow a range many times as large as that of the samples.

    Args:
      plan: the plan of the rate.
      system: a system of the plan's kind.
      t0: () start of the step.
      t1: () its end, before or after.
      branch: (e,) outcomes of the conditions.
      sizes: see `sizes`.
      steep: largest change that the steepest slope of a part may make in the step, in multiples of
        the range of its samples.
    """
    low, high = jnp.minimum(t0, t1), jnp.maximum(t0, t1)
    most, steepest = plan.bounds_of_parts(system, low, high, branch)
    at = jax.vmap(lambda t: plan.time_parts(system, t, branch))(t0 + _PLACES * (t1 - t0))
    seen = jnp.max(at, axis=0) - jnp.min(at, axis=0)
    small = _SMALL_HERE * jnp.max(jnp.abs(at), axis=0) + _SMALL_EVER * sizes
    width = most.high - most.low
    wide = ~(width <= _MOST_UNSEEN * seen + small)
    over = jnp.abs(t1 - t0) * steepest > steep * (seen + small)
    # A root is infinitely steep but hides nothing; nor does a part that rounding makes constant.
    return (wide | (over & jnp.isfinite(steepest) & (width != 0))).any()


# Traced once for all its uses in a program, of whose operations it may be a fifth.
@functools.partial(jax.jit, static_argnums=0)
def furthest_seen(
    plan: Plan, system: PyTree, t0: Array, t1: Array, branch: Array, sizes: Array
) -> Array:
    """() the end of the longest step from t0 towards t1 in which no part in time is hidden.

    The steps tried are t1 - t0, half of it, and so on; see `hides_in_time` for the arguments.
    """

    def hidden(h: Array) -> Array:
        return hides_in_time(plan, system, t0, t0 + h, branch, sizes)

    def again(carry: tuple[Array, Array]) -> tuple[Array, Array]:
        n, h = carry
        return n + 1, 0.5 * h

    def goes_on(carry: tuple[Array, Array]) -> Array:
        n, h = carry
        return (n < _MOST_HALVINGS) & hidden(h)

    n, h = jax.lax.while_loop(goes_on, again, (jnp.zeros((), int), t1 - t0))
    return jnp.where(n == 0, t1, t0 + h)


def is_hidden(plan: Plan, system: PyTree, branch: Array, start: tuple, end: tuple) -> Array:
    """Whether () functions of time and state may have acted within a step without being seen.

    Their bounds over all states that the step may have passed, those between the control points of
    its cubic, are compared with samples along it. Bounds of a function that moves along with the
    state are too wide, and more steps are taken than are needed.

    Args:
      plan: the plan of the rate.
      system: a system of the plan's kind.
      branch: (e,) outcomes of the conditions.
      start: () time, (k,) state and (k,) rate at the start of the step.
      end: likewise at its end.
    """
    (t0, y0, f0), (t1, y1, f1) = start, end
    h = t1 - t0
    nodes = jnp.stack([y0, y0 + h * f0 / 3, y1 - h * f1 / 3, y1])
    states = Interval(nodes.min(axis=0), nodes.max(axis=0))
    most = plan.bounds_of_mixed(
        system, Interval(jnp.minimum(t0, t1), jnp.maximum(t0, t1)), states, branch
    )
    z = jnp.asarray(_PLACES)[:, None]
    weights = ((1 - z) ** 3, 3 * z * (1 - z) ** 2, 3 * z * z * (1 - z), z**3)
    along = sum(w * node[None] for w, node in zip(weights, nodes, strict=True))
    at = jax.vmap(lambda t, y: plan.mixed_parts(system, t, y, branch)[1])(t0 + _PLACES * h, along)
    seen = jnp.max(at, axis=0) - jnp.min(at, axis=0)
    small = _SMALL_HERE * jnp.max(jnp.abs(at), axis=0) + _SMALL_MIXED
    argument, value = most.high - most.low
    # Over a few units of its argument such a function is nearly a polynomial, which a method sees.
    # Over many units a sample may have met it by chance.
    unseen = (argument > _FEW_UNITS) & (value > _MOST_UNSEEN * seen + small)
    return (unseen | ((argument > _MANY_UNITS) & (value > small))).any()


def next_change(plan: Plan, system: PyTree, t0: Array, t1: Array, branch: Array) -> Array:
    """() the first time after t0, up to t1, at which a condition on time alone changes; else t1.

    It is the first floating-point number for which the outcome is different.
    """
    direction = jnp.where(t1 >= t0, 1.0, -1.0)
    given = branch[np.flatnonzero(plan.of_time)]
    tiny = _LEAST * jnp.abs(t1 - t0)  # near 0, where floating-point times are denser than that

    def clear(a: Array, b: Array) -> Array:
        a, b = direction * a, direction * b
        if not plan.bounded:
            at = a + (b - a) * jnp.linspace(0.0, 1.0, _SAMPLES)
            found = jax.vmap(lambda t: plan.time_conditions(system, t, branch).outcomes)(at[1:])
            return (found == given[None]).all()
        margins = plan.bounds_of_margins(system, jnp.minimum(a, b), jnp.maximum(a, b), branch)
        return (margins.low >= 0).all()

    def search(carry):
        n, a, w, _ = carry
        end = direction * t1
        b = jnp.minimum(a + w, end)
        least = jnp.maximum(jnp.nextafter(a, jnp.inf), a + tiny)
        b = jnp.maximum(b, jnp.minimum(least, end))
        other = (plan.time_conditions(system, direction * b, branch).outcomes != given).any()
        free = clear(a, b) & ~other
        last = b <= least
        changed = last & other
        onwards = free | (last & ~changed)
        w = jnp.where(onwards, 2.0 * w, 0.5 * (b - a))
        return n + 1, jnp.where(onwards | changed, b, a), w, changed

    def goes_on(carry) -> Array:
        n, a, _, changed = carry
        return (n < _MOST_INTERVALS) & (a < direction * t1) & ~changed

    start = jnp.zeros((), int), direction * t0, jnp.abs(t1 - t0), jnp.zeros((), bool)
    _, a, _, changed = jax.lax.while_loop(goes_on, search, start)
    return jnp.where(changed, direction * a, t1)
