"""Aiming: the launch angles that hit a target, the farthest throw, the least speed.

The throws are of one point in the plane, whatever acts on it. `farthest` samples the range over all
angles, forwards and backwards, and refines its best maximum; `hit` divides all angles at the
extremes of the range into pieces where it is monotone, each of which has at most one angle that
hits; `slowest` raises the speed until the farthest throw reaches the target. Times of landing, and
the derivatives of the range with respect to angle and speed, are exact (see
`jaxdyn.integrate.events`); there are no penalties.

With quadratic drag c v^2 the best angle is 45 degrees for slow throws and tends to 0 very slowly as
the speed v grows: with L = log(v^2 c / (m g)), it falls like s / L, where s itself grows like
log L. In the limit the ball lands at a right angle to its launch, as it does without drag. With
linear drag the angle falls like log(u^2) / u instead (`jaxdyn.scenes.ballistics`).
"""

from typing import Annotated

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, _text
from jaxdyn._checks import array, at_least_zero, check_first, fail, positive
from jaxdyn.analysis._roots import root
from jaxdyn.status import Code
from orbits.targets.launch import (
    BY_SPEED,
    Landings,
    angle_of,
    are_followed,
    check_throw,
    free_sine,
    landings,
)

#: Courses log tan(angle / 2) at which the range is sampled forwards; the flattest angle is
#: 1e-17 rad. Where drag alters still flatter throws, the first eight courses are stretched.
_STRETCHED = np.arange(40.0, 16.0, -3.0)
_STEEPER = np.array([16, 13.5, 11.5, 9.5, 7.5, 6, 4.8, 4, 3.3, 2.7, 2.2, 1.7, 1.3, 0.9, 0.5])
_FREE = 5.0  # courses flatter by this are free flights, whose range grows with the angle
LOOK = 1e-7  # tolerance of the samples
WIDER = 1e-3  # by how much a bracket found with `LOOK` is widened, to remain valid with `RTOL`
SAME = 1e-7  # courses closer than this, at the largest range, are one


class Aim(Code):
    """Outcome of aiming."""

    FOUND = 0, "The aim was found."
    OUT_OF_REACH = 1, "No throw lands there. Throw faster, or choose a nearer target."
    NO_RANGE = (
        2,
        "No launch angle is best: throws go less far forwards the flatter they are, or do not come "
        "down. Is the wind too strong for this speed?",
    )
    LOST = (
        3,
        "Some throws could not be integrated to the ground, and one of them may be better. The "
        "drag is so strong that the fall is stiff, or the speed so high that its square exceeds "
        "all numbers: use a lower speed, a nearer target or less drag.",
    )
    NO_CONVERGENCE = (
        4,
        "The range is too rough a function of the angle to find its extremes. Is a force of the "
        "scene discontinuous?",
    )


def courses(scene: Scene, speeds: np.ndarray) -> np.ndarray:
    """(n, m) courses to sample for each speed, ascending, down to those that drag does not alter.

    With linear drag the best angle falls like log(u^2) / u in the speed u, so that no fixed set of
    courses contains it. Drag has no time to act where the flight, v sin(angle) / g, is short
    compared with v / a for the first acceleration a: flatter courses need no samples.
    """
    flattest = _FREE - np.log(free_sine(scene, speeds))
    stretch = np.maximum(flattest, _STRETCHED[0]) - _STEEPER[0]
    part = (_STRETCHED - _STEEPER[0]) / (_STRETCHED[0] - _STEEPER[0])
    flat = _STEEPER[0] + stretch[:, None] * part
    steeper = np.broadcast_to(_STEEPER, (len(speeds), len(_STEEPER)))
    forwards = np.concatenate([flat, steeper], axis=1)
    return np.concatenate([-forwards, np.zeros((len(speeds), 1)), forwards[:, ::-1]], axis=1)


def best_courses(scene: Scene, speeds: np.ndarray, height: float) -> tuple[np.ndarray, np.ndarray]:
    """(n,) course of the farthest throw for each speed, NaN if there is none; and `Aim` codes."""
    w_look = courses(scene, speeds)
    n, m = w_look.shape
    look = landings(scene, w_look, speeds[:, None], LOOK, height=height)
    x, slope = look.x.reshape(n, m), look.slope.reshape(n, m)
    top = (slope[:, :-1] > 0) & (slope[:, 1:] <= 0)
    reach = np.where(top, np.maximum(x[:, :-1], x[:, 1:]), -np.inf)
    cell = np.argmax(reach, axis=1)
    found = np.isfinite(reach[np.arange(n), cell])
    outcome = np.where(found, Aim.FOUND, Aim.NO_RANGE)
    w = np.full(n, np.nan)
    if found.any():
        low, high = w_look[found, cell[found]], w_look[found, cell[found] + 1]
        w[found], fine = _extremes(scene, low, high, speeds[found], height)
        outcome[found] = np.where(fine, Aim.FOUND, Aim.NO_CONVERGENCE)
    lost = ~are_followed(look).reshape(n, m).all(axis=1)
    outcome = np.where(lost, Aim.LOST, outcome)
    return np.where(outcome == Aim.FOUND, w, np.nan), outcome


def turns(
    scene: Scene, w: np.ndarray, look: Landings, speed: float, height: float
) -> tuple[np.ndarray, np.ndarray]:
    """Courses of all extremes of the range between those sampled, and whether they were found."""
    rising = look.slope > 0
    known = np.isfinite(look.x[:-1] + look.x[1:])
    cells = np.flatnonzero((rising[:-1] != rising[1:]) & known)
    if not len(cells):
        return np.zeros(0), np.ones(0, bool)
    return _extremes(scene, w[cells], w[cells + 1], np.full(len(cells), speed), height)


def _extremes(
    scene: Scene, low, high, speeds: np.ndarray, height: float
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) courses between `low` and `high` at which the range is extreme, and whether found."""

    def slope(w):
        # Its slope would need second derivatives of the flight, and three times the compile time.
        found = landings(scene, w, speeds, height=height)
        return found.slope, np.full(len(w), np.nan)

    return root(slope, low - WIDER, high + WIDER)


#: Speeds tried by `slowest`, in units of sqrt(pull x distance).
_SPEEDS = np.logspace(-3, 15, 55)
_GROUPS = 4  # the lowest speeds are tried first; mostly the first quarter of them is enough
_ROUNDING = 4 * np.finfo(float).eps
_BEFORE = 3  # a bracket begins this many speeds earlier, since sampled angles miss the best ones


class Hits(eqx.Module):
    """All throws that land at a point, in the units of the scene.

    Attributes:
      x: () the target, from the launch along the first axis.
      speed: () launch speed.
      height: () height of the launch above the ground.
      angles: (n,) launch angles [rad], ascending; empty if the target is out of reach.
      times: (n,) times of flight.
      short: () distance of the nearest throw from the target; 0 if the target is hit.
      nearest: () launch angle of that throw [rad]; NaN if the target is hit.
      outcome: the `Aim` code.
    """

    x: float
    speed: float
    height: float
    angles: np.ndarray
    times: np.ndarray
    short: float
    nearest: float
    outcome: Aim = eqx.field(static=True)

    __repr__ = _text.fields
    _repr_html_ = _text.html

    @property
    def ok(self) -> bool:
        """Whether the target is hit, and no angle is missing."""
        return self.outcome == Aim.FOUND

    @property
    def message(self) -> str:
        """The outcome in numbers, and the remedy."""
        if self.outcome != Aim.OUT_OF_REACH:
            return self.outcome.message
        nearest = f"The nearest, at {np.degrees(self.nearest):.6g} degrees, misses"
        return f"{self.outcome.message} {nearest} by {self.short:.6g}."


class Throws(eqx.Module):
    """The best throw for each speed or target, in the units of the scene; NaN where there is none.

    Attributes:
      speed: () or (n,) launch speed.
      angle: () or (n,) launch angle [rad].
      x: () or (n,) where it lands, from the launch along the first axis.
      t: () or (n,) time of flight.
      landing: () or (n,) angle below the first axis at which it comes down [rad].
      height: () or (n,) height of the launch above the ground.
      outcome: () or (n,) `Aim` codes.
    """

    speed: np.ndarray
    angle: np.ndarray
    x: np.ndarray
    t: np.ndarray
    landing: np.ndarray
    height: np.ndarray
    outcome: Annotated[np.ndarray, Aim]

    __repr__ = _text.fields
    _repr_html_ = _text.html

    @property
    def ok(self) -> bool:
        """Whether all throws were found."""
        return bool((self.outcome == Aim.FOUND).all())

    @property
    def message(self) -> str:
        """The outcome, which for many throws is the first failure, and the remedy."""
        bad = np.ravel(self.outcome)[np.ravel(self.outcome) != Aim.FOUND]
        return Aim(int(bad[0]) if bad.size else 0).message


@check_first
def hit(scene: Scene, x, speed, height=0.0) -> Hits:
    """All launch angles between 0 and 180 degrees that hit a point on the ground.

    Args:
      scene: one point in the plane and the effects on it; its own velocity is not used.
      x: () the target, from the launch along the first axis [m]; at 0, throws along the axis,
        which land at once, do not count.
      speed: () launch speed [m/s].
      height: () height of the launch above the ground [m].
    Raises:
      ValueError: `scene` is not a thrown point, `x` is not finite, `speed` is not positive, or
        `height` is negative; or one of them is traced.
    Limits: angles so flat that drag has no time to act are not sampled; two extremes of the range
      between neighbouring sampled angles (up to 28 degrees apart) would be missed. Throws
      from a height that begin downwards are not looked for. For a point above the launch, solve for
      the angle with which the throw passes through it, as below.
    Example:
      >>> from jaxdyn import scenes
      >>> from orbits.targets import aim
      >>> found = aim.hit(scenes.cannonball(g=10.0), 5.0, 10.0)
      >>> [round(float(angle), 12) for angle in np.degrees(found.angles)]
      [15.0, 75.0]
      >>> import jax, jaxdyn
      >>> from jaxdyn.integrate.events import Reaches
      >>> def miss(angle):  # of a point 5 m away and 1 m above the launch
      ...     thrown = scenes.cannonball(speed=10.0, angle=angle, g=10.0)
      ...     return jaxdyn.until(thrown, Reaches(0, 5.0), 9.0).y[1] - 1.0
      >>> angle = 0.4
      >>> for _ in range(5):
      ...     value, slope = jax.value_and_grad(miss)(angle)
      ...     angle -= value / slope
      >>> round(float(np.degrees(angle)), 6)
      27.328126
    """
    scene, height = check_throw(scene, x=x, speed=speed, height=height), _height(height)
    x, speed = float(array("x", x, ())), float(positive("speed", array("speed", speed, ())))
    (samples,) = courses(scene, np.array([speed]))
    look = landings(scene, samples, speed, LOOK, height=height)
    extremes, fine = turns(scene, samples, look, speed, height)
    if not fine.all():
        return _miss(x, speed, height, Aim.NO_CONVERGENCE)
    ends = np.sort(np.concatenate([samples, extremes]))
    ranges = landings(scene, ends, speed, height=height).x
    known = np.isfinite(ranges)
    if not known.any():
        outcome = Aim.NO_RANGE if are_followed(look).any() else Aim.LOST
        return _miss(x, speed, height, outcome)
    side = np.sign(ranges - x)
    cells = np.flatnonzero(side[:-1] * side[1:] <= 0)

    def over(w):
        found = landings(scene, w, speed, height=height)
        return found.x - x, found.slope

    angles, times, outcome = np.zeros(0), np.zeros(0), Aim.FOUND
    if len(cells):
        w, fine = root(over, ends[cells], ends[cells + 1])
        w = np.sort(w[fine])
        w = w[np.diff(w, prepend=-np.inf) > SAME]  # one at a boundary is found twice
        angles, times = angle_of(w), landings(scene, w, speed, height=height).t
        outcome = outcome if fine.all() else Aim.NO_CONVERGENCE
    if not are_followed(look).all():
        outcome = Aim.LOST
    elif not len(angles) and outcome == Aim.FOUND:
        short = np.abs(ranges - x)
        # To rounding, all throws are equally near a target that is very far.
        near = short <= (1 + _ROUNDING) * np.nanmin(short)
        i = int(np.argmax(np.where(near, np.sign(x) * ranges, -np.inf)))
        return _miss(x, speed, height, Aim.OUT_OF_REACH, short[i], angle_of(ends[i]))
    short = 0.0 if len(angles) else np.nan
    return Hits(x, speed, height, angles, times, short, np.nan, outcome)


def _miss(
    x: float, speed: float, height: float, outcome: Aim, short=np.nan, nearest=np.nan
) -> Hits:
    none = np.zeros(0)
    return Hits(x, speed, height, none, none, float(short), float(nearest), outcome)


@check_first
def farthest(scene: Scene, speed, height=0.0) -> Throws:
    """The launch angle with the largest range along the first axis, for one speed or many.

    Args:
      scene: see `hit`.
      speed: () or (n,) launch speeds [m/s].
      height: () height of the launch above the ground [m].
    Raises:
      ValueError: see `hit`.
    Limits: see `hit`. The angle of a maximum so flat that rounding hides it is accurate to 1e-8.
      Speeds from 1e150 on, whose squares overflow, are `LOST`; with quadratic drag, speeds from
      1e75 on.
    Example:
      >>> from jaxdyn import scenes
      >>> from orbits.targets import aim
      >>> best = aim.farthest(scenes.cannonball(drag=0.01), [1e-2, 1e2, 1e4])
      >>> np.round(np.degrees(best.angle), 3)
      array([45.   , 32.554, 14.994])
      >>> cliff = aim.farthest(scenes.cannonball(), 15.0, height=20.0)
      >>> round(float(np.degrees(cliff.angle)), 9)
      31.118608127
    """
    scene, height = check_throw(scene, speed=speed, height=height), _height(height)
    speeds = positive("speed", speed, "It is a speed; the angle gives the direction.")
    shape = np.shape(speeds)
    if len(shape) > 1 or 0 in shape:
        raise fail("speed", "one speed or a row of them", f"shape {shape}")
    flat = np.ravel(np.asarray(speeds))
    w, outcome = best_courses(scene, flat, height)
    throws = _throws(scene, w, flat, height, outcome)
    return throws if shape else _single(throws)


@check_first
def slowest(scene: Scene, x, height=0.0) -> Throws:
    """The smallest launch speed with a range of at least x, and its angle.

    Args:
      scene: see `hit`.
      x: () distance along the first axis [m], > 0; mirror the scene for throws to the left.
      height: () height of the launch above the ground [m].
    Raises:
      ValueError: see `hit`.
    Limits: speeds from 1e-3 to 1e15 times sqrt(g x) are tried. See `hit`.
    Example:
      >>> from jaxdyn import scenes
      >>> from orbits.targets import aim
      >>> best = aim.slowest(scenes.cannonball(g=10.0, drag=0.5), 2.0)
      >>> round(float(best.speed), 6), round(float(np.degrees(best.angle)), 4)
      (7.176481, 37.8694)
    """
    scene, height = check_throw(scene, x=x, height=height), _height(height)
    x = float(positive("x", array("x", x, ()), "Mirror the scene for throws to the left."))
    rest = jnp.concatenate([scene.y0[:2], jnp.zeros(2)])
    pull = float(jnp.linalg.norm(scene.rate(jnp.zeros(()), rest)[2:]))
    speeds = np.sqrt(pull * x) * _SPEEDS
    reach, followed = np.zeros(0), True
    for some in np.array_split(speeds, _GROUPS):
        look = landings(scene, courses(scene, some), some[:, None], LOOK, height=height)
        far = np.where(np.isnan(look.x), -np.inf, look.x).reshape(len(some), -1).max(axis=1)
        reach, followed = np.append(reach, far), followed and are_followed(look).all()
        if (far >= x).any():
            break
    enough = int(np.argmax(reach >= x))
    before = enough - _BEFORE
    if reach[enough] < x or before < 0:
        out = Aim.OUT_OF_REACH if followed else Aim.LOST
        nothing = out if reach[enough] < x else Aim.NO_RANGE
        unknown = np.full(1, np.nan)
        return _single(_throws(scene, unknown, unknown, height, np.array([nothing])))

    def over(log_speed):
        # At the best angle the total derivative with respect to the speed is the partial one
        # (envelope theorem).
        w, _ = best_courses(scene, np.exp(log_speed), height)
        found = landings(scene, w, np.exp(log_speed), along=BY_SPEED, height=height)
        return found.x - x, found.slope

    low, high = np.log(speeds[[before, enough]])[:, None]
    log_speed, fine = root(over, low, high + WIDER)
    w, outcome = best_courses(scene, np.exp(log_speed), height)
    outcome = np.where(fine, outcome, Aim.NO_CONVERGENCE)
    return _single(_throws(scene, w, np.exp(log_speed), height, outcome))


def _throws(scene: Scene, w, speeds: np.ndarray, height: float, outcome: np.ndarray) -> Throws:
    """The throws of these courses, NaN unless found."""
    found = outcome == Aim.FOUND
    one = np.where(found, 1.0, np.nan)
    # A throw straight up is a placeholder where none was found.
    known = np.where(found, w, 0.0), np.where(found, speeds, 1.0)
    end = landings(scene, *known, height=height)
    down = np.arctan2(-end.vy, end.vx)
    return Throws(
        speed=speeds,
        angle=angle_of(w),
        x=one * end.x,
        t=one * end.t,
        landing=one * down,
        height=np.full(np.shape(speeds), height),
        outcome=outcome,
    )


def _height(height) -> float:
    remedy = "For a point above the launch see the example of `hit`."
    return float(at_least_zero("height", array("height", height, ()), remedy))


def _single(throws: Throws) -> Throws:
    return jax.tree.map(lambda column: column[0], throws)
