"""The benchmarks of published numbers and verdicts compare rightly; no orbit is searched for."""

import numpy as np
import pytest

from benchmarks import published, verdicts

mp = pytest.importorskip("mpmath")


def polynomial(*values):
    """Coefficients of the polynomial with these multipliers."""
    return [mp.mpf(c) for c in np.poly(values).real]


ON_CIRCLE = np.exp([0.4j, -0.4j, 2.0j, -2.0j])


def test_a_difference_is_counted_in_units_of_the_last_digit():
    one = published.Compared("T", "6.3259", 6.32595)
    assert one.units == pytest.approx(0.5, abs=1e-9)
    assert one.agrees
    assert published.Compared("T", "-13.76", -13.79).units == pytest.approx(-3.0, abs=1e-9)
    assert not published.Compared("T", "6.3259", 6.3257).agrees


def test_another_verdict_differs_and_none_does_not():
    for verdict, agrees in (("stable", True), ("undecided", True), ("unstable", False)):
        one = published.Compared("T", "1.0", 1.0, 1e-14, verdict, "stable")
        assert one.agrees == agrees


def test_the_verdicts_of_multipliers_that_are_known():
    exact = polynomial(*ON_CIRCLE)
    said, values, bars = verdicts.judge([exact, exact])
    assert said == "stable"
    off, _ = verdicts.distances(verdicts.Truth(said, values, bars, 64, 0.0, 0.0), ON_CIRCLE)
    assert off.max() < 1e-14
    for values in ([3.0, 1 / 3.0, 0.8 + 0.6j, 0.8 - 0.6j], [1.2j, -1.2j, 1j / 1.2, -1j / 1.2]):
        exact = polynomial(*values)
        assert verdicts.judge([exact, exact])[0] == "unstable"


def test_iterates_that_differ_leave_it_open():
    exact = polynomial(*ON_CIRCLE)
    other = polynomial(*np.exp([0.5j, -0.5j, 2.1j, -2.1j]))
    assert verdicts.judge([exact, other])[0] == "open"


def test_rows_are_drawn_again_by_the_same_seed():
    rows = verdicts.draw(30, 3)
    assert rows == verdicts.draw(30, 3)
    assert len({row.name for row in rows}) == 30
    assert {row.d for row in rows} == {2, 3}
    for row in rows:
        scene = verdicts.scene(row)
        points = scene.system.points(0.0, scene.y0)
        assert np.abs(points.m @ points.v).max() < 1e-14


def test_the_reference_has_the_multipliers_of_the_eight():
    pytest.importorskip("heyoka")
    row = next(row for row in verdicts.draw(2547, 0) if row.name == "I.A^ic_1")
    found = verdicts.truth(row, 64)
    assert found.verdict == "stable"
    # By python-flint in 120 bits.
    known = np.array(
        [-0.297596667518713 + 0.9546916902758484j, 0.9985999820920393 + 0.0528968407920j]
    )
    off, _ = verdicts.distances(found, np.concatenate([known, known.conj()]))
    assert off.max() < 1e-12


def test_more_bits_are_taken_where_fewer_leave_something_open():
    settled = {"truth": "stable", "vague": False, "within bars": True}
    assert not verdicts.unsettled(settled)
    assert verdicts.unsettled(settled | {"vague": True})
    assert verdicts.unsettled(settled | {"within bars": False})
    assert verdicts.unsettled({"truth": "open"})
    assert verdicts.unsettled({"truth": "unstable", "within bars": False})
    assert not verdicts.unsettled({"truth": "unstable", "within bars": True})
