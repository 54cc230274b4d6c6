"""True or false: claims about three satellites.

Rate some claims about the satellites A, B and C of problem 55. A is said to have three unequal
moments, the middle one about the line of its balls' centres, and no other motions than exact spins,
wobbles about axes 1 and 3, and wobbles about axis 2 that flip again and again; B to be axisymmetric
about (1, 1, 1), with steady precession only; C to keep its angular velocity whatever the start.

Answer: All claims on B and C are true, one of them if it is read rightly. On A two are false: the
line of the centres is the axis of the smallest moment, and there are other motions: from a spin
across axis 2 with 2 T I_2 = H^2 the satellite flips just once, omega = (a sech, b tanh, c sech) of
the time.

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
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn import scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.drawing.figures import blank, style
from jaxdyn.formulations import rigid
from jaxdyn.geometry import inertia
from jaxdyn.studies import satellite_claims

PROBLEM = 57
TOPIC = "rigid bodies in space"


def solve(page: Page) -> None:
    """Rate the claims; then give the motion that refutes the last one on A in closed form."""
    claims = satellite_claims.satellite_claims()
    for claim in claims:
        page.number(f"{claim.name}: {claim.says}", "true" if claim.holds else "false")
    wrong = [claim.name for claim in claims if not claim.holds]
    page.true("Only A ii and the last of A iii fail", wrong == ["A ii", "A iii d"], route="rating")

    moments, axes = inertia.principal(scenes.satellites.satellite_a())
    page.number("principal moments of A", moments, "kg m^2")
    line = [0.5**0.5, -(0.5**0.5), 0.0]
    page.equal("The line of the centres has the least moment", axes[:, 0], line, within=1e-14)
    first, second, third = moments
    rate = np.sqrt((second - first) * (third - second) / (first * third))
    a = np.sqrt(second * (third - second) / (first * (third - first)))
    c = np.sqrt(second * (second - first) / (third * (third - first)))
    starts = {
        "near axis 1": axes @ jnp.array([1.0, 0.2, 0.1]),
        "near axis 2": axes @ jnp.array([0.05, 1.0, 0.1]),
        "near axis 3": axes @ jnp.array([0.1, 0.2, 1.0]),
        "one flip only": axes @ jnp.array([a, 0.0, c]),
    }
    motions, polhodes = {}, {}
    for name, omega in starts.items():
        motions[name] = simulate(scenes.satellite("A", omega), 40.0, samples=400, rtol=1e-13)
        polhodes[name] = energy.along(rigid.pose, motions[name]).omega_b @ axes
    once = polhodes["one flip only"][:200]
    t = rate * np.asarray(motions["one flip only"].ts[:200])
    single = np.stack([a / np.cosh(t), np.tanh(t), c / np.cosh(t)], axis=1)
    page.equal("The single flip is (a sech, tanh, c sech)", once, single, within=1e-11)

    figure = blank(6.0, 5.2)
    ax = figure.add_subplot(projection="3d", xlabel="axis 1", ylabel="axis 2", zlabel="axis 3")
    style(ax)
    for name, omega in polhodes.items():
        momentum = omega * moments
        ax.plot(*(momentum / jnp.linalg.norm(momentum[0])).T, label=name)
    ax.set_aspect("equal")
    ax.view_init(25, 20)
    ax.legend(frameon=False)
    page.draw(
        figure, "Angular momentum in the body's axes: loops, and half of the curve that parts them."
    )
    page.play(motions, "Wobbles, repeated flips, and a single flip.", choose="start")


if __name__ == "__main__":
    show(solve)
