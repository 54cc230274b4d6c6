"""Double pendulum.

Two equal uniform bars (m = l = g = 1) hang from a hinge, one from the other. They are let go with
the upper arm level, to the right, and the forearm straight up. Find the equations of motion by
angular momentum balance, by Lagrange, and by constraints between two free bodies; show that they
are the same, and draw the path of the end of the forearm up to t = 30.

Answer: The balance about the hinge, and that of the forearm about the elbow, are two linear
equations for the angular accelerations (`balance`). All routes give one motion, which ends at
(1.2362, 0.0122), but chaos takes digits from each: a start 1e-5 rad aside ends up far away.
"""

import math

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show

PROBLEM = 31
TOPIC = "pendulums and linkages"


def balance(t, y):
    """The rate of theta1, theta2 and their rates by angular momentum balance."""
    q, v = y[:2], y[2:]
    sin, cos = jnp.sin(q[0] - q[1]), jnp.cos(q[0] - q[1])
    inertia = jnp.array([[4 / 3, cos / 2], [cos / 2, 1 / 3]])
    moment = jnp.array([-sin * v[1] ** 2 - 3 * jnp.sin(q[0]), sin * v[0] ** 2 - jnp.sin(q[1])]) / 2
    return jnp.concatenate([v, jnp.linalg.solve(inertia, moment)])


def solve(page: Page) -> None:
    """Swing by every route, compare, and start once more a hair's breadth aside."""
    precisely = {"samples": 601, "rtol": 1e-13}
    by_lagrange = simulate(scenes.double_pendulum(formulation="lagrange"), **precisely)
    by_constraints = simulate(scenes.double_pendulum(formulation="constrained"), **precisely)
    by_balance = simulate(ode(balance, [math.pi / 2, math.pi, 0.0, 0.0], 30.0), **precisely)
    page.number("angles at t = 30", by_balance.ys[-1, :2], "rad")
    page.number("end of the forearm there", by_lagrange.r[-1, 2], "m")

    angles = by_lagrange.ys[:, :2]
    tied = np.stack([by_constraints["theta1"], by_constraints["theta2"]], axis=1)
    for t, within in ((10, 1e-11), (30, 1e-8)):
        name, i = f"give the same angles at t = {t}", 20 * t
        for route, other in (("Lagrange", angles), ("constraints", tied)):
            statement = f"Balance and {route} {name}"
            page.equal(statement, by_balance.ys[i, :2], other[i], within=within, route=route)
    drift = energy.drift(by_lagrange)
    page.equal("The energy stays the same", drift, 0.0, within=1e-12, route="conservation")

    angle = math.pi / 2 + 1e-5
    beside = scenes.n_pendulum(
        m=(1, 1), l=(1, 1), angles=(angle, math.pi), rates=(0, 0), t1=30.0, formulation="lagrange"
    )
    aside = simulate(beside, **precisely)
    apart = np.abs(aside.ys[-1] - by_lagrange.ys[-1]).max()
    page.number("growth of a small error of the start until t = 30", apart / 1e-5)

    look = "The end of the forearm draws a tangle that never repeats."
    page.draw(drawing.trajectory(by_lagrange), look)
    motions = {"released": by_lagrange, "1e-5 rad aside": aside}
    page.play(motions, "Two starts that no eye tells apart stay together for a while, then part.")


if __name__ == "__main__":
    show(solve)
