"""Derivatives where naive codes lose them: closed forms, other formulations, differences."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from jaxdyn import Scene, scenes, solvers
from jaxdyn.effects import LinearDrag, PowerLaw, QuadraticDrag, SinusoidalForce, Spring
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.hard.cases.contact import bouncing_ball
from jaxdyn.integrate.phases import follow
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes.corners import phases_of
from jaxdyn.scenes.pendula import shaken_pendulum

RTOL = 1e-13


def differences(fn, x: float, h: float) -> np.ndarray:
    """Derivative of fn at x by central differences that are right to order h^6."""
    steps = [(np.asarray(fn(x + k * h)) - fn(x - k * h)) / (2 * k * h) for k in (1, 2, 3)]
    return 1.5 * steps[0] - 0.6 * steps[1] + 0.1 * steps[2]


def end(scene: Scene, t: float, **how):
    return solve(scene, t, **({"rtol": RTOL} | how)).y1


def point(effect, y0) -> Scene:
    """One point of mass 1 on a line."""
    return Scene(FreePoints([1.0], d=1), (effect,), y0=y0)


@pytest.mark.parametrize("speed", [1e8, 1.0, 1e-8, 0.0])
def test_quadratic_drag_at_any_speed_and_at_rest(speed):
    # x = log(1 + c v t) / c.
    def way(c, v):
        return end(point(QuadraticDrag(c), jnp.stack([0.0, v])), 2.0)[0]

    by_c, by_v = jax.grad(way, argnums=(0, 1))(0.1, speed)
    with mpmath.workdps(40):
        c = mpmath.mpf(0.1)
        u = 2 * c * mpmath.mpf(speed)
        exact_c, exact_v = (u / (1 + u) - mpmath.log(1 + u)) / c**2, 2 / (1 + u)
    np.testing.assert_allclose(by_v, float(exact_v), rtol=1e-10)
    np.testing.assert_allclose(by_c, float(exact_c), rtol=1e-9, atol=1e-20)


def test_drag_from_rest_under_gravity():
    def height(c):
        return end(scenes.cannonball(speed=0.0) + LinearDrag(c), 2.0)[1]

    with mpmath.workdps(40):
        exact = mpmath.diff(
            lambda c: -(mpmath.mpf("9.81") / c) * (2 - (1 - mpmath.exp(-2 * c)) / c), 0.3
        )
    np.testing.assert_allclose(jax.grad(height)(0.3), float(exact), rtol=1e-11)


@pytest.mark.slow
def test_a_spring_without_length_through_its_anchor():
    # x = cos(sqrt(k) t) is at the anchor when sqrt(k) t = pi / 2.
    def place(k):
        return end(point(Spring(k), [1.0, 0.0]), 3.0)[0]

    k = 2.0
    exact = -1.5 / np.sqrt(k) * np.sin(3 * np.sqrt(k))
    np.testing.assert_allclose([jax.grad(place)(k), jax.jacfwd(place)(k)], exact, rtol=1e-11)


@pytest.mark.parametrize("e", [0.9, 0.999])
def test_a_period_through_a_close_encounter(e):
    # All orbits close: the map over the period T(y0) is 1 - f (grad T), T = 2 pi a^(3/2).
    start = np.array([1 + e, 0.0, 0.0, np.sqrt((1 - e) / (1 + e))])
    scene = Scene(FreePoints([1.0]), (PowerLaw(1.0, -2.0),), y0=start)
    found = jax.jit(jax.jacfwd(lambda y: end(scene.starting(y), 2 * np.pi)))(start)
    f = np.asarray(scene.rate(jnp.zeros(()), jnp.asarray(start)))
    slope = 6 * np.pi * np.concatenate([start[:2] / np.hypot(*start[:2]) ** 3, start[2:]])
    exact = np.eye(4) - np.outer(f, slope)
    # Errors grow by 1 / (1 - e) on the way past the centre.
    assert np.abs(found - exact).max() < 1e-11 / (1 - e) ** 2


@pytest.mark.slow
def test_the_time_and_place_of_a_stop():
    def stop(speed):
        scene = scenes.car(locked="rear", spin=0.0, mu=0.7, g=9.81, speed=speed)
        t, y = follow(scenes.braking(scene), [("slide", 0)], scene.y0, 60.0, rtol=RTOL)
        return jnp.stack([t, y[0]])

    slows = 0.7 * 9.81 * 1.2 / 2.6
    np.testing.assert_allclose(jax.jacfwd(stop)(20.0), [1 / slows, 20.0 / slows], rtol=1e-9)


@pytest.mark.slow
def test_the_time_of_the_third_bounce():
    def third(keeps, up):
        y0 = jnp.stack([0.0, 0.0, 1.0, up])
        return follow(bouncing_ball(keeps), [("fly", 0)] * 3, y0, 100.0, rtol=RTOL)[0]

    keeps, up, g = 0.8, 5.0, 10.0
    by_keeps, by_up = jax.grad(third, argnums=(0, 1))(keeps, up)
    np.testing.assert_allclose(by_keeps, 2 * up / g * (1 + 2 * keeps), rtol=1e-11)
    np.testing.assert_allclose(by_up, 2 / g * (1 + keeps + keeps**2), rtol=1e-11)


@pytest.mark.slow
def test_a_constrained_pendulum_has_the_derivatives_of_its_angle():
    def place(length, formulation):
        scene = scenes.pendulum(angle=2.0, length=length, formulation=formulation)
        return scene.system.points(0.0, end(scene, 1.5)).r[0]

    names = ("newton_euler", "constrained")
    by_angle, by_rod = (jax.jacfwd(lambda x, f=f: place(x, f))(1.3) for f in names)
    np.testing.assert_allclose(by_rod, by_angle, rtol=1e-10)


@pytest.mark.slow
def test_a_four_bar_linkage():
    def state(g):
        return end(scenes.four_bar(g=g), 1.0)

    np.testing.assert_allclose(
        jax.jacfwd(state)(1.0), differences(state, 1.0, 1e-2), rtol=1e-7, atol=1e-9
    )


@pytest.mark.slow
def test_a_top_in_quaternions():
    def state(spin):
        return end(scenes.top(0.5, spin=spin), 0.3)

    found = jax.jacfwd(state)(20.0)
    np.testing.assert_allclose(found, differences(state, 20.0, 1e-2), rtol=1e-7, atol=1e-8)


@pytest.mark.slow
def test_a_stiff_motion():
    # Overdamped: x'' + c x' + k x = 0, with rates of -1 and -1e4.
    c, k = 1e4 + 1, 1e4

    def place(k):
        return end(scenes.oscillator(k=k, c=c), 1.0, solver=solvers.RADAU9)[0]

    def exact(k):
        root = mpmath.sqrt(mpmath.mpf(c) ** 2 - 4 * k)
        slow, fast = (-c + root) / 2, (-c - root) / 2
        (x, v) = map(mpmath.mpf, map(float, scenes.oscillator().y0))
        a = (v - fast * x) / (slow - fast)
        return a * mpmath.exp(slow) + (x - a) * mpmath.exp(fast)

    with mpmath.workdps(50):
        wanted = float(mpmath.diff(exact, mpmath.mpf(k)))
    np.testing.assert_allclose(jax.grad(place)(k), wanted, rtol=1e-9)


@pytest.mark.parametrize("method", [solvers.KAHAN_LI8, solvers.GAUSS12], ids=lambda m: m.name)
def test_steps_of_equal_length(method):
    def place(k):
        return end(point(Spring(k), [1.0, 0.0]), 30.0, solver=method, dt=0.1, rtol=1e-10)[0]

    k = 2.0
    exact = -15 / np.sqrt(k) * np.sin(30 * np.sqrt(k))
    np.testing.assert_allclose(jax.grad(place)(k), exact, rtol=1e-7)


def test_a_derivative_through_a_collision_is_nan_and_a_status():
    def place(v):
        scene = point(PowerLaw(1.0, -2.0), jnp.stack([1.0, v]))
        flow = solve(scene, 3.0)
        return flow.y1[0], flow.status

    slope, status = jax.grad(place, has_aux=True)(-0.1)
    assert np.isnan(slope)
    assert status != 0


@pytest.mark.slow
def test_the_times_of_a_skid():
    # Pushed by F sin(w t) it rolls until F sin(w t) = 3 mu m g; the slip then grows by
    # F sin(w t) / m - 3 mu g and ends when its integral is 0 again.
    push, w, g = 20.0, 3.0, 10.0

    def times(mu):
        scene = scenes.cylinder_on_ramp(d=0.0, inertia=0.5, slope=0.0, mu=mu, g=g, t1=1.2)
        scene = scene + SinusoidalForce((push / 2, 0.0), w)  # on each of its two points
        phases = phases_of(scene)
        skids, _ = follow(phases, [("roll", 0)], scene.y0, 1.2, rtol=RTOL)
        rolls, _ = follow(phases, [("roll", 0), ("slip_on", 0)], scene.y0, 1.2, rtol=RTOL)
        return jnp.stack([skids, rolls])

    with mpmath.workdps(30):

        def skids(mu):
            return mpmath.asin(3 * mu * g / push) / w

        def rolls(mu):
            def slip(t):
                swing = mpmath.cos(w * skids(mu)) - mpmath.cos(w * t)
                return push / w * swing - 3 * mu * g * (t - skids(mu))

            return mpmath.findroot(slip, 0.9)

        exact = [mpmath.diff(skids, 0.5), mpmath.diff(rolls, 0.5)]
        at = [float(skids(0.5)), float(rolls(0.5))]
    found, slopes = jax.jvp(times, (0.5,), (1.0,))
    np.testing.assert_allclose(found, at, rtol=1e-10)
    np.testing.assert_allclose(slopes, np.array(exact, float), rtol=1e-8)


@pytest.mark.slow
def test_a_base_that_shakes_fast():
    def angle(amplitude):
        scene = shaken_pendulum(
            length=1.0, g=9.81, uniform=False, amplitude=amplitude, frequency=1e3, angle=0.3
        )
        return end(scene, 1.0)[0]

    found = jax.jacfwd(angle)(5e-3)
    np.testing.assert_allclose(found, differences(angle, 5e-3, 1e-5), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["double_pendulum", "triple_pendulum"])
def test_chaos_before_it_has_eaten_the_digits(name):
    def state(g):
        return end(getattr(scenes, name)(g=g), 4.0)

    found = jax.jacfwd(state)(1.0)
    np.testing.assert_allclose(found, differences(state, 1.0, 1e-3), rtol=1e-6, atol=1e-8)
