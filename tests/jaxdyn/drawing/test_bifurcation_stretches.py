"""Where the lines of a diagram are cut, and which of them a legend names."""

import numpy as np
import pytest

from jaxdyn.drawing.bifurcations import stretches

#: Places on a line and verdicts.
POINTS = [(0.0, "stable"), (1.0, "stable"), (2.0, "unstable"), (3.0, "unstable")]


def of(points, special=()):
    return stretches(points, special, lambda x: x[1], lambda x: np.array([x[0], 0.0]))


def test_a_line_changes_at_a_special_point():
    cut, elsewhere = (1.4, "undecided"), (9.0, "undecided")
    assert of(POINTS, [elsewhere, cut]) == [
        ("stable", [*POINTS[:2], cut], True),
        ("unstable", [cut, *POINTS[2:]], True),
    ]


def test_a_change_elsewhere_has_no_name():
    assert of(POINTS) == [
        ("stable", POINTS[:2], True),
        ("undecided", POINTS[1:3], False),
        ("unstable", POINTS[2:], True),
    ]


def test_points_without_a_verdict_are_named():
    points = [(0.0, "stable"), (1.0, "undecided"), (2.0, "unstable")]
    assert of(points, [(1.4, "undecided")]) == [("undecided", points, True)]


def test_a_line_leads_through_special_points_at_which_its_verdict_stays():
    turns = [(2.7, "undecided"), (2.2, "undecided")]
    stable, unstable = POINTS[:2], POINTS[2:]
    assert of(POINTS, turns)[-1] == ("unstable", [unstable[0], *turns[::-1], unstable[1]], True)
    assert of(POINTS, turns)[0] == ("stable", stable, True)


def test_a_special_point_is_on_the_nearest_line_only():
    points = [((0.0, 0.0), "stable"), ((2.0, 1.0), "stable"), ((0.0, 1.2), "stable")]
    special = ((1.0, 0.6), "undecided")
    found = stretches(points, [special], lambda x: x[1], lambda x: np.array(x[0]))
    assert found == [("stable", [points[0], special, *points[1:]], True)]


@pytest.mark.parametrize("unit", [1.0, 1e-5, 1e5])
def test_the_order_along_a_line_does_not_depend_on_units(unit):
    # A curve x^3 - 3 x = p bends back at x = -1 and 1; p is in another unit than x.
    def point(x, verdict):
        return (x, unit * (x**3 - 3 * x)), verdict

    stable, unstable = np.linspace(-2.05, -1.05, 9), np.linspace(-0.95, 0.95, 9)
    left, right = point(-1.0, "undecided"), point(1.0, "undecided")
    first = [point(x, "stable") for x in stable]
    middle = [point(x, "unstable") for x in unstable]
    last = [point(-x, "stable") for x in reversed(stable)]
    found = stretches([*first, *middle, *last], [left, right], lambda x: x[1], lambda x: x[0])
    wanted = [[*first, left], [left, *middle, right], [right, *last]]
    assert [points for _, points, _ in found] == wanted
