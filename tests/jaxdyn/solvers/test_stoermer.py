"""The extrapolated leapfrog: weights, orders, closed forms, derivatives, what it refuses."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap

from benchmarks.figure_eight import END
from jaxdyn import Scene, ensemble, scenes, simulate
from jaxdyn.analysis.energy import energy
from jaxdyn.effects import PairGravity, Spring, SpringNetwork
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate import events
from jaxdyn.integrate.simulation import solve
from jaxdyn.solvers import NYSTROM12, STOERMER14, STOERMER18, Stoermer
from jaxdyn.solvers.stoermer import _weights

BOTH = [STOERMER14, STOERMER18]


@pytest.mark.parametrize("method", BOTH, ids=lambda m: m.name)
def test_weights_leave_no_power_of_the_substeps(method):
    weights = _weights(method.counts)
    assert sum(weights) == 1
    for power in range(1, len(weights)):
        pairs = zip(method.counts, weights, strict=True)
        assert sum(w * Fraction(1, n ** (2 * power)) for n, w in pairs) == 0


@pytest.mark.parametrize("method", [*BOTH, Stoermer((1, 2)), Stoermer((2, 3, 5, 9, 10, 17))])
def test_the_plan_takes_each_column_once_and_without_gaps(method):
    length, since, first = (method.schedule.table[:, i, :, 0] for i in range(3))
    for n in method.counts:
        ours = np.isclose(length, 1 / n, rtol=1e-14)
        assert ours.sum() == n
        lane = np.flatnonzero(ours.any(0))
        assert len(lane) == 1
        rows = np.flatnonzero(ours[:, lane[0]])
        assert (np.diff(rows) == 1).all()
        np.testing.assert_allclose(since[rows, lane[0]], np.arange(1, n + 1) / n, rtol=1e-15)
        np.testing.assert_array_equal(first[rows, lane[0]], np.arange(n) == 0)
    # The two with the most substeps end last, in the first lanes.
    np.testing.assert_allclose(1 / length[-1, :2], sorted(method.counts)[:-3:-1])


def test_the_plan_wastes_no_lanes():
    assert len(STOERMER14.schedule.table) == 9 == max(STOERMER14.counts)
    assert len(STOERMER18.schedule.table) == 14 == max(STOERMER18.counts)


@pytest.mark.parametrize(("counts", "order"), [((1, 2), 4), ((1, 2, 3), 6), ((1, 2, 3, 4), 8)])
def test_the_order_is_twice_the_number_of_columns(counts, order):
    # A swing about a centre that is pulled on by a force known in time.
    @jax.jit
    def step(i, h, y):
        return y + Stoermer(counts).advance(_pulled, i * h, h, y).increment

    ends = []
    for steps in (8, 16, 32):
        y = jnp.array([1.0, 0.3])
        for i in range(steps):
            y = step(float(i), 2.0 / steps, y)
        ends.append(y)
    errors = [gap(y, _pulled_end(2.0)) for y in ends]
    observed = np.log2(errors[1] / errors[2])
    assert abs(observed - order) < 0.5  # steps are not short enough for less


def _pulled(t, y):
    """q'' = -q + cos(2 t), whose solution from (1, 0.3) is known."""
    return jnp.stack([y[1], -y[0] + jnp.cos(2 * t)])


def _pulled_end(t):
    q = 4 / 3 * np.cos(t) + 0.3 * np.sin(t) - np.cos(2 * t) / 3
    v = -4 / 3 * np.sin(t) + 0.3 * np.cos(t) + 2 * np.sin(2 * t) / 3
    return np.array([q, v])


@pytest.mark.parametrize("method", BOTH, ids=lambda m: m.name)
def test_its_estimate_is_no_smaller_than_its_error(method):
    for h in (1.0, 1.5, 2.0):
        y = jnp.array([1.0, 0.3])
        found = method.advance(_pulled, jnp.zeros(()), jnp.asarray(h), y)
        error = gap(y + found.increment, _pulled_end(h))
        assert error < 3 * float(jnp.abs(found.error).max()) + 1e-14


@pytest.mark.sample("Stoermer 18")
@pytest.mark.parametrize("method", BOTH, ids=lambda m: m.name)
def test_a_period_of_the_eight_ends_where_it_ends_with_36_digits(method):
    scene = scenes.three_body()
    end = solve(scene, scene.t1, rtol=1e-12, solver=method)
    assert gap(end.y1, np.array(END)) < 1e-13
    assert int(end.steps) < 70


def test_at_one_tolerance_errors_are_of_the_size_of_those_of_the_pair():
    scene = scenes.three_body()
    rtols = 10.0 ** -np.arange(4, 13)

    def errors(method):
        ends = [solve(scene, scene.t1, rtol=rtol, solver=method).y1 for rtol in rtols]
        gaps = [gap(y, np.array(END)) for y in ends]
        return np.log(np.maximum(gaps, 0.1 * rtols))

    assert np.exp(np.mean(errors(STOERMER14) - errors(NYSTROM12))) < 1.0


@pytest.mark.slow
def test_rounding_of_places_in_close_encounters_neither_shortens_steps_nor_is_amplified():
    # Two bodies that nearly collide: at 1e-4 to 1e-3 of their distance from the origin.
    def run(aside, method, rtol):
        y0 = np.array([1.0, 1.0, 1.5, 1.0 + aside, 0.5, 0.0, -0.5, 0.0])
        scene = Scene(FreePoints([1.0, 1.0]), (PairGravity(1.0),), y0=y0)
        out = solve(scene, 0.4, rtol=rtol, solver=method)
        lost = energy(scene, 0.4, out.y1) - energy(scene, 0.0, scene.y0)
        return int(out.steps), abs(float(lost))

    asides = np.linspace(0.01, 0.05, 45)
    for rtol in (1e-10, 1e-11):
        ours, theirs = (
            np.array([run(aside, method, rtol) for aside in asides])
            for method in (STOERMER14, NYSTROM12)
        )
        assert ours[:, 0].sum() < 1.2 * theirs[:, 0].sum()
        assert np.exp(np.mean(np.log(ours[:, 1] / theirs[:, 1]))) < 4


@pytest.mark.parametrize("method", BOTH, ids=lambda m: m.name)
def test_backwards_it_comes_back(method):
    scene = scenes.three_body()
    there = solve(scene, 3.0, rtol=1e-13, solver=method).y1
    back = solve(scene.starting(there), 0.0, t0=3.0, rtol=1e-13, solver=method).y1
    assert gap(back, scene.y0) < SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("method", BOTH, ids=lambda m: m.name)
def test_samples_are_as_right_as_the_end(method):
    scene = scenes.oscillator()
    motion = simulate(scene, 10.0, samples=23, rtol=1e-13, solver=method)
    expected = simulate(scene, 10.0, samples=23, rtol=1e-13, solver=NYSTROM12)
    assert gap(motion.ys, expected.ys) < SOLVED


@pytest.mark.slow
def test_many_coordinates_are_not_taken_apart_and_go_the_same_way():
    # 20 points in a row, 40 coordinates, pulled together by springs and pushed in time.
    n = 20
    r = np.stack([np.arange(n) * 1.0, 0.1 * np.sin(np.arange(n))], axis=1)
    springs = SpringNetwork([(i, i + 1) for i in range(n - 1)], k=3.0, length=0.9)
    scene = Scene(FreePoints(np.ones(n)), (springs,), y0=np.concatenate([r, 0 * r]).ravel())
    ends = [solve(scene, 3.0, rtol=1e-13, solver=m).y1 for m in (NYSTROM12, *BOTH)]
    assert gap(ends[1], ends[0]) < SOLVED
    assert gap(ends[2], ends[0]) < SOLVED


@pytest.mark.slow
def test_derivatives_are_those_of_the_pair():
    scene = scenes.three_body()

    def end(y0, solver):
        return solve(scene.starting(y0), 2.0, rtol=1e-13, solver=solver).y1

    expected = jax.jacfwd(end)(scene.y0, NYSTROM12)
    assert gap(jax.jacfwd(end)(scene.y0, STOERMER18), expected) < 1e-11
    assert gap(jax.jacrev(end)(scene.y0, STOERMER14), expected) < 1e-11


@pytest.mark.slow
def test_many_at_once_by_vmap():
    scene = scenes.three_body()
    y0s = scene.y0[None] * jnp.array([1.0, 1.001])[:, None]
    ends = jax.vmap(lambda y0: solve(scene.starting(y0), 2.0, rtol=1e-13, solver=STOERMER14).y1)(
        y0s
    )
    for y0, end in zip(y0s, ends, strict=True):
        alone = solve(scene.starting(y0), 2.0, rtol=1e-13, solver=STOERMER14)
        assert gap(end, alone.y1) < SOLVED


@pytest.mark.parametrize("method", [*BOTH, Stoermer((1, 2, 3))], ids=lambda m: m.name)
def test_it_is_stable_up_to_the_limit_that_it_names(method):
    @jax.jit
    def matrix(h):
        return jax.vmap(lambda y: y + method.advance(_free, 0.0 * h, h, y).increment)(np.eye(2))

    def growth(h):
        return np.abs(np.linalg.eigvals(matrix(jnp.asarray(h)))).max()

    assert all(growth(part * method.stable) < 1.002 for part in (0.3, 0.6, 0.9, 0.99))
    assert growth(1.01 * method.stable) > 1.001
    for h in (0.7, method.stable, 2 * method.stable):
        np.testing.assert_allclose(growth(h), method._growth(h), rtol=1e-9)


def _free(t, y):
    """q'' = -q."""
    del t
    return jnp.stack([y[1], -y[0]])


@pytest.mark.slow
def test_a_stiff_motion_is_noticed():
    # A slow fall of two points that a rod-like spring holds together.
    scene = scenes.two_masses()
    assert not bool(solve(scene, 5.0, rtol=1e-6, solver=STOERMER18).stiff)
    stiff = Scene(
        FreePoints(np.ones(2)),
        (Spring(1e8, 1.0, i=0, j=1),),
        y0=[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.3],
    )
    assert bool(solve(stiff, 3.0, rtol=1e-4, solver=STOERMER18).stiff)


def test_forces_that_depend_on_velocity_are_refused():
    with pytest.raises(ValueError, match=r"solver: expected .* velocity, got Stoermer 18"):
        simulate(scenes.cannonball(drag=0.1), solver=STOERMER18)


@pytest.mark.slow
def test_in_an_ensemble_it_goes_the_same_way():
    scene = scenes.three_body()
    y0s = np.asarray(scene.y0) * np.array([[1.0], [1.001]])
    out = ensemble.run(scene, y0s, 2.0, rtol=1e-13, solver=STOERMER14)
    expected = ensemble.run(scene, y0s, 2.0, rtol=1e-13)
    assert gap(out.y1, expected.y1) < SOLVED


@pytest.mark.slow
def test_events_are_found_with_it():
    # cos t comes down to 0 at pi / 2.
    scene = scenes.oscillator().starting(jnp.array([1.0, 0.0]))
    stop = events.until(scene, events.Reaches(0, 0.0, -1), 9.0, rtol=1e-13, solver=STOERMER18)
    assert abs(float(stop.t) - np.pi / 2) < 1e-13


@pytest.mark.parametrize("amplitude", [1.0, 0.03])
@pytest.mark.parametrize("method", BOTH, ids=lambda m: m.name)
def test_long_steps_at_loose_tolerances_are_not_stiff(method, amplitude):
    scene = scenes.oscillator()
    scene = scene.starting(amplitude * scene.y0)
    for rtol in (1e-3, 1e-5):
        assert not bool(solve(scene, 3000.0, rtol=rtol, solver=method).stiff)


@pytest.mark.parametrize("counts", [(1,), (2, 1), (1, 1), (0, 1), ()])
def test_counts_that_do_not_rise_are_refused(counts):
    with pytest.raises(ValueError, match="counts: expected at least two increasing numbers"):
        Stoermer(counts)


def test_a_rate_that_is_no_number_gives_no_number():
    found = STOERMER14.advance(
        lambda t, y: jnp.stack([y[1], jnp.sqrt(y[0])]),
        jnp.zeros(()),
        jnp.asarray(0.1),
        -jnp.ones(2),
    )
    assert not np.isfinite(found.increment).any()
