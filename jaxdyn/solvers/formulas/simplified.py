"""A rate evaluated by its formulas: what was written twice is computed once, what cancels never."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.solvers.formulas.formulas import NotElementary
from jaxdyn.solvers.formulas.nodes import Node, Number
from jaxdyn.solvers.formulas.shortest import shortest
from jaxdyn.solvers.formulas.values import Value, value
from jaxdyn.solvers.method import Rate, operations

#: Numbers of a state: more are points in arrays, whose loops the compiler vectorises (of 12 and
#: more numbers three bodies take 1.2 times as long by formulas, Pleiades 1.3 times).
_MOST_NUMBERS = 11
#: Operations of a rate: a thousand take a tenth of a second to find formulas for.
_MOST_OPERATIONS = 1000


def simplified(rate: Rate) -> Rate:
    """The same rate by its formulas, for few numbers and where it has any.

    Rates composed of parts, or derived from energies, contain products with zeros, sums that
    cancel, angles written twice; XLA removes little of that, and calculates what several entries
    share once for each. By formulas a step of a pair takes 0.3 (a cart with a pendulum) to 0.6 (a
    double pendulum) of the time, and one with tangents 0.03 (a triple pendulum) to 0.5, since loops
    over the unknowns of a linear system, as in a mass matrix, are written out.

    Limits: rates with derivatives of their own (``jax.custom_jvp``) are left as they are. A product
      with a known 0 is 0, also where the other factor is infinite.
    """

    def by_formulas(t: Array, y: Array) -> Array:
        if y.ndim > 1 or len(y) > _MOST_NUMBERS or operations(rate, t, y) > _MOST_OPERATIONS:
            return rate(t, y)
        if _has_own_derivatives(jax.make_jaxpr(rate)(t, y).jaxpr):
            return rate(t, y)
        try:
            found, nodes = shortest(rate, t, y)
        except NotElementary:
            return rate(t, y)
        values: dict[Node, Value] = {node: node.value for node in (found.time, *found.states)}
        at = _reader(values)
        for node in nodes:
            values[node] = value(node, at)
        rates = (at(x) for x in found.rates)
        return jnp.stack([jnp.zeros_like(t) if x is None else jnp.asarray(x) for x in rates])

    return by_formulas


def _has_own_derivatives(jaxpr) -> bool:
    """Whether a program, or one within it, comes with a rule for its derivative."""
    inner = (v for eqn in jaxpr.eqns for v in eqn.params.values() if hasattr(v, "jaxpr"))
    own = any(eqn.primitive.name.startswith("custom_") for eqn in jaxpr.eqns)
    return own or any(_has_own_derivatives(closed.jaxpr) for closed in inner)


def _reader(values: dict[Node, Value]) -> Callable[[Number], Value]:
    def at(a: Number) -> Value:
        if isinstance(a, Node):
            return values[a]
        return np.bool_(a) if isinstance(a, bool) else np.float64(a)

    return at
