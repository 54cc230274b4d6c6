"""Error estimates without the exact solution: problem 3 d and e of the course.

There are four independent methods, each of which gives an `Estimate` with its basis:

- `estimate`: the same solver at a thousandth of the tolerance, or the default solver for the
  finest tolerances. It is the usual one: cheap and sharp.
- `by_second_method`: another solver at a thousandth of the tolerance. It would also detect a
  fault of the first one.
- `by_tangents`: the error made in each piece of the span, propagated to its end by the tangent
  map and summed without cancellation. It is an upper bound, to first order in the errors.
- `by_halving`: equal steps, their halves and quarters, with the observed order.

None of them detects errors of the equations. All include the effect of rounding, see
`integrate.errors.rounding`; compared with exact solutions, the first two are within a factor of 5
of the true error in at least 95 of 100 cases (tests/jaxdyn/accuracy/test_estimates.py).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.accuracy.convergence import fixed_steps
from jaxdyn.integrate import errors
from jaxdyn.integrate.errors import Estimate, Run, gaps, kind_of, scales
from jaxdyn.integrate.simulation import simulate, solve
from jaxdyn.integrate.spans import RTOL, Share, SolverOptions, span
from jaxdyn.scene import Scene
from jaxdyn.solvers import DOPRI8, EULER, NYSTROM12, RADAU5, RADAU9, VERNER9, Method, Solver
from jaxdyn.solvers.choice import choose_method, method_of

_SAMPLES = 33
#: The second method for each solver: of another family, and suited to the same scenes.
_SECOND_METHODS = {NYSTROM12: VERNER9, VERNER9: DOPRI8, RADAU5: RADAU9, RADAU9: RADAU5}


@check_first
def estimate(
    scene: Scene,
    t1=None,
    *,
    t0=0.0,
    samples=_SAMPLES,
    rtol: float = RTOL,
    solver: Solver | None = None,
    dt: float | None = None,
) -> Estimate:
    """The error of a solution at a tolerance, by a tolerance ladder; host only.

    Args:
      scene: system, effects, start.
      t1: () end time [s]; the scene's own span by default.
      t0: () start time [s].
      samples: number of times, or an array of times (s,).
      rtol: relative and absolute tolerance of the solution.
      solver: see `simulate`.
      dt: step [s] of a solver of fixed step; the estimate is then by step halving.
    Raises:
      ValueError: see `simulate`.
      IntegrationError: the end was not reached.
    Example:
      >>> from jaxdyn import accuracy, scenes
      >>> loose = accuracy.estimate(scenes.oscillator(), rtol=1e-6)
      >>> end = loose.ys[-1, 0]
      >>> bool(loose.error.max() / 5 < abs(end - np.cos(10.0)) < 5 * loose.error.max())
      True
    """
    method, finer = _methods(scene, t1, t0, samples, solver, (rtol, errors.FINEST))
    options = SolverOptions(rtol=rtol, solver=method)
    run, ts = _runner(scene, t1, t0, samples, options, dt=dt)
    if dt is not None:
        return errors.halve_steps(run, scene, ts, dt, method.name)
    by = run
    if finer is not method:
        by, _ = _runner(scene, t1, t0, samples, options._replace(solver=finer))
    names = ("tolerance ladder", method.name, finer.name)
    return errors.measure(run, scene, ts, np.array([rtol, rtol]), names, by=by)[1]


@check_first
def by_second_method(
    scene: Scene,
    t1=None,
    *,
    t0=0.0,
    samples=_SAMPLES,
    rtol: float = RTOL,
    solver: Solver | None = None,
    second: Solver | None = None,
) -> Estimate:
    """The result of `estimate` with another solver as the finer one.

    Args:
      scene: see `estimate`.
      t1: see `estimate`.
      t0: see `estimate`.
      samples: see `estimate`.
      rtol: see `estimate`.
      solver: see `simulate`.
      second: the other solver; one of another family by default.
    Raises:
      ValueError: `second` is the same as `solver`, or see `simulate`.
    Limits: the second solver runs at a thousandth of the tolerance. Where the first is more
      accurate even so, the estimate is the error of the second: it is too large by up to 900 times
      for a throw with drag, whose series is compared with a pair, at rtol 1e-3, and right from 1e-9
      on.
    """
    first, _ = _methods(scene, t1, t0, samples, solver, (rtol, rtol))
    if second is None:
        second = _SECOND_METHODS.get(first, VERNER9)
    second = choose_method(scene, second)
    if second is first:
        raise _checks.fail("second", "another solver", first.name, "Or call `estimate`.")
    options = SolverOptions(rtol=rtol, solver=first)
    run, ts = _runner(scene, t1, t0, samples, options)
    by, _ = _runner(scene, t1, t0, samples, options._replace(solver=second))
    names = ("second method", first.name, second.name)
    return errors.measure(run, scene, ts, np.array([rtol, rtol]), names, by=by)[1]


@check_first
def by_tangents(
    scene: Scene,
    t1=None,
    *,
    t0=0.0,
    samples=_SAMPLES,
    rtol: float = RTOL,
    solver: Solver | None = None,
) -> Estimate:
    """A bound of the error: the sum of all local errors, each propagated by the tangent map.

    If l_n is the error made in piece n (from solving that piece again, from the same start at a
    thousandth of the tolerance) and P_n the derivative of the end with respect to the end of piece
    n, the error is the sum of P_n l_n, to first order. This is the sum of the |P_n l_n|.

    Args:
      scene: see `estimate`.
      t1: see `estimate`.
      t0: see `estimate`.
      samples: the ends of the pieces.
      rtol: see `estimate`.
      solver: see `simulate`.
    Raises:
      ValueError: see `simulate`.
    Limits: the bound is too large by the cancellation of local errors, which over many periods of
      an oscillation is a factor of 10 and more. It is of first order only: where errors are not
      small, neither are the neglected terms.
    """
    fine = max(rtol * errors.RATIO, errors.FINEST)
    first, method = _methods(scene, t1, t0, samples, solver, (rtol, fine))
    run, ts = _runner(scene, t1, t0, samples, SolverOptions(rtol=rtol, solver=first))
    ys = np.asarray(run(scene, np.array([rtol, rtol])).ys)
    starts_at = np.concatenate([[float(t0)], np.asarray(ts)[:-1]])
    starts = np.concatenate([np.asarray(scene.y0)[None], ys[:-1]])
    ends, tangents = _pieces(scene, starts_at, starts, ts, np.asarray(fine), solver=method)
    local = gaps(scene, ys, np.asarray(ends))
    carried = np.zeros((ys.shape[1], 0))
    sums = []
    for step, missed in zip(np.asarray(tangents), local, strict=True):
        carried = np.concatenate([step @ carried, missed[:, None]], axis=1)
        sums.append(np.abs(carried).sum(axis=1))
    return Estimate(
        ts=ts,
        ys=ys,
        error=np.stack(sums),
        rounding=np.full_like(ys, np.nan),
        scale=scales(scene, ys),
        fineness=np.array([rtol, fine]),
        kind=kind_of("local errors and the tangent map", scene),
        solver=first.name,
        other=method.name,
    )


@eqx.filter_jit
def _pieces(scene: Scene, t0s, starts, t1s, rtol, solver: Method):
    """(s, k) ends of all pieces and (s, k, k) their derivatives with respect to the starts."""

    def end(y, t0, t1):
        return solve(scene.starting(y), t1, t0=t0, rtol=rtol, solver=solver).y1

    def piece(x):
        t0, y, t1 = x
        return end(y, t0, t1), jax.jacfwd(end)(y, t0, t1)

    return jax.lax.map(piece, (t0s, starts, t1s))


@check_first
def by_halving(
    scene: Scene, t1=None, *, steps: int = 1000, t0=0.0, method: Solver = EULER
) -> Estimate:
    """The error of a solution with equal steps at the end; host only.

    This is `estimate` with dt, but for any solver, e.g. Euler's method (problem 3 d).

    Args:
      scene: system, effects, start.
      t1: () end time [s]; the scene's own span by default.
      steps: number of steps of the solution.
      t0: () start time [s].
      method: any solver, whose error estimate is not used.
    Returns:
      An estimate whose `fineness` are the steps [s].
    Raises:
      ValueError: see `fixed_steps`.
    """
    _checks.check_on_host("estimate", (scene, t0, t1))
    (t0, t1), method = span(scene, t1, t0), method_of(method)
    length = abs(float(t1) - float(t0))

    def run(scene, h, noise=None):
        n = round(length / h[0])
        y1 = fixed_steps(scene, t1, steps=n, t0=t0, method=method, noise=noise)
        return _Ends(y1[None])

    ts = t1[None]
    return errors.halve_steps(run, scene, ts, length / steps, method.name)


class _Ends(NamedTuple):
    ys: Array


def _methods(
    scene: Scene, t1, t0, samples, solver: Solver | None, rtols: tuple[float, float]
) -> tuple[Method, Method]:
    """The methods at two tolerances; `RADAU9` for both where it takes over at the first."""
    _checks.check_on_host("estimate", (scene, t0, t1, samples))
    first, second = (choose_method(scene, solver, rtol=rtol) for rtol in rtols)
    if solver is not None:
        return first, second
    motion = simulate(scene, t1, t0=t0, samples=samples, rtol=rtols[0])
    return (RADAU9, RADAU9) if np.any(motion.switched) else (first, second)


def _runner(scene: Scene, t1, t0, samples, options: SolverOptions, *, dt=None) -> tuple[Run, Array]:
    """The run for `integrate.errors` and its times; arguments are checked as by `simulate`."""
    ts = simulate(scene, t1, t0=t0, samples=samples, dt=dt, **options._asdict()).ts
    t0, end = span(scene, t1, t0)

    def run(scene, fineness, noise=None):
        if dt is not None:
            at = options._asdict() | {"dt": fineness[0]}
        else:
            at = options._replace(rtol=fineness[0], atol=Share(fineness[1]))._asdict()
        return solve(scene, end, t0=t0, ts=ts, noise=noise, **at)

    return run, ts
