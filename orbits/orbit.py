"""A periodic orbit: the residual of its equations, and the outcome of the search for it."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, _text
from jaxdyn._text import number_of
from jaxdyn.solvers import RADAU9, Method
from jaxdyn.status import Code
from orbits.closing.closings import Closing
from orbits.closing.sizes import sizes
from orbits.motion import logarithmic_period

#: Largest closing error, in sizes, at which the start still counts as determining its orbit.
CLOSED = 1e-2


class Outcome(Code):
    """Outcome of a search for an orbit."""

    FOUND = 0, "The orbit closes."
    ITERATION_LIMIT = (
        1,
        "The iteration reached its limit. Raise max_iterations, or start closer.",
    )
    NO_DESCENT = (
        2,
        "No step reduces the closing error any further, and it is above the goal: Newton's method "
        "has ended beside an orbit, if there is one. Start closer, pass strategy=orbits.Descent() "
        "or more segments, or hold what distinguishes the orbit from its family.",
    )
    COLLISION = (
        3,
        "The motion from the guess, or its derivative, runs into a singularity before it can "
        "close. Start elsewhere, or set bounds that keep away from it.",
    )
    ESCAPE = (
        4,
        "The iteration diverged to a hundred times the size of the guess, where everything "
        "closes for lack of motion. Set bounds near the guess.",
    )
    TRIVIAL = (
        5,
        "The iteration converged to a trivial solution: a period of zero or a state of rest, "
        "which always closes. Start elsewhere, guess the period better, or give `orbits.find` a "
        "lower bound on the period.",
    )
    BOUND = (
        6,
        "The best point lies on the bounds and does not close. Widen them, or start elsewhere.",
    )
    STEP_LIMIT = (
        7,
        "The motion from the guess takes more steps than the integrator may. In close encounters "
        "rounding leaves fewer digits than requested: pass rtol=1e-13. Else inspect it with "
        "simulate(): is the period as long as it should be, and the scene not stiff?",
    )
    BOUND_PASSED = (
        8,
        "The chain closes, but a leg is on the far side of one of its bounds on the way: it enters "
        "the ground, or is pulled by what only pushes. Start elsewhere; without bounds on its legs "
        "the chain is found as it is.",
    )

    DESCENT_ENDED = (
        9,
        "The descent from the rough guess ended far from an orbit, at a local minimum of the "
        "closing error or in a collision, and Newton's method did not converge from there. Start "
        "elsewhere, or set bounds on the start and the period.",
    )
    MESH_LIMIT = (
        10,
        "Collocation with its largest number of intervals leaves errors of its steps above the "
        "goal. Raise goal, start closer, or find the orbit by shooting "
        "(strategy=orbits.Shooting()).",
    )
    NO_OTHER = (
        11,
        "No orbit unlike the known ones was found from this guess. Start elsewhere, or raise "
        "max_iterations; in a conservative scene hold the energy.",
    )
    UNCONFIRMED = (
        12,
        "The motion closes by the integrator that found it, but not by another one: its rate is "
        "not smooth, or changes faster than the steps see. Pass a smaller rtol, and check the "
        "rate: orbits of motions with corners are found by legs (orbits.hybrid).",
    )
    OPEN_CHAIN = (
        15,
        "No step reduces the closing error of the chain of legs any further, and it is above the "
        "goal. Start closer: follow the legs one after the other for states and spans, and look "
        "whether each reaches its own end first.",
    )
    TIME_LIMIT = (
        14,
        "The search has taken as long as it may. Its best iterate is in `orbit` with throw=False: "
        "start from there, or raise seconds=.",
    )
    UNDETERMINED = (
        16,
        "Its segments join, but rounding grows so much over the period that no motion from its "
        "start, in doubles, closes. Start where the orbit is less unstable, look for a shorter "
        "one, or impose a symmetry: closing=orbits.reversal(...).",
    )

    @property
    def cause(self) -> str:
        """The first sentence of the message; the others say what to do."""
        return f"{self.message.partition('. ')[0].rstrip('.')}."


class SearchError(RuntimeError):
    """Raised if no orbit was found, with ``throw=True``."""


class Orbit(eqx.Module):
    """A start and a period, the residual of their equations, and the outcome of the search.

    Attributes:
      scene: the scene; its own start and span are those of the orbit.
      closing: the closing condition.
      residual: () largest residual of the equations that were solved, in units of the sizes of the
        entries along the motion (`orbits.closing.sizes`): by how much each segment misses the start
        of the next one, the last one the closing condition, and the orbit other conditions. One run
        over the whole period closes less well if errors grow over it; see `orbits.recheck`.
      outcome: how the search ended; unless it is FOUND, this is the best iterate, not an orbit.
      iterations: number of Newton steps.
      rtol: tolerance of the integrations.
      angle: rotation of a relative orbit after one part of its period [rad], else 0.
      s_period: the period in logarithmic time (see `jaxdyn.analysis.regularized`) if close
        encounters are integrated in it, else None.
      mesh: lengths of the intervals of collocation, as shares of the time that closes the orbit;
        None if it was found by shooting.
      stiff: whether its motion is integrated by a stiff method.
      shift: largest change of an entry of the start from the guess that `find` was given.
      hint: after a failed search, a suggestion that suits the guess, such as a symmetric closing.

    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> orbit = orbits.find(scenes.oscillator(), period=6.0)
      >>> print(str(orbit).partition(", residual")[0])  # the residual is rounding
      Orbit of oscillator
        period   6.2831853071796 s
        closing  plain closing
    """

    scene: Scene
    closing: Closing
    residual: float
    outcome: Outcome = eqx.field(static=True)
    iterations: int
    rtol: float
    angle: float = 0.0
    s_period: float | None = None
    mesh: tuple[float, ...] | None = None
    stiff: bool = eqx.field(static=True, default=False)
    shift: float = 0.0
    hint: str = eqx.field(static=True, default="")

    @_text.never_raising
    def __repr__(self) -> str:
        labels = self.scene.labels()
        closes = f"{self.closing.name}, residual {_text.brief(self.residual)}"
        steps = f"after {number_of(self.iterations, 'step')} at rtol {_text.brief(self.rtol)}"
        rows = [
            ("period", _text.brief(self.scene.t1, _text.second(labels), digits=14)),
            ("closing", f"{closes} {steps}"),
            ("turned", _text.brief(self.angle, "rad") if self.closing.turns else ""),
            ("outcome", f"{self.outcome.name}: {self.message}"),
            ("start", _text.entries(labels, self.y0)),
        ]
        return _text.table(f"Orbit of {_text.title_of(self.scene)}", rows)

    def live(self, path=None):
        """A page that runs the orbit beside a motion whose start is a thousandth away.

        See `jaxdyn.player.live`. The second motion stays near a stable orbit and leaves an unstable
        one.

        Args:
          path: an .html file to write the page to; the page needs no other file.
        Raises:
          ValueError: this is not an orbit, its scene cannot run on a page, or `path` cannot be
            written.
        """
        from orbits.drawing import pages

        return pages.orbit_page(self, path)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import periodic

        return periodic.overview(self)

    @property
    def y0(self) -> Array:
        """(k,) start."""
        return self.scene.y0

    @property
    def period(self) -> float:
        """The full period [time of the scene]."""
        return float(self.scene.t1)

    @property
    def solver(self) -> Method | None:
        """The method that integrates the motion; None for the default."""
        return RADAU9 if self.stiff else None

    @property
    def ok(self) -> bool:
        """Whether this is an orbit."""
        return self.outcome == Outcome.FOUND

    @property
    def message(self) -> str:
        """How the search ended and what to try."""
        return " ".join(filter(None, [self.outcome.message, self._where, self.hint]))

    @property
    def cause(self) -> str:
        """How the search ended."""
        return f"{self.outcome.cause} {self._where}".strip()

    @property
    def _where(self) -> str:
        return self.scene.singular if self.outcome == Outcome.COLLISION else ""


def relocate(orbit: Orbit, scene: Scene) -> Orbit:
    """The same orbit in another scene: rotated, scaled, shifted in time, or over fewer periods."""
    s_period = None if orbit.s_period is None else logarithmic_period(scene)
    mesh = orbit.mesh if float(scene.t1) == orbit.period else None  # it spans one period
    return dataclasses.replace(orbit, scene=scene, s_period=s_period, mesh=mesh)


def gap(orbit: Orbit, end: Array, periods: int = 1, entry_sizes: np.ndarray | None = None) -> float:
    """Largest entry, in sizes, of the difference between a state and the start some periods later.

    Args:
      orbit: the orbit.
      end: (k,) the state.
      periods: number of periods.
      entry_sizes: (k,) the sizes; by default those along the orbit.
    """
    system, y0 = orbit.scene.system, jnp.asarray(orbit.y0)
    target = orbit.closing.after(system, y0, orbit.angle, periods)
    off = np.asarray(system.difference(*map(np.asarray, (end, target))))
    return float(np.abs(off / (sizes(orbit.scene) if entry_sizes is None else entry_sizes)).max())
