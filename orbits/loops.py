"""Closed orbits about a centre of force that are neither circles nor lines: course problem 11 b.

A motion between two radii is a rosette: each loop, from the farthest point to the farthest point,
is the last one turned by twice the apsidal angle. It closes after p turns with q loops where that
angle is pi p / q. The shape of an orbit, the ratio of its radii, decides: `closed` looks for the
ratio that gives p / q, and polishes the orbit by `find`. A search that fails has a regular rosette
all the same, one that fills its ring. `least` says which closed orbit has the fewest loops.

From circles to lines the angle of a power law r^n goes from pi / sqrt(3 + n) to pi / 2, or to
pi / (3 + n) where n < -1. At n = 1 and n = -2 both are the same, and all orbits close (Bertrand).
"""

import math
from fractions import Fraction

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, events, scenes, simulate
from jaxdyn._checks import array, fail, positive, whole
from jaxdyn._roots import root
from jaxdyn.effects import CentralForce
from orbits.problem import Orbit, SearchError
from orbits.shooting import find

#: Ratios of the smallest to the largest distance that are tried, from lines to circles.
_RATIOS = np.concatenate([np.geomspace(0.02, 0.2, 12), np.linspace(0.25, 0.97, 19)])
_SAME = 1e-9  # angles over pi that differ by less are one: all shapes close
_ANY = 15  # of the ratios, where all shapes close
_SIMPLE = 100  # loops that are counted of an orbit of any shape
_LOOKS = 16  # samples a step, to count turns


class Least(eqx.Module):
    """The closed orbits with the fewest loops, one for each exponent.

    Attributes:
      n: (m,) exponents of the attraction k r^n.
      loops: (m,) least number of loops q; 0 where nothing but circles closes.
      turns: (m,) turns p about the centre that it makes; of several the fewest.
      circle: (m,) apsidal angle over pi near circles; NaN where nothing moves between two radii.
      line: (m,) the same near lines.
    """

    n: np.ndarray
    loops: np.ndarray
    turns: np.ndarray
    circle: np.ndarray
    line: np.ndarray

    @property
    def message(self) -> str:
        """For which exponents there is none, and why."""
        none = self.n[self.loops == 0]
        if not none.size:
            return "Every exponent has closed orbits with loops."
        return (
            f"None for {none.size} exponents up to {none.max():g}: with n <= -3 no motion has both "
            "a nearest and a farthest point, so only circles close. Take n > -3."
        )


def least(n) -> Least:
    """The least number of loops of a closed orbit, no circle and no line, against the exponent.

    Args:
      n: () or (m,) exponents of the attraction k r^n.
    Raises:
      ValueError: exponents that are no numbers.
    Limits: see `jaxdyn.scenes.fewest_loops`; within 1e-7 of 1 or -2, where the number goes to
      infinity, it takes long.
    Example:
      >>> from orbits import loops
      >>> found = loops.least([-3.5, -2.0, -1.0, 1.0, 3.0, 10.0])
      >>> found.loops.tolist(), found.turns.tolist()
      ([0, 1, 3, 2, 7, 3], [0, 1, 2, 1, 3, 1])
    """
    n = np.atleast_1d(np.asarray(array("n", np.atleast_1d(n), (None,))))
    moves = n > -3
    safe = np.where(moves, n, 0.0)
    circle = np.where(moves, 1 / np.sqrt(3 + safe), np.nan)
    line = np.where(moves, np.where(safe < -1, 1 / (3 + safe), 0.5), np.nan)
    count = np.array([scenes.fewest_loops(float(x)) if x > -3 else 0 for x in n])
    low = np.where(moves, np.minimum(circle, line), 0.0)
    # Strictly between the limits, but for the two laws where they are one.
    turns = np.where(circle == line, np.round(count * low), np.floor(count * low) + 1)
    return Least(n, count, np.where(moves, turns, 0).astype(int), circle, line)


def closed(law: CentralForce, turns: int, loops: int, *, r=1.0, m=1.0) -> Orbit:
    """The orbit with so many loops in so many turns about the centre, from its farthest point.

    Args:
      law: the force, e.g. ``PowerLaw(k, n)``, or a `CentralForce` of one's own.
      turns: p, turns in a period.
      loops: q, farthest points in a period; without a common factor with p.
      r: distance of the farthest point [m]; the search moves it by the errors of the quadrature.
      m: mass [kg].
    Returns:
      The orbit, closed to 1e-12; of several shapes the one nearest to a line.
    Raises:
      ValueError: numbers that make no sense.
      SearchError: no orbit with radii of a ratio between 0.02 and 0.97 closes like this, and which
        do.
    Example:
      >>> from jaxdyn.effects import PowerLaw
      >>> from orbits import loops
      >>> orbit = loops.closed(PowerLaw(1.0, -1.0), 2, 3)
      >>> loops.count(orbit), orbit.residual < 1e-12
      ((2, 3), True)
    """
    _coprime(turns, loops)
    _law(law)
    r, m = (float(positive(name, array(name, x, ()))) for name, x in (("r", r), ("m", m)))
    scene, half = _started(law, _shape(law, turns / loops, r), r, m)
    return find(scene, period=2 * loops * half)


def rosette(law: CentralForce, ratio=0.4, *, r=1.0, m=1.0, loops: int = 40) -> Scene:
    """A motion between two radii over many loops: where none closes, it fills its ring.

    That is what a search which fails is left with.

    Args:
      law: the force.
      ratio: of the smallest to the largest distance, between 0 and 1.
      r: distance of the farthest point, where it starts [m].
      m: mass [kg].
      loops: in the scene's span.
    Raises:
      ValueError: numbers that make no sense.
      SearchError: nothing moves between such radii under this law.
    Example:
      >>> from jaxdyn.effects import PowerLaw
      >>> from orbits import loops
      >>> ring = simulate(loops.rosette(PowerLaw(1.0, -1.0), 0.5), samples=2000)
      >>> r = np.hypot(ring["x"], ring["y"])
      >>> round(float(r.min()), 4), round(float(r.max()), 4)
      (0.5, 1.0)
    """
    _law(law)
    ratio, r, m = (
        float(positive(name, array(name, x, ())))
        for name, x in (("ratio", ratio), ("r", r), ("m", m))
    )
    if not ratio < 1:
        raise fail("ratio", "below 1", ratio, "A circle closes.")
    loops = whole("loops", loops)
    angle = np.asarray(_angles(law, jnp.asarray([ratio]), r)[0])
    if not np.isfinite(angle).all():
        raise SearchError(_no_shape(angle))
    scene, half = _started(law, ratio, r, m)
    return scene.starting(scene.y0, 2 * loops * half)


def count(orbit: Orbit) -> tuple[int, int]:
    """Turns about the centre and farthest points of an orbit in a period, counted on its path."""
    steps = int(simulate(orbit.scene, samples=1).steps)
    motion = simulate(orbit.scene, samples=_LOOKS * steps)
    x, y, vx, vy = np.asarray(motion.ys).T
    turned = np.unwrap(np.arctan2(y, x))
    growing = (x * vx + y * vy > 0)[:-1]  # the last sample is the first one again
    tops = int(np.sum(growing & ~np.roll(growing, -1)))
    return round(abs(turned[-1] - turned[0]) / (2 * np.pi)), tops


def _coprime(turns, loops) -> None:
    common = math.gcd(whole("turns", turns), whole("loops", loops))
    if common > 1:
        remedy = f"It closes after {turns // common} turns already."
        raise fail("turns", f"no common factor with loops = {loops}", turns, remedy)


def _law(law) -> None:
    if not isinstance(law, CentralForce):
        raise fail("law", "a CentralForce", repr(law), "PowerLaw(1.0, -1.0) is one.")


def _shape(law: CentralForce, wanted: float, r: float) -> float:
    """The ratio of radii whose apsidal angle is pi times the wanted number."""

    def over(ratio):
        angle, slope = _angles(law, jnp.asarray(ratio), r)
        return np.asarray(angle) / np.pi - wanted, np.asarray(slope) / np.pi

    off, _ = over(_RATIOS)
    if np.all(np.abs(off) < _SAME):
        return float(_RATIOS[_ANY])
    cells = np.flatnonzero(off[:-1] * off[1:] <= 0)
    if not len(cells):
        raise SearchError(_no_shape(off + wanted))
    ratio, fine = root(over, _RATIOS[cells[:1]], _RATIOS[cells[:1] + 1])
    if not fine.all():
        raise SearchError("The apsidal angle is too rough a function of the shape of the orbit.")
    return float(ratio[0])


def _no_shape(found: np.ndarray) -> str:
    known = found[np.isfinite(found)]
    if not known.size:
        return (
            "No motion has both a nearest and a farthest point under this law: it repels, or it is "
            "steeper than r^-3, where only circles close. Take a weaker law."
        )
    low, high = known.min(), known.max()
    if high - low < _SAME:
        turns, loops = Fraction(float(low)).limit_denominator(_SIMPLE).as_integer_ratio()
        return (
            f"Under this law every motion between two radii closes, with turns / loops = {turns} / "
            f"{loops}. Take these."
        )
    return (
        f"From ratios of radii 0.02 to 0.97 the apsidal angle over pi goes from {low:.6g} to "
        f"{high:.6g} only; all of it are rosettes. Take turns / loops between these numbers."
    )


@eqx.filter_jit
def _angles(law: CentralForce, ratio, r):
    """(m,) apsidal angles of orbits with these ratios of radii, and their slopes in the ratio."""

    def angle(ratio):
        return scenes.apsidal_angle(law, ratio * r, r)

    return jax.vmap(jax.value_and_grad(angle))(ratio)


def _started(law: CentralForce, ratio: float, r: float, m: float):
    """The scene from its farthest point, and the time to the nearest one."""
    # Energy and angular momentum are the same at both ends.
    drop = float(law.energy(jnp.asarray(r)) - law.energy(jnp.asarray(ratio * r)))
    speed = math.sqrt(2 * drop / (m * (1 / ratio**2 - 1)))
    fall = np.pi * r / speed  # longer than any fall from here with this angular momentum
    scene = scenes.central_orbit(law, r=r, speed=speed, m=m, t1=fall)
    nearest = events.until(scene, _NEAREST, 100 * fall, rtol=1e-13)
    return scene, float(nearest.t)


def _approach(t, y):
    del t
    return y[0] * y[2] + y[1] * y[3]


_NEAREST = events.When(_approach, 1)
