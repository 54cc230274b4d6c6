"""A cannonball on target.

A ball of 1 kg is shot at 10 m/s through air with the drag c v^2, where c = 0.5 kg/m and g = 10
m/s^2. Find, without guessing, the launch angles with which it lands 2 m away. Then find the lowest
speed that still reaches 2 m, and its angle. As printed, the problem calls itself a continuation of
problem 10; it continues 12.

Answer: At 10 m/s two angles hit, 13.19 and 61.51 degrees. The lowest speed is 7.176 m/s, at 37.87
degrees: 2 m is the longest range at that speed.

The ball obeys x'' = -(c/m) v x' and y'' = -g - (c/m) v y' with v^2 = x'^2 + y'^2. A shot at the
angle theta and the speed u is integrated until y = 0 again, at the distance X(theta, u).

(i) X rises with theta to its largest value and falls again, so X(theta, 10 m/s) = 2 m has one root
on either side of the maximum. Each is bracketed there, and found by Newton's method with the
derivative of the integration by theta.

(ii) At the lowest speed the two roots meet: the largest X over all angles is 2 m. That maximum,
where dX/dtheta = 0, grows with the speed u, and its derivative by u is the partial one at the best
angle; so u is found by Newton's method, too.
"""

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.integrate.events import Reaches
from orbits.targets import aim

PROBLEM = 27
TOPIC = "one particle"


def solve(page: Page) -> None:
    """Find all hits and the slowest one, and check them by separate integrations."""
    air = {"g": 10.0, "drag": 0.5}
    cannon = scenes.cannonball(**air)
    hits = aim.hit(cannon, 2.0, 10.0)
    page.number("angles that hit at 10 m/s", np.degrees(hits.angles), "degrees")
    best = aim.slowest(cannon, 2.0)
    page.number("lowest speed", best.speed, "m/s")
    page.number("its angle", np.degrees(best.angle), "degrees")

    flat, steep = hits.angles
    shots = {
        "flat": scenes.cannonball(speed=10.0, angle=flat, t1=hits.times[0], **air),
        "steep": scenes.cannonball(speed=10.0, angle=steep, t1=hits.times[1], **air),
        "slowest": scenes.cannonball(speed=best.speed, angle=best.angle, t1=best.t, **air),
    }
    motions = {name: simulate(shot, samples=200, rtol=1e-13) for name, shot in shots.items()}
    for name, motion in motions.items():
        end = motion.ys[-1, :2]
        page.equal(
            f"The {name} shot lands at 2 m", end, [2.0, 0.0], within=1e-12, route="shot again"
        )
    longest = aim.farthest(cannon, best.speed)
    page.equal(
        "No angle takes the slowest farther", longest.x, 2.0, within=1e-12, route="longest range"
    )
    page.equal(
        "and its angle is the best", longest.angle, best.angle, within=1e-7, route="longest range"
    )

    page.draw(
        lambda: drawing.trajectory(list(motions.values()), names=list(motions), title=""),
        "Two angles hit at 10 m/s, and one at the lowest speed, between them.",
    )
    page.play(motions, "All three land 2 m away, the steep shot last.", ends=Reaches(1, 0.0, -1))


if __name__ == "__main__":
    show(solve)
