"""Independent checks of an orbit: its closing error by another integrator and tolerance.

The finder makes its own integrator's error part of the closing condition, so its residual says
nothing about that error. Here the whole period is integrated by a method of another family at
a tighter tolerance; several periods in a row can be integrated as well.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxdyn import Status
from jaxdyn._checks import check_first
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.integrate.flow import SolveResult
from jaxdyn.solvers import Method
from orbits.analysis.chain import transitions
from orbits.closing.closings import PLAIN
from orbits.closing.sizes import sizes
from orbits.hybrid.equations import ChainEquations
from orbits.hybrid.legs import HybridOrbit
from orbits.motion import advance, other_solver
from orbits.orbit import Orbit, gap
from orbits.shooting.equations import Equations, InUnits
from orbits.shooting.newton import RANK_TOLERANCE
from orbits.shooting.segmentation import SEGMENTS_MOST, largest, with_segments
from orbits.shooting.strategy import TIGHT


@dataclasses.dataclass(frozen=True)
class Recheck:
    """An independent check of an orbit.

    Attributes:
      solver: name of the other method.
      tolerance: its relative tolerance.
      closure: largest entry of y(T) - y(0) by that method, in units of the entries' sizes.
    """

    solver: str
    tolerance: float
    closure: float


@check_first
def closure(
    orbit: Orbit | HybridOrbit, *, periods: int = 1, rtol: float | None = None, solver=None
) -> float:
    """Largest entry of the state after some periods minus the start; NaN if not reached.

    Each entry is in units of its size along the orbit (`orbits.closing.sizes`). For a relative
    orbit the start is rotated accordingly. For a chain of legs the result is the largest error of
    its closing and of the ends of its legs at their times.
    """
    rtol = orbit.rtol if rtol is None else rtol
    if isinstance(orbit, HybridOrbit):
        solvers = (solver,) * len(orbit.legs)
        found = float(np.abs(_closing_errors(orbit, periods, rtol, solvers)).max())
        return found if np.isfinite(found) else float("nan")
    flow = after(orbit, periods, rtol=rtol, solver=solver)
    if int(flow.status) != Status.OK:
        return float("nan")
    return gap(orbit, flow.y1, periods)


def after(orbit: Orbit, periods: float, *, rtol: float, solver=None) -> SolveResult:
    """The motion after some periods, or after a part of one, in plain or logarithmic time."""
    s = None if orbit.s_period is None else periods * orbit.s_period
    solver = orbit.solver if solver is None else solver
    return advance(orbit.scene, periods * orbit.period, s, rtol=rtol, solver=solver)


def _closing_errors(orbit: HybridOrbit, periods: int, rtol: float, solvers) -> np.ndarray:
    """(m,) the errors of a chain's equations after some periods, integrated by given methods."""
    chain = ChainEquations.of(orbit)
    return chain.residual(orbit.y0, orbit.spans, rtol, solvers, periods) / _in_units(orbit)[1]


def _in_units(orbit: HybridOrbit) -> tuple[np.ndarray, np.ndarray]:
    """(m, u) the Jacobian of a chain's equations in units, and (m,) the units of the equations."""
    chain, spans = ChainEquations.of(orbit), orbit.spans
    found = chain.linearize(chain.pack(np.asarray(orbit.y0), spans), orbit.rtol)
    leg_sizes = chain.sizes(found, spans)
    rows = chain.residual_units(found, spans, leg_sizes)
    return found.jacobian * chain.pack(leg_sizes[0], spans) / rows[:, None], rows


def growth(orbit: Orbit | HybridOrbit) -> float:
    """Largest growth of a change of the state on the way to the end of the period.

    This is the largest norm of the derivatives of the end with respect to states at 32 times, or at
    the starts of the legs of a chain; NaN where the chain grazes an event. Multiplied by the unit
    of rounding, it is about the smallest closing error of an integration in doubles.
    """
    if isinstance(orbit, HybridOrbit):
        maps, _, grazed = transitions(orbit, orbit.rtol)
        return largest(maps) if grazed is None else float("nan")
    y0, rtol = np.asarray(orbit.y0), orbit.rtol
    whole = dataclasses.replace(Equations.of(orbit), closing=PLAIN)
    if orbit.mesh is not None:
        fine = whole
    elif orbit.s_period is None:
        # Encounters, if any, are moderate; a cut inside one makes the value somewhat larger.
        even = (1 / SEGMENTS_MOST,) * SEGMENTS_MOST
        fine = dataclasses.replace(whole, shares=even, s_spans=None)
    else:
        whole = dataclasses.replace(whole, s_spans=(orbit.s_period,))
        x = whole.pack(y0, (), 0.0, 0.0, orbit.period)
        fine = with_segments(whole, x, rtol, SEGMENTS_MOST)
    return largest(map_in_units(fine.transitions(y0, orbit.period, rtol), sizes(orbit.scene)))


@dataclasses.dataclass(frozen=True)
class Digits:
    """The certain decimal digits of an orbit's numbers.

    Attributes:
      y0: digits of the start, relative to the sizes of its entries along the orbit.
      period: digits of the full period.
    """

    y0: float
    period: float


@check_first
def digits(orbit: Orbit | HybridOrbit) -> Digits:
    """The digits of an orbit that another integrator at a tighter tolerance confirms.

    The closing error by that integrator, times the inverse of the closing equations' Jacobian,
    is the displacement of the orbit if it were found again with that integrator. In a family of
    orbits this is the distance to the family, whose members all close.

    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> swing = orbits.find(scenes.oscillator(k=4.0), [1.0, 0.0], 3.0)
      >>> orbits.digits(swing).period > 12
      True
    """
    y0 = np.asarray(orbit.y0)
    if isinstance(orbit, HybridOrbit):
        jacobian, _ = _in_units(orbit)
        move = _first_order_move(jacobian, _closing_errors(orbit, 1, TIGHT, _others(orbit)))
        k = len(y0)
        return Digits(_digits(move[:k].max()), _digits(move[k:] @ orbit.spans / orbit.period))
    equations = Equations.of(orbit)
    x = equations.spread(y0, orbit.period, orbit.rtol, orbit.angle)
    closed = InUnits(equations, x, orbit.rtol)
    _, jacobian = closed(x)
    end = after(orbit, 1 / orbit.closing.parts, rtol=TIGHT, solver=_other(orbit)).y1
    angle = jnp.asarray(orbit.angle)
    miss = np.asarray(orbit.closing.residual(orbit.scene.system, end, jnp.asarray(y0), angle))
    miss = np.append(miss, np.zeros(len(jacobian) - len(miss)))  # a drive has no error
    move = _first_order_move(jacobian, miss / closed.units.residual)
    return Digits(_digits(move[:-1].max(initial=0.0)), _digits(move[-1] / (2 * np.pi)))


def _first_order_move(jacobian: np.ndarray, miss: np.ndarray) -> np.ndarray:
    """(n,) by how much the unknowns would move, to first order, to remove the errors `miss`."""
    if not np.isfinite(miss).all():
        return np.full(jacobian.shape[1], np.nan)
    return np.abs(np.linalg.pinv(jacobian, rcond=RANK_TOLERANCE) @ miss)


def _digits(error: float) -> float:
    """Correct decimal digits at a relative error, at most those of a double."""
    return float(-np.log10(max(error, np.finfo(float).eps))) if np.isfinite(error) else 0.0


def _other(orbit: Orbit) -> Method:
    """A method that the search for the orbit did not use, with tangents or without."""
    return other_solver(orbit.scene, orbit.solver, logarithmic=orbit.s_period is not None)


def _others(orbit: HybridOrbit) -> tuple[Method, ...]:
    """For each leg of a chain, a method that the search did not use."""
    return tuple(other_solver(leg.scene, logarithmic=False) for leg in orbit.legs)


@check_first
def recheck(orbit: Orbit | HybridOrbit) -> Recheck:
    """The closing error of an orbit by another integrator at a tighter tolerance."""
    if isinstance(orbit, HybridOrbit):
        others = _others(orbit)
        names = ", ".join(dict.fromkeys(other.name for other in others))
        return Recheck(names, TIGHT, float(np.abs(_closing_errors(orbit, 1, TIGHT, others)).max()))
    other = _other(orbit)
    return Recheck(other.name, TIGHT, closure(orbit, rtol=TIGHT, solver=other))
