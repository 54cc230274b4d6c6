"""The flow map and its derivatives, by two modes, by differences and by their own laws."""

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import DIFFED, EXACT, SOLVED, TESTS, central_difference, gap, kepler

from jaxdyn import Scene, scenes
from jaxdyn.effects import QuadraticDrag, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.simulation import solve
from jaxdyn.solvers import NYSTROM12, VERNER9, method

#: y0 (4), mass, g, drag, t0, t1, ts (2): every number that a flow depends on.
NUMBERS = jnp.array([0.0, 0.0, 4.0, 5.0, 2.0, 9.81, 0.3, 0.1, 1.1, 0.4, 0.9])


def _ball(x):
    effects = (UniformGravity(x[5]), QuadraticDrag(x[6]))
    scene = Scene(FreePoints(x[4]), effects, y0=x[:4])
    out = solve(scene, x[8], t0=x[7], ts=x[9:], rtol=1e-13)
    return jnp.concatenate([out.y1, out.ys.ravel()])


def _three_bodies(x):
    """End of a motion of three bodies as a function of G and the masses."""
    return solve(scenes.three_body(G=x[0], m=x[1:]), 0.7, rtol=1e-13).y1


@pytest.fixture(scope="module")
def ball_jacobian():
    return jax.jit(jax.jacfwd(_ball))(NUMBERS)


@pytest.fixture(scope="module")
def monodromy():
    scene = scenes.three_body()
    end = lambda y: solve(scene.starting(y), scene.t1, rtol=1e-13).y1  # noqa: E731
    return jax.jit(jax.jacfwd(end))(scene.y0)


@pytest.mark.slow
def test_derivatives_in_every_number(ball_jacobian):
    reverse = jax.jit(jax.jacrev(_ball))(NUMBERS)
    assert gap(ball_jacobian, reverse) < EXACT
    assert gap(ball_jacobian, central_difference(jax.jit(_ball), NUMBERS)) < DIFFED


@pytest.mark.slow
def test_derivatives_of_the_nystrom_pair_in_its_parameters():
    x = jnp.array([1.0, 1.0, 1.2, 0.8])
    forward = jax.jit(jax.jacfwd(_three_bodies))(x)
    assert gap(forward, jax.jit(jax.jacrev(_three_bodies))(x)) < EXACT
    assert gap(forward, central_difference(jax.jit(_three_bodies), x)) < DIFFED


@pytest.mark.slow
def test_a_parameter_that_cancels_has_a_derivative_of_zero():
    def end(m):
        return solve(scenes.pendulum(m=m, g=9.79328584, angle=1.19517567, rate=0.0353), 1.0).y1

    for m in (1.0, 1 + 2.0**-52, 1.0000000001, 0.7):  # a mass of 1 is exact, others are rounded
        np.testing.assert_allclose(jax.jacfwd(end)(m), 0.0, atol=1e-12)


@pytest.mark.slow
def test_second_derivatives():
    total = lambda x: jnp.sum(jnp.sin(_ball(x)))  # noqa: E731
    hessian = jax.jit(jax.hessian(total))(NUMBERS)
    differences = central_difference(jax.jit(jax.grad(total)), NUMBERS)
    # Entries up to 200, and fifth derivatives of sin(y(x)) to go with them.
    assert gap(hessian / 200, differences / 200) < DIFFED
    assert gap(hessian, hessian.T) < 200 * SOLVED


def test_derivatives_in_the_times_are_rates(ball_jacobian):
    scene = scenes.cannonball(g=9.81, drag=0.3, m=2.0).starting(NUMBERS[:4])
    y1, sample = _ball(NUMBERS)[:4], _ball(NUMBERS)[8:12]
    # d y1 / d t1 is the rate at the end; likewise for samples.
    assert gap(ball_jacobian[:4, 8], scene.rate(0.0, y1)) < EXACT * 100
    assert gap(ball_jacobian[8:12, 10], scene.rate(0.0, sample)) < EXACT * 100
    # Nothing here depends on absolute time: shifting all times changes nothing.
    assert gap(ball_jacobian[:, 7:].sum(axis=1), np.zeros(12)) < SOLVED


def test_derivatives_at_a_span_of_zero():
    def end(x):
        return solve(scenes.cannonball(drag=0.3).starting(x[:4]), x[5], t0=x[4], rtol=1e-13).y1

    x = jnp.array([0.0, 0.0, 4.0, 5.0, 1.0, 1.0])
    rate = scenes.cannonball(drag=0.3).rate(1.0, x[:4])
    wanted = jnp.concatenate([jnp.eye(4), -rate[:, None], rate[:, None]], axis=1)
    assert gap(jax.jacfwd(end)(x), wanted) < EXACT


@pytest.mark.slow
def test_the_monodromy_matrix_is_symplectic(monodromy):
    zero, one = np.zeros((6, 6)), np.eye(6)
    J = np.block([[zero, one], [-one, zero]])  # unit masses: velocities are momenta
    assert gap(monodromy.T @ J @ monodromy, J) < SOLVED
    assert abs(np.linalg.det(monodromy) - 1) < SOLVED


def test_tangents_are_as_accurate_as_the_state(monodromy):
    scene = scenes.three_body()
    end = lambda y: solve(scene.starting(y), scene.t1, rtol=1e-15, solver=VERNER9).y1  # noqa: E731
    assert gap(monodromy, jax.jit(jax.jacfwd(end))(scene.y0)) < SOLVED


def test_kepler_tangents_obey_the_third_law():
    # Scaling space by s, time by s^(3/2) and velocity by s^(-1/2) takes solutions to solutions.
    scene = kepler(0.3)
    end = lambda y, t: solve(scene.starting(y), t, rtol=1e-14).y1  # noqa: E731
    t1 = 2.0
    weights = jnp.concatenate([jnp.ones(4), -0.5 * jnp.ones(4)])
    y1, along = jax.jvp(end, (scene.y0, t1), (weights * scene.y0, 1.5 * t1))
    assert gap(along, weights * y1) < SOLVED


@pytest.mark.slow
def test_vmap_is_a_loop_and_jit_is_eager():
    x = jnp.array([[1.0, 1.0, 1.0, 1.0], [1.1, 1.0, 1.2, 0.8], [0.9, 1.3, 1.0, 1.0]])
    one_by_one = jnp.stack([_three_bodies(row) for row in x])
    # Other code for other shapes contracts products into sums elsewhere: equal to rounding.
    assert gap(jax.vmap(_three_bodies)(x), one_by_one) < 10 * EXACT
    assert gap(jax.jit(_three_bodies)(x[0]), one_by_one[0]) < 10 * EXACT


def test_a_failed_run_has_no_derivative():
    scene = scenes.three_body()
    end = lambda y: solve(scene.starting(y), 5.0, max_steps=3).y1  # noqa: E731
    assert jnp.isnan(jax.jacfwd(end)(scene.y0)).all()


def test_tolerances_have_no_derivative():
    end = lambda rtol: solve(scenes.cannonball(drag=0.3), 0.5, rtol=rtol).y1  # noqa: E731
    np.testing.assert_array_equal(jax.jacfwd(end)(1e-9), np.zeros(4))


@pytest.mark.slow
@pytest.mark.parametrize("pair", [NYSTROM12, VERNER9], ids=lambda p: p.name)
def test_compensated_summation_lowers_the_error_of_long_runs(pair, monkeypatch):
    # Ten periods: the compensated error, 2e-14, is a fourth or less of the plain one. After
    # hundreds of periods both are led by the rounding of the coefficients, which is the same.
    def errors(pair):
        def one(angle):
            scene = kepler(0.2, angle)
            return solve(scene, 20 * jnp.pi, rtol=1e-15, solver=pair).y1 - scene.y0

        return jax.jit(jax.vmap(one))(jnp.linspace(0.1, 6.0, 16))

    def root_mean_square(x):
        return float(jnp.sqrt(jnp.mean(x * x)))

    compensated = root_mean_square(errors(pair))
    monkeypatch.setattr(method, "two_sum", lambda total, carry, step: (total + step, carry))
    plain = root_mean_square(errors(dataclasses.replace(pair)))  # a new pair compiles anew
    assert compensated < 0.5 * plain


_LONG = TESTS / "references" / "long_spans_reference.json"
#: At rtol 1e-10, of the largest entry, at the times of the reference: three times what was found.
_OFF = {"lorenz": (2e-11, 5e-11, 6e-11, 5e-7), "eight": (1e-11, 2e-10, 8e-10)}


def _end_by(name, start):
    """(parameter, t, rtol) -> end, of the Lorenz system by rho or three bodies by G."""
    make = {"lorenz": lambda p: scenes.lorenz(rho=p), "eight": lambda p: scenes.three_body(G=p)}
    return lambda p, t, rtol: solve(make[name](p).starting(start), t, rtol=rtol).y1


@pytest.mark.slow
@pytest.mark.parametrize("name", _OFF)
def test_derivatives_of_long_motions_are_right_and_differences_are_not(name):
    kept = json.loads(_LONG.read_text())[name]
    end = _end_by(name, jnp.array(kept["start"]))
    p = kept["pars"][0]
    by_parameter = jax.jit(lambda t, rtol: jax.jvp(lambda p: end(p, t, rtol), (p,), (1.0,))[1])
    for t, row, most in zip(kept["ts"], kept["states"], _OFF[name], strict=True):
        exact = np.array(row[len(row) // 2 :])
        size = np.abs(exact).max()
        assert gap(by_parameter(t, 1e-10), exact) < most * size
        fine = gap(by_parameter(t, 1e-13), exact) / size
        assert fine < 1e-2 * most
        # With any step either the third derivative or the error of the ends spoils a difference.
        coarse = [(end(p + h, t, 1e-13) - end(p - h, t, 1e-13)) / (2 * h) for h in (1e-4, 1e-6)]
        assert min(gap(c, exact) for c in coarse) / size > 20 * fine
