"""Collocation: stiff cycles, every kind of closing, errors of its steps, what it refuses."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import odes
import pytest
from helpers import forge

import jaxdyn
import orbits
from jaxdyn import scenes
from orbits import Outcome
from orbits.shooting import gauss_steps
from orbits.shooting.collocation import MeshEquations, condense, expand, quality
from orbits.shooting.finding import AUTOMATIC
from orbits.shooting.strategy import GOAL

#: Period of van der Pol's cycle for mu = 1000: the time between two passages of x = 1.5 by
#: `solvers.RADAU9` at rtol 1e-13, and by SciPy's Radau at 1e-12 to the digits 1614.40112581.
STIFF = 1614.4011258070
#: The same for mu = 100, by SciPy's Radau at 1e-12 and 1e-13.
STIFF_100 = 162.8370710924


def van_der_pol(mu=1.0, period=6.5):
    return jaxdyn.ode(odes.van_der_pol, [2.0, 0.0], period, params=mu)


@pytest.mark.parametrize("n", [1, 2, 3, 8, 13])
def test_elimination_solves_the_equations_of_all_intervals(n):
    random = np.random.default_rng(n)
    k, g = 3, 2
    sizes = [(n, k, k), (n, k, k), (n, k, g), (n, k)]
    chain = MeshEquations(*(random.standard_normal(size) for size in sizes))
    top, rounds = condense(chain)
    first, shared = random.standard_normal(k), random.standard_normal(g)
    last = -np.linalg.solve(
        top.right[0], top.left[0] @ first + top.shared[0] @ shared + top.rest[0]
    )
    dy = expand(rounds, first, last, shared)
    left = np.einsum("nij,nj->ni", chain.left, dy[:-1])
    right = np.einsum("nij,nj->ni", chain.right, dy[1:])
    missed = left + right + chain.shared @ shared + chain.rest
    assert dy.shape == (n + 1, k)
    assert np.abs(missed).max() < 1e-12 * np.abs(dy).max()


def test_a_step_has_order_sixteen_and_its_derivatives_are_exact():
    scene = jaxdyn.ode(lambda t, y: [y[1], -y[0]], [1.0, 0.0], 1.0)
    spans = jnp.array([3.0, 6.0])
    starts = jnp.array([[1.0, 0.0]] * 2)
    pieces = gauss_steps.Piece(start=starts, t0=jnp.zeros(2), span=spans, parameter=jnp.zeros(2))
    found, slopes = gauss_steps.linearize_steps(scene, pieces, make=None)
    errors = np.abs(found.end - jnp.stack([jnp.cos(spans), -jnp.sin(spans)], axis=1)).max(axis=1)
    assert 16.0 < np.log2(errors[1] / errors[0]) < 18.0  # 17 of a step
    estimates = gauss_steps.local_errors(scene, pieces, make=None).max(axis=1)
    assert np.abs(estimates / errors - 1).max() < 0.1
    # A linear equation: the derivative by the start takes the start to the end.
    assert np.abs(jnp.einsum("nij,nj->ni", slopes.start, starts) - found.end).max() < 1e-14
    speeds = jnp.stack([-jnp.sin(spans), -jnp.cos(spans)], axis=1)
    assert np.abs(slopes.span - speeds)[0].max() < 1e-7


@pytest.mark.slow
def test_collocation_and_shooting_find_the_same_cycle():
    cycle = orbits.find(van_der_pol(), strategy=orbits.Collocation())
    assert abs(cycle.period - odes.VAN_DER_POL) < 1e-13 * odes.VAN_DER_POL
    shot = orbits.find(van_der_pol())
    ours, theirs = orbits.stability(cycle), orbits.stability(shot)
    assert abs(ours.nontrivial - theirs.nontrivial).max() < 1e-11
    assert ours.verdict == "stable"
    assert orbits.recheck(cycle).closure < 1e-13
    assert orbits.same_orbit(cycle, shot)


@pytest.mark.slow
def test_a_relaxation_oscillation_is_found_where_steps_run_out(tmp_path):
    cycle = orbits.find(van_der_pol(1000.0, 1614.0))
    assert cycle.mesh is not None
    assert cycle.stiff
    assert abs(cycle.period / STIFF - 1) < 2e-12
    linear = orbits.stability(cycle)
    assert linear.verdict == "stable"
    assert linear.unit == 1
    assert abs(linear.nontrivial[0]) < 1e-12
    check = orbits.recheck(cycle)
    assert check.solver == "Radau 9"
    assert check.closure < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("guess", [162.8, 150.0])
def test_a_slow_start_is_no_equilibrium(guess):
    # The guess starts off its slow curve, where the rate is 300 times that of the orbit's start.
    cycle = orbits.find(van_der_pol(100.0, guess))
    assert abs(cycle.period / STIFF_100 - 1) < 1e-12


def decaying(t, y):
    """y chases x at rate 100, x'' = -x - 0.3 x': nothing repeats."""
    return [-100 * (y[0] - y[1]), y[2], -y[1] - 0.3 * y[2]]


@pytest.mark.slow
@pytest.mark.parametrize("strategy", [AUTOMATIC, orbits.Collocation()])
def test_a_stiff_motion_that_ends_at_rest_is_trivial(strategy):
    scene = jaxdyn.ode(decaying, [1.0, 1.0, 0.0], 6.0)
    ended = orbits.find(scene, strategy=strategy, throw=False)
    assert ended.outcome == Outcome.TRIVIAL
    held = {"lower": [-9, -9, 162.8], "upper": [9, 9, 162.8]}
    rest = orbits.find(van_der_pol(100.0), [0.0, 0.0], **held, strategy=strategy, throw=False)
    assert rest.outcome == Outcome.TRIVIAL


@pytest.mark.slow
def test_an_orbit_on_a_mesh_survives_its_file(tmp_path):
    swing = orbits.find(
        scenes.pendulum(angle=2.0), period=2.7, hold="theta", strategy=orbits.Collocation()
    )
    exact = orbits.find(scenes.pendulum(angle=2.0), period=2.7, hold="theta")
    assert abs(swing.period - exact.period) < 1e-14
    path = tmp_path / "swing.json"
    orbits.save(path, swing)
    loaded, _ = orbits.load(path)
    assert loaded.mesh == swing.mesh
    assert orbits.verify(path)[1] == []
    record = json.loads(path.read_text())
    wrongs = (
        ([0.5], "intervals"),
        ([0.5, 0.6], "intervals"),
        ("even", "file.mesh: expected tuple"),
    )
    for wrong, message in wrongs:
        forge(path, record | {"mesh": wrong})
        with pytest.raises(ValueError, match=message):
            orbits.load(path)


@pytest.mark.slow
def test_the_figure_eight_by_collocation():
    closing = orbits.choreography(3)
    eight = orbits.find(scenes.three_body(), closing=closing)
    found = orbits.find(eight.scene, closing=closing, strategy=orbits.Collocation())
    assert found.residual < 1e-13
    ours, theirs = orbits.stability(found), orbits.stability(eight)
    assert ours.verdict == "stable"
    assert ours.exponents == pytest.approx(theirs.exponents, abs=1e-8)


@pytest.mark.slow
def test_a_driven_orbit_closes_with_its_drive_by_collocation():
    def driven(t, y):
        return [y[1], -0.2 * y[1] + y[0] - y[0] ** 3 + 0.3 * jnp.cos(1.2 * t)]

    scene = jaxdyn.ode(driven, [0.9, 0.1], 2 * np.pi / 1.2)
    shot = orbits.find(scene)
    ours = orbits.find(scene, shot.y0 + 1e-3, strategy=orbits.Collocation())
    assert abs(ours.period - shot.period) < 1e-14
    assert np.abs(ours.y0 - shot.y0).max() < 1e-12


@pytest.mark.slow
def test_a_family_of_relaxation_oscillations():
    start = orbits.find(van_der_pol(5.0, 11.6), strategy=orbits.Collocation())
    family = orbits.continue_family(start, van_der_pol, 5.0, step=0.2, members=3)
    for member in family.members:
        shot = orbits.find(van_der_pol(member.parameter, member.orbit.period), [2.0, 0.0])
        assert abs(member.orbit.period / shot.period - 1) < 1e-10


@pytest.mark.slow
def test_the_mesh_follows_a_family():
    start = orbits.find(van_der_pol(1.0, 6.66), strategy=orbits.Collocation())
    family = orbits.continue_family(start, van_der_pol, 1.0, step=5.0, within=(0.0, 18.0))
    assert family.end.startswith("the bounds")
    last = family.members[-1]
    assert max(member.orbit.residual for member in family.members) <= GOAL
    assert orbits.recheck(last.orbit).closure < 1e-12
    # On the mesh of the first member its steps have errors that no closing error shows, or fail.
    point, old = last.point, family.members[0].point.equations
    x = point.equations.move_to(point.x, old, last.orbit.rtol)
    assert not quality(old, x).errors.max() <= GOAL


@pytest.mark.slow
def test_a_family_ends_where_no_mesh_is_fine_enough(monkeypatch):
    start = orbits.find(van_der_pol(1.0, 6.66), strategy=orbits.Collocation())
    monkeypatch.setattr("orbits.shooting.collocation._MOST", len(start.mesh) // 2)
    family = orbits.continue_family(start, van_der_pol, 1.0, step=5.0, within=(0.0, 50.0))
    assert "errors of the steps of collocation exceed the goal" in family.end
    assert max(member.orbit.residual for member in family.members) <= GOAL


@pytest.mark.slow
def test_a_stiff_cycle_is_differentiated_once_found_by_shooting():
    def period(mu):
        return orbits.differentiable(van_der_pol(mu, 34.7), again).period

    cycle = orbits.find(van_der_pol(20.0, 34.7), strategy=orbits.Collocation())
    with pytest.raises(ValueError, match=r"period=orbit\.period, strategy=orbits\.Shooting\(\)"):
        orbits.differentiable(cycle.scene, cycle)
    again = orbits.find(cycle.scene, period=cycle.period, strategy=orbits.Shooting())
    beside = [
        orbits.find(van_der_pol(mu, 34.7), cycle.y0, strategy=orbits.Collocation()).period
        for mu in (20.02, 19.98)
    ]
    np.testing.assert_allclose(jax.grad(period)(20.0), (beside[0] - beside[1]) / 0.04, rtol=1e-6)


def test_misuse_of_collocation_is_refused():
    with pytest.raises(
        ValueError, match="strategy: expected one for a scene with projected constraints"
    ):
        orbits.find(scenes.four_bar(), strategy=orbits.Collocation())
    with pytest.raises(ValueError, match="segments: expected none with collocation, got 4"):
        orbits.find(van_der_pol(), strategy=orbits.Collocation(), segments=4)
    cycle = orbits.find(van_der_pol(), strategy=orbits.Collocation())
    with pytest.raises(ValueError, match="segments: expected none"):
        orbits.continue_family(cycle, van_der_pol, 1.0, segments=4)


@pytest.mark.slow
def test_a_mesh_with_too_few_intervals_is_no_orbit(monkeypatch):
    monkeypatch.setattr("orbits.shooting.collocation._MOST", 16)
    monkeypatch.setattr("orbits.shooting.collocation._FIRST", 16)
    cycle = orbits.find(van_der_pol(20.0, 40.0), strategy=orbits.Collocation(), throw=False)
    assert cycle.outcome in (Outcome.MESH_LIMIT, Outcome.NO_DESCENT)
    assert not cycle.ok
