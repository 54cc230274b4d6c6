"""The mesh of collocation: first along a guess, then where the errors of its steps require it."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, Status
from jaxdyn.solvers import RADAU9
from orbits.closing.sizes import sizes
from orbits.motion import quick_solve
from orbits.shooting.collocation import steps
from orbits.shooting.equations import Equations, pieces
from orbits.shooting.strategy import Effort

#: Most steps of the default method: a motion that takes more is sampled by a stiff method.
STEPS_MOST = 20_000
#: Error of a step as a share of the goal; an orbit has hundreds of steps.
STEP_SHARE = 0.1
#: Intervals are a multiple of this number, so that few numbers of them are compiled.
_UNIT = 16
_FIRST = 64  # intervals of the first mesh
#: Most intervals; the equations for the unknowns of all of them form one matrix.
_MOST = 512
_SAMPLES = 2048  # samples of the guess, for its first mesh
_CALM = _SAMPLES // 10  # samples about the start in which the motion is slow
_SAMPLE_RTOL = 1e-12  # tolerance of these samples
_RETURNS_MOST = 8  # integrations for the time of the nearest return
_RETURN_STEP = 0.05  # largest change of that time in one step, as a share of the period
_SAMPLINGS = 5  # most samplings; each resolves what is some hundred times faster than the last
#: Share of the intervals of the first mesh that time decides on; the path decides on the others.
_BY_TIME = 0.3
#: Largest ratio of the densities of neighbouring intervals.
_NEIGHBOURS = 4.0
#: Growth of errors over an interval: the largest in a first mesh, and what a new mesh aims at. With
#: more, the end depends so strongly on the start that Newton's method takes only tiny steps.
_GROWTH_MOST, _GROWTH_WANTED = 100.0, 10.0
_BELOW = 0.1  # error of a step that a new mesh aims at, as a share of the tolerance
_SPARSEST = 1e-2  # least number of new intervals on an old one
_SPARE = 1.3  # number of intervals, relative to what the errors require
_SPACING = 4 * np.finfo(float).eps  # relative to the states: smaller errors of a step are rounding


class Mesh(NamedTuple):
    """A motion on a mesh.

    Attributes:
      shares: (n,) lengths of the intervals, whose sum is 1.
      states: (n, k) at their starts.
    """

    shares: np.ndarray
    states: np.ndarray


class Guess(NamedTuple):
    """A motion that nearly closes, on its mesh.

    Attributes:
      mesh: the mesh.
      period: the full period.
    """

    mesh: Mesh
    period: float


def first_guess(
    equations: Equations, guess: np.ndarray, tolerance: float, effort: Effort
) -> Guess | None:
    """A motion on a mesh, from a guess (k + 1,) of start and period; None where it ends early.

    It starts where the motion from the guess is slowest, if any start will do, and the period is
    the time after which it comes nearest to its start: on a mesh, jumps of a relaxation
    oscillation cannot move by more than their width in a Newton step. Where the time allowed by
    `effort` is up, the guess is returned as it stands.
    """
    span = guess[-1] / equations.closing.parts
    scene = equations.scene.starting(guess[:-1], span)
    if _any_start(equations):
        ys = _states_at(equations, scene, np.linspace(0.0, span, _SAMPLES))
        speeds = np.abs(np.asarray(_rates(scene, ys)) / _scales(ys)).max(axis=1)
        if not np.isfinite(speeds).all():
            return None
        # Judge a window about each sample: the end of a jump is slow too, but next to the jump.
        fastest = np.lib.stride_tricks.sliding_window_view(speeds, _CALM).max(axis=1)
        scene = scene.starting(ys[int(np.argmin(fastest)) + _CALM // 2], span)
    if not equations.driven:
        span = _return_time(equations, scene, span, effort)
    mesh = _first_mesh(equations, scene, span, tolerance, effort)
    return mesh and Guess(mesh, span * equations.closing.parts)


def _any_start(equations: Equations) -> bool:
    """Whether any point of the orbit may be its start."""
    everything = len(equations.closing.free(len(equations.scene.y0))) == len(equations.scene.y0)
    return everything and not (equations.driven or equations.conditions)


def _return_time(equations: Equations, scene: Scene, span: float, effort: Effort) -> float:
    """The time near a span after which the motion comes nearest to closing."""
    best, error = span, np.inf
    for _ in range(_RETURNS_MOST):
        end = _states_at(equations, scene, np.array([0.0, span]))[-1]
        rows = equations.closing.rows(sizes(scene))
        miss, slope = (np.asarray(x) / rows for x in _closing(equations, scene.y0, end))
        if effort.over or not np.linalg.norm(miss) < error:
            break
        best, error = span, float(np.linalg.norm(miss))
        change = -(slope @ miss) / max(slope @ slope, 1e-300)
        span += float(np.clip(change, -_RETURN_STEP * best, _RETURN_STEP * best))
    return best


@jax.jit
def _closing(equations: Equations, start, end):
    """(m,) the closing error, and its derivative with respect to the end time."""
    system, closing = equations.scene.system, equations.closing
    rate = equations.scene.rate(jnp.zeros(()), end)
    return jax.jvp(lambda y: closing.miss(system, y, start, jnp.zeros(())), (end,), (rate,))


@jax.jit
def _rates(scene: Scene, ys):
    return jax.vmap(scene.rate, (None, 0))(jnp.zeros(()), ys)


def _first_mesh(
    equations: Equations, scene: Scene, span: float, tolerance: float, effort: Effort
) -> Mesh | None:
    """A mesh along the scene's motion; None where that ends early.

    At first it is partly even in time and partly even along the path of the state, with each entry
    in units of its largest value, so that jumps of a relaxation oscillation are resolved. Then it
    is refined as in `refine`, until every step can be made and none amplifies errors strongly.
    """
    ts = np.linspace(0.0, span, _SAMPLES)
    for _ in range(_SAMPLINGS):
        ys = _states_at(equations, scene, ts)
        path = np.abs(np.diff(ys / _scales(ys), axis=0)).max(axis=1)
        if not np.isfinite(path).all():
            return None
        even = _BY_TIME * np.diff(ts) / span + (1 - _BY_TIME) * path / max(path.sum(), 1e-300)
        ts = _divide(ts, even, _SAMPLES - 1)
        if effort.over:
            break
    ts = _divide(ts, np.ones(_SAMPLES - 1), _FIRST)
    for _ in range(_SAMPLINGS):
        mesh = Mesh(shares=np.diff(ts) / span, states=_states_at(equations, scene, ts)[:-1])
        here = on(equations, mesh)
        period = span * equations.closing.parts
        x = here.pack(scene.y0, mesh.states[1:], angle=0.0, parameter=0.0, period=period)
        found = quality(here, x)
        good = found.errors.max() <= tolerance and found.growth.max() <= _GROWTH_MOST  # no NaN
        if good or effort.over:
            break
        ts = _divide(ts, *found.density(tolerance))
    return mesh


def _states_at(equations: Equations, scene: Scene, ts: np.ndarray) -> np.ndarray:
    """(n, k) states at times (n,) of the scene's motion."""
    solver = RADAU9 if equations.stiff else None
    return np.asarray(quick_solve(scene, ts[-1], ts=ts, rtol=_SAMPLE_RTOL, solver=solver).ys)


def is_stiff(equations: Equations, guess: np.ndarray) -> bool:
    """Whether the default method takes too many steps for the motion from a guess (k + 1,)."""
    span = guess[-1] / equations.closing.parts
    scene = equations.scene.starting(guess[:-1], span)
    flow = quick_solve(scene, span, rtol=_SAMPLE_RTOL, max_steps=STEPS_MOST)
    return int(flow.status) == Status.STEP_LIMIT


def on(equations: Equations, mesh: Mesh) -> Equations:
    """The closing equations by collocation on a mesh."""
    shares = tuple(mesh.shares.tolist())
    return dataclasses.replace(equations, shares=shares, s_spans=None, collocated=True)


class Quality(NamedTuple):
    """How good the steps of a mesh are; NaN where a step could not be made.

    Attributes:
      errors: (n,) errors of their ends, relative to the largest value of each entry.
      growth: (n,) growth of errors from start to end of an interval, in the same units.
    """

    errors: np.ndarray
    growth: np.ndarray

    def density(self, tolerance: float) -> tuple[np.ndarray, int]:
        """The density (n,) of new intervals on each old one, and their number."""
        errors = np.where(np.isfinite(self.errors), self.errors, 1.0)
        density = (errors / (_BELOW * tolerance)) ** (1 / (2 * steps.NODES + 1))
        growth = np.where(np.isfinite(self.growth), self.growth, 1.0)
        density = np.maximum(density, np.log(np.maximum(growth, 1.0)) / np.log(_GROWTH_WANTED))
        density = _smooth(np.maximum(density, _SPARSEST))
        number = _UNIT * np.ceil(_SPARE * density.sum() / _UNIT)
        return density, int(min(number, _MOST))


def quality(equations: Equations, x: np.ndarray) -> Quality:
    """The quality of the steps at the unknowns x."""
    here = pieces(equations, x)
    scales = _scales(np.asarray(here.start))
    errors = steps.local_errors(equations.scene, here, make=equations.make)
    _, slopes = steps.linearise_steps(equations.scene, here, make=equations.make)
    growth = np.asarray(slopes.start) * scales / scales[:, None]
    return Quality((errors / scales).max(axis=1), np.linalg.norm(growth, axis=(1, 2)))


def refine(equations: Equations, x: np.ndarray, tolerance: float) -> Mesh | None:
    """A mesh whose steps have errors below a tolerance; None if they have them already.

    Args:
      equations: the equations on the present mesh.
      x: (n,) unknowns there, near a solution.
      tolerance: largest of the errors in `Quality` that are acceptable.
    """
    found = quality(equations, x)
    if found.errors.max() <= max(tolerance, _SPACING):
        return None
    old = np.append(0.0, np.cumsum(equations.shares))
    new = _divide(old / old[-1], *found.density(tolerance))
    return Mesh(shares=np.diff(new), states=equations.states_at(x, new[:-1]))


def _divide(ts: np.ndarray, weights: np.ndarray, number: int) -> np.ndarray:
    """(number + 1,) times that divide (n + 1,) times into parts of equal weight (n,)."""
    grown = np.append(0.0, np.cumsum(weights))
    new = np.interp(np.linspace(0.0, grown[-1], number + 1), grown, ts)
    new[0], new[-1] = ts[0], ts[-1]
    return new


def _smooth(density: np.ndarray) -> np.ndarray:
    """The density, raised so that neighbours differ by a factor `_NEIGHBOURS` at most."""
    for _ in range(len(density)):
        beside = np.maximum(
            np.append(density[1:], density[0]), np.append(density[-1], density[:-1])
        )
        new = np.maximum(density, beside / _NEIGHBOURS)
        if np.array_equal(new, density):
            break
        density = new
    return density


def _scales(states: np.ndarray) -> np.ndarray:
    """(k,) largest absolute values of the entries of states (n, k); 1 where all are zero."""
    scales = np.abs(states).max(axis=0)
    return np.where(scales > 0, scales, 1.0)
