"""The call `train`: parameters of any number, such as weights of networks, by gradient descent."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax import lax
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn.fitting.measurements import Measured
from jaxdyn.fitting.problem import pose
from jaxdyn.fitting.segments import Model
from jaxdyn.integrate.spans import MAX_STEPS
from jaxdyn.scene import Scene
from jaxdyn.solvers import Solver
from jaxdyn.status import Code, Ended

#: Relative tolerance of a step, far below the misfit of a network to data.
_RTOL = 1e-6
_RATE = 0.01  # learning rate of the default optimiser, that of many examples of Optax


class TrainingStatus(Code):
    """How a training ended; `TrainingStatus.DONE` is zero."""

    DONE = 0, "All steps were taken."
    NO_MOTION = (
        1,
        "A motion could not be computed, and the steps after that were not taken. The parameters "
        "are the best ones so far. Use an optimiser with a smaller learning rate.",
    )


class Spans(NamedTuple):
    """Short spans of the measured motion, each of which begins at a measured state.

    Attributes:
      starts: (m, k) states at which they begin.
      begin: (m,) their times.
      ts: (m, n) the n following times.
      values: (m, n, c) measured values at these times; 0 for gaps.
      weights: (m, n, c) weights of the squared misfits, 0 for gaps; their sum is 1.
    """

    starts: Array
    begin: Array
    ts: Array
    values: Array
    weights: Array


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Training(Ended):
    """The result of `train`.

    Attributes:
      params: the parameters with the smallest loss, or validation loss if there is one, in the
        structure of the guess.
      scene: the scene with these parameters, which starts at the first complete row of the data.
      losses: (steps + 1,) mean squared misfit, relative to the spread of each column, from that of
        the guess on; NaN for steps that were not taken.
      validation_losses: (steps + 1,) those of the held-out data, relative to the same spread; None
        without such data.
      outcome: how it ended.
    """

    params: Any
    scene: Scene
    losses: np.ndarray
    validation_losses: np.ndarray | None
    outcome: TrainingStatus

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            ("status", self.outcome.name),
            ("loss", _before_and_after(self.losses)),
            ("steps", f"{np.isfinite(self.losses).sum() - 1}"),
        ]
        if self.validation_losses is not None:
            rows.insert(2, ("validation loss", _before_and_after(self.validation_losses)))
        return _text.table(f"Training of {self.scene.name}", rows)

    _repr_html_ = _text.html


def _before_and_after(losses: np.ndarray) -> str:
    best = int(np.argmin(np.where(np.isnan(losses), np.inf, losses)))
    return f"{losses[0]:.4g} before, {losses[best]:.4g} after {best} steps"


def train(
    make: Callable[..., Scene],
    guess: Any,
    data: Any,
    *,
    steps: int = 1000,
    optimiser: optax.GradientTransformation | None = None,
    ahead: int = 1,
    columns: Sequence[str] | None = None,
    observe: Mapping[str, Callable] | None = None,
    validation: Any = None,
    rtol: float = _RTOL,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
) -> Training:
    """Parameters, such as weights of a network, that predict each measurement from the last one.

    The loss is the mean squared misfit over short spans, each of which begins at a measured state
    and ends some measurements later; so neither phase nor chaos creates local minima. Misfits are
    in parts of the standard deviation of their column. The loss is lowered by gradient descent,
    with derivatives through the steps of the motion (``adjoint="steps"`` of `solve`), the cost of
    which does not depend on the number of parameters. Unlike `fit`, which is accurate and gives
    error bars, it suits thousands of parameters that need not be determined one by one; noise at
    the beginning of a span, however, acts on its prediction.

    Args:
      make: function of the parameters that returns the scene; see `fit`.
      guess: initial values of the parameters; see `fit`. Whatever is not a number, such as the
        activation function of a network, stays as it is.
      data: times "t" and columns with every entry of the state; see `fit`. Further columns may be
        positions of points, or functions, see `observe`. A list has the measurements of several
        motions, with the same columns.
      steps: number of steps of the optimiser.
      optimiser: an optimiser of Optax; by default ``optax.adam(0.01)``.
      ahead: number of measurements that each span predicts.
      columns: the columns that are used; all by default.
      observe: further columns by name, functions (scene, t, y) -> () of a state y.
      validation: measurements that are not learned from, with the same columns, or a list of them:
        the parameters that predict these best are returned, instead of those that fit the noise of
        `data`.
      rtol: relative tolerance of a step.
      solver: see `simulate`.
      max_steps: largest number of steps of a span.
    Raises:
      ValueError: an entry of the state has no column, no row is complete, or an argument is out of
        range; see also `fit`.
    Limits: optimisers such as Adam change each number by about their learning rate in a step. A
      single number, such as a stiffness of 300 N/m, is measured in units of its guess, so that its
      unit does not matter, unless the guess is 0. The entries of arrays are not scaled, and should
      be of order one, as weights of networks are.
    Example:
      >>> import jaxdyn
      >>> from jaxdyn import scenes
      >>> swing = jaxdyn.simulate(scenes.pendulum(g=9.7), 4.0, samples=40)
      >>> found = jaxdyn.train(scenes.pendulum, {"g": 9.0}, swing, steps=200)
      >>> abs(found.params["g"] - 9.7) < 1e-4
      True
    """
    _checks.whole("steps", steps, 1)
    _checks.whole("ahead", ahead, 1)
    if optimiser is not None and not callable(getattr(optimiser, "update", None)):
        remedy = "For example optax.adam(0.01)."
        raise _checks.fail("optimiser", "one of Optax", type(optimiser).__name__, remedy)
    options = {"rtol": rtol, "solver": solver, "max_steps": max_steps, "adjoint": "steps"}
    first, *more = _motions("data", data)
    model, theta, scene, table, _ = pose(make, guess, first, columns, observe, options)

    def tables(motions):
        posed = (pose(make, guess, one, table.names, observe, options) for one in motions)
        return [one.table for one in posed]

    learned = [table, *tables(more)]
    spread = np.nanstd(np.concatenate([one.values for one in learned]), axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    spans, held_out = _spans("data", model, scene, learned, ahead, spread), None
    if validation is not None:
        others = tables(_motions("validation", validation))
        held_out = _spans("validation", model, scene, others, ahead, spread)
    optimiser = optax.adam(_RATE) if optimiser is None else optimiser
    units = _units(model, theta)
    best, losses, judged, lost = _descend(model, spans, held_out, theta, units, optimiser, steps)
    params = model.as_given(best)
    start = model.scene(best).starting(spans.starts[0])
    outcome = TrainingStatus.NO_MOTION if bool(lost) else TrainingStatus.DONE
    judged = None if held_out is None else np.asarray(judged)
    return Training(params, start, np.asarray(losses), judged, outcome)


def _units(model: Model, theta: Array) -> Array:
    """(p,) units of the parameters: the size of a single number, 1 for entries of arrays."""
    single = np.concatenate([np.full(math.prod(shape), shape == ()) for shape in model.shapes])
    return jnp.where(single & (theta != 0), jnp.abs(theta), 1.0)


def _motions(name: str, data: Any) -> list:
    """The measurements of each motion; `name` is the argument."""
    motions = list(data) if isinstance(data, list | tuple) else [data]
    if not motions:
        raise _checks.fail(name, "measurements of at least one motion", "none")
    return motions


def _spans(
    name: str, model: Model, scene: Scene, tables: list[Measured], ahead: int, spread: np.ndarray
) -> Spans:
    """The spans from all complete rows that enough rows follow, of data that an argument names.

    Misfits are relative to the spread (c,) of the columns.
    """
    of_entry = {column.entry: j for j, column in enumerate(model.columns)}
    names = [name for name, _ in scene.labels()]
    missing = [name for i, name in enumerate(names) if i not in of_entry]
    if missing:
        wanted, got = "a column for each entry of the state", f"none for {', '.join(missing)}"
        remedy = "Spans begin at measured states; jaxdyn.fit estimates what was not measured."
        raise _checks.fail(name, wanted, got, remedy)
    entries = [of_entry[i] for i in range(len(names))]
    parts = [_spans_of(table, entries, ahead) for table in tables]
    starts, begin, ts, values, there = (np.concatenate(x) for x in zip(*parts, strict=True))
    if not there.any():
        wanted = f"a complete row with {ahead} more after it"
        rows = sum(len(table.ts) for table in tables)
        raise _checks.fail(name, wanted, f"{rows} rows without one", "Lower ahead=.")
    weights = there / spread**2 / there.sum()
    return Spans(*map(jnp.asarray, (starts, begin, ts, np.where(there, values, 0.0), weights)))


def _spans_of(table: Measured, entries: list[int], ahead: int) -> tuple[np.ndarray, ...]:
    """Starts, their times, later times, values there, and whether these are known, of a table."""
    known = np.isfinite(table.values)
    first = np.flatnonzero(known[:, entries].all(axis=1))
    first = first[first + ahead < len(table.ts)]
    after = first[:, None] + np.arange(1, ahead + 1)
    starts = table.values[first][:, entries]
    return starts, table.ts[first], table.ts[after], table.values[after], known[after]


@eqx.filter_jit
def _descend(
    model: Model,
    spans: Spans,
    held_out: Spans | None,
    theta: Array,
    units: Array,
    optimiser: optax.GradientTransformation,
    steps: int,
) -> tuple[Array, Array, Array, Array]:
    """The best parameters, two rows (steps + 1,) of losses, and whether one was not finite.

    The second row has the losses of the spans held out for validation, by which the parameters are
    chosen; without such spans it is the first.
    """

    def loss(scaled: Array, spans: Spans) -> Array:
        theta = units * scaled

        def of_span(start, begin, ts, values, weights):
            seen, _ = model.run(theta, start, begin, ts[-1], ts)
            return jnp.sum(weights * model.misfit(seen, values) ** 2)

        return jnp.sum(jax.vmap(of_span)(*spans))

    def step(carry, _):
        scaled, state, best, least, lost = carry
        value, slope = jax.value_and_grad(loss)(scaled, spans)
        judged = value if held_out is None else loss(scaled, held_out)
        lost = lost | ~(jnp.isfinite(value + judged) & jnp.isfinite(slope).all())
        better = judged < least
        best = jnp.where(better, scaled, best)
        with jax.numpy_dtype_promotion("standard"):  # Optax mixes floats and whole numbers
            change, new = optimiser.update(slope, state, scaled)
        following = jax.tree.map(
            lambda old, new: jnp.where(lost, old, new), (scaled, state), (scaled + change, new)
        )
        losses = jnp.where(lost, jnp.nan, jnp.stack([value, judged]))
        return (*following, best, jnp.where(better, judged, least), lost), losses

    start = theta / units
    first = (start, optimiser.init(start), start, jnp.asarray(jnp.inf), jnp.asarray(False))
    (_, _, best, _, lost), losses = lax.scan(step, first, None, length=steps + 1)
    return units * best, losses[:, 0], losses[:, 1], lost
