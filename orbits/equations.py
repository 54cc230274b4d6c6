"""The closing equations of an orbit and their Jacobian: what Newton's method is given.

The unknowns are the start (those entries of it that the closing condition leaves free) and
the period; with several segments also the states in between, each integrated by itself, so
that an unstable orbit's errors do not grow over a whole period; the angle of a relative orbit;
the parameter of a family. They lie in one vector x, the period last.

Each segment is integrated once with its variational equations. What closes is then a cheap
function of the ends and of x, whose Jacobian autodiff takes with the ends made linear in x.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene
from jaxdyn.flow import Flow
from jaxdyn.simulate import solve
from orbits.closing import Closing
from orbits.conditions import Condition

#: From the number a family is named after to a scene; its start and span do not matter.
Make = Callable[[Array], Scene]


class Unknowns(NamedTuple):
    """The parts of x."""

    start: Array  # (p,) free entries of the start
    between: Array  # (segments - 1, k)
    angle: Array  # () of a relative orbit, else 0
    parameter: Array  # () of a family, else 0
    period: Array  # ()


class Evaluation(NamedTuple):
    """The closing equations at a point x.

    Attributes:
      residual: (m,) what does not close.
      jacobian: (m, len(x)).
      transitions: (segments, k, k) derivative of each segment's end by its start.
      status: () `Status` code of the integrations, the worst.
    """

    residual: Array
    jacobian: Array
    transitions: Array
    status: Array


class Equations(eqx.Module):
    """Closing equations of a scene: x -> residual and Jacobian.

    Attributes:
      scene: what moves; its start is a start of the kind that the closing condition demands.
      closing: what must close.
      conditions: what else must hold.
      make: the scene of a family's parameter; None where there is no parameter.
      segments: pieces integrated by themselves.
      driven: whether the rate depends on time, so that segments start at their own times.
    """

    scene: Scene
    closing: Closing
    conditions: tuple[Condition, ...] = ()
    make: Make | None = eqx.field(static=True, default=None)
    segments: int = eqx.field(static=True, default=1)
    driven: bool = eqx.field(static=True, default=False)

    def unpack(self, x: Array | np.ndarray) -> Unknowns:
        """x taken apart."""
        k = len(self.scene.y0)
        p = len(self.closing.free(k))
        middle = p + (self.segments - 1) * k
        angle, parameter = self.closing.turns, self.make is not None
        zero = 0.0 * x[-1]
        return Unknowns(
            x[:p],
            x[p:middle].reshape(self.segments - 1, k),
            x[middle] if angle else zero,
            x[middle + angle] if parameter else zero,
            x[-1],
        )

    def pack(self, y0, between, angle, parameter, period) -> np.ndarray:
        """The unknowns as one vector."""
        start = np.asarray(y0)[self.closing.free(len(self.scene.y0))]
        more = [angle] * self.closing.turns + [parameter] * (self.make is not None)
        return np.concatenate([start, np.ravel(between), more, [period]]).astype(float)

    def scene_at(self, parameter) -> Scene:
        """The scene with this parameter of the family."""
        if self.make is None:
            return self.scene
        made = self.make(parameter)
        return Scene(made.system, made.effects, y0=self.scene.y0, t1=self.scene.t1)

    def start(self, x) -> Array:
        """(k,) the start that x stands for."""
        unknowns = self.unpack(x)
        system = self.scene_at(unknowns.parameter).system
        return self.closing.start(system, unknowns.start, self.scene.y0)

    def spread(self, y0, period, rtol, angle=0.0, parameter=0.0) -> np.ndarray:
        """x of a motion: the states in between are those that it passes."""
        part = period / self.closing.parts
        ts = np.arange(1, self.segments) * part / self.segments
        scene = self.scene_at(jnp.asarray(parameter, float)).starting(y0)
        between = solve(scene, part, ts=ts, rtol=rtol).ys if self.segments > 1 else ()
        return self.pack(y0, between, angle, parameter, period)

    def repeated(self, times: int) -> "Equations":
        """The equations of the same motions taken as many periods as one."""
        scene = self.scene.starting(self.scene.y0, times * self.scene.t1)
        return dataclasses.replace(self, scene=scene, segments=times * self.segments)

    def repeat(self, x: np.ndarray, times: int, rtol) -> np.ndarray:
        """x of the same motion for `repeated` equations."""
        unknowns = self.unpack(x)
        angle, period = (times * float(n) for n in (unknowns.angle, unknowns.period))
        parameter = float(unknowns.parameter)
        return self.repeated(times).spread(self.start(x), period, rtol, angle, parameter)

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bounds (k + 1,) on the start and the period as bounds on x; the rest is free."""

        def on_x(b: np.ndarray, free: float) -> np.ndarray:
            between = np.full((self.segments - 1, len(b) - 1), free)
            return self.pack(b[:-1], between, free, free, b[-1])

        return on_x(lower, -np.inf), on_x(upper, np.inf)

    def __call__(self, x: np.ndarray, rtol: float) -> Evaluation:
        if not x[-1] > 0:  # no integration backwards, nor for no time
            x = np.where(np.arange(len(x)) == len(x) - 1, np.nan, x)
        return evaluate(self, jnp.asarray(x), rtol)


@jax.jit
def evaluate(equations: Equations, x: Float[Array, " n"], rtol) -> Evaluation:
    """Residual and Jacobian at x."""
    here = _pieces(equations, x)
    flow = functools.partial(_flow, equations, rtol=rtol)
    # One after the other, each with its own steps; a loop compiles once for all of them.
    ends, status, slopes = jax.lax.map(flow, (here, jnp.arange(equations.segments)))
    residual, jacobian = _linearised(equations, x, here, ends, slopes)
    return Evaluation(residual, jacobian, slopes.start, status.max())


def residual_at(equations: Equations, x: Array, rtol) -> Array:
    """What does not close at x alone, differentiable in every number of the equations."""
    here = _pieces(equations, x)
    ends = [
        _end(equations, jax.tree.map(lambda leaf, i=i: leaf[i], here), i, rtol).y1
        for i in range(equations.segments)
    ]
    return _errors(equations, x, here.start, jnp.stack(ends))


class _Piece(NamedTuple):
    """What a segment's end depends on; each with a first axis of segments."""

    start: Array
    span: Array
    parameter: Array


def _pieces(equations: Equations, x: Array) -> _Piece:
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    count = equations.segments
    span = unknowns.period / (equations.closing.parts * count)
    first = equations.start(x)
    times = span * jnp.arange(1, count) * equations.driven
    between = jax.vmap(scene.system.project)(times, unknowns.between)
    starts = jnp.concatenate([first[None], between])
    return _Piece(starts, jnp.full(count, span), jnp.full(count, unknowns.parameter))


def _flow(equations: Equations, piece_and_index, rtol):
    piece, i = piece_and_index

    def end(piece: _Piece):
        flow = _end(equations, piece, i, rtol)
        return flow.y1, (flow.y1, flow.status)

    slopes, (y1, status) = jax.jacfwd(end, has_aux=True)(piece)
    return y1, status, slopes


def _end(equations: Equations, piece: _Piece, i, rtol) -> Flow:
    scene = equations.scene_at(piece.parameter).starting(piece.start)
    t0 = i * piece.span if equations.driven else 0.0
    return solve(scene, t0 + piece.span, t0=t0, rtol=rtol)


def _linearised(equations: Equations, x: Array, here: _Piece, ends: Array, slopes: _Piece):
    def residual(x):
        moved = _pieces(equations, x)
        change = jnp.sum(slopes.start * (moved.start - here.start)[:, None, :], axis=-1)
        change = change + slopes.span * (moved.span - here.span)[:, None]
        if equations.make is not None:
            change = change + slopes.parameter * (moved.parameter - here.parameter)[:, None]
        errors = _errors(equations, x, moved.start, ends + change)
        return errors, errors

    jacobian, value = jax.jacfwd(residual, has_aux=True)(x)
    return value, jacobian


def _errors(equations: Equations, x: Array, starts: Array, ends: Array) -> Array:
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    system, closing = scene.system, equations.closing
    joints = jax.vmap(system.difference)(ends[:-1], starts[1:]).ravel()
    last = closing.miss(system, ends[-1], starts[0], unknowns.angle)
    more = [c.value(scene, starts[0], unknowns.period) for c in equations.conditions]
    return jnp.concatenate([joints, last, jnp.asarray(more, float).reshape(-1)])
