"""The work of drag on a cannonball.

A ball of 1 kg is shot at 1 m/s and 45 degrees with g = 1 m/s^2 and the quadratic drag c v^2. Solve
the motion, and integrate the power of the drag along with it: W' = P. Compare the work with the
change of the total energy, and show that their difference goes to zero as the integration becomes
more accurate. As printed, c is not given; take 1 kg/m, and others.

Answer: With c = 1 kg/m the ball lands 0.589 m away and the drag does -0.2951 J in 1.2 s, which is
the change of the energy. With Euler's method the two differ in proportion to the step, with the
classical Runge-Kutta method to its fourth power, and with the tolerance 1e-13 only by rounding.

(a) The equation is m r'' = -c |v| v - m g j, with m = 1 kg, g = 1 m/s^2, v0 = 1 m/s and 45 degrees.
No closed form is known; without drag the ball would land 1 m away, after 1.414 s. See the numbers
for where and when it lands with drag, and how fast.

(b) The power of the drag is -c |v|^3, so its work W is one more equation, W' = -c |v|^3. The total
energy m v^2 / 2 + m g y changes by W and by nothing else, so any difference of the two is an error
of the integration; the picture shows it going to zero, with the order of each method.
"""

import numpy as np

from jaxdyn import drawing, effects, scenes, simulate, solvers, until
from jaxdyn.accuracy import convergence
from jaxdyn.analysis import energy, work_by_effect
from jaxdyn.course.page import Page, show
from jaxdyn.integrate import events

PROBLEM = 12
TOPIC = "one particle"

LANDS = (1, 0.0, -1)  # y falls to 0


def throws():
    """The same throw through air of different density, by the drag coefficient [kg/m]."""
    shots = {}
    for c in (0.03, 0.1, 0.3, 1.0, 3.0, 10.0):
        shot = scenes.cannonball(speed=1.0, g=1.0, drag=c)
        scene = work_by_effect.with_work(shot, effects.QuadraticDrag)
        shots[f"{c:g}"] = simulate(scene, 1.2, samples=200)
    return shots


def solve(page: Page) -> None:
    """Integrate the work with the motion, by three methods, and compare it with the energy."""
    shot = scenes.cannonball(speed=1.0, g=1.0, drag=1.0)
    landing = until(shot, events.Reaches(*LANDS), 3.0, rtol=1e-13)
    page.number("a: lands after, without drag", 2**0.5, "s")
    page.number("a: lands after, with c = 1 kg/m", landing.t, "s")
    page.number("a: at the distance", landing.y[0], "m")
    page.number("a: with the velocity", landing.y[2:4], "m/s")
    scene = work_by_effect.with_work(shot, effects.QuadraticDrag)
    first = energy.energy(scene, 0.0, scene.y0)

    def gap(y):
        return abs(float(y[-1] - (energy.energy(scene, 0.0, y) - first)))

    runs = [simulate(scene, 1.2, samples=200, rtol=10.0**-n) for n in range(4, 14)]
    best = runs[-1]
    page.number("b: work of the drag in 1.2 s, c = 1 kg/m", best["work of QuadraticDrag"][-1], "J")
    along = energy.along(energy.energy, best) - first
    works = best["work of QuadraticDrag"]
    page.equal("It is the change of energy", works, along, within=1e-14, route="energy")

    counts = 4 * 2 ** np.arange(9)
    errors = {}
    for method, order in ((solvers.EULER, 1), (solvers.RK4, 4)):
        gaps = [gap(convergence.fixed_steps(scene, 1.2, steps=n, method=method)) for n in counts]
        errors[f"{method.name}, equal steps"] = (counts, gaps)
        observed = np.log2(gaps[3] / gaps[4])
        page.equal(f"{method.name}: order", observed, order, within=0.1, route="halved steps")
    steps, gaps = zip(*((run.steps, gap(run.ys[-1])) for run in runs), strict=True)
    errors["tolerances 1e-4 to 1e-13"] = (steps, gaps)
    look = "Any difference is an integration error, and vanishes with it."
    page.draw(lambda: picture(errors), look)

    shots = throws()
    spent = [motion["work of QuadraticDrag"][-1] for motion in shots.values()]
    page.number("b: work in 1.2 s with c = 0.03, 0.1, 0.3, 1, 3 and 10 kg/m", spent, "J")
    names = [f"c = {c} kg/m" for c in shots]
    page.draw(
        lambda: drawing.trajectory(list(shots.values()), names=names, title=""),
        "All throws are drawn for 1.2 s: the more drag, the shorter.",
    )
    ends = events.Reaches(*LANDS)
    page.play(shots, "With much drag it stops and falls.", choose="drag [kg/m]", ends=ends)


def picture(errors):
    """The errors over the numbers of steps, for each way to choose these."""
    figure = drawing.figures.blank(6.0, 4.4)
    ax = figure.subplots()
    drawing.figures.style(ax)
    ax.set_prop_cycle(color=drawing.figures.PALETTE)
    for name, (steps, gaps) in errors.items():
        ax.loglog(steps, gaps, "o-", label=name)
    ax.set(xlabel="steps", ylabel="difference of work and energy [J]")
    ax.legend(frameon=False)
    return figure


if __name__ == "__main__":
    show(solve)
