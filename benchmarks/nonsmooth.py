"""How fast are motions with switches, at equal true error, and do they keep the order of a method?

Run: ``python -m benchmarks nonsmooth``. Five problems of `benchmarks.switched`: a converter with a
voltage that is switched by time, a ball that bounces on a spring, a pendulum with dry friction that
comes to rest, a relay, gears with play. Ours, diffrax and "SciPy DOP853" are given the rate as it
is written; "by hand" means a program that knows the switches: heyoka with terminal events that set
a parameter of the formulas, SciPy with its events. Errors are the largest at the end, relative to
the largest number of the state, against heyoka by hand in 80-bit floats. diffrax and SciPy give up
after 20 000 steps, which they need where friction chatters. Relative and absolute tolerance are the
same number for all: our default absolute tolerance depends on the sizes of a whole motion, which a
piece of it does not know.

A second table has the time of the default beside that of the same pieces as smooth problems, whose
ends are given, by the same pair; the notes have the steps of both at several tolerances, and the
slope of the error over the number of steps, in logarithms: above the order of the pair, 9, since a
piece takes few steps.

Last numbers (2 cores under load, 2026-11). Steps at tolerances of 1e-4 to 1e-12 with switches, and
of the pieces, which begin with a shorter step each: converter (99 switches) 163 to 315, 249 to 501;
ball (8) 21 to 80, 35 to 104; friction (8) 28 to 137, 37 to 155; relay (16) 49 to 197, 60 to 236;
gears (20) 43 to 166, 65 to 218. Slopes 11 to 13, of the pieces 13 to 16; the converter's is 6, as
most of its pieces are one step. The search for switches makes a solve 4 to 7 times as long.
Times over those of others (minima) at errors of 1e-6, 1e-9, 1e-12: heyoka by hand 2.1, 2.1, 2.1 for
the converter, 3.6, 4.2, 5.8 for the ball, 4.6, 5.7, 8.4 for friction, 3.6, 4.5, 8.1 for the relay,
5.1, 6.5, 9.8 for the gears. diffrax's Dopri8 0.19, 0.12, 0.06; 0.66, 0.62, none; none; 0.45, 0.39,
0.46; 1.5, 1.3, none; its Tsit5 0.49, 0.24, none; 1.2, 0.81, none; none; 0.84, 0.49, none; 1.4,
0.68, none. SciPy by hand takes 40 to 110 times as long as ours. First runs take 2.4 s for the
converter and 11 to 19 s for the others.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

import jaxdyn
from benchmarks import _peers, switched
from benchmarks._timing import Curves, Method, Row, Run, interleave, work_precision
from benchmarks.switched import MAX_STEPS, SWITCHED, Leg, Switched
from benchmarks.systems import SCIPY
from jaxdyn.integrate.simulation import solve
from jaxdyn.solvers import VERNER9

#: True errors compared at.
ERRORS = (1e-6, 1e-9, 1e-12)
TOLERANCES = tuple(float(f"1e-{e}") for e in (4, 6, 8, 10, 12, 13, 14))
_SCIPY_FINEST = 3e-14  # it refuses smaller ones
#: Tolerances for counting the steps of pieces, at which rounding hides no error.
_COUNTED = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
_SHOWN = 1e-10
_ROUNDS, _QUICK_ROUNDS = 8, 2


def run(quick: bool = False) -> list[Curves | Row]:
    """Times of every method that is installed; `quick` for a rough estimate."""
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    found: list[Curves | Row] = []
    for name, make in SWITCHED.items():
        problem = make()
        legs = true_legs(problem)
        ours = whole(problem, legs)
        found.append(curves(name, problem, ours, rounds))
        found.append(beside_pieces(name, ours, as_smooth(problem, legs), rounds))
    return found


class Counted(NamedTuple):
    """Steps and error of a run at one tolerance."""

    steps: int
    error: float


class Way(NamedTuple):
    """A way to solve a problem.

    Attributes:
      solved: function of a tolerance that returns the number of steps and the compared states.
      truth: those states.
    """

    solved: Any
    truth: np.ndarray

    def run(self, tol: float) -> Run:
        """A run at a tolerance."""
        known = jnp.asarray(tol)
        return lambda: np.asarray(self.solved(known)[1])

    def counted(self) -> list[Counted]:
        """Steps and errors at all tolerances."""
        scale, found = np.max(np.abs(self.truth)), []
        for tol in _COUNTED:
            steps, ends = self.solved(jnp.asarray(tol))
            found.append(Counted(int(steps), float(np.max(np.abs(ends - self.truth)) / scale)))
        return found


def true_legs(problem: Switched) -> list[Leg]:
    """The legs of a problem by a method that is not ours, as accurately as possible."""
    if _peers.importable("heyoka"):
        return switched.heyoka_legs(problem, 1e-18, np.longdouble)()
    return switched.scipy_legs(problem, _SCIPY_FINEST)()


def curves(
    name: str,
    problem: Switched,
    ours: Way,
    rounds: int,
    tolerances: Sequence[float] = TOLERANCES,
) -> Curves:
    """Error against time of all methods for one problem."""
    methods = {"jaxdyn": Method(ours.run, tolerances)}
    if _peers.importable("heyoka"):
        methods["heyoka by hand"] = Method(
            lambda tol: switched.end_of(switched.heyoka_legs(problem, tol)), tolerances
        )
    for solver in (diffrax.Dopri8(), diffrax.Tsit5()):
        build = functools.partial(_peers.diffrax_run, problem, solver, max_steps=MAX_STEPS)
        methods[f"diffrax {type(solver).__name__}"] = Method(build, tolerances)
    if _peers.importable("scipy", "numba"):
        coarse = [tol for tol in tolerances if tol > _SCIPY_FINEST]
        methods[SCIPY] = Method(functools.partial(switched.scipy_plain, problem), coarse)
        methods[f"{SCIPY} by hand"] = Method(
            lambda tol: switched.end_of(switched.scipy_legs(problem, tol)), coarse
        )
    return work_precision(f"switches: {name}", methods, ours.truth, ERRORS, rounds, slow=1e-2)


def beside_pieces(name: str, ours: Way, pieces: Way, rounds: int) -> Row:
    """The default beside its pieces as smooth problems: times, and a note with steps and slopes."""
    counted = {"with switches": ours.counted(), "its pieces": pieces.counted()}
    times = interleave(
        {"jaxdyn": ours.run(_SHOWN), "its pieces, smooth": pieces.run(_SHOWN)}, rounds
    )
    lines = [
        f"{which} {', '.join(str(each.steps) for each in found)} steps, slope {slope(found):.1f}"
        for which, found in counted.items()
    ]
    tolerances = f"{_COUNTED[0]:.0e} to {_COUNTED[-1]:.0e}"
    note = f"{len(pieces.truth) - 1} switches; tolerances {tolerances}: {'; '.join(lines)}"
    return Row(f"switches: {name}, tolerance {_SHOWN:.0e}", times, note=note)


def whole(problem: Switched, legs: list[Leg]) -> Way:
    """The default, given the rate as it is written."""
    scene = problem.scene

    @jax.jit
    def solved(tol):
        found = solve(scene, scene.t1, rtol=tol, atol=tol, fixed=True)
        return found.steps, found.y1[None]

    return Way(solved, legs[-1].y1[None])


def as_smooth(problem: Switched, legs: list[Leg]) -> Way:
    """Each leg as a smooth problem of its own, between times that are given."""
    piece = problem.piece(jnp)
    starts = [
        jnp.asarray(np.array(column)) for column in zip(*(leg[:4] for leg in legs), strict=True)
    ]

    @jax.jit
    def solved(tol):
        def each(leg):
            t0, y0, mode, t1 = leg
            scene = jaxdyn.ode(piece, y0, t1, params=mode)
            found = solve(scene, t1, t0=t0, rtol=tol, atol=tol, solver=VERNER9)
            return found.steps, found.y1

        steps, ends = jax.lax.map(each, starts)
        return jnp.sum(steps), ends

    return Way(solved, np.array([leg.y1 for leg in legs]))


def slope(found: Sequence[Counted]) -> float:
    """Minus the slope of the error over the number of steps, both in logarithms."""
    steps, errors = np.log(np.array(found)).T
    return -float(np.polyfit(steps, errors, 1)[0])
