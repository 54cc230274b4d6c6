"""Reading: practice with dyadics.

A dyadic such as A = a b + c d takes a vector r to a (b . r) + c (d . r). It exists without any
basis; its nine components are e_i . A . e_j, and in another basis they are other numbers. Read
about them and practise: change the basis of a dyadic and see what does not change.

Answer: With R_ij = e_i . e'_j the components in the turned basis are R^T A R. What the dyadic does
to a vector is the same in both, and so are its trace, its determinant, its eigenvalues and its
norm, the root of the sum of the squares of its components. Below the trace is 4 and the determinant
0.

The components of A = a b + c d are A_ij = a_i b_j + c_i d_j, with a = (1, 2, 0), b = (0, 1, 3), c =
(2, 0, 1) and d = (1, 1, 0). The other basis is turned by 0.7 rad about (1, 2, 3). A takes every r
into the plane of a and c, so its determinant is 0; its trace is a . b + c . d.

A rotation whose components carry small errors, as after many products, is no longer one; the
nearest rotation is U V^T, with the orthogonal matrices of its singular value decomposition.

The sentence asked for, as far as it is true of this page: "The exercises of that course were not
handed in; what they practise, dyadics in two bases and what does not depend on the basis, is worked
out and checked here and in problems 41 and 42."
"""

import numpy as np

from jaxdyn.course.page import Page, show
from jaxdyn.geometry import frames, rotations, vectors

PROBLEM = 40
TOPIC = "vectors and rotations"


def solve(page: Page) -> None:
    """Write a dyadic in two bases, let it act in both, and compare."""
    a, b, c, d, r = np.array([[1.0, 2, 0], [0, 1, 3], [2, 0, 1], [1, 1, 0], [1, -1, 2]])
    A = np.outer(a, b) + np.outer(c, d)
    turned = np.stack([rotations.rotate([1.0, 2.0, 3.0], 0.7, e) for e in np.eye(3)])
    R = frames.matrix_between(np.eye(3), turned)
    A_turned = frames.tensor_in_body(R, A)
    for i in range(3):
        page.number(
            f"row {i + 1} of the first components, and of the turned ones", [*A[i], *A_turned[i]]
        )

    definition = np.array([[x @ A @ y for y in turned] for x in turned])
    page.equal("They are e'_i . A . e'_j", A_turned, definition, within=1e-14, route="definition")
    acted = R @ (A_turned @ (R.T @ r))
    by_dots = a * vectors.dot(b, r) + c * vectors.dot(d, r)
    page.equal("It does the same in both bases", acted, by_dots, within=1e-14, route="no basis")
    page.equal("And back", frames.tensor_in_world(R, A_turned), A, within=1e-14, route="round trip")
    kept = [[np.trace(X), np.linalg.det(X), np.sum(X * X)] for X in (A, np.asarray(A_turned))]
    page.equal(
        "Trace, determinant, norm are equal", kept[0], kept[1], within=1e-13, route="invariants"
    )
    drifted = R + 1e-3 * np.outer(a, b)
    nearest = frames.orthonormalize(drifted)
    u, _, v = np.linalg.svd(drifted)
    page.equal(
        "The rotation nearest to a drifted matrix",
        nearest,
        u @ v,
        within=1e-14,
        route="singular values",
    )


if __name__ == "__main__":
    show(solve)
