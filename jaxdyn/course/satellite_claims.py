"""True or false: claims about three satellites.

Rate some claims about the satellites A, B and C of problem 55. A is said to have three unequal
moments, the middle one about the line of its balls' centres, and no other motions than exact spins,
wobbles about axes 1 and 3, and wobbles about axis 2 that flip again and again; B to be axisymmetric
about (1, 1, 1), with steady precession only; C to keep its angular velocity whatever the start.

Answer: All claims on B and C are true, one of them if it is read rightly. On A two are false: the
line of the centres is the axis of the smallest moment, and there are other motions: from a spin
across axis 2 with 2 T I_2 = H^2 the satellite flips just once, omega = (a sech, b tanh, c sech) of
b t sqrt((I2 - I1) (I3 - I2) / (I1 I3)), with a = b sqrt(I2 (I3 - I2) / (I1 (I3 - I1))) and c = b
sqrt(I2 (I2 - I1) / (I3 (I3 - I1))).

The claims number the axes of A from the biggest moment to the smallest; here, as in problem 55, the
numbers go from the smallest to the biggest. Axis 2 is the same, and no verdict depends on it.

(A i) True: 0.527, 0.795 and 1.051 kg m^2. (A ii) False: the line through the centres of the balls,
along (1, -1, 0), is the axis of the smallest moment, since the balls are nearest to it. (A iii) The
spins, wobbles and repeated flips are possible. But they are not all: the motion that separates
wobbles about axis 1 from those about axis 3 begins and ends as a spin about axis 2, in opposite
directions of the body, and flips once.

(B i, ii) True: a third of a turn about (1, 1, 1) takes the cube and its balls into themselves.
(B iii) As printed it says "steady precession about the symmetry axis". In the body that is true:
there omega goes round the symmetry axis at a constant rate. In space it is the axis that goes round
the constant angular momentum H, and a precession about the axis, which moves itself, is none. In
that reading, which problem 58 proves, these are all motions, with the exact spins as limits.

(C) True: with three equal moments H = I omega, so omega is constant with H, whatever the start.

The computations distinguish motions by the angular momentum H in the body's axes: it points along a
principal axis in a steady rotation, stays around one in a wobble, and passes from one side of the
middle axis to the other in a flip.
"""

import dataclasses
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.analysis.precession import free_attitude
from jaxdyn.course.page import Page, show
from jaxdyn.formulations import rigid
from jaxdyn.geometry import inertia
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scenes import satellite
from jaxdyn.scenes.satellites import SATELLITES

PROBLEM = 57
TOPIC = "rigid bodies in space"

_EQUAL = 1e-12  # [1] moments, axes and rates that differ by less count as equal: rounding of sums
_SAME_MOTION = 1e-9  # [1] two computations of one motion over the spans below, at rtol 1e-12
_RTOL = 1e-12
_TILT = 0.15  # [rad] between a wobbling start and its axis
_SPAN = 60.0  # [s] dozens of revolutions at 1 rad/s
_SPINS = ((0.3, 1.0, 0.2), (1.0, -0.4, 0.7), (-0.2, 0.1, 1.1))  # [rad/s] all different


def solve(page: Page) -> None:
    """Rate the claims; then give the motion that refutes the last one on A in closed form."""
    claims = satellite_claims()
    for claim in claims:
        page.number(f"{claim.name}: {claim.says}", "true" if claim.holds else "false")
    wrong = [claim.name for claim in claims if not claim.holds]
    page.true("Only A ii and the last of A iii fail", wrong == ["A ii", "A iii d"], route="rating")

    moments, axes = _principal("A")
    page.number("principal moments of A", moments, "kg m^2")
    line = [0.5**0.5, -(0.5**0.5), 0.0]
    page.equal("The line of the centres has the least moment", axes[:, 0], line, within=1e-14)
    first, second, third = moments
    rate = np.sqrt((second - first) * (third - second) / (first * third))
    a = np.sqrt(second * (third - second) / (first * (third - first)))
    c = np.sqrt(second * (second - first) / (third * (third - first)))
    starts = {
        "near axis 1": axes @ np.array([1.0, 0.2, 0.1]),
        "near axis 2": axes @ np.array([0.05, 1.0, 0.1]),
        "near axis 3": axes @ np.array([0.1, 0.2, 1.0]),
        "one flip only": axes @ np.array([a, 0.0, c]),
    }
    motions, polhodes = {}, {}
    for name, omega in starts.items():
        drawn = scenes.satellite("A", omega, t1=40.0)
        motions[name] = dataclasses.replace(_motion("A", omega, 40.0), scene=drawn)
        polhodes[name] = np.asarray(energy.along(rigid.pose, motions[name]).omega_b) @ axes
    once = polhodes["one flip only"][:500]
    t = rate * np.asarray(motions["one flip only"].ts[:500])
    single = np.stack([a / np.cosh(t), np.tanh(t), c / np.cosh(t)], axis=1)
    page.equal(
        "The single flip is (a sech, b tanh, c sech), with b = 1 rad/s", once, single, within=1e-11
    )

    page.draw(
        lambda: picture(polhodes, moments),
        "Angular momentum in the body's axes: loops, and half of the separatrix.",
    )
    page.play(motions, "Wobbles, repeated flips, and a single flip.", choose="start")


def picture(polhodes, moments):
    """The angular momentum in the axes of the body, for each start."""
    figure = drawing.figures.blank(6.0, 5.2)
    ax = figure.add_subplot(projection="3d", xlabel="axis 1", ylabel="axis 2", zlabel="axis 3")
    drawing.figures.style(ax)
    for name, omega in polhodes.items():
        momentum = omega * moments
        ax.plot(*(momentum / np.linalg.norm(momentum[0])).T, label=name)
    ax.set_aspect("equal")
    ax.view_init(25, 20)
    ax.legend(frameon=False)
    return figure


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
    """All claims of problem 57, each with the figure that decides it."""
    return (*_claims_on_a(), *_claims_on_b(), *_claims_on_c())


def _claims_on_a() -> tuple[Claim, ...]:
    moments, axes = _principal("A")
    gap = float(np.diff(moments).min() / moments[2])
    line = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    along = float(np.abs(axes[:, 1] @ line))
    exact = _change_of_rate("A", axes.T)
    wobbles = [_share_of_momentum("A", _near(axes, k), axes[:, k]) for k in (0, 2)]
    least = float(min(np.abs(share).min() for share in wobbles))
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
            because="cosine of axis 2 to H 25 s after a flip of a motion with 2 T I_2 = H^2, whose "
            "cosine is the opposite 25 s before and which never flips again",
        ),
    )


def _claims_on_b() -> tuple[Claim, ...]:
    moments, axes = _principal("B")
    gap = float(np.abs(moments[1] - moments[0]) / moments[2])
    axis, across = axes[:, 2], axes[:, :2]
    off = float(np.linalg.norm(np.cross(axis, np.ones(3))) / np.sqrt(3.0))
    mixed = across @ np.array([[1.0, 2.0], [1.0, -0.5]])
    every = np.stack([axis, *across.T, *mixed.T])
    exact = _change_of_rate("B", every)
    missed = float(max(_off_precession(omega, moments, axes) for omega in _SPINS))
    tilted = [_share_of_momentum("B", omega, axis) for omega in _SPINS]
    change = float(max(np.ptp(share) for share in tilted))
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
            because="largest difference of the attitude to that of the two turns of problem 58",
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
    moments, _ = _principal("C")
    gap = float(np.abs(moments[2] - moments[0]) / moments[2])
    poses = [energy.along(rigid.pose, _motion("C", omega)) for omega in _SPINS]
    turning = [np.einsum("sij,sj->si", pose.R_wb, pose.omega_b) for pose in poses]
    change = float(max(np.ptp(omega, axis=0).max() for omega in turning))
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


def _principal(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments and axes of a satellite."""
    moments, axes = inertia.principal(SATELLITES[name]())
    return np.asarray(moments), np.asarray(axes)


def _scene(name: str, omega, t1=_SPAN) -> Scene:
    """A satellite without its drawing: one program serves A, B and C."""
    scene = satellite(name, omega, t1=t1)
    return dataclasses.replace(scene, system=dataclasses.replace(scene.system, drawn=None))


def _motion(name: str, omega, t1=_SPAN) -> Trajectory:
    return simulate(_scene(name, omega, t1), rtol=_RTOL, samples=1000)


def _change_of_rate(name: str, spins: np.ndarray) -> float:
    """Largest angular acceleration [rad/s^2] at angular velocities (n, 3) [rad/s]."""
    found = (_scene(name, omega) for omega in spins)
    return float(max(np.abs(scene.rate(0.0, scene.y0)[-3:]).max() for scene in found))


def _near(axes: np.ndarray, k: int) -> np.ndarray:
    """Angular velocity (3,) of 1 rad/s, slightly off principal axis k."""
    return np.cos(_TILT) * axes[:, k] + np.sin(_TILT) * axes[:, (k + 1) % 3]


def _separatrix(moments: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Angular velocity (3,) across axis 2, near 1 rad/s, of a motion with 2 T I_2 = H^2."""
    first, second, third = moments
    # From I_1 (I_1 - I_2) w_1^2 + I_3 (I_3 - I_2) w_3^2 = 0.
    w = np.sqrt([third * (third - second), first * (second - first)])
    return (axes[:, ::2] @ w) / np.sqrt(w @ w)


def _single_flip(moments: np.ndarray, axes: np.ndarray) -> tuple[float, bool]:
    """Cosine of axis 2 to H after a motion of A on the separatrix, and whether it flips just once.

    On the separatrix, 2 T I_2 = H^2, the motion passes from one side to the other and never
    returns; simulated from H across axis 2, half a span in each direction.
    """
    across = _separatrix(moments, axes)
    after, before = (_share_of_momentum("A", way * across, axes[:, 1], 25.0) for way in (1.0, -1.0))
    # Reversed in time, the earlier motion has H reversed.
    flip = float(after[-1] + before[-1]) / 2
    return flip, abs(flip) > 1 - 1e-4 and _sides(after) == _sides(before) == 0


def _share_of_momentum(name: str, omega, axis: np.ndarray, t1=_SPAN) -> np.ndarray:
    """(s,) cosine of the angle between an axis of the satellite and H along a motion."""
    motion = _motion(name, omega, t1)
    H = np.asarray(energy.along(energy.angular_momentum, motion))
    turned = np.asarray(energy.along(rigid.pose, motion).R_wb) @ axis
    return (turned * H).sum(axis=1) / np.sqrt((H**2).sum(axis=1))


def _sides(share: np.ndarray) -> int:
    """Number of flips: how often a cosine passes from above 1/2 to below -1/2 or back."""
    sides = np.sign(share[np.abs(share) > 0.5])
    return int(np.count_nonzero(np.diff(sides)))


def _off_precession(omega, moments: np.ndarray, axes: np.ndarray) -> float:
    """Largest difference [1] between the entries of B's attitude and of its closed form."""
    motion = _motion("B", omega)
    turned = np.asarray(energy.along(rigid.pose, motion).R_wb) @ axes
    closed = _precessing(axes, axes.T @ np.array(omega), motion.ts, moments)
    return float(np.abs(turned - closed).max())


@jax.jit
def _precessing(axes: Array, omega_b: Array, ts: Array, moments: Array) -> Array:
    """(s, 3, 3) attitudes of B in closed form."""
    first, _, third = moments
    return jax.vmap(lambda t: free_attitude(axes, omega_b, t, I1=first, I3=third))(ts)


if __name__ == "__main__":
    show(solve)
