"""Derivatives of chains of legs by their numbers, against closed forms and differences."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.integrate import events
from jaxdyn.integrate.phase import Exit, Phase


def _found(scene, **options):
    return orbits.find_hybrid(scenes.phases_of(scene), scene.y0, **options)


@pytest.mark.slow
def test_a_rimless_wheel_by_its_slope_and_gravity():
    roll = _found(scenes.rimless_wheel())

    def gait(numbers):
        slope, g = numbers
        phases = scenes.phases_of(scenes.rimless_wheel(slope=slope, g=g))
        found = orbits.differentiable(phases, roll)
        return jnp.append(found.y0, found.period)

    values = gait(jnp.array([0.08, 1.0]))
    np.testing.assert_allclose(values, [*roll.y0, roll.period], rtol=1e-15)
    slopes = jax.jacrev(gait)(jnp.array([0.08, 1.0]))
    np.testing.assert_allclose(slopes, jax.jacfwd(gait)(jnp.array([0.08, 1.0])), atol=1e-11)
    # theta = slope - a; omega = 2 cot 2a sqrt(g sin a sin slope); times go with 1 / sqrt(g).
    omega = float(roll.y0[1])
    exact = [[1.0, 0.0], [omega / (2 * math.tan(0.08)), omega / 2]]
    np.testing.assert_allclose(slopes[:2], exact, atol=1e-10)
    assert abs(float(slopes[2, 1]) + roll.period / 2) < 1e-10


def test_a_gait_by_its_slope_against_gaits_found_again():
    gait = _found(scenes.simplest_walker())

    def numbers(slope):
        found = orbits.differentiable(scenes.phases_of(scenes.simplest_walker(slope=slope)), gait)
        return jnp.concatenate([found.y0, found.spans])

    h = 1e-4
    plus, minus = (_found(scenes.simplest_walker(slope=0.009 + s * h)) for s in (1, -1))
    there, here = (np.append(x.y0, x.spans) for x in (plus, minus))
    np.testing.assert_allclose(jax.jacfwd(numbers)(0.009), (there - here) / (2 * h), rtol=1e-3)


def _near(values, known):
    """Of some multipliers those nearest to known ones."""
    return values[np.argmin(np.abs(values[:, None] - known), axis=0)]


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.009, 0.0135])
def test_multipliers_of_a_gait_by_its_slope(slope):
    gait = _found(scenes.simplest_walker(slope=slope))
    known = orbits.stability(gait).nontrivial

    def phases(slope):
        return scenes.phases_of(scenes.simplest_walker(slope=slope))

    def multipliers(slope):
        found = orbits.differentiable(phases(slope), gait).multipliers()
        return jnp.stack([found.real, found.imag])

    np.testing.assert_allclose(multipliers(slope), [known.real, known.imag], rtol=1e-15)
    by_slope = jax.jacfwd(multipliers)(slope)
    np.testing.assert_allclose(by_slope, jax.jacrev(multipliers)(slope), atol=1e-8)
    # Against the stability of gaits that are found again, by differences of order 6.
    h, weights = 1e-5 * np.array([1, 2, 3]), np.array([3 / 4, -3 / 20, 1 / 60])
    change = 0.0
    for step, weight in zip(h, weights, strict=True):
        there, here = (
            _near(
                orbits.stability(
                    orbits.find_hybrid(phases(slope + s * step), gait.y0, gait.spans)
                ).nontrivial,
                known,
            )
            for s in (1, -1)
        )
        change = change + weight * (there - here) / h[0]
    np.testing.assert_allclose(by_slope, [change.real, change.imag], rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_multipliers_of_the_rimless_wheel_by_gravity_and_slope():
    # It is cos^2 2a, whatever they are; that of the flow is not among them.
    roll = _found(scenes.rimless_wheel())

    def multipliers(numbers):
        phases = scenes.phases_of(scenes.rimless_wheel(slope=numbers[0], g=numbers[1]))
        return orbits.differentiable(phases, roll).multipliers()

    numbers = jnp.array([0.08, 1.0])
    np.testing.assert_allclose(multipliers(numbers), [0.5], atol=1e-9)
    np.testing.assert_allclose(jax.jacfwd(multipliers)(numbers), np.zeros((1, 2)), atol=1e-8)


@pytest.mark.slow
def test_multipliers_of_a_bouncing_ball_are_differentiated_under_jit():
    """Their product is e^2 and their sum 1 + e^2 - (1 + e)^2 A w^2 sin(phase) / g."""
    numbers = jnp.array([0.8, 0.1, 11.0, 9.81])

    def phases(numbers):
        e, amplitude, w, g = numbers
        table = {"amplitude": amplitude, "frequency": w, "velocity": 3.8}
        return scenes.phases_of(scenes.ball_on_table(restitution=e, g=g, **table))

    flight = phases(numbers)
    ball = orbits.find_hybrid(flight, flight["fly"].scene.y0)

    def sums(numbers):
        m = orbits.differentiable(phases(numbers), ball).multipliers().real
        return jnp.stack([m[0] * m[1], m[0] + m[1]])

    def exact(numbers):
        e, amplitude, w, g = numbers
        rise = g * jnp.pi / w**2 * (1 - e) / (1 + e)  # A cos(phase)
        sine = jnp.sqrt(amplitude**2 - rise**2)
        return jnp.stack([e**2, 1 + e**2 - (1 + e) ** 2 * w**2 * sine / g])

    np.testing.assert_allclose(jax.jit(sums)(numbers), exact(numbers), rtol=1e-12)
    by_numbers = jax.jit(jax.jacrev(sums))(numbers)
    np.testing.assert_allclose(by_numbers, jax.jacfwd(exact)(numbers), rtol=1e-10, atol=1e-10)


def _bounce(t, y):
    return y * jnp.array([1.0, 1.0, 1.0, -1.0])


def test_legs_are_differentiated_as_well():
    def legs(g, top):
        ball = scenes.cannonball(g=g)
        falls = orbits.Leg(ball, (events.Reaches(1, 0.0),), _bounce)
        return [falls, orbits.Leg(ball, (events.Reaches(3, 0.0), events.Reaches(1, top)))]

    ball = orbits.find_hybrid(legs(10.0, 5.0), [0.0, 4.8, 0.0, 0.0], [1.0, 1.0])

    def period(g, top):
        return orbits.differentiable(legs(g, top), ball).period

    # T = 2 sqrt(2 h / g)
    by_both = jax.grad(period, (0, 1))
    np.testing.assert_allclose(by_both(10.0, 5.0), [-0.1, 0.2], atol=1e-10)
    np.testing.assert_allclose(jax.jit(by_both)(10.0, 5.0), [-0.1, 0.2], atol=1e-10)
    assert jnp.isnan(jnp.stack(by_both(10.0, 5.1))).all()
    with pytest.raises(ValueError, match="scene: expected the numbers with which the orbit was f"):
        period(10.0, 5.1)


def _slipping(t, y, friction):
    return [y[1], -friction * jnp.sign(y[1])]


def _kick(t, y):
    return jnp.stack([0.0 * y[0], 1 + 0.1 * y[0]])


@pytest.mark.slow
def test_a_leg_that_ends_where_friction_stops_a_block():
    """It slides from a kick v over v^2 / 2 f, and the next kick is 1 + v^2 / 20 f."""

    def legs(friction):
        slips = jaxdyn.ode(_slipping, [0.0, 1.1], 2.2, params=friction)
        return [orbits.Leg(slips, (events.Reaches(1, 0.0),), _kick)]

    def exactly(friction):
        return 10 * friction * (1 - jnp.sqrt(1 - 0.2 / friction))

    found = orbits.find_hybrid(legs(0.5), [0.0, 1.1], [2.2])
    assert abs(found.y0[1] - exactly(0.5)) < 1e-12
    assert abs(orbits.stability(found).nontrivial[0] - exactly(0.5) / 5) < 1e-12
    slope = jax.jacfwd(lambda friction: orbits.differentiable(legs(friction), found).y0[1])(0.5)
    assert abs(slope - jax.grad(exactly)(0.5)) < 1e-10


def _pushed_along(t, y, damping):
    return [y[1], -y[0] - 2 * damping * y[1] + jnp.where(y[1] >= 0, 1.0, -0.5)]


def _swings(damping):
    there, back = (events.Reaches(1, 0.0, way) for way in (-1, 1))
    scene = jaxdyn.ode(_pushed_along, [-4.5, 0.0], 7.0, params=damping)
    return {"up": Phase(scene, (Exit(there, "down"),)), "down": Phase(scene, (Exit(back, "up"),))}


def _of_swings(damping):
    """Start, period and multiplier: each half swing shrinks the distance to its own middle."""
    w = jnp.sqrt(1 - damping**2)
    r = jnp.exp(-damping * jnp.pi / w)
    return jnp.stack([-(0.5 + 1.5 * r + r**2) / (1 - r**2), 2 * jnp.pi / w, r**2])


@pytest.fixture(scope="module")
def swings():
    return orbits.find_hybrid(_swings(0.1), [-4.7, 0.0], events=2)


@pytest.mark.slow
def test_a_leg_that_begins_where_its_own_rate_jumps(swings):
    start, period, multiplier = _of_swings(0.1)
    np.testing.assert_allclose([swings.y0[0], swings.period], [start, period], rtol=1e-12)
    found = orbits.stability(swings)
    np.testing.assert_allclose(np.sort(found.multipliers.real), [multiplier, 1.0], rtol=1e-12)
    np.testing.assert_allclose(found.nontrivial, [multiplier], rtol=1e-12)


@pytest.mark.slow
def test_derivatives_of_a_leg_that_begins_where_its_own_rate_jumps(swings):
    def numbers(damping):
        found = orbits.differentiable(_swings(damping), swings)
        return jnp.stack([found.y0[0], found.period, found.multipliers()[0].real])

    exact = jax.jacfwd(_of_swings)(0.1)
    np.testing.assert_allclose(jax.jacfwd(numbers)(0.1), exact, rtol=1e-9)


def test_what_does_not_fit_is_refused():
    scene = scenes.rimless_wheel()
    roll, swing = _found(scene), orbits.find(scenes.oscillator(), period=6.0)
    with pytest.raises(ValueError, match="scene: expected legs or phases for such an orbit"):
        orbits.differentiable(scene, roll)
    with pytest.raises(ValueError, match="scene: expected a scene for such an orbit"):
        orbits.differentiable(scenes.phases_of(scene), swing)
    with pytest.raises(ValueError, match="hold: expected none for a chain of legs"):
        orbits.differentiable(scenes.phases_of(scene), roll, hold="theta")
