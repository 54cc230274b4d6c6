"""Drag in still and moving air, and dry friction."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap

import jaxdyn
from jaxdyn import scenes
from jaxdyn.effects import DryFriction, LinearDrag, QuadraticDrag
from jaxdyn.status import Status

RNG = np.random.default_rng(3)
T = jnp.asarray(0.3)
R, V = (jnp.asarray(x) for x in RNG.normal(size=(2, 2, 3)))
M = jnp.asarray([1.5, 0.5])
DRAGS = [LinearDrag(0.3), LinearDrag(0.3, wind=[1.0, -2.0, 0.5]), QuadraticDrag(0.3)]
DRAGS += [QuadraticDrag(0.3, wind=[1.0, -2.0, 0.5]), QuadraticDrag(0.3, wind=1.5)]


@pytest.mark.parametrize("effect", DRAGS)
def test_drag_opposes_the_velocity_through_the_air(effect):
    u = np.asarray(V) - np.asarray(effect.wind)
    speed = np.linalg.norm(u, axis=1, keepdims=True) if isinstance(effect, QuadraticDrag) else 1.0
    assert gap(effect.force(T, R, V, M), -0.3 * speed * u) < EXACT


def test_quadratic_drag_has_slope_zero_at_rest():
    slope = jax.jacrev(QuadraticDrag(0.3).force, argnums=2)(T, R, 0 * V, M)
    np.testing.assert_array_equal(slope, np.zeros((2, 3, 2, 3)))


def test_dry_friction_is_coulombs_law_and_its_regularisation_is_as_near_as_it_says():
    u = np.asarray(V) - np.array([1.0, 0, 0])
    speed = np.linalg.norm(u, axis=1, keepdims=True)
    law = -0.3 * np.array([[2.0], [4.0]]) * u / speed
    belt, normal = jnp.array([1.0, 0.0, 0.0]), [2.0, 4.0]
    assert gap(DryFriction(0.3, normal, belt).force(T, R, V, M), law) < EXACT
    creep = 1e-3
    smooth = DryFriction(0.3, normal, belt, creep).force(T, R, V, M)
    off = np.max(np.abs(smooth / law - 1) / ((creep / speed) ** 2 / 2))
    assert 0.99 < off <= 1.0


def test_a_motion_that_friction_stops_says_so():
    sliding = scenes.particle(position=(0.0, 0.0), velocity=(3.0, 1.0)) + DryFriction(0.5, 9.81)
    stopped = jaxdyn.simulate(sliding, 5.0, max_steps=10_000, throw=False)
    assert stopped.status == Status.STEP_LIMIT
    assert DryFriction.singular in stopped.message


@pytest.mark.slow
def test_dry_friction_on_a_line_sticks_and_slips():
    # Each half swing takes 2 mu N / k off the amplitude: 1, -0.76, 0.52, -0.28, 0.04, and it holds.
    def stopped(mu):
        return jaxdyn.solve(scenes.oscillator() + DryFriction(mu, 1.0), 20.0).y1

    assert gap(stopped(0.12), [0.04, 0.0]) < 1e-10
    assert gap(jax.grad(lambda mu: stopped(mu)[0])(0.12), -8.0) < 1e-9
    assert gap(jax.vmap(stopped)(jnp.array([0.12, 0.13]))[:, 0], [0.04, -0.04]) < 1e-10


def test_a_creep_of_zero_is_coulombs_law_itself():
    assert DryFriction(0.3, 1.0, creep=0.0).creep is None
    assert DryFriction(0.3, 1.0, creep=1e-3).creep == 1e-3
    smooth = jax.jit(lambda c: DryFriction(0.3, 1.0, creep=c).force(T, R[:, :1], V[:, :1], M))
    assert gap(smooth(0.0), -0.3 * np.sign(V[:, :1])) < EXACT
