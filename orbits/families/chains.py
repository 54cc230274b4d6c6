"""Chains of legs as a surface of solutions, so that their families are followed as of orbits.

The unknowns are those of `orbits.hybrid.equations`. The solutions continue beyond a grazed event,
but as chains that are not motions; so grazing is a special point at which a family ends.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status
from jaxdyn.integrate.events import Event
from orbits.analysis.stability import Stability, stability
from orbits.families.surface import Point, Surface, kept_directions
from orbits.hybrid.equations import ChainEquations, LinearizedChain, closing_in_sizes, pass_leg
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.motion import quick_solve
from orbits.orbit import Outcome
from orbits.shooting.equations import Units, UnknownSizes
from orbits.shooting.segment import UNTIMED, Limits

_RANK = 1e-9  # smaller singular values, relatively, belong to directions that a closing leaves out
_HOLDS = 1e-6  # a chain over several periods closes better than this if its closing allows it


class ChainSurface(Surface):
    """All solutions of the equations of a chain of legs."""

    equations: ChainEquations
    shrinks, parts = False, 1

    def orbit(self, point: Point) -> HybridOrbit:
        return self.equations.orbit(
            point.x,
            residual=point.residual,
            outcome=Outcome.FOUND,
            iterations=point.iterations,
            rtol=self.rtol,
        )

    def scene(self, orbit: HybridOrbit) -> Scene:
        return orbit.legs[0].scene

    def stability(self, orbit: HybridOrbit, point: Point, alike: np.ndarray) -> Stability:
        del point, alike  # nothing is known about integrals
        # A chain beyond a bound has multipliers too; tests there show that the bound was passed.
        closed = dataclasses.replace(orbit, outcome=Outcome.FOUND)
        return stability(closed, throw=False)

    def judge(self, orbit: HybridOrbit, known: Stability) -> HybridOrbit:
        del known
        return orbit

    def margins(self, orbit: HybridOrbit) -> np.ndarray:
        return margins(orbit)

    def status(self, x: np.ndarray) -> Status:
        known = np.isfinite(self.equations.linearize(x, self.rtol).jacobian).all()
        return Status.OK if known else Status.NOT_FINITE

    def holds(self, x: np.ndarray) -> bool:
        """Whether the equations hold at x, roughly."""
        residual, _ = self._closing_in_units(x, self._unknown_sizes(x))(x)
        return bool(np.abs(residual).max() <= _HOLDS)

    def _closing_in_units(
        self, x: np.ndarray, known: UnknownSizes, limits: Limits = UNTIMED
    ) -> "_InUnits":
        del limits  # legs have limits of their own
        return _InUnits(self.equations, x, self.rtol, self._units(x, known), known.sizes)

    def _unknown_sizes(self, x: np.ndarray, least: np.ndarray | float = 0.0) -> UnknownSizes:
        chain, unknowns = self.equations, self.equations.unpack(x)
        found = chain.linearize(x, self.rtol)
        leg_sizes = chain.sizes(found, unknowns.spans, unknowns.parameter)
        own = np.maximum(leg_sizes[0], least)
        if chain.make is None:
            return UnknownSizes(own)
        rows = chain.residual_units(found, unknowns.spans, leg_sizes, unknowns.parameter)
        # A unit of the parameter changes the most sensitive equation by that equation's unit.
        most = float(np.abs(found.jacobian[:, -2] / rows).max())
        return UnknownSizes(own, 1 / most if 0 < most < np.inf else 1.0)

    def _units(self, x: np.ndarray, known: UnknownSizes) -> np.ndarray:
        radians = self.equations.unpack(x).spans / (2 * np.pi)
        return self.equations.pack(known.sizes, radians, known.parameter)

    def _in_units(self, point: Point) -> np.ndarray:
        jacobian = point.jacobian * point.units
        rows = np.linalg.norm(jacobian, axis=1, keepdims=True)
        return jacobian / np.where(rows > 0, rows, 1.0)

    def _neutral(self, x, jacobian, in_units: np.ndarray, entry_sizes: np.ndarray) -> np.ndarray:
        chain, unknowns = self.equations, self.equations.unpack(x)
        start = unknowns.start
        scene = chain.legs_at(unknowns.parameter)[0].scene
        shift = np.zeros(len(unknowns.spans))
        shift[0], shift[-1] = shift[0] - 1.0, shift[-1] + 1.0
        columns = [chain.pack(np.asarray(scene.rate(0.0, start)), shift)]
        by_start = closing_in_sizes(chain.closes, start, start, entry_sizes)[1]
        _, s, vt = np.linalg.svd(by_start)
        compared = int((s > _RANK * s.max(initial=0.0)).sum())
        columns += [chain.pack(entry_sizes * v, np.zeros_like(shift)) for v in vt[compared:]]
        return kept_directions(jacobian, [column / in_units for column in columns])


class _InUnits:
    """The equations of a chain in the units of the motion at a first point; see `Closed`."""

    def __init__(
        self, chain: ChainEquations, x: np.ndarray, rtol: float, in_units: np.ndarray, sizes
    ):
        self.chain, self.rtol, self.sizes = chain, rtol, sizes
        unknowns = chain.unpack(x)
        self._last = x, chain.linearize(x, rtol)
        leg_sizes = chain.sizes(self._last[1], unknowns.spans, unknowns.parameter)
        rows = chain.residual_units(self._last[1], unknowns.spans, leg_sizes, unknowns.parameter)
        self.units = Units(in_units, rows)

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = self._at(x)
        value, jacobian = found.value / self.units.residual, self.units.jacobian(found.jacobian)
        if not (self.chain.unpack(x).spans > 0).all():
            return np.full_like(value, np.nan), np.full_like(jacobian, np.nan)
        return value, jacobian

    def _at(self, x: np.ndarray) -> LinearizedChain:
        if not np.array_equal(x, self._last[0]):
            self._last = x, self.chain.linearize(x, self.rtol)
        return self._last[1]


# ---- How far a chain of legs is from grazing: numbers that change sign where it grazes
#
# A leg grazes the event at its end where it meets the event at zero speed. It grazes a bound where
# the bound has a minimum of zero on the way. Beyond that the chain closes, but is not a motion: it
# meets an event from its far side, or passes a bound.

_SAMPLES = 400  # samples of a leg, to find a minimum, and again about that sample, to refine it


def margins(orbit: HybridOrbit) -> np.ndarray:
    """(e,) for each leg the speed at its event, and the smallest minimum of each of its bounds.

    For a bound without a minimum inside its leg, the number is its largest absolute value there.
    """
    found = []
    for leg in orbit.legs:
        if leg.ends:
            rtol = np.asarray(orbit.rtol, float)
            _, (_, by_span) = pass_leg(leg, np.asarray(leg.scene.y0), leg.scene.t1, rtol)
            found.append(float(by_span[1][0]))
        found += [_least_minimum(leg, bound, orbit.rtol) for bound in leg.bounds]
    return np.array(found)


def _least_minimum(leg: Leg, bound: Event, rtol: float) -> float:
    """The smallest local minimum of a bound inside a leg."""
    ts = np.linspace(0.0, float(leg.scene.t1), _SAMPLES + 1)
    values = _along(leg, bound, ts, rtol)
    inside = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])) + 1
    least = [_refine(leg, bound, ts[i - 1 : i + 2], rtol) for i in inside]
    return min(least, default=float(np.abs(values).max()))


def _refine(leg: Leg, bound: Event, ts: np.ndarray, rtol: float) -> float:
    """The minimum of a bound between three times."""
    values = _along(leg, bound, np.linspace(ts[0], ts[-1], _SAMPLES + 1), rtol)
    i = int(np.clip(np.argmin(values), 1, _SAMPLES - 1))
    left, middle, right = values[i - 1 : i + 2]
    bend = left - 2 * middle + right
    return float(middle - (right - left) ** 2 / (8 * bend)) if bend > 0 else float(middle)


def _along(leg: Leg, bound: Event, ts: np.ndarray, rtol: float) -> np.ndarray:
    ys = quick_solve(leg.scene, ts[-1], ts=ts, rtol=rtol).ys
    return np.asarray(_values(bound, jnp.asarray(ts), ys))


@eqx.filter_jit
def _values(bound: Event, ts: Array, ys: Array) -> Array:
    return jax.vmap(bound.value)(ts, ys)
