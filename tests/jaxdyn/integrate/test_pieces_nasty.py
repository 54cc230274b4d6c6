"""Conditions that change together, at rest, in arrays; forces in sums: closed forms and DOP853."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxdyn
from jaxdyn import solvers
from jaxdyn.plan import plan_of


def reference(rate, y0, t1, t0=0.0):
    """DOP853 with short steps, which shrink to nothing where the rate jumps."""
    found = solve_ivp(rate, (t0, t1), y0, "DOP853", rtol=1e-13, atol=1e-14, max_step=5e-3)
    assert found.success
    return found.y[:, -1]


def end_of(rate, y0, t1, **options):
    return np.asarray(jaxdyn.simulate(jaxdyn.ode(rate, y0, t1), samples=2, **options).ys[-1])


def relay(xp, y):
    """A relay with hysteresis whose state y[1] snaps to 1 or -1: three conditions are one."""
    side = xp.where(y[1] > 0, 1.0, -1.0)
    on = xp.where((y[0] > 0.5) | ((y[0] > -0.5) & (y[1] > 0)), 1.0, -1.0)
    return [xp.where(y[1] > 0, -y[0] - 1.0, 1.0 - y[0]), 200 * (side * on * side - y[1])]


@pytest.mark.slow
def test_conditions_with_one_surface_change_together():
    # Else the product keeps the sign of one side, and the motion slides where it should not.
    found = end_of(lambda t, y: relay(jnp, y), [0.0, -1.0], 2.0)
    # The turns at 1/2 and -1/2 and the snaps between, each exponential, by their closed forms.
    t, x, way = 0.0, 0.0, 1.0
    for _ in range(10):
        reach = t + np.log((1 - way * x) / 0.5)
        snap = reach + np.log(2) / 200
        if snap > 2.0:
            break
        at = way * (1 - 0.5 * np.exp(-np.log(2) / 200))
        t, x, way = snap, at, -way
    assert abs(found[0] - (way + (x - way) * np.exp(t - 2.0))) < 1e-9
    assert abs(found[1] - -way) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("inflow", [0.0, 0.3])
def test_a_tank_that_empties_stays_empty(inflow):
    # The surface is reached with no speed, and left by rounding only.
    def rate(t, y):
        return [inflow * jnp.maximum(0.0, -jnp.cos(t)) - jnp.sqrt(jnp.maximum(y[0], 0.0))]

    if not inflow:
        assert abs(end_of(rate, [1.0], 5.0)[0]) < 1e-15
        return
    found = jaxdyn.simulate(jaxdyn.ode(rate, [0.01], 2.0), samples=jnp.array([1.0, 1.5, 2.0]))
    # Empty from t = 0.2 to pi/2, then it fills: DOP853 in the variable sqrt(y).
    assert np.abs(found.ys[:2]).max() < 1e-15
    fill = solve_ivp(
        lambda t, s: [(-inflow * np.cos(t) / s[0] - 1.0) / 2.0],
        (np.pi / 2 + 1e-4, 2.0),
        [_series_of_filling(inflow, 1e-4)],
        "DOP853",
        rtol=1e-12,
        atol=1e-14,
    )
    assert abs(found.ys[-1, 0] - fill.y[0, -1] ** 2) < 1e-8


def _series_of_filling(a, s):
    """sqrt(y) at a time s after the inflow a sin(s) begins, by dy/ds = a s - sqrt(y): y = c s^2."""
    root = (-1.0 + np.sqrt(1.0 + 8.0 * a)) / 4.0  # 2 c = a - sqrt(c)
    return root * s


def largest(xp, y):
    return [y[1], -xp.max(xp.asarray([y[0], 2 * y[0] - 0.5, -3 - 0.2 * y[1]]))]


def place(xp, y):
    which = xp.argmax(xp.asarray([y[0], 0.2, -y[0]]))
    return [y[1], -xp.asarray([1.0, 0.3, -1.5])[which]]


def order(xp, y):
    row = xp.sort(xp.asarray([y[0], 0.2 * y[1], 2 * y[0] - 0.5]))
    return [y[1], -row[2] - 0.1 * row[0]]


@pytest.mark.slow
@pytest.mark.parametrize("rate", [largest, place, order], ids=lambda f: f.__name__)
def test_extremes_and_order_of_numbers(rate):
    found = end_of(lambda t, y: rate(jnp, y), [1.0, 0.0], 5.0)
    assert np.allclose(found, reference(lambda t, y: rate(np, y), [1.0, 0.0], 5.0), atol=1e-9)


def test_the_nearest_knot_of_a_table():
    knots, heights = np.arange(0.0, 5.5, 0.5), np.arange(11.0) ** 2 % 7

    def rate(t, y):
        return [jnp.asarray(heights)[jnp.argmin(jnp.abs(knots - t))] - y[0]]

    ends = np.concatenate([[0.0], knots[:-1] + 0.25, [5.0]])
    expected = 0.0
    for height, step in zip(heights, np.diff(ends), strict=True):
        expected = height + (expected - height) * np.exp(-step)
    assert abs(end_of(rate, [0.0], 5.0)[0] - expected) < 1e-11


def test_a_start_at_rest_just_before_the_knot_of_a_table():
    # The first piece is short, and moves the state by little; a rounding before zero, mod(t, 1) is
    # 1, and the table constant but for a slope that its bounds allow.
    def rate(t, y):
        return [jnp.interp(jnp.mod(t, 1.0), np.array([0, 0.5, 1]), np.array([0.0, 1, 0])) - y[0]]

    scene = jaxdyn.ode(rate, [0.0], 1.0)
    expected = 2 * (0.25 - 1 + np.exp(-0.25))  # y' = 2 t - y
    for t0 in (0.0, -1e-300, -3e-18, -2e-16, -1e-10, -1e-5, 1 - 1e-10, 2 - 1e-15):
        t1 = round(t0) + 0.25
        found = jaxdyn.simulate(scene, t1, t0=t0, rtol=1e-14, samples=2, max_steps=300)
        assert abs(found.ys[-1, 0] - expected) < 1e-15 + 2 * min(abs(t0 - round(t0)), 1e-5) ** 2


def test_the_largest_of_functions_of_time():
    def rate(t, y):
        return [jnp.max(jnp.stack([jnp.cos(t), jnp.sin(t), jnp.full_like(t, 0.5)]))]

    quarter, third = np.pi / 4, 5 * np.pi / 6
    expected = np.sin(quarter) + np.cos(quarter) - np.cos(third) + 0.5 * (5.0 - third)
    run = jaxdyn.simulate(jaxdyn.ode(rate, [0.0], 5.0))
    assert abs(run.ys[-1, 0] - expected) < 1e-13
    assert run.rejected <= 5


def test_a_small_pulse_in_a_sum_that_is_divided():
    def rate(t, y):
        force = 1e5 * jnp.cos(3 * t) + 10 * jnp.exp(-(((t - 9.7) / 1e-3) ** 2))
        return [y[1], -y[0] + force / 2]

    drive = 6250 * np.array([np.cos(20) - np.cos(60), 3 * np.sin(60) - np.sin(20)])
    pulse = 5e-3 * np.sqrt(np.pi) * np.array([np.sin(10.3), np.cos(10.3)])
    for solver in (None, solvers.DOPRI8):
        found = end_of(rate, [0.0, 0.0], 20.0, solver=solver)
        assert np.allclose(found, drive + pulse, rtol=1e-8)


def test_a_pulse_in_a_product_with_a_matrix():
    gain = jnp.array([[0.0, 0.0], [1.0, 0.5]])

    def rate(t, y):
        inputs = jnp.stack([jnp.cos(3 * t) * 1e5, jnp.exp(-(((t - 9.7) / 1e-3) ** 2)) * 20])
        return jnp.stack([y[1], -y[0]]) + gain @ inputs

    drive = 12500 * np.array([np.cos(20) - np.cos(60), 3 * np.sin(60) - np.sin(20)])
    pulse = 1e-2 * np.sqrt(np.pi) * np.array([np.sin(10.3), np.cos(10.3)])
    assert np.allclose(end_of(rate, [0.0, 0.0], 20.0), drive + pulse, rtol=1e-9)


@pytest.mark.parametrize(
    ("function", "name"),
    [
        (lambda y: jax.lax.cummax(y)[1], "cummax"),
        (lambda y: jax.lax.top_k(y, 1)[0][0], "top_k"),
        (lambda y: jnp.sort(jnp.tile(y, 11))[-1], "sort"),
    ],
    ids=["cummax", "top_k", "sort"],
)
def test_what_orders_numbers_and_is_not_read_is_named(function, name):
    scene = jaxdyn.ode(lambda t, y: [y[1], -function(y)], [1.0, 0.0], 1.0)
    assert name in plan_of(scene.field, 2).caveat


def test_smooth_rates_with_whole_numbers_have_bounds():
    def bits(t, y):
        return [jnp.where((t * 10).astype(int) & 3 == 1, 1.0, 0.0) - y[0]]

    expected = 0.0
    for i in range(30):
        height = float(i & 3 == 1)
        expected = height + (expected - height) * np.exp(-0.1)
    assert abs(end_of(bits, [0.0], 3.0)[0] - expected) < 1e-12


def end(rate, y0, t1, entry=0):
    """One entry of the end of a motion as a function of a parameter."""

    def of(p, adjoint=False):
        scene = jaxdyn.ode(rate, y0, t1, params=p)
        return jaxdyn.solve(scene, t1, rtol=1e-11, adjoint=adjoint).y1[entry]

    return of


@pytest.mark.slow
def test_derivatives_by_a_switch_on_another_surface_while_sliding():
    def rate(t, y, p):
        return [-jnp.sign(y[0]), jnp.where(y[2] > p, 1.0, 0.0), 1.0]

    assert abs(jax.grad(end(rate, [0.5, 0.0, 0.0], 3.0, 1))(1.3) + 1) < 1e-12


@pytest.mark.slow
def test_second_derivatives_through_the_end_of_sliding():
    # A block that comes to rest, sticks, and is torn off by the growing force at t = p.
    def rate(t, y, p):
        return [y[1], t - p * jnp.sign(y[1])]

    def closed(p):
        rest = p - jnp.sqrt(p * p - 0.1)
        return 0.05 * rest + rest**3 / 6 - p * rest**2 / 2 + (2.0 - p) ** 3 / 6

    of = end(rate, [0.0, 0.05], 2.0)
    assert abs(jax.grad(of)(0.5) - jax.grad(closed)(0.5)) < 1e-9
    assert abs(jax.grad(jax.grad(of))(0.5) - jax.grad(jax.grad(closed))(0.5)) < 1e-8


@pytest.mark.slow
def test_adjoints_begin_a_rounding_beyond_a_surface():
    # Beyond it the power of the branch is not defined, and neither was its derivative.
    def rate(t, y, p):
        return [y[1], p * jnp.maximum(0.0, -y[0]) ** 1.5 - 9.81]

    of = end(rate, [1.0, 0.0], 3.0)
    # Central differences of ends at rtol 1e-13.
    assert abs(jax.grad(lambda p: of(p, True))(1e3) - 0.00034309870872) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.0, 1e-14])
def test_a_follower_with_a_gap_is_released_just_after_the_body_turns(late):
    # x - z is at the gap to rounding then, and gets nearer to it by as much only after seconds: the
    # motion was moved along a straight line as far as that.
    def rate(t, y, late):
        x, v, z = y
        right, left = (x - z >= 0.5) & (v > -late), (x - z <= -0.5) & (v < late)
        return [v, -x, jnp.where(right | left, v, 0.0)]

    scene = jaxdyn.ode(rate, [2.3, 0.0, 1.8], 40.0, params=late)
    found = jaxdyn.solve(scene, 40.0, rtol=1e-11).y1
    turned = 40.0 - 12 * np.pi  # since x was 2.3; from x = 1.3 to -2.3 the body pulls z
    assert np.arccos(1.3 / 2.3) < turned < np.pi
    exact = [2.3 * np.cos(turned), -2.3 * np.sin(turned), 2.3 * np.cos(turned) + 0.5]
    assert np.abs(found - np.array(exact)).max() < 1e-11
