"""Cart and pendulum.

A cart slides without friction on a level track. A massless stick of length l is hinged to it, with
a point mass at its end; theta = 0 is hanging down. Find the full equations of motion by linear and
angular momentum balance, and by Lagrange, and show that they are the same.

Answer: (m1 + m2) x'' + m2 l (theta'' cos(theta) - theta'^2 sin(theta)) = 0 for the whole along the
track, and l theta'' + x'' cos(theta) + g sin(theta) = 0 for the point across the stick. The
momentum along the track is conserved, so cart and point swing against each other.

(a) The point is at (x + l sin(theta), -l cos(theta)), so its acceleration is x'' along the track
plus l theta'' across the stick less l theta'^2 along it. Momentum of the whole along the track, on
which no force acts, and angular momentum of the point about the hinge, which accelerates with x'':

    (m1 + m2) x'' + m2 l (theta'' cos(theta) - theta'^2 sin(theta)) = 0
    m2 l (l theta'' + x'' cos(theta)) = -m2 g l sin(theta)

(b) The Lagrangian is

    L = (m1 + m2) x'^2 / 2 + m2 l x' theta' cos(theta) + m2 l^2 theta'^2 / 2 + m2 g l cos(theta).

dL/dx = 0, so d/dt (dL/dx') = 0 is the first equation. d/dt (dL/dtheta') = m2 l (x'' cos(theta) -
x' theta' sin(theta)) + m2 l^2 theta'', and dL/dtheta = -m2 l x' theta' sin(theta) - m2 g l
sin(theta): the terms with x' theta' cancel, and what is left is the second.

The motion below has m1 = 2 kg, m2 = 1 kg, l = 1 m, g = 9.81 m/s^2, from theta = 2 rad at rest, the
cart with 0.3 m/s.
"""

import jax.numpy as jnp

from jaxdyn import drawing, effects, ode, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show

PROBLEM = 35
TOPIC = "pendulums and linkages"

START = {"m": (2.0, 1.0), "angle": 2.0, "speed": 0.3}
PRECISELY = {"samples": 401, "rtol": 1e-13}


def by_balance(t, y, p):
    """The rate of x, theta and their rates: momentum along the track and across the stick."""
    _, theta, _, w = y
    (m1, m2), l, g = p["m"], p["l"], p["g"]  # noqa: E741 the usual name
    s, c = jnp.sin(theta), jnp.cos(theta)
    # Both are solved for x'' and theta'' by hand: a linear solver subtracts m2 cos^2(theta) from
    # m1 + m2, which cancels all digits if the cart is light.
    pull = m2 * s * (l * w**2 + g * c) / (m1 + m2 * s**2)
    return jnp.concatenate([y[2:], jnp.stack([pull, -(pull * c + g * s) / l])])


def solve(page: Page) -> None:
    """Swing by hand and by Lagrange; compare, and check what is conserved."""
    by_lagrange = simulate(scenes.cart_pendulum(**START, formulation="lagrange"), **PRECISELY)
    numbers = {"m": (2.0, 1.0), "l": 1.0, "g": 9.81}
    hand = simulate(ode(by_balance, by_lagrange.scene.y0, 10.0, params=numbers), **PRECISELY)
    page.number("x and theta after 10 s", by_lagrange.ys[-1, :2], "m, rad")
    statement = "The balances by hand give the motion of Lagrange's equations"
    page.equal(statement, hand.ys, by_lagrange.ys, within=1e-10, route="second formulation")

    along = energy.along(energy.momentum, by_lagrange)[:, 0]
    page.equal(
        "The momentum along the track is conserved",
        along,
        0 * along + along[0],
        within=1e-11,
        route="conservation",
    )
    drift = energy.drift(by_lagrange)
    page.equal("The energy is conserved", drift, 0.0, within=1e-12, route="conservation")
    page.draw(
        lambda: drawing.free_body(by_lagrange, float(by_lagrange.ts[40])),
        "The stick pulls cart and mass towards each other; the track holds the cart.",
    )
    page.draw(
        lambda: drawing.trajectory(by_lagrange), "The cart moves against the swing of the point."
    )
    page.play(by_lagrange, "The centre of both moves along the track at a constant speed.")


def check(page: Page) -> None:
    """Swing with the stick as a constraint, and on a cart that hardly moves."""
    by_lagrange, tied = (
        simulate(scenes.cart_pendulum(**START, formulation=formulation), **PRECISELY)
        for formulation in ("lagrange", "constrained")
    )
    statement = "The stick as a constraint gives the same motion"
    page.equal(statement, tied.r, by_lagrange.r, within=1e-9, route="second formulation")
    heavy = scenes.cart_pendulum(m=(1e9, 1.0), angle=2.0, formulation="lagrange")
    swing, fixed = (simulate(one, **PRECISELY) for one in (heavy, scenes.pendulum(angle=2.0)))
    statement = "On a very heavy cart it is a simple pendulum"
    page.equal(statement, swing["theta"], fixed["theta"], within=1e-7, route="special case")


def ask(page: Page) -> None:
    """Carts of other masses."""
    start = {"angle": 2.0, "formulation": "lagrange"}
    page.ask(
        "What happens when the cart is a thousand times heavier than the point?",
        "It hardly moves, and the point swings like a pendulum on a fixed hinge.",
        scenes.cart_pendulum(m=(1000.0, 1.0), **start),
    )
    page.ask(
        "What happens when the cart weighs almost nothing, and is released from rest?",
        "No force along the track acts on the point: it falls on a vertical line, while the cart "
        "darts from side to side.",
        scenes.cart_pendulum(m=(0.001, 1.0), **start),
    )
    page.ask(
        "What happens without gravity, when the point is pushed?",
        "The mass centre of both moves along at a constant speed, and the stick turns for ever.",
        scenes.cart_pendulum(m=(2.0, 1.0), rate=3.0, **start).without(effects.UniformGravity),
    )


if __name__ == "__main__":
    show(solve)
