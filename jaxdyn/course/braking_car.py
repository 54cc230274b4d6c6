"""A car that brakes with locked front or rear wheels.

A car, seen from above, runs straight ahead when either its front or its rear wheels lock; the
other axle rolls freely, the locked one drags like a single point on the centre line. Derive the
motion, brake down to rest, and decide which of the two is stable: does a small rotation grow? What
does that depend on?

Answer: With the front wheels locked any rotation dies out, at any speed. With the rear wheels
locked it grows while V^2 > mu g L, above 4.2 m/s here. From 20 m/s a
rotation of 0.01 rad/s turns this car by 257 degrees before it stops, with locked front wheels by
0.07 degrees.
"""

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.integrate.phases import simulate_phases

PROBLEM = 32
TOPIC = "rolling and skating"


def solve(page: Page) -> None:
    """Brake both cars to rest; check straight stops, small rotations and the free car."""
    edge = np.sqrt(0.7 * 9.81 * (1.2 + 1.4))
    page.number("speed above which locked rear wheels are unstable", edge, "m/s")
    stops = {}
    for locked, far in (("front", 1.4), ("rear", 1.2)):
        scene = scenes.car(locked=locked)
        stop = simulate_phases(scenes.braking(scene), "slide", scene.y0, 60.0, samples=300)
        stops[f"{locked} wheels locked"] = stop
        page.number(f"turned at rest, {locked} wheels locked", np.degrees(stop.y[2]), "degrees")

        straight = scenes.car(locked=locked, spin=0.0)
        slide = simulate_phases(scenes.braking(straight), "slide", straight.y0, 60.0, samples=300)
        slowing = 0.7 * 9.81 * far / 2.6
        found, expected = [slide.t, slide.y[0]], [20.0 / slowing, 20.0**2 / (2 * slowing)]
        page.equal(f"Straight stop, {locked}: time and way", found, expected, within=1e-9)

        hardly = scenes.car(locked=locked, speed=10.0, spin=1e-6)
        later = simulate(hardly, 1.0, samples=300, rtol=1e-12)["theta_dot"][-1] / 1e-6
        left = scenes.wheels.turning_left(hardly, 10.0 - slowing)
        page.number(f"rotation after 1 s from 10 m/s, {locked}", left, "of the first")
        page.equal(f"A small rotation after 1 s, {locked}", later, left, within=1e-7)
        growth = hardly.rate(0.0, hardly.y0)[5] / 1e-6
        rate = scenes.turning_rate(hardly, 10.0)
        page.equal(f"Its rate of growth, {locked}", growth, rate, within=1e-12)

    page.equal("It is 0 at that speed", scenes.turning_rate(scenes.car(), edge), 0.0, within=1e-14)
    free = simulate(scenes.car(mu=0.0, spin=0.5), 10.0, samples=300, rtol=1e-12)
    page.equal("Without friction energy is conserved", energy.drift(free), 0.0, within=1e-12)

    figure = drawing.trajectory(list(stops.values()), names=list(stops))
    page.draw(figure, "Both cars start with the same small rotation; one goes on, one spins round.")
    page.play(stops, "The same car with the same disturbance, and two ways to brake.")


if __name__ == "__main__":
    show(solve)
