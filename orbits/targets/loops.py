"""Closed orbits about a centre of force that are neither circles nor lines: course problem 11 b.

A motion between two radii is a rosette: each loop, from one farthest point to the next, is the
previous one rotated by twice the apsidal angle. The motion closes after p turns with q loops where
the apsidal angle is pi p / q. The shape of an orbit, the ratio of its radii, determines the angle:
`closed` searches for the ratio that gives p / q, and refines the orbit by `find`. If that fails,
there is still a regular `rosette` that fills its ring. `fewest` gives the closed orbit with the
fewest loops.

For a power law r^n the possible p / q are known: those strictly between the limits of its apsidal
angle (`jaxdyn.scenes.apsidal_limits`), each for one shape. For other laws shapes are sampled.
"""

import math
from fractions import Fraction

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, _text, scenes, simulate
from jaxdyn._checks import array, check_first, check_on_host, fail, positive, whole
from jaxdyn.analysis._roots import root
from jaxdyn.effects import CentralForce, PowerLaw
from orbits.orbit import Orbit, SearchError
from orbits.shooting.finding import find

#: Shapes tried, from circles to lines: logarithms of r_max / r_min. The last ratio r_min / r_max is
#: 1e-74.
_DEPTHS = np.concatenate([[1e-7], np.geomspace(1e-3, 170.0, 60)])
_SAME = 1e-9  # if angles over pi differ by less, they are equal, and all shapes close
_ANY = 0.8  # the depth that is used where all shapes close
_SIMPLE = 100  # largest number of loops tried where every shape closes


def depth_of(law: CentralForce, turns: int, loops: int, r: float) -> float:
    """The logarithm of r_max / r_min of the orbit whose apsidal angle is pi turns / loops."""
    wanted = turns / loops
    if isinstance(law, PowerLaw):
        _check_limits(law, turns, loops)
    found = apsidal_angles(law, _DEPTHS, r)
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
        return apsidal_angles(law, depth, r) - wanted, np.full(len(depth), np.nan)

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


def apsidal_angles(law: CentralForce, depths: np.ndarray, r: float) -> np.ndarray:
    """(m,) apsidal angles over pi of orbits with these shapes; NaN if there is none."""
    # Padding to one number of shapes avoids a compilation for each number.
    padded = np.append(depths, np.full(len(_DEPTHS) - len(depths), depths[0]))
    return np.asarray(_angles(law, jnp.asarray(padded), r))[: len(depths)] / np.pi


@eqx.filter_jit
def _angles(law: CentralForce, depths, r):
    return jax.lax.map(lambda depth: scenes.apsides(law, depth, r).angle, depths)


_LOOKS = 16  # samples per step, to count loops
_WHOLE = 0.01  # largest distance of a closed orbit's turns from a whole number


class FewestLoops(eqx.Module):
    """The closed orbits with the fewest loops, one for each exponent.

    Attributes:
      n: (m,) exponents of the attraction k r^n.
      loops: (m,) smallest number of loops q; 0 where only circles close.
      turns: (m,) turns p about the centre that this orbit makes; the smallest of several.
      circle: (m,) apsidal angle over pi near circles; NaN where no motion stays between two radii.
      line: (m,) apsidal angle over pi near lines.
    """

    n: np.ndarray
    loops: np.ndarray
    turns: np.ndarray
    circle: np.ndarray
    line: np.ndarray

    __repr__ = _text.fields
    _repr_html_ = _text.html

    @property
    def message(self) -> str:
        """The exponents without such an orbit, and why."""
        none = self.n[self.loops == 0]
        if not none.size:
            return "Every exponent has closed orbits with loops."
        return (
            f"None for {none.size} exponents up to {none.max():g}: with n <= -3 no motion has both "
            "a nearest and a farthest point, so only circles close. Take n > -3."
        )


def fewest(n) -> FewestLoops:
    """The least number of loops of a closed orbit, circles and lines excepted, for each exponent.

    Args:
      n: () or (m,) exponents of the attraction k r^n.
    Raises:
      ValueError: `n` is not finite, or traced.
    Limits: it takes long for exponents within 1e-7 of 1 or -2, where the number diverges.
    Example:
      >>> from orbits.targets import loops
      >>> found = loops.fewest([-3.5, -2.0, -1.0, 1.0, 3.0, 10.0])
      >>> found.loops.tolist(), found.turns.tolist()
      ([0, 1, 3, 2, 7, 3], [0, 1, 2, 1, 3, 1])
    """
    check_on_host("n", n)
    n = np.atleast_1d(np.asarray(array("n", np.atleast_1d(n), (None,))))
    moves = n > -3
    circle, line = scenes.apsidal_limits(n)
    count = np.array([scenes.fewest_loops(float(x)) if x > -3 else 0 for x in n])
    low = np.where(moves, np.minimum(circle, line), 0.0)
    # Strictly between the limits, except for the two laws where they coincide.
    turns = np.where(circle == line, np.round(count * low), np.floor(count * low) + 1)
    return FewestLoops(
        n=n,
        loops=count,
        turns=np.where(moves, turns, 0).astype(int),
        circle=circle,
        line=line,
    )


def closed(law: CentralForce, turns: int, loops: int, *, r=1.0, m=1.0) -> Orbit:
    """The orbit with given loops and turns about the centre, from its farthest point.

    Args:
      law: the force, e.g. ``PowerLaw(k, n)``, or a custom `CentralForce`.
      turns: number p of turns in a period.
      loops: number q of farthest points in a period, without a common factor with p.
      r: distance of the farthest point [m].
      m: mass [kg].
    Returns:
      The orbit, closed to 1e-12, or for very close passages to what rounding permits (`find`); of
        several shapes, the one closest to a circle.
    Raises:
      ValueError: `law` is not a `CentralForce`, `turns` or `loops` is less than 1 or they have a
        common factor, or `r` or `m` is not positive.
      SearchError: no orbit closes like this; the message says which do. For a `PowerLaw` that is
        certain; for another law the message names the shapes tried.
    Example:
      >>> from jaxdyn.effects import PowerLaw
      >>> from orbits.targets import loops
      >>> orbit = loops.closed(PowerLaw(1.0, -1.0), 2, 3)
      >>> loops.count(orbit), orbit.residual < 1e-12
      ((2, 3), True)
    """
    _check_coprime(turns, loops)
    _check_law(law, r=r, m=m)
    r, m = (float(positive(name, array(name, x, ()))) for name, x in (("r", r), ("m", m)))
    depth = depth_of(law, turns, loops, r)
    scene, half = _start(law, depth, r, m)
    orbit = find(scene, period=2 * loops * half, throw=False)
    if not orbit.ok:
        raise SearchError(
            f"The orbit exists: its smallest distance is {math.exp(-depth):.3g} of the largest. "
            f"But it could not be integrated accurately enough: {orbit.message}"
        )
    return orbit


def rosette(law: CentralForce, ratio=0.4, *, r=1.0, m=1.0, loops: int = 40) -> Scene:
    """A motion between two radii over many loops, which fills its ring unless it closes.

    It is useful where `closed` finds no orbit.

    Args:
      law: the force.
      ratio: ratio of the smallest to the largest distance, between 0 and 1.
      r: distance of the farthest point, where it starts [m].
      m: mass [kg].
      loops: number of loops in the scene's span.
    Raises:
      ValueError: `law` is not a `CentralForce`, or `ratio` is not between 0 and 1, or `r`, `m` or
        `loops` is not positive.
      SearchError: no motion stays between such radii under this law.
    Example:
      >>> from jaxdyn.effects import PowerLaw
      >>> from orbits.targets import loops
      >>> ring = simulate(loops.rosette(PowerLaw(1.0, -1.0), 0.5), samples=2000)
      >>> r = np.hypot(ring["x"], ring["y"])
      >>> round(float(r.min()), 4), round(float(r.max()), 4)
      (0.5, 1.0)
    """
    _check_law(law, ratio=ratio, r=r, m=m)
    ratio, r, m = (
        float(positive(name, array(name, x, ())))
        for name, x in (("ratio", ratio), ("r", r), ("m", m))
    )
    if not ratio < 1:
        raise fail("ratio", "below 1", ratio, "A circle closes.")
    loops = whole("loops", loops)
    depth = -math.log(ratio)
    if not np.isfinite(apsidal_angles(law, np.array([depth]), r)).all():
        raise SearchError(NOWHERE)
    scene, half = _start(law, depth, r, m)
    return scene.starting(scene.y0, 2 * loops * half)


@check_first
def count(orbit: Orbit) -> tuple[int, int]:
    """Turns about the centre and farthest points of an orbit in a period, counted on its path.

    The turns come from the angle that is integrated with the motion (`jaxdyn.scenes.swept_angle`).
    A motion between two radii moves outwards for half of its time, which samples cannot miss.

    Raises:
      ValueError: the orbit has traced numbers.
      SearchError: the turns differ from a whole number by 0.01 or more.
    """
    check_on_host("orbit", orbit)
    turns = abs(float(scenes.swept_angle(orbit.scene, rtol=orbit.rtol))) / (2 * np.pi)
    if not abs(turns - round(turns)) < _WHOLE:
        raise SearchError(
            f"The motion makes {turns:.9g} turns about the origin, not a whole number."
        )
    steps = int(simulate(orbit.scene, samples=1).steps)
    x, y, vx, vy = np.asarray(simulate(orbit.scene, samples=_LOOKS * steps).ys).T
    growing = (x * vx + y * vy > 0)[:-1]  # the last sample is the first one again
    return round(turns), int(np.sum(growing & ~np.roll(growing, -1)))


def _check_coprime(turns, loops) -> None:
    common = math.gcd(whole("turns", turns), whole("loops", loops))
    if common > 1:
        remedy = f"It closes after {turns // common} turns already."
        raise fail("turns", f"no common factor with loops = {loops}", turns, remedy)


def _check_law(law, **numbers) -> None:
    for name, x in {"law": law, **numbers}.items():
        check_on_host(name, x, "Find the orbit outside; see orbits.differentiable.")
    if not isinstance(law, CentralForce):
        raise fail("law", "a CentralForce", repr(law), "Pass PowerLaw(1.0, -1.0), for example.")


def _start(law: CentralForce, depth: float, r: float, m: float):
    """The scene from its farthest point, and the time to the nearest one."""
    apsides = scenes.apsides(law, depth, r, m)
    speed = float(apsides.momentum) / (m * r)
    half = float(apsides.time)
    return scenes.central_orbit(law, r=r, speed=speed, m=m, t1=2 * half), half
