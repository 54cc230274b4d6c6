"""Descent on the closing error, from a rough guess until Newton's method converges.

Newton's method, however damped, stops at local minima of the closing error |F|, and from a rough
guess it often ends at a trivial solution (a period of zero, a state of rest), which closes too.
Here the error is measured against the path L = T |f(y0)| that the motion covers,

    e(x) = |F(x)| (1 / L(x) + 1 / L(x_guess)),

which does not vanish at rest, nor decrease with a longer period. It is minimised by Adam (optax),
whose momentum passes through shallow minima, with the exact gradient J^T F, from the same
variational equations as Newton's Jacobian J. Descent loses half of the digits, so it only provides
the guess for Newton's method.

In several segments descent reaches small errors more often, but mostly at motions whose segments do
not join; so it works in one segment.
"""

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import lazy_loader
import numpy as np
from jaxtyping import Array

from orbits.orbit import Orbit, Outcome
from orbits.shooting.equations import Equations, InUnits
from orbits.shooting.multiple import Automatic, Shooting
from orbits.shooting.newton import Iteration
from orbits.shooting.outcomes import orbit_at
from orbits.shooting.strategy import Effort, Search, Strategy

#: Its import takes as long as a search from a good guess, which does not need it.
optax: Any = lazy_loader.load("optax")

_STEPS_MOST = 500
#: Length of the first steps, in units of the size of each unknown.
_RATE = 0.02
#: Error at which the descent ends, since Newton's method converges from there almost always.
_ARRIVED = 1e-3
#: Error up to which Newton's method may converge; from larger ones it mostly meets collisions.
_NEAR = 0.1
#: Steps within which the least error must decrease by a factor unless it is below `_NEAR`; else the
#: descent has stalled. Near an orbit the error oscillates until the scheduled steps get shorter.
_PATIENCE, _PROGRESS = 100, 0.9
_FIRST = 0.5  # share of the time for the descent; the rest is for a search from the guess
_RTOL = 1e-8
_MAX_STEPS = 5000  # steps of one motion; more would mean that it is close to a collision


@dataclasses.dataclass(frozen=True)
class Descent(Strategy):
    """Descent on the closing error (optax, Adam) from a rough guess, before Newton's method.

    It takes half of the time at most; where it fails, the default strategy begins at the guess.
    """

    def orbit(self, search: Search) -> Orbit:
        """The orbit near the end of the descent, or near the guess, or the best iterate."""
        effort = search.effort.share(_FIRST)
        orbit = _orbit_after_descent(dataclasses.replace(search, effort=effort))
        if orbit.ok or search.effort.over:
            return orbit
        # The descent may have left an orbit that is near the guess.
        plain = Automatic().orbit(search)
        return plain if plain.ok else orbit


def _orbit_after_descent(search: Search) -> Orbit:
    problem, equations, effort = search.problem, search.equations, search.effort
    guess = problem.guess
    lower, upper = equations.bounds(problem.lower, problem.upper)
    if problem.driven:  # Adam would move the period however little the error depends on it
        lower[-1] = upper[-1] = guess[-1]
    effort.begin("a descent on the closing error")
    x = equations.spread(guess[:-1], guess[-1], effort.rtol, angle=search.angle)
    end = descend(equations, x, lower=lower, upper=upper, effort=effort)
    if not end.near:
        return orbit_at(equations, end.x, end.residual, Outcome.DESCENT_ENDED, rtol=effort.rtol)
    orbit = Shooting().orbit(search.at(equations, end.x))
    if orbit.ok or end.arrived:
        return orbit
    return dataclasses.replace(orbit, outcome=Outcome.DESCENT_ENDED)


@dataclasses.dataclass(frozen=True)
class DescentResult:
    """Where a descent ended.

    Attributes:
      x: (n,) unknowns with the smallest error.
      residual: () largest entry of the closing error there.
      near: whether the error is so small that Newton's method may converge.
      arrived: whether it is so small that Newton's method converges almost always.
    """

    x: np.ndarray
    residual: float
    near: bool
    arrived: bool


def descend(
    equations: Equations,
    x: np.ndarray,
    *,
    lower: np.ndarray,
    upper: np.ndarray,
    effort: Effort,
) -> DescentResult:
    """The point to which descent on the closing error leads.

    Args:
      equations: the closing equations and conditions, in one segment.
      x: (n,) the guess.
      lower: (n,) bounds of x.
      upper: (n,) bounds of x.
      effort: the limit of time, and the function that is called with each step.
    """
    closed = InUnits(equations, x, _RTOL, effort.limits(_MAX_STEPS))
    units, entry_sizes = closed.units.x, closed.sizes
    path, _ = _path(jnp.asarray(x), equations, entry_sizes)
    lengths = np.append(units[:-1], x[-1])  # the period in units of itself
    state = _adam().init(jnp.asarray(x))
    best, best_residual, least, step = x, np.nan, np.inf, 0.0
    mark, marked = np.inf, 0
    for index in range(_STEPS_MOST):
        residual, jacobian = closed(x)
        by_x = _path(jnp.asarray(x), equations, entry_sizes)
        error, gradient = _error(residual, jacobian, by_x, float(path), units)
        if not (np.isfinite(error) and np.isfinite(gradient).all()):  # a collision
            break
        largest = float(np.abs(residual).max(initial=0.0))
        effort.report(Iteration(index=index, residual=largest, period=float(x[-1]), step=step))
        if error < least:
            best, best_residual, least = x, largest, error
        if least < _PROGRESS * mark:
            mark, marked = least, index
        patient = least <= _NEAR or index - marked < _PATIENCE
        if error <= _ARRIVED or not patient or effort.over:
            break
        moves, state = _adam_moves(jnp.asarray(gradient), state)
        new = np.clip(x + np.asarray(moves) * lengths, lower, upper)
        step, x = float(np.linalg.norm((new - x) / units)), new
    return DescentResult(
        x=best,
        residual=best_residual,
        near=bool(least <= _NEAR),
        arrived=bool(least <= _ARRIVED),
    )


def _error(
    residual: np.ndarray, jacobian: np.ndarray, now, path: float, units: np.ndarray
) -> tuple[float, np.ndarray]:
    """e(x) and its gradient (n,) in the units; `now` is the path at x and its gradient."""
    here, by_x = np.asarray(now[0]), np.asarray(now[1]) * units
    norm = float(np.linalg.norm(residual))
    per_path = 1 / float(here) + 1 / path
    gradient = residual @ jacobian / max(norm, 1e-300) * per_path - norm * by_x / float(here) ** 2
    return norm * per_path, gradient


@jax.jit
@jax.value_and_grad
def _path(x: Array, equations: Equations, entry_sizes: Array) -> Array:
    """() the path that the rate at the start would cover, in sizes (k,); and its gradient (n,)."""
    scene = equations.scene_at(equations.unpack(x).parameter)
    rate = scene.rate(jnp.zeros(()), equations.start(x))
    return x[-1] * jnp.linalg.norm(rate / entry_sizes)


@functools.cache
def _adam() -> Any:
    return optax.adam(optax.cosine_decay_schedule(_RATE, _STEPS_MOST))


@jax.jit
def _adam_moves(gradient: Array, state) -> tuple[Array, Any]:
    with jax.numpy_dtype_promotion("standard"):  # optax multiplies floats by an integer count
        moves, state = _adam().update(gradient, state)
    return jnp.asarray(moves), state
