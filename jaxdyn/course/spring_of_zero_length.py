"""A mass on a spring of rest length zero.

A mass hangs in space on a linear spring whose rest length is zero. Write and solve its equations,
draw its path from several sides, and look for the wildest motion that it can make. Make sure that
what you see is a property of the system and not of the integration, and explain it.

Answer: There is no wild motion. The force -k r - m g e_z is linear, so about the point m g / k
below the pin all directions oscillate with the same frequency: each motion is an ellipse in a
plane, with the period 2 pi sqrt(m / k) = 1.987 s. With a rest length of 0.5 m the motion from the
same start is wild.

(a) m r'' = -k r - m g e_z, in space, with e_z upwards. Here m = 1 kg, k = 10 N/m and g = 9.81
m/s^2.

(b) Every start gives an ellipse. The wildest is a circle or a line.

(c) With u the position relative to the point m g / k below the pin, m u'' = -k u in each direction,
so u = u0 cos(w t) + (v0 / w) sin(w t) with w = sqrt(k / m). That lies in the plane of u0 and v0,
and is an ellipse with u0 and v0 / w as conjugate half-diameters. A spring with a rest length has
the force -k (1 - L / |r|) r, which is not linear, and its directions swing with different
frequencies.
"""

import math

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.scenes import springs

PROBLEM = 10
TOPIC = "one particle"


def solve(page: Page) -> None:
    """Compare with the closed form, and measure how far from an ellipse the path is."""
    m, k, g = 1.0, 10.0, 9.81
    scene = scenes.hanging_spring(k=k, m=m, g=g)
    motion = simulate(scene, 10.0, samples=400, rtol=1e-13)
    exact = springs.hanging_spring_exact(scene, motion.ts)
    page.equal("The motion is harmonic in each direction", motion.ys, exact, within=1e-12)
    period = 2 * math.pi * math.sqrt(m / k)
    page.number("period", period, "s")
    back = simulate(scene, period, samples=2, rtol=1e-13).ys[-1]
    page.equal("It is back after a period", back, scene.y0, within=1e-13)
    centre = np.array([0.0, 0.0, -m * g / k])
    r, v = np.asarray(scene.y0[:3]), np.asarray(scene.y0[3:])
    heights = (np.asarray(motion.ys[:, :3]) - centre) @ np.cross(r - centre, v)
    page.equal("Its path is in a plane", heights, 0 * heights, within=1e-12)

    start = {"position": r, "velocity": v}
    wild = simulate(scenes.spring_mass(length=0.5, **start), 10.0, samples=400, rtol=1e-13)
    rough = simulate(scenes.spring_mass(length=0.5, **start), 10.0, samples=400, rtol=1e-9)
    ours, others = springs.wildness(motion), springs.wildness(wild)
    page.number("deviation from an ellipse with rest length 0.5 m, as a part of its size", others)
    page.equal("Without one it is an ellipse", ours, 0.0, within=1e-10, route="best fit")
    page.equal(
        "The wild motion is not an integration error",
        wild.ys,
        rough.ys,
        within=1e-6,
        route="looser tolerance",
    )

    page.draw(
        lambda: drawing.projections(motion, title=""), "From each side the path is an ellipse."
    )
    page.draw(
        lambda: drawing.projections(wild, title=""),
        "With a rest length it fills a region of space.",
    )
    page.play(
        {"rest length 0": motion, "rest length 0.5 m": wild}, "One of the two repeats itself."
    )


if __name__ == "__main__":
    show(solve)
