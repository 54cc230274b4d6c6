"""Problem 57: which claims about the satellites A, B and C are true, by computation.

Motions are distinguished by the angular momentum H in the body's axes. Its length is constant; it
points along a principal axis for a steady rotation, stays around one for a wobble, and passes from
one side of the middle axis to the other for a flip.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.analysis import energy
from jaxdyn.analysis.precession import free_attitude
from jaxdyn.formulations import rigid
from jaxdyn.geometry.inertia import principal
from jaxdyn.geometry.vectors import cross
from jaxdyn.integrate.simulation import simulate
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scenes import satellite
from jaxdyn.scenes.satellites import SATELLITES

_EQUAL = 1e-12  # [1] moments, axes and rates that differ by less count as equal: rounding of sums
_SAME_MOTION = 1e-9  # [1] two computations of one motion over the spans below, at rtol 1e-12
_RTOL = 1e-12
_TILT = 0.15  # [rad] between a wobbling start and its axis
_SPAN = 60.0  # [s] dozens of revolutions at 1 rad/s
_SPINS = ((0.3, 1.0, 0.2), (1.0, -0.4, 0.7), (-0.2, 0.1, 1.1))  # [rad/s] all different


class Claim(NamedTuple):
    """A claim of problem 57 and the result of the computation.

    Attributes:
      name: its number in the course; the parts of iii are iii a, b, c in order.
      says: the claim in short.
      holds: whether it is true.
      figure: the number that decides it.
      because: the meaning of that number.
    """

    name: str
    says: str
    holds: bool
    figure: float
    because: str


def satellite_claims() -> tuple[Claim, ...]:
    """All claims of problem 57, each with the figure that decides it.

    Example:
      >>> [claim.name for claim in satellite_claims() if not claim.holds]
      ['A ii', 'A iii d']
    """
    return (*_claims_on_a(), *_claims_on_b(), *_claims_on_c())


def _claims_on_a() -> tuple[Claim, ...]:
    moments, axes = principal(SATELLITES["A"]())
    gap = float(jnp.min(jnp.diff(moments)) / moments[2])
    line = jnp.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    along = float(jnp.abs(axes[:, 1] @ line))
    exact = _change_of_rate("A", axes.T)
    wobbles = [_share_of_momentum("A", _near(axes, k), axes[:, k]) for k in (0, 2)]
    least = float(min(jnp.min(jnp.abs(share)) for share in wobbles))
    flips = _sides(_share_of_momentum("A", _near(axes, 1), axes[:, 1]))
    flip, once = _single_flip(moments, axes)
    return (
        Claim(
            name="A i",
            says="three unequal principal moments",
            holds=gap > _EQUAL,
            figure=gap,
            because="least difference of two moments over the largest",
        ),
        Claim(
            name="A ii",
            says="the middle axis is parallel to the line of the balls' centres",
            holds=along > 1 - _EQUAL,
            figure=along,
            because="cosine of the angle between them",
        ),
        Claim(
            name="A iii a",
            says="exact rotation about axes 1, 2 and 3",
            holds=exact <= _EQUAL,
            figure=exact,
            because="largest angular acceleration of the three spins [rad/s^2]",
        ),
        Claim(
            name="A iii b",
            says="wobbling about axes 1 and 3",
            holds=least > 0.5,
            figure=least,
            because="least cosine of the angle of the axis to H in 60 s",
        ),
        Claim(
            name="A iii c",
            says="wobbling about axis 2 with flips",
            holds=flips > 2,
            figure=flips,
            because="flips in 60 s",
        ),
        Claim(
            name="A iii d",
            says="no other motions",
            holds=not once,
            figure=flip,
            because="cosine of axis 2 to H 25 s after a flip of a motion with 2 T I_2 = H^2, which "
            "has minus it 25 s before and never flips again",
        ),
    )


def _claims_on_b() -> tuple[Claim, ...]:
    moments, axes = principal(SATELLITES["B"]())
    gap = float(jnp.abs(moments[1] - moments[0]) / moments[2])
    axis, across = axes[:, 2], axes[:, :2]
    off = float(jnp.linalg.norm(cross(axis, jnp.ones(3))) / np.sqrt(3.0))
    mixed = across @ jnp.array([[1.0, 2.0], [1.0, -0.5]])
    every = jnp.stack([axis, *across.T, *mixed.T])
    exact = _change_of_rate("B", every)
    missed = float(max(_off_precession(omega, moments, axes) for omega in _SPINS))
    tilted = [_share_of_momentum("B", jnp.array(omega), axis) for omega in _SPINS]
    change = float(max(jnp.ptp(share) for share in tilted))
    return (
        Claim(
            name="B i",
            says="two equal principal moments",
            holds=gap <= _EQUAL,
            figure=gap,
            because="difference of the two over the third",
        ),
        Claim(
            name="B ii",
            says="the axis of symmetry is (1, 1, 1)",
            holds=off <= _EQUAL,
            figure=off,
            because="sine of the angle between them",
        ),
        Claim(
            name="B iii a",
            says="exact rotation about that axis and any across it",
            holds=exact <= _EQUAL,
            figure=exact,
            because="largest angular acceleration of five such spins [rad/s^2]",
        ),
        Claim(
            name="B iii b",
            says="steady precession, of the axis about H (printed: about the axis)",
            holds=missed <= _SAME_MOTION,
            figure=missed,
            because="largest difference of the attitude to exp(t H / I_1) R_0 exp(t omega_s e_3)",
        ),
        Claim(
            name="B iii c",
            says="no other motions",
            holds=change <= _SAME_MOTION,
            figure=change,
            because="largest change of the cosine of the axis to H, unlike starts; the closed form "
            "of iii b holds for all",
        ),
    )


def _claims_on_c() -> tuple[Claim, ...]:
    moments, _ = principal(SATELLITES["C"]())
    gap = float(jnp.abs(moments[2] - moments[0]) / moments[2])
    turning = [energy.along(rigid.pose, _motion("C", omega)).omega_w for omega in _SPINS]
    change = float(max(jnp.max(jnp.ptp(omega, axis=0)) for omega in turning))
    return (
        Claim(
            name="C i",
            says="every direction is principal",
            holds=gap <= _EQUAL,
            figure=gap,
            because="largest difference of two moments over the largest",
        ),
        Claim(
            name="C ii",
            says="the angular velocity is constant, there is no precession",
            holds=change <= _SAME_MOTION,
            figure=change,
            because="its largest change in 60 s [rad/s]",
        ),
    )


def _motion(name: str, omega, t1=_SPAN) -> Trajectory:
    return simulate(satellite(name, omega, t1=t1), rtol=_RTOL, samples=1000)


def _change_of_rate(name: str, spins: Array) -> float:
    """Largest angular acceleration [rad/s^2] at angular velocities (n, 3) [rad/s]."""
    scenes = (satellite(name, omega) for omega in spins)
    return float(max(jnp.max(jnp.abs(x.rate(0.0, x.y0)[-3:])) for x in scenes))


def _near(axes: Array, k: int) -> Array:
    """Angular velocity (3,) of 1 rad/s, slightly off principal axis k."""
    return jnp.cos(_TILT) * axes[:, k] + jnp.sin(_TILT) * axes[:, (k + 1) % 3]


def _separatrix(moments: Array, axes: Array) -> Array:
    """Angular velocity (3,) across axis 2, near 1 rad/s, of a motion with 2 T I_2 = H^2."""
    first, second, third = moments
    # From I_1 (I_1 - I_2) w_1^2 + I_3 (I_3 - I_2) w_3^2 = 0.
    w = jnp.stack([jnp.sqrt(third * (third - second)), jnp.sqrt(first * (second - first))])
    return (axes[:, ::2] @ w) / jnp.sqrt(w @ w)


def _single_flip(moments: Array, axes: Array) -> tuple[float, bool]:
    """Cosine of axis 2 to H after a motion of A on the separatrix, and whether it flips just once.

    On the separatrix, 2 T I_2 = H^2, the motion passes from one side to the other and never
    returns; simulated from H across axis 2, half a span in each direction.
    """
    across = _separatrix(moments, axes)
    after, before = (_share_of_momentum("A", way * across, axes[:, 1], 25.0) for way in (1.0, -1.0))
    # Reversed in time, the earlier motion has H reversed.
    flip = float(after[-1] + before[-1]) / 2
    return flip, abs(flip) > 1 - 1e-4 and _sides(after) == _sides(before) == 0


def _share_of_momentum(name: str, omega: Array, axis: Array, t1=_SPAN) -> Array:
    """(s,) cosine of the angle between an axis of the satellite and H along a motion."""
    motion = _motion(name, omega, t1)
    H = energy.along(energy.angular_momentum, motion)
    H = H / jnp.sqrt(jnp.sum(H**2, axis=1, keepdims=True))
    return jnp.sum((energy.along(rigid.pose, motion).R_wb @ axis) * H, axis=1)


def _sides(share: Array) -> int:
    """Number of flips: how often a cosine passes from above 1/2 to below -1/2 or back."""
    sides = np.sign(np.asarray(share)[np.abs(share) > 0.5])
    return int(np.count_nonzero(np.diff(sides)))


def _off_precession(omega, moments: Array, axes: Array) -> float:
    """Largest difference [1] between the entries of B's attitude and of its closed form."""
    motion = _motion("B", omega)
    turned = energy.along(rigid.pose, motion).R_wb @ axes

    def closed(t):
        return free_attitude(axes, axes.T @ jnp.array(omega), t, I1=moments[0], I3=moments[2])

    return float(jnp.max(jnp.abs(turned - jax.vmap(closed)(motion.ts))))
