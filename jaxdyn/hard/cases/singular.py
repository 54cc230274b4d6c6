"""Where formulas divide by zero: rest, anchors, zero rotations, huge speeds; and failing lanes.

The results are compared with closed forms in this file.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import ensemble
from jaxdyn._numerics import safe_norm, safe_sqrt
from jaxdyn.effects import DryFriction, QuadraticDrag, Spring
from jaxdyn.geometry.rotations import rotation_vector_from_wxyz, wxyz_from_rotation_vector
from jaxdyn.hard.case import Case, Figure, absolute_error, relative_error
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes.nbody import two_body
from jaxdyn.scenes.particles import cannonball, particle

_RTOL = 1e-13
_LANES = 64
_COLLIDE, _INVALID, _ESCAPE = 3, 4, 5


def _lanes() -> tuple[Figure, ...]:
    scene = two_body(m1=1.0, m2=1.0)
    starts = np.tile(scene.y0, (_LANES, 1)) * np.linspace(0.9, 1.0, _LANES)[:, None]
    starts[_COLLIDE, 4:] = 0.0  # they collide
    starts[_INVALID, 2] = np.nan
    starts[_ESCAPE, 4:] *= 1e3
    good = np.delete(np.arange(_LANES), [_COLLIDE, _INVALID])
    mixed = ensemble.run(scene, starts, 20.0, rtol=_RTOL)
    alone = ensemble.run(scene, starts[good], 20.0, rtol=_RTOL)
    failed = np.setdiff1d(np.arange(_LANES), good)
    finite = int(np.isfinite(mixed.y1[failed]).sum() + mixed.ok[failed].sum())
    return (
        Figure("numbers from lanes that failed", finite, 0),
        Figure("lanes that others disturb", int((mixed.y1[good] != alone.y1).any(1).sum()), 0),
        Figure("steps that others cost", int(np.abs(mixed.steps[good] - alone.steps).max()), 0),
        Figure(
            "steps until a collision is given up",
            int(mixed.steps[_COLLIDE] + mixed.rejected[_COLLIDE]),
            1000,
        ),
        Figure("steps of a circular orbit", int(mixed.steps[-1])),
    )


def _fast() -> tuple[Figure, ...]:
    """The figures of huge speeds: without gravity x = log(1 + v t), for c = m = 1."""

    def end(speed):
        return solve(cannonball(speed=speed, angle=0.0, g=0.0, drag=1.0), 1.0, rtol=_RTOL).y1

    v = 1e8
    y, slope = jax.jvp(end, (jnp.asarray(v),), (jnp.ones(()),))
    wanted = np.array([np.log1p(v), v / (1 + v)])
    slopes = np.array([1 / (1 + v), 1 / (1 + v) ** 2])
    steps = solve(cannonball(speed=v, angle=0.0, g=0.0, drag=1.0), 1.0, rtol=_RTOL).steps
    return (
        Figure("place and speed after 1 s", relative_error(y[jnp.array([0, 2])], wanted), 1e-11),
        Figure("gradient of the place", relative_error(slope[:1], slopes[:1]), 1e-8),
        Figure("gradient of the speed [1]", float(abs(slope[2] - slopes[1])), 1e-13),
        Figure("steps", int(steps)),
    )


def _rest() -> tuple[Figure, ...]:
    """The figures of starts from rest: y = -log(cosh(s t)) m / c with s^2 = g c / m.

    The drag at v = 0 has the slope 0.
    """

    def end(c, speed):
        return solve(cannonball(speed=speed, angle=0.5, g=9.0, drag=c), 1.0, rtol=_RTOL).y1

    def fall(c):
        return -jnp.log(jnp.cosh(3 * jnp.sqrt(c))) / c

    y, slope = end(0.7, 0.0), jax.jacrev(end)(0.7, 0.0)
    wanted = fall(0.7), jax.grad(fall)(0.7)
    push = jax.jacfwd(QuadraticDrag(0.7).force, argnums=2)(0.0, *jnp.zeros((2, 1, 2)), jnp.ones(1))
    # A dry contact at rest gives no force of its own, never NaN; sticking is left to a phase.
    dry = DryFriction(0.5, 9.81).force(0.0, jnp.zeros((1, 2)), jnp.zeros((1, 2)), jnp.ones(1))
    h = 1e-4
    thrown = jax.jacfwd(end, argnums=1)(0.7, 0.0)
    differences = (end(0.7, h) - end(0.7, 0.0)) / h  # one-sided, since |v| has a kink
    return (
        Figure("fall from rest", relative_error(y[1:2], wanted[:1]), 1e-11),
        Figure("its gradient in the drag", relative_error(slope[1:2], wanted[1:]), 1e-8),
        Figure("its gradient in the throw", absolute_error(thrown, differences), 3 * h),
        Figure("slope of the drag at rest", float(jnp.max(jnp.abs(push))), 0.0),
        Figure("dry friction at rest [N]", float(jnp.max(jnp.abs(dry))), 0.0),
    )


def _anchor() -> tuple[Figure, ...]:
    """The figures of a mass that a spring of rest length 0 pulls through its anchor.

    The motion is x = cos(w t).
    """

    def end(k):
        scene = particle(Spring(k), position=(1.0, 0.0), velocity=(0.0, 0.0))
        return solve(scene, t1, rtol=_RTOL).y1

    t1 = 2.5 * jnp.pi  # at the anchor itself, for the third time
    y, slope = end(1.0), jax.jacrev(end)(1.0)
    force = jax.jacfwd(Spring(2.0, 0.5).force, argnums=1)(0.0, *jnp.zeros((2, 1, 2)), jnp.ones(1))
    return (
        Figure("place and velocity [m]", absolute_error(y, [0.0, 0.0, -1.0, 0.0]), 1e-11),
        Figure("gradient in the stiffness [m]", absolute_error(slope[:2], [-t1 / 2, 0.0]), 1e-9),
        Figure("not finite, with a rest length", float(jnp.sum(~jnp.isfinite(force))), 0),
    )


def _zeros() -> tuple[Figure, ...]:
    """The figures of lengths, roots and angles at 0; gradients are 0 by convention or the limit."""
    zero = jnp.zeros(3)
    norm = jax.value_and_grad(safe_norm)(zero)
    root = jax.value_and_grad(safe_sqrt)(0.0)

    def there_and_back(phi):
        return rotation_vector_from_wxyz(wxyz_from_rotation_vector(phi))

    turn, turns = there_and_back(zero), jax.jacrev(there_and_back)(zero)
    found = jnp.concatenate([jnp.stack([norm[0], *root]), norm[1], turn])
    return (
        Figure("length and root at 0, with gradients", float(jnp.max(jnp.abs(found))), 0.0),
        Figure("log of exp at no turn: gradient", absolute_error(turns, np.eye(3)), 1e-15),
    )


CASES = (
    Case(
        "failing-lanes", "Failing lanes have a status and NaN, and cost the others nothing.", _lanes
    ),
    Case(
        "fast-cannonball",
        "Values and gradients are right at 1e8 m/s against quadratic drag.",
        _fast,
    ),
    Case(
        "drag-from-rest",
        "Values and gradients are right from rest, where |v| has no derivative.",
        _rest,
    ),
    Case(
        "through-the-anchor",
        "A spring passes through its anchor, where its direction is undefined.",
        _anchor,
    ),
    Case(
        "norms-at-zero", "Lengths, roots and angles at 0 are finite with their gradients.", _zeros
    ),
)
