"""Distances of chains of legs from known ones, for deflation.

A known chain may be begun at the start of any of its legs, and run through once or twice.
"""

from collections.abc import Sequence

import numpy as np

from jaxdyn._checks import fail
from orbits.hybrid.equations import Chain
from orbits.hybrid.legs import HybridOrbit

_TIMES = (1, 2)  # periods of a known chain


class Squares:
    """x -> of each known chain the square of its distance from x (u,), and its gradient (u,)."""

    def __init__(self, chain: Chain, known: Sequence[HybridOrbit], sizes: np.ndarray):
        """Measure in sizes (k,) of the first state, and in known periods.

        Raises:
          ValueError: one of the known does not close, or is of other scenes.
        """
        self._chain, self._sizes = chain, sizes
        scene = chain.legs[0].scene
        self._system = scene.system
        self._known = []
        for one in known:
            if not (isinstance(one, HybridOrbit) and one.ok):
                got = getattr(one, "message", type(one).__name__)
                raise fail("Deflated", "known chains of legs that close", got)
            legs = [leg.scene for leg in one.legs]
            starts = [np.asarray(x.y0) for x in legs if type(x.system) is type(scene.system)]
            starts = [y for y in starts if y.shape == scene.y0.shape]
            if not starts:
                raise fail("Deflated", f"known chains of {scene!r}", repr(one.legs[0].scene))
            self._known.append((starts, one.period))

    def __call__(self, x: np.ndarray) -> list[tuple[float, np.ndarray]]:
        return [self._nearest(x, *one) for one in self._known]

    def distance(self, x: np.ndarray) -> float:
        """Distance of x (u,) from the nearest known chain."""
        return min(float(np.sqrt(square)) for square, _ in self(x))

    def _nearest(self, x, starts: list[np.ndarray], period: float) -> tuple[float, np.ndarray]:
        start, spans, _ = self._chain.unpack(x)
        found = []
        for y in starts:
            off = np.asarray(self._system.difference(start, y)) / self._sizes
            for times in _TIMES:
                late = spans.sum() / (times * period) - 1.0
                by_span = np.full(len(spans), 2 * late / (times * period))
                slope = self._chain.pack(2 * off / self._sizes, by_span)
                found.append((float(off @ off) + late**2, slope))
        square, slope = min(found, key=lambda one: one[0])
        # Zero on the chain, where the gradient's direction is unknown and steps are zero.
        return max(square, np.finfo(float).tiny), slope
