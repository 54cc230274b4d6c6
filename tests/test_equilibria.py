"""Rest points: all of those that are known, their number by topology, decay by simulation."""

import numpy as np
import pytest
from helpers import gap
from test_linearize import Arm

from jaxdyn import Scene, simulate
from jaxdyn.effects import UniformGravity
from jaxdyn.equilibria import Equilibria, equilibria, low_discrepancy
from jaxdyn.formulations.newton_euler import NewtonEuler
from jaxdyn.scenes.particles import lorenz
from jaxdyn.scenes.springs import spring_mass, two_springs

DAMPED = {"c_a": 0.3, "c_b": 0.2, "c_d": 0.1}


def _saddles(found: Equilibria) -> int:
    """How many have a stiffness matrix with one negative eigenvalue (masses are 1 kg)."""
    return sum(np.linalg.det(x.jacobian[2:, :2]) < 0 for x in found.linearizations)


def test_weightless_mass_between_long_springs_has_five():
    found = equilibria(two_springs(g=0.0), [-3, -3], [3, 3])
    # Both springs at rest length (two minima); on the line of the anchors, where the two
    # forces cancel: midway, and where one is stretched by what the other is pressed.
    height = np.sqrt(1.5**2 - 1)
    expected = [[-1.5, 0], [0, -height], [0, 0], [0, height], [1.5, 0]]
    assert gap(found.states[:, :2], expected) < 1e-14
    assert gap(found.states[:, 2:], np.zeros((5, 2))) < 1e-14
    assert [x.portrait for x in found.linearizations] == ["saddle", "centre"] * 2 + ["saddle"]
    assert found.isolated.all()
    assert found.found_by.sum() + found.lost == found.starts == 1024
    assert found.residuals.max() < 1e-13


# (numbers besides k = 10, length = 1.5 and g, how many)
NUMBERS = [
    ({"g": 1.0}, 5),
    ({"g": 1000.0}, 1),
    ({"g": 0.0, "length_a": 0.0, "length_b": 0.0}, 1),
    ({"g": 1.0, "length_b": 0.0}, 1),
    ({"g": 1.0, "length_a": 3.0, "length_b": 0.0}, 2),
    ({"g": 4.0, "k_b": 2.0, "length_b": 3.6}, 3),
]


def _peaks(g, k_a=10.0, k_b=10.0, length_a=1.5, length_b=1.5) -> int:
    """At how many anchors the energy has a peak, sharp since the spring is pressed to a point.

    It has one where k L, the force of that spring, beats all other forces, from any side.
    """
    at_a = k_a * length_a > np.hypot(k_b * (2 - length_b), g)
    at_b = k_b * length_b > np.hypot(k_a * (2 - length_a), g)
    return int(at_a) + int(at_b)


@pytest.mark.parametrize(("numbers", "count"), NUMBERS)
def test_problem_13_c_number_of_equilibria_by_topology(numbers, count):
    scene = two_springs(**numbers)
    found = equilibria(scene, [-8, -8 - numbers["g"] / 5], [8, 8])
    assert len(found) == count
    # The energy grows to all sides, so minima and maxima less saddles are 1 (Morse).
    saddles = _saddles(found)
    assert (count - saddles) + _peaks(**numbers) - saddles == 1


@pytest.mark.slow
def test_problem_13_d_eigenvalues_against_simulated_decay():
    scene = two_springs(**DAMPED)
    found = equilibria(scene, [-3, -3], [3, 3])
    verdicts = [x.verdict for x in found.linearizations]
    assert verdicts == ["unstable", "stable", "unstable", "stable", "unstable"]
    for state, linear in zip(found.states, found.linearizations, strict=True):
        # Along the slowest, or the fastest growing, eigenvector.
        value = linear.eigenvalues[0]
        values, vectors = np.linalg.eig(linear.jacobian)
        vector = vectors[:, np.argmax(values.real)]
        size, span = 1e-8, 2.0
        start = size * np.real(vector)
        motion = simulate(scene.starting(state + start), span, samples=2, rtol=1e-13)
        expected = size * np.real(np.exp(values[np.argmax(values.real)] * span) * vector)
        scale = size * np.exp(value.real * span)
        assert gap((motion.ys[-1] - state) / scale, expected / scale) < 1e-4


def test_rest_points_of_lorenz():
    found = equilibria(lorenz(), [-30, -30, -10], [30, 30, 60], starts=64)
    w = np.sqrt(8 / 3 * 27)
    assert gap(found.states, [[-w, -w, 27], [0, 0, 0], [w, w, 27]]) < 1e-12


def test_angles_are_counted_once():
    scene = Scene(NewtonEuler(Arm()), (UniformGravity(9.0),), y0=[0.0, 0.0])
    found = equilibria(scene, [-10.0], [10.0], starts=64)
    assert len(found) == 2
    assert sorted(x.portrait for x in found.linearizations) == ["centre", "saddle"]
    assert gap(np.sort(np.abs(np.cos(found.states[:, 0]))), [1.0, 1.0]) < 1e-14


@pytest.mark.slow
def test_a_circle_of_rest_points_is_reported_as_not_isolated():
    found = equilibria(spring_mass(g=0.0, length=0.5), [-1, -1], [1, 1], starts=64)
    assert len(found) > 10
    assert not found.isolated.any()
    assert gap(np.hypot(*found.states[:, :2].T), np.full(len(found), 0.5)) < 1e-7
    assert all(x.portrait == "degenerate" for x in found.linearizations)


def test_none_in_the_box_is_none():
    found = equilibria(spring_mass(k=10.0, g=10.0), [5, 5], [6, 6], starts=16)
    assert len(found) == 0
    assert found.lost == 16


def test_low_discrepancy_points_fill_the_cube():
    points = low_discrepancy(512, 3)
    assert ((points >= 0) & (points < 1)).all()
    cells = np.unique((points * 4).astype(int), axis=0)
    assert len(cells) == 64  # every one of 4^3 cells; random points miss some at n / cells = 8
    assert gap(low_discrepancy(1, 1), [[(0.5 + 2 / (1 + np.sqrt(5))) % 1]]) < 1e-14


BOXES = [
    ([0, 0], [1, -1], r"^high: expected above low = \[0\.0, 0\.0\], got \[1\.0, -1\.0\]"),
    ([0, 0], [0, 0], r"^high: expected above low"),
    ([0, 0, 0], [1, 1, 1], r"^low: expected 4 entries, or 2 for coordinates at rest, got 3\.$"),
    ([0, 0], [1, 1, 1], r"^high: expected shape \(2,\), got shape \(3,\)"),
]


@pytest.mark.parametrize(("low", "high", "message"), BOXES)
def test_a_box_that_is_none_is_refused(low, high, message):
    with pytest.raises(ValueError, match=message):
        equilibria(two_springs(), low, high)
