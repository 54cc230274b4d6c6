"""The result of a fit: estimates with error bars, residuals, profiles and predictions."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from scipy import special

from jaxdyn import _checks, _text
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.fitting.measurements import Column, Measured
from jaxdyn.fitting.multiple_shooting import UNDETERMINED, Solution, estimate
from jaxdyn.fitting.segments import Model, Segments
from jaxdyn.scene import Scene
from jaxdyn.status import Code

LEVEL = 0.95  # confidence level of all bars
_INTERVALS = ("confidence", "prediction")
_GRID = 15  # number of values of a profile
_WIDENINGS = 4  # how often its range is doubled
_NAMED = 0.1  # a combination names parameters with larger weights, relative to the largest
_CORRELATED = 4.0  # standard errors above which residuals count as correlated in time
_WIDE = 0.25  # relative half-width of an interval over which the Jacobian may change
_UNLIKELY = 1e-3  # probability of the misfit, or of an outlier, below which there is a warning
#: Root mean square [rad] of residuals of angles above which the motion explains nothing. It would
#: be pi / sqrt(3) = 1.8 at random; estimates that were fitted to such angles leave a little less.
_ANY_ANGLE = 1.2
_EXACT = 1e-9  # of the largest value: smaller residuals are integration errors, of exact data


class FitStatus(Code):
    """How a fit ended; `FitStatus.CONVERGED` is zero."""

    CONVERGED = 0, "The fit converged."
    NOT_CONVERGED = (
        1,
        "The iteration did not settle. Begin with a guess nearer to the data, or give more "
        "segments (segments=). For weights of a network, use jaxdyn.train.",
    )
    UNDETERMINED = (
        2,
        "The data do not determine all parameters separately. Keep one of those named at a known "
        "value, or measure another quantity. For weights of a network, use jaxdyn.train.",
    )
    NO_MOTION = (
        3,
        "The motion from the guess could not be computed. Check jaxdyn.simulate of the guess, "
        "and begin with another one.",
    )


class FitError(RuntimeError):
    """Raised for a status other than CONVERGED (``throw=True``)."""


class Propagated(NamedTuple):
    """A quantity derived from a fit, and the half-width of its 95 % interval, as pytrees."""

    value: Any
    bar: Any


class Prediction(NamedTuple):
    """The prediction of a fit.

    Attributes:
      ts: (s,) times.
      names: names of the columns and, but for measurements, of the entries of the state that are
        not columns.
      values: (s, c) values of each.
      bars: (s, c) half-widths of their 95 % intervals: of the motion without noise, or of a new
        measurement.
    """

    ts: np.ndarray
    names: tuple[str, ...]
    values: np.ndarray
    bars: np.ndarray

    def __getitem__(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """(s,) values and bars of a column."""
        i = self.names.index(_checks.choice("name", name, self.names))
        return self.values[:, i], self.bars[:, i]


class Profile(NamedTuple):
    """The misfit along one parameter, minimised over all others for each value of it.

    Attributes:
      name: name of the parameter.
      values: (n,) its values.
      rise: (n,) increase of twice the misfit above its minimum, in units of the noise.
      low: lower end of the 95 % interval; -inf if the misfit stays below its limit.
      high: upper end; inf likewise.
    """

    name: str
    values: np.ndarray
    rise: np.ndarray
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class Fit:
    """Parameters and an initial state that explain measurements.

    Attributes:
      params: the estimates, in the structure of the guess.
      bars: half-widths of their 95 % intervals, likewise; NaN if the data do not determine them.
      scene: the scene with the estimates, from the estimated initial state; where the fit did not
        converge, that at which it stopped.
      names: names of all estimated numbers: parameters, then entries of the start, "theta(t0)".
      covariance: (q, q) covariance of these.
      residuals: (s, c) measured minus fitted, NaN for gaps.
      noise: standard deviation of each column by name: given, or estimated.
      dof: degrees of freedom: measured numbers minus estimated ones.
      status: how the fit ended.
      undetermined: combinations of parameters that the data do not determine, in words.
      warning: reasons to doubt the model or the bars; empty if there are none.
    """

    params: Any
    bars: Any
    scene: Scene
    names: tuple[str, ...]
    covariance: np.ndarray
    residuals: np.ndarray
    noise: dict[str, float]
    dof: int
    status: FitStatus
    undetermined: tuple[str, ...]
    warning: str
    table: Measured
    quantile: float
    model: Model = dataclasses.field(repr=False)
    segments: Segments = dataclasses.field(repr=False)
    sigma: Array = dataclasses.field(repr=False)
    solution: Solution = dataclasses.field(repr=False)

    @property
    def ok(self) -> bool:
        """Whether it converged and all parameters are determined."""
        return self.status == FitStatus.CONVERGED

    @property
    def _solved(self) -> bool:
        return self.status in (FitStatus.CONVERGED, FitStatus.UNDETERMINED)

    def _check_solved(self) -> None:
        if not self._solved:
            raise _checks.fail("fit", "one that converged", self.status.name, self.message)

    @property
    def message(self) -> str:
        """What happened and what to do about it."""
        return " ".join([self.status.message, *self.undetermined])

    @property
    def values(self) -> np.ndarray:
        """(q,) all estimated numbers, in the order of `names`; NaN for those without a bar."""
        start = np.asarray(self.solution.x.nodes[0])[np.array(self.model.free)]
        found = np.concatenate([np.asarray(self.solution.x.theta), start])
        return np.where(np.isfinite(np.diag(self.covariance)), found, np.nan)

    @property
    def correlations(self) -> np.ndarray:
        """(q, q) correlations of the estimated numbers."""
        sd = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(sd, sd)

    @property
    def t0(self) -> float:
        """Time of the initial state."""
        return float(self.segments.begin[0])

    def interval(self, name: str) -> tuple[float, float]:
        """The 95 % interval of an estimated number, from the Jacobian."""
        i = self.names.index(_checks.choice("name", name, self.names))
        half = self.quantile * np.sqrt(self.covariance[i, i])
        return float(self.values[i] - half), float(self.values[i] + half)

    def profile(self, name: str, count: int = _GRID) -> Profile:
        """The profile likelihood of a parameter, which does not rely on the Jacobian.

        Args:
          name: name of a parameter, one of `names`, but not an entry of the initial state.
          count: number of values; the range is widened until the misfit exceeds its limit.
        """
        p = len(self.solution.x.theta)
        i = self.names.index(_checks.choice("name", name, self.names[:p]))
        _checks.whole("count", count, 5)
        self._check_solved()
        var = float(np.sum(np.asarray(self.solution.factor[i]) ** 2))
        sd = np.sqrt(var) if var > 0 else float(self.solution.sizes[i])
        width = 1.5 * self.quantile * sd
        for _ in range(1 + _WIDENINGS):
            offsets = np.linspace(-width, width, count)
            values, rise = self._rises(i, offsets)
            low, high = self._crossings(values, rise)
            if np.isfinite([low, high]).all():
                break
            width *= 2.0
        return Profile(name, values, rise, low, high)

    def _rises(self, i: int, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values of a parameter at offsets from its estimate, and the rise of the misfit there."""
        theta, nodes = self.solution.x
        factor, p = np.asarray(self.solution.factor), len(theta)
        var = np.sum(factor[i] ** 2)
        along = factor @ factor[i] / var if var > 0 else np.eye(len(factor))[i]
        thetas = np.asarray(theta) + offsets[:, None] * along[:p]
        starts = np.asarray(nodes) + (offsets[:, None] * along[p:]).reshape(-1, *nodes.shape)
        pin = jnp.asarray(np.eye(p)[i])
        sizes = self.solution.sizes[p : p + nodes.shape[1]]
        costs, closed = _profile(self.model, self.segments, self.sigma, pin, thetas, starts, sizes)
        rise = 2.0 * np.asarray(costs - self.solution.cost)
        return thetas[:, i], np.where(np.asarray(closed), rise, np.nan)

    def _crossings(self, values: np.ndarray, rise: np.ndarray) -> tuple[float, float]:
        """Where the rise exceeds its limit, by its square root, which is linear for a parabola."""
        limit, best = self.quantile, np.mean(values)
        found = []
        for side in (-1.0, 1.0):
            take = (side * (values - best) >= 0) & np.isfinite(rise)
            x, root = values[take], np.sqrt(np.maximum(rise[take], 0.0))
            order = np.argsort(side * x)
            x, root = x[order], root[order]
            past = np.flatnonzero(root > limit)
            if not len(past) or past[0] == 0:
                found.append(side * np.inf)
                continue
            j = past[0]
            share = (limit - root[j - 1]) / (root[j] - root[j - 1])
            found.append(float(x[j - 1] + share * (x[j] - x[j - 1])))
        return found[0], found[1]

    def predict(self, ts: Any = None, *, interval: str = "confidence") -> Prediction:
        """The fitted motion with its 95 % bands: columns, and entries of the state.

        Args:
          ts: (s,) times, not before the start; 400 from the first to the last measurement by
            default. Beyond the last measurement the bands show what the data say about the future.
            Where the fit did not converge, they are NaN.
          interval: "confidence" for the band of the motion itself; "prediction" for that of a new
            measurement, with its noise, of each column.
        """
        _checks.choice("interval", interval, _INTERVALS)
        first, last = self.t0, float(self.segments.end[-1])
        ts = np.linspace(first, last, 400) if ts is None else _checks.host_array("ts", ts, (None,))
        ts = np.asarray(ts)
        if len(ts) and ts.min() < first:
            raise _checks.fail("ts", f"times from {first:g} on", ts.min(), "The start is there.")
        begin = np.asarray(self.segments.begin)
        which = np.clip(np.searchsorted(begin, ts, side="right") - 1, 0, len(begin) - 1)
        taken = {column.entry for column in self.model.columns}
        labels = enumerate(self.scene.labels())
        more = [Column(name, unit, i) for i, (name, unit) in labels if i not in taken]
        columns, noise = (*self.model.columns, *more), np.zeros(())
        if interval == "prediction":
            columns, noise = self.model.columns, np.array([*self.noise.values()])
        n = max(np.bincount(which, minlength=len(begin)).max(), 1)
        padded, places = np.empty((len(begin), n)), np.empty(len(ts), int)
        for i in range(len(begin)):
            mine = np.flatnonzero(which == i)
            mine = mine[np.argsort(ts[mine], kind="stable")]
            padded[i] = ts[mine].max() if len(mine) else begin[i]
            padded[i, : len(mine)] = ts[mine]
            places[mine] = i * n + np.arange(len(mine))
        values, bars = _bands(self.model, self.segments, self.solution, padded, columns)
        flat = np.asarray(values).reshape(-1, len(columns))[places]
        errors = np.hypot(np.asarray(bars), noise).reshape(-1, len(columns))[places]
        widths = self.quantile * errors
        if not self._solved:
            widths = np.full_like(widths, np.nan)
        return Prediction(ts, tuple(column.name for column in columns), flat, widths)

    def propagate(
        self, function: Callable[[Scene], Any], draws: int | None = None, seed: int = 0
    ) -> Propagated:
        """A quantity derived from the fit, with its bars: a period, multipliers, a range.

        Args:
          function: function of a scene that returns a number or a pytree of numbers.
          draws: None to propagate the bars by its derivative, for functions that JAX can
            differentiate; otherwise the number of scenes drawn from the normal distribution of
            the estimates, for functions that search, such as `orbits.find`, or are nonlinear.
          seed: seed of the draws.
        Returns:
          Its value at the estimates, and the half-widths of its 95 % intervals.
        Raises:
          ValueError: the function cannot be traced (the remedy is `draws`), or the fit did not
            converge.
        """
        self._check_solved()
        p, k = len(self.solution.x.theta), len(self.scene.y0)
        z = jnp.concatenate([self.solution.x.theta, self.solution.x.nodes[0]])
        factor = np.asarray(self.solution.factor)[: p + k]
        t1 = self.scene.t1

        def of(z: Array) -> Any:
            return function(self.model.scene(z[:p]).starting(z[p:], t1))

        value = of(z)
        if draws is not None:
            _checks.whole("draws", draws, 10)
            steps = np.random.default_rng(seed).standard_normal((draws, factor.shape[1]))
            drawn = [of(z + jnp.asarray(factor @ step)) for step in steps]
            tail = 50 * (1 - LEVEL)
            stretch = self.quantile / special.ndtri(0.5 + LEVEL / 2)

            def half(*xs):
                low, high = np.percentile(np.stack(xs), [tail, 100 - tail], axis=0)
                return stretch * (high - low) / 2

            return Propagated(value, jax.tree.map(half, *drawn))
        try:
            jacobian = jax.jacfwd(of)(z)
        except (
            jax.errors.ConcretizationTypeError,
            jax.errors.TracerArrayConversionError,
            ValueError,
        ) as error:
            got = f"one that is not ({str(error).splitlines()[0][:80]})"
            remedy = "Pass draws=200: it is then called for scenes drawn from the estimates."
            raise _checks.fail("function", "one that JAX differentiates", got, remedy) from error

        def bar(j):
            return self.quantile * np.linalg.norm(np.asarray(j) @ factor, axis=-1)

        return Propagated(value, jax.tree.map(bar, jacobian))

    def plot(
        self,
        path: str | Path | None = None,
        *,
        interval: str = "confidence",
        title: str | None = None,
    ):
        """A picture of the data, the fitted motion with its bands, and the residuals.

        Args:
          path: file to write, .png, .pdf or .svg.
          interval: see `predict`; with "prediction" a second, wider band is that of measurements.
          title: its title.
        """
        from jaxdyn.drawing import fits

        return fits.fit(self, path, interval=interval, title=title)

    def as_dict(self) -> dict:
        """Estimates, bars and verdicts as plain data, for JSON."""
        sd = np.sqrt(np.diag(self.covariance))
        return {
            "status": self.status.name,
            "message": self.message,
            "warning": self.warning,
            "estimates": {n: float(x) for n, x in zip(self.names, self.values, strict=True)},
            "bars": {n: float(self.quantile * x) for n, x in zip(self.names, sd, strict=True)},
            "noise": self.noise,
            "degrees of freedom": self.dof,
            "time of the start": self.t0,
        }

    @_text.never_raising
    def __repr__(self) -> str:
        sd = np.sqrt(np.diag(self.covariance))
        rows = [
            (name, with_bar(x, self.quantile * s))
            for name, x, s in zip(self.names, self.values, sd, strict=True)
        ]
        noise = ", ".join(f"{name} {x:.3g}" for name, x in self.noise.items())
        started = f"at t0 = {self.t0:g} {_text.second(self.scene.labels())}".rstrip()
        rows += [
            ("start", started if any(self.model.free) else ""),
            ("noise", noise),
            (
                "data",
                f"{np.isfinite(self.table.values).sum()} numbers, {self.dof} degrees of freedom",
            ),
            ("status", f"{self.status.name}: {self.message}"),
            ("warning", self.warning),
            ("wide", self._wide()),
        ]
        return _text.table(f"Fit of {_text.title_of(self.scene)}, with 95 % intervals", rows)

    def _wide(self) -> str:
        """A remark on intervals that may be too wide for the Jacobian; "" if there are none."""
        sd, values = np.sqrt(np.diag(self.covariance)), self.values
        p = len(self.solution.x.theta)
        wide = self.quantile * sd[:p] > _WIDE * np.abs(values[:p])
        names = [name for name, is_wide in zip(self.names, wide, strict=False) if is_wide]
        calls = ", ".join(f"profile({name!r})" for name in names)
        return calls and f"over such intervals the Jacobian may change, which {calls} follows"

    _repr_html_ = _text.html


@eqx.filter_jit
def _profile(model, segments, sigma, pin, thetas, starts, sizes):
    def one(at):
        theta, nodes = at
        found = estimate(model, segments, sigma, theta, nodes[0], pin, (nodes, sizes))
        return found.cost, found.converged

    # Not in parallel: batches of LAPACK in two of XLA's threads deadlock on two cores [jaxlib 0.10,
    # in fits of a double pendulum], and all values would wait for the slowest.
    return jax.lax.map(one, (thetas, starts))


@eqx.filter_jit
def _bands(model: Model, segments: Segments, solution: Solution, ts, columns):
    """(m, n, c) values at times of each segment, and their standard errors."""
    theta, nodes = solution.x
    p, (m, k) = theta.shape[0], nodes.shape
    by_parameter = jnp.broadcast_to(solution.factor[:p], (m, p, solution.factor.shape[1]))
    factors = jnp.concatenate([by_parameter, solution.factor[p:].reshape(m, k, -1)], axis=1)

    def of_segment(begin, start, times, factor):
        def seen(z):
            return model.run(z[:p], z[p:], begin, jnp.max(times), times, columns)[0]

        values, jacobian = value_and_jacfwd(seen)(jnp.concatenate([theta, start]))
        return values, jnp.linalg.norm(jacobian @ factor, axis=-1)

    return jax.vmap(of_segment)(segments.begin, nodes, jnp.asarray(ts), factors)


def with_bar(value: float, bar: float) -> str:
    """A number and the half-width of its interval, to two digits of the latter.

    Example:
      >>> with_bar(9.81234, 0.0321), with_bar(1.0, float("nan")), with_bar(9e5 + 0.1, 1.8e-19)
      ('9.812 +- 0.032', '1 +- nan', '900000.1 +- 1.8e-19')
    """
    if not (np.isfinite(bar) and bar > 0):
        return f"{value:.6g} +- {bar:.2g}"
    places = 1 - int(np.floor(np.log10(bar)))
    if 0 <= places <= 8:
        return f"{value:.{places}f} +- {bar:.{places}f}"
    digits = places + int(np.floor(np.log10(abs(value) or bar))) + 1
    digits = min(max(digits, 1), np.finfo(float).precision)
    return f"{value:.{digits}g} +- {bar:.2g}"


def undetermined(names: Sequence[str], solution: Solution) -> tuple[np.ndarray, tuple[str, ...]]:
    """(q,) whether each estimated number is undetermined, and the combinations in words."""
    singular, theta = np.asarray(solution.singular), np.asarray(solution.x.theta)
    values = np.concatenate([theta, np.asarray(solution.x.nodes[0])])
    sizes = np.asarray(solution.sizes)[: len(names)]
    relative = sizes / np.where(values != 0, np.abs(values), sizes)
    lost = np.flatnonzero(~(singular > UNDETERMINED * singular.max()))
    directions = np.asarray(solution.directions)[: len(names), lost] * relative[:, None]
    words, which = [], np.zeros(len(names), bool)
    for direction in directions.T:
        largest = np.abs(direction).max()
        taken = np.flatnonzero(np.abs(direction) > _NAMED * largest)
        which[taken] = True
        if len(taken) == 1:
            words.append(f"{names[int(taken[0])]} has no effect on what was measured.")
            continue
        weights = direction[taken] / direction[int(np.argmax(np.abs(direction)))]
        changes = ", ".join(
            f"{names[i]} by {100 * w:+.3g} %" for i, w in zip(taken.tolist(), weights, strict=True)
        )
        words.append(f"Together these changes leave what was measured as it is: {changes}.")
    return which, tuple(words)


def doubts(
    residuals: np.ndarray,
    noise: np.ndarray,
    dof: int,
    known: bool,
    table: Measured,
    angles: Sequence[bool],
) -> str:
    """Warnings about the model: residuals that are not noise; `angles` marks columns of angles."""
    parts = [
        f"The residuals of {name} are nearly as large as between angles at random: the motion "
        "says nothing about them. Numbers without a unit are in rad; where they are in degrees, "
        f"name the column '{name} [deg]'."
        for i, name in enumerate(table.names)
        if angles[i] and np.sqrt(np.nanmean(residuals[:, i] ** 2)) > _ANY_ANGLE
    ]
    chi = np.nansum((residuals / noise) ** 2)
    if known and dof > 0 and special.chdtrc(dof, chi) < _UNLIKELY:
        parts.append(
            f"The misfit is {np.sqrt(chi / dof):.3g} times the given noise: the model lacks "
            "something, or the noise is larger than given. The bars do not hold."
        )
    for i, name in enumerate(table.names):
        there = np.isfinite(residuals[:, i])
        x, share = residuals[there, i], (residuals / noise)[there, i]
        if len(x) < 20 or not np.abs(x).max() > _EXACT * np.abs(table.values[there, i]).max():
            continue
        r = float(np.sum(x[1:] * x[:-1]) / np.sum(x * x))
        if r * np.sqrt(len(x)) > _CORRELATED:
            parts.append(
                f"The residuals of {name} are correlated in time ({r:.2f}): the model lacks "
                "something, and the bars are too small."
            )
        far = np.abs(share)
        if 2 * len(x) * special.ndtr(-far.max()) < _UNLIKELY:
            at = _text.brief(table.ts[there][np.argmax(far)])
            parts.append(
                f"At t = {at} the residual of {name} is {far.max():.1f} standard deviations. If "
                "this is an outlier, replace it by NaN."
            )
    return " ".join(parts)
