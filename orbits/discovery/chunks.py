"""One unit of work of a search: from sampled starts to verified orbits.

The samples of a chunk are screened for close returns, their guesses are refined side by side,
those that lead to different orbits are refined further by `find`, and orbits found are reduced to
their shortest period and verified by another integrator. The result of a chunk depends only on
the plan and its number.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import fail, host_array
from jaxdyn.analysis.energy import energy
from jaxdyn.status import IntegrationError
from orbits.analysis.evidence import recheck
from orbits.analysis.identity import scale_free_period
from orbits.analysis.stability import stability
from orbits.closing.closings import Closing
from orbits.closing.sizes import sizes
from orbits.discovery.journal import Chunk, Find
from orbits.discovery.screening import Guesses, close_returns, refine
from orbits.discovery.several import over_shortest_period
from orbits.discovery.workers import unpack
from orbits.motion import gravitates, quick_solve
from orbits.orbit import Orbit, Outcome
from orbits.shooting.finding import find

#: An orbit is verified if its closing error by another integrator is below this, in sizes.
VERIFIED = 1e-7
_GOAL = 1e-10  # Newton's method continues to rounding, which for some orbits is no lower
_ITERATIONS = 15  # five suffice from a refined guess; more mean that there is no orbit
_TOGETHER = 1e-4  # relative: a refined guess this close to an orbit leads to it
_SAMPLES = 1024  # samples of an orbit

MOST = 2**53  # largest seed, which files keep as a float

#: (indices of samples, seed) -> their starts (n, k).
Sampler = Callable[[np.ndarray, int], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Box:
    """Samples drawn uniformly from a box, each from its index and the seed.

    Attributes:
      low: (d,) lower corner.
      high: (d,) upper corner.
      make: from points of the box (n, d) to starts (n, k); a module-level function.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    make: Callable[[np.ndarray], np.ndarray] = np.asarray

    def __call__(self, numbers: np.ndarray, seed: int) -> np.ndarray:
        """(n, k) starts."""
        low = host_array("low", self.low, (None,))
        high = host_array("high", self.high, low.shape, "One for each of low.")
        random = [np.random.default_rng([seed, i]).random(len(low)) for i in numbers.tolist()]
        return self.make(low + (high - low) * np.array(random))


@dataclasses.dataclass(frozen=True)
class Starts:
    """Given samples, e.g. of a grid or a published table.

    Attributes:
      y0s: (n, k) starts.
    """

    y0s: np.ndarray

    def __call__(self, numbers: np.ndarray, seed: int) -> np.ndarray:
        """(n, k) starts."""
        del seed
        y0s = host_array("y0s", self.y0s, (None, None), "One row for each start.")
        if numbers.max(initial=0) >= len(y0s):
            remedy = "Ask for as many, or give more rows."
            raise fail("samples", f"at most the {len(y0s)} rows of Starts", "more", remedy)
        return y0s[numbers]


def keep(orbit: Orbit) -> Orbit:
    """The orbit, unchanged."""
    return orbit


def no_label(orbit: Orbit) -> str:
    """An empty label."""
    del orbit
    return ""


def seed_from(seed: int, rng: int | np.random.Generator | None) -> int:
    """The seed of a search, which may be given as `rng` (SPEC 7 of Scientific Python).

    Raises:
      ValueError: both are given, or `rng` is neither a whole number nor a generator.
    """
    if rng is None:
        return seed
    if seed != 0:
        raise fail("rng", "either rng or seed", "both", "They say the same; rng is the newer name.")
    if isinstance(rng, np.random.Generator):
        return int(rng.integers(MOST))
    if isinstance(rng, int | np.integer) and not isinstance(rng, bool):
        return int(rng)
    remedy = "Pass a seed, or np.random.default_rng(seed)."
    raise fail("rng", "a whole number or a generator of NumPy", repr(rng), remedy)


class Plan(NamedTuple):
    """The arguments of a search, as sent to the workers: see `search`.

    `each` has the sizes (k,) of the entries of a state, those of the first chunk of samples.
    """

    scene: Scene
    sampler: Sampler
    closing: Closing
    samples: int
    chunk: int
    seed: int
    shortest: float
    longest: float
    windows: int
    close: float
    limit: np.ndarray
    each: np.ndarray
    normal: Callable[[Orbit], Orbit]
    label: Callable[[Orbit], str]
    rtol: float

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.samples // self.chunk)


def work(plan: Plan, number: int) -> Chunk:
    """The result of one chunk; called by an executor."""
    plan = plan._replace(scene=unpack(plan.scene))
    numbers = np.arange(number * plan.chunk, min((number + 1) * plan.chunk, plan.samples))
    starts = plan.sampler(numbers, plan.seed)
    guesses = close_returns(
        plan.scene,
        starts,
        plan.closing,
        shortest=plan.shortest,
        longest=plan.longest,
        windows=plan.windows,
        close=plan.close,
        limit=plan.limit,
        each=plan.each,
    )
    near = refine(plan.scene, plan.closing, guesses, plan.each)
    tried: list[_Tried] = []
    finds: list[Find] = []
    # The shortest first, so that guesses of several periods are recognised.
    for i in np.lexsort((near.index, near.periods)):
        form = plan.normal(_guess(plan, near, i))
        if near.periods[i] > plan.longest or any(earlier.contains(form) for earlier in tried):
            continue
        orbit = _polish(plan, near.y0s[i], near.periods[i])
        tried.append(_Tried.of(form if orbit is None else orbit))
        found = None if orbit is None else _verify(plan, int(numbers[near.index[i]]), orbit)
        if found is not None:
            finds.append(found)
    counts = {
        "samples": len(numbers),
        "guesses": len(guesses.index),
        "refined": len(near.index),
        "polished": len(tried),
        "orbits": len(finds),
    }
    return Chunk(number, counts, tuple(sorted(finds, key=lambda f: (f.sample, f.period))))


class _Tried(NamedTuple):
    """A guess that failed, or an orbit: its period, samples of it, and sizes of the entries."""

    period: float
    ys: np.ndarray
    each: np.ndarray

    @classmethod
    def of(cls, orbit: Orbit) -> "_Tried":
        each = sizes(orbit.scene)
        if not orbit.ok:
            return cls(orbit.period, np.asarray(orbit.y0)[None], each)
        ts = np.arange(_SAMPLES) * orbit.period / _SAMPLES
        ys = np.asarray(quick_solve(orbit.scene, orbit.period, ts=ts, rtol=1e-10).ys)
        return cls(orbit.period, np.append(ys, ys[:1], axis=0), each)

    def contains(self, guess: Orbit) -> bool:
        """Whether a guess lies on this orbit and has a multiple of its period."""
        times = guess.period / self.period
        y, whole = np.asarray(guess.y0), max(1, round(times))
        if abs(times - whole) > _TOGETHER * whole:
            return False
        return _distance(y / self.each, self.ys / self.each) <= _TOGETHER


def _distance(y: np.ndarray, ys: np.ndarray) -> float:
    """Distance of a point (k,) from the polyline through points (s, k)."""
    if len(ys) == 1:
        return float(np.linalg.norm(y - ys[0]))
    side, off = np.diff(ys, axis=0), y - ys[:-1]
    along = np.einsum("sk,sk->s", side, off) / np.maximum(np.einsum("sk,sk->s", side, side), 1e-300)
    nearest = off - np.clip(along, 0.0, 1.0)[:, None] * side
    return float(np.linalg.norm(nearest, axis=1).min())


def _guess(plan: Plan, guesses: Guesses, i: int) -> Orbit:
    scene = plan.scene.starting(guesses.y0s[i], guesses.periods[i])
    return Orbit(
        scene=scene,
        closing=plan.closing,
        residual=guesses.gaps[i],
        outcome=Outcome.ITERATION_LIMIT,
        iterations=0,
        rtol=plan.rtol,
    )


def _polish(plan: Plan, y0, period) -> Orbit | None:
    """The orbit at a guess, in normal form and over its shortest period; None if there is none."""

    def closest(y0, period, closing: Closing) -> Orbit:
        return find(
            plan.scene,
            y0,
            period,
            closing=closing,
            goal=_GOAL,
            rtol=plan.rtol,
            max_iterations=_ITERATIONS,
            throw=False,
        )

    orbit = over_shortest_period(closest(y0, period, plan.closing), closest)
    if orbit is None:
        return None
    orbit = plan.normal(orbit)
    return orbit if plan.shortest <= orbit.period <= plan.longest else None


def _verify(plan: Plan, sample: int, orbit: Orbit) -> Find | None:
    y0 = np.asarray(orbit.y0)
    again = recheck(orbit).closure
    if not again <= VERIFIED:
        return None
    linear = stability(orbit, throw=False)
    if not linear.ok:
        return None
    try:
        label = plan.label(orbit)
    except IntegrationError:  # the label's integration fails at a near collision
        return None
    return Find(
        sample=sample,
        y0=tuple(y0.tolist()),
        period=orbit.period,
        closing=0 if orbit.closing == plan.closing else 1,
        residual=float(orbit.residual),
        s_period=orbit.s_period or 0.0,
        recheck=again,
        invariant=_invariant(orbit),
        verdict=linear.verdict,
        multiplier=float(np.abs(linear.multipliers).max()),
        label=label,
    )


def _invariant(orbit: Orbit) -> float:
    scene = orbit.scene
    e = float(energy(scene, jnp.zeros(()), orbit.y0)) if gravitates(scene) else 0.0
    return scale_free_period(scene, orbit.period, e) or orbit.period
