"""The interface of solvers: a name, an order, and a pure function of a state to its increment.

`Method.advance` is all that a solver has to define. Steps, samples and event times are built on it
elsewhere, so a new solver is one new file here.
"""

import abc
import dataclasses
import functools
import math
from collections.abc import Callable
from typing import ClassVar, NamedTuple, NoReturn, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import two_sum
from jaxdyn._programs import size

#: A rate (t, y) -> dy/dt.
Rate = Callable[[Array, Array], Array]

#: Slopes that differ relatively by less are equal up to rounding.
_ROUNDING = 1e-13
#: Part of the step that would just meet the tolerance. At exponents of 9 to 11 even 0.75 aims at
#: no more than a tenth of the error; with 0.9, which is usual at order 5, 10 to 30 % of the steps
#: are rejected and it takes 10 to 20 % more evaluations at equal true error (measured).
STEP_SAFETY = 0.75
_KINDS = 256  # number of kinds of systems for which a result is cached


class Advance(NamedTuple):
    """The result of one step.

    Attributes:
      increment: (k, ...) change of the state.
      error: (k, ...) estimate of its error; zero for a method of fixed step.
      rest: (k, ...) correction for the rounding of the coefficients: too small to be added to
        the increment, but the compensated sum over many steps retains it.
      speed: () |h lambda| of the fastest part of the motion; zero where the method does not
        estimate it.
      converged: () whether implicit equations were solved.
      part: () how much of the step was taken, at most 1.
      reach: () how long the step might have been, in parts of the proposed one, where the method
        knows.
      square: () square of the size of the error in tolerances, where the method measures it;
        `error` is then only its direction.
    """

    increment: Array
    error: Array
    rest: Array | float = 0.0
    speed: Array | float = 0.0
    converged: Array | bool = True
    part: Array | float = 1.0
    reach: Array | None = None
    square: Array | None = None

    def onto(self, y: Array, carry: Array) -> tuple[Array, Array]:
        """The state after the step, and the rounding error of that sum.

        `carry` contains the error of the step before, so that the rounding error of N steps grows
        like that of one, not like sqrt(N) to N. Over 1.7e6 steps of a linear oscillator by
        `VERNER9` at rtol 1e-16 the energy is off by 2e-14, and without `rest` by 6e-13; where the
        tolerance decides, as over 1e6 steps of the figure-eight, `rest` makes no difference.

        Args:
          y: (k, ...) state before the step.
          carry: (k, ...) rounding error of y; zero at the start.
        """
        return two_sum(y, carry + self.rest, self.increment)


class Method(abc.ABC):
    """A one-step method.

    Methods are compared and hashed by identity, and so are cheap static arguments of jit.

    Attributes:
      name: its name in reports.
      order: order of the solution that is propagated.
      error_order: exponent p of the error estimate's h^p.
      position_only: whether it requires a state [q, v] and velocity-independent forces.
      stable: |h lambda| up to which an explicit method is stable; infinite for others.
      adaptive: whether it estimates its error, and so takes a tolerance, not a step.
    """

    name: str
    order: int
    error_order: int
    position_only: bool
    stable: float
    adaptive: bool
    #: A step is limited by stability, not by accuracy, if it is longer than this part of the
    #: stable one; where accuracy limits steps, they stay shorter, even at rtol 1e-3 (tested).
    alarm: ClassVar[float] = 0.7
    #: Whether `advance` only evaluates the rate, and so may be given one by `simplify`.
    evaluates: ClassVar[bool] = False
    #: Whether `advance` can take several steps side by side, h (1, s) of states y (k, s). Methods
    #: whose iterations end independently of each other cannot.
    several: ClassVar[bool] = True

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, order={self.order})"

    @property
    def evaluations(self) -> float:
        """Right-hand sides per step; NaN where that varies or is unknown."""
        return math.nan

    @property
    def damps(self) -> bool:
        """Whether it damps fast vibrations, and so the effect of rounding on a stiff motion."""
        return False

    @property
    def for_tangents(self) -> "Method":
        """The method for variational equations."""
        return self

    def in_loops(self, n: int) -> "Method":
        """The same method as a smaller program, with its stages in at most n successive loops.

        A method with only one form, such as an iterative one, returns itself. Equal calls return
        the same object, so that nothing compiles twice. Tables of many stages run faster in two
        loops than in one.
        """
        del n
        return self

    @property
    def term_structure(self) -> NoReturn:
        """The first attribute that diffrax reads; raises a ValueError that names `to_diffrax`."""
        remedy = "Pass jaxdyn.solvers.to_diffrax(solver)."
        raise _checks.fail("solver", "a solver of diffrax", f"{self.name} of jaxdyn", remedy)

    @abc.abstractmethod
    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        """Increment of y over [t, t + h], with its error estimate.

        Args:
          field: (t, y) -> dy/dt.
          t: () start.
          h: () step, of either sign.
          y: (k, ...) state; [q, v] along the first axis where `position_only`.
        """

    def advance_within(
        self, field: Rate, t: Array, h: Array, y: Array, tolerance: tuple[Array, Array]
    ) -> Advance:
        """The same as `advance`, over a part of the step if the whole is known to be too long.

        Args:
          field: (t, y) -> dy/dt.
          t: () start.
          h: () step, of either sign.
          y: (k, ...) state.
          tolerance: () relative and (k, ...) absolute tolerance of one step.
        """
        del tolerance
        return self.advance(field, t, h, y)


M = TypeVar("M", bound=Method)


@functools.cache
def in_loops(method: M, n: int) -> M:
    """The same method with n loops; the method is a dataclass with the field `loops`."""
    return dataclasses.replace(method, loops=n)


def fastest_rate(k: Array, shift: Array, whole: Array) -> Array:
    """() |difference of two slopes| / |difference of their arguments|, per step.

    Differences below rounding are not significant and count as small.
    """
    noise = _ROUNDING * jnp.max(jnp.abs(whole))
    return jnp.max(jnp.abs(k)) / (jnp.max(jnp.abs(shift)) + noise)


def stability_limit(growth: Callable[[float], float]) -> float:
    """The z up to which a method is stable; `growth` is its factor for a test equation."""
    for z in np.arange(0.05, 30.0, 0.05):
        if growth(z) > 1 + 1e-3:
            break
    return float(z)


def _kind(x) -> tuple:
    """Shape and type of a number or numbers."""
    x = x if isinstance(x, jax.Array) else jax.typeof(x)  # `typeof` takes 2 us
    return x.shape, x.dtype


def trace_once(examine: Callable) -> Callable:
    """The result of examine(rate, t, y), found once for each kind of system, whatever its numbers.

    Returns:
      A function, host only, of a system with ``rate(t, y)``, which is a pytree of its numbers, of
      the length of a state, and of what else `examine` takes.
    """

    @functools.lru_cache(maxsize=_KINDS)
    def found(tree, kinds: tuple, k: int, more: tuple, in_64_bits: bool):
        del in_64_bits  # part of the cache's key only
        answers, kind = [], jnp.result_type(float)

        def answer(leaves, t, y):
            answers.append(examine(jax.tree.unflatten(tree, leaves).rate, t, y, *more))

        shapes = [jax.ShapeDtypeStruct(*kind) for kind in (*kinds, ((), kind), ((k,), kind))]
        jax.eval_shape(answer, shapes[:-2], *shapes[-2:])
        return answers[0]

    def of(system, k: int, *more):
        leaves, tree = jax.tree.flatten(system)
        return found(tree, tuple(map(_kind, leaves)), k, more, jax.config.jax_enable_x64)

    return of


def operations(rate: Callable, t0: Array, y0: Array) -> int:
    """Number of operations of one rate evaluation."""
    return size(jax.make_jaxpr(rate)(t0, y0).jaxpr)
