"""The method for a scene: the requested one, checked, or the default."""

import diffrax

from jaxdyn import _checks
from jaxdyn.scene import Scene
from jaxdyn.solvers.exchange import from_diffrax
from jaxdyn.solvers.method import Method
from jaxdyn.solvers.pairs import NYSTROM12, VERNER9
from jaxdyn.solvers.taylor.method import TAYLOR14, Taylor, series_of

#: Type of the argument ``solver``.
Solver = Method | diffrax.AbstractSolver

#: Operations of a rate, and products at each order of its Taylor series, up to which that is the
#: default.
_SHORT, _FEW = 60, 8

#: The default's series for velocity-independent forces: derivatives are by the Nystrom pair.
_TAYLOR14_NYSTROM12 = Taylor(14, tangents=NYSTROM12)


def method_of(solver: Solver) -> Method:
    """The method that a `solver` argument stands for.

    Raises:
      ValueError: `solver` is an implicit solver of diffrax, or not a solver.
    """
    if isinstance(solver, Method):
        return solver
    kind = solver if isinstance(solver, type) else type(solver)
    if issubclass(kind, diffrax.AbstractSolver):
        return from_diffrax(solver)
    raise _checks.fail(
        "solver", "one of jaxdyn.solvers, or an explicit solver of diffrax", repr(solver)
    )


def default_solver(scene: Scene, *, several: bool = False) -> Method:
    """The method that a scene is solved with if none is asked for.

    - Velocity-independent forces: `NYSTROM12`; but Taylor's series of order 14 for rates of at most
      60 operations and 15 numbers without quotients and roots, of at most 8 products an order. At
      true errors of 1e-6, 1e-9 and 1e-12 that takes 0.69, 0.55 and 0.62 of the time for Henon and
      Heiles's potential and 0.34, 0.27 and 0.29 for Toda's ring, and compiles as fast. Derivatives,
      events and ensembles take `NYSTROM12` there as well. At rtol 1e-12 its errors
      are four and six times larger there (1e-14 and 1e-12). Close encounters gain a tenth only
      (a Kepler orbit with e = 0.9), and lose up to two digits at the same tolerance.
    - Other rates of at most 60 operations and 15 numbers that have a Taylor series wherever they
      are finite, of at most 8 products an order: `TAYLOR14`. At true errors of 1e-6, 1e-9 and
      1e-12 it takes 0.7, 0.6 and 0.4 of the time of `VERNER9` (medians of Lorenz, Duffing, Chua,
      Lotka-Volterra, van der Pol, the spherical pendulum and a ball with drag; see ``python -m
      benchmarks default``), and 0.9 to 1.4 of the time to compile.
    - All others: `VERNER9`. Longer series run faster than it too (Arenstorf's orbit 0.8, a free
      body 0.2), but compile for up to three times as long.

    The tolerance has no part in it, since one method for all tolerances is one program. Order 14
    takes at most 1.13, 1.23 and 1.56 of the time of the best order at these errors (20 is best for
    Duffing's equation, and for Henon and Heiles's with 1.23 at 1e-9 and 1.47 at 1e-12).

    Args:
      scene: any.
      several: whether the method has to cross several steps side by side, as ensembles and the
        search for events ask of it. Taylor series cannot.
    """
    method, _ = _rule(scene)
    return method.for_tangents if several else method


def reason(scene: Scene) -> str:
    """Why `default_solver` takes what it takes."""
    return _rule(scene)[1]


def _rule(scene: Scene) -> tuple[Method, str]:
    """The default, and why."""
    pair = NYSTROM12 if scene.second_order else VERNER9
    kind = "forces do not depend on velocity, and " if scene.second_order else ""
    series = series_of(scene.field, scene.y0, longest=_SHORT)
    if series is None:
        return pair, f"{kind}its rate is long, or has no Taylor series"
    if not series.everywhere:
        return pair, f"{kind}its rate has a root, and no Taylor series where that is 0"
    if scene.second_order and not series.entire:
        return pair, f"{kind}its rate has quotients or roots"
    why = f"{kind}its Taylor series takes {series.products} products an order; up to {_FEW} are few"
    taylor = _TAYLOR14_NYSTROM12 if scene.second_order else TAYLOR14
    return (taylor if series.products <= _FEW else pair), why


def chosen_method(scene: Scene, solver: Solver | None, *, several: bool = False) -> Method:
    """The requested method, if it suits the scene, or that of `default_solver`.

    Raises:
      ValueError: `solver` requires velocity-independent forces, and the scene has others.
    """
    if solver is None:
        return default_solver(scene, several=several)
    method = method_of(solver)
    if method.position_only and not scene.second_order:
        raise _checks.fail(
            "solver",
            "one for forces that may depend on velocity",
            f"{method.name}, which requires velocity-independent forces",
            "Leave the solver out, or use solvers.GAUSS12 for a long run that conserves energy.",
        )
    return method


def checked_method(
    scene: Scene, solver: Solver | None, dt=None, *, several: bool = False
) -> Method:
    """`chosen_method`, with checks: 64-bit floats are on, and `dt` is given exactly if needed.

    Raises:
      ValueError: 64-bit floats are off, or `dt` is given to an adaptive method or missing.
    """
    _checks.float64()
    method = chosen_method(scene, solver, several=several)
    if method.adaptive and dt is not None:
        raise _checks.fail(
            "dt",
            f"none, since {method.name} chooses its steps by rtol",
            dt,
            "Leave it out, or use a solver of fixed step, such as solvers.KAHAN_LI8.",
        )
    if not method.adaptive and dt is None:
        raise _checks.fail(
            "dt",
            f"a step, since those of {method.name} are equal",
            "none",
            "Pass dt to simulate, say a hundredth of a period; events need an adaptive solver.",
        )
    return method
