"""A cylinder that rolls off a fixed cylinder.

A solid cylinder of radius r starts to roll, without slip, from the top of a fixed cylinder of
radius R. Is its motion that of an inverted pendulum? At which angle from the top does it lose
contact, if it was released almost at rest there, and how much friction does it need up to that
point?

Answer: Yes: the equation is (3/2) (R + r) theta'' = g sin(theta), a pendulum of length R + r with
2/3 of the gravity, since rolling adds half of the mass as inertia and the contact does no work. It
loses contact at cos(theta) = 4/7, theta = 55.15 degrees, for any radii; but rolling so far needs
unlimited friction, sin(theta) / (7 cos(theta) - 4), so every real cylinder slips before.

(a) The centre moves on a circle of radius R + r at the speed v = (R + r) theta', and rolling turns
the cylinder at v / r. With I = m r^2 / 2 the kinetic energy is (m / 2) v^2 + (m / 4) v^2, and with
the potential energy m g (R + r) cos(theta) the derivative of the constant sum is

    (3/2) (R + r) theta'' = g sin(theta).

An inverted pendulum of length l has l theta'' = g sin(theta). The similarity is expected: both have
one degree of freedom, an inertia that does not depend on theta, and a weight on a circle.

(b) From rest at the top (3/4) v^2 = g (R + r) (1 - cos(theta)). Towards the centre of the circle
m v^2 / (R + r) = m g cos(theta) - N, so

    N / (m g) = cos(theta) - (4/3) (1 - cos(theta)) = (7 cos(theta) - 4) / 3,

which is zero at cos(theta) = 4/7. Along the circle the friction is F = m g sin(theta) - m (R + r)
theta'' = m g sin(theta) / 3, so rolling needs a coefficient F / N = sin(theta) / (7 cos(theta) -
4).

The numbers belong to r = 0.5 m on R = 1 m, from rest at 0.001 rad, which changes the angle little.
"""

import jax
import numpy as np
from scipy import integrate

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 37
TOPIC = "rolling and skating"


START = 1e-3  # [rad]


def rolling_time(angle):
    """Time [s] from rest at the start to an angle, by the energy; with theta = START + u^2."""

    def pace(u):
        fallen = 2 * np.sin(START + u**2 / 2) * np.sin(u**2 / 2)
        return 2 * u / np.sqrt(4 / 3 * 9.81 / 1.5 * fallen)

    return integrate.quad(pace, 0.0, np.sqrt(angle - START), epsabs=0.0, epsrel=1e-13)[0]


def solve(page: Page) -> None:
    """Roll to where contact ends, and find the friction on the way."""
    rolling = scenes.cylinder_on_cylinder(r=0.5, fixed=1.0, theta=START, t1=4.0)
    angle = np.arccos(4 / 7 * np.cos(START))
    page.number(
        "b: angle where contact ends, with unlimited friction", np.degrees(angle), "degrees"
    )
    motion = simulate(rolling, rolling_time(angle), samples=2001, rtol=1e-12)
    end = np.arctan2(motion["x"][-1], motion["y"][-1])
    page.equal("The motion takes as long as energy predicts", end, angle, within=1e-9)

    for mu in (0.2, 0.4, 0.8):
        slips = np.arccos(4 * mu / np.hypot(7 * mu, 1.0)) - np.arctan2(1.0, 7 * mu)
        page.number(f"b: slips with a coefficient of {mu} at", np.degrees(slips), "degrees")
        ratio = np.sin(slips) / (7 * np.cos(slips) - 4)
        page.equal("The friction needed there is the coefficient", ratio, mu, within=1e-14)

    page.draw(
        lambda: drawing.free_body(motion, float(motion.ts[1670])),
        "The free-body diagram: weight, normal force and friction.",
    )
    page.draw(lambda: drawing.trajectory(motion), "The ring is where the cylinder loses contact.")
    look = (
        "The motion ends where contact would end if friction had no limit; with a coefficient of "
        "friction, `jaxdyn run cylinder_on_cylinder` continues with slip and flight."
    )
    page.play(motion, look)


def check(page: Page) -> None:
    """Find the end of contact, and compare with a pendulum and with the formula of friction."""
    rolling = scenes.cylinder_on_cylinder(r=0.5, fixed=1.0, theta=START, t1=4.0)
    end = scenes.contact_lost(rolling)
    cosine, printed = np.cos(np.arctan2(end.y[0], end.y[1])), 4 / 7 * np.cos(START)
    statement = "The normal force vanishes where cos(theta) is 4/7 of its value at the start"
    page.equal(statement, cosine, printed, within=1e-9, route="event")
    motion = simulate(rolling, end.t, samples=300, rtol=1e-12)
    theta = np.arctan2(motion["x"], motion["y"])
    inverted = scenes.pendulum(length=1.5, g=9.81 * 2 / 3, angle=np.pi - START)
    swing = simulate(inverted, end.t, samples=300, rtol=1e-12)
    same = "It moves as an inverted pendulum does with 2/3 of the gravity"
    page.equal(same, theta, np.pi - swing["theta"], within=1e-10, route="second formulation")

    before = theta < np.radians(54)
    needed = jax.jit(jax.vmap(scenes.friction_needed, (None, 0)))(rolling, motion.ys[before])
    closed = np.sin(theta) / (7 * np.cos(theta) - 4 * np.cos(START))
    page.equal("Friction over normal force", needed, closed[before], within=1e-9)


if __name__ == "__main__":
    show(solve)
