"""Families of equilibria, followed by pseudo-arclength in state and parameter together.

Folds are regular points of such a family. At a simple branch point `switch_branch` follows the
other family through it, whose tangent solves a quadratic equation with second derivatives there.

Reference: Keller (1977), in Rabinowitz (ed.), Applications of Bifurcation Theory, 359; Govaerts
(2000), Numerical Methods for Bifurcations of Dynamical Equilibria, chapter 2.
"""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._records import with_captures
from jaxdyn.analysis.linearize import complete_state
from jaxdyn.analysis.scales_at_rest import at_rest
from jaxdyn.continuation import defining
from jaxdyn.continuation.branch import (
    ANYWHERE,
    Bounded,
    BranchProblem,
    begin_within,
    check_bounds,
    follow,
    inside,
)
from jaxdyn.continuation.checkpoint import EQUILIBRIA, Codec, Log, of_fields
from jaxdyn.continuation.defining import Make, slope_at
from jaxdyn.continuation.family import Equilibrium, EquilibriumFamily, equilibrium_at
from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.newton import Solution
from jaxdyn.continuation.normal_forms import second
from jaxdyn.continuation.special import EquilibriumChart, solution_of, special_points
from jaxdyn.continuation.units import InUnits, units_at, units_of
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.formulations.extended import innermost
from jaxdyn.scales import Groups, groups
from jaxdyn.scene import Scene, check_scene

_DEPENDENT = 1e-10  # largest ratio of least to largest singular value of dependent equations
_SAME_PARAMETER = 1e-6  # largest relative distance of a fold at the start from its parameter
_LOST = "no equilibrium was found beyond: a singularity of the rate, or a branch point"
_LATER = (0.0, 0.37, 1.3)  # times of the test for forcing, in the time of motions nearby
_SAME_RATE = (
    1e-12  # largest change of a rate with time by rounding, relative to that with the state
)
_ASIDE = 0.1  # distance from the start, as a part of the sizes, for the same test


def continue_equilibria(
    make: Make,
    parameter: float,
    start,
    *,
    step: float = 0.05,
    members: int = 100,
    down: bool = False,
    within: tuple[float, float] = ANYWHERE,
    report: Callable[[Equilibrium], None] = lambda point: None,
    path: str | Path | Log | None = None,
) -> EquilibriumFamily:
    """The family of equilibria of a scene in a parameter, with its bifurcations.

    Folds, branch points and Hopf points are located by their defining equations, with exact
    derivatives, to rounding. Each has its normal-form coefficients; a Hopf point is named
    supercritical or subcritical by its first Lyapunov coefficient.

    Args:
      make: the scene for each value of a parameter, e.g. ``lambda rho: lorenz(rho=rho)``; its
        start and span do not matter. A program is compiled for each function, so define it once.
      parameter: the value of the parameter at the start.
      start: (k,) state near an equilibrium; or (k/2,) coordinates of a state [q, v], with
        dq/dt = v, at rest. It may be a fold, known to about six digits.
      step: length of the first step in state and parameter, each in units of its size (`units`);
        the other steps are up to ten times as long.
      members: largest number of members.
      down: start towards a smaller parameter; at a fold, opposite to the default direction, in
        which the entry of the state that changes most grows.
      within: bounds on the parameter; a family that leaves them ends with the member on the bound.
      report: called with each member as it is found.
      path: a file (.jsonl) that saves each member as it is found, and may contain several families
        and curves; the same call resumes from it after an interruption. See
        `jaxdyn.continuation.load`.
    Returns:
      The members, and the special points between them.
    Raises:
      ValueError: there is no equilibrium near `start`, the scene depends on time or has
        constraints, its equilibria are not isolated at a fixed parameter even after a small
        change of it (redundant coordinates), or a number is out of range or traced.
    Limits: host only. Where two points of a kind coincide, as they may in a symmetric scene, one
      is found, without coefficients. Opposite eigenvalues of a conservative
      scene rule out the test for Hopf points: such a scene has none in this sense. Angles are not
      reduced modulo a turn.
    Reference: Govaerts (2000), Numerical Methods for Bifurcations of Dynamical Equilibria;
      Kuznetsov (2004), Elements of Applied Bifurcation Theory, chapters 5 and 10.
    Example:
      >>> import jaxdyn
      >>> family = jaxdyn.continue_equilibria(
      ...     lambda rho: jaxdyn.scenes.lorenz(rho=rho), 20.0, [7.0, 7.0, 19.0], within=(14, 28)
      ... )
      >>> [(str(x.kind), x.criticality, round(x.parameter, 6)) for x in family.special]
      [('Hopf point', 'subcritical', 24.736842)]
    """
    numbers = (parameter, start)
    _checks.check_on_host("continue_equilibria", numbers, "See orbits.differentiable.")
    _checks.float64()
    _checks.positive(
        "step", step, "It is a length in state and parameter, in units of their sizes."
    )
    members = _checks.whole("members", members)
    check_bounds("within", within)
    parameter = float(_checks.array("parameter", parameter, ()))
    if not inside(parameter, within):
        wanted = f"one within the bounds {within[0]:g} and {within[1]:g}"
        raise _checks.fail("parameter", wanted, f"{parameter:g}", "Widen within=.")
    make = with_captures(make, "parameter")
    first = _first(make, parameter, start, down)
    return _follow(_problem(make, parameter, within), first, step, members, path, report)


@check_first
def switch_branch(
    family: EquilibriumFamily,
    special: Equilibrium,
    *,
    step: float = 0.05,
    members: int = 100,
    down: bool = False,
    within: tuple[float, float] = ANYWHERE,
    path: str | Path | Log | None = None,
) -> EquilibriumFamily:
    """The other family of equilibria through a branch point, in one of its two directions.

    Args:
      family: the family of the point.
      special: one of ``family.special``, a branch point.
      step: see `continue_equilibria`.
      members: see `continue_equilibria`.
      down: take the direction opposite to the default, in which the entry of the state that changes
        most grows.
      within: bounds on the parameter.
      path: see `continue_equilibria`.
    Raises:
      ValueError: `special` is not a branch point, or not a simple one.
    Example:
      >>> import jaxdyn
      >>> family = jaxdyn.continue_equilibria(
      ...     lambda rho: jaxdyn.scenes.lorenz(rho=rho), 0.5, [0.0, 0.0, 0.0], within=(0, 2)
      ... )
      >>> other = jaxdyn.continuation.switch_branch(family, family.special[0], members=5)
      >>> rho, (x, _, z) = other.parameters[-1], other.states[-1]
      >>> bool(abs(z - (rho - 1)) < 1e-12 and abs(x**2 - 8 / 3 * z) < 1e-12)
      True
    """
    if special.kind != Kind.BRANCH:
        raise _checks.fail("special", "a branch point", special.kind or "an ordinary member")
    units = units_of(family.make, special)
    make, here = units.scene(family.make), units.inward(special)
    tangent = _largest_grows(_other_tangent(make, here), down)
    normal = np.stack([here.x + step * tangent, tangent])
    solution = defining.solve(defining.arc, make, normal[0], normal)
    if solution is None:
        raise _checks.fail("step", "an equilibrium at this distance", "none", "Try a smaller one.")
    problem = _problem(family.make, special.parameter, within)
    beside = equilibrium_at(make, solution.x, tangent, solution.residual)
    start = dataclasses.replace(here, tangent=tangent, kind=None)
    first = begin_within(problem, EquilibriumChart(family.make, units), start, beside)
    return _follow(problem, units.outward(first), step, members, path)


def _first(make: Make, parameter: float, start, down: bool) -> Equilibrium:
    scene = check_scene(make(jnp.asarray(parameter)))
    y = np.asarray(_checks.array("start", start, (None,)))
    if isinstance(innermost(scene.system), Constrained):
        remedy = 'Set it up in minimal coordinates, e.g. with formulation="lagrange".'
        raise _checks.fail("make", "a scene without constraints", "a constrained one", remedy)
    y = complete_state("start", y, scene)
    k = len(y)
    if _driven(scene, y):
        remedy = "It has no equilibria; follow its periodic motions instead."
        raise _checks.fail("make", "an autonomous scene", "one that depends on time", remedy)
    start, up = np.append(y, parameter), np.append(np.zeros(k), -1.0 if down else 1.0)
    for _ in range(2):  # the second time in the units of what was found: a start may be far off
        units = units_at(make, start, k)
        within = units.scene(make)
        x = start / units.x
        values = np.linalg.svd(np.asarray(slope_at(within, x)), compute_uv=False)
        if not values[-1] > _DEPENDENT * values[0]:
            raise _checks.fail(
                "start",
                "a regular point of one family of equilibria",
                "dependent equations",
                "Use a minimal set of coordinates, none redundant; at a branch point begin "
                "beside it.",
            )
        solution, along = defining.solve(defining.arc, within, x, np.stack([x, up])), up
        if solution is None:
            near = equilibrium_at(within, x, up, math.nan)
            solution, along = _fold_at(within, near), _largest_grows(near.tangent, down)
        if solution is None:
            remedy = "jaxdyn.equilibria finds those in a box."
            raise _checks.fail("start", "a state near an equilibrium", y.tolist(), remedy)
        start = np.append((solution.x * units.x)[:k], parameter)
    return units.outward(equilibrium_at(within, solution.x, along, solution.residual))


def _fold_at(make: InUnits, near: Equilibrium) -> Solution | None:
    """The fold near a state; None if it is not at the same parameter.

    At a fixed parameter the equations of an equilibrium are dependent there.
    """
    fold, p, k = solution_of(make, Kind.FOLD, near), near.parameter, len(near.state)
    if fold is None or abs(fold.x[k] - p) > _SAME_PARAMETER * (1.0 + abs(p)):
        return None
    return fold._replace(x=fold.x[: k + 1])


def _largest_grows(tangent: np.ndarray, down: bool) -> np.ndarray:
    """A tangent along which the entry of the state that changes most grows, or falls if `down`."""
    return tangent * (-1.0 if (tangent[np.argmax(np.abs(tangent[:-1]))] < 0) != down else 1.0)


def _driven(scene: Scene, y: np.ndarray) -> bool:
    sizes, time, _ = at_rest(scene.field, groups(scene.system), y)
    # States near the start are tested too: a shaken pendulum at rest does not feel the forcing.
    states = jnp.stack([y, y + _ASIDE * np.asarray(sizes)])

    def derivatives(t):
        def at(y):
            by_time, by_state = jax.jacfwd(scene.rate, argnums=(0, 1))(t, y)
            return time * by_time, jnp.abs(by_state) @ jnp.asarray(sizes)

        return jax.vmap(at)(states)

    later = jnp.asarray(_LATER) * time
    change, own = map(np.asarray, jax.jit(jax.vmap(derivatives))(later))
    # The rate of a bead on a turning hoop depends on time only by rounding.
    return bool(np.any(np.abs(change) > _SAME_RATE * own.max(axis=(0, 1))))


class _Problem(BranchProblem[Equilibrium]):
    """A family of equilibria within bounds on the parameter."""

    what = EQUILIBRIA

    def __init__(self, make: Make, within: tuple[float, float], known: Groups):
        self.make, self.within, self.known = make, within, known

    def chart(self, member: Equilibrium) -> EquilibriumChart:
        return EquilibriumChart(self.make, units_of(self.make, member), self.known)

    def codec(self) -> Codec:
        return of_fields(Equilibrium)

    def special(self, chart: EquilibriumChart, a, b, first: bool) -> list[Equilibrium]:
        return special_points(chart, a, b, first)

    def bounded(self, chart: EquilibriumChart, member: Equilibrium) -> list[Bounded]:
        units = chart.units.parameters
        return [Bounded(member.parameter * units, self.within, units=units)]

    def lost(self, reason: str) -> str:
        return _LOST


def _problem(make: Make, parameter: float, within: tuple[float, float]) -> _Problem:
    return _Problem(make, within, groups(make(parameter).system))


def _follow(
    problem: _Problem, first: Equilibrium, step, members, path, report=lambda point: None
) -> EquilibriumFamily:
    found = follow(problem, first, step, members, report, path)
    return EquilibriumFamily(found.members, found.special, found.end, problem.make)


def _other_tangent(make: InUnits, special: Equilibrium) -> np.ndarray:
    """(k + 1,) unit direction of the second family at a simple branch point."""
    u, _, vt = np.linalg.svd(special.slopes)
    psi, plane = u[:, -1], vt[-2:]
    form = np.array([[psi @ second(make, special.x, v, w) for w in plane] for v in plane])
    # The tangents of both families are the zeros of this quadratic form in the plane.
    values, vectors = np.linalg.eigh(form)
    if not values[0] * values[1] < 0:
        remedy = "More than two families meet there, or they touch."
        raise _checks.fail("special", "a simple branch point", "another", remedy)
    root = np.sqrt(np.abs(values[::-1]))
    tangents = [(vectors @ (root * sign)) @ plane for sign in ((1.0, 1.0), (1.0, -1.0))]
    tangents = [tangent / np.linalg.norm(tangent) for tangent in tangents]
    return min(tangents, key=lambda tangent: abs(tangent @ special.tangent))
