"""Scales of a motion: they change with units as the motion does, and an entry at zero has one."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from units import rewritten

import jaxdyn
from jaxdyn import effects, scales, scenes
from jaxdyn.analysis.regularized import regularize
from jaxdyn.hard.cases.encounters import pythagorean
from jaxdyn.integrate.events import Reaches


def coupled(t, y):
    return [y[1], -y[0] - y[0] ** 3 + y[2] + jnp.cos(2 * t), y[0] * y[1] - 0.3 * y[2]]


def chain(t, y):
    del t
    return jnp.roll(y, 1) - 2 * y + jnp.roll(y, -1)


def start(scene):
    groups = scales.groups(scene.system)
    at = jax.jit(lambda field, y0, t1: scales.at_start(field, groups, jnp.zeros(()), y0, t1))
    found, rate = at(scene.field, scene.y0, scene.t1)
    np.testing.assert_allclose(rate, scene.rate(jnp.zeros(()), scene.y0), rtol=1e-14)
    return np.asarray(found.sizes), float(found.time)


def test_the_scales_at_a_start_change_with_units_as_the_motion_does():
    scene = jaxdyn.ode(coupled, [0.7, 0.0, 0.0], 10.0)
    sizes, time = start(scene)
    for seed in range(3):
        rewriting = rewritten(scene, seed)
        found, time_there = start(rewriting.scene)
        np.testing.assert_allclose(found, rewriting.y * sizes, rtol=1e-13)
        assert time_there == pytest.approx(rewriting.t * time, rel=1e-13)


def test_an_entry_at_zero_has_the_size_that_others_give_to_it():
    # By a coupling, by a product of two entries that are zero at the start, and along a chain.
    assert (start(jaxdyn.ode(coupled, [0.7, 0.0, 0.0], 10.0))[0] > 1e-3).all()
    assert (start(jaxdyn.ode(coupled, [0.0, 0.0, 0.0], 10.0))[0] > 1e-3).all()
    assert (start(jaxdyn.ode(chain, [1.0, *[0.0] * 40], 10.0))[0] > 0).all()


def test_the_time_is_that_of_the_fastest_rate():
    for k in (1e-6, 1.0, 1e6):
        _, time = start(scenes.oscillator(k=k, t1=1e4))
        assert time == pytest.approx(k**-0.5, rel=0.3)


def test_a_motion_that_is_about_to_turn_has_the_scales_of_one_that_turns():
    turning = start(scenes.oscillator(v=0.0))
    for v in (1e-14, -1e-9, 1e-4, -1e-2):
        sizes, time = start(scenes.oscillator(v=v))
        np.testing.assert_allclose(sizes, turning[0], rtol=1e-3)
        assert time == pytest.approx(turning[1], rel=1e-3)


def driven(t, y, k):
    # Three masses and springs in a row, from rest: the rate at the start is zero.
    x = jnp.concatenate([jnp.zeros(1), y[:3], y[2:3]])
    force = jnp.array([0.0, 0.0, 25.0]) * jnp.sin(6 * t)
    return jnp.concatenate([y[3:], k * (x[2:] - 2 * x[1:-1] + x[:-2]) + force])


METRES = [(f"{x}{i}", unit) for x, unit in (("x", "m"), ("v", "m/s")) for i in range(3)]


@pytest.mark.parametrize("names", [None, METRES])
def test_a_drive_that_is_zero_at_the_start_says_how_large_a_motion_from_rest_becomes(names):
    for k, span in ((200.0, 10.0), (200.0, 1e6), (1e6, 10.0)):
        sizes, time = start(jaxdyn.ode(driven, np.zeros(6), span, params=k, names=names))
        assert 0.3 < time * k**0.5 < 3.0
        assert 1e-3 < (sizes[3:] * k / 150.0).max() < 100.0
    # An entry that moves by itself, here a clock, does not hide that all others are at rest.
    clock = jaxdyn.ode(lambda t, y: [1.0, *driven(t, y[1:], 200.0)], np.zeros(7), 1e3)
    assert start(clock)[0][1:].max() < 100.0


@pytest.mark.parametrize("names", [None, METRES])
def test_a_drive_that_is_zero_at_the_start_has_digits_and_derivatives(names):
    def end(k, t1):
        return jaxdyn.solve(jaxdyn.ode(driven, np.zeros(6), t1, params=k, names=names), t1).y1[0]

    def exact(k, t1):
        squares, shapes = np.linalg.eigh(k * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1.0]]))
        own = np.sqrt(squares)
        parts = np.sin(6 * t1) - 6 / own * np.sin(own * t1)
        return (shapes[0] * shapes[2] * 25.0 / (squares - 36.0)) @ parts

    found = end(200.0, 100.0)
    np.testing.assert_allclose(found, exact(200.0, 100.0), rtol=1e-8)
    slope = (exact(200.001, 100.0) - exact(199.999, 100.0)) / 0.002
    np.testing.assert_allclose(jax.jacfwd(end)(200.0, 100.0), slope, rtol=1e-6)


def test_a_force_that_jumps_at_the_start_is_no_rounding():
    # Its tolerance would be as large as the jump: no digit would be right, without a warning.
    pulled = scenes.particle(position=(2.0, 0.3), velocity=(0.0, 0.0), t1=1.0)
    pulled = pulled + effects.DryFriction(0.5, 10.0) + effects.ConstantForce([6.0, 0.0])
    rubbed = scenes.oscillator(t1=1.0) + effects.DryFriction(0.3, 1.0)
    kicked = scenes.spring_mass(position=(0, 0), velocity=(3, 0), k=4.0, g=0.0, t1=1.0)
    ends = (
        (pulled, [2.5, 0.3, 1.0, 0.0]),
        (rubbed, [0.3 + 0.7 * np.cos(1), -0.7 * np.sin(1)]),
        (kicked, [0.5 - 0.5 * np.cos(2) + 1.5 * np.sin(2), 0.0, np.sin(2) + 3 * np.cos(2), 0.0]),
    )
    for scene, end in ends:
        np.testing.assert_allclose(jaxdyn.simulate(scene).ys[-1], end, atol=1e-9)


# From rest nearer to the anchor, where rounding of the start decides the direction, there is none.
@pytest.mark.parametrize(
    ("speed", "distance"),
    [(3.0, 0.0), (3.0, 2e-16), (3.0, 1e-12), (0.0, 1e-10), (0.0, 1e-8)],
    ids=range(5),
)
def test_a_force_that_turns_within_roundings_of_the_start_is_no_rounding(speed, distance):
    anchor, along, k, length, t1 = np.array([0.7, 0.3]), np.array([0.6, 0.8]), 45.0, 0.5, 0.6
    scene = scenes.particle(
        position=anchor + distance * along, velocity=speed * along, t1=t1
    ) + effects.Spring(k, length, anchor=anchor)
    scene = scene + effects.Spring(4.0, anchor=anchor + along)
    groups, zero = scales.groups(scene.system), jnp.zeros(())
    found, rate = scales.at_start(scene.field, groups, zero, scene.y0, scene.t1)
    assert np.max(found.noise) < 1e-9 * np.max(np.abs(rate))
    omega = np.sqrt(k + 4.0)
    rest = (k * length + 4.0) / omega**2
    away = (distance - rest) * np.cos(omega * t1) + speed / omega * np.sin(omega * t1)
    end = jaxdyn.simulate(scene).ys[-1, :2]
    np.testing.assert_allclose(end, anchor + (rest + away) * along, atol=1e-7 if speed else 3e-6)


@pytest.mark.slow  # it compiles for 4 s
@pytest.mark.parametrize("long", [1.0, 1e6])
def test_a_plain_rate_that_turns_at_the_start_is_no_rounding(long):
    anchor, along = long * np.array([0.7, 0.3]), np.array([0.6, 0.8])

    def pull(t, y):
        del t
        off = y[:2] - anchor
        square = jnp.sum(off**2)
        length = jnp.sqrt(jnp.where(square > 0, square, 1.0))
        return jnp.concatenate([y[2:], jnp.where(square > 0, 0.3 * long / length - 1.0, 0.0) * off])

    motion = jaxdyn.simulate(jaxdyn.ode(pull, [*anchor, *(0.4 * long * along)]), 3.0)
    away = long * (0.3 - 0.3 * np.cos(3.0) + 0.4 * np.sin(3.0))
    np.testing.assert_allclose(motion.ys[-1, :2], anchor + away * along, rtol=1e-9)


def test_nothing_that_depends_on_the_state_leaves_the_span():
    sizes, time = start(jaxdyn.ode(lambda t, y: [3.0, 0.0], [0.0, 0.0], 5.0))
    assert time == 5.0
    np.testing.assert_array_equal(sizes, [15.0, 0.0])


def test_entries_of_one_unit_share_a_size_and_angles_are_known_by_the_radian():
    groups = scales.groups(scenes.double_pendulum().system)
    assert groups.group_of == (0, 0, 1, 1)
    np.testing.assert_array_equal(groups.sizes(jnp.array([9.0, 2.0, 3.0, 4.0])), [1, 1, 4, 4])
    assert len(set(scales.groups(scenes.three_body().system).group_of)) == 2


@pytest.mark.sample("scene2")
@pytest.mark.parametrize(
    "scene", [scenes.pendulum(), scenes.double_pendulum(), scenes.two_body(), scenes.spring_mass()]
)
def test_a_span_that_is_a_mere_limit_changes_nothing(scene):
    near = start(dataclasses.replace(scene, t1=jnp.asarray(10.0)))
    for far in (1e5, 1e20, 1e150):
        found = start(dataclasses.replace(scene, t1=jnp.asarray(far)))
        np.testing.assert_allclose(found[0], near[0], rtol=1e-4)
        assert found[1] == pytest.approx(near[1], rel=1e-4)


#: Starts where some entry hardly moves, as an event leaves them: at the bottom, at a turn, nearly
#: upright.
@pytest.mark.parametrize("y0", [[1e-17, 1.0], [-1e-13, 1.0], [1.0, 1e-17], [3.1, 1e-15]])
@pytest.mark.parametrize("far", [1e9, 1e20, 1e150])
def test_a_span_that_is_a_mere_limit_changes_nothing_beside_a_turn(y0, far):
    scene = scenes.pendulum().starting(jnp.array(y0))
    near = start(dataclasses.replace(scene, t1=jnp.asarray(10.0)))
    found = start(dataclasses.replace(scene, t1=jnp.asarray(far)))
    np.testing.assert_allclose(found[0], near[0], rtol=1e-4)
    assert found[1] == pytest.approx(near[1], rel=1e-4)


def test_an_event_is_as_accurate_however_far_the_limit():
    scene = scenes.oscillator(k=4.0).starting(jnp.array([1e-13, -2.0]))
    turn = jaxdyn.until(scene, Reaches(1, 0.0), 1e15)
    assert abs(float(turn.t) - np.pi / 4) < 1e-11  # the default tolerance


def test_a_span_that_is_a_mere_limit_changes_nothing_from_rest_in_logarithmic_time():
    # Speeds that grew for such a span would stop the bodies, since slowness is 1 / (T - E).
    slow = regularize(pythagorean())
    near = start(dataclasses.replace(slow, t1=jnp.asarray(100.0)))
    for far in (1e8, 1e150):
        found = start(dataclasses.replace(slow, t1=jnp.asarray(far)))
        np.testing.assert_allclose(found[0], near[0], rtol=1e-6)
        assert found[1] == pytest.approx(near[1], rel=1e-6)


def test_the_time_of_an_angle_is_that_of_its_motion_in_every_unit_of_time():
    slow = start(scenes.pendulum(g=1e-6, t1=1e4))
    fast = start(scenes.pendulum(g=1e6, t1=1e-2))
    assert slow[1] == pytest.approx(1e6 * fast[1], rel=1e-6)
    np.testing.assert_allclose(slow[0], fast[0] * [1, 1e-6], rtol=1e-6)


def test_a_second_order_state_without_units_has_places_and_velocities():
    def fall(t, y):
        return jnp.concatenate([y[2:], -y[:2]])

    plain, second = (jaxdyn.ode(fall, [1.0, 0, 0, 1.0], second_order=is_) for is_ in (False, True))
    assert scales.groups(plain.system).group_of == (0, 1, 2, 3)
    assert scales.groups(second.system).group_of == (0, 0, 1, 1)


def test_long_states_have_the_groups_of_short_ones():
    many = scales.Groups(tuple([0, 1] * 40), tuple([np.inf] * 80))
    x = jnp.arange(80.0)
    np.testing.assert_array_equal(many.largest(x), np.tile([78.0, 79.0], 40))
