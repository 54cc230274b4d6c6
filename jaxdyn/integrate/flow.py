"""The map from a start to the states at later times, and its derivatives.

`flow` is built on `march` and `pieces`, and is differentiable any number of times, in forward and
reverse mode, under jit and vmap, with respect to the start, the times and every number of the
scene. Its derivative is not taken through the stepping loop (that would differentiate the choice of
steps, compile slowly, and allow only one mode) but by the variational equations (`Variational`),
integrated together with the state, with the tangents in the error norm. The result is a matrix;
forward and reverse mode both multiply by it. So a gradient costs about as much as a Jacobian: right
for the tens of numbers of a mechanics scene, not for thousands (a neural force).
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import _checks
from jaxdyn._numerics import in_one_kernel
from jaxdyn.integrate.march import Limits, march
from jaxdyn.integrate.march import SolveResult as SolveResult
from jaxdyn.integrate.pieces import Branches, first_branch, has_pieces, run_pieces
from jaxdyn.plan.branch import Branch, InBranch, in_branch, jump
from jaxdyn.plan.plan import without_wrappers
from jaxdyn.solvers import RADAU9, Method
from jaxdyn.solvers.formulas.formulas import simplify
from jaxdyn.solvers.stepper import state_of
from jaxdyn.status import Status

# ---- The variational equations: tangents integrated together with a motion
#
#     d/dt V = (df/dy) V + (df/dp) P
#
# with one column of V for each perturbed number. `flow` integrates them; the derivative of an end
# with respect to its start is `analysis.monodromy.end_and_derivative`.

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

    @classmethod
    def of(cls, field: Any) -> "Variational":
        """A field whose numbers are not perturbed, with tangents."""
        return cls(field, jax.tree.map(lambda _: None, field))

    def around(self, change: Callable, branch: Any) -> "Variational":
        """The same tangents of the field in a branch of its conditions; see `plan.branch`."""
        none = jax.tree.map(lambda _: None, branch)
        return Variational(change(self.field, branch), change(self.directions, none))

    def rate(self, t: Array, y: Columns) -> Columns:
        """Rates of the state and of its tangents."""
        return self._carry(lambda field: field.rate, t, y)

    @property
    def single(self):
        """The field of the state without its tangents."""
        return self.field

    @property
    def perturbed(self) -> list[tuple[Array, Array]]:
        """The numbers of the field that are perturbed, and their tangents."""
        numbers, tree = jax.tree.flatten(self.directions, is_leaf=lambda x: x is None)
        pairs = zip(tree.flatten_up_to(self.field), numbers, strict=True)
        return [(x, direction) for x, direction in pairs if direction is not None]

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
        the rates before and after. A wrapper within the field may also change the state itself.
        """
        moving, fixed = _split_like(self.field, self.directions)
        x = y[..., 0]
        # Where sliding ends the rate is continuous, but that of tangents is not: tangents of
        # tangents jump there.
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
            _, changed = jax.jvp(change, here, (direction, dt, tangent + before * dt))
            return changed - after * dt

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


# ---- The map


def flow(
    field, y0, t0, t1, ts, limits: Limits, *, method: Method, passes: bool = True
) -> SolveResult:
    """States at t1 and at the times ts of the motion that starts at (t0, y0).

    Args:
      field: has ``rate``, ``project`` and ``undetermined`` of (t, y); a pytree of its numbers,
        e.g. `Scene.field`.
      y0: (k,) start; (k, columns) for a `Variational` field.
      t0: () start time.
      t1: () end time, before or after t0.
      ts: (s,) times between t0 and t1 in the order they are passed.
      limits: tolerances or step length, and the maximum numbers of steps.
      method: method of plain solves; variational equations are solved by its `for_tangents`.
      passes: whether tangents pass a switch at the end, see `pieces.Branches`.
    Limits: derivatives with respect to the tolerance are zero by definition.
    """
    return flow_and_branches(field, y0, t0, t1, ts, limits, passes, method=method)[0]


# The function inside the derivative rule is compiled, not the one with the rule, and the rule is
# compiled by itself: a derivative then traces no plain solve besides its own, and several solves of
# a kind in one program are traced once.
@eqx.filter_custom_jvp
@functools.partial(jax.jit, static_argnames=("method", "sampled"))
def flow_and_branches(
    field,
    y0,
    t0,
    t1,
    ts,
    limits: Limits,
    passes: bool | Array = True,
    *,
    method: Method,
    sampled: bool = False,
) -> tuple[SolveResult, Branches | None]:
    """The result of `flow`, and the branches of the motion; None where its rate has no conditions.

    Branches at the times ts are included only if they are asked for by `sampled`. For `passes` see
    `pieces.run_pieces`.
    """
    run = functools.partial(_march, method=method, sampled=sampled)
    # Some of these are known only at run time; the tolerance is often a constant.
    unknown = jnp.isfinite(y0.ravel()[0] + t0 + t1 + limits.tolerance[0])
    return in_one_kernel(run, (passes, field, y0, t0, t1, ts, limits), unknown=unknown)


def _march(
    passes, field, y0, *rest, method: Method, sampled: bool
) -> tuple[SolveResult, Branches | None]:
    *_, limits = rest
    # A caller who asks for steps of equal length does not want conditions to cut them.
    if method.adaptive and has_pieces(field, len(y0), limits):
        options = {"method": method, "passes": passes, "sampled": sampled}
        found = run_pieces(field, (), y0, *rest, **options)
        return found[0], found[3]
    return march(field, y0, *rest, method=method)[0], None


@flow_and_branches.def_jvp
@functools.partial(jax.jit, static_argnames=("method", "sampled"))
def _flow_jvp(primals, tangents, *, method, sampled=False):
    field, y0, t0, t1, ts, limits, *passes = primals
    d_field, d_y0, d_t0, d_t1, d_ts, *_ = tangents
    start, sampled = jnp.zeros_like(y0), sampled or d_ts is not None
    if d_t0 is not None:
        start = rate_in(first_branch(field, y0, t0, t1, limits, method=method), field, t0, y0)
    columns, directions, multiply = tangent_columns(field, y0, start, d_field, d_y0, d_t0)
    if columns.shape[-1]:
        whole, start = Variational(field, directions), jnp.concatenate([y0[..., None], columns], -1)
        method = method.for_tangents
    else:
        whole, start = field, y0
    out, branches = flow_and_branches(
        whole, start, t0, t1, ts, limits, *passes, method=method, sampled=sampled
    )
    y1, ys, d_y1, d_ys = out.y1, out.ys, jnp.zeros_like(y0), jnp.zeros_like(out.ys)
    if columns.shape[-1]:
        y1, ys = out.y1[..., 0], out.ys[..., 0]
        d_y1, d_ys = multiply(out.y1[..., 1:]), multiply(out.ys[..., 1:])
    if d_t1 is not None:
        d_y1 = d_y1 + rate_in(branches and branches.last, field, t1, y1) * d_t1
    if d_ts is not None:
        here = branches and branches.sampled
        rates = jax.vmap(lambda branch, t, y: rate_in(branch, field, t, y))(here, ts, ys)
        d_ys = d_ys + rates * d_ts.reshape(-1, *[1] * y0.ndim)
    result = dataclasses.replace(out, y1=y1, ys=ys)
    d_out = SolveResult(y1=d_y1, ys=d_ys, steps=None, rejected=None, status=None, stiff=None)
    return (result, branches), (d_out, jax.tree.map(lambda _: None, branches))


def rate_in(branch: Branch | None, field: Any, t: Array, y: Array) -> Array:
    """The rate of a field in a branch of its conditions, if there is one."""
    return (field if branch is None else in_branch(field, branch)).rate(t, y)


# ---- The switch from the default method to another, where it turns out not to suit the motion
#
# A stiff motion starts again with an implicit method. Where a series or an extrapolation cannot go
# on, as where exp(x) overflows in a rate that stays finite, the pair is tried before a failure is
# reported.

#: Net number of steps limited by stability after which a motion starts again: fewer steps take less
#: time than it takes to compile an implicit method, one or two seconds.
MOST_LIMITED = 1000


class HasStatus(Protocol):
    """What a run returns."""

    @property
    def status(self) -> Array:
        """() `Status` code."""
        ...


R = TypeVar("R", bound=HasStatus)


def run_or_switch(
    run: Callable[..., R], limits: Limits, method: Method, *, default: bool
) -> tuple[R, bool]:
    """The result of a run, and whether `RADAU9` took over because the motion is stiff.

    If the default is not a pair and its steps collapse, the pair for its tangents takes over first.

    The motion then starts again: continuing from where the explicit method stopped would save the
    steps so far, but need a second treatment of samples, events and failures.

    Args:
      run: takes `Limits`, and a `Method` as ``method``.
      limits: tolerances and the number of steps.
      method: the solver, or the default.
      default: whether another may take over: nobody asked for this one, and no value on which the
        run depends is traced.
    """
    if not default:
        return run(limits, method=method), False
    limited = limits.until_stiff(MOST_LIMITED)
    first = run(limited, method=method)
    if _checks.is_traced(first.status):
        # A trace is in progress that involves none of the values.
        return run(limits, method=method), False
    # NumPy reads it: int() of a JAX array takes three times as long as an empty program.
    status = np.asarray(first.status).item()
    pair = method.for_tangents
    if status == Status.STEP_COLLAPSED and method is not pair:
        first = run(limited, method=pair)
        status = np.asarray(first.status).item()
    if status != Status.STIFF:
        return first, False
    return run(limits, method=RADAU9), True
