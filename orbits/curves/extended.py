"""Equations of curves of special orbits in two parameters, with exact Jacobians.

With M the derivative of the state after one part of the period with respect to the start, g the
symmetry by which the orbit closes (1 if there is none), and f the rate at the end:

- Fold: closing, M w + b f = g w, |w| = 1; in autonomous scenes w is orthogonal to the rate at the
  start, in driven ones b = 0. Lengths and angles are in the sizes of the entries (`units`).
- Period doubling: closing, M w = -g w. With a symmetry of two parts this is a branch point, where
  a second family without the symmetry crosses.
- Torus point: closing, M w = g u, M u = g (2 c u - w), where the multipliers exp(+-i a) have
  cos a = c. The curve passes c = -1 and 1, beyond which the multipliers are real.

Products M w are integrated together with the motion, with the state (y, w) or (y, w, u) of one
system, in segments; the first derivatives of this system are second derivatives of the motion. The
period of a driven scene is fixed by a condition on the drive. That is one condition with several
entries, so that Newton's steps are solved for by least squares.

Reference: Doedel, Kernevez, Keller (1991), Int. J. Bifurc. Chaos 1, 745; Govaerts, Kuznetsov,
Dhooge (2005), SIAM J. Sci. Comput. 27, 231.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, System
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.continuation.kinds import Kind
from orbits.closing.closings import Return
from orbits.closing.given import drive
from orbits.shooting.segment import Piece, linearize_end, map_segments

MakeOfTwo = Callable[[Array, Array], Scene]

#: Offset from the start, in sizes, at which a drive is read, since it may cancel at the start.
_BESIDE = 0.1

#: Number of vectors carried along the motion for each kind.
VECTORS = {Kind.FOLD: 1, Kind.BRANCH: 1, Kind.DOUBLING: 1, Kind.TORUS: 2}


class Varied(System):
    """The state y of a scene, and m perturbations of it, in one state (y, w, ..).

    Attributes:
      make: (p, q) -> scene.
      parameters: (2,) p and q.
      vectors: the number m of perturbations.
    """

    make: MakeOfTwo = eqx.field(static=True)
    parameters: Array
    vectors: int = eqx.field(static=True)

    def labels(self):
        labels = self.make(*self.parameters).labels()
        more = [(f"w{i}{j}", "1") for i in range(self.vectors) for j in range(len(labels))]
        return (*labels, *more)

    def rate(self, t, y, effects):
        del effects
        scene = self.make(*self.parameters)
        y = y.reshape(self.vectors + 1, -1)
        value, derivative = jax.linearize(lambda y: scene.rate(t, y), y[0])
        return jnp.concatenate([value, *(derivative(w) for w in y[1:])])


@functools.lru_cache(maxsize=32)
def extended_make(make: MakeOfTwo, vectors: int) -> Callable[[Array], Scene]:
    """The function (2,) parameters -> scene of (y, w, ..); the same for the same arguments."""

    def extended(parameters: Array) -> Scene:
        k = len(make(*parameters).labels())
        system = Varied(make=make, parameters=parameters, vectors=vectors)
        return Scene(system, y0=jnp.zeros((vectors + 1) * k))

    return extended


class Unknowns(NamedTuple):
    """The unknowns, by name.

    Attributes:
      states: (n, k) starts of the segments.
      vectors: (n, m, k) the perturbations there.
      period: () the period.
      parameters: (2,) the parameters.
      extra: () b of a fold, c of a torus point, 0 for other kinds.
    """

    states: Array
    vectors: Array
    period: Array
    parameters: Array
    extra: Array


class Frame(NamedTuple):
    """The data that fix the lengths of the vectors, the phase, and the place on the curve.

    Attributes:
      sizes: (k,) sizes of the entries of the state.
      time: unit of time of the motion, a radian of the period.
      rows: (1 or 2, k) rows whose products with the first vector are 1 and 0.
      start: (k,) a state; the phase of an autonomous scene is the one nearest to it.
      flow: (k,) a row whose product with a change of the start is its length along the rate, in
        sizes.
      point: (k + 3,) a start, period and parameters.
      along: (k + 3,) normal of the plane through `point` in which the solution lies; its product
        with a change of start, period and parameters is a length in units.
    """

    sizes: np.ndarray
    time: float
    rows: np.ndarray
    start: np.ndarray
    flow: np.ndarray
    point: np.ndarray
    along: np.ndarray


class Extended(eqx.Module):
    """The equations of a kind of special orbit: unknowns -> residual and Jacobian.

    Attributes:
      make: (p, q) -> scene.
      kind: kind of the orbits.
      closing: how they close.
      driven: whether the rate depends on time.
      segments: number of segments, of equal length.
      k: number of entries of the state.
      rtol: tolerance of the integrations.
    """

    make: MakeOfTwo = eqx.field(static=True)
    kind: Kind = eqx.field(static=True)
    closing: Return
    driven: bool = eqx.field(static=True)
    segments: int = eqx.field(static=True)
    k: int = eqx.field(static=True)
    rtol: float

    @property
    def vectors(self) -> int:
        """Number of vectors carried along."""
        return VECTORS[self.kind]

    @property
    def has_extra(self) -> bool:
        """Whether b or c is among the unknowns."""
        return self.kind == Kind.TORUS or (self.kind == Kind.FOLD and not self.driven)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.segments * (self.vectors + 1) * self.k + 3 + self.has_extra

    def unpack(self, x) -> Unknowns:
        """The unknowns that x consists of."""
        n, m, k = self.segments, self.vectors, self.k
        rest = x[n * (m + 1) * k :]
        return Unknowns(
            states=x[: n * k].reshape(n, k),
            vectors=x[n * k : n * (m + 1) * k].reshape(n, m, k),
            period=rest[0],
            parameters=rest[1:3],
            extra=rest[3] if self.has_extra else 0.0 * rest[0],
        )

    def pack(self, states, vectors, period, parameters, extra) -> np.ndarray:
        """x (n,) of these unknowns."""
        more = [extra] * self.has_extra
        parts = (np.ravel(states), np.ravel(vectors), [period], parameters, more)
        return np.concatenate(parts).astype(float)

    @property
    def place(self) -> np.ndarray:
        """Indices of start, period and parameters in x."""
        at = self.segments * (self.vectors + 1) * self.k
        return np.append(np.arange(self.k), at + np.arange(3))

    def pieces(self, x) -> Piece:
        """The segments at x."""
        unknowns, n = self.unpack(x), self.segments
        together = jnp.concatenate([unknowns.states[:, None], unknowns.vectors], axis=1)
        span = unknowns.period / (self.closing.parts * n)
        return Piece(
            start=together.reshape(n, -1),
            t0=span * jnp.arange(n, dtype=float) * float(self.driven),
            span=jnp.full(n, span),
            parameter=jnp.tile(unknowns.parameters, (n, 1)),
        )

    def __call__(self, x: np.ndarray, frame: Frame):
        """The residual (r,), its Jacobian (r, n), and M (k, k) at x; NaN if a motion ends early."""
        here = jax.tree.map(np.asarray, _pieces(self, x))
        extended = extended_make(self.make, self.vectors)
        base = extended(jnp.asarray(here.parameter[0]))
        integrate = functools.partial(linearize_end, base, rtol=self.rtol, make=extended)
        ends, slopes = (found := map_segments(integrate, here)).y1, found.slopes
        residual, jacobian = map(np.asarray, _linearize(self, x, here, ends, slopes, frame))
        k = self.k
        monodromy = functools.reduce(lambda m, s: s[:k, :k] @ m, slopes.start, np.eye(k))
        return residual, jacobian, monodromy

    def errors(self, x: Array, ends: Array, frame: Frame) -> Array:
        """(r,) the residual at x from the ends (n, (m + 1) k) of the segments."""
        unknowns, n = self.unpack(x), self.segments
        scene = self.make(*unknowns.parameters)
        ends = ends.reshape(n, self.vectors + 1, self.k)
        joints = jax.vmap(scene.system.difference)(ends[:-1, 0], unknowns.states[1:])
        carried = ends[:-1, 1:] - unknowns.vectors[1:]
        start, end, w = unknowns.states[0], ends[-1, 0], unknowns.vectors[0]

        def miss(end, start):
            return self.closing.residual(scene.system, end, start, jnp.zeros(()))

        def carried_over(after, before):
            return jax.jvp(miss, (end, start), (after, before))[1]

        after = ends[-1, 1:]
        if self.kind == Kind.TORUS:
            returned = [
                carried_over(after[0], w[1]),
                carried_over(after[1], 2 * unknowns.extra * w[1] - w[0]),
            ]
        elif self.kind == Kind.FOLD:
            t1 = unknowns.period / self.closing.parts * float(self.driven)
            returned = [carried_over(after[0] + unknowns.extra * scene.rate(t1, end), w[0])]
        else:
            returned = [carried_over(after[0], -w[0])]
        held = frame.rows @ w[0] - jnp.eye(len(frame.rows))[0]
        place = jnp.concatenate([start, unknowns.period[None], unknowns.parameters])
        if self.driven:
            more = [drive(scene, start, unknowns.period, _BESIDE * frame.sizes)]
        else:
            more = [(jnp.asarray(frame.flow) @ (start - frame.start))[None]]
            if self.kind == Kind.FOLD:
                flow, first = scene.rate(0.0, start) / frame.sizes, w[0] / frame.sizes
                more.append((frame.time * flow @ first)[None])
        plane = (jnp.asarray(frame.along) @ (place - frame.point))[None]
        parts = [joints.ravel(), carried.ravel(), miss(end, start), *returned, held, *more, plane]
        return jnp.concatenate(parts)


@eqx.filter_jit
def _pieces(extended: Extended, x: Array) -> Piece:
    return extended.pieces(x)


@eqx.filter_jit
def _linearize(extended: Extended, x, here: Piece, ends, slopes: Piece, frame: Frame):
    """The residual and the Jacobian at x from the segments' ends and their derivatives."""

    def residual(x):
        change = jax.tree.map(jnp.subtract, extended.pieces(x), here)
        by_x = jnp.einsum("nij,nj->ni", slopes.start, change.start)
        by_x = by_x + slopes.span * change.span[:, None] + slopes.t0 * change.t0[:, None]
        by_x = by_x + jnp.einsum("nij,nj->ni", slopes.parameter, change.parameter)
        return extended.errors(x, ends + by_x, frame)

    return value_and_jacfwd(residual)(x)
