"""Steady precession of a disk on a plane.

A disk runs on level ground with a constant lean, so that its centre goes round a circle of radius
R. Which lean, precession omega_p, spin omega_s and R belong together (a) without slip, (b) without
friction, (c) without either? As printed, the lean is called both theta and phi; here theta is the
angle of the axis from the vertical, and R < 0 leans towards the middle.

Answer: (a) omega_p^2 = m g r cos(theta) / (sin(theta) (I cos(theta) - (2 I / r + m r) R)), with
r omega_3 = R omega_p. (b) I cos(theta) omega_p^2 - 2 I omega_3 omega_p = m g r cot(theta), the
centre at rest. (c) omega_p^2 = m g r / (I sin(theta)) and omega_3 = 0: the ever faster rattle of a
coin that comes to rest.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import precession
from jaxdyn.course.page import Page, show

PROBLEM = 60
TOPIC = "rolling and skating"

DISK = {"m": 1.0, "radius": 0.5, "I1": 1 / 16}  # uniform


def solve(page: Page) -> None:
    """Start disks in each steady motion, see that they keep it, and test straight rolling."""
    lean, R = 1.2, -1.0
    rolls = precession.rolling_disk_circle(lean, R, **DISK)
    page.number("a: precession and spin at R = -1 m", [rolls.precession, rolls.spin], "rad/s")
    scene = scenes.rolling_disk(lean, precession=rolls.precession, spin=rolls.spin)
    rolling = simulate(scene, 4.0, samples=400, rtol=1e-12)
    phi = rolls.precession * rolling.ts
    circle = R * jnp.stack([-jnp.sin(phi), jnp.cos(phi) - 1], axis=1)
    page.equal("a: its centre goes round that circle", rolling.ys[:, :2], circle, within=1e-11)
    page.equal("a: its lean stays", rolling["theta"], jnp.full(400, lean), within=1e-12)
    moment, slip, _ = precession.disk_residuals(lean, rolls, **DISK)
    page.equal("a: balance of moments, no slip", [moment, slip], [0, 0], within=1e-13)

    slides = precession.sliding_disk_roots(lean, 6.0, **DISK)
    page.number("b: precessions at a spin of 6 rad/s", slides.precession, "rad/s")
    scene = scenes.rolling_disk(lean, rough=False, precession=slides.precession[1], spin=6.0)
    change = jax.jit(scene.rate)(0.0, scene.y0)[6:]
    page.equal("b: no velocity changes at the fast one", change, jnp.zeros(6), within=1e-11)

    coins = {}
    for tilt in (0.15, 0.3, 0.6, 1.2):
        both = precession.frictionless_rolling_disk(tilt, **DISK)
        scene = scenes.rolling_disk(tilt, precession=both.precession, spin=both.spin)
        coins[f"{tilt:g}"] = simulate(scene, 4.0, samples=400, rtol=1e-12)
        shares = precession.disk_residuals(tilt, both, **DISK)
        page.equal(f"c: no slip, no friction at {tilt}", shares, np.zeros(3), within=1e-12)
        page.number(f"c: precession at a lean of {tilt}", both.precession, "rad/s")

    edge = np.sqrt(9.81 * 0.5 / 3)
    page.number("slowest stable straight rolling", edge, "m/s")
    leans = []
    for speed in (0.9 * edge, 1.1 * edge):
        upright = scenes.rolling_disk(np.pi / 2 + 1e-6, precession=0.0, spin=-speed / 0.5)
        straight = simulate(upright, 4.0, samples=400, rtol=1e-12)
        leans.append(jnp.max(jnp.abs(straight["theta"] - np.pi / 2)))
    page.number("largest lean after 1e-6 rad, at 0.9 and 1.1 of it", leans, "rad")
    falls = leans[0] > 1e-3 and leans[1] < 1e-4
    page.true("Slower it falls, faster it does not", falls, route="simulation")

    page.draw(drawing.trajectory(rolling), "The contact runs round a wider circle than the centre.")
    page.play(rolling, "A coin that rolls round a circle leans inwards.")
    page.play(coins, "The flatter, the faster it rattles.", choose="lean of the axis [rad]")


if __name__ == "__main__":
    show(solve)
