"""A method as a diffrax solver, with compensated summation, projection and stiffness detection."""

import dataclasses
from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from jaxdyn.solvers.formulas.simplified import simplify
from jaxdyn.solvers.method import Advance, Method
from jaxdyn.solvers.perturbed import perturbed_start
from jaxdyn.solvers.sizes import absolute, allowed_error, groups_of, grow, sizes_after_rejection

# ---- The loop over steps of ``diffrax.diffeqsolve``, without what step control does here
#
# diffrax prepares a run, and leaves the loop to its argument `adjoint`. Its own loops save
# samples, look for events, keep dense output, and first compute the time a hundred floating-point
# numbers before the end, one after the other. These took half of the time until a first result
# (Lorenz: 0.35 s of processor time against 0.75 s to compile, and 0.1 s less to trace), and none of
# them is used here.


class _Run(NamedTuple):
    """A run between two steps.

    Attributes:
      t: () the time that it has reached.
      tnext: () where the next step goes.
      y: (k, ...) the state.
      solver_state: the state of the solver.
      controller_state: the state of step control.
      result: whether it goes on.
      accepted: () number of steps kept.
    """

    t: Array
    tnext: Array
    y: Array
    solver_state: PyTree
    controller_state: PyTree
    result: diffrax.RESULTS
    accepted: Array


class Stepping(diffrax.AbstractAdjoint):
    """Steps until step control ends the run; only the end is saved; not differentiable."""

    def loop(self, *, args, terms, solver, stepsize_controller, init_state, t1, **others) -> Any:
        """The final state that diffrax expects, and no further statistics."""
        del others

        def going(run: _Run) -> Array:
            return (run.t < t1) & diffrax.is_successful(run.result)

        def step(run: _Run) -> _Run:
            y1, error, _, solver_state, solved = solver.step(
                terms, run.t, run.tnext, run.y, args, run.solver_state, False
            )
            keep, t, tnext, _, controller_state, controlled = stepsize_controller.adapt_step_size(
                run.t, run.tnext, run.y, y1, args, error, order, run.controller_state
            )
            y, solver_state = jax.tree.map(
                lambda new, old: jnp.where(keep, new, old),
                (y1, solver_state),
                (run.y, solver.after_rejection(run.solver_state, solver_state)),
            )
            # The failure of a rejected step does not end the run: the next step is shorter.
            solved = diffrax.RESULTS.where(keep, solved, diffrax.RESULTS.successful)
            result = diffrax.RESULTS.where(diffrax.is_okay(solved), controlled, solved)
            return _Run(
                t,
                tnext,
                y,
                solver_state,
                controller_state,
                result,
                run.accepted + jnp.where(keep, 1, 0),
            )

        order = solver.error_order(terms)
        start = init_state
        run = jax.lax.while_loop(
            going,
            step,
            _Run(
                start.tprev,
                start.tnext,
                start.y,
                start.solver_state,
                start.controller_state,
                start.result,
                jnp.asarray(0),  # weak, as in diffrax
            ),
        )
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
    """

    method: Method
    tolerance: Array
    sizes: Array | None = None
    h: Array | None = None
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
        return jnp.zeros_like(y0), jnp.zeros(()), self.sizes

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del made_jump
        carry, count, sizes = solver_state
        # Backwards in time diffrax increases t and negates the control: h < 0.
        h = terms.contr(t0, t1)
        if self.h is not None:
            # A step to a sample is shorter by more than rounding.
            rounding = _TIME_ROUNDINGS * jnp.finfo(h.dtype).eps * jnp.maximum(abs(t0), abs(t1))
            h = jnp.where(jnp.abs(self.h) - jnp.abs(h) > rounding, h, self.h)
        sign = jnp.where(h < 0, -1.0, 1.0)

        now, start, y = perturbed_start(args, sign * t0, y0)

        tolerance = None if sizes is None else (self.tolerance[0], absolute(self.tolerance, sizes))
        step = _advance(self.method, terms, now, sign, start, h, y, tolerance)
        y1, carry = step.onto(y0, carry)
        end = None if isinstance(step.part, float) else _end(t0, t1, step.part)
        t1 = t1 if end is None else end
        y1 = simplify(args.project)(sign * t1, y1)
        lost = args.loses(sign * t0, y0, sign * t1, y1)
        y1 = y1 if lost is None else jnp.where(lost, jnp.nan, y1)
        if not isinstance(step.speed, float):  # a float is the default: there is no estimate
            near = step.speed > self.method.alarm * self.method.stable
            # A motion that was stiff once counts as stiff from then on.
            least = jnp.where(is_stiff(count), _STIFF_COUNT, 0)
            count = jnp.maximum(count + jnp.where(near, 1, -1), least)
        result = diffrax.RESULTS.where(
            step.converged, diffrax.RESULTS.successful, diffrax.RESULTS.nonlinear_divergence
        )
        may = None
        if sizes is not None:
            sizes = grow(groups_of(args, y0), sizes, y1)
            may = allowed_error(self.tolerance, sizes, y0, y1)
        told = StepError(step.error, may, end, step.reach, step.square, count)
        nothing = {}  # for dense output, which is not asked for
        return y1, told, nothing, (carry, count, sizes), result

    def after_rejection(self, state, tried):
        """The state of the solver after a rejected step, from those before and after the step."""
        if state[2] is None:
            return state
        return (*state[:2], sizes_after_rejection(state[2], tried[2]))

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


def _end(t0: Array, t1: Array, part: Array) -> Array:
    """() the end of a part of a step."""
    return jnp.where(part < 1.0, t0 + part * (t1 - t0), t1)


def is_stiff(count: Array) -> Array:
    """() whether a count of steps limited by stability makes a motion stiff."""
    return count >= _STIFF_COUNT
