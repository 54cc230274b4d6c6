"""Balls as decimal strings that enclose them."""

from jaxdyn.ball_arithmetic.arithmetic import arb, precision
from jaxdyn.ball_arithmetic.enclosed import Enclosed

_DIGITS = 30.0  # digits of exact numbers


def decimal(x: arb) -> Enclosed:
    """A decimal midpoint and radius whose ball contains the ball."""
    digits = _DIGITS
    if x.rad() > 0:
        digits = 3 + float((1 + abs(x.mid()) / x.rad()).log() / arb(10).log())
    with precision(8 * int(digits) + 128):
        text = arb(x.mid()).str(int(digits) + 4, radius=False)
        bound = abs(x - arb(text)).upper()
        # A number of three digits is too small by a part in a hundred at most.
        rad = (bound * arb("1.03")).upper().str(3, radius=False) if bound > 0 else "0"
    return Enclosed(text, rad)
