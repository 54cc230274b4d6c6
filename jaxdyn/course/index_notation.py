"""Index notation.

In a product an index that occurs twice is summed from 1 to 3, and one that occurs once is free.
Each term of an equation must have the same free indices, and no index may occur three times. With
given matrices A and B and columns a and b, evaluate twelve expressions, (a) to (l), or say why one
makes no sense. Check the properties of the Kronecker delta and of the Levi-Civita epsilon as well.
As printed, c_3 = A_3j b_3 should end in b_j, and a_i e_i x b_i e_j in b_j e_j.

Answer: a 3, b 3, c and d (6, 15, 24), e (12, 15, 18), f 26, g 15, j the matrix product A B, k 9, l
a x b = (-2, 1, 1). Two make no sense: h, c_k = B_jk b_k, whose free index is k on the left and j on
the right, and i, c_i = A_ij B_jk, which has one free index on the left and two on the right.

The Kronecker delta has a_i delta_ij = a_j, delta_ii = 3, delta_ik delta_kj = delta_ij and e_i . e_j
= delta_ij; for the epsilon e_i x e_j = epsilon_ijk e_k.
"""

import numpy as np

from jaxdyn.course.page import Page, show
from jaxdyn.geometry import indices

PROBLEM = 41
TOPIC = "vectors and rotations"


def solve(page: Page) -> None:
    """Evaluate the expressions, or say what is wrong, and compare with products of matrices."""
    A = np.arange(1.0, 10.0).reshape(3, 3)
    B = np.array([[1.0, 0, 1], [0, 0, 1], [1, 0, 1]])
    a, b = np.array([1.0, 0.0, 2.0]), np.ones(3)
    expressions = {
        "a: c = a_i b_i": a @ b,
        "b: c = delta_ll": 3.0,
        "c: c_i = A_ij b_j": A @ b,
        "d: c_i = b_j A_ij": A @ b,
        "e: c_i = A_ji b_j": A.T @ b,
        "f: c = A_ij B_ij": np.trace(A.T @ B),
        "g: c = A_ij delta_ij": np.trace(A),
        "h: c_k = B_jk b_k": None,
        "i: c_i = A_ij B_jk": None,
        "j: C_ik = A_ij B_jk": A @ B,
        "k: delta_ij delta_jk delta_ki delta_ll": 9.0,
        "l: c_k = epsilon_ijk a_i b_j": np.cross(a, b),
    }
    given = {"A": A, "B": B, "a": a, "b": b}
    for name, expected in expressions.items():
        expression = name[3:]
        sense = indices.check_indices(expression)
        if expected is None:
            page.number(name, sense.reason)
            page.true(f"{name} makes no sense", not sense.sensible, route="free indices")
            continue
        value = indices.evaluate_indices(expression, **given)
        page.number(name, value)
        page.equal(name, value, expected, within=0.0, route="matrix products")

    delta, epsilon = indices.kronecker(), indices.levi_civita()
    product = indices.evaluate_indices("X_ij = delta_ik delta_kj")
    page.equal("delta_ik delta_kj = delta_ij", product, delta, within=0.0, route="property")
    signs = [np.sum(epsilon == s) for s in (1, -1, 0)]
    page.equal("epsilon is 3 x 1, 3 x -1, 21 x 0", signs, [3, 3, 21], within=0.0, route="count")
    skew = indices.evaluate_indices("S_ij = -epsilon_ijk a_k", **given)
    page.equal("S_ij = -epsilon_ijk a_k is a x", skew @ b, np.cross(a, b), within=0.0)
    renamed = ("c_l = A_lj b_j + B_kl a_k", "c_j = A_jk b_k + B_kj a_k")
    one, other = (indices.evaluate_indices(expression, **given) for expression in renamed)
    page.equal("Indices can be renamed", one, other, within=0.0, route="evaluated twice")


if __name__ == "__main__":
    show(solve)
