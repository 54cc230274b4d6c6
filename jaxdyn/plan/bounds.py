"""Bounds of functions of time over an interval, by interval arithmetic within compiled programs.

Each value that moves becomes a pair (low, high) that encloses it while time runs through an
interval; see `solvers.enclosures` for the same on the host, with rounding outwards. Here rounding
is left out: bounds decide where steps end, not what is proved. An operation without a rule gives
the whole line, so that what is not understood counts as unknown.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn._programs import CALLS, bind, inner_program


class Bounds(NamedTuple):
    """Numbers between low and high, arrays of one shape."""

    low: Array
    high: Array


_Value = Bounds | Any


def enclose_program(
    program, args: Sequence[_Value], unknown: set[str] | None = None
) -> list[_Value]:
    """The results of a program (a ``ClosedJaxpr``), as bounds where they move.

    Args:
      program: a program of float operations on arrays.
      args: its arguments, known numbers or `Bounds`.
      unknown: receives the names of operations without a rule, whose bounds are the whole line.
    """
    jaxpr = program.jaxpr
    values = dict(zip(jaxpr.constvars, program.consts, strict=True))
    values |= dict(zip(jaxpr.invars, args, strict=True))

    def read(atom) -> _Value:
        return atom.val if isinstance(atom, jax.extend.core.Literal) else values[atom]

    for eqn in _operations_needed(jaxpr):
        found = _apply(eqn, [read(a) for a in eqn.invars], unknown)
        values |= dict(zip(eqn.outvars, found, strict=True))
    return [read(a) for a in jaxpr.outvars]


def _operations_needed(jaxpr) -> list:
    """The operations that the results depend on; the others may have no bounds."""
    wanted, found = {id(v) for v in jaxpr.outvars}, []
    for eqn in reversed(jaxpr.eqns):
        if any(id(v) in wanted for v in eqn.outvars):
            found.append(eqn)
            wanted |= {id(v) for v in eqn.invars}
    return found[::-1]


def _apply(eqn, args: list[_Value], unknown: set[str] | None) -> Sequence[_Value]:
    name, params = eqn.primitive.name, eqn.params
    if not any(isinstance(x, Bounds) for x in args):
        return bind(eqn, args)
    if name in CALLS:
        return enclose_program(inner_program(eqn), args, unknown)
    if any(jnp.issubdtype(v.aval.dtype, jnp.integer) for v in eqn.outvars):
        return _without(eqn, unknown)  # integers that a branch fixes are known numbers
    if name in _ENTRY_BY_ENTRY:
        n = _ENTRY_BY_ENTRY[name] or len(args)
        if any(isinstance(x, Bounds) for x in args[n:]):
            return [_unbounded(v.aval.shape) for v in eqn.outvars]
        ends = ([*(as_bounds(x)[i] for x in args[:n]), *args[n:]] for i in (0, 1))
        return [Bounds(*pair) for pair in zip(*(bind(eqn, each) for each in ends), strict=True)]
    if name in _MONOTONE:
        ends = [bind(eqn, [x[i]])[0] for x in args for i in (0, 1)]
        low, high = ends if _MONOTONE[name] else ends[::-1]
        return [_with_domain(name, as_bounds(args[0]), low, high)]
    if name in _RULES:
        return [_RULES[name](params, *args)]
    return _without(eqn, unknown)


def _without(eqn, unknown: set[str] | None) -> list[_Value]:
    """The results of an operation that has no bounds."""
    if unknown is not None:
        unknown.add(eqn.primitive.name)
    return [_unbounded(v.aval.shape) for v in eqn.outvars]


def _unbounded(shape) -> Bounds:
    return Bounds(jnp.full(shape, -jnp.inf), jnp.full(shape, jnp.inf))


def as_bounds(x: _Value) -> Bounds:
    """A value as bounds; a known number is both of its own bounds."""
    return x if isinstance(x, Bounds) else Bounds(jnp.asarray(x), jnp.asarray(x))


#: Operations that only move entries, or increase with each of them, so that the ends of the result
#: follow from the ends of the arguments. The value is how many of the first arguments may be
#: bounds; None for all.
_ENTRY_BY_ENTRY: dict[str, int | None] = {
    **dict.fromkeys(("reshape", "broadcast_in_dim", "transpose", "squeeze", "slice", "rev")),
    **dict.fromkeys(("concatenate", "stack", "unstack", "split", "pad", "copy")),
    **dict.fromkeys(("add", "add_any", "max", "min", "reduce_sum", "reduce_max", "reduce_min")),
    **dict.fromkeys(("cumsum", "cummax", "cummin", "stop_gradient", "convert_element_type")),
    **{"dynamic_slice": 1, "gather": 1},
}
#: Whether a monotone function increases.
_MONOTONE = {
    **dict.fromkeys(("exp", "exp2", "expm1", "log", "log1p", "sqrt", "cbrt", "tanh"), True),
    **dict.fromkeys(("sinh", "asinh", "atan", "asin", "logistic", "erf", "acosh", "atanh"), True),
    **{"neg": False, "acos": False, "erfc": False, "rsqrt": False},
    **dict.fromkeys(("floor", "ceil", "round", "sign"), True),
}
#: The least argument at which a function is defined.
_DEFINED_FROM = {"log": 0.0, "sqrt": 0.0, "log1p": -1.0, "rsqrt": 0.0}


def _with_domain(name: str, a: Bounds, low: Array, high: Array) -> Bounds:
    low, high = _no_nan(low, -jnp.inf), _no_nan(high, jnp.inf)
    least = _DEFINED_FROM.get(name)
    if least is None:
        return Bounds(low, high)
    outside = a.low < least
    below = 0.0 if name in ("sqrt", "rsqrt") else -jnp.inf
    high = jnp.where(outside, jnp.inf, high) if name == "rsqrt" else high
    return Bounds(jnp.where(outside & (name != "rsqrt"), below, low), high)


def _no_nan(x: Array, instead: float) -> Array:
    return jnp.where(jnp.isnan(x), instead, x)


def _sub(params, a, b) -> Bounds:
    a, b = as_bounds(a), as_bounds(b)
    return Bounds(_no_nan(a.low - b.high, -jnp.inf), _no_nan(a.high - b.low, jnp.inf))


def _mul(params, a, b) -> Bounds:
    if a is b:
        return _power(2, a)
    a, b = as_bounds(a), as_bounds(b)
    corners = [jnp.where((x == 0) | (y == 0), 0.0, x * y) for x in a for y in b]
    return Bounds(functools.reduce(jnp.minimum, corners), functools.reduce(jnp.maximum, corners))


def _div(params, a, b) -> Bounds:
    b = as_bounds(b)
    through = (b.low <= 0) & (b.high >= 0)
    low = jnp.where(through, -jnp.inf, 1.0 / jnp.where(through, 1.0, b.high))
    high = jnp.where(through, jnp.inf, 1.0 / jnp.where(through, 1.0, b.low))
    return _mul(params, a, Bounds(low, high))


def _power(n: int, a) -> Bounds:
    a = as_bounds(a)
    if n < 0:
        return _div(None, jnp.ones_like(a.low), _power(-n, a))
    ends = lax.integer_pow(a.low, n), lax.integer_pow(a.high, n)
    low, high = jnp.minimum(*ends), jnp.maximum(*ends)
    if n % 2 == 0:
        low = jnp.where((a.low < 0) & (a.high > 0), 0.0, low)
    return Bounds(low, high)


def _real_power(params, a, n) -> Bounds:
    a, n = as_bounds(a), as_bounds(n)
    corners = [x**y for x in a for y in n]
    low, high = functools.reduce(jnp.minimum, corners), functools.reduce(jnp.maximum, corners)
    unknown = (a.low < 0) | jnp.isnan(low) | jnp.isnan(high)
    return Bounds(jnp.where(unknown, -jnp.inf, low), jnp.where(unknown, jnp.inf, high))


def _abs(params, a) -> Bounds:
    a = as_bounds(a)
    through = (a.low < 0) & (a.high > 0)
    ends = jnp.abs(a.low), jnp.abs(a.high)
    return Bounds(jnp.where(through, 0.0, jnp.minimum(*ends)), jnp.maximum(*ends))


def _wave(shift: float, fn: Callable, params, a) -> Bounds:
    """``cos`` (shift 0) or ``sin`` (shift 1/2): 1 at (shift + 2 n) pi, -1 half a turn later."""
    a = as_bounds(a)
    ends = fn(a.low), fn(a.high)
    first, last = a.low / np.pi - shift, a.high / np.pi - shift
    high = jnp.where(2 * jnp.floor(last / 2) >= first, 1.0, jnp.maximum(*ends))
    low = jnp.where(2 * jnp.floor((last - 1) / 2) + 1 >= first, -1.0, jnp.minimum(*ends))
    unknown = ~(jnp.isfinite(first) & jnp.isfinite(last))
    return Bounds(jnp.where(unknown, -1.0, low), jnp.where(unknown, 1.0, high))


def _cosh(params, a) -> Bounds:
    a = _abs(params, a)
    return Bounds(jnp.cosh(a.low), jnp.cosh(a.high))


def _tan(params, a) -> Bounds:
    a = as_bounds(a)
    same = jnp.floor(a.low / np.pi + 0.5) == jnp.floor(a.high / np.pi + 0.5)
    return Bounds(
        jnp.where(same, jnp.tan(a.low), -jnp.inf), jnp.where(same, jnp.tan(a.high), jnp.inf)
    )


def _select(params, which, *cases) -> Bounds:
    if not isinstance(which, Bounds):
        # Bounds of a truth value are the floats 0 and 1, but a known one is a boolean.
        ends = ([jnp.asarray(as_bounds(x)[i], float) for x in cases] for i in (0, 1))
        return Bounds(*(lax.select_n(which, *each) for each in ends))
    no, yes = map(as_bounds, cases)  # a condition has two cases

    def chosen(no: Array, yes: Array, either: Array) -> Array:
        return jnp.where(which.high == 0, no, jnp.where(which.low == 1, yes, either))

    return Bounds(
        chosen(no.low, yes.low, jnp.minimum(no.low, yes.low)),
        chosen(no.high, yes.high, jnp.maximum(no.high, yes.high)),
    )


def _compare(name: str, params, a, b) -> Bounds:
    """Bounds of a truth value: 1 and 1 where it surely holds, 0 and 0 where it does not."""
    a, b = as_bounds(a), as_bounds(b)
    if name in ("gt", "ge"):
        a, b = b, a
    if name in ("lt", "gt", "le", "ge"):
        surely, maybe = a.high < b.low, a.low <= b.high
    else:
        maybe = (a.low <= b.high) & (b.low <= a.high)
        surely = maybe & (a.low == a.high) & (b.low == b.high)
        if name == "ne":
            surely, maybe = ~maybe, ~surely
    return Bounds(surely.astype(float), maybe.astype(float))


def _logic(name: str, params, *args) -> Bounds:
    ends = [as_bounds(jnp.asarray(x, float) if not isinstance(x, Bounds) else x) for x in args]
    if name == "not":
        (a,) = ends
        return Bounds(1.0 - a.high, 1.0 - a.low)
    both = jnp.minimum if name == "and" else jnp.maximum
    return Bounds(both(ends[0].low, ends[1].low), both(ends[0].high, ends[1].high))


def _product(params, a, b) -> Bounds:
    """Bounds of a product of arrays, by the signs of the known one; none if neither is known."""
    if isinstance(a, Bounds) and isinstance(b, Bounds):
        shape = jax.eval_shape(functools.partial(lax.dot_general, **params), a.low, b.low).shape
        return _unbounded(shape)

    def dot(x, y):
        return lax.dot_general(x, y, **params)

    if isinstance(b, Bounds):
        up, down = jnp.maximum(a, 0.0), jnp.minimum(a, 0.0)
        return Bounds(dot(up, b.low) + dot(down, b.high), dot(up, b.high) + dot(down, b.low))
    up, down = jnp.maximum(b, 0.0), jnp.minimum(b, 0.0)
    return Bounds(dot(a.low, up) + dot(a.high, down), dot(a.high, up) + dot(a.low, down))


_RULES: dict[str, Callable[..., Bounds]] = {
    **{"sub": _sub, "mul": _mul, "div": _div, "pow": _real_power, "abs": _abs},
    "integer_pow": lambda params, a: _power(params["y"], a),
    "square": lambda params, a: _power(2, a),
    "one_minus_square": lambda params, a: _sub(params, jnp.ones(()), _power(2, a)),
    "cos": functools.partial(_wave, 0.0, jnp.cos),
    "sin": functools.partial(_wave, 0.5, jnp.sin),
    **{"cosh": _cosh, "tan": _tan, "select_n": _select, "dot_general": _product},
    **{n: functools.partial(_compare, n) for n in ("lt", "le", "gt", "ge", "eq", "ne")},
    **{n: functools.partial(_logic, n) for n in ("and", "or", "not")},
    "is_finite": lambda params, a: Bounds(jnp.ones(a.low.shape), jnp.ones(a.low.shape)),
}
