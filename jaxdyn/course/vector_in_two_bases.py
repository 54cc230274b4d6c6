"""One vector, one rotation, two bases.

A rotation R takes the fixed basis e_i to the turned one e'_i, and a vector r to r*. Distinguish the
vector, its components in each basis and the columns of them; likewise the tensor and its matrices.
From R_ij and r_i find: the components of r* in both bases, those of r from those of r*, the matrix
of R in the turned basis, and the components in e_i of the tensor R_ij e'_i e'_j.

Answer: R_ij = e_i . e'_j; r*_i = R_ij r_j, and in the turned basis r* has the components r_i,
whatever R is; r_i = R_ji r*_j, and in the turned basis r_i' = R_ji R_kj r*_k. The matrix of R is
the same in both bases, so the tensor R_ij e'_i e'_j is R itself and A_ij = R_ij.
"""

import numpy as np

from jaxdyn.course.page import Page, show
from jaxdyn.drawing import figures
from jaxdyn.geometry import frames, indices, rotations

PROBLEM = 42
TOPIC = "vectors and rotations"


def solve(page: Page) -> None:
    """Turn a basis and a vector, and compare the rules for components with dot products."""
    n, theta = [1.0, -1.0, 2.0], 0.6
    e, r = np.eye(3), np.array([1.0, 0.5, -0.5])
    turned = np.stack([rotations.rotate(n, theta, x) for x in e])
    r_star = np.asarray(rotations.rotate(n, theta, r))
    R = frames.matrix_between(e, turned)
    given = {"R": R, "r": r, "s": r_star}

    formula = rotations.matrix_from_axis_angle(n, theta)
    page.equal("c: R_ij = e_i . e'_j", R, formula, within=1e-14, route="axis and angle")
    found = indices.evaluate_indices("s_i = R_ij r_j", **given)
    page.number("d: components of r*", found)
    page.equal("d: r*_i = R_ij r_j", found, r_star, within=1e-14, route="rotated vector")
    page.equal(
        "e: in the turned basis r* is r", turned @ r_star, r, within=1e-14, route="dot products"
    )
    back = indices.evaluate_indices("r_i = R_ji s_j", **given)
    page.equal("f: r_i = R_ji r*_j", back, r, within=1e-14, route="rotated vector")
    double = indices.evaluate_indices("r_i = R_ji R_kj s_k", **given)
    page.number("g: components of r in the turned basis", double)
    page.equal("g: they are R_ji R_kj r*_k", double, turned @ r, within=1e-14, route="dot products")
    in_turned = np.array([[x @ rotations.rotate(n, theta, y) for y in turned] for x in turned])
    page.equal(
        "h: the matrix is the same in both bases", in_turned, R, within=1e-14, route="dot products"
    )
    columns = np.sum(np.asarray(r)[:, None] * turned, axis=0)
    page.equal("i: r* = r_i e'_i", columns, r_star, within=1e-14, route="rotated vector")
    A = frames.tensor_in_world(R, R)
    page.equal("j: A_ij = R_ij", A, R, within=1e-14, route="change of basis")

    ax = figures.in_space(5.5, 5.0)
    arrows = {"e": e, "e'": turned, "r": [r], "r*": [r_star]}
    for (name, group), colour in zip(arrows.items(), figures.PALETTE, strict=False):
        for i, arrow in enumerate(np.asarray(group)):
            ax.plot(*np.stack([0 * arrow, arrow]).T, color=colour, lw=2)
            ax.text(*arrow, f" {name}{i + 1 if len(group) == 3 else ''}", color=colour)
    ax.set_aspect("equal")
    page.draw(ax.figure, "r* lies in the basis e' as r lies in the basis e.")


if __name__ == "__main__":
    show(solve)
