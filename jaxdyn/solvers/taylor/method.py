"""Taylor series of the solution: explicit, of any order, for scenes with short formulas.

A step sums the series of the solution about its start, whose coefficients follow from the
formulas of the rate (`formulas`, `recurrences`). For a handful of numbers and many digits that
takes a quarter to a half of the time of a Runge-Kutta pair: the cost of an order is proportional
to the order, and nothing is evaluated inside the step. At its end the error is multiplied by the
Jacobian, once, to detect stiffness.

By operations alone the optimal order is about 1 - ln(rtol) / 2: 8 at rtol 1e-6, 16 at 1e-13. Where
an order has few products, what each step costs besides makes higher ones the fastest; where it has
many, lower ones. Formulas with more than 48 products compile too long, and are refused, as are
operations without a recurrence: loops of unknown length, hence most linear algebra.
"""

import dataclasses
import functools
import math
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import in_one_kernel
from jaxdyn.solvers.method import (
    Advance,
    Method,
    Rate,
    grows_from,
    operations,
    traced_once,
)
from jaxdyn.solvers.pairs import VERNER9
from jaxdyn.solvers.taylor.formulas import Formulas, NotElementary, formulas
from jaxdyn.solvers.taylor.graph import Node
from jaxdyn.solvers.taylor.ordered import ordered
from jaxdyn.solvers.taylor.recurrences import Coefficient, is_guarded, products, solution

#: Sums of products at each order; with more of them programs compile for ten seconds and longer,
#: exceed the processor's instruction cache, and run no faster than a pair.
_MOST_PRODUCTS = 48
#: Entries of a state; with more of them a step takes ten times as long, see `_in_one_array`.
_MOST_NUMBERS = 15
_SINGULAR = ("div", "sqrt", "pow", "log")  # at some values of their arguments
_LOWEST, _HIGHEST = 4, 40  # orders
#: The estimate in parts of the last term. The error is about the next term, a few times smaller;
#: but errors of a whole motion at the same tolerance were then 1.7 times those of `VERNER9` in the
#: median of 15 problems and 12 times in one of ten, and who asks for a tolerance by habit would
#: lose digits. So they are no larger in nine of ten. At equal errors it costs nothing.
_CAUTION = 10.0
#: The same of the difference of slopes at the end of a step, which also shows jumps within it, in
#: parts of that: it is the next term already, times the order.
_DEFECT_WEIGHT = 2.0
#: The part of it below so many roundings of the slope may be rounding, and counts less; but not
#: nothing, or steps would grow until they are rejected.
_ROUNDINGS, _ROUNDING_WEIGHT = 8.0, 0.25
#: Weight of the last term but one, in case the last one vanishes by symmetry. Successive terms
#: decrease by about this factor at the steps that tolerances lead to.
_LAST_BUT_ONE_WEIGHT = 0.1
#: Weight of each earlier term, in case both vanish: less than the factor between terms, or these
#: would limit the steps of motions without such a symmetry (0.05 does, at rtol 1e-14).
_TERM_RATIO = 0.03
_TINY = np.finfo(float).tiny
_LARGE_TERMS = 4  # terms that are large beside the later ones
_REMEDY = "Leave the solver out, or use solvers.VERNER9, which needs no formulas."


@dataclasses.dataclass(frozen=True, eq=False)
class Taylor(Method):
    """The Taylor series of the solution up to some order.

    Limits: elementary functions of a state of one axis, without loops of unknown length, hence
      without most linear algebra, and without conditions such as absolute values and friction
      that reverses; at most 48 products of moving numbers. With more than 15 numbers it is
      slow.

    Attributes:
      order: number of terms besides the start, 4 to 40.
      tangents: the method of variational equations, of events and of ensembles; one for
        velocity-independent forces makes the series one for such scenes as well.
    """

    order: int
    tangents: Method = VERNER9
    adaptive: ClassVar[bool] = True
    #: Where stability limits steps they are between a half and 1.4 of the limit in turn, since
    #: errors outside of it grow by a high power; by accuracy they are at most half of it.
    alarm: ClassVar[float] = 0.6

    def __post_init__(self):
        _checks.whole("order", self.order, _LOWEST, _HIGHEST, "It is that of the Taylor series.")

    @property
    def name(self) -> str:
        """Its name in reports."""
        return f"Taylor {self.order}"

    @property
    def error_order(self) -> int:
        """The last term is the estimate of the error."""
        return self.order

    @functools.cached_property
    def stable(self) -> float:
        """The |h lambda| on the negative axis up to which it is stable."""

        def growth(z: float) -> float:
            return abs(sum((-z) ** k / math.factorial(k) for k in range(self.order + 1)))

        return grows_from(growth)

    @property
    def position_only(self) -> bool:
        """Only where its method for tangents is."""
        return self.tangents.position_only

    @property
    def for_tangents(self) -> Method:
        """A pair: each column of tangents would need as many formulas again."""
        return self.tangents

    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        guarded = is_guarded(_formulas(field, t, y)[1])

        def step(t, h, y):
            series = solution(*_formulas(field, t, y), self.order, h)
            second = _slope if guarded else _cautious
            return _in_one_array([(_increment(c, h), second(c, h)) for c in series], h)

        # Isolated: XLA would duplicate the step for each other use of the result.
        both = in_one_kernel(step, (t, h, y), unknown=jnp.isfinite(h))
        increment, found = both.real, both.imag
        if guarded:
            # At a start from rest the series is that of the guard's other case, and wrong.
            found = _weighted(h * field(t + h, y + increment), found)
        return Advance(increment, found, speed=_speed(field, t + h, h, y + increment, found))


def has_series(system, y: Array) -> bool:
    """Whether a rate's formulas are short and elementary enough for `Taylor`; host only.

    Args:
      system: has ``rate(t, y)``; a pytree of its numbers, e.g. a scene. Formulas are those of a
        compiled solve, where these numbers are not known.
      y: (k,) a state.
    """
    found = series_of(system, y)
    return found is not None and found.products <= _MOST_PRODUCTS


class Series(NamedTuple):
    """What the Taylor series of a solution costs, and where there is one.

    Attributes:
      products: at each order.
      everywhere: whether there is one at each state at which the rate is finite; a root has none
        at 0.
      entire: whether the rate has no quotient, root, logarithm or power that may be singular.
    """

    products: int
    everywhere: bool
    entire: bool


def series_of(system, y: Array, longest: int | None = None) -> Series | None:
    """The series of a rate, found once for systems of a kind, whatever their numbers.

    Args:
      system: see `has_series`.
      y: (k,) a state.
      longest: operations of a rate above which it is not looked at: the formulas of a thousand
        take a tenth of a second to find.
    Returns:
      What it costs; None for more numbers than `Taylor` is made for, for a rate of too many
      operations, and for one without a series.
    """
    k = len(y)
    return None if k > _MOST_NUMBERS else _series_of(system, k, longest)


def _series(rate: Rate, t: Array, y: Array, longest: int | None) -> Series | None:
    if longest is not None and operations(rate, t, y) > longest:
        return None
    try:
        found = formulas(rate, t, y)
    except NotElementary:
        return None
    nodes = ordered(found.graph, found.rates)
    entire = not any(node.moving and node.op in _SINGULAR for node in nodes)
    return Series(products(nodes), not any(map(_ends, nodes)), entire)


_series_of = traced_once(_series)


def _ends(node: Node) -> bool:
    """Whether a formula is finite where its derivatives are not: a root that nothing guards at 0.

    Negative powers are infinite there, as is the rate.
    """
    base, *exponent = node.args if node.op in ("sqrt", "pow") else (None,)
    if not isinstance(base, Node) or not base.moving or base.op == "select":
        return False
    return not exponent or isinstance(exponent[0], Node) or exponent[0] > 0


def _formulas(field: Rate, t: Array, y: Array) -> tuple[Formulas, list[Node]]:
    wanted = "a scene with short formulas"
    if y.ndim > 1:
        several = "one that takes tangents or several motions at once"
        raise _checks.fail("solver", several, "a Taylor series", _REMEDY)
    try:
        found = formulas(field, t, y)
    except NotElementary as error:
        raise _checks.fail("solver", wanted, f"one with {error}", _REMEDY) from None
    nodes = ordered(found.graph, found.rates)
    if (n := products(nodes)) > _MOST_PRODUCTS:
        raise _checks.fail("solver", wanted, f"one with {n} products", _REMEDY)
    return found, nodes


def _increment(c: list[Coefficient], h: Array) -> Array:
    """The sum of all terms: first the small ones as they become known, then the large ones."""
    terms = [x for x in (*c[_LARGE_TERMS + 1 :], *c[_LARGE_TERMS:0:-1]) if x is not None]
    return functools.reduce(jnp.add, terms, jnp.zeros_like(h))


def _slope(c: list[Coefficient], h: Array) -> Array:
    """The slope at the end of the step, times the step."""
    terms = [np.float64(k) * x for k, x in enumerate(c) if k and x is not None]
    return functools.reduce(jnp.add, reversed(terms), jnp.zeros_like(h))


def _cautious(c: list[Coefficient], h: Array) -> Array:
    return _CAUTION * _last(c, h)


def _weighted(slope: Array, expected: Array) -> Array:
    """The error from the difference of slopes, both times the step, with its signs."""
    apart, rounding = slope - expected, _ROUNDINGS * jnp.finfo(slope.dtype).eps * jnp.abs(slope)
    small = jnp.clip(apart, -rounding, rounding)
    return _DEFECT_WEIGHT * (apart - small) + _ROUNDING_WEIGHT * small


def _last(c: list[Coefficient], h: Array) -> Array:
    """Size of the last two terms, extrapolated from earlier ones where symmetry hides them.

    With the sign of the last one, so that the errors of all entries are a direction.

    Terms of the second half count, since x'' = -x^7 from x = 0 has every eighth one only.
    """
    order = len(c) - 1
    found = jnp.zeros_like(h)
    for k in range(order // 2 + 1, order + 1):
        before = order - 1 - k
        weight = 1.0 if before < 0 else _LAST_BUT_ONE_WEIGHT * _TERM_RATIO**before
        if c[k] is not None:
            term = weight * jnp.abs(c[k])
            found = _larger(found, term) if before > 0 else found + term
    last = c[order]
    return found if last is None else jnp.where(last < 0, -found, found)


def _speed(field: Rate, t: Array, h: Array, y: Array, error: Array) -> Array:
    """() |h J error| / |error|: where stability limits steps, errors are along the fastest part."""
    _, slope = jax.jvp(lambda y: field(t, y), (y,), (error,))
    return jnp.abs(h) * jnp.max(jnp.abs(slope)) / (jnp.max(jnp.abs(error)) + _TINY)


def _larger(a: Array, b: Array) -> Array:
    return jnp.where(a > b, a, b)


def _in_one_array(pairs: list[tuple[Array, Array]], h: Array) -> Array:
    """All results in one array, so that XLA compiles the whole step to one function.

    A number that is used more than once is recomputed for each result that it enters, thousands
    of times for the first coefficients; not so within the function of a single array. There a
    number may enter up to 15 entries, so entries are complex numbers, with two results each
    (measured for three bodies: 0.5 us a step, against 11 us with 24 real entries).
    """
    places = jnp.arange(len(pairs))
    # A zero that XLA does not see, but LLVM does: what is compared with it stays within the
    # function, where the loop over entries is unrolled (else a third of a step's time).
    zero = lax.shift_right_logical(lax.bitcast_convert_type(h, int) & 1, 1)
    found = jnp.zeros(len(pairs), complex)
    for i, (first, second) in enumerate(pairs):
        found = jnp.where(places == i + zero, lax.complex(first, second), found)
    return found


#: For errors of 1e-6 and above; for many, more and few products an order (the default); 16 between.
TAYLOR8, TAYLOR12, TAYLOR14, TAYLOR16, TAYLOR20 = (Taylor(n) for n in (8, 12, 14, 16, 20))
