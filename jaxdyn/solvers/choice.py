"""The method for a scene: the requested one, checked, or the default."""

import diffrax

from jaxdyn import _checks
from jaxdyn.scene import Scene
from jaxdyn.solvers.exchange import from_diffrax
from jaxdyn.solvers.method import Method
from jaxdyn.solvers.pairs import NYSTROM12, VERNER9
from jaxdyn.solvers.taylor.method import TAYLOR12, TAYLOR14, Series, Taylor, series_of

#: Type of the argument ``solver``.
Solver = Method | diffrax.AbstractSolver

#: Operations of a rate up to which its formulas are sought: a tenth of a second.
_LONGEST = 1000
#: Products at each order of a Taylor series up to which it takes order 14, and order 12.
_FEW, _MANY = 16, 24

#: The series for velocity-independent forces: derivatives are by the Nystrom pair.
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

    Where no force depends on velocity:

    - `Taylor` series of order 14 of rates without quotients and roots, of at most 15 numbers and
      16 products an order. For Henon and Heiles's potential and Toda's ring that takes 0.3 to 0.65
      of the time of `NYSTROM12`. Close encounters, which quotients make, would lose up to two
      digits at the same tolerance.
    - `NYSTROM12` else. `STOERMER14` takes 0.6 to 0.8 of its time at the same true error for a few
      bodies (three bodies 0.82, 0.77, 0.70 at 1e-6, 1e-9 and 1e-12; Kepler's orbit with e = 0.9
      0.72, 0.70, 0.80; Pleiades 0.64, 0.68, 0.64; outer planets 0.73, 0.62, 0.68), but at the same
      tolerance its errors are some ten times larger, and up to 800 times for Kepler's orbit at
      1e-12: one who asks for a tolerance by habit would lose digits.

    Where forces may depend on velocity, a Taylor series of rates of at most 15 numbers that have
    one wherever they are finite, by its products an order, since many of them cost more at a high
    order, to run and to compile:

    - up to 16: `TAYLOR14`, 0.25 to 1.0 of the time of `VERNER9` (Lorenz, Duffing, Chua,
      Lotka-Volterra, van der Pol, a ball with drag, the spherical pendulum, Arenstorf's orbit,
      three restricted bodies in space, the magnetic bottle 0.74, 0.55, 0.42);
    - up to 24: `TAYLOR12` (the double pendulum 0.38, 0.33, 0.26, the rigid body 0.44, 0.36, 0.32).
    - `VERNER9` for all others.

    Series compile in 0.7 to 1.5 of the time of the pair. Derivatives, events and ensembles take
    `NYSTROM12` or `VERNER9` in each case. ``python -m benchmarks default`` has all figures.

    The tolerance has no part in it, since one method for all tolerances is one program. Up to 4
    products order 16 is faster at 1e-12, by 1.2 to 1.5 for Lorenz, Duffing and Lotka-Volterra; but
    the estimates of `accuracy.end_error` at a loose tolerance, from runs at others, miss a chaotic
    motion's error with it.

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
    series = series_of(scene.field, scene.y0, longest=_LONGEST)
    if scene.second_order:
        return _for_positions(series)
    if series is None:
        return VERNER9, "its rate is long, or has no Taylor series"
    if not series.everywhere:
        return VERNER9, "its rate has a root, and no Taylor series where that is 0"
    n = series.products
    why = f"its Taylor series takes {n} products an order; "
    if n <= _FEW:
        return TAYLOR14, f"{why}up to {_FEW} are few"
    if n <= _MANY:
        return TAYLOR12, f"{why}so many, up to {_MANY}, run fastest at a low order"
    return VERNER9, f"{why}more than {_MANY} are too many"


def _for_positions(series: Series | None) -> tuple[Method, str]:
    """The default where no force depends on velocity, and why."""
    kind = "forces do not depend on velocity, and "
    if series is None:
        return NYSTROM12, f"{kind}its rate is long, or has no Taylor series"
    if not series.entire:
        return NYSTROM12, f"{kind}its rate has quotients or roots"
    why = f"its Taylor series takes {series.products} products an order; up to {_FEW} are few"
    return (_TAYLOR14_NYSTROM12 if series.products <= _FEW else NYSTROM12), f"{kind}{why}"


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
