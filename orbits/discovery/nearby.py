"""The periodic orbit near a scene's own motion, from a guess of its period or from returns."""

import functools
from collections.abc import Callable, Iterator, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import check_first, check_on_host, fail
from jaxdyn._progress import report_progress
from jaxdyn.integrate.simulation import solve
from jaxdyn.status import Status
from orbits.analysis.same import minimal_period
from orbits.closing.closings import PLAIN, Closing, Energy, Reversal
from orbits.closing.given import DIFFERENTIATE, drive_period, is_driven
from orbits.discovery.seeds import Seed, extents, returns
from orbits.motion import quick_solve, sample
from orbits.orbit import Orbit, SearchError
from orbits.shooting.collocation import Collocation
from orbits.shooting.deflation import Deflated
from orbits.shooting.finding import AUTOMATIC, find
from orbits.shooting.newton import Iteration
from orbits.shooting.strategy import Strategy

_TRIES = 3  # close returns tried
#: Bounds on the steps of a span in which close returns are searched for. With more, whole turns of
#: the motion may lie between two samples of `returns`; with fewer, it may have completed only a
#: part of a turn. A span that replaces the scene's own has one to two times the lower bound; a
#: smooth turn has 3.
_MOST_STEPS, _FEWEST_STEPS = 2048, 64
_SPANS = 20  # most spans tried; each may be some tens of times longer or shorter than the last
_RTOL = 1e-10  # as in `returns`
#: A motion that does not preserve volumes may end on an attractor, perhaps a periodic orbit: how
#: long it may take to come close to it, and how long close returns are searched for there [spans].
_TRANSIENTS = ((30.0, 2.0), (300.0, 20.0))
_NEAR = 0.25  # an orbit is near a guess whose start it changes by less, in extents of its motion
_PRESERVED = 1e-9  # relative change of volumes over a span that rounding may cause


@check_first
def search_near(
    scene: Scene,
    period: float | None = None,
    *,
    closing: Closing | Sequence[Closing] = PLAIN,
    energy: float | None = None,
    hold: Sequence[str] = (),
    strategy: Strategy = AUTOMATIC,
    segments: int | None = None,
    report: Callable[[Iteration], None] = lambda step: None,
    throw: bool = True,
) -> Orbit:
    """The periodic orbit near a scene's own motion.

    `orbits.find` needs a guess of the period; this needs none. It takes the closest returns of the
    scene's own motion as guesses, and where none leads to an orbit and the motion does not
    preserve volumes, those of the same motion after a transient, which finds limit cycles.

    Args:
      scene: system, effects, start.
      period: guess; by default that of the forcing or, without forcing, the closest returns of the
        scene's own motion in its span, or in another span if that is much shorter or longer than a
        turn of the motion.
      closing: see `find`.
      energy: energy of the orbit; None for any.
      hold: names of entries of the scene's start that the orbit's start keeps.
      strategy: see `find`.
      segments: see `find`.
      report: see `find`.
      throw: raise if no orbit was found; with False check `Orbit.ok`.
    Returns:
      The orbit over its minimal period, or with ``throw=False`` the best iterate and the reason.
    Raises:
      ValueError: no close return to begin with, or what `find` refuses.
      SearchError: no orbit was found (``throw=True``).
    Example:
      >>> import jax.numpy as jnp, jaxdyn, orbits
      >>> def brusselator(t, y):
      ...     return jnp.array([1 + y[0] ** 2 * y[1] - 4 * y[0], 3 * y[0] - y[0] ** 2 * y[1]])
      >>> cycle = orbits.search_near(jaxdyn.ode(brusselator, jnp.array([1.0, 1.0]), t1=20.0))
      >>> round(cycle.period, 6)
      7.15692
    """
    check_on_host("search_near", (scene, period, energy), DIFFERENTIATE)
    several = (closing,) if isinstance(closing, Closing) else tuple(closing)
    held = (*hold, *(() if energy is None else (Energy(energy),)))
    near = functools.partial(
        find,
        scene,
        closing=several,
        hold=held,
        strategy=strategy,
        segments=segments,
        report=report,
        throw=False,
    )
    if period is not None:
        orbit = near(None, period)
    else:
        # A reversal needs a start that it leaves fixed, as the scene's own start may be.
        movable = not hold and not isinstance(several[0], Reversal)
        # First the scene's own start is tested, which may be periodic already; an orbit that is
        # deflated does not count.
        own = strategy if isinstance(strategy, Deflated | Collocation) else AUTOMATIC
        orbit = _minimal(_near_returns(scene, movable, own, held, near), near)
    if throw and not orbit.ok:
        raise SearchError(" ".join(filter(None, (orbit.message, orbit.hint))))
    return orbit


def _near_returns(
    scene: Scene, movable: bool, own: Strategy, held: tuple, near: Callable[..., Orbit]
) -> Orbit:
    """The orbit that a close return leads to, or the last one tried, which does not close."""
    orbit = None
    for seeds in _seeds(scene, movable):
        if orbit is None:
            orbit = near(None, seeds[0].period, strategy=own, max_iterations=0)
        for seed in seeds if not orbit.ok else ():
            orbit = near(seed.y0 if movable else None, seed.period)
            if orbit.ok:
                if movable:
                    orbit = _nearer(scene, seed, orbit, held, near)
                break
        if orbit.ok:
            break
    if orbit is None:
        remedy = (
            "The scene's own motion has no close return in its span. Give one, or another start or "
            "span (t1)."
        )
        raise fail("period", "a guess of the period", "none", remedy)
    return orbit


def _minimal(orbit: Orbit, near: Callable[..., Orbit]) -> Orbit:
    """The orbit over its minimal period: the closest return may be after several periods."""
    while orbit.ok:
        shortest, times = minimal_period(orbit)
        if times == 1:
            break
        again = near(orbit.y0, shortest, strategy=AUTOMATIC)
        orbit = eqx.tree_at(lambda o: o.shift, again, orbit.shift + again.shift)
    return orbit


def _nearer(
    scene: Scene, seed: Seed, orbit: Orbit, held: tuple, near: Callable[..., Orbit]
) -> Orbit:
    """The member of its family that keeps the entry of a guess which the orbit changes most.

    Newton's method takes the step that is shortest relative to the sizes of the entries. Where a
    size is large, such as that of a position measured from a far origin, a step may reduce the
    extent of the motion to nothing: from the guess of a halo orbit it leads to a planar one.
    Returns the orbit itself if the other one is not nearer.
    """
    if is_driven(scene) or _changes_volumes(scene, seed.period):
        return orbit  # it belongs to no family of the scene
    _, ys = sample(scene.starting(seed.y0), seed.period)
    ranges = extents(scene, seed.period, ys)

    def off(found: Orbit) -> np.ndarray:
        return np.abs(scene.system.difference(np.asarray(found.y0), seed.y0)) / ranges

    if off(orbit).max() <= _NEAR:
        return orbit
    kept = scene.labels()[int(np.argmax(off(orbit)))][0]
    other = near(seed.y0, seed.period, hold=(*held, kept))
    return other if other.ok and off(other).max() < off(orbit).max() else orbit


def _seeds(scene: Scene, movable: bool) -> Iterator[list[Seed]]:
    """Guesses from the scene's own motion, and then, if a start may move, from its attractor."""
    scene.check()
    if is_driven(scene):
        period = drive_period(scene)
        if period is None:
            remedy = "The rate depends on time, but not with a period that can be read from it."
            raise fail("period", "one, a multiple of the drive's", "none", remedy)
        yield [Seed(np.asarray(scene.y0), period)]
        for later, _ in _TRANSIENTS if movable and _changes_volumes(scene, period) else ():
            whole = round(later) * period
            if (settled := _after(scene, whole)) is not None:
                yield [Seed(np.asarray(settled.y0), period)]
        return
    report_progress("simulating the scene, to find close returns")
    span = float(scene.t1)
    for span in _spans(scene):
        seeds = returns(scene, span, longest=span, most=_TRIES)
        if seeds:
            yield seeds
            break
    for later, searched in _TRANSIENTS if movable and _changes_volumes(scene, span) else ():
        report_progress("simulating the scene past its transient, to find close returns")
        settled = _after(scene, later * span)
        longest = searched * span
        if settled is not None and (
            seeds := returns(settled, longest, longest=longest, most=_TRIES)
        ):
            yield seeds


def _changes_volumes(scene: Scene, span: float) -> bool:
    """Whether the motion expands or contracts volumes anywhere, by Liouville's formula.

    Each sample counts, not their sum: where a motion leaves an unstable equilibrium it expands
    volumes first.
    """
    ts, ys = sample(scene, span)
    return bool((np.abs(_divergences(scene, ts, ys)) * span > _PRESERVED).any())


@eqx.filter_jit
def _divergences(scene: Scene, ts: Array, ys: Array) -> Array:
    """(n,) traces of the rate's Jacobian at states ys (n, k)."""

    def trace(t, y):
        return jnp.trace(jax.jacfwd(lambda y: scene.rate(t, y))(y))

    return jax.vmap(trace)(jnp.asarray(ts), jnp.asarray(ys))


def _after(scene: Scene, span: float) -> Scene | None:
    """The scene, started where its motion is after a time; None if the motion ends before."""
    run = quick_solve(scene, span, rtol=_RTOL)
    return scene.starting(run.y1) if run.status == Status.OK else None


def _spans(scene: Scene) -> Iterator[float]:
    """The scene's own span unless it has too many steps, and, if it has too many or few, another.

    The number of steps of the integrator, which does not depend on units, indicates how many turns
    the motion completes in a span.
    """
    span = float(scene.t1)
    steps = _steps(scene, span)
    if steps <= _MOST_STEPS:
        yield span
    enough = steps == 0 or _FEWEST_STEPS <= steps <= _MOST_STEPS
    for _ in range(0 if enough else _SPANS):
        span *= 1.5 * _FEWEST_STEPS / steps
        steps = _steps(scene, span)
        if steps == 0:
            return
        if _FEWEST_STEPS <= steps <= 2 * _FEWEST_STEPS:
            yield span
            return


def _steps(scene: Scene, span: float) -> int:
    """Number of steps of a motion over a span, at most twice `_MOST_STEPS`; 0 where it fails.

    Where the motion is stiff, they are those of the stiff method: those of an explicit one indicate
    the rate of decay, and not the turns.
    """
    run = solve(scene, span, rtol=_RTOL, max_steps=2 * _MOST_STEPS)
    if run.status == Status.STEP_LIMIT:
        return 2 * _MOST_STEPS
    return int(run.steps) if run.status == Status.OK else 0
