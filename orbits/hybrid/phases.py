"""Legs from phases: the chain of legs along a path through the phases of a scene.

A phase (`jaxdyn.integrate.phase`) has several exits, a leg only the one by which it ends. All exits
of the phase that have a direction become bounds of the leg, so that a chain that passes one of them
on the way is not taken for a motion.
"""

from collections.abc import Mapping, Sequence

import equinox as eqx
import numpy as np

from jaxdyn._checks import choice, fail, whole
from jaxdyn._text import brief, number_of
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.phase import Phase, no_time
from jaxdyn.integrate.phases import simulate_phases
from orbits.hybrid.legs import Leg, Path

#: Number of the scenes' spans within which a guess is followed to its events.
_SPANS = 100.0
_EVENTS_MOST = 30  # number of events within which the motion has to return to its first phase

Phases = Mapping[str, Phase]


class Inside(Event):
    """How far a state is from an exit, on the side where this is positive within the phase.

    Attributes:
      event: the event of the exit.
      side: the sign of the event's value within the phase.
    """

    event: Event
    side: int = eqx.field(static=True)

    def value(self, t, y):
        return self.side * self.event.value(t, y)


def legs_of(given: Sequence[Leg] | Phases, path: Path) -> tuple[Leg, ...]:
    """The given legs, or those along a path through given phases.

    Raises:
      ValueError: the phases have no such path.
    """
    if not isinstance(given, Mapping):
        return tuple(given)
    legs = []
    for name, number in path:
        phase = given[choice("phase", name, given)]
        if not isinstance(phase, Phase):
            got = type(phase).__name__
            raise fail(f"phase {name}", "a Phase", got, "Write Phase(scene, exits).")
        if not 0 <= number < len(phase.exits):
            raise fail(f"phase {name}", f"an exit of number {number}", f"{len(phase.exits)} exits")
        last = phase.exits[number]
        if last.lasts is not no_time:
            remedy = "Write what lasts as a leg of its own."
            wanted = "a change that takes no time"
            raise fail(f"exit {number} of {name}", wanted, "one that lasts", remedy)
        bounds = tuple(Inside(other.event, other.side) for other in phase.exits if other.side)
        legs.append(Leg(phase.scene, (last.event,), last.change, bounds))
    return tuple(legs)


def _suggest_count(phases: Phases, y0, span: float, first: str) -> str:
    """Advice for a number of events that does not lead back to the first phase."""
    path = simulate_phases(phases, None, y0, span, samples=2, max_phases=_EVENTS_MOST).path
    for n, (name, number) in enumerate(path, 1):
        if first in phases[name].exits[number].names:
            return f"Such as {n}."
    return f"It is not there again within {number_of(len(path), 'event')}: give another start."


def follow(phases: Phases, y0, events: int) -> tuple[Path, np.ndarray]:
    """The path of a guess over a number of events, and the durations between them.

    Raises:
      ValueError: fewer events follow, or after them the motion is not in its first phase.
    """
    whole("events", events, least=1)
    span = _SPANS * max((float(phase.scene.t1) for phase in phases.values()), default=1.0)
    motion = simulate_phases(phases, None, y0, span, samples=2, max_phases=events)
    path = motion.path
    if not (len(path) == events == len(motion.pieces)):
        why = motion.message.rstrip(".")
        got = f"one with {len(path)} exits and {len(motion.pieces)} pieces: {why}"
        remedy = "Give another start, scenes of a longer span t1, other `events`, or legs."
        wanted = f"a start from which {number_of(events, 'phase')} end within {brief(span)} of time"
        raise fail("y0", wanted, got, remedy)
    names = [name for name, _ in path]
    name, number = path[-1]
    if names[0] not in phases[name].exits[number].names:
        got = f"{events}, after which it is in {phases[name].exits[number].to}"
        remedy = _suggest_count(phases, y0, span, names[0])
        raise fail("events", f"a number after which the motion is in {names[0]} again", got, remedy)
    return path, np.diff([float(motion.pieces[0].ts[0]), *motion.times])
