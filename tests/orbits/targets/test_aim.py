"""Aiming: closed forms without drag and with linear drag, a quadrature for quadratic drag."""

import dataclasses
import functools
import itertools
import json

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import EXACT, SOLVED
from scipy.integrate import solve_ivp

from jaxdyn import Effect, scenes
from jaxdyn.analysis._roots import root
from jaxdyn.effects import LinearDrag, QuadraticDrag, UniformGravity
from jaxdyn.integrate import events
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes.ballistics import best_angle
from orbits import drawing
from orbits.targets import aim
from orbits.targets.launch import landings, launch

SPEEDS = np.logspace(-2, 8, 200)
DRAG, G = 0.01, 9.81
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)


@pytest.fixture(scope="module")
def drag():
    return scenes.cannonball(drag=DRAG, g=G)


@pytest.fixture(scope="module")
def many(drag):
    return aim.farthest(drag, SPEEDS)


def quadratic_range(angle, speed, k=DRAG, g=G):
    """Range with drag k v^2, by quadrature over the slope p of the path (the hodograph).

    With F(p) = p sqrt(1 + p^2) + asinh p, g / vx^2 = g / vx0^2 + k (F(p0) - F(p)), and
    dx = -vx^2 / g dp, dy = p dx. No step of an integrator, no event.
    """

    def f(p):
        return p * mpmath.sqrt(1 + p * p) + mpmath.asinh(p)

    with mpmath.workdps(40):
        p0 = mpmath.tan(mpmath.mpf(float(angle)))
        f0, start = f(p0), g * (1 + p0 * p0) / mpmath.mpf(float(speed)) ** 2

        def density(p):
            return 1 / (start + k * (f0 - f(p)))

        def integrals(depth):
            """Integrals of dx and of dy / dx from the launch to the slope p0 - depth."""
            cuts = [0.0, *depth * np.logspace(-22, 0, 34)]
            x = y = 0.0
            for a, b in itertools.pairwise(cuts):
                for node, weight in zip(_NODES, _WEIGHTS, strict=True):
                    p = p0 - (a + b + (b - a) * node) / 2
                    part = density(p) * weight * (b - a) / 2
                    x, y = x + part, y + p * part
            return x, y

        depth = 2 * p0  # without drag; with it, it falls steeper
        for _ in range(40):
            _, y = integrals(float(depth))
            step = -y / ((p0 - depth) * density(p0 - depth))
            depth = depth + step
            if abs(step) < 1e-13 * depth:
                return float(integrals(float(depth))[0])
    raise AssertionError


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.3, 10.0, 3e5])
def test_without_drag_the_best_angle_is_45_degrees(speed):
    best = aim.farthest(scenes.cannonball(g=G), speed)
    assert best.ok
    assert abs(best.angle - np.pi / 4) < SOLVED
    assert abs(best.x / (speed**2 / G) - 1) < EXACT
    assert abs(best.t / (np.sqrt(2) * speed / G) - 1) < SOLVED
    assert abs(best.landing - np.pi / 4) < SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("x", [0.1, 5.0, -9.99])
def test_without_drag_two_angles_hit(x):
    found = aim.hit(scenes.cannonball(g=10.0), x, 10.0)
    first = 0.5 * np.arcsin(abs(x) / 10.0)
    angles = np.array([first, np.pi / 2 - first])
    angles = np.sort(angles if x > 0 else np.pi - angles)
    assert found.ok
    assert found.short == 0.0
    assert np.abs(found.angles - angles).max() < SOLVED
    assert np.abs(found.times - 2 * np.sin(angles)).max() < SOLVED


def test_straight_up_comes_back():
    found = aim.hit(scenes.cannonball(), 0.0, 10.0)
    assert np.abs(found.angles - np.pi / 2).max() < SOLVED
    assert len(found.angles) == 1


def test_out_of_reach_says_how_far_and_the_nearest_angle():
    for x in (12.5, -12.5):
        found = aim.hit(scenes.cannonball(g=10.0), x, 10.0)
        assert found.outcome == aim.Aim.OUT_OF_REACH
        assert not found.ok
        assert len(found.angles) == 0
        assert abs(found.short - 2.5) < SOLVED
        assert abs(found.nearest - (np.pi / 4 if x > 0 else 3 * np.pi / 4)) < SOLVED
    assert "Throw faster" in found.message
    assert "at 135 degrees, misses by 2.5." in found.message


@pytest.mark.parametrize("x", [1e20, 1e150, -1e300])
def test_a_target_that_no_throw_comes_near_is_out_of_reach_of_the_farthest_one(x):
    found = aim.hit(scenes.cannonball(g=10.0), x, 10.0)
    assert found.outcome == aim.Aim.OUT_OF_REACH
    assert found.short == abs(x)
    assert abs(found.nearest - (np.pi / 4 if x > 0 else 3 * np.pi / 4)) < SOLVED


@pytest.mark.parametrize("speed", [1e20, 1e76, 1e100, 1e150])
def test_a_throw_is_as_hard_at_any_speed(speed):
    scene = scenes.cannonball(g=10.0)
    w = np.array([-3.0, -0.7, 0.0, 2.0])
    angles = 2 * np.arctan(np.exp(w))
    found = landings(scene, w, speed)
    assert np.abs(found.x / (speed * (speed / 10.0)) - np.sin(2 * angles)).max() < SOLVED
    assert np.abs(found.t / (speed / 10.0) - 2 * np.sin(angles)).max() < SOLVED


def test_the_least_speed_of_the_farthest_targets():
    scene = scenes.cannonball(g=G)
    for x in (1e20, 1e300):
        best = aim.slowest(scene, x)
        assert best.ok
        assert abs(best.speed / (np.sqrt(G) * np.sqrt(x)) - 1) < SOLVED
        assert abs(best.angle - np.pi / 4) < SOLVED
    lost = aim.slowest(scene, 1e307)  # the square of its speed is no number
    assert lost.outcome == aim.Aim.LOST
    assert "a nearer target" in lost.message


def test_the_least_speed_without_drag():
    best = aim.slowest(scenes.cannonball(g=G), 7.0)
    assert abs(best.speed - np.sqrt(G * 7.0)) < SOLVED
    assert abs(best.angle - np.pi / 4) < SOLVED


@pytest.mark.slow
def test_linear_drag_has_the_angle_and_the_range_of_its_closed_form():
    """At any speed in units of the terminal one: the angle falls from 45 degrees to 5e-98."""
    speeds = np.array([1e-60, 1e-30, 1e-6, 1e-2, 1.0, 1e2, 1e5, 1e9, 1e12, 1e20, 1e30, 1e100])
    best = aim.farthest(windy(G, 0.0, (0.0, 0.0)), speeds)  # the terminal speed is 1
    assert best.ok
    exact = np.array([best_angle(speed=v, m=1.0, g=G, linear=G) for v in speeds])
    assert np.abs(best.angle / exact - 1).max() < 1e-11
    for angle, u, x, t in zip(exact, speeds, best.x, best.t, strict=True):
        # The time of flight s solves s = (1 + p) (1 - e^-s): Lambert's W.
        with mpmath.workdps(150):
            p = mpmath.mpf(float(u)) * mpmath.sin(mpmath.mpf(float(angle)))
            s = 1 + p + mpmath.lambertw(-(1 + p) * mpmath.exp(-1 - p)).real
            by_hand = u / G * np.cos(angle) * float(1 - mpmath.exp(-s))
        assert abs(x / by_hand - 1) < SOLVED
        assert abs(t * G / float(s) - 1) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e3, 1e12])
@pytest.mark.parametrize("wind", [(3.0, 0.0), (-0.5, 0.0), (30.0, 0.3)])
def test_linear_drag_in_wind_has_its_closed_form(speed, wind):
    best = aim.farthest(windy(G, 0.0, wind), speed)
    assert best.ok
    with mpmath.workdps(50):
        across, up = (mpmath.mpf(x) for x in wind)

        def flight(log_angle):
            """Range and time in units of the relaxation time and the terminal speed in calm air."""
            angle = mpmath.exp(log_angle)
            vx, vy = speed * mpmath.cos(angle), speed * mpmath.sin(angle)
            p = (vy - up + 1) / (1 - up)
            s = p + mpmath.lambertw(-p * mpmath.exp(-p)).real
            return across * s + (vx - across) * (1 - mpmath.exp(-s)), s

        near = mpmath.log(mpmath.mpf(float(best.angle)))
        top = mpmath.findroot(
            lambda x: mpmath.diff(lambda x: flight(x)[0], x),
            (near - mpmath.mpf("1e-6"), near + mpmath.mpf("1e-6")),
            tol=1e-20,
            verify=False,
        )
        x, s = flight(top)
    assert abs(float(best.angle / mpmath.exp(top)) - 1) < 1e-9
    assert abs(best.x * G / float(x) - 1) < SOLVED
    assert abs(best.t * G / float(s) - 1) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("drags", [(0.0, 1.0), (1.0, 1.0), (1.0, 1e-6), (0.0, 0.0)])
def test_drags_at_speeds_from_1e_6_to_1e12(drags):
    scene = windy(*drags, (0.0, 0.0))
    speeds = np.logspace(-6, 12, 7)
    best = aim.farthest(scene, speeds)
    assert best.ok
    for angle, u, x, t in zip(best.angle, speeds, best.x, best.t, strict=True):
        # The plain scene from the origin, whose short throws keep their digits.
        thrown = launch(scene.starting([0.0, 0.0, 0.0, 0.0]), angle, u, t)
        end = np.asarray(solve(thrown, t, rtol=1e-13, atol=1e-40).y1)
        assert np.abs(end[:2] - [x, 0.0]).max() < 1e-11 * x
        # The best angle is the middle of a parabola, up to its cubic term.
        beside = np.log(np.tan(angle / 2)) + np.array([-1e-2, 0.0, 1e-2])
        less = landings(scene, beside, u).x / x - 1
        assert abs(less[1]) < EXACT
        assert less[0] < 0 > less[2] or min(less) > -1e-13
        assert abs(less[0] - less[2]) < 0.1 * abs(less[0] + less[2]) + 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("row", [60, 130, 199])
def test_quadratic_drag_agrees_with_a_quadrature(many, row):
    angle, speed = float(many.angle[row]), SPEEDS[row]
    assert abs(many.x[row] / quadratic_range(angle, speed) - 1) < SOLVED
    h = 1e-3
    near = [quadratic_range(angle + i * h, speed) for i in (-2, -1, 0, 1, 2)]
    slope = (8 * (near[3] - near[1]) - (near[4] - near[0])) / (12 * h)
    bend = (16 * (near[1] + near[3]) - near[0] - near[4] - 30 * near[2]) / (12 * h * h)
    assert abs(slope / bend) < 1e-9  # the error of the difference: h^4 of a fifth derivative
    assert bend < 0


@pytest.mark.slow
def test_the_best_angle_falls_from_45_degrees_to_0(many):
    assert many.ok
    assert abs(many.angle[0] - np.pi / 4) < 1e-7
    assert (np.diff(many.angle) < 0).all()
    assert (np.diff(many.x) > 0).all()


@pytest.mark.slow
def test_how_the_best_angle_tends_to_0(many):
    """It lands at a right angle to its launch, up to 1 / L, L = log(v^2 c / (m g))."""
    fast = SPEEDS > 1e4
    scale = np.log(SPEEDS[fast] ** 2 * DRAG / G)
    off = many.angle[fast] + many.landing[fast] - np.pi / 2
    assert (np.diff(off) < 0).all()
    assert (np.abs(off * scale - 0.7) < 0.1).all()

    def law(scale):
        # angle = s / L, where the path down to the slope 1 / angle takes the height s / 2.
        def fall(p):
            return p / (p * mpmath.sqrt(1 + p * p) + mpmath.asinh(p))

        return float(
            mpmath.findroot(lambda a: 2 * mpmath.quad(fall, [0, 1, 1 / a]) - a * scale, (0.1, 0.3))
        )

    ratio = [many.angle[i] / law(np.log(SPEEDS[i] ** 2 * DRAG / G)) for i in (120, 160, 199)]
    off = np.abs(np.array(ratio) - 1)
    assert (np.diff(off) < 0).all()
    assert off[-1] < 0.1


@pytest.mark.slow
def test_numbers_without_dimension_are_all_that_matters(many):
    """Only v^2 c / (m g) enters the angle: another planet, another ball."""
    other = scenes.cannonball(drag=3.0, g=1.6, m=7.0)
    # Terminal speeds sqrt(m g / c) take the place of each other.
    ratio = np.sqrt(7.0 * 1.6 / 3.0) / np.sqrt(G / DRAG)
    best = aim.farthest(other, SPEEDS[::20] * ratio)
    assert np.abs(best.angle - many.angle[::20]).max() < 1e-11


def windy(linear, quadratic, wind):
    """One kind of scene for all of them: compiled once."""
    drags = LinearDrag(linear, wind), QuadraticDrag(quadratic, wind)
    return scenes.particle(UniformGravity(G), *drags, position=(2.0, 1.0))


@pytest.mark.parametrize(
    "scene",
    [windy(0.0, 0.1, (30.0, 0.0)), windy(0.3, 0.0, (-8.0, 0.0)), windy(0.1, 0.05, (3.0, -1.0))],
    ids=["tail wind", "head wind", "both drags"],
)
@pytest.mark.slow
def test_all_angles_are_found_in_wind(scene):
    dense = landings(scene, np.linspace(-9.0, 9.0, 512), 12.0, 1e-9).x
    for x in (15.0, 1.0, -0.2, -3.0):
        found = aim.hit(scene, x, 12.0)
        assert len(found.angles) == np.sum((dense[1:] - x) * (dense[:-1] - x) < 0)
        assert found.ok == bool(len(found.angles))
        for angle, t in zip(found.angles, found.times, strict=True):
            end = solve(launch(scene, angle, 12.0, t), t, rtol=1e-13).y1  # the plain scene
            assert np.abs(np.asarray(end[:2]) - [2.0 + x, 1.0]).max() < SOLVED * 10


@pytest.mark.slow
def test_the_course_problem(drag):
    """Problem 27: 1 kg, g = 10, c = 0.5 kg/m; hit 2 m at 10 m/s, and the least speed for 2 m."""
    scene = scenes.cannonball(g=10.0, drag=0.5)
    found = aim.hit(scene, 2.0, 10.0)
    assert len(found.angles) == 2
    for angle in found.angles:
        assert abs(quadratic_range(angle, 10.0, 0.5, 10.0) - 2.0) < SOLVED
    least = aim.slowest(scene, 2.0)
    assert abs(quadratic_range(least.angle, least.speed, 0.5, 10.0) - 2.0) < SOLVED
    best = aim.farthest(scene, least.speed)
    assert abs(best.angle - least.angle) < 1e-10
    assert abs(best.x - 2.0) < SOLVED
    assert not aim.hit(scene, 2.0, least.speed * (1 - 1e-9)).ok
    assert aim.hit(scene, 2.0, least.speed * (1 + 1e-9)).ok


@pytest.mark.slow
def test_too_far_for_any_speed():
    best = aim.slowest(scenes.cannonball(g=10.0, drag=0.5), 2000.0)
    assert best.outcome == aim.Aim.OUT_OF_REACH
    assert not best.ok
    assert np.isnan([best.speed, best.angle, best.x, best.t]).all()


@pytest.mark.slow
def test_a_ball_that_the_wind_carries_off_has_no_range():
    scene = windy(0.0, 1.0, (0.0, 50.0))
    for found in (aim.farthest(scene, 1.0), aim.hit(scene, 1.0, 1.0)):
        assert found.outcome == aim.Aim.NO_RANGE
        assert not found.ok
        assert "Is the wind too strong" in found.message


class Thinning(Effect):
    """Linear drag in air that is thinner higher up."""

    def force(self, t, r, v, m):
        return -jnp.exp(-r[:, 1:] / 1e7) * v


@pytest.mark.slow
def test_a_stiff_fall_is_lost_not_wrong():
    """Where the drag changes on the way down, the fall is no straight line at one speed."""
    best = aim.farthest(scenes.particle(UniformGravity(1.0), Thinning()), [10.0, 1e7])
    assert best.outcome.tolist() == [aim.Aim.FOUND, aim.Aim.LOST]
    assert np.isfinite(best.angle[0])
    assert np.isnan([best.angle[1], best.x[1]]).all()
    assert not best.ok
    assert "stiff" in best.message


class Layer(Effect):
    """Drag, and a wind that blows only in a thin layer of air."""

    def force(self, t, r, v, m):
        inside = jnp.exp(-(((r[:, 1:] - 300.0) / 10.0) ** 2))
        return -(v - inside * jnp.array([[1.0, 0.0]]))


@pytest.mark.slow
def test_a_steady_fall_that_something_disturbs_is_not_taken_for_one():
    scene = scenes.particle(UniformGravity(1.0), Layer())
    steep = landings(scene, np.array([-0.1]), 1e3)
    # Relative to the throw of 117 m, as tolerances of steps are.
    assert steep.status[0] != 0 or abs(steep.x[0] / steep_by_simulation(scene) - 1) < 1e-10
    assert steep.status[0] == 0 or np.isnan(steep.x[0])


def steep_by_simulation(scene):
    angle = float(2 * np.arctan(np.exp(-0.1)))
    thrown = launch(scene, angle, 1e3, 2e3)
    stop = events.until(thrown, events.Reaches(1, 0.0, -1), 2e3, rtol=1e-12)
    return float(stop.y[0])


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
def test_a_zero_is_found_between_values_of_very_different_size(scale):
    """A secant from end to end hardly leaves the smaller value: that is no convergence."""

    def fn(x):
        return scale * (np.exp(-40 * x) - np.exp(-28.0)), np.full(len(x), np.nan)

    x, found = root(fn, np.array([0.0, 0.0, 0.5, 0.8]), np.array([1.0, 3.0, 0.9, 0.9]))
    assert found.tolist() == [True, True, True, False]
    assert np.abs(x[:3] - 0.7).max() < SOLVED


def test_a_zero_of_an_exponential_is_found_in_a_wide_bracket():
    """Its values at the ends differ by 1e198; a secant step towards the larger one is tiny."""

    def fn(x):
        return np.exp(-454 * x) - np.exp(-454 * 0.3), np.full(len(x), np.nan)

    x, found = root(fn, np.array([0.0, -0.7]), np.array([1.0, 29.0]))
    assert found.all()
    assert np.abs(x - 0.3).max() < SOLVED


def test_outcomes_are_shown_by_name():
    assert "  outcome  FOUND\n" in str(aim.farthest(scenes.cannonball(), 10.0))
    throws = aim.farthest(scenes.cannonball(), [1.0, 2.0])
    assert "  outcome  2 FOUND\n" in str(throws)
    assert "  status  2 OK" in str(landings(scenes.cannonball(), [0.0, -1.0], 10.0))


def test_every_outcome_says_what_to_do():
    assert all(outcome.message.endswith((".", "?")) for outcome in aim.Aim)
    assert len({outcome.message for outcome in aim.Aim}) == len(aim.Aim)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: aim.hit(s, 1.0, 0.0), "speed: expected > 0, got 0.0"),
        (lambda s: aim.hit(s, np.nan, 1.0), "x: expected finite numbers"),
        (lambda s: aim.hit(s, [1.0, 2.0], 1.0), r"x: expected shape \(\)"),
        (lambda s: aim.farthest(s, [1.0, -2.0]), "speed: expected > 0, got -2.0"),
        (lambda s: aim.farthest(s, []), "speed: expected one speed or a row"),
        (lambda s: aim.farthest(s, np.inf), "speed: expected finite numbers, got inf"),
        (lambda s: aim.slowest(s, -1.0), "x: expected > 0, got -1.0. Mirror"),
        (
            lambda s: jax.grad(lambda g: float(aim.farthest(scenes.cannonball(g=g), 1.0).x))(9.8),
            "scene: expected numbers, got values traced",
        ),
        (
            lambda s: jax.grad(lambda v: aim.farthest(s, v).x)(20.0),
            "speed: expected numbers, got values traced",
        ),
        (
            lambda s: jax.vmap(lambda x: aim.slowest(s, x).speed)(jnp.ones(2)),
            "x: expected numbers, got values traced",
        ),
        (
            lambda s: jax.grad(lambda x: aim.hit(s, x, 20.0).angles[0])(5.0),
            "x: expected numbers, got values traced",
        ),
        (
            lambda s: aim.farthest(scenes.three_body(), 1.0),
            "scene: expected one free point in the plane",
        ),
        (
            lambda s: aim.farthest(scenes.pendulum(), 1.0),
            "scene: expected one free point in the plane",
        ),
        (lambda s: aim.farthest(scenes.cannonball, 1.0), "scene: expected a Scene"),
        (lambda s: aim.farthest(scenes.cannonball(g=0.0), 1.0), "a force on the point at rest"),
    ],
)
def test_misuse_is_refused_with_the_remedy(drag, call, message):
    with pytest.raises(ValueError, match=message):
        call(drag)


@pytest.fixture
def aim_command(command):
    return functools.partial(command, "orbits", "aim")


@pytest.mark.slow
def test_command_line(aim_command, tmp_path):
    picture = tmp_path / "throws.png"
    words = ("--speed", "50", "--drag", "0.01", "--x", "80")
    code, out, _ = aim_command(*words, "--plot", str(picture))
    assert code == 0
    assert out.count("hits 80 m at") == 2
    assert "farthest: 50 m/s at 37.9077657" in out
    assert picture.stat().st_size > 10_000
    code, out, _ = aim_command(*words, "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["farthest"]["ok"]
    assert len(answer["hits"]["angles"]) == 2
    assert answer["slowest"]["speed"] < 50
    code, out, _ = aim_command("--speed", "5", "--x", "80")
    assert code == 1
    assert "not hit" in out
    assert "misses by" in out
    code, out, _ = aim_command("--speed", "50", "--x", "1e300")
    assert code == 1
    assert "least speed: 3.132091953e+150 m/s at 45 degrees" in out
    assert max(map(len, out.splitlines())) < 200
    code, out, err = aim_command("--speed", "-5")
    assert (code, out) == (2, "")
    assert "speed: expected > 0, got -5.0" in err


def test_the_picture_shows_every_throw(drag):
    best, hits = aim.farthest(drag, 50.0), aim.hit(drag, 80.0, 50.0)
    figure = drawing.throws(drag, best, hits)
    paths, ranges = figure.axes
    labels = paths.get_legend_handles_labels()[1]
    assert len(labels) == 4
    assert paths.get_aspect() == 1.0
    assert (paths.get_xlabel(), ranges.get_ylabel()) == ("x [m]", "lands at x [m]")
    in_km = drawing.throws(dataclasses.replace(drag, units=("km", "kg", "min")), best)
    assert [axes.get_ylabel() for axes in in_km.axes] == ["y [km]", "lands at x [km]"]
    dots = [line for line in ranges.lines if line.get_marker() == "o"]
    ends = [float(np.asarray(dot.get_ydata())[0]) for dot in dots]
    assert np.abs(np.array(ends) - [float(best.x), 80.0, 80.0]).max() < 1e-6


@pytest.mark.parametrize(
    ("best", "message"),
    [
        (50.0, r"best: expected a Throws, got 50\.0"),
        (aim.Throws(*np.zeros((7, 2))), "best: expected one throw, got 2 throws"),
    ],
)
def test_a_picture_needs_a_throw(drag, best, message):
    with pytest.raises(ValueError, match=message):
        drawing.throws(drag, best)
    with pytest.raises(ValueError, match=r"hits: expected a Hits, got 80\.0"):
        drawing.throws(drag, aim.Throws(*np.zeros(7)), 80.0)


@pytest.mark.parametrize(("speed", "height"), [(15.0, 20.0), (1.0, 1e3), (300.0, 1e-6)])
def test_throws_from_a_height_are_those_of_the_closed_forms(speed, height):
    scene, last = scenes.cannonball(g=G), np.sqrt(speed**2 + 2 * G * height)
    best = aim.farthest(scene, speed, height)
    assert abs(best.angle - np.arctan2(speed, last)) < 1e-12
    assert abs(best.x - speed * last / G) < 1e-13 * best.x
    assert abs(best.landing - np.arctan2(last, speed)) < 1e-12
    x = 0.9 * float(best.x)
    found = aim.hit(scene, x, speed, height)
    part = G * x**2 / (2 * speed**2)
    upwards = [t for t in np.roots([part, -x, part - height]) if t > 0]
    np.testing.assert_allclose(found.angles, np.sort(np.arctan(upwards)), rtol=1e-10)
    np.testing.assert_allclose(found.times, x / (speed * np.cos(found.angles)), rtol=1e-10)
    least = aim.slowest(scene, x, height)
    assert abs(least.speed - np.sqrt(G * (np.hypot(x, height) - height))) < 1e-9 * least.speed


@pytest.mark.parametrize(("drag", "height"), [(0.01, 100.0), (1.0, 500.0)])
def test_throws_from_a_height_with_drag_are_those_of_scipy(drag, height):
    """The second one falls steadily long before it lands."""

    def reach(angle):
        def rate(t, y):
            pull = drag * np.hypot(y[2], y[3])
            return [y[2], y[3], -pull * y[2], -pull * y[3] - G]

        def ground(t, y):
            return y[1] + height

        ground.terminal = True
        start = [0.0, 0.0, 50 * np.cos(angle), 50 * np.sin(angle)]
        options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13, "events": ground}
        run = solve_ivp(rate, (0.0, 1e3), start, **options)
        return run.y_events[0][0][0]

    best = aim.farthest(scenes.cannonball(g=G, drag=drag), 50.0, height)
    assert best.ok
    less, x, more = (reach(best.angle + d) for d in (-1e-2, 0.0, 1e-2))
    assert abs(best.x - x) < 1e-10 * x
    assert max(less, more) < x
    closer = [reach(best.angle + d) for d in (-1e-3, 1e-3)]
    assert abs(closer[1] - closer[0]) < 1e-3 * (2 * x - less - more)  # cubic terms


def test_a_height_is_not_negative():
    with pytest.raises(ValueError, match=r"^height: expected .* For a point above the launch"):
        aim.farthest(scenes.cannonball(), 10.0, -1.0)
