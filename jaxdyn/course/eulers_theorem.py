"""Euler's theorem on rotations.

Any motion of a sphere about its fixed centre ends as if it had turned once about some axis. Find a
proof without algebra: take any point P, the point Q where the motion takes it, and the point S
where it takes Q. The planes that bisect PQ and QS meet in a line through the centre. Why is it the
axis?

Answer: A point N of the line has one distance from P, Q and S. The motion takes P and Q to Q and S,
so it takes N to a point with this distance from Q and S: to N itself or to its mirror image, which
would turn the sphere inside out. If S is P, both planes are the same; then the motion exchanges P
and Q, so it takes the middle of PQ to itself, which is on the axis of a half turn (or, if Q is
opposite to P, any point off the line PQ serves in place of P). If Q is P, P is on the axis. The
check finds the axis in this way for rotations by various angles.
"""

import numpy as np

from jaxdyn import drawing
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import rotations, vectors

PROBLEM = 44
TOPIC = "vectors and rotations"


def axis_of(R, P):
    """(3,) unit vector along the line in which the planes that bisect PQ and QS meet."""
    Q = R @ P
    N = vectors.cross(Q - P, R @ Q - Q)
    return N / np.linalg.norm(N)


def solve(page: Page) -> None:
    """Find axes by the construction, and compare with those of the formula for matrices."""
    numbers, P = np.random.default_rng(44), np.array([1.0, 0.0, 0.0])
    worst = fixed = 0.0
    for phi in numbers.normal(size=(20, 3)):
        R = rotations.matrix_from_rotation_vector(phi)
        N = axis_of(R, P)
        found = rotations.axis_angle_from_matrix(R).axis
        worst = max(worst, np.abs(N - found).max())
        fixed = max(fixed, np.abs(R @ N - N).max())
    page.equal("The rotation leaves N where it is", fixed, 0.0, within=1e-12, route="definition")
    page.equal("N is the axis of the matrix", worst, 0.0, within=1e-12, route="quaternion")
    steps = rotations.matrix_from_rotation_vector([0.0, 0.0, 0.5])
    for phi in numbers.normal(size=(100, 3)):
        steps = rotations.matrix_from_rotation_vector(phi) @ steps
    once = rotations.matrix_from_axis_angle(*rotations.axis_angle_from_matrix(steps))
    page.equal("A hundred turns are one", once, steps, within=1e-13, route="one axis and angle")

    R = rotations.matrix_from_axis_angle([1.0, 1.0, 2.0], 1.2)
    N = axis_of(R, P)
    page.draw(lambda: picture(R, N, P), "P, Q and S are on one circle, about the axis N.")


def picture(R, N, P):
    """The circle through P, Q and S about the axis N."""
    path = np.array([rotations.rotate(N, t, P) for t in np.linspace(0, 2 * np.pi, 61)])
    ax = drawing.figures.in_space(5.5, 5.0)
    ax.plot(*path.T, color=drawing.figures.PALETTE[5])
    for name, point in {"P": P, "Q": R @ P, "S": R @ R @ P, "N": N}.items():
        ax.plot(
            *np.stack([0 * P, point]).T, "-o", color=drawing.figures.PALETTE[name == "N"], lw=1.2
        )
        ax.text(*point, f"  {name}", fontsize=13)
    ax.set_aspect("equal")
    return ax.figure


if __name__ == "__main__":
    show(solve)
