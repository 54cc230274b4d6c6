"""Whether two orbits are the same motion.

The same motion may be seen at another time, rotated, mirrored, relabelled, scaled, or reversed in
time; then the two can be aligned (for free points by `alignment`) up to rounding.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn._checks import check_first, fail
from jaxdyn.system import differences
from orbits.analysis.alignment import (
    SAMPLES,
    TOLERANCE,
    Match,
    centre,
    distance_after_rotation,
    match_points,
)
from orbits.analysis.evidence import closure
from orbits.analysis.pieces import Periodic, offset_along, offsets, pieces, states_at
from orbits.closing.given import is_driven, repeats
from orbits.closing.sizes import sizes
from orbits.hybrid.legs import HybridOrbit
from orbits.motion import has_several_points, quick_solve
from orbits.orbit import Orbit, relocate

#: The largest tolerance, for orbits so unstable that their own first two periods differ as much.
_BLURRED = 1e-4
_MISSES = 4.0  # two orbits may differ by this multiple of the difference of an orbit's own periods
_ROUNDS = 6  # Gauss-Newton steps on the shift in time
_DIVISORS = 64  # shorter periods are tested down to the period over this number


@check_first
def minimal_period(orbit: Orbit | HybridOrbit, tolerance: float = TOLERANCE) -> tuple[float, int]:
    """The shortest time after which the motion returns, and how often the period contains it.

    A chain of legs has returned where its closing holds, with the state after a change and not the
    one before it; under a drive, the drive has to return too.

    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> twice = orbits.find(scenes.oscillator(k=4.0), [1.0, 0.0], 6.2)
      >>> period, times = orbits.minimal_period(twice)
      >>> round(period, 6), times
      (3.141593, 2)
    """
    parts = np.arange(_DIVISORS, 1, -1)
    first = pieces(orbit)[0]
    for n, (piece, y) in zip(parts, states_at(orbit, orbit.period / parts), strict=True):
        again = orbit.period / float(n)
        if piece.same_numbers(first) and _near(orbit, y, tolerance) and _in_step(orbit, again):
            return again, int(n)
    return orbit.period, 1


def _in_step(orbit: Periodic, period: float) -> bool:
    """Whether a drive returns too; a state of rest under the drive returns at any time."""
    if isinstance(orbit, HybridOrbit) or not is_driven(orbit.scene):
        return True
    return repeats(orbit.scene, period)


def _near(orbit: Periodic, y: np.ndarray, tolerance: float) -> bool:
    return bool((np.abs(offsets(orbit, y[None], orbit.y0)) <= tolerance).all())


@check_first
def same_orbit(
    a: Orbit | HybridOrbit, b: Orbit | HybridOrbit, tolerance: float = TOLERANCE
) -> bool:
    """Whether two orbits are the same up to symmetries.

    The symmetries are shifts in time; for several free points also the direction of time,
    rotations, reflections and relabelling of equal bodies; where these only attract each other by
    Newton's law, also scaling; for chains of legs, also changes that their closing leaves out.

    Args:
      a: an orbit.
      b: another orbit.
      tolerance: largest distance that counts as the same, relative to the orbits' size. If the
        second period of an orbit differs from its first by more, since it is unstable, four times
        that difference takes its place, up to 1e-4.
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
    return found.distance <= _MISSES * max(_mismatch(a, 0.0), _mismatch(b, found.shift))


def _mismatch(orbit: Periodic, shift: float) -> float:
    """Difference between the first two periods after a shift, relative to the orbit's size."""
    if isinstance(orbit, HybridOrbit):
        return closure(orbit, periods=2)
    scene, period = orbit.scene, minimal_period(orbit)[0]
    ts = shift + np.arange(2 * SAMPLES) * period / SAMPLES
    flow = quick_solve(scene, ts[-1], ts=ts, rtol=orbit.rtol, solver=orbit.solver)
    ys = np.asarray(flow.ys).reshape(2, SAMPLES, -1)
    if has_several_points(scene.system):
        first, second = (centre(y, np.asarray(scene.system.m)) for y in ys)
        return distance_after_rotation(first, second)[0]
    off = differences(scene.system, ys[1], ys[0])
    return float(np.abs(np.asarray(off) / sizes(orbit.scene)).max())


@check_first
def match(a: Orbit | HybridOrbit, b: Orbit | HybridOrbit) -> Match | None:
    """The best alignment of the second orbit with the first; None if there is none.

    For two chains of legs, the start of the first is sought on the legs of the second.

    Raises:
      ValueError: `a` or `b` does not close.
    """
    for orbit in (a, b):
        if not orbit.ok:
            raise fail("orbit", "an orbit that closes", orbit.message)
    if type(a) is not type(b) or not any(one.like(pieces(a)[0]) for one in pieces(b)):
        return None
    (period_a, _), (period_b, _) = minimal_period(a), minimal_period(b)
    if isinstance(a, Orbit) and isinstance(b, Orbit):
        a, b = _over(a, period_a), _over(b, period_b)
        if has_several_points(a.scene.system):
            return match_points(a, b)
    if abs(period_a - period_b) > TOLERANCE * period_a:
        return None
    return _match_states(a, b, period_b)


def _over(orbit: Orbit, period: float) -> Orbit:
    return relocate(orbit, orbit.scene.starting(orbit.y0, period))


def _match_states(a: Periodic, b: Periodic, period: float) -> Match:
    """`match_points` for other systems, which seeks the start of the first orbit on the second.

    The nearest piece of the second is followed beyond its ends if the start is at one of them.
    """
    start, first = jnp.asarray(a.y0), pieces(a)[0]
    best = None
    for piece in (one for one in pieces(b) if one.like(first)):
        ts = np.arange(SAMPLES) * float(piece.scene.t1) / SAMPLES
        off = np.linalg.norm(offsets(a, piece.states(ts), start), axis=1)
        if best is None or off.min() < best[0]:
            best = off.min(), piece, float(ts[np.argmin(off)])
    assert best is not None
    _, piece, t = best
    most, tries = float(piece.scene.t1) / SAMPLES, []
    for _ in range(_ROUNDS):
        y = piece.at(t)
        off, along = offsets(a, y[None], start)[0], offset_along(a, y, piece.scene.rate(t, y))
        tries.append((float(np.abs(off).max()), t))
        # Under a drive a state may rest for a moment; it is then compared without a shift.
        size = float(along @ along)
        t -= float(np.clip(off @ along / size, -most, most)) if size > 0 else 0.0
    distance, t = min(tries)
    return Match(
        distance=distance,
        shift=(piece.t0 + t) % period,
        backwards=False,
        order=(),
        mirrored=False,
        scale=1.0,
    )
