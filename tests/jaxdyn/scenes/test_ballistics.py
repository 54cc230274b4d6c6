"""Problem 9: the cannonball with linear drag against its closed forms, and those against mpmath."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import DIFFED, EXACT, SOLVED, gap

from jaxdyn import simulate
from jaxdyn.integrate import events
from jaxdyn.scenes import cannonball
from jaxdyn.scenes.ballistics import best_angle, cannonball_linear_exact, flight_time
from jaxdyn.solvers import VERNER9

LINEAR = {"speed": 1.0, "g": 1.0, "linear": 1.0}  # problem 9 b
SPEEDS = (1e-8, 1e-3, 0.3, 1.5, 10.0, 1e3, 1e8)


def test_problem_9_numbers_against_the_closed_form():
    errors = []
    for rtol in (1e-4, 1e-8, 1e-13):
        # By the pair; the default, a Taylor series, is exact to 2e-11 at the first.
        motion = simulate(cannonball(**LINEAR), 2.0, rtol=rtol, samples=5, solver=VERNER9)
        errors.append(gap(motion.ys, cannonball_linear_exact(motion.ts, **LINEAR)))
    assert errors[0] > 100 * errors[1] > 1e4 * errors[2]
    assert errors[2] < SOLVED
    motion = simulate(cannonball(**LINEAR), 2.0, rtol=1e-13, samples=5)
    assert gap(motion.ys, cannonball_linear_exact(motion.ts, **LINEAR)) < SOLVED


def test_the_closed_form_solves_its_equation():
    numbers = {"speed": 3.0, "angle": 1.0, "m": 2.0, "g": 9.0, "linear": 0.7}
    scene = cannonball(**numbers)
    for t in (0.0, 1e-3, 0.9, 5.0, 1.4285, 1.4286):  # the last two: where the series ends
        y, rate = jax.jvp(
            lambda t: cannonball_linear_exact(t, **numbers), (jnp.asarray(t),), (jnp.ones(()),)
        )
        assert gap(rate, scene.rate(t, y)) < 1000 * EXACT
    assert gap(cannonball_linear_exact(0.0, **numbers), scene.y0) == 0


def test_the_closed_form_tends_to_the_parabola_without_cancellation():
    y = cannonball_linear_exact(0.5, speed=1.0, angle=0.0, g=2.0, linear=1e-9)
    # y = -g t^2 / 2 (1 - c t / 3 + ...)
    assert gap(y[1] / -0.25, 1 - 0.5e-9 / 3) < EXACT


def test_problem_9_d_the_path_of_a_fast_ball_is_a_triangle():
    speed, angle = 1e6, np.pi / 4
    t = np.geomspace(1e-6, float(flight_time(speed=speed, angle=angle, g=1.0)), 2000)
    x, y = np.asarray(cannonball_linear_exact(t, speed=speed, g=1.0)[:, :2]).T / speed
    side = np.cos(angle)  # the corner is at (tau v0 cos, tau v0 sin)
    on_rise, on_fall = np.abs(y - x * np.tan(angle)), np.abs(x - side)
    assert np.max(np.minimum(on_rise, on_fall)) < 1e-4
    assert np.max(y) > side * (1 - 1e-4)


@pytest.mark.parametrize("angle", [1e-4, 0.7, 1.5])
@pytest.mark.parametrize("speed", SPEEDS)
def test_problem_9_d_time_of_flight_against_lamberts_function(speed, angle):
    with mpmath.workdps(60):
        p = mpmath.mpf(speed) * mpmath.sin(mpmath.mpf(angle)) / 2  # g tau = 2
        s = 1 + p + mpmath.lambertw(-(1 + p) * mpmath.exp(-1 - p)).real
    found = flight_time(speed=speed, angle=angle, m=2.0, g=3.0, linear=3.0)
    assert abs(float(found) / float(s * 2 / 3) - 1) < EXACT


@pytest.mark.slow
def test_problem_9_d_time_of_flight_against_the_event():
    numbers = {"speed": 30.0, "angle": 0.9, "m": 2.0, "linear": 0.7}
    down = events.until(cannonball(**numbers), events.Reaches(1, 0.0, -1), 20.0, rtol=1e-13)
    assert abs(float(down.t - flight_time(**numbers))) < SOLVED
    assert abs(float(cannonball_linear_exact(flight_time(**numbers), **numbers)[1])) < SOLVED
    slope = jax.grad(lambda v: flight_time(speed=v))(30.0)
    ends = [float(flight_time(speed=30.0 + h)) for h in (-1e-3, 1e-3)]
    assert abs(float(slope) - (ends[1] - ends[0]) / 2e-3) < DIFFED


def test_a_ball_thrown_down_is_never_back():
    assert np.isnan(float(flight_time(angle=-0.1)))


@pytest.mark.parametrize("speed", SPEEDS)
def test_problem_9_e_best_angle_against_lamberts_function(speed):
    # sin(angle) = u W / (u^2 - 1 - W), W = W((u^2 - 1) / e): Packel and Yuen (2004).
    with mpmath.workdps(60):
        u = mpmath.mpf(speed) / 2
        w = mpmath.lambertw((u * u - 1) / mpmath.e).real
        expected = mpmath.asin(u * w / (u * u - 1 - w))
    found = best_angle(speed=speed, m=2.0, g=3.0, linear=3.0)
    assert abs(float(found) / float(expected) - 1) < EXACT


@pytest.mark.slow
def test_problem_9_e_it_is_the_longest_range_and_tends_to_zero_like_log_v_over_v():
    def reach(angle, speed):
        t = flight_time(speed=speed, angle=angle)
        return cannonball_linear_exact(t, speed=speed, angle=angle)[0]

    for speed in (1.0, 20.0, 500.0):
        best = best_angle(speed=speed)
        assert abs(float(jax.grad(reach)(best, speed)) / speed) < 1e-10
        assert float(reach(best, speed)) > max(float(reach(best * f, speed)) for f in (0.99, 1.01))
    assert abs(float(best_angle(speed=1e-6)) - np.pi / 4) < 1e-6
    u = np.array([1e4, 1e8, 1e12])
    ratios = np.asarray(jnp.vectorize(lambda v: best_angle(speed=v, g=1.0))(u)) * u / np.log(u**2)
    assert (np.diff(ratios) > 0).all()  # slowly: to log(u^2) belongs its own logarithm
    assert 0.75 < ratios[0] < ratios[-1] < 1.0


@pytest.mark.parametrize(
    ("numbers", "message"),
    [({"g": 0.0}, "g: expected > 0"), ({"linear": 0.0}, "linear: expected > 0")],
)
def test_what_is_refused(numbers, message):
    for call in (flight_time, best_angle):
        with pytest.raises(ValueError, match=message):
            call(**numbers)
