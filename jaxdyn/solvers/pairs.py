"""Explicit pairs: Runge-Kutta for any vector field, Nystrom for velocity-independent forces.

A `Pair` is a table of coefficients; one whose error weights are all zero (`EULER`, `RK4`)
estimates no error and takes equal steps. A step has two forms, which are equal up to rounding:

- unrolled: one expression per stage. It compiles to straight-line code, the fastest for one
  trajectory.
- rolled: loops over stages with buffers. It compiles several times faster and runs faster where
  each stage is wide, as for the variational equations with their many columns. One loop passes
  over the whole buffer at each stage; of two loops the first passes over half of it.

Coefficient tables are package data (``data/*.json``): decimal strings or fractions, rounded
once to float64. A correction below removes the rounding of the weights, and `Advance.rest` carries
the correction.
"""

import bisect
import dataclasses
import functools
import itertools
import json
from collections.abc import Callable
from fractions import Fraction
from importlib import resources
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import materialize, runtime_one
from jaxdyn.solvers.method import Advance, Method, Rate, fastest_rate, in_loops, stability_limit

# ---- Corrections of the rounded weights of Runge-Kutta and Nystrom tables
#
# Rounded tables break the order conditions in the 17th digit, at every step in the same way, so
# that energies drift in proportion to time although each sum is compensated. A change of a few
# weights restores them; `Advance.rest` carries its effect on a step.

_CORRECTED_STAGES = 4  # number of stages whose weights are corrected


def weight_correction(
    c: np.ndarray, a: np.ndarray, weights: np.ndarray, order: int, *, position_only: bool
) -> np.ndarray:
    """(w, s) a correction of a few weights that restores the order conditions.

    Defects of the order conditions are found in rational arithmetic; they are so small that
    the change has to be right only to a few digits. The vectors of the conditions are nearly
    powers of the nodes, up to the third, so four stages at different times are enough.
    """
    exact_a = [[Fraction(x) for x in row] for row in a.tolist()]
    exact_c = [Fraction(x) for x in c.tolist()]
    rows = []
    for i, given in enumerate(weights):
        used = np.flatnonzero(given)
        _, apart = np.unique(c[used], return_index=True)
        spread = np.unique(np.linspace(0, len(apart) - 1, _CORRECTED_STAGES).round().astype(int))
        few = used[apart[spread]]
        conditions = [x for x in _conditions(exact_a, exact_c, position_only, i) if x[0] <= order]
        exact = [Fraction(w) for w in given.tolist()]
        defects = [value - sum(exact[j] * x[j] for j in used) for _, x, value in conditions]
        matrix = np.array([[float(x[j]) for j in few] for _, x, _ in conditions])
        change, *_ = np.linalg.lstsq(matrix, np.array([float(d) for d in defects]), rcond=1e-9)
        row = np.zeros(len(c))
        row[few] = change
        rows.append(row)
    return np.array(rows)


def _conditions(
    a: list, c: list, position_only: bool, row: int
) -> list[tuple[int, list, Fraction]]:
    """(order, stage vector, value) of conditions up to order 4: weights times the vector is value.

    Row 0 of a Nystrom pair weighs positions, row 1 velocities. Vectors are sums over rooted
    trees (Hairer, Norsett, Wanner, II.2 and II.14), with the sums of the rows of a as nodes.
    """
    one = [Fraction(1)] * len(a)

    def applied(x):
        return [sum(w * xi for w, xi in zip(r, x, strict=True) if w) for r in a]

    def times(x, y):
        return [p * q for p, q in zip(x, y, strict=True)]

    g = applied(one)
    if position_only:
        trees = [(1, one, 1), (2, c, 2), (3, times(c, c), 3), (3, g, 6)]
        trees += [(4, times(c, times(c, c)), 4), (4, times(c, g), 8), (4, applied(c), 24)]
        if row == 0:  # one order later, weighted by the remainder of the step
            left = (2, 6, 12, 24)
            trees = [(n + 1, x, w) for (n, x, _), w in zip(trees[:4], left, strict=True)]
    else:
        gg, ag = times(g, g), applied(g)
        trees = [(1, one, 1), (2, g, 2), (3, gg, 3), (3, ag, 6), (4, times(g, gg), 4)]
        trees += [(4, times(g, ag), 8), (4, applied(gg), 12), (4, applied(ag), 24)]
    return [(n, x, Fraction(1, value)) for n, x, value in trees]


# ---- Explicit pairs: Runge-Kutta for any vector field, Nystrom for velocity-independent forces

#: Number of doubles in the longest vectors of processors.
_VECTOR = 8


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Pair(Method):
    """An embedded pair of explicit one-step methods.

    Attributes:
      name: its name in reports.
      order: order of the solution that is propagated.
      error_order: exponent p of the error estimate's h^p.
      c: (s,) nodes.
      a: (s, s) strictly lower triangular stage weights.
      weights: (2, w, s) rows of solution weights and of error weights; w = 1 for a
        Runge-Kutta pair, w = 2 (positions, velocities) for a Nystrom pair.
      position_only: whether the stages are accelerations of a second-order system.
      loops: number of successive loops over the stages; 0 where they are unrolled.
    """

    name: str
    order: int
    error_order: int
    c: np.ndarray
    a: np.ndarray
    weights: np.ndarray
    position_only: bool
    loops: int = 0
    evaluates: ClassVar[bool] = True

    @functools.cached_property
    def adaptive(self) -> bool:
        """Whether its table has error weights; without them the steps are equal."""
        return bool(self.weights[1].any())

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.c)

    @property
    def evaluations(self) -> int:
        """Right-hand sides per step."""
        return self.stages

    @functools.cached_property
    def lacking(self) -> np.ndarray:
        """(w, s) the correction of the rounded solution weights."""
        return weight_correction(
            self.c, self.a, self.weights[0], self.order, position_only=self.position_only
        )

    @functools.cached_property
    def stable(self) -> float:
        """The |h lambda| on the negative axis (Nystrom: the h omega) up to which it is stable."""
        return stability_limit(functools.partial(_growth, self))

    @functools.cached_property
    def twins(self) -> tuple[int, int] | None:
        """The last two stages at equal times: their difference estimates the fastest rate."""
        same = [(i, j) for j in range(self.stages) for i in range(j) if self.c[i] == self.c[j]]
        return same[-1] if same else None

    def in_loops(self, n: int) -> "Pair":
        """The same method with its stages in n loops, or as many as it has stages."""
        return in_loops(self, min(n, self.stages))

    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        sums = self._rolled_stages if self.loops else self._unrolled_stages
        one = runtime_one(h)

        def keep(x):
            # The loops over stages keep their arrays anyway.
            return x if self.loops else materialize(x, one)

        if not self.position_only:

            def slope(c, shift):
                return field(t + c * h, keep(y + h * shift))

            increment, error, rest, ratio = sums(slope, y)
            return Advance(
                increment=h * keep(increment), error=h * keep(error), rest=h * rest, speed=ratio
            )

        half = y.shape[0] // 2
        q, v = y[:half], y[half:]
        still = jnp.zeros_like(v)

        def acceleration(c, shift):
            x = keep(q + (c * h) * v + (h * h) * shift)
            # Accelerations do not depend on velocities, and XLA drops what computes dq/dt. In a
            # loop it would copy them at each stage.
            return field(t + c * h, jnp.concatenate([x, still]))[half:]

        *found, q_rest, v_rest, ratio = sums(acceleration, q)
        dq, dv, q_error, v_error = (keep(x) for x in found)
        increment = jnp.concatenate([h * v + (h * h) * dq, h * dv])
        error = jnp.concatenate([(h * h) * q_error, h * v_error])
        rest = jnp.concatenate([(h * h) * q_rest, h * v_rest])
        return Advance(increment=increment, error=error, rest=rest, speed=jnp.sqrt(ratio))

    @property
    def _rows(self) -> np.ndarray:
        """(3 w, s) weights of the solution, of the error, and of the correction."""
        return np.concatenate([*self.weights, self.lacking])

    def _unrolled_stages(self, slope: Callable, like: Array) -> list[Array]:
        def combine(row, k):
            terms = [jax.lax.mul(x, w) for w, x in zip(row, k, strict=False) if w != 0.0]
            return functools.reduce(jax.lax.add, terms) if terms else jnp.zeros_like(like)

        k, shifts = [], []
        for c, row in zip(self.c.tolist(), self.a.tolist(), strict=True):
            shifts.append(combine(row, k))
            k.append(slope(c, shifts[-1]))
        ratio = jnp.zeros(())
        if self.twins:
            i, j = self.twins
            ratio = fastest_rate(k[j] - k[i], shifts[j] - shifts[i], k[j])
        return [*(combine(row, k) for row in self._rows.tolist()), ratio]

    def _rolled_stages(self, slope: Callable, like: Array) -> list[Array]:
        c, done = jnp.asarray(self.c), []
        # Rows of one state are padded to whole vectors: XLA takes the rest of a row entry by entry,
        # each sum through memory (a third of the time of a stage of ten numbers).
        rest = -len(like) % _VECTOR if like.ndim == 1 else 0
        shape = len(like) + rest, *like.shape[1:]
        edges = [self.stages * n // self.loops for n in range(self.loops + 1)]
        spans = list(itertools.pairwise(edges))

        def weighted(rows):
            # Rows are taken one at a time: XLA turns a product with several rows into a custom
            # fusion, which would prevent fusion of the stepping loop.
            terms = [row[None] @ k.reshape(len(k), -1) for row, k in rows]
            return functools.reduce(jnp.add, terms).reshape(shape)[: len(like)]

        for begin, end in spans:
            tables = [jnp.asarray(self.a[:, i:j]) for i, j in spans[: len(done) + 1]]

            def stage(i, k, begin=begin, tables=tables, done=tuple(done)):
                shift = weighted([(a[i], part) for a, part in zip(tables, (*done, k), strict=True)])
                new = slope(c[i], shift)
                new = jnp.pad(new, (0, rest)) if rest else new
                return jax.lax.dynamic_update_index_in_dim(k, new, i - begin, 0)

            k = jnp.zeros((end - begin, *shape), like.dtype)
            done.append(jax.lax.fori_loop(begin, end, stage, k))

        def combined(row):
            return weighted([(row[i:j], k) for (i, j), k in zip(spans, done, strict=True)])

        ratio = jnp.zeros(())
        if self.twins:
            k_i, k_j = (_row(done, edges, n)[: len(like)] for n in self.twins)
            i, j = self.twins
            ratio = fastest_rate(k_j - k_i, combined(self.a[j] - self.a[i]), k_j)
        return [*(combined(row) for row in self._rows), ratio]


def _row(parts: list[Array], edges: list[int], i: int) -> Array:
    """Row i of concatenated arrays whose first rows are `edges`."""
    part = bisect.bisect_right(edges, i) - 1
    return parts[part][i - edges[part]]


def _growth(pair: Pair, z: float) -> float:
    """Growth factor of a step of length 1 for the solution of y' = -z y, or of q'' = -z^2 q."""
    eye, one = np.eye(pair.stages), np.ones(pair.stages)
    if not pair.position_only:
        return abs(1 - z * pair.weights[0, 0] @ np.linalg.solve(eye + z * pair.a, one))
    # k = -z^2 (q + c v + a k), for q = 1, v = 0 and for q = 0, v = 1.
    k = np.linalg.solve(eye + z * z * pair.a, -z * z * np.stack([one, pair.c], axis=1))
    return np.abs(np.linalg.eigvals([[1, 1], [0, 1]] + pair.weights[0] @ k)).max()


def _load(file: str, name: str, order: int, error_order: int) -> Pair:
    table = json.loads(resources.files("jaxdyn").joinpath("data").joinpath(file).read_text())
    position_only = "bp" in table
    rows = ("b", "bp", "b_err", "bp_err") if position_only else ("b", "b_err")
    s = len(table["c"])

    def numbers(strings: list[str]) -> list[float]:
        values = [float(Fraction(x)) for x in strings]
        return values + [0.0] * (s - len(values))

    a = np.array([numbers(row) for row in table["a"]])
    weights = np.array([numbers(table[row]) for row in rows]).reshape(2, -1, s)
    return Pair(
        name=name,
        order=order,
        error_order=error_order,
        c=np.array(numbers(table["c"])),
        a=a,
        weights=weights,
        position_only=position_only,
    )


#: Euler's method, explicit: one right-hand side per step, no error estimate.
EULER = Pair(
    name="Euler",
    order=1,
    error_order=1,
    c=np.zeros(1),
    a=np.zeros((1, 1)),
    weights=np.array([[[1.0]], [[0.0]]]),
    position_only=False,
)
#: The classic Runge-Kutta method of order 4 (Kutta 1901): four right-hand sides, no estimate.
RK4 = Pair(
    name="RK4",
    order=4,
    error_order=4,
    c=np.array([0.0, 0.5, 0.5, 1.0]),
    a=np.diag([0.5, 0.5, 1.0], -1),
    weights=np.array([[[1.0, 2.0, 2.0, 1.0]], [[0.0] * 4]]) / [[[6.0] * 4], [[1.0] * 4]],
    position_only=False,
)
#: Dormand, El-Mikkawy, Prince (1987), 17 stages, for accelerations that do not depend on v.
NYSTROM12 = _load("rkn12_10_17.json", "Nystrom 12(10)", order=12, error_order=11)
#: Verner (2010), the "robust" pair, 16 stages. At an error of 1e-12 it needs 0.8 of the
#: evaluations of Dormand and Prince's 8(7); all its weights are positive. Coefficients by
#: J. H. Verner, https://www.sfu.ca/~jverner/.
VERNER9 = _load("verner9_8.json", "Verner 9(8)", order=9, error_order=9)
