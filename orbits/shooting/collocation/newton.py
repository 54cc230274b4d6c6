"""Newton's method for the closing equations by collocation.

Unknowns are scaled: each entry of the state is in units of its largest value on the mesh, since
those of a relaxation oscillation differ by powers of ten. Steps are halved until the residual
decreases.
"""

from typing import NamedTuple

import jax
import numpy as np

from orbits.shooting.collocation import steps as gauss
from orbits.shooting.collocation.elimination import Chain, condense, expand
from orbits.shooting.equations import Equations, boundary, equation_units, pieces, sizes_at
from orbits.shooting.newton import Iteration, Result
from orbits.shooting.strategy import Effort

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
      closing: (m,) units of the equations besides the steps.
    """

    state: np.ndarray
    x: np.ndarray
    closing: np.ndarray


def scales_of(equations: Equations, x: np.ndarray) -> Scales:
    """The largest absolute values of the entries of the states at x, and what follows from them."""
    states = np.asarray(pieces(equations, x).start)
    largest = np.abs(states).max(axis=0)
    largest = np.where(largest > 0, largest, sizes_at(equations, x))
    between = np.tile(largest, (equations.segments - 1, 1))
    all_of_x = equations.pack(
        largest, between, angle=1.0, parameter=1.0, period=x[-1] / (2 * np.pi)
    )
    _, by_x, _ = map(np.asarray, _boundary_slopes(equations, x, states[0]))
    changes = by_x * all_of_x[_shared_places(equations)]
    closing = equation_units(equations, equations.closing.rows(largest), changes)
    return Scales(state=largest, x=all_of_x, closing=closing)


class _Point(NamedTuple):
    """The linearised equations at x: those of the chain, and those between its ends."""

    x: np.ndarray
    end: np.ndarray  # (k,) end of the last interval
    chain: Chain  # in scaled unknowns
    closing: np.ndarray  # (m,) residual of the closing equations, in units

    @property
    def residual(self) -> np.ndarray:
        return np.concatenate([self.chain.rest.ravel(), self.closing])


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
    point = _at(equations, x, scales)
    accepted, done = 0, 0
    report(Iteration(index=0, residual=_size(point), period=x[-1], step=0.0))
    while accepted < max_iterations and np.isfinite(point.residual).all():
        step = _step(equations, point, scales, lower, upper)
        new = _shorter_if_needed(equations, point, scales, step, lower, upper, effort)
        if new is None:
            break
        accepted += 1
        moved = float(np.linalg.norm((new.x - point.x) / scales.x))
        point = new
        report(Iteration(index=accepted, residual=_size(point), period=point.x[-1], step=moved))
        done += _size(point) <= goal
        if done > _ROUNDS_AT_GOAL or effort.over:
            break
    at_bound = ((point.x <= lower) | (point.x >= upper)) & (lower < upper)
    return Result(
        x=point.x,
        residual=point.residual,
        iterations=accepted,
        converged=bool(_size(point) <= goal),
        at_bound=bool(at_bound.any()),
        limit=accepted >= max_iterations,
    )


def _at(equations: Equations, x: np.ndarray, scales: Scales) -> _Point:
    here = jax.tree.map(np.asarray, pieces(equations, x))
    found, slopes = gauss.linearise_steps(equations.scene, here, make=equations.make)
    left, end = np.asarray(slopes.start), np.asarray(found.end)
    by = _by_shared(equations, x)
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
    chain = Chain(
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
    first = start * unit / scales.state[:, None]  # derivative of dy[0] in the shared ones
    rows = np.vstack(
        [
            np.hstack([top.left[0] @ first + top.shared[0], top.right[0]]),
            np.hstack([by_x * unit, by_end * scales.state]) / scales.closing[:, None],
        ]
    )
    rest = np.append(top.rest[0], point.closing)
    # Growth over the motion makes some rows large; scaled, each counts alike.
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
        step[_between(equations)] = states[1:-1].ravel()
        steps.append(step)
    # The shortest in all unknowns: one that is short at the ends may shift every jump between.
    found, kernel = steps[0], np.stack([*steps[1:], 0 * steps[0]], axis=1)
    return scales.x * (found - kernel @ np.linalg.lstsq(kernel, found, rcond=None)[0])


def _shorter_if_needed(
    equations, point: _Point, scales, step, lower, upper, effort: Effort
) -> _Point | None:
    for halvings in range(_HALVINGS_MOST):
        if effort.over:
            break
        new = np.clip(point.x + step / 2**halvings, lower, upper)
        if not new[-1] > 0:
            continue
        found = _at(equations, new, scales)
        if np.linalg.norm(found.residual) < np.linalg.norm(point.residual):
            return found
    return None


def _size(point: _Point) -> float:
    return float(np.abs(point.residual).max())


def _between(equations: Equations) -> slice:
    """Places in x of the states inside the mesh."""
    k = len(equations.scene.y0)
    p = len(equations.closing.free(k))
    return slice(p, p + (equations.segments - 1) * k)


def _shared_places(equations: Equations) -> np.ndarray:
    """Places in x of the other unknowns: the start, which both ends share, and the last ones."""
    inside = _between(equations)
    n = inside.stop + equations.closing.turns + (equations.make is not None) + 1
    return np.append(np.arange(inside.start), np.arange(inside.stop, n))


@jax.jit
def _by_shared(equations: Equations, x):
    """Derivatives of the n pieces with respect to the shared unknowns (s,)."""
    places = _shared_places(equations)
    return jax.jacfwd(lambda u: pieces(equations, x.at[places].set(u)))(x[places])


@jax.jit
def _boundary_slopes(equations: Equations, x, end):
    """Derivatives of the start in the shared unknowns, and of `boundary` in these and the end."""
    places = _shared_places(equations)

    def start(u):
        return equations.start(x.at[places].set(u))

    def value(u, end):
        at = x.at[places].set(u)
        return boundary(equations, at, start(u), end)

    u = x[places]
    return jax.jacfwd(start)(u), *jax.jacfwd(value, argnums=(0, 1))(u, end)
