"""All orbits that several guesses lead to: Newton's method with the orbits found so far deflated.

Plain Newton's method leads from a guess to one orbit at most, and from many guesses to the same few
orbits again. With deflation (see `orbits.shooting.deflation`) each guess leads to further ones,
until none is found.
"""

from collections.abc import Callable, Sequence

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import check_first, check_on_host, fail, whole
from jaxdyn._progress import report_progress
from jaxdyn._text import number_of
from orbits.analysis.same import minimal_period, same_orbit
from orbits.closing.closings import PLAIN, Closing, Hold
from orbits.orbit import Orbit
from orbits.shooting.deflation import Deflated
from orbits.shooting.finding import AUTOMATIC, find
from orbits.shooting.strategy import GOAL, RTOL


@check_first
def find_all(
    scene: Scene,
    y0s,
    period=None,
    *,
    lower=None,
    upper=None,
    closing: Closing | Sequence[Closing] = PLAIN,
    hold: Hold = (),
    goal: float = GOAL,
    rtol: float = RTOL,
    max_iterations: int = 60,
    most: int = 100,
    report: Callable[[Orbit], None] = lambda orbit: None,
) -> list[Orbit]:
    """The distinct orbits to which guesses lead, each with those before it deflated.

    Args:
      scene: the scene.
      y0s: (n, k) guesses of the start.
      period: () or (n,) guesses of the full period; the scene's own span by default.
      lower: see `find`.
      upper: see `find`.
      closing: see `find`.
      hold: see `find`; hold the energy of a conservative scene, whose orbits form families.
      goal: see `find`.
      rtol: see `find`.
      max_iterations: most Newton steps for an orbit; after as many without one a guess is given up.
      most: largest number of orbits.
      report: called with each orbit as it is found, so that an interrupted run leaves what it has.
    Returns:
      The orbits in the order in which they were found, each over its shortest period; no two are
      the same up to the symmetries of `same_orbit`: shifts in time and, for several free points,
      rotations, reflections, reversal and relabelling. Other symmetries of a scene are not known:
      images of an orbit under them, such as its mirror image or its copies turned by a third in
      `scenes.henon_heiles`, count as further orbits.
    Raises:
      ValueError: `y0s` or `period` has the wrong shape, or what `find` refuses.
    Limits: a search proves nothing about orbits it has not found. Host only.
    Reference: P. Farrell, A. Birkisson, S. Funke, SIAM J. Sci. Comput. 37 (2015) A2026.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> well, level = scenes.henon_heiles(), orbits.Energy(1 / 8)
      >>> found = orbits.find_all(well, [[0.0, 0.1, 0.4, 0.0]], 6.5, hold=level)
      >>> sorted({round(orbit.period, 4) for orbit in found})
      [6.0756, 6.9006, 7.5433]
    """
    check_on_host("find_all", (scene, y0s, period), "Search outside of the transformation.")
    most = whole("most", most)
    starts = np.asarray(y0s, float)
    k = len(scene.y0)
    if starts.ndim != 2 or starts.shape[1] != k:
        raise fail("y0s", f"guesses of shape (n, {k})", f"shape {starts.shape}")
    spans = np.asarray(scene.t1 if period is None else period, float)
    if spans.shape not in ((), (len(starts),)):
        raise fail("period", f"one time, or one for each of {len(starts)}", f"shape {spans.shape}")
    found: list[Orbit] = []

    def closest(y0, span, closing=closing, known: Sequence[Orbit] = ()) -> Orbit:
        return find(
            scene,
            y0,
            span,
            lower=lower,
            upper=upper,
            closing=closing,
            hold=hold,
            goal=goal,
            rtol=rtol,
            strategy=Deflated(known) if known else AUTOMATIC,
            max_iterations=max_iterations,
            throw=False,
        )

    for i, (y0, span) in enumerate(zip(starts, np.broadcast_to(spans, len(starts)), strict=True)):
        while len(found) < most:
            report_progress(f"looking for orbits: {number_of(len(found), 'orbit')}", i, len(starts))
            orbit = closest(y0, span, known=tuple(found))
            shorter = over_shortest_period(orbit, closest)
            orbit = orbit if shorter is None else shorter
            if not orbit.ok or any(same_orbit(known, orbit) for known in found):
                break
            found.append(orbit)
            report(orbit)
    return found


def over_shortest_period(orbit: Orbit, closest: Callable[..., Orbit]) -> Orbit | None:
    """The orbit over its shortest period, found by ``closest(y0, period, closing)``; or None."""
    shortest, times = minimal_period(orbit) if orbit.ok else (orbit.period, 1)
    # Over the shortest period the orbit may satisfy plain closing only.
    again = (closest(orbit.y0, shortest, closing) for closing in (orbit.closing, PLAIN))
    return next((x for x in (again if times > 1 else (orbit,)) if x.ok), None)
