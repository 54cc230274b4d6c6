"""Steady precession of a disk on a plane.

A disk runs on level ground with a constant lean, so that its centre goes round a circle of radius
R. Which lean, precession omega_p, spin omega_s and R belong together (a) without slip, (b) without
friction, (c) without either? As printed, the lean is called both theta and phi; here theta is the
angle of the axis from the vertical, and R < 0 leans towards the middle.

Answer: (a) omega_p^2 = m g r cos(theta) / (sin(theta) (I cos(theta) - (2 I / r + m r) R)), with
r omega_3 = R omega_p. (b) I cos(theta) omega_p^2 - 2 I omega_3 omega_p = m g r cot(theta), the
centre at rest. (c) omega_p^2 = m g r / (I sin(theta)) and omega_3 = 0: the ever faster rattle of a
coin that comes to rest. Upright, straight rolling and turning on the spot belong to (a) and (c).

The numbers belong to a uniform disk of m = 1 kg, r = 0.5 m, I = m r^2 / 4 and g = 9.81 m/s^2.
omega_3 = omega_s + omega_p cos(theta) is the whole rate of turning about the axis of the disk.

(a) The centre circles at R omega_p, so the ground pushes with the friction m |R| omega_p^2 towards
the middle of the circle and with m g upwards. The moment of both about the centre is the rate
omega_p k x H of the angular momentum, which with r omega_3 = R omega_p (no slip) is the formula
above. For a lean 0 < theta < pi/2 it has a solution for every R with

    R < I r cos(theta) / (2 I + m r^2),   for a uniform disk R < r cos(theta) / 6,

so a disk may lean inwards on any circle (R < 0), but outwards only near the middle. The rates are
omega_p and -omega_p, mirror images. Upright, theta = pi/2, the right side is zero and two families
are left: straight rolling (omega_p = 0, R infinite, any omega_3), and turning on the spot about the
vertical diameter (R = 0, omega_3 = 0, any omega_p).

(b) Without friction no horizontal force acts, so the centre is at rest or moves straight on (R = 0
in a frame that moves with it). The equation has two roots omega_p for every lean 0 < theta < pi/2
and every omega_3, one of each sign. In terms of the spin it reads I cos(theta) omega_p^2 + 2 I
omega_s omega_p + m g r cot(theta) = 0: two roots of one sign where omega_s^2 > (m g r / I)
cos(theta)^2 / sin(theta), and none where the disk spins more slowly. Upright omega_p omega_3 = 0:
it spins about the vertical, or about its axis.

(c) R = 0 and r omega_3 = R omega_p give omega_3 = 0: the line from the centre to the contact is the
axis of rotation, and omega_p = sqrt(m g r / (I sin(theta))) follows from (b). It exists at every
lean. Upright there are straight rolling, which needs no friction, and turning on the spot, at any
rate. Straight rolling is stable faster than sqrt(g r / 3), here 1.279 m/s.
"""

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import precession
from jaxdyn.course.page import Page, largest, show

PROBLEM = 60
TOPIC = "rolling and skating"

DISK = {"m": 1.0, "radius": 0.5, "I1": 1 / 16}  # uniform


def solve(page: Page) -> None:
    """Start disks in each steady motion, see that they keep it, and test straight rolling."""
    lean, R = 1.2, -1.0
    rolls = precession.rolling_disk_circle(lean, R, **DISK)
    rates = "a: precession omega_p and spin omega_s, theta = 1.2 rad, R = -1 m"
    page.number(rates, [rolls.precession, rolls.spin], "rad/s")
    scene = scenes.rolling_disk(lean, precession=rolls.precession, spin=rolls.spin)
    rolling = simulate(scene, 4.0, samples=400, rtol=1e-12)
    phi = float(rolls.precession) * np.asarray(rolling.ts)
    circle = R * np.stack([-np.sin(phi), np.cos(phi) - 1], axis=1)
    page.equal("a: its centre goes round that circle", rolling.ys[:, :2], circle, within=1e-11)
    page.equal("a: its lean stays", rolling["theta"], np.full(400, lean), within=1e-12)
    moment, slip, _ = precession.disk_residuals(lean, rolls, **DISK)
    page.equal("a: balance of moments, no slip", [moment, slip], [0, 0], within=1e-13)
    outermost = 0.5 * np.cos(lean) / 6
    beside = precession.rolling_disk_circle(lean, outermost * np.array([0.999, 1.001]), **DISK)
    exists = np.isfinite(beside.precession).tolist() == [True, False]
    page.true("a: it exists for R < r cos(theta) / 6", exists, route="both sides")
    upright = (precession.SteadyDisk(0.0, 6.0, -1e9), precession.SteadyDisk(7.0, 0.0, 0.0))
    lacks = [precession.disk_residuals(np.pi / 2, one, **DISK).moment for one in upright]
    page.equal("a, c: upright, rolling on or turning on the spot", lacks, [0, 0], within=1e-12)

    slides = precession.sliding_disk_roots(lean, 6.0, **DISK)
    rates = "b: both precessions omega_p, theta = 1.2 rad, omega_s = 6 rad/s"
    page.number(rates, slides.precession, "rad/s")
    scene = scenes.rolling_disk(lean, rough=False, precession=slides.precession[1], spin=6.0)
    change = scene.rate(0.0, scene.y0)[6:]
    page.equal("b: started with the second, no rate changes", change, np.zeros(6), within=1e-11)

    coins = {}
    for tilt in (0.15, 0.3, 0.6, 1.2):
        both = precession.frictionless_rolling_disk(tilt, **DISK)
        scene = scenes.rolling_disk(tilt, precession=both.precession, spin=both.spin)
        coins[f"{tilt:g}"] = simulate(scene, 4.0, samples=400, rtol=1e-12)
        shares = precession.disk_residuals(tilt, both, **DISK)
        page.equal(f"c: no slip, no friction at {tilt}", shares, np.zeros(3), within=1e-12)
        page.number(f"c: precession omega_p at theta = {tilt} rad", both.precession, "rad/s")

    edge = np.sqrt(9.81 * 0.5 / 3)
    page.number("c: speed above which straight rolling is stable", edge, "m/s")

    page.draw(lambda: drawing.free_body(rolling, rolling.ts[40]), "Friction holds it on a circle.")
    page.draw(lambda: drawing.trajectory(rolling), "The contact runs round a wider circle.")
    page.play(rolling, "A coin that rolls round a circle leans inwards.")
    page.play(coins, "The flatter, the faster it rattles.", choose="lean of the axis [rad]")


def check(page: Page) -> None:
    """Roll straight on a little slower and a little faster than the limit of stability."""
    edge = page["c: speed above which straight rolling is stable"]
    leans = []
    for speed in (0.9 * edge, 1.1 * edge):
        upright = scenes.rolling_disk(np.pi / 2 + 1e-6, precession=0.0, spin=-speed / 0.5)
        at = [name for name, _ in upright.labels()].index("theta")
        most = largest(upright, lambda t, y, at=at: (y[at] - np.pi / 2) ** 2, 4.0)
        leans.append(np.sqrt(most.value))
    page.number("c: largest lean from upright in 4 s, from 1e-6 rad, at 0.9 of it", leans[0], "rad")
    page.number("c: and at 1.1 of that speed", leans[1], "rad")
    falls = leans[0] > 1e-3 and leans[1] < 1e-4
    page.true("c: Slower it falls, faster it does not", falls, route="simulation")


if __name__ == "__main__":
    show(solve)
