"""What a periodic orbit is: the unknowns, what must close, and the record of what was found.

An orbit is a start ``y0`` (k,) and a period T such that the motion comes back,

    y(T / n) = g y(0),

plainly (n = 1, g the identity) or up to a symmetry g of the scene after the n-th part of the
period. A choreography of N equal bodies is the case n = N, g = "each body takes the next one's
place": it is a stronger demand than plain closing, and costs an n-th of the integration.
"""

import enum

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene
from jaxdyn._checks import fail


class Closing(eqx.Module):
    """y(T / parts) = places of y(0): which part of the period leads where.

    Attributes:
      places: (k,) index array; entry i of g y is entry places[i] of y. None is the identity.
      parts: how many of these parts make a period.
      name: what reports call it.
    """

    places: tuple[int, ...] | None = eqx.field(static=True, default=None)
    parts: int = eqx.field(static=True, default=1)
    name: str = eqx.field(static=True, default="plain closing")

    def act(self, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The symmetry g applied to a state."""
        return y if self.places is None else y[np.array(self.places)]

    def check(self, k: int) -> None:
        """Raise ValueError if this cannot be a closing condition of a state of k entries."""
        if self.parts < 1:
            raise fail("closing", "at least one part of a period", self.parts)
        if self.places is not None and sorted(self.places) != list(range(k)):
            raise fail(
                "closing",
                f"a rearrangement of the {k} entries of the state",
                f"one of {len(self.places)} places",
                "choreography(n, d) makes one for n free points in d dimensions.",
            )


PLAIN = Closing()


def choreography(n: int = 3, d: int = 2) -> tuple[Closing, Closing]:
    """All n bodies on one curve: after T / n each is where the next one was.

    There are two directions round the ring; `find` takes the one its guess is nearer to.

    Args:
      n: number of free points.
      d: dimensions of space.
    """
    return _ring(n, d, 1), _ring(n, d, -1)


def _ring(n: int, d: int, step: int) -> Closing:
    bodies = (np.arange(n) + step) % n
    one = (bodies[:, None] * d + np.arange(d)).ravel()
    places = np.concatenate([one, n * d + one])
    return Closing(tuple(places.tolist()), n, f"choreography of {n}")


class Outcome(enum.IntEnum):
    """How a search for an orbit ended."""

    FOUND = 0
    ITERATION_LIMIT = 1
    NO_DESCENT = 2
    COLLISION = 3
    ESCAPE = 4
    TRIVIAL = 5
    BOUND = 6

    @property
    def message(self) -> str:
        """What happened and what to try."""
        return _MESSAGES[self]


_MESSAGES = {
    Outcome.FOUND: "The orbit closes.",
    Outcome.ITERATION_LIMIT: (
        "The iteration was still under way at its limit. Raise max_iterations, or start nearer."
    ),
    Outcome.NO_DESCENT: (
        "No step makes the closing error smaller: there is no orbit near this guess, or it is "
        "too unstable for single shooting. Start nearer, or use more segments."
    ),
    Outcome.COLLISION: (
        "The motion from the guess runs into a singularity before it can close. Start elsewhere, "
        "or set bounds that keep the bodies apart."
    ),
    Outcome.ESCAPE: (
        "The iteration ran away to a hundred times the size of the guess, where everything "
        "closes because nothing moves. Set bounds near the guess."
    ),
    Outcome.TRIVIAL: (
        "The iteration fell towards a trivial solution: a period of zero or a state of rest, "
        "which closes always. Set a lower bound on the period."
    ),
    Outcome.BOUND: (
        "The best point lies on the bounds and does not close. Widen them, or start elsewhere."
    ),
}


class SearchError(RuntimeError):
    """Raised where the caller asked for an orbit or an exception (``throw=True``)."""


class Orbit(eqx.Module):
    """A start and a period, how well they close, and how the search for them ended.

    Attributes:
      scene: what moves; its own start and span are those of the orbit.
      closing: what was demanded.
      residual: () largest entry of the demand, ``y(T / parts) - g y(0)``.
      outcome: `Outcome`; unless it is FOUND this is the best iterate, not an orbit.
      iterations: Newton steps taken.
      rtol: tolerance of the integrations.
    """

    scene: Scene
    closing: Closing
    residual: float
    outcome: Outcome = eqx.field(static=True)
    iterations: int
    rtol: float

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
        return self.outcome.message


def part(orbit: Orbit) -> float:
    """The time after which the orbit's closing condition holds."""
    return orbit.period / orbit.closing.parts
