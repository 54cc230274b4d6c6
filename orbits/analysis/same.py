"""Whether two orbits are the same motion.

One may be seen at another time, rotated, mirrored, relabelled, scaled, or reversed in time: then
they can be aligned (for free points by `alignment`), up to rounding.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import fail
from jaxdyn._records.kinds import check_first
from jaxdyn.formulations.newton import FreePoints
from orbits.analysis.alignment import (
    SAMPLES,
    TOLERANCE,
    Match,
    centred,
    match_points,
    samples,
    turned_distance,
)
from orbits.closing.sizes import sizes
from orbits.motion import solved
from orbits.orbit import Orbit, relocated

#: `TOLERANCE` for orbits so unstable that their own periods differ by as much.
_BLURRED = 1e-4
_MISSES = 4.0  # of those by which one orbit may differ from the other
_ROUNDS = 6  # Gauss-Newton steps on the shift in time
_DIVISORS = 64  # shorter periods are tested down to this part


@check_first
def minimal_period(orbit: Orbit, tolerance: float = TOLERANCE) -> tuple[float, int]:
    """The shortest time after which the motion returns, and how many of these a period is.

    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> twice = orbits.find(scenes.oscillator(k=4.0), [1.0, 0.0], 6.2)
      >>> period, times = orbits.minimal_period(twice)
      >>> round(period, 6), times
      (3.141593, 2)
    """
    parts = np.arange(_DIVISORS, 0, -1)
    system, y0 = orbit.scene.system, np.asarray(orbit.y0)
    ts = orbit.period / parts
    flow = solved(orbit.scene, orbit.period, ts=ts, rtol=orbit.rtol, solver=orbit.solver)
    ys = np.asarray(flow.ys)
    each = sizes(orbit.scene)
    for n, y in zip(parts, ys, strict=True):
        if (np.abs(system.difference(y, y0)) <= tolerance * each).all():
            return orbit.period / float(n), int(n)
    return orbit.period, 1


@check_first
def same_orbit(a: Orbit, b: Orbit, tolerance: float = TOLERANCE) -> bool:
    """Whether two orbits are the same up to symmetries.

    That is, shifts in time; for several free points also its direction, rotations, reflections
    and names of equal bodies; where they only attract each other by Newton's law also scale.

    Args:
      a: an orbit.
      b: another one.
      tolerance: largest distance that counts as the same, relative to the orbits' size. If the
        second period of an orbit differs from its first by more, since it is unstable, four
        times that counts, up to 1e-4.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
      >>> orbits.same_orbit(eight, orbits.normal_form(eight))
      True
    """
    found = match(a, b)
    if found is None or found.distance > max(tolerance, _BLURRED):
        return False
    if found.distance <= tolerance:
        return True
    return found.distance <= _MISSES * max(_missed(a, 0.0), _missed(b, found.shift))


def _missed(orbit: Orbit, shift: float) -> float:
    """Difference of the second period after a time from the first, relative to the size."""
    scene, period = orbit.scene, minimal_period(orbit)[0]
    ts = shift + np.arange(2 * SAMPLES) * period / SAMPLES
    flow = solved(scene, ts[-1], ts=ts, rtol=orbit.rtol, solver=orbit.solver)
    ys = np.asarray(flow.ys).reshape(2, SAMPLES, -1)
    if _several_points(orbit):
        first, second = (centred(y, np.asarray(scene.system.m)) for y in ys)
        return turned_distance(first, second)[0]
    off = jax.vmap(scene.system.difference)(ys[1], ys[0])
    return float(np.abs(np.asarray(off) / sizes(orbit.scene)).max())


@check_first
def match(a: Orbit, b: Orbit) -> Match | None:
    """The best alignment of the second orbit with the first; None if there is none.

    Raises:
      ValueError: `a` or `b` does not close.
    """
    for orbit in (a, b):
        if not orbit.ok:
            raise fail("orbit", "an orbit that closes", orbit.message)
    if type(a.scene.system) is not type(b.scene.system) or a.y0.shape != b.y0.shape:
        return None
    (period_a, _), (period_b, _) = minimal_period(a), minimal_period(b)
    a, b = _over(a, period_a), _over(b, period_b)
    if _several_points(a):
        return match_points(a, b)
    if abs(period_a - period_b) > TOLERANCE * period_a:
        return None
    return _match_states(a, b)


def _several_points(orbit: Orbit) -> bool:
    """Whether it is one of free points that can be seen from their centre of mass."""
    system = orbit.scene.system
    return isinstance(system, FreePoints) and len(system.m) > 1


def _over(orbit: Orbit, period: float) -> Orbit:
    return relocated(orbit, orbit.scene.starting(orbit.y0, period))


def _at(orbit: Orbit, t: float) -> Array:
    return solved(orbit.scene, t, rtol=orbit.rtol, solver=orbit.solver).y1


def _match_states(a: Orbit, b: Orbit) -> Match:
    """As `match_points` for other systems: the first start is sought on the second orbit."""
    system = a.scene.system
    start = jnp.asarray(a.y0)
    ts = np.arange(SAMPLES) * b.period / SAMPLES
    ys, each = samples(b), sizes(a.scene)
    off = np.asarray(jax.vmap(system.difference, (0, None))(jnp.asarray(ys), start)) / each
    shift = float(ts[np.argmin(np.linalg.norm(off, axis=1))])
    for _ in range(_ROUNDS):
        y = _at(b, shift) if shift else jnp.asarray(b.y0)
        rate = np.asarray(b.scene.rate(jnp.asarray(shift), y)) / each
        shift -= float(np.asarray(system.difference(y, start)) / each @ rate / (rate @ rate))
    y = _at(b, shift)
    distance = float(np.abs(np.asarray(system.difference(y, start)) / each).max())
    return Match(
        distance=distance,
        shift=shift % b.period,
        backwards=False,
        order=(),
        mirrored=False,
        scale=1.0,
    )
