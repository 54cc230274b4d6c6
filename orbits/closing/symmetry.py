"""Symmetries of a scene that permute the entries of its state and change their signs.

These include relabelling equal bodies, reflections, half turns and time reversals, but not
rotations by other angles, for which see `orbits.relative`.
"""

from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn._records import Record
from orbits.closing.sizes import rates_at, sizes, times

#: Largest error, in units of the sizes, by which a symmetry may fail to preserve the vector field.
EXACT = 1e-9

A = TypeVar("A", Array, np.ndarray)


class Symmetry(Record):
    """The map y -> g y, where entry i of g y is ``signs[i]`` times entry ``places[i]`` of y.

    Attributes:
      places: (k,) index of the entry that each entry comes from; None for the identity.
      signs: (k,) +1 or -1 for each entry; None for all +1.
      reversing: whether it maps motions to time-reversed motions.
    """

    places: tuple[int, ...] | None = eqx.field(static=True, default=None)
    signs: tuple[int, ...] | None = eqx.field(static=True, default=None)
    reversing: bool = eqx.field(static=True, default=False)

    def act(self, y: A) -> A:
        """(k,) the symmetry applied to a state, or to a rate up to the direction of time."""
        y = y if self.places is None else y[np.array(self.places)]
        return y if self.signs is None else y * np.array(self.signs, float)

    @property
    def inverse(self) -> "Symmetry":
        """The symmetry that undoes this one."""
        signs = self.signs
        if self.places is None:
            return self
        back = np.argsort(self.places)
        signs = None if signs is None else tuple(np.array(signs)[back].tolist())
        return Symmetry(tuple(back.tolist()), signs, self.reversing)

    def check(self, scene: Scene, later: float = 0.0) -> None:
        """Raise ValueError unless this maps motions of the scene to motions of the scene.

        The images begin at time `later`, from which a reversing symmetry counts time backwards.
        """
        k = len(scene.y0)
        if self.places is not None and sorted(self.places) != list(range(k)):
            raise fail(
                "closing",
                f"a permutation of the {k} entries of the state",
                f"one of {len(self.places)} places",
                "choreography(n, d) makes one for n free points in d dimensions.",
            )
        if self.signs is not None and not (len(self.signs) == k and {*self.signs} <= {1, -1}):
            raise fail("closing", f"{k} signs, each 1 or -1", f"{self.signs}")
        self._check_rate(scene, later)

    def _check_rate(self, scene: Scene, later: float) -> None:
        # Otherwise the motion after the first part would not be an image of the first part.
        if self == IDENTITY and not later:
            return
        ts, y, back = times(scene), np.asarray(scene.y0), -1.0 if self.reversing else 1.0
        there = np.asarray(rates_at(scene, later + back * ts, self.act(y)))
        here = back * np.stack([self.act(f) for f in np.asarray(rates_at(scene, ts, y))])
        most = EXACT * 2 * np.pi / float(scene.t1) * sizes(scene)
        if not (np.abs(there - here) <= most).all():
            raise fail(
                "closing",
                "a symmetry of the scene",
                "one that changes its forces",
                "Bodies that are exchanged need equal masses, forces that depend on the sign of a "
                "velocity have no time reversal, and a drive must be the image of itself a part of "
                "the period earlier.",
            )


IDENTITY = Symmetry()


def order(act: Callable[[np.ndarray], np.ndarray], k: int) -> int:
    """The order of a symmetry on states of k entries: the power that is the identity."""
    entries = np.arange(1, k + 1)
    image, times = act(entries), 1
    while not np.array_equal(image, entries):
        image, times = act(image), times + 1
    return times


def point_symmetry(order, axes=(1, 1), *, reversing: bool = False) -> Symmetry:
    """A symmetry of free points: a relabelling, reflections of axes, optionally a time reversal.

    Args:
      order: (n,) index of the point whose place each point takes.
      axes: (d,) +1 or -1 for each axis of space.
      reversing: whether time is reversed, which changes the signs of the velocities once more.
    Example:
      >>> point_symmetry([1, 0, 2], (-1, -1), reversing=True).signs  # fixes Euler's starts
      (-1, -1, -1, -1, -1, -1, 1, 1, 1, 1, 1, 1)
    """
    order, axes = np.asarray(order), np.asarray(axes)
    n, d = len(order), len(axes)
    one = (order[:, None] * d + np.arange(d)).ravel()
    signs = np.tile(axes, n)
    return Symmetry(
        tuple(np.concatenate([one, n * d + one]).tolist()),
        tuple(np.concatenate([signs, -signs if reversing else signs]).tolist()),
        reversing,
    )


def time_reversal(k: int) -> Symmetry:
    """The time reversal of a state [q, v] of k entries, which changes the signs of v."""
    half = k // 2
    return Symmetry(None, (1,) * half + (-1,) * half, reversing=True)
