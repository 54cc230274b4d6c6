"""No unit matters: a scene that is rewritten in other units has the same motion, rewritten."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from units import in_units, rewritten

import jaxdyn
from jaxdyn import ensemble, scenes, solvers
from jaxdyn.accuracy.end_error import end_error
from jaxdyn.integrate import events
from jaxdyn.integrate.simulation import solve

#: Tolerances are 1e-10, but steps and their errors are the same in all units: what differs is the
#: rounding in another program, which motions of some turns amplify.
SAME = 1e-9


def shaken(t, y, p):
    return [y[1], -y[0] - y[0] ** 3 + y[2] + jnp.cos(p * t), y[0] * y[1] - 0.3 * y[2]]


def circling(t, y):
    cube = (y[0] ** 2 + y[1] ** 2) ** 1.5
    return [y[2], y[3], -y[0] / cube, -y[1] / cube]


SHAKEN = jaxdyn.ode(shaken, [0.7, 0.0, 0.0], 10.0, params=2.0)
CIRCLING = jaxdyn.ode(circling, [0.5, 0.0, 0.0, 3.0**0.5], 20.0)


@pytest.mark.sample("scene1-solver1")
@pytest.mark.parametrize("solver", [None, solvers.VERNER9, solvers.RADAU9])
@pytest.mark.parametrize("scene", [SHAKEN, CIRCLING])
def test_motions(scene, solver):
    plain = jaxdyn.simulate(scene, solver=solver, samples=7)
    for seed in range(2):
        new, y, _ = rewritten(scene, seed)
        found = jaxdyn.simulate(new, solver=solver, samples=7)
        np.testing.assert_allclose(np.asarray(found.ys) / y, plain.ys, atol=SAME)
        assert abs(int(found.steps) - int(plain.steps)) <= 1
        assert found.warning == plain.warning


@pytest.mark.slow
def test_motions_of_second_order():
    scene = jaxdyn.ode(circling, [0.5, 0.0, 0.0, 3.0**0.5], 20.0, second_order=True)
    plain = solve(scene, 20.0)
    for length, time in ((1e-11, 1e-9), (1.5e11, 3e7)):
        y = np.array([length, length, length / time, length / time])
        new = in_units(scene, y, time).scene
        assert new.second_order
        found = solve(new, 20.0 * time)
        np.testing.assert_allclose(np.asarray(found.y1) / y, plain.y1, atol=SAME)
        assert abs(int(found.steps) - int(plain.steps)) <= 1


def test_ready_made_scenes_by_their_parameters():
    # Three bodies with G = 1 and in metres, kilograms and seconds.
    plain = scenes.three_body()
    period, a, m, G = scenes.EIGHT_PERIOD, 1.496e11, 1.989e30, 6.6743e-11
    time = (a**3 / (G * m)) ** 0.5
    y = np.repeat([a, a / time], len(plain.y0) // 2)
    si = scenes.three_body(G=G, m=m * np.ones(3), y0=plain.y0 * y)
    ours, theirs = solve(plain, period), solve(si, period * time)
    np.testing.assert_allclose(np.asarray(theirs.y1) / y, ours.y1, atol=SAME)
    assert abs(int(theirs.steps) - int(ours.steps)) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("adjoint", [False, True])
def test_gradients(adjoint):
    def end(scene, y0):
        return solve(scene.starting(y0), scene.t1, adjoint=adjoint).y1

    def jacobian(scene):
        return np.asarray(jax.jacrev(lambda y0: end(scene, y0))(scene.y0))

    plain = jacobian(SHAKEN)
    new, y, _ = rewritten(SHAKEN, 0)
    np.testing.assert_allclose(jacobian(new) * y[None] / y[:, None], plain, atol=100 * SAME)


def test_derivatives_by_parameters():
    def by_parameters(scene):
        def end(system):
            return solve(jaxdyn.scene.Scene(system, y0=scene.y0), scene.t1).y1

        direction = jax.tree.map(jnp.ones_like, scene.system)
        return np.asarray(jax.jvp(end, (scene.system,), (direction,))[1])

    def scaled(t, y, p):
        return shaken(t, y, p * 1e-9)

    fine = jaxdyn.ode(scaled, SHAKEN.y0, SHAKEN.t1, params=2e9)
    np.testing.assert_allclose(by_parameters(fine) * 1e9, by_parameters(SHAKEN), atol=10 * SAME)


@pytest.mark.slow
def test_events_and_crossings():
    plain = events.until(CIRCLING, events.Reaches(1, 0.0, 1), 20.0)
    through = jaxdyn.crossings(CIRCLING, events.Reaches(1, 0.0), 20.0)
    for seed in range(2):
        new, y, t = rewritten(CIRCLING, seed)
        found = events.until(new, events.Reaches(1, 0.0, 1), 20.0 * t)
        assert float(found.t) / t == pytest.approx(float(plain.t), rel=SAME)
        np.testing.assert_allclose(np.asarray(found.y) / y, plain.y, atol=SAME)
        crossed = jaxdyn.crossings(new, events.Reaches(1, 0.0), 20.0 * t)
        np.testing.assert_allclose(np.asarray(crossed.ts) / t, through.ts, rtol=SAME)


def test_ensembles():
    starts = np.asarray(CIRCLING.y0) * np.linspace(0.9, 1.1, 3)[:, None]
    plain = ensemble.run(CIRCLING, starts, 5.0)
    new, y, t = rewritten(CIRCLING, 1)
    found = ensemble.run(new, starts * y, 5.0 * t)
    np.testing.assert_allclose(np.asarray(found.y1) / y, plain.y1, atol=SAME)
    assert np.abs(np.asarray(found.steps) - np.asarray(plain.steps)).max() <= 1


def test_an_entry_that_is_rounding_asks_for_no_steps():
    # The last entry is the difference of two that are equal but for rounding.
    def beside(t, y):
        a, b, c, d, _ = y
        off = (0.1 * a + 0.3 * b) ** 2 - (0.1 * c + 0.3 * d) ** 2
        return [b, -a, d, -c, off]

    scene = jaxdyn.ode(beside, [0.0, 1.0, 0.0, 1.0, 0.0], 20.0)
    for solver in (None, solvers.VERNER9):
        found = solve(scene, 20.0, solver=solver)
        assert int(found.status) == 0
        assert int(found.steps) < 100
        assert abs(float(found.y1[4])) < 1e-15


def test_an_entry_that_never_moves_is_no_division_by_zero():
    scene = jaxdyn.ode(lambda t, y: [y[1], -y[0], 0.0 * y[2], 0.0], [1.0, 0.0, 0.0, 0.0], 10.0)
    by_start = jax.jacfwd(lambda y0: solve(scene.starting(y0), 10.0).y1)(scene.y0)
    c, s = np.cos(10.0), np.sin(10.0)
    exact = np.array([[c, s, 0, 0], [-s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(by_start, exact, atol=1e-9)


@pytest.mark.slow
def test_digits():
    plain = jaxdyn.simulate(SHAKEN, digits=9, samples=5)
    new, y, _ = rewritten(SHAKEN, 0)
    found = jaxdyn.simulate(new, digits=9, samples=5)
    assert plain.error is not None
    assert found.error is not None
    assert found.error.digits == pytest.approx(plain.error.digits, abs=0.5)
    np.testing.assert_allclose(np.asarray(found.ys) / y, plain.ys, atol=SAME)
    np.testing.assert_allclose(np.asarray(found.error.scale) / y, plain.error.scale, rtol=1e-6)


@pytest.mark.slow
def test_the_error_of_an_end():
    def again(scene, rtol):
        return jaxdyn.simulate(scene, samples=5, rtol=rtol)

    plain = end_error(again(SHAKEN, 1e-8), again, rtol=1e-8)
    new, y, _ = rewritten(SHAKEN, 0)
    found = end_error(again(new, 1e-8), again, rtol=1e-8)
    assert found.least == pytest.approx(plain.least, abs=0.5)
    assert found.most == pytest.approx(plain.most, abs=1.5)  # changes of digits are random
    np.testing.assert_allclose(found.scale / y, plain.scale, rtol=1e-6)
