"""Two and three bodies on circles (problem 16), the figure-eight (17), many bodies in space."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap, refusal

from jaxdyn import scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.scenes.nbody import (
    EIGHT,
    EIGHT_PERIOD,
    three_body,
    three_body_circular,
    three_body_rate,
    two_body,
    two_body_period,
)


def test_problem_16_a_and_b_two_unequal_bodies():
    numbers = {"m1": 1.5, "m2": 4.0, "d": 0.7, "G": 3.0}
    scene = two_body(**numbers)
    period = two_body_period(**numbers)
    motion = simulate(scene, samples=[period / 4, period / 2, period], rtol=1e-13)
    start = np.asarray(scene.y0).reshape(4, 2)
    turned = np.stack([-start[:, 1], start[:, 0]], axis=-1).ravel()
    assert gap(motion.ys, [turned, -start.ravel(), start.ravel()]) < 100 * SOLVED
    r, _, m = scene.system.points(0.0, scene.y0)
    assert gap(jnp.linalg.norm(r[1] - r[0]), 0.7) < EXACT
    assert gap(m @ r, np.zeros(2)) < EXACT
    assert gap(energy.momentum(scene, 0.0, scene.y0), np.zeros(2)) < 10 * EXACT


def test_the_period_is_keplers_third_law():
    assert gap(two_body_period(m1=3e-6, m2=1.0, G=4 * np.pi**2) * np.sqrt(1 + 3e-6), 1.0) < EXACT
    slope = jax.grad(lambda d: jnp.log(two_body_period(d=d)))(2.0)
    assert gap(slope * 2.0, 1.5) < EXACT


def test_problem_16_c_the_rate_of_three_from_their_forces():
    scene = three_body_circular()
    w = three_body_rate()
    r, v, _ = scene.system.points(0.0, scene.y0)
    rate = scene.rate(0.0, scene.y0)
    assert gap(jnp.linalg.norm(r, axis=1), np.full(3, 1.5)) < EXACT  # d = 3 is a diameter
    assert gap(rate[6:].reshape(3, 2), -(w**2) * r) < 10 * EXACT
    assert gap(rate[:6].reshape(3, 2), v) == 0
    assert abs(float(w) - 1.3079) < 1e-4


@pytest.mark.slow
def test_problem_16_d_it_turns_then_breaks_up_at_the_rate_of_its_instability():
    scene = three_body_circular()
    turn = 2 * np.pi / float(three_body_rate())
    ts = turn * np.array([1.0, 2.0, 3.0, 12.0])
    motion = simulate(scene, ts[-1], samples=ts, rtol=1e-13)
    off = np.max(np.abs(np.asarray(motion.ys - scene.y0[None])), axis=1)
    assert off[0] < 1e-10
    assert off[3] > 0.1
    # A disturbance grows like e^(w t / sqrt(2)), by 85 a turn (Routh): the monodromy of a
    # turn, without the directions that only drift, has that for its largest multiplier.
    one = jax.jacfwd(lambda y: simulate(scene.starting(y), turn, samples=1, rtol=1e-12).ys[-1])
    largest = np.max(np.abs(np.linalg.eigvals(np.asarray(one(scene.y0)))))
    assert abs(largest / np.exp(2 * np.pi / np.sqrt(2)) - 1) < 1e-6


def test_problem_17_the_eight_closes_to_the_digits_printed():
    motion = simulate(three_body(), samples=1, rtol=1e-12)
    assert gap(motion.ys[-1], motion.scene.y0) < 1e-6


@pytest.mark.slow
def test_problem_17_c_and_d_small_changes_keep_the_eight_and_large_ones_break_it_up():
    change = np.random.default_rng(17).normal(size=(2, 3, 2))
    change -= change.mean(axis=1, keepdims=True)  # the centre of mass stays at rest
    change = change.ravel() / np.linalg.norm(change)
    reach = {}
    # Rounding in the encounters of the last one leaves 5e-12 to 1.4e-10, over the last digits of
    # its start, with each method.
    for size, bar in ((0.0, 1e-12), (1e-3, 1e-12), (0.2, 1e-9)):
        scene = three_body(np.asarray(EIGHT) + size * change)
        motion = simulate(scene, 10 * EIGHT_PERIOD, samples=400, rtol=1e-12)
        assert float(energy.drift(motion)) < bar
        reach[size] = float(np.abs(motion.r).max())
    assert abs(reach[1e-3] - reach[0.0]) < 1e-3
    assert reach[0.2] > 4 * reach[0.0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: scenes.two_body(d=-1.0), "d: expected > 0, got -1.0"),
        (lambda: scenes.two_body(m1=-5.0), "m1: expected >= 0, got -5.0"),
        (lambda: scenes.two_body(G=0.0), "G: expected > 0, got 0.0"),
        (lambda: scenes.three_body_circular(diameter=0.0), "diameter: expected > 0, got 0.0"),
        (lambda: scenes.three_body_circular(m=-1.0), "m: expected > 0, got -1.0"),
        (lambda: scenes.n_body(m=[1.0, 2.0]), "m: expected shape (3,), got shape (2,)"),
        (lambda: scenes.n_body([1.0, 2.0]), "r: expected shape (any, 3), or (any, 2) in a plane,"),
        (
            lambda: scenes.n_body([[1.0, 2.0]]),
            "v: expected shape (1, 2), got shape (3, 3). One row",
        ),
        (lambda: scenes.n_body(names="ab").check(), "names: expected 3 different ones, one for"),
        (lambda: scenes.n_body(names="aba").check(), "names: expected 3 different ones, one for"),
        (lambda: scenes.n_body(names=[1, 2, 3]).check(), "names: expected 3 different ones"),
    ],
)
def test_an_invalid_start_is_refused_by_name(make, message):
    assert refusal(make).startswith(message)


def test_a_traced_distance_passes_the_checks():
    slope = jax.grad(lambda d: scenes.two_body(d=d).t1)(1.0)
    np.testing.assert_allclose(slope, 1.5 * scenes.two_body().t1, rtol=1e-14)


def test_the_published_trio_in_space_returns_with_zero_momentum():
    motion = simulate(scenes.n_body(), rtol=1e-13)
    assert gap(motion.ys[-1], motion.ys[0]) < 1e-10  # printed to 15 digits
    points = motion.scene.points(0.0, motion.scene.y0)
    assert np.abs(points.m @ points.v).max() < 1e-16


def test_bodies_in_a_plane_move_as_those_of_three_body():
    other = scenes.three_body(m=(1.0, 2.0, 3.0), G=2.0)
    r, v, m = other.points(0.0, other.y0)
    scene = scenes.n_body(r, v, m=m, G=2.0)
    assert scene.labels() == other.labels()
    assert gap(scene.rate(0.0, scene.y0), other.rate(0.0, other.y0)) == 0.0


@pytest.mark.slow
def test_many_bodies_in_space_by_name():
    rng = np.random.default_rng(0)
    r, v = rng.normal(size=(2, 5, 3))
    names = ["Sun", "Mercury", "Venus", "Earth", "Mars"]
    scene = scenes.n_body(r, v, m=np.arange(1.0, 6.0), G=2.0, names=names, t1=0.1)
    scene.check()
    apart = r[None] - r[:, None]
    far = np.linalg.norm(apart, axis=-1) + np.eye(5)
    pull = 2.0 * (np.arange(1.0, 6.0)[:, None] * apart / far[..., None] ** 3).sum(axis=1)
    assert gap(scene.rate(0.0, scene.y0)[15:], pull.ravel()) < 1e-12 * np.abs(pull).max()
    motion = simulate(scene, samples=3)
    assert gap(motion["vz_Earth"][0], v[3, 2]) == 0.0


@pytest.mark.parametrize("make", [scenes.three_body, scenes.two_body, scenes.n_body])
def test_units_of_length_mass_and_time_have_names(make):
    scene = make(units=("AU", "Msun", "day"))
    assert {unit for _, unit in scene.labels()} == {"AU", "AU/day"}
    assert np.array_equal(scene.y0, make().y0)
    assert make().units is make(units=[]).units is None
    for wrong in (("AU", "day"), "day", ("AU", "M sun", "day")):
        said = refusal(lambda wrong=wrong: simulate(make(units=wrong), 1.0))
        assert "units: expected names of the units of length, mass and time" in said


def test_bodies_about_their_centre_of_mass():
    rng = np.random.default_rng(3)
    r, v, m = rng.normal(size=(4, 3)), rng.normal(size=(4, 3)), np.array([1.0, 2.0, 0.0, 0.5])
    scene = scenes.n_body(r, v, m=m, t1=0.3)
    here = scenes.barycentric(scene)
    points = here.system.points(0.0, here.y0)
    assert gap(m @ points.r, np.zeros(3)) < 10 * EXACT
    assert gap(energy.momentum(here, 0.0, here.y0), np.zeros(3)) < 10 * EXACT
    # Koenig: the energy is less by that of the centre of mass.
    before, after = (float(energy.energy(s, 0.0, s.y0)) for s in (scene, here))
    assert gap(before - after, 0.5 * np.sum((m @ v) ** 2) / m.sum()) < 10 * EXACT
    # Seen from the centre of mass, which moves uniformly, the motion is the same.
    end, other = (simulate(s, samples=2, rtol=1e-13).ys[-1] for s in (scene, here))
    r0, v0 = m @ r / m.sum(), m @ v / m.sum()
    uniform = np.concatenate([np.tile(r0 + 0.3 * v0, 4), np.tile(v0, 4)])
    assert gap(end - uniform, other) < 10 * SOLVED
    slope = jax.jit(jax.jacfwd(lambda m: scenes.barycentric(scenes.n_body(r, v, m=m)).y0))(m)
    assert gap(slope[:3, 0], -(r[0] - r0) / m.sum()) < 10 * EXACT


def test_only_free_points_have_a_barycentric_scene():
    with pytest.raises(ValueError, match="scene: expected free points, got "):
        scenes.barycentric(scenes.pendulum())
