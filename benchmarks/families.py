"""How do orbits and families compare with those of peers, in time, error and lines?

Run: ``python -m benchmarks families``. Van der Pol's cycle at mu = 5 and 100 by collocation: ours
(`orbits.find` with `collocation=True`) and SciPy's `solve_bvp`, from a motion of about the period;
the error is that of the period, by another method. Then ten halo orbits about L1 of Earth and Moon,
from a start of six digits: ours and hiten's, if that is installed (`pip install hiten`; it is no
part of `jaxdyn[benchmark]`); the error is the largest closing error, in one integration at rtol
1e-13. Lines are those of the functions below. Times are of a run after the first, compiled.

Last numbers (2 cores under six times their load, 2026-11; hiten 0.5.4, SciPy 1.17):
van der Pol's cycle at mu = 5: ours 0.20 s, error 4e-16, 2 lines; `solve_bvp` 4.8 s (its guess
included), 2e-12, 23 lines. At mu = 100: ours 1.0 s, 3e-12 (of which most is the reference's own);
`solve_bvp` 12 s, 8e-10; from a guess that starts where the cycle is slow it diverges. Ten halo
orbits: ours 1.2 s, closing to 4e-13, 5 lines; hiten 37 s, to 1.3e-8, 10 lines. Ours first compile,
for 10 s each with stored programs and a minute without on that machine; hiten's first run took
168 s, and its import 71 s.
"""

import inspect
import time
from collections.abc import Callable

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


def run(quick: bool = False) -> list[Row]:
    """Times, errors and lines of cycles by collocation, and of a halo family."""
    rows = [_cycle(mu) for mu in (list(CYCLES)[:1] if quick else CYCLES)]
    return [*rows, _halos(quick)]


def rate(t, y, mu):
    """x'' = mu (1 - x^2) x' - x."""
    x, v = y
    return [v, mu * (1 - x * x) * v - x]


def our_cycle(mu: float, guess: float) -> float:
    """The period."""
    scene = jaxdyn.ode(rate, [2.0, 0.0], guess, params=mu)
    return orbits.find(scene, collocation=True).period


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
    first = _seconds(lambda: our_cycle(mu, guess))
    found = {"ours": our_cycle(mu, guess), "solve_bvp": scipy_cycle(mu, guess)}
    times = {
        "ours": _times(lambda: our_cycle(mu, guess)),
        "solve_bvp": _times(lambda: scipy_cycle(mu, guess)),
    }
    errors = {name: abs(period / PERIODS[mu] - 1) for name, period in found.items()}
    return Row(
        f"cycle of van der Pol, mu = {mu:g}",
        times,
        note=_note(errors, {"ours": our_cycle, "solve_bvp": scipy_cycle}, first),
    )


def restricted(t, y, mu):
    """The restricted three bodies in space, in turning axes."""
    x, y_, z, vx, vy, vz = y
    one = (1 - mu) / ((x + mu) ** 2 + y_**2 + z**2) ** 1.5
    two = mu / ((x - 1 + mu) ** 2 + y_**2 + z**2) ** 1.5
    ax = 2 * vy + x - one * (x + mu) - two * (x - 1 + mu)
    return [vx, vy, vz, ax, y_ - 2 * vx - (one + two) * y_, -(one + two) * z]


def our_halos() -> list[tuple[np.ndarray, float]]:
    """Starts and periods."""
    mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
    scene = jaxdyn.ode(restricted, HALO, HALO_PERIOD, params=HALO_MU)
    first = orbits.find(scene, closing=orbits.reversal(mirror), hold="y2")
    family = orbits.continue_family(first, members=MEMBERS, step=5e-3)
    return [(np.asarray(x.orbit.y0), x.orbit.period) for x in family.members]


def hiten_halos() -> list[tuple[np.ndarray, float]]:
    """Starts and periods."""
    from hiten import System
    from hiten.algorithms.continuation.options import OrbitContinuationOptions

    point = System.from_bodies("earth", "moon").get_libration_point(1)
    seed = point.create_orbit("halo", initial_state=HALO)
    seed.correct()
    seed.propagate()
    z = seed.initial_state[2]
    options = OrbitContinuationOptions(target=([z], [z + 2.0]), step=5e-3, max_members=MEMBERS)
    found = seed.generate(options).family
    return [(np.asarray(orbit.initial_state), orbit.period) for orbit in found]


def _halos(quick: bool) -> Row:
    methods: dict[str, Callable] = {"ours": our_halos}
    if not quick and importable("hiten"):
        methods["hiten"] = hiten_halos
    first = _seconds(our_halos)
    found = {name: method() for name, method in methods.items()}
    times = {name: _times(method) for name, method in methods.items()}
    errors = {name: max(_closing(y0, period) for y0, period in x) for name, x in found.items()}
    return Row(f"{MEMBERS} halo orbits about L1", times, note=_note(errors, methods, first))


def _closing(y0: np.ndarray, period: float) -> float:
    scene = jaxdyn.ode(restricted, y0, period, params=HALO_MU)
    return float(np.abs(np.asarray(jaxdyn.solve(scene, period, rtol=1e-13).y1) - y0).max())


def _times(work: Callable) -> Times:
    """Of one run after the first: those of a minute need no second one."""
    spent = _seconds(work)
    return Times(spent, spent)


def _seconds(work: Callable) -> float:
    start = time.perf_counter()
    jax.block_until_ready(work())
    return time.perf_counter() - start


def _note(errors: dict[str, float], methods: dict[str, Callable], first: float) -> str:
    lines = {
        name: sum(bool(line.strip()) for line in inspect.getsource(method).splitlines()[2:])
        for name, method in methods.items()
    }
    each = ", ".join(f"{name} {errors[name]:.1e} in {lines[name]} lines" for name in methods)
    return f"errors: {each}; ours compiles and runs first in {first:.0f} s"
