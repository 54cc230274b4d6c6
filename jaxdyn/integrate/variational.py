"""The variational equations: tangents integrated together with a motion.

    d/dt V = (df/dy) V + (df/dp) P

with one column of V for each perturbed number. `flow` integrates them; the derivative of an end
with respect to its start is `analysis.monodromy.end_and_derivative`.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn.plan.in_branch import Branch, InBranch, in_branch, jump, without_wrappers
from jaxdyn.solvers.formulas.simplified import simplify
from jaxdyn.solvers.sizes import state_of

#: A state and its tangents as columns, for a state (k,).
Columns = Float[Array, "k columns *batch"]


class Variational(eqx.Module):
    """A vector field with tangents: column 0 is the state, the others are tangents.

    Attributes:
      field: anything with ``rate(t, y)``.
      directions: tangents of the field's numbers, a tree like `field` with a last axis of one
        entry per column, None where a number is not perturbed.
    """

    field: eqx.Module
    directions: eqx.Module

    def around(self, change: Callable, branch: Any) -> "Variational":
        """The same tangents of the field in a branch of its conditions; see `plan.in_branch`."""
        none = jax.tree.map(lambda _: None, branch)
        return Variational(change(self.field, branch), change(self.directions, none))

    def rate(self, t: Array, y: Columns) -> Columns:
        """Rates of the state and of its tangents."""
        return self._carry(lambda field: field.rate, t, y)

    @property
    def single(self):
        """The field of the state without its tangents."""
        return self.field

    def undetermined(self, t: Array, y: Columns) -> Array | None:
        """Whether () the constraints leave the acceleration undetermined at the state."""
        return self.field.undetermined(t, y[..., 0])

    def loses(self, t0: Array, y0: Columns, t1: Array, y1: Columns) -> Array | None:
        """Whether () a step may pass a state that leaves the acceleration undetermined."""
        return self.field.loses(t0, y0[..., 0], t1, y1[..., 0])

    def project(self, t: Array, y: Columns) -> Columns:
        """The state on its constraints, and its tangents along them."""
        return self._carry(lambda field: field.project, t, y)

    def jump(self, t: Array, y: Columns, old: Branch, new: Branch, which: Array) -> Columns:
        """State and tangents after a switch of the rate, by the saltation matrix.

        A tangent V moves the time of the switch by dt = -(dg V + dg/dp P) / (dg f + dg/dt), with g
        the margin of the condition that changes, and so becomes V + (f - f') dt, with f and f'
        the rates before and after. What the field is made of may change the state itself.
        """
        moving, fixed = _split_like(self.field, self.directions)
        x = y[..., 0]
        # Rates are continuous where sliding ends; those of tangents are not: their tangents jump.
        bends = x.ndim > 1
        jumps = bends | (which < len(old.outcomes))

        def margin(p, t, x):
            system = without_wrappers(eqx.combine(p, fixed))
            state = state_of(x)
            return InBranch(system, old).change(t, state, which, slid=bends)

        def change(p, t, x):
            return jump(eqx.combine(p, fixed), t, x, old, new, which)

        before = in_branch(self.field, old).rate(t, x)
        at = change(moving, t, x)
        after = in_branch(self.field, new).rate(t, at)
        still = jax.tree.map(jnp.zeros_like, moving)
        here = moving, t, x
        _, speed = jax.jvp(margin, here, (still, jnp.ones_like(t), before))

        def along(direction, tangent):
            _, off = jax.jvp(margin, here, (direction, jnp.zeros_like(t), tangent))
            dt = jnp.where(jumps, -off / speed, 0.0)
            _, moved = jax.jvp(change, here, (direction, dt, tangent + before * dt))
            return moved - after * dt

        tangents = jax.vmap(along, in_axes=-1, out_axes=-1)(self.directions, y[..., 1:])
        return jnp.concatenate([at[..., None], tangents], axis=-1)

    def _carry(self, function: Callable, t: Array, y: Columns) -> Columns:
        """A function (t, state) of the field, and its derivatives along the tangents."""
        moving, fixed = _split_like(self.field, self.directions)

        def of(p, x):
            return simplify(function(eqx.combine(p, fixed)))(t, x)

        def along(direction, tangent):
            return jax.jvp(of, (moving, y[..., 0]), (direction, tangent))

        # Batch axis last: columns are contiguous in memory.
        x, tangents = jax.vmap(along, in_axes=-1, out_axes=(None, -1))(self.directions, y[..., 1:])
        return jnp.concatenate([x[..., None], tangents], axis=-1)


def tangent_columns(field, y0: Array, f0: Array, d_field, d_y0, d_t0):
    """One column for each perturbed number: its start, its direction, and how to combine them.

    Returns:
      (*y0.shape, c) tangents of the state at t0; the directions of the field's numbers as a
      tree like `field` with a last axis c; and the linear map from the columns at a later
      time to the tangent there.
    """
    leaves, tree = jax.tree.flatten(d_field)
    sizes = [leaf.size for leaf in leaves]
    state = 0 if d_y0 is None else y0.size
    start = 0 if d_t0 is None else 1
    c = state + start + sum(sizes)

    weights = [] if d_y0 is None else [d_y0.ravel()]
    weights += [] if d_t0 is None else [d_t0.ravel()]
    weights += [leaf.ravel() for leaf in leaves]

    parts = [jnp.eye(y0.size, state).reshape(*y0.shape, state)]
    # Starting later by dt is the same motion shifted: dy = -f dt at the old start.
    parts += [-f0[..., None]] * start
    parts += [jnp.zeros((*y0.shape, sum(sizes)))]

    ends = state + start + np.cumsum([0, *sizes])
    directions = [
        jnp.eye(leaf.size, c, k=int(at)).reshape(*leaf.shape, c)
        for leaf, at in zip(leaves, ends, strict=False)
    ]

    def multiply(v: Array) -> Array:
        return v @ jnp.concatenate(weights)

    return jnp.concatenate(parts, axis=-1), jax.tree.unflatten(tree, directions), multiply


def _split_like(tree, like):
    """tree split in two: the leaves where `like` has one, and the rest."""
    present = jax.tree.map(lambda x: x is not None, like, is_leaf=lambda x: x is None)
    return eqx.partition(tree, present)
