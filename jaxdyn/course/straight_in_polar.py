"""A straight line in polar coordinates.

A particle without forces moves straight at constant speed. Write a = 0 in polar coordinates, solve
it for several starts, and check that the path is straight and the speed constant. Define a measure
of how straight a path is, and find out whether a tighter tolerance makes it straighter.

Answer: r'' = r theta'^2 and theta'' = -2 r' theta' / r. With the measure "largest distance from the
best straight line over the length" the paths are straight to the tolerance and, at 1e-13, to
rounding, even the one that passes the origin at a distance of a micrometre, where theta jumps by
almost pi.

(a) The acceleration is (r'' - r theta'^2) e_r + (r theta'' + 2 r' theta') e_theta. Both parts are
zero, which gives the two equations.

(b, c) A particle starts at (1, b) m with (-1, 0) m/s and passes the origin at b = 0.5 m, 1 mm and
1 um. At all times it is at (1 - t, b), to 1e-11 m.

(d) The measure: fit the straight line that is nearest to all samples, and divide the largest
distance of a sample from it by the length of the path.

(e) Yes, until rounding: see the numbers and the second picture.
"""

import numpy as np

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 8
TOPIC = "one particle"


def free(t, y):
    """No acceleration, in polar coordinates."""
    r, _, vr, omega = y
    return [vr, omega, r * omega**2, -2 * vr * omega / r]


def solve(page: Page) -> None:
    """Pass the origin at three distances, and measure how straight the path is."""
    starts = {"0.5 m": 0.5, "1 mm": 1e-3, "1 um": 1e-6}
    tolerances = np.logspace(-3, -13, 11)
    motions, bends = {}, {}
    for name, b in starts.items():
        scene = scenes.polar_particle(position=(1.0, b), velocity=(-1.0, 0.0), t1=2.0)
        runs = [simulate(scene, samples=200, rtol=rtol) for rtol in tolerances]
        bends[name] = np.array([scenes.straightness(run) for run in runs])
        few = bends[name][[0, 5, 10]]
        page.number(f"straightness at 1e-3, 1e-8 and 1e-13, passing at {name}", few)
        motions[f"passes at {name}"] = runs[-1]
        t = np.asarray(runs[-1].ts)
        line = np.stack([1.0 - t, b + 0 * t], axis=1)
        page.equal(f"Straight and uniform, passing at {name}", runs[-1].r[:, 0], line, within=1e-11)

    wide = motions["passes at 0.5 m"]
    written = simulate(ode(free, wide.scene.y0, 2.0), samples=200, rtol=1e-13)
    page.equal("The equations as written", wide.ys, written.ys, within=1e-12, route="own rate")

    page.draw(
        lambda: drawing.time_series(motions["passes at 1 mm"], names=["r", "theta"], title=""),
        "The closer it passes, the more suddenly theta turns by pi.",
    )
    page.draw(
        lambda: picture(tolerances, bends),
        "Tighter tolerances make the path straighter, down to rounding.",
    )
    page.play(motions, "All three move uniformly, each along its own straight line.")


def picture(tolerances, bends):
    """The deviation from a straight line over the tolerance, for each distance."""
    figure = drawing.figures.blank(6.0, 4.4)
    ax = figure.subplots()
    drawing.figures.style(ax)
    for (name, bend), colour in zip(bends.items(), drawing.figures.PALETTE, strict=False):
        ax.loglog(tolerances, bend, "o-", color=colour, label=f"passes at {name}")
    ax.set(xlabel="tolerance", ylabel="deviation from a straight line / length")
    ax.legend(frameon=False)
    return figure


if __name__ == "__main__":
    show(solve)
