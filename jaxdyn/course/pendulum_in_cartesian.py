"""Pendulum in Cartesian coordinates.

A point on a rigid massless rod swings about a hinge. Do without the angle: the unknowns are the
accelerations of x and y and the force in the rod, and the third equation is the length condition,
differentiated twice. Integrate for a long time and compare with the pendulum by its angle: does the
rod keep its length?

Answer: The three linear equations have the motion of theta'' = -g/l sin(theta), but they only keep
the second derivative of the length at zero, so errors of the steps add up: at a tolerance of 1e-3
the rod drifts visibly within 100 s. Baumgarte's restoring term bounds the drift, and
projecting the state back onto the circle after each step removes it.

The equations, with y upwards and T the tension of the rod, are linear in x'', y'' and T:

    m x'' + (x / l) T = 0
    m y'' + (y / l) T = -m g
    x x'' + y y'' = -(x'^2 + y'^2)

The third is x^2 + y^2 = l^2 differentiated twice. As a matrix equation for (x'', y'', T / (m l))
the rows are (1, 0, x), (0, 1, y) and (x, y, 0), with the right side (0, -g, -(x'^2 + y'^2)). It
always has a solution, as its determinant is -l^2.

The start, l = 1 m, 2 rad from hanging, at rest, satisfies the length condition and its derivative;
the equations preserve only the second derivative. Therefore errors e of the length and e' of its
rate that steps leave grow like e + e' t. Baumgarte's method subtracts 2 a e' + a^2 e, with e = (x^2
+ y^2 - l^2) / 2, from the right side of the third equation, so that e decays like exp(-a t);
projection moves the state to the nearest one that satisfies the length condition and its
derivative. Compared with l sin(theta) and -l cos(theta) of the pendulum by its angle all three, the
bare equations, Baumgarte's and those with projection, agree to 1e-9 for 100 s at a tolerance of
1e-14.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import constraints
from jaxdyn.course.page import Page, show

PROBLEM = 23
TOPIC = "pendulums and linkages"


def three_equations(t, y, g=9.81):
    """The rate of x, y and their rates: F = m a twice, and x x'' + y y'' = -(x'^2 + y'^2)."""
    (x, y), v = y[:2], y[2:]
    matrix = jnp.array(
        [[1.0, 0.0, -x], [0.0, 1.0, -y], [x, y, 0.0]]
    )  # the last unknown: force / (m l)
    return jnp.concatenate([v, jnp.linalg.solve(matrix, jnp.array([0.0, -g, -v @ v]))[:2]])


def stretch(motion):
    """(s,) [m] the change of the length along a motion."""
    return np.abs(np.linalg.norm(motion.r[:, 0], axis=1) - 1.0)


def solve(page: Page) -> None:
    """Swing by the angle and by x and y with each remedy; compare the ends and the lengths."""
    swing = {"angle": 2.0, "t1": 100.0}
    tied = {
        drift: scenes.pendulum(formulation="constrained", tie="square", drift=drift, **swing)
        for drift in ("raw", "baumgarte", "projection")
    }
    y0 = tied["raw"].y0
    got, by_hand = (jax.jit(rate)(0.0, y0) for rate in (tied["raw"].rate, three_equations))
    page.equal("The scene has the three equations", got, by_hand, within=1e-13, route="by hand")

    by_angle = simulate(scenes.pendulum(**swing), samples=601, rtol=1e-14)
    tight = {name: simulate(scene, samples=601, rtol=1e-14) for name, scene in tied.items()}
    loose = {name: simulate(scene, samples=601, rtol=1e-3) for name, scene in tied.items()}
    for name, motion in loose.items():
        statement = f"x and y are those of the angle for 100 s, {name}"
        page.equal(statement, tight[name].r, by_angle.r, within=1e-9, route="second formulation")
        off = stretch(motion)
        page.number(
            f"largest error of the length at 601 times in 100 s, rtol 1e-3, {name}", off.max(), "m"
        )
    theta, rate = by_angle["theta"], by_angle["theta_dot"]
    pull = constraints.tensions(tight["projection"])["stick"]
    statement = "The force in the rod is m g cos(theta) + m l theta'^2"
    page.equal(statement, pull, 9.81 * np.cos(theta) + rate**2, within=1e-8)
    page.draw(
        lambda: picture(loose),
        "Without a remedy the errors of the length add up; projection leaves rounding.",
    )
    look = "At a tolerance of 1e-3 the rod of the raw equations changes its length visibly."
    page.play(loose, look, inexact=True)


def picture(motions):
    """The change of the length over time, by each remedy."""
    figure = drawing.figures.blank(6.4, 4.0)
    ax = figure.subplots()
    drawing.figures.style(ax)
    for name, motion in motions.items():
        ax.semilogy(motion.ts, stretch(motion) + 1e-17, label=name)
    ax.set(xlabel="t [s]", ylabel="change of the length [m]")
    ax.legend(frameon=False)
    return figure


if __name__ == "__main__":
    show(solve)
