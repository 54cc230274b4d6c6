"""The periodic orbit near a scene's own start, from a guess of its period or from close returns."""

import functools
from collections.abc import Callable, Sequence

import equinox as eqx

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn._progress import doing
from jaxdyn._records.kinds import check_first
from orbits.analysis.same import minimal_period
from orbits.closing.closings import PLAIN, Closing, Reversal
from orbits.closing.conditions import Energy
from orbits.closing.given import driven
from orbits.discovery.seeds import Seed, returns
from orbits.orbit import Orbit
from orbits.shooting.finding import find
from orbits.shooting.newton import Iteration

_TRIES = 3  # close returns tried


@check_first
def searched(
    scene: Scene,
    period: float | None = None,
    *,
    closing: Closing | Sequence[Closing] = PLAIN,
    energy: float | None = None,
    hold: Sequence[str] = (),
    segments: int | None = None,
    rough: bool = False,
    collocation: bool | None = None,
    unlike: Sequence[Orbit] = (),
    report: Callable[[Iteration], None] = lambda step: None,
) -> Orbit:
    """The orbit near a scene's own start, or the best iterate and the reason.

    Args:
      scene: system, effects, start.
      period: guess; by default the closest returns of the scene's own motion are tried.
      closing: see `find`.
      energy: that of the orbit; None for any.
      hold: names of entries of the scene's start that the orbit's start keeps.
      segments: see `find`.
      rough: see `find`.
      collocation: see `find`.
      unlike: see `find`.
      report: see `find`.
    Raises:
      ValueError: no close return to begin with, or what `find` refuses.
    """
    several = (closing,) if isinstance(closing, Closing) else tuple(closing)
    held = (*hold, *(() if energy is None else (Energy(energy),)))
    near = functools.partial(
        find,
        scene,
        closing=several,
        hold=held,
        segments=segments,
        collocation=collocation,
        unlike=unlike,
        report=report,
        throw=False,
    )
    if period is not None:
        return near(None, period, rough=rough)
    seeds = _seeds(scene)
    # The scene's own start, if that is periodic already.
    orbit = near(None, seeds[0].period, max_iterations=0)
    for seed in seeds if not orbit.ok else ():
        # A reversal needs a start that it leaves fixed, such as the scene's own may be.
        start = None if hold or isinstance(several[0], Reversal) else seed.y0
        orbit = near(start, seed.period, rough=rough)
        if orbit.ok:
            break
    shortest, times = minimal_period(orbit) if orbit.ok else (orbit.period, 1)
    if times == 1:
        return orbit
    # The closest return may be after several periods.
    again = near(orbit.y0, shortest, unlike=())
    return eqx.tree_at(lambda o: o.shift, again, orbit.shift + again.shift)


def _seeds(scene: Scene) -> list[Seed]:
    if driven(scene):
        raise fail("--period", "one, a multiple of the drive's", "none", "The motion is driven.")
    scene.check()
    doing("simulating the scene, to find close returns")
    seeds = returns(scene, float(scene.t1), longest=float(scene.t1), most=_TRIES)
    if not seeds:
        remedy = "The scene's own motion has no close return in its span."
        raise fail("--period", "a guess of the period", "none", remedy)
    return seeds
