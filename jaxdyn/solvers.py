"""Explicit one-step pairs: Runge-Kutta for any vector field, Nystrom where forces forget v.

A `Pair` is a table of coefficients and one pure function, `Pair.step`, from the state at t to
the increment over h and an estimate of its error. Everything that integrates is built from
that function: `Stepper` lends it to diffrax; samples and event times between the steps take it
from the last node, so they are as accurate as the steps themselves.

Two forms of one step, equal but for rounding:

- unrolled: one expression a stage. Compiles to straight code, the fastest for one trajectory.
- rolled: a loop over stages with a buffer. Compiles several times faster and runs faster where
  each stage is wide, as for the variational equations with their many columns.

Coefficient tables are package data (``data/*.json``): decimal strings or fractions, rounded
once to float64.
"""

import dataclasses
import functools
import json
from collections.abc import Callable
from fractions import Fraction
from importlib import resources
from typing import ClassVar

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import materialised, runtime_one, two_sum

Field = Callable[[Array, Array], Array]


@dataclasses.dataclass(frozen=True, eq=False)
class Pair:
    """An embedded pair of explicit one-step methods.

    Compared and hashed by identity, so that it is a cheap static argument of jit.

    Attributes:
      name: what reports call it.
      order: order of the solution that is carried on.
      error_order: exponent p of the error estimate's h^p.
      c: (s,) nodes.
      a: (s, s) strictly lower triangular stage weights.
      weights: (2, w, s) rows of solution weights and of error weights; w = 1 for a
        Runge-Kutta pair, w = 2 (positions, velocities) for a Nystrom pair.
      nystrom: whether the stages are accelerations of a second-order system.
    """

    name: str
    order: int
    error_order: int
    c: np.ndarray
    a: np.ndarray
    weights: np.ndarray
    nystrom: bool

    @property
    def stages(self) -> int:
        """Right-hand sides a step."""
        return len(self.c)

    def step(self, field: Field, t: Array, h: Array, y: Array, rolled: bool) -> tuple:
        """Increment of y over [t, t + h] and the estimate of its error.

        Args:
          field: (t, y) -> dy/dt.
          t: () start.
          h: () step, of either sign.
          y: (k, ...) state; a Nystrom pair takes it as [q, v] along the first axis.
          rolled: loop over the stages instead of writing them out.
        """
        sums = self._rolled if rolled else self._unrolled
        one = runtime_one(h)

        def keep(x):
            # The loop over stages keeps its arrays by itself.
            return x if rolled else materialised(x, one)

        if not self.nystrom:

            def slope(c, shift):
                return field(t + c * h, keep(y + h * shift))

            increment, error = (keep(x) for x in sums(slope, y))
            return h * increment, h * error

        half = y.shape[0] // 2
        q, v = y[:half], y[half:]

        def acceleration(c, shift):
            x = keep(q + (c * h) * v + (h * h) * shift)
            # v takes no part in the acceleration; XLA drops what computes dq/dt.
            return field(t + c * h, jnp.concatenate([x, v]))[half:]

        dq, dv, q_error, v_error = (keep(x) for x in sums(acceleration, q))
        increment = jnp.concatenate([h * v + (h * h) * dq, h * dv])
        return increment, jnp.concatenate([(h * h) * q_error, h * v_error])

    def _unrolled(self, slope: Callable, like: Array) -> list[Array]:
        def combine(row, k):
            terms = [w * x for w, x in zip(row, k, strict=False) if w != 0.0]
            return functools.reduce(jnp.add, terms) if terms else jnp.zeros_like(like)

        k = []
        for c, row in zip(self.c.tolist(), self.a.tolist(), strict=True):
            k.append(slope(c, combine(row, k)))
        return [combine(row, k) for row in self.weights.reshape(-1, self.stages).tolist()]

    def _rolled(self, slope: Callable, like: Array) -> list[Array]:
        a, c = jnp.asarray(self.a), jnp.asarray(self.c)

        def weighted(row, k):
            # One row at a time: XLA turns a product with several rows into a custom fusion,
            # which would keep the whole stepping loop from being folded.
            return (row[None] @ k.reshape(self.stages, -1)).reshape(like.shape)

        def stage(i, k):
            shift = weighted(a[i], k)
            return jax.lax.dynamic_update_index_in_dim(k, slope(c[i], shift), i, 0)

        k = jnp.zeros((self.stages, *like.shape), like.dtype)
        k = jax.lax.fori_loop(0, self.stages, stage, k)
        return [weighted(row, k) for row in self.weights.reshape(-1, self.stages)]


def from_diffrax(solver: diffrax.AbstractERK) -> Pair:
    """The pair of any explicit Runge-Kutta solver of diffrax, e.g. ``diffrax.Tsit5()``."""
    table = solver.tableau
    s = len(table.b_sol)
    a = np.zeros((s, s))
    for i, row in enumerate(table.a_lower):
        a[i + 1, : len(row)] = row
    weights = np.stack([table.b_sol, table.b_error])[:, None, :]
    order = solver.order(None)
    assert order is not None
    c = np.concatenate([[0.0], table.c])
    return Pair(type(solver).__name__, order, order, c, a, weights, nystrom=False)


def _load(file: str, name: str, order: int, error_order: int) -> Pair:
    table = json.loads(resources.files("jaxdyn").joinpath("data").joinpath(file).read_text())
    nystrom = "bp" in table
    rows = ("b", "bp", "b_err", "bp_err") if nystrom else ("b", "b_err")
    s = len(table["c"])

    def numbers(strings: list[str]) -> list[float]:
        values = [float(Fraction(x)) for x in strings]
        return values + [0.0] * (s - len(values))

    a = np.array([numbers(row) for row in table["a"]])
    weights = np.array([numbers(table[row]) for row in rows]).reshape(2, -1, s)
    return Pair(name, order, error_order, np.array(numbers(table["c"])), a, weights, nystrom)


#: Dormand, El-Mikkawy, Prince (1987), 17 stages, for accelerations that do not depend on v.
NYSTROM12 = _load("rkn12_10_17.json", "Nystrom 12(10)", order=12, error_order=11)
#: Verner (2010), the "robust" pair, 16 stages. At an error of 1e-12 it needs 0.8 of the
#: evaluations of Dormand and Prince's 8(7); all its weights are positive. Coefficients by
#: J. H. Verner, https://www.sfu.ca/~jverner/.
VERNER9 = _load("verner9_8.json", "Verner 9(8)", order=9, error_order=9)
#: Prince and Dormand (1981), 13 stages, as diffrax has it: the second opinion on the other two.
DOPRI8 = from_diffrax(diffrax.Dopri8())


class Stepper(diffrax.AbstractAdaptiveSolver):
    """A pair as a diffrax solver, with compensated summation and projection of the steps.

    The solver's state is what rounding left out of the last sum; it is added to the next
    increment, so the rounding error of N steps grows like one step's, not like sqrt(N) to N.
    After each step the field projects the state onto its constraints (most have none).
    """

    pair: Pair
    rolled: bool
    term_structure: ClassVar = diffrax.ODETerm
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation  # never used: see simulate.py

    def order(self, terms):
        del terms
        return self.pair.order

    def error_order(self, terms):
        del terms
        return self.pair.error_order

    def init(self, terms, t0, t1, y0, args):
        del terms, t0, t1, args
        return jnp.zeros_like(y0)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del made_jump
        # Backwards in time diffrax counts t upwards and turns the control about: h < 0.
        h = terms.contr(t0, t1)
        sign = jnp.where(h < 0, -1.0, 1.0)

        @jax.jit  # traced once for all stages: half of the time until a first result
        def field(t, y):
            return terms.vf(sign * t, y, args)

        increment, error = self.pair.step(field, sign * t0, h, y0, self.rolled)
        y1, carry = two_sum(y0, solver_state, increment)
        y1 = args.project(sign * t1, y1)
        return y1, error, {"y0": y0, "y1": y1}, carry, diffrax.RESULTS.successful

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)
