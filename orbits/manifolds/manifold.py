"""Stable and unstable manifolds of periodic orbits and equilibria, as ensembles of strands."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, _checks, _text, ensemble
from jaxdyn._checks import check_first
from jaxdyn.ensemble.crossings import EachCrossing
from jaxdyn.integrate.events import Event, as_events
from jaxdyn.integrate.trajectory import explanation
from jaxdyn.scene import check_scene
from jaxdyn.status import tally
from jaxdyn.system import differences
from orbits.manifolds.directions import SENSES, Directions, of_equilibrium, of_orbit
from orbits.motion import quick_solve
from orbits.orbit import Orbit, SearchError

# ---- A stable or unstable manifold as strands: motions that begin next to an orbit

_MISSED = (
    "The strand ended before the requested number of crossings. Raise `time`, ask for fewer "
    "`crossings`, or choose another section."
)


@dataclasses.dataclass(frozen=True)
class Manifold:
    """Strands of a manifold of a periodic orbit or of an equilibrium.

    Attributes:
      scene: the scene.
      kind: "unstable", or "stable", whose strands run backwards.
      orbit: the orbit, or None.
      base: (n, k) the states beside which strands begin.
      phases: (n,) for each strand, the time at which the orbit passes its base, over the period,
        from 0 to 1; at an equilibrium the angle on the circle of starts, over a turn.
      branches: (n,) the side, 1 or -1, of each strand; 1 for all strands from a circle.
      multipliers: multipliers of the orbit, or eigenvalues of the equilibrium, to which it belongs.
      step_off: distance of the starts from the base, in the sizes of the entries.
      linear_error: estimated distance of the starts from the manifold, in these sizes.
      t0s: (n,) times of the starts: those at which the orbit passes the bases, at which a driven
        scene has to be started.
      starts: (n, k) starts.
      ts: (n,) times of the ends, on the clock of `t0s`; `durations` are those from start to end.
      ends: (n, k) states at those times, on a section or after a time; NaN unless the status is OK.
      status: (n,) `Status` codes.
      sample_ts: (n, s) times of the samples, from `t0s` to `ts`.
      samples: (n, s, k) states on the strands; NaN unless the status is OK.
      rtol: tolerance of the integrations.
    """

    scene: Scene
    kind: str
    orbit: Orbit | None
    base: np.ndarray
    phases: np.ndarray
    branches: np.ndarray
    multipliers: np.ndarray
    step_off: float
    linear_error: float
    t0s: np.ndarray
    starts: np.ndarray
    ts: np.ndarray
    ends: np.ndarray
    status: np.ndarray
    sample_ts: np.ndarray
    samples: np.ndarray
    rtol: float

    @_text.never_raising
    def __repr__(self) -> str:
        rest = self.orbit is None
        lasted = _text.extent(np.abs(self.durations)[self.ok]) if self.ok.any() else ""
        values = ", ".join(f"{z:.9g}" for z in self.multipliers)
        rows = [
            ("eigenvalue" if rest else "multiplier", values.replace("+0j", "")),
            ("strands", f"{len(self)}, {int(self.ok.sum())} of them reached their end"),
            ("step-off", f"{_text.brief(self.step_off)}, error {_text.brief(self.linear_error)}"),
            ("durations", lasted),
            ("failures", "" if self.ok.all() else self.message),
        ]
        what = "equilibrium" if rest else "orbit"
        title = f"{self.kind.capitalize()} manifold of {what} of {_text.title_of(self.scene)}"
        return _text.table(title, rows)

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import manifolds

        return manifolds.manifold(self, title="")

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def ok(self) -> np.ndarray:
        """(n,) whether each strand reached its end."""
        return self.status == Status.OK

    @property
    def durations(self) -> np.ndarray:
        """(n,) times from the starts to the ends, negative for a stable manifold."""
        return self.ts - self.t0s

    @property
    def message(self) -> str:
        """Number of strands that failed, by status, and the remedies."""
        return tally(self.status[~self.ok], "strand", self._explanation)

    def _explanation(self, status: Status) -> str:
        return _MISSED if status == Status.FEW_CROSSINGS else explanation(status, self.scene)


# ---- How far from an orbit the linear start of a manifold may be, for a wanted error
#
# A start ``base + e * tangent`` misses the manifold by a term of order e^2. This shows in a map
# over one period (for an equilibrium, over a time): the image of ``base + e * before`` is on the
# manifold to a smaller error, and the linear prediction of it is the start itself. Their distance,
# over 1 - 1/growth, is the estimate. It is measured for e, e / 4, e / 16, ..., and extrapolated
# from where it falls at least as e^2: further down there is only rounding.

_LARGEST = 0.2  # the first e; all distances are in units of the sizes of the entries
_RUNGS = 10
_RATIO = 0.25  # ratio of successive e: halves would take twice the time for the same step-off
_QUADRATIC = 9.0  # least ratio of estimates at e and e / 4, which is 16 for an error of order e^2
_SHARE = 0.5  # share of the wanted error that may be rounding


def choose_step_off(
    scene: Scene, near: Directions, signs: tuple[int, ...], error: float, rtol: float
) -> tuple[float, float]:
    """The step-off, and the estimated error of the linear starts.

    Raises:
      SearchError: the wanted error is below what rounding leaves, or none was reached.
    """
    grown = math.exp(near.rate * abs(near.span))
    es = _LARGEST * _RATIO ** np.arange(_RUNGS)
    ladder = np.concatenate([np.zeros(1), np.outer(es, signs).ravel()])
    misses = _misses(scene, near, ladder, rtol)
    rounding = misses[0] / grown
    rungs = misses[1:].reshape(_RUNGS, -1).max(axis=1) / (1 - 1 / grown)
    if not rounding <= _SHARE * error:
        raise SearchError(
            f"The orbit itself is known to {rounding:.1e} only, which the linear start cannot "
            "undercut: ask for a larger error, or find the orbit with a smaller rtol."
        )
    with np.errstate(invalid="ignore"):  # where motions end
        falls = rungs[:-1] / np.maximum(rungs[1:], np.finfo(float).tiny) >= _QUADRATIC
    for i, e in enumerate(es):
        if rungs[i] + rounding <= error:
            return float(e), float(rungs[i] + rounding)
        if i > 1 and falls[i - 2] and falls[i - 1]:
            e_wanted = float(e * math.sqrt((error - rounding) / rungs[i]))
            return e_wanted, float(error)
    raise SearchError(
        "No linear start is accurate enough: the estimated error does not fall as the square of "
        "the step-off. Ask for a larger error."
    )


def linear_starts(scene: Scene, near: Directions, e: float, signs: tuple[int, ...]) -> np.ndarray:
    """(signs * n, k) linear starts, branch by branch, on the constraints of the scene."""
    ys = np.concatenate([near.base + sign * e * near.tangent for sign in signs])
    return np.asarray(_project(scene, jnp.asarray(np.tile(near.times, len(signs))), ys))


def _misses(scene: Scene, near: Directions, ladder: np.ndarray, rtol: float) -> np.ndarray:
    """(rungs,) the largest distance between image and prediction, infinite where a motion ends."""
    before = np.concatenate([near.base + e * near.before for e in ladder])
    after = np.concatenate([near.base + e * near.tangent for e in ladder])
    t0 = np.tile(near.times, len(ladder))
    y0s = np.asarray(_project(scene, t0, before))
    ends = ensemble.run(scene, y0s, t0 + near.span, t0=t0, rtol=rtol)
    after = _project(scene, t0, after)
    apart = np.asarray(differences(scene.system, ends.y1, after)) / near.each
    apart = np.linalg.norm(apart, axis=1)
    apart = np.where(np.isfinite(apart), apart, np.inf)
    return apart.reshape(len(ladder), -1).max(axis=1)


@jax.jit
def _project(scene: Scene, ts: Array, ys: Array) -> Array:
    return jax.vmap(scene.system.project)(ts, ys)


# ---- Stable and unstable manifolds of periodic orbits and equilibria, as ensembles of strands

#: Default tolerance of the integrations.
RTOL = 1e-12
#: Default error of the linear starts.
ERROR = 1e-8
#: By default a strand lasts until its tangent has grown from the step-off to 1, and then for so
#: many e-folding times more.
_MORE = 3.0
_BRANCHES = {"both": (1, -1), "+": (1,), "-": (-1,)}


@check_first
def manifold(
    orbit: Orbit | Scene,
    kind: str,
    *,
    until: Event | None = None,
    crossings: int = 1,
    time: float | None = None,
    strands: int = 40,
    branch: str = "both",
    which: int | None = None,
    error: float = ERROR,
    samples: int = 200,
    rtol: float = RTOL,
    progress: bool = False,
) -> Manifold:
    """The stable or unstable manifold of an orbit or equilibrium, cut at a section or a time.

    Strands begin a small step off the orbit along its Floquet vectors, which the variational flow
    carries around it, or along the eigenvectors of an equilibrium. The step is as long as the
    wanted error of this linear start allows. Strands are integrated on all cores, those of a stable
    manifold backwards.

    Args:
      orbit: a periodic orbit, or a scene whose start is an equilibrium.
      kind: "stable" or "unstable".
      until: the section at which strands end; without one they end after `time`. Directions of
        crossings are those along the strand, backwards for a stable manifold. If the orbit crosses
        it too, strands end beside the orbit: restrict it to where the orbit is not, as
        ``When(far)`` does with a value ``jnp.where(y[0] < 0, y[1], 1.0)``.
      crossings: number of the crossing at which strands end; those beside the orbit count.
      time: length of strands [time of the scene], with a section the largest; by default the time
        until the linear growth reaches 1, and three e-folding times more.
      strands: number of phases of the orbit, or of starts on the circle of a two-dimensional
        manifold of an equilibrium; each has two strands, one of each branch, unless on a circle.
      branch: "+", "-" or "both". On "+" the first entry of the vector at phase 0 grows (the first
        that is not below a tenth of the largest).
      which: number of the multiplier or eigenvalue, where the fastest is 0; at an equilibrium by
        default all of them, of which there may be two.
      error: largest estimated distance of a start from the manifold: the norm of a state whose
        entries are in units of their sizes (`orbits.closing.sizes`).
      samples: number of states on each strand.
      rtol: relative tolerance of a step.
      progress: show a bar.
    Returns:
      The strands, with starts, ends, samples, and a status each.
    Raises:
      ValueError: `orbit` is neither an orbit nor an equilibrium, or has no such multiplier; another
        argument is out of its range.
      SearchError: the wanted error is not reached.
    Limits: host only. Manifolds of orbits belong to one real multiplier, so that those of the map
      over a period are one-dimensional; manifolds of equilibria have one or two dimensions. Orbits
      that close only up to a rotation are refused.
    Reference: Krauskopf et al. (2005), Int. J. Bifurcation Chaos 15, 763; Koon, Lo, Marsden & Ross
      (2000), Chaos 10, 427.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> upright = scenes.pendulum().starting([3.141592653589793, 0.0])
      >>> out = orbits.manifold(upright, "unstable", time=3.0)
      >>> len(out), bool(out.ok.all()), out.linear_error <= 1e-8
      (2, True, True)
    """
    _checks.check_on_host("orbit", orbit, "Manifolds are computed on the host.")
    _checks.choice("kind", kind, SENSES)
    _checks.choice("branch", branch, _BRANCHES)
    n, crossings = _checks.whole("strands", strands), _checks.whole("crossings", crossings)
    samples = _checks.whole("samples", samples, 2)
    error = float(_checks.positive("error", error, "It is a distance of states."))
    scene = orbit.scene if isinstance(orbit, Orbit) else check_scene(orbit)
    if until is not None:
        if not isinstance(until, Event):
            raise _checks.fail("until", "an event", repr(until), "See jaxdyn.integrate.events.")
        as_events(until, len(scene.y0))
    near = _directions(orbit, kind, n, which, rtol)
    circle = len(near.multipliers) > 1
    signs = (1,) if circle else _BRANCHES[branch]
    e, reached = choose_step_off(scene, near, signs, error, rtol)
    y0s, t0s = linear_starts(scene, near, e, signs), np.tile(near.times, len(signs))
    longest = (np.log(1 / min(e, 1.0)) + _MORE) / near.rate if time is None else time
    longest = float(_checks.positive("time", longest, "It is the length of a strand."))
    t1s = t0s + SENSES[kind] * longest
    ts, ends, status = _run(scene, y0s, t0s, t1s, until, crossings, rtol, progress)
    stops = np.where(status == Status.OK, ts, t0s)
    sample_ts = t0s[:, None] + (stops - t0s)[:, None] * np.linspace(0.0, 1.0, samples)
    states = np.array(_sample(scene, t0s, y0s, sample_ts, rtol))
    states[status != Status.OK] = np.nan
    return Manifold(
        scene=scene,
        kind=kind,
        orbit=orbit if isinstance(orbit, Orbit) else None,
        base=np.tile(near.base, (len(signs), 1)),
        phases=np.tile(_phases(near, circle), len(signs)),
        branches=np.repeat(signs, len(near.base)),
        multipliers=near.multipliers,
        step_off=e,
        linear_error=reached,
        t0s=t0s,
        starts=y0s,
        ts=ts,
        ends=ends,
        status=status,
        sample_ts=sample_ts,
        samples=states,
        rtol=float(rtol),
    )


def _directions(orbit: Orbit | Scene, kind: str, n: int, which, rtol: float) -> Directions:
    if not isinstance(orbit, Orbit):
        return of_equilibrium(orbit, orbit.y0, kind, n, which)
    if not orbit.ok:
        raise _checks.fail("orbit", "a periodic orbit", orbit.outcome.name, orbit.message)
    if orbit.closing.turns:
        remedy = "Write the scene in a frame that rotates with the orbit."
        raise _checks.fail("orbit", "one that closes without a rotation", "a relative one", remedy)
    return of_orbit(orbit, kind, n, 0 if which is None else which, rtol)


def _phases(near: Directions, circle: bool) -> np.ndarray:
    n = len(near.base)
    return np.arange(n) / n if circle else np.mod(near.times / abs(near.span), 1.0)


def _run(scene: Scene, y0s, t0s, t1s, until: Event | None, crossings: int, rtol, progress):
    """Times, states and statuses of the ends."""
    if until is None:
        ends = ensemble.run(scene, y0s, t1s, t0=t0s, rtol=rtol, progress=progress)
        return ends.t, ends.y1, np.asarray(ends.status)
    watch = EachCrossing(scene.field, until, jnp.asarray(crossings), crossings)
    ends = ensemble.run(scene, y0s, t1s, t0=t0s, rtol=rtol, watch=watch, progress=progress)
    status = np.array(ends.status)
    few = (status == Status.OK) & (ends.seen.count < crossings)
    status[few | ends.seen.lost] = Status.FEW_CROSSINGS
    missed = status != Status.OK
    ts = np.where(missed, ends.t, ends.seen.ts[:, crossings - 1])
    return ts, np.where(missed[:, None], np.nan, ends.seen.ys[:, crossings - 1]), status


@jax.jit
def _sample(scene: Scene, t0s: Array, y0s: Array, ts: Array, rtol) -> Array:
    """(n, s, k) states at the times of each strand."""

    def one(t0, y0, ts):
        return quick_solve(scene.starting(y0), ts[-1], t0=t0, ts=ts, rtol=rtol).ys

    return jax.lax.map(lambda strand: one(*strand), (t0s, y0s, ts))
