"""One vector, one rotation, two bases.

A rotation R takes the fixed basis e_i to the turned one e'_i, and a vector r to r*. Distinguish the
vector, its components in each basis and the columns of them; likewise the tensor and its matrices.
From R_ij and r_i find: the components of r* in both bases, those of r from those of r*, the matrix
of R in the turned basis, and the components in e_i of the tensor R_ij e'_i e'_j.

Answer: R_ij = e_i . e'_j; r*_i = R_ij r_j, and in the turned basis r* has the components r_i,
whatever R is; r_i = R_ji r*_j, and in the turned basis r_Bi = R_ji R_kj r*_k. The matrix of R is
the same in both bases, so the tensor R_ij e'_i e'_j is R itself and A_ij = R_ij.

The numbers belong to a turn by 0.6 rad about (1, -1, 2), and to r = (1, 1/2, -1/2).

(a) to (h), where the index B marks components in the turned basis:

    a)  r_i = r . e_i
    b)  R_ij = e_i . R . e_j
    c)  R_ij = e_i . e'_j
    d)  r*_i = R_ij r_j
    e)  r*_Bi = r_i, as r* lies in the turned basis as r does in the fixed one
    f)  r_i = R_ji r*_j
    g)  r_Bi = R_ji r_j = R_ji R_kj r*_k
    h)  R_Bij = e'_i . R . e'_j = R_ij

(i) The column of r* in the fixed basis, in seven ways; n is the axis of R and theta its angle:

    [r*] = R [r]                                  the matrix times the column of r
    r*_i = R_ij r_j                               by indices
    r*_i = r* . e_i                               components of the turned vector
    [r*] = r_1 [e'_1] + r_2 [e'_2] + r_3 [e'_3]   r* has the components r_i in the turned basis
    [r*] = R [r*]_B                               change of basis, [r*]_B = [r]
    [r*] = R R [r]_B                              the same from the components of r, [r]_B = R^T [r]
    [r*] = [n] n.r + cos(theta) ([r] - [n] n.r) + sin(theta) [n x r]

(j) A = R_ij e'_i e'_j has the matrix R in the turned basis, so in the fixed one it is R R R^T = R.

(k) Questions that test whether any confusion is left:

Does the matrix R rotate vectors or change bases? Both: [r*] = R [r] is a new vector in the same
basis, [r] = R [r]_B is the same vector in two bases. The nine numbers are the same; only the
columns that they relate differ.

The body now turns by a second rotation, given by the matrix S in its own, turned basis. What is the
matrix of the whole in the fixed basis? R S, not S R: in the fixed basis the second is R S R^T, and
(R S R^T) R = R S.

Is omega in the turned basis R^T [omega] or R [omega]? R^T [omega], like any vector's components.
"""

import numpy as np

from jaxdyn import drawing
from jaxdyn.course.page import Page, show
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
    ways = [columns, R @ r, R @ (turned @ r_star), R @ R @ (turned @ r), [r_star @ x for x in e]]
    same = "i: r_i e'_i and the other ways are r*"
    page.equal(same, ways, [r_star] * 5, within=1e-14, route="rotated vector")
    second = np.array([rotations.rotate(turned[2], 0.9, x) for x in turned])
    S = rotations.matrix_from_axis_angle(e[2], 0.9)
    page.equal("k: a second turn about e'_3 makes R S", second.T, R @ S, within=1e-14, route="axes")
    A = frames.tensor_in_world(R, R)
    page.equal("j: A_ij = R_ij", A, R, within=1e-14, route="change of basis")

    arrows = {"e": e, "e'": turned, "r": [r], "r*": [r_star]}
    page.draw(lambda: picture(arrows), "r* lies in the basis e' as r lies in the basis e.")


def picture(arrows):
    """Both bases and both vectors."""
    ax = drawing.figures.in_space(5.5, 5.0)
    for (name, group), colour in zip(arrows.items(), drawing.figures.PALETTE, strict=False):
        for i, arrow in enumerate(np.asarray(group)):
            ax.plot(*np.stack([0 * arrow, arrow]).T, color=colour, lw=2)
            ax.text(*arrow, f" {name}{i + 1 if len(group) == 3 else ''}", color=colour)
    ax.set_aspect("equal")
    return ax.figure


if __name__ == "__main__":
    show(solve)
