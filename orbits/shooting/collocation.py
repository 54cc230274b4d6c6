"""A periodic orbit by collocation: Newton's method on one mesh after another."""

import dataclasses
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, Status
from jaxdyn._checks import fail
from jaxdyn._text import number_of
from jaxdyn.solvers import RADAU9
from orbits.closing.given import Problem, has_constraints
from orbits.closing.sizes import sizes
from orbits.motion import quick_solve
from orbits.orbit import Orbit, Outcome
from orbits.shooting import gauss_steps
from orbits.shooting.equations import Equations, InUnits, boundary, equation_units, pieces, sizes_at
from orbits.shooting.newton import Iteration, Result
from orbits.shooting.outcomes import Trouble, orbit_at, outcome_of
from orbits.shooting.segmentation import divide
from orbits.shooting.strategy import Effort, Search, Strategy

# ---- The mesh of collocation: first along a guess, then refined by the errors of its steps

#: Most steps of the default method: a motion that takes more is sampled by a stiff method.
STEPS_MOST = 20_000
#: Error of a step as a share of the goal; an orbit has hundreds of steps.
STEP_SHARE = 0.1
#: The number of intervals is a multiple of this, so that few different numbers are compiled.
_UNIT = 16
_FIRST = 64  # intervals of the first mesh
#: Most intervals; the equations for the unknowns of all of them form one matrix.
_MOST = 512
_SAMPLES = 2048  # samples of the guess, for its first mesh
_CALM = _SAMPLES // 10  # number of samples around the start over which the motion has to be slow
_SAMPLE_RTOL = 1e-12  # tolerance of these samples
_RETURNS_MOST = 8  # most integrations in the search for the time of the nearest return
_RETURN_STEP = 0.05  # largest change of that time in one step, as a share of the period
_SAMPLINGS = 5  # most samplings; each resolves changes about a hundred times faster than the last
#: Share of the first mesh's density that is even in time; the rest is even along the path.
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

    If any point of the orbit may be its start, the motion starts where it is slowest. The period is
    the time after which it comes nearest to its start. Both must be good, since a Newton step
    cannot move the jumps of a relaxation oscillation by more than their width. Refinement stops
    when the time of `effort` is up.
    """
    span = guess[-1] / equations.closing.parts
    scene = equations.scene.starting(guess[:-1], span)
    if _is_start_free(equations):
        ys = _states_at(equations, scene, np.linspace(0.0, span, _SAMPLES))
        speeds = np.abs(np.asarray(_rates(scene, ys)) / _scales(ys)).max(axis=1)
        if not np.isfinite(speeds).all():
            return None
        # The largest speed in a window: the end of a jump is slow too, but next to the jump.
        fastest = np.lib.stride_tricks.sliding_window_view(speeds, _CALM).max(axis=1)
        scene = scene.starting(ys[int(np.argmin(fastest)) + _CALM // 2], span)
    if not equations.driven:
        span = _return_time(equations, scene, span, effort)
    mesh = _first_mesh(equations, scene, span, tolerance, effort)
    return mesh and Guess(mesh, span * equations.closing.parts)


def _is_start_free(equations: Equations) -> bool:
    """Whether any point of the orbit may be its start."""
    everything = len(equations.closing.free(len(equations.scene.y0))) == len(equations.scene.y0)
    return everything and not (equations.driven or equations.conditions)


def _return_time(equations: Equations, scene: Scene, span: float, effort: Effort) -> float:
    """The time near a span after which the motion comes nearest to closing."""
    best, error = span, np.inf
    for _ in range(_RETURNS_MOST):
        end = _states_at(equations, scene, np.array([0.0, span]))[-1]
        rows = equations.closing.residual_units(sizes(scene))
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
    return jax.jvp(lambda y: closing.residual(system, y, start, jnp.zeros(())), (end,), (rate,))


@jax.jit
def _rates(scene: Scene, ys):
    # Not `vmap`: a convolution of n states side by side takes XLA a time that grows with n^2 on
    # a CPU, and minutes for all samples (jaxlib 0.10.2).
    return jax.lax.map(lambda y: scene.rate(jnp.zeros(()), y), ys)


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
        ts = divide(ts, even, _SAMPLES - 1)
        if effort.over:
            break
    ts = divide(ts, np.ones(_SAMPLES - 1), _FIRST)
    for _ in range(_SAMPLINGS):
        mesh = Mesh(shares=np.diff(ts) / span, states=_states_at(equations, scene, ts)[:-1])
        here = on_mesh(equations, mesh)
        period = span * equations.closing.parts
        x = here.pack(scene.y0, mesh.states[1:], angle=0.0, parameter=0.0, period=period)
        found = quality(here, x)
        good = found.errors.max() <= tolerance and found.growth.max() <= _GROWTH_MOST  # no NaN
        if good or effort.over:
            break
        ts = divide(ts, *found.density(tolerance))
    return mesh


def _states_at(equations: Equations, scene: Scene, ts: np.ndarray) -> np.ndarray:
    """(n, k) states at times (n,) of the scene's motion."""
    solver = RADAU9 if equations.stiff else None
    return np.asarray(quick_solve(scene, ts[-1], ts=ts, rtol=_SAMPLE_RTOL, solver=solver).ys)


def exceeds_step_limit(equations: Equations, guess: np.ndarray) -> bool:
    """Whether the default method takes more than `STEPS_MOST` steps from a guess (k + 1,)."""
    span = guess[-1] / equations.closing.parts
    scene = equations.scene.starting(guess[:-1], span)
    flow = quick_solve(scene, span, rtol=_SAMPLE_RTOL, max_steps=STEPS_MOST)
    return int(flow.status) == Status.STEP_LIMIT


def on_mesh(equations: Equations, mesh: Mesh) -> Equations:
    """The closing equations by collocation on a mesh."""
    shares = tuple(mesh.shares.tolist())
    return dataclasses.replace(equations, shares=shares, s_spans=None, collocated=True)


class Quality(NamedTuple):
    """The quality of the steps on a mesh; NaN where a step failed.

    Attributes:
      errors: (n,) errors of the steps' ends, relative to the largest value of each entry.
      growth: (n,) growth of errors from start to end of an interval, in the same units.
    """

    errors: np.ndarray
    growth: np.ndarray

    def density(self, tolerance: float) -> tuple[np.ndarray, int]:
        """The density (n,) of new intervals on each old one, and their number."""
        errors = np.where(np.isfinite(self.errors), self.errors, 1.0)
        density = (errors / (_BELOW * tolerance)) ** (1 / (2 * gauss_steps.NODES + 1))
        growth = np.where(np.isfinite(self.growth), self.growth, 1.0)
        density = np.maximum(density, np.log(np.maximum(growth, 1.0)) / np.log(_GROWTH_WANTED))
        density = _smooth(np.maximum(density, _SPARSEST))
        number = _UNIT * np.ceil(_SPARE * density.sum() / _UNIT)
        return density, int(min(number, _MOST))


def quality(equations: Equations, x: np.ndarray) -> Quality:
    """The quality of the steps at the unknowns x."""
    here = pieces(equations, x)
    scales = _scales(np.asarray(here.start))
    errors = gauss_steps.local_errors(equations.scene, here, make=equations.make)
    _, slopes = gauss_steps.linearize_steps(equations.scene, here, make=equations.make)
    growth = np.asarray(slopes.start) * scales / scales[:, None]
    return Quality((errors / scales).max(axis=1), np.linalg.norm(growth, axis=(1, 2)))


def refine(equations: Equations, x: np.ndarray, tolerance: float) -> Mesh | None:
    """A mesh whose steps have errors below a tolerance; None if the present mesh is one.

    Args:
      equations: the equations on the present mesh.
      x: (n,) unknowns there, near a solution.
      tolerance: largest acceptable error, as in `Quality`.
    """
    found = quality(equations, x)
    if found.errors.max() <= max(tolerance, _SPACING):
        return None
    old = np.append(0.0, np.cumsum(equations.shares))
    new = divide(old / old[-1], *found.density(tolerance))
    return Mesh(shares=np.diff(new), states=equations.states_at(x, new[:-1]))


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


# ---- Newton steps for collocation: the states inside the mesh are eliminated, pair by pair
#
# Each interval gives k linear equations in the states at its two ends and in the few unknowns that
# all intervals share (period, parameter, angle). Of two neighbours, an orthogonal elimination of
# the state between them leaves k equations for their outer ends; after log2(n) rounds one block for
# the two ends of the whole motion is left, which is solved with the closing equations. Orthogonal
# elimination is stable where growth and decay over the motion have no common scale, as in
# relaxation oscillations. A product of the transition matrices is not stable there, and a singular
# value decomposition of all equations mistakes their small singular values for symmetries.
#
# Reference: U. Ascher, R. Mattheij, R. Russell, Numerical Solution of Boundary Value Problems for
# Ordinary Differential Equations, SIAM (1995), chapter 7; S. Wright, SIAM J. Sci. Stat. Comput. 13
# (1992) 742.


class MeshEquations(NamedTuple):
    """Equations left @ dy[i] + right @ dy[i + 1] + shared @ dg + rest = 0 for i < n.

    Attributes:
      left: (n, k, k).
      right: (n, k, k).
      shared: (n, k, g).
      rest: (n, k).
    """

    left: np.ndarray
    right: np.ndarray
    shared: np.ndarray
    rest: np.ndarray


class _Elimination(NamedTuple):
    """The equations upper @ dy + left @ before + right @ after + shared @ dg + rest = 0 for dy."""

    upper: np.ndarray
    chain: MeshEquations


def condense(chain: MeshEquations) -> tuple[MeshEquations, list[_Elimination]]:
    """One equation for the two ends of a chain, and how the states between follow from them."""
    rounds = []
    while len(chain.rest) > 1:
        pairs = len(chain.rest) // 2
        first, second = (MeshEquations(*(a[i : 2 * pairs : 2] for a in chain)) for i in (0, 1))
        k = first.left.shape[-1]
        q, r = np.linalg.qr(np.concatenate([first.right, second.left], axis=1), mode="complete")
        nothing = np.zeros_like(first.left)
        rows = [
            np.concatenate([first.left, nothing], axis=1),
            np.concatenate([nothing, second.right], axis=1),
            np.concatenate([first.shared, second.shared], axis=1),
            np.concatenate([first.rest, second.rest], axis=1)[..., None],
        ]
        turned = [np.swapaxes(q, 1, 2) @ row for row in rows]
        upper, lower = ([a[:, part] for a in turned] for part in (slice(k), slice(k, None)))
        by_before, by_after, by_shared, known = upper
        between = MeshEquations(by_before, by_after, by_shared, known[..., 0])
        rounds.append(_Elimination(r[:, :k], between))
        joined = (*lower[:3], lower[3][..., 0])
        left, right, shared, rest = (
            np.concatenate([new, old[2 * pairs :]]) for new, old in zip(joined, chain, strict=True)
        )
        chain = MeshEquations(left, right, shared, rest)
    return chain, rounds


def expand(
    rounds: list[_Elimination],
    first: np.ndarray,
    last: np.ndarray,
    dg: np.ndarray,
    *,
    homogeneous: bool = False,
):
    """(n + 1, k) all changes dy, from those of the ends (k,) and the changes dg (g,).

    With `homogeneous`, the `rest` of the equations counts as zero.
    """
    states = np.stack([first, last])
    for upper, chain in reversed(rounds):
        pairs = len(upper)
        before, after = states[:pairs], states[1 : pairs + 1]
        right = np.einsum("nij,nj->ni", chain.left, before)
        right += np.einsum("nij,nj->ni", chain.right, after) + chain.shared @ dg
        right += 0.0 if homogeneous else chain.rest
        between = np.linalg.solve(upper, -right[..., None])[..., 0]
        joined = np.empty((2 * pairs, states.shape[1]))
        joined[::2], joined[1::2] = before, between
        states = np.concatenate([joined, states[pairs:]])
    return states


# ---- Newton's method for the closing equations by collocation
#
# Unknowns are scaled: each entry of the state is in units of its largest value on the mesh, since
# those of a relaxation oscillation differ by powers of ten. Steps are halved until the residual
# decreases.

#: Singular values of the condensed equations below this share of the largest belong to shifts
#: along the orbit, its family and the symmetries.
_RANK = 1e-9
_HALVINGS_MOST = 12
_ROUNDS_AT_GOAL = 2  # more steps once the goal is met: convergence is quadratic


class Scales(NamedTuple):
    """Units of the unknowns.

    Attributes:
      state: (k,) units of a state.
      x: (n,) units of all unknowns.
      closing: (m,) units of the equations other than the steps.
    """

    state: np.ndarray
    x: np.ndarray
    closing: np.ndarray


def scales_of(equations: Equations, x: np.ndarray) -> Scales:
    """The units at x, from the largest absolute values of the entries of the states."""
    states = np.asarray(pieces(equations, x).start)
    largest = np.abs(states).max(axis=0)
    largest = np.where(largest > 0, largest, sizes_at(equations, x))
    between = np.tile(largest, (equations.segments - 1, 1))
    all_of_x = equations.pack(
        largest, between, angle=1.0, parameter=1.0, period=x[-1] / (2 * np.pi)
    )
    _, by_x, _ = map(np.asarray, _boundary_slopes(equations, x, states[0]))
    changes = by_x * all_of_x[_shared_places(equations)]
    closing = equation_units(equations, equations.closing.residual_units(largest), changes)
    return Scales(state=largest, x=all_of_x, closing=closing)


class _Point(NamedTuple):
    """The linearised equations at x: those of the chain, and those between its ends."""

    x: np.ndarray
    end: np.ndarray  # (k,) end of the last interval
    chain: MeshEquations  # in scaled unknowns
    closing: np.ndarray  # (m,) residual of the closing equations, in units

    @property
    def residual(self) -> np.ndarray:
        return np.concatenate([self.chain.rest.ravel(), self.closing])

    @property
    def size(self) -> float:
        return float(np.abs(self.residual).max())


def solve(
    equations: Equations,
    x: np.ndarray,
    *,
    lower: np.ndarray,
    upper: np.ndarray,
    effort: Effort,
) -> Result:
    """The solution near x (n,), within the bounds, as far as an effort leads."""
    goal, max_iterations, report = effort.goal, effort.max_iterations, effort.report
    scales = scales_of(equations, x)
    point = _linearize_at(equations, x, scales)
    accepted, done = 0, 0
    report(Iteration(index=0, residual=point.size, period=x[-1], step=0.0))
    while accepted < max_iterations and np.isfinite(point.residual).all():
        step = _step(equations, point, scales, lower, upper)
        new = _backtrack(equations, point, scales, step, lower, upper, effort)
        if new is None:
            break
        accepted += 1
        moved = float(np.linalg.norm((new.x - point.x) / scales.x))
        point = new
        report(Iteration(index=accepted, residual=point.size, period=point.x[-1], step=moved))
        done += point.size <= goal
        if done > _ROUNDS_AT_GOAL or effort.over:
            break
    at_bound = ((point.x <= lower) | (point.x >= upper)) & (lower < upper)
    return Result(
        x=point.x,
        residual=point.residual,
        iterations=accepted,
        converged=bool(point.size <= goal),
        at_bound=bool(at_bound.any()),
        limit=accepted >= max_iterations,
    )


def _linearize_at(equations: Equations, x: np.ndarray, scales: Scales) -> _Point:
    here = jax.tree.map(np.asarray, pieces(equations, x))
    found, slopes = gauss_steps.linearize_steps(equations.scene, here, make=equations.make)
    left, end = np.asarray(slopes.start), np.asarray(found.end)
    by = _slopes_in_shared(equations, x)
    shared = sum(
        np.asarray(slope)[:, :, None] * np.asarray(change)[:, None, :]
        for slope, change in (
            (slopes.span, by.span),
            (slopes.t0, by.t0),
            (slopes.parameter, by.parameter),
        )
    )
    k = left.shape[1]
    # The end of the last interval is an unknown too, equal to its present value.
    rest = end - np.vstack([here.start[1:], end[-1:]])
    rows = 1 / scales.state[:, None]
    chain = MeshEquations(
        left=rows * left * scales.state,
        right=np.broadcast_to(-np.eye(k), left.shape),
        shared=rows * shared * scales.x[_shared_places(equations)],
        rest=rest / scales.state,
    )
    closing = np.asarray(boundary(equations, x, here.start[0], end[-1])) / scales.closing
    return _Point(x=x, end=end[-1], chain=chain, closing=closing)


def _step(equations, point: _Point, scales: Scales, lower, upper) -> np.ndarray:
    """(n,) the shortest change of x that solves the linearised equations."""
    places = _shared_places(equations)
    unit = scales.x[places]
    top, rounds = condense(point.chain)
    start, by_x, by_end = map(np.asarray, _boundary_slopes(equations, point.x, point.end))
    first = start * unit / scales.state[:, None]  # derivative of dy[0] with respect to dg
    rows = np.vstack(
        [
            np.hstack([top.left[0] @ first + top.shared[0], top.right[0]]),
            np.hstack([by_x * unit, by_end * scales.state]) / scales.closing[:, None],
        ]
    )
    rest = np.append(top.rest[0], point.closing)
    # Growth over the motion makes some rows large; they are scaled to count alike.
    size = np.abs(rows).max(axis=1, keepdims=True)
    rows, rest = rows / np.maximum(size, 1e-300), rest / np.maximum(size[:, 0], 1e-300)
    free = np.append(lower[places] < upper[places], np.ones(len(point.end), bool))
    u, values, vt = np.linalg.svd(rows[:, free])
    rank = int((values > _RANK * values[0]).sum())
    moves = np.zeros((1 + len(vt) - rank, len(free)))
    moves[0, free] = -vt[:rank].T @ (u.T[:rank] @ rest / values[:rank])
    moves[1:, free] = vt[rank:]
    steps = []
    for i, move in enumerate(moves):
        dg, last = move[: len(places)], move[len(places) :]
        states = expand(rounds, first @ dg, last, dg, homogeneous=i > 0)
        step = np.zeros(len(point.x))
        step[places] = dg
        step[_inner_states(equations)] = states[1:-1].ravel()
        steps.append(step)
    # The step that is shortest in all unknowns: one short only at the ends may shift every jump.
    found, kernel = steps[0], np.stack([*steps[1:], 0 * steps[0]], axis=1)
    return scales.x * (found - kernel @ np.linalg.lstsq(kernel, found, rcond=None)[0])


def _backtrack(
    equations, point: _Point, scales, step, lower, upper, effort: Effort
) -> _Point | None:
    for halvings in range(_HALVINGS_MOST):
        if effort.over:
            break
        new = np.clip(point.x + step / 2**halvings, lower, upper)
        if not new[-1] > 0:
            continue
        found = _linearize_at(equations, new, scales)
        if np.linalg.norm(found.residual) < np.linalg.norm(point.residual):
            return found
    return None


def _inner_states(equations: Equations) -> slice:
    """Places in x of the states inside the mesh."""
    k = len(equations.scene.y0)
    p = len(equations.closing.free(k))
    return slice(p, p + (equations.segments - 1) * k)


def _shared_places(equations: Equations) -> np.ndarray:
    """Places in x of the other unknowns: the start, and those after the states inside the mesh."""
    inside = _inner_states(equations)
    n = inside.stop + equations.closing.turns + (equations.make is not None) + 1
    return np.append(np.arange(inside.start), np.arange(inside.stop, n))


@jax.jit
def _slopes_in_shared(equations: Equations, x):
    """Derivatives of the n pieces with respect to the shared unknowns (s,)."""
    places = _shared_places(equations)
    return jax.jacfwd(lambda u: pieces(equations, x.at[places].set(u)))(x[places])


@jax.jit
def _boundary_slopes(equations: Equations, x, end):
    """Derivatives with respect to the shared unknowns, of the start and of `boundary`.

    The last item is the derivative of `boundary` with respect to the end.
    """
    places = _shared_places(equations)

    def start(u):
        return equations.start(x.at[places].set(u))

    def value(u, end):
        at = x.at[places].set(u)
        return boundary(equations, at, start(u), end)

    u = x[places]
    return jax.jacfwd(start)(u), *jax.jacfwd(value, argnums=(0, 1))(u, end)


# ---- One mesh after another

_MESHES_MOST = 8
#: Tolerance at which stability limits the steps of stiff motions; a finer one would limit them
#: by accuracy.
_COARSE_RTOL = 1e-6


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
        if has_constraints(equations.scene):
            remedy = "Leave it out, to search by shooting."
            raise fail("strategy", "one for a scene with projected constraints", self, remedy)
        if search.segments is not None:
            raise fail("segments", "none with collocation", search.segments)
        stiff = exceeds_step_limit(equations, problem.guess)
        equations = dataclasses.replace(equations, stiff=stiff)
        found = _search(problem, equations, effort)
        if found is None:  # the motion from the guess ends early
            x = equations.pack(problem.guess[:-1], (), 0.0, 0.0, problem.guess[-1])
            return orbit_at(equations, x, math.nan, Outcome.COLLISION, rtol=effort.rtol)
        last, result, error, trouble = found
        outcome = outcome_of(InUnits(last, result.x, effort.rtol), result, trouble)
        if outcome == Outcome.FOUND and error > effort.goal:
            outcome = Outcome.MESH_LIMIT
        residual = max(float(np.abs(result.residual).max()), error)
        number = result.iterations
        return orbit_at(last, result.x, residual, outcome, rtol=effort.rtol, iterations=number)

    @staticmethod
    def may_help(search: Search, failed: Orbit) -> bool:
        """Whether collocation may find an orbit that shooting did not find.

        It may if the motion from the guess is stiff, or if integrations took too many steps.
        """
        if has_constraints(search.equations.scene):
            return False
        return failed.outcome == Outcome.STEP_LIMIT or _is_stiff(search.problem, search.equations)


def _is_stiff(problem: Problem, equations: Equations) -> bool:
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
      trouble: the test that compares iterates with the guess on the first mesh.
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
    trouble = Trouble(*_pose_on_mesh(equations, mesh, angle, period))
    for _ in range(_MESHES_MOST):
        here, x = _pose_on_mesh(equations, mesh, angle, period)
        effort.begin(f"collocation in {number_of(here.segments, 'step')}")
        lower, upper = here.bounds(problem.lower, problem.upper)
        x = np.clip(x, lower, upper)
        result = solve(here, x, lower=lower, upper=upper, effort=effort)
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


def _pose_on_mesh(
    equations: Equations, mesh: Mesh, angle: float, period: float
) -> tuple[Equations, np.ndarray]:
    """The equations on a mesh, and the unknowns x of the motion on it."""
    here, (first, *others) = on_mesh(equations, mesh), mesh.states
    return here, here.pack(first, others, angle=angle, parameter=0.0, period=period)
