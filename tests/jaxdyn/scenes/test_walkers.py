"""Walkers down a slope against closed forms and published gaits."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED
from scipy.integrate import quad, solve_ivp

from jaxdyn import scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.integrate import phases
from jaxdyn.scenes.corners import has_corners


def _motion(scene, t1, **options):
    return phases.simulate_phases(scenes.phases_of(scene), None, scene.y0, t1, **options)


def test_a_rimless_wheel_settles_to_the_published_gait():
    motion = _motion(scenes.rimless_wheel(), 120.0, samples=2)
    after = [float(piece.ys[0, 1]) for piece in motion.pieces]
    assert abs(after[-1] - 0.3497543674325097) < 1e-11
    # The square of the angular velocity is mapped linearly, with the multiplier 1/2.
    off = np.array(after[:9]) ** 2 - 0.3497543674325097**2
    np.testing.assert_allclose(off[1:] / off[:-1], 0.5, rtol=1e-8)


@pytest.mark.parametrize("numbers", [{"spokes": 10, "slope": 0.06, "length": 0.3, "g": 9.81}])
def test_its_gait_has_the_closed_form(numbers):
    a = math.pi / numbers["spokes"]
    pull = numbers["g"] / numbers["length"]
    omega = 2 / math.tan(2 * a) * math.sqrt(pull * math.sin(a) * math.sin(numbers["slope"]))
    scene = scenes.rimless_wheel(**numbers, omega=omega)
    step = _motion(scene, 50.0, samples=2, max_phases=1)
    assert np.abs(step.y - scene.y0).max() < SOLVED


def test_a_wheel_that_is_too_slow_rolls_back():
    slow = scenes.rimless_wheel(slope=0.0, omega=0.2)
    motion = _motion(slow, 30.0, samples=2, max_phases=4)
    assert [number for _, number in motion.path] == [1, 0, 1, 0]
    # From one spoke to the next at rest it keeps cos 45 degrees of its speed.
    speeds = [abs(float(piece.ys[0, 1])) for piece in motion.pieces]
    np.testing.assert_allclose(np.array(speeds[1:]) / speeds[:-1], math.cos(math.pi / 4))


def test_a_wheel_on_level_ground_rocks_to_rest_on_two_spokes():
    wheel = scenes.rimless_wheel(slope=0.0, omega=0.3)
    motion = _motion(wheel, 30.0, samples=2)
    assert motion.names[-1] == "rest"
    assert motion.ok
    np.testing.assert_allclose(np.abs(motion.y), [math.pi / 8, 0.0], rtol=1e-12)

    def lasts(omega):
        """The time in which it rises from a spoke and falls back, as an integral over omega."""

        def inverse_rate(speed):
            cosine = math.cos(math.pi / 8) + (omega**2 - speed**2) / 2
            return 1 / math.sqrt(1 - cosine**2)

        return 2 * quad(inverse_rate, 0, omega, epsabs=0, epsrel=1e-13)[0]

    rocks = sum(lasts(0.3 * math.cos(math.pi / 4) ** n) for n in range(100))
    assert float(motion.pieces[-1].ts[0]) == pytest.approx(rocks, abs=2e-6)  # rest: below 1e-7


def test_where_a_wheel_may_rest():
    # Up to the slope at which its hub is above a foot: there it tips, also from rest.
    for slope, name in ((0.39, "rest"), (0.395, "roll"), (-0.39, "rest"), (-0.395, "roll")):
        wheel = scenes.rimless_wheel(slope=slope, omega=0.0)
        assert _motion(wheel, 0.5, samples=2).names[0] == name


def test_the_simplest_walker_walks_in_its_published_gait():
    gait = {"stance": 0.20031090054424716, "rate": -0.19983247300495}
    scene = scenes.simplest_walker(**gait)
    # Its multipliers are -0.19 +- 0.56i: steps make errors smaller.
    steps = _motion(scene, 60.0, samples=2, rtol=1e-13)
    assert len(steps.pieces) == 16
    for piece in steps.pieces:
        assert np.abs(np.asarray(piece.ys[0] - scene.y0)).max() < SOLVED


def test_its_equations_are_those_of_the_reference():
    slope = 0.012

    def reference(t, y):
        theta, phi, rate, turn = y
        pull = math.sin(theta - slope)
        bend = rate**2 * math.sin(phi) - math.cos(theta - slope) * math.sin(phi)
        return [rate, turn, pull, pull + bend]

    scene = scenes.simplest_walker(slope=slope)
    exact = solve_ivp(reference, (0, 3), np.asarray(scene.y0), "DOP853", rtol=1e-13, atol=1e-15)
    assert np.abs(simulate(scene, 3.0, samples=2).ys[-1] - exact.y[:, -1]).max() < 1e-11


@pytest.mark.parametrize("make", [scenes.rimless_wheel, scenes.simplest_walker])
def test_energy_is_kept_in_a_step_and_gait_is_the_same_in_all_units(make):
    plain, other = make(), make(length=0.2, g=9.81)
    assert energy.drift(simulate(plain, 3.0)) < 1e-12
    time = math.sqrt(0.2 / 9.81)
    scaled = jnp.asarray([1.0] * (len(plain.y0) // 2) + [1 / time] * (len(plain.y0) // 2))
    one = _motion(plain, 20.0, samples=2, max_phases=1)
    two = phases.simulate_phases(
        scenes.phases_of(other), None, plain.y0 * scaled, 20.0 * time, samples=2, max_phases=1
    )
    assert abs(two.t / time - one.t) < 1e-11
    assert np.abs(two.y / scaled - one.y).max() < 1e-11


def test_the_swing_foot_is_on_the_ground_at_both_ends_of_a_step():
    scene = scenes.simplest_walker()
    step = _motion(scene, 20.0, samples=2, max_phases=1).pieces[0]
    normal = np.array([math.sin(0.009), math.cos(0.009)])
    for t, y in zip(step.ts, step.ys, strict=True):
        foot = next(s for s in scene.sketch(t, y) if s.name == "swing foot").at[0]
        assert abs(float(foot @ normal)) < 1e-11
    assert float(foot[0]) > 0.3  # ahead, down the slope


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: scenes.rimless_wheel(spokes=4), "spokes: expected a whole number, at least 5"),
        (lambda: scenes.rimless_wheel(length=0.0).check(), "length: expected > 0"),
        (lambda: scenes.simplest_walker(length=-1.0).check(), "length: expected > 0"),
        (lambda: scenes.phases_of(scenes.pendulum()), "scene: expected one of BallOnTable, Car"),
        (lambda: scenes.phases_of(scenes.car(mu=0.0)), "a car with a locked axle"),
    ],
)
def test_walkers_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_which_scenes_have_corners():
    assert has_corners(scenes.simplest_walker())
    assert has_corners(scenes.car())
    assert not has_corners(scenes.car(mu=0.0))
    assert not has_corners(scenes.pendulum())
