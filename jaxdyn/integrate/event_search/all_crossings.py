"""All crossings of one motion: `jaxdyn.crossings`.

The search continues from each crossing to the next, see `pieces.first_event`. Derivatives do not
pass through it: one run of the variational equations, sampled at the crossings, gives those of the
states at fixed times, and the implicit function theorem does the rest, as for `events.until`.
"""

import functools
from collections.abc import Callable
from typing import Annotated, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn._numerics import in_one_kernel
from jaxdyn._text import number_of
from jaxdyn.integrate import resting
from jaxdyn.integrate.event_search.event_values import (
    crossing_values,
    jumping_conditions,
    time_tangent,
)
from jaxdyn.integrate.events import Event, as_events
from jaxdyn.integrate.flow import flow, rate_in, run_or_switch
from jaxdyn.integrate.march import Limits
from jaxdyn.integrate.pieces import Arrival, first_branch, first_event
from jaxdyn.integrate.spans import MAX_STEPS, RTOL, SolverOptions, limits, span
from jaxdyn.integrate.trajectory import raise_unless_ok
from jaxdyn.plan.branch import in_branch
from jaxdyn.scene import Scene
from jaxdyn.solvers import Method, Solver
from jaxdyn.solvers.choice import check_method
from jaxdyn.status import Status

#: Crossings found by one call of the program where all are requested.
_CROSSINGS_A_CALL = 64


class Crossings(NamedTuple):
    """The crossings of one motion, in the order in which they happen.

    Attributes:
      ts: (n,) times; NaN after the last crossing found.
      ys: (n, k) states at these times, NaN likewise.
      directions: (n,) 1 where the value rises along the motion, -1 where it falls; 0 after the
        last one.
      count: () number of crossings found.
      status: () `Status` code of the motion; crossings found before it failed are valid.
    """

    ts: Array
    ys: Array
    directions: Array
    count: Array
    status: Annotated[Array, Status]

    __repr__ = _text.fields
    _repr_html_ = _text.html

    @property
    def message(self) -> str:
        """The number of crossings, and how the motion ended; host only."""
        return f"{number_of(int(self.count), 'crossing')}. {Status(int(self.status)).message}"


@check_first
def crossings(
    scene: Scene,
    event: Event,
    t1=None,
    *,
    t0=0.0,
    most: int | None = None,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
    max_step=None,
    breaks=(),
    throw: bool = True,
) -> Crossings:
    """All crossings of an event by one motion: times, states and directions.

    A motion that starts on the event has left it: its start is not a crossing. A value that is held
    at zero crosses it when it arrives, and again where it returns to the side from which it came.
    See `events.until` for the rules, and for how the times are found to full precision.

    Args:
      scene: system, effects, start.
      event: what crosses zero, with the direction that counts.
      t1: () end of the span [s]; the scene's own by default.
      t0: () start time [s].
      most: number of rows of the result: no further crossings are found, and rows that are not
        needed are NaN, with derivatives of 0, so that sums over the other rows have theirs. It is
        required under jit, grad and vmap; without it the result has one row for each crossing.
      rtol: see `simulate`.
      atol: see `simulate`.
      solver: see `simulate`.
      max_steps: largest number of steps of the whole motion.
      max_step: see `simulate`.
      breaks: see `simulate`.
      throw: raise where the motion fails; with False check `Crossings.status`. Inside a
        transformation nothing is raised.
    Returns:
      The `Crossings`, differentiable in forward and reverse mode, any number of times, in the
      start, the times, and the numbers of the scene and of the event.
    Raises:
      ValueError: `event` is not an event, `most` is not positive, or missing inside a
        transformation, or a number is out of range, as for `simulate`.
      IntegrationError: the motion failed before t1 (``throw=True``).
    Limits: those of `events.until`; derivatives are infinite where the motion touches the event.
    Example:
      >>> import jaxdyn
      >>> from jaxdyn import scenes
      >>> from jaxdyn.integrate import events
      >>> scene = scenes.oscillator(k=4.0, m=1.0)
      >>> found = jaxdyn.crossings(scene, events.Reaches(0, 0.0), 4.0)
      >>> (found.ts * 4 / jnp.pi).round(9).tolist(), found.directions.tolist()
      ([1.0, 3.0, 5.0], [-1, 1, -1])
    """
    t0, t1 = span(scene, t1, t0)
    (event,) = as_events((event,), len(scene.y0))
    method = check_method(scene, solver, several=True)
    options = SolverOptions(rtol, atol, solver, max_steps, max_step, breaks)
    run_limits = limits(options)
    given = scene, event, t0, t1, run_limits
    rows = None if most is None else _checks.whole("most", most)
    if rows is None:
        remedy = "Pass most=, a number of rows that does not depend on the motion."
        _checks.check_untraced("scene and times", given, remedy)

    traced = _checks.is_traced(given)

    def run(run_limits, method: Method) -> Crossings:
        run_limits = jax.tree.map(jnp.asarray if traced else np.asarray, run_limits)

        def rest(y, t, side, run_limits: Limits, rows: int) -> tuple[Crossings, Array]:
            args = (scene.field, event, y, t, side, t1, run_limits)
            return _compiled(*args, method=method, rows=rows)[:2]

        none = np.zeros(())
        if rows is None:
            return _every(rest, scene.y0, t0, none, run_limits)
        return rest(scene.y0, t0, none, run_limits, rows)[0]

    found, _ = run_or_switch(run, run_limits, method, default=solver is None and not traced)
    if throw:
        raise_unless_ok(found.status, scene)
    return found


def _every(rest: Callable[..., tuple[Crossings, Array]], y, t, side, limits: Limits) -> Crossings:
    """All crossings, by calls of one program, each from where the last one ended."""
    # On the host, where another number of crossings needs no other program.
    parts, stiff = [], np.asarray(limits.max_steps)[1]
    while True:
        found, left = rest(y, t, side, limits, _CROSSINGS_A_CALL)
        limits = limits._replace(max_steps=np.array([left, stiff]))
        n = int(found.count)
        parts.append([np.asarray(x)[:n] for x in found[:3]])
        if n < _CROSSINGS_A_CALL:
            break
        t, y, side = (x[-1] for x in parts[-1])
        side = np.asarray(side, float)
    ts, ys, directions = map(np.concatenate, zip(*parts, strict=True))
    found_all = jnp.asarray(ts, float), jnp.asarray(ys, float), jnp.asarray(directions, int)
    return Crossings(*found_all, count=jnp.asarray(len(ts)), status=found.status)


@eqx.filter_custom_jvp
def _find(
    field, event, y0, t0, side, t1, limits, *, method: Method, rows: int
) -> tuple[Crossings, Array, Arrival | None]:
    """The crossings, the number of steps that are left until the limit, and (rows,) arrivals."""
    search = functools.partial(_search, method=method, rows=rows)
    args = (field, event, y0, t0, side, t1, limits)
    return in_one_kernel(search, args, unknown=limits.tolerance[0] > 0)


@_find.def_jvp
def _find_jvp(primals, tangents, *, method, rows):
    field, event, y0, t0, _, _, limits = primals
    d_field, d_event, d_y0, d_t0, _, _, _ = tangents
    found, left, arrivals = _find(*primals, method=method, rows=rows)
    there = jnp.arange(rows) < found.count
    # The motion is followed only as far as the last crossing: it may fail after it.
    end = jnp.where(found.count > 0, found.ts[jnp.maximum(found.count - 1, 0)], t0)
    ts = jnp.where(there, found.ts, end)

    def states(field, y0, t0):
        if arrivals is None:
            return flow(field, y0, t0, end, ts, limits, method=method).ys
        # As in `events.until`: at a crossing at which a condition changes as well, the motion that
        # arrives is meant, so the last part of the way to each is in the branch of that motion.
        # While the motion is held, one branch has no sizes by which errors are measured: the whole
        # motion does.
        starts = jnp.where(arrivals.ended >= 0, ts, 0.5 * (arrivals.since + ts))
        starts = jax.lax.stop_gradient(starts)
        before = flow(field, y0, t0, starts[-1], starts, limits, method=method).ys
        return jax.vmap(functools.partial(arrive, field))(arrivals.branch, before, starts, ts)

    def arrive(field, branch, y, start, t):
        none = jnp.zeros(0)
        return flow(in_branch(field, branch), y, start, t, none, limits, method=method).y1

    ys, dys = eqx.filter_jvp(states, (field, y0, t0), (d_field, d_y0, d_t0))
    dys = jnp.zeros_like(ys) if dys is None else dys
    branches = None if arrivals is None else arrivals.branch
    rates = jax.vmap(lambda branch, t, y: rate_in(branch, field, t, y))(branches, ts, ys)
    # A value that jumps over zero does so where one of its conditions changes.
    on = jnp.where(there[:, None], found.ys, ys)
    jumping = jax.vmap(lambda t, y, f: jumping_conditions((event,), t, y, f, t0))(ts, on, rates)

    def values(event, ts, ys):
        return jax.vmap(lambda *row: crossing_values((event,), *row)[0])(jumping, ts, ys)

    dts_of = functools.partial(time_tangent, values, event, d_event)
    dts = resting.time_tangent(dts_of, field, d_field, arrivals, ts, ys, dys, rates, there)
    dts = jnp.where(there, dts, 0.0)
    dys = jnp.where(there[:, None], dys + rates * dts[:, None], 0.0)
    tangents = Crossings(ts=dts, ys=dys, directions=None, count=None, status=None)
    return (found, left, arrivals), (tangents, None, jax.tree.map(lambda _: None, arrivals))


_compiled = eqx.filter_jit(_find)


def _search(field, event, y0, t0, side, t1, limits, *, method: Method, rows: int):
    def following(carry, _):
        t, y, side, status, left, arrival = carry
        sides = (side,)  # just after the last crossing the side is known without evaluation
        # Each search has the steps that those before it left, so that their sum is bounded.
        run_limits = limits.with_steps(left)
        end, found, new = first_event(field, (event,), y, t, t1, run_limits, sides, method=method)
        right = (status == Status.OK) & (found.status == Status.OK)
        there = right & jnp.isfinite(found.t)
        # If there is no other crossing, the remaining rows take no step.
        t, y = jnp.where(there, found.t, t1), jnp.where(there, found.y, end.y1)
        side = jnp.where(there, found.towards, 0.0)
        # Rows without a crossing have the arrival of the last one, where derivatives are finite.
        arrival = jax.tree.map(lambda a, b, there=there: jnp.where(there, a, b), new, arrival)
        row = (
            jnp.where(there, t, jnp.nan),
            jnp.where(there, y, jnp.nan),
            side.astype(int),
            there,
            arrival,
        )
        status = jnp.where(status == Status.OK, found.status, status)
        left = jnp.maximum(left - found.steps, 0)
        return (t, y, side, status, left, arrival), row

    branch = first_branch(field, y0, t0, t1, limits, method=method)
    arrival = None if branch is None else Arrival(jnp.asarray(t0), branch, jnp.asarray(-1))
    start = t0, y0, side, jnp.asarray(int(Status.OK)), limits.max_steps[0], arrival
    (*_, status, left, _), found = jax.lax.scan(following, start, length=rows)
    ts, ys, directions, there, arrivals = found
    return Crossings(ts, ys, directions, count=jnp.sum(there), status=status), left, arrivals
