"""Kinematics of the double pendulum.

Both links of a double pendulum have the length l. Find the acceleration of its end from the angles
theta1 and theta2 from the vertical, in a frame that moves with the elbow without turning, and from
theta1 and phi = theta2 - theta1, in a frame glued to the first link, by the five-term formula.

Answer: The first is the sum of l (theta_i'' e_theta - theta_i'^2 e_r) over both links. In the
second, the Coriolis term 2 theta1' phi' completes theta1'^2 + phi'^2 to theta2'^2, so both agree
for all angles and rates.

For each link e_r points along it, and e_theta across it, in the direction of growing angles; the
indices 1 and 2 name the link.

(a) The elbow moves on a circle about the hinge, and the end on a circle about the elbow in a frame
that does not turn, so the two accelerations of motion on a circle add up:

    a = l (theta1'' e_theta1 - theta1'^2 e_r1) + l (theta2'' e_theta2 - theta2'^2 e_r2)

(b) The frame on the first link turns at omega = theta1'; in it the end circles the elbow at phi':

    a = a_elbow + theta1'' k x r - theta1'^2 r + 2 theta1' k x v_rel + a_rel
    r = l e_r2,   v_rel = l phi' e_theta2,   a_rel = l (phi'' e_theta2 - phi'^2 e_r2)

Along e_theta2 that is l (theta1'' + phi''), along e_r2 it is -l (theta1'^2 + 2 theta1' phi' +
phi'^2) = -l (theta1' + phi')^2. With theta2 = theta1 + phi both are those of (a).

The example below is the double pendulum of problem 31: bars of 1 m and 1 kg, g = 1 m/s^2.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.course.page import Page, largest, show
from jaxdyn.geometry import kinematics

PROBLEM = 36
TOPIC = "pendulums and linkages"

l = np.ones(2)  # noqa: E741 the usual name; no array of JAX, which would start a device


def balance(t, y):
    """The rate by the equations of problem 31, solved for theta1'' and theta2''."""
    q1, q2, v1, v2 = y
    s, c = jnp.sin(q1 - q2), jnp.cos(q1 - q2)
    first, second = -s * v2**2 - 3 * jnp.sin(q1), s * v1**2 - jnp.sin(q2)
    whole = 16 / 9 - c**2
    return [v1, v2, (2 / 3 * first - c * second) / whole, (8 / 3 * second - c * first) / whole]


def square(t, y):
    """Square of the acceleration of the end, as the sum over both links."""
    q, v = y[:2], y[2:]
    a = jnp.stack(balance(t, y)[2:])
    return jnp.sum(kinematics.end_acceleration(l, q, v, a) ** 2)


def at_all(function):
    """A function of one sample as one of all samples, on the host."""
    several = jax.jit(jax.vmap(function))
    return lambda *given: np.asarray(several(*given))


def solve(page: Page) -> None:
    """Follow a double pendulum, and compute the acceleration of its end in three ways."""
    motion = simulate(scenes.double_pendulum(formulation="lagrange"), 5.0, samples=401, rtol=1e-13)
    ts, ys = np.asarray(motion.ts), np.asarray(motion.ys)
    (q, v), a = np.split(ys, 2, axis=1), at_all(motion.scene.rate)(ts, ys)[:, 2:]

    absolute = at_all(lambda q, v, a: kinematics.end_acceleration(l, q, v, a))(q, v, a)
    relative = np.array([[1.0, 0.0], [-1.0, 1.0]])  # theta1 and phi from theta1 and theta2
    turned = (q @ relative.T, v @ relative.T, a @ relative.T)
    glued = at_all(lambda q, v, a: kinematics.end_acceleration_relative(l, q, v, a))(*turned)
    twice = at_all(
        lambda q, v, a: kinematics.by_derivatives(lambda q: kinematics.end_position(l, q), q, v, a)
    )(q, v, a)
    same = "The sum over both links is that of the equations by hand"
    lengths = np.linalg.norm(absolute, axis=1)
    page.equal(same, np.sqrt(at_all(square)(ts, ys)), lengths, within=1e-12)
    page.number("acceleration of the end after 5 s", absolute[-1], "m/s^2")
    statement = "Absolute and relative angles agree"
    page.equal(statement, absolute, glued, within=1e-12, route="five-term formula")
    statement = "Both are the second derivative of the position"
    page.equal(statement, absolute, twice, within=1e-12, route="autodiff")

    e, x, y = np.array([0.3, -0.5]), np.array([0.6, 0.8]), np.array([-0.8, 0.6])
    five = jax.jit(kinematics.five_terms)(e, 1.1, 0.2, x, y, e)
    hand = np.array([0.6 - 0.16 - 1.21 * 0.6 - 2.2 * 0.6, -1.0 + 0.12 - 1.21 * 0.8 - 2.2 * 0.8])
    page.equal("The five terms in an example", five, hand, within=1e-14, route="by hand")

    page.draw(
        lambda: picture(ts, absolute, glued),
        "The five-term formula (dashed) coincides with the sum of the two links.",
    )
    page.play(motion, "The end of the second link is the point whose acceleration is found.")


def picture(ts, absolute, glued):
    """The acceleration of the end over time, by both formulas."""
    figure = drawing.figures.blank(6.4, 4.0)
    ax = figure.subplots()
    drawing.figures.style(ax)
    ax.plot(ts, absolute, lw=4, alpha=0.4, label=["x", "y"])
    ax.plot(ts, glued, "k--", lw=1, label=["five-term formula", ""])
    ax.set(xlabel="t [s]", ylabel="acceleration of the end [m/s^2]")
    ax.legend(frameon=False)
    return figure


def check(page: Page) -> None:
    """The largest acceleration on the way, and when it is reached."""
    start = scenes.double_pendulum(formulation="lagrange").y0
    most = largest(ode(balance, start, 5.0), square)
    page.number("largest acceleration of the end in 5 s", np.sqrt(most.value), "m/s^2")
    page.number("reached at", most.t, "s")


if __name__ == "__main__":
    show(solve)
