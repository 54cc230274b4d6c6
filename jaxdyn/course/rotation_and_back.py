"""From axis and angle to a matrix, and back.

Write a function that turns a vector about an axis by an angle, and one that gives the matrix of the
turn. Try them on turns that you can see: by 90 degrees about x, about z, and by 120 degrees about
(1, 1, 1). Then go back, from a matrix to its axis and angle, for odd examples too.

Answer: r' = n n.r + cos(theta) (r - n n.r) + sin(theta) n x r, and R is its matrix. In the other
direction axis and angle are found to rounding at every angle, also at 0, where any axis is right,
and near half a turn, where the usual formula loses all digits, since sin(theta) = 0.

(a) The part of r along the axis, n n.r, stays; the part across it, r - n n.r, turns towards n x r.

(b) The columns of R are the turned unit vectors: R_ij = n_i n_j + cos(theta) (delta_ij - n_i n_j) -
sin(theta) eps_ijk n_k.

(c) A quarter turn about x takes y to z and z to -y, one about z takes x to y and y to -x, and a
third of a turn about (1, 1, 1) takes x to y, y to z and z to x.

(d) The trace of R is 1 + 2 cos(theta), and the differences a = (R_32 - R_23, R_13 - R_31, R_21 -
R_12) are 2 sin(theta) n. Near half a turn the cosine is flat, so it says little of theta, and a is
small, so it says little of n. But R + R^T = 2 cos(theta) 1 + 2 (1 - cos(theta)) n n^T, so the
largest column of R + R^T + (1 - trace R) 1 is along n there. The function uses the quaternion q =
(w, s n) with w = cos(theta / 2) and s = sin(theta / 2): its products 4 q q^T are sums of the
entries of R, and with the row of the largest nothing cancels; theta = 2 atan2(s, w).
"""

import math

import numpy as np

from jaxdyn import drawing
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import rotations

PROBLEM = 46
TOPIC = "vectors and rotations"


def solve(page: Page) -> None:
    """Turn the unit vectors, compare with what can be seen, and go back from matrices."""
    x, y, z = e = np.eye(3)
    quarter = math.pi / 2
    seen = {
        "90 degrees about x": (x, quarter, [x, z, -y]),
        "90 degrees about z": (z, quarter, [y, -x, z]),
        "120 degrees about (1, 1, 1)": (np.ones(3), 4 * quarter / 3, [y, z, x]),
    }
    for name, (n, theta, ends) in seen.items():
        turned = [rotations.rotate(n, theta, r) for r in e]
        page.equal(f"{name}: the vectors", turned, ends, within=1e-14, route="geometry")
        R = rotations.matrix_from_axis_angle(n, theta)
        page.equal(f"{name}: the matrix", R.T, ends, within=1e-14, route="geometry")

    n = np.array([2.0, -3.0, 6.0]) / 7
    angles = np.array([1e-12, 1e-5, 0.3, 2.0, 3.0, math.pi - 1e-6, math.pi - 1e-12, math.pi])
    matrices = [rotations.matrix_from_axis_angle(n, angle) for angle in angles]
    found = [rotations.axis_angle_from_matrix(R) for R in matrices]
    back = np.array([turn.angle for turn in found])
    axes = np.array([np.sign(turn.axis @ n) * turn.axis for turn in found])
    page.number("angles", angles, "rad")
    page.number("their errors after there and back", back - angles, "rad")
    page.equal("The angles come back", back, angles, within=1e-14, route="there and back")
    page.equal("The axes come back", axes, np.tile(n, (8, 1)), within=1e-14, route="there and back")
    R = rotations.matrix_from_rotation_vector([0.3, -2.0, 1.0])
    turn = rotations.axis_angle_from_matrix(R)
    again = rotations.matrix_from_axis_angle(*turn)
    page.equal("A matrix comes back", again, R, within=1e-14, route="there and back")
    none = rotations.axis_angle_from_matrix(np.eye(3)).angle
    page.equal("No turn has the angle 0", none, 0.0, within=0.0, route="definition")
    usual = [math.acos((np.trace(R) - 1) / 2) for R in matrices[:-1]]
    page.number(
        "errors of arccos((trace R - 1) / 2) for all but the last", usual - angles[:-1], "rad"
    )

    page.draw(picture, "120 degrees about (1, 1, 1) take x to y, y to z and z to x.")


def picture():
    """The paths of x, y and z in a turn of 120 degrees about (1, 1, 1)."""
    ax = drawing.figures.in_space(5.5, 5.0)
    for name, r, colour in zip("xyz", np.eye(3), drawing.figures.PALETTE, strict=False):
        arc = [rotations.rotate(np.ones(3), t, r) for t in np.linspace(0, 2 * math.pi / 3, 31)]
        ax.plot(*np.array(arc).T, color=colour)
        ax.plot(*np.stack([0 * r, r]).T, "-o", color=colour, label=name)
    ax.plot([0, 1], [0, 1], [0, 1], color=drawing.figures.INK, label="axis")
    ax.legend(loc="upper left", frameon=False)
    ax.set_aspect("equal")
    return ax.figure


if __name__ == "__main__":
    show(solve)
