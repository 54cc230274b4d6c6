"""Central forces, and orbits that close.

A particle is attracted to the origin by a force F(r). For which law do circular orbits of all radii
have the same speed? Under laws other than a spring's and gravity's, find periodic orbits that are
neither circles nor lines. Do the motions that do not close look regular or chaotic? Under a power
law r^n, how few loops can a closed orbit have, and how does that depend on n?

Answer: F = k / r, since m v^2 / r = k / r. A motion between two radii is a regular rosette, never
chaotic: each loop is the previous one, rotated by twice the apsidal angle, and q loops close if
that angle is pi p / q. The fewest are 3 for k / r, 1 for gravity, 2 for a spring, 7 for r^3 and 3
for r^10, and their number grows without bound as n approaches 1 or -2 without being equal to it.

(a) On a circle m v^2 / r = F(r), so v is the same for all r where F is proportional to 1 / r.

(b) The law of the example is F = k / r with k = 1 N m, for m = 1 kg. Started at 1 m from the centre
across the radius with 0.3132 m/s, the motion closes after 2 turns and 3 loops, in 8.141 s: that is
where the angle between a nearest and the next farthest point, which the start determines, is pi
2 / 3. It is found by solving the closure for the start and the period, as the hint says.

i. The motions that do not close are regular. In a central force the energy and the angular momentum
are constant, so r oscillates between two values with one period, and each loop is the previous one
rotated by the same angle; a chaotic motion is impossible.

ii. See the table: the fewest loops depend on the exponent n through the range of the apsidal angle,
from pi / sqrt(3 + n) for nearly circular orbits to pi / 2, or pi / (3 + n) for -3 < n < -1, for
nearly straight ones. For n <= -3 no motion stays between two radii, so only circles close. The
closer n is to gravity or a spring, the narrower that range, and the more loops the first fraction
in it has.
"""

import numpy as np

from jaxdyn import drawing, effects, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import vectors
from orbits.targets import loops

PROBLEM = 11
TOPIC = "one particle"


def solve(page: Page) -> None:
    """Circle at two radii, close a rosette, and turn one loop of another onto the next."""
    law = effects.PowerLaw(1.0, -1.0)
    speeds = scenes.circular_speed(law, np.array([0.5, 1.0, 2.0]))
    page.equal("Circles of all radii have one speed", speeds, np.ones(3), within=1e-15)
    for radius in (0.5, 2.0):
        scene = scenes.power_law(n=-1.0, r=radius, speed=1.0)
        circle = simulate(scene, samples=400, rtol=1e-13)
        r = np.hypot(circle["x"], circle["y"])
        name = f"At that speed it circles at {radius:g} m"
        page.equal(name, r, np.full(400, radius), within=1e-12, route="integrated")

    orbit = loops.closed(law, turns=2, loops=3)
    closed = simulate(orbit.scene, orbit.period, samples=400, rtol=1e-13)
    page.number("b: period of the closed orbit", orbit.period, "s")
    page.number("b: its speed at the start, 1 m away", np.hypot(*orbit.y0[2:4]), "m/s")
    page.equal("It closes", closed.ys[-1], orbit.y0, within=1e-12, route="integrated again")
    turned = np.unwrap(np.arctan2(closed["y"], closed["x"]))[-1]
    page.equal("After two turns", turned, 4 * np.pi, within=1e-12, route="angle along the path")

    angle = scenes.apsidal_angle(law, 0.4, 1.0)
    page.number("b i: such an angle, 0.4 m to 1 m, without a closed orbit", angle, "rad")
    ring = loops.rosette(law, 0.4, loops=12)
    rosette = simulate(ring, samples=501, rtol=1e-13)
    once = simulate(ring, ring.t1 / 12, samples=400, rtol=1e-13).ys[-1].reshape(2, 2)
    turn = np.asarray(vectors.plane_rotation(2 * angle))
    next_loop = np.asarray(ring.y0).reshape(2, 2) @ turn.T
    page.equal(
        "Each loop is turned by twice that angle", once, next_loop, within=1e-12, route="integral"
    )

    fewest = loops.fewest([-2.0, -1.5, -1.0, 0.0, 0.9, 1.0, 2.0, 3.0, 10.0])
    page.number("b ii: exponents n of the laws k r^n", fewest.n)
    page.number("b ii: fewest loops of a closed orbit under these", fewest.loops)
    bertrand = fewest.loops[fewest.circle == fewest.line]
    page.equal("Gravity needs one loop, a spring two", bertrand, [1, 2], within=0, route="Bertrand")

    motions = {"rosette": rosette, "2 turns, 3 loops": closed}
    page.draw(
        lambda: drawing.trajectory(list(motions.values()), names=list(motions), title=""),
        "A motion that does not close fills its ring with equal loops.",
    )
    page.play(
        motions, "The closed orbit repeats itself; each loop of the other is rotated a little."
    )


def ask(page: Page) -> None:
    """Other laws."""
    page.ask(
        "What happens under gravity, n = -2?",
        "Every bound motion closes after one loop: it is an ellipse about the centre.",
        scenes.power_law(n=-2.0, r=1.0, speed=0.8),
    )
    page.ask(
        "What happens under a spring, n = 1?",
        "Every motion closes, on an ellipse around the centre: two loops in a turn.",
        scenes.power_law(n=1.0, r=1.0, speed=0.6),
    )
    page.ask(
        "What happens to a circle under n = -3.5, when it starts 1 % too fast?",
        "It leaves for good: circles are stable only for n > -3.",
        scenes.power_law(n=-3.5, r=1.0, speed=1.01),
    )


if __name__ == "__main__":
    show(solve)
