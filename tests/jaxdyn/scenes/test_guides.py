"""Beads, slots and plates against closed forms, quadrature and limits."""

import math

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import EXACT, SOLVED, central_difference, gap, refusal

from jaxdyn import Status, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.geometry import kinematics
from jaxdyn.scenes import guides

NOW = jnp.zeros(())
C, G = 0.3, 2.0
RANDOM = jax.random.normal(jax.random.key(4), (4, 4))


def test_bead_on_a_parabola_obeys_newtons_law():
    # (1 + 4 c^2 x^2) x'' = -2 c g x - 4 c^2 x x'^2.
    scene = guides.bead_on_parabola(c=C, g=G)
    for x, v in RANDOM[:, :2]:
        by_hand = -(2 * C * G * x + 4 * C**2 * x * v**2) / (1 + 4 * C**2 * x**2)
        assert gap(scene.rate(NOW, jnp.stack([x, v]))[1], by_hand) < EXACT * 10


@pytest.mark.parametrize("share", [0.01, 0.5, 0.98])
def test_bead_on_a_cycloid_takes_as_long_at_any_amplitude(share):
    scene = guides.bead_on_cycloid(c=C, g=G, s=share / (2 * C), speed=0.0)
    motion = simulate(scene, 2 * np.pi / np.sqrt(2 * C * G), samples=9, rtol=1e-13)
    assert gap(motion.ys[-1], scene.y0) < SOLVED * 10


def test_bead_on_a_cycloid_ends_with_the_curve():
    motion = simulate(guides.bead_on_cycloid(speed=10.0), samples=9, throw=False)
    assert int(motion.status) == Status.STEP_COLLAPSED
    assert bool(jnp.isnan(motion.ys[-1]).all())


def test_cycloid_is_the_curve_y_equals_c_s_squared():
    s = jnp.linspace(-0.99, 0.99, 7) / (2 * C)
    # Its tangent is a unit vector that rises at the rate 2 c s.
    tangents = jax.vmap(jax.jacfwd(lambda s: guides.cycloid(C, s)))(s)
    assert gap(jnp.sum(tangents**2, axis=1), jnp.ones(7)) < EXACT * 10
    assert gap(guides.cycloid(C, s)[:, 1], C * s**2) < EXACT
    # Its x by quadrature of dx = sqrt(ds^2 - dy^2), and as the bead has it.
    nodes, weights = np.polynomial.legendre.leggauss(60)
    end = float(s[5])
    x = np.sum(weights * np.sqrt(1 - (C * end * (nodes + 1)) ** 2)) * end / 2
    assert gap(guides.cycloid(C, s[5])[0], x) < EXACT * 10
    bead = guides.bead_on_cycloid(c=C).system.mechanism
    assert gap(bead.positions(NOW, s[5:6])[0], guides.cycloid(C, s[5])) < EXACT * 10


def test_slot_mass_accelerates_alike_by_three_routes():
    d = jnp.asarray(0.7)
    for row in jax.random.normal(jax.random.key(5), (5, 6)):
        q, v, a = row.reshape(3, 2)
        by_axes = kinematics.slot_acceleration(d, q, v, a)
        assert gap(kinematics.slot_acceleration_five_terms(d, q, v, a), by_axes) < EXACT * 50
        position = lambda q: kinematics.slot_position(d, q)  # noqa: E731
        assert gap(kinematics.by_derivatives(position, q, v, a), by_axes) < EXACT * 50


def test_turntable_obeys_its_momentum_balances():
    m, inertia, d = 1.3, 0.8, 0.6
    scene = guides.turntable(m=m, inertia=inertia, d=d, m_table=2.0)
    for y in RANDOM:
        _, s, w, v = y
        alpha, a = scene.rate(NOW, y)[2:]
        # Along the slot nothing pushes; about the centre nothing turns the whole.
        assert gap(a + alpha * d - w**2 * s, jnp.zeros(())) < EXACT * 100
        whole = (inertia + m * (s**2 + d**2)) * alpha + m * d * a + 2 * m * s * v * w
        assert gap(whole, jnp.zeros(())) < EXACT * 100


@pytest.mark.parametrize("speed", [1.0, -0.5])
def test_turntable_approaches_its_limit_angle(speed):
    scene = guides.turntable(speed=speed)
    motion = simulate(scene, 1e5, samples=9, rtol=1e-13)
    theta, s, _, v = motion.ys[-1]
    # What is left falls as 1/s: dtheta/ds = (H / v - m d) / (m s^2) far out.
    momentum = energy.angular_momentum(scene, NOW, scene.y0)
    left = (momentum / v - 0.5) / s
    assert gap(theta + left, guides.turntable_limit(speed=speed)) < 1e-10


@pytest.mark.parametrize("speed", [1.0, -0.3, 1e-4, 1e-8, 1e-100])
def test_the_turntables_limit_is_an_elliptic_integral_at_any_speed(speed):
    d, m, inertia, rate = 0.4, 1.5, 2.0, 1.3
    a = inertia + m * d * d
    h, e2 = a * rate + m * d * speed, a * rate**2 + m * speed**2 + 2 * m * d * speed * rate
    with mpmath.workdps(30):
        near = inertia * mpmath.mpf(speed) ** 2 / e2
        first = mpmath.elliprf(0, near, inertia / m)
        third = mpmath.elliprj(0, near, inertia / m, a / m)
        exact = h / mpmath.sqrt(e2 * m) * (first - d * d / 3 * third)
        exact -= mpmath.sign(speed) * m * d * mpmath.pi / 2 / mpmath.sqrt(m * a)
    found = guides.turntable_limit(d=d, m=m, inertia=inertia, speed=speed, rate=rate)
    assert abs(float(found) / float(exact) - 1) < EXACT


def test_the_turntables_limit_is_differentiable():
    def limit(x):
        return guides.turntable_limit(d=x[0], speed=x[1], rate=x[2])

    x = jnp.array([0.4, 0.1, 1.2])
    assert gap(jax.grad(limit)(x), central_difference(limit, x)) < 1e-7  # h^4 / v^5


@pytest.mark.slow
def test_turntable_turns_for_ever_with_the_mass_at_rest_but_is_unstable():
    m, inertia, d, rate = 1.3, 0.8, 0.6, 2.0
    scene = guides.turntable(m=m, inertia=inertia, d=d, speed=0.0, rate=rate)
    assert gap(scene.rate(NOW, scene.y0), jnp.array([rate, 0.0, 0.0, 0.0])) < EXACT
    motion = simulate(scene, 4.0, samples=9, rtol=1e-13)
    assert gap(motion["theta"], rate * motion.ts) < SOLVED * 10
    # The growth rate of the docstring.
    growth = np.linalg.eigvals(jax.jacfwd(lambda y: scene.rate(NOW, y))(scene.y0)).real.max()
    assert abs(growth / (rate * np.sqrt(1 + m * d * d / inertia)) - 1) < EXACT * 10
    limits = [guides.turntable_limit(speed=0.0, rate=rate) for rate in (2.0, -2.0, 0.0)]
    assert np.array_equal(limits, [np.inf, -np.inf, 0.0])


@pytest.mark.slow
def test_plate_turns_at_zero_angular_momentum():
    motion = simulate(guides.plate(), samples=9, rtol=1e-13)
    momentum = energy.along(energy.angular_momentum, motion)
    assert gap(momentum, jnp.zeros(9)) < SOLVED * 10
    # The integral of (1 + 2 cos a) / (9 + 4 cos a) over a round.
    closed = -np.pi * (1 - 7 / np.sqrt(65))
    assert gap(motion["phi"][-1], closed) < SOLVED
    assert gap(guides.plate_turn(), closed) < EXACT


@pytest.mark.parametrize("weld", [2.0, 1e-3, 1e-6])
def test_the_plates_turn_is_that_of_a_quadrature_however_near_a_mass_comes_to_the_middle(weld):
    with mpmath.workdps(30):
        exact = mpmath.quad(
            lambda t: (
                -4 * (1 + mpmath.cos(t)) / (mpmath.mpf(weld) ** 2 + 4 + 4 + 8 * mpmath.cos(t))
            ),
            [0, *(mpmath.pi * (1 - mpmath.mpf(10) ** -i) for i in range(1, 8)), mpmath.pi],
        )
    found = guides.plate_turn(weld=weld, centre=2.0, radius=2.0)
    assert abs(float(found) / float(2 * exact) - 1) < EXACT


def test_numbers_that_make_no_sense_are_refused():
    for scene, name in (
        (guides.bead_on_cycloid(c=-1.0), "c"),
        (guides.turntable(inertia=-1.0), "inertia"),
        (guides.plate(weld=0.0), "weld"),
    ):
        with pytest.raises(ValueError, match=f"{name}: expected > 0"):
            simulate(scene)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: scenes.bead_on_cycloid(s=9.0, c=0.25),
            "s: expected less than 2 m from the bottom",
        ),
        (lambda: scenes.bead_on_cycloid(s=math.nan), "s: expected less than"),
    ],
)
def test_an_invalid_start_is_refused_by_name(make, message):
    assert refusal(make).startswith(message)


def test_a_start_just_inside_of_the_cycloid_is_taken():
    assert simulate(scenes.bead_on_cycloid(s=1.99, c=0.25), 0.1).ok


def test_the_limit_of_the_turntable_takes_one_number_at_a_time():
    assert "jax.vmap" in refusal(lambda: guides.turntable_limit(speed=np.ones(3)))
    refusal(lambda: guides.turntable_limit(d="far"))
