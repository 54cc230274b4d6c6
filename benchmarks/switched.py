"""Problems with switches, each as one rate and as pieces whose switches are found by hand.

The rate is written as by a user, with its conditions, and given to jaxdyn, diffrax and SciPy as it
is. The pieces are written as by a careful user, for solvers that do not handle conditions: formulas
with the parameters of a mode, guards that are positive in the mode and end it where they cross
zero, and the mode that follows. heyoka, whose formulas have no conditions, is given these, and so
is SciPy a second time. Both forms are functions of a library, as in `benchmarks.problems`.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

import jaxdyn
from benchmarks import _peers
from benchmarks._timing import Run

#: Numbers of a mode.
Mode = tuple[float, ...]
#: Steps after which a peer that is given the rate as it is gives up, since it chatters.
MAX_STEPS = 20_000


class Switched(NamedTuple):
    """A problem with switches.

    Attributes:
      rate: library with `where`, `sign`, ... -> rate(t, y).
      piece: library -> rate(t, y, u) in a mode u.
      guards: function of (t, y, u), numbers that are positive in the mode.
      after: function of (y, u, i), the mode after guard i, or after a switching time if i is -1.
      mode: the first one.
      start: (k,) state at time 0.
      t1: the span [s].
      times: known switching times, increasing.
    """

    rate: Callable
    piece: Callable
    guards: Callable
    after: Callable[[Any, Mode, int], Mode]
    mode: Mode
    start: Sequence[float]
    t1: float
    times: Sequence[float] = ()

    @property
    def scene(self) -> jaxdyn.Scene:
        """The scene with the rate as it is written."""
        return jaxdyn.ode(_for_jax(self.rate), self.start, self.t1)

    @property
    def y0s(self) -> np.ndarray:
        """(1, k) the start, as in `benchmarks.problems`."""
        return np.array([self.start], float)


@functools.cache
def _for_jax(formulas: Callable) -> Callable:
    return formulas(jnp)


class Leg(NamedTuple):
    """A part of a motion between two switches.

    Attributes:
      t0: its beginning.
      y0: (k,) state there.
      mode: its numbers.
      t1: its end.
      y1: (k,) state there.
    """

    t0: float
    y0: np.ndarray
    mode: Mode
    t1: float
    y1: np.ndarray


# ---- the five problems


def converter() -> Switched:
    """An LC filter whose input voltage is on for a quarter of each of 50 cycles."""
    cycle, cycles = 1e-2, 50

    def piece(lib):
        return lambda t, y, u: [100 * (u[0] - y[1]), 100 * (y[0] - y[1] / 2)]

    def rate(lib):
        def moved(t, y):
            voltage = lib.where(lib.mod(t, cycle) < cycle / 4, 1.0, 0.0)
            return [100 * (voltage - y[1]), 100 * (y[0] - y[1] / 2)]

        return moved

    times = [cycle * (n + part) for n in range(cycles) for part in (0.25, 1.0)][:-1]
    toggled = lambda y, u, i: (1 - u[0],)  # noqa: E731
    end = cycle * cycles
    return Switched(rate, piece, lambda t, y, u: [], toggled, (1.0,), [0.0, 0.0], end, times)


def ball() -> Switched:
    """A ball that falls on a spring with a damper, which push from contact on."""

    def piece(lib):
        return lambda t, y, u: [y[1], -9.81 + (u[0] - 1) / 2 * (1e4 * y[0] + 5 * y[1])]

    def rate(lib):
        def moved(t, y):
            return [y[1], -9.81 - lib.where(y[0] < 0, 1e4 * y[0] + 5 * y[1], 0.0)]

        return moved

    guards = lambda t, y, u: [u[0] * y[0]]  # noqa: E731
    return Switched(rate, piece, guards, lambda y, u, i: (-u[0],), (1.0,), [1.0, 0.0], 3.0)


def pendulum() -> Switched:
    """A pendulum with dry friction at its pivot, which comes to rest after ten half swings."""
    rubs = 0.1

    def piece(lib):
        return lambda t, y, u: [u[1] * y[1], -u[1] * (lib.sin(y[0]) + rubs * u[0])]

    def rate(lib):
        return lambda t, y: [y[1], -lib.sin(y[0]) - rubs * lib.sign(y[1])]

    def after(y, u, i):
        return (-u[0], 1.0 if abs(np.sin(float(y[0]))) > rubs else 0.0)

    guards = lambda t, y, u: [u[0] * y[1] + (1 - u[1])]  # noqa: E731
    return Switched(rate, piece, guards, after, (-1.0, 1.0), [2.05, 0.0], 40.0)


def relay() -> Switched:
    """Three first-order lags in series, driven by a relay with the opposite sign of the output."""

    def piece(lib):
        return lambda t, y, u: [y[1] - y[0], y[2] - y[1], -u[0] - y[2]]

    def rate(lib):
        return lambda t, y: [y[1] - y[0], y[2] - y[1], -lib.sign(y[0]) - y[2]]

    guards = lambda t, y, u: [u[0] * y[0]]  # noqa: E731
    return Switched(rate, piece, guards, lambda y, u, i: (-u[0],), (1.0,), [1.0, 0.0, 0.0], 30.0)


def gears() -> Switched:
    """Two gear wheels with backlash, the first of them driven to and fro."""
    play, stiffness = 0.1, 50.0

    def piece(lib):
        def moved(t, y, u):
            torque = stiffness * u[0] * u[0] * (y[0] - y[1] - play * u[0])
            return [y[2], y[3], lib.cos(2 * t) - torque - 0.1 * y[2], torque - 0.2 * y[3]]

        return moved

    def rate(lib):
        def moved(t, y):
            d = y[0] - y[1]
            torque = stiffness * (d - lib.minimum(lib.maximum(d, -play), play))
            return [y[2], y[3], lib.cos(2 * t) - torque - 0.1 * y[2], torque - 0.2 * y[3]]

        return moved

    def guards(t, y, u):
        d, meets = y[0] - y[1], u[0] * u[0]
        return [
            (1 - meets) * (play - d) + meets * (u[0] * d - play),
            (1 - meets) * (play + d) + meets,
        ]

    def after(y, u, i):
        return (0.0,) if u[0] else ((1.0,) if i == 0 else (-1.0,))

    return Switched(rate, piece, guards, after, (0.0,), [0.0] * 4, 10.0)


SWITCHED = {
    "converter": converter,
    "bouncing ball": ball,
    "dry friction": pendulum,
    "relay": relay,
    "gears with play": gears,
}


# ---- switches by hand


def heyoka_legs(problem: Switched, tol: float, number: type = float) -> Callable[[], list[Leg]]:
    """The legs of a problem, by terminal events that set the mode."""
    import heyoka as hy

    k = len(problem.start)
    y, u = hy.make_vars(*(f"y{i}" for i in range(k))), [hy.par[i] for i in range(len(problem.mode))]
    passed: list[int] = []
    falling = hy.event_direction.negative

    def event(i, guard):
        def switch(integrator, *_):
            passed.append(i)
            return False

        return hy.t_event(guard, callback=switch, direction=falling, fp_type=number)

    guards = problem.guards(hy.time, y, u)
    integrator = hy.taylor_adaptive(
        list(zip(y, problem.piece(hy)(hy.time, y, u), strict=True)),
        np.array(problem.start, number),
        pars=np.array(problem.mode, number),
        t_events=[event(i, guard) for i, guard in enumerate(guards)],
        tol=number(tol),
        fp_type=number,
    )

    def run() -> list[Leg]:
        integrator.time = number(0)
        integrator.state[:] = problem.start
        integrator.pars[:] = problem.mode
        if guards:
            integrator.reset_cooldowns()

        def moved(t0, state, mode, until):
            integrator.pars[:] = mode
            passed.clear()
            integrator.propagate_until(number(until))
            return integrator.time, integrator.state.copy(), passed[0] if passed else -1

        return _legs(problem, moved, number)

    return run


def scipy_legs(problem: Switched, tol: float) -> Callable[[], list[Leg]]:
    """The legs of a problem, by DOP853 and its events."""
    from scipy.integrate import solve_ivp

    rate = _numba(problem.piece, 3)
    n = len(problem.guards(0.0, problem.start, problem.mode))

    def guard(i):
        def value(t, y, u):
            return problem.guards(t, y, u)[i]

        value.terminal, value.direction = True, -1
        return value

    guards = [guard(i) for i in range(n)]

    def moved(t0, y, mode, until):
        found = solve_ivp(
            rate, (t0, until), y, "DOP853", rtol=tol, atol=tol, events=guards, args=(mode,)
        )
        hit = [i for i in range(n) if len(found.t_events[i])]
        return found.t[-1], found.y[:, -1], hit[0] if hit else -1

    return lambda: _legs(problem, moved, float)


def _legs(problem: Switched, moved: Callable, number: type) -> list[Leg]:
    """The legs of a problem, each by a function of its beginning, its mode and a last time."""
    t, y, mode = number(0), np.array(problem.start, number), problem.mode
    legs, waiting = [], [*problem.times, problem.t1]
    while waiting:
        end, there, which = moved(t, y, mode, waiting[0])
        legs.append(Leg(float(t), y.astype(float), mode, float(end), there.astype(float)))
        if which < 0:
            waiting = waiting[1:]
        t, y, mode = end, there, problem.after(there, mode, which)
    return legs


def end_of(legs: Callable[[], list[Leg]]) -> Run:
    """The end (1, k) of a problem from a function that finds its legs."""
    return lambda: legs()[-1].y1[None]


# ---- the rate as it is written


def scipy_plain(problem: Switched, tol: float) -> Run:
    """The end (1, k) by DOP853, which ignores the conditions; NaN where it gives up."""
    from scipy.integrate import DOP853

    rate = _numba(problem.rate, 2)

    def run() -> np.ndarray:
        solver = DOP853(rate, 0.0, np.array(problem.start), problem.t1, rtol=tol, atol=tol)
        for _ in range(MAX_STEPS):
            solver.step()
            if solver.status != "running":
                break
        return np.where(solver.status == "finished", solver.y, np.nan)[None]

    return run


@functools.cache
def _numba(formulas: Callable, arguments: int) -> Callable:
    """A right-hand side of (t, y), or (t, y, u), compiled where numba is installed."""
    if not _peers.importable("numba"):
        plain = formulas(np)
        return lambda *given: np.array(plain(*given))
    import numba

    numbers = numba.njit(formulas(np))
    if arguments == 2:
        return numba.njit(lambda t, y: np.array(numbers(t, y)))
    return numba.njit(lambda t, y, u: np.array(numbers(t, y, u)))
