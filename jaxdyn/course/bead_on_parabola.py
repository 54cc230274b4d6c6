"""Bead on a parabolic wire.

A bead slides without friction on the rigid wire y = c x^2, with gravity along -y. Find its equation
of motion with x as the only coordinate, by Newton's laws.

Answer: Gravity is the only force along the wire, which gives
(1 + 4 c^2 x^2) x'' + 4 c^2 x x'^2 + 2 c g x = 0. It oscillates, with the period
4 E(-4 c^2 a^2) / sqrt(2 c g) for the amplitude a, where E(m) is the complete elliptic integral of
the second kind: longer for wider swings.

The direction along the wire is (1, 2 c x), and the wire pushes across it. The velocity is (x', 2 c
x x'), the acceleration (x'', 2 c x x'' + 2 c x'^2). Newton's law m a = N + (0, -m g), multiplied by
the direction, has no N:

    x'' + 2 c x (2 c x x'' + 2 c x'^2) = -2 c x g.

The period follows from the energy, (1 + 4 c^2 x^2) x'^2 = 2 c g (a^2 - x^2): it is four times the
integral of dx / |x'| from 0 to a, with x = a sin(u).

The numbers belong to c = 1 per metre and g = 9.81 m/s^2.
"""

import numpy as np
from scipy import special

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 30
TOPIC = "constraints"


def by_newton(t, y, p):
    """The rate of x and x': m a along the wire is the weight along it."""
    x, v = y
    c, g = p["c"], p["g"]
    return [v, -(4 * c**2 * x * v**2 + 2 * c * g * x) / (1 + 4 * c**2 * x**2)]


def solve(page: Page) -> None:
    """Solve the equation derived by hand, the scene, and x and y constrained to the wire."""
    precisely = {"samples": 401, "rtol": 1e-13}
    hand = simulate(ode(by_newton, [1.0, 0.0], 10.0, params={"c": 1.0, "g": 9.81}), **precisely)
    by_x = simulate(scenes.bead_on_parabola(c=1.0, x=1.0), **precisely)
    tied = simulate(scenes.bead_on_parabola(c=1.0, x=1.0, formulation="constrained"), **precisely)
    statement = "The equation by hand is that of the scene"
    page.equal(statement, hand.ys, by_x.ys, within=1e-11, route="by hand")
    statement = "x and y constrained to the wire move in the same way"
    page.equal(statement, tied.r, by_x.r, within=1e-10, route="second formulation")

    slides = {}
    for a in (0.1, 0.25, 0.5, 1.0, 1.5, 2.0):
        scene = scenes.bead_on_parabola(c=1.0, x=a)
        period = 4 * special.ellipe(-4 * a**2) / np.sqrt(2 * 9.81)
        page.number(f"period of the amplitude {a} m", period, "s")
        back = simulate(scene, period, **precisely).ys[-1]
        page.equal(f"Then the bead is back at {a} m", back, scene.y0, within=1e-11)
        slides[a] = simulate(scene, 5.0, samples=401)
    page.draw(
        lambda: drawing.free_body(by_x, float(by_x.ts[40])),
        "The weight and the force of the wire, which is normal to it.",
    )
    page.draw(
        lambda: drawing.trajectory(by_x), "The bead swings between equal heights on the wire."
    )
    page.play(slides, "Wider swings take longer on a parabola.", choose="amplitude [m]")


def ask(page: Page) -> None:
    """Other wires and other gravity, from an amplitude of 1 m."""
    periods = [4 * special.ellipe(-4 * c**2) / np.sqrt(2 * c * 9.81) for c in (1.0, 0.1)]
    page.ask(
        "What happens on a flatter wire, c = 0.1 per metre?",
        f"It takes longer, {periods[1]:.3g} s instead of {periods[0]:.3g} s from 1 m, and the "
        "period hardly depends on the amplitude: a flat parabola is almost a cycloid.",
        scenes.bead_on_parabola(c=0.1, x=1.0),
    )
    page.ask(
        "What happens on the Moon, where g = 1.62 m/s^2?",
        "The same oscillation, slower by the factor sqrt(9.81 / 1.62) = "
        f"{np.sqrt(9.81 / 1.62):.3g} everywhere on the wire.",
        scenes.bead_on_parabola(c=1.0, x=1.0, g=1.62),
    )


if __name__ == "__main__":
    show(solve)
