"""Rigorous bounds of how far a motion can be followed, and of what its Taylor series leaves out.

Theorem. Let y' = f(y). Let P be the Taylor polynomial of order p of the motion from a point c at
s = 0. Let 0 < R < R', f analytic about P(s) with |f_i(P(s))| <= M_i for |s| <= R', and
|df_i/dy_j| <= A_ij at all points that are no farther than delta from P(s), |s| <= R. Let eps_j > 0,
and eta_j >= |y_j - c_j| + eps_j for each start y in a box Y. Let d_i = M_i Q^p / (1 - Q) with
Q = R / R', and entry by entry

    E = exp(R A) (eta + R d) < delta.

Then for each start in Y the solution exists for complex |s| < R, and what its series of order n
leaves out at |h| <= q R, q < 1, is at most

    E_i q^(n+1) / (1 - q)                  of entry i of the solution, if n >= p,
    (E_i / eps_j) q^(n+1) / (1 - q)        of its derivative by entry j of the start, for any n.

Proof. (1) f(P) and P' have the same coefficients below order p, as P is the solution up to order
p; P' has no others, and those of f(P) are at most M_i / R'^n (Cauchy). So |f_i(P) - P'_i| <= d_i
on |s| <= R. (2) For a complex start w with |w_j - y_j| <= eps_j let e = z - P. Along a ray from 0,
|e_i|' <= d_i + sum_j A_ij |e_j| as long as |e| < delta, so |e| <= exp(|s| A) (eta + |s| d) <= E:
the solution z does not leave the neighbourhood before |s| = R, and is analytic in s and in w. (3)
Beyond order p the coefficients of z_i are those of e_i, at most E_i / R^n (Cauchy). (4) Those of
e_i are analytic functions of w_j on a disc of radius eps_j, hence their derivatives at y are at
most E_i / (eps_j R^n); those of P do not depend on w. (5) Both sums are geometric series.

The bounds M and A are those of `acb` on squares that cover the disc in s. Reference: Neumaier 1990,
Interval Methods for Systems of Equations; Tucker 2011, Validated Numerics; Walter 1970,
Differential and Integral Inequalities, for (2).
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence

from jaxdyn.ball_arithmetic.arithmetic import (
    COMPLEX,
    Undecided,
    acb,
    acb_poly,
    arb,
    arb_mat,
    precision,
)
from jaxdyn.ball_arithmetic.field import BallField

#: Bits of the bounds, which are enclosures at any precision.
_BITS = 64
_ACROSS = 10  # squares across the disc
_OUTER = 0.6  # first trial of R' as a part of the series' radius of convergence
_ROUNDS = 30  # towards an estimate of that radius
_FAR_BELOW_ONE = math.log(1e-3)  # of log r; elsewhere proofs of earlier versions are kept
_DEFECT_BITS = 34  # Q^p is about 2^-34, so that the polynomial's defect is small
_LEAST_Q = 0.5  # least Q, at low orders
#: eps over the defect, in parts of the entry's size on the disc: nearby motions must not be far
#: away, and the defect must not dominate the bounds of derivatives.
_EPS_BY_DEFECT = 2.0**10
_FIRST_GROWTH = 100.0  # first trial of delta / (eta + R d)
_GROWN = 1.5  # factor by which a further trial exceeds what the one before required
_MOST_GROWTH = 1e5  # largest growth from eta + R d to E: beyond it bounds of derivatives are poor
_TRIALS = 3
_EXPANDED = 3  # order of the polynomials' expansions about the squares' middles
_MARGIN = 1e-9  # margin of squares, so that they certainly cover the disc
_SHORTER, _LONGER = 0.85, 1.04  # factors on R' between trials, and from one step to the next
_MOST_TRIALS = 30


@dataclasses.dataclass(frozen=True)
class Disc:
    """A disc of time on which motions are analytic, and bounds on it.

    Attributes:
      radius: R [time].
      state: (k) the bounds E_i.
      start: (k) the radii eps_j.
    """

    radius: arb
    state: list
    start: list

    def remainder(self, q: arb, order: int) -> list:
        """(k) bounds of what the solution's series, of order p or more, leaves out."""
        return [e * _tail(q, order) for e in self.state]

    def left_out_of_slopes(self, q: arb, order: int) -> list[list]:
        """(k, k) bounds of what the series of the derivative by the start leaves out."""
        tail = _tail(q, order)
        return [[e / eps * tail for eps in self.start] for e in self.state]


@dataclasses.dataclass(frozen=True)
class About:
    """A motion to be enclosed with its neighbours.

    Attributes:
      field: the rate.
      t: () time of the start.
      series: (k) lists of the coefficients 0 to p of the motion from the centre.
      box: (k) a box of starts about it.
      sizes: (k) sizes of the entries of the state, by which these are compared.
    """

    field: BallField
    t: arb
    series: list[list]
    box: list
    sizes: Sequence[float]


def disc(about: About, outer: float | None, farthest: float) -> tuple[Disc, float] | None:
    """A large disc, and R' as a part of the radius of convergence; None if none is found.

    Args:
      about: the motion.
      outer: this part at the step before.
      farthest: a radius [time] that is large enough.
    """
    if not all(x.is_finite() for row in about.series for x in row):
        return None
    with precision(_BITS):
        reach = min(_convergence(about), 2 * farthest / _OUTER)
        share = _OUTER if outer is None else min(outer * _LONGER, 0.9)
        for _ in range(_MOST_TRIALS):
            found = _verify(about, share * reach)
            if found is not None:
                return found, share
            share *= _SHORTER
        return None


def _convergence(about: About) -> float:
    """An estimate of the radius of convergence; infinite for polynomials."""
    series = [[x / s for x in row] for row, s in zip(about.series, about.sizes, strict=True)]
    order = len(series[0]) - 1
    logs = [max(_log(row[n]) for row in series) for n in range(order + 1)]
    first, found = logs[: order // 2], [math.inf]
    for n in (order - 1, order):
        if min(logs[n], max(first)) > -math.inf:
            log_r = (max(first) - logs[n]) / n
            # In a unit of time far above r, the largest of the first half is not the first term: at
            # the radius r the last one is as large as it. Each round halves the error of log r.
            for _ in range(_ROUNDS if log_r < _FAR_BELOW_ONE else 0):
                largest = max(x + m * log_r for m, x in enumerate(first))
                log_r = (largest - logs[n]) / n
            found.append(math.exp(log_r))
    return min(found)


def _log(x: arb) -> float:
    bound = abs(arb(x).mid())
    return float(bound.log()) if not bound.is_zero() else -math.inf


def _verify(about: About, outer: float) -> Disc | None:
    """The disc inside one of radius R', if the bounds can be verified; else None."""
    order = len(about.series[0]) - 1
    ratio = max(2.0 ** (-_DEFECT_BITS / order), _LEAST_Q)
    inner, share = outer * ratio, _EPS_BY_DEFECT * ratio**order
    r, q = arb(inner), arb(inner) / arb(outer)
    cells = _cells(about, outer)
    bounds = _largest(_rates(about, *cell[:2]) for cell in cells)
    if bounds is None:
        return None
    defect = [m * q**order / (1 - q) for m in bounds]
    columns = zip(*(z for _, z, _ in cells), strict=True)
    sizes = [float(max(x.abs_upper() for x in column)) for column in columns]
    known = [x or own for x, own in zip(sizes, about.sizes, strict=True)]
    start = [arb(share * x) for x in known]
    pairs = zip(about.box, about.series, start, strict=True)
    apart = [(abs(x - row[0]) + eps).upper() for x, row, eps in pairs]
    first = [eta + r * d for eta, d in zip(apart, defect, strict=True)]
    near = [cell for cell in cells if cell[2] <= inner]
    delta = [x * arb(_FIRST_GROWTH) for x in first]
    for _ in range(_TRIALS):
        slopes = _largest(_slopes(about, *cell[:2], delta) for cell in near)
        if slopes is None:
            return None
        reached = _exponential_times(slopes, r, first, about.sizes)
        grown = zip(reached, first, strict=True)
        if not all(x.is_finite() and x < _MOST_GROWTH * f for x, f in grown):
            return None
        if all(bool(x < d) for x, d in zip(reached, delta, strict=True)):
            return Disc(radius=r, state=[x.upper() for x in reached], start=start)
        delta = [(x * arb(_GROWN)).upper() for x in reached]
    return None


def _exponential_times(slopes: list, r: arb, first: list, sizes: Sequence[float]) -> list:
    """(k) exp(R A) times a vector, with A (k k); in sizes, so that A has moderate entries."""
    k = len(first)
    rows = [
        [x * r * size / own for x, size in zip(slopes[i * k : (i + 1) * k], sizes, strict=True)]
        for i, own in enumerate(sizes)
    ]
    found = arb_mat(rows).exp() * arb_mat([[x / s] for x, s in zip(first, sizes, strict=True)])
    return [x * s for x, s in zip(found.entries(), sizes, strict=True)]


def _cells(about: About, outer: float) -> list[tuple[acb, list, float]]:
    """Squares that cover the disc's upper half: offsets, the polynomials there, least |s|.

    Rates are real for real arguments, so bounds on the lower half are the same.
    """
    side = 2 * outer / _ACROSS
    half = arb(0, side / 2 * (1 + _MARGIN))
    square = acb(half, half)
    whole = [_derivatives(row) for row in about.series]
    found = []
    for i, j in itertools.product(range(-_ACROSS // 2, _ACROSS // 2), range(_ACROSS // 2)):
        x, y = (i + 0.5) * side, (j + 0.5) * side
        nearest = math.hypot(max(abs(x) - side / 2, 0.0), max(y - side / 2, 0.0)) * (1 - _MARGIN)
        if nearest <= outer:
            middle = acb(x, y)
            found.append((middle + square, [_over(p, middle, square) for p in whole], nearest))
    return found


def _derivatives(row: list) -> list[acb_poly]:
    """p, p', p''/2, ... for the polynomial p with these coefficients, at the present precision."""
    found = [acb_poly([x * 1 for x in row])]
    for n in range(1, _EXPANDED + 1):
        found.append(found[-1].derivative() * (1 / arb(n)))
    return found


def _over(p: list[acb_poly], middle: acb, square: acb) -> acb:
    """An enclosure of a polynomial over a square, by its expansion about the middle.

    The derivative in the last term is taken over the whole square (Lagrange's remainder, which in
    its integral form holds for balls of complex numbers).
    """
    total = p[-1](middle + square)
    for derivative in reversed(p[:-1]):
        total = derivative(middle) + square * total
    return total


def _rates(about: About, s: acb, z: list) -> list | None:
    """(k) the rates on the motion from the centre; None if they are not analytic there."""
    try:
        return about.field.rate(about.t + s, z, COMPLEX)
    except Undecided:
        return None


def _slopes(about: About, s: acb, z: list, delta: list) -> list | None:
    """(k k) derivatives of the rate on motions near that; None if they are not analytic."""
    discs = [acb(arb(0, x.upper()), arb(0, x.upper())) for x in delta]
    near = [x + d for x, d in zip(z, discs, strict=True)]
    try:
        inputs = about.field.inputs(about.t + s, near)
        return about.field.slopes(inputs, COMPLEX)[about.field.k :]
    except Undecided:
        return None


def _largest(rows) -> list | None:
    """Upper bounds of the absolute values over all rows; None if one row has no bounds."""
    found: list | None = None
    for row in rows:
        if row is None:
            return None
        sizes = [acb(x).abs_upper() for x in row]
        if not all(x.is_finite() for x in sizes):
            return None
        found = sizes if found is None else [max(a, b) for a, b in zip(found, sizes, strict=True)]
    return found


def _tail(q: arb, order: int) -> arb:
    """The tail of the geometric series beyond an order; infinite unless q < 1 is certain."""
    return q ** (order + 1) / (1 - q) if q < 1 else arb.pos_inf()
