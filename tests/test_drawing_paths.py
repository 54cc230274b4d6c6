"""What is drawn of a motion: smooth curves, one path a body, units, rods; little is integrated."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap

from jaxdyn import Scene, Trajectory, effects, ledger, scenes, simulate
from jaxdyn.drawing.contents import CURVE, in_time, paths, segments
from jaxdyn.formulations.newton import FreePoints


def _motion(scene, ys):
    """Samples that were not integrated."""
    ts = jnp.linspace(0.0, 1.0, len(ys))
    return Trajectory(scene, ts, jnp.asarray(ys), jnp.array(1), jnp.array(0), jnp.array(0))


def _poses(scene):
    """Any states that the system can be in: rigid bodies stay rigid."""
    some = np.random.default_rng(2).normal(size=(12, len(scene.y0)))
    states = jax.jit(jax.vmap(scene.system.project))(jnp.zeros(12), jnp.asarray(some))
    return _motion(scene, states.at[0].set(scene.y0))


def _circle(samples):
    """One turn on the unit circle."""
    scene = scenes.hanging_spring(k=1.0, m=1.0, g=0.0)
    t = np.linspace(0.0, 2 * np.pi, samples)
    zero = 0 * t
    states = np.stack([np.cos(t), np.sin(t), zero, -np.sin(t), np.cos(t), zero], axis=1)
    return Trajectory(scene, jnp.asarray(t), states, jnp.array(1), jnp.array(0), jnp.array(0))


@pytest.mark.parametrize(("samples", "missed"), [(4, 3e-3), (7, 4e-5), (61, 1e-10)])
def test_the_curve_between_few_samples_is_the_motion(samples, missed):
    motion = _circle(samples)
    drawn = paths(motion)
    assert CURVE <= len(drawn.ts) < CURVE + samples
    exact = np.stack([np.cos(drawn.ts), np.sin(drawn.ts), 0 * drawn.ts], axis=1)
    assert gap(drawn.xyz[:, 0], exact) < missed
    every = (len(drawn.ts) - 1) // (samples - 1)
    assert gap(drawn.xyz[::every], motion.r) == 0
    assert gap(drawn.ts[::every], motion.ts) == 0


def test_as_many_samples_as_a_curve_needs_stay_as_they_are():
    motion = _circle(CURVE + 1)
    assert gap(paths(motion).xyz, motion.r) == 0


@pytest.mark.parametrize(
    ("name", "traced"),
    [
        ("double_pendulum", (1, 2)),  # not the hinge that rests, not the bars' middles
        ("n_pendulum", (1, 2, 3, 4)),
        ("top", (4,)),  # its axis, not the arms that spin
        ("turntable", (0, 1, 2)),  # the mass slides along the table
        ("three_body", (0, 1, 2)),
    ],
)
def test_the_paths_that_are_drawn(name, traced):
    scene = getattr(scenes, name)()
    if name == "top":
        turn = np.linspace(0.0, 1.0, 12)[:, None]
        # It leans by 0.5 and goes once round the vertical while it spins seven times.
        half = np.pi * turn
        spun = 7 * half
        quaternion = np.concatenate(
            [
                np.cos(0.25) * np.cos(half + spun),
                np.sin(0.25) * np.cos(half - spun),
                np.sin(0.25) * np.sin(half - spun),
                np.cos(0.25) * np.sin(half + spun),
            ],
            axis=1,
        )
        motion = _motion(scene, np.concatenate([quaternion, np.zeros((12, 3))], axis=1))
    else:
        motion = _poses(scene)
    assert paths(motion).traced == traced


@pytest.mark.parametrize("name", ["box", "feynman_plate", "satellite", "free_body"])
def test_a_rigid_body_has_one_path_and_its_edges(name):
    scene = getattr(scenes, name)()
    drawn = paths(_poses(scene))
    assert len(drawn.traced) == 1
    lengths = [np.linalg.norm(b - a) for a, b in segments(drawn, 0)]
    last = [np.linalg.norm(b - a) for a, b in segments(drawn, len(drawn.ts) - 1)]
    assert len(lengths) == len(scene.system.links()) > 2
    assert gap(lengths, last) < 10 * EXACT


def test_a_drawing_of_a_ledger_has_the_rods_of_its_system():
    scene = scenes.double_pendulum()
    assert scene.system.links() == ((0, 1), (1, 2))
    assert ledger.with_work(scene, effects.UniformGravity).system.links() == scene.system.links()


def test_bodies_that_keep_their_distances_without_rods_stay_several():
    scene = Scene(FreePoints([1.0, 1.0]), y0=np.zeros(8))
    turn = np.linspace(0.0, 3.0, 9)[:, None]
    r = np.concatenate([np.cos(turn), np.sin(turn), -np.cos(turn), -np.sin(turn)], axis=1)
    assert paths(_motion(scene, np.concatenate([r, 0 * r], axis=1))).traced == (0, 1)


def test_anchors_of_rods_stay_where_they_are():
    drawn = paths(_poses(scenes.pendulum()))
    for sample in (0, 700):
        (rod,) = segments(drawn, sample)
        assert gap(rod, np.stack([np.zeros(2), drawn.xyz[sample, 0]])) == 0


@pytest.mark.parametrize("name", ["cylinder_on_cylinder", "cylinder_on_ramp"])
def test_rims_move_with_the_cylinder_and_touch_what_they_roll_on(name):
    scene = getattr(scenes, name)(t1=0.6)
    drawn = paths(simulate(scene, samples=20))
    r = float(scene.system.r)
    for sample in (0, 700, len(drawn.ts) - 1):
        rim, arm, surface = segments(drawn, sample)[-3:]
        np.testing.assert_allclose(np.linalg.norm(rim - arm[0], axis=1), r, rtol=1e-6)
        if name == "cylinder_on_ramp":
            across = surface[1] - surface[0]
            gap_to_ramp = abs(
                across @ np.array([[0.0, 1.0], [-1.0, 0.0]]) @ (arm[0] - surface[0])
            ) / np.linalg.norm(across)
            np.testing.assert_allclose(gap_to_ramp, r, rtol=1e-6)
        else:
            fixed = np.linalg.norm(surface, axis=1)
            np.testing.assert_allclose(np.linalg.norm(arm[0]) - fixed, r, rtol=1e-6)


def test_units_are_said_unless_the_scene_has_none():
    eight = scenes.three_body()
    drawn = paths(_poses(eight))
    assert (drawn.labels, drawn.second) == (("x", "y"), "")
    solar = eight.without(effects.PairGravity) + effects.PairGravity(6.674e-11)
    drawn = paths(_poses(solar))
    assert (drawn.labels, drawn.second) == (("x [m]", "y [m]"), " s")


def test_a_state_without_points_is_drawn_itself():
    motion = simulate(scenes.lorenz(), 1.0, samples=5)
    drawn = paths(motion)
    assert (drawn.labels, drawn.second) == (("x", "y", "z"), "")
    assert gap(drawn.xyz[:: (len(drawn.ts) - 1) // 4, 0], motion.ys) == 0


def test_even_times_of_uneven_samples():
    uneven = simulate(scenes.cannonball(), samples=[0.0, 0.05, 0.1, 1.0])
    drawn = paths(uneven)
    at = in_time(drawn, 5)
    assert (at[0], at[-1]) == (0, len(drawn.ts) - 1)
    assert gap(drawn.ts[at], np.linspace(0, 1, 5)) < 1.0 / 666
    backwards = paths(simulate(scenes.cannonball(), -1.0, samples=20))
    assert gap(backwards.ts[in_time(backwards, 3)], np.array([0.0, -0.5, -1.0])) < 1e-3
