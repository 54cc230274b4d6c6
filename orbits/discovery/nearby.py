"""The periodic orbit near a scene's own start, from a guess of its period or from close returns."""

import functools
from collections.abc import Callable, Sequence

import equinox as eqx

from jaxdyn import Scene
from jaxdyn._checks import choice, fail
from jaxdyn._progress import doing
from jaxdyn.formulations.newton import FreePoints
from orbits.analysis.same import minimal_period
from orbits.closing import closings as closings
from orbits.closing.conditions import Energy
from orbits.closing.given import driven
from orbits.closing.symmetry import backwards
from orbits.discovery.seeds import Seed, returns
from orbits.orbit import Orbit
from orbits.shooting.finding import find
from orbits.shooting.newton import Iteration

_TRIES = 3  # close returns that are tried


def searched(
    scene: Scene,
    period: float | None = None,
    *,
    closing: str = "plain",
    energy: float | None = None,
    hold: Sequence[str] = (),
    segments: int | None = None,
    report: Callable[[Iteration], None] = lambda step: None,
) -> Orbit:
    """The orbit near a scene's own start; the best iterate and the reason where there is none.

    Args:
      scene: what moves.
      period: guess; left out, the closest returns of the scene's own motion are tried.
      closing: plain, choreography, relative or reversal.
      energy: of the wanted orbit; None for any.
      hold: names of entries of the scene's start that the orbit's start keeps.
      segments: see `find`.
      report: see `find`.
    Raises:
      ValueError: a closing that the scene does not allow, or no close return to begin with.
    """
    several = _closings(scene, closing)
    held = (*hold, *(() if energy is None else (Energy(energy),)))
    near = functools.partial(
        find, scene, closing=several, hold=held, segments=segments, report=report, throw=False
    )
    if period is not None:
        return near(None, period)
    seeds = _seeds(scene)
    # The scene's own start, where that is periodic as it is.
    orbit = near(None, seeds[0].period, max_iterations=0)
    for seed in seeds if not orbit.ok else ():
        # A reversal needs a start that it keeps, which the scene's own may be.
        orbit = near(None if hold or closing == "reversal" else seed.y0, seed.period)
        if orbit.ok:
            break
    shortest, times = minimal_period(orbit) if orbit.ok else (orbit.period, 1)
    if times == 1:
        return orbit
    # The closest return may be after several periods.
    again = near(orbit.y0, shortest)
    return eqx.tree_at(lambda o: o.shift, again, orbit.shift + again.shift)


def _seeds(scene: Scene) -> list[Seed]:
    if driven(scene):
        raise fail("--period", "one, a multiple of the drive's", "none", "The motion is driven.")
    scene.check()
    doing("simulating the scene, to see when it nearly comes back")
    seeds = returns(scene, float(scene.t1), longest=float(scene.t1), most=_TRIES)
    if not seeds:
        remedy = "The scene's own motion does not nearly come back in its span."
        raise fail("--period", "a guess of the period", "none", remedy)
    return seeds


def _closings(scene: Scene, name: str) -> Sequence[closings.Closing]:
    choice("--closing", name, ("plain", "choreography", "relative", "reversal"))
    system = scene.system
    if name == "choreography":
        if not isinstance(system, FreePoints):
            raise fail("--closing", "one for this scene", name, "Only free points can follow it.")
        return closings.choreography(len(system.m), system.d)
    if name == "relative":
        turns = [key for key in system.generators(scene.y0) if key.startswith("turn")]
        if not turns:
            raise fail("--closing", "one for this scene", name, "Nothing turns its state.")
        return (closings.relative(turns[0]),)
    if name == "reversal":
        return (closings.reversal(backwards(len(scene.y0))),)
    return (closings.PLAIN,)
