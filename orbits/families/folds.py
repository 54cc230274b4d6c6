"""A fold of orbits: the direction of the family there, and the orbit with its derivatives.

At a fold the orbit is no function of the parameter p, but orbit x and parameter are functions of
the other numbers of the scene, by the extended system

    F(x, p, numbers) = 0,    w F_x(x, p, numbers) v = 0,

where v is the direction of the family, F_x v = 0, and w the left kernel vector of F_x with
w F_p != 0. Both are held fixed: their changes are of second order in the equation, since
F_x v = 0 and w F_x = 0. The derivatives of F_x v are second derivatives of the motion.

Reference: Doedel, Keller, Kernevez (1991), Int. J. Bifurc. Chaos 1, 493.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import fail
from orbits.analysis.sensitivity import Linearization, Posed, linearization, residual
from orbits.families.surface import OrbitSurface
from orbits.shooting.equations import Equations, units_at
from orbits.shooting.finding import GOAL

#: A singular value of the closing equations' Jacobian at a fold counts as zero below this share of
#: the largest. It is not smaller there than the square root of the parameter's rounding error.
ZERO = 1e-5


class FoldDirection(NamedTuple):
    """The direction of a family at a fold.

    Attributes:
      units: (n,) units of the unknowns.
      rows: (m,) units of the equations.
      x: (n,) the unknowns at the fold.
      jacobian: (m, n) the Jacobian of the closing equations there, in units.
      direction: (n,) the direction, of unit length in units.
    """

    units: np.ndarray
    rows: np.ndarray
    x: np.ndarray
    jacobian: np.ndarray
    direction: np.ndarray


def direction_at(posed: Posed, rtol: float) -> FoldDirection:
    """The direction at a fold that changes the orbit, but not the parameter to first order.

    Raises:
      ValueError: it is not a fold, or a condition is missing that selects its family.
    """
    surface = OrbitSurface(posed.equations, rtol, GOAL)
    point = surface.nearest(posed.x)
    if point is None:
        raise fail("point", "an orbit that closes", "another one", "See hold=.")
    units = units_at(posed.equations, point.x, point.jacobian, surface.unknown_sizes(point))
    jacobian, same = units.jacobian(point.jacobian), surface.neutral(point)
    fixed = np.vstack([jacobian, np.linalg.norm(jacobian) * same.T])
    _, values, vt = np.linalg.svd(fixed)
    rank = int((values > ZERO * values[0]).sum())
    if rank != len(posed.x) - 1:
        expected = "a fold at which one direction leads along the family"
        raise fail("point", expected, f"{len(posed.x) - rank} directions", "See hold=.")
    return FoldDirection(units.x, units.residual, point.x, jacobian, vt[-1])


class FoldOrbit(NamedTuple):
    """The orbit at a fold, with its derivatives.

    Attributes:
      y0: (k,) start.
      period: () full period [time of the scene].
      angle: () angle of a relative orbit.
    """

    y0: Array
    period: Array
    angle: Array


def differentiable_fold(posed: Posed, equations: Equations, by_parameter, rtol: float) -> FoldOrbit:
    """The orbit at a fold as a function of the numbers of its closing equations.

    Args:
      posed: the closing equations of the known orbit.
      equations: the same equations with the numbers that derivatives are taken for, and with the
        parameter as the function of them that it is at the fold.
      by_parameter: (m,) derivative of the closing error with respect to the parameter.
      rtol: tolerance of the integrations.
    """
    here = direction_at(posed, rtol)
    left, values, _ = np.linalg.svd(here.jacobian)
    beyond = left[:, int((values > ZERO * values[0]).sum()) :]
    # The parameter moves one combination of the equations that no change of the orbit moves; the
    # other such combinations are redundant.
    moved = beyond @ (beyond.T @ (np.asarray(by_parameter) / here.rows))
    w = moved / np.linalg.norm(moved) / here.rows
    v = here.units * here.direction
    fixed = jax.lax.stop_gradient(posed.equations)
    slope = np.asarray(_level_slope(fixed, here.x, v, w, rtol)) * here.units
    size = np.linalg.norm(slope)
    rows = np.append(here.rows, size)
    jacobian = np.vstack([here.jacobian, slope / size])
    return _implicit(equations, here.x, v, w, linearization(jacobian, here.units, rows), rtol)


def _level(equations: Equations, x: Array, v: Array, w: Array, rtol) -> Array:
    """() w F_x v, which is zero at a fold."""
    return w @ jax.jvp(lambda x: residual(equations, x, rtol), (x,), (v,))[1]


@eqx.filter_jit
def _level_slope(equations: Equations, x: Array, v: Array, w: Array, rtol) -> Array:
    return jax.jacfwd(lambda x: _level(equations, x, v, w, rtol))(jnp.asarray(x))


@eqx.filter_jit
def _implicit(equations: Equations, x, v, w, linear: Linearization, rtol) -> FoldOrbit:
    """The orbit at x, with its derivatives by the implicit function theorem."""
    x, v = jnp.asarray(x), jnp.asarray(v)
    miss = jnp.append(residual(equations, x, rtol), _level(equations, x, v, w, rtol))
    x = linear.solution(x, miss, within=ZERO)
    unknowns = equations.unpack(x)
    return FoldOrbit(equations.start(x), unknowns.period, unknowns.angle)
