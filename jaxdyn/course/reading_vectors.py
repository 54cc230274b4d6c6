"""Reading: vectors, components and moments.

The chapters to read introduce vectors, their components, dot and cross products, forces and their
moments, and units. One thing that is worth checking as you read: the moment of a force about a line
does not depend on which point of the line is used, nor on where along its own line the force acts.

Answer: In components the moment about the line through p along the unit vector n is
epsilon_ijk n_i (r_j - p_j) F_k, for the numbers below 1 N m. It does not change if p moves along n
or r along F: only the arm perpendicular to both lines counts.

(a, b) The moment about the line is n . ((r - p) x F). Moving p by a n adds a n . (n x F) = 0, and
moving r by b F adds b n . (F x F) = 0. The numbers belong to n = (1, 2, 2) / 3, p = (0, 1, 0) m,
r = (1, 0, 2) m and F = (2, -1, 3) N.

(c) The statement asked for, as far as it is true of this page: "The book and the course's site were
not read for it, so nothing is claimed of chapters 1 to 3, one section of chapter 17, and appendix
A. The subjects in their titles, vectors, components, products and moments, are worked out and
checked in problems 2, 4, 5 and 40 to 42."
"""

import numpy as np

from jaxdyn.course.page import Page, show
from jaxdyn.geometry import indices, vectors

PROBLEM = 5
TOPIC = "vectors and rotations"


def solve(page: Page) -> None:
    """Compute a moment about a line, and slide the force and the point along their lines."""
    n, p = np.array([1.0, 2.0, 2.0]) / 3, np.array([0.0, 1.0, 0.0])
    r, F = np.array([1.0, 0.0, 2.0]), np.array([2.0, -1.0, 3.0])

    def moment(p, r):
        return vectors.dot(n, vectors.cross(r - p, F))

    page.number("moment about the line", moment(p, r), "N m")
    moved = [moment(p + 7 * n, r), moment(p, r - 4 * F)]
    page.equal("It stays as p and r slide", moved, [moment(p, r)] * 2, within=1e-13, route="moved")
    by_indices = indices.evaluate_indices("M = epsilon_ijk n_i d_j F_k", n=n, d=r - p, F=F)
    page.equal("Index notation agrees", by_indices, moment(p, r), within=1e-14, route="components")


if __name__ == "__main__":
    show(solve)
