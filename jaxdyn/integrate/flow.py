"""The map from a start to the states at later times, and its derivatives.

`flow` is built on `march` and `pieces`, and is differentiable any number of times, in forward and
reverse mode, under jit and vmap, with respect to the start, the times and every number of the
scene. Its derivative is not taken through the stepping loop (that would differentiate the choice of
steps, compile slowly, and allow only one mode) but by the variational equations (`Variational`),
integrated together with the state, with the tangents in the error norm. The result is a matrix;
forward and reverse mode both multiply by it. So a gradient costs about as much as a Jacobian: right
for the tens of numbers of a mechanics scene, not for thousands (a neural force).
"""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxdyn._numerics import in_one_kernel
from jaxdyn.integrate.march import SolveResult as SolveResult
from jaxdyn.integrate.march import march
from jaxdyn.integrate.pieces import run_pieces
from jaxdyn.integrate.step_control import Limits
from jaxdyn.integrate.variational import Variational, tangent_columns
from jaxdyn.plan import plan_of
from jaxdyn.plan.in_branch import without_wrappers
from jaxdyn.solvers import Method


# Compiled within the rule of derivatives, not around it, and so is that rule: a derivative then
# traces no plain solve besides its own, and several solves of a kind in one program are traced
# once.
@eqx.filter_custom_jvp
@functools.partial(jax.jit, static_argnames="method")
def flow(field, y0, t0, t1, ts, limits: Limits, *, method: Method) -> SolveResult:
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
    Limits: derivatives with respect to the tolerance are zero by definition.
    """
    run = functools.partial(_march, method=method)
    # Some of these are known only at run time; the tolerance is often a constant.
    unknown = jnp.isfinite(y0.ravel()[0] + t0 + t1 + limits.tolerance[0])
    return in_one_kernel(run, (field, y0, t0, t1, ts, limits), unknown=unknown)


def _march(field, y0, *rest, method: Method) -> SolveResult:
    *_, limits = rest
    plan = plan_of(without_wrappers(field), len(y0))
    # A caller who asks for steps of equal length wants them where they are.
    if (plan.size or len(limits.breaks)) and method.adaptive:
        return run_pieces(field, (), y0, *rest, method=method)[0]
    return march(field, y0, *rest, method=method)[0]


@flow.def_jvp
@functools.partial(jax.jit, static_argnames="method")
def _flow_jvp(primals, tangents, *, method):
    field, y0, t0, t1, ts, limits = primals
    d_field, d_y0, d_t0, d_t1, d_ts, _ = tangents
    f0 = field.rate(t0, y0)
    columns, directions, multiply = tangent_columns(field, y0, f0, d_field, d_y0, d_t0)
    if columns.shape[-1]:
        start = jnp.concatenate([y0[..., None], columns], axis=-1)
        method = method.for_tangents
        out = flow(Variational(field, directions), start, t0, t1, ts, limits, method=method)
        y1, ys = out.y1[..., 0], out.ys[..., 0]
        d_y1, d_ys = multiply(out.y1[..., 1:]), multiply(out.ys[..., 1:])
    else:
        out = flow(field, y0, t0, t1, ts, limits, method=method)
        y1, ys, d_y1, d_ys = out.y1, out.ys, jnp.zeros_like(y0), jnp.zeros_like(out.ys)
    if d_t1 is not None:
        d_y1 = d_y1 + field.rate(t1, y1) * d_t1
    if d_ts is not None:
        rates = jax.vmap(field.rate)(ts, ys)
        d_ys = d_ys + rates * d_ts.reshape(-1, *[1] * y0.ndim)
    result = SolveResult(
        y1=y1, ys=ys, steps=out.steps, rejected=out.rejected, status=out.status, stiff=out.stiff
    )
    return result, SolveResult(y1=d_y1, ys=d_ys, steps=None, rejected=None, status=None, stiff=None)
