"""The loop over steps of ``diffrax.diffeqsolve``, without what step control does here.

diffrax prepares a run, and leaves the loop to its argument `adjoint`. Its own loops save samples,
look for events, keep dense output, and first compute the time a hundred floating-point numbers
before the end, one after the other. These took half of the time until a first result (Lorenz:
0.35 s of processor against 0.75 s to compile, 0.1 s less to trace), and here none of them is used.
"""

import dataclasses
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree


class _Run(NamedTuple):
    """A run between two steps.

    Attributes:
      t: () where it is.
      tnext: () where the next step goes.
      y: (k, ...) the state.
      solver_state: that of the solver.
      controller_state: that of step control.
      result: whether it goes on.
      accepted: () steps kept.
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
        """The final state of diffrax's, and no further statistics."""
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
            # The failure of a step that is rejected does not end the run: the next one is shorter.
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
