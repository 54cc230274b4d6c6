"""Find a periodic orbit near a guess: shooting with Newton's method.

The unknowns are the start and the period; with several segments also the states in between,
each integrated by itself, so that an unstable orbit's errors do not grow over a whole period.
The residual is what does not close, its Jacobian comes from the variational equations.
"""

import functools
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import array, fail, positive
from jaxdyn.simulate import solve, tolerances
from orbits import newton
from orbits.problem import PLAIN, Closing, Orbit, Outcome, SearchError

RTOL = 1e-14
GOAL = 1e-12
_SYMMETRIC = 1e-9  # relative: how exactly a closing condition keeps the vector field
_ESCAPE = 100.0  # times the guess's size is a run-away
_TRIVIAL = 0.02  # of the guessed period, or of its path length, is a trivial solution


def find(
    scene: Scene,
    y0=None,
    period=None,
    *,
    lower=None,
    upper=None,
    closing: Closing | Sequence[Closing] = PLAIN,
    segments: int = 1,
    goal: float = GOAL,
    rtol: float = RTOL,
    max_iterations: int = 60,
    report: Callable[[newton.Iteration], None] = lambda iteration: None,
    throw: bool = True,
) -> Orbit:
    """The periodic orbit near a guess.

    Args:
      scene: what moves.
      y0: (k,) guess of the start; the scene's own if left out.
      period: () guess of the full period; the scene's own span if left out.
      lower: (k + 1,) lower bounds of the start and the period; -inf where there is none.
      upper: (k + 1,) upper bounds.
      closing: what must hold after which part of the period; of several, the one that the
        guess misses least.
      segments: pieces integrated by themselves (multiple shooting).
      goal: largest closing error that counts as an orbit.
      rtol: tolerance of the integrations.
      max_iterations: Newton steps at most.
      report: called with an `Iteration` after each step.
      throw: raise if no orbit was found; with False look at `Orbit.outcome`.
    Returns:
      The orbit, or with ``throw=False`` the best iterate and the reason.
    Raises:
      ValueError: numbers that make no sense.
      SearchError: no orbit was found (``throw=True``).
    Limits: the system's coordinates must close by themselves; host only, not inside jit.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
      >>> round(eight.period, 6)
      6.325914
    """
    closings = (closing,) if isinstance(closing, Closing) else tuple(closing)
    guess, lower, upper = checked(scene, y0, period, lower, upper, closings, segments)
    positive("goal", goal, "It is the largest closing error of an orbit.")
    tolerances(rtol, None)  # refuses what is none; inside jit it could not
    closing = _nearest(scene, guess, closings, rtol)
    equations = _Equations(scene, closing, segments, rtol)
    x = equations.spread(guess)
    low, high = equations.bounds(lower, upper)

    def keep_going(x: np.ndarray) -> bool:
        return _trouble(scene, x, guess) is None

    result = newton.solve(
        equations,
        x,
        lower=low,
        upper=high,
        goal=goal,
        max_iterations=max_iterations,
        keep_going=keep_going,
        report=report,
    )
    outcome = _outcome(scene, result, guess)
    if throw and outcome != Outcome.FOUND:
        raise SearchError(outcome.message)
    k = len(guess) - 1
    found = scene.starting(result.x[:k], result.x[-1])
    residual = float(np.max(np.abs(result.residual)))
    return Orbit(found, closing, residual, outcome, result.iterations, rtol)


class _Equations:
    """x = (states at the starts of the segments, period) -> closing residual and Jacobian."""

    def __init__(self, scene: Scene, closing: Closing, segments: int, rtol: float):
        self.scene, self.closing = scene, closing
        self.segments, self.rtol = segments, rtol

    def spread(self, guess: np.ndarray) -> np.ndarray:
        """The unknowns that go with a start and a period."""
        if self.segments == 1:
            return guess
        part = guess[-1] / self.closing.parts
        ts = np.arange(self.segments) * part / self.segments
        flow = solve(self.scene.starting(guess[:-1]), part, ts=ts, rtol=self.rtol)
        return np.append(np.asarray(flow.ys).ravel(), guess[-1])

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bounds on the start and the period; the states in between are free."""
        between = (self.segments - 1) * (len(lower) - 1)

        def with_free(b: np.ndarray, free: float) -> np.ndarray:
            return np.concatenate([b[:-1], np.full(between, free), b[-1:]])

        return with_free(lower, -np.inf), with_free(upper, np.inf)

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if x[-1] <= 0:
            m = self.segments * len(self.scene.y0)
            return np.full(m, np.nan), np.full((m, len(x)), np.nan)
        residual, jacobian = _closing_error(
            self.scene, self.closing, x, self.rtol, segments=self.segments
        )
        return np.asarray(residual), np.asarray(jacobian)


@functools.partial(jax.jit, static_argnames="segments")
def _closing_error(scene, closing, x, rtol, *, segments) -> tuple[Array, Array]:
    def residual(x):
        states, period = x[:-1].reshape(segments, -1), x[-1]
        span = period / (closing.parts * segments)
        # One after the other, each with its own steps; a loop compiles once for all of them.
        ends = jax.lax.map(lambda y: solve(scene.starting(y), span, rtol=rtol).y1, states)
        targets = [*states[1:], closing.act(states[0])]
        errors = [scene.system.difference(*pair) for pair in zip(ends, targets, strict=True)]
        return (jnp.concatenate(errors),) * 2

    jacobian, value = jax.jacfwd(residual, has_aux=True)(x)
    return value, jacobian


def checked(
    scene: Scene, y0=None, period=None, lower=None, upper=None, closings=(PLAIN,), segments=1
):
    """The guess (k + 1,) within its bounds, and both bounds; arguments as for `find`.

    Raises:
      ValueError: numbers that make no sense.
    """
    scene = scene if y0 is None else scene.starting(y0)
    scene.check()
    k = len(scene.y0)
    if not closings:
        raise fail("closing", "at least one closing condition", "none")
    for closing in closings:
        closing.check(k)
        _check_symmetry(scene, closing)
    if segments < 1:
        raise fail("segments", "at least 1", segments)
    period = positive("period", scene.t1 if period is None else period, "It is a time.")
    array("period", period, (), "It is one time.")
    guess = np.append(np.asarray(scene.y0), float(period))
    remedy = f"One entry for each of the {k} of the start, then one for the period."
    low = np.full(k + 1, -np.inf) if lower is None else _bound("lower", lower, k, remedy)
    high = np.full(k + 1, np.inf) if upper is None else _bound("upper", upper, k, remedy)
    if (low > high).any():
        i = int(np.argmax(low > high))
        raise fail("lower", f"<= upper = {high[i]} at index {i}", low[i], "Swap them?")
    if not high[-1] > 0:
        raise fail("upper", "a positive last entry, for the period", high[-1])
    _check_time(scene, low[-1] == high[-1], np.clip(float(period), low[-1], high[-1]))
    clipped = np.clip(guess, low, high)
    if not (np.isfinite(clipped).all() and clipped[-1] > 0):
        raise fail("bounds", "some finite numbers between them", f"{clipped} nearest to the guess")
    return clipped, low, high


def _check_time(scene: Scene, fixed: bool, period: float) -> None:
    # Where the rate depends on time, coming back is not enough: the drive must come back too.
    ts = period * np.array([0.0, 0.13, 0.37, 0.71])
    rates = [np.asarray(scene.rate(jnp.asarray(t), scene.y0)) for t in ts]
    if all(np.array_equal(rates[0], rate, equal_nan=True) for rate in rates):
        return
    later = [np.asarray(scene.rate(jnp.asarray(t + period), scene.y0)) for t in ts]
    size = max(float(np.abs(rate).max()) for rate in rates)
    repeats = all(
        np.abs(a - b).max() <= _SYMMETRIC * size for a, b in zip(rates, later, strict=True)
    )
    if not (fixed and repeats):
        raise fail(
            "period",
            "a fixed multiple of the drive's, since the rate depends on time",
            f"{'a drive that does not repeat after ' if fixed else 'a free period near '}{period}",
            "Set the last entries of lower and upper to that period.",
        )


def _check_symmetry(scene: Scene, closing: Closing) -> None:
    # Without the symmetry the motion after the first part is another one: it would not close.
    if closing.places is None:
        return
    t = jnp.zeros(())
    there, here = scene.rate(t, closing.act(scene.y0)), closing.act(scene.rate(t, scene.y0))
    if not float(jnp.abs(there - here).max()) <= _SYMMETRIC * float(jnp.abs(here).max()):
        raise fail(
            "closing",
            "a symmetry of the scene",
            f"{closing.name!r}, which changes its forces",
            "Bodies that take each other's places need equal masses.",
        )


def _nearest(scene: Scene, guess: np.ndarray, closings: tuple[Closing, ...], rtol) -> Closing:
    if len(closings) == 1:
        return closings[0]

    def miss(closing: Closing) -> float:
        y0 = jnp.asarray(guess[:-1])
        end = solve(scene.starting(y0), guess[-1] / closing.parts, rtol=rtol).y1
        error = float(jnp.linalg.norm(scene.system.difference(end, closing.act(y0))))
        return error if np.isfinite(error) else np.inf

    return min(closings, key=miss)


def _bound(name, value, k, remedy):
    value = np.asarray(value, dtype=float)
    if value.shape != (k + 1,):
        raise fail(name, f"shape ({k + 1},)", f"shape {value.shape}", remedy)
    if np.isnan(value).any():
        raise fail(name, "numbers", "NaN", "Use -inf or inf where there is no bound.")
    return value


def _trouble(scene: Scene, x: np.ndarray, guess: np.ndarray) -> Outcome | None:
    """Whether an iterate is on its way to a solution that is none."""
    k = len(guess) - 1
    # A guess of zeros has no size to compare with.
    if np.abs(x[:k]).max() > _ESCAPE * np.abs(guess[:k]).max() > 0:
        return Outcome.ESCAPE
    path = float(jnp.linalg.norm(scene.rate(jnp.zeros(()), jnp.asarray(x[:k])))) * x[-1]
    start = float(jnp.linalg.norm(scene.rate(jnp.zeros(()), jnp.asarray(guess[:k])))) * guess[-1]
    if x[-1] < _TRIVIAL * guess[-1] or path <= _TRIVIAL * start:
        return Outcome.TRIVIAL
    return None


def _outcome(scene: Scene, result: newton.Result, guess: np.ndarray) -> Outcome:
    if not np.isfinite(result.residual).all():
        return Outcome.COLLISION
    trouble = _trouble(scene, result.x, guess)
    if trouble is not None:
        return trouble
    if result.converged:
        return Outcome.FOUND
    if result.at_bound:
        return Outcome.BOUND
    return Outcome.ITERATION_LIMIT if result.limit else Outcome.NO_DESCENT
