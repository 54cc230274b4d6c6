"""A body on one skate and on two skates.

A rigid body slides on a plane on one skate, or on two in any places and directions; a skate moves
along its blade only. Find the motion with the constraint forces of Newton and Euler, and again with
Lagrange's equations and multipliers. Which simple argument gives the motion on two skates? Two
skates with a common normal are excluded: why?

Answer: On one skate under its mass centre a body runs round a circle; otherwise it ends in a
straight glide with the mass centre ahead. Two skates leave one possible motion, in which the
velocities along the body's axes and the rate of turning are constant: the body turns uniformly
about the point where the normals meet. With a common normal both skates impose the same condition,
and only the sum of their forces is determined.

The mass centre is at (x, y), and the body has turned by theta. A skate is at (a, b) from the mass
centre in the body's axes, and its blade makes the angle beta with the body's x axis. n =
(-sin(theta + beta), cos(theta + beta)) is its normal, r the arm from the mass centre to it in fixed
axes, and h = r x n = a cos(beta) + b sin(beta) the moment of a unit force along n.

(a) One skate, with the force F across it: m (x'', y'') = F n, I theta'' = F h, and the condition
n . (x', y') + h theta' = 0. With h = 0 the force does no turning: theta' is constant, and the body
runs at a constant speed round a circle; the printed equations are those of a skate under the mass
centre. If the mass centre is c ahead of the skate, along the blade, let u be the speed of the skate
and omega = theta'. Momentum along the blade and angular momentum about the skate give

    u' = c omega^2,   (I + m c^2) omega' = -m c u omega.

So c u grows until omega is zero, which it becomes where c u > 0: in a straight glide with the mass
centre ahead.

(b) Two skates, as differential-algebraic equations for x'', y'', theta'', F1 and F2:

    m x'' = F1 n1x + F2 n2x
    m y'' = F1 n1y + F2 n2y
    I theta'' = F1 h1 + F2 h2
    n1 . (x'', y'') + h1 theta'' = theta' e1 . (x', y')
    n2 . (x'', y'') + h2 theta'' = theta' e2 . (x', y')

with e_i along blade i. The last two are n_i . (x', y') + h_i theta' = 0 differentiated: n_i turns
at -theta' e_i, and h_i is constant. The start has to satisfy the two undifferentiated conditions.

(c) By Lagrange: T = m (x'^2 + y'^2) / 2 + I theta'^2 / 2 gives the left sides m x'', m y'' and I
theta''. The virtual work of F_i in a displacement is F_i (n_i . (dx, dy) + h_i dtheta), so the
generalised forces are the right sides above: the same five equations.

(d) In the body's axes the two conditions are two fixed linear equations for three velocities. These
determine the ratios of the velocities, and the constant energy their size. Such a motion is a
uniform rotation about the point with zero velocity, where the normals of the skates meet. If these
are parallel, it is a straight glide.

The numbers belong to m = 1 kg and I = 0.5 kg m^2. The two skates are at (1, 0) and (-0.5, 0.3) m
with the angles 0.4 and -0.2 rad. The glide is that of a body with one skate at (-0.5, 0) m, along
its x axis, which starts at (1, 0.5) m/s and 1 rad/s; all its energy is in the straight motion at
the end.
"""

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 39
TOPIC = "rolling and skating"


TWO = {"at": ((1.0, 0.0), (-0.5, 0.3)), "headings": (0.4, -0.2)}
PRECISELY = {"samples": 2001, "rtol": 1e-12}


def solve(page: Page) -> None:
    """One skate in two places, then two skates, by the equations and by hand."""
    circle = simulate(scenes.one_skate(), 10.0, **PRECISELY)
    t = np.asarray(circle.ts)
    by_hand = np.stack([np.sin(t), 1 - np.cos(t)], axis=1)
    page.equal("Skate under the centre: a circle", circle.ys[:, :2], by_hand, within=1e-11)

    behind = scenes.one_skate(at=(-0.5, 0.0))
    glide = simulate(behind, 15.0, **PRECISELY)
    energy = 0.5 * (1.0 + 0.5**2) + 0.5 * 0.5
    theta, velocity = np.asarray(glide["theta"][-1]), np.asarray(glide.ys)[-1, 3:5]
    page.number("final speed of the glide", np.hypot(*velocity), "m/s")
    final = velocity @ np.array([np.cos(theta), np.sin(theta)])
    page.equal("It ends ahead with all the energy", final, np.sqrt(2 * energy), within=1e-11)

    scene = scenes.two_skates(**TWO)
    two = simulate(scene, 15.0, **PRECISELY)
    simple = scenes.skates.elementary_motion(scene, two.ts)
    page.equal("Two skates: the uniform turn found by hand", two.ys, simple, within=1e-11)
    centre = np.asarray(scenes.skates.meeting_point(scene))
    page.number("point where the normals meet", centre, "m")
    away = np.linalg.norm(np.asarray(two.ys)[:, :2] - centre, axis=1)
    page.equal("The distance from it is constant", np.ptp(away), 0.0, within=1e-11)

    alike = scenes.two_skates(at=((0.0, 1.0), (0.0, -1.0)), headings=(0.0, 0.0))
    conditions = np.linalg.matrix_rank(np.asarray(alike.system.mechanism.twists()))
    page.true("Skates on one normal are one condition", conditions == 1, route="rank")

    page.draw(
        lambda: drawing.trajectory([glide, two], names=["one skate, behind", "two skates"]),
        "One skate ends in a straight glide; two skates run round one point.",
    )
    begins = simulate(behind, 5.0, **PRECISELY)  # all fit into one view
    motions = {"below the mass centre": circle, "behind it": begins}
    page.play(motions, "A circle, and a turn that ends in a glide.", choose="one skate")
    page.play(two, "On two skates it turns uniformly round one point.")


def check(page: Page) -> None:
    """Two skates by the other formulation."""
    scene = scenes.two_skates(**TWO)
    two, lagrange = (
        simulate(one, 15.0, **PRECISELY) for one in (scene, scenes.skates.by_lagrange(scene))
    )
    same = "Newton-Euler and Lagrange agree on two skates"
    page.equal(same, two.ys, lagrange.ys, within=1e-11, route="second formulation")


def ask(page: Page) -> None:
    """A skate ahead of the mass centre, and one at an angle."""
    page.ask(
        "What happens when the skate is ahead of the mass centre?",
        "The body turns round, until the mass centre is ahead; then it glides straight on.",
        scenes.one_skate(at=(0.5, 0.0)),
    )
    page.ask(
        "What happens when the skate is turned by 0.5 rad in the body?",
        "It glides at that angle: the blade leads, wherever the body looks.",
        scenes.one_skate(at=(-0.5, 0.0), heading=0.5),
    )


if __name__ == "__main__":
    show(solve)
