"""How far a motion can be followed, and what its Taylor series leave out: rigorous bounds.

Theorem. Let Y be a set of starts and P the polydisc |z_i - y_i| <= eps_i + delta_i (complex z)
about each y in Y. Let f be analytic on P for |t - t0| <= R, with |f_i| <= M_i there, and
R M_i <= delta_i. Let p be the order of the series, |h| <= q R with q < 1. Then for each start y in
Y the solution exists for complex |t - t0| < R, and what its series leaves out at h is at most

    delta_i q^(p+1) / (1 - q)                  of entry i of the solution,
    (delta_i / eps_j) q^(p+1) / (1 - q)        of its derivative by entry j of the start.

Proof. (1) For a complex start w with |w_j - y_j| <= eps_j, Picard's iteration z -> w + int f(z)
along straight rays maps the functions with |z_i - w_i| <= delta_i, analytic in |t - t0| < R, into
themselves, as |int f_i| <= R M_i <= delta_i; its limit is the solution, analytic in t and in w.
(2) By Cauchy's estimate on the circle |t - t0| = r, for all r < R, the coefficient of order n >= 1
of z_i - w_i is at most delta_i / R^n. (3) That coefficient is an analytic function of w_j on the
disc of radius eps_j, hence its derivative at y is at most delta_i / (eps_j R^n), by Cauchy's
estimate once more. (4) Sum both for n > p at |h| <= q R: geometric series.

The bound M is that of `acb` on a square that contains each disc, where roots, logarithms and
quotients must be analytic. Reference: Neumaier 1990, Interval Methods for Systems of Equations;
Tucker 2011, Validated Numerics; for Cauchy's estimates in Taylor methods, Jorba, Zou 2005.
"""

import dataclasses

from jaxdyn.balls.arithmetic import COMPLEX, Undecided, acb, arb, precision
from jaxdyn.balls.field import BallField

#: Bits of the bounds: they are enclosures at any precision.
_BITS = 64
_GROWN = 1.05  # by which trial radii exceed the bounds that they must exceed
_TRIALS = 6
_SHORTER, _LONGER = 0.8, 1.3  # factors between trials of R
_MOST_TRIALS = 60
#: eps as a part of delta: the derivative's bound is 1 / it, the disc a tenth larger.
_START_SHARE = 0.1
_DISC_OF_UNFOLDING = 2.0**-10  # radius of the complex discs about the unfolding parameters


@dataclasses.dataclass(frozen=True)
class Disc:
    """A disc of time on which a motion is analytic, and bounds on it.

    Attributes:
      radius: R [time].
      state: (k) delta_i.
      start: (k + n) eps_j, of the unfolding parameters as well.
    """

    radius: arb
    state: list
    start: list

    def left_out(self, q: arb, order: int) -> list:
        """(k) bounds of what the solution's series leaves out."""
        return [delta * _tail(q, order) for delta in self.state]

    def left_out_of_slopes(self, q: arb, order: int) -> list[list]:
        """(k, k + n) the same of the derivative by the start and by the unfolding."""
        tail = _tail(q, order)
        return [[delta / eps * tail for eps in self.start] for delta in self.state]


def disc(field: BallField, t: arb, y: list, unfolding: list, guess: float) -> Disc | None:
    """A large disc about time t for starts in the box y; None if none is found.

    Args:
      field: the rate.
      t: () its centre.
      y: (k) a box of starts.
      unfolding: (n) a box of the unfolding's parameters.
      guess: a radius to try first.
    """
    with precision(_BITS):
        found, radius = None, guess
        for _ in range(_MOST_TRIALS):
            now = _verified(field, t, y, unfolding, radius)
            if found is not None and now is None:
                return found
            if now is not None and found is None and radius < guess:
                return now
            found = now
            radius *= _LONGER if now else _SHORTER
        return found


def _verified(field: BallField, t: arb, y: list, unfolding: list, radius: float) -> Disc | None:
    """The disc of this radius, if the bounds can be verified."""
    r = arb(radius)
    here = _bounds(field, _disc(t, arb(0)), y, [arb(0)] * field.k, unfolding)
    if here is None:
        return None
    largest = max((float(m) for m in here), default=0.0)
    state = [arb(radius * (float(m) + 1e-3 * largest + 1e-300) * 1.2) for m in here]
    for _ in range(_TRIALS):
        around = [s * (1 + arb(_START_SHARE)) for s in state]
        bounds = _bounds(field, _disc(t, r), y, around, unfolding)
        if bounds is None:
            return None
        needed = [r * m for m in bounds]
        if all(bool(need <= s) for need, s in zip(needed, state, strict=True)):
            start = [s * arb(_START_SHARE) for s in state]
            discs = [arb(_DISC_OF_UNFOLDING)] * field.n
            return Disc(radius=r, state=state, start=[*start, *discs])
        pairs = zip(needed, state, strict=True)
        state = [arb(max(float(need.upper()) * _GROWN, float(s))) for need, s in pairs]
    return None


def _bounds(field, t: acb, y: list, around: list, unfolding: list) -> list | None:
    """(k) upper bounds of |f_i| on a polydisc; None if f is not analytic on it."""
    z = [_disc(entry, radius) for entry, radius in zip(y, around, strict=True)]
    more = [_disc(x, arb(_DISC_OF_UNFOLDING)) for x in unfolding]
    try:
        rates = field.rate(t, z, more, COMPLEX)
    except Undecided:
        return None
    found = [acb(x).abs_upper() for x in rates]
    return found if all(x.is_finite() for x in found) else None


def _disc(centre: arb, radius: arb) -> acb:
    """A square that contains the discs about a ball's points."""
    side = arb(0, radius.upper())
    return acb(centre + side, side)


def _tail(q: arb, order: int) -> arb:
    """The sum of the geometric series; infinite unless q < 1 is certain."""
    return q ** (order + 1) / (1 - q) if q < 1 else arb.pos_inf()
