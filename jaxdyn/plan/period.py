"""The period of a rate that depends on time, read from its program and the numbers of its scene.

Time enters a periodic rate through sines and remainders of a t + b. What is made of such terms by
sums, products or functions has their common period, which exists if all ratios of their periods are
rational.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxdyn._programs import CALLS, Loop, bind, inner_program, interpret, loop

#: Largest denominator of a ratio of two periods, and the accuracy to which it must be rational.
_MOST_PERIODS, _RATIO_ROUNDING = 1000, 1e-12


class _InTime(NamedTuple):
    """How a value depends on time.

    Attributes:
      array: the value if it does not depend on time; for a t + b the coefficients, (2, ...).
      affine: whether it is a t + b.
      period: () period of the value, 0 if it does not depend on time, infinite if it has none.
    """

    array: Any
    affine: bool = False
    period: float = 0.0


def period_of(program: Any, system: PyTree) -> float | None:
    """The period of a rate in time; None where it has none that can be read.

    Args:
      program: a function of its numbers, t and y, see `Plan`.
      system: the system, with known numbers.
    """
    time = _InTime(np.array([1.0, 0.0]), affine=True, period=math.inf)
    known = [_InTime(np.asarray(x)) for x in jax.tree.leaves(system)]
    (rate,) = interpret(program, [*known, time, _InTime(None)], _apply, _InTime)
    return rate.period if 0 < rate.period < math.inf else None


def _apply(eqn, args: list[_InTime]) -> list[_InTime]:
    name = eqn.primitive.name
    if name in CALLS:
        return interpret(inner_program(eqn), args, _apply, _InTime)
    if any(x.affine for x in args):
        rule = _OF_AFFINE.get(name)
        found = None if rule is None else rule(eqn, *args)
        if found is not None:
            return [found]
    elif all(x.array is not None and not x.period for x in args):
        with jax.ensure_compile_time_eval():
            return [_InTime(np.asarray(x)) for x in bind(eqn, [x.array for x in args])]
    if name == "scan" and (known := loop(eqn)) is not None:
        return _scan(known, args)
    if name == "mul" and any(x.array is not None and not np.any(x.array) for x in args):
        return [_InTime(None) for _ in eqn.outvars]
    period = common_period([x.period for x in args])
    return [_InTime(None, period=period) for _ in eqn.outvars]


def _scan(known: Loop, args: list[_InTime]) -> list[_InTime]:
    n, m = known.consts, known.carry
    args = [_InTime(None, period=x.period) for x in args]
    for _ in range(m + 2):  # until each carried value depends on all that it may depend on
        found = interpret(known.body, args, _apply, _InTime)
        merged = [
            _InTime(None, period=common_period([a.period, b.period]))
            for a, b in zip(args[n : n + m], found[:m], strict=True)
        ]
        args = [*args[:n], *merged, *args[n + m :]]
    return [*merged, *found[m:]]


def common_period(periods: list[float]) -> float:
    """The least common multiple of the periods that are not 0; infinite if there is none."""
    found = 0.0
    for period in periods:
        if not period:
            continue
        if not found:
            found = period
            continue
        if math.isinf(found) or math.isinf(period):
            return math.inf
        ratio = Fraction(found / period).limit_denominator(_MOST_PERIODS)
        if not ratio or abs(float(ratio) * period / found - 1) > _RATIO_ROUNDING:
            return math.inf
        found = found * ratio.denominator
    return found


def _coefficients(x: _InTime) -> tuple[np.ndarray, np.ndarray] | None:
    """a and b of a t + b; None where they are not known."""
    if x.affine:
        return x.array[0], x.array[1]
    return None if x.array is None or x.period else (np.zeros(np.shape(x.array)), x.array)


def _affine(a: Any, b: Any) -> _InTime:
    a, b = np.broadcast_arrays(a, b)
    if not a.any():
        return _InTime(b)
    return _InTime(np.stack([a, b]), affine=True, period=math.inf)


def _linear(eqn, *args: _InTime) -> _InTime | None:
    """The result of an operation that is linear in all arguments: a sum, or moved entries."""
    parts = [_coefficients(x) for x in args]
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    with jax.ensure_compile_time_eval():
        a, b = (np.asarray(bind(eqn, [jnp.asarray(p[i], float) for p in known])[0]) for i in (0, 1))
    return _affine(a, b)


def _scale(eqn, x: _InTime, y: _InTime) -> _InTime | None:
    line, factor = (x, y) if x.affine else (y, x)
    if factor.affine or factor.array is None or factor.period:
        return None
    if eqn.primitive.name == "div":
        if not x.affine:
            return None
        return _affine(line.array[0] / factor.array, line.array[1] / factor.array)
    return _affine(line.array[0] * factor.array, line.array[1] * factor.array)


def _trigonometric(eqn, x: _InTime) -> _InTime:
    turn = math.pi if eqn.primitive.name == "tan" else 2 * math.pi
    rates = np.abs(np.ravel(x.array[0]))
    return _InTime(None, period=common_period([turn / r for r in rates.tolist() if r]))


def _remainder(eqn, x: _InTime, d: _InTime) -> _InTime | None:
    if d.affine or d.array is None or d.period:
        return None
    rates, lengths = np.broadcast_arrays(x.array[0], d.array)
    pairs = zip(np.ravel(rates).tolist(), np.ravel(lengths).tolist(), strict=True)
    return _InTime(None, period=common_period([abs(n / r) for r, n in pairs if r]))


_OF_AFFINE: dict[str, Callable] = {
    **dict.fromkeys(("add", "sub", "neg", "broadcast_in_dim", "reshape", "squeeze"), _linear),
    **dict.fromkeys(("concatenate", "stack", "slice", "convert_element_type"), _linear),
    **dict.fromkeys(("mul", "div"), _scale),
    **dict.fromkeys(("sin", "cos", "tan"), _trigonometric),
    "rem": _remainder,
}
