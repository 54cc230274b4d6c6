"""Rates with conditions, pulses and tables: closed forms, SciPy's DOP853 piece by piece, mpmath."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import effects, ensemble, scenes, solvers
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate import events
from jaxdyn.status import Status

#: By mpmath's quadrature of exp(-((t - 10) / p)^2) sin(20 - t) and cos(20 - t).
KICKED_AT_REST = (-0.190931568430, -0.294483504159)
KICKED = (0.311897592517, -1.061295467494)


def kick(t, y, p):
    return [y[1], -y[0] + jnp.exp(-(((t - 10) / p) ** 2))]


def modulated(t, y):
    return [(jnp.where(jnp.mod(t, 1e-3) < 5e-5, 1.0, 0.0) - y[0]) / 0.1]


def pushed(on, off=5.5):
    """A particle at rest that is pushed by 1 N from one time to another."""
    forces = (effects.StepForce(jnp.ones(1), on), effects.StepForce(-jnp.ones(1), off))
    return jaxdyn.Scene(FreePoints(jnp.ones(1), 1), forces, y0=jnp.zeros(2), t1=10.0)


def stuck(t, y, p):
    return [y[1], -y[0] - p * jnp.sign(y[1])]


def contact(t, y, p):
    return [y[1], p * jnp.maximum(0.0, -y[0]) ** 1.5 - 9.81]


METHODS = [None, solvers.VERNER9, solvers.DOPRI8, solvers.TAYLOR16, solvers.RADAU9]


@pytest.mark.sample("Verner 9(8)")
@pytest.mark.parametrize("solver", METHODS, ids=lambda m: m.name if m else "default")
def test_a_pulse_is_seen_by_every_method(solver):
    run = jaxdyn.simulate(jaxdyn.ode(kick, [1.0, 0.0], 20.0, params=0.1), solver=solver, samples=2)
    assert np.allclose(run.ys[-1], KICKED, rtol=0, atol=1e-8)


@pytest.mark.sample("2000")
@pytest.mark.parametrize("samples", [2, 50, 2000])
def test_a_pulse_at_rest_with_digits(samples):
    scene = jaxdyn.ode(kick, [0.0, 0.0], 20.0, params=0.2)
    run = jaxdyn.simulate(scene, digits=10, samples=samples)
    assert np.allclose(run.ys[-1], KICKED_AT_REST, rtol=0, atol=2e-12)


@pytest.mark.slow
def test_a_pulse_whose_tails_are_rounding():
    # tanh cancels to its rounding before the pulse, and a motion at rest has no size of its own.
    def rate(t, y):
        u = (t - 10.0) / 0.01
        return [y[1], -y[0] + 0.5 * (jnp.tanh(u + 1.0) - jnp.tanh(u - 1.0))]

    run = jaxdyn.simulate(jaxdyn.ode(rate, [0.0, 0.0], 20.0))
    # Its area is 2 w, and its second moment moves the phase by less than w^2.
    assert np.allclose(run.ys[-1], 0.02 * np.array([np.sin(10), np.cos(10)]), rtol=1e-4)
    assert run.steps < 100


@pytest.mark.parametrize("width", [1e-2, 1e-4, 2e-5])
def test_pulses_down_to_a_millionth_of_the_span(width):
    # An impulse of width sqrt(pi) at t = 10, but for the square of the width.
    run = jaxdyn.solve(jaxdyn.ode(kick, [0.0, 0.0], 20.0, params=width), 20.0)
    impulse = width * np.sqrt(np.pi) * np.exp(-(width**2) / 4)
    assert np.allclose(run.y1, impulse * np.array([np.sin(10), np.cos(10)]), rtol=1e-6)


@pytest.mark.sample("0.001")
@pytest.mark.parametrize("width", [0.3, 1e-3])
def test_a_pulse_that_moves_past_the_motion(width):
    def rate(t, y, p):
        return [y[1], -y[0] + jnp.exp(-(((y[0] + 3.0 * (t - 10.3)) / p) ** 2))]

    run = jaxdyn.simulate(jaxdyn.ode(rate, [0.1, 0.0], 20.0, params=width), samples=2)
    # DOP853 with steps of at most a third of the width.
    expected = {0.3: (-0.00194847, -0.25357263), 1e-3: (0.0406633, -0.09185177)}[width]
    assert np.allclose(run.ys[-1], expected, rtol=0, atol=1e-8)
    assert run.steps < 60


@pytest.mark.slow
def test_a_pulse_in_ensembles_events_and_derivatives():
    scene = jaxdyn.ode(kick, [1.0, 0.0], 20.0, params=0.1)
    ends = ensemble.run(scene, np.array([[1.0, 0.0], [0.0, 0.0]]), 20.0)
    assert np.allclose(ends.y1[0], KICKED, rtol=0, atol=1e-8)
    rest = jaxdyn.ode(kick, [0.0, 0.0], 20.0, params=0.1)
    stop = events.until(rest, events.Reaches(0, 0.05, 1))
    impulse = 0.1 * np.sqrt(np.pi) * np.exp(-0.0025)
    assert abs(stop.t - (10 + np.arcsin(0.05 / impulse))) < 1e-4
    gradient = jax.grad(end_of)(0.1)
    expected = np.sqrt(np.pi) * np.exp(-0.0025) * (1 - 0.01 / 2) * np.sin(10)
    assert abs(gradient - expected) < 1e-8


def end_of(width):
    return jaxdyn.solve(jaxdyn.ode(kick, [0.0, 0.0], 20.0, params=width), 20.0).y1[0]


@pytest.mark.sample("200")
@pytest.mark.parametrize("samples", [2, 200, 2000])
def test_pulse_width_modulation(samples):
    run = jaxdyn.simulate(jaxdyn.ode(modulated, [0.0], 0.3), samples=samples)
    assert abs(run.ys[-1, 0] - 0.047285309612386) < 1e-13
    assert run.rejected == 0


def test_forces_that_are_switched_on_and_off():
    run = jaxdyn.simulate(pushed(5.0))
    assert np.allclose(run.ys[-1], (2.375, 0.5), rtol=0, atol=1e-14)
    stop = events.until(pushed(5.0), events.Reaches(0, 1.1875))
    assert abs(stop.t - 7.625) < 1e-14
    at = jnp.array([4.0, 5.0, 5.25, 5.5, 9.0])
    expected = np.array([0, 0, 0.25**2 / 2, 0.125, 0.125 + 0.5 * 3.5])
    assert np.allclose(jaxdyn.simulate(pushed(5.0), samples=at).ys[:, 0], expected, atol=1e-14)


@pytest.mark.sample("True")
@pytest.mark.parametrize("adjoint", [False, True])
def test_derivatives_by_a_switching_time(adjoint):
    def end(on):
        return jaxdyn.solve(pushed(on, 20.0), 10.0, adjoint=adjoint).y1[0]

    assert abs(jax.grad(end)(3.0) + 7) < 1e-12
    if not adjoint:
        assert abs(jax.jacfwd(end)(3.0) + 7) < 1e-12
        assert abs(jax.grad(jax.grad(end))(3.0) - 1) < 1e-12


@pytest.mark.slow
def test_derivatives_of_events_by_a_switching_time():
    when = lambda on: events.until(pushed(on, 20.0), events.Reaches(0, 1.1875)).t  # noqa: E731
    assert abs(jax.grad(when)(3.0) - 1) < 1e-12


@pytest.mark.slow
def test_a_fit_of_a_switching_time():
    at = jnp.linspace(4.0, 10.0, 13)
    measured = jaxdyn.solve(pushed(3.217, 20.0), 10.0, ts=at).ys[:, 0]
    residual = lambda on: jaxdyn.solve(pushed(on, 20.0), 10.0, ts=at).ys[:, 0] - measured  # noqa: E731
    on = 2.0
    for _ in range(8):
        slope = jax.jacfwd(residual)(on)
        on = on - slope @ residual(on) / (slope @ slope)
    assert abs(on - 3.217) < 1e-10


@pytest.mark.sample("50")
@pytest.mark.parametrize("samples", [2, 50, 2000])
def test_a_table_with_a_spike(samples):
    knots = np.linspace(0.0, 14.0, 141)
    heights = np.zeros(141)
    heights[70] = 1.0
    table = lambda t, y: [jnp.interp(t, knots, heights) - y[0]]  # noqa: E731
    run = jaxdyn.simulate(jaxdyn.ode(table, [0.0], 14.0), samples=samples)
    # A triangle of half width 0.1 about t = 7.
    triangle = 2 * (np.cosh(0.1) - 1) / 0.1
    assert abs(run.ys[-1, 0] - triangle * np.exp(-7.0)) < 1e-16


def test_a_spring_of_a_table():
    def rate(t, y, forces):
        return [y[1], jnp.interp(y[0], jnp.array([-1.0, 0.0, 1.0]), forces)]

    # Of stiffness 4 on one side and 1 on the other, where the force is constant beyond 1.
    spring = jaxdyn.ode(rate, [1.5, 0.0], 2 + np.pi, params=jnp.array([4.0, 0.0, -1.0]))
    for times in (1, 10):
        run = jaxdyn.simulate(spring, times * (2 + np.pi), rtol=1e-14)
        assert np.allclose(run.ys[-1], (1.5, 0.0), rtol=0, atol=1e-13 * times)

    def end(stiffness):
        varied = jaxdyn.ode(rate, [1.5, 0.0], 1.0, params=jnp.array([stiffness, 0.0, -1.0]))
        return jaxdyn.solve(varied, 2 + np.pi).y1

    # Half a period on that side is pi / sqrt(4), and the acceleration at the end -1.
    assert np.allclose(jax.jacfwd(end)(4.0), (0.0, -np.pi / 16), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_contact_stiffness_and_its_derivative():
    scene = jaxdyn.ode(contact, [1.0, 0.0], 3.0, params=1e6)
    run = jaxdyn.simulate(scene, rtol=1e-12)
    # DOP853 at 1e-13 in contact, parabolas between.
    assert np.allclose(run.ys[-1], (0.66267798318763, -2.57259751415525), rtol=1e-10)


@pytest.mark.slow
def test_dry_friction_sticks():
    run = jaxdyn.simulate(jaxdyn.ode(stuck, [2.05, 0.0], 20.0, params=0.3))
    assert np.allclose(run.ys[-1], (-0.25, 0.0), rtol=0, atol=1e-10)
    assert run.steps < 100
    # Each of three half swings takes 2 p off the amplitude.
    end = lambda p: jaxdyn.solve(jaxdyn.ode(stuck, [2.05, 0.0], 20.0, params=p), 20.0).y1[0]  # noqa: E731
    assert abs(jax.grad(end)(0.3) - 6) < 1e-9
    held = jaxdyn.simulate(jaxdyn.ode(stuck, [-0.2, 0.0], 20.0, params=0.3))
    assert np.allclose(held.ys, [-0.2, 0.0], rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [None, 1e-13])
def test_a_start_that_sticks_to_a_belt_keeps_the_tolerance(rtol):
    # On the surface the least rounding turns the friction; that is no rounding of the force.
    scene = scenes.oscillator(x=0.0, v=0.5) + effects.DryFriction(0.3, 1.0, belt=[0.5])
    for t in (0.5, 2.0, 4.0, 6.0):
        end = jaxdyn.solve(scene, t, rtol=rtol or 1e-10).y1
        turn = t - 0.6  # it slips where the spring pulls with 0.3
        slips = [0.3 + 0.5 * np.sin(turn), 0.5 * np.cos(turn)]
        wanted = slips if turn > 0 else [0.5 * t, 0.5]
        assert np.allclose(end, wanted, rtol=0, atol=1e-14 if rtol else 1e-11)


@pytest.mark.slow
def test_of_two_blocks_at_rest_each_sticks_or_slips():
    # A stretched spring pulls both with 0.75 N; the lighter one, of 1 kg, starts to slip.
    def end(most, throw=True):
        blocks, spring = FreePoints(jnp.array([3.0, 1.0]), 1), effects.Spring(0.5, 1.0, i=0, j=1)
        pair = spring, effects.DryFriction(1.0, most)
        start = jnp.array([0.0, 2.5, 0.0, 0.0])
        return jaxdyn.simulate(jaxdyn.Scene(blocks, pair, y0=start), 0.5, throw=throw)

    w = np.sqrt(0.5)
    wanted = [0.0, 1.2 + 1.3 * np.cos(w / 2), 0.0, -1.3 * w * np.sin(w / 2)]
    assert np.allclose(end([1.0, 0.1]).ys[-1], wanted, rtol=0, atol=1e-11)
    w = np.sqrt(0.5 / 3)
    wanted = [0.1 * (1 - np.cos(w / 2)), 2.5, 0.1 * w * np.sin(w / 2), 0.0]
    assert np.allclose(end([0.7, 1.0]).ys[-1], wanted, rtol=0, atol=1e-11)
    assert np.allclose(end([1.0, 1.0]).ys, [0.0, 2.5, 0.0, 0.0], rtol=0, atol=1e-15)


@pytest.mark.slow
def test_a_force_that_jumps_breaks_a_block_loose():
    def pushed(t, y, p):
        return [y[1], jnp.where(t < 1.0, 0.0, p) - 0.3 * jnp.sign(y[1])]

    run = jaxdyn.simulate(jaxdyn.ode(pushed, [0.0, 0.0], 3.0, params=0.7))
    assert np.allclose(run.ys[-1], (0.8, 0.8), rtol=0, atol=1e-14)


@pytest.mark.slow
def test_a_block_at_rest_breaks_loose_where_a_force_has_grown():
    # At rest what rounding leaves of forces in balance is no motion.
    def driven(t, y, p):
        return [y[1], p * jnp.sin(t) - 0.3 * jnp.sign(y[1])]

    run = jaxdyn.simulate(jaxdyn.ode(driven, [0.0, 0.0], 3.0, params=0.7))
    start = np.arcsin(3 / 7)
    speed = 0.7 * (np.cos(start) - np.cos(3.0)) - 0.3 * (3.0 - start)
    assert abs(run.ys[-1, 1] - speed) < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("x", [0.9, 1.0])
def test_two_blocks_that_stick_and_derivatives_where_both_turn_at_once(x):
    # Each half swing takes 2 p off an amplitude, until it is below p.
    def end(y0, p):
        rate = lambda t, y, p: jnp.concatenate([y[2:], -y[:2] - p * jnp.sign(y[2:])])  # noqa: E731
        return jaxdyn.solve(jaxdyn.ode(rate, y0, 12.0, params=p), 12.0).y1

    given = jnp.array([1.0, x, 0.0, 0.0]), 0.3
    second = {0.9: (-0.3, -1.0, 2.0), 1.0: (-0.2, 1.0, -4.0)}[x]
    assert np.allclose(end(*given), [-0.2, second[0], 0.0, 0.0], rtol=0, atol=1e-10)
    by_start, by_force = jax.jacfwd(end, (0, 1))(*given)
    wanted = np.diag([1.0, second[1], 0.0, 0.0])
    assert np.allclose(by_start, wanted, rtol=0, atol=1e-9)
    assert np.allclose(by_force, [-4.0, second[2], 0.0, 0.0], rtol=0, atol=1e-9)


@pytest.mark.slow
def test_derivatives_of_a_motion_that_starts_held():
    # A small velocity is stopped at once.
    end = lambda y0: jaxdyn.solve(jaxdyn.ode(stuck, y0, 1.0, params=0.3), 1.0).y1  # noqa: E731
    assert np.allclose(jax.jacfwd(end)(jnp.array([0.1, 0.0])), [[1, 0], [0, 0]], atol=1e-14)

    # Beside the surface it takes d until it slides at 2/3, at 1 instead, or -d / 2 at 0.
    rate = lambda t, y: [jnp.where(y[0] > 0, -1.0, 2.0), jnp.where(y[0] > 0, 1.0, 0.0)]  # noqa: E731
    end = lambda y0: jaxdyn.solve(jaxdyn.ode(rate, y0, 1.0), 1.0).y1  # noqa: E731
    assert np.allclose(end(jnp.zeros(2)), [0, 2 / 3], rtol=0, atol=1e-15)
    assert np.allclose(jax.jacfwd(end)(jnp.zeros(2)), [[0, 0], [1 / 3, 1]], rtol=0, atol=1e-14)


@pytest.mark.slow
def test_blocks_on_each_other_slide_together_and_then_apart():
    # The upper one is pulled with t / 2: both slide from t = 2, apart from t = 5.
    def pulled(t, y):
        below, between = jnp.sign(y[2]), 2.0 * jnp.sign(y[3] - y[2])
        return [y[2], y[3], (between - below) / 2.0, 0.5 * t - between]

    run = jaxdyn.simulate(jaxdyn.ode(pulled, jnp.zeros(4), 7.0))
    v, x = (0.25 * 21 - 3) / 3, ((125 - 8) / 12 - 3 - 4.5) / 3
    wanted = [x + 2 * v + 1, x + 2 * v + (7**3 - 125) / 12 - 12.5 - 4, v + 1, v + 2]
    assert np.allclose(run.ys[-1], wanted, rtol=0, atol=1e-13)
    assert run.steps < 10


@pytest.mark.slow
def test_derivatives_by_times_of_a_block_that_starts_from_rest_and_is_held():
    """It is released at a distance a, follows f + (a - f) cos(t - t0), and stays at -0.25."""

    def states(t0, ts, adjoint=False):
        scene = jaxdyn.ode(stuck, [2.05, 0.0], 20.0, params=0.3)
        run = jaxdyn.solve(scene, ts[-1], t0=t0, ts=ts, rtol=1e-12, adjoint=adjoint)
        return jnp.concatenate([run.ys, run.y1[None]])

    def exactly(t0, ts):
        t = jnp.where(ts < 10, ts, 0.0) - t0
        moving = jnp.stack([0.3 + 1.75 * jnp.cos(t), -1.75 * jnp.sin(t)], 1)
        ys = jnp.where(ts[:, None] < 10, moving, jnp.array([[-0.25, 0.0]]))
        return jnp.concatenate([ys, ys[-1:]])

    for ts in (jnp.array([0.0, 1.0, 2.5]), jnp.array([1.0, 11.0, 20.0])):
        for derivative in (jax.jacfwd, jax.jacrev):
            found = derivative(states, (0, 1))(0.0, ts)
            for a, b in zip(found, derivative(exactly, (0, 1))(0.0, ts), strict=True):
                assert np.allclose(a, b, rtol=0, atol=1e-10)
    ts = jnp.array([0.0, 1.0, 2.5])
    by_t0, by_ts = jax.grad(lambda *at: jnp.sum(states(*at, adjoint=True)), (0, 1))(0.0, ts)
    exact = jax.grad(lambda *at: jnp.sum(exactly(*at)), (0, 1))(0.0, ts)
    assert np.allclose(by_t0, exact[0], rtol=0, atol=1e-10)
    assert np.allclose(by_ts, exact[1], rtol=0, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.hessian])
def test_derivatives_of_a_motion_that_goes_on_from_where_it_turned(derivative):
    """In two runs, the second from where the first was stopped, as in one."""

    def end(x):
        block = jaxdyn.ode(stuck, jnp.stack([x[0], 0.0]), 20.0, params=x[1])
        turn = events.until(block, events.Reaches(1, 0.0), 20.0, rtol=1e-12)
        return jaxdyn.solve(block.starting(turn.y), 4.0, t0=turn.t, rtol=1e-12).y1

    def exactly(x):
        turned, t = 2 * x[1] - x[0], 4.0 - jnp.pi
        away = turned + x[1]
        return jnp.stack([away * jnp.cos(t) - x[1], -away * jnp.sin(t)])

    x = jnp.array([2.05, 0.3])
    assert np.allclose(derivative(end)(x), derivative(exactly)(x), rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.0, 1e-14, -1e-14])
def test_derivatives_of_two_runs_that_join_where_friction_turns_round(late):
    """They are those of one run, in whichever order rounding sees the turn and the join."""

    def end(x, joint):
        block = jaxdyn.ode(stuck, x[:2], 20.0, params=x[2])
        there = jaxdyn.solve(block, joint, rtol=1e-12).y1
        return jaxdyn.solve(block.starting(there), 4.0, t0=joint, rtol=1e-12).y1

    def in_one(x):
        return jaxdyn.solve(jaxdyn.ode(stuck, x[:2], 20.0, params=x[2]), 4.0, rtol=1e-12).y1

    x, joint = jnp.array([5.05, -0.2, 0.3]), jnp.pi - jnp.arctan(0.2 / 4.75) + late
    by_x, by_joint = jax.jacfwd(end, (0, 1))(x, joint)
    assert np.allclose(by_x, jax.jacfwd(in_one)(x), rtol=0, atol=1e-10)
    assert np.allclose(by_joint, 0.0, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_adjoints_by_switching_times_at_samples_and_fractions_of_the_span():
    """A particle is pushed from `on`; the gradient is integrated backwards between fixed times."""

    def ends(on, ts, adjoint=True):
        scene = jaxdyn.ode(lambda t, y, on: [y[1], t > on], [0.0, 0.0], 10.0, params=on)
        run = jaxdyn.solve(scene, 10.0, ts=ts, adjoint=adjoint)
        return run.y1[0] + jnp.sum(run.ys[:, 0])

    for on in (2.5, 5.0, 4.0):
        ts = jnp.array([1.0, 4.0, 6.0, 7.5])
        assert abs(jax.grad(ends)(on, ts[:0]) + 10 - on) < 1e-12
        wanted = -(10 - on) - float(jnp.sum(jnp.maximum(ts - on, 0)))
        assert abs(jax.grad(ends)(on, ts) - wanted) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("adjoint", [False, True])
def test_derivatives_where_two_surfaces_are_crossed_at_once(adjoint):
    # Two oscillators with dry friction, apart: each turns where it would turn alone.
    def end(y0):
        rate = lambda t, y: jnp.concatenate([y[2:], -y[:2] - 0.1 * jnp.sign(y[2:])])  # noqa: E731
        return jaxdyn.solve(jaxdyn.ode(rate, y0, 4.0), 4.0, adjoint=adjoint).y1[0]

    both, second = (jax.grad(end)(jnp.array([1.0, x, -0.1, -0.1])) for x in (1.0, 0.9))
    assert np.allclose(both, second, rtol=0, atol=1e-9)
    assert np.allclose(both[1::2], 0.0, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_a_derivative_that_depends_on_the_order_of_crossings_is_nan():
    # Each is faster once the other has passed 0: in a state beside it one of them passes first.
    def end(y0):
        rate = lambda t, y: 1.0 + jnp.where(y[::-1] > 0, jnp.array([1.0, 0.5]), 0.0)  # noqa: E731
        return jaxdyn.solve(jaxdyn.ode(rate, y0, 2.0), 2.0).y1[0]

    value, slope = jax.value_and_grad(end)(jnp.array([-1.0, -1.0]))
    assert abs(value - 2.0) < 1e-14
    assert np.isnan(slope).all()
    assert np.isfinite(jax.grad(end)(jnp.array([-1.0, -1.001]))).all()


@pytest.mark.slow
def test_adjoints_through_sliding_are_refused_and_others_are_right():
    def banged(t, y, p):
        return [y[1], -y[0] - p * jnp.where(y[0] > 0.2, 1.0, -0.5) - 0.1 * y[1]]

    def end(p, rate, y0, adjoint):
        return jaxdyn.solve(jaxdyn.ode(rate, y0, 1.0, params=p), 10.0, adjoint=adjoint).y1[0]

    both = [jax.grad(end)(0.4, banged, [1.0, 0.0], adjoint) for adjoint in (False, True)]
    assert abs(both[0] - both[1]) < 1e-10
    assert np.isnan(jax.grad(end)(0.3, stuck, [2.05, 0.0], True))


@pytest.mark.slow
@pytest.mark.parametrize("t1", [3.0, 6.0])
def test_adjoints_of_play_between_gears_from_rest(t1):
    def driven(t, y, p):
        d = y[0] - y[1]
        torque = 50 * (d - jnp.clip(d, -p, p))
        return [y[2], y[3], jnp.cos(2 * t) - torque - 0.1 * y[2], torque - 0.2 * y[3]]

    def end(y0, p, adjoint=False):
        return jaxdyn.solve(jaxdyn.ode(driven, y0, t1, params=p), t1, adjoint=adjoint).y1[0]

    given = jnp.zeros(4), 0.1
    forwards = jax.jacfwd(end, (0, 1))(*given)
    backwards = jax.grad(lambda *given: end(*given, adjoint=True), (0, 1))(*given)
    assert np.allclose(backwards[0], forwards[0], rtol=1e-7)
    assert np.allclose(backwards[1], forwards[1], rtol=1e-7)


@pytest.mark.slow
def test_many_short_pieces_are_not_stiff():
    rate = lambda t, y: [y[1], -y[0] - 0.3 * jnp.maximum(y[0], 0.0)]  # noqa: E731
    run = jaxdyn.simulate(jaxdyn.ode(rate, [1.0, 0.0], 500.0), samples=2)
    assert run.steps + run.rejected > 1000
    assert not run.stiff
    assert not run.switched


def test_chattering_ends_in_a_status():
    # Three surfaces through one point, each pushing back to the next.
    def rate(t, y):
        return [-jnp.sign(y[0] + 2 * y[1]), -jnp.sign(y[1] - 2 * y[0])]

    run = jaxdyn.simulate(jaxdyn.ode(rate, [1.0, 0.3], 20.0), throw=False)
    assert run.status == Status.CHATTERING
    assert "as creep= of effects.DryFriction does" in run.message
    assert np.isnan(run.ys[-1]).all()


@pytest.mark.slow
def test_conditions_in_ensembles_jit_and_backwards():
    scene = jaxdyn.ode(stuck, [2.05, 0.0], 20.0, params=0.3)
    ends = ensemble.run(scene, np.array([[2.05, 0.0], [-0.2, 0.0]]), 20.0)
    assert np.allclose(ends.y1[:, 0], (-0.25, -0.2), rtol=0, atol=1e-10)
    compiled = jax.jit(lambda y0: jaxdyn.solve(scene.starting(y0), 20.0).y1)
    assert np.allclose(compiled(jnp.array([2.05, 0.0])), (-0.25, 0.0), rtol=0, atol=1e-10)
    there = jaxdyn.solve(pushed(5.0), 10.0).y1
    back = jaxdyn.solve(pushed(5.0).starting(there), 0.0, t0=10.0).y1
    assert np.allclose(back, 0.0, rtol=0, atol=1e-13)


def test_the_pair_takes_over_where_a_series_overflows():
    rate = lambda t, y: [1 / (1 + jnp.exp(-y[0] / 1e-3))]  # noqa: E731
    run = jaxdyn.simulate(jaxdyn.ode(rate, [-1.0], 0.5))
    assert run.ys[-1, 0] == -1.0
    compiled = jax.jit(lambda y0: jaxdyn.solve(jaxdyn.ode(rate, y0, 0.5), 0.5).y1)
    assert compiled(jnp.array([-1.0]))[0] == -1.0


def test_a_removable_singularity_is_named():
    gate = lambda t, y: [0.01 * (y[0] + 55) / (1 - jnp.exp(-(y[0] + 55) / 10))]  # noqa: E731
    run = jaxdyn.simulate(jaxdyn.ode(gate, [-55.0], 1.0), throw=False)
    assert run.status == Status.NOT_FINITE
    assert "0/0 at the start and finite beside it" in run.message
    advice = re.search(r"as (jnp\.where.+) with near = (.+) and s = (.+)\.$", run.message)
    value, near, other = advice.groups()

    def advised(x):
        names = {"jnp": jnp, "x": x, "near": eval(near, {"x": x})}
        return eval(value, names | {"s": eval(other, names)})

    for x in (0.0, 9.9e-3, 1.1e-2):
        assert abs(advised(x) - (x / np.expm1(x) if x else 1.0)) < 1e-14
        assert abs(jax.grad(advised)(x) - (-1 / 2 + x / 6 - x**3 / 180)) < 1e-11


def test_what_cannot_be_read_is_said():
    def rate(t, y):
        body = lambda s: (s[0] + 1, jnp.abs(s[1]) - 0.1)  # noqa: E731
        return [jax.lax.while_loop(lambda s: s[1] > 0.0, body, (0, y[0]))[1]]

    scene = jaxdyn.ode(rate, [0.95], 1.0)  # not on a jump
    assert "a loop of unknown length" in jaxdyn.simulate(scene).warning
    assert "blind to a loop" in jaxdyn.simulate(scene, digits=6).error.basis


@pytest.mark.slow
def test_events_at_a_switching_surface():
    # The ball meets the floor where the contact force begins.
    ball = jaxdyn.ode(contact, [1.0, 0.0], 3.0, params=1e6)
    stop = events.until(ball, events.Reaches(0, 0.0, -1))
    assert abs(stop.t - np.sqrt(2 / 9.81)) < 1e-12
    assert stop.y[0] >= 0


@pytest.mark.slow
def test_breaks_and_longest_steps_for_what_cannot_be_read():
    def called(t):
        return np.asarray(float(abs(float(t) - 1.2345) < 1e-3))

    def rate(t, y):
        kick = jax.pure_callback(
            called, jax.ShapeDtypeStruct((), float), t, vmap_method="sequential"
        )
        return [kick - y[0]]

    scene = jaxdyn.ode(rate, [0.0], 3.0)
    expected = (np.exp(1.2355) - np.exp(1.2335)) * np.exp(-3.0)
    run = jaxdyn.simulate(scene, samples=2, breaks=[1.2335, 1.2355])
    assert abs(run.ys[-1, 0] - expected) < 1e-10
    assert "a call of Python" in run.warning
    run = jaxdyn.simulate(scene, samples=2, max_step=1e-3)
    assert abs(run.ys[-1, 0] - expected) < 1e-10


@pytest.mark.slow
def test_breaks_and_longest_steps_of_smooth_motions():
    scene = jaxdyn.ode(lambda t, y: [y[1], -y[0]], [1.0, 0.0], 10.0)
    run = jaxdyn.simulate(scene, breaks=[1.0, 2.0])
    assert np.allclose(run.ys[-1], (np.cos(10), -np.sin(10)), rtol=0, atol=1e-9)
    assert jaxdyn.simulate(scene, max_step=0.01).steps >= 1000
    found = jaxdyn.crossings(scene, events.Reaches(0, 0.0), breaks=[1.0])
    assert np.allclose(found.ts, np.pi * (np.arange(3) + 0.5), rtol=1e-12)
    stop = events.until(scene, events.Reaches(0, 0.0), max_step=0.1)
    assert abs(stop.t - np.pi / 2) < 1e-12
    with pytest.raises(ValueError, match="max_step"):
        jaxdyn.simulate(scene, max_step=-1.0)
    with pytest.raises(ValueError, match="breaks"):
        jaxdyn.simulate(scene, breaks=[[1.0]])


@pytest.mark.slow
@pytest.mark.parametrize("adjoint", [False, True, "steps"])
def test_breaks_where_nothing_switches_do_not_change_derivatives(adjoint):
    def end(y0, **options):
        scene = jaxdyn.ode(lambda t, y: [y[1], -jnp.sin(y[0])], y0)
        return jaxdyn.solve(scene, 2.0, rtol=1e-12, **options).y1[0]

    y0 = jnp.array([1.0, 0.2])
    found = jax.grad(lambda y: end(y, breaks=[0.7, 1.3], adjoint=adjoint))(y0)
    np.testing.assert_allclose(found, jax.grad(end)(y0), rtol=1e-10)
