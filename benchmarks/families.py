"""How do orbits and families compare with those of peers, in time, error and lines?

Run: ``python -m benchmarks families``. Van der Pol's cycle at mu = 5 and 100 by collocation: ours
(`orbits.find` with `orbits.Collocation()`) and SciPy's `solve_bvp`, from a motion of about the
period; the error is that of the period, by another method. Then ten halo orbits about L1 of Earth
and Moon, from a start of six digits: ours and hiten's, if that is installed (`pip install hiten`;
it is not part of `jaxdyn[benchmark]`); the error is the largest closing error, in one integration
at rtol 1e-13. Then 50 strands of the unstable manifold of the first one: hiten starts 1e-6 off the
orbit, ours as far as the error of the linear start, 1e-8, allows, which it measures first; the
error is that of the integration from the starts that each gives, at the ends. Lines are those of
the functions below. Times are of a run after the first, compiled.

Last numbers (2 cores with other work, 2026-11; hiten 0.5.4, SciPy 1.17; first runs in brackets,
which compile, ours with stored programs): van der Pol's cycle at mu = 5: ours 51 ms (5 s), error
8e-16, 2 lines; `solve_bvp` 0.84 s, its guess included, 2e-12, 23 lines. At mu = 100: ours 0.20 s,
3e-12 (of which most is the reference's own); `solve_bvp` 1.6 s, 8e-10; from a guess that starts
where the cycle is slow it diverges. Ten halo orbits: ours 0.10 s (3 s), their stability and special
points included, closing to 2e-13, 5 lines; hiten, in a run before, 0.08 to 0.09 s (15 to 33 s), to
1.4e-9, 10 lines. Fifty strands: ours 0.03 s (3 s), errors 2e-10, 7 lines; hiten 0.05 to 0.08 s (5
s), 1e-6, 9 lines, at its own tolerances.
"""

import functools
import inspect
import math
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

import jaxdyn
import orbits
from benchmarks._peers import importable
from benchmarks._timing import Row, Times

#: Guesses of the period.
CYCLES = {5.0: 11.6, 100.0: 162.8}
#: The period by shooting; and by `solve_bvp` at a tolerance of 1e-8 with 100 000 nodes.
PERIODS = {5.0: 11.612230667719569, 100.0: 162.8370710918647}
#: Tolerances of SciPy: at the finer one for mu = 100, 1e-8, it ends at 100 000 nodes.
BVP_TOLERANCES = {5.0: 1e-8, 100.0: 1e-6}
#: A halo orbit about L1, to six digits, and the share of the Moon that hiten takes.
HALO, HALO_PERIOD, HALO_MU = (
    (0.823428, 0.0, 0.032466, 0.0, 0.142166, 0.0),
    2.749902,
    0.012154535289174722,
)
MEMBERS = 10
STRANDS, STRAND_TIME = 50, 1.5 * math.pi
STRAND_SAMPLES = 200


def run(quick: bool = False) -> list[Row]:
    """Times, errors and lines of cycles by collocation, of a halo family, and of a manifold."""
    rows = [_cycle(mu) for mu in (list(CYCLES)[:1] if quick else CYCLES)]
    return [*rows, _halos(quick), _manifolds(quick)]


def rate(t, y, mu):
    """x'' = mu (1 - x^2) x' - x."""
    x, v = y
    return [v, mu * (1 - x * x) * v - x]


def our_cycle(mu: float, guess: float) -> float:
    """The period."""
    scene = jaxdyn.ode(rate, [2.0, 0.0], guess, params=mu)
    return orbits.find(scene, strategy=orbits.Collocation()).period


def scipy_cycle(mu: float, guess: float) -> float:
    """The period. A cycle that starts on its slow part, at v = 0, diverges at mu = 100."""
    from scipy.integrate import solve_bvp, solve_ivp

    def turns(t, y):
        return y[0]

    def scaled(s, y, p):
        return p[0] * np.array(rate(s, y, mu))

    def closes(here, there, p):
        return np.array([*(here - there), here[0]])

    motion = solve_ivp(
        lambda t, y: rate(t, y, mu),
        (0, 4 * guess),
        [2.0, 0.0],
        "Radau",
        rtol=1e-8,
        atol=1e-10,
        events=turns,
        dense_output=True,
    )
    start, end = motion.t_events[0][[1, 3]]
    inside = motion.t[(start < motion.t) & (motion.t < end)]
    t = np.concatenate([[start], inside, [end]])
    s, tol = (t - start) / (end - start), BVP_TOLERANCES[mu]
    found = solve_bvp(scaled, closes, s, motion.sol(t), p=[end - start], tol=tol, max_nodes=100_000)
    return float(found.p[0])


def _cycle(mu: float) -> Row:
    guess = CYCLES[mu]
    first = {"ours": _seconds(lambda: our_cycle(mu, guess))}
    found = {"ours": our_cycle(mu, guess), "solve_bvp": scipy_cycle(mu, guess)}
    times = {
        "ours": _times(lambda: our_cycle(mu, guess)),
        "solve_bvp": _times(lambda: scipy_cycle(mu, guess)),
    }
    errors = {name: abs(period / PERIODS[mu] - 1) for name, period in found.items()}
    return Row(
        f"cycle of van der Pol, mu = {mu:g}",
        times,
        note=_note(errors, {"ours": our_cycle, "solve_bvp": scipy_cycle}, first, {}),
    )


def restricted_rate(t, y, mu):
    """The restricted three-body problem in space, in rotating axes."""
    x, y_, z, vx, vy, vz = y
    one = (1 - mu) / ((x + mu) ** 2 + y_**2 + z**2) ** 1.5
    two = mu / ((x - 1 + mu) ** 2 + y_**2 + z**2) ** 1.5
    ax = 2 * vy + x - one * (x + mu) - two * (x - 1 + mu)
    return [vx, vy, vz, ax, y_ - 2 * vx - (one + two) * y_, -(one + two) * z]


def our_halo() -> orbits.Orbit:
    """The first one."""
    mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
    scene = jaxdyn.ode(restricted_rate, HALO, HALO_PERIOD, params=HALO_MU)
    return orbits.find(scene, closing=orbits.reversal(mirror), hold="y2")


def our_halos() -> list[tuple[np.ndarray, float]]:
    """Starts and periods."""
    family = orbits.continue_family(our_halo(), members=MEMBERS, step=5e-3)
    return [(np.asarray(x.orbit.y0), x.orbit.period) for x in family.members]


@functools.cache
def hiten_point() -> Any:
    """L1, made once, since hiten compiles again for each."""
    from hiten import System

    return System.from_bodies("earth", "moon").get_libration_point(1)


def hiten_halo() -> Any:
    """The first one."""
    seed = hiten_point().create_orbit("halo", initial_state=HALO)
    seed.correct()
    seed.propagate()
    return seed


HALOS: dict[str, Callable] = {"ours": our_halo, "hiten": hiten_halo}


def hiten_halos() -> list[tuple[np.ndarray, float]]:
    """Starts and periods."""
    from hiten.algorithms.continuation.options import OrbitContinuationOptions

    seed = hiten_halo()
    z = seed.initial_state[2]
    options = OrbitContinuationOptions(target=([z], [z + 2.0]), step=5e-3, max_members=MEMBERS)
    found = seed.generate(options).family
    return [(np.asarray(orbit.initial_state), orbit.period) for orbit in found]


def _halos(quick: bool) -> Row:
    methods: dict[str, Callable] = {"ours": our_halos}
    if not quick and importable("hiten"):
        methods["hiten"] = hiten_halos
    first = {name: _seconds(method) for name, method in methods.items()}
    found = {name: method() for name, method in methods.items()}
    times = {name: _times(method) for name, method in methods.items()}
    errors = {name: max(_closing(y0, period) for y0, period in x) for name, x in found.items()}
    note = _note(errors, methods, first, HALOS)
    return Row(f"{MEMBERS} halo orbits about L1", times, note=note)


def our_strands(orbit: orbits.Orbit) -> list[tuple[np.ndarray, np.ndarray]]:
    """Starts and ends."""
    found = orbits.manifold(
        orbit, "unstable", strands=STRANDS, branch="+", time=STRAND_TIME, samples=STRAND_SAMPLES
    )
    return list(zip(found.starts, found.ends, strict=True))


def hiten_strands(orbit: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Starts and ends."""
    found = orbit.manifold(stable=False, direction="positive")
    share, dt = STRAND_TIME / (2 * math.pi), STRAND_TIME / STRAND_SAMPLES
    found.compute(step=1 / STRANDS, integration_fraction=share, dt=dt, show_progress=False)
    assert len(found.trajectories) == STRANDS  # none was discarded
    return [(strand.states[0], strand.states[-1]) for strand in found.trajectories]


def _manifolds(quick: bool) -> Row:
    methods: dict[str, Callable] = {"ours": our_strands}
    if not quick and importable("hiten"):
        methods["hiten"] = hiten_strands
    first = {name: _seconds(lambda name=name: methods[name](HALOS[name]())) for name in methods}
    found = {name: method(HALOS[name]()) for name, method in methods.items()}
    # Another orbit, since hiten caches the manifold of one.
    fresh = {name: HALOS[name]() for name in methods}
    times = {name: _times(lambda name=name: methods[name](fresh[name])) for name in methods}
    errors = {name: max(_end_error(*strand) for strand in x) for name, x in found.items()}
    note = _note(errors, methods, first, HALOS)
    return Row(f"{STRANDS} strands of a halo's manifold", times, note=note)


def _end_error(start: np.ndarray, end: np.ndarray) -> float:
    scene = jaxdyn.ode(restricted_rate, start, STRAND_TIME, params=HALO_MU)
    return float(np.abs(np.asarray(jaxdyn.solve(scene, STRAND_TIME, rtol=1e-14).y1) - end).max())


def _closing(y0: np.ndarray, period: float) -> float:
    scene = jaxdyn.ode(restricted_rate, y0, period, params=HALO_MU)
    return float(np.abs(np.asarray(jaxdyn.solve(scene, period, rtol=1e-13).y1) - y0).max())


def _times(work: Callable) -> Times:
    """Times of one run after the first; runs of a minute need no repetition."""
    spent = _seconds(work)
    return Times(spent, spent)


def _seconds(work: Callable) -> float:
    start = time.perf_counter()
    jax.block_until_ready(work())
    return time.perf_counter() - start


def _note(
    errors: dict[str, float],
    methods: dict[str, Callable],
    first: dict[str, float],
    seeds: dict[str, Callable],
) -> str:
    lines = {name: _lines(method) for name, method in methods.items()}
    for name in lines.keys() & seeds.keys():
        lines[name] += _lines(seeds[name])
    each = ", ".join(f"{name} {errors[name]:.1e} in {lines[name]} lines" for name in methods)
    firsts = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in first.items())
    return f"errors: {each}; first runs, compilation included: {firsts}"


def _lines(function: Callable) -> int:
    """Number of lines besides the heading and a docstring of one line."""
    return sum(bool(line.strip()) for line in inspect.getsource(function).splitlines()[2:])
