"""Two quarter turns.

A body is turned by 90 degrees about the y axis, and then by 90 degrees about the x axis. Find the
axis and the angle of the one turn that does the same, by looking at where the axes go. Then apply
the formula for a turn about an axis twice, to the three unit vectors and to any vector (x, y, z).

Answer: It is a turn by 120 degrees about (1, 1, 1): x goes to -z and then to y, y then goes to z,
and z to x and stays there. So (x, y, z) goes to (z, x, y).

The formula r' = n n.r + cos(theta) (r - n n.r) + sin(theta) n x r is n n.r + n x r for a quarter
turn. About y it takes e_x to e_y x e_x = -e_z, e_y to e_y and e_z to e_y x e_z = e_x; about x, e_x
to e_x, e_y to e_z and e_z to e_x x e_z = -e_y. Together e_x goes to -e_z and then to e_y, e_y to
e_y and then to e_z, and e_z to e_x, which stays: (x, y, z) goes to (z, y, -x), and then to (z, x,
y). The axis is what stays where it is, x = y = z; three such turns take every vector back, so the
angle is a third of a full turn.
"""

import math

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import rotations

PROBLEM = 45
TOPIC = "vectors and rotations"
QUARTER = math.pi / 2


def one_after_the_other(t):
    """Angles about the fixed y and x axes, in one second each, from rest to rest."""
    part = jnp.clip(t - jnp.arange(3.0), 0, 1)
    return QUARTER * (part - jnp.sin(2 * jnp.pi * part) / (2 * jnp.pi))


def solve(page: Page) -> None:
    """Turn vectors twice, and compare with one turn about (1, 1, 1)."""
    x, y, z = e = np.eye(3)

    def twice(r):
        return rotations.rotate(x, QUARTER, rotations.rotate(y, QUARTER, r))

    R = np.stack([twice(r) for r in e], axis=1)
    seen = {"route": "geometry", "within": 1e-14}
    page.equal("x goes to y, y to z, z to x", R.T, [y, z, x], **seen)
    page.equal("(2, 3, 5) goes to (5, 2, 3)", twice([2.0, 3, 5]), [5.0, 2, 3], **seen)
    quarters = (rotations.AxisAngle(axis, jnp.asarray(QUARTER)) for axis in (y, x))
    turn = rotations.compose_axis_angle(*quarters)
    page.number("net axis", turn.axis)
    page.number("net angle", math.degrees(turn.angle), "degrees")
    page.equal("The axis is (1, 1, 1) / sqrt(3)", turn.axis, np.ones(3) / math.sqrt(3), **seen)
    page.equal("The angle is 120 degrees", turn.angle, 2 * math.pi / 3, **seen)
    again = rotations.axis_angle_from_matrix(R)
    page.equal("The matrix has the same axis", again.axis, turn.axis, within=1e-14, route="matrix")

    two = simulate(scenes.moved_box(angles=one_after_the_other, sequence="yxz", t1=2.0), rtol=1e-13)
    one = simulate(scenes.turned_box(rate=math.pi / 3, t1=2.0), rtol=1e-13)
    ends = two.r[-1, :8], one.r[-1, :8]
    page.equal("A box ends in the same place", *ends, within=1e-11, route="both simulated")

    page.draw(picture, "The tip of x goes down and up again to y, or straight there.")
    page.play({"two quarter turns": two, "one turn": one}, "Both boxes end in the same place.")


def picture():
    """The paths of the tip of x."""
    x, y = np.eye(3)[:2]
    arcs = [rotations.rotate(y, QUARTER * s, x) for s in np.linspace(0, 1, 31)]
    arcs += [rotations.rotate(x, QUARTER * s, arcs[-1]) for s in np.linspace(0, 1, 31)]
    direct = [rotations.rotate(np.ones(3), 4 * QUARTER / 3 * s, x) for s in np.linspace(0, 1, 31)]
    ax = drawing.figures.in_space(5.5, 5.0)
    ax.plot(*np.array(arcs).T, color=drawing.figures.PALETTE[0], label="two quarter turns")
    ax.plot(
        *np.array(direct).T, color=drawing.figures.PALETTE[1], label="120 degrees about (1, 1, 1)"
    )
    ax.figure.legend(loc="outside lower center", frameon=False)
    ax.set_aspect("equal")
    return ax.figure


if __name__ == "__main__":
    show(solve)
