"""Numerical techniques, each with its name and its reason.

All of these are safe inside a stepping loop (no LAPACK, no sort, no scatter) and have finite
derivatives where the plain formula gives NaN.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn._programs import size

#: Entries of a state up to which loops over steps write out what is summed or compared over them: a
#: reduction would keep XLA from fusing the loop.
UNROLLED_ENTRIES = 32

#: Prefix of the names that functions decorated by `smooth` have in programs.
_SMOOTH = "smooth_"
#: Functions of JAX whose conditions only choose the formula with the least rounding.
_SMOOTH_OF_JAX = frozenset({"hypot", "sinc", "softplus", "log_softmax"})


def smooth(function: Callable) -> Callable:
    """Decorate a function whose conditions do not require a step of an integration to end.

    Such conditions choose between two formulas of one smooth function, or decide a rank. They are
    evaluated as they are; otherwise `jaxdyn.plan` would read them as switches of the rate.
    """

    @functools.wraps(function)
    def named(*args):
        return function(*args)

    named.__name__ = f"{_SMOOTH}{function.__name__}"
    return functools.wraps(function)(jax.jit(named))


def is_smooth(name: str) -> bool:
    """Whether a function of this name in a program is one of `smooth`, or such a one of JAX."""
    return name.startswith(_SMOOTH) or name in _SMOOTH_OF_JAX


def nan_unless(known: Array, x: Array) -> Array:
    """x where it is known, and NaN elsewhere, with derivatives of NaN.

    Those of ``jnp.where(known, x, jnp.nan)`` would be 0: a finite wrong number. Derivatives in what
    x does not depend on remain 0.

    Args:
      known: () or in the shape of x.
      x: the numbers.
    """
    return x * jnp.where(known, 1.0, jnp.nan)


def value_and_jacfwd(fn: Callable, argnums: int | tuple[int, ...] = 0) -> Callable:
    """The function that returns the value of another one and, from the same run, its `jax.jacfwd`.

    It is to `jax.jacfwd` what `jax.value_and_grad` is to `jax.grad`.
    """

    def twice(*args):
        value = fn(*args)
        return value, value

    def both(*args):
        slope, value = jax.jacfwd(twice, argnums, has_aux=True)(*args)
        return value, slope

    return both


def taylor_coefficients(function: Callable[[Array], Array], order: int) -> Array:
    """(order + 1, ...) the coefficients of a function of one number in its powers."""

    def terms(e: Array, n: int) -> list[Array]:
        if not n:
            return [function(e)]
        known, slopes = jax.jvp(lambda e: terms(e, n - 1), (e,), (jnp.ones(()),))
        return [*known, slopes[-1] / n]

    return jnp.stack(terms(jnp.zeros(()), order))


@jax.custom_jvp
def first_only(x: Array) -> Array:
    """x, whose second and higher derivatives are NaN.

    It is for formulas of which only the first derivative is right: further ones would be finite
    wrong numbers.
    """
    return x


@first_only.defjvp
def _(primals, tangents):
    (x,), (dx,) = primals, tangents
    return x, dx * _one(x)


@jax.custom_jvp
def _one(x: Array) -> Array:
    return jnp.ones_like(x)


@_one.defjvp
def _(primals, tangents):
    (x,), (dx,) = primals, tangents
    return jnp.ones_like(x), jnp.nan * dx


def zero_of(tree: Any) -> Array:
    """() 0 as a function of all finite numbers of a tree.

    Added to an x that does not depend on them, it gives `nan_unless` derivatives of NaN in them.
    """
    found = jax.tree.leaves(eqx.filter(tree, eqx.is_inexact_array))
    finite = [jnp.where(jnp.isfinite(x), x, 0.0) for x in found]
    return sum((jnp.sum(0.0 * x) for x in finite), jnp.zeros(()))


def safe_sqrt(x: Array) -> Array:
    """Square root with derivative 0, not infinity, at 0.

    The double ``where``: the argument is replaced before the root is taken, since a NaN or
    infinity in the branch not taken still poisons reverse mode (0 * inf = NaN). Only 0 itself
    is replaced: a negative or NaN argument stays visible as NaN.
    """
    zero = x == 0
    return jnp.where(zero, 0.0, jnp.sqrt(jnp.where(zero, 1.0, x)))


def square_norm(x: Float[Array, "*b d"]) -> Float[Array, "*b"]:
    """Sum of squares over the last axis, unrolled: a `dot` call costs more than 2-3 products."""
    total = x[..., 0] * x[..., 0]
    for i in range(1, x.shape[-1]):
        total = total + x[..., i] * x[..., i]
    return total


def safe_norm(x: Float[Array, "*b d"]) -> Float[Array, "*b"]:
    """Euclidean length over the last axis with gradient 0, not NaN, at the origin."""
    return safe_sqrt(square_norm(x))


# Below these arguments a smooth function is evaluated as its series, whose next term is below 1e-17
# there: at 0 its formula contains the root of 0, and has a derivative that cancels.
_SINC_SERIES_BELOW = 0.25
_ATANC_SERIES_BELOW = 0.01
_COS = tuple((-1) ** k / math.factorial(2 * k) for k in range(8))
_SINC = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(8))
_ATANC = tuple((-1) ** k / (2 * k + 1) for k in range(8))


def _series(x: Array, coefficients: tuple[float, ...]) -> Array:
    total = jnp.full_like(x, coefficients[-1])
    for c in coefficients[-2::-1]:
        total = total * x + c
    return total


@smooth
def cos_of_root(x: Array) -> Array:
    """The cosine cos(sqrt(x)) as a function of x >= 0; smooth at 0."""
    small = x < _SINC_SERIES_BELOW
    root = jnp.sqrt(jnp.where(small, 1.0, x))
    return jnp.where(small, _series(jnp.where(small, x, 0.0), _COS), jnp.cos(root))


@smooth
def sinc_of_root(x: Array) -> Array:
    """The ratio sin(sqrt(x)) / sqrt(x) as a function of x >= 0; 1 and smooth at 0."""
    small = x < _SINC_SERIES_BELOW
    root = jnp.sqrt(jnp.where(small, 1.0, x))
    return jnp.where(small, _series(jnp.where(small, x, 0.0), _SINC), jnp.sin(root) / root)


@smooth
def atanc(ss: Array, w: Array) -> Array:
    """The ratio atan2(s, w) / s as a function of ss = s^2 and w >= 0; 1/w and smooth at s = 0."""
    small = ss < _ATANC_SERIES_BELOW * w * w
    s = jnp.sqrt(jnp.where(small, 1.0, ss))
    safe_w = jnp.where(small, w, 1.0)
    ratio = jnp.where(small, ss, 0.0) / (safe_w * safe_w)
    return jnp.where(small, _series(ratio, _ATANC) / safe_w, jnp.arctan2(s, w) / s)


def two_sum(total: Array, carry: Array, increment: Array) -> tuple[Array, Array]:
    """One compensated addition: the new total and its rounding error.

    There are two sums, each with its error: Knuth's, of increment and carry, which may be of any
    size, and Kahan's, of the total, right when ``|increment| <= |total|``, as for an integrator's
    step. Without the first the carry would have no finer digits than the increment, and smaller
    contributions would be lost at every step. XLA on CPU keeps the order of these operations (there
    is no product that could be contracted), which a test verifies.
    """
    together = increment + carry
    back = together - increment
    lost = (increment - (together - back)) + (carry - back)
    new = total + together
    return new, (together - (new - total)) + lost


def runtime_one(runtime: Array) -> Array:
    """The number 1 as a runtime value unknown to the compiler; see `materialize`.

    Args:
      runtime: () any finite number known only at run time.
    """
    return runtime * 0.0 + 1.0


def materialize(x: Array, one: Array) -> Array:
    """x itself, as an array that XLA computes once instead of once for each of its uses.

    XLA on CPU copies cheap producers into every consumer: in unrolled Runge-Kutta stages the
    whole weighted sum of slopes is recomputed for each entry that the force reads, which costs a
    third of the run time. A division counts as expensive and is not copied; by a number that is 1
    only at run time it cannot be simplified away either, and dividing by 1 is exact.
    ``optimization_barrier`` would be clearer, but is removed before fusion.

    Args:
      x: the array to keep.
      one: () a `runtime_one`. Use the same one everywhere in a program: with one for each use
        the gain is lost (measured).
    """
    return x / one


#: Number of operations of a program beyond which it is left in many functions. XLA's compile time
#: for a single one grows faster than its length (CPU, JAX 0.10; a search for events and its run):
#:
#:   operations   compile in one, as it is   run in one, as it is
#:     11,100          7.6 s,  7.2 s           .38 ms,  .52 ms   (top)
#:     14,500         13.3 s, 11.6 s         14.0 ms,  7.9 ms    (four-bar linkage)
#:     23,600         23.1 s, 13.9 s          6.1 ms,  6.5 ms    (rolling disk)
#:     21,800          120 s, 23.5 s                           (three events of a cylinder)
#:
#: No integration without events has as many.
_LARGEST_KERNEL = 12_000


def in_one_kernel(fn: Callable, args: tuple, unknown: Array) -> Any:
    """fn(*args), compiled so that XLA on CPU runs all of it as one function, unless it is large.

    Every operation outside a folded loop is launched separately, from a pool of threads once
    there are more than a few; a short solve spends most of its time there (measured: 60 us for
    one step of the three-body problem against 12 us this way). So the whole calculation becomes
    the body of a loop that runs once, which XLA folds like any small loop. XLA must not be able to
    deduce that it runs once: the limit of the count, 1 or 1/2, both of which end it after one
    round, is known only at run time. The arguments depend on the round, since zero times its number
    is added to them; otherwise loop-invariant code would be moved out.

    Args:
      fn: a pure function of arrays, with array results; never differentiated.
      args: its arguments.
      unknown: () a boolean known only at run time; the result does not depend on it.
    """
    fn = jax.jit(fn)  # traced once, for the shapes and for the loop
    numbers, rest = eqx.partition(args, eqx.is_inexact_array)
    # This also removes the weak type of Python numbers, which would not survive the first sum.
    numbers = jax.tree.map(lambda x: jax.lax.convert_element_type(x, x.dtype), numbers)
    given = eqx.combine(numbers, rest)
    program, shapes = jax.make_jaxpr(fn, return_shape=True)(*given)
    if size(program.jaxpr) > _LARGEST_KERNEL:
        return fn(*given)
    empty = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)

    def body(carry):
        round_, _ = carry
        zero = 0.0 * round_
        now = eqx.combine(jax.tree.map(lambda x: x + zero, numbers), rest)
        return round_ + 1.0, fn(*now)

    limit = jnp.where(unknown, 1.0, 0.5)
    return jax.lax.while_loop(lambda carry: carry[0] < limit, body, (jnp.zeros(()), empty))[1]


@jax.custom_batching.custom_vmap
def any_lane(condition: Array) -> Array:
    """Whether () a condition holds here or, under `jax.vmap`, in any of the lanes.

    A `lax.cond` on it stays one under `vmap`; on the condition itself, both of its branches would
    be evaluated in every step. The branches have to allow for lanes in which it does not hold.
    """
    return condition


@any_lane.def_vmap
def _(axis_size, in_batched, condition):
    del axis_size, in_batched
    return any_lane(jnp.any(condition)), False


_MEAN = 0.043  # mean excess of the binary logarithm over what the bits say, which is 0 to 0.086
_BEND = 0.6565  # 2^f is 1 + f (0.6565 + 0.3435 f) within 0.2 % for f from 0 to 1


def rough_power(x: Array, n: float) -> Array:
    """x^n for x >= 0 to 1 % for |n| <= 1/5, 2 % for 1/2; finite for |n| <= 1/2 and every x.

    It is computed from the bits of a float, which are nearly its logarithm. XLA on CPU computes
    powers, roots and divisions in functions of their own, together with all that they depend on; so
    a function with such a number as an intermediate result would be split, and most of it computed
    twice.
    """
    kind = jnp.finfo(x.dtype)
    mantissa, bias, whole_number = kind.nmant, kind.maxexp - 1, jnp.dtype(f"int{kind.bits}")
    bits = jax.lax.bitcast_convert_type(x, whole_number).astype(x.dtype)
    logarithm = n * (bits * 2.0**-mantissa - (bias - _MEAN))
    whole = jnp.floor(logarithm)
    f = logarithm - whole
    exponent = whole.astype(whole_number) + bias
    exponent = jax.lax.shift_left(exponent, jnp.full_like(exponent, mantissa))
    scale = jax.lax.bitcast_convert_type(exponent, x.dtype)
    return scale * (1.0 + f * (_BEND + (1.0 - _BEND) * f))


#: Rows of a matrix up to which elimination is unrolled.
_UNROLLED_ROWS = 3


def solve_spd(a: Array, b: Array) -> Array:
    """The x with a x = b for a symmetric positive definite a, without LAPACK.

    Gauss-Jordan elimination, stable without pivoting for such matrices, one whole-array update
    for each unknown: a call of LAPACK would prevent folding of a stepping loop, and costs
    ten times as much at the size of a mechanism (n up to about 20).

    Args:
      a: (n, n) symmetric positive definite.
      b: (n,) or (n, m) right-hand sides.
    Limits: a singular matrix gives NaN or infinity, never an exception.
    """
    n = a.shape[0]
    columns = b.reshape(n, -1)
    x = jnp.concatenate([a, columns], axis=1)

    def eliminate(k, x):
        row = _slice(x, k)
        row = row / _slice(row, k)
        return _clear_column(x, k, row, jnp.arange(n) == k)

    return _repeat(n, eliminate, x)[:, n:].reshape(b.shape)


class Reduced(NamedTuple):
    """The result of elimination of a x = b for a symmetric positive semidefinite a (n, n).

    Attributes:
      x: b's shape; a solution that is 0 for the unknowns of dependent rows.
      kept: (n,) bool, False for rows that depend on those before them.
      combination: (n, n); row k of a is the sum over kept j of combination[j, k] times row j.
    """

    x: Array
    kept: Array
    combination: Array


@smooth
def solve_psd(a: Array, b: Array, least: Array) -> Reduced:
    """A solution of a x = b where rows of a may depend on each other, without LAPACK.

    This is `solve_spd`, except that a row whose pivot falls to `least` or below is left out. For
    a = G W G^T, the pivot divided by the diagonal entry is the squared sine of the angle between a
    row of G and the span of those before it; and G^T x is the same for all solutions.

    Args:
      a: (n, n) symmetric positive semidefinite.
      b: (n,) or (n, m) right-hand sides, in the range of a; any other component is ignored.
      least: (n,) pivots at or below which a row counts as dependent.
    """
    n = a.shape[0]
    columns = b.reshape(n, -1)
    x = jnp.concatenate([a, columns], axis=1)

    def eliminate(k, carry):
        x, kept = carry
        row = _slice(x, k)
        pivot = _slice(row, k)
        # A NaN is kept, to stay visible.
        keep = ~(pivot <= _slice(least, k))
        row = jnp.where(keep, row / jnp.where(keep, pivot, 1.0), 0.0)
        here = jnp.arange(n) == k
        return _clear_column(x, k, row, here), jnp.where(here, keep, kept)

    x, kept = _repeat(n, eliminate, (x, jnp.ones(n, bool)))
    solved, combination = (jnp.where(kept[:, None], part, 0.0) for part in (x[:, n:], x[:, :n]))
    return Reduced(solved.reshape(b.shape), kept, combination)


@smooth
def has_positive_minors(a: Array) -> Array:
    """Whether () all leading principal minors of a (n, n) are positive, without LAPACK."""
    n = a.shape[0]

    def eliminate(k, carry):
        x, positive = carry
        row = _slice(x, k)
        pivot = _slice(row, k)
        row = row / jnp.where(pivot > 0, pivot, 1.0)
        return _clear_column(x, k, row, jnp.arange(n) == k), positive & (pivot > 0)

    return _repeat(n, eliminate, (a, jnp.ones((), bool)))[1]


def _clear_column(x: Array, k: Array | int, row: Array, here: Array) -> Array:
    """x with the normalised row as its row k, and column k eliminated from all others.

    Subtracting (pivot - 1) rows from row k itself would lose digits for a large pivot.
    """
    return jnp.where(here[:, None], row[None, :], x - _slice(x, k, axis=1)[:, None] * row[None, :])


def _repeat(n: int, body: Callable, start: Any) -> Any:
    """body(k, carry) for k from 0 to n - 1: unrolled where short, else a loop.

    Unrolled, the program for the hinges of nine bars takes four times as long to compile.
    """
    if n > _UNROLLED_ROWS:
        return jax.lax.fori_loop(0, n, body, start)
    return functools.reduce(lambda carry, k: body(k, carry), range(n), start)


def _slice(x: Array, k: Array | int, axis: int = 0) -> Array:
    return jax.lax.dynamic_index_in_dim(x, k, axis, keepdims=False)
