"""A field in one branch of its conditions, or sliding along the surfaces between some of them.

A motion that is pushed back to a surface from both sides slides along it (Filippov, 1988,
Differential Equations with Discontinuous Righthand Sides): its rate is the weighted mean of the
rates on both sides that is tangent to the surface. The side to which the motion was going is called
behind the surface, the side from which it came before it. On several surfaces at once each has a
weight of its own, and the rate is f + sum of w_j (f_j - f), with f the rate behind all of them and
f_j that before surface j alone. This is exact where the jumps at the surfaces add up, as those of
dry friction in several places do; where they do not, Filippov's rate is not unique, and the motion
ends.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._numerics import solve_spd
from jaxdyn._records import Record
from jaxdyn.plan.evaluation import Conditions
from jaxdyn.plan.plan import Wrapper, plan_of
from jaxdyn.scene import FieldAround


class Branch(NamedTuple):
    """The outcomes of the conditions of a rate along a piece of a motion.

    Attributes:
      outcomes: (e,) outcomes of all conditions, those behind a surface on which the motion slides.
      before: (e,) likewise, but those before such a surface.
      surfaces: (w, e) for each condition in `Plan.jumping`, which conditions change on its surface
        if the motion slides there. Of conditions with a common surface only the first has its row
        set.
    """

    outcomes: Array
    before: Array
    surfaces: Array

    @classmethod
    def of(cls, outcomes: Array, rows: int) -> "Branch":
        """The branch of a motion that does not slide; `rows` is `Plan.most_surfaces`."""
        return cls(outcomes, outcomes, jnp.zeros((rows, len(outcomes)), bool))

    @property
    def slides(self) -> Array:
        """Whether () the motion slides."""
        return self.surfaces.any()

    @property
    def surface(self) -> Array:
        """(e,) whether each condition changes on any surface on which the motion slides."""
        return self.surfaces.any(0)


class Balance(NamedTuple):
    """The rates on all sides of the surfaces on which a state lies, and how fast they lead away.

    Attributes:
      rates: (w + 1, k) the rate behind all surfaces, then that before each surface alone.
      slopes: (w,) derivative in time, along the first rate, of each surface's margin behind it.
      gains: (w, w) by how much slope i is larger along the rate before surface j.
    """

    rates: Array
    slopes: Array
    gains: Array

    @property
    def weights(self) -> Array:
        """(w,) weights of the rates before the surfaces whose mean is tangent to all of these."""
        if len(self.slopes) == 1:
            return -self.slopes / self.gains[0]
        return solve_spd(self.gains, -self.slopes)

    def mean(self, weights: Array) -> Array:
        """(k,) the rate for given weights (w,)."""
        jumps = self.rates[1:] - self.rates[:1]
        return self.rates[0] + jnp.sum(weights[:, None] * jumps, 0)

    def slopes_for(self, weights: Array) -> Array:
        """(w,) the slopes along the mean rate, for each surface with its own weight set to 0."""
        own = jnp.diag(self.gains)
        return self.slopes + jnp.sum(self.gains * weights[None], 1) - own * weights

    def settle(self, direction: Array) -> Array:
        """(w,) the weights between 0 and 1 with which the motion goes on.

        At each surface, given the weights of the others, the motion stays behind (0) if the rate
        there leads away from the surface; else it returns (1) if the rate before leads away; else
        it slides. Projected relaxation finds weights that satisfy this at all surfaces (Cottle,
        Pang, Stone, 1992, The Linear Complementarity Problem).

        Args:
          direction: () 1 forward in time, -1 backward.
        """
        slopes, gains, w = direction * self.slopes, direction * self.gains, len(self.slopes)

        def relax(i, weights):
            this, own = jnp.arange(w) == i % w, gains[i % w, i % w]
            behind = slopes[i % w] + jnp.sum(jnp.where(this, 0.0, gains[i % w] * weights))
            share = jnp.where(behind + own <= 0, 1.0, -behind / own)
            return jnp.where(this, jnp.where(behind >= 0, 0.0, share), weights)

        return jax.lax.fori_loop(0, 1 if w == 1 else _RELAXATIONS * w, relax, jnp.zeros(w))


#: Number of rounds of relaxation: for surfaces with a coupling of 0.9 they leave an error of 1e-5.
_RELAXATIONS = 100
#: Number of roundings of the rates on both sides up to which their mean counts as zero.
_ROUNDINGS = 8


def in_branch(field: Any, branch: Any) -> Any:
    """A field in a branch of its conditions, inside the same wrappers."""
    if isinstance(field, Wrapper):
        return field.around(in_branch, branch)
    return InBranch(field, branch)


def jump(field: Any, t: Array, y: Array, old: Branch, new: Branch, which: Array) -> Array:
    """A state with its tangents after a switch, changed as the field's outermost wrapper demands.

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


class InBranch(Record, FieldAround):
    """A field whose conditions have given outcomes.

    Attributes:
      field: has ``rate``, ``project``, ``undetermined`` and ``loses``; a pytree of its numbers.
      branch: see `Branch`.
    """

    field: Any
    branch: Branch

    def rate(self, t: Array, y: Array) -> Array:
        """The rate (k,) in the branch."""
        plan = plan_of(self.field, len(y))
        if not plan.on_state:
            return self._plain(t, y)
        # There is a choice even where nothing can slide, since `simplify` does not rewrite one: it
        # would expand k (d - clip(d)) and leave its rounding as a force within the play of gears.
        slide = self._sliding if plan.most_surfaces else self._plain
        return jax.lax.cond(self.branch.slides, slide, self._plain, t, y)

    def _plain(self, t: Array, y: Array) -> Array:
        return self.side(t, y, self.branch.outcomes)[0]

    def _sliding(self, t: Array, y: Array) -> Array:
        balance = self.balance(t, y)
        mean = balance.mean(balance.weights)
        # What rounding leaves of balanced forces would set the scale of a motion from rest.
        rounding = _ROUNDINGS * jnp.finfo(y.dtype).eps * jnp.max(jnp.abs(balance.rates), 0)
        return mean - jax.lax.stop_gradient(jnp.where(jnp.abs(mean) <= rounding, mean, 0.0))

    def balance(self, t: Array, y: Array) -> Balance:
        """The rates on all sides of the surfaces of the branch, and how fast they lead away.

        Rows without a surface have a weight of 0: their slope is 0 and their gains are a unit row.
        """
        outcomes, before, surfaces = self.branch
        plan = plan_of(self.field, len(y))
        used, first = surfaces.any(1), jnp.argmax(surfaces, 1)

        def margins(t, y):
            return plan.state_margins(self.field, t, y, outcomes)

        def slope(rate):
            return jax.jvp(margins, (t, y), (jnp.ones_like(t), rate))[1][first]

        sides = jnp.where(surfaces, before[None], outcomes[None])
        sides = jnp.concatenate([outcomes[None], sides])
        # For two rates a loop takes longer to compile than a copy of the program.
        vectorize = _map_unrolled if len(sides) == 2 else jax.vmap
        rates = vectorize(lambda side: self.side(t, y, side)[0])(sides)
        slopes = jax.vmap(slope)(rates)
        gains = jnp.where(
            used[:, None] & used[None], (slopes[1:] - slopes[:1]).T, jnp.eye(len(used))
        )
        return Balance(rates, jnp.where(used, slopes[0], 0.0), gains)

    def side(self, t: Array, y: Array, outcomes: Array) -> tuple[Array, Conditions]:
        """The rate and the conditions for given outcomes.

        A trial step may pass a little beyond a surface. If the branch is not defined there, as
        max(0, -x)^1.5 is not for x > 0, the rate is that of the outcomes which hold at the point.
        """
        plan = plan_of(self.field, len(y))
        rate, conditions = plan.evaluate(self.field, t, y, outcomes)
        if plan.partial:
            # A choice between two rates would have a NaN derivative if either one's is NaN.
            outcomes = jnp.where(jnp.isnan(rate).any(), conditions.outcomes, outcomes)
            rate = plan.evaluate(self.field, t, y, outcomes)[0]
        return rate, conditions

    def margins(self, t: Array, y: Array) -> Array:
        """(e + 2 w,) numbers: the branch ends where one of them falls through 0.

        They are the margins of the conditions on the state and, for a sliding motion, the weights
        of the rates behind each surface, then of those before, each multiplied by the rate at which
        both sides together push the motion to that surface.
        """
        plan, branch = plan_of(self.field, len(y)), self.branch
        margins = plan.state_margins(self.field, t, y, branch.outcomes)
        margins = jnp.where(branch.surface, 1.0, margins)
        return jnp.concatenate([margins, self._weights(t, y)]) if plan.most_surfaces else margins

    def _weights(self, t: Array, y: Array) -> Array:
        rows = len(self.branch.surfaces)
        none = lambda t, y: jnp.ones(2 * rows)  # noqa: E731
        return jax.lax.cond(self.branch.slides, self._pushes, none, t, y)

    def _pushes(self, t: Array, y: Array) -> Array:
        # They are not divided by the push, since weights would be 0/0 where neither side pushes. A
        # single surface needs no weights of others, so none are computed.
        balance = self.balance(t, y)
        own, weights = jnp.diag(balance.gains), balance.weights
        weights = jnp.zeros(1) if len(own) == 1 else weights
        before = -balance.slopes_for(weights)
        pushes = jnp.concatenate([own - before, before]) * jnp.tile(jnp.sign(own), 2)
        return jnp.where(jnp.tile(self.branch.surfaces.any(1), 2), pushes, 1.0)

    def change(self, t: Array, y: Array, which: Array, slid: bool) -> Array:
        """() the function whose zero ended the branch, which is smooth on both sides.

        Args:
          t: () time.
          y: (k,) state.
          which: () number of the function, as in `margins`.
          slid: whether it may be one that ends sliding.
        """
        margins = self.side(t, y, self.branch.outcomes)[1].margins
        if slid and len(self.branch.surfaces):
            margins = jnp.concatenate([margins, self._weights(t, y)])
        return margins[which]


def _map_unrolled(function: Callable) -> Callable:
    """Like `jax.vmap`, with a copy of the program for each row."""
    return lambda rows: jax.tree.map(lambda *found: jnp.stack(found), *map(function, rows))
