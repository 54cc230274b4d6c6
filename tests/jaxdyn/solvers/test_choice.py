"""Which method a scene gets, and that all that is asked of a default works with it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap, kepler
from odes import lorenz

import jaxdyn
from jaxdyn import Scene, ensemble, scenes, simulate
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate import events
from jaxdyn.integrate.simulation import _compiled_flow, solve
from jaxdyn.solvers import (
    NYSTROM12,
    STOERMER18,
    TAYLOR12,
    TAYLOR14,
    TAYLOR16,
    TAYLOR20,
    VERNER9,
    Taylor,
    default_solver,
)
from jaxdyn.solvers.choice import reason


def rooted(t, y):
    """Drag whose root has no derivative at rest, where the motion starts."""
    return [y[1], -9.81 - y[1] * jnp.sqrt(y[1] ** 2 + 0.0 * y[0])]


def swing(t, y):
    return [y[1], -jnp.sin(y[0])]


def braked(t, y):
    return [y[1], -y[0] - jnp.abs(y[1])]


def relaxed(t, y, k):
    """y chases cos t at rate k."""
    return [k * (jnp.cos(t) - y[0])]


def van_der_pol(t, y, mu):
    return [y[1], mu * (1 - y[0] * y[0]) * y[1] - y[0]]


def spherical(t, y):
    """A pendulum in space in two angles."""
    sine, cosine = jnp.sin(y[0]), jnp.cos(y[0])
    return [y[2], y[3], y[3] ** 2 * sine * cosine - sine, -2.0 * cosine / sine * y[2] * y[3]]


def anharmonic(t, y):
    """Four points between walls, joined by springs with a cubic part."""
    q = jnp.concatenate([jnp.zeros(1), y[:4], jnp.zeros(1)])
    pull = jnp.diff(q) + 0.3 * jnp.diff(q) ** 3
    return [*y[4:], *jnp.diff(pull)]


def robertson(t, y):
    """A slow reaction and two fast ones."""
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return [back - slow, slow - back - fast, fast]


NUMBERS = {"sigma": 10.0, "rho": 28.0, "beta": 8 / 3}
LORENZ = jaxdyn.ode(lorenz, [1.0, 1.0, 1.0], 2.0, params=NUMBERS)
#: Lennard and Jones's potential: powers and a quotient, ten products.
WELL = jaxdyn.ode(
    lambda t, y: [y[1], 24 * (2 * y[0] ** -13 - y[0] ** -7)], [1.5, 0.0], second_order=True
)
#: The potential of Henon and Heiles: a polynomial, three products.
HENON_HEILES = jaxdyn.ode(
    lambda t, y: [y[2], y[3], -y[0] - 2 * y[0] * y[1], y[1] ** 2 - y[1] - y[0] ** 2],
    [0.1, 0.2, 0.3, 0.1],
    second_order=True,
)
#: Duffing's, undamped: two.
CUBIC = jaxdyn.ode(lambda t, y: [y[1], y[0] - y[0] ** 3], [1.2, 0.0], second_order=True)
END = solve(LORENZ, 2.0, rtol=1e-13, solver=VERNER9).y1


@pytest.mark.parametrize(
    ("scene", "method", "why"),
    [
        (LORENZ, TAYLOR20, "2 products per order; with at most 4, order 20 is the fastest"),
        (scenes.cannonball(drag=0.3), TAYLOR16, "needs 5 products"),
        (scenes.double_pendulum(), TAYLOR12, "needs 22 products"),
        (
            scenes.triple_pendulum(),
            VERNER9,
            "51 products per order; with more than 24, another",
        ),
        (
            scenes.three_body(),
            STOERMER18,
            "faster for forces that contain only powers and quotients",
        ),
        (
            WELL,
            STOERMER18,
            "faster for forces that contain only powers and quotients",
        ),
        (
            HENON_HEILES,
            STOERMER18,
            "with more than 2, another method is faster for polynomial",
        ),
        (scenes.two_masses(), NYSTROM12, "do not depend on velocity, and the rate has many"),
        (
            jaxdyn.ode(rooted, [0.0, 0.0]),
            VERNER9,
            "contains a root, which has no Taylor series at 0",
        ),
        (jaxdyn.ode(braked, [1.0, 0.0]), VERNER9, "no Taylor series"),
    ],
    ids=[
        "lorenz",
        "ball",
        "two bars",
        "three",
        "eight",
        "well",
        "henon",
        "spring",
        "root",
        "condition",
    ],
)
def test_the_default_is_by_what_the_rate_is_made_of(scene, method, why):
    assert default_solver(scene) is method
    assert why in reason(scene)


def test_looser_tolerances_take_lower_orders():
    assert default_solver(LORENZ, rtol=1e-7) is TAYLOR16
    assert default_solver(LORENZ, rtol=1e-8) is TAYLOR20
    assert default_solver(scenes.cannonball(drag=0.3), rtol=1e-7) is TAYLOR12
    # One program for tolerances that are known at run time only.
    orders = []

    @jax.jit
    def looked(rtol):
        orders.append(default_solver(LORENZ, rtol=rtol))
        return rtol

    looked(1e-5)
    assert orders == [TAYLOR20]
    # One with a value is looked at, within a program as well.
    coarse = jnp.asarray(1e-5)
    assert jax.jit(lambda t: t + default_solver(LORENZ, rtol=coarse).order)(0.0) == 16
    orbit = kepler(0.3)
    assert default_solver(orbit, rtol=1e-5).name == "Taylor 12"
    assert default_solver(orbit, rtol=1e-5).for_tangents is NYSTROM12


@pytest.mark.slow
def test_polynomial_forces_take_what_runs_fastest_at_each_tolerance():
    assert default_solver(CUBIC).name == "Taylor 20"
    assert default_solver(HENON_HEILES, rtol=1e-8) is STOERMER18
    assert default_solver(HENON_HEILES, rtol=1e-7) is NYSTROM12
    assert reason(HENON_HEILES, 1e-7).endswith("this pair is usually as fast as extrapolation")
    assert default_solver(HENON_HEILES, rtol=1e-11) is STOERMER18
    # A finer tolerance than extrapolation can reach: what a series costs decides as for quotients.
    assert default_solver(HENON_HEILES, rtol=1e-12).name == "Taylor 20"
    traced = []
    jax.jit(lambda rtol: traced.append(default_solver(HENON_HEILES, rtol=rtol)) or rtol)(1e-7)
    assert traced[0].name == "Taylor 20"
    # Ten products, of which a series is never the fastest.
    chain = jaxdyn.ode(anharmonic, [0.4, 0.7, 0.7, 0.4, 0, 0, 0, 0], second_order=True)
    wanted = {1e-7: NYSTROM12, 1e-10: STOERMER18, 1e-12: NYSTROM12}
    assert {rtol: default_solver(chain, rtol=rtol) for rtol in wanted} == wanted
    # Few numbers whose forces are no polynomials.
    assert default_solver(WELL, rtol=1e-7) is NYSTROM12
    ends = [solve(HENON_HEILES, 20.0, rtol=rtol).y1 for rtol in (1e-7, 1e-10, 1e-13)]
    exact = solve(HENON_HEILES, 20.0, rtol=1e-15, solver=VERNER9).y1
    for found, bound in zip(ends, (1e-6, 1e-9, 1e-12), strict=True):
        assert gap(found, exact) < bound


def _ring(n, d=2):
    """n bodies that attract each other, on a ring and at rest in its plane's first direction."""
    angles = 2 * np.pi * np.arange(n) / n
    r = np.zeros((n, d))
    r[:, 0], r[:, 1] = 2 * np.cos(angles), 2.1 * np.sin(angles)
    v = np.zeros((n, d))
    v[:, 1] = 0.5 * np.cos(angles)
    y0 = np.concatenate([r.ravel(), v.ravel()])
    return Scene(FreePoints(np.arange(1.0, n + 1), d=d), (PairGravity(1.0),), y0=y0, t1=1.0)


@pytest.mark.parametrize(
    ("n", "d", "rtol", "method", "why"),
    [
        (5, 2, 1e-6, STOERMER18, "for a state of 20 numbers, extrapolation is"),
        (12, 3, 1e-11, STOERMER18, "for a state of 72 numbers, extrapolation is"),
        (5, 2, 1e-12, NYSTROM12, "below rtol 1e-11, rounding errors limit extrapolation"),
        (
            3,
            2,
            1e-5,
            STOERMER18,
            "for a state of 12 numbers, extrapolation is",
        ),
        (13, 3, 1e-6, NYSTROM12, "has many operations, or no Taylor series"),
    ],
)
def test_several_bodies_take_extrapolation_where_rounding_leaves_room(n, d, rtol, method, why):
    scene = _ring(n, d)
    assert default_solver(scene, rtol=rtol) is method
    assert default_solver(scene, rtol=rtol, several=True) is NYSTROM12
    assert reason(scene, rtol).endswith(why)


@pytest.mark.slow
def test_all_that_is_asked_of_a_default_works_with_extrapolation():
    scene = _ring(5)
    exact = solve(scene, 1.0, ts=[0.3, 1.0], rtol=1e-15, solver=NYSTROM12)
    for rtol in (1e-7, 1e-10, 1e-12):
        found = solve(scene, 1.0, ts=[0.3, 1.0], rtol=rtol)
        assert gap(found.y1, exact.y1) < 30 * rtol
        assert gap(found.ys, exact.ys) < 30 * rtol
    by_name = solve(scene, 1.0, rtol=1e-10, solver=STOERMER18)
    assert gap(solve(scene, 1.0, rtol=1e-10).y1, by_name.y1) == 0
    # A tolerance that is known at run time only may be fine.
    fine = jax.jit(lambda rtol: solve(scene, 1.0, rtol=rtol).y1)
    assert gap(fine(1e-14), exact.y1) < 1e-13
    # So may that of requested digits: one program, and the pair's.
    motion = simulate(scene, 1.0, samples=2, digits=11)
    assert gap(motion.ys[-1], exact.y1) < 1e-11
    assert "Nystrom 12(10)" in motion.error.basis
    assert "Stoermer" not in motion.error.basis


@pytest.mark.slow
def test_a_series_for_forces_without_velocities_leaves_the_rest_to_the_nystrom_pair():
    scene = jaxdyn.ode(swing, [2.0, 0.1], 3.0, second_order=True)
    method = default_solver(scene)
    assert method.name == "Taylor 20"
    assert "and the Taylor series of the rate needs 2 products" in reason(scene)
    assert method.for_tangents is default_solver(scene, several=True) is NYSTROM12
    orbit = kepler(0.3)
    with_quotients = default_solver(orbit)
    assert with_quotients.name == "Taylor 16"
    assert with_quotients.for_tangents is NYSTROM12
    assert "and the Taylor series of the rate needs 6 products" in reason(kepler(0.3))

    ts = jnp.array([1.0, 2.5])
    exact = solve(scene, 3.0, ts=ts, rtol=1e-14, solver=VERNER9)
    for fixed in (False, True):
        found = solve(scene, 3.0, ts=ts, rtol=1e-13, fixed=fixed)
        assert gap(found.ys, exact.ys) < SOLVED
        assert gap(found.y1, exact.y1) < SOLVED

    def height(y0, **how):
        return jnp.cos(solve(scene.starting(y0), 3.0, rtol=1e-12, **how).y1[0])

    by_pair = jax.jacfwd(lambda y: height(y, solver=NYSTROM12))(scene.y0)
    assert gap(jax.jacfwd(height)(scene.y0), by_pair) < SOLVED
    assert gap(jax.grad(lambda y: height(y, adjoint=True))(scene.y0), by_pair) < 1e-10
    lowest = events.Reaches(0, 0.0)
    found = [events.until(scene, lowest, rtol=1e-13, solver=each).y for each in (None, NYSTROM12)]
    assert gap(*found) == 0


def test_a_root_that_is_zero_at_the_start_is_passed_by_default():
    scene = jaxdyn.ode(rooted, [0.0, 0.0])
    exact = [-np.log(np.cosh(np.sqrt(9.81))), -np.sqrt(9.81) * np.tanh(np.sqrt(9.81))]
    assert gap(solve(scene, 1.0, rtol=1e-13).y1, exact) < 1e-11
    assert not np.isfinite(solve(scene, 1.0, rtol=1e-13, solver=TAYLOR14).y1).all()


@pytest.mark.slow
def test_ends_samples_and_digits_are_right():
    motion = simulate(LORENZ, samples=[1.0, 2.0], rtol=1e-13)
    assert gap(motion.ys[-1], END) < SOLVED
    halfway = solve(LORENZ, 1.0, rtol=1e-13, solver=VERNER9).y1
    assert gap(motion.ys[0], halfway) < SOLVED
    assert gap(simulate(LORENZ, samples=1, digits=9).ys[-1], END) < 1e-9


@pytest.mark.slow
def test_events_and_ensembles_take_a_pair_for_it():
    event = events.Reaches(2, 30.0)
    found = events.until(LORENZ, event, rtol=1e-13)
    assert gap(found.y, events.until(LORENZ, event, rtol=1e-13, solver=VERNER9).y) == 0
    assert gap(solve(LORENZ, found.t, rtol=1e-13).y1, found.y) < SOLVED
    starts = np.array([LORENZ.y0, LORENZ.y0 + 0.1])
    assert gap(ensemble.run(LORENZ, starts, rtol=1e-13).y1[0], END) < SOLVED


@pytest.mark.slow
def test_derivatives_maps_and_traced_tolerances():
    def end(y0, rtol=1e-12, **how):
        return solve(LORENZ.starting(y0), 2.0, rtol=rtol, **how).y1

    by_pair = jax.jacfwd(lambda y: end(y, solver=VERNER9))(LORENZ.y0)
    assert gap(jax.jacfwd(end)(LORENZ.y0), by_pair) < SOLVED
    assert gap(jax.jacrev(end)(LORENZ.y0), by_pair) < SOLVED
    assert gap(jax.vmap(end)(jnp.stack([LORENZ.y0]))[0], END) < 1e-10
    # One method for all tolerances, so that they may be known at run time only.
    assert gap(jax.jit(end)(LORENZ.y0, 1e-13), END) < SOLVED


@pytest.mark.slow
def test_samples_derivatives_events_and_ensembles_of_a_mechanism():
    scene = scenes.double_pendulum(angles=(0.8, 0.5), t1=2.0)
    assert default_solver(scene).for_tangents is VERNER9
    ts = jnp.array([0.7, 2.0])
    exact = solve(scene, 2.0, ts=ts, rtol=1e-14, solver=VERNER9)
    found = solve(scene, 2.0, ts=ts, rtol=1e-13)
    assert gap(found.ys, exact.ys) < SOLVED
    assert gap(found.y1, exact.y1) < SOLVED

    def end(y0, **how):
        return solve(scene.starting(y0), 2.0, rtol=1e-12, **how).y1

    by_pair = jax.jacfwd(lambda y: end(y, solver=VERNER9))(scene.y0)
    assert gap(jax.jacfwd(end)(scene.y0), by_pair) < SOLVED
    assert gap(jax.jacrev(end)(scene.y0), by_pair) < SOLVED
    lowest = events.Reaches(0, 0.0)
    found = [events.until(scene, lowest, rtol=1e-13, solver=each).y for each in (None, VERNER9)]
    assert gap(*found) == 0
    starts = np.array([scene.y0, scene.y0 + 1e-3])
    several = [
        ensemble.run(scene, starts, rtol=1e-12, **how).y1 for how in ({}, {"solver": VERNER9})
    ]
    assert gap(*several) == 0
    assert gap(several[0][0], exact.y1) < 1e-10


def _error_ratio(scene, method, t1):
    """Geometric mean, over tolerances, of a method's errors beside those of `VERNER9`.

    Errors below a tenth of the tolerance count as a tenth.
    """
    exact = solve(scene, t1, rtol=1e-15, solver=VERNER9).y1

    def errors(each):
        ends = [
            (rtol, solve(scene, t1, rtol=rtol, solver=each).y1)
            for rtol in 10.0 ** -np.arange(5, 11)
        ]
        return np.log([max(gap(y, exact), 0.1 * rtol) for rtol, y in ends])

    return float(np.exp(np.mean(errors(method) - errors(VERNER9))))


@pytest.mark.slow
def test_at_one_tolerance_errors_are_of_the_size_of_those_of_the_pair():
    swinging = jaxdyn.ode(spherical, [1.0, 0.0, 0.0, 0.8])
    relaxing = jaxdyn.ode(van_der_pol, [2.0, 0.0], params=5.0)
    tumbling = scenes.double_pendulum(angles=(0.8, 0.5))
    for scene, t1 in ((swinging, 100.0), (relaxing, 100.0), (tumbling, 20.0)):
        method = default_solver(scene)
        assert isinstance(method, Taylor)
        ratio = _error_ratio(scene, method, t1)
        assert ratio < 2.0, (method.name, ratio)


@pytest.mark.sample("damped")
@pytest.mark.parametrize(
    ("make", "t1"),
    [
        (lambda: jaxdyn.ode(van_der_pol, [2.0, 0.0], params=1000.0), 1.0),
        (lambda: jaxdyn.ode(robertson, [1.0, 0.0, 0.0]), 3.0),
        # Its estimate is a difference of slopes; the fast motion is that of two masses apart.
        (lambda: scenes.two_springs(c_a=1e6), 1e-3),
    ],
    ids=["relaxation", "reactions", "damped"],
)
def test_the_default_says_that_a_motion_is_stiff(make, t1):
    scene = make()
    assert isinstance(default_solver(scene), Taylor)
    motion = simulate(scene, t1, samples=2, rtol=1e-6)
    assert motion.warning.startswith("The scene is stiff")


@pytest.mark.slow
def test_new_numbers_and_tolerances_do_not_compile_again():
    other = jaxdyn.ode(lorenz, [1.0, 2.0, 1.0], 2.0, params=NUMBERS | {"rho": 20.0})
    for first, more in ((1e-10, (1e-8, 1e-12)), (1e-5, (2e-6, 1e-3))):
        solve(LORENZ, 2.0, rtol=first)
        programs = _compiled_flow._cache_size()
        for rtol in more:
            solve(other, 1.5, rtol=rtol)
        assert _compiled_flow._cache_size() == programs


@pytest.mark.slow
@pytest.mark.parametrize("order", [8, 14, 20])
def test_series_notice_stiffness_and_nothing_else(order):
    method = Taylor(order)
    stiff = jaxdyn.ode(relaxed, [1.0], params=1e3)
    plain = jaxdyn.ode(relaxed, [1.0], params=1.0)
    for rtol in (1e-3, 1e-6, 1e-10):
        assert bool(solve(stiff, 5.0, rtol=rtol, solver=method).stiff)
        assert not bool(solve(plain, 200.0, rtol=rtol, solver=method).stiff)
        assert not bool(solve(LORENZ, 5.0, rtol=rtol, solver=method).stiff)
