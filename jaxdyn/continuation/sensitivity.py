"""Folds and Hopf points as functions of the numbers of their scenes, with derivatives.

The defining equations F(u, numbers) = 0 of a special point (`defining`) are regular where it is
generic, so du = -F_u^-1 F_numbers dnumbers by the implicit function theorem: one solve, not a
differentiation of the search.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn._checks import check_kind, fail, is_traced
from jaxdyn._numerics import first_only, nan_unless
from jaxdyn.continuation.defining import Make
from jaxdyn.continuation.family import Equilibrium
from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.special import locate, pose
from jaxdyn.continuation.units import Units

#: Largest distance of a known point from that of the given numbers, relative to its unknowns.
_SAME = 1e-6


class DifferentiablePoint(NamedTuple):
    """A special point of equilibria as a differentiable function of the numbers of its scenes.

    Attributes:
      parameter: () value of the family's parameter.
      state: (k,) the equilibrium.
      frequency: () frequency of the small oscillations at a Hopf point [rad per time]; NaN at a
        fold.
    """

    parameter: Array
    state: Array
    frequency: Array

    __repr__ = _text.fields
    _repr_html_ = _text.html


def differentiable(make: Make, point: Equilibrium) -> DifferentiablePoint:
    """A fold or a Hopf point near a known one, for `jax.grad`, `jax.jvp` and so on.

    Args:
      make: parameter -> scene, as for `continue_equilibria`. The numbers with respect to which to
        differentiate have the values with which the known point was found, or are traced copies.
      point: the known point, from ``family.special``.
    Returns:
      Its numbers, equal to those of `point`, with their first derivatives.
    Raises:
      ValueError: `point` is neither a fold nor a Hopf point, belongs to other numbers, or has no
        units, as from a file of an early version.
    Limits: first derivatives; further ones are NaN. Where the numbers are traced, and are not those
      of the point, the result is NaN. At points of codimension two, such as a cusp, there is no
      derivative, and the result is not finite.
    Example:
      >>> import jax, jaxdyn
      >>> from jaxdyn import continuation, scenes
      >>> def lorenz(sigma):
      ...     return lambda rho: scenes.lorenz(sigma=sigma, rho=rho)
      >>> family = jaxdyn.continue_equilibria(lorenz(10.0), 20.0, [7.0, 7.0, 19.0], within=(2, 30))
      >>> hopf = family.special[0]  # at sigma (sigma + beta + 3) / (sigma - beta - 1)
      >>> by_sigma = jax.grad(lambda s: continuation.differentiable(lorenz(s), hopf).parameter)
      >>> round(float(by_sigma(10.0)), 9)
      0.146814404
    """
    units = _check(point)
    scenes, here = units.scene(make), units.inward(point)
    posed = pose(point.kind, here)
    if posed is None:
        raise fail("point", "one with a pair of complex eigenvalues", "real ones")

    def residual(u: Array) -> Array:
        return posed.system(scenes, u, posed.normal)

    u = jnp.asarray(posed.unknowns)
    step = jnp.linalg.solve(jax.lax.stop_gradient(jax.jacfwd(residual)(u)), residual(u))
    known = jax.lax.stop_gradient(step)
    away = jnp.max(jnp.abs(known))
    if not is_traced(away) and _SAME < away < math.inf:
        got = f"others, for which it is elsewhere by {float(away):.1g} of its size"
        raise fail("make", "scenes with the numbers of the point", got, "Find it again with these.")
    # A factor makes the derivatives NaN as well; those of a selected constant would be zero.
    u = u - nan_unless(away <= _SAME, first_only(step - known))
    k = len(point.state)
    hopf = point.kind == Kind.HOPF
    return DifferentiablePoint(
        parameter=u[k] * units.parameters[0],
        state=u[:k] * units.each,
        frequency=u[-1] / units.time if hopf else jnp.asarray(math.nan),
    )


def find_again(make: Make, point: Equilibrium, state: Array, parameter: float) -> Equilibrium:
    """The fold or Hopf point of other scenes near a known one; host only.

    Args:
      make: parameter -> scene, with other numbers than those of the known point.
      point: the known point, see `differentiable`.
      state: (k,) guess of its state.
      parameter: guess of its parameter.
    Raises:
      ValueError: see `differentiable`; or there is none near the guess.
    """
    units = _check(point)
    before = units.inward(point)
    found = locate(units.scene(make), before, np.append(state, parameter) / units.x)
    if found is None:
        raise fail("point", f"a {point.kind} near the guess", "none", "Begin closer.")
    return units.outward(found)


def _check(point: Equilibrium) -> Units:
    """The units of a fold or a Hopf point."""
    check_kind("point", point, (Equilibrium,))
    if point.kind not in (Kind.FOLD, Kind.HOPF):
        expected = "a fold or a Hopf point"
        raise fail("point", expected, point.kind or "an ordinary member", "See family.special.")
    if point.units is None:
        raise fail("point", "one with its units", "none", "Continue the family again.")
    return Units.of(point.units, len(point.state))
