"""Stoermer's method with extrapolation: few long steps, for velocity-independent forces.

A step is integrated by the leapfrog in 1, 2, 3, ... substeps, and the results are extrapolated to
substeps of length zero; each such column raises the order by two (Hairer, Norsett, Wanner, II.9
and II.14). That takes two to three times the evaluations of a Nystrom pair. But the columns are
independent: four lanes take them in turn, vectorised, so that 31 evaluations take the time of 9,
and 53 that of 14. For a few bodies a step of order 14 takes 0.4 of the time of a step of the pair
of order 12, and about as many steps are needed.

Nearly equal numbers of substeps amplify rounding, which differs between substeps: the numbers 1 to
7 do so by 13, and their errors in close encounters are ten times those of a pair. The numbers used
here, the last ones far apart, amplify it by 3, and the lanes take 1.15 times as long. It is the
rounding of positions that counts, where forces change fast with them: sums within the columns with
twice the digits take 1.4 times as long and change errors little.
"""

import dataclasses
import functools
from collections.abc import Sequence
from fractions import Fraction
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import materialize, runtime_one
from jaxdyn.solvers.method import Advance, Method, Rate, fastest_rate, stability_limit
from jaxdyn.solvers.pairs import NYSTROM12
from jaxdyn.solvers.side_by_side import side_by_side

_LANES = 4  # doubles in a vector of most processors
#: The part of an estimate that this many roundings of the positions explain, through forces that
#: change with them, gets this weight, since shorter steps would not make it smaller. The weight is
#: not zero, or steps would grow until they are rejected.
_POSITION_ROUNDINGS, _ROUNDING_WEIGHT = 30.0, 0.02
#: Positions whose relative difference is smaller say nothing about forces.
_NEARLY_EQUAL = 1e-13
#: With this many columns, errors at a tolerance are about those of a pair; each further column
#: makes them smaller than the difference of columns, so that the estimate is multiplied by this
#: share for each. Errors of nine columns are then a twentieth of the pair's (median of eleven
#: orbits of three bodies with encounters at 1e-8 and 1e-10), and half of them in one of ten.
_LIKE_A_PAIR, _SHARE = 7, 0.3
#: Number of coordinates up to which each is an array of lanes of its own; 14 of them compile three
#: times as long as together.
_MOST_APART = 9


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Stoermer(Method):
    """The extrapolated leapfrog.

    Limits: velocity-independent accelerations. In ensembles, which are vectorised over motions, a
      pair is twice as fast. At the same tolerance its errors are those of `NYSTROM12` or much
      smaller, but no tolerance gives less than about 1e-14 or, in close encounters far from the
      origin, than a few times what the pair reaches. Variational equations are integrated by
      `NYSTROM12`.

    Attributes:
      counts: (n,) substeps of each column, increasing, at least two.
    """

    counts: tuple[int, ...]
    adaptive: ClassVar[bool] = True
    position_only: ClassVar[bool] = True
    evaluates: ClassVar[bool] = True
    #: At rtol 1e-2 accuracy leads to steps of 0.75 of the limit.
    alarm: ClassVar[float] = 0.9

    def __post_init__(self):
        rising = all(a < b for a, b in zip((0, *self.counts), self.counts, strict=False))
        if len(self.counts) < 2 or not rising:
            raise _checks.fail("counts", "at least two increasing numbers", self.counts)

    @property
    def name(self) -> str:
        """The name in reports."""
        return f"Stoermer {self.order}"

    @property
    def order(self) -> int:
        """Twice the number of columns, since the leapfrog's error has even powers only."""
        return 2 * len(self.counts)

    @property
    def error_order(self) -> int:
        """The order of the extrapolation without the last columns, which gives the estimate."""
        return 2 * _columns_compared(self.counts) + 1

    @property
    def evaluations(self) -> int:
        """Right-hand sides per step."""
        return 1 + sum(self.counts)

    @property
    def for_tangents(self) -> Method:
        """The method `NYSTROM12`: columns of tangents are vectorised anyway."""
        return NYSTROM12

    @functools.cached_property
    def stable(self) -> float:
        """The h omega up to which it is stable."""
        return stability_limit(self._growth)

    @functools.cached_property
    def schedule(self) -> "Schedule":
        """The schedule of the lanes."""
        return _schedule_columns(self.counts)

    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        # The substeps are one loop: unrolled, they compile longer and run no faster.
        half = len(y) // 2
        still = jnp.zeros_like(y[half:])
        # Few entries are kept as scalars: in one array they would be assembled and split again
        # in each substep, with a branch for each.
        few = y.ndim == 1 and half <= _MOST_APART
        rank = 0 if few else y.ndim  # number of axes of a part besides the lanes

        def parts(x):
            x = x[..., None, None]
            return [x[i] for i in range(half)] if few else [x]

        def wide(x):
            return x.reshape(*(1,) * (rank - x.ndim), *x.shape, 1, 1)

        def accelerate(t, *q):
            a = field(t, jnp.concatenate([jnp.stack(q) if few else q[0], still]))[half:]
            return list(a) if few else [a]

        # It starts every column, so it is computed once, not in each of its uses.
        one = runtime_one(h.ravel()[0])
        times = jnp.broadcast_shapes(t.shape, h.shape)
        first = parts(materialize(field(jnp.broadcast_to(t, times), y)[half:], one))
        q, v = parts(y[:half]), parts(y[half:])
        start, length = wide(t), wide(h)
        wider = (x.reshape(*x.shape[:2], *(1,) * rank, *x.shape[2:]) for x in self.schedule)
        table, weights = wider

        def substep(k, carry):
            row = lax.dynamic_index_in_dim(jnp.asarray(table), k, keepdims=False)
            step, since, begins = length * row[0], length * row[1], row[2] > 0
            slot = row[3].ravel()[0].astype(int)
            # The displacement beyond v times the time, and the change of v, both since t.
            (dqs, dvs, forces), ends = carry
            dvs = [
                jnp.where(begins, (0.5 * step) * f, u + step * a)
                for f, u, a in zip(first, dvs, forces, strict=True)
            ]
            dqs = [jnp.where(begins, 0.0, x) + step * u for x, u in zip(dqs, dvs, strict=True)]
            at = (start + since).reshape(*times, _LANES, 1)
            there = [a + (since * b + x) for a, b, x in zip(q, v, dqs, strict=True)]
            # Scalars are cheap to compute again, but arrays are not: each entry of a force would.
            there = there if few else [materialize(x, one) for x in there]
            forces = side_by_side(accelerate, at, *there, axes=2, apart=True)
            new = [*dqs, *(u + (0.5 * step) * a for u, a in zip(dvs, forces, strict=True))]
            # Until a column ends, the next substep overwrites its end.
            put = lax.dynamic_update_index_in_dim
            ends = [put(x, end, slot, 0) for x, end in zip(ends, new, strict=True)]
            return (dqs, dvs, forces), ends

        empty = [jnp.zeros((*x.shape[:-2], _LANES, 1)) for x in q]
        places = [jnp.zeros((len(weights), *x.shape)) for x in empty]
        begin = (empty, empty, empty), [*places, *places]
        (dqs, _, forces), ends = lax.fori_loop(0, len(table), substep, begin)
        # It is multiplied by one, or else XLA cuts the array into constants, each with its memory.
        weights = jnp.asarray(weights) * one
        return _extrapolate(h, y, ends, weights, dqs=dqs, forces=forces)

    def _growth(self, z: float) -> float:
        """Growth factor of a step of length 1 for q'' = -z^2 q."""
        end = np.zeros((2, 2))
        for n, w in zip(self.counts, _weights(self.counts), strict=True):
            q, v = np.eye(2)  # of both motions: from 1 at rest, and from 0 with velocity 1
            for _ in range(n):
                v = v - 0.5 / n * z * z * q
                q = q + v / n
                v = v - 0.5 / n * z * z * q
            end += float(w) * np.stack([q, v])
        return float(np.abs(np.linalg.eigvals(end)).max())


def _extrapolate(
    h: Array, y: Array, ends: list[Array], weights: Array, *, dqs: list[Array], forces: list[Array]
) -> Advance:
    """The step from the ends of its columns, and from the last `dqs` and forces of the lanes."""
    still = jnp.zeros_like(y[len(y) // 2 :])
    increment, error = (
        _join([_weighted_sum(weights[:, row], x) for x in ends], y.shape) for row in range(2)
    )
    increment = increment + jnp.concatenate([h * y[len(y) // 2 :], still])
    # The two columns with the most substeps end side by side, at nearly the same place.
    places, pair = (
        [_join([x[..., j, 0] for x in part], still.shape) for j in range(2)]
        for part in (dqs, forces)
    )
    ratio = fastest_rate(h * h * (pair[0] - pair[1]), places[0] - places[1], h * h * pair[0])
    off = h * h * _steepness(pair, places) * y[: len(y) // 2]
    rounding = (
        _POSITION_ROUNDINGS * jnp.finfo(y.dtype).eps * jnp.abs(jnp.concatenate([off, off / h]))
    )
    small = jnp.clip(error, -rounding, rounding)
    error = (error - small) + _ROUNDING_WEIGHT * small
    return Advance(increment, error, speed=jnp.sqrt(ratio))


def _steepness(forces: list[Array], places: list[Array]) -> Array:
    """The change of forces over that of positions between two places, for each motion."""
    largest = functools.partial(jnp.max, axis=0, keepdims=True)
    apart, change = (largest(jnp.abs(a - b)) for a, b in (places, forces))
    size = largest(jnp.abs(places[0]))
    return change / (apart + _NEARLY_EQUAL * size + jnp.finfo(size.dtype).tiny)


def _weighted_sum(weights: Array, ends: Array) -> Array:
    """Weighted sum; unrolled, since XLA on CPU allocates memory for each `jnp.sum`."""
    terms = [w * x for w, x in zip(weights, ends, strict=True)]
    total = functools.reduce(jnp.add, terms)
    a, b, c, d = (total[..., j, 0] for j in range(_LANES))
    return (a + b) + (c + d)


def _join(parts: list[Array], shape: tuple[int, ...]) -> Array:
    """The entries, or arrays of them, as one array."""
    return jnp.concatenate([x.reshape(-1, *shape[1:]) for x in parts])


class Schedule(NamedTuple):
    """The schedule of the lanes, substep by substep.

    Attributes:
      table: (d, 4, lanes, 1) for each substep: its length in steps, 0 for an idle lane; the
        time at its end since the start of the step, in steps; 1 if it is the first of a column;
        the index where its end is stored, shared until columns end.
      weights: (places, 2, lanes, 1) weights of the columns that end there, 0 for other lanes: in
        the solution, and in the estimate of its error.
    """

    table: np.ndarray
    weights: np.ndarray


def _schedule_columns(counts: Sequence[int]) -> Schedule:
    """Columns in the fewest substeps of four lanes, the longest of each lane last."""
    lanes: list[list[int]] = [[] for _ in range(_LANES)]
    for n in sorted(counts, reverse=True):
        min(lanes, key=sum).insert(0, n)
    depth = max(map(sum, lanes))
    table = np.zeros((depth, 4, _LANES, 1))
    length, since, first, place = (table[:, i] for i in range(4))
    first[:] = 1.0
    weights = np.zeros((depth + 1, 2, _LANES, 1))
    solution = dict(zip(counts, _weights(counts), strict=True))
    others = counts[: _columns_compared(counts)]
    without = dict(zip(others, _weights(others), strict=True))
    share = _SHARE ** max(0, len(counts) - _LIKE_A_PAIR)
    change = {n: share * float(w - without.get(n, 0)) for n, w in solution.items()}
    for j, lane in enumerate(lanes):
        end = depth - sum(lane)
        for n in lane:
            begin, end = end, end + n
            length[begin:end, j] = 1 / n
            first[begin + 1 : end, j] = 0.0
            since[begin:end, j, 0] = np.arange(1, n + 1) / n
            weights[end, :, j, 0] = solution[n], change[n]
    ends = np.flatnonzero(weights.any((1, 2, 3)))
    place[:, 0, 0] = np.searchsorted(ends, np.arange(1, depth + 1))
    return Schedule(table, weights[ends])


def _columns_compared(counts: Sequence[int]) -> int:
    """Number of first columns with which the result is compared, to estimate its error.

    Without a third of the columns the order is lower by four or six. So errors of a motion at a
    tolerance are no larger than those of a pair, whose estimates are of a lower order too; and the
    estimate is so much larger than the amplified rounding that tolerances may be fine. With only
    one column left out, errors were 10 to 800 times as large, and steps at 1e-15 a tenth as long.
    """
    return len(counts) - max(1, len(counts) // 3)


@functools.cache  # called for a hundred step lengths to find where stability ends
def _weights(counts: tuple[int, ...]) -> tuple[Fraction, ...]:
    """Weights of the columns in the extrapolation to substeps of length zero."""

    def weight(n: int) -> Fraction:
        factors = (Fraction(n * n, n * n - m * m) for m in counts if m != n)
        return functools.reduce(lambda a, b: a * b, factors, Fraction(1))

    return tuple(weight(n) for n in counts)


#: The second takes as long as the first for errors of 1e-6, and 0.8 of its time for 1e-12.
STOERMER14 = Stoermer((1, 2, 3, 4, 5, 7, 9))
STOERMER18 = Stoermer((1, 2, 3, 4, 5, 6, 7, 11, 14))
