"""An eccentric cylinder that rolls down a ramp.

A cylinder of radius r has its mass centre G at a distance d from its axis, and rolls without slip
down a ramp. Find its equation of motion, and the friction that rolling needs. Released from rest
with G straight above the contact, how far does it roll before it leaves the ramp?

Answer: With psi the angle of G from the normal of the ramp, Lagrange's equation of L(psi, psi')
below is the motion. With unlimited friction this cylinder rolls 12.78 m, two turns and 0.21 rad,
until the normal force vanishes; but the friction does not vanish there, so let go it would move
into the ramp: with any real coefficient it slips before, and lifts off from a slip, if at all.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, lagrangian, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 38
TOPIC = "rolling and skating"

NUMBERS = {"m": 1.0, "r": 1.0, "d": 0.5, "inertia": 0.4, "slope": 0.2, "g": 9.81}


def rolling_law(t, q, v, p):
    """Kinetic minus potential energy by psi, the angle of G from the normal of the ramp."""
    psi, turning = q[0], v[0]
    square = p["r"] ** 2 + p["d"] ** 2 + 2 * p["r"] * p["d"] * jnp.cos(psi)
    down, off = p["r"] * psi + p["d"] * jnp.sin(psi), p["d"] * jnp.cos(psi)
    height = off * jnp.cos(p["slope"]) - down * jnp.sin(p["slope"])
    return (p["m"] * square + p["inertia"]) * turning**2 / 2 - p["m"] * p["g"] * height


def solve(page: Page) -> None:
    """Roll to where the normal force vanishes, in two ways, and find the forces on the way."""
    scene = scenes.cylinder_on_ramp(t1=10.0, **NUMBERS)
    end = scenes.contact_lost(scene)
    page.number("it rolls until the normal force vanishes", end.y[2] - 0.2, "m")
    motion = simulate(scene, end.t, samples=300, rtol=1e-12)
    by_angle = lagrangian(rolling_law, [0.0], [0.0], params=NUMBERS)
    angle = simulate(by_angle, end.t, samples=300, rtol=1e-12)
    psi, rate = angle["q0"], angle["q0_dot"]
    same = "Lagrange's equation gives the same motion"
    page.equal(same, motion["phi"] - 0.2, psi, within=1e-10, route="second formulation")

    turning = jax.vmap(by_angle.rate)(angle.ts, angle.ys)[:, 1]
    down = turning * (1 + 0.5 * np.cos(psi)) - 0.5 * np.sin(psi) * rate**2
    off = -0.5 * (np.sin(psi) * turning + np.cos(psi) * rate**2)
    normal, friction = off + 9.81 * np.cos(0.2), down - 9.81 * np.sin(0.2)  # m = 1 kg
    page.equal("No normal force is left at the end", normal[-1], 0.0, within=1e-9)
    page.number("friction that is left", friction[-1], "N")
    lifts = 0.5 * np.sin(psi[-1]) * (1 + 0.5 * np.cos(psi[-1])) * friction[-1] / 0.4
    page.number("acceleration off the ramp without it", lifts, "m/s^2")
    page.true("A flight from there would enter the ramp", lifts < 0, route="Newton's law")

    rolls = normal > 0.1
    needed = jax.jit(jax.vmap(scenes.friction_needed, (None, 0)))(scene, motion.ys[rolls])
    page.equal("Friction needed", needed, abs(friction / normal)[rolls], within=1e-9)
    k = int(np.argmax(needed > 0.8))
    slips = np.interp(0.8, needed[k - 1 : k + 1], psi[rolls][k - 1 : k + 1])
    page.number("it slips with a coefficient of 0.8 after", f"{slips:.3f}", "m")

    page.draw(drawing.trajectory(motion), "The paths of G and of a mark on the rim.")
    look = (
        "It rolls until the ramp would have to pull, as if friction had no limit; with a "
        "coefficient of friction, `jaxdyn run cylinder_on_ramp` goes on by slip and flight."
    )
    page.play(motion, look)


if __name__ == "__main__":
    show(solve)
