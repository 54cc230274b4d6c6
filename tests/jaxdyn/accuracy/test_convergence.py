"""Problem 3: equal steps against exact solutions, and estimates that know none."""

from typing import ClassVar

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap

from jaxdyn import effects, scenes, simulate, solvers
from jaxdyn.accuracy import convergence as steps
from jaxdyn.accuracy import work_precision

SCENES = {
    "oscillator": (scenes.oscillator(k=4.0, c=0.3), 3.0),
    "pendulum": (scenes.pendulum(angle=2.0), 2.0),
    "lorenz": (scenes.lorenz(), 1.0),
}


def test_problem_3_a_b_the_plain_loop_is_the_same():
    x, v, h = 1.0, 0.0, 0.1
    for _ in range(20):
        x, v = x + h * v, v - h * x
    assert gap(steps.fixed_steps(scenes.oscillator(), 2.0, steps=20), [x, v]) < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(
    ("method", "first", "order"),
    [(solvers.EULER, 4096, 1), (solvers.from_diffrax(diffrax.Bosh3()), 256, 3)],
    ids=["euler", "bosh3"],
)
def test_problem_3_d_estimated_errors_are_the_errors(name, method, first, order):
    scene, t1 = SCENES[name]
    table = steps.halvings(scene, t1, steps=first, rows=5, method=method)
    exact = simulate(scene, t1, samples=2, rtol=1e-13).ys[-1]
    errors = np.abs(table.ys - np.asarray(exact)).max(axis=1)
    assert np.isnan(table.errors[:2]).all()
    assert np.all(np.abs(table.orders[3:] - order) < 0.2)
    assert np.all(np.abs(table.errors[3:] / errors[3:] - 1) < 0.2)
    assert table.steps.tolist() == [first * 2**i for i in range(5)]


@pytest.mark.sample("lorenz")
@pytest.mark.parametrize("name", SCENES)
def test_problem_3_e_the_error_follows_the_tolerance(name):
    scene, t1 = SCENES[name]
    ends = [simulate(scene, t1, samples=2, rtol=r).ys[-1] for r in (1e-4, 1e-7, 1e-10, 1e-13)]
    errors = [gap(y, ends[-1]) for y in ends[:-1]]
    assert errors[0] > 30 * errors[1] > 900 * errors[2]
    assert errors[2] < 1e-7


def test_there_and_back_again():
    there = steps.fixed_steps(scenes.oscillator(), 1.0, steps=200, method=solvers.VERNER9)
    back = steps.fixed_steps(
        scenes.oscillator().starting(there), 0.0, t0=1.0, steps=100, method=solvers.VERNER9
    )
    assert gap(there, [np.cos(1.0), -np.sin(1.0)]) < SOLVED
    assert gap(back, [1.0, 0.0]) < SOLVED


class Counted(effects.ConstantForce):
    """A force that counts how often it is traced."""

    traces: ClassVar[list] = []

    def force(self, t, r, v, m):
        if isinstance(r, jax.core.Tracer):
            self.traces.append(1)
        return super().force(t, r, v, m)


def test_new_numbers_do_not_compile_again():
    steps.fixed_steps(scenes.particle(Counted([1.0, 0.0])), 1.0, steps=5)
    count = len(Counted.traces)
    end = steps.fixed_steps(scenes.particle(Counted([2.0, 0.0]), m=2.0), 3.0, steps=7)
    assert len(Counted.traces) == count > 0
    assert gap(end[2], 1.0 + 3.0) < 1e-13


def test_estimates_where_there_are_none():
    # Exactly right from the first step on: differences of 0 tell nothing.
    table = steps.halvings(scenes.particle(velocity=(0.0, 0.0)), rows=3)
    assert np.isnan(table.orders).all()
    assert np.isnan(table.errors).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [({"steps": 0}, "steps: expected at least 1"), ({"t1": jnp.inf}, "t1: expected finite")],
)
def test_what_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        steps.fixed_steps(scenes.oscillator(), **options)
    with pytest.raises(ValueError, match="rows: expected at least 3"):
        steps.halvings(scenes.oscillator(), rows=2)


@pytest.mark.parametrize("judge", [steps.halvings, work_precision.work_precision])
def test_comparisons_of_solutions_run_outside_of_traces(judge):
    with pytest.raises(ValueError, match=r"^scene: .*traced by jit.* Call it outside of jit"):
        jax.jit(lambda length: judge(scenes.pendulum(length=length), 1.0))(1.0)
