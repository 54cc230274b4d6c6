"""A dropped ball lands before a thrown one.

Choose forces for a single particle, draw its free-body diagram, write its equations, solve them,
and find something worth reporting. Here two balls of 1 kg leave a roof 5 m above the ground, one
dropped and one thrown level at 20 m/s. Without air they land together. With the drag c |v| v, where
c = 0.1 kg/m, the equation is m a = -m g j - c |v| v, and |v| couples its two components. Which of
the balls lands first?

Answer: The dropped ball, after (w / g) arcosh(exp(g h / w^2)) = 1.095 s, where w = 9.905 m/s is the
terminal speed, with g = 9.81 m/s^2; the thrown one then is still 0.90 m above the ground. Its drag
grows with its whole speed, so the part that holds it up is larger at the same rate of fall.
"""

import math

from jaxdyn import drawing, effects, scenes, simulate, until
from jaxdyn.course.page import Page, show
from jaxdyn.integrate import events

PROBLEM = 1
TOPIC = "one particle"


def solve(page: Page) -> None:
    """Drop one ball, throw another, with and without air, and see which lands first."""
    m, g, c, h = 1.0, 9.81, 0.1, 5.0
    air = effects.UniformGravity(g), effects.QuadraticDrag(c)
    vacuum = effects.UniformGravity(g), effects.QuadraticDrag(0.0)

    def landing(forces, speed):
        ball = scenes.particle(*forces, position=(0.0, h), velocity=(speed, 0.0), m=m)
        return until(ball, events.Reaches(1, 0.0, -1), 2.0, rtol=1e-13).t

    dropped, thrown = landing(air, 0.0), landing(air, 20.0)
    page.number("dropped: lands after", dropped, "s")
    page.number("thrown: lands after", thrown, "s")
    w = math.sqrt(m * g / c)
    page.number("terminal speed", w, "m/s")
    fall = w / g * math.acosh(math.exp(g * h / w**2))
    page.equal("The time of the dropped ball", dropped, fall, within=1e-13)
    page.true("The thrown ball lands later", thrown - dropped > 0.1, route="both integrated")
    both = [landing(vacuum, 0.0), landing(vacuum, 20.0)]
    page.equal("Without air they land together", both, [math.sqrt(2 * h / g)] * 2, within=1e-13)

    start = {"position": (0.0, h), "m": m, "t1": dropped}
    balls = {
        "dropped": scenes.particle(*air, velocity=(0.0, 0.0), **start),
        "thrown": scenes.particle(*air, velocity=(20.0, 0.0), **start),
    }
    motions = {name: simulate(ball, samples=200) for name, ball in balls.items()}
    page.number("height of the thrown ball when the other lands", motions["thrown"]["y"][-1], "m")
    page.draw(
        lambda: drawing.free_body(motions["thrown"], 0.5, motion=True),
        "The free-body diagram of the thrown ball after 0.5 s.",
    )
    page.draw(
        lambda: drawing.trajectory(list(motions.values()), names=list(motions), title=""),
        "When the dropped ball lands, the thrown one is still in the air.",
    )
    page.play(motions, "The dropped ball is on the ground before the thrown one.")


def ask(page: Page) -> None:
    """The same two balls without air, and heavier ones."""
    g, h, forces = 9.81, 5.0, (effects.UniformGravity(9.81), effects.QuadraticDrag(0.1))

    def balls(*acting, **numbers):
        return {
            name: scenes.particle(*acting, position=(0.0, h), velocity=(v, 0.0), t1=1.2, **numbers)
            for name, v in (("dropped", 0.0), ("thrown", 20.0))
        }

    page.ask(
        "What happens without air?",
        "Both are at the same height at all times, and land together after sqrt(2 h / g) = "
        f"{math.sqrt(2 * h / g):.4g} s.",
        balls(forces[0]),
    )
    page.ask(
        "What happens to balls of 10 kg in the same air?",
        "Drag matters ten times less: the terminal speed is sqrt(10) times that of 1 kg, "
        f"{math.sqrt(10) * page['terminal speed']:.3g} m/s, and the thrown one is only a little "
        "behind.",
        balls(*forces, m=10.0),
    )


if __name__ == "__main__":
    show(solve)
