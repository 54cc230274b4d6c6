"""Bounds of functions of time over an interval, by interval arithmetic within compiled programs.

Each value that depends on time becomes an interval (`intervals`) that encloses it while time runs
through an interval; `solvers.enclosures` does the same with formulas on the host. The result of an
operation without a rule is the whole real line, so that nothing is assumed of it.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxdyn._programs import CALLS, bind, inner_program, interpret
from jaxdyn.intervals import COMPILED, Interval, negative, point

_Value = Interval | Any


def enclose_program(
    program, args: Sequence[_Value], unknown: set[str] | None = None
) -> list[_Value]:
    """The results of a program (a ``ClosedJaxpr``), as intervals where an argument is one.

    Args:
      program: a program of float operations on arrays.
      args: its arguments, known numbers or intervals.
      unknown: receives the names of operations without a rule.
    """
    return interpret(program, args, lambda eqn, args: _apply(eqn, args, unknown), effects=False)


def _apply(eqn, args: list[_Value], unknown: set[str] | None) -> Sequence[_Value]:
    name, params = eqn.primitive.name, eqn.params
    if not any(isinstance(x, Interval) for x in args):
        return bind(eqn, args)
    if name in CALLS:
        return enclose_program(inner_program(eqn), args, unknown)
    if any(jnp.issubdtype(v.aval.dtype, jnp.integer) for v in eqn.outvars):
        return _without_rule(eqn, unknown)  # those that a branch fixes are no intervals
    if name in _ENTRY_BY_ENTRY:
        n = _ENTRY_BY_ENTRY[name] or len(args)
        if any(isinstance(x, Interval) for x in args[n:]):
            return [_unbounded(v.aval.shape) for v in eqn.outvars]
        ends = ([*(as_interval(x)[i] for x in args[:n]), *args[n:]] for i in (0, 1))
        return [Interval(*pair) for pair in zip(*(bind(eqn, end) for end in ends), strict=True)]
    if name in _MONOTONE:
        ends = [bind(eqn, [x[i]])[0] for x in args for i in (0, 1)]
        return [COMPILED.widen(*(ends if _MONOTONE[name] else ends[::-1]))]
    if name in _RULES:
        return [_RULES[name](*map(as_interval, args))]
    if name in _RULES_WITH_PARAMETERS:
        return [_RULES_WITH_PARAMETERS[name](params, *args)]
    return _without_rule(eqn, unknown)


def _without_rule(eqn, unknown: set[str] | None) -> list[_Value]:
    """The results of an operation that has no bounds."""
    if unknown is not None:
        unknown.add(eqn.primitive.name)
    return [_unbounded(v.aval.shape) for v in eqn.outvars]


def _unbounded(shape) -> Interval:
    return Interval(jnp.full(shape, -jnp.inf), jnp.full(shape, jnp.inf))


def as_interval(x: _Value) -> Interval:
    """A value as an interval; a known number is both of its ends, a Boolean is 0.0 or 1.0."""
    if isinstance(x, Interval):
        return x
    x = jnp.asarray(x)
    return point(x if jnp.issubdtype(x.dtype, jnp.floating) else x.astype(float))


#: Operations that only move entries, or increase with each of them, so that the ends of the result
#: follow from the ends of the arguments. The value is the number of arguments, the first ones, that
#: may be intervals; None for all.
_ENTRY_BY_ENTRY: dict[str, int | None] = {
    **dict.fromkeys(("reshape", "broadcast_in_dim", "transpose", "squeeze", "slice", "rev")),
    **dict.fromkeys(("concatenate", "stack", "unstack", "split", "pad", "copy")),
    **dict.fromkeys(("max", "min", "clamp", "reduce_sum", "reduce_max", "reduce_min")),
    **dict.fromkeys(("cumsum", "cummax", "cummin", "stop_gradient", "convert_element_type")),
    **{"dynamic_slice": 1, "gather": 1},
}
#: Monotone functions, and whether each increases.
_MONOTONE = {
    **dict.fromkeys(("exp", "exp2", "expm1", "log", "log1p", "cbrt", "tanh"), True),
    **dict.fromkeys(("sinh", "asinh", "atan", "asin", "logistic", "erf", "acosh", "atanh"), True),
    **{"neg": False, "acos": False, "erfc": False, "rsqrt": False},
    **dict.fromkeys(("floor", "ceil", "round", "sign"), True),
}


# A product is traced once for each shape: written out it is sixteen operations, which take longer
# to trace than all else in the bounds of a rate.
_inlined = functools.partial(jax.jit, inline=True)
_sum, _product_of_two = _inlined(COMPILED.add), _inlined(COMPILED.multiply)


def _multiply(a: Interval, b: Interval) -> Interval:
    return COMPILED.whole_power(a, 2) if a is b else _product_of_two(a, b)


def _select(params, which, *cases) -> Interval:
    if isinstance(which, Interval):
        return COMPILED.choose(which, *map(as_interval, cases))  # a condition has two cases
    ends = ([as_interval(x)[i] for x in cases] for i in (0, 1))
    return Interval(*(lax.select_n(which, *end) for end in ends))


def _product(params, a, b) -> Interval:
    """Interval of a product of arrays, from the signs of the known one; unbounded without one."""
    if isinstance(a, Interval) and isinstance(b, Interval):
        shape = jax.eval_shape(functools.partial(lax.dot_general, **params), a.low, b.low).shape
        return _unbounded(shape)

    def dot(x, y):
        return lax.dot_general(x, y, **params)

    if isinstance(b, Interval):
        up, down = jnp.maximum(a, 0.0), jnp.minimum(a, 0.0)
        return Interval(dot(up, b.low) + dot(down, b.high), dot(up, b.high) + dot(down, b.low))
    up, down = jnp.maximum(b, 0.0), jnp.minimum(b, 0.0)
    return Interval(dot(a.low, up) + dot(a.high, down), dot(a.high, up) + dot(a.low, down))


#: Rules by the names of JAX's primitives.
_RULES: dict[str, Callable[..., Interval]] = {
    **{"add": _sum, "add_any": _sum, "mul": _multiply},
    "sub": lambda a, b: _sum(a, negative(b)),
    "div": lambda a, b: _product_of_two(a, COMPILED.inverse(b)),
    **{"pow": COMPILED.real_power, "sqrt": COMPILED.root, "abs": COMPILED.magnitude},
    "square": lambda a: COMPILED.whole_power(a, 2),
    "one_minus_square": lambda a: COMPILED.add(
        point(jnp.ones(())), negative(COMPILED.whole_power(a, 2))
    ),
    "cos": lambda a: COMPILED.cosine(a, 0.0),
    "sin": lambda a: COMPILED.cosine(a, 0.5),
    "tan": COMPILED.tangent,
    "cosh": lambda a: COMPILED.rising(jnp.cosh, COMPILED.magnitude(a)),
    **dict.fromkeys(("lt", "le"), COMPILED.less),
    **dict.fromkeys(("gt", "ge"), lambda a, b: COMPILED.less(b, a)),
    "eq": COMPILED.equal,
    "ne": lambda a, b: COMPILED.opposite(COMPILED.equal(a, b)),
    **{"and": COMPILED.both, "or": COMPILED.either, "not": COMPILED.opposite},
    "is_finite": lambda a: point(jnp.ones(a.low.shape)),
}
#: Rules that also need the parameters of the operation, or which arguments are known numbers.
_RULES_WITH_PARAMETERS: dict[str, Callable[..., Interval]] = {
    "integer_pow": lambda params, a: COMPILED.whole_power(a, params["y"]),
    "select_n": _select,
    "dot_general": _product,
}
