"""A tube about a motion: proved enclosures of its end and of the end's derivative by the start.

For a box X of starts with a centre c, each step takes enclosures on to
the next time:

- of the motion from c: its Taylor series at the midpoint of its ball, plus what `enclosure` proves
  that the series leaves out, plus the derivative times the ball (mean value form);
- of the derivative Phi by the start, for all motions from X: the product with that of the step;
- of all motions from X: the motion from c plus Phi (X - c), by the mean value theorem.

So the box does not grow by wrapping, only rounding does, which more bits make up for: sets of
other shapes (Lohner 1987) are not needed for motions of moderate growth.
"""

import math
from typing import NamedTuple

from jaxdyn.balls import series
from jaxdyn.balls.arithmetic import Undecided, arb, arb_mat, precision
from jaxdyn.balls.enclosure import About, Disc, disc
from jaxdyn.balls.field import BallField

#: Step as a part of the radius of the disc; less takes more steps, more takes higher orders.
_SHARE = 0.35
#: Digits of the derivative that truncation spares; it only has to be regular.
SLOPE_DIGITS = 16.0
#: Digits that bounds of small neighbourhoods of a motion spare its series.
_SPARED_DIGITS = 5.0
_GROWTH_DIGITS = 2.0  # of derivatives over a disc
_LEAST_ORDER = 24  # of the polynomial about which neighbours are enclosed
_MOST_STEPS = 20_000
_STEP_BITS = 40
#: Of the span: a step so short approaches a singularity, which many more would not reach.
_SHORTEST = 1e-9


class NotEnclosed(ArithmeticError):
    """Raised if no enclosure is found; says why, and what to try."""


class Tube(NamedTuple):
    """Proved enclosures of the end.

    Attributes:
      centre: (k) of the motion from the centre over the centre of the span.
      box: (k) of all motions over all spans.
      slopes: (k, k) of the derivatives of all of them.
      steps: number of steps.
    """

    centre: list
    box: list
    slopes: arb_mat
    steps: int


class _Now(NamedTuple):
    centre: list
    box: list
    slopes: arb_mat


def tube(
    field: BallField,
    t: arb,
    centre: list,
    box: list,
    span: tuple[arb, arb],
    digits: float,
    bits: int,
    slope_digits: float = SLOPE_DIGITS,
) -> Tube:
    """Enclosures of the end of all motions from a box.

    Args:
      field: the rate.
      t: () the time of the start.
      centre: (k) a point of the box.
      box: (k) starts.
      span: () the centre of the spans in time, and a ball of them that contains it; positive.
      digits: what a step's series leaves out is below 10^-digits.
      bits: precision of the calculation.
      slope_digits: the same as `digits` for the derivatives.
    Raises:
      NotEnclosed: the rate cannot be bounded, or the tube becomes too wide.
    """
    order = max(_LEAST_ORDER, _orders(digits - _SPARED_DIGITS))
    slope_order = _orders(slope_digits + _GROWTH_DIGITS)
    # Series are cut off at the longest one's order.
    with precision(bits, max(order, slope_order)):
        offset = arb_mat([[a - b] for a, b in zip(box, centre, strict=True)])
        unit = arb_mat([[int(i == j) for j in range(field.k)] for i in range(field.k)])
        now, done, outer = _Now(centre, box, unit), arb(0), None
        for steps in range(1, _MOST_STEPS):
            about = _about(field, t + done, now, order)
            left = span[1] - done
            found = about and disc(about, outer, float(left.upper()) / _SHARE)
            # The last disc is as small as what is left.
            least = min(_SHORTEST * float(span[1].upper()), float(left.upper()))
            if found is None or float(found[0].radius) < least:
                raise NotEnclosed(
                    f"The rate has no bound near t = {float(done):.6g}: the tube touches a "
                    "singularity. Try more digits."
                )
            around, outer = found
            h = _short(_SHARE * float(around.radius))
            last = bool(left <= h)
            spans = (span[0] - done, left) if last else (h, h)
            now = _stepped(about, now, offset, spans, around, slope_order)
            if not all(x.is_finite() and float(x.rad()) < 1.0 for x in now.box):
                raise NotEnclosed(
                    f"The tube becomes too wide at t = {float(done):.6g}. Try more bits."
                )
            if last:
                return Tube(now.centre, now.box, now.slopes, steps)
            done = done + h
        raise NotEnclosed("The motion takes too many steps. Prove it in parts of a period.")


def _orders(digits: float) -> int:
    return math.ceil(digits * math.log(10) / -math.log(_SHARE))


def _about(field: BallField, t: arb, now: _Now, order: int) -> About | None:
    """The motion from the centre of a box, if its rate has a series there."""
    try:
        thin = [x.mid() for x in now.centre]
        coefficients = series.motion_series(field, t, thin, order)
    except (ValueError, ZeroDivisionError, Undecided):  # python-flint's word for a singularity
        return None
    return About(field, t, coefficients, now.box)


def _short(x: float) -> arb:
    """A number below, of few bits, so that sums of steps are exact."""
    mantissa, exponent = math.frexp(x)
    return arb(math.ldexp(math.floor(math.ldexp(mantissa, _STEP_BITS)), exponent - _STEP_BITS))


def _stepped(
    about: About,
    now: _Now,
    offset: arb_mat,
    spans: tuple[arb, arb],
    found: Disc,
    slope_order: int,
) -> _Now:
    """Enclosures a step later: of the centre over the first span, of all over the second."""
    q = abs(spans[1]) / found.radius
    slopes = _slopes(about, spans[1], found, q, slope_order)
    all_slopes = slopes * now.slopes
    thin = [row[0] for row in about.series]
    off = arb_mat([[x - m] for x, m in zip(now.centre, thin, strict=True)])
    moved = slopes * off
    left_out = found.left_out(q, len(about.series[0]) - 1)

    def ending(h: arb) -> list:
        parts = zip(about.series, left_out, moved.entries(), strict=True)
        return [series.at(row, h) + _ball(error) + shift for row, error, shift in parts]

    centre = ending(spans[0])
    same = spans[0] is spans[1]
    ends = centre if same else ending(spans[1])
    spread = (all_slopes * offset).entries()
    return _Now(centre, [c + d for c, d in zip(ends, spread, strict=True)], all_slopes)


def _slopes(about: About, h: arb, found: Disc, q: arb, order: int) -> arb_mat:
    """(k, k) the derivatives of a step's end for all motions from a box."""
    field, t = about.field, about.t
    coefficients = series.motion_series(field, t, about.box, order)
    slopes = series.slope_series(field, t, coefficients, order)
    value = series.at(series.transition_series(slopes, order), h)
    errors = found.left_out_of_slopes(q, order)
    return value + arb_mat([[_ball(x) for x in row] for row in errors])


def _ball(radius: arb) -> arb:
    return arb(0, radius.upper())
