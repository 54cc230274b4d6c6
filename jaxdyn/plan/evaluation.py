"""Rates in one branch: each condition of the program has a given outcome.

A rate with conditions (``where``, ``sign``, ``abs``, ``max``, ``floor``, ``mod``, tables, ...) is
smooth between the times at which one of them changes. `BranchEvaluation` runs the program of a rate
with the outcomes of its conditions, the branch, as an argument, so that a step across such a time
is not affected by the other side. Besides the rate it returns how far each condition is from
changing, its margin, and the outcomes that hold at the point.

What a condition is, and its margin:

- a comparison a < b: b - a where it holds, a - b where it does not; ``max``, ``min``, ``abs``,
  ``sign`` and ``clamp`` are made of comparisons;
- ``floor``, ``ceil``, ``round``, ``rem``, a conversion to integers: the distance from the next
  whole number;
- the place of a number in a table (``searchsorted``, and so ``interp``): the distance to the
  nearest of the two knots beside it; values of ``interp`` are continuous there;
- which of several numbers is the largest or the smallest: how far it is from the next one; the
  order of a few numbers is made of comparisons.

Equality does not count as a condition: programs test it to guard a removable singularity, and it
holds at single points only. But derivatives of ``max`` and ``min`` use it to find the operand
that was taken. Steps end on the surface, where both operands are equal: there the branch decides.
Conditions on numbers of the scene alone are evaluated as they are. Those within loops of unknown
length, and choices such as the pivots of a linear system, cannot be read;
`BranchEvaluation.unread` names them.
"""

import functools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import is_smooth
from jaxdyn._programs import CALLS, Loop, bind, inner_program, interpret, is_interp, loop

#: What a value depends on: time and state, so that it varies along a motion, or only outcomes of
#: conditions, so that it is constant in a branch and jumps between branches.
BY_TIME, BY_STATE, JUMPS_IN_TIME, JUMPS_WITH_STATE = 1, 2, 4, 8
_MOVES = BY_TIME | BY_STATE
OF_TIME, OF_STATE = BY_TIME | JUMPS_IN_TIME, BY_STATE | JUMPS_WITH_STATE
_JUMPS = JUMPS_IN_TIME | JUMPS_WITH_STATE
#: A further flag: the value is made of a function that is not defined for all states, as a root is.
_NOT_EVERYWHERE = 16

_COMPARISONS = ("lt", "le", "gt", "ge", "lt_to", "le_to")
_TABLE = "searchsorted"
#: Largest number of rounds for which a loop with conditions is unrolled.
_LONGEST_LOOP = 100
#: Largest number of entries in a sort that is read.
_LONGEST_ROW = 20
#: Operations on floats whose conditions are not read.
_UNREAD = frozenset({"sort", "cummax", "cummin", "top_k", "reduce_window_max", "reduce_window_min"})
#: Margin of a condition that has none, such as one at infinity, as a part of the largest float.
_FAR = 1e-8


class Value(NamedTuple):
    """A value of a program.

    Attributes:
      array: the value; None where it is not computed.
      on: what it depends on: `BY_TIME`, `BY_STATE`, `JUMPS_IN_TIME` and `JUMPS_WITH_STATE`, joined
        by ``|``, and `_NOT_EVERYWHERE`; 0 for a value to which none of these applies.
      degree: its degree as a polynomial in time, where it depends on time alone; infinite if it is
        not a polynomial.
    """

    array: Any
    on: int = 0
    degree: float = 0.0

    def map(self, function: Callable) -> "Value":
        """The same with ``function(array)`` as its array, if that is computed."""
        return self if self.array is None else self._replace(array=function(self.array))


def _dependence(*values: Value) -> int:
    """What any of some values depends on, see `Value.on`."""
    return functools.reduce(lambda on, x: on | x.on, values, 0)


class Conditions(NamedTuple):
    """The conditions of a rate at a point of a motion.

    Attributes:
      outcomes: (e,) the outcomes that hold there, each in the branch of the conditions before it.
      margins: (e,) how far each is from changing in the branch; negative where it has changed.
      beyond: (e,) the outcomes on the other side of the nearest change.
    """

    outcomes: Array
    margins: Array
    beyond: Array


class Condition(NamedTuple):
    """A condition of a program, or several in one array.

    Attributes:
      on: what it depends on, see `Value`.
      size: number of its entries.
      bends: whether values are continuous where it changes, as those of ``max``.
    """

    on: int
    size: int
    bends: bool = False

    @property
    def of_time(self) -> bool:
        """Whether it depends on time and not on the state."""
        return not self.on & OF_STATE


class BranchEvaluation:
    """One evaluation of a program in a branch.

    Args:
      branch: (e,) outcomes; None for those that hold at the point.
      time_only: leave out what depends on the state.
      state_only: leave out the margins of conditions on time alone.
      continuous: ids of the comparisons at which the results are continuous.
      every_call: enter every function that is called, though this bypasses its derivative rule.
      waves: count sines of time as well among the parts that a step may pass over.

    Attributes:
      conditions: the conditions met so far.
      unread: names of operations that may hide conditions.
      partial: whether a condition decides if a function that is not defined everywhere, such as a
        root, has a value, or whether that value is used.
      leaves: values that depend on time alone and are combined with the state, or are a result.
      mixed: alternately the arguments and the values of functions of time and state that may be
        flat except in a brief part of a motion.
    """

    def __init__(
        self,
        branch: Array | None,
        time_only: bool = False,
        every_call: bool = False,
        waves: bool = False,
        state_only: bool = False,
        continuous: frozenset[int] = frozenset(),
    ):
        self.branch, self.time_only, self.waves = branch, time_only, waves
        self.state_only = state_only
        self.every_call = every_call or time_only
        self.continuous = continuous
        self.conditions: list[Condition] = []
        self._found: list[tuple[Array, Array, Array]] = []
        self.unread: set[str] = set()
        self.partial = False
        self.leaves: list[Value] = []
        self.mixed: list[Value] = []
        # The values are kept as well, since ids of deleted ones would be given to others.
        self._origins: dict[int, tuple[Value, str, list[Value]]] = {}
        self._taken: dict[int, tuple[Array, Value, Value, Value, int]] = {}
        self._compared: list[tuple[Value, Value]] = []
        self._continuous = False  # whether inside a function that is continuous, as `interp`

    @property
    def found(self) -> Conditions:
        """What was found about all conditions."""
        if not self._found:
            return Conditions(*[jnp.zeros(0)] * 3)
        outcomes, margins, beyond = map(jnp.concatenate, zip(*self._found, strict=True))
        far = _FAR * jnp.finfo(margins.dtype).max
        margins = jnp.where(jnp.isnan(margins), far, jax.lax.clamp(-far, margins, far))
        return Conditions(outcomes, margins, beyond)

    def rate(self, program, leaves: Sequence, t: Any, y: Any) -> Value:
        """The result of the program of a rate, a function of the system's numbers, t and y."""
        inputs = [*map(Value, leaves), Value(t, BY_TIME, 1.0), Value(y, BY_STATE, math.inf)]
        (rate,) = self.program(program, inputs)
        if self.time_only:
            self._meets_state(rate)
        return rate

    def program(self, closed, args: Sequence[Value]) -> list[Value]:
        """The results of a program."""
        # Only its live operations are run. A condition whose outcome is not used would end steps
        # and take long to compile: the work of an effect, whose error is measured by the magnitudes
        # of its terms, took 26 s.
        return interpret(closed, args, self._apply, Value)

    def _apply(self, eqn, args: list[Value]) -> list[Value]:
        name, params = eqn.primitive.name, eqn.params
        on = _dependence(*args)
        if on & _MOVES:
            rule = _RULES.get(name)
            if rule is not None and _is_condition(eqn):
                found = rule(self, eqn, args)
                return found if isinstance(found, list) else [found]
            if name in CALLS:
                if params.get("name") == _TABLE and not args[0].on & _MOVES:
                    # In a derivative the tangents of both follow; the result is the same.
                    return [self._table(*args[:2])]
                inner = inner_program(eqn)
                # Some calls are entered only to find the degrees of polynomials in time.
                enter = may_switch(inner) or (self.every_call and on & BY_TIME)
                if enter and not is_smooth(str(params.get("name", ""))):
                    outside, self._continuous = self._continuous, is_interp(eqn) or self._continuous
                    found = self.program(inner, args)
                    self._continuous = outside
                    return found
            elif name == "cond" and may_switch(*params["branches"]):
                return self._choose(params["branches"], args)
            elif name == "scan" and may_switch(params["jaxpr"]):
                known = loop(eqn)
                if known is not None and known.length <= _LONGEST_LOOP:
                    return self._unroll(eqn, known, args)
                self.unread.add("a loop of many rounds with conditions")
            elif name == "while" and may_switch(params["body_jaxpr"], params["cond_jaxpr"]):
                self.unread.add("a loop of unknown length")
            elif name == "eq" and (taken := self._is_chosen(*args)) is not None:
                return [Value(taken, on, math.inf)]
            elif name == "eq" and self._are_apart(*args):
                return [Value(jnp.zeros(eqn.outvars[0].aval.shape, bool), on, math.inf)]
        return self._as_it_stands(eqn, args, on)

    def note_choice(self, which: Array, no: Value, yes: Value, found: Value) -> None:
        """Note that a result of ``max`` or ``min`` is the operand that an outcome chooses."""
        if found.array is not None:
            self._taken[id(found.array)] = which, no, yes, found, len(self.conditions) - 1

    def note_comparison(self, a: Value, b: Value) -> None:
        """Note that an outcome says which of two values is the larger one."""
        if self.branch is not None:
            self._compared.append((a, b))

    def _are_apart(self, a: Value, b: Value) -> bool:
        """Whether an outcome says which value is larger: then they are never equal in a branch.

        So the derivatives of ``max`` and ``min`` are those of the branch, although the rules of JAX
        0.11 and newer take half of each where the operands are equal.
        """
        return any(
            (_is_same(a, x) and _is_same(b, y)) or (_is_same(a, y) and _is_same(b, x))
            for x, y in self._compared
        )

    def _is_chosen(self, a: Value, b: Value) -> Array | None:
        """Whether one value is the operand that was taken for the other, a maximum or minimum.

        It is None if the values are no such pair. The derivative rules of JAX 0.10 and older make
        this comparison, and such a derivative jumps: the condition is no longer one that bends.
        """
        for x, of in ((a, b), (b, a)):
            if id(of.array) in self._taken:
                which, no, yes, _, number = self._taken[id(of.array)]
                if _is_same(x, yes) or _is_same(x, no):
                    self.conditions[number] = self.conditions[number]._replace(bends=False)
                    if self.branch is not None:
                        return which > 0.5 if _is_same(x, yes) else which <= 0.5
        return None

    def _as_it_stands(self, eqn, args: list[Value], on: int) -> list[Value]:
        if _is_callback(eqn):
            # It counts as depending on the state, so that it is not evaluated ahead of the motion.
            self.unread.add("a call of Python")
            on |= BY_STATE
        elif _is_unread(eqn) and on & _MOVES:
            self.unread.add(eqn.primitive.name)
        if on & OF_STATE:
            for x in args:
                self._meets_state(x)
        if self.time_only and on & OF_STATE:
            return [Value(None, on, math.inf) for _ in eqn.outvars]
        if eqn.primitive.name == "mul" and any(map(_is_zero, args)):
            on = 0  # as in code that makes a zero with the type and shape of another number
        on |= self._note_domain(eqn, args, on)
        waves = self.waves and eqn.primitive.name in _WAVES
        degree = _degree(eqn.primitive.name, eqn.params, args) if on & BY_TIME else 0.0
        degree = math.inf if on & BY_TIME and waves else degree
        made = [Value(x, on, degree) for x in bind(eqn, [x.array for x in args])]
        if eqn.primitive.name in _BRIEF and args[0].on & BY_TIME and args[0].on & BY_STATE:
            self.mixed += [args[0], *made]
        if self.time_only and on & BY_TIME:
            self._origins |= {id(x.array): (x, eqn.primitive.name, args) for x in made}
        return made

    def _note_domain(self, eqn, args: list[Value], on: int) -> int:
        """`_NOT_EVERYWHERE` for a function that is not defined for all states, else 0.

        If its argument, or its use, depends on a condition, it may be NaN in a branch beyond the
        surface, and the program is `partial`. A spring's length is a root as well, but depends on
        no condition.
        """
        if eqn.primitive.name in _CHOICES:
            self.partial |= bool(on & _NOT_EVERYWHERE and on & _JUMPS)
        if eqn.primitive.name not in _PARTIAL or not args[0].on & BY_STATE:
            return 0
        self.partial |= bool(args[0].on & _JUMPS)
        return _NOT_EVERYWHERE

    def _meets_state(self, x: Value) -> None:
        """Note the terms of a value of time alone that an operation on the state uses."""
        if not x.on & BY_TIME or x.on & OF_STATE or x.degree <= _TRIVIAL_DEGREE:
            return
        _, name, args = self._origins.get(id(x.array), (x, "", []))
        scaled = name in _SCALES and sum(bool(part.on & BY_TIME) for part in args) == 1
        if name in _TERM_BY_TERM or (scaled and not (name == "div" and args[1].on & BY_TIME)):
            for part in args:
                self._meets_state(part)
        elif not any(x.array is leaf.array for leaf in self.leaves):
            self.leaves.append(x)

    def condition(
        self,
        args: list[Value],
        judge: Callable,
        shape: tuple[int, ...] | None = None,
        bends: bool = False,
    ) -> tuple[Any, int]:
        """The outcome of a condition in the branch, and what it depends on.

        Args:
          args: its arguments.
          judge: a function of the outcome in the branch, or of None for the one at the point; it
            returns the outcome at the point, the margin of the one in the branch, and the outcome
            beyond the nearest change.
          shape: shape of the outcomes; by default that to which the arguments are broadcast.
          bends: see `Condition`.
        Returns:
          The outcome, and what it depends on. The outcome is None if it depends on the state while
          only what depends on time is computed.
        """
        moves = _dependence(*args)
        on = moves | ((moves & _MOVES) << 2)
        jumps = on & (JUMPS_IN_TIME | JUMPS_WITH_STATE)
        if self.time_only and on & OF_STATE:
            for x in args:
                self._meets_state(x)
            return None, jumps
        if shape is None:
            shape = np.broadcast_shapes(*(np.shape(x.array) for x in args))
        size, given = math.prod(shape), None
        if self.branch is not None:
            first = sum(c.size for c in self.conditions)
            given = self.branch[first : first + size].reshape(shape)
        left_out = self.state_only and not on & OF_STATE
        here, margin, beyond = (given, 1.0, given) if left_out else judge(given)
        self.conditions.append(Condition(on, size, bends or self._continuous))
        flat = lambda x: jnp.broadcast_to(x, shape).astype(float).ravel()  # noqa: E731
        self._found.append((flat(here), flat(margin), flat(beyond)))
        return (jnp.broadcast_to(here, shape).astype(float) if given is None else given), jumps

    def holds(
        self, a: Value, b: Value, strict: bool = True, bends: bool = False
    ) -> tuple[Any, int]:
        """Whether a < b in the branch, or a <= b, as 0 or 1."""

        def judge(given):
            here = (a.array < b.array if strict else a.array <= b.array).astype(float)
            held = here if given is None else given
            return here, (2.0 * held - 1.0) * (b.array - a.array), 1.0 - held

        return self.condition([a, b], judge, bends=bends)

    def _table(self, knots: Value, x: Value) -> Value:
        places, n = jnp.asarray(knots.array), np.shape(knots.array)[0]

        def judge(given):
            here = jnp.searchsorted(places, x.array)
            held = here if given is None else given.astype(int)
            below = jnp.where(held > 0, places[jnp.clip(held - 1, 0, n - 1)], -jnp.inf)
            above = jnp.where(held < n, places[jnp.clip(held, 0, n - 1)], jnp.inf)
            low, high = x.array - below, above - x.array
            step = jnp.where(low < high, -1, 1)
            return here.astype(float), jnp.minimum(low, high), (held + step).astype(float)

        found, on = self.condition([x], judge)
        kind = jnp.searchsorted(jnp.zeros(1), 0.0).dtype
        return Value(None if found is None else found.astype(kind), on)

    def _choose(self, branches, args: list[Value]) -> list[Value]:
        """The result of a choice, all of whose cases are run so that their conditions are read."""
        which, rest = args[0], args[1:]
        every = [self.program(branch, rest) for branch in branches]
        if which.array is None:
            return [Value(None, which.on | x.on, math.inf) for x in every[0]]
        found = []
        for cases in zip(*every, strict=True):
            on = _dependence(which, *cases)
            self.partial |= bool(on & _NOT_EVERYWHERE)
            if any(x.array is None for x in cases):
                found.append(Value(None, on, math.inf))
                continue
            pick = jnp.clip(jnp.asarray(which.array).astype(int), 0, len(cases) - 1)
            arrays = [jnp.asarray(x.array) for x in cases]
            value = arrays[0]
            for i, other in enumerate(arrays[1:], 1):
                value = jnp.where(pick == i, other, value)
            found.append(Value(value, on, math.inf if on & BY_TIME else 0.0))
        return found

    def _unroll(self, eqn, known: Loop, args: list[Value]) -> list[Value]:
        """A loop of known length, round by round."""
        body, length, n, m = known.body, known.length, known.consts, known.carry
        consts, carry, rows = args[:n], args[n : n + m], args[n + m :]
        if not length:
            nothing = (jnp.zeros(var.aval.shape, var.aval.dtype) for var in eqn.outvars[m:])
            return [*carry, *(Value(x) for x in nothing)]
        collected: list[list[Value]] = []
        for i in range(length):
            place = length - 1 - i if known.reverse else i
            row = [x.map(operator.itemgetter(place)) for x in rows]
            found = self.program(body, [*consts, *carry, *row])
            carry = found[:m]
            collected.append(found[m:])
        if known.reverse:
            collected.reverse()
        outs = []
        for column, var in zip(zip(*collected, strict=True), eqn.outvars[m:], strict=True):
            on = _dependence(*column)
            missing = any(x.array is None for x in column)
            shape = var.aval.shape
            array = None if missing else jnp.stack([jnp.asarray(x.array) for x in column])
            assert array is None or array.shape == shape
            outs.append(Value(array, on, math.inf if on & BY_TIME else 0.0))
        return [*carry, *outs]


#: Degree up to which a polynomial in time and in sines of time hides nothing from a step.
_TRIVIAL_DEGREE = 3.0
_WAVES = frozenset({"sin", "cos"})
#: Functions that are flat, to all digits, for most arguments.
_BRIEF = frozenset({"exp", "exp2", "tanh", "logistic", "erf", "erfc"})
#: Functions that are not defined for all numbers.
_PARTIAL = frozenset({"pow", "sqrt", "rsqrt", "log", "log1p", "asin", "acos", "acosh", "atanh"})
#: Operations that take one of several values.
_CHOICES = frozenset({"select_n", "gather", "dynamic_slice"})
#: Operations whose operands are evaluated one by one, to detect a small pulse beside a large force.
_TERM_BY_TERM = frozenset(
    {"add", "sub", "neg", "add_any", "stack", "concatenate", "broadcast_in_dim", "reshape"}
) | {"squeeze", "convert_element_type", "copy", "slice", "reduce_sum"}
#: Likewise operations in which only one operand varies, such as a force divided by a mass.
_SCALES = frozenset({"mul", "div", "dot_general"})


def _degree(name: str, params, args: list[Value]) -> float:
    """Degree of a result that is a polynomial in time and in sines of time; else infinity."""
    degrees = [x.degree for x in args]
    if name in _TERM_BY_TERM or name in ("transpose", "rev", "pad", "select_n"):
        return max(degrees)
    if name in ("mul", "dot_general"):
        return sum(degrees)
    if name == "div" and degrees[1] == 0:
        return degrees[0]
    if name == "integer_pow" and params["y"] > 0:
        return degrees[0] * params["y"]
    if name == "square":
        return degrees[0] * 2
    if name in _WAVES and degrees[0] <= 1:
        return 1.0  # it varies everywhere: its samples show a method how long a step may be
    return math.inf


@functools.lru_cache(maxsize=1024)
def _switches(jaxpr) -> bool:
    for eqn in jaxpr.eqns:
        if eqn.primitive.name in _RULES and _is_condition(eqn):
            return True
        if _is_unread(eqn):
            return True
        for value in eqn.params.values():
            for inner in value if isinstance(value, tuple | list) else (value,):
                inner = getattr(inner, "jaxpr", inner)
                if hasattr(inner, "eqns") and _switches(inner):
                    return True
    return False


def _is_zero(x: Value) -> bool:
    known = not x.on and not isinstance(x.array, jax.core.Tracer | jax.Array)
    return known and not np.any(x.array)


def _is_condition(eqn) -> bool:
    """Whether an operation that may be a condition is one for the types of its operands."""
    of = eqn.invars[1 if eqn.primitive.name == "clamp" else 0].aval.dtype
    if eqn.primitive.name == "sort" and not _is_readable(eqn):
        return False
    if eqn.primitive.name == "convert_element_type":
        wanted = eqn.params["new_dtype"]
        return jnp.issubdtype(of, jnp.floating) and jnp.issubdtype(wanted, jnp.integer)
    return jnp.issubdtype(of, jnp.floating)


def _is_callback(eqn) -> bool:
    return "callback" in eqn.primitive.name


def _is_unread(eqn) -> bool:
    """Whether an operation may be a condition that cannot be read."""
    if _is_callback(eqn):
        return True
    floats = bool(eqn.invars) and jnp.issubdtype(eqn.invars[0].aval.dtype, jnp.floating)
    return floats and eqn.primitive.name in _UNREAD


def _is_readable(eqn) -> bool:
    """Whether a sort is of few enough numbers, in one row."""
    shape = eqn.invars[0].aval.shape
    return len(shape) == 1 and shape[0] <= _LONGEST_ROW and eqn.params["num_keys"] == 1


def may_switch(*programs) -> bool:
    """Whether programs contain operations that may be conditions."""
    return any(_switches(getattr(p, "jaxpr", p)) for p in programs)


def _compare(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    name = eqn.primitive.name
    a, b = args if name[0] == "l" else args[::-1]
    bends = id(eqn) in evaluation.continuous
    found, on = evaluation.holds(a, b, strict=name[:2] in ("lt", "gt"), bends=bends)
    evaluation.note_comparison(a, b)
    return Value(None if found is None else found > 0.5, on)


def _select(which, no: Value, yes: Value, on: int, evaluation: BranchEvaluation) -> Value:
    """One of two values by an outcome of 0 or 1."""
    on = on | no.on | yes.on
    evaluation.partial |= bool(on & _NOT_EVERYWHERE)
    if which is None or no.array is None or yes.array is None:
        for x in (no, yes):
            evaluation._meets_state(x)
        return Value(None, on, math.inf)
    array = jnp.where(which > 0.5, yes.array, no.array)
    return Value(array, on, max(no.degree, yes.degree))


def _sign(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    (x,) = args
    found, on = evaluation.holds(Value(jnp.zeros_like(x.array) if x.array is not None else None), x)
    return Value(None if found is None else 2.0 * found - 1.0, on)


def _abs(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    (x,) = args
    zero = x._replace(degree=0.0).map(jnp.zeros_like)
    found, on = evaluation.holds(zero, x, bends=True)
    return _select(found, x.map(operator.neg), x, on, evaluation)


def _larger(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    a, b = args
    found, on = evaluation.holds(a, b, bends=True)
    ends = (a, b) if eqn.primitive.name == "max" else (b, a)
    larger = _select(found, *ends, on, evaluation)
    evaluation.note_choice(found, *ends, larger)
    return larger


def _is_same(a: Value, b: Value) -> bool:
    """Whether two values are the same value of a program, or equal known numbers."""
    if a.array is b.array:
        return True
    if a.on or b.on or any(isinstance(x.array, jax.core.Tracer) for x in (a, b)):
        return False
    return np.array_equal(np.asarray(a.array), np.asarray(b.array))


def _clamp(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    low, x, high = args
    below, on = evaluation.holds(x, low, bends=True)
    x = _select(below, x, low, on, evaluation)
    above, on = evaluation.holds(high, x, bends=True)
    return _select(above, x, high, on, evaluation)


def _whole(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    """The rule of ``floor``, ``ceil``, ``round`` and conversions to integers."""
    (x,), name = args, eqn.primitive.name
    rounds = {"floor": jnp.floor, "ceil": jnp.ceil, "round": jnp.round}
    rounded = rounds.get(name, jnp.trunc)

    def judge(given):
        here = rounded(x.array)
        n = here if given is None else given
        low, high = _region(name, n)
        left, right = x.array - low, high - x.array
        return here, jnp.minimum(left, right), n + jnp.where(left < right, -1.0, 1.0)

    found, on = evaluation.condition([x], judge)
    if found is not None and name == "convert_element_type":
        found = found.astype(eqn.params["new_dtype"])
    return Value(found, on)


def _region(name: str, n: Array) -> tuple[Array, Array]:
    """The numbers that are rounded to n."""
    if name == "floor":
        return n, n + 1.0
    if name == "ceil":
        return n - 1.0, n
    if name == "round":
        return n - 0.5, n + 0.5
    return jnp.where(n > 0, n, n - 1.0), jnp.where(n < 0, n, n + 1.0)


def _remainder(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    """x - n d, where n is the whole part of x / d."""
    x, d = args

    def judge(given):
        here = jnp.trunc(x.array / d.array)
        n = here if given is None else given
        low, high = _region("trunc", n)
        left, right = x.array / d.array - low, high - x.array / d.array
        return here, jnp.minimum(left, right), n + jnp.where(left < right, -1.0, 1.0)

    found, on = evaluation.condition([x, d], judge)
    on = on | x.on | d.on
    if found is None:
        return Value(None, on, math.inf)
    return Value(x.array - found * d.array, on, x.degree if not d.on else math.inf)


def _extreme(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    """The largest or smallest of the numbers along some axes, or its place."""
    (x,), name = args, eqn.primitive.name
    axes, shape = tuple(eqn.params["axes"]), eqn.outvars[0].aval.shape
    last = tuple(range(-len(axes), 0))
    rows = None
    if x.array is not None:
        n = math.prod(np.shape(x.array)[a] for a in axes)
        rows = jnp.moveaxis(jnp.asarray(x.array), axes, last).reshape(*shape, n)

    def judge(given):
        assert rows is not None  # what has no value has no outcome
        signed = rows if name.endswith("max") else -rows
        here = jnp.argmax(signed, -1)
        held = here if given is None else given.astype(int)
        own = jax.nn.one_hot(held, n, dtype=bool)
        others = jnp.where(own, -jnp.inf, signed)
        margin = _entry(signed, held) - jnp.max(others, -1)
        return here.astype(float), margin, jnp.argmax(others, -1).astype(float)

    found, on = evaluation.condition([x], judge, shape)
    evaluation.partial |= bool(x.on & _NOT_EVERYWHERE)
    if found is None:
        return Value(None, on | x.on, math.inf)
    if name.startswith("arg"):
        return Value(found.astype(eqn.outvars[0].aval.dtype), on)
    return Value(_entry(rows, found.astype(int)), on | x.on, x.degree)


def _entry(rows: Array, which: Array) -> Array:
    return jnp.take_along_axis(rows, which[..., None], -1)[..., 0]


def _sort(evaluation: BranchEvaluation, eqn, args: list[Value]) -> list[Value]:
    """Numbers in ascending order, and others with them, by comparisons of all pairs."""
    keys, n = args[0], eqn.invars[0].aval.shape[0]
    i, j = np.triu_indices(n, 1)
    first, second = (keys.map(operator.itemgetter(k)) for k in (i, j))
    found, on = evaluation.holds(second, first, bends=len(args) == 1)
    on |= _dependence(*args)
    if found is None or any(x.array is None for x in args):
        return [Value(None, on, math.inf) for _ in args]
    place = jnp.zeros(n).at[i].add(found).at[j].add(1.0 - found)
    there = place[None] == jnp.arange(n, dtype=place.dtype)[:, None]
    return [
        x._replace(array=jnp.sum(jnp.where(there, jnp.asarray(x.array)[None], 0), 1), on=on)
        for x in args
    ]


_RULES: dict[str, Callable[[BranchEvaluation, Any, list[Value]], Value | list[Value]]] = {
    **dict.fromkeys(_COMPARISONS, _compare),
    **{"sign": _sign, "abs": _abs, "max": _larger, "min": _larger, "clamp": _clamp},
    **dict.fromkeys(("floor", "ceil", "round", "convert_element_type"), _whole),
    "rem": _remainder,
    **dict.fromkeys(("reduce_max", "reduce_min", "argmax", "argmin"), _extreme),
    "sort": _sort,
}
