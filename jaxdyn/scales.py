"""Scales of a motion: the sizes of the entries of its state, and its time.

Whatever is compared with a tolerance is compared in these. A motion that is written in other units
of length, time and mass, or whose entries are multiplied by numbers of their own, has the scales of
the motion before, multiplied likewise, up to rounding; so nothing that is decided in them depends
on units, and there is no number of the size of one anywhere below.

Entries with the same unit share one size, the largest (`Groups`): places do, and velocities, so
that a coordinate that is zero, or rounding, is measured by the others. An angle that turns many
times is known by its radian. What has no unit, as in a plain `jaxdyn.ode`, has a size of its own.

- `of_motion`: the scales of a motion that is known.
- `at_start`: those that are known before a step is taken, from the rate and its derivatives. Sizes
  u are carried to |J| u, the rates at which they change other entries: by J times one vector of
  generic weights of random signs, since all of J would take as many derivatives as there are
  entries, and terms that cancel in J u itself do not with these weights.

The time at the start is 1 over the spectral radius of |J|: 1 over the fastest rate, up to a factor
of a few. The least growth rate that some choice of units of the entries leads to, it depends on no
such choice.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

if TYPE_CHECKING:
    from jaxdyn.system import System

_RADIAN = "rad"
_UNSPECIFIED = "1"
#: Products with |J| before its growth is measured, and those over which it is: an even number,
#: since the sizes of places and velocities are exchanged by each.
_PRODUCTS_BEFORE, _PRODUCTS = 2, 4
#: Rounds in which sizes are carried on at least, besides those that reach further entries.
_ROUNDS = 2
#: When the rate is looked at besides the start, in times of the motion: not half of it, where a
#: force that is zero at the start may be zero again.
_LATER = 0.37
#: Logarithm of the largest weight of an entry; the least is 1 over it.
_LOG_WEIGHT = 0.2
#: Where J is taken in one more round, in sizes from the start: a coupling that vanishes there, as
#: that of a product of two entries at zero, is seen from elsewhere, and so is a rate that is faster
#: there, for which sizes are made smaller. They must not be too large: the motion soon shows larger
#: ones, but never smaller ones.
_ASIDE = 1 / 16


class Groups(NamedTuple):
    """Which entries of a state share a size; static.

    Attributes:
      of: the group of each of the k entries, numbered from 0 in the order in which they appear.
      most: the largest size of each entry: 1 for angles, which are known by the radian; infinite
        for others.
    """

    of: tuple[int, ...]
    most: tuple[float, ...]

    @property
    def alone(self) -> bool:
        """Whether each entry has a group of its own."""
        return len(set(self.of)) == len(self.of)

    def largest(self, x: Array) -> Array:
        """(k, ...) the largest of each group of numbers x (k, ...) that are not negative.

        Written out, since a reduction would keep XLA from fusing a loop over steps.
        """
        if not self.alone:
            n = max(self.of) + 1
            rows = [[i for i, group in enumerate(self.of) if group == g] for g in range(n)]
            if len(x) <= _WRITTEN_OUT:
                tops = [_maximum([x[i] for i in row]) for row in rows]
                x = jnp.stack([tops[group] for group in self.of])
            else:
                tops = jnp.stack([jnp.max(x[np.array(row)], axis=0) for row in rows])
                x = tops[np.array(self.of)]
        if all(most == np.inf for most in self.most):
            return x
        return jnp.minimum(x, np.array(self.most).reshape(-1, *[1] * (x.ndim - 1)))


_WRITTEN_OUT = 32  # entries of a state


def _maximum(parts: list[Array]) -> Array:
    """Of numbers, pairwise, so that they do not wait for each other."""
    while len(parts) > 1:
        pairs = [jnp.maximum(a, b) for a, b in zip(parts[::2], parts[1::2], strict=False)]
        parts = pairs + ([parts[-1]] if len(parts) % 2 else [])
    return parts[0]


def groups(system: "System") -> Groups:
    """The groups of a system's state: entries with one unit, or of [q, v] without any, are one."""
    units = [unit for _, unit in system.labels()]
    k, second = len(units), system.second_order
    halves = ["q"] * (k // 2) + ["v"] * (k - k // 2)
    names = [
        unit if unit != _UNSPECIFIED else (halves[i], _UNSPECIFIED) if second else (i, _UNSPECIFIED)
        for i, unit in enumerate(units)
    ]
    order = list(dict.fromkeys(names))
    most = tuple(1.0 if unit == _RADIAN else np.inf for unit in units)
    return Groups(tuple(map(order.index, names)), most)


class Scales(NamedTuple):
    """The scales of a motion.

    Attributes:
      sizes: (k,) of the entries of its state.
      time: () that in which it changes.
    """

    sizes: Array
    time: Array


def at_start(field: Any, groups: Groups, t0: Array, y0: Array, t1: Array) -> tuple[Scales, Array]:
    """The scales of the motion from (t0, y0) before it is known, and its rate (k,) there.

    With J the Jacobian of the rate f at and near the start, and tau the time, sizes are the largest
    of |y0|, tau |f|, also that of a time later, and tau |J| times sizes, so that an entry that is
    zero has the size that others give to it. An entry has the size 0 if nothing moves it. If
    nothing depends on the state, the time is |t1 - t0|.

    Args:
      field: has ``rate(t, y)``.
      groups: of its state.
      t0: () start time.
      y0: (k,) start.
      t1: () end time.
    Limits: the rate must have derivatives in forward mode; those that are not finite count as 0.
    """
    weights = _weights(len(y0))
    span = jnp.abs(t1 - t0)
    here = groups.largest(jnp.abs(y0))
    measured = 1 + _PRODUCTS_BEFORE + _PRODUCTS
    # Rounds with another time, and with another state.
    later, aside = measured, measured + 1 + _ROUNDS
    least = aside + 2

    def again(carry):
        n, *_, grows = carry
        return (n < least) | (grows & (n < least + len(y0)))

    # All in one loop of one derivative: each written out would have to be compiled.
    def round_(carry):
        n, u, compared, tau, step, rate, _ = carry
        along = weights * u
        ahead = jnp.where(t1 < t0, -_LATER, _LATER) * jnp.minimum(tau, span)
        t = jnp.where(n == later, t0 + ahead, t0)
        y = y0 + jnp.where(n == aside, _ASIDE, 0.0) * along
        f, by_u = jax.jvp(lambda y: field.rate(t, y), (y,), (along,))
        changed, carried = groups.largest(_finite(f)), groups.largest(_finite(by_u))
        rate = jnp.where(n == 0, f, rate)
        growth = _growth(carried, compared)
        measure = (n == measured - 1) & (growth > 0)
        tau = jnp.where(measure, 1.0 / jnp.where(measure, growth, 1.0), tau)
        shrink = jnp.where(n == aside, jnp.minimum(1.0, _least_ratio(u, tau * carried)), 1.0)
        step = jnp.where(n < aside, tau, shrink * step)
        first = here + _first_time(here, changed, span) * changed
        known = jnp.maximum(here, tau * jnp.maximum(changed, groups.largest(_finite(rate))))
        grown = jnp.maximum(jnp.maximum(here, shrink * u), step * carried)
        cases = (n == 0, n < measured, n == later)
        new = jnp.select(cases, (first, carried, known), grown)
        new = groups.largest(jnp.where(jnp.isfinite(new), new, u))
        compared = jnp.where(n == _PRODUCTS_BEFORE, new, compared)
        return n + 1, new, compared, tau, step, rate, ((new > 0) & (u == 0)).any()

    zero = jnp.zeros_like(y0)
    begin = jnp.zeros((), int), here, zero, span, span, zero, jnp.ones((), bool)
    _, sizes, _, tau, _, rate, _ = jax.lax.while_loop(again, round_, begin)
    return Scales(sizes, tau), rate


def of_motion(field: Any, groups: Groups, ts: Array, ys: Array, time: Array) -> Scales:
    """The scales of a motion that is known.

    The size of an entry is the largest of its group over all states. A group that stays at zero has
    the size of what moves it: the time times |J| times the other sizes. If nothing does, it is the
    geometric mean of all sizes that are known, which changes with units of length and of time as
    they do together; that of no known size is 1, since no unit can be told from a state at zero.

    Args:
      field: has ``rate(t, y)``.
      groups: of its state.
      ts: (s,) times.
      ys: (s, k) states.
      time: () the span, or the period.
    """
    sizes = groups.largest(jnp.max(jnp.abs(ys), axis=0))
    weights = _weights(ys.shape[1])
    places = np.unique([0, len(ys) // 3])  # at one of them a coupling may vanish by symmetry

    def driven(sizes: Array, place: int) -> Array:
        t, y = ts[place], ys[place]
        f, by_sizes = jax.jvp(lambda y: field.rate(t, y), (y,), (weights * sizes,))
        return jnp.abs(time) * groups.largest(jnp.maximum(_finite(f), _finite(by_sizes)))

    for _ in range(_ROUNDS):
        found = _maximum([driven(sizes, int(place)) for place in places])
        sizes = jnp.where(sizes > 0, sizes, groups.largest(found))
    known = sizes > 0
    logs = jnp.log(jnp.where(known, sizes, 1.0))
    mean = jnp.exp(jnp.sum(logs) / jnp.maximum(jnp.sum(known.astype(float)), 1.0))
    return Scales(jnp.where(known, sizes, mean), jnp.abs(time))


def _weights(k: int) -> np.ndarray:
    """(k,) generic weights of either sign; 1 for a single entry."""
    if k == 1:
        return np.ones(1)
    random = np.random.default_rng(0)
    return np.exp(random.uniform(-_LOG_WEIGHT, _LOG_WEIGHT, k)) * random.choice([-1.0, 1.0], k)


def _finite(x: Array) -> Array:
    """The absolute values, 0 for those that are not finite."""
    return jnp.where(jnp.isfinite(x), jnp.abs(x), 0.0)


def _least_ratio(a: Array, b: Array) -> Array:
    """() the least of a / b where both are positive; infinite if they are nowhere."""
    both = (a > 0) & (b > 0)
    return jnp.min(jnp.where(both, a / jnp.where(both, b, 1.0), jnp.inf))


def _first_time(sizes: Array, rates: Array, span: Array) -> Array:
    """() the time in which the fastest entry changes by its own size; the span if none does."""
    time = _least_ratio(sizes, rates)
    return jnp.where(jnp.isfinite(time), time, span)


def _growth(u: Array, before: Array) -> Array:
    """() the factor by which sizes grow with each product."""
    known = before > 0
    ratio = jnp.max(jnp.where(known, u / jnp.where(known, before, 1.0), 0.0))
    return jnp.where(ratio > 0, jnp.where(ratio > 0, ratio, 1.0) ** (1 / _PRODUCTS), 0.0)
