"""Work by effect: changes of energy, closed forms, and no trace of it where it is not asked for."""

import itertools
from typing import ClassVar

import jax
import jax.numpy as jnp
import pytest
from helpers import SOLVED, gap

from jaxdyn import Effect, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.analysis.work_by_effect import WorkByEffect, power, with_work
from jaxdyn.effects import LinearDrag, QuadraticDrag, UniformGravity
from jaxdyn.formulations.mechanism import Mechanism
from jaxdyn.formulations.newton_euler import NewtonEuler
from jaxdyn.scene import Scene
from jaxdyn.scenes.particles import cannonball
from jaxdyn.solvers import VERNER9

BALL = cannonball(speed=1.0, g=1.0, drag=1.0, t1=2.0)
LEDGER = with_work(BALL, QuadraticDrag)


def _gap_of_work(rtol: float) -> float:
    motion = simulate(LEDGER, rtol=rtol, samples=2)
    total = energy.along(energy.energy, motion)
    return float(jnp.abs(motion["work of QuadraticDrag"][-1] - (total[-1] - total[0])))


@pytest.mark.slow
def test_problem_12_b_work_of_drag_is_the_change_of_energy_as_tolerance_shrinks():
    gaps = [_gap_of_work(rtol) for rtol in (1e-4, 1e-7, 1e-10, 1e-13)]
    assert gaps[0] > 1e-9  # the two are not one number by construction
    assert all(b < a / 10 for a, b in itertools.pairwise(gaps))
    assert gaps[3] < SOLVED


@pytest.mark.slow
def test_the_motion_is_that_without_a_ledger():
    # By a pair: a series of the work compiles for ten seconds.
    plain = simulate(BALL, samples=5, rtol=1e-13, solver=VERNER9)
    assert gap(simulate(LEDGER, samples=5, rtol=1e-13, solver=VERNER9).ys[:, :4], plain.ys) < SOLVED
    assert LEDGER.system.labels() == (*BALL.system.labels(), ("work of QuadraticDrag", "J"))
    assert gap(LEDGER.system.kinetic(0.0, LEDGER.y0), BALL.system.kinetic(0.0, BALL.y0)) == 0


def test_each_kind_has_its_own_entry_and_effect_means_all():
    scene = with_work(BALL, UniformGravity, QuadraticDrag, Effect)
    rates = scene.rate(0.0, scene.y0)[4:]
    # at the start: -m g vy, -c |v|^3, and both
    assert gap(rates, [-(0.5**0.5), -1.0, -1.0 - 0.5**0.5]) < 1e-15
    assert power(scene, "LinearDrag", 0.0, scene.y0) == 0


def test_a_ledger_is_differentiable_and_keeps_up_with_the_scene():
    y = LEDGER.y0

    def rate_of_work(c):
        return with_work(cannonball(speed=1.0, drag=c), QuadraticDrag).rate(0.0, y)[-1]

    assert gap(jax.grad(rate_of_work)(2.0), -1.0) < 1e-15
    slower = LEDGER.without(QuadraticDrag)
    assert slower.rate(0.0, y)[-1] == 0
    assert (LEDGER + LinearDrag(1.0)).rate(0.0, y)[2] < LEDGER.rate(0.0, y)[2]


class Arm(Mechanism):
    """A pendulum of length 1 m and mass 2 kg, x to the right and y up; angle from below."""

    def coordinates(self):
        return (("theta", "rad"),)

    def masses(self):
        return jnp.array([2.0])

    def positions(self, t, q):
        return jnp.stack([jnp.sin(q[0]), -jnp.cos(q[0])])[None]


class Motor(Effect):
    """A constant torque of 3 N m on the first coordinate."""

    def generalized(self, t, q, v):
        return jnp.array([3.0])


@pytest.mark.slow
def test_a_motor_works_on_the_coordinate_it_turns():
    plain = Scene(NewtonEuler(Arm()), (UniformGravity(9.81), Motor()), y0=[0.1, 0.0], t1=1.0)
    scene = with_work(plain, Motor)
    motion = simulate(scene, samples=2, rtol=1e-13)
    # torque times the angle turned, and the change of energy
    turned = motion["theta"][-1] - motion["theta"][0]
    assert gap(motion["work of Motor"][-1], 3.0 * turned) < SOLVED
    total = energy.along(energy.energy, motion)
    assert gap(motion["work of Motor"][-1], total[-1] - total[0]) < 10 * SOLVED
    # and the angle still wraps, the work does not
    y = jnp.array([0.0, 0.0, 0.0])
    difference = scene.system.difference(y + jnp.array([2 * jnp.pi, 1.0, 7.0]), y)
    assert gap(difference, [0.0, 1.0, 7.0]) < 1e-14
    assert gap(scene.system.project(0.0, y), y) == 0


class _Brake(Effect):
    """A torque against the spin of a rigid body, in its axes."""

    velocity_dependent: ClassVar[bool] = True

    def generalized(self, t, q, v):
        return jnp.concatenate([jnp.zeros(3), -0.3 * v[3:]])


@pytest.mark.slow
def test_a_torque_on_a_rigid_body_works_on_its_spin():
    scene = scenes.free_body(t1=2.0) + _Brake()
    motion = simulate(with_work(scene, _Brake), rtol=1e-12)
    total = energy.along(energy.energy, motion)
    assert total[0] - total[-1] > 0.1 * total[0]
    assert gap(motion["work of _Brake"], total - total[0]) < SOLVED


def test_a_scene_without_a_ledger_has_none():
    assert not isinstance(BALL.system, WorkByEffect)
    assert isinstance(LEDGER.system, WorkByEffect)
    assert not LEDGER.second_order


@pytest.mark.parametrize(("kinds", "got"), [((LinearDrag,), "LinearDrag"), ((), "NoneType")])
def test_a_kind_that_the_scene_lacks_is_refused(kinds, got):
    message = rf"^with_work: expected an effect of the scene \(UniformGravity, .*\), got {got}\.$"
    with pytest.raises(ValueError, match=message):
        with_work(BALL, *kinds)


def test_the_system_inside_is_still_checked():
    scene = with_work(cannonball(m=-1.0, drag=1.0), QuadraticDrag)
    with pytest.raises(ValueError, match=r"^mass: expected >= 0, got -1\.0\."):
        simulate(scene)
