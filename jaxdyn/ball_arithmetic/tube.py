"""A tube about a motion: proved enclosures of its end and of the end's derivative by the start.

For a box X of starts with a centre c, each step takes three enclosures to the next time:

- that of the motion from c: its Taylor series at a point nearby, plus the bound that `enclosure`
  proves of what the series leaves out, plus the derivative times the distance from that point (mean
  value form);
- that of the derivative Phi with respect to the start, for all motions from X: the product with the
  derivative of the step;
- that of all motions from X: the motion from c plus Phi (X - c), by the mean value theorem.

Distances from the point and Phi are kept as B e and B E, with balls in e and E and a matrix B of
floats. The next B is the orthogonal factor Q of S B, where S is the derivative of the step,
whatever its rounding; e and E are multiplied by Q^-1 S B, which is nearly triangular. So they grow
as motions nearby do, not as the product of the norms of all steps (Lohner 1987, in
Computerarithmetic, 255).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxdyn.ball_arithmetic import series
from jaxdyn.ball_arithmetic.arithmetic import (
    Undecided,
    arb,
    arb_mat,
    column,
    float_matrix,
    precision,
    unit_matrix,
)
from jaxdyn.ball_arithmetic.enclosure import About, Disc, disc
from jaxdyn.ball_arithmetic.field import BallField

#: Largest step as a part of the disc's radius; a smaller one takes more steps, a larger one higher
#: orders.
_SHARE = 0.35
#: Digits to which the series of the derivative are truncated; it only has to be regular.
SLOPE_DIGITS = 16.0
#: Digits that the series of a motion need not have, since bounds are of small neighbourhoods.
_SPARED_DIGITS = 4.5
_GROWTH_DIGITS = 2.0  # digits by which derivatives grow over a disc
_LEAST_ORDER = 24  # least order of the polynomial about which neighbours are enclosed
_MOST_STEPS = 20_000
_STEP_BITS = 40
#: A step below this share of the span approaches a singularity, which many more would not reach.
_SHORTEST = 1e-9


class NotEnclosed(ArithmeticError):
    """Raised if no enclosure is found; the message says why, and what to try."""


class Tube(NamedTuple):
    """Proved enclosures of the end.

    Attributes:
      centre: (k) the end of the motion from the centre over the centre of the span.
      box: (k) the ends of all motions over all spans.
      slopes: (k, k) the derivatives of all these ends.
      steps: number of steps.
    """

    centre: list
    box: list
    slopes: arb_mat
    steps: int


class _Now(NamedTuple):
    """Where motions are: that from the centre is at ``point + frame off``; with derivatives."""

    point: list
    frame: arb_mat
    off: arb_mat
    growth: arb_mat

    def centre(self) -> arb_mat:
        """(k, 1) the motion from the centre."""
        return column(self.point) + self.frame * self.off

    def box(self, offset: arb_mat) -> list:
        """(k) all motions."""
        return (self.centre() + self.frame * self.growth * offset).entries()


def tube(
    field: BallField,
    t: arb,
    centre: list,
    box: list,
    span: tuple[arb, arb],
    digits: float,
    bits: int,
    slope_digits: float = SLOPE_DIGITS,
    sizes: Sequence[float] | None = None,
) -> Tube:
    """Enclosures of the end of all motions from a box.

    Args:
      field: the rate.
      t: () the time of the start.
      centre: (k) a point of the box.
      box: (k) starts.
      span: () the centre of the spans in time, and a ball of spans that contains it; positive.
      digits: what a step's series leaves out is below 10^-digits.
      bits: precision of the calculation.
      slope_digits: these digits for the derivatives.
      sizes: (k) sizes of the entries along the motion, to which digits are relative; 1 by default.
        Powers of 2 do not round.
    Raises:
      NotEnclosed: the rate cannot be bounded, or the tube becomes too wide.
    """
    order = max(_LEAST_ORDER, _orders(digits - _SPARED_DIGITS))
    slope_order = _orders(slope_digits + _GROWTH_DIGITS)
    # Series are cut off at the larger of both orders.
    with precision(bits, max(order, slope_order)):
        sizes = [1.0] * field.k if sizes is None else sizes
        offset = column(box) - column(centre)
        unit = unit_matrix(field.k)
        point = [x.mid() for x in centre]
        now = _Now(point, unit, column(centre) - column(point), unit)
        done, outer = arb(0), None
        for steps in range(1, _MOST_STEPS):
            around = now.box(offset)
            if not _narrow(around, sizes):
                raise NotEnclosed(
                    f"The tube becomes too wide at t = {float(done):.6g}. Try more bits."
                )
            about = _about(field, t + done, now.point, around, order, sizes)
            left = span[1] - done
            farthest = float(abs(left).upper())  # some of the spans may be over already
            found = about and disc(about, outer, farthest / _SHARE)
            # The last disc may be as small as what is left of the span.
            least = min(_SHORTEST * float(span[1].upper()), farthest)
            if found is None or float(found[0].radius) < least:
                raise NotEnclosed(
                    f"The rate has no bound near t = {float(done):.6g}: the tube touches a "
                    "singularity. Try more digits."
                )
            bounds, outer = found
            h = _short(_share(bounds, about, order, digits) * float(bounds.radius))
            if left <= h:
                return _end(about, now, offset, (span[0] - done, left), bounds, slope_order, steps)
            now, done = _step(about, now, h, bounds, slope_order), done + h
        raise NotEnclosed("The motion takes too many steps. Prove it in parts of a period.")


def _narrow(box: list, sizes: Sequence[float]) -> bool:
    """Whether a box is narrower than the sizes of its entries."""
    return all(x.is_finite() and float(x.rad()) < s for x, s in zip(box, sizes, strict=True))


def _share(bounds: Disc, about: About, order: int, digits: float) -> float:
    """The step as a part of the radius; less where motions on a large disc differ widely."""
    size = max(abs(row[0]) / s for row, s in zip(about.series, about.sizes, strict=True))
    largest = max(x / s for x, s in zip(bounds.state, about.sizes, strict=True))
    if not (size > 0 and largest > 0):
        return _SHARE
    allowed = float((size / largest).log()) - digits * math.log(10)
    return min(_SHARE, math.exp(allowed / (order + 1)))


def _orders(digits: float) -> int:
    return math.ceil(digits * math.log(10) / -math.log(_SHARE))


def _about(
    field: BallField, t: arb, point: list, box: list, order: int, sizes: Sequence[float]
) -> About | None:
    """The motion from a point in a box, if its rate has a series there; else None."""
    try:
        coefficients = series.motion_series(field, t, point, order)
    except (ValueError, ZeroDivisionError, Undecided):  # what python-flint raises at a singularity
        return None
    return About(field, t, coefficients, box, sizes)


def _short(x: float) -> arb:
    """A slightly smaller number of few bits, so that sums of steps are exact."""
    mantissa, exponent = math.frexp(x)
    return arb(math.ldexp(math.floor(math.ldexp(mantissa, _STEP_BITS)), exponent - _STEP_BITS))


def _step(about: About, now: _Now, h: arb, bounds: Disc, slope_order: int) -> _Now:
    """The places of motions a step later."""
    moved = _slopes(about, h, bounds, slope_order) * now.frame
    value = _ending(about, h, bounds)
    point = [x.mid() for x in value]
    frame = _orthogonal(moved, np.array(about.sizes))
    back = frame.inv()
    carried = back * moved
    off = carried * now.off + back * (column(value) - column(point))
    return _Now(point, frame, off, carried * now.growth)


def _end(
    about: About,
    now: _Now,
    offset: arb_mat,
    spans: tuple[arb, arb],
    bounds: Disc,
    slope_order: int,
    steps: int,
) -> Tube:
    """Enclosures at the end: of the centre over the first span, of all over the second."""
    moved = _slopes(about, spans[1], bounds, slope_order) * now.frame
    off = moved * now.off
    centre, ends = (column(_ending(about, span, bounds)) + off for span in spans)
    slopes = moved * now.growth
    ended = (ends + slopes * offset).entries()
    if not _narrow(ended, about.sizes):
        raise NotEnclosed("The tube becomes too wide at its end. Try more bits.")
    return Tube(centre.entries(), ended, slopes, steps)


def _ending(about: About, h: arb, bounds: Disc) -> list:
    """(k) the end of the motion from the point."""
    left_out = bounds.remainder(abs(h) / bounds.radius, len(about.series[0]) - 1)
    pairs = zip(about.series, left_out, strict=True)
    return [series.at(row, h) + _ball(error) for row, error in pairs]


def _orthogonal(matrix: arb_mat, sizes: np.ndarray) -> arb_mat:
    """(k, k) exact floats near the orthogonal factor of a matrix in sizes (k)."""
    table = float_matrix(matrix)
    if not np.isfinite(table).all():
        raise NotEnclosed("The derivatives become too large. Try a shorter part of the period.")
    return arb_mat((sizes[:, None] * np.linalg.qr(table / sizes[:, None])[0]).tolist())


def _slopes(about: About, h: arb, bounds: Disc, order: int) -> arb_mat:
    """(k, k) the derivatives of a step's end for all motions from a box."""
    field, t = about.field, about.t
    coefficients = series.motion_series(field, t, about.box, order)
    slopes = series.slope_series(field, t, coefficients, order)
    value = series.at(series.transition_series(slopes, order), h)
    errors = bounds.left_out_of_slopes(abs(h) / bounds.radius, order)
    return value + arb_mat([[_ball(x) for x in row] for row in errors])


def _ball(radius: arb) -> arb:
    return arb(0, radius.upper())
