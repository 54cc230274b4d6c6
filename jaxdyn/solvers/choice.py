"""The method for a scene: the requested one, checked, or the default."""

import diffrax

from jaxdyn import _checks
from jaxdyn.scene import Scene
from jaxdyn.solvers.exchange import from_diffrax
from jaxdyn.solvers.method import Method
from jaxdyn.solvers.pairs import NYSTROM12, VERNER9

#: Type of the argument ``solver``.
Solver = Method | diffrax.AbstractSolver


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


def default_solver(scene: Scene) -> Method:
    """The method that suits a scene's effects."""
    return NYSTROM12 if scene.second_order else VERNER9


def chosen_method(scene: Scene, solver: Solver | None) -> Method:
    """The requested method, if it suits the scene, or the default one.

    Raises:
      ValueError: `solver` requires velocity-independent forces, and the scene has others.
    """
    if solver is None:
        return default_solver(scene)
    method = method_of(solver)
    if method.position_only and not scene.second_order:
        raise _checks.fail(
            "solver",
            "one for forces that may depend on velocity",
            f"{method.name}, which requires velocity-independent forces",
            "Leave the solver out, or use solvers.GAUSS12 for a long run that conserves energy.",
        )
    return method


def checked_method(scene: Scene, solver: Solver | None, dt=None) -> Method:
    """`chosen_method`, with checks: 64-bit floats are on, and `dt` is given exactly if needed.

    Raises:
      ValueError: 64-bit floats are off, or `dt` is given to an adaptive method or missing.
    """
    _checks.float64()
    method = chosen_method(scene, solver)
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
