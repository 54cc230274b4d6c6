"""What was found: an orbit, how well it closes, and how the search for it ended."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, _text
from jaxdyn._text import counted
from jaxdyn.status import Code
from orbits.closing.closings import Closing
from orbits.motion import logarithmic_period


class Outcome(Code):
    """How a search for an orbit ended."""

    FOUND = 0, "The orbit closes."
    ITERATION_LIMIT = (
        1,
        "The iteration was still under way at its limit. Raise max_iterations, or start nearer.",
    )
    NO_DESCENT = (
        2,
        "No step makes the closing error smaller: there is no orbit near this guess, or it is "
        "too unstable for single shooting. Start nearer, or use more segments.",
    )
    COLLISION = (
        3,
        "The motion from the guess, or its derivative, runs into a singularity before it can "
        "close. Start elsewhere, or set bounds that keep away from it.",
    )
    ESCAPE = (
        4,
        "The iteration ran away to a hundred times the size of the guess, where everything "
        "closes because nothing moves. Set bounds near the guess.",
    )
    TRIVIAL = (
        5,
        "The iteration fell towards a trivial solution: a period of zero or a state of rest, "
        "which closes always. Set a lower bound on the period.",
    )
    BOUND = (
        6,
        "The best point lies on the bounds and does not close. Widen them, or start elsewhere.",
    )
    STEP_LIMIT = (
        7,
        "The motion from the guess takes more steps than the integrator may. In close encounters "
        "rounding leaves fewer digits than asked for: pass rtol=1e-13. Else look at it with "
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


class SearchError(RuntimeError):
    """Raised where the caller asked for an orbit or an exception (``throw=True``)."""


class Orbit(eqx.Module):
    """A start and a period, how well they close, and how the search for them ended.

    Attributes:
      scene: what moves; its own start and span are those of the orbit.
      closing: what was demanded.
      residual: () largest entry of what does not close, conditions included.
      outcome: `Outcome`; unless it is FOUND this is the best iterate, not an orbit.
      iterations: Newton steps taken.
      rtol: tolerance of the integrations.
      angle: by which a relative orbit has turned after one part of its period [rad], else 0.
      s_period: the period in logarithmic time (see `jaxdyn.analysis.regularised`) where close
        encounters are followed in it, else None.
      shift: largest change of an entry of the start from the guess that `find` was given.

    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> orbit = orbits.find(scenes.oscillator(), period=6.0)
      >>> print(str(orbit).partition(", to ")[0])  # how well it closes is rounding
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
    shift: float = 0.0

    @_text.never_raising
    def __repr__(self) -> str:
        labels = self.scene.labels()
        closes = f"{self.closing.name}, to {_text.brief(self.residual)}"
        steps = f"after {counted(self.iterations, 'step')} at rtol {_text.brief(self.rtol)}"
        rows = [
            ("period", _text.brief(self.scene.t1, _text.second(labels), digits=14)),
            ("closing", f"{closes} {steps}"),
            ("turned", _text.brief(self.angle, "rad") if self.closing.turns else ""),
            ("outcome", f"{self.outcome.name}: {self.message}"),
            ("start", _text.entries(labels, self.y0)),
        ]
        return _text.table(f"Orbit of {_text.called(self.scene)}", rows)

    @property
    def y0(self) -> Array:
        """(k,) start."""
        return self.scene.y0

    @property
    def period(self) -> float:
        """The full period [time of the scene]."""
        return float(self.scene.t1)

    @property
    def ok(self) -> bool:
        """Whether it is an orbit."""
        return self.outcome == Outcome.FOUND

    @property
    def message(self) -> str:
        """How the search ended and what to try."""
        if self.outcome != Outcome.COLLISION:
            return self.outcome.message
        return f"{self.outcome.message} {self.scene.singular}".strip()


def relocated(orbit: Orbit, scene: Scene) -> Orbit:
    """The same orbit elsewhere: turned, scaled, begun at another time, counted over fewer turns."""
    s_period = None if orbit.s_period is None else logarithmic_period(scene)
    return eqx.tree_at(
        lambda o: (o.scene, o.s_period), orbit, (scene, s_period), is_leaf=lambda x: x is None
    )


def gap(orbit: Orbit, end: Array, periods: int = 1) -> float:
    """Largest entry of a state that should be the start after some whole periods, minus that."""
    system, y0 = orbit.scene.system, jnp.asarray(orbit.y0)
    target = orbit.closing.after(system, y0, orbit.angle, periods)
    return float(np.abs(system.difference(end, target)).max())
