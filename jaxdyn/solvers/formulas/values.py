"""The values of formulas: each operation as one of the compiler's."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn.solvers.formulas.graph import ROUGH, STEADY, Node, Number

#: A value; a known number is a NumPy number, and a known zero is None.
Value = Array | np.floating | np.bool_ | None


def value(node: Node, at: Callable[[Number], Value]) -> Value:
    """The value of a node.

    Args:
      node: a node that is not an input.
      at: gives the values of its operands.
    """
    if node.op == "given":
        return node.value
    if node.op == "sum":
        return _sum(node, at)
    return _VALUES[node.op](*(at(a) for a in node.args))


def constant(a: float | int | bool) -> Value:
    """The value of a number known when the program is compiled."""
    return np.bool_(a) if isinstance(a, bool) else np.float64(a)


def times(a: Value, b: Value) -> Value:
    """A product; None for zero."""
    if a is None or b is None:
        return None
    if isinstance(a, np.floating) and abs(a) == 1.0:
        return b if a > 0 else lax.neg(b)
    return lax.mul(a, b)


def plus(a: Value, b: Value) -> Value:
    """A sum; None for zero."""
    if a is None or b is None:
        return b if a is None else a
    return lax.add(a, b)


def minus(a: Value, b: Value) -> Value:
    """A difference; None for zero."""
    if b is None:
        return a
    return lax.neg(b) if a is None else lax.sub(a, b)


def weighted_sum(terms: list[tuple[Value, Value]]) -> Value:
    """A sum of terms with their factors."""
    found = None
    for factor, term in terms:
        if isinstance(factor, np.floating) and factor == -1.0:
            found = minus(found, term)
        else:
            found = plus(found, times(factor, term))
    return found


def select(which: Value, no: Value, yes: Value) -> Array:
    """One of two values, chosen by a condition."""
    no, yes = (jnp.asarray(0.0 if x is None else x) for x in (no, yes))
    return lax.select(which, yes, no)


def _sum(node: Node, at: Callable[[Number], Value]) -> Value:
    parts = zip(node.args[::2], node.args[1::2], strict=True)
    return weighted_sum([(at(c), np.float64(1.0) if m is None else at(m)) for c, m in parts])


def _power(a: Value, n: Value) -> Array:
    a = jnp.asarray(a)
    if isinstance(n, np.floating) and n + 0.5 in (0.0, -1.0, -2.0, -3.0):
        # This is faster than the power, and more accurate.
        return lax.div(np.float64(1.0), lax.mul(lax.integer_pow(a, int(-n - 0.5)), lax.sqrt(a)))
    return lax.pow(a, jnp.asarray(n))


_VALUES: dict[str, Callable[..., Value]] = {
    **{"scale": times, "mul": times, "product": times, "add": plus, "div": lax.div},
    **{"sqrt": lax.sqrt, "exp": lax.exp, "log": lax.log, "pow": _power, "select": select},
    **{"sin": lax.sin, "cos": lax.cos, "tanh": lax.tanh},
    **{"lt": lax.lt, "le": lax.le, "gt": lax.gt, "ge": lax.ge, "eq": lax.eq, "ne": lax.ne},
    **{"and": lax.bitwise_and, "or": lax.bitwise_or, "not": lax.bitwise_not},
    "is_finite": lax.is_finite,
    "real": lambda a: lax.convert_element_type(a, float),
}
_VALUES |= {name: getattr(lax, name) for name in ROUGH}
assert set(_VALUES) >= STEADY
