"""Contacts that stick and slip: dry friction, skids, hops, and a level that is only touched.

They are compared with closed forms. All forces are sines or constants, so the motions between
events are known, and the time of each event is a root of one function of time.
"""

import math
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.effects import ConstantForce, SinusoidalForce, Spring, UniformGravity
from jaxdyn.hard.case import Case, Figure, relative_error
from jaxdyn.integrate.events import Reaches, until
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.integrate.phases import simulate_phases
from jaxdyn.scene import Scene
from jaxdyn.scenes.corners import phases_of
from jaxdyn.scenes.cylinders import cylinder_on_ramp
from jaxdyn.scenes.particles import particle
from jaxdyn.scenes.pendula import pendulum

_RTOL = 1e-13
_BOUND = 1e-10
_G = 10.0
_HALVINGS = 100
_MU, _FREQUENCY = 0.5, 3.0
_HALF = math.pi / _FREQUENCY
_CYCLES = 10


class StickOrSlide(eqx.Module):
    """The choice whether dry friction holds a spring: 1 for END, 0 to slide back."""

    far: Array  # largest distance from the anchor at which friction can hold [m]

    def __call__(self, t: Array, y: Array) -> Array:
        """The number of the next phase."""
        del t
        return jnp.where(jnp.abs(y[0]) <= self.far, 1, 0)


def rubbing_mass(k: float, friction: float) -> dict[str, Phase]:
    """The phases of a mass of 1 kg on a spring that slides right and left on a dry floor."""
    held = StickOrSlide(jnp.asarray(friction / k))
    phases = {}
    for way, name, other in ((1, "right", "left"), (-1, "left", "right")):
        scene = particle(Spring(k), ConstantForce((-way * friction, 0.0)))
        stops = Exit(Reaches(2, 0.0, -way), (other, END), choose=held)
        phases[name] = Phase(scene, (stops,))
    return phases


def _dry() -> tuple[Figure, ...]:
    k, friction, start = 9.0, 1.0, 2.5
    chain = simulate_phases(
        rubbing_mass(k, friction), "left", [start, 0.0, 0.0, 0.0], 100.0, samples=2, rtol=_RTOL
    )
    n = np.arange(1, 1 + math.ceil((start * k / friction - 1) / 2))
    places = (-1.0) ** n * (start - 2 * n * friction / k)
    found = [piece.ys[-1, 0] for piece in chain.pieces]
    return (
        Figure(
            "times of the turns", relative_error(chain.times, n * math.pi / math.sqrt(k)), _BOUND
        ),
        Figure("places of the turns", relative_error(found, places), _BOUND),
        Figure("turns too many or too few", abs(len(chain.names) - len(n)), 0),
        Figure("no clear end", float(not chain.ended), 0),
    )


def _cylinder(t1: float, spin: float, **push) -> Scene:
    scene = cylinder_on_ramp(d=0.0, inertia=0.5, slope=0.0, mu=_MU, g=_G, spin=spin, t1=t1)
    return scene + SinusoidalForce(omega=_FREQUENCY, **push)


def _skids() -> tuple[Figure, ...]:
    """The figures of a cylinder pushed by F sin(w t), which rolls until this equals 3 mu m g.

    Then its slip grows at the rate F sin(w t) / m - 3 mu g, and later ends.
    """
    push, grip = 4 * _MU * _G, 3 * _MU * _G
    scene = _cylinder(_CYCLES * _HALF, 0.0, F=(push / 2, 0.0))  # half on each of two points
    chain = simulate_phases(
        phases_of(scene), "roll", scene.y0, float(scene.t1), samples=2, rtol=_RTOL
    )
    skids = math.asin(grip / push) / _FREQUENCY

    def slip(t):
        swing = math.cos(_FREQUENCY * skids) - math.cos(_FREQUENCY * t)
        return push / _FREQUENCY * swing - grip * (t - skids)

    rolls = _root(slip, math.pi / 2 / _FREQUENCY, skids + _HALF)
    wanted = np.ravel(_HALF * np.arange(_CYCLES)[:, None] + np.array([[skids, rolls]]))
    wanted = wanted[wanted < _CYCLES * _HALF]
    return (
        Figure(
            "times of the skids and their ends", relative_error(chain.times[:-1], wanted), _BOUND
        ),
        Figure("phases", len(chain.names), 2 * _CYCLES + 1),
        Figure(
            "phases of the wrong kind", _wrong(chain, ("roll", "slip_on", "roll", "slip_back")), 0
        ),
    )


def _hops() -> tuple[Figure, ...]:
    """The figures of a rolling cylinder that F sin(w t) lifts off where it equals m g."""
    lift, t1 = 2 * _G, _CYCLES * _HALF
    scene = _cylinder(t1, 1.0, F=(0.0, lift / 2))
    chain = simulate_phases(phases_of(scene), "roll", scene.y0, t1, samples=2, rtol=_RTOL)
    off = math.asin(_G / lift) / _FREQUENCY

    def height(t):
        s, w = t - off, _FREQUENCY
        rise = s * math.cos(w * off) - (math.sin(w * t) - math.sin(w * off)) / w
        return lift / w * rise - _G * s * s / 2

    lands = _root(height, math.pi / 2 / _FREQUENCY, off + 2 * _HALF)
    wanted = np.ravel(2 * _HALF * np.arange(_CYCLES // 2)[:, None] + np.array([[off, lands]]))
    wanted = wanted[wanted < t1]
    return (
        Figure("times of take-off and landing", relative_error(chain.times[:-1], wanted), _BOUND),
        Figure("phases", len(chain.names), _CYCLES + 1),
        Figure("phases of the wrong kind", _wrong(chain, ("roll", "fly")), 0),
        Figure("change of the speed along [m/s]", abs(float(chain.y[3]) - 1.0), 1e-12),
    )


def _wrong(chain, cycle: tuple[str, ...]) -> int:
    return sum(name != cycle[i % len(cycle)] for i, name in enumerate(chain.names))


def _grazing() -> tuple[Figure, ...]:
    """The figures of a ball that rises to 1.25 m, and of a pendulum with an amplitude of 1 rad.

    The ball passes a height d below its highest point sqrt(2 d / g) before it is there.
    """
    ball = particle(UniformGravity(_G), velocity=(1.0, 5.0))
    below, above = 1.25 - 1e-9, 1.25 + 1e-9
    touched = until(ball, Reaches(1, below), 3.0, rtol=_RTOL)
    when = 0.5 - math.sqrt(2 * (1.25 - below) / _G)
    swing = pendulum(angle=1.0)
    inside, outside = (
        until(swing, Reaches(0, -1.0 + off), 40.0, rtol=_RTOL) for off in (1e-9, -1e-9)
    )
    return (
        Figure("time of a touch 1e-9 m deep", relative_error([touched.t], [when]), _BOUND),
        Figure("a touch 1e-9 m too high seen", float(_reaches(ball, above)), 0),
        Figure("a touch 1e-12 m deep missed", float(not _reaches(ball, 1.25 - 1e-12)), 0),
        Figure("a touch 1e-12 m too high seen", float(_reaches(ball, 1.25 + 1e-12)), 0),
        Figure("a swing 1e-9 rad too far missed", float(not inside.happened), 0),
        Figure("a swing 1e-9 rad too short seen in 20 periods", float(outside.happened), 0),
    )


def _reaches(scene: Scene, height: float) -> bool:
    return bool(until(scene, Reaches(1, height), 3.0, rtol=_RTOL).happened)


def _root(fn: Callable[[float], float], low: float, high: float) -> float:
    """The root, between two points, of a function that decreases through 0."""
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if fn(middle) > 0 else (low, middle)
    return (low + high) / 2


CASES = (
    Case("dry-friction", "A mass on a spring slides on a dry floor until friction holds it.", _dry),
    Case("rolling-and-skidding", "A pushed cylinder skids and rolls again, ten times.", _skids),
    Case("lift-off-and-landing", "A cylinder that is pulled up lifts off and lands again.", _hops),
    Case("grazing", "A level is met or missed by 1e-9 of the size of the motion.", _grazing),
)
