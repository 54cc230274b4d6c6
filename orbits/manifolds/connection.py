"""The record of a connection: its motion, its parameter, and the outcome of the search for it."""

import dataclasses
import math
from typing import Any

import numpy as np

from jaxdyn import Scene, _text
from jaxdyn._doors import renamed
from jaxdyn.status import Code
from orbits.orbit import Orbit

_SAME = 1e-6  # ends closer than this share of the largest entries of the motion are the same


class ConnectionOutcome(Code):
    """Outcome of a search for a connection."""

    FOUND = 0, "The chain of states connects them."
    NO_CONVERGENCE = (
        1,
        "Newton's method did not converge: there is no connection near this one. Take a parameter "
        "closer to it, the other branch, or a shorter time if the strand passes several times; "
        "between orbits more strands.",
    )
    MOTION_ENDS = (
        2,
        "The strand from the first equilibrium cannot be followed: it runs into a singularity. "
        "Take a shorter time, or the other branch.",
    )
    DEPENDENT = (
        3,
        "The equations do not determine the parameter: a connection exists at each value of it, "
        "as where an integral of motion has the same value at both equilibria. Leave out `make`.",
    )
    ERROR_LIMIT = (
        4,
        "The error of the linear ends did not fall to the wanted one. Ask for a larger error, or "
        "use more segments.",
    )
    NO_APPROACH = (
        5,
        "The strand from the first equilibrium does not come closer to the second. Take another "
        "parameter, the other branch, or a longer time.",
    )
    NO_CROSSING = (
        6,
        "The strands of the two orbits do not cross on the section. Take other branches, later "
        "crossings, another section, more strands, or another energy.",
    )
    FEWER = (
        7,
        "There are fewer connections than `which` asks for among these crossings of strands. Take "
        "a smaller number, more strands, or later crossings.",
    )


@renamed(rests="limits", miss="residual")
@dataclasses.dataclass(frozen=True)
class Connection:
    """A motion from one equilibrium or orbit to another, or back to the same one.

    Attributes:
      scene: the scene, at the parameter found, starting at the first state.
      parameter: parameter at which the connection exists; NaN without one.
      parameter_error: the change of the parameter when the ends were last shortened, plus that
        which gaps as large as the goal would cause.
      limits: (2, k) the two equilibria, or the states of the orbits beside which it begins and
        ends.
      time: travel time between the ends [time of the scene].
      step_off: distances of the first and the last state from `limits`, in sizes of the entries.
      error: estimated distance of the ends from the manifolds, in the same units; at equilibria
        that of the ends at the next larger step-off, an upper bound where the estimate converges.
      residual: largest gap of the closing equations.
      ts: (s,) times of the states, from 0.
      states: (s, k) states; NaN unless found.
      outcome: how the search ended.
      iterations: number of Newton steps.
      rtol: tolerance of the integrations.
      orbits: the two orbits; None for equilibria.
      phases: times from their starts at which the orbits pass `limits`; NaN for equilibria.
    """

    scene: Scene
    parameter: float
    parameter_error: float
    limits: np.ndarray
    time: float
    step_off: tuple[float, float]
    error: float
    residual: float
    ts: np.ndarray
    states: np.ndarray
    outcome: ConnectionOutcome
    iterations: int
    rtol: float
    orbits: tuple[Orbit, Orbit] | None = None
    phases: tuple[float, float] = (math.nan, math.nan)

    @_text.never_raising
    def __repr__(self) -> str:
        found = f"{self.parameter:.13g} (+-{_text.brief(self.parameter_error, digits=1)})"
        first, last = (_text.brief(d, digits=3) for d in self.step_off)
        ends = f"{first} and {last}, error {_text.brief(self.error, digits=1)}"
        rows = [
            ("parameter", "" if math.isnan(self.parameter) else found),
            ("time", _text.brief(self.time, _text.second(self.scene.labels()), digits=10)),
            ("step-off", ends),
            (
                "residual",
                f"{_text.brief(self.residual, digits=2)} after {self.iterations} Newton steps",
            ),
            ("outcome", f"{self.outcome.name}: {self.message}"),
        ]
        pair = self.limits if self.orbits is None else [orbit.y0 for orbit in self.orbits]
        first, last = (np.asarray(y) for y in pair)
        apart, sizes = np.abs(last - first), np.nanmax(np.abs([first, last, *self.states]), axis=0)
        kind = "Homoclinic" if (apart <= _SAME * sizes).all() else "Heteroclinic"
        what = "" if self.orbits is None else "orbits of "
        return _text.table(f"{kind} connection of {what}{_text.title_of(self.scene)}", rows)

    _repr_html_ = _text.html

    @property
    def ok(self) -> bool:
        """Whether a connection was found."""
        return self.outcome == ConnectionOutcome.FOUND

    @property
    def message(self) -> str:
        """How the search ended and what to try."""
        return self.outcome.message


def no_connection(
    posed: Any,
    near: Any,
    outcome: ConnectionOutcome,
    residual: float,
    iterations: int,
    orbits: tuple[Orbit, Orbit] | None = None,
) -> Connection:
    """The record of a search that found no connection; the numbers sought are NaN.

    Args:
      posed: the chain.
      near: (2, k) the states that it was to connect.
      outcome: why there is no connection.
      residual: see `Connection`.
      iterations: see `Connection`.
      orbits: see `Connection`.
    """
    near = np.asarray(near)
    return Connection(
        scene=posed.base,
        parameter=math.nan,
        parameter_error=math.nan,
        limits=near,
        time=math.nan,
        step_off=(math.nan, math.nan),
        error=math.nan,
        residual=residual,
        ts=np.zeros(0),
        states=np.full((0, near.shape[1]), math.nan),
        outcome=outcome,
        iterations=iterations,
        rtol=float(posed.rtol),
        orbits=orbits,
    )
