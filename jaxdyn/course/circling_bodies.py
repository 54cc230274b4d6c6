"""Two and three bodies on circles.

Two bodies that attract each other by gravity can circle their centre of mass for ever, and so can
three equal ones at the corners of a triangle. What is the period of the two at a distance d, and
how fast do three bodies turn on a circle of diameter 3 for G = 10? Is the motion stable?

Answer: The period of two is 2 pi sqrt(d^3 / (G (m1 + m2))), and three on a circle of radius R turn
at sqrt(G m / (sqrt(3) R^3)) = 1.3079. The circle of three is unstable: rounding alone ends it.

(a) Both circle the mass centre with one angular speed w. The first is at d m2 / (m1 + m2) from it,
so m1 w^2 d m2 / (m1 + m2) = G m1 m2 / d^2, and the period is 2 pi / w.

(b) For G = 1, m1 = 1, m2 = 3 and d = 2 the period is 8.886; after it both bodies are back.

(c) Three bodies on a circle of radius R are sqrt(3) R apart. Each is pulled to the centre with
2 (G m^2 / (3 R^2)) cos(30 degrees) = G m^2 / (sqrt(3) R^2) = m w^2 R. For the diameter 3, R = 1.5.

(d) After 2 pi / w they are back as well. But a small error grows in each turn by the factor in the
table, so that a simulation leaves the circle after some turns.
"""

import math

import orbits
from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 16
TOPIC = "many particles"


def solve(page: Page) -> None:
    """Follow both for one period and compare with their starts; find out which is stable."""
    two = scenes.two_body(m1=1.0, m2=3.0, d=2.0)
    period = 2 * math.pi * math.sqrt(2.0**3 / 4.0)
    motion = simulate(two, period, samples=200, rtol=1e-13)
    page.number("period of two bodies", period)
    page.equal("Two bodies are back after it", motion.ys[-1], two.y0, within=1e-11)

    three = scenes.three_body_circular(diameter=3.0, G=10.0)
    rate = math.sqrt(10.0 / (math.sqrt(3.0) * 1.5**3))
    orbit = orbits.find(three, period=2 * math.pi / rate)
    growth = abs(orbits.stability(orbit).multipliers).max()
    page.number("angular speed of three bodies", rate)
    page.equal("Three bodies are back after one turn", orbit.y0, three.y0, within=1e-11)
    page.number("growth of a small error in one turn of three bodies", growth)
    page.true("The circle of three is unstable", growth > 1.1, route="Floquet multipliers")

    page.draw(lambda: drawing.trajectory(motion), "The lighter body runs on the wider circle.")
    page.play(motion, "The bodies are always on opposite sides of their centre of mass.")
    page.play(simulate(three, orbit.period), "Three bodies keep their triangle, for a while.")


def ask(page: Page) -> None:
    """Two bodies at other speeds."""
    two = scenes.two_body(m1=1.0, m2=3.0, d=2.0)

    def faster(factor, t1):
        y0 = two.y0.at[4:].multiply(factor)
        return two.starting(y0, t1)

    # A start at factor times the speed of the circle is an apsis: a = d / (2 - factor^2).
    period = page["period of two bodies"]
    wide = period / (2 - 1.2**2) ** 1.5
    page.ask(
        "What happens when both start 1.2 times as fast?",
        f"Each runs on an ellipse, and is back after {wide:.4g} instead of {period:.4g}.",
        faster(1.2, wide),
    )
    page.ask(
        "What happens when both start sqrt(2) times as fast?",
        "That is the escape speed: they separate on parabolas and never come back.",
        faster(math.sqrt(2), 40.0),
    )


if __name__ == "__main__":
    show(solve)
