"""Taylor series of the solution: explicit, of any order, for scenes with short formulas.

A step sums the series of the solution about its start, whose coefficients follow from the
formulas of the rate (`formulas`, `terms`). For a handful of numbers and many digits that takes a
fifth to three quarters of the time of a Runge-Kutta pair: the cost of an order is proportional to
the order, and nothing is evaluated inside the step. How much of a proposed step is taken is read
off its terms (`terms`), so that hardly any step is rejected. At its end the error is multiplied by
the Jacobian, once, to detect stiffness.

By operations alone the optimal order is about 1 - ln(rtol) / 2: 8 at rtol 1e-6, 16 at 1e-13. Where
an order has few products, the other costs of a step make higher orders the fastest; where it has
many, lower ones are. Formulas with more than 48 products compile too long and are refused, as are
operations without a recurrence: loops of unknown length, and hence most linear algebra.
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
from jaxdyn.solvers.formulas.formulas import Formulas, is_guarded, products, shortest
from jaxdyn.solvers.formulas.graph import FUNCTIONS, Node, NotElementary
from jaxdyn.solvers.method import (
    Advance,
    Method,
    Rate,
    operations,
    stability_limit,
    trace_once,
)
from jaxdyn.solvers.pairs import VERNER9
from jaxdyn.solvers.taylor import terms
from jaxdyn.solvers.taylor.terms import solution

#: Most sums of products at each order; with more of them programs compile for ten seconds and
#: longer, exceed the processor's instruction cache, and run no faster than a pair.
_MOST_PRODUCTS = 48
#: Most entries of a state; with more of them a step takes ten times as long, see `_in_one_array`.
_MOST_NUMBERS = 15
_FUNCTIONS = frozenset(FUNCTIONS) - {"sqrt"}
_OF_POLYNOMIALS = frozenset({"sum", "scale", "product"})
_LOWEST, _HIGHEST = 4, 40  # orders
#: Largest difference of slopes at the end of a step, in tolerances, where a function may be hidden
#: in it: the terms do not show it there. The difference is itself no estimate of the error.
_MOST_DEFECT = 30.0
_TINY = np.finfo(float).tiny
_REMEDY = "Leave the solver out, or use solvers.VERNER9, which needs no formulas."


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Taylor(Method):
    """The Taylor series of the solution up to some order.

    Limits: elementary functions of a state of one axis, without loops of unknown length, hence
      without most linear algebra, and without conditions such as absolute values and friction
      that reverses; at most 48 products of moving numbers. With more than 15 numbers it is
      slow.

    Attributes:
      order: number of terms besides the start, 4 to 40.
      tangents: the method for variational equations, events and ensembles; if it requires
        velocity-independent forces, so does the series.
    """

    order: int
    tangents: Method = VERNER9
    adaptive: ClassVar[bool] = True
    #: Where stability limits steps, they are as long as the limit, since errors beyond it grow by a
    #: high power (0.99 of it in the mean for orders 8, 14 and 20); by accuracy, at most half of it.
    alarm: ClassVar[float] = 0.6

    def __post_init__(self):
        _checks.whole("order", self.order, _LOWEST, _HIGHEST, "It is that of the Taylor series.")

    @property
    def name(self) -> str:
        """The name in reports."""
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

        return stability_limit(growth)

    @property
    def position_only(self) -> bool:
        """Whether its method for tangents is for velocity-independent forces only."""
        return self.tangents.position_only

    @property
    def for_tangents(self) -> Method:
        """A pair, since each column of tangents would need as many formulas again."""
        return self.tangents

    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        return self.advance_within(field, t, h, y, None)

    def advance_within(
        self, field: Rate, t: Array, h: Array, y: Array, tolerance: tuple[Array, Array] | None
    ) -> Advance:
        nodes = _formulas(field, t, y)[1]
        guarded = is_guarded(nodes)
        checked = not guarded and tolerance is not None and any(map(_may_hide, nodes))
        given = t, h, y
        if tolerance is not None:
            # The divisions are here for the reason given at `rough_power`.
            rtol, atol = tolerance
            given = *given, 1.0 / h, jnp.unstack(1.0 / (atol + rtol * jnp.abs(y)))
        estimate = terms.error if tolerance is None else terms.last

        def step(t, h, y, *limits):
            series = solution(*_formulas(field, t, y), self.order, h)
            part, about = jnp.ones_like(h), []
            if limits:
                inverse, inverses = limits
                squares = terms.squares(series, inverses)
                reach = terms.reach(squares)
                part = terms.snap_to_number(reach, t, h, inverse)
                about = [(part, terms.square_error(squares, part)), (reach, reach)]
            second = [(terms.slope if guarded else estimate)(c, part) for c in series]
            sums = [terms.increment(c, part) for c in series]
            slopes = [terms.slope(c, part) for c in series] if checked else []
            pairs = [*zip(sums, second, strict=True), *about, *((x, x) for x in slopes)]
            return _in_one_array(pairs, h)

        # The step is isolated: XLA would duplicate it for each other use of the result.
        both = in_one_kernel(step, given, unknown=jnp.isfinite(h))
        k = len(y)
        increment, found = both.real[:k], both.imag[:k]
        part = 1.0 if tolerance is None else both.real[k]
        h = part * h
        if guarded:
            # At a start from rest the series follows the other case of the guard, and is wrong.
            found = terms.error_of_slopes(h * field(t + h, y + increment), found)
        square = None if guarded or tolerance is None else both.imag[k]
        if checked:
            off = h * field(t + h, y + increment) - both.real[k + 2 :]
            size = jnp.mean((off * jnp.stack(given[-1])) ** 2)
            square = jnp.maximum(square, size / _MOST_DEFECT**2)
        advance = Advance(increment, found, speed=_speed(field, t + h, h, y + increment, found))
        if tolerance is None:
            return advance
        return advance._replace(part=part, reach=both.real[k + 1], square=square)


def has_series(system, y: Array) -> bool:
    """Whether a rate's formulas are short and elementary enough for `Taylor`; host only.

    Args:
      system: has ``rate(t, y)``; a pytree of its numbers, e.g. a scene. The formulas are those of a
        compiled solve, where these numbers are not known.
      y: (k,) a state.
    """
    found = series_of(system, y)
    return found is not None and found.products <= _MOST_PRODUCTS


class Series(NamedTuple):
    """What the Taylor series of a solution costs, and where there is one.

    Attributes:
      products: number of products at each order.
      everywhere: whether there is a series at each state at which the rate is finite; a root has
        none at 0.
      operations: the operations of the rate whose results change along a motion.
    """

    products: int
    everywhere: bool
    operations: frozenset[str]

    @property
    def functions(self) -> bool:
        """Whether the rate has sines, exponentials and the like, besides powers."""
        return not self.operations.isdisjoint(_FUNCTIONS)

    @property
    def polynomial(self) -> bool:
        """Whether the rate is made of sums and products alone."""
        return self.operations <= _OF_POLYNOMIALS


def series_of(system, y: Array, longest: int | None = None) -> Series | None:
    """The series of a rate, found once for each kind of system, whatever its numbers.

    Args:
      system: see `has_series`.
      y: (k,) a state.
      longest: number of operations of a rate above which it is not analysed: finding the formulas
        of a thousand takes a tenth of a second.
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
        _, nodes = shortest(jax.make_jaxpr(rate)(t, y), t, y, smooth=True)
    except NotElementary:
        return None
    moving = frozenset(node.op for node in nodes if node.moving)
    return Series(products(nodes), not any(map(_has_unguarded_root, nodes)), moving)


_series_of = trace_once(_series)


def _may_hide(node: Node) -> bool:
    """Whether the series of a step may be that of another function than the one at its end.

    An exponential may be flat, to all digits, at the start. A root may pass a double zero of its
    argument, as the speed |v| does where a puck stops: its series continues with -|v|. That of a
    negative power of such a root, other than the inverse root, has no value there.
    """
    if not node.moving:
        return False
    if node.op == "pow" and isinstance(node.args[1], float):
        return abs(node.args[1]) == 0.5 or (node.args[1] > 0 and node.args[1] % 1 == 0.5)
    return node.op in ("exp", "tanh", "sqrt")


def _has_unguarded_root(node: Node) -> bool:
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
        found, nodes = shortest(jax.make_jaxpr(field)(t, y), t, y, smooth=True)
    except NotElementary as error:
        raise _checks.fail("solver", wanted, f"one with {error}", _REMEDY) from None
    if (n := products(nodes)) > _MOST_PRODUCTS:
        raise _checks.fail("solver", wanted, f"one with {n} products", _REMEDY)
    return found, nodes


def _speed(field: Rate, t: Array, h: Array, y: Array, error: Array) -> Array:
    """() |h J error| / |error|: where stability limits steps, errors are along the fastest part."""
    _, slope = jax.jvp(lambda y: field(t, y), (y,), (error,))
    return jnp.abs(h) * jnp.max(jnp.abs(slope)) / (jnp.max(jnp.abs(error)) + _TINY)


def _in_one_array(pairs: list[tuple[Array, Array]], h: Array) -> Array:
    """All results in one array, so that XLA compiles the whole step to one function.

    A number that is used more than once is recomputed for each result that it enters, thousands
    of times for the first coefficients, but not within the function of a single array. There a
    number may enter up to 15 entries, so the entries are complex numbers, with two results each
    (measured for three bodies: 0.5 us a step, against 11 us with 24 real entries).
    """
    places = jnp.arange(len(pairs))
    # A zero that XLA does not see, but LLVM does: the comparison with it stays within the function,
    # where the loop over entries is unrolled (otherwise it takes a third of a step's time).
    zero = lax.shift_right_logical(lax.bitcast_convert_type(h, int) & 1, 1)
    found = jnp.zeros(len(pairs), complex)
    for i, (first, second) in enumerate(pairs):
        found = jnp.where(places == i + zero, lax.complex(first, second), found)
    return found


#: The first is for errors of 1e-6 and above. The others are defaults: the fewer products an order
#: has, the higher the order that is used.
TAYLOR8, TAYLOR12, TAYLOR14, TAYLOR16, TAYLOR20 = (Taylor(n) for n in (8, 12, 14, 16, 20))
