"""Three satellites made of a cube and balls.

Balls of radius 1/2 are welded to the middles of the faces of a unit cube, all of density 1: two
balls (towards +x and +y) for satellite A, a third one (+z) for B, and one on every face for C. Two
massless antennas stick out. Find the centres of mass, the inertia matrices and the principal
moments, and look at the paths of the tips of the antennas while the satellites tumble: can the
motion be described simply? As printed, two principal moments of A are equal; they are not.

Answer: A has the moments 0.527, 0.795 and 1.051 about (1, -1, 0), (1, 1, 0) and z, B has 1.371
about (1, 1, 1) and 1.051 across, C is dynamically a sphere with 2.575. Every point of C moves on a
circle, the long antenna of B, which lies on its axis, circles about the constant angular momentum,
and only A tumbles irregularly.

By hand: the cube has the mass 1 and the inertia 1/6 about any axis through its centre, a ball the
mass b = pi/6, the inertia b/10 about its own centre, and a centre 1 m from that of the cube. By the
theorem of parallel axes a ball adds b/10 about the axis through its centre and that of the cube,
and b/10 + b across. The centre of mass of n balls is at b/(1 + n b) times the sum of their places;
for A and B the mass at the square of its distance is subtracted again.

Why the motions of B and C are simple: with three equal moments H = I omega, so omega is constant
with H, and every point of C goes round a circle. For an axisymmetric body such as B, omega = H /
I_1 + omega_s e_3' (problem 58): its axis circles about H, and so does the tip of the long antenna
on it. The tip of the short one is off the axis: it circles about the axis while that circles about
H, which draws a rosette on a sphere. No axis of A does either: its angular velocity has to be
integrated (problem 57).
"""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.formulations import rigid
from jaxdyn.geometry import inertia

PROBLEM = 55
TOPIC = "rigid bodies in space"


BALL = np.pi / 6  # mass of a ball [kg]


def by_hand(name):
    """Principal moments by the theorem of parallel axes, in ascending order."""
    count = {"A": 2, "B": 3, "C": 6}[name]
    own, off = 1 / 6 + count * BALL / 10, BALL**2 / (1 + count * BALL)
    return {
        "A": [own + BALL - 2 * off, own + BALL, own + 2 * BALL - 2 * off],
        "B": [own + 2 * BALL - 3 * off] * 2 + [own + 2 * BALL],
        "C": [own + 4 * BALL] * 3,
    }[name]


def tumble(name):
    """A motion of a satellite, computed without its drawing: one program serves all three."""
    scene = scenes.satellite(name, (0.3, 1.0, 0.2))
    bare = dataclasses.replace(scene, system=dataclasses.replace(scene.system, drawn=None))
    motion = simulate(bare, 30.0, samples=400, rtol=1e-12)
    return dataclasses.replace(motion, scene=scene)


def solve(page: Page) -> None:
    """Weigh the satellites, spin them about their axes, and let them tumble."""
    axes = {}
    for name, make in scenes.satellites.SATELLITES.items():
        body = make()
        moments, axes[name] = inertia.principal(body)
        page.number(f"centre of mass of {name}", body.centre, "m")
        page.number(
            f"inertia of {name}, by rows", np.round(body.inertia, 12).ravel() + 0.0, "kg m^2"
        )
        page.number(f"principal moments of {name}", moments, "kg m^2")
        page.equal(
            f"The principal moments of {name} are those by hand",
            moments,
            by_hand(name),
            within=1e-13,
        )

    spins = [scenes.satellite("A", axis) for axis in axes["A"].T]
    rates = np.stack([scene.rate(0.0, scene.y0)[-3:] for scene in spins])
    page.equal("A turns steadily about each principal axis", rates, 0 * rates, within=1e-14)

    tumbles = {name: tumble(name) for name in axes}
    paths = {name: scenes.satellites.antenna_trace(tumbles[name], name) for name in axes}
    momentum = energy.along(energy.angular_momentum, tumbles["B"])
    height = paths["B"] @ momentum[0] / jnp.linalg.norm(momentum[0])
    page.equal("Angular momentum is constant", momentum, momentum[:1].repeat(400, 0), within=1e-11)
    page.equal("B's long antenna circles about it", jnp.ptp(height), 0.0, within=1e-12)
    turning = energy.along(rigid.pose, tumbles["C"]).omega_w
    page.equal("C turns steadily", jnp.ptp(turning, axis=0), jnp.zeros(3), within=1e-13)
    page.equal(
        "A's centre stays at rest", tumbles["A"].ys[:, :3], jnp.zeros((400, 3)), within=1e-14
    )

    page.draw(
        lambda: picture(paths),
        "The tip of A's antenna tumbles about; those of B and C run round circles.",
    )
    page.play(tumbles, "Look at the tips of the antennas.", choose="satellite")


def picture(paths):
    """The paths of the tips of the long antennas."""
    figure = drawing.figures.blank(9.0, 3.4)
    for i, (name, path) in enumerate(paths.items()):
        ax = figure.add_subplot(1, 3, i + 1, projection="3d")
        ax.plot(*path.T, lw=1.0)
        ax.set(xlim=(-4.5, 4.5), ylim=(-4.5, 4.5), zlim=(-4.5, 4.5), aspect="equal")
        ax.set_title(f"tip of the long antenna of {name}")
        drawing.figures.style(ax)
    return figure


if __name__ == "__main__":
    show(solve)
