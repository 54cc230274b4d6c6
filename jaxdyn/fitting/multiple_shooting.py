"""Least squares over parameters and initial states of all segments, with continuity constraints.

Each iteration linearises all segments at once, compresses the rows of each by an orthogonal
factorisation, and takes the Gauss-Newton step within the null space of the constraints, damped as
in the Levenberg-Marquardt method. In this null space perturbations do not grow with the motion, so
that nothing overflows where it is chaotic, and the singular values show which parameters the data
determine. A step is accepted if it lowers an exact penalty function, which is the misfit plus the
violation of the constraints with weights above their multipliers.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array

from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.fitting.measurements import Column
from jaxdyn.fitting.segments import Model, Segments
from jaxdyn.scales import Groups, groups

#: Directions with singular values below this fraction of the largest are undetermined:
#: derivatives of a motion at the default tolerance are accurate to about 1e-9.
UNDETERMINED = 1e-7
#: Damping, relative to the largest singular value: at first, its factors after a failed and after a
#: successful step, and the value below which it is 0.
_FIRST, _MORE, _LESS, _NONE = 1e-3, 10.0, 0.1, 1e-10
_MOST_DAMPING = 1e12
#: A step is small below this many standard errors, or this part of the sizes of all unknowns.
_OF_A_BAR, _OF_SIZE = 1e-4, 1e-9
_CLOSED = 1e-7  # relative to the sizes: largest violation of a constraint in a solution
_ITERATIONS = 100
#: Relative to the spread of a column: the noise that is assumed until residuals are known.
_FIRST_NOISE = 0.05
_ROUNDS = 5  # rounds in which the noise of several columns is estimated from residuals
_FILTER = 8  # steps for the initial state of each segment in turn
_RELATIVE_NOISE = 1e-12  # relative to the size of a column: the smallest noise
#: Relative to the spread of columns: an effect of a parameter up to this may be rounding.
_NO_EFFECT = 1e-13


class Unknowns(NamedTuple):
    """Parameters (p,) and the initial states (m, k) of all segments."""

    theta: Array
    nodes: Array


class Linear(NamedTuple):
    """The problem over all segments, linearised at some unknowns.

    Attributes:
      cost: () half the sum of squares of whitened residuals.
      rows: (m, q + 1, q + 1) compressed derivatives and residuals of each; q = p + k.
      violation: (r,) violation of the constraints, relative to sizes.
      constraints: (r, p + m k) their derivatives with respect to the scaled unknowns.
      residuals: (m, n, c) computed minus measured values.
    """

    cost: Array
    rows: Array
    violation: Array
    constraints: Array
    residuals: Array


class Solution(NamedTuple):
    """The best unknowns and what is known about them.

    Attributes:
      x: the unknowns.
      sizes: (p + m k,) their sizes.
      factor: (p + m k, q) a factor F of their covariance F F^T.
      singular: (q,) singular values of the misfit in the null space, in scaled unknowns.
      directions: (p + m k, q) their directions, in scaled unknowns.
      noise: (c,) standard deviation of each column if it was estimated, 1 if it was given.
      residuals: (m, n, c) computed minus measured values.
      cost: () half the sum of squares of whitened residuals.
      iterations: () number of steps.
      converged: () whether the last step was small.
    """

    x: Unknowns
    sizes: Array
    factor: Array
    singular: Array
    directions: Array
    noise: Array
    residuals: Array
    cost: Array
    iterations: Array
    converged: Array


def estimate(
    model: Model,
    segments: Segments,
    sigma: Array | None,
    theta: Array,
    start: Array,
    pin: Array | None = None,
    known: tuple[Array, Array] | None = None,
    zeros: bool = False,
) -> Solution:
    """The best fit from a guess.

    Args:
      model: the model that is fitted.
      segments: the measurements.
      sigma: (m, n, c) standard deviations; None to estimate one for each column.
      theta: (p,) guess of the parameters.
      start: (k,) guess of the start.
      pin: (p,) weights of a combination of parameters, relative to their sizes, that is held fixed;
        None for none.
      known: (m, k) initial states of the segments and (k,) sizes of the entries, if they are known.
      zeros: whether a parameter may be 0 in the guess, which does not show its size.
    """
    system, c = model.scene(theta).system, len(model.columns)
    group = groups(system)
    counts = jnp.maximum(jnp.sum(segments.there, (0, 1)), 1.0)
    spread = _spread(segments, counts)
    noise = jnp.ones(c) if sigma is not None else _FIRST_NOISE * spread
    given = jnp.ones_like(segments.values) if sigma is None else sigma
    weights = segments.there / given
    first = weights / noise[None, None]
    nodes, sizes = known or _filter_starts(group, model, segments, first, theta, start)
    p = theta.shape[0]
    unknown = _sizes_by_effect(model, segments, first, spread, theta, nodes) if zeros else 1.0
    parameter_sizes = jnp.where(theta != 0, jnp.abs(theta), unknown)
    everything = jnp.concatenate([parameter_sizes, jnp.tile(sizes, len(nodes))])
    q = p + sum(model.free)
    dof_share = jnp.maximum(1.0 - q / jnp.maximum(jnp.sum(counts), q + 1.0), 0.05)

    def one(carry, _):
        x, noise = carry
        linear, x, iterations, converged = _minimum(
            model, segments, weights / noise[None, None], x, everything, sizes, pin
        )
        square = jnp.sum((linear.residuals * segments.there / given) ** 2, (0, 1))
        seen = jnp.sqrt(square / (counts * dof_share))
        new = noise if sigma is not None else jnp.maximum(seen, _RELATIVE_NOISE * spread)
        return (x, new), (linear, noise, iterations, converged)

    rounds = 1 if sigma is not None else 2 if c == 1 else _ROUNDS
    (x, _), history = lax.scan(one, (Unknowns(theta, nodes), noise), None, length=rounds)
    linear, noise, _, converged = jax.tree.map(lambda a: a[-1], history)
    step = _Step(linear, p, nodes.shape, jnp.zeros(()))
    kept = step.singular > UNDETERMINED * jnp.max(step.singular, initial=0.0)
    inverse = jnp.where(kept, 1.0 / jnp.where(kept, step.singular, 1.0), 0.0)
    return Solution(
        x=x,
        sizes=everything,
        factor=everything[:, None] * step.directions * inverse[None],
        singular=step.singular,
        directions=step.directions,
        noise=noise,
        residuals=linear.residuals,
        cost=linear.cost,
        iterations=jnp.sum(history[2]),
        converged=converged,
    )


def _sizes_by_effect(
    model: Model, segments: Segments, weights: Array, spread: Array, theta: Array, nodes: Array
) -> Array:
    """(p,) changes of the parameters that change the columns by about their spread; else 1."""

    def seen(theta):
        def one(start, segment, weight):
            values, _ = model.run(theta, start, segment.begin, segment.end, segment.ts)
            return values * weight

        return jax.vmap(one)(nodes, segments, weights)

    effect = jnp.sqrt(jnp.sum(jax.jacfwd(seen)(theta) ** 2, (0, 1, 2)))
    wanted = jnp.sqrt(jnp.sum((weights * spread[None, None]) ** 2))
    known = jnp.isfinite(effect) & (effect > _NO_EFFECT * wanted)
    return jnp.where(known, wanted / jnp.where(known, effect, 1.0), 1.0)


def _spread(segments: Segments, counts: Array) -> Array:
    """(c,) standard deviation of each column; its size where all values are the same."""
    mean = jnp.sum(segments.values * segments.there, (0, 1)) / counts
    off = (segments.values - mean[None, None]) * segments.there
    spread = jnp.sqrt(jnp.sum(off**2, (0, 1)) / counts)
    return jnp.where(spread > 0, spread, jnp.where(mean != 0, jnp.abs(mean), 1.0))


def _first_sizes(group: Groups, model: Model, segments: Segments, start: Array) -> Array:
    """(k,) sizes of the entries of the state, from the guess and from columns that are entries."""
    most = jnp.max(jnp.abs(segments.values), (0, 1))
    rows = [
        jnp.max(
            jnp.stack([jnp.abs(s), *(most[j] for j, c in enumerate(model.columns) if c.entry == i)])
        )
        for i, s in enumerate(start)
    ]
    sizes = group.sizes(jnp.stack(rows))
    return jnp.where(sizes > 0, sizes, 1.0)


def _filter_starts(
    group: Groups, model: Model, segments: Segments, weights: Array, theta: Array, start: Array
) -> tuple[Array, Array]:
    """(m, k) initial states of the segments, one after another, and (k,) sizes of the entries.

    The parameters are those of the guess. Each state is fitted to the data of its segment,
    beginning at the end of the previous segment, which also serves as a weak prior for what the
    data do not determine. The sizes are those that the motion reaches.
    """
    sizes = _first_sizes(group, model, segments, start)
    c, k = len(model.columns), start.shape[0]
    every = (*model.columns, *(Column("", entry=i) for i in range(k)))

    def of_segment(predicted, one):
        segment, weight = one

        def rows(z):
            begin = predicted + z * sizes
            seen, end = model.run(theta, begin, segment.begin, segment.end, segment.ts, every)
            d = model.misfit(seen[:, :c], segment.values) * weight
            states = jnp.concatenate([begin[None], seen[:, c:], end[None]])
            return jnp.concatenate([d.ravel(), z]), (end, jnp.max(jnp.abs(states), axis=0))

        def improved(carry, _):
            z, trial, best, damping, gram, slope, ended = carry
            jacobian, (value, there) = jax.jacfwd(lambda z: (rows(z)[0], rows(z)), has_aux=True)(
                trial
            )
            cost = 0.5 * jnp.sum(value**2)
            better = cost < best  # False for NaN
            z = jnp.where(better, trial, z)
            best = jnp.where(better, cost, best)
            gram = jnp.where(better, jacobian.T @ jacobian, gram)
            slope = jnp.where(better, jacobian.T @ value, slope)
            ended = jax.tree.map(lambda new, old: jnp.where(better, new, old), there, ended)
            damping = damping * jnp.where(better, _LESS, _MORE)
            damped = gram + jnp.diag(damping * jnp.diag(gram))
            return (z, z - jnp.linalg.solve(damped, slope), best, damping, gram, slope, ended), None

        zero = jnp.zeros(k)
        first = (zero, zero, jnp.inf, jnp.asarray(1e-2), jnp.eye(k), zero)
        first = (*first, (predicted, jnp.abs(predicted)))
        (z, _, _, _, _, _, (end, reach)), _ = lax.scan(improved, first, None, length=_FILTER)
        return end, (predicted + z * sizes, reach)

    nodes, reach = lax.scan(of_segment, start, (segments, weights))[1]
    reached = group.sizes(jnp.max(reach, axis=0))
    return nodes, jnp.where(reached > 0, reached, 1.0)


def _linear(
    model: Model, segments: Segments, weights: Array, x: Unknowns, sizes: Array, k_sizes: Array, pin
) -> Linear:
    p, (m, k) = x.theta.shape[0], x.nodes.shape
    q = p + k
    scene = model.scene(x.theta)

    def of_segment(start, segment, weight):
        def rows(z):
            seen, end = model.run(z[:p], z[p:], segment.begin, segment.end, segment.ts)
            d = model.misfit(seen, segment.values)
            return jnp.concatenate([(d * weight).ravel(), end]), (d, end)

        def both(z):
            value, (d, end) = rows(z)
            return value, (value, d, end)

        z = jnp.concatenate([x.theta, start])
        jacobian, (value, d, end) = jax.jacfwd(both, has_aux=True)(z)
        jacobian = jacobian * jnp.concatenate([sizes[:p], k_sizes])[None]
        measured = jnp.concatenate([jacobian[:-k], value[:-k, None]], axis=1)
        square = jnp.concatenate([measured, jnp.zeros((q + 1, q + 1))])
        rows_ = jnp.linalg.qr(square, mode="r")
        return rows_, jacobian[-k:] / k_sizes[:, None], d, end, 0.5 * jnp.sum(value[:-k] ** 2)

    rows, ends_by, d, ends, costs = jax.vmap(of_segment)(x.nodes, segments, weights)
    fixed = np.flatnonzero(~np.array(model.free))
    parts, violations = [], []
    if len(fixed):
        start, start_by = value_and_jacfwd(lambda theta: model.scene(theta).y0)(x.theta)
        gap = scene.system.difference(x.nodes[0], start)[fixed] / k_sizes[fixed]
        row = jnp.zeros((len(fixed), p + m * k))
        row = row.at[:, :p].set(-start_by[fixed] * sizes[None, :p] / k_sizes[fixed][:, None])
        parts.append(row.at[np.arange(len(fixed)), p + fixed].set(1.0))
        violations.append(gap)
    if m > 1:
        gap = jax.vmap(scene.system.difference)(x.nodes[1:], ends[:-1]) / k_sizes[None]
        here, after = np.eye(m)[:-1], np.eye(m)[1:]
        row = after[:, None, :, None] * np.eye(k)[None, :, None, :]
        row = row - here[:, None, :, None] * ends_by[:-1, :, None, p:]
        row = jnp.concatenate([-ends_by[:-1, :, :p], row.reshape(m - 1, k, m * k)], axis=2)
        parts.append(row.reshape((m - 1) * k, p + m * k))
        violations.append(gap.ravel())
    if pin is not None:
        parts.append(jnp.concatenate([pin, jnp.zeros(m * k)])[None])
        violations.append(jnp.zeros(1))
    none = jnp.zeros((0, p + m * k))
    return Linear(
        cost=jnp.sum(costs),
        rows=rows,
        violation=jnp.concatenate([jnp.zeros(0), *violations]),
        constraints=jnp.concatenate([none, *parts]),
        residuals=d,
    )


class _Step:
    """The damped Gauss-Newton step within the constraints, in scaled unknowns."""

    def __init__(self, linear: Linear, p: int, shape: tuple[int, int], damping: Array):
        m, k = shape
        q, total, r = p + k, p + m * k, linear.violation.shape[0]
        by_node = linear.rows[:, :, None, p:q] * np.eye(m)[:, None, :, None]
        a = jnp.concatenate([linear.rows[:, :, :p], by_node.reshape(m, q + 1, m * k)], axis=2)
        a, b = a.reshape(m * (q + 1), total), -linear.rows[:, :, q].ravel()
        basis, triangle = jnp.linalg.qr(linear.constraints.T, mode="complete")
        along, self.null = basis[:, :r], basis[:, r:]
        triangle = triangle[:r]
        # A damped step also closes the gaps only partially.
        wanted = -linear.violation / (1.0 + damping)
        fixed = along @ solve_triangular(triangle, wanted, trans="T") if r else jnp.zeros(total)
        left = b - a @ fixed
        u, self.singular, v = jnp.linalg.svd(a @ self.null, full_matrices=False)
        self.directions = self.null @ v.T
        seen = u.T @ left
        top = jnp.max(self.singular, initial=0.0)
        kept = self.singular > UNDETERMINED * top
        squares = self.singular**2 + damping * top**2
        z = jnp.where(kept, self.singular * seen / jnp.where(kept, squares, 1.0), 0.0)
        self.x = fixed + self.directions @ z
        self.bars = jnp.linalg.norm(jnp.where(kept, seen, 0.0))
        gradient = along.T @ (a.T @ (a @ self.x - b))
        multipliers = solve_triangular(triangle, gradient) if r else jnp.zeros(0)
        self.weight = jnp.max(jnp.abs(multipliers), initial=0.0)


class _Carry(NamedTuple):
    x: Unknowns
    linear: Linear
    damping: Array
    weight: Array
    count: Array
    done: Array


def _next_damping(damping: Array, better: Array) -> Array:
    """() smaller after a step that improved the fit, down to 0, larger after one that did not."""
    less = jnp.where(damping * _LESS < _NONE, 0.0, damping * _LESS)
    return jnp.where(better, less, jnp.maximum(damping, _FIRST) * _MORE)


def _minimum(
    model: Model,
    segments: Segments,
    weights: Array,
    x: Unknowns,
    sizes: Array,
    k_sizes: Array,
    pin: Array | None,
) -> tuple[Linear, Unknowns, Array, Array]:
    """The linearised problem at the minimum, its unknowns, the steps, and whether it converged."""
    p, shape = x.theta.shape[0], x.nodes.shape
    measured = jnp.maximum(jnp.sum(segments.there), 1.0)
    blank = jax.eval_shape(lambda: _linear(model, segments, weights, x, sizes, k_sizes, pin))
    blank = jax.tree.map(lambda a: jnp.zeros(a.shape), blank)
    first = _Carry(
        x=x,
        linear=blank,
        damping=jnp.asarray(_FIRST),
        weight=jnp.zeros(()),
        count=jnp.asarray(0),
        done=jnp.asarray(False),
    )

    def body(carry: _Carry) -> _Carry:
        begun = carry.count > 0
        step = _Step(carry.linear, p, shape, carry.damping)
        change = jnp.where(begun, step.x, 0.0)
        x = Unknowns(
            carry.x.theta + change[:p] * sizes[:p],
            carry.x.nodes + (change[p:] * sizes[p:]).reshape(shape),
        )
        linear = _linear(model, segments, weights, x, sizes, k_sizes, pin)
        weight = jnp.where(begun, jnp.maximum(carry.weight, 2.0 * step.weight), 0.0)

        def merit(at: Linear) -> Array:
            return at.cost + weight * jnp.sum(jnp.abs(at.violation))

        better = ~begun | (merit(linear) < merit(carry.linear))
        rms = jnp.sqrt(2.0 * carry.linear.cost / measured)
        largest = jnp.max(jnp.abs(change))
        small = (step.bars <= _OF_A_BAR * rms) | (largest <= _OF_SIZE)
        closed = jnp.max(jnp.abs(carry.linear.violation), initial=0.0) <= _CLOSED
        damping = _next_damping(carry.damping, better)
        stuck = damping > _MOST_DAMPING
        chosen = jax.tree.map(
            lambda new, old: jnp.where(better, new, old), (x, linear), (carry.x, carry.linear)
        )
        return _Carry(
            *chosen,
            damping=jnp.where(begun, damping, carry.damping),
            weight=weight,
            count=carry.count + 1,
            done=begun & ((small & closed) | stuck),
        )

    def going(carry: _Carry) -> Array:
        return ~carry.done & (carry.count < _ITERATIONS)

    end = lax.while_loop(going, body, first)
    closed = jnp.max(jnp.abs(end.linear.violation), initial=0.0) <= _CLOSED
    return end.linear, end.x, end.count, end.done & closed & (end.damping <= _MOST_DAMPING)
