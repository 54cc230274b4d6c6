"""The branch engine on a problem that is known in closed form: the circle, in units of its own."""

import numpy as np
import pytest

from jaxdyn.continuation import newton
from jaxdyn.continuation.branch import (
    ANYWHERE,
    Bounded,
    BranchProblem,
    Chart,
    Correction,
    Place,
    follow,
)
from jaxdyn.continuation.checkpoint import Codec, Log

RADIUS = 1e3


class Circle(Chart):
    """The points (x, y, tangent) at a distance from 0, cut off where y is less than `least`."""

    def __init__(self, least: float = -np.inf):
        self.least = least

    def inward(self, member):
        return np.append(member[:2] / RADIUS, member[2:])

    def outward(self, member):
        return np.append(member[:2] * RADIUS, member[2:])

    def place(self, member):
        return Place(member[:2], member[2:])

    def correct(self, last, start, plane):
        def equations(x):
            value = [x @ x - 1.0, last[2:] @ (x - plane)]
            return np.array(value), np.stack([2 * x, last[2:]])

        found = newton.solve(equations, start)
        if not found.settled:
            return "none"
        if found.x[1] < self.least:
            return "it is too low"
        way = np.array([-found.x[1], found.x[0]])
        way = way * np.sign(way @ last[2:])
        return Correction(found.x, found.iterations, np.append(found.x, way))


class Around(BranchProblem):
    """The circle within bounds on x and y, with the points where x or y is 0."""

    what = "circle"

    def __init__(self, least: float = -np.inf, x=ANYWHERE, y=ANYWHERE):
        self.least, self.within = least, (x, y)

    def chart(self, member):
        return Circle(self.least)

    def codec(self):
        return Codec(lambda x: list(map(float, x)), np.array)

    def special(self, chart, a, b, first):
        found = [chart.locate(lambda point, i=i: point[i], a, b, first=first) for i in range(2)]
        return [point for point in found if point is not None]

    def bounded(self, chart, member):
        return [Bounded(member[:2] * RADIUS, self.within)]

    def lost(self, reason):
        return f"nothing beyond: {reason}"


FIRST = np.array([RADIUS, 0.0, 0.0, 1.0])


def ignore(member):
    del member


def test_a_branch_goes_round_and_zeros_of_tests_are_located_to_rounding():
    found = follow(Around(), FIRST, 0.1, 24, ignore)
    points = np.array(found.members)
    np.testing.assert_allclose(np.hypot(*points[:, :2].T), RADIUS, rtol=1e-14)
    angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert (np.diff(angles) > 0).all()
    assert angles[-1] > 2 * np.pi
    # Tangents of neighbours turn by less than 26 degrees.
    assert np.diff(angles).max() < np.arccos(0.9)
    # One at the first member too, and each of the others once.
    places = np.array(found.special)[:, :2] / RADIUS
    right = np.arange(len(places)) * np.pi / 2
    assert np.abs(places - np.stack([np.cos(right), np.sin(right)], axis=1)).max() < 1e-14
    assert len(places) == 1 + int(angles[-1] / (np.pi / 2))
    assert found.before == (1, *(int((angles < way).sum()) for way in right[1:]))
    assert found.end == "the number of members requested, 24"


def test_steps_become_shorter_where_a_branch_ends_and_it_says_why():
    problem = Around(least=-0.5)
    found = follow(problem, FIRST, 0.1, 200, ignore)
    assert found.end == "nothing beyond: it is too low"
    assert found.members[-1][1] / RADIUS == pytest.approx(-0.5, abs=problem.shortest)


@pytest.mark.parametrize(
    ("bounds", "angle", "special"),
    [
        ({"y": (-1.0, 0.7 * RADIUS)}, np.arcsin(0.7), 1),
        ({"x": (0.3 * RADIUS, 2e3)}, np.arccos(0.3), 1),
        ({"x": (-0.01 * RADIUS, 2e3)}, np.arccos(-0.01), 2),
        ({"x": (0.01 * RADIUS, 2e3)}, np.arccos(0.01), 1),  # the next point is in the same step
        ({"x": (0.0, np.inf)}, np.pi / 2, 2),  # on the bound itself
        ({"y": (-0.5 * RADIUS, np.inf)}, np.pi + np.arcsin(0.5), 3),
    ],
)
def test_a_branch_that_leaves_its_bounds_ends_on_them(bounds, angle, special):
    seen = []
    found = follow(Around(**bounds), FIRST, 0.1, 200, seen.append)
    x, y = found.members[-1][:2] / RADIUS
    assert [x, y] == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-12)
    assert len(found.special) == special
    within = tuple(bounds.get(name, ANYWHERE) for name in "xy")
    assert found.end == f"the bounds {within}"
    np.testing.assert_array_equal(seen, found.members)


@pytest.mark.parametrize("angle", [0.69, 0.71])
def test_of_several_bounds_the_first_along_the_branch_counts(angle):
    corner = {"x": (np.cos(angle) * RADIUS, 2e3), "y": (-1.0, np.sin(0.7) * RADIUS)}
    found = follow(Around(**corner), FIRST, 0.25, 200, ignore)
    x, y = found.members[-1][:2]
    assert np.arctan2(y, x) == pytest.approx(min(angle, 0.7), abs=1e-12)


@pytest.mark.parametrize("top", [RADIUS, RADIUS * (1 + 1e-15), RADIUS * (1 - 1e-15)])
def test_a_branch_goes_on_where_it_touches_a_bound(top):
    assert len(follow(Around(x=(-top, top), y=(-top, top)), FIRST, 0.1, 24, ignore).members) == 24


class Turning(Around):
    """The circle, with the points where it turns in x and in y."""

    def special(self, chart, a, b, first):
        found = [chart.locate(lambda point, i=i: point[2 + i], a, b) for i in range(2)]
        return [point for point in found if point is not None]


def test_a_branch_that_leaves_and_returns_within_a_step_ends_where_it_leaves():
    top = 0.9999 * RADIUS
    found = follow(Turning(y=(-2e3, top)), FIRST, 0.4, 24, ignore)
    points = np.array(follow(Turning(), FIRST, 0.4, 24, ignore).members)
    assert (points[:12, 1] < top).all()  # no member is beyond
    assert found.members[-1][1] == pytest.approx(top, rel=1e-12)
    assert found.members[-1][0] > 0
    assert found.special == ()


@pytest.mark.parametrize("off", [-1e-15, 0.0, 1e-15])
def test_a_branch_may_begin_on_a_bound(off):
    start = RADIUS * np.cos(0.5), RADIUS * np.sin(0.5)
    first = np.array([*start, -np.sin(0.5), np.cos(0.5)])
    inward = follow(Around(y=(start[1] * (1 + off), 0.9 * RADIUS)), first, 0.1, 30, ignore)
    assert inward.members[-1][1] == pytest.approx(0.9 * RADIUS, rel=1e-12)
    outward = follow(Around(x=(start[0] * (1 + off), 2e3)), first, 0.1, 30, ignore)
    assert len(outward.members) == 1
    assert outward.end.startswith("the bounds ((877.58")


class Hole(Circle):
    """The circle without its points between two heights, where nothing is found."""

    def correct(self, last, start, plane):
        found = super().correct(last, start, plane)
        return "a hole" if 0.5 < found.x[1] < 0.55 else found


def test_where_no_member_is_found_on_a_bound_the_last_one_is_inside():
    problem = Around(y=(-1.0, 0.52 * RADIUS))
    problem.chart = lambda member: Hole()
    found = follow(problem, FIRST, 0.25, 30, ignore)
    assert found.members[-1][1] < 0.5 * RADIUS
    assert found.end.endswith("520.0)), on which no member was found")


def test_a_branch_goes_on_from_its_bounds_where_they_are_wider(tmp_path):
    path = tmp_path / "circle.jsonl"

    def upto(high, most=30):
        return follow(Around(y=(-1.0, high * RADIUS)), FIRST, 0.1, most, ignore, path)

    short = upto(0.5)
    size = path.stat().st_size
    again = upto(0.5)
    assert path.stat().st_size == size  # nothing was found anew
    np.testing.assert_array_equal(again.members, short.members)
    assert (again.end, again.before) == (short.end, short.before)
    long = upto(0.9)
    np.testing.assert_array_equal(long.members[: len(short.members)], short.members)
    assert long.members[-1][1] == pytest.approx(0.9 * RADIUS, rel=1e-12)
    # Narrower bounds end it on them, and leave the file as it is.
    narrow = upto(0.3)
    assert narrow.members[-1][1] == pytest.approx(0.3 * RADIUS, rel=1e-12)
    assert len(narrow.members) < len(short.members)
    np.testing.assert_array_equal(upto(0.5).members, short.members)
    np.testing.assert_array_equal(upto(0.9).members, long.members)


def test_an_interrupted_branch_goes_on_from_its_file(tmp_path):
    log = Log(tmp_path / "circle.jsonl")
    whole = follow(Around(), FIRST, 0.1, 12, ignore)
    follow(Around(), FIRST, 0.1, 5, ignore, log)
    seen = []
    again = follow(Around(), FIRST, 0.1, 12, seen.append, tmp_path / "circle.jsonl")
    np.testing.assert_array_equal(again.members, whole.members)
    np.testing.assert_array_equal(again.special, whole.special)
    assert (again.before, again.end) == (whole.before, whole.end)
    assert len(seen) == 12


@pytest.mark.parametrize("power", [1, 3, 7])
def test_the_locator_converges_where_one_end_would_stay(power):
    a, b = (np.array([np.cos(t), np.sin(t), -np.sin(t), np.cos(t)]) for t in (1.2, 1.65))
    found = Circle().locate(lambda point: point[0] ** power + point[0], a, b)
    assert found[0] == pytest.approx(0.0, abs=1e-15)
    assert Circle().locate(lambda point: point[1], a, b) is None
