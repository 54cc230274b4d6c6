"""Solvers exchanged with diffrax: its explicit Runge-Kutta solvers as methods of ours."""

import functools

import diffrax
import numpy as np

from jaxdyn import _checks
from jaxdyn.solvers.pairs import EULER, Pair

Rows = tuple[tuple[float, ...], ...]


def from_diffrax(solver: diffrax.AbstractSolver) -> Pair:
    """The pair of an explicit Runge-Kutta solver of diffrax, e.g. ``diffrax.Tsit5()``.

    Equal solvers give the same pair, so a program compiled with it is found again. Functions that
    take a ``solver`` call this themselves.

    Args:
      solver: an instance. Only its table is taken: diffrax's interpolation and its reuse of the
        last stage have no part in it.
    Raises:
      ValueError: any other solver, since a `Pair` holds one strictly lower triangular table.
    Example:
      >>> import diffrax
      >>> from_diffrax(diffrax.Tsit5()) is from_diffrax(diffrax.Tsit5())
      True
    """
    table = getattr(solver, "tableau", None)
    if type(solver) is diffrax.Euler:  # the one explicit solver there that has no table
        return EULER
    reason, remedy = _unsuitable(solver, table)
    if reason:
        got = solver if isinstance(solver, type) else type(solver)
        name = f"{getattr(got, '__name__', got)}, {reason}"
        raise _checks.fail("solver", "an explicit Runge-Kutta solver of diffrax", name, remedy)
    # Not the solver itself: one with arrays among its fields has no hash.
    rows = tuple(_row(x) for x in (table.c, table.b_sol, table.b_error, *table.a_lower))
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


def _row(x: np.ndarray) -> tuple[float, ...]:
    return tuple(np.asarray(x, float).tolist())


def _nothing(t, y, args):
    del t, args
    return 0.0 * y


def _unsuitable(solver, table) -> tuple[str, str]:
    """Why a solver has no explicit table, and what to take instead; empty where it has one."""
    stiff = "Take solvers.RADAU9, which is implicit, for stiff scenes."
    if not isinstance(solver, diffrax.AbstractSolver):
        return "which is none", "Pass an instance, such as diffrax.Tsit5()."
    if isinstance(table, diffrax.MultiButcherTableau):
        return "which splits the rate into an explicit and an implicit part", stiff
    if isinstance(solver, diffrax.AbstractImplicitSolver) or getattr(table, "implicit", False):
        return "which is implicit", stiff
    if not isinstance(table, diffrax.ButcherTableau) or solver.order(None) is None:
        return "which has no Butcher tableau of an ODE", "Take one of jaxdyn.solvers."
    return "", ""


#: Prince and Dormand (1981), 13 stages, as diffrax has it: the second opinion on the others.
DOPRI8 = from_diffrax(diffrax.Dopri8())
