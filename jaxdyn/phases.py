"""Motions with corners: phases (roll, skid, fly, rest) chained by events into one motion.

Smooth code never sees a contact or a stop. Each phase is a scene with its own equations, and
exits: an event, the phase it leads to, and what happens to the state on the way (an impact, a
change of coordinates). The chain is run on the host, one compiled search for each phase.
"""

from collections.abc import Callable, Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.events import Event, until
from jaxdyn.scene import Scene
from jaxdyn.simulate import RTOL, Trajectory, explained, simulate, single
from jaxdyn.status import Status

MAX_PHASES = 200
#: The name of the phase that ends a motion.
END = "end"


def unchanged(t: Array, y: Array) -> Array:
    """The state goes on as it is."""
    del t
    return y


def first(t: Array, y: Array) -> Array:
    """The first of the phases that an exit leads to."""
    del t, y
    return jnp.zeros((), int)


class Exit(eqx.Module):
    """How a phase ends.

    Attributes:
      event: when.
      to: name of the next phase, or `END`; or the names `choose` chooses from.
      change: (t, y) -> the state in the next phase; a named function or a module.
      choose: (t, y) -> number of the next phase among `to`, from the state after the change:
        what stands still may stick or slip, say.
    """

    event: Event
    to: str | tuple[str, ...] = eqx.field(static=True)
    change: Callable[[Array, Array], Array] = unchanged
    choose: Callable[[Array, Array], Array] = first

    @property
    def names(self) -> tuple[str, ...]:
        """The phases it may lead to."""
        return (self.to,) if isinstance(self.to, str) else self.to


class Phase(eqx.Module):
    """A stretch of smooth motion: its equations (the scene's start is not used) and its exits."""

    scene: Scene
    exits: tuple[Exit, ...]


class Chain(eqx.Module):
    """A motion in pieces.

    Attributes:
      names: name of the phase of each piece.
      pieces: sampled motion of each piece; the last sample is at its event.
      t: () time at the end.
      y: (k,) state there, in the coordinates of the last phase after its exit's change.
      ended: whether an exit led to `END`; if not, `message` says what else stopped it.
      status: `Status` of the last piece; t and y are NaN unless it is OK.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    pieces: tuple[Trajectory, ...]
    t: Array
    y: Array
    ended: bool
    status: Status = eqx.field(static=True)

    @property
    def times(self) -> tuple[float, ...]:
        """When each piece ended."""
        return tuple(float(piece.ts[-1]) for piece in self.pieces)

    @property
    def message(self) -> str:
        """Why the motion stops here, and what to do about it."""
        if self.status != Status.OK:
            return f"In phase {self.names[-1]}: {explained(self.status, self.pieces[-1].scene)}"
        if self.ended:
            return f"Phase {self.names[-1]} led to the end."
        if self.t >= self.pieces[-1].scene.t1:
            return "The span ended."
        return (
            f"The limit of {len(self.pieces)} phases was reached at t = {float(self.t):.6g}. "
            "Raise max_phases; where infinitely many phases pass in finite time, as for a ball "
            "that comes to rest by bouncing, give the phase an exit to rest."
        )


def run(
    phases: Mapping[str, Phase],
    start: str,
    y0,
    t1: float,
    *,
    t0: float = 0.0,
    samples: int = 100,
    rtol: float = RTOL,
    max_phases: int = MAX_PHASES,
) -> Chain:
    """The motion from phase to phase until it ends, or the span or the phases run out.

    Args:
      phases: by name.
      start: name of the first.
      y0: (k,) state at its start.
      t1: end of the span [s], after t0.
      t0: start time [s].
      samples: of each piece.
      rtol: see `simulate`.
      max_phases: pieces at most: infinitely many bounces end in finite time.
    Raises:
      ValueError: a name that is no phase, a span that does not go forward, no phase allowed.
    """
    _check_names(phases)
    _checks.choice("start", start, phases)
    if not _checks.array("t1", t1, ()) > _checks.array("t0", t0, ()):
        raise _checks.fail("t1", f"a time after t0 = {t0}", t1, "Impacts do not run backwards.")
    if max_phases < 1:
        raise _checks.fail("max_phases", "at least 1", max_phases)
    names: list[str] = []
    pieces: list[Trajectory] = []
    t, y = jnp.asarray(float(t0)), jnp.asarray(y0, dtype=float)
    name, status = start, Status.OK
    while name != END and len(pieces) < max_phases and t < t1 and status == Status.OK:
        phase = phases[name]
        scene = phase.scene.starting(y, t1)
        stop = until(scene, tuple(way.event for way in phase.exits), t1, t0=t, rtol=rtol)
        status = Status(int(stop.status))
        until_when = stop.t if status == Status.OK else t1
        piece = simulate(scene, until_when, t0=t, samples=samples, rtol=rtol, throw=False)
        names.append(name)
        pieces.append(piece)
        t, y = stop.t, stop.y
        if not stop.happened:
            break
        way = phase.exits[int(stop.event)]
        y = way.change(stop.t, stop.y)
        name = way.names[int(way.choose(t, y))]
    return Chain(tuple(names), tuple(pieces), t, y, name == END, status)


def follow(
    phases: Mapping[str, Phase], path: Sequence[tuple[str, int]], y0, t1, *, t0=0.0, rtol=RTOL
) -> tuple[Array, Array]:
    """Time and state after a known sequence of phases; differentiable, also under jit and vmap.

    Args:
      phases: by name.
      path: (name of the phase, number of the exit taken) in order, as `run` found it.
      y0: (k,) start.
      t1: end of the span [s].
      t0: start time [s].
      rtol: see `simulate`.
    Returns:
      () time and (k,) state after the last exit; NaN where another exit came first, or none,
      or one that led elsewhere.
    Raises:
      ValueError: a name that is no phase, a number that is none of its exits.
    """
    _check_names(phases)
    for name, number in path:
        exits = len(phases[_checks.choice("path", name, phases)].exits)
        if not 0 <= number < exits:
            raise _checks.fail("path", f"an exit of {name} from 0 to {exits - 1}", number)
    t, y = jnp.asarray(t0, dtype=float), jnp.asarray(y0, dtype=float)
    for i, (name, number) in enumerate(path):
        phase = phases[name]
        way = phase.exits[number]
        events = tuple(way.event for way in phase.exits)
        stop = until(phase.scene.starting(y, t1), events, t1, t0=t, rtol=rtol)
        after = way.change(stop.t, stop.y)
        as_expected = stop.event == number
        if i + 1 < len(path):
            following = way.names.index(_checks.choice("path", path[i + 1][0], way.names))
            as_expected = as_expected & (way.choose(stop.t, after) == following)
        t = jnp.where(as_expected, stop.t, jnp.nan)
        y = jnp.where(as_expected, after, jnp.nan)
        if not _checks.is_traced(as_expected) and not as_expected:
            break  # a start of NaN would be refused
    return t, y


def pieces_of(motion: Trajectory | Chain) -> tuple[Trajectory, ...]:
    """The smooth pieces of a motion: those of its phases, or the motion itself."""
    return motion.pieces if isinstance(motion, Chain) else (single(motion),)


def _check_names(phases: Mapping[str, Phase]) -> None:
    if not phases:
        raise _checks.fail("phases", "at least one", "none", "Give them by name.")
    if END in phases:
        raise _checks.fail("phases", f"names other than {END!r}", END, "It ends a motion; rename.")
    for name, phase in phases.items():
        if not isinstance(phase, Phase):
            raise _checks.fail(
                f"phase {name}", "a Phase", type(phase).__name__, "Make it: Phase(scene, exits)."
            )
        if not isinstance(phase.exits, tuple):
            got = type(phase.exits).__name__
            raise _checks.fail(
                f"exits of {name}", "a tuple", got, "Write (exit,) for a single one."
            )
        for way in phase.exits:
            for to in way.names:
                _checks.choice(f"exit of {name}", to, (*phases, END))
