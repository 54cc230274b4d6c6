"""The branch engine on a problem that is known in closed form: the circle, in units of its own."""

import numpy as np
import pytest

from jaxdyn.continuation import newton
from jaxdyn.continuation.branch import BranchProblem, Chart, Correction, Place, follow
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
    """The circle, with the points where x or y is 0."""

    what = "circle"

    def __init__(self, least: float = -np.inf):
        self.least = least

    def chart(self, member):
        return Circle(self.least)

    def codec(self):
        return Codec(lambda x: list(map(float, x)), np.array)

    def special(self, chart, a, b, first):
        found = [chart.locate(lambda point, i=i: point[i], a, b, first=first) for i in range(2)]
        return [point for point in found if point is not None]

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
