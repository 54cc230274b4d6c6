"""A method as a diffrax solver, with compensated summation, projection and stiffness detection."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from equinox.internal import while_loop
from jax import lax
from jaxtyping import Array, PyTree

from jaxdyn._numerics import any_lane
from jaxdyn.scales import (
    ALL_ROUNDING,
    LATER,
    MARGIN,
    USUAL_ALONE,
    Groups,
    at_start,
    notable,
    rounding,
    shifted,
)
from jaxdyn.solvers.formulas.formulas import simplify
from jaxdyn.solvers.method import Advance, Method
from jaxdyn.solvers.perturbed import perturbed_start

# ---- The loop over steps of ``diffrax.diffeqsolve``, without what step control does here
#
# diffrax prepares a run, and leaves the loop to its argument `adjoint`. Its own loops save
# samples, look for events, keep dense output, and first compute the time a hundred floating-point
# numbers before the end, one after the other. These took half of the time until a first result
# (Lorenz: 0.35 s of processor time against 0.75 s to compile, and 0.1 s less to trace), and none of
# them is used here.


#: Number of states that are kept for derivatives: 5000 steps are computed twice more.
_CHECKPOINTS = 100


class _Run(NamedTuple):
    """A run between two steps.

    Attributes:
      t: () the time that it has reached.
      tnext: () where the next step goes.
      y: (k, ...) the state.
      solver_state: the state of the solver.
      controller_state: the state of step control.
      result: whether it continues.
      accepted: () number of steps kept.
    """

    t: Array
    tnext: Array
    y: Array
    solver_state: PyTree
    controller_state: PyTree
    result: diffrax.RESULTS
    accepted: Array


class StepLoop(diffrax.AbstractAdjoint):
    """Steps until step control ends the run; only the end is saved; not differentiable."""

    def loop(self, *, args, terms, solver, stepsize_controller, init_state, t1, **others) -> Any:
        """The final state that diffrax expects, and no further statistics."""
        del others

        def going(run: _Run) -> Array:
            return (run.t < t1) & diffrax.is_successful(run.result)

        def advance(run: _Run, args: Any) -> tuple:
            times = run.t, run.tnext
            return solver.step(terms, *times, run.y, args, run.solver_state, False)

        def step(run: _Run, args: Any) -> _Run:
            y1, error, _, solver_state, solved = advance(run, args)
            keep, t, tnext, _, controller_state, controlled = stepsize_controller.adapt_step_size(
                run.t, run.tnext, run.y, y1, args, error, order, run.controller_state
            )
            y, solver_state = jax.tree.map(
                lambda new, old: jnp.where(keep, new, old),
                (y1, solver_state),
                (run.y, solver.after_rejection(run.solver_state, solver_state)),
            )
            result, success = controlled, diffrax.RESULTS.successful
            if solved is not success:  # an explicit method solves nothing that could fail
                # The failure of a rejected step does not end the run: the next step is shorter.
                solved = diffrax.RESULTS.where(keep, solved, success)
                result = diffrax.RESULTS.where(diffrax.is_okay(solved), controlled, solved)
            accepted = run.accepted + jnp.where(keep, 1, 0)
            return _Run(t, tnext, y, solver_state, controller_state, result, accepted)

        order = solver.error_order(terms)
        start, none = init_state, jnp.asarray(0)  # weak, as in diffrax
        states = start.solver_state, start.controller_state
        begin = _Run(start.tprev, start.tnext, start.y, *states, start.result, none)
        run = self.repeat(begin, args, going, step, advance)
        final = dataclasses.replace(
            start,
            y=run.y,
            tprev=run.t,
            tnext=run.tnext,
            solver_state=run.solver_state,
            controller_state=run.controller_state,
            result=run.result,
            num_accepted_steps=run.accepted,
            save_state=dataclasses.replace(start.save_state, ts=run.t[None], ys=run.y[None]),
        )
        return final, {}

    def repeat(self, run: _Run, args: Any, going: Callable, step: Callable, advance: Callable):
        """The run after its last step; `advance` is what a step does before its end is judged."""
        del advance
        return lax.while_loop(going, lambda run: step(run, args), run)


class StepLoopInReverse(StepLoop):
    """The same steps, differentiable in reverse mode by the state and the numbers of the field.

    The times of steps are constants. Some states are kept, from which others are computed again
    (online checkpointing: Stumm and Walther, 2010, SIAM J. Sci. Comput. 32, 836).
    """

    def repeat(self, run: _Run, args: Any, going: Callable, step: Callable, advance: Callable):
        """The run after its last step."""
        fixed, begin = without_derivatives(args), without_derivatives(run.t)

        def step_kept(run: _Run) -> _Run:
            # Steps that are too long are left out, since what they compute need not be finite, and
            # zero times infinity would be their part of the gradient. So would be that of a step
            # from the infinite time of a run that has ended, while others in a batch go on.
            start = without_derivatives(run)
            before, after = lax.while_loop(
                lambda pair: going(pair[1]) & (pair[1].accepted == start.accepted),
                lambda pair: (pair[1], step(pair[1], fixed)),
                (start, start),
            )
            kept = after.accepted > before.accepted
            t, tnext = jnp.where(kept, before.t, begin), jnp.where(kept, before.tnext, begin)
            y = advance(before._replace(y=run.y, t=t, tnext=tnext), args)[0]
            return after._replace(y=jnp.where(kept, y, run.y))

        kind: Any = {"kind": "checkpointed", "checkpoints": _CHECKPOINTS, "max_steps": None}
        return while_loop(going, step_kept, run, **kind)


def without_derivatives(tree: Any) -> Any:
    """The tree with its arrays as constants."""
    return jax.tree.map(lambda x: lax.stop_gradient(x) if eqx.is_array(x) else x, tree)


# ---- A method as a diffrax solver, with compensated summation, projection and stiffness detection

#: Net number of stability-limited steps before a run is flagged stiff.
_STIFF_COUNT = 50
#: Roundings of the times of a fixed step by which their difference may be shorter than the step.
_TIME_ROUNDINGS = 4.0


class StepError(NamedTuple):
    """The data about a step that step control needs.

    Attributes:
      error: (k, ...) estimate of the error.
      allowed: (k, ...) the error that the step may have, where the method takes a tolerance.
      end: () the time to which the step went, if the method may shorten it.
      reach: () how long the step might have been, in parts of the proposed one, if it is known.
      square: () square of the size of the error in tolerances, if the method measures it.
      limited: () net number of steps so far that stability limited, if it is counted.
    """

    error: Array
    allowed: Array | None = None
    end: Array | None = None
    reach: Array | None = None
    square: Array | None = None
    limited: Array | None = None


class Stepper(diffrax.AbstractAdaptiveSolver):
    """A method as a diffrax solver.

    The solver's state is the rounding error of the last sum (`Advance.onto`). After each step the
    field projects the state onto its constraints (most have none). The state also counts
    steps that stability limits, see `is_stiff`, and has the sizes of the motion so far.

    Attributes:
      method: the method.
      tolerance: (3,) relative and absolute tolerance of one step, and an absolute one in parts of
        the sizes of the motion, where the method takes one.
      sizes: (k, ...) sizes of the motion at the start; None where the method takes no tolerance.
      h: () the exact step where it is fixed: a difference of times would be rounded. Steps to
        samples are shorter.
      time: () the time in which the motion changes, where the method takes a tolerance.
    """

    method: Method
    tolerance: Array
    sizes: Array | None = None
    h: Array | None = None
    time: Array | None = None
    term_structure: ClassVar = diffrax.ODETerm
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation  # never used

    def order(self, terms):
        del terms
        return self.method.order

    def error_order(self, terms):
        del terms
        return self.method.error_order

    def init(self, terms, t0, t1, y0, args):
        del terms, t0, t1, args
        return jnp.zeros_like(y0), jnp.zeros(()), self.sizes, self.sizes

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del made_jump
        carry, count, sizes, seen = solver_state
        # Backwards in time diffrax increases t and negates the control: h < 0.
        h = terms.contr(t0, t1)
        if self.h is not None:
            # A step to a sample is shorter by more than rounding.
            rounding = _TIME_ROUNDINGS * jnp.finfo(h.dtype).eps * jnp.maximum(abs(t0), abs(t1))
            h = jnp.where(jnp.abs(self.h) - jnp.abs(h) > rounding, h, self.h)
        sign = jnp.where(h < 0, -1.0, 1.0)

        now, start, y = perturbed_start(args, sign * t0, y0)

        tolerance = (
            None if sizes is None else (self.tolerance[0], absolute_error(self.tolerance, sizes))
        )
        step = _advance(self.method, terms, now, sign, start, h, y, tolerance)
        y1, carry = step.onto(y0, carry)
        end = None
        if not isinstance(step.part, float):  # a float is the default: the whole step
            t1 = end = jnp.where(step.part < 1.0, t0 + step.part * (t1 - t0), t1)
        y1 = simplify(args.project)(sign * t1, y1)
        lost = args.loses(sign * t0, y0, sign * t1, y1)
        y1 = y1 if lost is None else jnp.where(lost, jnp.nan, y1)
        if not isinstance(step.speed, float):  # a float is the default: there is no estimate
            near = step.speed > self.method.alarm * self.method.stable
            # A motion that was stiff once counts as stiff from then on.
            least = jnp.where(is_stiff(count), _STIFF_COUNT, 0)
            count = jnp.maximum(count + jnp.where(near, 1, -1), least)
        result = diffrax.RESULTS.successful
        if step.converged is not True:  # which is the default
            failed = diffrax.RESULTS.nonlinear_divergence
            result = diffrax.RESULTS.where(step.converged, result, failed)
        may = None
        if sizes is not None:
            sizes = grow(groups_of(args, y0), sizes, y1)
            # A method that damps suppresses rounding in fast modes, so its sizes are kept.
            if not (groups_of(args, y0).known or self.method.damps):
                reached = args, self.tolerance, self.time, sign * t1, h, y1, sizes
                grown = jnp.any(sizes > _GROWN * seen)
                new = lax.cond(any_lane(grown), lambda: _above_later_noise(*reached), lambda: sizes)
                sizes, seen = jnp.where(grown, new, sizes), jnp.where(grown, new, seen)
            may = allowed_error(self.tolerance, sizes, y0, y1)
        error = StepError(step.error, may, end, step.reach, step.square, count)
        nothing = {}  # for dense output, which is not asked for
        return y1, error, nothing, (carry, count, sizes, seen), result

    def after_rejection(self, state, tried):
        """The state of the solver after a rejected step, from those before and after the step."""
        if state[2] is None:
            return state
        return (*state[:2], sizes_after_rejection(state[2], tried[2]), state[3])

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)


@eqx.filter_jit  # one program for the stages, whatever is done around them
def _advance(
    method: Method, terms, args, sign: Array, t: Array, h: Array, y: Array, tolerance
) -> Advance:
    """The increment of a step, in the time that diffrax counts: sign * t of the field."""

    @jax.jit  # traced once for all stages: half of the time until a first result
    def field(t, y):
        return terms.vf(sign * t, y, args)

    if tolerance is None:
        return method.advance(field, t, h, y)
    return method.advance_within(field, t, h, y, tolerance)


def is_stiff(count: Array) -> Array:
    """() whether a count of steps limited by stability makes a motion stiff."""
    return count >= _STIFF_COUNT


# ---- The sizes of a state along a motion, relative to which a tolerance is absolute by default
#
# The error that a step may have in an entry is
#
#     atol + share * size + rtol * |y|
#
# with `atol` in the units of the state, where it is given, and otherwise a share of the size of the
# entry, by default a quarter of `rtol`. Sizes are the largest so far of each group of entries
# (`scales.Groups`). At the start, where an entry may be zero that others move at once, they are a
# part of the scales that the rate shows there. So an entry that is zero, or rounding, for a while
# or by symmetry does not require smaller steps.
#
# Tangents of a state (k, columns) are as large as their column: the largest of its entries, each
# measured in the size of the state's entry, whatever the units of entries and of perturbed numbers.

#: The part of the scales at the start that counts until the motion has shown how large it is. These
#: scales are what an entry reaches in the time of the motion, unless others stop it before.
PART = 0.1

#: The error that a step may have in an entry is at least this multiple of the change that rounding
#: makes in the time of the motion.
_NOISE = 32.0
#: Number of roundings in a rate that is a sum of a few products, and the multiple of these up to
#: which rates of tangents are only rounding.
_FEW, _ALONE = 4.0, 64.0
#: An entry at rest is given this part of the size that a rejected step would have given it.
_GLIMPSE = 0.01
#: Growth of a size after which rounding is measured again, and the largest multiple of a step in
#: which it is taken to act: the motion may leave the place at once.
_GROWN, _LONGER = 2.0, 16.0
#: The error that rounding may allow is at most this part of the size of an entry. A step that is
#: far too long leads to where rates are enormous, and so is their rounding, which would allow it.
_MOST_NOISE = 1e-3


class AtStart(NamedTuple):
    """What is known at a start.

    Attributes:
      sizes: (k, ...) the sizes of the entries.
      time: () the time in which the motion changes.
      rate: (k,) the rate there, of the state alone; (k, ...) where steps have one length.
      noise: (k, ...) the effect of rounding on the rate, if it is known.
    """

    sizes: Array
    time: Array
    rate: Array
    noise: Array | None = None


def sizes_at_start(field: Any, t0: Array, y0: Array, t1: Array, *, driven: bool = True) -> AtStart:
    """The sizes of a state (k, ...) at its start, and the rate and the time of its motion.

    Args:
      field: has ``rate`` and ``groups``; for a state with tangents instead of these ``single``, the
        field of the state alone, and ``perturbed``, see `_rounding_of_tangents`.
      t0: () start time.
      y0: (k, ...) start.
      t1: () end time.
      driven: whether the rate may depend on time.
    """
    with_tangents = field
    field, y = _without_tangents(field, y0)
    scales, rate = at_start(field, field.groups, t0, y, t1, driven=driven)
    sizes = jnp.maximum(field.groups.sizes(jnp.abs(y)), PART * scales.sizes)
    if y0.ndim == 1:
        return AtStart(sizes, scales.time, rate, scales.noise)
    later = t0 + LATER * jnp.sign(t1 - t0) * scales.time
    rates, noise = _rates_beside(with_tangents, y0, jnp.stack([t0, later]), sizes, scales.time)
    wide = jnp.concatenate([sizes[:, None], PART * scales.time * rates], axis=1).reshape(y0.shape)
    of_state = jnp.zeros_like(y) if scales.noise is None else scales.noise
    noise = jnp.concatenate([of_state[:, None], noise], axis=1).reshape(y0.shape)
    return AtStart(grow(field.groups, wide, y0), scales.time, rate, noise)


def _rates_beside(
    field: Any, y: Array, ts: Array, sizes: Array, time: Array
) -> tuple[Array, Array]:
    """(k, c) sizes of the rates of tangents beside the start, and of their rounding.

    Tangents that begin as zero, in a force that is zero both there and a little later, may grow by
    any power of time. They have the size of what moves them a little further on: measured by
    themselves, each step would be too long, or, where that zero is rounding, too short. Tangents of
    tangents are moved by these, so the rate is evaluated on both sides for each level.

    Args:
      field: has ``rate``.
      y: (k, ...) the state with its tangents.
      ts: (2,) times of the evaluations on one side and on the other.
      sizes: (k,) sizes of the state, which is displaced by a part of them.
      time: () the time of the motion.
    """
    levels = y.ndim - 1
    flat, near = y.reshape(len(y), -1), rounding(y)
    signs = jnp.resize(jnp.array([1.0, -1.0, -1.0]), flat.shape)

    def evaluate(carry: tuple[Array, ...], at: tuple[Array, ...]) -> tuple[tuple[Array, ...], None]:
        beside, rates, down, up, gap = carry
        t, side, rounded, begins = at
        grown = _tangent_sizes(sizes, PART * time * rates[:, 1:])
        beside = lax.select(begins, beside.at[:, 1:].set(grown), beside)
        off = jnp.concatenate([beside[:, :1], signs[:, 1:] * beside[:, 1:]], axis=1)
        there = (flat + side * off) * (1.0 + near[:, None] * rounded)
        found = field.rate(t, there.reshape(y.shape)).reshape(flat.shape)
        found = jnp.where(jnp.isfinite(found), found, 0.0)
        again, known = rounded > 0, lax.select(side < 0, down, up)
        gap = lax.select(again, jnp.maximum(gap, jnp.abs(found - known)), gap)
        rates = lax.select(again, rates, jnp.maximum(rates, jnp.abs(found)))
        down = lax.select(~again & (side < 0), found, down)
        up = lax.select(~again & (side > 0), found, up)
        return (beside, rates, down, up, gap), None

    # It is a loop so that the rate is compiled once.
    zero, numbers = jnp.zeros_like(flat), np.arange(2 * levels + 2)
    places = jnp.tile(ts, levels + 1), jnp.tile(jnp.array([-1.0, 1.0]), levels + 1)
    rounded = jnp.asarray(numbers >= 2 * levels, float)
    begins = jnp.asarray((numbers % 2 == 0) & (numbers < 2 * levels))
    begin = zero.at[:, 0].set(PART * sizes), zero, zero, zero, zero
    (_, rates, _, _, gap), _ = lax.scan(evaluate, begin, (*places, rounded, begins))
    of_state = jnp.maximum(rates[:, 0], sizes / time)
    rates, gap = (_tangent_sizes(sizes, x[:, 1:]) for x in (rates, gap))
    if levels == 1 and field.perturbed:
        gap = jnp.maximum(gap, _rounding_of_tangents(field.perturbed, of_state, rates))
    return rates, notable(gap, rates)


def _rounding_of_tangents(
    perturbed: Sequence[tuple[Array, Array]], of_state: Array, rates: Array
) -> Array:
    """(k, c) the effect of rounding on rates of tangents that are only rounding; 0 for all others.

    A parameter that cancels, such as the mass of a pendulum, has no effect but by rounding. That is
    random: evaluations may show none of it, and then no step is short enough. With p the number
    that is perturbed, its tangents are compared with the rates of the state over |p|.

    Args:
      perturbed: arrays of numbers (...) that are perturbed, and by how much in each column
        (..., c).
      of_state: (k,) rates of the state.
      rates: (k, c) rates of the tangents.
    """
    # (c,) the magnitude of the number that each column perturbs.
    values = jnp.zeros(rates.shape[1])
    for p, direction in perturbed:
        values += jnp.sum(jnp.abs(direction * p[..., None]), axis=tuple(range(p.ndim)))
    usual = of_state[:, None] / jnp.where(values > 0, values, jnp.inf)[None]
    usual = _FEW * jnp.finfo(rates.dtype).eps * usual
    return jnp.where(rates < _ALONE * usual, usual, 0.0)


def above_noise(start: AtStart, tolerance: Array) -> AtStart:
    """What is known at a start, with sizes raised until tolerances exceed the effect of rounding.

    This is its effect in the time of the motion. A body at rest in space may be moved by the
    rounding of its rotation: no step is short enough to resolve that.
    """
    if start.noise is None:
        return start
    share, k = tolerance[2], len(start.sizes)
    least = jnp.where(share > 0, _NOISE * start.time * start.noise / share, 0.0).reshape(k, -1)
    flat = start.sizes.reshape(k, -1)
    state = jnp.maximum(flat[:, :1], least[:, :1])
    tangents = jnp.maximum(flat[:, 1:], _tangent_sizes(state[:, 0], least[:, 1:]))
    flat = jnp.concatenate([state, tangents], axis=1)
    return start._replace(sizes=flat.reshape(start.sizes.shape))


def _above_later_noise(
    field: Any, tolerance: Array, time: Array, t: Array, h: Array, y: Array, sizes: Array
) -> Array:
    """The sizes (k, ...) of a motion that has grown, raised above the effect of rounding there.

    A mode that symmetry keeps at zero is nothing but the rounding of others, which grows with them.
    """
    single, x = _without_tangents(field, y)
    here, *beside = lax.map(lambda x: single.rate(t, x), shifted(x))
    gap = functools.reduce(jnp.maximum, [jnp.abs(other - here) for other in beside])
    own = sizes.reshape(len(x), -1)[:, 0]
    rate = jnp.maximum(jnp.abs(here), own / time)
    # Where a rate is little else, rounding is no small part of what grows from now on.
    margin = jnp.where(gap > ALL_ROUNDING * rate, 1.0, MARGIN)
    noise = (margin * notable(gap, rate, USUAL_ALONE))[:, None]
    tangents = jnp.zeros((len(x), sizes.size // len(x) - 1))
    noise = jnp.concatenate([noise, tangents], 1).reshape(y.shape)
    start = AtStart(sizes, jnp.minimum(time, _LONGER * jnp.abs(h)), here, noise)
    most = jnp.where(tolerance[2] > 0, _MOST_NOISE / tolerance[2], 1.0) * sizes
    return jnp.maximum(sizes, jnp.minimum(above_noise(start, tolerance).sizes, most))


def state_of(y: Array) -> Array:
    """The state (k,) of a state with tangents (k, ...)."""
    return y.reshape(len(y), -1)[:, 0]


def groups_of(field: Any, y: Array) -> Groups:
    """The groups of the state alone."""
    return _without_tangents(field, y)[0].groups


def _without_tangents(field: Any, y: Array) -> tuple[Any, Array]:
    """The field of the state without its tangents, and the state (k,)."""
    while y.ndim > 1:
        field, y = field.single, y[..., 0]
    return field, y


def grow(groups: Groups, sizes: Array, y: Array) -> Array:
    """The sizes (k, ...) after a step to y (k, ...): nowhere smaller than before."""
    if y.ndim == 1:
        return jnp.maximum(sizes, groups.sizes(jnp.abs(y), in_loop=True))
    flat = sizes.reshape(len(y), -1), jnp.abs(y).reshape(len(y), -1)
    old, now = flat
    state = jnp.maximum(old[:, 0], groups.sizes(now[:, 0], in_loop=True))
    found = jnp.concatenate([state[:, None], _tangent_sizes(state, now[:, 1:])], axis=1)
    return jnp.maximum(old, found).reshape(y.shape)


def sizes_after_rejection(sizes: Array, tried: Array) -> Array:
    """The sizes (k, ...) after a step that is rejected, which changes them for entries at rest.

    An entry that was at rest so far gets a small part of what the step would have made of it:
    measured by itself, an entry that begins to move at once would have no size at any step.
    """
    found = jnp.where(jnp.isfinite(tried), tried, 0.0)
    return jnp.where(sizes > 0, sizes, _GLIMPSE * found)


def allowed_error(tolerance: Array, sizes: Array, y0: Array, y1: Array) -> Array:
    """The error (k, ...) that a step from y0 to y1 may have, with the sizes after it."""
    now = jnp.maximum(jnp.abs(y0), jnp.abs(y1))
    if y0.ndim > 1:
        state, flat = sizes.reshape(len(now), -1)[:, 0], now.reshape(len(now), -1)
        wide = jnp.concatenate([flat[:, :1], _tangent_sizes(state, flat[:, 1:])], axis=1)
        now = wide.reshape(now.shape)
    return absolute_error(tolerance, sizes) + tolerance[0] * now


def absolute_error(tolerance: Array, sizes: Array) -> Array:
    """The part (k, ...) of the error that a step may have that does not depend on the step.

    It is positive even for an entry that never moves, and has no error.
    """
    return tolerance[1] + tolerance[2] * sizes + jnp.finfo(sizes.dtype).tiny


def _tangent_sizes(state: Array, tangents: Array) -> Array:
    """Sizes (k, c) of tangents whose entries have magnitudes (k, c); see above.

    Where entries of the state have no size, and so never move, their tangents are as large as the
    largest of such tangents in their column. For a state at rest these are all, since a tangent
    may decay next to one that grows.
    """
    moves = (state > 0)[:, None]
    parts = jnp.where(moves, tangents / jnp.where(moves, state[:, None], 1.0), 0.0)
    still = jnp.max(jnp.where(moves, 0.0, tangents), axis=0)[None]
    return jnp.where(moves, state[:, None] * jnp.max(parts, axis=0)[None], still)
