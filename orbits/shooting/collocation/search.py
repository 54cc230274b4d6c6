"""A periodic orbit by collocation: Newton's method on one mesh after another."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from jaxdyn import System
from jaxdyn._checks import fail
from jaxdyn._text import number_of
from orbits.closing.given import Problem
from orbits.motion import quick_solve
from orbits.orbit import Orbit, Outcome
from orbits.shooting.collocation import newton
from orbits.shooting.collocation.mesh import (
    STEP_SHARE,
    STEPS_MOST,
    Mesh,
    first_guess,
    is_stiff,
    on,
    quality,
    refine,
)
from orbits.shooting.equations import Equations, InUnits
from orbits.shooting.newton import Result
from orbits.shooting.outcomes import Trouble, orbit_at, outcome_of
from orbits.shooting.strategy import Effort, Search, Strategy

_MESHES_MOST = 8
#: Tolerance at which stability limits the steps of stiff motions; a finer one would limit them
#: by accuracy.
_COARSE_RTOL = 1e-6


def suits(equations: Equations) -> bool:
    """Whether collocation can solve the equations: no states are projected onto constraints."""
    return type(equations.scene.system).project is System.project


@dataclasses.dataclass(frozen=True)
class Collocation(Strategy):
    """Gauss collocation on an adaptive mesh instead of integrations.

    It is meant for orbits that are stiff or very unstable. Unless something fixes the start, the
    orbit then starts where it is slow.

    Limits: not for scenes whose states are projected onto constraints, nor with `segments`.
    """

    def orbit(self, search: Search) -> Orbit:
        """The orbit near the guess, or the best iterate and the reason.

        Raises:
          ValueError: see the limits.
        """
        problem, equations, effort = search.problem, search.equations, search.effort
        if not suits(equations):
            remedy = "Leave it out: by shooting."
            raise fail("strategy", "one for a scene with projected constraints", self, remedy)
        if search.segments is not None:
            raise fail("segments", "none with collocation", search.segments)
        equations = dataclasses.replace(equations, stiff=is_stiff(equations, problem.guess))
        found = _search(problem, equations, effort)
        if found is None:  # the motion from the guess ends early
            x = equations.pack(problem.guess[:-1], (), 0.0, 0.0, problem.guess[-1])
            return orbit_at(
                equations,
                x,
                residual=math.nan,
                outcome=Outcome.COLLISION,
                iterations=0,
                rtol=effort.rtol,
            )
        last, result, error, trouble = found
        outcome = outcome_of(InUnits(last, result.x, effort.rtol), result, trouble)
        if outcome == Outcome.FOUND and error > effort.goal:
            outcome = Outcome.MESH_LIMIT
        return orbit_at(
            last,
            result.x,
            residual=max(float(np.abs(result.residual).max()), error),
            outcome=outcome,
            iterations=result.iterations,
            rtol=effort.rtol,
        )

    @staticmethod
    def may_help(search: Search, failed: Orbit) -> bool:
        """Whether collocation may find what shooting did not.

        It may where the motion from the guess is stiff, or integrations take too many steps.
        """
        if not suits(search.equations):
            return False
        return failed.outcome == Outcome.STEP_LIMIT or _stiff(search.problem, search.equations)


def _stiff(problem: Problem, equations: Equations) -> bool:
    """Whether stability, not accuracy, limits the steps along the guess."""
    scene, part = problem.scene, problem.guess[-1] / equations.closing.parts
    flow = quick_solve(scene, part, rtol=_COARSE_RTOL, max_steps=STEPS_MOST)
    return bool(flow.stiff)


class _Found(NamedTuple):
    """How a search ended.

    Attributes:
      equations: the equations on the last mesh.
      result: where Newton's method ended.
      error: the largest error of a step.
      trouble: the test that compares with the guess on the first mesh.
    """

    equations: Equations
    result: Result
    error: float
    trouble: Trouble


def _search(problem: Problem, equations: Equations, effort: Effort) -> _Found | None:
    tolerance = STEP_SHARE * effort.goal
    guess = first_guess(equations, problem.guess, tolerance, effort)
    if guess is None:
        return None
    mesh, period, angle, done = guess.mesh, guess.period, 0.0, 0
    trouble = Trouble(*_place(equations, mesh, angle, period))
    for _ in range(_MESHES_MOST):
        here, x = _place(equations, mesh, angle, period)
        effort.begin(f"collocation in {number_of(here.segments, 'step')}")
        lower, upper = here.bounds(problem.lower, problem.upper)
        result = newton.solve(
            here,
            np.clip(x, lower, upper),
            lower=lower,
            upper=upper,
            effort=effort,
        )
        done += result.iterations
        if not np.isfinite(result.residual).all() or effort.over:
            break
        mesh = refine(here, result.x, tolerance)
        if mesh is None:
            break
        unknowns = here.unpack(result.x)
        period, angle = float(unknowns.period), float(unknowns.angle)
    error = float(quality(here, result.x).errors.max())
    return _Found(here, dataclasses.replace(result, iterations=done), error, trouble)


def _place(
    equations: Equations, mesh: Mesh, angle: float, period: float
) -> tuple[Equations, np.ndarray]:
    """The equations on a mesh, and the unknowns x of the motion on it."""
    here, (first, *others) = on(equations, mesh), mesh.states
    return here, here.pack(first, others, angle=angle, parameter=0.0, period=period)
