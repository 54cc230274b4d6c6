"""Derivatives of special points of families with respect to the numbers of their scenes.

Along a family the test function of a special point, g(p, numbers) = 0, has derivatives by the
implicit function theorem for the orbit, so dp = -g_numbers / g_p dnumbers. At a period doubling the
test is det(M + 1), with M the derivative of the return map: the product of all l + 1 over the
multipliers l. It is simple also where two multipliers of a conservative scene meet at -1, since
(l + 1) (1 / l + 1) = l + 1 / l + 2 passes 0 with their index. At a torus point it is |l|^2 - 1,
with the critical multiplier l. At a fold, where orbits have no derivative with respect to the
parameter, it is the part w F of the closing equations F that no change of the orbit moves, with w
normal to the range of their Jacobian.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import check_first, fail
from jaxdyn.continuation.kinds import Kind
from orbits.analysis.sensitivity import differentiable, pose, residual
from orbits.closing.closings import Hold
from orbits.families.family import Member, smooth_orbit
from orbits.shooting.equations import InUnits
from orbits.shooting.segment import Make

#: A singular value of the closing equations' Jacobian at a fold is zero below this share of the
#: largest. Its remainder there is the root of the rounding error of the parameter.
_ZERO = 1e-5
_KINDS = (Kind.FOLD, Kind.DOUBLING, Kind.TORUS)


@check_first
def special_parameter(point: Member, make: Make, *, hold: Hold = ()) -> Array:
    """The parameter () at which a special orbit lies, for `jax.grad`, `jax.jvp` and so on.

    ``orbits.differentiable(make(p), point.orbit)`` with this parameter p is the orbit itself, if it
    is not at a fold.

    Args:
      point: a fold, period doubling or torus point, of ``family.special``.
      make: parameter -> scene, as for `continue_family`, with the numbers to differentiate by:
        those with which the point was found, or traced copies.
      hold: the conditions of the family, as for `continue_family`.
    Returns:
      The parameter of `point`, whatever the numbers are, with its first derivatives.
    Raises:
      ValueError: `point` is of another kind, or not a generic one: the multiplier is not simple, or
        does not change with the parameter.
    Limits: host only except for the numbers that make the scene; not for chains.
    Example:
      >>> import jax, orbits
      >>> import jax.numpy as jnp
      >>> import jaxdyn
      >>> def rate(t, y, c):  # cycles of r^2 = (b +- sqrt(b^2 + 4 a)) / 2
      ...     r2 = y[0] ** 2 + y[1] ** 2
      ...     grow = c[0] + c[1] * r2 - r2**2
      ...     return [grow * y[0] - y[1], grow * y[1] + y[0]]
      >>> def make(b):
      ...     return lambda a: jaxdyn.ode(rate, [0.85, 0.0], 6.28, params=jnp.stack([a, b]))
      >>> with_one = make(jnp.asarray(1.0))
      >>> cycle = orbits.find(with_one(jnp.asarray(-0.2)))
      >>> family = orbits.continue_family(cycle, with_one, -0.2, down=True, members=8)
      >>> fold = family.special[0]  # at a = -b^2 / 4
      >>> by_b = jax.grad(lambda b: orbits.families.special_parameter(fold, make(b)))
      >>> round(float(by_b(jnp.asarray(1.0))), 8)
      -0.5
    """
    if point.kind not in _KINDS:
        remedy = "Choose one of family.special."
        what = "a fold, period doubling or torus point"
        raise fail("point", what, point.kind or "an ordinary orbit", remedy)
    orbit = smooth_orbit("point", point.orbit)
    value = jnp.asarray(point.parameter)
    if point.kind == Kind.FOLD:
        posed = pose(orbit, hold)
        rows = jnp.asarray(_beyond(posed.equations, posed.x, orbit.rtol))

        def test(scene: Scene) -> Array:
            return rows @ residual(posed.of(scene), posed.x, orbit.rtol)
    elif point.kind == Kind.DOUBLING:

        def test(scene: Scene) -> Array:
            m = differentiable(scene, orbit, hold=hold).return_map()
            return jnp.linalg.det(m + jnp.eye(len(m)))[None]
    else:
        which = _critical(point)

        def test(scene: Scene) -> Array:
            multiplier = differentiable(scene, orbit, hold=hold).multipliers()[which]
            return (jnp.abs(multiplier) ** 2 - 1.0)[None]

    scene, by_parameter = eqx.filter_jvp(make, (value,), (jnp.ones(()),))
    found = test(scene)
    # The slope has no derivatives in the other numbers: second derivatives are not wanted.
    fixed = jax.lax.stop_gradient((scene, by_parameter))
    _, slope = eqx.filter_jvp(test, fixed[:1], fixed[1:])
    return value - slope @ (found - jax.lax.stop_gradient(found)) / (slope @ slope)


def _critical(point: Member) -> int:
    """Index of the non-trivial multiplier that is on the unit circle with its conjugate."""
    values = point.stability.nontrivial
    return int(np.argmin(np.where(values.imag > 0, np.abs(np.abs(values) - 1.0), np.inf)))


def _beyond(equations, x: np.ndarray, rtol: float) -> np.ndarray:
    """(r, m) rows of the closing equations that no change of the unknowns moves."""
    closed = InUnits(jax.lax.stop_gradient(equations), x, rtol)
    left, values, _ = np.linalg.svd(closed(x)[1])
    rank = int((values > _ZERO * values[0]).sum())
    return left[:, rank:].T / closed.units.residual
