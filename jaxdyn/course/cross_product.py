"""The cross product by geometry and by components.

By definition a x b is orthogonal to a and b, of length |a| |b| sin(theta), in the direction given
by the right-hand rule. Show that the same vector results if b is projected onto the plane
orthogonal to a, stretched by |a|, and rotated by a quarter turn about a. Conclude that a x (b + c)
= a x b + a x c, and find from that the formula for the components.

Answer: The projection of b has the length |b| sin(theta), the stretched one |a| |b| sin(theta). It
lies in the plane of a and b, across a; the quarter turn about a makes it orthogonal to both, on the
side of the right-hand rule. To project, stretch or turn a sum is to do so with its parts and add
them, so a x is a linear operator on b, with the skew matrix S_ij = -epsilon_ijk a_k. As a x b = -b
x a, it is linear in a as well. By that and the nine products of base vectors, e_1 x e_2 = e_3 and
so on, where epsilon_ijk is 1 if i, j, k are 1, 2, 3 or follow each other in that cyclic order, -1
in the opposite order, and 0 if two are equal, a x b = epsilon_ijk a_i b_j e_k, that is (a2 b3 - a3
b2, a3 b1 - a1 b3, a1 b2 - a2 b1).
"""

import numpy as np

from jaxdyn import drawing
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import vectors

PROBLEM = 4
TOPIC = "vectors and rotations"


def solve(page: Page) -> None:
    """Take the three steps, and compare with the definition and with components."""
    a, b, c = np.array([[1.0, 2.0, 2.0], [3.0, 0.0, 1.0], [-1.0, 1.0, 2.0]])
    product = vectors.cross_by_geometry(a, b)
    page.number("a x b for a = (1, 2, 2), b = (3, 0, 1)", product)
    cosine = vectors.dot(a, b) / np.linalg.norm(a) / np.linalg.norm(b)
    length = np.linalg.norm(a) * np.linalg.norm(b) * np.sqrt(1 - cosine**2)
    page.equal(
        "Its length is |a| |b| sin(theta)",
        np.linalg.norm(product),
        length,
        within=1e-14,
        route="definition",
    )
    across = [vectors.dot(product, a), vectors.dot(product, b)]
    page.equal("It is orthogonal to both", across, np.zeros(2), within=1e-14, route="definition")
    page.true(
        "a, b and a x b are right-handed",
        vectors.dot(vectors.cross(a, b), product) > 0,
        route="determinant",
    )

    both = vectors.cross_by_geometry(a, b + c)
    parts = product + vectors.cross_by_geometry(a, c)
    page.equal("a x (b + c) = a x b + a x c", both, parts, within=1e-14, route="three steps each")
    page.equal("It is the formula in components", product, vectors.cross(a, b), within=1e-14)
    page.equal("and the sum with epsilon", product, vectors.cross_by_indices(a, b), within=1e-14)
    page.equal("and a skew matrix times b", product, vectors.skew(a) @ b, within=1e-14)
    e = np.eye(3)
    table = np.array([[vectors.cross_by_geometry(x, y) for y in e] for x in e])
    page.equal(
        "e1 x e2 = e3 and so on", table, np.cross(e[:, None], e), within=1e-14, route="NumPy"
    )

    page.draw(picture, "b is projected along a, stretched by |a| = 2, and turned by 90 degrees.")


def picture():
    """b projected along a, stretched and turned."""
    a, b = np.array([0.0, 0.0, 2.0]), np.array([1.5, 0.0, 1.0])
    ax = drawing.figures.in_space(5.5, 5.0)
    b_across = b - a * vectors.dot(a, b) / vectors.dot(a, a)
    arrows = {"a": a, "b": b, "stretched": 2 * b_across, "projected": b_across}
    arrows["a x b"] = vectors.cross(a, b)
    for (name, arrow), colour in zip(arrows.items(), drawing.figures.PALETTE, strict=False):
        ax.quiver(0, 0, 0, *arrow, color=colour, arrow_length_ratio=0.1, lw=2)
        ax.text(*arrow, f" {name}", color=colour)
    ax.set(xlim=(0, 3), ylim=(0, 3), zlim=(0, 2), aspect="equal")
    return ax.figure


if __name__ == "__main__":
    show(solve)
