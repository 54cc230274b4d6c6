"""Dumbbell by five differential-algebraic equations.

Two masses of 1 kg on a rod of 1 m fly freely with opposite velocities of 1 m/s across the rod.
Write F = m a for both and the length condition differentiated twice, five equations for four
accelerations and the force in the rod, and integrate them. Which errors can be measured?

Answer: The dumbbell turns at 2 rad/s about its centre, which rests, and the rod pulls with 2 N.
Momentum, angular momentum, energy, length and all positions are known. Only the momentum is exact:
an integration of the bare equations at a loose tolerance does not preserve the others, and
projection restores only the length.

The five equations, linear in the four accelerations and the tension T of the rod, with m = l = 1:

    x1'' = T (x2 - x1)       y1'' = T (y2 - y1)
    x2'' = -T (x2 - x1)      y2'' = -T (y2 - y1)
    (x2 - x1) (x2'' - x1'') + (y2 - y1) (y2'' - y1'') = -(x2' - x1')^2 - (y2' - y1')^2

The last is (x2 - x1)^2 + (y2 - y1)^2 = l^2 differentiated twice. With the first four it becomes 2 T
= (x2' - x1')^2 + (y2' - y1')^2 = 4: the tension is 2 N, m v^2 / r with r = 1/2 m.

What can be measured: the sum of the velocities (momentum), the angular momentum about the centre,
the energy (the rod does no work), the length and its rate, and the position of each mass, which is
on a circle of 1/2 m at the angle 2 t. The table has the length, the momenta and the energy, at a
deliberately loose tolerance of 1e-2. In the equations as the scene has them lambda is -T.
"""

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import constraints, energy
from jaxdyn.course.page import Page, show

PROBLEM = 25
TOPIC = "constraints"


def solve(page: Page) -> None:
    """Spin it tightly and loosely, by the bare equations and projected; measure the errors."""
    bare = scenes.dumbbell(drift="raw", tie="square")
    kept = scenes.dumbbell(drift="projection", tie="square")
    tight = simulate(bare, samples=401, rtol=1e-13)
    angle = 2 * np.asarray(tight.ts)
    circle = 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    places = np.stack([-circle, circle], axis=1)
    page.equal("Each mass runs on its circle at 2 rad/s", tight.r, places, within=1e-11)
    pull = constraints.tensions(tight)["rod 1-2"]
    page.equal("The rod pulls with m v^2 / r", pull, np.full(401, 2.0), within=1e-11)

    loose = {
        "raw": simulate(bare, samples=401, rtol=1e-2),
        "projection": simulate(kept, samples=401, rtol=1e-2),
    }
    for name, motion in loose.items():
        length = np.linalg.norm(motion.r[:, 1] - motion.r[:, 0], axis=1)
        page.number(
            f"largest error of the length at 401 times, rtol 1e-2, {name}",
            abs(length - 1.0).max(),
            "m",
        )
        for of in ("momentum", "angular momentum", "energy"):
            page.number(f"change of the {of}, rtol 1e-2, {name}", energy.drift(motion, of))
        rest = motion.r.sum(axis=1)
        page.equal(f"The centre rests even so, {name}", rest, 0 * rest, within=1e-12)
    length = np.linalg.norm(loose["projection"].r[:, 1] - loose["projection"].r[:, 0], axis=1)
    page.equal("Projection keeps the length", length, np.ones(401), within=1e-13)
    page.draw(
        lambda: picture(loose, places),
        "Projection preserves the length, not the angular velocity: positions are worse here.",
    )
    page.play(loose, "Loosely integrated, the two turn at slightly different rates.", inexact=True)


def picture(loose, places):
    """The distance of a mass from its place over time."""
    figure = drawing.figures.blank(6.4, 4.4)
    ax = figure.subplots()
    drawing.figures.style(ax)
    for name, motion in loose.items():
        ax.plot(motion.ts, np.linalg.norm(motion.r[:, 0] - places[:, 0], axis=1), label=name)
    ax.set(xlabel="t [s]", ylabel="position error of a mass [m]")
    ax.legend(frameon=False)
    return figure


if __name__ == "__main__":
    show(solve)
