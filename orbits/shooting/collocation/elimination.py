"""Newton steps for collocation: the states inside the mesh are eliminated, pair by pair.

Each interval gives k linear equations in the states at its two ends and in the few unknowns that
all intervals share (period, parameter, angle). Of two neighbours, an orthogonal elimination of the
state between them leaves k equations for their outer ends; after log2(n) rounds one block for the
two ends of the whole motion is left, which is solved with the closing equations. Orthogonal
elimination is stable where growth and decay over the motion have no common scale, as in relaxation
oscillations. A product of the transition matrices is not stable there, and a singular value
decomposition of all equations mistakes their small singular values for symmetries.

Reference: U. Ascher, R. Mattheij, R. Russell, Numerical Solution of Boundary Value Problems for
Ordinary Differential Equations, SIAM (1995), chapter 7; S. Wright, SIAM J. Sci. Stat. Comput. 13
(1992) 742.
"""

from typing import NamedTuple

import numpy as np


class Chain(NamedTuple):
    """Equations left @ dy[i] + right @ dy[i + 1] + shared @ dg + rest = 0 for i < n.

    Attributes:
      left: (n, k, k).
      right: (n, k, k).
      shared: (n, k, g).
      rest: (n, k).
    """

    left: np.ndarray
    right: np.ndarray
    shared: np.ndarray
    rest: np.ndarray


class _Round(NamedTuple):
    """The equations upper @ dy + left @ before + right @ after + shared @ dg + rest = 0 for dy."""

    upper: np.ndarray
    chain: Chain


def condense(chain: Chain) -> tuple[Chain, list[_Round]]:
    """One equation for the two ends of a chain, and how the states between follow from them."""
    rounds = []
    while len(chain.rest) > 1:
        pairs = len(chain.rest) // 2
        first, second = (Chain(*(a[i : 2 * pairs : 2] for a in chain)) for i in (0, 1))
        k = first.left.shape[-1]
        q, r = np.linalg.qr(np.concatenate([first.right, second.left], axis=1), mode="complete")
        nothing = np.zeros_like(first.left)
        rows = [
            np.concatenate([first.left, nothing], axis=1),
            np.concatenate([nothing, second.right], axis=1),
            np.concatenate([first.shared, second.shared], axis=1),
            np.concatenate([first.rest, second.rest], axis=1)[..., None],
        ]
        turned = [np.swapaxes(q, 1, 2) @ row for row in rows]
        upper, lower = ([a[:, part] for a in turned] for part in (slice(k), slice(k, None)))
        by_before, by_after, by_shared, known = upper
        between = Chain(by_before, by_after, by_shared, known[..., 0])
        rounds.append(_Round(r[:, :k], between))
        joined = (*lower[:3], lower[3][..., 0])
        left, right, shared, rest = (
            np.concatenate([new, old[2 * pairs :]]) for new, old in zip(joined, chain, strict=True)
        )
        chain = Chain(left, right, shared, rest)
    return chain, rounds


def expand(
    rounds: list[_Round],
    first: np.ndarray,
    last: np.ndarray,
    dg: np.ndarray,
    *,
    homogeneous: bool = False,
):
    """(n + 1, k) all changes dy of a chain from those of its ends (k,) and the shared ones (g,).

    With `homogeneous`, the `rest` of the equations counts as zero.
    """
    states = np.stack([first, last])
    for upper, chain in reversed(rounds):
        pairs = len(upper)
        before, after = states[:pairs], states[1 : pairs + 1]
        right = np.einsum("nij,nj->ni", chain.left, before)
        right += np.einsum("nij,nj->ni", chain.right, after) + chain.shared @ dg
        right += 0.0 if homogeneous else chain.rest
        between = np.linalg.solve(upper, -right[..., None])[..., 0]
        joined = np.empty((2 * pairs, states.shape[1]))
        joined[::2], joined[1::2] = before, between
        states = np.concatenate([joined, states[pairs:]])
    return states
