"""Gauss collocation: the end of each interval of a mesh by one implicit step, and its derivatives.

A polynomial of degree m satisfies the equation at the m Gauss nodes of an interval; its end then
has an error of order 2 m. Shooting whose segments are such steps is collocation with its inner
unknowns eliminated, so that closing conditions, families and special points work as they do for
shooting. Each step begins at a state of the mesh, and all these states are solved for together:
errors that grow or decay over a period by factors too large for an integration change little over
one interval.

Reference: U. Ascher, R. Mattheij, R. Russell, Numerical Solution of Boundary Value Problems for
Ordinary Differential Equations, SIAM (1995), chapter 5; E. Doedel, Lecture Notes on Numerical
Analysis of Nonlinear Equations (2007).
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status
from jaxdyn._numerics import nan_unless
from jaxdyn.solvers.gauss import collocation
from orbits.shooting.segment import Make, Piece, scene_of

#: Nodes of an interval, which give order 16 at its end. With fewer, twelve digits need more
#: intervals.
NODES = 8
_MORE = 2  # additional nodes with which the error of a step is estimated
_ITERATIONS_MOST = 20
_CONVERGED = 1e-15  # change of the states at the nodes, relative to their size
_ACCEPTED = 1e-9  # largest last change, in the same measure, of an iteration that has converged


class Rule(NamedTuple):
    """Gauss collocation on the interval from 0 to 1.

    Attributes:
      c: (m,) nodes.
      a: (m, m) integrals of the nodes' polynomials from 0 to each node.
      d: (m,) weights; the end is the start plus `d` times the changes from the start to the nodes.
    """

    c: np.ndarray
    a: np.ndarray
    d: np.ndarray


class Step(NamedTuple):
    """The step over an interval.

    Attributes:
      end: (k,) state; NaN unless the equations of the nodes were solved.
      nodes: (m, k) states at the nodes.
      status: () `Status` code.
    """

    end: Array
    nodes: Array
    status: Array


@functools.cache
def rule(nodes: int) -> Rule:
    """The rule with the given number of nodes."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    c = (x + 1) / 2
    a = collocation(c)
    return Rule(c=c, a=a, d=np.linalg.solve(a.T, w / 2))


@functools.partial(jax.jit, static_argnames=("make", "nodes"))
def steps(scene: Scene, pieces: Piece, *, make: Make | None, nodes: int = NODES):
    """The steps over all intervals (a `Step` with a first axis of intervals).

    Args:
      scene: the scene.
      pieces: the n intervals, at least two, each of which leads nearly to the start of the next.
      make: see `Equations`.
      nodes: number of nodes.
    """
    ends = _guess_ends(pieces)
    return jax.vmap(lambda piece, end: _step(scene, make, piece, end, rule(nodes)))(pieces, ends)


@functools.partial(jax.jit, static_argnames=("make", "nodes"))
def linearize_steps(scene: Scene, pieces: Piece, *, make: Make | None, nodes: int = NODES):
    """The steps, and the derivatives of their ends with respect to the pieces (a `Piece`)."""

    def linearize_step(piece: Piece, end: Array):
        step = _step(scene, make, piece, end, rule(nodes))
        return step, _slopes(scene, make, piece, step.nodes, rule(nodes))

    return jax.vmap(linearize_step)(pieces, _guess_ends(pieces))


def _guess_ends(pieces: Piece) -> Array:
    """(n, k) guessed ends: each interval leads to the next, and the last continues straight."""
    starts, spans = pieces.start, pieces.span
    last = starts[-1] + (starts[-1] - starts[-2]) * spans[-1] / spans[-2]
    return jnp.concatenate([starts[1:], last[None]])


def local_errors(scene: Scene, pieces: Piece, *, make: Make | None) -> np.ndarray:
    """(n, k) errors of the ends, of order 2 m + 1: how much two more nodes change them."""
    few = steps(scene, pieces, make=make).end
    many = steps(scene, pieces, make=make, nodes=NODES + _MORE).end
    return np.abs(np.asarray(many - few))


def interpolate(start: np.ndarray, nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(n, k) the polynomials through starts (n, k) and nodes (n, m, k).

    Each is evaluated at its own share `at` (n,) of the interval.
    """
    points = np.append(0.0, rule(nodes.shape[1]).c)
    values = np.concatenate([start[:, None], nodes], axis=1)
    weights = np.ones((len(at), len(points)))
    for j, own in enumerate(points):
        others = np.delete(points, j)
        weights[:, j] = np.prod((at[:, None] - others) / (own - others), axis=1)
    return np.einsum("nj,njk->nk", weights, values)


def _defect(scene: Scene, make: Make | None, piece: Piece, nodes: Array, rule: Rule) -> Array:
    """(m, k) the defect, zero where the nodes' polynomial satisfies the equation at the nodes."""
    scene = scene_of(scene, make, piece.parameter)
    rates = jax.vmap(scene.rate)(piece.t0 + piece.span * rule.c, nodes)
    return nodes - piece.start[None] - piece.span * (rule.a @ rates)


def _matrix(scene: Scene, make: Make | None, piece: Piece, nodes: Array, rule: Rule) -> Array:
    """(m k, m k) the derivative of the defect with respect to the nodes."""
    scene = scene_of(scene, make, piece.parameter)
    ts = piece.t0 + piece.span * rule.c
    slopes = jax.vmap(jax.jacfwd(scene.rate, argnums=1))(ts, nodes)
    blocks = piece.span * rule.a[:, None, :, None] * jnp.moveaxis(slopes, 0, 1)[None]
    size = nodes.size
    return jnp.eye(size) - blocks.reshape(size, size)


def _step(scene: Scene, make: Make | None, piece: Piece, end: Array, rule: Rule) -> Step:
    """The step by Newton's method, from states at the nodes on the straight line to the guess."""

    def body(state):
        nodes, _, count = state
        matrix = _matrix(scene, make, piece, nodes, rule)
        defect = _defect(scene, make, piece, nodes, rule)
        move = jnp.linalg.solve(matrix, defect.ravel()).reshape(nodes.shape)
        new = nodes - move
        return new, jnp.abs(move).max() / jnp.abs(new).max(), count + 1

    def going(state):
        _, change, count = state
        return (count < _ITERATIONS_MOST) & (change > _CONVERGED)

    line = piece.start[None] + jnp.asarray(rule.c)[:, None] * (end - piece.start)[None]
    nodes, change, _ = jax.lax.while_loop(going, body, (line, jnp.inf, 0))
    reached = piece.start + rule.d @ (nodes - piece.start[None])
    solved = (change < _ACCEPTED) & jnp.isfinite(reached).all()
    status = jnp.where(solved, Status.OK, Status.STEP_TOO_LONG)
    return Step(end=nan_unless(solved, reached), nodes=nodes, status=status)


def _slopes(scene: Scene, make: Make | None, piece: Piece, nodes: Array, rule: Rule) -> Piece:
    """Derivatives of the end with respect to each field of the piece.

    They follow from the implicit function theorem.
    """

    def defect(at: Piece):
        return _defect(scene, make, at._replace(s=None), nodes, rule).ravel()

    matrix = _matrix(scene, make, piece, nodes, rule)
    by = jax.jacfwd(defect)(piece._replace(s=None))
    columns = jnp.column_stack([by.start, by.t0, by.span, by.parameter])
    # One solve for all: two batched ones that XLA runs at the same time, on as many threads as it
    # has, wait for each other forever (jaxlib 0.10, two cores).
    moves = -jnp.linalg.solve(matrix, columns)
    ends = jnp.tensordot(rule.d, moves.reshape(*nodes.shape, -1), axes=1)
    k = len(piece.start)
    return Piece(
        start=ends[:, :k] + (1.0 - rule.d.sum()) * jnp.eye(k),
        t0=ends[:, k],
        span=ends[:, k + 1],
        parameter=ends[:, k + 2],
    )
