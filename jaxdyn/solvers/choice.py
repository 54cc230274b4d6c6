"""Which method a scene is solved with: the one asked for, checked, or the one that fits best."""

import diffrax

from jaxdyn import _checks
from jaxdyn.scene import Scene
from jaxdyn.solvers.exchange import from_diffrax
from jaxdyn.solvers.method import Method
from jaxdyn.solvers.pairs import NYSTROM12, VERNER9

#: What functions take as ``solver``.
Solver = Method | diffrax.AbstractSolver


def method_of(solver: Solver) -> Method:
    """The method that a `solver` argument stands for.

    Raises:
      ValueError: an implicit solver of diffrax, or no solver at all.
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
    """The method that a scene's effects call for."""
    return NYSTROM12 if scene.second_order else VERNER9


def chosen_method(scene: Scene, solver: Solver | None) -> Method:
    """The method asked for, if it fits the scene, or the default one.

    Raises:
      ValueError: a method for velocity-independent forces only, and a scene with others.
    """
    if solver is None:
        return default_solver(scene)
    method = method_of(solver)
    if method.position_only and not scene.second_order:
        raise _checks.fail(
            "solver",
            "one for forces that may depend on velocity",
            f"{method.name}, which requires velocity-independent forces",
            "Leave the solver out, or take solvers.GAUSS12 for a long run that keeps energy.",
        )
    return method


def checked_method(scene: Scene, solver: Solver | None, dt=None) -> Method:
    """`chosen_method`, where 64-bit floats are on and there is a step `dt` exactly if it needs one.

    Raises:
      ValueError: 32-bit floats, a step for an adaptive method, or none for one of fixed step.
    """
    _checks.float64()
    method = chosen_method(scene, solver)
    if method.adaptive and dt is not None:
        raise _checks.fail(
            "dt",
            f"none, since {method.name} chooses its steps by rtol",
            dt,
            "Leave it out, or take a solver of fixed step, such as solvers.KAHAN_LI8.",
        )
    if not method.adaptive and dt is None:
        raise _checks.fail(
            "dt",
            f"a step, since those of {method.name} are equal",
            "none",
            "Pass dt to simulate, say a hundredth of a period; events need an adaptive solver.",
        )
    return method
