"""Order conditions of explicit Runge-Kutta tableaus, checked by rooted trees.

A method with matrix A and weights b has order p if, for every rooted tree t of at most
p nodes,

    sum_i b_i phi_i(t) = 1 / gamma(t),

where phi and gamma follow the tree: for a root with the subtrees t_1 .. t_m,

    phi(t) = prod_k (A phi(t_k))  (componentwise),   gamma(t) = |t| prod_k gamma(t_k).

The weights of an error estimate (the difference of two methods of orders p and q < p) fulfil
sum_i e_i phi_i(t) = 0 up to order q.

Reference: Butcher (2016), Numerical Methods for Ordinary Differential Equations, chapter 3.
"""

import itertools
from fractions import Fraction
from typing import Any

import mpmath as mp

DIGITS = 60


def number(text: str | float) -> Any:
    """A coefficient written as a decimal or as `p/q`, or a float as it is."""
    if isinstance(text, float):
        return mp.mpf(text)
    ratio = Fraction(text)
    return mp.mpf(ratio.numerator) / ratio.denominator


def partitions(total: int, largest: int):
    """The partitions of an integer as non-increasing tuples."""
    if total == 0:
        yield ()
    for first in range(min(total, largest), 0, -1):
        for rest in partitions(total - first, first):
            yield (first, *rest)


def rooted_trees(order: int) -> list[list[tuple]]:
    """All rooted trees of up to `order` nodes: a list of lists, one list for each size.

    A tree is the sorted tuple of its subtrees, so `()` is the single node.
    """
    trees = [[], [()]]
    for size in range(2, order + 1):
        found = []
        for parts in partitions(size - 1, size - 1):
            pools = [
                itertools.combinations_with_replacement(trees[part], len(list(group)))
                for part, group in itertools.groupby(parts)
            ]
            for choice in itertools.product(*pools):
                found.append(tuple(sorted(itertools.chain(*choice))))
        trees.append(found)
    return trees[1:]


class OrderConditions:
    """Elementary weights of one tableau; subtrees are computed once and kept."""

    def __init__(self, a):
        """Take the rows of the lower triangle, the first (empty) row included."""
        self.rows = [[(j, number(x)) for j, x in enumerate(row) if number(x)] for row in a]
        self.known = {}

    def tree(self, tree: tuple) -> tuple[list, int, int]:
        """(phi, gamma, size) of a tree."""
        phi, gamma, size = [mp.mpf(1)] * len(self.rows), 1, 1
        for child in tree:
            image, child_gamma, child_size = self.image(child)
            phi = [x * y for x, y in zip(phi, image, strict=True)]
            gamma *= child_gamma
            size += child_size
        return phi, gamma * size, size

    def image(self, tree: tuple) -> tuple[list, int, int]:
        """(A phi, gamma, size) of a tree."""
        if tree not in self.known:
            phi, gamma, size = self.tree(tree)
            image = [mp.fsum(x * phi[j] for j, x in row) for row in self.rows]
            self.known[tree] = image, gamma, size
        return self.known[tree]

    def residuals(self, weights, order: int, *, of_error: bool = False) -> list[float]:
        """Largest residual for each tree size 1 .. order.

        Against 1/gamma, as for the weights of a method, or against zero, as for those of an
        error estimate.
        """
        used = [(j, number(w)) for j, w in enumerate(weights) if number(w)]
        worst = []
        for trees in rooted_trees(order):
            found = (self.tree(tree) for tree in trees)
            values = [
                mp.fsum(w * phi[j] for j, w in used) - (0 if of_error else mp.mpf(1) / gamma)
                for phi, gamma, _ in found
            ]
            worst.append(float(max(map(abs, values))))
        return worst

    def row_sums(self, c) -> float:
        """Largest difference between a node and the sum of its row."""
        sums = [mp.fsum(x for _, x in row) for row in self.rows]
        return float(max(abs(s - number(x)) for s, x in zip(sums, c, strict=True)))
