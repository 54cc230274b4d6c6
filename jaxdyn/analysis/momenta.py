"""Angular momentum about moving points, and kinetic energy split at the centre of mass.

Problems 14 and 19 ask for which definition of the angular momentum H about a moving point C

    dH/dt = M = sum of r_i/C x m_i a_i

holds. `moment_balance` evaluates both sides along a motion, dH/dt by autodiff, for

    "fixed"     sum of r_i/C' x m_i v_i         C' at rest where C is now: always true
    "absolute"  sum of r_i/C  x m_i v_i         M - dH/dt = v_C x m v_G:
                                                true if C rests or moves parallel to G
    "relative"  sum of r_i/C  x m_i (v_i - v_C) M - dH/dt = r_G/C x m a_C:
                                                true if C = G (problem 50), if C does not
                                                accelerate, or accelerates towards or from G

A point C is a function ``c(t, points)`` (d,) of time and of the material points, so it may be
prescribed, ride on a point, or be the `centre_of_mass`. Problem 18 is `kinetic_split` and
`power_balances`.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.analysis.energy import moment
from jaxdyn.integrate.spans import of_samples
from jaxdyn.integrate.trajectory import Trajectory, each_motion
from jaxdyn.scene import Effect, Field, Points, Scene
from jaxdyn.system import total_force

DEFINITIONS = ("fixed", "absolute", "relative")
MovingPoint = Callable[[Array, Points], Array]
_ROUNDING = 1e-11  # relative: sides that differ by less count as equal


class Balance(NamedTuple):
    """Two sides of an equation along a motion.

    Attributes:
      left: (s, ...) one side: moments, or powers, at the samples.
      right: (s, ...) the other side: rates of change there.
      holds: () whether they agree to rounding at all samples.
      residual: () largest difference, in the equation's unit.
      scale: () largest of the terms summed, the reference for rounding.
    """

    left: Array
    right: Array
    holds: Array
    residual: Array
    scale: Array


def centre_of_mass(t, points: Points) -> Array:
    """(d,) the centre of mass G, as a moving point."""
    del t
    r, _, m = points
    return jnp.sum(m[:, None] * r, axis=0) / jnp.sum(m)


@check_first
def angular_momentum_about(scene: Scene | Field, t, y, c: MovingPoint, definition: str) -> Array:
    """H about the moving point c by one of the three definitions [kg m^2/s].

    It is () in the plane, (3,) in space.
    """
    _checks.choice("definition", definition, DEFINITIONS)
    points, _, c_now, c_rate = _motion_about(scene, t, y, c)
    v = points.v - c_rate[None] if definition == "relative" else points.v
    return moment(points.r - c_now[None], points.m[:, None] * v)


@check_first
def moment_about(scene: Scene | Field, t, y, c: MovingPoint) -> Array:
    """M = sum of r_i/C x m_i a_i about c [N m]: () in the plane, (3,) in space.

    For free points this is the moment of the forces; with constraints, reactions count too.
    """
    points, a, c_now, _ = _motion_about(scene, t, y, c)
    return moment(points.r - c_now[None], points.m[:, None] * a)


@check_first
def angular_momentum_rate(scene: Scene | Field, t, y, c: MovingPoint, definition: str) -> Array:
    """dH/dt along the motion through (t, y), by autodiff [N m]."""
    t = jnp.asarray(t, float)
    here = c(t, scene.points(t, y))
    # C' is fixed at the present position of C.
    about = (lambda t, points: here) if definition == "fixed" else c
    return _along(scene, t, y, lambda t, y: angular_momentum_about(scene, t, y, about, definition))[
        1
    ]


@check_first
@each_motion
def moment_balance(motion: Trajectory, c: MovingPoint) -> dict[str, Balance]:
    """Whether M = dH/dt about c, for each definition, at the samples of a motion.

    Example:
      >>> from jaxdyn.analysis import momenta
      >>> from jaxdyn import scenes, simulate
      >>> motion = simulate(scenes.three_body(), samples=20)
      >>> balance = momenta.moment_balance(motion, momenta.centre_of_mass)
      >>> {name: bool(b.holds) for name, b in balance.items()}
      {'fixed': True, 'absolute': True, 'relative': True}
    """
    return dict(zip(DEFINITIONS, _moment_balances(motion, c), strict=True))


@of_samples
@eqx.filter_jit  # one program for all definitions, which share most of the work
def _moment_balances(motion: Trajectory, c: MovingPoint) -> list[Balance]:
    scene = motion.scene

    def sides(t, y):
        points, a, c_now, c_rate = _motion_about(scene, t, y, c)
        m, arm = points.m[:, None], points.r - c_now[None]
        v = jnp.abs(points.v) + jnp.abs(c_rate[None])
        size = jnp.sum(m * jnp.abs(arm)) * jnp.max(jnp.abs(a)) + jnp.sum(m * v) * jnp.max(v)
        rates = [angular_momentum_rate(scene, t, y, c, name) for name in DEFINITIONS]
        return moment(arm, m * a), jnp.stack(rates), size

    moments, rates, sizes = jax.vmap(sides)(motion.ts, motion.ys)
    return [_balance(moments, rates[:, i], sizes) for i in range(len(DEFINITIONS))]


@check_first
def kinetic_split(scene: Scene | Field, t, y) -> tuple[Array, Array]:
    """Konig's theorem: kinetic energy () of the centre of mass, and () relative to it [J].

    They are m v_G^2 / 2 and the sum of m_i |v_i - v_G|^2 / 2.
    """
    _, v, m = scene.points(t, y)
    v_g = jnp.sum(m[:, None] * v, axis=0) / jnp.sum(m)
    return 0.5 * jnp.sum(m) * jnp.sum(v_g * v_g), 0.5 * jnp.sum(m[:, None] * (v - v_g[None]) ** 2)


@check_first
@each_motion
@of_samples
@eqx.filter_jit
def power_balances(motion: Trajectory, internal: type[Effect]) -> dict[str, Balance]:
    """Problem 18 b and c along a motion: which power changes which part of the energy.

    "centre": the resultant of the external forces times v_G, against the rate of change of
    m v_G^2 / 2: always equal, since internal forces sum to zero. "relative": the power of the
    internal forces against the rate of the energy relative to G: not always equal, since an
    external force also works on a point that moves relative to G.

    Args:
      motion: a motion of free points.
      internal: the kind of effects that act between the points; all others are external.
    Returns:
      For each balance the power `left` [W], the rate of the energy `right` [W], and whether they
      are equal.
    """
    scene = motion.scene

    def forces(t, points, wanted):
        chosen = [e for e in scene.effects if isinstance(e, internal) == wanted]
        return total_force(chosen, t, *points)

    def sides(t, y):
        points = scene.points(t, y)
        inside, outside = forces(t, points, True), forces(t, points, False)
        v_g = jnp.sum(points.m[:, None] * points.v, axis=0) / jnp.sum(points.m)
        rates = _along(scene, t, y, lambda t, y: jnp.stack(kinetic_split(scene, t, y)))[1]
        powers = jnp.stack([jnp.sum(outside * v_g[None]), jnp.sum(inside * points.v)])
        size = jnp.sum(jnp.abs(inside) + jnp.abs(outside)) * jnp.max(jnp.abs(points.v))
        return powers, rates, size

    powers, rates, size = jax.vmap(sides)(motion.ts, motion.ys)
    names = ("centre", "relative")
    return {name: _balance(powers[:, i], rates[:, i], size) for i, name in enumerate(names)}


def _balance(one: Array, other: Array, sizes: Array) -> Balance:
    residual, scale = jnp.max(jnp.abs(one - other)), jnp.max(sizes)
    return Balance(
        left=one, right=other, holds=residual <= _ROUNDING * scale, residual=residual, scale=scale
    )


def _along(scene: Scene | Field, t, y, quantity: Callable) -> tuple:
    """A quantity (t, y) and its rate of change along the motion through (t, y)."""
    t = jnp.asarray(t, float)
    return jax.jvp(quantity, (t, y), (jnp.ones_like(t), scene.rate(t, y)))


def _motion_about(scene: Scene | Field, t, y, c: MovingPoint) -> tuple[Points, Array, Array, Array]:
    """The points, their accelerations (n, d), and position and velocity (d,) of C."""

    def look(t, y):
        points = scene.points(t, y)
        return points, c(t, points)

    (points, c_now), (rates, c_rate) = _along(scene, t, y, look)
    return points, rates.v, c_now, c_rate
