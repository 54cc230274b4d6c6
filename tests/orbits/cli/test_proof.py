"""`orbits refine` and `orbits prove`: digits and theorems about an orbit file."""

import functools
import json

import mpmath
import pytest
from helpers import forge

import orbits as library
from jaxdyn import scenes


@pytest.fixture
def orbits(command):
    return functools.partial(command, "orbits")


@pytest.fixture
def swing(tmp_path):
    path = tmp_path / "swing.json"
    library.save(path, library.find(scenes.pendulum(angle=2.0), period=2.7, hold="theta"))
    return path


def test_a_file_is_refined_and_proved(orbits, swing):
    with mpmath.workdps(50):
        # The period for the exact binary numbers that the scene has as parameters.
        g = mpmath.mpf(9.81)
        exact = 4 / mpmath.sqrt(g) * mpmath.ellipk(mpmath.sin(1) ** 2)
        code, out, err = orbits("refine", swing, "--digits", 40, "--json")
        assert code == 0, err
        refined = json.loads(out)
        assert abs(mpmath.mpf(refined["period"]) - exact) < mpmath.mpf(10) ** -38
        code, out, err = orbits("prove", swing, "--json")
        assert code == 0, err
        proved = json.loads(out)
        assert proved["proved"]
        period = proved["period"]
        assert abs(mpmath.mpf(period["mid"]) - exact) <= mpmath.mpf(period["rad"])


@pytest.mark.sample("prove-proof was repeated")
@pytest.mark.parametrize(
    ("make", "words"),
    [("refine", "digits were computed again"), ("prove", "proof was repeated")],
)
def test_verify_says_what_was_derived_again(orbits, swing, tmp_path, make, words):
    path = tmp_path / "more.json"
    assert orbits(make, swing, "--save", path)[0] == 0
    code, out, err = orbits("verify", path)
    assert code == 0, err
    assert words in out
    assert words not in orbits("verify", swing)[1]


def test_a_file_with_one_digit_edited_is_not_proved(orbits, swing):
    record = json.loads(swing.read_text())
    period = repr(record["scene"]["t1"])
    digit = (int(period[8]) + 1) % 10
    record["scene"]["t1"] = float(f"{period[:8]}{digit}{period[9:]}")
    forge(swing, record)
    code, out, _ = orbits("prove", swing, "--json")
    proved = json.loads(out)
    assert code != 0
    assert (proved["proved"], proved["period"]) == (False, None)
    assert "whose digits are wrong" in proved["reason"]


def test_misuse_is_one_line(orbits, swing):
    code, out, err = orbits("refine", swing, "--digits", 3)
    assert (code, out) == (2, "")
    assert "digits: expected a whole number, at least 15" in err
    code, out, err = orbits("prove", swing.with_name("nothing.json"))
    assert (code, out) == (2, "")
    assert "expected a readable file" in err
