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
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.integrate.flow import Flow
from orbits.closing.closings import Closing
from orbits.closing.conditions import Condition
from orbits.closing.given import driven
from orbits.motion import advanced
from orbits.orbit import Orbit

#: Steps of one segment: an orbit with so many is none that could be found, and on its way
#: towards a collision an iteration must not take minutes.
MAX_STEPS = 200_000
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
      shares: of the time to integrate that each segment takes; their sum is 1.
      s_spans: spans of logarithmic time of the segments; None in plain time.
      driven: whether the rate depends on time, so that segments start at their own times.
    """

    scene: Scene
    closing: Closing
    conditions: tuple[Condition, ...] = ()
    make: Make | None = eqx.field(static=True, default=None)
    shares: tuple[float, ...] = (1.0,)
    s_spans: tuple[float, ...] | None = None
    driven: bool = eqx.field(static=True, default=False)

    @classmethod
    def of(cls, orbit: Orbit, conditions: tuple[Condition, ...] = (), make: Make | None = None):
        """The equations of a known orbit, in one segment."""
        spans = None if orbit.s_period is None else (orbit.s_period / orbit.closing.parts,)
        here = orbit.scene, orbit.closing, conditions, make
        return cls(*here, s_spans=spans, driven=driven(orbit.scene))

    @property
    def s_period(self) -> float | None:
        """The logarithmic time of a whole period; None in plain time."""
        return None if self.s_spans is None else self.closing.parts * sum(self.s_spans)

    @property
    def segments(self) -> int:
        """How many pieces are integrated by themselves."""
        return len(self.shares)

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
        return made(self.scene, self.make, parameter)

    def start(self, x) -> Array:
        """(k,) the start that x stands for."""
        unknowns = self.unpack(x)
        system = self.scene_at(unknowns.parameter).system
        return self.closing.start(system, unknowns.start, self.scene.y0)

    def spread(self, y0, period, rtol, angle=0.0, parameter=0.0) -> np.ndarray:
        """x of a motion: the states in between are those that it passes."""
        scene = self.scene_at(jnp.asarray(parameter, float)).starting(y0)
        between, t = [], 0.0
        # One after the other: samples would be compiled anew for each number of them.
        for share, s in zip(self.shares[:-1], self._spans, strict=False):
            t0 = t if self.driven else 0.0
            span = share * period / self.closing.parts
            scene = scene.starting(advanced(scene, span, s, t0=t0, rtol=rtol).y1)
            between.append(np.asarray(scene.y0))
            t += span
        return self.pack(y0, between, angle, parameter, period)

    def transitions(self, y0, period, rtol, parameter=0.0) -> np.ndarray:
        """(segments, k, k) derivative of each segment's end by its start, along one motion."""
        y, t, maps = jnp.asarray(y0, float), 0.0, []
        for share, s in zip(self.shares, self._spans, strict=True):
            span = share * period / self.closing.parts
            numbers = (y, t * self.driven, span, parameter, s)
            piece = jax.tree.map(lambda z: jnp.asarray(z, float), Piece(*numbers))
            y, _, slopes = flow(self.scene, piece, rtol, make=self.make)
            maps.append(np.asarray(slopes.start))
            t += span
        return np.stack(maps)

    @property
    def _spans(self) -> tuple[float | None, ...]:
        return (None,) * self.segments if self.s_spans is None else self.s_spans

    def repeated(self, times: int) -> "Equations":
        """The equations of the same motions taken as many periods as one."""
        scene = self.scene.starting(self.scene.y0, times * self.scene.t1)
        shares = tuple(share / times for share in self.shares) * times
        spans = None if self.s_spans is None else self.s_spans * times
        return dataclasses.replace(self, scene=scene, shares=shares, s_spans=spans)

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
        """Residual and Jacobian at x; NaN where a segment does not last."""
        if not x[-1] > 0:  # no integration backwards, nor for no time
            x = np.where(np.arange(len(x)) == len(x) - 1, np.nan, x)
        here = jax.tree.map(np.asarray, pieces(self, x))
        # One compiled program for any number of segments; threads put them on all cores.
        each = [jax.tree.map(lambda leaf, i=i: leaf[i], here) for i in range(self.segments)]
        integrate = functools.partial(flow, self.scene, rtol=rtol, make=self.make)
        if self.segments == 1:  # starting a thread takes as long as a few plain integrations
            found = [integrate(each[0])]
        else:
            with ThreadPoolExecutor(self.segments) as threads:
                found = list(threads.map(integrate, each))
        ends, status, slopes = jax.tree.map(lambda *leaves: np.stack(leaves), *found)
        residual, jacobian = linearised(self, x, here, ends, slopes)
        return Evaluation(residual, jacobian, slopes.start, status.max())


def made(scene: Scene, make: Make | None, parameter) -> Scene:
    """The scene, or the one that is made of a parameter, with its start and span."""
    if make is None:
        return scene
    return make(parameter).starting(scene.y0, scene.t1)


@jax.jit
def size_and_speed(equations: Equations, x: Array) -> tuple[Array, Array]:
    """Largest entry of the start that x stands for, and the norm of the rate there."""
    y0 = equations.start(x)
    scene = equations.scene_at(equations.unpack(x).parameter)
    return jnp.abs(y0).max(), jnp.linalg.norm(scene.rate(jnp.zeros(()), y0))


class Piece(NamedTuple):
    """What a segment's end depends on; with a first axis of segments where there are several."""

    start: Array
    t0: Array
    span: Array
    parameter: Array
    s: Array | None = None  # logarithmic time; nothing is differentiated by it


@jax.jit
def pieces(equations: Equations, x: Array) -> Piece:
    """The segments that x stands for."""
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    spans = unknowns.period / equations.closing.parts * jnp.asarray(equations.shares)
    first = equations.start(x)
    times = jnp.where(equations.driven, jnp.cumsum(spans) - spans, 0.0)
    between = jax.vmap(scene.system.project)(times[1:], unknowns.between)
    starts = jnp.concatenate([first[None], between])
    s = None if equations.s_spans is None else jnp.asarray(equations.s_spans, float)
    return Piece(starts, times, spans, jnp.full_like(spans, unknowns.parameter), s)


@functools.partial(jax.jit, static_argnames="make")
def flow(scene: Scene, piece: Piece, rtol, *, make: Make | None):
    """A segment's end, its status, and the derivatives of the end."""

    def end(moved: Piece):
        found = _end(scene, make, moved._replace(s=piece.s), rtol)
        return found.y1, (found.y1, found.status)

    slopes, (y1, status) = jax.jacfwd(end, has_aux=True)(piece._replace(s=None))
    return y1, status, slopes


def _end(scene: Scene, make: Make | None, piece: Piece, rtol) -> Flow:
    scene = made(scene, make, piece.parameter).starting(piece.start)
    how = {"t0": piece.t0, "rtol": rtol, "max_steps": MAX_STEPS}
    return advanced(scene, piece.span, piece.s, **how)


@jax.jit
def linearised(equations: Equations, x: Array, here: Piece, ends: Array, slopes: Piece):
    """(residual, Jacobian) at x from the segments' ends and their derivatives."""

    def residual(x):
        change = jax.tree.map(jnp.subtract, pieces(equations, x), here)
        moved = jnp.sum(slopes.start * change.start[:, None, :], axis=-1)
        moved = moved + slopes.span * change.span[:, None] + slopes.t0 * change.t0[:, None]
        moved = moved + slopes.parameter * change.parameter[:, None]
        errors = _errors(equations, x, here.start + change.start, ends + moved)
        return errors, errors

    jacobian, value = jax.jacfwd(residual, has_aux=True)(x)
    return value, jacobian


def residual_at(equations: Equations, x: Array, rtol) -> Array:
    """What does not close at x alone, differentiable in every number of the equations."""
    here = pieces(equations, x)
    each = [jax.tree.map(lambda leaf, i=i: leaf[i], here) for i in range(equations.segments)]
    ends = [_end(equations.scene, equations.make, piece, rtol).y1 for piece in each]
    return _errors(equations, x, here.start, jnp.stack(ends))


def _errors(equations: Equations, x: Array, starts: Array, ends: Array) -> Array:
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    system, closing = scene.system, equations.closing
    joints = jax.vmap(system.difference)(ends[:-1], starts[1:])
    # Where bodies pass fast and near each other the rounding of a joint is that of its state.
    sizes = jax.lax.stop_gradient(jnp.maximum(jnp.abs(ends[:-1]).max(axis=1), 1.0))
    joints = (joints / sizes[:, None]).ravel()
    last = closing.miss(system, ends[-1], starts[0], unknowns.angle)
    more = [c.value(scene, starts[0], unknowns.period) for c in equations.conditions]
    return jnp.concatenate([joints, last, jnp.asarray(more, float).reshape(-1)])
