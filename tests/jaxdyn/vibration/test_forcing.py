"""Responses in time to steps, impulses, sweeps and tables, against closed forms."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from vibrating import C, K, M, one, quarter_car

import jaxdyn
from jaxdyn import scenes, vibration

W = np.sqrt(K / M - (C / (2 * M)) ** 2)
DECAY = C / (2 * M)


def step_response(t):
    return (1 - np.exp(-DECAY * t) * (np.cos(W * t) + DECAY / W * np.sin(W * t))) / K


def test_the_response_to_a_step_is_the_closed_form():
    scene = vibration.drive(one(), "x", vibration.Step(2.0, 1.0), 6.0)
    motion = jaxdyn.simulate(scene)
    t = np.asarray(motion.ts)
    known = np.where(t > 1, 2 * step_response(t - 1), 0.0)
    assert_allclose(motion["x"], known, atol=1e-11)


def test_the_response_to_an_impulse_is_the_rate_of_that_to_a_step():
    motion = jaxdyn.simulate(vibration.strike(one(), "x", 3.0), 6.0)
    t = np.asarray(motion.ts)
    assert_allclose(motion["x"], 3 / (M * W) * np.exp(-DECAY * t) * np.sin(W * t), atol=1e-11)
    short = vibration.Pulse(3.0 * np.pi / 2 / 1e-4, 1e-4)
    pulsed = jaxdyn.simulate(vibration.drive(one(), "x", short, 6.0))
    assert_allclose(pulsed["x"][1:], motion["x"][1:], atol=3e-4)


def test_a_harmonic_response_settles_to_the_receptance():
    omega = 1.7
    h = complex(vibration.receptance(one(), "x", "x", omega))
    drive = vibration.Harmonic(0.5, omega, 0.3)
    start = [(0.5 * h * np.exp(-0.3j)).real, (0.5j * omega * h * np.exp(-0.3j)).real]
    motion = jaxdyn.simulate(vibration.drive(one(), "x", drive, 9.0).starting(start))
    known = 0.5 * h * np.exp(1j * (omega * np.asarray(motion.ts) - 0.3))
    assert_allclose(motion["x"], known.real, atol=1e-11)


def test_a_sweep_and_a_moving_base_agree_with_another_integrator():
    sweep = vibration.Sweep(1.0, 0.5, 4.0, 20.0)
    motion = jaxdyn.simulate(vibration.drive(one(), vibration.Base([1.0]), sweep, 20.0))
    assert float(sweep.omega(20.0)) == 4.0

    def rate(t, y):
        return [y[1], -(K * y[0] + C * y[1]) / M - np.sin((0.5 + 3.5 * t / 40) * t)]

    run = solve_ivp(rate, (0, 20), [0, 0], "DOP853", rtol=1e-12, atol=1e-13)
    assert_allclose(motion.ys[-1], run.y[:, -1], atol=1e-10)


def test_an_imbalance_that_runs_up_has_the_integral_of_duhamel():
    """Past the end of the run-up; by parts, since the force is the rate of the rate of g."""
    moment, low, high, duration, phase, t = 0.3, 0.2, 4.0, 6.0, 0.7, 8.0
    signal = vibration.Imbalance(moment, low, high, duration, phase)
    motion = jaxdyn.simulate(vibration.drive(one(), "x", signal), t, rtol=1e-12)

    def g(t):
        angle = low * t + (high - low) * t**2 / 12 if t < 6 else 12.6 + high * (t - 6)
        return -moment * mpmath.cos(angle - phase)

    def kernel(t):
        return mpmath.exp(-DECAY * t) * mpmath.sin(W * t) / (M * W)

    def rate(t):
        return mpmath.exp(-DECAY * t) * mpmath.cos(W * t) / M - DECAY * kernel(t)

    def bent(s):
        return -g(s) * (C * rate(t - s) + K * kernel(t - s)) / M

    ends = g(t) / M - g(0) * rate(t) + moment * low * np.sin(phase) * kernel(t)
    known = mpmath.quad(bent, range(0, 9, 2)) + ends
    assert abs(float(known) - float(motion["x"][-1])) < 1e-11


def test_an_imbalance_at_constant_speed_grows_with_its_square():
    omega = np.array([1.0, 3.0])
    for w in omega:
        signal = vibration.Imbalance(0.5, w, w, 1.0)
        t = np.linspace(0.0, 3.0, 7)
        assert_allclose(jax.vmap(signal)(t), 0.5 * w**2 * np.cos(w * t), atol=1e-14)
        assert_allclose(signal.omega(2.0), w)


def road():
    ts = np.linspace(0.0, 20.0, 401)
    return ts, np.cumsum(np.random.default_rng(0).standard_normal(401)) * 0.01


def test_a_road_is_taken_line_by_line():
    """By the matrix exponential of each line; the road acts by its height and by its slope."""
    ts, heights = road()
    scene = vibration.drive(
        quarter_car(0.0, 0.0), vibration.Motion(quarter_car), vibration.Table(ts, heights)
    )
    motion = jaxdyn.simulate(scene, 20.0, samples=401)
    assert motion.warning == ""
    assert motion.rejected < 20  # of some 2500 steps
    a = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-20, 20, -2, 2], [200, -2200, 20, -25.0]])
    y, known = np.zeros(4), [np.zeros(4)]
    for i in range(400):
        slope = (heights[i + 1] - heights[i]) / (ts[i + 1] - ts[i])
        whole = np.zeros((6, 6))
        whole[:4, :4], whole[3, 4], whole[3, 5], whole[4, 5] = a, 2000.0, 5.0, 1.0
        y = (expm(whole * (ts[i + 1] - ts[i])) @ [*y, heights[i], slope])[:4]
        known.append(y)
    assert_allclose(motion.ys, known, atol=1e-10)


def test_a_table_costs_two_steps_a_line_and_no_rejected_one():
    ts, heights = road()
    scene = vibration.drive(one(), "x", vibration.Table(ts, heights), 20.0)
    motion = jaxdyn.simulate(scene)
    assert motion.rejected == 0
    assert motion.steps <= 3 * 400


def test_responses_are_differentiable_in_the_signal_and_mapped_over():
    def end(height):
        scene = vibration.drive(one(), "x", vibration.Step(height), 1.0)
        return jaxdyn.solve(scene, 1.0).y1[0]

    assert_allclose(jax.grad(end)(2.0), step_response(1.0), rtol=1e-9)
    assert_allclose(jax.vmap(end)(jnp.array([1.0, 2.0])), step_response(1.0) * np.array([1, 2]))


def test_a_driven_scene_is_what_it_was_otherwise():
    scene = scenes.pendulum(angle=0.1)
    held = vibration.drive(scene, "theta", vibration.Step(0.0))
    assert held.labels() == scene.labels()
    assert_allclose(jaxdyn.simulate(held).ys, jaxdyn.simulate(scene).ys, rtol=0, atol=1e-10)
    assert_allclose(
        jaxdyn.analysis.energy.energy(held, 0.0, held.y0),
        jaxdyn.analysis.energy.energy(scene, 0.0, scene.y0),
    )


def test_a_step_moves_a_base_without_a_damper():
    def moved(t, y, u):
        return [y[1], -K / M * (y[0] - u)]

    def base(u, du):
        return jaxdyn.ode(moved, [0.0, 0.0], params=u, names=["x", "v"])

    rise = vibration.drive(base(0.0, 0.0), vibration.Motion(base), vibration.Step(0.1))
    known = 0.1 * (1 - np.cos(np.sqrt(K / M)))
    assert_allclose(jaxdyn.simulate(rise, 1.0)["x"][-1], known, rtol=1e-10)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: vibration.drive(one(), "x", jnp.sin), "signal: expected a signal"),
        (
            lambda: vibration.drive(one(), "x", vibration.Pulse(1.0, 0.0)),
            "Pulse.duration: expected > 0",
        ),
        (
            lambda: vibration.drive(one(), "x", vibration.Sweep(1.0, 1.0, 2.0, 0.0)),
            "Sweep.duration: expected > 0",
        ),
        (
            lambda: vibration.drive(one(), "x", vibration.Imbalance(1.0, 1.0, 2.0, 0.0)),
            "Imbalance.duration: expected > 0",
        ),
        (
            lambda: vibration.drive(one(), "x", vibration.Table([0.0, 0.0], [1.0, 2.0])),
            "Table.ts: expected increasing times",
        ),
        (
            lambda: vibration.drive(one(), "x", vibration.Table([0.0, 1.0], [1.0])),
            "Table.values: expected shape",
        ),
        (
            lambda: vibration.Table(["0", "1"], [1.0, 2.0]),
            r"Table.ts: expected numbers, got \['0', '1'\]. jaxdyn.read_csv reads",
        ),
        (lambda: vibration.Table([0.0, 1.0], "ab"), "Table.values: expected numbers, got 'ab'"),
        (
            lambda: vibration.drive(
                quarter_car(0.0, 0.0), vibration.Motion(quarter_car), vibration.Step(0.1)
            ),
            "signal: expected one without a jump, since the scene of Motion depends on its rate",
        ),
        (
            lambda: vibration.strike(quarter_car(0.0, 0.0), vibration.Motion(quarter_car), 1.0),
            "input: expected one that may jump",
        ),
    ],
)
def test_misuse_is_refused_with_what_to_do(call, said):
    with pytest.raises(ValueError, match=said):
        call()


def test_a_traced_table_whose_times_do_not_increase_gives_nan():
    def end(times):
        table = vibration.Table(times, jnp.array([0.0, 1.0, 0.0]))
        driven = vibration.drive(scenes.pendulum(), vibration.Base([1.0, 0.0]), table)
        return jaxdyn.solve(driven, 2.0).y1

    right = jnp.array([0.0, 0.4, 0.8])
    assert (jax.jit(end)(right) == end(right)).all()
    assert jnp.isnan(jax.jit(end)(right[jnp.array([0, 2, 1])])).all()
    with pytest.raises(ValueError, match="increasing times"):
        end(right[jnp.array([0, 2, 1])])
