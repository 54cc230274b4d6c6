"""How an iteration ended: at an orbit, at a trivial solution, at the rounding level, or early."""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Status
from orbits.motion import advance, logarithmic_period, other_solver, quick_solve
from orbits.orbit import CLOSED, Orbit, Outcome, gap
from orbits.shooting.equations import Equations, InUnits, pieces, sizes_at
from orbits.shooting.newton import Result
from orbits.shooting.segment import MAX_STEPS
from orbits.shooting.segmentation import SEGMENTS_MOST, largest
from orbits.shooting.strategy import TIGHT

#: Rounding errors made over one segment, in units of the machine epsilon.
_SEGMENT_ROUNDINGS = 64.0
#: A residual up to this many times the effect of rounding all unknowns cannot be reduced.
_ROUNDING_FACTOR = 4.0
#: Growth of rounding over a period, in decimal digits, up to which an orbit certainly closes.
_FEW_DIGITS = 12.0
#: Largest difference between a segment's ends by two integrators, divided by the tolerance and by
#: the growth of errors.
_AGREEMENT = 1e5
#: An iterate whose start is this many times larger than the guess's has escaped: far away every
#: state closes for lack of motion.
_ESCAPE_FACTOR = 100.0
#: An iterate is a trivial solution if its period, or the extent of its motion, is a smaller share
#: than this of the guess's.
_TRIVIAL_SHARE = 0.02
_SAMPLES = 64  # samples of each segment, to see how far it moves
_SAMPLE_RTOL = 1e-12  # tolerance of these samples
#: A state at rest seems to move by up to this in the samples, in sizes.
_UNSEEN = 10 * _SAMPLE_RTOL
#: The least extent attributed to an entry of the state, relative to a guess's largest extent.
_LEAST_EXTENT = 1e-9


class Trouble:
    """A test of whether an iterate approaches a trivial solution or diverges."""

    def __init__(self, equations: Equations, guess: np.ndarray):
        """Compare iterates with the unknowns (n,) of a guess."""
        self.equations, self.guess = equations, guess
        self.sizes = sizes_at(equations, guess)
        self.size, self.path = self._size_and_path(equations, guess)
        if equations.driven and self.size > 0:  # a guess almost at rest, where a drive moves it
            self.size = max(self.size, 1.0)

    def __call__(self, equations: Equations, x: np.ndarray) -> Outcome | None:
        """The outcome of an iteration that ends at x; None if x is acceptable.

        The equations may have other segments than those of the guess.
        """
        size, path = self._size_and_path(equations, x)
        # A guess of zeros has no size to compare with.
        if size > _ESCAPE_FACTOR * self.size > 0:
            return Outcome.ESCAPE
        if equations.driven:  # the period is that of the drive, and rest is a regular orbit
            return None
        # The path is measured by the rate at the start, which is also small where an orbit is slow
        # there, as a relaxation oscillation may be. The path of a guess at rest may be rounding.
        slow = path <= max(_TRIVIAL_SHARE * self.path, _UNSEEN)
        if x[-1] < _TRIVIAL_SHARE * self.guess[-1] or (slow and self._is_at_rest(equations, x)):
            return Outcome.TRIVIAL
        return None

    def _size_and_path(self, equations: Equations, x: np.ndarray) -> tuple[float, float]:
        """The largest entry of the start at x, and the path at the rate there, in sizes."""
        start, rate = (np.asarray(y) / self.sizes for y in _start_and_rate(equations, x))
        return float(np.abs(start).max()), float(np.linalg.norm(rate)) * x[-1]

    def _is_at_rest(self, equations: Equations, x: np.ndarray) -> bool:
        """Whether every entry of the state moves far less at x than at the guess."""
        guessed = extents(self.equations, self.guess) / self.sizes
        least = _TRIVIAL_SHARE * np.maximum(guessed, _LEAST_EXTENT * guessed.max())
        return not (extents(equations, x) / self.sizes > np.maximum(least, _UNSEEN)).any()


@jax.jit
def _start_and_rate(equations: Equations, x: Array) -> tuple[Array, Array]:
    """(k,) the start at x, and the rate there."""
    y0 = equations.start(x)
    scene = equations.scene_at(equations.unpack(x).parameter)
    return y0, scene.rate(jnp.zeros(()), y0)


def extents(equations: Equations, x: np.ndarray) -> np.ndarray:
    """(k,) how far each entry of the state moves from the start at x; NaN if a motion ends early.

    On a mesh the starts of the intervals suffice, since these are short where the motion is fast;
    segments of shooting are sampled.
    """
    here = jax.tree.map(np.asarray, pieces(equations, x))
    if equations.collocated:
        return np.abs(here.start - here.start[0]).max(axis=0)
    scene = equations.scene_at(equations.unpack(x).parameter)
    far = np.zeros(len(here.start[0]))
    for y, t0, span in zip(here.start, here.t0, here.span, strict=True):
        ts = np.linspace(t0, t0 + span, _SAMPLES + 1)[1:]
        start = scene.starting(y)
        flow = quick_solve(start, ts[-1], t0=t0, ts=ts, rtol=_SAMPLE_RTOL, max_steps=MAX_STEPS)
        far = np.maximum(far, np.abs(np.asarray(flow.ys) - here.start[0]).max(axis=0))
    return far


def outcome_of(closed: InUnits, result: Result, trouble: Trouble) -> Outcome:
    """How Newton's method on the closing equations ended."""
    equations, rtol = closed.equations, closed.rtol
    if not np.isfinite(result.residual).all():
        # Integrate without tangents, which overflow earlier and hide why the motion itself ends.
        x = equations.unpack(result.x)
        scene = equations.scene_at(x.parameter).starting(equations.start_at(result.x))
        part = x.period / equations.closing.parts
        status = quick_solve(scene, part, rtol=rtol, max_steps=MAX_STEPS).status
        other = Outcome.COLLISION
        if int(status) == Status.OK:
            if equations.collocated:  # the intervals are too long for its steps
                other = Outcome.MESH_LIMIT
            else:  # the tangents take too many steps, or overflow
                status = closed.status(result.x)
        if int(status) == Status.STEP_LIMIT:
            return Outcome.STEP_LIMIT
        # At an unstable equilibrium the residual is not finite because errors grow too much.
        return trouble(equations, result.x) or other
    outcome = trouble(equations, result.x)
    if outcome is not None:
        return outcome
    early = result.at_bound or result.limit
    if result.converged or (not early and _at_rounding(closed, result)):
        return _outcome_if_joined(closed, result)
    if result.at_bound:
        return Outcome.BOUND
    return Outcome.ITERATION_LIMIT if result.limit else Outcome.NO_DESCENT


def _outcome_if_joined(closed: InUnits, result: Result) -> Outcome:
    """The outcome of an iteration at whose end the segments join."""
    if not is_confirmed(closed, result.x):
        return Outcome.UNCONFIRMED
    orbit = orbit_at(closed.equations, result.x, math.nan, Outcome.FOUND, rtol=closed.rtol)
    growth = max(1.0, largest(closed.transitions(result.x)))
    known = is_determined(orbit, closed.equations.closing.parts * math.log10(growth))
    return Outcome.FOUND if known else Outcome.UNDETERMINED


def is_determined(orbit: Orbit, lost: float) -> bool:
    """Whether the start of an orbit, in doubles, determines it: a motion from there closes.

    Args:
      orbit: the orbit.
      lost: decimal digits by which rounding, in sizes, grows over a period.
    """
    if lost <= _FEW_DIGITS:
        return True
    solver = other_solver(orbit.scene, orbit.solver, logarithmic=orbit.s_period is not None)
    end = advance(orbit.scene, orbit.period, orbit.s_period, rtol=TIGHT, solver=solver)
    return int(end.status) == Status.OK and gap(orbit, end.y1) <= CLOSED


def is_confirmed(closed: InUnits, x: np.ndarray) -> bool:
    """Whether another integrator confirms that the segments at x end where they should.

    The differences may exceed the goal by as much as the motion lets errors grow.
    """
    equations, rtol = closed.equations, closed.rtol
    if equations.collocated:  # steps with more nodes have confirmed it
        return True
    here, ends = jax.tree.map(np.asarray, pieces(equations, x)), []
    scene = equations.scene_at(equations.unpack(x).parameter)
    solver = other_solver(scene, logarithmic=equations.s_spans is not None)
    for i in range(equations.segments):
        s = None if here.s is None else here.s[i]
        start = scene.starting(here.start[i])
        flow = advance(start, here.span[i], s, t0=here.t0[i], rtol=TIGHT, solver=solver)
        ends.append(np.asarray(flow.y1))
    off = equations.residual(x, here, np.array(ends)) / closed.units.residual
    growth = max(1.0, float(np.linalg.norm(closed.transitions(x), axis=(1, 2)).max()))
    return bool(np.abs(off).max() <= _AGREEMENT * max(rtol, np.finfo(float).eps) * growth)


def _at_rounding(closed: InUnits, result: Result) -> bool:
    """Whether the residual is rounding that grew over the segments: no smaller goal can be met."""
    equations, x = closed.equations, result.x
    if equations.collocated or equations.segments < SEGMENTS_MOST:
        return False
    left, unit = np.abs(result.residual).max(), np.finfo(float).eps
    growth = np.linalg.norm(closed.transitions(x), axis=(1, 2)).max()
    if left <= _SEGMENT_ROUNDINGS * unit * growth:
        return True
    # An encounter inside a segment amplifies more: compare with the effect of rounding x.
    signs = np.where(np.arange(len(x)) % 2, 1.0, -1.0)
    rounded, _ = closed(x * (1 + unit * signs))
    return bool(left <= _ROUNDING_FACTOR * np.abs(rounded - result.residual).max())


def orbit_at(
    equations: Equations,
    x: np.ndarray,
    residual: float,
    outcome: Outcome,
    *,
    rtol: float,
    iterations: int = 0,
) -> Orbit:
    """The orbit at a point x of the unknowns."""
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    scene = scene.starting(equations.start_at(x), unknowns.period)
    return Orbit(
        scene=scene,
        closing=equations.closing,
        residual=residual,
        outcome=outcome,
        iterations=iterations,
        rtol=rtol,
        angle=float(unknowns.angle),
        # Computed along the orbit: the span in the equations is that of the guess.
        s_period=None if equations.s_spans is None else logarithmic_period(scene),
        mesh=equations.shares if equations.collocated else None,
        stiff=equations.stiff,
    )
