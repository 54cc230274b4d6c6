"""Mass in a slot on a turntable.

A rigid table turns freely about its centre. A mass slides without friction in a straight slot that
passes the centre at the distance d. With the angle theta of the table and the place s along the
slot, find the acceleration of the mass in three ways (a) and the equations of motion by angular
momentum balance (b) and by Lagrange (c). Started with s = 0, s' > 0 and theta' > 0, does theta grow
without bound (d)?

Answer: s'' = theta'^2 s - theta'' d and (I + m s^2) theta'' = -m s (2 theta' s' + theta'^2 d).
The angle has a limit: the mass runs away steadily, s grows like t, and with the angular momentum
fixed theta' falls like 1 / s^2.
"""

import jax.numpy as jnp

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import kinematics

PROBLEM = 34
TOPIC = "constraints"


def by_balance(t, y, p):
    """The rate of theta, s and their rates, by the balances of table and mass, and of the mass."""
    _, s, w, v = y
    turning = -p["m"] * s * (2 * w * v + w**2 * p["d"]) / (p["I"] + p["m"] * s**2)
    return [w, v, turning, w**2 * s - turning * p["d"]]


def solve(page: Page) -> None:
    """Compare accelerations and equations of motion, then wait for the limit of the angle."""
    d, q, v, a = 0.5, jnp.array([0.7, 1.1]), jnp.array([1.3, -0.4]), jnp.array([0.2, 0.9])
    by_axes = kinematics.slot_acceleration(d, q, v, a)
    page.number("acceleration of the mass in an example", by_axes, "m/s^2")
    twice = kinematics.by_derivatives(lambda q: kinematics.slot_position(d, q), q, v, a)
    statement = "It is the second derivative of x and y"
    page.equal(statement, by_axes, twice, within=1e-14, route="autodiff")
    five = kinematics.slot_acceleration_five_terms(d, q, v, a)
    page.equal("The five-term formula agrees", by_axes, five, within=1e-14, route="moving frame")

    numbers = {"m": 1.0, "I": 1.0, "d": d}
    precisely = {"samples": 401, "rtol": 1e-13}
    hand = simulate(ode(by_balance, [0.0, 0.0, 1.0, 1.0], 3.0, params=numbers), **precisely)
    by_lagrange = simulate(scenes.turntable(formulation="lagrange"), **precisely)
    statement = "Balances and Lagrange agree"
    page.equal(statement, hand.ys, by_lagrange.ys, within=1e-12, route="second formulation")

    late = simulate(by_lagrange.scene, 1e4, **precisely)
    theta, s, _, speed = late.ys[-1]
    momentum = (1.0 + d**2) * 1.0 + d * 1.0
    # The integral of dtheta / ds from s on; what is left out falls like 1 / s^3.
    tail = (momentum / speed - d) / s
    limit = scenes.turntable_limit(d=d)
    page.number("angle after 1e4 s", theta, "rad")
    page.number("its limit", limit, "rad")
    page.equal(
        "The rest of the way to the limit is what is left", theta + tail, limit, within=1e-11
    )
    slow = [scenes.turntable_limit(d=d, speed=u) for u in (0.01, 0.1, 1.0)]
    page.number("limits for slower masses: 0.01, 0.1 and 1 m/s", slow, "rad")

    page.draw(drawing.trajectory(by_lagrange), "The mass leaves on a path that becomes straight.")
    speeds = {
        u: simulate(scenes.turntable(speed=u, formulation="lagrange"), 6.0, samples=401)
        for u in (0.01, 0.1, 0.3, 1.0, 3.0)
    }
    page.play(speeds, "The slower the mass, the longer the table turns.", choose="speed [m/s]")


if __name__ == "__main__":
    show(solve)
