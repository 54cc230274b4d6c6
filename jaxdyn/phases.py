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
from jaxdyn.simulate import RTOL, Trajectory, simulate
from jaxdyn.status import Status

MAX_PHASES = 200
#: The name of the phase that ends a motion.
END = "end"


def unchanged(t: Array, y: Array) -> Array:
    """The state goes on as it is."""
    del t
    return y


class Exit(eqx.Module):
    """How a phase ends.

    Attributes:
      event: when.
      to: name of the next phase, or `END`.
      change: (t, y) -> the state in the next phase; a named function or a module.
    """

    event: Event
    to: str = eqx.field(static=True)
    change: Callable[[Array, Array], Array] = unchanged


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
      ended: whether an exit led to `END`; else the span or the number of phases ran out.
      status: `Status` of the last piece.
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
      ValueError: a name that is no phase.
    """
    _checks.choice("start", start, phases)
    for name, phase in phases.items():
        for way in phase.exits:
            _checks.choice(f"exit of {name}", way.to, (*phases, END))
    names: list[str] = []
    pieces: list[Trajectory] = []
    t, y = jnp.asarray(float(t0)), jnp.asarray(y0, dtype=float)
    name, status = start, Status.OK
    while name != END and len(pieces) < max_phases and t < t1 and status == Status.OK:
        phase = phases[name]
        scene = phase.scene.starting(y, t1)
        stop = until(scene, tuple(way.event for way in phase.exits), t1, t0=t, rtol=rtol)
        status = Status(int(stop.status))
        piece = simulate(scene, stop.t, t0=t, samples=samples, rtol=rtol, throw=False)
        names.append(name)
        pieces.append(piece)
        t, y = stop.t, stop.y
        if not stop.happened:
            break
        way = phase.exits[int(stop.event)]
        name, y = way.to, way.change(stop.t, stop.y)
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
      () time and (k,) state after the last exit; NaN where another exit came first, or none.
    """
    t, y = jnp.asarray(t0, dtype=float), jnp.asarray(y0, dtype=float)
    for name, number in path:
        phase = phases[name]
        events = tuple(way.event for way in phase.exits)
        stop = until(phase.scene.starting(y, t1), events, t1, t0=t, rtol=rtol)
        as_expected = stop.event == number
        t = jnp.where(as_expected, stop.t, jnp.nan)
        y = jnp.where(as_expected, phase.exits[number].change(stop.t, stop.y), jnp.nan)
    return t, y
