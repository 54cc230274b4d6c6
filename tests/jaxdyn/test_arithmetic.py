"""Numbers as text: arithmetic with a few names, and nothing else."""

import math

import pytest

from jaxdyn._arithmetic import value


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("2", 2.0),
        ("-1e-3", -1e-3),
        ("pi/2", math.pi / 2),
        (" 2 * pi / 3 ", 2 * math.pi / 3),
        ("-2**2", -4.0),
        ("2**-0.5", 2**-0.5),
        ("sqrt(2)*(1 + e)", math.sqrt(2) * (1 + math.e)),
        ("cos(60*deg) - sin(-30*deg)", 1.0),
        ("+inf", math.inf),
    ],
)
def test_arithmetic(text, number):
    assert value(text) == pytest.approx(number, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        *("", "x", "1,2", "1 2", "pi pi", "sqrt", "sqrt(1, 2)", "sqrt(x=1)", "sqrt(-1)", "1/0"),
        *("10**1000", "(-1)**0.5", "True", "'1'", "1j", "[1]", "1 if 1 else 2", "1 < 2", "7 % 2"),
        *("__import__('os')", "pi.real", "(lambda: 1)()", "abs(1)", "1\n2", "\0", "()" * 10),
        *("(" * 150 + "1" + ")" * 40, "-" * 199 + "1", "9" * 201 + "x", "1+" * 10_000 + "1"),
    ],
)
def test_what_is_no_number_is_refused(text):
    if text == "-" * 199 + "1":
        assert value(text) == -1.0  # deep, but arithmetic
        return
    with pytest.raises(ValueError, match=r"number: expected a number, got .*arithmetic with pi, e"):
        value(text)
