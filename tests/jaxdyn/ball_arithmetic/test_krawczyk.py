"""Krawczyk's theorem on equations whose zeros are known."""

from jaxdyn.ball_arithmetic.arithmetic import arb, arb_mat, precision
from jaxdyn.ball_arithmetic.krawczyk import Krawczyk, is_inside


def _root_of_two(centre: float, radius: float) -> tuple[bool, arb]:
    """Whether x^2 = 2 has one zero in a box, and K."""
    x, offset = arb(centre), arb(0, radius)
    slopes, inverse = arb_mat([[2 * (x + offset)]]), arb_mat([[1 / (2 * centre)]])
    (step,) = Krawczyk.of([x * x - 2], slopes, inverse)([offset])
    return is_inside([step], [offset]), x + step


def test_a_box_with_one_zero_is_mapped_into_itself_and_k_holds_the_zero():
    with precision(100):
        alone, k = _root_of_two(1.4, 0.1)
        assert alone
        assert k.contains(arb(2).sqrt())
        assert float(k.rad()) < 0.02  # (1 - C D) r = 0.1^2 / 1.4, besides rounding


def test_a_box_with_no_zero_or_with_two_is_not():
    with precision(100):
        alone, k = _root_of_two(1.0, 0.1)
        assert not alone
        assert not k.overlaps(arb(1, 0.1))
        alone, k = _root_of_two(0.1, 3.0)
        assert not alone
        assert k.contains(arb(2).sqrt())
        assert k.contains(-arb(2).sqrt())


def test_k_may_be_narrowed_and_still_holds_the_zero():
    with precision(100):
        x, offset, zero = arb(1.4), arb(0, 0.1), arb(2).sqrt()
        krawczyk = Krawczyk.of([x * x - 2], arb_mat([[2 * (x + offset)]]), arb_mat([[1 / 2.8]]))
        first = krawczyk([offset])
        (second,) = krawczyk(first)
        assert (x + second).contains(zero)
        assert second.rad() < 0.25 * first[0].rad()
