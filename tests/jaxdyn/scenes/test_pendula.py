"""Pendulums against closed forms, elliptic periods and published frequencies."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap
from scipy.integrate import solve_ivp

from jaxdyn import linearize, simulate
from jaxdyn.analysis import energy
from jaxdyn.geometry import kinematics
from jaxdyn.scenes import pendula

NOW = jnp.zeros(())
RANDOM = jax.random.normal(jax.random.key(2), (4, 4))


def elliptic_period(length: float, g: float, angle: float) -> float:
    """Period of a pendulum by Gauss's arithmetic-geometric mean."""
    a, b = 1.0, np.cos(angle / 2)
    for _ in range(10):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return 2 * np.pi * np.sqrt(length / g) / a


@pytest.mark.sample("newton_euler")
@pytest.mark.parametrize("formulation", ["newton_euler", "constrained"])
def test_pendulum_returns_after_its_elliptic_period(formulation):
    scene = pendula.pendulum(length=0.7, g=3.0, angle=2.8, formulation=formulation)
    motion = simulate(scene, elliptic_period(0.7, 3.0, 2.8), samples=9, rtol=1e-13)
    assert gap(motion.ys[-1], scene.y0) < SOLVED * 10


@pytest.mark.slow
def test_uniform_bar_is_a_pendulum_of_two_thirds_of_its_length():
    scene = pendula.n_pendulum(m=(2.0,), length=(1.2,), angles=(2.0,), rates=(0.0,), g=5.0)
    motion = simulate(scene, elliptic_period(0.8, 5.0, 2.0), samples=9, rtol=1e-13)
    assert gap(motion.ys[-1], scene.y0) < SOLVED * 10


def test_shaken_pendulum_obeys_its_equation():
    # theta'' = (g + b'') sin(theta) / L with b'' = A w^2 cos(w t), L = l or 2 l / 3.
    t, y = jnp.asarray(0.37), jnp.array([0.8, 0.3])
    lift = 9.81 + 0.2 * 30.0**2 * np.cos(30.0 * 0.37)
    for uniform, share in ((False, 1.0), (True, 2 / 3)):
        scene = pendula.shaken_pendulum(length=1.4, amplitude=0.2, frequency=30.0, uniform=uniform)
        expected = lift * np.sin(0.8) / (share * 1.4)
        assert gap(scene.rate(t, y)[1], expected) < EXACT * 1e3


@pytest.mark.slow
def test_fast_shaking_holds_a_stick_upright_and_slow_shaking_does_not():
    # Kapitza: upright if (amplitude frequency)^2 > 2 g L; 36 and 4 against 13.
    fast = simulate(pendula.shaken_pendulum(frequency=60.0), samples=200)
    assert float(jnp.abs(fast["theta"]).max()) < 0.3
    slow = simulate(pendula.shaken_pendulum(frequency=20.0), samples=200)
    assert float(jnp.abs(slow["theta"]).max()) > 2.0


def two_points(m, l, g):  # noqa: E741
    """The double pendulum of point masses as mechanics books print it, solved for both."""

    def rate(t, y):
        del t
        (a, b, va, vb), (m1, m2), (l1, l2) = y, m, l
        turn = a - b
        rows = [[(m1 + m2) * l1, m2 * l2 * np.cos(turn)], [l1 * np.cos(turn), l2]]
        right = [
            -m2 * l2 * vb**2 * np.sin(turn) - (m1 + m2) * g * np.sin(a),
            l1 * va**2 * np.sin(turn) - g * np.sin(b),
        ]
        return np.concatenate([[va, vb], np.linalg.solve(rows, right)])

    return rate


POINTS = {"m": (1.3, 0.7), "length": (0.9, 1.1), "g": 2.0, "uniform": False}


@pytest.mark.slow
def test_double_pendulum_of_point_masses_obeys_the_equations_of_the_books():
    rate = two_points(POINTS["m"], POINTS["length"], POINTS["g"])
    for formulation in ("newton_euler", "lagrange"):
        scene = pendula.double_pendulum(**POINTS, formulation=formulation)
        for y in RANDOM:
            assert gap(scene.rate(NOW, y), rate(0.0, np.asarray(y))) < 100 * EXACT
        assert [name for name, _ in scene.labels()] == [
            "theta1",
            "theta2",
            "theta1_dot",
            "theta2_dot",
        ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("formulation", "relative"),
    [("newton_euler", False), ("lagrange", True), ("constrained", False)],
)
def test_double_pendulum_of_point_masses_moves_as_by_another_integrator(formulation, relative):
    start = [1.0, 2.0, 0.1, -0.3]
    exact = solve_ivp(
        two_points(POINTS["m"], POINTS["length"], POINTS["g"]),
        (0, 3.0),
        start,
        "DOP853",
        rtol=1e-13,
        atol=1e-14,
    ).y[:, -1]
    scene = pendula.double_pendulum(
        **POINTS, angles=start[:2], rates=start[2:], formulation=formulation, relative=relative
    )
    motion = simulate(scene, 3.0, samples=9, rtol=1e-13)
    (a, b), (l1, l2) = exact[:2], POINTS["length"]
    first = np.array([l1 * np.sin(a), -l1 * np.cos(a)])
    ends = np.cumsum([first, [l2 * np.sin(b), -l2 * np.cos(b)]], axis=0)
    assert gap(motion.r[-1], ends) < 1e-10


@pytest.mark.parametrize("n", [2, 3])
def test_point_masses_hanging_in_a_row_have_the_frequencies_of_laguerre(n):
    # With equal masses on equal rods they are g / l times the zeros of Laguerre's polynomial of
    # degree n.
    numbers = {"m": (1.0,) * n, "length": (0.5,) * n, "angles": (0.0,) * n, "rates": (0.0,) * n}
    scene = pendula.n_pendulum(**numbers, g=2.0, uniform=False)
    found = np.linalg.eigvals(linearize(scene, scene.y0).jacobian)
    zeros = np.polynomial.laguerre.lagroots([0.0] * n + [1.0])
    assert gap(np.sort(np.abs(found.imag) ** 2)[::2], 2.0 / 0.5 * zeros) < 1e-11


def test_double_pendulum_obeys_the_equations_of_the_books():
    m1, m2, l1, l2, g = 1.3, 0.7, 0.9, 1.1, 2.0
    scene = pendula.double_pendulum(m=(m1, m2), length=(l1, l2), g=g)
    for y in RANDOM:
        a, b, u, w = y
        rate = scene.rate(NOW, y)
        x, z = rate[2:]
        c, s = jnp.cos(a - b), jnp.sin(a - b)
        k = m2 * l1 * l2 / 2
        first = (m1 / 3 + m2) * l1**2 * x + k * (c * z + s * w**2)
        second = m2 * l2**2 / 3 * z + k * (c * x - s * u**2)
        assert gap(first, -(m1 / 2 + m2) * g * l1 * jnp.sin(a)) < EXACT * 100
        assert gap(second, -m2 * g * l2 / 2 * jnp.sin(b)) < EXACT * 100


@pytest.mark.parametrize("make", [pendula.double_pendulum, pendula.triple_pendulum])
def test_dampers_in_hinges_take_the_power_of_the_rates_between_bars(make):
    c = np.array([0.3, 0.2, 0.1])[: len(make().y0) // 2]
    for damping in (c, 0.4, (*c[:-1], 0.0)):
        for relative in (False, True):
            scene = make(damping=damping, relative=relative)
            y = RANDOM.ravel()[: len(scene.y0)]
            v = np.asarray(y[len(c) :])
            between = v if relative else np.diff(v, prepend=0.0)
            torques = sum(one.generalized(NOW, y[: len(c)], v) for one in scene.effects[1:])
            assert gap(torques @ v, -np.sum(damping * between**2)) < EXACT * 100
    assert make(damping=0.0).effects == make().effects


def test_a_compiled_function_adds_no_damper_of_0():
    def effects(length, formulation):
        scene = pendula.pendulum(length=length, formulation=formulation)
        return jnp.asarray(len(scene.effects))

    for formulation in ("newton_euler", "constrained"):
        alone = len(pendula.pendulum(formulation=formulation).effects)
        assert jax.jit(lambda x, f=formulation: effects(x, f))(1.2) == alone


def test_damping_of_a_row_is_one_number_or_one_for_each_hinge():
    with pytest.raises(ValueError, match=r"damping: expected shape \(2,\), .* One number for all"):
        pendula.double_pendulum(damping=(0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match="damping: expected 0 for formulation='constrained'"):
        pendula.triple_pendulum(formulation="constrained", damping=0.1)

    def rate(c):
        return pendula.double_pendulum(damping=c).rate(NOW, RANDOM[0])

    # The rate is linear in the coefficient, which may be traced.
    assert gap(jax.jacfwd(rate)(0.0), rate(1.0) - rate(0.0)) < EXACT * 100


def test_end_of_a_double_pendulum_accelerates_alike_by_three_routes():
    l = jnp.array([1.3, 0.6])  # noqa: E741
    for row in jax.random.normal(jax.random.key(3), (5, 6)):
        q, v, a = row.reshape(3, 2)
        polar = kinematics.end_acceleration(l, q, v, a)
        relative = [jnp.stack([x[0], x[1] - x[0]]) for x in (q, v, a)]
        assert gap(kinematics.end_acceleration_relative(l, *relative), polar) < EXACT * 50
        position = lambda q: kinematics.end_position(l, q)  # noqa: E731
        assert gap(kinematics.by_derivatives(position, q, v, a), polar) < EXACT * 50


def test_cart_and_pendulum_obey_the_equations_of_newton_and_euler():
    m1, m2, l, g = 1.5, 0.8, 0.9, 3.0  # noqa: E741
    scene = pendula.cart_pendulum(m=(m1, m2), length=l, g=g)
    for y in RANDOM:
        _, angle, _, rate = y
        s, c = jnp.sin(angle), jnp.cos(angle)
        x = m2 * s * (l * rate**2 + g * c) / (m1 + m2 * s**2)
        swing = -(g * s + x * c) / l
        assert gap(scene.rate(NOW, y)[2:], jnp.stack([x, swing])) < EXACT * 100


@pytest.mark.slow
def test_cart_and_pendulum_keep_horizontal_momentum():
    motion = simulate(pendula.cart_pendulum(speed=0.3, rate=2.0), samples=9, rtol=1e-13)
    momentum = energy.along(energy.momentum, motion)[:, 0]
    assert gap(momentum, jnp.broadcast_to(momentum[0], (9,))) < SOLVED


def test_numbers_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"angles: expected shape \(2,\), got shape \(3,\)"):
        pendula.double_pendulum(angles=(1.0, 2.0, 3.0))
    with pytest.raises(ValueError, match=r"rates: expected shape \(2,\), got shape \(1,\)"):
        pendula.double_pendulum(rates=(1.0,))
    with pytest.raises(ValueError, match=r"length: expected shape .* One for each entry of m"):
        pendula.n_pendulum(m=(1.0,), length=(1.0, 1.0), angles=(1.0,), rates=(0.0,)).check()
    with pytest.raises(ValueError, match=r"length: expected > 0, got -1.0"):
        pendula.double_pendulum(length=(1.0, -1.0)).check()


@pytest.mark.slow
def test_the_phase_of_a_shaking_base_shifts_time():
    t, y = jnp.asarray(0.3), jnp.array([0.4, 0.1])
    late = pendula.shaken_pendulum(frequency=20.0, phase=0.7)
    now = pendula.shaken_pendulum(frequency=20.0)
    assert gap(late.rate(t, y), now.rate(t + 0.7 / 20.0, y)) < EXACT * 1e3
    numbers = {"frequency": 20.0, "phase": 0.7, "formulation": "constrained", "t1": 1.0}
    base = simulate(pendula.shaken_pendulum(**numbers), samples=3, rtol=1e-13)
    free = simulate(
        pendula.shaken_pendulum(**numbers | {"formulation": "lagrange"}), samples=3, rtol=1e-13
    )
    assert gap(base.r, free.r) < SOLVED * 100
