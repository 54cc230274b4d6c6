"""Gradients of one loss with respect to many numbers: the adjoint equations, backwards in time.

The derivatives of `flow` cost one column for each perturbed number. For one loss the adjoint

    d/dt lambda = -(df/dy)^T lambda,    d/dt mu = -(df/dp)^T lambda,

integrated backwards together with the state, gives the derivatives with respect to the start and
all numbers at once, at the cost of a few solves whatever their number. The state is not simply
integrated backwards, which is unstable for damped motion: it restarts from stored nodes. Where
forces do not depend on velocity, neither do these equations, if they are written for
[q, lambda_v, M] with dM/dt = mu, so the Nystrom pair integrates them. Only reverse mode and first
derivatives are available.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.integrate.flow import SolveResult, flow_and_branches, rate_in
from jaxdyn.integrate.march import Limits
from jaxdyn.integrate.pieces import first_branch
from jaxdyn.plan import plan_of
from jaxdyn.plan.branch import Branch, InBranch
from jaxdyn.scales import Groups, groups_of_names
from jaxdyn.solvers import Method

#: Largest relative difference of a state integrated forwards from the same one found backwards.
_SAME_STATE = 1e-3
_PIECES = 4  # pieces of the backward integration, besides those between samples


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
        """The vector z unchanged: scenes with constraints are refused."""
        del t
        return z

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


def _is_same_state(y: Array, z: Array, largest: Array) -> Array:
    """Whether () two results for one state agree; `largest` is the largest entry of the motion."""
    return jnp.max(jnp.abs(y - z)) <= _SAME_STATE * largest


def adjoint_flow(field, y0, t0, t1, ts, limits: Limits, *, method: Method) -> SolveResult:
    """The result of `flow`, with the adjoint equations for its gradient; arguments as for `flow`.

    Raises:
      ValueError: the scene has constraints, or the solver has a fixed step.
    """
    remedy = "Leave adjoint=True out."
    if field.undetermined(t0, y0) is not None:
        raise _checks.fail("adjoint", "a scene without constraints", "one with some", remedy)
    if not method.adaptive:
        solver = method.name
        raise _checks.fail("adjoint", "a solver with a tolerance", solver, remedy)
    pieces = jnp.linspace(t0, t1, _PIECES + 1)[1:-1]
    nodes = jnp.concatenate([ts, pieces])
    # Nodes are in the order of integration; the second argsort recovers the requested times.
    order = jnp.argsort(nodes * jnp.where(t1 > t0, 1.0, -1.0))
    out = _with_nodes((field, y0, t0, t1, nodes[order]), limits, method)
    return eqx.tree_at(lambda out: out.ys, out, out.ys[jnp.argsort(order)[: len(ts)]])


@eqx.filter_custom_vjp
def _with_nodes(given, limits, method: Method) -> SolveResult:
    return flow_and_branches(*given, limits, method=method)[0]


@_with_nodes.def_fwd
def _primal(perturbed, given, limits, method):
    del perturbed
    out, branches = flow_and_branches(*given, limits, False, method=method, sampled=True)
    return out, (out.y1, out.ys, branches)


@_with_nodes.def_bwd
def _gradients(found, slopes, perturbed, given, limits, method):
    """Gradients with respect to all inputs, from those with respect to the states."""
    del perturbed
    field, y0, t0, t1, ts = given
    y1, ys, branches = found
    by_y1 = jnp.zeros_like(y1) if slopes.y1 is None else slopes.y1
    by_ys = jnp.zeros_like(ys) if slopes.ys is None else slopes.ys
    numbers, _ = eqx.partition(field, eqx.is_inexact_array)
    flat, tree = ravel_pytree(numbers)
    system = _Backwards(field, method.position_only, len(y0))
    method = method.for_tangents
    switches = plan_of(field, len(y0)).on_state
    # A start at rest has no size of its own, so all nodes count.
    largest = jnp.max(jnp.abs(jnp.concatenate([ys, y0[None], y1[None]])))

    def piece(carry, node):
        adjoint, mu = carry
        late, y, early, by_early, there, inside = node
        start = system.pack(y, adjoint, mu)
        # A switch at a node is passed by the piece that ends there, except at the start.
        args = (system, start, late, early, ts[:0], limits, inside)
        end = flow_and_branches(*args, method=method)[0].y1
        adjoint, mu = system.unpack(end)
        if switches:
            # A motion that came to slide on a surface is not retraced backwards in time.
            adjoint = jnp.where(_is_same_state(system.state(end), there, largest), adjoint, jnp.nan)
        return (adjoint + by_early, mu), None

    nodes = (
        jnp.concatenate([ts, t1[None]]),
        jnp.concatenate([ys, y1[None]]),
        jnp.concatenate([t0[None], ts]),
        jnp.concatenate([jnp.zeros_like(y0)[None], by_ys]),
        jnp.concatenate([y0[None], ys]),
        jnp.concatenate([t0[None], ts]) != t0,
    )
    start = by_y1, jnp.zeros(flat.shape, y0.dtype)  # a field without numbers has no float64
    (by_y0, mu), _ = jax.lax.scan(piece, start, nodes, reverse=True)
    first = first_branch(field, y0, t0, t1, limits, method=method)
    last, sampled = (None, None) if branches is None else branches
    by_t1 = jnp.sum(by_y1 * rate_in(last, field, t1, y1))
    rates = jax.vmap(lambda branch, t, y: rate_in(branch, field, t, y))(sampled, ts, ys)
    by_ts = jnp.sum(by_ys * rates, axis=-1)
    by_t0 = -jnp.sum(by_y0 * rate_in(first, field, t0, y0))
    return tree(mu / system.magnitudes), by_y0, by_t0, by_t1, by_ts
