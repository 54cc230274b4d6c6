"""Euler's equations in full.

The inertia of a free body in space is I = R I* R^T, its angular velocity changes by omega' =
-I^-1 (omega x I omega), and its attitude by R' = S(omega) R. Draw a box, long in x and narrow in z,
whose moments could be 1, 2 and 3, and let it spin almost about y for long enough that something
happens. As printed, "could plausibly be" is too much: 1 + 2 = 3 holds for flat plates only.

Answer: The plate of 1 kg with these moments is 4.899 m x 3.464 m x 0. Spun at 1 rad/s about y, with
0.01 rad/s about x, it flips over every 20.75 s, for ever; a real box flips alike.
"""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import ellipk

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.formulations import rigid
from jaxdyn.geometry import inertia

PROBLEM = 51
TOPIC = "rigid bodies in space"


def euler(t, y, p):
    """Rates of the attitude, row by row, and of the angular velocity, both in the fixed frame."""
    R, omega = y[:9].reshape(3, 3), y[9:]
    momentum = R @ (p["moments"] * (R.T @ omega))
    turning = R @ ((R.T @ -jnp.cross(omega, momentum)) / p["moments"])
    return jnp.concatenate([jnp.cross(omega, R.T).T.ravel(), turning])


def solve(page: Page) -> None:
    """Find the box, let it flip, and integrate the equations as they stand."""
    moments = jnp.array([1.0, 2.0, 3.0])
    body = inertia.Body(1.0, jnp.zeros(3), jnp.diag(moments))
    sides = inertia.equivalent_box(body)
    page.number("sides of the box", sides, "m")
    page.equal(
        "They give the moments", jnp.diag(inertia.box(1.0, sides).inertia), moments, within=1e-14
    )
    page.true("It is flat", inertia.is_flat(body), route="1 + 2 = 3")

    omega = jnp.array([0.01, 1.0, 0.0])
    low, high = 4.0001 - 2.0001, 3 * 2.0001 - 4.0001  # H^2 - 2 T I_1 and 2 T I_3 - H^2
    flip = 2 * ellipk(low / high) / np.sqrt(high / 6)
    page.number("time from flip to flip", flip, "s")
    plate = scenes.box(omega, sides=sides)
    motion = simulate(plate, 3 * flip, samples=601, rtol=1e-13)
    page.equal("It is on its side half-way", motion["omega2"][100::200], np.zeros(3), within=1e-8)
    page.equal("Energy is conserved", energy.drift(motion), 0.0, within=1e-12)
    page.equal("So is momentum", energy.drift(motion, "angular momentum"), 0.0, within=1e-12)
    six = scenes.free_body(omega, moments=moments)
    same = jax.jit(plate.rate)(0.0, plate.y0)
    page.equal("Only the moments count", jax.jit(six.rate)(0.0, six.y0), same, within=1e-14)

    start = jnp.concatenate([jnp.eye(3).ravel(), omega])
    whole = ode(euler, start, 3 * flip, params={"moments": moments})
    fixed = simulate(whole, samples=601, rtol=1e-13).ys
    pose, attitude = energy.along(rigid.pose, motion), fixed[:, :9].reshape(-1, 3, 3)
    same = "The equations in the fixed frame give the same attitude"
    page.equal(same, pose.R_wb, attitude, within=1e-7, route="second formulation")
    same = "They give the same angular velocity"
    page.equal(same, pose.omega_w, fixed[:, 9:], within=1e-7, route="second formulation")

    page.draw(
        lambda: drawing.time_series(motion, names=["omega1", "omega2", "omega3"]),
        "It flips over whenever omega2 changes its sign.",
    )
    page.play(motion, "The plate turns, wobbles, and flips over.")


if __name__ == "__main__":
    show(solve)
