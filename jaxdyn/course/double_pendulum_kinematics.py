"""Kinematics of the double pendulum.

Both links of a double pendulum have the length l. Find the acceleration of its end from the angles
theta1 and theta2 from the vertical, in a frame that moves with the elbow without turning, and from
theta1 and phi = theta2 - theta1, in a frame glued to the first link, by the five-term formula.

Answer: The first is the sum of l (theta_i'' e_theta - theta_i'^2 e_r) over both links. In the
second the Coriolis term 2 theta1' phi' is what turns theta1'^2 + phi'^2 into theta2'^2: both
agree, for any angles and rates.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.drawing.figures import blank, style
from jaxdyn.geometry import kinematics

PROBLEM = 36
TOPIC = "pendulums and linkages"

l = np.ones(2)  # noqa: E741 the usual name; no array of JAX, which would start a device


def solve(page: Page) -> None:
    """Follow a double pendulum, and compute the acceleration of its end in three ways."""
    motion = simulate(scenes.double_pendulum(formulation="lagrange"), 5.0, samples=401, rtol=1e-13)
    q, v = motion.ys[:, :2], motion.ys[:, 2:]
    a = jax.vmap(motion.scene.rate)(motion.ts, motion.ys)[:, 2:]

    absolute = jax.vmap(lambda q, v, a: kinematics.end_acceleration(l, q, v, a))(q, v, a)
    relative = jnp.array([[1.0, 0.0], [-1.0, 1.0]])  # theta1 and phi from theta1 and theta2
    turned = (q @ relative.T, v @ relative.T, a @ relative.T)
    glued = jax.vmap(lambda q, v, a: kinematics.end_acceleration_relative(l, q, v, a))(*turned)
    twice = jax.vmap(
        lambda q, v, a: kinematics.by_derivatives(lambda q: kinematics.end_position(l, q), q, v, a)
    )(q, v, a)
    largest = jnp.linalg.norm(absolute, axis=1).max()
    page.number("largest acceleration of the end in 5 s", largest, "m/s^2")
    statement = "Absolute and relative angles agree"
    page.equal(statement, absolute, glued, within=1e-12, route="five-term formula")
    statement = "Both are the second derivative of the position"
    page.equal(statement, absolute, twice, within=1e-12, route="autodiff")

    e = jnp.array([0.3, -0.5])
    five = kinematics.five_terms(e, 1.1, 0.2, jnp.array([0.6, 0.8]), jnp.array([-0.8, 0.6]), e)
    hand = jnp.array([0.6 - 0.16 - 1.21 * 0.6 - 2.2 * 0.6, -1.0 + 0.12 - 1.21 * 0.8 - 2.2 * 0.8])
    page.equal("The five terms in an example", five, hand, within=1e-14, route="by hand")

    figure = blank(6.4, 4.0)
    ax = figure.subplots()
    style(ax)
    ax.plot(motion.ts, absolute, lw=4, alpha=0.4, label=["x", "y"])
    ax.plot(motion.ts, glued, "k--", lw=1, label=["five-term formula", ""])
    ax.set(xlabel="t [s]", ylabel="acceleration of the end [m/s^2]")
    ax.legend(frameon=False)
    page.draw(figure, "The five-term formula (dashed) lies on the sum of the two links.")
    page.play(motion, "The end of the second link is the point whose acceleration is found.")


if __name__ == "__main__":
    show(solve)
