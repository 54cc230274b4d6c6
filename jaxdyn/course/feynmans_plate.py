"""Feynman's plate.

A plate thrown into the air spins and wobbles. Feynman says that a medallion on it went round twice
as fast as the plate wobbled. Is he right? Compare the rate at which the normal goes round with the
rate of the plate, by simulation and for a steady precession.

Answer: It is the other way round: for small wobbles the normal goes round twice for one turn of the
plate. In steady precession the ratio is 2 / (2 - cos(theta)), with theta the tilt of the normal.

A plate has I_3 = 2 I_1, so H = I_1 omega + I_1 omega_3 e_3' and omega = H / I_1 - omega_3 e_3': a
steady precession at omega_p = |H| / I_1 about H, with the spin omega_s = -omega_3 about the normal.
The tilt follows from H . e_3' = 2 I_1 omega_3 = |H| cos(theta), so omega_p = 2 omega_3 /
cos(theta). The normal goes round at omega_p. The rate of the plate is that at which its edge goes
round for small tilts, omega_p + omega_s = omega_3 (2 - cos(theta)) / cos(theta), and the ratio of
both is 2 / (2 - cos(theta)): 2 for small tilts.
"""

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy, precession
from jaxdyn.course.page import Page, show
from jaxdyn.formulations import rigid

PROBLEM = 56
TOPIC = "rigid bodies in space"


def solve(page: Page) -> None:
    """Throw plates with small and large wobbles, and count both rates."""
    throws = {}
    for tilt in (0.01, 0.1, 0.2, 0.4, 0.6):
        motion = simulate(scenes.feynman_plate(tilt, spin=10.0), 3.0, samples=400, rtol=1e-12)
        throws[f"{tilt:g}"] = motion
        wobble, turn = precession.wobble_and_spin(motion)
        page.number(f"wobbles for one turn at a tilt of {tilt:g}", wobble / turn)
        steady = precession.free_precession(tilt, 10.0, I1=1.0, I3=2.0)
        expected = [steady.precession, steady.precession + steady.spin]
        page.equal(f"Steady precession at {tilt:g}", [wobble, turn], expected, within=1e-11)
        lean = precession.tilts(motion)
        page.equal(f"The tilt of {tilt:g} is constant", np.ptp(lean), 0.0, within=1e-12)

        page.equal(f"Ratio at {tilt:g}", wobble / turn, 2 / (2 - np.cos(tilt)), within=1e-12)

    page.draw(
        lambda: picture(throws["0.1"]), "The normal goes round twice while the plate turns once."
    )
    page.play(
        throws, "Follow the marked corner, and the highest point of the rim.", choose="tilt [rad]"
    )


def picture(motion):
    """Turns of the normal and of the plate over time."""
    R, t = energy.along(rigid.pose, motion).R_wb, motion.ts
    figure = drawing.figures.blank(6.4, 4.0)
    ax = figure.add_subplot(xlabel="t [s]", ylabel="turns")
    drawing.figures.style(ax)
    normal, mark = np.arctan2(R[:, 1, 2], R[:, 0, 2]), np.arctan2(R[:, 1, 0], R[:, 0, 0])
    ax.plot(t, (np.unwrap(normal) - normal[0]) / (2 * np.pi), label="normal")
    ax.plot(t, (np.unwrap(mark) - mark[0]) / (2 * np.pi), label="drawing on the plate")
    ax.legend(frameon=False)
    return figure


if __name__ == "__main__":
    show(solve)
