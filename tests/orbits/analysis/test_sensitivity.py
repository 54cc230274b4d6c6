"""Derivatives of orbits against closed forms and orbits found again."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cycles import Bautin, cycle
from helpers import gap, kepler
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.analysis import energy


@pytest.fixture(scope="module")
def swing():
    return orbits.find(scenes.pendulum(angle=1.0), period=2.2)


@pytest.mark.slow
def test_the_period_of_a_pendulum_by_gravity(swing):
    level = float(energy.energy(swing.scene, jnp.zeros(()), swing.y0))
    hold = orbits.Energy(level)

    def period(g):
        scene = eqx.tree_at(lambda s: s.effects[0].g, swing.scene, g)
        return orbits.differentiable(scene, swing, hold=hold).period

    # T = 4 K(m) / sqrt(g) with m = (1 + E / g) / 2, and dK/dm = (E(m) / (1 - m) - K) / (2 m).
    g = 9.81
    m = 0.5 * (1 + level / g)
    slope = (ellipe(m) / (1 - m) - ellipk(m)) / (2 * m)
    exact = -2 * ellipk(m) / g**1.5 - 4 / np.sqrt(g) * slope * 0.5 * level / g**2
    for way in jax.grad, jax.jacfwd, lambda f: jax.jit(jax.grad(f)):
        assert abs(way(period)(swing.scene.effects[0].g) - exact) < 1e-10
    # The formula for first derivatives would give a finite wrong number.
    assert np.isnan(jax.hessian(period)(swing.scene.effects[0].g))


def _grown_and_rubbed(t, y, p):
    return [y[1], -y[0] + 2 * p[0] * y[1] - p[1] * jnp.sign(y[1])]


@pytest.mark.slow
@pytest.mark.parametrize("aside", [0.0, 0.01, -0.01])
def test_a_cycle_that_starts_where_dry_friction_turns_round(aside):
    """Between turns it is a spiral about the force of friction f: with growth r in half a period,
    it turns at f (r + 1) / (r - 1), and its multiplier is r^2."""

    def exactly(p):
        frequency = jnp.sqrt(1 - p[0] ** 2)
        r = jnp.exp(p[0] * jnp.pi / frequency)
        return jnp.stack([p[1] * (r + 1) / (r - 1), 2 * jnp.pi / frequency]), r**2

    p = jnp.array([0.05, 0.3])
    (turn, period), multiplier = exactly(p)
    start = [float(turn) * (1 + aside), 0.0]

    def scene(p):
        return jaxdyn.ode(_grown_and_rubbed, start, float(period), params=p)

    found = orbits.find(scene(p), start, float(period))
    values = np.sort(np.linalg.eigvals(orbits.stability(found).monodromy).real)
    assert np.allclose(values, [1.0, multiplier], rtol=0, atol=1e-10)

    def numbers(p):
        orbit = orbits.differentiable(scene(p), found, hold="y1")
        return jnp.stack([orbit.y0[0], orbit.period])

    assert np.allclose(numbers(p), [turn, period], rtol=0, atol=1e-11)
    wanted = jax.jacfwd(lambda p: exactly(p)[0])(p)
    assert np.allclose(jax.jacfwd(numbers)(p), wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_a_cycles_start_and_multiplier_by_its_parameter():
    a = 0.3
    orbit = orbits.find(cycle(Bautin, a, [1.1, 0.0]))

    def numbers(a):
        found = orbits.differentiable(cycle(Bautin, a, orbit.y0), orbit)
        return jnp.linalg.norm(found.y0), found.period, found.exponents()[0].real

    # r^2 = (1 + sqrt(1 + 4 a)) / 2, so dr/da = 1 / (2 r sqrt(1 + 4 a)); exponent 2 r^2 - 4 r^4.
    r = np.sqrt(0.5 * (1 + np.sqrt(1 + 4 * a)))
    dr = 1 / (2 * r * np.sqrt(1 + 4 * a))
    found = jax.jacfwd(numbers)(a)
    assert gap(found, [dr, 0.0, (4 * r - 16 * r**3) * dr]) < 1e-9
    assert gap(numbers(a), [r, 2 * np.pi, 2 * r**2 - 4 * r**4]) < 1e-10


@pytest.mark.slow
def test_the_eight_by_a_mass_against_orbits_found_again():
    half = orbits.reversal(orbits.point_symmetry([1, 0, 2], (-1, -1), reversing=True))
    eight = orbits.find(scenes.three_body(m=(1.0, 1.0, 0.98)), closing=half)
    hold = (orbits.Energy(float(energy.energy(eight.scene, jnp.zeros(()), eight.y0))),)

    def scene(m3):
        return scenes.three_body(eight.y0, m=jnp.stack([jnp.ones(()), jnp.ones(()), m3]))

    def numbers(m3):
        found = orbits.differentiable(scene(m3), eight, hold=hold)
        return found.period, found.multipliers()[0].real

    def again(m3):
        found = orbits.find(scene(jnp.asarray(m3)), eight.y0, eight.period, closing=half, hold=hold)
        return np.array([found.period, orbits.stability(found).nontrivial[0].real])

    # Differences to order 6: which of the two is right, derivatives or differences, is seen only
    # where the differences' own error is smaller than the gap.
    h = 4e-4
    steps = {i: again(0.98 + i * h) - again(0.98 - i * h) for i in (1, 2, 3)}
    differences = (45 * steps[1] - 9 * steps[2] + steps[3]) / (60 * h)
    slopes = np.array(jax.jacfwd(numbers)(jnp.asarray(0.98)))
    assert np.abs(slopes / differences - 1).max() < 1e-9


@pytest.mark.slow
def test_the_period_of_a_pendulum_at_a_held_angle_by_gravity():
    swing = orbits.find(scenes.pendulum(angle=1.0), period=2.2)

    def period(g):
        scene = eqx.tree_at(lambda s: s.effects[0].g, swing.scene, g)
        return orbits.differentiable(scene, swing, hold="theta").period

    exact = -swing.period / (2 * 9.81)  # T ~ 1 / sqrt(g) at one amplitude
    assert abs(jax.grad(period)(swing.scene.effects[0].g) - exact) < 1e-11


def test_the_period_of_a_pendulum_by_the_angle_that_a_name_holds():
    """A name stands for the value at the scene's start, so it has the derivatives of this."""

    def period(angle):
        return orbits.differentiable(scenes.pendulum(angle=angle), swing, hold="theta").period

    swing = orbits.find(scenes.pendulum(angle=1.0), period=2.1, hold="theta")
    h = 1e-20  # complex step through T = 2 pi sqrt(l / g) / agm(1, cos(angle / 2))
    a, b = 1.0 + 0.0j, np.cos((1.0 + 1j * h) / 2)
    for _ in range(8):
        a, b = (a + b) / 2, np.sqrt(a * b)
    exact = (2 * np.pi * np.sqrt(1 / 9.81) / a).imag / h
    by_angle = jax.jit(jax.grad(period))
    assert abs(by_angle(1.0) - exact) < 1e-11
    assert by_angle(1.2) == 0.0  # the scene starts elsewhere: it is the orbit's value


@pytest.mark.parametrize(
    ("search", "remedy"),
    [
        (
            lambda s, o: orbits.find(s, period=2.2).period,
            "orbits.differentiable\\(scene, orbit\\) has",
        ),
        (lambda s, o: orbits.search(s, None, 1, longest=3.0), "see orbits.differentiable"),
        (lambda s, o: orbits.stability(_in(s, o)).nontrivial, "multipliers"),
        (lambda s, o: orbits.continue_family(_in(s, o)).periods, "orbits.differentiable"),
        (lambda s, o: orbits.find_hybrid([orbits.Leg(s, ())], s.y0, [1.0]), "Find it outside"),
    ],
    ids=["find", "search", "stability", "continue_family", "find_hybrid"],
)
@pytest.mark.parametrize("transform", [jax.grad, jax.jit])
def test_searches_say_that_they_cannot_be_traced(swing, search, remedy, transform):
    def traced(g):
        return search(eqx.tree_at(lambda s: s.effects[0].g, swing.scene, g), swing)

    with pytest.raises(ValueError, match=f"expected numbers, got values traced by.*{remedy}"):
        transform(traced)(9.81)


def _in(scene, orbit):
    return eqx.tree_at(lambda o: o.scene, orbit, scene)


def test_an_orbit_that_does_not_close_has_no_derivative(swing):
    bad = orbits.Orbit(swing.scene, swing.closing, 1.0, orbits.Outcome.BOUND, 1, 1e-14)
    with pytest.raises(ValueError, match="orbit: expected an orbit that closes"):
        orbits.differentiable(bad.scene, bad)


@pytest.mark.parametrize("given", [3.0, jnp.ones(2), None])
def test_numbers_in_place_of_an_orbit_have_no_derivative(given):
    with pytest.raises(ValueError, match=r"orbit: expected an Orbit, .* or a SpecialOrbit, got"):
        orbits.differentiable(scenes.pendulum(), given)


def _driven(t, y, k):
    return [y[1], jnp.cos(t) - 0.2 * y[1] - k * y[0]]


def _response(k):
    return jaxdyn.ode(_driven, [0.0, 0.0], 2 * jnp.pi, params=k)


def test_the_numbers_of_another_orbit_are_refused_or_nan():
    """x = Re(exp(i t) / (k - 1 + 0.2 i)), so that x(0) depends on k."""
    known = orbits.find(_response(3.0))

    def start(k):
        return orbits.differentiable(_response(k), known).y0[0]

    values, slopes = jax.vmap(jax.value_and_grad(start))(jnp.array([2.9, 3.0, 3.0 + 1e-12]))
    x = 1 / (2 + 0.2j)
    assert np.isnan([values[0], slopes[0]]).all()
    np.testing.assert_allclose(values[1:], x.real, atol=1e-12)
    np.testing.assert_allclose(slopes[1:], -(x**2).real, atol=1e-10)
    with pytest.raises(ValueError, match="scene: expected the numbers with which the orbit was f"):
        start(2.9)
    level = orbits.Energy(0.0)
    still = orbits.find(scenes.oscillator(k=4.0), [1.0, 0.0], 3.0)
    with pytest.raises(ValueError, match="scene: expected the numbers with which the orbit was f"):
        orbits.differentiable(still.scene, still, hold=level)


def test_conditions_traced_by_jit_or_vmap_are_refused():
    swing = orbits.find(scenes.oscillator(k=4.0), [1.0, 0.0], 3.0)

    def start(level):
        return orbits.differentiable(swing.scene, swing, hold=orbits.Energy(level)).y0[0]

    assert abs(jax.grad(start)(2.0) - 0.25) < 1e-10  # x = sqrt(2 E / k)
    for way in (jax.jit(start), jax.jit(jax.grad(start)), lambda x: jax.vmap(start)(x[None])):
        with pytest.raises(
            ValueError, match="hold: expected numbers that are known, or traced by d"
        ):
            way(jnp.asarray(2.0))


def test_multipliers_that_coincide_are_nan():
    # On a circle the two that no integral forces to be 1 are 1 too, in a defective block.
    circle = orbits.Orbit(
        scene=kepler(0.0),
        closing=orbits.PLAIN,
        residual=0.0,
        outcome=orbits.Outcome.FOUND,
        iterations=0,
        rtol=1e-13,
    )
    found = orbits.analysis.DifferentiableOrbit(circle.scene, jnp.zeros(()), circle).multipliers()
    assert found.shape == (2,)
    assert jnp.isnan(found).all()


@pytest.mark.slow
def test_a_driven_orbit_by_the_frequency_of_its_drive():
    """Its period follows: x'' = cos(w t) - 0.2 x' - x has the answer 1 / (1 - w^2 + 0.2 i w)."""

    def rate(t, y, w):
        return [y[1], jnp.cos(w * t) - 0.2 * y[1] - y[0]]

    def at(w):
        return jaxdyn.ode(rate, [1.0, 0.0], 2 * jnp.pi / w, params=w)

    orbit = orbits.find(at(0.5))

    def start_and_period(w):
        found = orbits.differentiable(at(w), orbit)
        return jnp.append(found.y0, found.period)

    def exact(w):
        x = 1 / (1 - w**2 + 0.2j * w)
        return jnp.stack([x.real, (1j * w * x).real, 2 * jnp.pi / w])

    error = jax.jacfwd(start_and_period)(0.5) - jax.jacfwd(exact)(0.5)
    assert jnp.abs(error).max() < 1e-11


def van_der_pol(t, y, mu):
    del t
    return [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]


@pytest.mark.slow
def mathieu(t, y, p):
    omega, damping = p
    return [y[1], -damping * y[1] - (1 + 0.3 * jnp.cos(omega * t)) * y[0] - y[0] ** 3]


def test_a_rest_state_by_the_frequency_of_a_parametric_drive():
    """The drive is seen only beside the rest state."""

    def at(omega):
        numbers = jnp.stack([jnp.asarray(omega, float), jnp.asarray(0.05)])
        return jaxdyn.ode(mathieu, [0.0, 0.0], 2 * jnp.pi / omega, params=numbers)

    rest = orbits.find(at(2.6))

    def found(omega):
        orbit = orbits.differentiable(at(omega), rest)
        return orbit.period, orbit.multipliers()[0].real

    def trace(omega):
        def linear(t, z):
            y = z.reshape(2, 2)
            return np.stack([y[1], -0.05 * y[1] - (1 + 0.3 * np.cos(omega * t)) * y[0]]).ravel()

        span = (0.0, 2 * np.pi / omega)
        end = solve_ivp(linear, span, np.eye(2).ravel(), rtol=1e-12, atol=1e-13).y[:, -1]
        return end[0] + end[3]  # two complex multipliers with the same real part

    by_period, by_multiplier = jax.jacfwd(found)(2.6)
    np.testing.assert_allclose(by_period, -2 * np.pi / 2.6**2, rtol=1e-9)
    exact = (trace(2.601) - trace(2.599)) / 0.004
    np.testing.assert_allclose(by_multiplier, exact, rtol=1e-5)  # of the difference quotient


def test_the_amplitude_of_a_cycle_by_its_parameter():
    def make(mu):
        return jaxdyn.ode(van_der_pol, [2.0, 0.0], 6.66, params=mu)

    known = orbits.find(make(1.3))
    by_mu = jax.grad(lambda mu: orbits.differentiable(make(mu), known).amplitude("y0"))
    slope = float(by_mu(1.3))
    assert jax.jit(by_mu)(1.3) == pytest.approx(slope, abs=1e-12)

    def again(mu):
        orbit = orbits.find(make(mu), known.y0, known.period)
        return orbits.analysis.quantities.amplitude(orbit, "y0")

    h = 5e-3
    steps = {i: again(1.3 + i * h) - again(1.3 - i * h) for i in (1, 2, 3)}
    differences = (45 * steps[1] - 9 * steps[2] + steps[3]) / (60 * h)
    assert slope == pytest.approx(differences, abs=1e-9)


@pytest.mark.slow
def test_extremes_that_are_corners_move_with_the_switch():
    """A capacitor that is charged to u for d of 2; its least value is at the start."""

    def rate(t, y, p):
        u, d = p
        return [jnp.where(jnp.mod(t, 2.0) < d, u, 0.0) - y[0]]

    def make(p, y0):
        return jaxdyn.ode(rate, y0, 2.0, params=p, names=["u"])

    def exactly(p):
        high = p[0] * (1 - jnp.exp(-p[1])) / (1 - jnp.exp(-2.0))
        return jnp.stack([high * jnp.exp(p[1] - 2), high])

    p = jnp.array([3.0, 0.7])
    known = orbits.find(make(p, [0.5]))
    slopes = jax.jacfwd(lambda p: orbits.differentiable(make(p, known.y0), known).extremes("u"))(p)
    np.testing.assert_allclose(slopes, jax.jacfwd(exactly)(p), rtol=1e-10)


@pytest.mark.slow
def test_extremes_of_a_relay_of_which_some_are_corners():
    """By central differences of the exact half swing, in which the matrix exponential is exact."""

    def rate(t, y, p):
        gain, decay = p
        return [y[1] - y[0], y[2] - y[1], -gain * jnp.sign(y[0]) - decay * y[2]]

    def make(p):
        return jaxdyn.ode(rate, [0.003, -0.35, -0.89], 3.56, params=p)

    def exactly(p):
        gain, decay = p
        a, b = np.array([[-1, 1, 0], [0, -1, 1], [0, 0, -decay]]), np.array([0, 0, -gain])

        def after(y, s):
            flow = expm(a * s)
            return flow @ y + np.linalg.solve(a, (flow - np.eye(3)) @ b)

        def start(h):
            return np.linalg.solve(expm(a * h) + np.eye(3), -after(np.zeros(3), h))

        h = brentq(lambda h: start(h)[0], 1.0, 3.0, xtol=1e-14)
        y = start(h)
        top = brentq(lambda s: np.diff(after(y, s)[:2])[0], 1e-3, h - 1e-3, xtol=1e-14)
        return np.abs([after(y, top)[0], y[2]])

    known = orbits.find(make(jnp.array([1.3, 1.1])))

    def found(p):
        orbit = orbits.differentiable(make(p), known)
        return jnp.stack([orbit.amplitude("y0"), orbit.amplitude("y2")])

    p, h = np.array([1.3, 1.1]), 1e-5
    np.testing.assert_allclose(found(jnp.asarray(p)), exactly(p), rtol=1e-12)
    exact = [(exactly(p + d) - exactly(p - d)) / (2 * h) for d in h * np.eye(2)]
    np.testing.assert_allclose(jax.jacfwd(found)(jnp.asarray(p)).T, exact, rtol=1e-8)
