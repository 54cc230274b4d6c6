"""A body on skates: two routes, closed forms, and what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap, refusal

from jaxdyn import scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.scenes.skates import (
    by_lagrange,
    elementary_motion,
    meeting_point,
    one_skate,
    two_skates,
)

TIMES = np.linspace(0.0, 10.0, 21)
#: The skate off the blade's line through the centre as well: no symmetry left.
ODD = one_skate(m=2.0, inertia=0.7, at=(0.4, -0.3), heading=0.8, speed=1.1, spin=-0.6)
TWO = two_skates(m=2.0, inertia=0.7)
PARALLEL = two_skates(at=((1.0, 0.2), (-0.5, 0.3)), headings=(0.4, 0.4))


@pytest.fixture(scope="module", params=[ODD, TWO, PARALLEL], ids=["one", "two", "parallel"])
def motion(request):
    return simulate(request.param, samples=TIMES, rtol=1e-13)


@pytest.mark.slow
def test_newton_euler_and_lagrange_agree(motion):
    scene = by_lagrange(motion.scene)
    assert gap(simulate(scene, samples=TIMES, rtol=1e-13).ys, motion.ys) < 1e-11
    # And where nothing is integrated: the rates, with their multipliers.
    for y in motion.ys[::5]:
        assert gap(scene.rate(0.0, y), motion.scene.rate(0.0, y)) < 10 * EXACT


@pytest.mark.sample("parallel")
def test_skates_do_no_work_and_do_not_slip(motion):
    assert energy.drift(motion) < SOLVED
    rows = jax.vmap(lambda y: motion.scene.system.violation(0.0, y)[1])(motion.ys)
    assert gap(rows, 0 * rows) < EXACT


def test_a_skate_at_the_centre_of_mass_goes_round_a_circle():
    scene = one_skate(heading=0.3, speed=2.0, spin=0.5)
    ys = simulate(scene, samples=TIMES, rtol=1e-13).ys
    angle = 0.3 + 0.5 * TIMES
    assert gap(ys[:, 0], 4 * (np.sin(angle) - np.sin(0.3))) < 10 * SOLVED
    assert gap(ys[:, 1], -4 * (np.cos(angle) - np.cos(0.3))) < 10 * SOLVED


def test_a_skate_behind_the_centre_turns_until_it_glides_straight():
    # With the blade a behind the centre and J = I + m a^2: v' = a w^2, J w' = -m a v w, so
    # v = u tanh(k t), w = u sqrt(m/J) sech(k t) with k = m a u / J, started here at t = -3.
    m, inertia, a, u = 2.0, 0.7, 0.5, 1.3
    j = inertia + m * a * a
    k = m * a * u / j

    def closed(t):
        return u * np.tanh(k * t), u * np.sqrt(m / j) / np.cosh(k * t)

    speed, spin = closed(-3.0)
    scene = one_skate(m=m, inertia=inertia, at=(-a, 0.0), speed=speed, spin=spin)
    ys = simulate(scene, samples=TIMES, rtol=1e-13).ys
    v, w = closed(TIMES - 3.0)
    along = ys[:, 3] * np.cos(ys[:, 2]) + ys[:, 4] * np.sin(ys[:, 2])
    assert gap(along, v) < 10 * SOLVED
    assert gap(ys[:, 5], w) < 10 * SOLVED
    # The angle is the Gudermannian: it turns by pi sqrt(J/m) / a in all.
    turned = np.sqrt(j / m) / a * (2 * np.arctan(np.tanh(k * (TIMES - 3.0) / 2)))
    assert gap(ys[:, 2], turned - turned[0]) < 10 * SOLVED


@pytest.mark.parametrize("scene", [TWO, PARALLEL])
def test_two_skates_move_by_elementary_means(scene):
    ys = simulate(scene, samples=TIMES, rtol=1e-13).ys
    assert gap(ys, elementary_motion(scene, TIMES)) < 10 * SOLVED


def test_two_skates_turn_about_the_meeting_point_of_their_normals():
    body = TWO.system.mechanism
    centre = meeting_point(TWO)
    # Both normals pass through it: the line to each skate is across its blade.
    along = np.stack([np.cos(body.headings), np.sin(body.headings)], axis=-1)
    assert gap(np.sum(along * (centre[None] - body.at), axis=-1), [0, 0]) < EXACT
    ys = elementary_motion(TWO, TIMES)
    distance = np.linalg.norm(np.asarray(ys[:, :2]) - np.asarray(centre), axis=1)
    assert gap(distance, np.full_like(distance, distance[0])) < EXACT
    # Parallel blades go straight on, along the blades.
    assert abs(PARALLEL.y0[5]) < EXACT
    assert abs(np.arctan2(PARALLEL.y0[4], PARALLEL.y0[3]) % np.pi - 0.4) < EXACT
    assert not (np.abs(meeting_point(PARALLEL)) < 1e14).any()


def test_a_start_that_slips_is_refused_and_the_nearest_offered():
    wrong = TWO.starting(TWO.y0 + jnp.array([0, 0, 0, 0.1, 0.2, -0.1]))
    with pytest.raises(ValueError, match="y0: expected a start that satisfies the constr") as info:
        simulate(wrong)
    offered = TWO.system.nearest(0.0, wrong.y0)
    numbers = [float(f"{x:.12g}") for x in offered]
    assert f"The nearest one that does is {numbers}" in str(info.value)
    TWO.starting(offered).check()
    # Nearest in kinetic energy: what was taken away is orthogonal to what is allowed.
    mass = np.array([2.0, 2.0, 0.7])
    removed = np.asarray(wrong.y0 - offered)[3:]
    assert abs(np.sum(mass * removed * np.asarray(TWO.y0)[3:])) < EXACT
    assert gap(offered[:3], TWO.y0[:3]) == 0


@pytest.mark.parametrize("nudge", [0.0, 1e-8])
def test_skates_on_a_common_normal_are_refused(nudge):
    # Parallel, and across the line that joins them.
    scene = two_skates(at=((0.0, 1.0), (0.0, -1.0)), headings=(nudge, 0.0))
    with pytest.raises(ValueError, match=r"skates: expected .* common normal .*condition number"):
        simulate(scene)


def test_nearly_common_normals_are_all_right():
    scene = two_skates(at=((0.0, 1.0), (0.0, -1.0)), headings=(1e-3, 0.0))
    ys = simulate(scene, samples=TIMES, rtol=1e-13).ys
    assert gap(ys, elementary_motion(scene, TIMES)) < 1e-9


def test_impossible_bodies_are_refused():
    with pytest.raises(ValueError, match=r"inertia: expected > 0, got -1\.0"):
        simulate(one_skate(inertia=-1.0))
    with pytest.raises(ValueError, match=r"mass: expected > 0"):
        simulate(one_skate(m=-1.0))


@pytest.mark.parametrize(
    ("at", "headings"),
    [
        (((1.0, 0.0), (-0.5, 0.3)), (0.4, -0.2)),
        (((1.0, 0.0), (-1.0, 0.0)), (0.3, -0.3)),
        (((0.5, 0.2), (-0.5, 0.2)), (0.4, 0.4)),  # straight on
        (((0.3, 0.1), (-0.7, 0.2)), (2.5, -1.0)),
    ],
)
def test_a_positive_speed_moves_the_first_skate_forwards(at, headings):
    for speed in (2.0, -2.0):
        scene = two_skates(at=at, headings=headings, speed=speed)
        vx, vy, omega = scene.y0[3:]
        (x, y), angle = at[0], headings[0]
        along = (vx - omega * y) * np.cos(angle) + (vy + omega * x) * np.sin(angle)
        assert along * speed > 0.1


def test_one_skate_and_two_go_the_same_way():
    # Both blades at the centre's height along x: two conditions that one skate at rest in spin has.
    two = two_skates(at=((1.0, 0.0), (-1.0, 0.0)), headings=(0.0, 0.0), speed=2.0)
    one = one_skate(speed=2.0, spin=0.0)
    assert gap(two.y0, one.y0) < EXACT


def test_a_body_that_turns_about_its_first_skate_moves_the_second_forwards():
    # The normals meet at the first skate: it turns on the spot, and the second goes round it.
    scene = two_skates(at=((0.0, 0.0), (1.0, 0.0)), headings=(0.3, np.pi / 2), speed=1.0)
    assert scene.y0[5] > 0
    assert two_skates(at=((0.0, 0.0), (1.0, 0.0)), headings=(0.3, -np.pi / 2)).y0[5] < 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: scenes.one_skate(at=1.0), r"at: expected shape (2,), got shape ()"),
        (lambda: scenes.one_skate(at=((1.0, 0.0), (2.0, 0.0))), "at: expected shape (2,)"),
        (lambda: scenes.one_skate(heading=(1.0, 2.0)), "heading: expected shape ()"),
        (lambda: scenes.two_skates(at=(1.0, 0.0)), "at: expected shape (2, 2)"),
        (lambda: scenes.two_skates(headings=(1.0,)), "headings: expected shape (2,)"),
    ],
)
def test_an_invalid_start_is_refused_by_name(make, message):
    assert refusal(make).startswith(message)
