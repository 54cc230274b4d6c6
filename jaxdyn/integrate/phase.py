"""A phase of a piecewise-smooth motion: its equations, exits, and whether a state fits it.

An exit whose event has a direction is also a bound: the phase lasts on the near side of the event
(above the floor, while the contact force pushes, within the friction limit). A state is beyond a
bound where the value is on the far side, and also where the value is zero and its slope along the
motion leads there: a ball at the floor with a downward velocity has to bounce, not to fly.

Zero means to rounding: the change of the value when every number that enters it (state, time,
parameters) changes by a few units in the last place.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn._records import Record
from jaxdyn._text import number_of
from jaxdyn.integrate.event_search.event_values import sizes, values
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.trajectory import Motion, Trajectory, explanation
from jaxdyn.scene import Field, Scene
from jaxdyn.status import Status

#: The name of the phase that ends a motion.
END = "end"

_ZERO_ROUNDINGS = 64  # units in the last place of all inputs within which a value counts as zero
#: Largest change by projection of a state that counts as on the constraint surface, as a part of
#: its largest entry.
_MAX_PROJECTION = 1e-10


def keep_state(t: Array, y: Array) -> Array:
    """The state is unchanged."""
    del t
    return y


def no_time(t: Array, y: Array) -> Array:
    """The change takes no time."""
    del y
    return jnp.zeros_like(t)


class Fit(NamedTuple):
    """How a state fits a phase with E exits.

    Attributes:
      on: () whether it is on the phase's constraint surface.
      passed: (E,) whether it is on the far side of a bound.
      leaving: (E,) whether it is at a bound, on its way to the far side.
    """

    on: Array
    passed: Array
    leaving: Array

    @property
    def beyond(self) -> Array:
        """(E,) whether a bound does not hold."""
        return self.passed | self.leaving


class Exit(Record):
    """How a phase ends.

    Attributes:
      event: the event that ends it.
      to: name of the next phase, or `END`; or several names.
      change: (t, y) -> the state in the next phase; a named function or a module.
      choose: (t, y) -> index of the next phase in `to`, from the state after the change. By
        default the first of them that the state fits; `END` fits every state.
      lasts: (t, y) -> () duration of the change [s], for a last part of the motion that is known in
        closed form; 0 by default.
      one_sided: whether an event with a direction is a bound of the phase. With False the phase
        may begin beyond it, and ends at the next crossing: the kick of a clock, say.
    """

    event: Event
    to: str | tuple[str, ...] = eqx.field(static=True)
    change: Callable[[Array, Array], Array] = keep_state
    choose: Callable[[Array, Array], Array] | None = None
    lasts: Callable[[Array, Array], Array] = no_time
    one_sided: bool = eqx.field(static=True, default=True)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the phases that may follow."""
        return (self.to,) if isinstance(self.to, str) else self.to

    @property
    def side(self) -> int:
        """The sign of the event's value within the phase; 0 if it is not a bound."""
        return -self.event.direction if self.one_sided else 0


class Phase(Record):
    """A stretch of smooth motion: its equations (the scene's start is not used) and its exits.

    Without exits, ``Phase(scene, ())``, it lasts to the end of the span: a phase of rest, say.
    """

    scene: Scene
    exits: tuple[Exit, ...]

    @property
    def events(self) -> tuple[Event, ...]:
        """The events of its exits."""
        return tuple(exit_.event for exit_ in self.exits)

    @property
    def sides(self) -> tuple[int, ...]:
        """The sides of its exits."""
        return tuple(exit_.side for exit_ in self.exits)

    def fit(self, t: Array, y: Array) -> Fit:
        """How a state (k,) fits this phase at a time."""
        return _fit(self.scene.field, self.events, self.sides, t, y)


@eqx.filter_jit
def _fit(field: Field, events: tuple[Event, ...], sides: tuple[int, ...], t: Array, y: Array):
    bounds = [event for event, side in zip(events, sides, strict=True) if side]
    passed = leaving = jnp.zeros(len(events), bool)
    if bounds:
        near = jnp.array([side for side in sides if side], float)
        which = np.flatnonzero(sides)
        beyond = _beyond(field, tuple(bounds), near, t, y)
        passed, leaving = (jnp.zeros(len(events), bool).at[which].set(x) for x in beyond)
    off = jnp.max(jnp.abs(field.project(t, y) - y))
    return Fit(off <= _MAX_PROJECTION * jnp.max(jnp.abs(y)), passed, leaving)


def _beyond(field: Field, bounds: tuple[Event, ...], near: Array, t: Array, y: Array):
    """(E,) whether a state has passed each bound, and (E,) whether it is leaving there."""
    rate = field.rate(t, y)

    def slopes(t, y):
        fn = functools.partial(values, bounds)
        return jax.jvp(fn, (t, y), (jnp.ones_like(t), field.rate(t, y)))[1]

    # The time of an event is known only to rounding, and so is the state.
    size = jnp.append(sizes(field.system, y) + jnp.abs(t * rate), jnp.abs(t))
    by_time, by_state = jax.jacfwd(slopes, argnums=(0, 1))(t, y)
    parts = [_sensitivities(bound, t, y) for bound in bounds]
    rows, others = (jnp.stack(part) for part in zip(*parts, strict=True))
    noise = rows @ size + others
    slope_noise = jnp.abs(jnp.append(by_state, by_time[:, None], axis=1)) @ size
    slope_noise = slope_noise + rows @ jnp.append(jnp.abs(rate), 1.0)  # rounding of its terms
    rounding = _ZERO_ROUNDINGS * jnp.finfo(y.dtype).eps
    value, slope = near * values(bounds, t, y), near * slopes(t, y)
    return value < -rounding * noise, (
        (jnp.abs(value) <= rounding * noise) & (slope < -rounding * slope_noise)
    )


def _sensitivities(bound: Event, t: Array, y: Array) -> tuple[Array, Array]:
    """(k + 1,) magnitudes of a value's derivatives by state and time, () by all parameters.

    The latter is with respect to relative changes of the parameters.
    """
    slopes = eqx.filter_grad(lambda b: b[0].value(*b[1:]))((bound, t, y))
    floats = eqx.filter(bound, eqx.is_inexact_array)
    changes = jax.tree.map(lambda slope, x: jnp.sum(jnp.abs(slope * x)), slopes[0], floats)
    return jnp.abs(jnp.append(slopes[2], slopes[1])), sum(jax.tree.leaves(changes), jnp.zeros(()))


class HybridTrajectory(eqx.Module, Motion):
    """A motion in pieces.

    Attributes:
      names: name of the phase of each piece.
      pieces: sampled motion of each piece; the last sample is at its event.
      t: () end time [s].
      y: (k,) state there, in the coordinates of the last phase after its exit's change.
      ended: whether an exit led to `END`; if not, `message` says what else stopped it.
      status: `Status`; t and y are NaN where a phase failed; where the chain was `STUCK`, or
        reached its `PHASE_LIMIT`, they are its last time and state.
      path: (name of the phase, index of the exit taken) in order, for `follow`; phases left at
        once, which have no piece, are included.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    pieces: tuple[Trajectory, ...]
    t: Array
    y: Array
    ended: bool
    status: Status = eqx.field(static=True)
    path: tuple[tuple[str, int], ...] = eqx.field(static=True, default=())

    @_text.never_raising
    def __repr__(self) -> str:
        scene = self.pieces[-1].scene
        labels = scene.labels()
        second = _text.second(labels)
        rows = [
            (name, f"{_text.brief(piece.ts[0])} to {_text.brief(end, second)}")
            for name, piece, end in zip(self.names, self.pieces, self.times, strict=True)
        ]
        return _text.table(
            f"HybridTrajectory of {number_of(len(self.pieces), 'phase')}",
            [
                *_text.shorten(rows),
                ("status", f"{self.status.name}: {self.message}"),
                ("end", _text.entries(labels, self.y)),
            ],
        )

    @property
    def ok(self) -> bool:
        """Whether the span or an exit to `END` was reached."""
        return self.status == Status.OK

    @property
    def times(self) -> tuple[float, ...]:
        """End time of each phase [s], including the duration of the change at its exit."""
        starts = [float(piece.ts[0]) for piece in self.pieces]
        failed = self.status not in (Status.OK, Status.PHASE_LIMIT)
        return (*starts[1:], float(self.pieces[-1].ts[-1] if failed else self.t))

    @property
    def message(self) -> str:
        """Why the motion stops here, and what to do about it."""
        if self.status == Status.PHASE_LIMIT:
            after = number_of(len(self.pieces), "phase")
            return f"At t = {float(self.t):.6g}, after {after}: {self.status.message}"
        if self.status == Status.STUCK:
            return f"At t = {float(self.t):.6g}, in phase {self.path[-1][0]}: {self.status.message}"
        if self.status != Status.OK:
            return f"In phase {self.names[-1]}: {explanation(self.status, self.pieces[-1].scene)}"
        if self.ended:
            return f"Phase {self.path[-1][0]} led to the end."
        return "The span ended."

    @property
    def warning(self) -> str:
        """The warnings about its pieces, each once; empty if there are none."""
        return " ".join(dict.fromkeys(piece.warning for piece in self.pieces if piece.warning))
