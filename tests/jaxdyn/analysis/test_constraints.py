"""Constraints that repeat, nearly repeat, contradict each other, or lose rank in one pose."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap

from jaxdyn import Scene, Status, scenes, simulate
from jaxdyn._numerics import solve_psd
from jaxdyn.analysis import constraints
from jaxdyn.analysis.work_by_effect import with_work
from jaxdyn.effects import LinearDrag, UniformGravity
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.formulations.mechanism import Mechanism, planar_body
from jaxdyn.integrate.simulation import solve
from jaxdyn.mechanisms.bars import Chain
from jaxdyn.mechanisms.rods import Rods
from jaxdyn.mechanisms.skates import Skated

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
SIDES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2))
ALL = (*SIDES, (1, 3))  # four points in the plane need five rods; the sixth repeats


def frame(pairs):
    """Points of unequal masses at the corners of a square, turning and thrown."""
    length = np.linalg.norm(SQUARE[[i for i, _ in pairs]] - SQUARE[[j for _, j in pairs]], axis=1)
    v = np.stack([0.5 - SQUARE[:, 1], SQUARE[:, 0] - 0.3], axis=1) * 2.0
    y0 = np.concatenate([SQUARE.ravel(), v.ravel()])
    system = Constrained(Rods(jnp.array([1.0, 2.0, 0.5, 3.0]), jnp.asarray(length), pairs))
    return Scene(system, (UniformGravity(3.0),), y0=y0, t1=2.0)


class HungBar(Mechanism):
    """A bar on three equal parallel cranks: one crank more than it needs."""

    def coordinates(self):
        return (("x", "m"), ("y", "m"), ("theta", "rad"))

    def masses(self):
        return jnp.ones(2)

    def positions(self, t, q):
        return planar_body(q[:2], q[2], jnp.asarray(0.7))

    def constraints(self, t, q):
        at = jnp.array([-1.0, 0.0, 1.0])
        x, y = q[0] + at * jnp.cos(q[2]) - at, q[1] + at * jnp.sin(q[2])
        return jnp.sqrt(x * x + y * y) - 1.0


class Torn(Mechanism):
    """A point that is to keep two places at once."""

    def coordinates(self):
        return (("x", "m"),)

    def masses(self):
        return jnp.ones(1)

    def positions(self, t, q):
        return q[None]

    def constraints(self, t, q):
        return jnp.stack([q[0], q[0] - 0.1 * t])


def parallelogram(angle, rate=0.0):
    """Bars of lengths 1, 2, 1 on hinges 2 apart: flat at pi/2, where it may fold or stay one."""
    chain = Chain(jnp.ones(3), jnp.array([1.0, 2.0, 1.0]), jnp.array([2.0, 0.0]))
    # The last bar is counted from its upper end: the crank turned round.
    q, v = [angle, np.pi / 2, angle - np.pi], [rate, 0.0, rate]
    return Scene(Constrained(chain), (UniformGravity(1.0),), y0=[*q, *v], t1=1.0)


@pytest.mark.slow
def test_a_repeated_rod_changes_nothing():
    plain, doubled = frame(SIDES), frame(ALL)
    doubled.check()
    report = constraints.conditioning(doubled, 0.0, doubled.y0)
    assert (int(report.rank), int(report.redundant), bool(report.determined)) == (5, 1, True)
    assert gap(plain.rate(0.0, plain.y0), doubled.rate(0.0, plain.y0)) < SOLVED * 10


@pytest.mark.slow
def test_a_motion_with_a_repeated_rod_is_the_same():
    a, b = (simulate(frame(pairs), samples=9, rtol=1e-13) for pairs in (SIDES, ALL))
    assert gap(a.ys, b.ys) < 10 * SOLVED


@pytest.mark.slow
def test_the_same_rod_twice_has_the_same_derivatives():
    once, twice = (frame(pairs) for pairs in (SIDES, (*SIDES, (0, 1))))
    jacobians = [jax.jit(jax.jacfwd(lambda y, s=s: s.rate(0.0, y)))(s.y0) for s in (once, twice)]
    assert gap(*jacobians) < SOLVED * 100


@pytest.mark.slow
def test_the_repeated_condition_may_repeat_only_on_the_constraints():
    g, angle = 2.0, 0.6
    y0 = [np.sin(angle), -np.cos(angle), 0.0, 0.0, 0.0, 0.0]
    hung = Scene(Constrained(HungBar()), (UniformGravity(g),), y0=y0, t1=2.0)
    hung.check()
    report = constraints.conditioning(hung, 0.0, hung.y0)
    assert (int(report.rank), int(report.redundant), bool(report.determined)) == (2, 1, True)
    # The bar does not turn, so it swings like a point on one crank.
    swing = scenes.pendulum(length=1.0, g=g, angle=angle, rate=0.0)
    exact = simulate(swing, 2.0, samples=5, rtol=1e-13).ys[:, 0]
    motion = simulate(hung, samples=5, rtol=1e-12)
    assert gap(motion["x"], np.sin(exact)) < 1e-10
    assert gap(motion["theta"], np.zeros(5)) < 1e-10


@pytest.mark.slow
def test_skates_on_a_common_normal_are_one():
    at, headings = jnp.array([[0.2, 0.0], [0.2, 1.5]]), jnp.zeros(2)
    both, one = Skated(1.0, 0.5, at, headings), Skated(1.0, 0.5, at[:1], headings[:1])
    y = jnp.array([0.0, 0.0, 0.0, 1.0, -0.2 * 0.8, 0.8])
    a, b = (Scene(Constrained(body), (LinearDrag(0.1),), y0=y) for body in (one, both))
    assert gap(solve(a, 3.0, rtol=1e-13).y1, solve(b, 3.0, rtol=1e-13).y1) < 10 * SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 0.7])
def test_a_dead_centre_at_the_start_is_reported(rate):
    flat = parallelogram(np.pi / 2, rate)
    assert not constraints.conditioning(flat, 0.0, flat.y0).determined
    message = (
        r"^y0: expected a pose whose constraints determine the motion, got one where they lose "
        r"rank\. It could continue in several ways .*; start beside it\.$"
    )
    with pytest.raises(ValueError, match=message):
        simulate(flat)
    end = solve(flat, 1.0)
    assert int(end.status) == Status.SINGULAR
    assert np.isnan(end.y1).all()


@pytest.mark.slow
def test_a_motion_that_ends_in_a_dead_centre_is_reported():
    # Moved there by hand, backwards from it: the run from beside it ends in the flat pose.
    beside = parallelogram(np.pi / 2 - 0.1, 1.0)
    assert int(solve(beside, 0.05).status) == Status.OK
    flat = parallelogram(np.pi / 2)
    assert int(solve(beside.starting(flat.y0), 1e-9).status) == Status.SINGULAR


@pytest.mark.slow
def test_condition_grows_towards_the_dead_centre():
    beside = parallelogram(np.pi / 2)
    near = np.array([1e-1, 1e-2, 1e-3, 1e-5])
    ys = beside.y0[None] - near[:, None] * np.array([1.0, 0, 1.0, 0, 0, 0])
    found = jax.vmap(lambda y: constraints.conditioning(beside, 0.0, y))(ys)
    assert found.determined.all()
    scaled = np.asarray(found.condition) * near
    assert (np.abs(scaled / scaled[-1] - 1) < 0.1).all()


def test_contradictions_are_reported():
    torn = Scene(Constrained(Torn()), (), y0=[0.0, 0.0], t1=1.0)
    with pytest.raises(ValueError, match=r"^y0: expected a start that satisfies the constraints"):
        simulate(torn)
    end = solve(torn, 1.0)
    assert int(end.status) == Status.SINGULAR
    assert np.isnan(end.y1).all()
    assert "contradict each other" in Status.SINGULAR.message


@pytest.mark.slow
def test_conditioning_sees_through_a_ledger_and_refuses_what_has_no_constraints():
    bars = scenes.four_bar()
    plain = constraints.conditioning(bars, 0.0, bars.y0)
    worked = with_work(bars, UniformGravity)
    assert constraints.conditioning(worked, 0.0, worked.y0) == plain
    ball = scenes.cannonball()
    message = r"^scene: expected one with constraints, got FreePoints\. Try formulation="
    with pytest.raises(ValueError, match=message):
        constraints.conditioning(ball, 0.0, ball.y0)


def test_solve_psd_finds_a_solution_and_what_depends_on_what():
    g = np.random.default_rng(3).normal(size=(5, 4))
    g[2] = 2.0 * g[0] - 3.0 * g[1]
    a = jnp.asarray(g @ g.T)  # rank 4: row 2 depends on two others
    b = a @ jnp.arange(1.0, 6.0)
    found = solve_psd(a, b, 1e-12 * jnp.diagonal(a))
    assert found.kept.tolist() == [True, True, False, True, True]
    assert gap(a @ found.x, b) < 1e-11
    assert float(found.x[2]) == 0.0
    assert gap(found.combination[:, 2], [2.0, -3.0, 0.0, 0.0, 0.0]) < 1e-11
    bad = solve_psd(a.at[0, 0].set(jnp.nan), b, jnp.zeros(5))
    assert np.isnan(bad.x).any()


def test_the_tension_of_a_pendulum_is_that_of_its_angle():
    numbers = {"m": 2.0, "length": 1.3, "angle": 1.0, "rate": 0.5}
    free = simulate(scenes.pendulum(**numbers), 3.0, samples=7, rtol=1e-13)
    tension = 2.0 * (9.81 * jnp.cos(free["theta"]) + 1.3 * free["theta_dot"] ** 2)
    # The same force by free coordinates, as what the mass times acceleration has beside gravity.
    assert gap(jnp.linalg.norm(constraints.reactions(free)[:, 0], axis=-1), tension) < SOLVED * 10
    for tie in ("length", "square"):
        tied = scenes.pendulum(**numbers, formulation="constrained", tie=tie)
        motion = simulate(tied, 3.0, samples=7, rtol=1e-13)
        assert gap(constraints.tensions(motion)["stick"], tension) < SOLVED * 100
        assert gap(constraints.multipliers(motion)[:, 0], -tension) < SOLVED * 100


def test_forces_of_motions_without_rods_are_refused():
    bars = simulate(scenes.four_bar(), 0.1, samples=2)
    with pytest.raises(
        ValueError, match=r"^motion: expected constraints that are .* got FreeBars\. `react"
    ):
        constraints.tensions(bars)
    with pytest.raises(ValueError, match=r"^scene: expected one with constraints, got NewtonEuler"):
        constraints.multipliers(simulate(scenes.pendulum(), 0.1, samples=2))


@pytest.mark.slow
def test_the_ties_of_textbooks_drift_differently():
    how = {"formulation": "constrained", "drift": "raw"}
    off = {}
    for tie in ("length", "square"):
        motion = simulate(scenes.pendulum(**how, tie=tie), 20.0, samples=2, rtol=1e-6)
        off[tie] = float(jnp.hypot(motion["x"], motion["y"])[-1] - 1)
        assert 1e-9 < abs(off[tie]) < 1e-3
    assert abs(off["length"] / off["square"] - 1) > 0.01
    with pytest.raises(ValueError, match=r"^tie: expected one of length, square, got 'squared'"):
        scenes.pendulum(**how, tie="squared")


@pytest.mark.slow
def test_forces_of_a_batch_are_those_of_its_motions():
    def swing(angle):
        scene = scenes.pendulum(angle=angle, formulation="constrained")
        return simulate(scene, 0.5, samples=3, rtol=1e-8)

    batch = jax.vmap(swing)(jnp.array([0.2, 1.0]))
    forces = [constraints.tensions, constraints.multipliers, constraints.reactions]
    for look in forces:
        of_batch, of_one = jax.tree.leaves(look(batch))[0], jax.tree.leaves(look(batch.one(1)))[0]
        assert of_batch.shape == (2, *of_one.shape)
        assert gap(of_batch[1], of_one) < 1e-13
