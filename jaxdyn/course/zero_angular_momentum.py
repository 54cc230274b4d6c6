"""Rotation with zero angular momentum.

A massless plate floats in space with four equal masses: two fixed to it at y = +-2, two driven by
machinery on the plate once round circles of radius 1 about x = +-2, opposite to each other. The
angular momentum is zero from beginning to end. By which angle has the plate turned when the driven
masses are back?

Answer: By -pi (1 - 7 / sqrt(65)) = -0.41393 rad, 23.7 degrees against the driven masses. The angle
follows from the path alone, so it is the same at any speed.

With the plate turned by phi and a driven mass at (x, y) on it, the angular momentum of all four
masses is 2 m (w^2 phi' + r^2 phi' + x y' - y x'), with w = 2 metres and r^2 = x^2 + y^2. It is
zero, so

    phi' = -(x y' - y x') / (w^2 + r^2),   phi = -integral of (x dy - y dx) / (4 + x^2 + y^2)

round the circle x = 2 + cos(theta), y = sin(theta). The time does not occur in it. With x dy - y dx
= (1 + 2 cos(theta)) dtheta and r^2 = 5 + 4 cos(theta) the integrand is (1 + 2 cos) / (9 + 4 cos) =
1/2 - (7/2) / (9 + 4 cos), and the integral over one turn is pi - 7 pi / sqrt(65).
"""

import math

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show

PROBLEM = 26
TOPIC = "many particles"


def solve(page: Page) -> None:
    """Let the machinery run once round, and integrate dphi = -(x dy - y dx) / (w^2 + r^2)."""
    motion = simulate(scenes.plate(weld=2.0, centre=2.0, radius=1.0), samples=401, rtol=1e-13)
    turned = motion["phi"][-1]
    page.number("the plate has turned by", turned, "rad")
    page.number("that is", math.degrees(turned), "degrees")
    momentum = energy.along(energy.angular_momentum, motion)
    page.equal(
        "The angular momentum stays zero",
        momentum,
        0 * momentum,
        within=1e-12,
        route="conservation",
    )
    page.equal(
        "It is -pi (1 - 7 / sqrt(65))", turned, -math.pi * (1 - 7 / math.sqrt(65)), within=1e-12
    )
    page.equal("The formula for any plate has it", scenes.plate_turn(), turned, within=1e-12)

    theta = np.linspace(0.0, 2 * math.pi, 64, endpoint=False)
    x, y, dx, dy = 2 + np.cos(theta), np.sin(theta), -np.sin(theta), np.cos(theta)
    path = -2 * math.pi * np.mean((x * dy - y * dx) / (4 + x**2 + y**2))
    page.equal("It is the integral over the path", path, turned, within=1e-12, route="quadrature")

    look = "The driven masses end on the circles where they began, but the plate has turned."
    page.draw(lambda: drawing.trajectory(motion), look)
    page.play(motion, "The plate turns against the masses that are driven round on it.")


if __name__ == "__main__":
    show(solve)
