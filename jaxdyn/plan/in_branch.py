"""A field in one branch of its conditions, or sliding along the surface between two.

`in_branch` puts the branch below whatever wraps a field, such as its variational equations. A
motion that is pushed back to a surface from both sides slides along it (Filippov, 1988,
Differential Equations with Discontinuous Righthand Sides): its rate is the weighted mean of the
rates on both sides that is tangent to the surface.
"""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.plan.plan import Conditions, plan_of
from jaxdyn.scales import Groups


class Branch(NamedTuple):
    """The outcomes of the conditions of a rate along a piece of a motion.

    Attributes:
      outcomes: (e,) outcomes of all conditions; when sliding, those on the side to which it was
        going.
      before: (e,) outcomes on the side from which a sliding motion came.
      surface: (e,) whether each condition changes on the surface of sliding.
      slides: () whether the motion slides.
    """

    outcomes: Array
    before: Array
    surface: Array
    slides: Array

    @classmethod
    def of(cls, outcomes: Array) -> "Branch":
        """Outcomes of a motion that does not slide."""
        return cls(outcomes, outcomes, jnp.zeros(outcomes.shape, bool), jnp.zeros((), bool))


@runtime_checkable
class Wrapper(Protocol):
    """A field around another, such as its variational equations, or the field with noise.

    Attributes:
      field: the inner field.
    """

    field: Any

    def around(self, change, branch: Any) -> Any:
        """The same wrapper around ``change(field, branch)``."""


def in_branch(field: Any, branch: Any) -> Any:
    """A field, or what is around one, in a branch."""
    if isinstance(field, Wrapper):
        return field.around(in_branch, branch)
    return InBranch(field, branch)


def without_wrappers(field: Any) -> Any:
    """The field of a system, below its variational equations and noise."""
    while isinstance(field, Wrapper | InBranch):
        field = field.field
    return field


def jump(field: Any, t: Array, y: Array, old: Branch, new: Branch, which: Array) -> Array:
    """A state with tangents after a switch, by whatever is around a field.

    Args:
      field: see `flow`.
      t: () time of the switch.
      y: (k, ...) state before.
      old: branch before.
      new: branch after.
      which: () number of the condition that changes.
    """
    change = getattr(field, "jump", None)
    return y if change is None else change(t, y, old, new, which)


class InBranch(NamedTuple):
    """A field whose conditions have given outcomes.

    Attributes:
      field: has ``rate``, ``project``, ``undetermined`` and ``loses``; a pytree of its numbers.
      branch: see `Branch`.
    """

    field: Any
    branch: Branch

    @property
    def system(self) -> Any:
        """The system of the field."""
        return self.field.system

    @property
    def groups(self) -> Groups:
        """Which entries of the state share a size."""
        return self.field.groups

    def rate(self, t: Array, y: Array) -> Array:
        """The rate (k,) in the branch."""
        plan = plan_of(self.field, len(y))
        if not plan.on_state:
            return self._plain(t, y)
        return jax.lax.cond(self.branch.slides, self._sliding, self._plain, t, y)

    def _plain(self, t: Array, y: Array) -> Array:
        return self.side(t, y, self.branch.outcomes)[0]

    def _sliding(self, t: Array, y: Array) -> Array:
        both, towards = self._sides(t, y)
        part = towards[0] / (towards[0] - towards[1])
        return both[0] + part * (both[1] - both[0])

    def _sides(self, t: Array, y: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """The rates before and behind the surface, and how fast each leads to the side before."""
        branch = self.branch
        before, behind = (self.side(t, y, x)[0] for x in (branch.before, branch.outcomes))

        def margin(t, y):
            margins = self.side(t, y, branch.before)[1].margins
            return margins[jnp.argmax(branch.surface)]

        slopes = (jax.jvp(margin, (t, y), (jnp.ones_like(t), rate))[1] for rate in (before, behind))
        return (before, behind), tuple(slopes)

    def side(self, t: Array, y: Array, outcomes: Array) -> tuple[Array, Conditions]:
        """The rate, and the conditions, for other outcomes.

        Beyond a surface where a branch is not defined, as max(0, -x)^1.5 for x > 0, the rate is the
        one that the program gives there: a trial step may pass a little beyond the surface.
        """
        plan = plan_of(self.field, len(y))
        rate, conditions = plan.look(self.field, t, y, outcomes)
        if plan.partial:
            # A choice between two rates would have a NaN derivative if either one's is NaN.
            here = plan.look(self.field, t, y)[1].outcomes
            outcomes = jnp.where(jnp.isnan(rate).any(), here, outcomes)
            rate = plan.look(self.field, t, y, outcomes)[0]
        return rate, conditions

    def margins(self, t: Array, y: Array) -> Array:
        """(e + 2,) numbers whose fall through 0 ends the branch.

        They are the margins of the conditions on the state and, for a sliding motion, how strongly
        the side before the surface and the side behind it push towards it.
        """
        plan, branch = plan_of(self.field, len(y)), self.branch
        margins = self.side(t, y, branch.outcomes)[1].margins
        margins = jnp.where(plan.of_time | branch.surface, 1.0, margins)
        held = jax.lax.cond(branch.slides, self._pushes, lambda t, y: jnp.ones(2), t, y)
        return jnp.concatenate([margins, held])

    def _pushes(self, t: Array, y: Array) -> Array:
        return jnp.stack([-1.0, 1.0]) * jnp.stack(self._sides(t, y)[1])

    def change(self, t: Array, y: Array, which: Array, slid: bool) -> Array:
        """() the function whose zero ended the branch, smooth on both sides.

        Args:
          t: () time.
          y: (k,) state.
          which: () its number, as in `margins`.
          slid: whether it may be an end of sliding.
        """
        margins = self.side(t, y, self.branch.outcomes)[1].margins
        if slid:
            none = lambda t, y: jnp.ones(2)  # noqa: E731
            pushes = jax.lax.cond(self.branch.slides, self._pushes, none, t, y)
            margins = jnp.concatenate([margins, pushes])
        return margins[which]

    def project(self, t: Array, y: Array) -> Array:
        """The nearest state that satisfies the system's constraints."""
        return self.field.project(t, y)

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () the constraints leave the acceleration undetermined at a state (k,)."""
        return self.field.undetermined(t, y)

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """Whether () a step may pass a state that leaves the acceleration undetermined."""
        return self.field.loses(t0, y0, t1, y1)
