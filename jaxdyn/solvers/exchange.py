"""Exchange with diffrax: its Runge-Kutta solvers as methods, methods as its solvers.

`from_diffrax` takes the table of an explicit solver; an implicit solver takes its own steps, within
the same loop and step control as all methods. `to_diffrax` makes a solver of any method. The dense
output of such a solver is the Hermite polynomial through states and slopes within the step, as many
as its order needs; each of these states is one step of the method from the left end.
"""

import dataclasses
import functools
from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jaxtyping import Array, Float

from jaxdyn import _checks
from jaxdyn.solvers.method import Advance, Method, Rate
from jaxdyn.solvers.pairs import EULER, Pair

Rows = tuple[tuple[float, ...], ...]


def from_diffrax(solver: diffrax.AbstractSolver) -> Method:
    """The method of a Runge-Kutta solver of diffrax, e.g. ``diffrax.Tsit5()``.

    Equal solvers give the same method, so compiled programs are reused. Functions with an argument
    ``solver`` call this themselves.

    Args:
      solver: an instance, for ODEs. Of an explicit solver only the table is used. An implicit one,
        such as ``diffrax.Kvaerno5()``, takes its own steps; its root finder has the tolerances of
        a step unless it has its own. Dense output and the reuse of the last stage are not used.
    Raises:
      ValueError: `solver` is not an instance, is for stochastic equations, is for rates in two
        parts as ``diffrax.KenCarp4()`` is, or carries more than a state from step to step, as
        multistep methods do.
    Limits: implicit solvers solve linear systems by LAPACK in each step: `RADAU9` is many times
      faster for small stiff scenes. Besides step control, such a solver may reject a step itself,
      as when its iteration does not converge.
    Example:
      >>> import diffrax
      >>> from_diffrax(diffrax.Tsit5()) is from_diffrax(diffrax.Tsit5())
      True
      >>> import jax.numpy as jnp, jaxdyn
      >>> fast = jaxdyn.ode(lambda t, y: -1e6 * (y - jnp.cos(t)), [1.0], 1.0)
      >>> run = jaxdyn.simulate(fast, solver=diffrax.Kvaerno5())
      >>> bool(abs(run.ys[-1, 0] - np.cos(1.0)) < 1e-5)  # lags by 1e-6
      True
    """
    table = getattr(solver, "tableau", None)
    if type(solver) is diffrax.Euler:  # the only explicit solver of diffrax without a table
        return EULER
    reason, remedy = _why_unsuitable(solver, table)
    if reason:
        got = solver if isinstance(solver, type) else type(solver)
        name = f"{getattr(got, '__name__', got)}, {reason}"
        raise _checks.fail("solver", "a Runge-Kutta solver of diffrax", name, remedy)
    if not _is_explicit(solver, table):
        return _diffrax_method(solver)
    assert table is not None
    # The solver itself is not passed on: with arrays among its fields it has no hash.
    numbers = table.c, table.b_sol, table.b_error, *table.a_lower
    rows = tuple(tuple(np.asarray(x, float).tolist()) for x in numbers)
    return _pair(type(solver).__name__, solver.order(diffrax.ODETerm(_nothing)), rows)


@functools.cache
def _pair(name: str, order: int, rows: Rows) -> Pair:
    """The pair of a table: nodes, weights, error weights, and the rows of a below the diagonal."""
    c, b_sol, b_error, *lower = rows
    a = np.zeros((len(b_sol), len(b_sol)))
    for i, row in enumerate(lower):
        a[i + 1, : len(row)] = row
    weights = np.array([b_sol, b_error])[:, None, :]
    return Pair(
        name=name,
        order=order,
        error_order=order,
        c=np.array([0.0, *c]),
        a=a,
        weights=weights,
        position_only=False,
    )


def _nothing(t, y, args):
    del t, args
    return 0.0 * y


def _why_unsuitable(solver, table) -> tuple[str, str]:
    """Why a solver takes no steps of an ODE, and what to take instead; empty where it does."""
    if not isinstance(solver, diffrax.AbstractSolver):
        return "which is not a solver", "Pass an instance, such as diffrax.Tsit5()."
    if isinstance(table, diffrax.MultiButcherTableau):
        # With all of the rate in the implicit part its iteration mostly fails, also in diffrax.
        reason = "which is for a rate in two parts, one of them explicit"
        return reason, "diffrax.Kvaerno5() takes the whole rate, as does RADAU9."
    known = isinstance(table, diffrax.ButcherTableau) or type(solver) is diffrax.ImplicitEuler
    if not known or solver.order(None) is None:
        return "which has no Butcher tableau of an ODE", "Use one of jaxdyn.solvers."
    return "", ""


def _is_explicit(solver, table) -> bool:
    """Whether one strictly lower triangular table describes a solver completely."""
    return table is not None and not (
        isinstance(solver, diffrax.AbstractImplicitSolver) or table.implicit
    )


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class DiffraxMethod(Method):
    """A solver of diffrax that takes its own steps; only the state passes from one to the next.

    Attributes:
      solver: the solver.
      name: the name of its class.
      order: its order.
      error_order: the order of its error estimate.
    """

    solver: diffrax.AbstractSolver
    name: str
    order: int
    error_order: int
    adaptive: ClassVar[bool] = True
    position_only: ClassVar[bool] = False
    stable: ClassVar[float] = np.inf
    several: ClassVar[bool] = False

    @property
    def damps(self) -> bool:
        """Implicit solvers of diffrax are for stiff equations."""
        return isinstance(self.solver, diffrax.AbstractImplicitSolver)

    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        """A step whose iterations continue to the rounding level."""
        eps = jnp.finfo(y.dtype).eps
        return self.advance_within(field, t, h, y, (jnp.asarray(eps), jnp.asarray(eps)))

    def advance_within(
        self, field: Rate, t: Array, h: Array, y: Array, tolerance: tuple[Array, Array]
    ) -> Advance:
        # Times count from the start of the step, or else its length would be rounded.
        term: Any = diffrax.ODETerm(lambda after, y, args: field(t + after, y))
        solver = _with_tolerances(self.solver, *tolerance)
        begin = jnp.zeros_like(t)
        state = solver.init(term, begin, h, y, None)
        y1, error, _, _, result = solver.step(term, begin, h, y, None, state, made_jump=False)
        # Where an iteration has failed, the step is too long.
        solved = result == diffrax.RESULTS.successful
        return Advance(y1 - y, jnp.where(solved, jnp.abs(error), jnp.inf))


def _with_tolerances(solver, rtol: Array, atol: Array):
    """The solver, with these tolerances in its root finder unless that has its own."""
    finder = getattr(solver, "root_finder", None)
    if finder is None or isinstance(getattr(finder, "rtol", 0.0), float | Array):
        return solver

    def open_to(solver):
        return solver.root_finder.rtol, solver.root_finder.atol, solver.root_finder.norm

    return eqx.tree_at(open_to, solver, (rtol, atol, optimistix.rms_norm))


def _diffrax_method(solver) -> DiffraxMethod:
    try:
        hash(solver)
    except TypeError:  # with arrays among its fields it has no hash, and is not looked up
        return _make_diffrax_method.__wrapped__(solver)
    return _make_diffrax_method(solver)


@functools.cache
def _make_diffrax_method(solver) -> DiffraxMethod:
    term = diffrax.ODETerm(_nothing)
    if getattr(solver, "scan_kind", "") is None:  # its default kind of loop has no forward mode
        loops = eqx.tree_at(lambda s: s.scan_kind, solver, "lax", is_leaf=lambda x: x is None)
    else:
        loops = solver
    orders = int(solver.order(term)), int(solver.error_order(term))
    return DiffraxMethod(loops, type(solver).__name__, *orders)


class HermiteStep(diffrax.AbstractLocalInterpolation):
    """The polynomial through states and slopes at nodes of a step.

    Attributes:
      t0: () beginning of the step.
      t1: () end of the step.
      y0: (k,) state at its beginning.
      increments: (m, k) differences of the states at the m nodes from y0.
      slopes: (m, k) slopes there, times the step.
    """

    t0: Array
    t1: Array
    y0: Array
    increments: Float[Array, "m k"]
    slopes: Float[Array, "m k"]

    def evaluate(self, t0, t1=None, left=True) -> Array:
        """(k,) state at t0, or its change from t0 to t1."""
        del left
        if t1 is not None:
            return self.evaluate(t1) - self.evaluate(t0)
        at = (t0 - self.t0) / (self.t1 - self.t0)
        nodes = _nodes(len(self.slopes))
        # Products, not powers of the time: coefficients of powers lose six digits at order 12.
        away = at - jnp.asarray(nodes)
        others = [np.delete(np.arange(len(nodes)), j) for j in range(len(nodes))]
        base = [jnp.prod(away[i] / (nodes[j] - nodes[i])) for j, i in enumerate(others)]
        tilt = [np.sum(1 / (nodes[j] - nodes[i])) for j, i in enumerate(others)]
        square = jnp.stack(base) ** 2
        values = (1 - 2 * away * np.array(tilt)) * square
        return self.y0 + values @ self.increments + (away * square) @ self.slopes


@functools.cache
def _nodes(m: int) -> np.ndarray:
    """(m,) nodes of a step, from 0 to 1, denser at its ends to avoid oscillations."""
    return 0.5 - 0.5 * np.cos(np.pi * np.arange(m) / (m - 1))


class _MethodSolver(diffrax.AbstractSolver):
    """A method as a solver of diffrax; its state is the rounding error of the last sum."""

    method: Method = eqx.field(static=True)
    term_structure: ClassVar = diffrax.ODETerm
    interpolation_cls: ClassVar = HermiteStep

    def order(self, terms):
        del terms
        return self.method.order

    def error_order(self, terms):
        del terms
        return self.method.error_order

    def init(self, terms, t0, t1, y0, args):
        del t1
        kind = jnp.result_type(float)
        if not isinstance(y0, Array | np.ndarray) or y0.ndim != 1 or y0.dtype != kind:
            got = getattr(y0, "aval", type(y0).__name__)
            raise _checks.fail("y0", f"one array (k,) of {kind}", got, "Join its parts.")
        if not self.method.position_only:
            return jnp.zeros_like(y0)
        half, odd = divmod(y0.size, 2)
        if odd:
            raise _checks.fail("y0", "[q, v] of equal lengths", f"{y0.size} entries")
        blind = terms.vf(t0, y0.at[half:].set(jnp.nan), args)[half:]
        rate = terms.vf(t0, y0, args)
        fits = (rate[:half] == y0[half:]).all() & jnp.array_equal(rate[half:], blind)
        remedy = "It requires dq/dt = v and dv/dt free of v; solvers.VERNER9 requires neither."
        message = str(_checks.fail("solver", "one for any rate", self.method.name, remedy))
        return eqx.error_if(jnp.zeros_like(y0), ~fits, message)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del made_jump
        # Backwards in time diffrax increases t and negates the control: h < 0.
        h = terms.contr(t0, t1)
        sign = jnp.where(h < 0, -1.0, 1.0)
        method, start = self.method.in_loops(1), sign * t0

        def field(t, y):
            return terms.vf(sign * t, y, args)

        found = method.advance(field, start, h, y0)
        y1, carry = found.onto(y0, solver_state)

        def within(part):
            increment = method.advance(field, start, part * h, y0).increment
            return increment, h * field(start + part * h, y0 + increment)

        # XLA does not compute these where no output between steps is requested.
        ends = jnp.zeros_like(y0), y1 - y0
        begin, end = h * field(start, y0), h * field(start + h, y1)
        nodes = _nodes(max(2, (self.method.order + 2) // 2))
        increments, slopes = jax.lax.map(within, jnp.asarray(nodes[1:-1]))
        dense = {
            "y0": y0,
            "increments": jnp.concatenate([ends[0][None], increments, ends[1][None]]),
            "slopes": jnp.concatenate([begin[None], slopes, end[None]]),
        }
        result = diffrax.RESULTS.where(
            jnp.asarray(found.converged),
            diffrax.RESULTS.successful,
            diffrax.RESULTS.nonlinear_divergence,
        )
        return y1, found.error if self.method.adaptive else None, dense, carry, result

    def func(self, terms, t0, y0, args) -> Any:
        return terms.vf(t0, y0, args)


def to_diffrax(method: Method) -> diffrax.AbstractSolver:
    """A method of `jaxdyn.solvers` as a solver for ``diffrax.diffeqsolve``.

    Sums are compensated; ``SaveAt(ts=...)`` and ``SaveAt(dense=True)`` are as accurate as the
    steps.

    Args:
      method: any method. One of fixed step takes ``diffrax.ConstantStepSize``; one that requires
        velocity-independent forces, such as `NYSTROM12`, requires a state [q, v] with dq/dt = v
        and dv/dt independent of v; the solve fails with a message if a test at its start shows
        otherwise.
    Raises:
      ValueError: `method` is not a method; in the solve, the state is not one array (k,) of
        floats, of 64 bits where they are enabled.
    Limits: dense output costs a few more steps within each step, half as many as the order of the
      method. Constraints of a scene hold only to the tolerance, since states are not projected
      onto them. Methods that iterate (`Gauss`, `Radau`) have no reverse mode.
    Example:
      >>> import diffrax
      >>> from jaxdyn.solvers import VERNER9
      >>> term = diffrax.ODETerm(lambda t, y, args: -y)
      >>> run = diffrax.diffeqsolve(
      ...     term, to_diffrax(VERNER9), 0.0, 1.0, 0.1, jnp.ones(1),
      ...     stepsize_controller=diffrax.PIDController(1e-12, 1e-12),
      ... )
      >>> bool(abs(run.ys[0, 0] - np.exp(-1)) < 1e-12)
      True
    """
    if not isinstance(method, Method):
        raise _checks.fail("method", "one of jaxdyn.solvers", repr(method))
    return _MethodSolver(method)


#: Prince and Dormand (1981), 13 stages, from diffrax: the second method for error estimates.
DOPRI8: Any = from_diffrax(diffrax.Dopri8())
