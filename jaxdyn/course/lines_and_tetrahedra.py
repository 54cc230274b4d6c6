"""Lines, tetrahedra and rods by vectors.

Four points A, B, C and D lie anywhere in space. How far apart are the infinite lines AB and CD, and
where are the ends of their shortest connection? What is the volume of the tetrahedron ABCD? If
massless rods join D to A, B and C, which are fixed, and a force F acts at D, what is the tension of
the rod AD? Find one vector formula for each.

Answer: With n = (b - a) x (d - c) the distance is |n . (c - a)| / |n|, 1.826 m for the points
below, and the volume |(b - a) x (c - a) . (d - a)| / 6 = 1.667 m^3, a third of base times height.
About the line BC only the rod AD and F have a moment, so with N = (b - d) x (c - d) its tension is
-F . N |a - d| / ((a - d) . N) = 3.317 N.

The letters a to d are the positions of the points from the origin. The numbers belong to a = (0, 0,
0), b = (2, 0, 1), c = (0, 2, 0), d = (1, 1, 3) m and F = (3, -1, -10) N.

(a) n = (b - a) x (d - c) is at right angles to both lines, so the planes through them with normal n
are parallel, and their distance is that of the lines: the component of c - a along n. Parallel
lines have n = 0; their distance is |(c - a) x (b - a)| / |b - a|.

(b) The ends are a + s (b - a) and c + t (d - c). What joins them is a multiple of n, so the product
with (d - c) x n leaves only s, and that with (b - a) x n only t:

    s = (c - a) x (d - c) . n / n^2,   t = (c - a) x (b - a) . n / n^2.

For parallel lines n = 0, and there are many such connections.

(c) The section parallel to the base ABC at the fraction z of the way down from D is the base scaled
by the factor z, so its area is z^2 times that of the base. Integrated over the height h that is h
times the base times the integral of z^2 from 0 to 1, a third. The base is half of the parallelogram
|(b - a) x (c - a)|, and (d - a) along that direction is the height.

(d) The tensions pull D towards A, B and C, and with F they add up to zero. The product of that sum
with N = (b - d) x (c - d), which is across the rods BD and CD, leaves T (a - d) . N / |a - d| + F .
N = 0, with T the tension of AD.
"""

import numpy as np

from jaxdyn import drawing
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import vectors

PROBLEM = 2
TOPIC = "vectors and rotations"


def solve(page: Page) -> None:
    """Evaluate each formula, and find each answer without it."""
    points = a, b, c, d = np.array([[0.0, 0, 0], [2, 0, 1], [0, 2, 0], [1, 1, 3]])
    force = np.array([3.0, -1.0, -10.0])

    near = vectors.closest_points(*points)
    page.number("a: distance of the lines AB and CD", near.distance, "m")
    page.number(
        "b: ends of the shortest connection, x, y, z on AB and on CD",
        [*near.on_ab, *near.on_cd],
        "m",
    )
    along, miss, *_ = np.linalg.lstsq(np.stack([b - a, c - d], axis=1), c - a)
    least = {"route": "least squares", "within": 1e-13}
    page.equal("a: No points of the lines are closer", near.distance, np.sqrt(miss[0]), **least)
    page.equal("b: It begins there", near.on_ab, a + along[0] * (b - a), **least)
    page.equal("b: It ends there", near.on_cd, c + along[1] * (d - c), **least)

    volume = vectors.tetrahedron_volume(*points)
    page.number("c: volume of ABCD", volume, "m^3")
    base = np.linalg.norm(np.cross(b - a, c - a)) / 2
    height = np.sqrt(np.linalg.lstsq(np.stack([b - a, c - a], axis=1), d - a)[1][0])
    page.equal("c: A third of base times height", volume, base * height / 3, **least)
    squares = np.ones((5, 5)) - np.eye(5)
    squares[1:, 1:] = np.sum((points[:, None] - points) ** 2, axis=2)
    edges = np.sqrt(np.linalg.det(squares) / 288)
    page.equal("c: From the six edges alone", volume, edges, within=1e-13, route="Cayley, Menger")

    tensions = vectors.rod_tensions(*points, force).tensions
    page.number("d: tensions of AD, BD and CD", tensions, "N")
    normal = np.cross(b - d, c - d)
    moment = -force @ normal / ((a - d) @ normal) * np.linalg.norm(a - d)
    page.equal("d: The rod AD alone", tensions[0], moment, within=1e-13, route="moment about BC")
    rods = (points[:3] - d) / np.linalg.norm(points[:3] - d, axis=1, keepdims=True)
    page.equal("d: D is at rest", tensions @ rods, -force, within=1e-13, route="sum of forces")

    page.draw(
        lambda: picture(points, near),
        "The shortest connection of AB and CD is at right angles to both.",
    )


def picture(points, near):
    """The tetrahedron and the shortest connection."""
    ax = drawing.figures.in_space(5.5, 5.0)
    for i, j in np.argwhere(np.triu(np.ones((4, 4)), 1)):
        ax.plot(*points[[i, j]].T, color=drawing.figures.INK, lw=1.0)
    ax.plot(*np.stack([near.on_ab, near.on_cd]).T, "o-", color=drawing.figures.PALETTE[1], lw=2.5)
    for name, point in zip("ABCD", points, strict=True):
        ax.text(*point, f" {name}", fontsize=13)
    ax.set_aspect("equal")
    return ax.figure


if __name__ == "__main__":
    show(solve)
