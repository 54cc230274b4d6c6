"""Uniform gravity and the attraction of pairs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap, operations

from jaxdyn import Effect
from jaxdyn.effects import PairGravity, UniformGravity
from jaxdyn.scene import Points

RNG = np.random.default_rng(2)
T = jnp.zeros(())


def _points(n: int, d: int = 2) -> Points:
    r, v = jnp.asarray(RNG.normal(size=(2, n, d)))
    return Points(r, v, jnp.asarray(RNG.uniform(0.5, 2.0, n)))


@pytest.mark.sample("effect0-1-2", "effect0-1-3", "effect0-3-3", "effect1-1-2", "effect1-1-3")
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("n", [1, 3, 12])
@pytest.mark.parametrize("effect", [UniformGravity(9.81), PairGravity(0.7)])
def test_force_is_minus_the_gradient_of_the_potential(effect, n, d):
    r, v, m = _points(n, d)
    force = effect.force(T, r, v, m)
    slope = Effect.force(effect, T, r, v, m)  # the default: by autodiff
    scale = 1 + float(jnp.max(jnp.abs(slope)))
    assert gap(force / scale, slope / scale) < EXACT


def test_pair_gravity_is_newtons_law():
    r = jnp.array([[0.0, 0.0], [3.0, 4.0]])
    force = PairGravity(2.0).force(T, r, 0 * r, jnp.array([5.0, 10.0]))
    # G m1 m2 / r^2 = 2 * 5 * 10 / 25 = 4, along (0.6, 0.8), and its reaction
    assert gap(force, [[2.4, 3.2], [-2.4, -3.2]]) < EXACT


@pytest.mark.sample("12")
@pytest.mark.parametrize("n", [9, 10, 12, 15])
def test_pair_gravity_is_one_law_for_few_and_many_bodies(n):
    gravity, (r, v, m) = PairGravity(0.7), _points(n, 3)
    d = np.asarray(r) - np.asarray(r)[:, None]
    away = np.sqrt(np.sum(np.square(d), -1)) + np.eye(n)
    masses = np.asarray(m)[:, None] * np.asarray(m)
    each = 0.7 * masses / away**3
    assert gap(gravity.force(T, r, v, m), (each[:, :, None] * d).sum(1)) < 100 * EXACT
    assert gap(gravity.acceleration(T, r, v, m), gravity._acceleration_by_pairs(r, m)) < 100 * EXACT
    lost = (0.7 * masses / away)[~np.eye(n, dtype=bool)].sum() / 2
    assert gap(gravity.potential(T, r, m), -lost) < 100 * EXACT * lost


@pytest.mark.slow
def test_derivatives_of_many_bodies_are_those_of_few():
    gravity, (r, v, m) = PairGravity(0.7), _points(9)
    slope = jax.jacfwd(lambda r: gravity._acceleration_by_pairs(r, m))(r)
    for derivative in (jax.jacfwd, jax.jacrev):
        assert gap(derivative(gravity.acceleration, argnums=1)(T, r, v, m), slope) < 1000 * EXACT


def test_nothing_of_many_bodies_grows_with_their_square():
    n = 64
    r, v, m = _points(n, 3)

    def loss(r):
        return jnp.sum(PairGravity().force(T, r, v, m) ** 2) + PairGravity().potential(T, r, m)

    for program in (loss, jax.grad(loss)):
        made = [x.aval.size for eqn in operations(program, r) for x in eqn.outvars]
        assert max(made) <= 5 * n


def test_bodies_that_meet_have_no_force():
    r, v, m = _points(12)
    force = PairGravity().force(T, r.at[7].set(r[2]), v, m)
    assert jnp.isnan(force[jnp.array([2, 7])]).all()


def test_internal_forces_sum_to_zero():
    for n in (3, 12):
        r, v, m = _points(n)
        assert gap(PairGravity().force(T, r, v, m).sum(axis=0), np.zeros(2)) < 1000 * EXACT


def test_uniform_gravity_pulls_down_the_last_axis():
    force = UniformGravity(2.0).force(T, jnp.ones((2, 3)), jnp.ones((2, 3)), jnp.array([1.0, 4.0]))
    np.testing.assert_array_equal(force, [[0, 0, -2], [0, 0, -8]])


def test_two_bodies_at_one_point_are_refused():
    r = jnp.array([[0.0, 1.0], [2.0, 3.0], [0.0, 1.0]])
    message = (
        r"^y0: expected bodies at different points, got bodies 1 and 3 both at \[0\.0, 1\.0\]\. "
        r"Their attraction is infinite there; move one\.$"
    )
    with pytest.raises(ValueError, match=message):
        PairGravity().check(Points(r, 0 * r, jnp.ones(3)))
