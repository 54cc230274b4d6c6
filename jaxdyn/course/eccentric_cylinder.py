"""An eccentric cylinder that rolls down a ramp.

A cylinder of radius r has its mass centre G at a distance d from its axis, and rolls without slip
down a ramp. Find its equation of motion, and the friction that rolling needs. Released from rest
with G straight above the contact, how far does it roll before it leaves the ramp?

Answer: With unlimited friction this cylinder rolls 12.78 m, two turns and 0.21 rad, until the
normal force vanishes; but the friction does not vanish there, so let go it would move into the
ramp: with any real coefficient it slips before, and lifts off from a slip, if at all. With the
coefficient 0.8 it slips after 12.568 m.

The numbers belong to m = 1 kg, r = 1 m, d = 0.5 m, I = 0.4 kg m^2 about G, a slope of gamma = 0.2
rad and g = 9.81 m/s^2. Let psi be the angle that the cylinder has rolled, which is that of G from
the normal of the ramp, since it starts with G above the contact; it has rolled the distance r psi.

(a) G is at r psi + d sin psi along the ramp, downwards, and at r + d cos psi off it. Angular
momentum balance about the contact, or Lagrange's equation of T - V, gives

    (I + m (r^2 + d^2 + 2 r d cos psi)) psi'' - m r d sin(psi) psi'^2
        = m g (r sin gamma + d sin(psi + gamma)).

From rest the energy gives the rate: (I + m (r^2 + d^2 + 2 r d cos psi)) psi'^2 / 2 =
m g (r psi sin gamma + d cos gamma - d cos(psi + gamma)).

(b) Momentum balance along the ramp and off it gives the friction F (positive down the ramp) and the
normal force N, and rolling needs a coefficient of at least |F| / N:

    F = m ((r + d cos psi) psi'' - d sin(psi) psi'^2) - m g sin gamma
    N = m g cos gamma - m d (sin(psi) psi'' + cos(psi) psi'^2)

(c) N falls to zero after 12.78 m. There the friction is still -0.602 N: it holds the cylinder back
and, by its moment about G, keeps it turning as it rolls. Without it G would accelerate into the
ramp, at 0.233 m/s^2, so there is no flight that begins there. As N falls, |F| / N grows without
bound, so a real cylinder slips before; it can skip into the air only from a slip.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, lagrangian, scenes, simulate, until
from jaxdyn.course.page import Page, show
from jaxdyn.scenes.cylinders import Grip

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


def forces(psi):
    """Friction down the ramp and normal force [N] after a turn psi from rest."""
    m, r, d, inertia, slope, g = (NUMBERS[name] for name in NUMBERS)
    about = inertia + m * (r**2 + d**2 + 2 * r * d * np.cos(psi))
    fallen = r * psi * np.sin(slope) + d * (np.cos(slope) - np.cos(psi + slope))
    square = 2 * m * g * fallen / about
    pull = m * g * (r * np.sin(slope) + d * np.sin(psi + slope))
    turning = (pull + m * r * d * np.sin(psi) * square) / about
    friction = m * ((r + d * np.cos(psi)) * turning - d * np.sin(psi) * square)
    normal = m * g * np.cos(slope) - m * d * (np.sin(psi) * turning + np.cos(psi) * square)
    return friction - m * g * np.sin(slope), normal


def solve(page: Page) -> None:
    """Roll to where it slips and to where the normal force vanishes, and find the forces there."""
    scene = scenes.cylinder_on_ramp(t1=10.0, mu=0.8, **NUMBERS)
    end = scenes.contact_lost(scene)
    rolled = end.y[2] - NUMBERS["slope"]
    page.number("c: it rolls until the normal force vanishes, with unlimited friction", rolled, "m")
    page.number("c: that is, beyond two turns", rolled - 4 * np.pi, "rad")
    friction, normal = forces(float(rolled))
    page.equal("c: No normal force is left there", normal, 0.0, within=1e-9, route="energy")
    page.number("c: friction that is left there", friction, "N")
    lifts = 0.5 * np.sin(rolled) * (1 + 0.5 * np.cos(rolled)) * friction / 0.4
    page.number("c: acceleration of G off the ramp without it", lifts, "m/s^2")
    page.true("c: A flight from there would enter the ramp", lifts < 0, route="Newton's law")

    slip = until(scene, Grip(scene, 1))
    slips = slip.y[2] - NUMBERS["slope"]
    page.number("c: with a coefficient of 0.8 it slips after", slips, "m")
    friction, normal = forces(float(slips))
    page.equal("b: There |F| / N is 0.8", abs(friction) / normal, 0.8, within=1e-9, route="energy")
    psi = np.linspace(0.0, float(slips), 100_000)[1:-1]
    friction, normal = forces(psi)
    page.true("b: and smaller before", (abs(friction) < 0.8 * normal).all(), route="energy")

    motion = simulate(scene, end.t, samples=300, rtol=1e-12)
    page.draw(drawing.trajectory(motion), "The paths of G and of a mark on the rim.")
    look = (
        "It rolls until the ramp would have to pull, as if friction had no limit; with a "
        "coefficient of friction, `jaxdyn run cylinder_on_ramp` goes on by slip and flight."
    )
    page.play(motion, look)


def check(page: Page) -> None:
    """Roll by Lagrange's equation, and find the friction from the multipliers of the contact."""
    scene = scenes.cylinder_on_ramp(t1=10.0, **NUMBERS)
    end = scenes.contact_lost(scene).t
    motion = simulate(scene, end, samples=300, rtol=1e-12)
    angle = simulate(lagrangian(rolling_law, [0.0], [0.0], params=NUMBERS), end, samples=300)
    same = "a: Lagrange's equation gives the same motion"
    page.equal(same, motion["phi"] - 0.2, angle["q0"], within=1e-9, route="second formulation")
    friction, normal = forces(np.asarray(motion["phi"]) - 0.2)
    rolls = normal > 0.1
    needed = jax.jit(jax.vmap(scenes.friction_needed, (None, 0)))(scene, motion.ys[rolls])
    page.equal("b: Friction needed", needed, abs(friction / normal)[rolls], within=1e-9)


if __name__ == "__main__":
    show(solve)
