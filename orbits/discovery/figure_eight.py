"""From the course's rough guess to Montgomery's figure-eight, through its neighbour.

Course problem 28 asks to close the motion from a rough guess of the eight. Closing it plainly
leads to a neighbour, in which three bodies follow three slightly different eights: weakly
unstable, T |E|^(3/2) = 9.2376827... Montgomery's eight is a choreography, all bodies on one
curve: stable, T |E|^(3/2) = 9.2376812507... A closing error of 1e-5 cannot distinguish them. So the
motion is closed plainly first, then with the condition of a choreography.
"""

from collections.abc import Callable

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.scenes import EIGHT_GUESS, EIGHT_GUESS_PERIOD, three_body
from orbits.closing.closings import choreography
from orbits.closing.given import pose
from orbits.orbit import Orbit
from orbits.shooting.finding import find
from orbits.shooting.newton import Iteration

#: Half width of the search box round the guess, for positions and velocities.
BOX = 0.5
#: Half width for the period.
PERIOD_BOX = 2.0


def figure_eight(
    guess=EIGHT_GUESS,
    period=EIGHT_GUESS_PERIOD,
    *,
    m=(1.0, 1.0, 1.0),
    lower=None,
    upper=None,
    say: Callable[[str], None] = lambda text: None,
    report: Callable[[Iteration], None] = lambda iteration: None,
) -> tuple[Orbit, Orbit]:
    """The plainly closed orbit near a guess, and the choreography near it.

    Args:
      guess: (12,) x1 y1 x2 y2 x3 y3 vx1 vy1 vx2 vy2 vx3 vy3.
      period: () guess of the period.
      m: (3,) masses.
      lower: (13,) lower bounds of the start and the period; `BOX` round the guess by default.
      upper: (13,) upper bounds.
      say: called with a line of text at each stage.
      report: called after each Newton step.
    Returns:
      (plain, eight); check their `outcome`: a stage that fails returns its best iterate.
    Raises:
      ValueError: an argument has the wrong shape or is not finite, or the masses differ.
    """
    scene = three_body(np.asarray(guess, dtype=float), m=m, t1=period)
    scene.check()
    if np.ptp(np.asarray(m, dtype=float)) != 0:
        raise fail("masses", "equal ones", m, "Bodies of a choreography are interchanged.")
    lower = _around(scene, -1) if lower is None else lower
    upper = _around(scene, +1) if upper is None else upper
    pose(scene, lower=lower, upper=upper)
    say("closing plainly: y(T) = y(0)")
    plain = find(scene, lower=lower, upper=upper, report=report, throw=False)
    if not plain.ok:
        return plain, plain
    say("imposing the choreography: y(T/3) = y(0) with each body in the next one's place")
    eight = find(
        scene,
        plain.y0,
        plain.period,
        lower=lower,
        upper=upper,
        closing=choreography(3),
        report=report,
        throw=False,
    )
    return plain, eight


def _around(scene: Scene, side: int) -> np.ndarray:
    """(13,) the bounds on one side of the guess."""
    period = float(scene.t1)
    # A period of zero closes everything; the box must exclude it.
    bound = max(period - PERIOD_BOX, period / 2) if side < 0 else period + PERIOD_BOX
    return np.append(np.asarray(scene.y0) + side * BOX, bound)
