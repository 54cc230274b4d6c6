"""A piecewise-smooth periodic motion: a closed chain of smooth legs (roll, fly, ...).

`find_hybrid` (orbits.hybrid.search) finds such motions. In its equations the times of the corners
are unknowns, so a solution may pass the end of a leg before its time. The bounds of a leg state
what must hold on the way, and a chain that violates them is not reported as found.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, _text, simulate
from jaxdyn._records import Record
from jaxdyn._text import number_of
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.phase import keep_state
from jaxdyn.integrate.phases import HybridTrajectory
from orbits.orbit import Outcome

_SAMPLES = 400  # samples of a leg at which its bounds are checked
_PASSED = 1e-9  # a bound this far below 0, relative to its largest value on a leg, is violated


#: The name of the phase of each leg, and the index of the exit by which it ends.
Path = tuple[tuple[str, int], ...]


class Leg(Record):
    """A smooth part of a periodic chain.

    Attributes:
      scene: system and effects (its start and span are not used). Neither its rate nor the
        functions below may depend on time: a driven system has the phase of its drive as an entry
        of the state.
      ends: functions that vanish at the leg's end: its event, and further conditions.
      change: (t, y) -> the state at the start of the next leg; a named function or a module.
      bounds: functions that must not be negative on the way, such as a height or a normal force.
    """

    scene: Scene
    ends: tuple[Event, ...]
    change: Callable[[Array, Array], Array] = keep_state
    bounds: tuple[Event, ...] = ()


@dataclasses.dataclass(frozen=True)
class HybridOrbit:
    """A periodic chain, its closing error, and the outcome of the search for it.

    Attributes:
      legs: the legs in order; their scenes have the start and the span of each.
      closes: (end, start) -> closing error of the chain.
      residual: largest entry of the closing error, see the `goal` of `find_hybrid`.
      outcome: how the search ended; unless it is FOUND, this is the best iterate.
      iterations: Newton steps taken.
      rtol: tolerance of the integrations.
      path: the path through the phases to which the legs belong, as `HybridTrajectory.path`; () for
        legs without phases.
    """

    legs: tuple[Leg, ...]
    closes: Callable[[Array, Array], Array]
    residual: float
    outcome: Outcome
    iterations: int
    rtol: float
    path: Path = ()

    @_text.never_raising
    def __repr__(self) -> str:
        scene = self.legs[0].scene
        labels = scene.labels()
        steps = f"after {number_of(self.iterations, 'step')} at rtol {_text.brief(self.rtol)}"
        rows = [
            ("period", _text.brief(self.period, _text.second(labels), digits=14)),
            ("closing", f"to {_text.brief(self.residual)} {steps}"),
            ("outcome", f"{self.outcome.name}: {self.message}"),
            ("start", _text.entries(labels, self.y0)),
        ]
        return _text.table(f"Hybrid orbit of {number_of(len(self.legs), 'leg')}", rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import periodic

        return periodic.overview(self)

    def live(self, path=None):
        """A page that runs the orbit through its phases; see `jaxdyn.player.live`.

        Args:
          path: an .html file to write the page to; the page needs no other file.
        Raises:
          ValueError: this is not an orbit, it was not found from the phases of a ready-made scene
            (`scenes.phases_of`), or `path` cannot be written.
        """
        from orbits.drawing import pages

        return pages.orbit_page(self, path)

    def check_functions(self) -> None:
        """Raise ValueError if a number that a function of a leg captured has changed."""
        for leg in self.legs:
            leg.check_functions()

    @property
    def y0(self) -> Array:
        """(k,) start of the first leg."""
        return self.legs[0].scene.y0

    @property
    def names(self) -> tuple[str, ...]:
        """(n,) names of the legs, those of their phases or numbered ones."""
        found = tuple(name for name, _ in self.path)
        return found or tuple(f"leg {i + 1}" for i in range(len(self.legs)))

    @property
    def spans(self) -> np.ndarray:
        """(n,) duration of each leg [time of the scene]."""
        return np.array([float(leg.scene.t1) for leg in self.legs])

    @property
    def period(self) -> float:
        """Duration of all legs [time of the scene]."""
        return float(self.spans.sum())

    @property
    def ok(self) -> bool:
        """Whether the chain closes and satisfies its bounds."""
        return self.outcome == Outcome.FOUND

    @property
    def message(self) -> str:
        """How the search ended, where in the chain, and what to try."""
        return f"{self.outcome.message} {self._where()}".strip()

    def _where(self) -> str:
        """The part of the chain that an outcome concerns; empty if it concerns all of it."""
        if self.outcome == Outcome.BOUND_PASSED:
            least = [f"{bound} goes down to {value:.3g}" for bound, value in self._violations()]
            return f"On the way {', '.join(least)}."
        if self.outcome == Outcome.TRIVIAL:
            shortest = int(np.argmin(self.spans))
            return f"legs[{shortest}] has shrunk to a span of {self.spans[shortest]:.3g}."
        if self.outcome == Outcome.COLLISION:
            for i, leg in enumerate(self.legs):
                motion = simulate(leg.scene, samples=2, rtol=self.rtol, throw=False)
                if not motion.ok:
                    return f"legs[{i}]: {motion.message}"
        return ""

    def trajectory(self, samples: int = 100) -> HybridTrajectory:
        """One period as a motion in pieces."""
        pieces, t = [], 0.0
        for leg in self.legs:
            end = t + float(leg.scene.t1)
            pieces.append(simulate(leg.scene, end, t0=t, samples=samples, rtol=self.rtol))
            t = end
        last = self.legs[-1].change(jnp.asarray(t), pieces[-1].ys[-1])
        return HybridTrajectory(
            names=self.names,
            pieces=tuple(pieces),
            t=jnp.asarray(t),
            y=last,
            ended=True,
            status=Status.OK,
            path=self.path,
        )

    def smallest(self, leg: int, event: Event) -> float:
        """The smallest value of a function at 400 times of a leg.

        The function may be, say, a height in flight or a normal force in contact: if its value is
        negative by more than rounding, the chain closes but is physically impossible.
        """
        return float(self._values(leg, event).min())

    @property
    def keeps_bounds(self) -> bool:
        """Whether each leg satisfies its bounds, to rounding, at 400 times."""
        return not self._violations()

    def _violations(self) -> list[tuple[str, float]]:
        """The bounds that are violated by more than rounding, each with its smallest value."""
        found = []
        for i, leg in enumerate(self.legs):
            for j, bound in enumerate(leg.bounds):
                values = self._values(i, bound)
                if not values.min() >= -_PASSED * np.abs(values).max():
                    found.append((f"legs[{i}].bounds[{j}]", float(values.min())))
        return found

    def _values(self, leg: int, event: Event) -> np.ndarray:
        scene = self.legs[leg].scene
        motion = simulate(scene, samples=_SAMPLES, rtol=self.rtol)
        return np.asarray(_along(event, motion.ts, motion.ys))


@eqx.filter_jit
def _along(event: Event, ts: Array, ys: Array) -> Array:
    return jax.vmap(event.value)(ts, ys)
