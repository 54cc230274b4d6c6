"""Problems 7, 47 and 49: drawings that move without distortion, where they should be."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import simulate
from jaxdyn.effects import UniformGravity
from jaxdyn.geometry.euler import matrix_from_euler
from jaxdyn.geometry.rotations import matrix_from_axis_angle
from jaxdyn.geometry.vectors import plane_rotation
from jaxdyn.scenes.drawings import HOUSE, HOUSE_LINES, moved_box, moved_shape, turned_box


def _lengths(r):
    """(s, p, p) distances of all pairs of points."""
    return np.linalg.norm(r[:, :, None] - r[:, None, :], axis=-1)


@pytest.mark.slow
@pytest.mark.parametrize("make", [moved_shape, turned_box, moved_box])
def test_nothing_is_distorted_and_the_motion_is_smooth(make):
    motion = simulate(make(), samples=200, rtol=1e-12)
    r = np.asarray(motion.r)
    assert np.ptp(_lengths(r), axis=0).max() < SOLVED
    assert np.linalg.norm(np.diff(r, axis=0), axis=-1).max() < 0.3
    lines = [np.asarray(x.at) for x in motion.scene.sketch(0.0, motion.ys[0]) if x.kind == "line"]
    ends = np.concatenate([line.reshape(-1, r.shape[2]) for line in lines])
    apart = np.abs(ends[:, None] - r[0]).max(axis=-1)
    assert apart.min(axis=0).max() < EXACT  # every point is drawn
    assert apart.min(axis=1).max() < EXACT


def test_problem_7_a_house_on_a_figure_of_eight():
    motion = simulate(moved_shape(reach=(2.0, 1.0), frequency=1.5, spin=0.7), 4.0, rtol=1e-12)
    t = np.asarray(motion.ts)
    assert gap(motion["x"], 2 * np.sin(1.5 * t)) < SOLVED * 10
    assert gap(motion["y"], np.sin(3 * t)) < SOLVED * 10
    assert gap(motion["theta"], 0.7 * t) < SOLVED * 10
    expected = motion.ys[-1:, :2] + jnp.asarray(HOUSE) @ plane_rotation(jnp.asarray(2.8)).T
    assert gap(motion.r[-1], expected) < SOLVED * 10
    assert len(HOUSE_LINES) == len(set(HOUSE_LINES))


def test_problem_47_a_third_of_a_turn_about_111_permutes_the_axes():
    motion = simulate(turned_box(sides=(1.0, 2.0, 3.0), rate=2.0), np.pi / 3, rtol=1e-12)
    first, last = np.asarray(motion.r[0]), np.asarray(motion.r[-1])
    assert gap(last, first[:, [2, 0, 1]]) < SOLVED  # x comes from z, y from x, z from y
    line = np.asarray(motion.r[:, 8:])
    assert np.ptp(line, axis=0).max() < SOLVED  # the axis stays where it is
    assert gap(np.cross(line[0, 1], np.ones(3)), np.zeros(3)) < EXACT * 10


@pytest.mark.parametrize("i", range(3))
def test_problem_49_roll_pitch_and_yaw_one_at_a_time(i):
    swings = np.zeros(3)
    swings[i] = 1.1
    motion = simulate(moved_box(swings=swings), 0.8, rtol=1e-12)
    axis, angle = jnp.eye(3)[i], 1.1 * np.sin((i + 1) * 0.8)
    expected = motion.r[0] @ matrix_from_axis_angle(axis, angle).T
    assert gap(motion.r[-1], expected) < SOLVED * 10


def _spun(t):
    return 0.3 * t, jnp.sin(t), t**2


def test_problem_49_three_functions_of_time():
    motion = simulate(moved_box(angles=_spun, sequence="ZXZ"), 0.8, rtol=1e-12)
    expected = motion.r[0] @ matrix_from_euler(jnp.stack(_spun(jnp.asarray(0.8))), "ZXZ").T
    assert gap(motion.r[-1], expected) < SOLVED * 10


class Spun(eqx.Module):
    """Turns about one axis at a rate."""

    rate: float

    def __call__(self, t):
        return self.rate * t, 0.0, 0.0


def test_the_numbers_of_a_module_of_angles_are_numbers_of_the_scene():
    def corner(rate):
        return simulate(moved_box(angles=Spun(rate), t1=2.0), rtol=1e-12).r[-1, 6]

    start = np.asarray(corner(0.0))
    matrix = plane_rotation(jnp.asarray(0.6))
    assert gap(corner(0.3)[1:], matrix @ start[1:]) < SOLVED * 10
    across = np.array([-corner(0.3)[2], corner(0.3)[1]])
    assert gap(jax.jacfwd(corner)(0.3)[1:], 2.0 * across) < SOLVED * 10


def test_problem_7_any_drawing():
    corners = np.array([[0.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    scene = moved_shape(corners=corners)
    (drawn, _) = scene.sketch(0.0, scene.y0)
    assert gap(drawn.at, corners[[[0, 1], [1, 2], [2, 0]]]) == 0
    assert moved_shape(corners=corners, joined=[(0, 2)]).system.mechanism.joined == ((0, 2),)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: moved_shape(corners=[1.0, 2.0]), "corners: expected shape"),
        (lambda: moved_shape(joined=[(0, 99)]), "joined: expected pairs of numbers from 0 to 8"),
        (lambda: moved_shape(joined=[0, 1]), "joined: expected pairs"),
        (lambda: moved_box(angles=3.0), "angles: expected a function of time, got 3.0"),
        (lambda: moved_box(angles=lambda t: (t, t)), "returns three angles, got shape"),
    ],
)
def test_drawings_that_cannot_be_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_problem_49_all_three_are_the_product_of_problem_48():
    scene = moved_box(swings=(0.3, -0.7, 1.9), frequencies=(1.0, 2.0, 0.5))
    motion = simulate(scene, 1.3, rtol=1e-12)
    x, y, z = 0.3 * np.sin(1.3), -0.7 * np.sin(2.6), 1.9 * np.sin(0.65)
    X, Y, Z = jnp.eye(3)
    net = matrix_from_axis_angle(Z, z) @ matrix_from_axis_angle(Y, y) @ matrix_from_axis_angle(X, x)
    assert gap(motion.r[-1], motion.r[0] @ net.T) < SOLVED * 10
    assert gap(motion["angle2_dot"], -1.4 * np.cos(2 * motion.ts)) < SOLVED * 10


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: simulate(turned_box(axis=(0.0, 0.0, 0.0))), "axis: expected a direction"),
        (lambda: moved_box(sequence="abc"), "sequence: expected one of"),
        (lambda: moved_box(swings=(1.0,)), "swings: expected shape"),
        (lambda: moved_shape(reach=(1.0,)), "reach: expected shape"),
        (
            lambda: simulate(moved_shape() + UniformGravity(1.0)),
            "UniformGravity: expected an effect",
        ),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
