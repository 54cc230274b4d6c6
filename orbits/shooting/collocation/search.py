"""A periodic orbit by collocation: Newton's method on one mesh after another."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from jaxdyn import System
from jaxdyn._checks import fail
from jaxdyn._text import counted
from orbits.closing.given import Problem
from orbits.motion import solved
from orbits.orbit import Orbit, Outcome
from orbits.shooting.collocation import newton
from orbits.shooting.collocation.mesh import (
    STEPS_MOST,
    Mesh,
    first_guess,
    is_stiff,
    on,
    quality,
    refined,
)
from orbits.shooting.effort import Effort
from orbits.shooting.equations import Equations
from orbits.shooting.newton import Result
from orbits.shooting.outcomes import Trouble, orbit_at, outcome_of
from orbits.shooting.units import InUnits

_MESHES_MOST = 8
#: Of the goal: error of a step, of which an orbit has hundreds.
_STEP_SHARE = 0.1
#: Tolerance with which stability limits the steps of stiff motions: finer ones limit them more.
_COARSE_RTOL = 1e-6


def suits(equations: Equations) -> bool:
    """Whether collocation can solve the equations: states are not projected onto constraints."""
    return type(equations.scene.system).project is System.project


def meshed(problem: Problem, equations: Equations, effort: Effort, *, instead: Orbit) -> Orbit:
    """The orbit by collocation, where it may find one that shooting did not; or else `instead`.

    That is where the motion from the guess is stiff, or integrations take too many steps.
    """
    if suits(equations) and (instead.outcome == Outcome.STEP_LIMIT or _stiff(problem, equations)):
        orbit = on_mesh(problem, equations, effort)
        return orbit if orbit.ok else instead
    return instead


def _stiff(problem: Problem, equations: Equations) -> bool:
    """Whether stability, not accuracy, limits the steps along the guess."""
    scene, part = problem.scene, problem.guess[-1] / equations.closing.parts
    flow = solved(scene, part, rtol=_COARSE_RTOL, max_steps=STEPS_MOST)
    return bool(flow.stiff)


def on_mesh(
    problem: Problem,
    equations: Equations,
    effort: Effort,
    segments: int | None = None,
    rough: bool = False,
) -> Orbit:
    """The orbit near a guess by collocation, or the best iterate and the reason.

    Args:
      problem: the guess, and bounds on the start and the period.
      equations: in one segment.
      effort: accuracy and limits.
      segments: must be None, as for all searches without integrations.
      rough: must be False, likewise.
    Raises:
      ValueError: the scene's states are projected onto constraints, or what `segments` says.
    """
    if not suits(equations):
        remedy = "Leave it out: by shooting."
        raise fail("collocation", "a scene without projected constraints", "others", remedy)
    if rough or segments is not None:
        raise fail("collocation", "neither `rough` nor `segments` with it", "one of them")
    equations = dataclasses.replace(equations, stiff=is_stiff(equations, problem.guess))
    found = _searched(problem, equations, effort)
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


class _Found(NamedTuple):
    """How a search ended.

    Attributes:
      equations: on the last mesh.
      result: where Newton's method ended.
      error: the largest error of a step.
      trouble: the test against the guess on the first mesh.
    """

    equations: Equations
    result: Result
    error: float
    trouble: Trouble


def _searched(problem: Problem, equations: Equations, effort: Effort) -> _Found | None:
    tolerance = _STEP_SHARE * effort.goal
    guess = first_guess(equations, problem.guess, tolerance)
    if guess is None:
        return None
    mesh, period, angle, done = guess.mesh, guess.period, 0.0, 0
    trouble = Trouble(*_placed(equations, mesh, angle, period))
    for _ in range(_MESHES_MOST):
        here, x = _placed(equations, mesh, angle, period)
        effort.trying(f"collocation in {counted(here.segments, 'step')}")
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
        mesh = refined(here, result.x, tolerance)
        if mesh is None:
            break
        unknowns = here.unpack(result.x)
        period, angle = float(unknowns.period), float(unknowns.angle)
    error = float(quality(here, result.x).errors.max())
    return _Found(here, dataclasses.replace(result, iterations=done), error, trouble)


def _placed(
    equations: Equations, mesh: Mesh, angle: float, period: float
) -> tuple[Equations, np.ndarray]:
    """The equations on a mesh, and x of the motion on it."""
    here, (first, *others) = on(equations, mesh), mesh.states
    return here, here.pack(first, others, angle=angle, parameter=0.0, period=period)
