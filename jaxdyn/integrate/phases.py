"""Piecewise-smooth motions: phases (roll, slip, fly, rest) chained by events.

Smooth code never sees a contact or a stop. Each phase is a scene with its own equations, and
exits: an event, the next phase, and a map of the state (an impact, a change of coordinates). The
chain is run on the host, one compiled search per phase.

A state that is beyond a bound of its phase leaves by that exit at once (see `phase`), so every
phase is checked where it begins. Several simultaneous exits, as of a ball in a corner, are taken
one after the other. Where several phases may follow, the first that the state fits is taken.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._numerics import nan_unless
from jaxdyn._progress import report_progress
from jaxdyn.integrate.events import stop_of
from jaxdyn.integrate.phase import END, Exit, HybridTrajectory, Phase
from jaxdyn.integrate.simulation import simulate
from jaxdyn.integrate.spans import MAX_STEPS, RTOL, SolverOptions
from jaxdyn.integrate.trajectory import Trajectory, single
from jaxdyn.scene import check_scene
from jaxdyn.solvers import Solver
from jaxdyn.status import Status

#: A ball that comes to rest on a shaken table once in each period needs some 30 phases per period.
MAX_PHASES = 1000


@check_first
def simulate_phases(
    phases: Mapping[str, Phase],
    start: str | None,
    y0,
    t1: float,
    *,
    t0: float = 0.0,
    samples: int = 100,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
    max_phases: int = MAX_PHASES,
) -> HybridTrajectory:
    """The motion from phase to phase, until it ends or reaches `t1` or `max_phases`.

    Args:
      phases: the phases by name.
      start: name of the first phase; None for the first of `phases` that y0 fits.
      y0: (k,) state at its start.
      t1: end of the span [s], after t0.
      t0: start time [s].
      samples: number of samples of each piece.
      rtol: see `simulate`.
      atol: see `simulate`.
      solver: see `simulate`; by default each phase has its own.
      max_steps: see `simulate`; per phase.
      max_phases: largest number of pieces: infinitely many bounces may take finite time.
    Raises:
      ValueError: a phase name is unknown, y0 fits no phase or is beyond a bound from which no exit
        leads back, `t1` is not after `t0`, or `max_phases` is less than 1.
    Example:
      A block on a belt of speed 0.2, held by a spring. Friction holds it up to a force of 0.5, and
      is 0.3 while it slides.
      >>> import jaxdyn
      >>> from jaxdyn.integrate.events import When
      >>> slide = jaxdyn.ode(lambda t, y: [y[1], 0.3 - y[0]], [0.0, 0.0])
      >>> stick = jaxdyn.ode(lambda t, y: [0.2, 0.0], [0.0, 0.2])
      >>> slips, stops = When(lambda t, y: y[0] - 0.5), When(lambda t, y: y[1] - 0.2, direction=1)
      >>> phases = {
      ...     "stick": Phase(stick, (Exit(slips, "slide", lambda t, y: y),)),
      ...     "slide": Phase(slide, (Exit(stops, "stick", lambda t, y: y),)),
      ... }
      >>> motion = simulate_phases(phases, "stick", [0.3, 0.2], 9.0)
      >>> motion.names, round(motion.times[2] - motion.times[0], 9)
      (('stick', 'slide', 'stick', 'slide'), 6.71238898)
    """
    _check_names(phases)
    remedy = "Phases are chosen on the host; `follow` goes through a known sequence of them."
    _checks.check_on_host("simulate_phases", (phases, y0, t1, t0, rtol, atol), remedy)
    if not _checks.array("t1", t1, ()) > _checks.array("t0", t0, ()):
        raise _checks.fail("t1", f"a time after t0 = {t0}", t1, "Impacts do not run backwards.")
    if max_phases < 1:
        raise _checks.fail("max_phases", "at least 1", max_phases)
    t, y = jnp.asarray(t0, dtype=float), jnp.asarray(y0, dtype=float)
    name = _first_phase(phases, t, y) if start is None else _checks.choice("start", start, phases)
    check_scene(phases[name].scene.starting(y, t1))
    options = SolverOptions(rtol=rtol, atol=atol, solver=solver, max_steps=max_steps)
    most = sum(len(phase.exits) for phase in phases.values())  # exits that may be taken at one time
    shortest = np.finfo(float).eps * (t1 - t0)  # [s] below which two times are equal
    names, pieces, path, idle, status = [], [], [], 0, Status.OK
    while name != END and len(pieces) < max_phases and t < t1 and status == Status.OK:
        report_progress(f"phase {name} from t = {float(t):.4g}")
        here, stay = name, _run_phase(phases[name], t, y, t1, samples, options)
        if stay.piece is not None:
            names.append(name)
            pieces.append(stay.piece)
        idle = 0 if stay.t - t > shortest else idle + 1
        t, y, status = stay.t, stay.y, Status.STUCK if stay.exits and idle > most else stay.status
        for number in stay.exits:
            if name == here:  # else the other event was an exit of a phase already left
                path.append((name, number))
                t, y, name = _take_exit(phases, here, number, t, y)
        if not stay.exits:
            break
    if name != END and len(pieces) >= max_phases and t < t1 and status == Status.OK:
        status = Status.PHASE_LIMIT
    if status == Status.STUCK and not pieces:
        _check_within(phases[path[0][0]], path[0][0], jnp.asarray(t0, dtype=float), y0)
    if not pieces:  # a motion that ends where it starts can be drawn, too
        names = [path[0][0]]
        scene = phases[names[0]].scene.starting(y0, t1)
        pieces = [simulate(scene, t0, t0=t0, samples=1, **options._asdict())]
    return HybridTrajectory(
        names=tuple(names),
        pieces=tuple(pieces),
        t=t,
        y=y,
        ended=name == END,
        status=status,
        path=tuple(path),
    )


def _first_phase(phases: Mapping[str, Phase], t: Array, y: Array) -> str:
    """The phase that a motion starts in."""
    alike = {k: phase for k, phase in phases.items() if y.shape == phase.scene.y0.shape}
    number = int(_first_fit(list(alike.values()), t, y)) if alike else -1
    if number < 0:
        raise _checks.fail("y0", f"a state of {' or '.join(phases)}", y, "Name the start.")
    return list(alike)[number]


def _check_within(phase: Phase, name: str, t: Array, y: Array) -> None:
    """Raise ValueError if a start that no exit leads away from is beyond a bound of its phase."""
    passed = np.flatnonzero(phase.fit(t, jnp.asarray(y, dtype=float)).passed)
    if len(passed):
        number = int(passed[0])
        event = phase.exits[number].event.called or f"the event of its exit {number}"
        remedy = (
            "Start before it; or set one_sided=False on its exit, if the phase may begin beyond."
        )
        raise _checks.fail("y0", f"a start of phase {name}", f"one beyond {event}", remedy)


class _PhaseRun(NamedTuple):
    """The evolution of a state in a phase."""

    piece: Trajectory | None  # None where it leaves at once
    t: Array
    y: Array
    exits: tuple[int, ...]  # numbers of the exits by which it leaves
    status: Status


def _run_phase(phase: Phase, t: Array, y: Array, t1, samples, options: SolverOptions) -> _PhaseRun:
    """How a state leaves a phase, and the motion until then."""
    scene = phase.scene.starting(y, t1)
    if not phase.exits:
        piece = simulate(scene, t1, t0=t, samples=samples, throw=False, **options._asdict())
        end = jnp.where(piece.status == Status.OK, t1, jnp.nan)
        status = Status(int(piece.status))
        return _PhaseRun(piece=piece, t=end, y=piece.ys[-1], exits=(), status=status)
    beyond = np.asarray(phase.fit(t, y).beyond)
    if beyond.any():
        end, at, exits, status = t, y, (int(np.argmax(beyond)),), Status.OK
    else:
        # The state is on the near side of every bound, to rounding, and the search takes that side.
        stop = stop_of(scene, phase.events, t1, t, options, phase.sides)
        also = np.asarray(stop.coincident) & (np.asarray(phase.sides) == 0)
        others = [int(i) for i in np.flatnonzero(also) if i != stop.event]
        exits = (int(stop.event), *others) if stop.happened else ()
        end, at, status = stop.t, stop.y, Status(int(stop.status))
    taken = [*exits[:1]]
    if taken and end + phase.exits[taken[0]].lasts(end, at) > t1:  # the span ends first
        end, exits = jnp.asarray(t1, dtype=float), ()
    elif taken and end <= t:
        return _PhaseRun(piece=None, t=t, y=at, exits=exits, status=status)
    until_when = end if status == Status.OK else t1
    piece = simulate(scene, until_when, t0=t, samples=samples, throw=False, **options._asdict())
    if taken and not exits:
        at = piece.ys[-1]
    passed = np.asarray(phase.fit(end, at).passed)
    if np.delete(passed, taken).any():
        lost = jnp.full_like(y, jnp.nan)
        return _PhaseRun(
            piece=_cut_at_bound(phase, piece),
            t=lost[0],
            y=lost,
            exits=(),
            status=Status.BOUND_PASSED,
        )
    return _PhaseRun(piece=piece, t=end, y=at, exits=exits, status=status)


def _cut_at_bound(phase: Phase, piece: Trajectory) -> Trajectory:
    """A piece up to its last sample before the first beyond a bound."""
    good = [not phase.fit(t, y).passed.any() for t, y in zip(piece.ts, piece.ys, strict=True)]
    ys = jnp.where(np.logical_and.accumulate(good)[:, None], piece.ys, jnp.nan)
    status = jnp.full_like(piece.status, Status.BOUND_PASSED)
    return eqx.tree_at(lambda piece: (piece.ys, piece.status), piece, (ys, status))


def _take_exit(phases: Mapping[str, Phase], here: str, number: int, t: Array, y: Array):
    """Time, state and name of the phase after an exit of the phase `here`."""
    exit_ = phases[here].exits[number]
    t, y = t + exit_.lasts(t, y), exit_.change(t, y)
    return t, y, exit_.names[int(_next_phase(phases, here, exit_, t, y))]


def _next_phase(phases: Mapping[str, Phase], here: str, exit_: Exit, t: Array, y: Array):
    """Index () of the phase that follows an exit of the phase `here`, among `exit_.names`."""
    if exit_.choose is not None:
        return exit_.choose(t, y)
    if len(exit_.names) == 1:
        return 0
    left = np.array([name == here for name in exit_.names])
    return _first_fit([phases.get(name) for name in exit_.names], t, y, left)


def _first_fit(candidates: Sequence[Phase | None], t: Array, y: Array, left=False) -> Array:
    """Index () of the first phase that a state fits, else of the first on whose surface it is.

    None stands for the end, which every state fits. The phase that is left follows only if no other
    fits: at its bound the state may fit it as well, to rounding. -1 if there is none.
    """
    # A state that fits none, as a ball just before it bounces, leaves its phase at once.
    fits = [phase.fit(t, y) if phase else None for phase in candidates]
    on = jnp.stack([fit.on if fit else jnp.asarray(True) for fit in fits])
    within = jnp.stack([on[i] & ~fit.beyond.any() if fit else on[i] for i, fit in enumerate(fits)])
    ranks = [x.astype(int) for x in (within & ~np.asarray(left), within, on)]
    best = jnp.argmax(4 * ranks[0] + 2 * ranks[1] + ranks[2])  # the first maximum
    return jnp.where(on.any(), best, -1)


@check_first
def follow(
    phases: Mapping[str, Phase], path: Sequence[tuple[str, int]], y0, t1, *, t0=0.0, rtol=RTOL
) -> tuple[Array, Array]:
    """Time and state after a known sequence of phases; differentiable, also under jit and vmap.

    Args:
      phases: the phases by name.
      path: (name of the phase, index of the exit taken) in order, such as `HybridTrajectory.path`.
      y0: (k,) start.
      t1: end of the span [s].
      t0: start time [s].
      rtol: see `simulate`.
    Returns:
      () time and (k,) state after the last exit; NaN where another exit came first, or none,
      or one that led to another phase.
    Raises:
      ValueError: `path` names an unknown phase, or an index that is not one of its exits.
    """
    _check_names(phases)
    for name, number in path:
        exits = len(phases[_checks.choice("path", name, phases)].exits)
        if not 0 <= number < exits:
            raise _checks.fail("path", f"an exit of {name} from 0 to {exits - 1}", number)
    t, y = jnp.asarray(t0, dtype=float), jnp.asarray(y0, dtype=float)
    before, others = None, False  # events simultaneous with the last exit
    for i, (name, number) in enumerate(path):
        phase = phases[name]
        exit_ = phase.exits[number]
        now = phase.fit(t, y).beyond | (others if name == before else False)
        at_once = now.any()
        scene, options = phase.scene.starting(y, t1), SolverOptions(rtol=rtol)
        stop = stop_of(scene, phase.events, t1, t, options, phase.sides)
        t, y = jnp.where(at_once, t, stop.t), jnp.where(at_once, y, stop.y)
        as_expected = jnp.where(at_once, jnp.argmax(now), stop.event) == number
        unbounded = (np.array(phase.sides) == 0) & (np.arange(len(phase.exits)) != number)
        before, others = name, jnp.where(at_once, now, stop.coincident) & unbounded
        t, y = t + exit_.lasts(t, y), exit_.change(t, y)
        if i + 1 < len(path):
            following = exit_.names.index(_checks.choice("path", path[i + 1][0], exit_.names))
            as_expected = as_expected & (_next_phase(phases, name, exit_, t, y) == following)
        t, y = nan_unless(as_expected, t), nan_unless(as_expected, y)
        if not _checks.is_traced(as_expected) and not as_expected:
            break  # a start of NaN would raise
    return t, y


@check_first
def pieces_of(motion: Trajectory | HybridTrajectory) -> tuple[Trajectory, ...]:
    """The smooth pieces of a motion: those of its phases, or the motion itself.

    Raises:
      ValueError: it is a batch, or traced: for pictures, files and the like.
    """
    remedy = "Draw, write and check what a compiled function returns."
    _checks.check_on_host("motion", motion, remedy)
    return motion.pieces if isinstance(motion, HybridTrajectory) else (single(motion),)


def _check_names(phases: Mapping[str, Phase]) -> None:
    if not phases:
        raise _checks.fail("phases", "at least one", "none", "Give them by name.")
    if END in phases:
        raise _checks.fail("phases", f"names other than {END!r}", END, "Rename the phase.")
    for name, phase in phases.items():
        if not isinstance(phase, Phase):
            raise _checks.fail(
                f"phase {name}", "a Phase", type(phase).__name__, "Write Phase(scene, exits)."
            )
        phase.check_functions()
        if not isinstance(phase.exits, tuple):
            got = type(phase.exits).__name__
            raise _checks.fail(
                f"exits of {name}", "a tuple", got, "Write (exit,) for a single one."
            )
        for exit_ in phase.exits:
            for to in exit_.names:
                _checks.choice(f"exit of {name}", to, (*phases, END))
