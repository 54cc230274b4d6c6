"""The call `fit`: from a guess and a table to a `Fit`."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy import special

from jaxdyn import _checks
from jaxdyn.fitting import measurements, result
from jaxdyn.fitting.multiple_shooting import estimate
from jaxdyn.fitting.problem import OUTSIDE, pose
from jaxdyn.fitting.result import Fit, FitError, FitStatus
from jaxdyn.fitting.segments import Model, cut, in_rows, in_segments
from jaxdyn.integrate.spans import MAX_STEPS, RTOL
from jaxdyn.scene import Scene
from jaxdyn.solvers import Solver

_estimate = eqx.filter_jit(estimate)


def fit(
    make: Callable[..., Scene],
    guess: Any,
    data: Any,
    *,
    start: Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
    noise: Any = None,
    observe: Mapping[str, Callable] | None = None,
    t0: float | None = None,
    segments: int | None = None,
    rtol: float = RTOL,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
    throw: bool = True,
) -> Fit:
    """Parameters and an initial state that fit a scene to measurements, by least squares.

    The method is multiple shooting: the motion is cut into short segments whose initial states are
    additional unknowns, and which join in the solution. Therefore neither a wrong phase nor chaos
    creates local minima, and the guess need not be close.

    Args:
      make: function of the parameters that returns the scene, such as `scenes.pendulum`.
      guess: initial values of the parameters: a dictionary, whose entries are passed to `make` by
        name, or any pytree of numbers, which is its only argument.
      data: times "t" and measured columns by name, NaN for gaps: a mapping of arrays, a DataFrame,
        a Trajectory, or the result of `jaxdyn.read_csv`. A column is named after an entry of the
        state, or "x", "y", "z" for the scene's point ("x1", "y1", "x2", ... if there are several).
        Units that `read_csv`, a DataFrame's ``attrs["units"]`` or a Trajectory state are converted
        to those of the scene.
      start: names of entries of the initial state that are estimated too; by default all of them if
        no parameter changes the initial state of the scene, otherwise none.
      columns: the columns that are used; all by default.
      noise: standard deviation of the measurements, in the units of the scene: one number, or one
        for each column by name, each () or (s,), NaN at gaps. By default that of each column is
        estimated from the residuals.
      observe: further columns by name, functions (scene, t, y) -> () of a state y.
      t0: time of the initial state; by default the first measured time if the whole initial state
        is estimated, otherwise 0.
      segments: number of segments; by default one for every ten times, at most 64.
      rtol: relative tolerance of a step.
      solver: see `simulate`.
      max_steps: largest number of steps of a segment.
      throw: raise on any status but CONVERGED; with False check `Fit.status`.
    Returns:
      Estimates with 95 % intervals from the Jacobian (Student's t if the noise is estimated),
      correlations and residuals, with the methods `profile`, `predict`, `propagate` and `plot`.
    Raises:
      ValueError: `make` does not return a scene, a column has an unknown name, times lie before
        `t0`, there are fewer measured numbers than unknowns, or an argument is out of range.
      FitError: it did not converge, or the data do not determine a parameter (``throw=True``).
    Limits: noise is assumed to be independent and normal, times to be exact, and the motion to be
      deterministic. A scene with phases (impacts) cannot be fitted.
    Reference: Bock (1983), Recent advances in parameter identification techniques for O.D.E.
    Example:
      >>> import jaxdyn, numpy as np
      >>> from jaxdyn import scenes
      >>> swing = jaxdyn.simulate(scenes.pendulum(g=9.7, angle=0.4), 6.0, samples=60)
      >>> noisy = swing["theta"] + 0.01 * np.random.default_rng(0).standard_normal(60)
      >>> found = jaxdyn.fit(scenes.pendulum, {"g": 8.0}, {"t": swing.ts, "theta": noisy})
      >>> low, high = found.interval("g")
      >>> low < 9.7 < high
      True
    """
    options = {"rtol": rtol, "solver": solver, "max_steps": max_steps}
    model, theta, scene, table, leaves = pose(make, guess, data, columns, observe, options)
    _checks.check_on_host("fit", (noise, t0), OUTSIDE)
    model = dataclasses.replace(model, free=_free(model, theta, scene, start))
    begin = _begin(t0, model, table)
    if segments is not None:
        _checks.whole("segments", segments, 1, max(len(table.ts) // 2, 1))
    sections = cut(table, begin, segments)
    names = _names(leaves, scene, model)
    sigma = None if noise is None else _sigma(noise, table, sections)
    dof = _degrees_of_freedom(table, names, 1 if sigma is None else 0)
    zeros = bool((theta == 0).any())
    solution = _estimate(model, sections, sigma, theta, jnp.asarray(scene.y0, float), zeros=zeros)
    fitted = _report(model, sections, sigma, solution, names, table, dof)
    if throw and not fitted.ok:
        raise FitError(fitted.message)
    return fitted


def _degrees_of_freedom(table: measurements.Measured, names: Sequence[str], least: int) -> int:
    """Measured numbers minus unknown ones."""
    count = int(np.isfinite(table.values).sum())
    if count - len(names) < least:
        got = f"{count} of {len(names)} unknown: {', '.join(names)}"
        remedy = "Measure more, or estimate fewer: start= names entries of the start."
        raise _checks.fail("data", "more measured numbers than unknown ones", got, remedy)
    return count - len(names)


def _free(model: Model, theta, scene: Scene, start: Sequence[str] | None) -> tuple[bool, ...]:
    """Whether each entry of the start is estimated."""
    names = [name for name, _ in scene.labels()]
    if start is None:
        moved = np.any(np.asarray(jax.jacfwd(lambda theta: model.scene(theta).y0)(theta)))
        chosen = [] if moved else names
    else:
        if isinstance(start, str):
            raise _checks.fail("start", "a list of names", repr(start), f"For example {names[:2]}.")
        chosen = [_checks.choice("start", name, names) for name in start]
    return tuple(name in chosen for name in names)


def _begin(t0: Any, model: Model, table: measurements.Measured) -> float:
    """The time of the start: that of the first row by default, if all of the start is estimated."""
    usual = table.ts[0] if all(model.free) else 0.0
    begin = float(usual if t0 is None else _checks.host_array("t0", t0, ()))
    if table.ts[0] < begin:
        raise _checks.fail("data", f"times from t0 = {begin:g} on", table.ts[0], "Pass t0=.")
    return begin


def _names(leaves: Any, scene: Scene, model: Model) -> tuple[str, ...]:
    """Names of the parameters, and of the estimated entries of the start."""
    found = []
    for path, x in jax.tree_util.tree_flatten_with_path(leaves)[0]:
        key = jax.tree_util.keystr(path, simple=True, separator=".") or "parameter"
        indices = np.ndindex(x.shape)
        found += [f"{key}{list(index)}" if index else key for index in indices]
    labels = zip(scene.labels(), model.free, strict=True)
    return (*found, *(f"{name}(t0)" for (name, _), free in labels if free))


def _sigma(noise: Any, table: measurements.Measured, sections):
    """(m, n, c) standard deviations in the shape of the segments."""
    c = len(table.names)
    if isinstance(noise, Mapping):
        for name in noise:
            _checks.choice("noise", name, table.names)
        missing = [name for name in table.names if name not in noise]
        if missing:
            raise _checks.fail("noise", "one for each column", f"none for {', '.join(missing)}")
        deviations = [
            _checks.positive(f"noise of {name}", _fill_gaps(noise[name], table, i))
            for i, name in enumerate(table.names)
        ]
    else:
        deviations = [_checks.positive("noise", noise)] * c
    n = table.count
    for name, x in zip(table.names, deviations, strict=True):
        if x.shape not in ((), (n,)):
            raise _checks.fail(f"noise of {name}", f"shape () or ({n},)", f"shape {x.shape}")
    values = np.stack([np.broadcast_to(np.asarray(x), (n,)) for x in deviations], axis=1)[
        table.rows
    ]
    return jnp.asarray(in_segments(values, len(sections.begin), 1.0))


def _fill_gaps(noise: Any, table: measurements.Measured, column: int) -> Any:
    """The noise of a column, with 1 in place of NaN where nothing was measured."""
    if np.shape(noise) != (table.count,) or np.asarray(noise).dtype.kind != "f":
        return noise
    gaps = np.ones(table.count, bool)
    gaps[table.rows] = np.isnan(table.values[:, column])
    return np.where(gaps & np.isnan(noise), 1.0, noise)


def _report(model, sections, sigma, solution, names, table, dof) -> Fit:
    p, q = solution.x.theta.shape[0], len(names)
    free = np.flatnonzero(np.array(model.free))
    rows = np.concatenate([np.arange(p), p + free])
    every = [names[j] if j < p else "" for j in range(p)]
    every += [f"{label}(t0)" for label, _ in model.scene(solution.x.theta).labels()]
    finite = bool(np.isfinite(solution.cost)) and bool(np.isfinite(solution.factor).all())
    lost, words = (
        result.undetermined(every, solution) if finite else (np.zeros(len(every), bool), ())
    )
    factor = np.asarray(solution.factor)[rows]
    covariance = factor @ factor.T
    lost = lost[rows]
    covariance[lost, :] = covariance[:, lost] = np.nan
    if not finite:
        status = FitStatus.NO_MOTION
    elif not bool(solution.converged):
        status = FitStatus.NOT_CONVERGED
    else:
        status = FitStatus.UNDETERMINED if words else FitStatus.CONVERGED
    known = sigma is not None
    quantile = float(
        special.ndtri(0.5 + result.LEVEL / 2)
        if known
        else special.stdtrit(dof, 0.5 + result.LEVEL / 2)
    )
    theta = np.where(lost[:p], np.nan, np.asarray(solution.x.theta))
    if status in (FitStatus.NO_MOTION, FitStatus.NOT_CONVERGED):
        theta, covariance = np.full(p, np.nan), np.full((q, q), np.nan)
    halves = quantile * np.sqrt(np.diag(covariance))[:p]
    scene = model.scene(solution.x.theta)
    scene = scene.starting(solution.x.nodes[0])
    weights = (
        jnp.ones_like(sections.values) * solution.noise[None, None] if sigma is None else sigma
    )
    residuals = -_in_rows(solution.residuals, table)
    sd = _in_rows(weights, table)
    columns = zip(table.names, sd.T, strict=True)
    noise = {name: _mean(x) if finite else np.nan for name, x in columns}
    good = status in (FitStatus.CONVERGED, FitStatus.UNDETERMINED)
    return Fit(
        params=model.as_given(theta),
        bars=model.as_given(halves),
        scene=scene,
        names=names,
        covariance=covariance,
        residuals=residuals,
        noise=noise,
        dof=dof,
        status=status,
        undetermined=words if good else (),
        warning=result.doubts(residuals, sd, dof, known, table, model.angles) if good else "",
        table=table,
        quantile=quantile,
        model=model,
        segments=sections,
        sigma=weights,
        solution=solution,
    )


def _mean(x: np.ndarray) -> float:
    """The mean of the finite entries; NaN if there are none."""
    kept = x[np.isfinite(x)]
    return float(np.mean(kept)) if len(kept) else np.nan


def _in_rows(x, table: measurements.Measured) -> np.ndarray:
    """(s, c) the values that belong to each measurement, NaN for gaps."""
    return np.where(np.isfinite(table.values), in_rows(np.asarray(x), len(table.ts)), np.nan)
