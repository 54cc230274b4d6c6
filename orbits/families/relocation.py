"""A special orbit found again after the numbers of its scenes have changed.

At a period doubling, branch point or torus point the orbit is a function of the parameter, and
Newton's method finds the zero of the test function, with the slope from the implicit function
theorem. At a fold it is not; there orbit and parameter are functions of a length s along the
family, and the secant method finds the zero of dp/ds.

No family is followed, so that the scenes are data of programs that are compiled once: the function
that makes the scenes of a family would be compiled again for each value that it captures.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.continuation.kinds import Kind
from orbits.analysis.sensitivity import Posed, differentiable_orbit, pose
from orbits.closing.closings import Hold
from orbits.families.folds import FoldDirection, direction_at
from orbits.families.special_orbits import (
    Place,
    SpecialOrbit,
    path_of,
    placed,
    residual_change,
    test_along,
)
from orbits.orbit import Outcome, SearchError
from orbits.shooting.finding import find
from orbits.shooting.outcomes import orbit_at
from orbits.shooting.segment import Make

_STEPS = 12  # most steps of the search for a zero, and of the corrector
#: After a step shorter than this, relative to the parameter and its change, only rounding is left.
_SETTLED = 1e-8
#: Lengths along a family at a fold, in units: the first step, and a step after which the parameter,
#: a quadratic function of the length, no longer changes.
_FIRST, _LEVEL = 1e-3, 1e-7
_RANK = 1e-9  # relative: smaller singular values belong to symmetries

Path = Callable[[Array], Place]


def find_again(
    known: SpecialOrbit,
    make: Make | Scene,
    parameter: float,
    guess: tuple[np.ndarray, float],
    *,
    hold: Hold = (),
) -> SpecialOrbit:
    """The special orbit of other scenes near a known one; host only.

    Args:
      known: the known one.
      make: parameter -> scene, or the scene of a family in energy, with other numbers than those of
        the known one.
      parameter: guess of the parameter, or of the energy.
      guess: guesses of the start (k,) and of the period; at a fold those of the known one are used.
      hold: the conditions of the family.
    Raises:
      SearchError: there is none near the guess.
    """
    path = path_of(known.orbit, make, hold)
    if known.kind == Kind.FOLD:
        return _zero_of_slope(known, path, parameter)
    return _zero_of_test(known, path, parameter, guess)


def _not_found() -> SearchError:
    return SearchError("The special orbit was not found again. Take a shorter step.")


def _zero_of_test(known: SpecialOrbit, path: Path, p: float, guess) -> SpecialOrbit:
    """The orbit where the test of its kind is zero, by Newton's method."""
    settled, before = False, np.inf
    for _ in range(_STEPS):
        scene, held = path(jnp.asarray(p))
        y0, period = guess
        orbit = find(
            scene,
            y0,
            float(period),
            closing=known.orbit.closing,
            hold=held,
            rtol=known.orbit.rtol,
            throw=True,
        )
        here = SpecialOrbit(known.kind, orbit, p)
        if settled:
            return here
        test = test_along(here, path, jnp.asarray(p))
        value, slope = np.asarray(test.value), np.asarray(test.slope)
        step = float(-slope @ value / (slope @ slope))
        if not np.isfinite(step):
            break
        settled = abs(step) <= _SETTLED * (abs(p) + abs(p - known.parameter)) or (
            abs(step) >= before  # rounding, since steps of Newton's method become shorter
        )
        guess, p, before = _ahead(here, path, step), p + step, abs(step)
    raise _not_found()


def _ahead(here: SpecialOrbit, path: Path, step: float) -> tuple[np.ndarray, float]:
    """Start and period after a step of the parameter, to first order."""

    def orbit(p: Array) -> tuple[Array, Array]:
        scene, held = path(p)
        found = differentiable_orbit(scene, here.orbit, held)
        return found.y0, found.period

    at = (jnp.asarray(here.parameter),)
    value, slope = jax.jvp(orbit, at, (jnp.asarray(step),))
    y0, period = jax.tree.map(lambda x, change: np.asarray(x + change), value, slope)
    return y0, float(period)


class _PointAtLength(NamedTuple):
    """An orbit of a family, as a function of a length along the family.

    Attributes:
      x: (n,) the unknowns of the closing equations.
      parameter: the parameter.
      turning: derivative of the parameter with respect to the length.
      residual: largest entry of the closing error.
    """

    x: np.ndarray
    parameter: float
    turning: float
    residual: float


def _zero_of_slope(known: SpecialOrbit, path: Path, p: float) -> SpecialOrbit:
    """The orbit where the parameter is stationary along the family."""
    orbit = known.orbit
    posed = pose(orbit, path(jnp.asarray(known.parameter)).held)
    along = direction_at(posed, orbit.rtol)
    a = _at_length(posed, path, along, 0.0, posed.x, p, orbit.rtol)
    s, t = 0.0, _FIRST
    for _ in range(_STEPS):
        ahead = a.x + (t - s) * along.units * along.direction
        b = _at_length(posed, path, along, t, ahead, a.parameter, orbit.rtol)
        if abs(t - s) <= _LEVEL or a.turning == b.turning:
            equations = placed(posed, path(jnp.asarray(b.parameter)))
            found = orbit_at(equations, b.x, b.residual, Outcome.FOUND, rtol=orbit.rtol)
            return SpecialOrbit(Kind.FOLD, found, b.parameter)
        s, t, a = t, t - b.turning * (t - s) / (b.turning - a.turning), b
    raise _not_found()


def _at_length(
    posed: Posed, path: Path, along: FoldDirection, s: float, x, p: float, rtol: float
) -> _PointAtLength:
    """The orbit at a length from the known fold, by Newton's method in unknowns and parameter."""
    units, rows = along.units, along.rows
    for _ in range(_STEPS):
        equations, ahead = eqx.filter_jvp(
            lambda p: placed(posed, path(p)), (jnp.asarray(p),), (jnp.ones(()),)
        )
        found = equations(x, rtol)
        column = np.asarray(residual_change(equations, ahead, jnp.asarray(x), rtol)) / rows
        size = float(np.linalg.norm(column))
        if not 0 < size < np.inf:
            break
        unit = 1 / size
        system = np.block(
            [
                [np.asarray(found.jacobian) * units / rows[:, None], column[:, None] * unit],
                [along.direction[None], np.zeros((1, 1))],
            ]
        )
        ahead_by = along.direction @ ((x - along.x) / units)
        off = np.append(np.asarray(found.residual) / rows, ahead_by - s)
        if not (np.isfinite(system).all() and np.isfinite(off).all()):
            break
        step = -np.linalg.lstsq(system, off, rcond=_RANK)[0]
        x, p = x + step[:-1] * units, p + float(step[-1]) * unit
        if np.abs(step).max() <= _LEVEL:
            ahead = np.linalg.lstsq(system, np.eye(len(off))[-1], rcond=_RANK)[0]
            return _PointAtLength(x, p, float(ahead[-1]), float(np.abs(off[:-1]).max()))
    raise _not_found()
