"""The record of a torus: its circle, its rotation, and the outcome of the search for it."""

import dataclasses
import math

import numpy as np

from jaxdyn import Scene, _checks, _text
from jaxdyn.status import Code
from orbits.tori import circle
from orbits.tori.invariance import Unknowns


class TorusOutcome(Code):
    """Outcome of a search for a torus."""

    FOUND = 0, "The circle is invariant."
    NO_CONVERGENCE = (
        1,
        "Newton's method did not converge: there is no such torus near this one. Take a smaller "
        "amplitude or step, or another rotation: close to a resonance tori break up.",
    )
    NOT_SMOOTH = (
        2,
        "The circle needs more Fourier modes than max_modes: it is close to a resonance or to the "
        "last torus before chaos. Take a smaller amplitude, or raise max_modes or the goal.",
    )
    MOTION_ENDS = (
        3,
        "A motion on the circle cannot be integrated over the return time: it runs into a "
        "singularity, or takes too many steps. Take a smaller amplitude.",
    )
    COLLAPSED = (
        4,
        "The circle shrank to a periodic orbit, which is invariant with any rotation. Take a "
        "smaller step or amplitude, or a rotation that tori of this family have.",
    )


@dataclasses.dataclass(frozen=True)
class Torus:
    """An invariant torus, given by an invariant circle of the map over the time T.

    Attributes:
      scene: the scene.
      points: (N, k) the circle, at equally spaced angles.
      time: T, the time between returns to the circle: a period of the torus, which is that of the
        drive in a driven scene [time of the scene].
      rotation: angle rho by which the map turns the circle [rad]; its sign, which depends on the
        sense of theta, and multiples of 2 pi are arbitrary.
      amplitude: norm of the first harmonic of the circle [norm of a state]; a torus is asked for by
        the component of this harmonic along the orbit's Floquet vector.
      energy: mean energy of the circle; NaN for a scene without one.
      error: largest error of invariance, between the points, in the sizes of the entries.
      outcome: how the search ended; unless it is FOUND, this is the best iterate, not a torus.
      held: "energy", "time" or "drive", the quantity that is kept along the family of tori.
      rtol: tolerance of the integrations.
    """

    scene: Scene
    points: np.ndarray
    time: float
    rotation: float
    amplitude: float
    energy: float
    error: float
    outcome: TorusOutcome
    held: str
    rtol: float

    @_text.never_raising
    def __repr__(self) -> str:
        w = ", ".join(f"{x:.12g}" for x in self.frequencies)
        rows = [
            ("frequencies", f"{w} rad per unit of time"),
            ("rotation", f"{self.rotation:.12g} rad in {self.time:.12g}"),
            ("amplitude", _text.brief(self.amplitude)),
            ("energy", "" if math.isnan(self.energy) else f"{self.energy:.12g}, held: {self.held}"),
            ("circle", f"{len(self.points) // 2} modes, invariant to {_text.brief(self.error)}"),
            ("outcome", f"{self.outcome.name}: {self.message}"),
        ]
        return _text.table(f"Torus of {_text.title_of(self.scene)}", rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import tori

        return tori.torus(self, title="")

    @property
    def ok(self) -> bool:
        """Whether this is a torus."""
        return self.outcome == TorusOutcome.FOUND

    @property
    def message(self) -> str:
        """How the search ended and what to try."""
        return self.outcome.message

    @property
    def frequencies(self) -> tuple[float, float]:
        """The two angular frequencies 2 pi / T and rho / T [rad per unit of time]."""
        return 2 * math.pi / self.time, self.rotation / self.time

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns for which Newton's method solved."""
        return Unknowns(self.points, self.rotation, self.time)

    def at(self, theta) -> np.ndarray:
        """(s, k) states of the circle at angles theta (s,); in a driven scene, at time 0."""
        return circle.at(self.points, _checks.host_array("theta", theta, (None,)))
