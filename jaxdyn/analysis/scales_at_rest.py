"""Scales of the motions near an equilibrium, which the rate there does not show.

They follow from the entries, from the Jacobian J, and, where all entries are 0, from the distance
at which the rate is no longer linear. A linear rate at 0 has no such distance, and its motions are
the same at all sizes: then coupled entries have sizes in the ratio of their motions, and one of
them has the size 1; no comparison in these sizes depends on that choice.
`jaxdyn.scales` explains what scales are for.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.scales import ASIDE, TIMES_NOISE, Groups, Scales, shifted, weights_of

#: An entry at rest below this part of the change that others cause in it is rounding.
_ROUNDING = 1e-9
#: An equilibrium nearer to 0 than this part of the distance up to which a rate is linear is at 0.
_NOTHING = 1e-12
#: Relative change of the terms of a Jacobian at which the rate is no longer linear.
_NONLINEAR = 0.5
#: Range of the distances at which linearity is tested; their number in a pass and the number of
#: passes, each between two neighbouring distances of the last, for a size or its magnitude only.
_NEAREST, _FARTHEST, _FINE, _COARSE = 1e-150, 1e150, (601, 5), (31, 2)


def at_rest(field: Any, groups: Groups, y: np.ndarray, t: float = 0.0) -> Scales:
    """The scales of the motions near an equilibrium, or a steady motion; host only.

    The time is 1 over the spectral radius of |J|, where J is the Jacobian of the rate. An entry
    that is 0, or only rounding of the change that others cause in it in that time, has the size of
    this change; an angle has the size 1. Where there is no change, or it is only rounding, an entry
    has the size at which the rate is no longer linear. If the rate is linear, no size follows from
    it, and the entry has the mean of all sizes, or 1.

    Args:
      field: an object with ``rate(t, y)``.
      groups: the groups of its state.
      y: (k,) the equilibrium.
      t: () time at which the field is frozen.
    """
    y, alike, most = np.asarray(y, float), groups.sizes_on_host, np.asarray(groups.most)
    near = RateNear.of(field, t, y, alike)
    here = np.where(np.isfinite(most), most, alike(np.abs(y)))
    here = np.where(here > _ROUNDING * alike((near.made * here).max(axis=1)), here, 0.0)
    nothing = _are_rounding(near, here, most)
    y, here = (np.where(nothing, 0.0, x) for x in (y, here))
    sizes = RateNear.of(field, t, y, alike).fill_zeros(here)
    slope = terms(field, y, sizes, t)
    fastest = _radius(slope)
    # At a fold the Jacobian itself may be rounding, and so may the change that it causes.
    caused = alike((slope * sizes).max(axis=1) / (fastest or 1.0))
    sizes = np.where(here == 0, np.maximum(sizes, caused), sizes)
    return Scales(jnp.asarray(sizes), jnp.asarray(1 / (fastest or 1.0)))


def _are_rounding(near: "RateNear", here: np.ndarray, most: np.ndarray) -> np.ndarray:
    """(k,) whether an entry is 0 up to the error of a search: negligible against its size at 0.

    That size depends on which entries are 0. At first all are taken as 0, so that none is compared
    with the rounding of another; those that are not negligible then get their values back, until
    there are no more.
    """
    small = (here > 0) & ~np.isfinite(most)
    while small.any():
        without, sizes = (np.where(small, 0.0, x) for x in (near.y, here))
        beside, bent = RateNear.of(near.field, near.t, without, near.alike), sizes
        while bent is not None:
            sizes = beside.carry(near.alike(bent))
            bent = beside.bend(sizes, _COARSE)
        left = small & (here < _NOTHING * sizes)
        if (left == small).all():
            break
        small = left
    return small


def _radius(matrix: np.ndarray) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def terms(field: Any, y: np.ndarray, sizes: np.ndarray, t: float = 0.0) -> np.ndarray:
    """(k, k) the largest |J| at a state and at two beside it, a small part of the sizes away."""
    off = ASIDE * sizes * weights_of(len(y))
    return np.abs([slopes(field, x, t) for x in (y, y - off, y + off)]).max(axis=0)


def slopes(field: Any, y: np.ndarray, t: float = 0.0) -> np.ndarray:
    """(k, k) the rate's Jacobian, 0 where it is not finite."""
    found = np.asarray(_slope(field, jnp.asarray(t, float), jnp.asarray(y)))
    return np.where(np.isfinite(found), found, 0.0)


class RateNear(NamedTuple):
    """A rate near a state, from which the relative sizes of the entries follow.

    Attributes:
      field: an object with ``rate(t, y)``.
      t: () time at which the field is frozen.
      y: (k,) the state.
      made: (k, k) change of entry i that a unit of entry j causes in the time of the motion.
      alike: takes numbers (k,) to the largest in the group of each.
      fastest: [1/time] a change of the Jacobian by this is large, if its terms are smaller.
    """

    field: Any
    t: float
    y: np.ndarray
    made: np.ndarray
    alike: Callable[[np.ndarray], np.ndarray]
    fastest: float = 0.0

    @classmethod
    def of(cls, field: Any, t: float, y: np.ndarray, alike: Callable) -> "RateNear":
        """The rate near a state of rest, whose Jacobian gives the time of the motion."""
        slope = np.abs(slopes(field, y, t))
        return cls(field, t, y, slope / (_radius(slope) or 1.0), alike)

    def fill_zeros(self, sizes: np.ndarray) -> np.ndarray:
        """The sizes (k,), with zeros replaced by the changes that the other entries cause.

        An entry that no other moves has the size at which the rate becomes nonlinear. Such entries
        are treated one after the other, each together with those that it moves. Where the rate is
        linear, any size is as good as another: the mean of the known ones is taken, or 1.
        """
        while ((sizes := self.carry(sizes)) == 0).any():
            bent = self.bend(sizes)
            if bent is None:
                mean = np.exp(np.log(sizes[sizes > 0]).mean()) if sizes.any() else 1.0
                bent = np.where(np.arange(len(sizes)) == np.argmin(sizes), mean, sizes)
            sizes = self.alike(bent)
        return sizes

    def carry(self, sizes: np.ndarray) -> np.ndarray:
        """(k,) sizes, with zeros replaced by the changes that entries with sizes cause, in turn."""
        before = np.zeros_like(sizes)
        while (sizes > before).any():
            before, made = sizes, self.alike((self.made * sizes).max(axis=1))
            sizes = self.alike(np.where(sizes == 0, made, sizes))
        return sizes

    def bend(self, sizes: np.ndarray, passes: tuple[int, int] = _FINE) -> np.ndarray | None:
        """The sizes (k,), with that of one entry at which the rate becomes nonlinear, or None."""
        for i in np.flatnonzero(sizes == 0):
            first = np.arange(len(sizes)) == i
            displacement = self._extend(self.alike(first.astype(float)), sizes == 0)
            size = self._linear_up_to(displacement, sizes, passes)
            if np.isfinite(size):
                return np.where(first, size, sizes)
        return None

    def _extend(self, displacement: np.ndarray, which: np.ndarray) -> np.ndarray:
        """(k,) a displacement of some entries, extended to those of `which` that they move."""
        for _ in displacement:
            displacement = np.where(
                which & (displacement == 0), (self.made * displacement).max(axis=1), displacement
            )
        return displacement

    def _linear_up_to(
        self, displacement: np.ndarray, sizes: np.ndarray, passes: tuple[int, int]
    ) -> float:
        """How far along a displacement (k,), in both directions, a rate is linear.

        It is linear until terms of its Jacobian change by about their own size, or by `fastest`.
        Terms of entries that have sizes (k,) or are displaced are compared together, row by row;
        those of other entries, which may have any size, one by one. Distances at which rounding
        alone may change them by so much are ignored.
        """
        field, t, y = self.field, self.t, self.y
        slope, off, near = (
            np.abs(slopes(field, y, t)),
            displacement * weights_of(len(y)),
            shifted(y),
        )
        alone = (slope > 0) & (sizes == 0) & (displacement == 0)
        low, high, bounds = _NEAREST, _FARTHEST, None
        for _ in range(passes[1]):
            distances = np.geomspace(low, high, passes[0])
            each = np.maximum(sizes, distances[:, None] * displacement)
            own = each @ slope.T + self.fastest * each
            share = np.zeros((len(distances), len(y) + len(y) ** 2))
            for sign in (1, -1):
                at = np.concatenate([near, y + sign * distances[:, None] * off])
                with np.errstate(all="ignore"):
                    there = np.asarray(_slopes(field, jnp.asarray(t, float), jnp.asarray(at)))
                    changes = np.abs(there - slopes(field, y, t))
                    rounded, changes = changes[: len(near)].max(axis=0), changes[len(near) :]
                    rows = np.where(own > 0, np.einsum("nij,nj->ni", changes, each) / own, 0.0)
                    ones = np.where(alone, changes / np.where(alone, slope, 1.0), 0.0)
                    noise = np.where(own > 0, TIMES_NOISE * (each @ rounded.T) / own, 0.0).max(
                        axis=1
                    )
                ones = np.where(TIMES_NOISE * rounded < _NONLINEAR * slope, ones, 0.0)
                parts = np.hstack([rows, ones.reshape(len(ones), -1)])
                share = np.maximum(share, np.where(np.isnan(parts), np.inf, parts))
            usable = ~(noise > _NONLINEAR)
            if not usable.any():
                return np.inf
            # The product of a displaced entry with one that has a size stays the same share of a
            # row. A larger share is nonlinear; so is a smaller one, as where a force decays with
            # distance. Each row is compared with itself: one such product would hide the others.
            if bounds is None:
                first = share[np.argmax(usable)]
                least = np.where(first > _NONLINEAR, 0.5 * first, 0.0)
                bounds = least, np.maximum(_NONLINEAR, 2 * first)
            beyond = np.flatnonzero(
                usable & ((share < bounds[0]) | (share > bounds[1])).any(axis=1)
            )
            if not len(beyond):
                return np.inf
            low, high = distances[max(beyond[0] - 1, 0)], distances[beyond[0]]
        return float(low)


@eqx.filter_jit
def _slope(field: Any, t: Array, y: Array) -> Array:
    return jax.jacfwd(lambda y: field.rate(t, y))(y)


@eqx.filter_jit
def _slopes(field: Any, t: Array, ys: Array) -> Array:
    return jax.vmap(jax.jacfwd(lambda y: field.rate(t, y)))(ys)
