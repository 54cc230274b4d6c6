"""What is read from the program of a rate: its dependence on time, its conditions, its period."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import effects, scenes
from jaxdyn.analysis import work_by_effect
from jaxdyn.intervals import Interval
from jaxdyn.plan import plan_of
from jaxdyn.plan.bounds import as_interval, enclose_program
from jaxdyn.plan.times import furthest_seen, next_change, sizes

KNOTS, HEIGHTS = np.linspace(0.0, 2.0, 5), np.array([0.0, 1.0, -1.0, 2.0, 0.0])


def plan(rate, k=2, **more):
    scene = jaxdyn.ode(rate, jnp.full(k, 0.3), 1.0, **more)
    return plan_of(scene.field, k), scene.field


def autonomous(t, y):
    return [y[1], -jnp.sin(y[0])]


def pulse(t, y):
    return [y[1], -y[0] + jnp.exp(-((t - 3.0) ** 2))]


def nothing_of_time(t, y):
    return [y[1] + 0.0 * t, -y[0]]


def with_all_kinds(t, y):
    a = jnp.where(y[0] > t, 1.0, 0.0) + jnp.sign(y[1]) + jnp.abs(y[0]) + jnp.maximum(y[0], y[1])
    b = jnp.floor(y[0]) + jnp.mod(y[1], 0.7) + jnp.round(y[0]) + jnp.clip(y[1], -1.0, 1.0)
    return [a, b + jnp.interp(y[0], KNOTS, HEIGHTS)]


def nested(t, y):
    slow = jax.lax.cond(y[0] > 0.0, lambda: jnp.where(y[1] > 0.0, 1.0, 2.0), lambda: 3.0)
    return [slow, jax.lax.fori_loop(0, 3, lambda i, s: s + jnp.abs(y[0] - i), 0.0)]


def of_no_rounds(t, y):
    none = jax.lax.map(lambda a: jnp.maximum(a * y[0], 0.0), jnp.zeros(0))
    return [y[1] + jnp.sum(none), -y[0]]


def unguarded(t, y):
    safe = jnp.where(y[0] == 0.0, 1.0, y[0])
    return [jnp.where(y[0] == 0.0, 1.0, jnp.sin(safe) / safe), y[0]]


def test_dependence_on_time_is_proved():
    assert not plan(autonomous)[0].depends_on_time
    assert not plan(nothing_of_time)[0].depends_on_time
    assert plan(pulse)[0].depends_on_time
    # Brief, and zero at any few times.
    assert plan(lambda t, y: [y[1], jnp.where(jnp.abs(t - 0.123456) < 1e-9, 1.0, 0.0)])[
        0
    ].depends_on_time


def test_smooth_scenes_have_no_conditions():
    for make in (scenes.double_pendulum, scenes.rolling_disk, scenes.four_bar, scenes.three_body):
        scene = make()
        found = plan_of(scene.field, len(scene.y0))
        assert not found.size, make.__name__
        assert not found.depends_on_time, make.__name__
    assert not plan(unguarded)[0].size


def test_conditions_whose_outcomes_are_thrown_away_are_none():
    def rate(t, y):
        size = jnp.abs(y[0]) + jnp.where(t > 1, y[1], 0.0)
        jax.jit(jnp.sign)(size)
        return -y

    assert plan(rate)[0].size == 0
    drag = scenes.cannonball(drag=0.1)
    field = work_by_effect.with_work(drag, effects.QuadraticDrag).field
    assert plan_of(field, 5).size == 0  # which also has the magnitudes of its terms


def test_conditions_of_all_kinds_and_those_on_time_alone():
    found, _ = plan(with_all_kinds)
    assert found.size == 13  # mod and clip have two each, interp three, the other six one
    assert found.bends.sum() == 7  # those of abs, maximum, clip and interp
    assert not found.of_time.any()
    found, _ = plan(lambda t, y: [jnp.where(jnp.mod(t, 0.1) < 0.01, 1.0, 0.0), jnp.sign(y[0])])
    assert found.of_time.any()
    assert found.on_state


def test_a_table_is_continuous_unlike_its_derivative_and_one_with_other_values_beyond_its_ends():
    knots = jnp.array([-1.0, 0.0, 2.0])
    table = functools.partial(jnp.interp, xp=knots, fp=knots**2)
    ends = functools.partial(table, right="extrapolate")
    for force in (table, ends, lambda y: 2 * table(jnp.sin(y)) - y):
        found, _ = plan(lambda t, y, force=force: -force(y))
        assert (found.on_state, found.most_surfaces) == (True, 0)
    slope = jax.vmap(jax.grad(table))
    for force in (slope, functools.partial(table, left=0.0), lambda y: jax.jvp(table, (y,), (y,))):
        found, _ = plan(lambda t, y, force=force: -jnp.asarray(force(y)).reshape(-1)[:2])
        assert found.most_surfaces > 0


@pytest.mark.sample("nested", "of_no_rounds")
@pytest.mark.parametrize("rate", [with_all_kinds, nested, of_no_rounds])
def test_a_branch_that_holds_gives_the_rate_itself(rate):
    found, field = plan(rate)
    for seed in range(20):
        t, *y = np.random.default_rng(seed).normal(size=3)
        y = jnp.asarray(y)
        _, here = found.evaluate(field, t, y)
        again, same = found.evaluate(field, t, y, here.outcomes)
        assert np.allclose(again, field.rate(t, y), rtol=1e-14)
        assert np.array_equal(same.outcomes, here.outcomes)
        assert (np.asarray(same.margins) >= 0).all()


@pytest.mark.slow
def test_margins_are_negative_exactly_where_outcomes_differ():
    found, field = plan(with_all_kinds)
    start = jnp.array([0.3, 0.3])
    _, here = found.evaluate(field, 0.1, start)
    for seed in range(50):
        y = start + 0.7 * np.random.default_rng(seed).normal(size=2)
        _, there = found.evaluate(field, 0.1, y, here.outcomes)
        differs = np.asarray(there.outcomes) != np.asarray(here.outcomes)
        assert np.array_equal(np.asarray(there.margins) < 0, differs)


@pytest.mark.parametrize("held", [0.0, 1.0])
def test_derivatives_on_a_surface_are_those_of_the_branch(held):
    def by_state(t, y):
        slope = jax.grad(lambda x: jnp.maximum(0.0, x) + jnp.minimum(x, 1.0))(y[0])
        return [slope, jax.grad(lambda x: jnp.clip(x, 0.0, 3.0))(y[0])]

    found, field = plan(by_state)
    on_it = jnp.zeros(2)
    _, here = found.evaluate(field, 0.0, on_it + (0.5 if held else -0.5))
    rate, _ = found.evaluate(field, 0.0, on_it, here.outcomes)
    # Without a branch half of it, as JAX has it.
    assert np.allclose(rate, (held + 1.0, held), rtol=0, atol=0)


def test_loops_that_cannot_be_read_are_named():
    def rate(t, y):
        body = lambda s: (s[0] + 1, jnp.abs(s[1]) - 0.1)  # noqa: E731
        return [jax.lax.while_loop(lambda s: s[1] > 0.0, body, (0, y[0]))[1], y[0]]

    assert plan(rate)[0].unread


def test_periods_are_read_from_numbers_of_the_scene():
    drive = lambda t, y, w: [y[1], jnp.cos(w * t) + jnp.sin(3 * w * t / 2)]  # noqa: E731
    found, field = plan(drive, params=1.3)
    assert found.period(field) == pytest.approx(4 * np.pi / 1.3, rel=1e-14)
    found, field = plan(lambda t, y: [y[1], jnp.where(jnp.mod(t, 0.25) < 0.1, 1.0, 0.0)])
    assert found.period(field) == 0.25
    found, field = plan(lambda t, y: [y[1], jnp.sin(t) + jnp.sin(np.sqrt(2.0) * t)])
    assert found.period(field) is None
    scene = scenes.shaken_pendulum()
    found = plan_of(scene.field, len(scene.y0))
    assert found.period(scene.field) == pytest.approx(np.pi / 30, rel=1e-14)


FUNCTIONS = [
    lambda t: jnp.sin(3 * t) * jnp.exp(-t * t) + t,
    lambda t: jnp.cos(t) ** 3 / (1.5 + jnp.sin(2 * t)),
    lambda t: jnp.tanh(4 * t) + jnp.sqrt(1.0 + t * t) + jnp.abs(t - 0.2),
    lambda t: jnp.log1p(t * t) - jnp.cosh(0.3 * t) + jnp.arctan(t),
    lambda t: jnp.where(t > 0.3, t**2, 0.09) + jnp.maximum(t, 0.1) * jnp.minimum(-t, 0.4),
    lambda t: jax.nn.sigmoid(5 * t) + jnp.stack([t, t * t]) @ np.array([0.5, -2.0]),
]


@pytest.mark.sample("<lambda>1", "<lambda>2", "<lambda>4", "<lambda>5")
@pytest.mark.parametrize("fn", FUNCTIONS)
def test_bounds_enclose(fn):
    program = jax.make_jaxpr(fn)(0.0)
    rng = np.random.default_rng(1)
    for _ in range(30):
        low, width = rng.uniform(-3, 3), 10 ** rng.uniform(-6, 0.5)
        (found,) = enclose_program(program, [Interval(jnp.asarray(low), jnp.asarray(low + width))])
        found = as_interval(found)
        values = jax.vmap(fn)(jnp.linspace(low, low + width, 101))
        room = 1e-13 * (1 + np.abs(values).max())
        assert found.low <= values.min() + room
        assert found.high >= values.max() - room
        # In proportion to the interval, so that they can be refined.
        assert found.high - found.low <= 60 * width + room or width > 0.1


def test_what_has_no_bounds_is_unknown():
    program = jax.make_jaxpr(lambda t: jax.scipy.special.bessel_jn(t, v=0)[0])(0.5)
    (found,) = enclose_program(program, [Interval(jnp.asarray(0.5), jnp.asarray(0.6))])
    assert not np.isfinite(found.low).any()


@pytest.mark.sample("0.87654321-0.1")
@pytest.mark.parametrize("width", [1e-1, 1e-3, 1e-5])
@pytest.mark.parametrize("centre", [1e-3, 0.123456, 0.5, 0.87654321])
def test_a_step_ends_before_a_pulse_of_any_width(width, centre):
    found, field = plan(lambda t, y, p: [y[1], jnp.exp(-(((t - p[0]) / p[1]) ** 2))], params=(0, 1))
    system = jax.tree.unflatten(
        jax.tree.structure(field), [jnp.asarray(x) for x in (centre, width)]
    )
    largest = sizes(found, system, 0.0, 1.0, jnp.zeros(0))
    t, steps = 0.0, [0.0]
    while t < 1.0 and len(steps) < 300:
        t = float(
            furthest_seen(found, system, jnp.asarray(t), jnp.asarray(1.0), jnp.zeros(0), largest)
        )
        steps.append(t)
    ends = np.array(steps)
    inside = np.diff(ends)[(ends[:-1] < centre + width) & (ends[1:] > centre - width)]
    # No step that meets the pulse is many times as long as it.
    assert inside.max() < 40 * width
    assert len(steps) < 150


def test_switching_times_are_the_first_numbers_on_the_other_side():
    found, field = plan(lambda t, y: [jnp.where(t >= 0.3, 1.0, 0.0), jnp.sign(jnp.sin(7 * t))])
    t, changes = jnp.asarray(0.05), []
    while t < 1.0:
        _, here = found.evaluate(field, t, jnp.zeros(2))
        t = next_change(found, field, t, jnp.asarray(1.0), here.outcomes)
        changes.append(float(t))
    assert np.allclose(changes, [0.3, np.pi / 7, 2 * np.pi / 7, 1.0], rtol=1e-15)
    assert changes[0] == 0.3
    # Backwards in time from either side.
    _, here = found.evaluate(field, 0.4, jnp.zeros(2))
    back = float(next_change(found, field, jnp.asarray(0.4), jnp.asarray(0.0), here.outcomes))
    assert back == np.nextafter(0.3, 0.0)


@pytest.mark.parametrize(
    "function", [jnp.hypot, lambda x, y: jnp.sinc(x) * y, lambda x, y: jax.nn.softplus(x - y)]
)
def test_conditions_that_only_save_digits_are_none(function):
    found, field = plan(lambda t, y: [y[1], -function(y[0], y[1]) - y[0]])
    assert found.conditions == ()
    at = jnp.array([0.3, -0.4])
    rate, _ = found.evaluate(field, 0.0, at)
    np.testing.assert_allclose(rate, [at[1], -function(*at) - at[0]], rtol=1e-15)
