"""A braking car: to rest, without friction, and which way round it is stable."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap, refusal
from scipy.integrate import solve_ivp

from jaxdyn import Effect, scenes, simulate
from jaxdyn.analysis import energy, work_by_effect
from jaxdyn.integrate.phases import simulate_phases
from jaxdyn.scenes.skates import one_skate
from jaxdyn.scenes.wheels import AXLES, braking, car, sliding_velocity, turning_left, turning_rate

G, MU, V = 9.81, 0.7, 20.0
SHARE = {"front": 1.4 / 2.6, "rear": 1.2 / 2.6}  # share of the weight on the locked axle


@pytest.fixture(scope="module", params=AXLES)
def stop(request):
    """A car turning by a degree a second, to rest."""
    scene = car(locked=request.param, spin=0.02)
    return request.param, scene, simulate_phases(braking(scene), "slide", scene.y0, 60.0, samples=9)


@pytest.mark.slow
def test_straight_braking_is_uniform():
    for locked in AXLES:
        scene = car(locked=locked, spin=0.0)
        a = MU * G * SHARE[locked]
        chain = simulate_phases(braking(scene), "slide", scene.y0, 60.0, samples=9)
        assert chain.ended
        assert abs(chain.t - V / a) < 10 * EXACT
        assert gap(chain.y, [V * V / (2 * a), 0, 0, 0, 0, 0]) < SOLVED
        ts = chain.pieces[0].ts
        assert gap(chain.pieces[0].ys[:, 3], V - a * ts) < 1e-10


@pytest.mark.slow
def test_the_car_comes_to_rest(stop):
    _, _, chain = stop
    assert chain.ended
    # The last sample is at the event, before the part of the stop that is in closed form.
    assert chain.times == (float(chain.t),)
    assert f"0 to {float(chain.t):.6g} s" in repr(chain)
    assert gap(chain.y[3:], np.zeros(3)) == 0
    # It slides to the end and loses energy all the way.
    assert (np.diff(energy.along(energy.energy, chain.pieces[0])) < 0).all()


def rest(locked, speed, spin):
    """Time, place and turn at rest, in the variable z with dt = |u| dz, in which u only decays."""
    s, ahead = (-1.4, 1.2) if locked == "front" else (1.2, -1.4)
    base, m, j = ahead - s, 1000.0, 1500.0 + 1000.0 * s * s
    grip = MU * m * G * SHARE[locked]

    def by_z(_, y):
        v, w, turn = y[:3]
        u = np.hypot(v, base * w)
        c, n = np.cos(turn), np.sin(turn)
        velocity = v * c + s * w * n, v * n - s * w * c
        v_dot = -u * s * w * w - grip * v / m
        w_dot = (u * m * s * v * w - grip * base**2 * w) / j
        return [v_dot, w_dot, u * w, u * velocity[0], u * velocity[1], u]

    start = [speed, spin, 0.0, 0.0, 0.0, 0.0]
    found = solve_ivp(by_z, (0.0, 12.0), start, method="DOP853", rtol=1e-13, atol=1e-16)
    return found.y[[5, 3, 4, 2], -1]


@pytest.mark.slow
@pytest.mark.parametrize("locked", AXLES)
@pytest.mark.parametrize(("speed", "spin"), [(V, 0.02), (V, 1.0), (0.1, 0.3)])
def test_time_and_place_of_rest_are_right_to_the_tolerance(locked, speed, spin):
    """However the car turns: not early by a part of the way, and with no integration into rest."""
    scene = car(locked=locked, speed=speed, spin=spin)
    how = {"rtol": 1e-13, "atol": 1e-13 * speed, "samples": 2, "max_steps": 300}
    chain = simulate_phases(braking(scene), "slide", scene.y0, 60.0, **how)
    assert chain.ended
    assert gap(np.append(chain.t, chain.y[:3]), rest(locked, speed, spin)) < SOLVED * max(1, speed)


@pytest.mark.slow
def test_a_car_at_rest_has_stopped():
    scene = car(speed=0.0, spin=0.0)
    chain = simulate_phases(braking(scene), None, scene.y0, 60.0, samples=2)
    assert chain.ended
    assert chain.t == 0
    assert gap(chain.y, np.zeros(6)) == 0


@pytest.mark.slow
def test_front_locked_goes_straight_and_rear_locked_turns_round(stop):
    locked, _, chain = stop
    if locked == "front":
        assert abs(chain.y[2]) < 0.01
    else:
        assert abs(chain.y[2]) > 2.0
        # It ends nearly backwards, the locked wheels in front.
        assert np.cos(chain.y[2]) < 0


@pytest.mark.slow
def test_the_work_of_friction_is_the_change_of_energy(stop):
    locked, scene, _ = stop
    motion = simulate(work_by_effect.with_work(scene, Effect), 2.0, samples=9, rtol=1e-13)
    kinetic = energy.along(energy.energy, motion)
    work = motion["work of Effect"]
    assert gap((kinetic - kinetic[0]) / kinetic[0], work / kinetic[0]) < SOLVED
    # By hand: mu N times the way of the locked wheels, by a quadrature of its own.
    nodes, weights = np.polynomial.legendre.leggauss(120)
    ahead = scene.effects[0].ahead
    fine = simulate(scene, 2.0, samples=1.0 + nodes, rtol=1e-13).ys
    u = jax.vmap(lambda y: sliding_velocity(ahead, y[:3], y[3:]))(fine)
    way = np.sum(weights * np.linalg.norm(np.asarray(u), axis=1))
    load = 1000.0 * G * SHARE[locked]
    assert abs(work[-1] / (-MU * load * way) - 1) < 1e-9


def test_the_equations_are_those_by_hand():
    # The free axle is s ahead of the centre, so v_centre = V u - s w n in car axes, and
    # m (V' + s w^2) = F_u, and moments about the free axle: J w' = m s V w + base F_n.
    for locked, s, x in (("front", -1.4, 1.2), ("rear", 1.2, -1.4)):
        scene = car(locked=locked, spin=0.3, speed=7.0)
        a = scene.rate(0.0, scene.y0)[3:]
        w, base, m = 0.3, x - s, 1000.0
        u = np.array([7.0, base * w])
        f = -MU * m * G * SHARE[locked] * u / np.linalg.norm(u)
        j = 1500.0 + m * s * s
        turn = (m * s * 7.0 * w + base * f[1]) / j
        # a_centre = (V' + s w^2, V w - s w') in car axes.
        assert gap(a, [f[0] / m, 7.0 * w - s * turn, turn]) < SOLVED


@pytest.mark.slow
def test_without_friction_it_is_the_ideal_car_on_one_skate():
    scene = car(mu=0.0, spin=0.3, m=2.0, inertia=0.7)
    assert scene.effects == ()
    ideal = one_skate(m=2.0, inertia=0.7, at=(1.2, 0.0), speed=20.0, spin=0.3)
    assert gap(scene.rate(0.0, scene.y0), ideal.rate(0.0, ideal.y0)) == 0
    assert energy.drift(simulate(scene, rtol=1e-13)) < SOLVED
    with pytest.raises(ValueError, match="scene: expected a car with a locked axle, got none"):
        braking(scene)


def test_without_friction_a_turning_grows_undamped():
    """The rate is the limit for little friction; what never slows down has no fraction left."""
    smooth, rough = car(mu=0.0), car(mu=1e-9)
    assert abs(turning_rate(smooth, 20.0) - turning_rate(rough, 20.0)) < 1e-8
    with pytest.raises(ValueError, match="scene: expected a car with a locked axle, got none"):
        turning_left(smooth, 10.0)


@pytest.mark.sample("rear")
@pytest.mark.parametrize("locked", AXLES)
def test_the_criterion_is_the_linearised_motion(locked):
    @jax.jit
    @jax.grad
    def slope(w, speed):
        scene = car(locked=locked, speed=speed, spin=w)
        return scene.rate(0.0, scene.y0)[5]

    for speed in (2.0, 20.0):
        rate = slope(0.0, speed)
        assert abs(rate - turning_rate(car(locked=locked), speed)) < SOLVED


def test_front_locked_is_stable_and_rear_locked_unstable_above_a_speed():
    speeds = np.linspace(0.1, 60.0, 100)
    assert (np.asarray([turning_rate(car(locked="front"), v) for v in speeds[::9]]) < 0).all()
    rear = car(locked="rear")
    critical = np.sqrt(MU * G * 2.6)
    assert turning_rate(rear, 1.01 * critical) > 0
    assert turning_rate(rear, 0.99 * critical) < 0
    assert abs(turning_rate(rear, critical)) < 100 * EXACT


@pytest.mark.parametrize("locked", AXLES)
def test_a_small_turning_grows_as_its_closed_form_says(locked):
    spin = 1e-8
    scene = car(locked=locked, spin=spin)
    motion = simulate(scene, 1.0, samples=9, rtol=1e-13, atol=1e-22)
    left = turning_left(scene, motion.ys[:, 3])
    assert left[-1] > 1000 if locked == "rear" else left[-1] < 0.1
    # What is neglected is of the order of the angle's square.
    assert gap(motion["theta_dot"] / (spin * left), np.ones(9)) < 1e-8


def test_impossible_cars_are_refused():
    with pytest.raises(ValueError, match="locked: expected one of front, rear, got 'fron'"):
        car(locked="fron")
    with pytest.raises(ValueError, match=r"mu: expected > 0, got -0\.7"):
        simulate(car(mu=-0.7))
    with pytest.raises(ValueError, match=r"load: expected > 0"):
        simulate(car(g=-1.0))


@pytest.mark.slow
def test_a_state_at_rest_has_finite_rates_and_gradients():
    scene = car()
    rest = jnp.zeros(6)
    assert gap(scene.rate(0.0, rest), rest) == 0
    assert np.isfinite(jax.jacrev(lambda y: scene.rate(0.0, y))(rest)).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: scenes.car(to_front=-1.4), "to_front: expected > 0, got -1.4"),
        (lambda: scenes.car(to_rear=0.0), "to_rear: expected > 0, got 0.0"),
    ],
)
def test_an_invalid_start_is_refused_by_name(make, message):
    assert refusal(make).startswith(message)


@pytest.mark.slow
def test_a_car_on_ice_stops_after_two_days():
    # Its yaw rate decays within a second: a stiff motion of 1.5e5 s.
    scene = car(locked="front", mu=2.5e-5, spin=0.01)
    chain = simulate_phases(braking(scene), "slide", scene.y0, 1e6, samples=3)
    assert chain.ended
    assert abs(chain.t * 2.5e-5 * G * SHARE["front"] / V - 1) < 1e-6  # it turns by 0.07 degrees
    assert abs(chain.y[2] - 1.2357e-3) < 1e-7  # as on other ice: what it turns is soon over
