"""The phases of the ready-made scenes whose motions have corners, by the kind of their system.

To add phases, write a function of the scene in the file of its family, and add a line here.
"""

from collections.abc import Callable

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.integrate.phase import Phase
from jaxdyn.integrate.phases import simulate_phases
from jaxdyn.mechanisms.car import Car
from jaxdyn.mechanisms.cylinders import Cylinder
from jaxdyn.scene import Scene, check_scene
from jaxdyn.scenes import cylinders, impacts, walkers, wheels

_PHASES: dict[type, Callable[[Scene], dict[str, Phase]]] = {
    Car: wheels.braking,
    Cylinder: cylinders.contact_phases,
    impacts.BallOnTable: impacts.flight_phases,
    impacts.ImpactOscillator: impacts.impact_phases,
    walkers.RimlessWheel: walkers.roll_phases,
    walkers.SimplestWalker: walkers.walk_phases,
}

_IN_PHASES = (
    "`jaxdyn run` follows it from phase to phase; the guide 22_walkers.md has its periodic motions."
)


def has_corners(scene: Scene) -> bool:
    """Whether `phases_of` has the phases of a scene; a car without friction has none."""
    kind = _kind(scene)
    return kind in _PHASES and (kind is not Car or bool(scene.effects))


@check_first
def phases_of(scene: Scene) -> dict[str, Phase]:
    """The phases of a ready-made scene whose motion has corners, for `simulate_phases`.

    ``simulate_phases(phases_of(scene), None, scene.y0, t1)`` begins with the first phase that the
    start fits. `orbits.find_hybrid` finds periodic motions through the phases.

    Args:
      scene: a cylinder (roll, slip, fly), a `car` with friction (slide), a `rimless_wheel`, a
        `simplest_walker`, a `ball_on_table` or an `impact_oscillator`.
    Raises:
      ValueError: `scene` is another one, or a car without friction.
    Example:
      >>> from jaxdyn import scenes
      >>> from jaxdyn.integrate import phases
      >>> walker = scenes.simplest_walker()
      >>> steps = phases.simulate_phases(scenes.phases_of(walker), None, walker.y0, 20.0)
      >>> len(steps.pieces)
      6
    """
    make = _PHASES.get(_kind(check_scene(scene)))
    if make is None:
        known = ", ".join(sorted(kind.__name__ for kind in _PHASES))
        remedy = "Write the phases: jaxdyn.integrate.phases.Phase(scene, exits)."
        raise _checks.fail("scene", f"one of {known}", _kind(scene).__name__, remedy)
    return make(scene)


def check_one_phase(scene: Scene, t1=None) -> Scene:
    """The scene, if its motion up to t1, or in its span, stays in the phase in which it begins.

    A function that uses only the rate of the scene would pass through a stop, or below the ground.

    Raises:
      ValueError: the motion leaves that phase, or begins in none.
    """
    if not has_corners(scene):
        return scene
    span = float(scene.t1 if t1 is None else t1)
    motion = simulate_phases(phases_of(scene), None, scene.y0, span, samples=1, max_phases=2)
    if motion.path:
        name, _ = motion.path[0]
        left = float(motion.pieces[0].ts[-1])
        got = f"one of {scene.name} that leaves {name!r} at t = {left:.6g}"
        raise _checks.fail("scene", "a motion in one phase", got, _IN_PHASES)
    return scene


def _kind(scene: Scene) -> type:
    return type(getattr(scene.system, "mechanism", scene.system))
