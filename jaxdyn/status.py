"""How a calculation ended, where that depends on the data: a code, a text, a remedy.

Misuse raises ValueError before anything runs. Failures known only at run time (a collision, a step
limit) are one of these codes on the result, and numbers that could not be computed are NaN.
"""

import enum
from collections.abc import Callable
from typing import Any

import numpy as np

from jaxdyn._text import number_of


class Code(enum.IntEnum):
    """How something ended: a whole number and a text.

    Attributes:
      message: what happened and what to do about it.
    """

    message: str

    def __new__(cls, code: int, message: str):
        """The member with this code and message."""
        member = int.__new__(cls, code)
        member._value_, member.message = code, message
        return member

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        return format(int(self) if spec else str(self), spec)


class Ended:
    """A result that says how its search ended.

    Attributes:
      outcome: 0 if what was sought is found.
    """

    outcome: Code

    @property
    def ok(self) -> bool:
        """Whether what was sought is found."""
        return self.outcome == 0

    @property
    def message(self) -> str:
        """How the search ended, in words."""
        return self.outcome.message


class Status(Code):
    """Outcome of an integration; `Status.OK` is zero."""

    OK = 0, "The integration reached its end."
    STEP_LIMIT = (
        1,
        "The integration stopped at its limit of steps. Raise max_steps, loosen rtol or "
        "lengthen a fixed dt, shorten the span, or use solvers.RADAU9 if the scene is stiff.",
    )
    STEP_COLLAPSED = (
        2,
        "The step size fell below the spacing of floating-point times: the motion runs into a "
        "singularity, or rtol is below rounding. Stop earlier, or loosen rtol.",
    )
    NOT_FINITE = (
        3,
        "The start, its rate, a time or a tolerance is NaN or infinite. Check the start and "
        "the parameters.",
    )
    SINGULAR = (
        4,
        "The constraints stopped determining the motion: they lose rank in a pose (a linkage at "
        "a dead centre, where it may continue in more than one way), contradict each other, or do "
        "not hold at the start. Stop earlier, change a length, or take out a constraint; "
        "`constraints.conditioning` shows where.",
    )
    STEP_TOO_LONG = (
        5,
        "A step of fixed length ended in NaN or infinity, or its equations were not solved: it "
        "is too long for the motion. Raise the number of steps (a smaller dt), or leave out the "
        "solver to use adaptive steps.",
    )
    BOUND_PASSED = (
        6,
        "The motion is on the far side of a bound of its phase (below a floor, pulled by a surface "
        "that only pushes) and no exit was found on the way. Add an exit to a phase of rest if "
        "it comes to rest there; else lower rtol, so that no crossing is missed within a step.",
    )
    STUCK = (
        7,
        "Exits lead from phase to phase and no time passes. Where impacts get closer and closer, "
        "as for a ball that comes to rest by bouncing, add an exit to a phase of rest; set "
        "one_sided=False on an exit whose phase may begin beyond its event; else the contact laws "
        "have no solution here.",
    )
    FEW_CROSSINGS = (
        8,
        "The span ended before the requested number of crossings. Raise t1, ask for fewer, or "
        "choose an event that the motion crosses repeatedly.",
    )
    FORBIDDEN = (
        9,
        "No state with these section coordinates has this energy: they are outside the allowed "
        "region. Raise the energy, or move the start into the region.",
    )
    NOT_COMPLETED = (
        10,
        "The missing entry of a start was not found: the energy does not depend on it, or Newton's "
        "method did not converge. Choose a velocity as the unknown.",
    )
    UNSEEN_WITHIN_STEP = (
        11,
        "The motion within the step of the event does not follow from its ends: a force acts where "
        "a long step passed over it, as a wind in a thin layer of air, or the event itself changes "
        "millions of times. Stop before that point and restart from there, or pass max_step=.",
    )
    STIFF = (
        12,
        "Stability, not accuracy, limits the steps of the explicit method. Choose solvers.RADAU9.",
    )
    CHATTERING = (
        13,
        "The conditions of the rate change again and again in no time: the motion is pushed back "
        "and forth where several surfaces meet, and slides in a way that the rate leaves open. "
        "Choose a steep slope for one of the jumps, tanh(x / width) for sign(x), as creep= of "
        "effects.DryFriction does, or give the motion on the surfaces a phase of its own.",
    )
    PHASE_LIMIT = (
        14,
        "The limit of phases was reached. Raise max_phases; where infinitely many phases pass in "
        "finite time, as for a ball that comes to rest by bouncing, add an exit to a phase of "
        "rest.",
    )
    MERGED = (
        15,
        "Nearby motions merged in no time, as where dry friction stops them: a tangent became 0, "
        "and its exponent is minus infinity. Choose count=1, the largest exponent alone, or a "
        "smooth friction, as by creep= of effects.DryFriction.",
    )


def tally(
    codes: Any, noun: str, explain: Callable[[Status], str] = lambda status: status.message
) -> str:
    """How many things ended with each status, and what that means, a line each; host only.

    Args:
      codes: (n,) `Status` codes.
      noun: what they are, such as "motion".
      explain: what is said of a status.

    Example:
      >>> print(tally([0, 0], "motion"))
      2 motions: The integration reached its end.
    """
    found, counts = np.unique(np.asarray(codes), return_counts=True)
    pairs = zip(counts.tolist(), found.tolist(), strict=True)
    return "\n".join(f"{number_of(n, noun)}: {explain(Status(code))}" for n, code in pairs)


class IntegrationError(RuntimeError):
    """Raised for a status other than OK where the caller asked for it (``throw=True``)."""
