"""Pendulum by its horizontal position.

Describe a pendulum that hangs down by the horizontal position of its mass instead of the angle:
here x (y in the course, whose x points down). Find the one equation of second order for x, and
compare its solutions with those of the usual pendulum equation.

Answer: x'' = -x x'^2 / (l^2 - x^2) - g x sqrt(l^2 - x^2) / l^2, from Lagrange with the speed
l x' / sqrt(l^2 - x^2). It agrees with l sin(theta) to rounding as long as the mass stays below the
hinge; at the level of the hinge the coordinate is singular, with 0 / 0 for the acceleration.

With x = l sin(theta) the mass is at the depth sqrt(l^2 - x^2), and its speed is l theta' = l x' /
sqrt(l^2 - x^2). So

    L = m l^2 x'^2 / (2 (l^2 - x^2)) + m g sqrt(l^2 - x^2),

and d/dt (dL/dx') = dL/dx, divided by m l^2 / (l^2 - x^2), is the equation above. The same follows
from theta'' = -(g / l) sin(theta): x'' = l theta'' cos(theta) - l theta'^2 sin(theta).

The comparison is for l = 1 m and g = 9.81 m/s^2, from 1.2 rad at rest, for 10 s.
"""

import jax.numpy as jnp

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 24
TOPIC = "pendulums and linkages"


def by_hand(t, y, p):
    """The rate of x and x'."""
    x, v = y
    square = p["l"] ** 2 - x**2
    return [v, -x * v**2 / square - p["g"] * x * jnp.sqrt(square) / p["l"] ** 2]


def solve(page: Page) -> None:
    """Swing by x and by the angle; find where a faster one leaves the range of x."""
    precisely = {"samples": 401, "rtol": 1e-13}
    sideways = simulate(scenes.sideways_pendulum(angle=1.2), **precisely)
    angle = simulate(scenes.pendulum(angle=1.2), **precisely)
    hand = simulate(
        ode(by_hand, sideways.scene.y0, 10.0, params={"g": 9.81, "l": 1.0}), **precisely
    )
    page.equal(
        "x is l sin(theta)",
        sideways["x"],
        jnp.sin(angle["theta"]),
        within=1e-11,
        route="second formulation",
    )
    page.equal(
        "x' is l theta' cos(theta)",
        sideways["x_dot"],
        angle["theta_dot"] * jnp.cos(angle["theta"]),
        within=1e-11,
        route="second formulation",
    )
    page.equal(
        "The equation by hand is that of the scene",
        hand.ys,
        sideways.ys,
        within=1e-11,
        route="by hand",
    )

    fast = scenes.sideways_pendulum(angle=0.0, rate=6.0)
    edge = scenes.sideways_edge(fast)
    page.number("a pendulum with 6 rad/s at the bottom reaches a depth of 1e-3 l at", edge.t, "s")
    there = simulate(scenes.pendulum(angle=0.0, rate=6.0), edge.t, **precisely).ys[-1]
    statement = "There the pendulum by its angle is at the same place"
    page.equal(statement, edge.y[0], jnp.sin(there[0]), within=1e-12, route="second formulation")
    page.draw(
        lambda: drawing.time_series(sideways),
        "x lingers at its ends, where the mass climbs rather than moves sideways.",
    )
    page.play({"by x": sideways, "by the angle": angle}, "Both coordinates describe one motion.")


if __name__ == "__main__":
    show(solve)
