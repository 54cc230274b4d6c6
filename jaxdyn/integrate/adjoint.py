"""Gradients of one loss with respect to many numbers, whose cost does not depend on their number.

The derivatives of `flow` cost one column for each perturbed number. For one loss the adjoint

    d/dt lambda = -(df/dy)^T lambda,    d/dt mu = -(df/dp)^T lambda,

integrated backwards together with the state, gives the derivatives with respect to the start and
all numbers at once, at the cost of a few solves whatever their number. Backwards in time a damped
motion departs from the one that it retraces, which would make the gradient wrong; so the motion is
retraced in pieces so short that each arrives where the motion was (see `_Tracer`). Where forces do
not depend on velocity, neither do these equations, if they are written for [q, lambda_v, M] with
dM/dt = mu, so the Nystrom pair integrates them.

For thousands of numbers most of the time is spent on mu, which has an entry for each of them in
every stage of a step. Then it is faster to differentiate the steps of the motion, one after the
other from the last to the first, with their times as constants (`StepLoopInReverse`). The result is
the gradient of the motion as computed: no tolerance controls how well the steps resolve df/dp.

Only reverse mode and first derivatives are available.
"""

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import any_lane
from jaxdyn.integrate.flow import SolveResult, flow_and_branches, rate_in
from jaxdyn.integrate.march import Limits, look_from_start, march
from jaxdyn.integrate.pieces import first_branch, has_pieces
from jaxdyn.plan.branch import Branch, InBranch
from jaxdyn.scales import Groups, groups_of_names
from jaxdyn.solvers import Method
from jaxdyn.solvers.stepper import StepLoopInReverse, absolute_error

#: Largest difference of a state found backwards from the same one found forwards, in tolerances of
#: a step. Integration errors may grow by this factor within a piece.
_MISFIT = 10.0
#: Largest number of times that the way to the next sample is halved, and of steps of a piece: where
#: a motion explodes backwards in time, there is no use in following it.
_HALVINGS, _MOST_STEPS = 12, 1000


class _Backwards(eqx.Module):
    """State, adjoint and gradient with respect to the field's numbers, as one field.

    Attributes:
      field: the scene's field.
      position_only: whether the method requires velocity-independent forces.
      k: number of entries of the state.
    """

    field: Any
    position_only: bool = eqx.field(static=True)
    k: int = eqx.field(static=True)

    def rate(self, t: Array, z: Array) -> Array:
        """Rate of [y, lambda, mu], or of [q, lambda_v, M, v, -lambda_q, mu]."""
        numbers, rest = eqx.partition(self.field, eqx.is_inexact_array)
        k, half = self.k, len(z) // 2
        if not self.position_only:
            y, adjoint = z[:k], z[k : 2 * k]
            f, pull = jax.vjp(lambda p, y: eqx.combine(p, rest).rate(t, y), numbers, y)
            by_numbers, by_state = pull(adjoint)
            return jnp.concatenate([f, -by_state, -self._by_relative_change(by_numbers, z.dtype)])
        q, adjoint, v = z[: k // 2], z[k // 2 : k], z[half : half + k // 2]

        def acceleration(p, q):
            return eqx.combine(p, rest).rate(t, jnp.concatenate([q, v]))[k // 2 :]

        a, pull = jax.vjp(acceleration, numbers, q)
        by_numbers, by_place = pull(adjoint)
        by_numbers = self._by_relative_change(by_numbers, z.dtype)
        return jnp.concatenate([z[half:], a, by_place, -by_numbers])

    @property
    def magnitudes(self) -> Array:
        """(p,) the magnitudes of the numbers, 1 for those that are 0."""
        flat = jnp.abs(_as_vector(eqx.filter(self.field, eqx.is_inexact_array), float))
        return jnp.where(flat == 0, 1.0, flat)

    def _by_relative_change(self, by_numbers: Any, dtype) -> Array:
        """(p,) derivatives with respect to relative changes of the numbers."""
        return self.magnitudes * _as_vector(by_numbers, dtype)

    def state(self, z: Array) -> Array:
        """The state (k,) in a vector z, or its rate in the rate of z."""
        k, half = self.k, len(z) // 2
        if not self.position_only:
            return z[:k]
        return jnp.concatenate([z[: k // 2], z[half : half + k // 2]])

    @property
    def system(self) -> Any:
        """The system of the field."""
        return self.field.system

    def jump(self, t: Array, z: Array, old: Branch, new: Branch, which: Array) -> Array:
        """The vector before a switch of the rate, from the vector after it.

        The adjoint is multiplied by the transposed saltation matrix, see `Variational.jump`; the
        gradient receives what the numbers contribute to the time of the switch.
        """
        numbers, rest = eqx.partition(self.field, eqx.is_inexact_array)
        y, (adjoint, mu) = self.state(z), self.unpack(z)

        def margin(numbers, t, y):
            system = _Backwards(eqx.combine(numbers, rest), self.position_only, self.k)
            at = system.pack(y, adjoint, mu)
            return InBranch(system, old).side(t, at, old.outcomes)[1].margins[which]

        after, before = (self.state(InBranch(self, branch).rate(t, z)) for branch in (old, new))
        by_numbers, by_time, by_state = jax.grad(margin, (0, 1, 2))(numbers, t, y)
        weight = jnp.sum(adjoint * (after - before)) / (by_time + jnp.sum(by_state * before))
        mu = mu + weight * self._by_relative_change(by_numbers, z.dtype)
        return self.pack(y, adjoint + weight * by_state, mu)

    @property
    def groups(self) -> Groups:
        """Adjoints share sizes as the entries of the state do, since they have inverse units.

        All parts of the gradient share one size, since they are with respect to relative changes of
        the numbers: a part that is zero up to rounding, such as that of a mass that cancels, is
        measured by the others.
        """
        groups = self.field.groups.group_of
        y, adjoint = ([(part, group) for group in groups] for part in ("y", "adjoint"))
        leaves = jax.tree.leaves(eqx.filter(self.field, eqx.is_inexact_array))
        mu = ["mu"] * sum(leaf.size for leaf in leaves)
        if not self.position_only:
            return groups_of_names([*y, *adjoint, *mu])
        half, rates = len(groups) // 2, ["rate of mu"] * len(mu)
        q, v, by_q, by_v = y[:half], y[half:], adjoint[:half], adjoint[half:]
        return groups_of_names([*q, *by_v, *mu, *v, *by_q, *rates])

    def project(self, t: Array, z: Array) -> Array:
        """The vector with its state projected, for example on quaternions of norm 1.

        The adjoint loses what the projection takes from a change of the state. Scenes with
        constraints, whose projections depend on numbers of the field, are refused.
        """
        adjoint, mu = self.unpack(z)
        y, pull = jax.vjp(lambda y: self.field.project(t, y), self.state(z))
        (adjoint,) = pull(adjoint)
        return self.pack(y, adjoint, mu)

    def undetermined(self, t: Array, z: Array) -> None:
        """None, since there are no constraints."""
        del t, z

    def loses(self, t0: Array, z0: Array, t1: Array, z1: Array) -> None:
        """None, since there are no constraints."""
        del t0, z0, t1, z1

    def pack(self, y: Array, adjoint: Array, mu: Array) -> Array:
        """The state, the adjoint and the gradient as one vector."""
        if not self.position_only:
            return jnp.concatenate([y, adjoint, mu])
        (q, v), (by_q, by_v) = jnp.split(y, 2), jnp.split(adjoint, 2)
        return jnp.concatenate([q, by_v, jnp.zeros_like(mu), v, -by_q, mu])

    def unpack(self, z: Array) -> tuple[Array, Array]:
        """lambda and mu."""
        k, half = self.k, len(z) // 2
        if not self.position_only:
            return z[k : 2 * k], z[2 * k :]
        adjoint = jnp.concatenate([-z[half + k // 2 : half + k], z[k // 2 : k]])
        return adjoint, z[half + k :]


def _as_vector(numbers: Any, dtype) -> Array:
    """The numbers of a pytree as one vector; without any, `ravel_pytree` returns 32-bit floats."""
    return ravel_pytree(numbers)[0].astype(dtype)


# ---- The motion retraced, in pieces that arrive where it was
#
# A piece that begins at a known state and ends at another one shows its error there. If it is too
# large, or the motion cannot be retraced at all, since it came to slide on a surface, the earlier
# half is integrated forwards again to find a state in the middle, and so on. States found in this
# way wait on a stack. Storing the steps of the forward motion instead would need as much memory as
# the longest motion allowed, and under `vmap` copies of it in each step.


class _Retraced(NamedTuple):
    """How far a motion has been retraced.

    Attributes:
      t: () the time that has been reached.
      y: (k,) the state there, from the forward motion.
      adjoint: (k,) the adjoint there.
      mu: (p,) the gradient so far.
      ts: (d,) a stack of earlier times, the first of which is where the motion begins.
      ys: (d, k) the states there.
      top: () index of the latest of these; negative at the end.
      longest: () longest piece to try.
      lost: () whether the motion could not be retraced.
    """

    t: Array
    y: Array
    adjoint: Array
    mu: Array
    ts: Array
    ys: Array
    top: Array
    longest: Array
    lost: Array


class _Tracer(NamedTuple):
    """What all pieces share.

    Attributes:
      system: the adjoint equations.
      limits: see `flow`.
      method: the method of the forward motion.
      allowed: (k,) largest difference of states found forwards and backwards.
    """

    system: _Backwards
    limits: Limits
    method: Method
    allowed: Array

    def retrace(self, carry, node):
        """The adjoint, gradient and longest piece at an earlier node, from those at a later one."""
        adjoint, mu, longest = carry
        late, y, early, by_early, start, inside = node
        ts = jnp.zeros(_HALVINGS + 1).at[0].set(early)
        ys = jnp.zeros((_HALVINGS + 1, len(y))).at[0].set(start)
        none = jnp.asarray(0)
        lost = ~(jnp.isfinite(y).all() & jnp.isfinite(start).all())
        run = _Retraced(late, y, adjoint, mu, ts, ys, none, longest, lost)
        run = jax.lax.while_loop(
            lambda run: (run.top >= 0) & ~run.lost, lambda run: self._go_on(run, inside), run
        )
        adjoint = jnp.where(run.lost, jnp.nan, run.adjoint)
        mu = jnp.where(run.lost, jnp.nan, run.mu)
        return (adjoint + by_early, mu, run.longest), None

    def _go_on(self, run: _Retraced, inside: Array) -> _Retraced:
        """The same after a piece was tried, or the way to the next known state was halved."""
        waits = (run.top < 0) | run.lost  # for other lanes
        far = ~waits & (jnp.abs(run.t - run.ts[run.top]) > run.longest)
        tried = jax.lax.cond(
            any_lane(~waits & ~far),
            lambda: self._try_piece(run, ~waits & ~far, inside),
            lambda: run,
        )
        return jax.lax.cond(any_lane(far), lambda: self._halve(tried, far), lambda: tried)

    def _try_piece(self, run: _Retraced, chosen: Array, inside: Array) -> _Retraced:
        """The same one piece earlier, if the piece arrives where the motion was."""
        to, there = run.ts[run.top], run.ys[run.top]
        to = jnp.where(chosen, to, run.t)
        start = self.system.pack(run.y, run.adjoint, run.mu)
        # A switch at a node is passed by the piece that ends there, except at the start.
        passes = (run.top > 0) | inside
        limits = self.limits.with_steps(jnp.minimum(self.limits.max_steps[0], _MOST_STEPS))
        args = (self.system, start, run.t, to, jnp.zeros(0), limits, passes)
        end = flow_and_branches(*args, method=self.method.for_tangents)[0].y1
        adjoint, mu = self.system.unpack(end)
        same = jnp.all(jnp.abs(self.system.state(end) - there) <= self.allowed)
        arrived, length = chosen & same, jnp.abs(run.t - to)
        longest = jnp.where(same, jnp.maximum(run.longest, 2 * length), length / 2)
        return run._replace(
            t=jnp.where(arrived, to, run.t),
            y=jnp.where(arrived, there, run.y),
            adjoint=jnp.where(arrived, adjoint, run.adjoint),
            mu=jnp.where(arrived, mu, run.mu),
            top=jnp.where(arrived, run.top - 1, run.top),
            longest=jnp.where(chosen, longest, run.longest),
        )

    def _halve(self, run: _Retraced, chosen: Array) -> _Retraced:
        """The same with a known state in the middle of the way to the next one."""
        field, (t, y) = self.system.field, (run.ts[run.top], run.ys[run.top])
        middle = jnp.where(chosen, 0.5 * (t + run.t), t)
        args = field, y, t, middle, jnp.zeros(0), self.limits
        there = flow_and_branches(*args, method=self.method)[0].y1
        top = jnp.where(chosen, run.top + 1, run.top)
        return run._replace(
            ts=jnp.where(chosen, run.ts.at[top].set(middle), run.ts),
            ys=jnp.where(chosen, run.ys.at[top].set(there), run.ys),
            top=top,
            lost=run.lost | (chosen & (top >= _HALVINGS)),
        )


def _retrace(motion, start, nodes, limits: Limits, method: Method) -> tuple[Array, Array]:
    """The adjoint and the gradient at the start of a motion, from those at its end."""
    field, t0, t1 = motion
    _, late, _, _, early, _ = nodes
    system, tolerance = _Backwards(field, method.position_only, late.shape[1]), limits.tolerance
    # An entry may be zero at the start, and at all nodes.
    least = look_from_start(field, t0, early[0], t1, tolerance, method)[0].sizes
    most = jnp.max(jnp.abs(jnp.concatenate([early[:1], late])), axis=0)
    size = jnp.maximum(field.groups.sizes(most), least)
    allowed = _MISFIT * (tolerance[0] * size + absolute_error(tolerance, size))
    retrace = _Tracer(system, limits, method, allowed).retrace
    (adjoint, mu, _), _ = jax.lax.scan(retrace, (*start, jnp.asarray(jnp.inf)), nodes, reverse=True)
    return adjoint, mu / system.magnitudes


# ---- The gradient through the steps of a motion


def _pull_back(carry, node, *, field, limits: Limits, method: Method):
    """The adjoint and the gradient at an earlier node, from those at a later one."""
    adjoint, mu = carry
    late, _, early, by_early, start, _ = node
    numbers, rest = eqx.partition(field, eqx.is_inexact_array)

    def end(numbers, y):
        args = eqx.combine(numbers, rest), y, early, late, jnp.zeros(0), limits
        return march(*args, method=method, loop=StepLoopInReverse())[0].y1

    y, pull = jax.vjp(end, numbers, start)
    by_numbers, by_start = pull(adjoint)
    lost = ~jnp.isfinite(y).all()
    mu = jnp.where(lost, jnp.nan, mu + _as_vector(by_numbers, mu.dtype))
    return (jnp.where(lost, jnp.nan, by_start + by_early), mu), None


def adjoint_flow(
    field, y0, t0, t1, ts, limits: Limits, *, method: Method, through_steps: bool
) -> SolveResult:
    """The result of `flow`, with one of these ways to its gradient; arguments as for `flow`.

    With `through_steps` the steps are differentiated, where the rate has no conditions and the
    method no equations to solve.

    Raises:
      ValueError: the scene has constraints, or the solver has a fixed step.
    """
    remedy = "Leave adjoint= out."
    if field.undetermined(t0, y0) is not None:
        raise _checks.fail("adjoint", "a scene without constraints", "one with some", remedy)
    if not method.adaptive:
        solver = method.name
        raise _checks.fail("adjoint", "a solver with a tolerance", solver, remedy)
    through_steps &= method.for_tangents.evaluates and not has_pieces(field, len(y0), limits)
    return _with_adjoint((field, y0, t0, t1, ts), limits, method, through_steps)


@eqx.filter_custom_vjp
def _with_adjoint(given, limits, method: Method, through_steps: bool) -> SolveResult:
    del through_steps
    return flow_and_branches(*given, limits, method=method)[0]


@_with_adjoint.def_fwd
def _primal(perturbed, given, limits, method, through_steps):
    del perturbed, through_steps
    out, branches = flow_and_branches(*given, limits, False, method=method, sampled=True)
    return out, (out.y1, out.ys, branches)


@_with_adjoint.def_bwd
def _gradients(found, slopes, perturbed, given, limits, method, through_steps):
    """Gradients with respect to all inputs, from those with respect to the states."""
    del perturbed
    field, y0, t0, t1, ts = given
    y1, ys, branches = found
    by_y1 = jnp.zeros_like(y1) if slopes.y1 is None else slopes.y1
    by_ys = jnp.zeros_like(ys) if slopes.ys is None else slopes.ys
    flat, tree = ravel_pytree(eqx.filter(field, eqx.is_inexact_array))
    nodes = (
        jnp.concatenate([ts, t1[None]]),
        jnp.concatenate([ys, y1[None]]),
        jnp.concatenate([t0[None], ts]),
        jnp.concatenate([jnp.zeros_like(y0)[None], by_ys]),
        jnp.concatenate([y0[None], ys]),
        jnp.concatenate([t0[None], ts]) != t0,
    )
    start = by_y1, jnp.zeros(flat.shape, y0.dtype)  # a field without numbers has no float64
    if through_steps:
        options = {"field": field, "limits": limits, "method": method.for_tangents}
        pull_back = functools.partial(_pull_back, **options)
        (by_y0, mu), _ = jax.lax.scan(pull_back, start, nodes, reverse=True)
    else:
        by_y0, mu = _retrace((field, t0, t1), start, nodes, limits, method)
    first = first_branch(field, y0, t0, t1, limits, method=method)
    last, sampled = (None, None) if branches is None else branches
    by_t1 = jnp.sum(by_y1 * rate_in(last, field, t1, y1))
    rates = jax.vmap(lambda branch, t, y: rate_in(branch, field, t, y))(sampled, ts, ys)
    by_ts = jnp.sum(by_ys * rates, axis=-1)
    by_t0 = -jnp.sum(by_y0 * rate_in(first, field, t0, y0))
    return tree(mu), by_y0, by_t0, by_t1, by_ts
