"""The smooth pieces of a period of an orbit, or of a chain of legs, for comparisons.

An orbit is one piece. A chain has one for each leg; its states are compared with the start as its
closing compares them, so that a position that the closing leaves out does not count.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.solvers import Method
from jaxdyn.system import differences
from orbits.closing.sizes import sizes
from orbits.hybrid.equations import closing_error
from orbits.hybrid.legs import HybridOrbit
from orbits.motion import quick_solve
from orbits.orbit import Orbit

Periodic = Orbit | HybridOrbit

#: Share of the period: this close to the end of a leg, the state is that after the leg's change.
_AT_END = 1e-9


class Piece(NamedTuple):
    """A smooth piece of a period.

    Attributes:
      scene: the scene, with the start and the span of the piece.
      t0: time at which the piece begins.
      solver: the method that integrates it; None for the default.
      rtol: tolerance of that integration.
    """

    scene: Scene
    t0: float
    solver: Method | None
    rtol: float

    def states(self, ts: np.ndarray) -> np.ndarray:
        """(s, k) states at times (s,) since the start of the piece, in order."""
        scene = self.scene
        flow = quick_solve(scene, float(scene.t1), ts=ts, rtol=self.rtol, solver=self.solver)
        return np.asarray(flow.ys)

    def at(self, t: float) -> Array:
        """(k,) the state at a time since the start of the piece, which may lie beyond its ends."""
        if t == 0:
            return jnp.asarray(self.scene.y0)
        return quick_solve(self.scene, t, rtol=self.rtol, solver=self.solver).y1

    def like(self, other: "Piece") -> bool:
        """Whether the states of both pieces belong to one kind of system."""
        return type(self.scene.system) is type(other.scene.system) and (
            self.scene.y0.shape == other.scene.y0.shape
        )

    def same_numbers(self, other: "Piece") -> bool:
        """Whether both follow the same equations with the same numbers."""
        if self.scene is other.scene or not self.like(other):
            return self.scene is other.scene
        return bool(eqx.tree_equal(self.scene.field, other.scene.field))


def pieces(orbit: Periodic) -> tuple[Piece, ...]:
    """The pieces of a period, in order."""
    if isinstance(orbit, Orbit):
        return (Piece(orbit.scene, 0.0, orbit.solver, orbit.rtol),)
    starts = np.cumsum(orbit.spans) - orbit.spans
    return tuple(
        Piece(leg.scene, float(t0), None, orbit.rtol)
        for leg, t0 in zip(orbit.legs, starts, strict=True)
    )


def offsets(orbit: Periodic, ys, start) -> np.ndarray:
    """(s, m) by how much states (s, k) differ from a start (k,), in units of their sizes."""
    if isinstance(orbit, Orbit):
        system = orbit.scene.system
        return np.asarray(differences(system, ys, start)) / sizes(orbit.scene)
    rows = _compare_ends(orbit, start)[1]
    return np.asarray(_closing_errors(orbit.closes, ys, start)) / rows


def offset_along(orbit: Periodic, y, direction) -> np.ndarray:
    """(m,) the derivative of `offsets` at a start y (k,) along a direction (k,)."""
    if isinstance(orbit, Orbit):
        return np.asarray(direction) / sizes(orbit.scene)
    slope, rows = _compare_ends(orbit, jnp.asarray(y))
    return slope @ np.asarray(direction) / rows


def _compare_ends(orbit: HybridOrbit, start: Array) -> tuple[np.ndarray, np.ndarray]:
    """(m, k) the derivative of the quantities that a chain's closing compares, (m,) their sizes."""
    slope = np.asarray(closing_error(orbit.closes, start, start)[1][0])
    rows = np.abs(slope) @ sizes(orbit.legs[0].scene)
    return slope, np.where(rows > 0, rows, 1.0)


@eqx.filter_jit
def _closing_errors(closes, ys: Array, start: Array) -> Array:
    # A closing that counts turns adds a constant, which is subtracted.
    return jax.vmap(lambda y: closes(y, start) - closes(start, start))(ys)


def states_at(orbit: Periodic, ts: np.ndarray) -> list[tuple[Piece, np.ndarray]]:
    """The piece and the state (k,) at each of some times (s,) of the period, in order."""
    parts = pieces(orbit)
    ends = np.array([piece.t0 + float(piece.scene.t1) for piece in parts])
    near = _AT_END * ends[-1]
    which = np.minimum(np.searchsorted(ends - near, ts, side="right"), len(parts) - 1)
    found = []
    for i, piece in enumerate(parts):
        # Evaluate at all times, clipped to the piece: another number of times would recompile.
        ys = piece.states(np.clip(ts - piece.t0, 0.0, float(piece.scene.t1)))
        found += [(piece, y) for y in ys[which == i]]
    return found
