"""Equilibria: all of those that are known, their number by topology, decay by simulation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, Arm, gap, refusal

import jaxdyn
from jaxdyn import Scene, simulate
from jaxdyn.analysis.equilibria import Equilibria, equilibria, equilibrium
from jaxdyn.analysis.equilibrium_search.completeness import bisect, judge
from jaxdyn.analysis.equilibrium_search.search import Box, low_discrepancy
from jaxdyn.analysis.linearize import modes
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.formulations.newton_euler import NewtonEuler
from jaxdyn.formulations.ode import ode
from jaxdyn.hard.cases.rest import FOLDS, OBLIQUE, oblique_springs
from jaxdyn.scene import Effect
from jaxdyn.scenes import cannonball, lorenz
from jaxdyn.scenes.pendula import pendulum
from jaxdyn.scenes.springs import spring_mass, two_springs

DAMPED = {"c_a": 0.3, "c_b": 0.2, "c_d": 0.1}


def _saddles(found: Equilibria) -> int:
    """How many have a stiffness matrix with one negative eigenvalue (masses are 1 kg)."""
    return sum(np.linalg.det(x.jacobian[2:, :2]) < 0 for x in found.linearizations)


@pytest.mark.slow
def test_weightless_mass_between_long_springs_has_five():
    found = equilibria(two_springs(g=0.0), [-3, -3], [3, 3])
    # Both springs at rest length (two minima); on the line of the anchors, where the two
    # forces cancel: midway, and where one is stretched by what the other is pressed.
    height = np.sqrt(1.5**2 - 1)
    expected = [[-1.5, 0], [0, -height], [0, 0], [0, height], [1.5, 0]]
    assert gap(found.states[:, :2], expected) < 1e-14
    assert gap(found.states[:, 2:], np.zeros((5, 2))) < 1e-14
    assert [x.portrait for x in found.linearizations] == ["saddle", "centre"] * 2 + ["saddle"]
    assert set(found.kinds) == {"isolated"}
    assert found.complete
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


@pytest.mark.slow
@pytest.mark.parametrize(("numbers", "count"), NUMBERS)
def test_problem_13_c_number_of_equilibria_by_topology(numbers, count):
    scene = two_springs(**numbers)
    found = equilibria(scene, [-8, -8 - numbers["g"] / 5], [8, 8])
    assert len(found) == count
    assert found.complete
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


def test_equilibria_of_lorenz():
    found = equilibria(lorenz(), [-30, -30, -10], [30, 30, 60], starts=64)
    w = np.sqrt(8 / 3 * 27)
    assert gap(found.states, [[-w, -w, 27], [0, 0, 0], [w, w, 27]]) < 1e-12


@pytest.mark.slow
def test_angles_are_counted_once():
    scene = Scene(NewtonEuler(Arm()), (UniformGravity(9.0),), y0=[0.0, 0.0])
    found = equilibria(scene, [-10.0], [10.0], starts=64)
    assert len(found) == 2
    assert sorted(x.portrait for x in found.linearizations) == ["centre", "saddle"]
    assert gap(np.sort(np.abs(np.cos(found.states[:, 0]))), [1.0, 1.0]) < 1e-14


@pytest.mark.slow
def test_a_circle_of_equilibria_is_reported_as_a_continuum():
    found = equilibria(spring_mass(g=0.0, length=0.5), [-1, -1], [1, 1], starts=64)
    assert len(found) > 10
    assert set(found.kinds) == {"continuum"}
    assert not found.complete
    assert "boxes" in found.certainty
    assert "along a curve of equilibria" in found.certainty
    assert gap(np.hypot(*found.states[:, :2].T), np.full(len(found), 0.5)) < 1e-7
    assert all(x.portrait == "degenerate" for x in found.linearizations)


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize(("numbers", "expected"), OBLIQUE)
def test_equilibria_with_small_basins_are_all_found(numbers, expected):
    found = equilibria(oblique_springs(*numbers), [-10, -10], [10, 10])
    assert found.states.shape == (len(expected), 4)
    assert gap(found.states[:, :2], expected) < 1e-12
    assert (found.states[:, 2:] == 0).all()
    assert found.complete
    assert found.certainty.startswith("complete: interval bisection excludes any other equilibrium")
    assert (
        "except the points (0, 0), (0.8, 0.6), where the rate is discontinuous" in found.certainty
    )


WEAK, LAG = 5e-8, 0.4  # of the field below: its strength, and the direction of the bulge [rad]


def _geostationary(t, y):
    """A planet with a slightly elliptic equator, in axes that turn with it."""

    def potential(x, y):
        along, across = np.cos(2 * LAG), np.sin(2 * LAG)
        bulge = along * (x * x - y * y) + 2 * across * x * y
        r2 = x * x + y * y
        return -(r2**-0.5) - WEAK * bulge * r2**-2.5 - 0.5 * r2

    x, y, vx, vy = y
    ax, ay = jax.grad(potential, argnums=(0, 1))(x, y)
    return [vx, vy, 2 * vy - ax, -2 * vx - ay]


def test_four_equilibria_that_a_weak_force_leaves_of_a_ring():
    found = equilibria(ode(_geostationary, np.zeros(4)), [-1.1, -1.1], [1.1, 1.1], starts=64)
    # Towards the bulge, and across: there r^5 = r^2 + 3 WEAK and r^5 = r^2 - 3 WEAK.
    angles = LAG + np.pi / 2 * np.arange(4)
    r = np.array([np.roots([1, 0, 0, -1, 0, -3 * WEAK * s]).real.max() for s in (1, -1, 1, -1)])
    expected = r[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    order = np.argsort(expected[:, 0])
    assert set(found.kinds) == {"isolated"}
    # Rounding is larger along the ring by the share of the weak force.
    assert gap(found.states[:, :2], expected[order]) < 1e-15 / WEAK
    assert gap(np.hypot(*found.states[:, :2].T), r[order]) < EXACT


@pytest.mark.slow
def test_two_equilibria_that_are_about_to_vanish():
    before, after = (
        equilibria(
            oblique_springs(0.5, 3.0, 3.0, FOLDS[1] + beside), [-10, -10], [10, 10], starts=64
        )
        for beside in (-1e-7, 1e-7)
    )
    assert (len(before), len(after)) == (3, 1)
    assert before.complete
    assert after.complete
    near = before.states[np.abs(before.states[:, 1] - 1.02) < 0.01]
    assert 1e-4 < np.ptp(near[:, 1]) < 1e-2
    at = equilibria(oblique_springs(0.5, 3.0, 3.0, FOLDS[1]), [-10, -10], [10, 10], starts=64)
    assert not at.complete
    assert "near (0.4602, 1.02002) the Jacobian is singular" in at.certainty


@pytest.mark.parametrize("scene", [cannonball(), two_springs(k_a=0.0, k_b=0.0, g=1.0)])
def test_a_falling_body_rests_nowhere(scene):
    found = equilibria(scene, [-3, -3], [3, 3])
    assert len(found) == 0
    assert found.complete
    assert found.lost == 1024


def test_a_place_where_the_rate_is_zero_but_jumps_is_no_equilibrium():
    # B where the search starts, and the spring to A at its rest length there: the other spring
    # has no direction, so the rate is 0 just there.
    start = 2 * low_discrepancy(1, 2)[0] - 1
    scene = two_springs(g=0.0, anchor_b=start, length_a=np.hypot(start[0] + 1, start[1]))
    found = equilibria(scene, [-1, -1], [1, 1], starts=64)
    assert not (found.states[:, :2] == start).all(axis=1).any()
    assert "where the rate is 0 but discontinuous" in found.certainty


def test_modes_take_what_equilibria_returns():
    scene = oblique_springs(8.0, 2.0, 0.8, 1.0)
    state = equilibria(scene, [1.0, -1.0], [2.0, 1.0], starts=32).states[0]
    assert (modes(scene, state).squares > 0).all()
    moving = np.array([0.0, 0.0, 1.0, 0.0])
    assert (modes(scene, state + 5e-174 * moving).squares > 0).all()
    with pytest.raises(
        ValueError, match=r"^y: expected an equilibrium, got velocities \[0\.001, 0"
    ):
        modes(scene, state + 1e-3 * moving)


@pytest.mark.slow
def test_equilibria_with_constraints_satisfy_them_and_are_not_proved():
    # Without the constraint, a mass on a rod could rest anywhere on the vertical.
    found = equilibria(pendulum(formulation="constrained"), [-2, -2], [2, 2], starts=64)
    assert gap(found.states, [[0, -1, 0, 0], [0, 1, 0, 0]]) < 1e-12
    assert found.kinds == ("isolated", "isolated")
    assert not found.complete
    assert found.certainty.startswith("not certain: interval bisection has no bounds for the rate")


class Flat(Effect):
    """A force -k x^3 to the origin [N]: no stiffness there."""

    velocity_dependent = False

    def force(self, t, r, v, m):
        return -(r**3)


@pytest.mark.slow
def test_an_equilibrium_that_exists_but_was_not_reached_is_told():
    field, box = spring_mass().field, Box(np.array([-3.0, -3, 0, 0]), np.array([3.0, 3, 0, 0]))
    proof = bisect(field, jnp.zeros(()), box)
    found = equilibria(spring_mass(), [-3, -3], [3, 3], starts=64)
    assert found.complete
    complete, certainty = judge(proof, field, jnp.zeros(()), found.states[:-1], np.zeros((0, 4)))
    assert not complete
    assert "did not reach the equilibrium that exists near" in certainty


def test_an_equilibrium_without_stiffness_is_degenerate():
    scene = Scene(FreePoints([1.0], 1), (Flat(),), y0=[1.0, 0.0])
    found = equilibria(scene, [-1.0], [2.0], starts=16)
    assert found.kinds == ("degenerate",)
    assert gap(found.states, [[0.0, 0.0]]) < 1e-8
    assert not found.complete
    assert "near (0) the Jacobian is singular" in found.certainty


@pytest.mark.slow
def test_an_equilibrium_moves_with_the_numbers_of_the_scene():
    def height(k):
        return equilibrium(spring_mass(k=k, length=0.5, g=9.0), [0.1, -1.0, 0.0, 0.0])[1]

    # -length - m g / k
    assert gap(height(10.0), -1.4) < EXACT
    assert gap(jax.grad(height)(10.0), 0.09) < EXACT
    assert gap(jax.jacfwd(jax.grad(height))(10.0), -0.018) < EXACT


def test_equilibria_of_a_traced_scene_are_refused():
    def least(g):
        return equilibria(spring_mass(g=g), [-3, -3], [3, 3]).states.min()

    message = (
        r"^equilibria: expected numbers, got values traced .* `equilibria\.equilibrium\(scene, y\)"
    )
    for attempt in (jax.grad(least), jax.jit(least)):
        with pytest.raises(ValueError, match=message):
            attempt(1.0)


@pytest.mark.slow
def test_no_isolated_equilibrium_is_nan_and_so_is_its_derivative():
    def place(length):
        return equilibrium(spring_mass(g=0.0, length=length), [0.5, 0.0, 0.0, 0.0])[0]

    assert np.isnan(place(0.5))
    assert np.isnan(jax.grad(place)(0.5))
    assert np.isnan(equilibrium(cannonball(), jnp.zeros(4))).all()


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


def test_coordinates_alone_are_for_states_of_coordinates_and_velocities():
    """Two chemostats, or any rate: half of its entries are no state at rest."""
    plain = jaxdyn.ode(lambda t, y: [y[0] - y[1], y[0] * y[1] - 1.0], [1.0, 1.0], 1.0)
    with pytest.raises(ValueError, match=r"^low: expected 2 entries, got 1\.$"):
        equilibria(plain, [0.5], [1.5])
    with pytest.raises(ValueError, match=r"^start: expected 2 entries, got 1\.$"):
        jaxdyn.continue_equilibria(lambda p: plain, 1.0, [0.5])
    swing = jaxdyn.ode(lambda t, y: [y[1], -jnp.sin(y[0])], [1.0, 1.0], 1.0)
    assert len(equilibria(swing, [-0.5], [0.5])) == 1


def rest(**options):
    return equilibria(pendulum(), [-1.0, 0.0], [1.0, 1.0], **options)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: equilibria(Scene(FreePoints([]), (), y0=[]), [], []),
            "system: expected a system with a state",
        ),
        (lambda: equilibria(pendulum, [0], [1]), "scene: expected a Scene"),
        (lambda: rest(starts=0), "starts: expected a whole number, at least 1, got 0"),
        (lambda: rest(starts=1.5), "starts: expected a whole number, at least 1, got 1.5"),
        (lambda: rest(starts=10**12), "starts: expected at most 1000000, got 1000000000000"),
        (lambda: rest(t=np.nan), "t: expected finite numbers"),
    ],
)
def test_invalid_arguments_are_refused_by_name(call, message):
    assert message in refusal(call)
