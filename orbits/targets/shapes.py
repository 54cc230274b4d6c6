"""The shape of an orbit about a centre, the ratio of its radii, with a given apsidal angle.

For power laws the limits of the angle are known and it is monotone between them, so that there is
one shape or, provably, none. For other laws shapes are sampled.
"""

import math
from fractions import Fraction

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import scenes
from jaxdyn.analysis._roots import root
from jaxdyn.effects import CentralForce, PowerLaw
from orbits.orbit import SearchError

#: Shapes tried, from circles to lines: logarithms of r_max / r_min. The last is 1e-74.
_DEPTHS = np.concatenate([[1e-7], np.geomspace(1e-3, 170.0, 60)])
_SAME = 1e-9  # angles over pi that differ by less are equal: all shapes close
_ANY = 0.8  # the depth used then
_SIMPLE = 100  # largest number of loops tried where every shape closes


def depth_of(law: CentralForce, turns: int, loops: int, r: float) -> float:
    """The logarithm of r_max / r_min of the orbit whose apsidal angle is pi turns / loops."""
    wanted = turns / loops
    if isinstance(law, PowerLaw):
        _check_limits(law, turns, loops)
    found = over_pi(law, _DEPTHS, r)
    known = np.isfinite(found)
    depths, found = _DEPTHS[known], found[known]
    if not known.any():
        raise SearchError(NOWHERE)
    if np.ptp(found) < _SAME:
        if abs(found[0] - wanted) < _SAME:
            return _ANY
        raise SearchError(_always(float(found[0])))
    cells = np.flatnonzero((found[:-1] - wanted) * (found[1:] - wanted) <= 0)
    if not len(cells):
        raise SearchError(_no_shape(law, depths, found))

    def over(depth):
        return over_pi(law, depth, r) - wanted, np.full(len(depth), np.nan)

    depth, fine = root(over, depths[cells[:1]], depths[cells[:1] + 1])
    if not fine.all():
        raise SearchError("The apsidal angle is too rough a function of the shape of the orbit.")
    return float(depth[0])


def _check_limits(law: PowerLaw, turns: int, loops: int) -> None:
    """Raise SearchError unless the power law has an orbit with these turns and loops."""
    circle, line = map(float, scenes.apsidal_limits(law.n))
    if not (law.k > 0 and math.isfinite(circle)):
        raise SearchError(NOWHERE)
    if circle == line:
        if turns != loops * line:
            raise SearchError(_always(line))
    elif not min(circle, line) < turns / loops < max(circle, line):
        raise SearchError(
            f"Under r^{float(law.n):g} the apsidal angle over pi is monotone from {circle:.6g} "
            f"near circles to {line:.6g} near lines, and reaches neither: all of these orbits are "
            "rosettes. Choose turns / loops between these numbers."
        )


NOWHERE = (
    "No motion has both a nearest and a farthest point under this law: it repels, or it is as "
    "steep as r^-3, where only circles close. Take a weaker law."
)


def _always(angle: float) -> str:
    turns, loops = Fraction(angle).limit_denominator(_SIMPLE).as_integer_ratio()
    return (
        f"Under this law every motion between two radii closes, with turns / loops = {turns} / "
        f"{loops}. Choose these."
    )


def _no_shape(law: CentralForce, depths: np.ndarray, found: np.ndarray) -> str:
    shapes = f"ratios of radii from {math.exp(-depths[-1]):.2g} to {math.exp(-depths[0]):.7g}"
    if isinstance(law, PowerLaw):
        return (
            f"The orbit exists, but not at {shapes}: it is closer to a line or a circle. "
            "Choose turns / loops farther from the limits of the apsidal angle over pi."
        )
    return (
        f"At {len(found)} {shapes} the apsidal angle over pi is between {found.min():.6g} and "
        f"{found.max():.6g}; these orbits are rosettes. Shapes between them or beyond them are not "
        "excluded. Choose turns / loops between these numbers."
    )


def over_pi(law: CentralForce, depths: np.ndarray, r: float) -> np.ndarray:
    """(m,) apsidal angles over pi of orbits of these shapes, NaN if there is none."""
    # Each number of shapes is compiled once.
    padded = np.append(depths, np.full(len(_DEPTHS) - len(depths), depths[0]))
    return np.asarray(_angles(law, jnp.asarray(padded), r))[: len(depths)] / np.pi


@eqx.filter_jit
def _angles(law: CentralForce, depths, r):
    return jax.lax.map(lambda depth: scenes.apsides(law, depth, r).angle, depths)
