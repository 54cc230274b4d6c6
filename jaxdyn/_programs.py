"""The programs of JAX (jaxprs), read the same way in every version.

The parameters of JAX's operations are not a public interface, and they change: `scan` describes its
operands by their numbers up to JAX 0.10, and by trees from 0.11 on; called programs have been open
or closed, under several names. Whatever interprets a program uses this file, so that only this
has to follow a new version; an operation that it does not know is left as it is.
"""

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np

#: Operations that call a program, also those with rules of their own for derivatives.
CALLS = frozenset({"jit", "pjit", "closed_call", "core_call", "remat", "remat2", "checkpoint"}) | {
    *("custom_jvp_call", "custom_vjp_call", "custom_vjp_call_jaxpr")
}


def inner_program(eqn: Any) -> Any:
    """The closed program that an operation of `CALLS` calls."""
    params = eqn.params
    inner = params.get("jaxpr") or params.get("call_jaxpr") or params["fun_jaxpr"]
    return inner if hasattr(inner, "consts") else jax.extend.core.ClosedJaxpr(inner, ())


def is_interp(eqn: Any) -> bool:
    """Whether an operation of `CALLS` is ``jnp.interp``, continuous also at the ends of its table.

    Its derivative, which has the same name, is not, nor one with values of its own beyond the ends.
    """
    named = "interp" in str(eqn.params.get("name", ""))
    return named and len(eqn.invars) == 3 and _is_interp(inner_program(eqn).jaxpr)


@functools.lru_cache(maxsize=256)
def _is_interp(jaxpr: Any) -> bool:
    shapes = [jax.ShapeDtypeStruct(x.aval.shape, x.aval.dtype) for x in jaxpr.invars]
    ends, text = (None, "extrapolate"), str(jaxpr)
    for left, right in ((left, right) for left in ends for right in ends):
        interp = functools.partial(jnp.interp, left=left, right=right)
        for eqn in jax.make_jaxpr(interp)(*shapes).eqns:
            if eqn.primitive.name in CALLS and str(inner_program(eqn).jaxpr) == text:
                return True
    return False


def bind(eqn, args: list) -> Sequence[Any]:
    """The results of an operation of a program for other arguments."""
    given = eqn.primitive.get_bind_params(eqn.params)
    # Up to JAX 0.9 this is a pair: functions, and the other parameters.
    functions, params = ((), given) if isinstance(given, dict) else given
    with np.errstate(all="ignore"):  # known numbers are NumPy's
        found = eqn.primitive.bind(*functions, *args, **params)
    return found if eqn.primitive.multiple_results else [found]


def programs(jaxpr: Any) -> Iterator[Any]:
    """A program and all that its operations call, as often as they occur in it."""
    yield jaxpr
    for eqn in jaxpr.eqns:
        for value in eqn.params.values():
            for inner in value if isinstance(value, tuple | list) else (value,):
                inner = getattr(inner, "jaxpr", inner)
                if hasattr(inner, "eqns"):
                    yield from programs(inner)


def size(jaxpr: Any) -> int:
    """Number of operations of a program, with those of all that it calls."""
    return sum(len(program.eqns) for program in programs(jaxpr))


def interpret(
    program: Any,
    args: Sequence[Any],
    apply: Callable[[Any, list], Sequence],
    known: Callable[[Any], Any] = lambda x: x,
    effects: bool = True,
) -> list[Any]:
    """The results of a closed program for values of any kind in place of its numbers.

    Args:
      program: a ``ClosedJaxpr``.
      args: the values of its arguments.
      apply: the results of an operation for the values of its operands.
      known: the value of a number that the program contains.
      effects: see `live_operations`.
    """
    jaxpr = program.jaxpr
    values = dict(zip(jaxpr.constvars, map(known, program.consts), strict=True))
    values |= dict(zip(jaxpr.invars, args, strict=True))

    def read(atom: Any) -> Any:
        return known(atom.val) if isinstance(atom, jax.extend.core.Literal) else values[atom]

    for eqn in live_operations(jaxpr, effects):
        results = apply(eqn, [read(a) for a in eqn.invars])
        values |= dict(zip(eqn.outvars, results, strict=True))
    return [read(a) for a in jaxpr.outvars]


def live_operations(jaxpr: Any, effects: bool = True) -> list[Any]:
    """The operations of a program on which its results depend, and those with `effects`, in order.

    JAX traces computations whose results are not used as well; only the compiler drops them.
    """
    wanted = {id(x) for x in jaxpr.outvars}
    found = []
    for eqn in reversed(jaxpr.eqns):
        if (effects and eqn.effects) or any(id(x) in wanted for x in eqn.outvars):
            wanted |= {id(x) for x in eqn.invars}
            found.append(eqn)
    return found[::-1]


class Loop(NamedTuple):
    """A loop of known length, `scan`.

    Attributes:
      body: its closed program, a function of constants, carried values and rows.
      length: number of rounds.
      reverse: whether the last row comes first.
      consts: number of operands that are the same in every round.
      carry: number of operands, and of results, that are carried from round to round.
    """

    body: Any
    length: int
    reverse: bool
    consts: int
    carry: int


def loop(eqn: Any) -> Loop | None:
    """The loop of a `scan`; None where this version of JAX describes it in an unknown way."""
    params = eqn.params
    try:
        if "ft_in" in params:  # from 0.11 on
            consts, carry, _ = (len(part) for part in params["ft_in"].unpack())
        else:
            consts, carry = params["num_consts"], params["num_carry"]
        return Loop(params["jaxpr"], params["length"], params["reverse"], consts, carry)
    except (AttributeError, KeyError, TypeError, ValueError):
        return None
