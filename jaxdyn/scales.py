"""Scales of a motion: the sizes of the entries of its state, and its time.

Whatever is compared with a tolerance is measured in these scales. A motion in other units of
length, time and mass, or one whose entries are multiplied by constants, has the same scales
multiplied likewise, up to rounding; so nothing that is decided with them depends on units.

Entries with the same unit share one size, the largest (`Groups`): all positions do, and all
velocities, so that a coordinate that is zero, or only rounding, is measured by the others. An angle
may turn many times, so its size is at most one radian. An entry without a unit, as in a plain
`jaxdyn.ode`, has a size of its own.

`at_start` finds the scales before a step is taken, from the rate and its derivatives. In place of
|J| u it takes the absolute value of J times one vector, u with generic weights of random signs,
since the whole of J would take as many derivatives as there are entries; terms that cancel in J u
do not cancel with these weights.
"""

from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn._numerics import UNROLLED_ENTRIES

if TYPE_CHECKING:
    from jaxdyn.system import System

_RADIAN = "rad"
_UNSPECIFIED = "1"
#: Number of products with |J| before their growth is measured, and over which it is measured. The
#: latter is even, since each product exchanges the sizes of positions and velocities; it is four,
#: so that the growth per product takes two square roots.
_PRODUCTS_BEFORE, _PRODUCTS = 2, 4
_MEASURED = _PRODUCTS_BEFORE + _PRODUCTS
#: The growth is measured again if over all these products it is less than this part of the growth
#: over the first two: then sizes are still spreading to entries that were hardly more than zero.
#: Rounding may start such a spread at any time: there are at most as many repetitions as entries.
_SETTLED = 1 / 16
#: Least number of rounds that carry sizes from entry to entry; more follow as long as they reach
#: further entries.
_REACH = 2
#: Second time at which the rate is evaluated, after the start and in units of the time of the
#: motion: not 1/2, where a force that is zero at the start may be zero again.
LATER = 0.37
#: Distance from the start at which it is evaluated, as a part of the sizes: a coupling that
#: vanishes at the start, as in a product of two entries at zero, does not vanish there.
ASIDE = 1 / 16
#: Time over which the change of a rate is measured, as a part of the horizon.
_AHEAD = 2.0**-20
#: The horizon is the span or, if that is shorter, this multiple of the time in which the slowest
#: entry changes by its size: a span may be a mere limit, as in a search for an event.
_HORIZON = 2.0**10
#: Number of roundings by which a state is shifted to measure their effect on its rate, and parts of
#: that shift, which show more of the effect since rounding is random.
PERTURBED, PARTS = 4.0, np.array([0.0, 1.0, 0.6, 0.2, -0.2, -0.6, -1.0])
#: Where the rate exceeds this multiple of the motion's own, as near a singularity, its rounding
#: says nothing about the motion.
_FASTER = 16.0
#: A rate is little else than rounding where the effect of rounding exceeds this part of it.
ALL_ROUNDING = 2.0**-16
#: The usual effect of rounding on a rate, in roundings of it. At the tightest tolerances it may be
#: less.
_USUAL = 2.0**12
#: Likewise for an entry with a size of its own, which may be small beside what its rate is made of,
#: as a high mode that is computed from all others: their rounding is no part of its motion.
USUAL_ALONE = 2.0**3
#: Number of rounds that measure the effect of rounding on a rate. It is random: one may show little
#: of it, and others after it a thousand times as much. With so many rounds, this part of the usual
#: margin is enough.
_NOISE_ROUNDS, MARGIN = 8, 1 / 8
#: Multiple of that noise above which a rate is more than rounding.
TIMES_NOISE = 4.0
#: Logarithm of the largest weight of an entry; the least is 1 over it.
_LOG_WEIGHT = 0.2
#: A group is near a turning point, and counts as zero, if it is less than this part of the change
#: that its rate makes in the time of the other groups.
_TURNING = 2.0**-6
#: Number of halvings of the span, after each of which a forcing is evaluated; it has begun where it
#: is this part of the largest of these values; the time of a motion that it starts from rest is at
#: most this multiple of the time in which it begins.
_HALVES, _BEGUN, _SLOWER = 48, 0.5, 4.0
#: Numbers of the evaluations of `_by_change_of_rate` that are a little after the start, later in
#: the motion, with a rounding added, and displaced by the effect of rounding.
_SOON, _LATER, _ROUNDED, _BESIDE = (2, 3, 6), (4, 5, 8, 10, 11, 12), (5, 6, 7, 11), (8, 9, 12, 13)
#: An effect of rounding that exceeds this multiple of that later in the motion, or of one rounding
#: of the rate there, is that of a place which the motion leaves at once.
_STAYS = 2.0**10


class Groups(NamedTuple):
    """Which entries of a state share a size; static.

    Attributes:
      group_of: the group of each of the k entries, numbered from 0 as they appear.
      most: the largest size that each entry may have: 1 for angles, whose scale is the radian;
        infinite for others.
      known: whether units, or the form [q, v], say for all entries which belong together.
    """

    group_of: tuple[int, ...]
    most: tuple[float, ...]
    known: bool = False

    @property
    def alone(self) -> bool:
        """Whether each entry has a group of its own."""
        return len(set(self.group_of)) == len(self.group_of)

    def sizes(self, x: Array, *, in_loop: bool = False) -> Array:
        """(k, ...) the size of each entry, the same in a group, for entries of sizes x (k, ...)."""
        x = self.largest(x, in_loop=in_loop)
        if all(most == np.inf for most in self.most):
            return x
        return jnp.minimum(x, np.array(self.most).reshape(-1, *[1] * (x.ndim - 1)))

    def sizes_on_host(self, x: np.ndarray) -> np.ndarray:
        """(k,) `sizes`, in NumPy."""
        of, found = np.array(self.group_of), np.array(x, float)
        for group in range(max(self.group_of) + 1):
            found[of == group] = found[of == group].max()
        return np.minimum(found, self.most)

    def largest(self, x: Array, *, in_loop: bool = False) -> Array:
        """(k, ...) the largest of each group of numbers x (k, ...) that are not negative.

        It is found by reductions, which compile fastest; in a loop over steps it is written out
        where there are few entries, since a reduction would keep XLA from fusing the loop.
        """
        if self.alone:
            return x
        n = max(self.group_of) + 1
        if in_loop and len(x) <= UNROLLED_ENTRIES:
            rows = [[i for i, group in enumerate(self.group_of) if group == g] for g in range(n)]
            tops = [_pairwise_maximum([x[i] for i in row]) for row in rows]
            return jnp.stack([tops[group] for group in self.group_of])
        member = np.equal.outer(np.arange(n), self.group_of).reshape(n, -1, *[1] * (x.ndim - 1))
        tops = jnp.max(jnp.where(member, x[None], 0.0), axis=1, keepdims=True)
        return jnp.max(jnp.where(member, tops, 0.0), axis=0)


def _pairwise_maximum(parts: list[Array]) -> Array:
    """The maximum of numbers, found pairwise, so that comparisons do not wait for each other."""
    while len(parts) > 1:
        pairs = [lax.max(a, b) for a, b in zip(parts[::2], parts[1::2], strict=False)]
        parts = pairs + ([parts[-1]] if len(parts) % 2 else [])
    return parts[0]


def groups(system: "System") -> Groups:
    """The groups of a system's state: one for each unit, or half of [q, v] without units."""
    units = [unit for _, unit in system.labels()]
    k, second = len(units), system.second_order
    halves = ["q"] * (k // 2) + ["v"] * (k - k // 2)
    names = [
        unit if unit != _UNSPECIFIED else (halves[i], _UNSPECIFIED) if second else (i, _UNSPECIFIED)
        for i, unit in enumerate(units)
    ]
    most = tuple(1.0 if unit == _RADIAN else np.inf for unit in units)
    return groups_of_names(names, most, known=second or _UNSPECIFIED not in units)


def groups_of_names(
    names: Sequence[Hashable], most: tuple[float, ...] = (), *, known: bool = False
) -> Groups:
    """Groups of entries with equal names."""
    order = {name: i for i, name in enumerate(dict.fromkeys(names))}
    of = tuple(order[name] for name in names)
    return Groups(of, most or (np.inf,) * len(names), known)


class Scales(NamedTuple):
    """The scales of a motion.

    Attributes:
      sizes: (k,) the sizes of the entries of its state.
      time: () the time in which it changes.
      noise: (k,) the change of each rate by a few roundings of the state, where that is a notable
        part of it; None if it is not known.
    """

    sizes: Array
    time: Array
    noise: Array | None = None


def at_start(
    field: Any, groups: Groups, t0: Array, y0: Array, t1: Array, *, driven: bool = True
) -> tuple[Scales, Array]:
    """The scales of the motion from (t0, y0) before it is known, and its rate (k,) there.

    Where units say which entries belong together, the time is the shortest in which the rate, or
    its change along the motion, changes an entry by its size; a group at zero has the size that it
    reaches in that time.

    Entries without units have no others to be measured by. With J the Jacobian of the rate f at and
    near the start, the time tau is 1 over the spectral radius of |J|. Sizes are the largest of
    |y0|, tau |f|, at the start and a time later, and tau |J| times the sizes: an entry that is
    zero, or whose terms cancel, has the size that others give it.

    An entry has the size 0 if nothing moves it; the time is at most |t1 - t0|.

    A forcing may be zero at the start, as A sin(omega t) is; then the rate there shows nothing. A
    motion that begins in this way, from rest, has the time in which the forcing begins to act or,
    if that is shorter, the time that |J| gives for what it moves; units are not needed for that.

    Args:
      field: an object with ``rate(t, y)``.
      groups: the groups of its state.
      t0: () start time.
      y0: (k,) start.
      t1: () end time.
      driven: whether the rate may depend on time.
    Limits: the rate must have derivatives in forward mode; those that are not finite count as 0.
    """
    here, span = groups.sizes(lax.abs(y0)), lax.abs(t1 - t0)
    ahead = lax.sign(t1 - t0)
    forcing = _forcing(field, t0, y0, span, ahead) if driven else _no_forcing(y0, span)
    if not groups.known:
        return _by_its_derivatives(field, groups, t0, y0, here, forcing, ahead)
    scales, rate = _by_change_of_rate(field, groups, t0, y0, here, span, ahead)
    if not driven:
        return scales, rate
    alone = Groups(tuple(range(len(y0))), (np.inf,) * len(y0))

    def from_rest(scales: Scales) -> Scales:
        found, _ = _by_its_derivatives(field, alone, t0, y0, lax.abs(y0), forcing, ahead)
        return Scales(groups.sizes(lax.max(found.sizes, here)), found.time, scales.noise)

    return lax.cond(forcing.from_rest, from_rest, lambda scales: scales, scales), rate


class _Forcing(NamedTuple):
    """What moves a state later in the span where its rate at the start does not.

    Attributes:
      most: (k,) the largest rates of entries that have none at the start.
      span: () the span or, where everything is at rest, a few times that in which a forcing begins.
      from_rest: () whether a forcing moves a state of which nothing moves at the start.
    """

    most: Array
    span: Array
    from_rest: Array


def _no_forcing(y0: Array, span: Array) -> _Forcing:
    return _Forcing(jnp.zeros_like(y0), span, jnp.zeros((), bool))


def _forcing(field: Any, t0: Array, y0: Array, span: Array, ahead: Array) -> _Forcing:
    """The forcing of a start, from the rates of its state (k,) after the span and its halves."""
    after = span * np.append(0.0, 0.5 ** np.arange(_HALVES)).astype(y0.dtype)
    rates = lax.map(lambda time: field.rate(t0 + ahead * time, y0), after)
    still = rates[0] == 0
    change = jnp.where(still[None], _finite_magnitude(rates), 0.0)
    most = jnp.max(change, axis=0)
    begun = ((change > 0) & (change >= _BEGUN * most[None])).any(axis=1)
    begins = jnp.min(jnp.where(begun, after, span))
    from_rest = still.all() & (most > 0).any()
    return _Forcing(most, lax.select(from_rest, lax.min(span, _SLOWER * begins), span), from_rest)


def _by_its_derivatives(
    field: Any,
    groups: Groups,
    t0: Array,
    y0: Array,
    here: Array,
    forcing: _Forcing,
    ahead: Array,
) -> tuple[Scales, Array]:
    """The result of `at_start` from the rate and its Jacobian, for a start of sizes `here` (k,)."""
    plan, rounds, span = jnp.asarray(_PLAN), len(_PLAN), forcing.span
    weights, off, zero = weights_of(len(y0)), rounding(y0), jnp.zeros_like(y0)

    def goes_on(carry):
        return carry[1] < _NOISE_ROUNDS

    def round_(carry):
        stage, probe, u, rate, then, stays, noise, grows = carry
        n, tau, step = stage.n, stage.tau, stage.step
        sizing = (n < rounds) | (grows & (n < rounds + len(y0)))
        probe = lax.select(sizing, probe, probe + 1)
        row = lax.dynamic_index_in_dim(plan, lax.min(n, rounds - 1), 0, False)
        now = _Round(*(row[i] for i in range(len(row))))
        along = weights * u
        # For the effect of rounding the rate is evaluated twice a little later in the motion, the
        # second time with a rounding added, then at the start with a rounding added, beside the
        # start, and at the start again with other roundings.
        far = (probe == 1) | (probe == 2)
        rounded = ((probe == 2) | (probe == 3)).astype(float)
        rounded = lax.select(probe > 4, 1.0 - 0.4 * (probe - 4).astype(float), rounded)
        t = t0 + lax.select(sizing, now.later, LATER * far.astype(float)) * tau * ahead
        t = t + _time_rounding(t0, (probe == 2).astype(float))
        drift = LATER * tau * ahead * far.astype(float) * rate
        aside = now.aside * sizing.astype(float) * along
        at = y0 + aside + drift + tau * noise * (probe == 4).astype(float)
        at = at + at * off * rounded
        f, by_u = jax.jvp(lambda y: field.rate(t, y), (at,), (along,))
        rate, then = lax.select(n == 0, f, rate), lax.select(probe == 1, f, then)
        gap = f - lax.select(probe == 2, then, rate)
        noise, stays = _noise_after(probe, groups, gap, f, tau, u, noise, stays)
        speeds, carried = lax.max(lax.abs(f), lax.abs(rate)), lax.abs(by_u)
        speeds = lax.select(n == 0, lax.max(speeds, forcing.most), speeds)
        shrink = 1.0 / lax.max(1.0, now.shrinks * step * _largest_ratio(carried, u))
        by_rate = now.first / _positive_or(_largest_ratio(speeds, u), 1 / span) + now.time * tau
        by_others = now.product + now.step * shrink * step
        kept = lax.max(now.here * here, now.kept * shrink * u)
        new = groups.sizes(lax.max(kept, lax.max(by_rate * speeds, by_others * carried)))
        new = lax.select(sizing & (new < np.inf), new, u)
        stage, new = _next_stage(stage, u, new, shrink, 1 / span, sizing)
        grows = ((new > 0) & (u == 0)).any()
        return stage, probe, new, rate, then, stays, noise, grows

    none = jnp.zeros((), int)
    first = _Stage(none, none, zero, 0 * span, span, span)
    begin = first, none, here, zero, zero, zero + np.inf, zero, jnp.ones((), bool)
    stage, _, sizes, rate, _, _, noise, _ = lax.while_loop(goes_on, round_, begin)
    return Scales(sizes, stage.tau, MARGIN * noise), rate


def _noise_after(
    probe: Array,
    groups: Groups,
    gap: Array,
    rate: Array,
    tau: Array,
    sizes: Array,
    noise: Array,
    stays: Array,
) -> tuple[Array, Array]:
    """The effect of rounding on the rate (k,), and on the rate later in the motion, after a probe.

    Args:
      probe: () its number: 2 is that later in the motion, those after it are at the start.
      groups: the groups of the state.
      gap: (k,) the change of the rate in this probe.
      rate: (k,) the rate in it.
      tau: () the time of the motion.
      sizes: (k,) its sizes.
      noise: (k,) the first result so far.
      stays: (k,) the second one, infinite where it is not known.
    """
    later, gap = _noise_later(groups, gap, rate), _finite_magnitude(gap)
    typical = _is_as_fast(rate, gap, tau, sizes)
    stays = lax.select((probe == 2) & typical, later, stays)
    gap = lax.select((probe > 2) & (gap > _STAYS * stays), stays, gap)
    found = _notable_in_groups(groups, gap, rate, sizes / tau, probe == 4)
    return lax.select((probe > 1) & typical, lax.max(noise, found), noise), stays


def sizes_at_start(scene: Any, t0: Any = 0.0, t1: Any = None) -> np.ndarray:
    """(k,) the sizes of `at_start`; what nothing moves has the mean of the others, or 1."""
    starts = np.asarray(scene.y0)[None]
    return sizes_at_starts(scene, starts, t0, scene.t1 if t1 is None else t1)[0]


def sizes_at_starts(
    scene: Any, starts: np.ndarray, t0: Any, t1: Any, params: Any | None = None
) -> np.ndarray:
    """(n, k) sizes of a scene from several starts (n, k), each with its own numbers in `params`."""
    times = (jnp.asarray(t, float) for t in (t0, t1))
    numbers, tree = jax.tree.flatten((scene if params is None else params).field)
    shared = map(np.ndim, jax.tree.leaves(scene.field))
    own = [np.ndim(x) > axes for x, axes in zip(numbers, shared, strict=True)]
    found = _at_starts(tree, tuple(own), numbers, groups(scene.system), jnp.asarray(starts), *times)
    sizes = np.asarray(found)
    moves = (sizes > 0) & np.isfinite(sizes)
    count = np.maximum(moves.sum(axis=1, keepdims=True), 1)
    mean = np.log(np.where(moves, sizes, 1.0)).sum(axis=1, keepdims=True) / count
    return np.where(moves, sizes, np.exp(mean))


@eqx.filter_jit
def _at_starts(tree, own, numbers, groups: Groups, starts: Array, t0: Array, t1: Array) -> Array:
    def sizes(numbers, y0):
        return at_start(jax.tree.unflatten(tree, numbers), groups, t0, y0, t1)[0].sizes

    axes = [0 if is_own else None for is_own in own]
    return jax.vmap(sizes, in_axes=(axes, 0))(numbers, starts)


def _by_change_of_rate(
    field: Any, groups: Groups, t0: Array, y0: Array, here: Array, span: Array, ahead: Array
) -> tuple[Scales, Array]:
    """The result of `at_start` for known groups, of sizes `here` (k,), from the rate.

    The rate is evaluated at the start; for a motion from rest also right after it, since the span
    may be a mere limit; and twice a little later. It is evaluated again for a state that differs by
    a rounding, a little later and at the start, and for starts displaced by the effect of rounding
    on the rate: by that at the start, and by that later in the motion, which may be larger.

    Each of these changes is first made later in the motion, for comparison: the direction of a
    spring whose ends nearly coincide, or of friction at rest, depends on the least rounding, but
    only at a place that the motion leaves at once.
    """
    off = rounding(y0)
    # A time that is short for any motion.
    at_once = float(np.sqrt(jnp.finfo(y0.dtype).tiny))

    def evaluate(carry: tuple[Array, ...], n: Array) -> tuple[tuple[Array, ...], None]:
        first, then, later, stays, noise, most, horizon, moving = carry
        soon, far, rounded, aside = (
            (n == np.array(numbers)).any() for numbers in (_SOON, _LATER, _ROUNDED, _BESIDE)
        )
        plain = far & ~rounded & ~aside
        tau, sizes = _time_and_sizes(groups, here, span, first, then, noise, horizon)
        begins = (n == 1) & ~moving
        after = lax.select(begins, lax.full_like(span, at_once), _AHEAD * horizon)
        time = after * (soon | (n == 1)).astype(float) + LATER * tau * far.astype(float)
        # A motion from rest leaves its place by the change of its rate.
        change = 0.5 * LATER * tau / _positive_or(_AHEAD * horizon, lax.full_like(span, 1.0))
        bend = change * jnp.nan_to_num(then - first, posinf=0.0, neginf=0.0) * far.astype(float)
        time = ahead * time
        off_by = lax.select(n < 10, horizon * noise, tau * most) * aside.astype(float)
        at = y0 + time * (first + bend) + off_by
        t = t0 + time + _time_rounding(t0, (far & rounded).astype(float))
        rate = field.rate(t, at + at * off * rounded.astype(float))
        # At rest the rate grows with time from zero; where nothing moves at all, the span remains.
        slowest = _largest_ratio(here, groups.largest(lax.abs(rate)))
        slowest = lax.select(moving, slowest, lax.sqrt(after * slowest))
        new = ((n == 0) | (((n == 1) | (n == 2)) & ~moving)) & (slowest > 0)
        moving = (slowest > 0) & (n == 0) | moving & (n > 0)
        horizon = lax.select(new, lax.min(span, _HORIZON * slowest), horizon)
        # What hardly moves at the start, as at a turning point, may turn long before the horizon.
        turns = _HORIZON * _slowest_turn(groups, here, first, rate - first, after)
        shorter = ((n == 1) | (n == 2)) & moving & (0 < turns) & (turns < horizon / _HORIZON)
        horizon = lax.select(shorter, turns, horizon)
        first = lax.select(n == 0, rate, first)
        then = lax.select(n == 3, rate, then)
        later = lax.select(plain, rate, later)
        gap = rate - lax.select(n == 6, then, lax.select(far, later, first))
        stays = lax.select(far & ~plain, lax.max(stays, _noise_later(groups, gap, rate)), stays)
        gap = _finite_magnitude(gap)
        gap = lax.select(~far & (gap > _STAYS * stays), stays, gap)
        noise = lax.select((n > 5) & (n < 10) & ~far, lax.max(noise, gap), noise)
        counts = (n > 5) & (~far | (n == 11) & _is_as_fast(rate, gap, tau, sizes))
        most = lax.select(
            counts, lax.max(most, _notable_in_groups(groups, gap, rate, sizes / tau, aside)), most
        )
        return (first, then, later, stays, noise, most, horizon, moving), None

    # A loop, so that the rate is compiled once: a tenth of the time until a first result.
    zero = jnp.zeros_like(y0)
    begin = zero, zero, zero, zero, zero, zero, span, jnp.ones((), bool)
    (f, then, _, _, noise, most, horizon, _), _ = lax.scan(evaluate, begin, jnp.arange(14))
    tau, sizes = _time_and_sizes(groups, here, span, f, then, noise, horizon)
    return Scales(sizes, tau, most), f


def _slowest_turn(groups: Groups, here: Array, rate: Array, gap: Array, after: Array) -> Array:
    """() the time in which the slowest group of sizes `here` changes by its size, or turns.

    Args:
      groups: the groups of the state.
      here: (k,) their sizes.
      rate: (k,) the rate.
      gap: (k,) its change after a time.
      after: () that time.
    """
    moves, turns = groups.largest(jnp.abs(jnp.stack([rate, gap], -1))).T
    by_turn = lax.sqrt(jnp.where(turns > 0, here * after / turns, np.inf))
    times = lax.min(jnp.where(moves > 0, here / moves, np.inf), by_turn)
    return jnp.max(jnp.where(times < np.inf, times, 0.0))


def _noise_later(groups: Groups, gap: Array, rate: Array) -> Array:
    """(k,) the effect of rounding on the rate later in the motion, at least one rounding of it.

    Args:
      groups: the groups of the state.
      gap: (k,) the change of the rate by a rounding later in the motion.
      rate: (k,) the rate there; where it is not finite, the result is infinite.
    """
    rounded = lax.max(lax.abs(gap), jnp.finfo(rate.dtype).eps * lax.abs(rate))
    return groups.largest(jnp.where(jnp.isfinite(rounded), rounded, np.inf))


def _time_and_sizes(
    groups: Groups,
    here: Array,
    span: Array,
    rate: Array,
    then: Array,
    noise: Array,
    horizon: Array,
) -> tuple[Array, Array]:
    """The time () of a motion and its sizes (k,), from the change of its rate.

    Args:
      groups: the groups of its state.
      here: (k,) the sizes of the start itself.
      span: () the span.
      rate: (k,) the rate at the start.
      then: (k,) the rate a part `_AHEAD` of the horizon later.
      noise: (k,) the effect of rounding on the rate.
      horizon: () the horizon.
    """
    noise = groups.largest(noise)

    def known(x: Array) -> Array:
        return lax.select(x > TIMES_NOISE * noise, x, jnp.zeros_like(x))

    change = known(lax.abs(then - rate)) / _positive_or(_AHEAD * horizon, jnp.ones_like(span))
    moves, turns = groups.largest(jnp.stack([known(lax.abs(rate)), change], -1)).T
    turns = lax.select(turns < np.inf, turns, jnp.zeros_like(turns))
    # What is only rounding of the motion's displacement counts as zero: it gives no time.
    least = jnp.finfo(rate.dtype).eps * horizon * moves
    there = lax.select(here > least, here, jnp.zeros_like(here))
    speeds = lax.max(_ratio(moves, there), lax.sqrt(_ratio(turns, there)))
    there, speeds = _without_turning(groups, there, moves, speeds)
    begins = _ratio(lax.select(there > 0, jnp.zeros_like(turns), turns), moves)
    speed = lax.reduce_max(lax.max(speeds, begins), (0,))
    tau = 1 / lax.max(speed, 1 / span)
    return tau, groups.sizes(lax.max(here, tau * lax.max(moves, tau * turns)))


def _without_turning(
    groups: Groups, there: Array, moves: Array, speeds: Array
) -> tuple[Array, Array]:
    """(k,) sizes and (k,) speeds, with 0 for a group near a turning point.

    There a velocity is nearly zero: by itself it would give a time as short as that to the turning
    point, in which nothing else happens.
    """
    others = _largest_of_other_groups(groups, speeds)
    turned = (others > 0) & (there * others < _TURNING * moves)
    there = lax.select(turned, jnp.zeros_like(there), there)
    return there, lax.select(turned, jnp.zeros_like(speeds), speeds)


def _largest_of_other_groups(groups: Groups, x: Array) -> Array:
    """(k,) for each entry the largest of the numbers x (k,) of other groups; 0 without others."""
    first = [groups.group_of.index(group) for group in range(max(groups.group_of) + 1)]
    of_groups = [x[i] for i in first]
    found = [
        _pairwise_maximum([jnp.zeros_like(x[0]), *of_groups[:group], *of_groups[group + 1 :]])
        for group in range(len(first))
    ]
    return jnp.stack(found)[np.array(groups.group_of)]


class _Round(NamedTuple):
    """The factors of a round of `at_start`.

    Attributes:
      later: when the rate is evaluated, in units of the time of the motion.
      aside: how far from the state it is evaluated, as a part of the sizes.
      here: how much of |y0| is kept, at least.
      kept: how much of the sizes is kept.
      first: how much of the change by the rate is taken, in the time that is known first.
      time: how much of it is taken in the time of the motion.
      product: how much of |J| times the sizes is taken.
      step: how much of it is taken in the time `_Stage.step`.
      shrinks: whether that time is at most the one in which the fastest entry changes by its size:
        sizes must not be too large, since the motion soon shows larger ones, but never smaller.
    """

    later: Any = 0.0
    aside: Any = 0.0
    here: Any = 0.0
    kept: Any = 0.0
    first: Any = 0.0
    time: Any = 0.0
    product: Any = 0.0
    step: Any = 0.0
    shrinks: Any = 0.0


_PLAN = np.array(
    [
        _Round(here=1.0, first=1.0),
        *[_Round(product=1.0)] * _MEASURED,
        _Round(later=LATER, here=1.0, time=1.0),
        *[_Round(kept=1.0, step=1.0)] * _REACH,
        _Round(aside=ASIDE, here=1.0, kept=1.0, step=1.0, shrinks=1.0),
        _Round(kept=1.0, step=1.0),
    ]
)


class _Stage(NamedTuple):
    """How far `at_start` has come.

    Attributes:
      n: () number of the round.
      again: () number of rounds that were repeated.
      before: (k,) the sizes before their growth is measured.
      first: () their growth by one of the first two products.
      tau: () the time of the motion.
      step: () the time in which others change an entry, at most `tau`.
    """

    n: Array
    again: Array
    before: Array
    first: Array
    tau: Array
    step: Array


def _next_stage(
    stage: _Stage, u: Array, new: Array, shrink: Array, slowest: Array, sizing: Array
) -> tuple[_Stage, Array]:
    """The stage after a round, and its sizes (k,).

    Args:
      stage: the stage before.
      u: (k,) sizes before the round.
      new: (k,) sizes after it.
      shrink: () the factor by which it made the time `step` shorter.
      slowest: () [1/time] the least speed of the motion.
      sizing: () whether it was a round that finds sizes.
    """
    n, again, before, first, tau, step = stage
    twice = lax.sqrt(_largest_ratio(new, before))
    growth = lax.sqrt(twice)  # per product; a power compiles long
    tau = lax.select(n == _MEASURED, 1 / lax.max(growth, slowest), tau)
    first = lax.select(n == _MEASURED - _PRODUCTS // 2, twice, first)
    early = (n == _MEASURED) & (0 < growth) & (growth < _SETTLED * first) & (again < len(u))
    # Sizes that grow in all measurements would overflow.
    new = lax.select(early, new / growth**_PRODUCTS, new)
    n = lax.select(early, jnp.full_like(n, _PRODUCTS_BEFORE), n)
    before = lax.select(n == _PRODUCTS_BEFORE, new, before)
    step = lax.select(n <= _MEASURED, tau, shrink * step)
    carries = (
        (n == _MEASURED + 1 + _REACH) & (_largest_ratio(new, u) > 1 / _SETTLED) & (again < len(u))
    )
    again = again + (early | carries).astype(again.dtype)
    n = n + (sizing & ~carries).astype(n.dtype)
    return _Stage(n, again, before, first, tau, step), new


def _time_rounding(t0: Array, rounded: Array) -> Array:
    """() a few roundings of the time, which far from 0 are more than those of the state.

    They are made later in the motion only: a force that begins right after the start is no noise.
    """
    return rounded * PERTURBED * jnp.finfo(t0.dtype).eps * t0


def rounding(y: Array | np.ndarray) -> np.ndarray:
    """(k,) a few roundings of each entry of a state, as a part of it, of either sign."""
    return PERTURBED * jnp.finfo(y.dtype).eps * np.resize([1.0, -1.0, -1.0], len(y))


def shifted(y: Any) -> Any:
    """(s, k) a state, and states that differ from it by a few roundings."""
    return y[None] * (1.0 + np.outer(PARTS, rounding(y)))


def notable(gap: Array, rate: Array, roundings: float | np.ndarray = _USUAL) -> Array:
    """The effect of rounding on a rate where it is more than on any rate; else 0."""
    usual = roundings * jnp.finfo(rate.dtype).eps * rate
    return lax.select(gap > usual, gap, jnp.zeros_like(gap))


def _notable_in_groups(
    groups: Groups, gap: Array, rate: Array, usual: Array, aside: Array
) -> Array:
    """(k,) the result of `notable` in groups, whose rates count as at least `usual` (k,).

    At rest the rates themselves vanish. Beside the start, displaced by the effect of rounding, the
    result counts only where the rate is hardly anything else: what holds a motion on its
    constraints responds to any distance from them.
    """
    gap, rate = groups.largest(jnp.stack([gap, lax.abs(rate)], -1)).T
    rate = lax.max(rate, usual)
    alone = np.bincount(groups.group_of)[list(groups.group_of)] == 1
    roundings = np.where(alone & (not groups.known), USUAL_ALONE, _USUAL)
    return notable(gap, rate, roundings) * (~aside | (gap > ALL_ROUNDING * rate)).astype(float)


def weights_of(k: int) -> np.ndarray:
    """(k,) generic weights of either sign; 1 for a single entry."""
    if k == 1:
        return np.ones(1)
    random = np.random.default_rng(0)
    return np.exp(random.uniform(-_LOG_WEIGHT, _LOG_WEIGHT, k)) * random.choice([-1.0, 1.0], k)


def _finite_magnitude(x: Array) -> Array:
    """The absolute values, 0 for those that are not finite."""
    return jnp.where(jnp.isfinite(x), jnp.abs(x), 0.0)


def _is_as_fast(rate: Array, gap: Array, tau: Array, sizes: Array) -> Array:
    """Whether () the rate at a place is like that of the motion, not like that near a singularity.

    Entries that are hardly more than rounding say nothing about it.
    """
    change = tau * lax.abs(rate)
    change = lax.select(gap < ALL_ROUNDING * lax.abs(rate), change, jnp.zeros_like(change))
    return _largest_ratio(change, sizes) < _FASTER


def _largest_ratio(a: Array, b: Array) -> Array:
    """() the largest a / b where b is positive, of numbers that are not negative; else 0."""
    return lax.reduce_max(_ratio(a, b), (0,))


def _ratio(a: Array, b: Array) -> Array:
    """The ratio a / b where b is positive, of numbers that are not negative; else 0."""
    positive = b > 0
    return lax.select(positive, a, jnp.zeros_like(a)) / lax.select(positive, b, jnp.ones_like(b))


def _positive_or(a: Array, b: Array) -> Array:
    """() a where it is positive, else b."""
    return lax.select(a > 0, a, b)
