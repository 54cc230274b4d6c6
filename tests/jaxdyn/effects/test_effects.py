"""Each effect against its closed form, its own potential, and at rest."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap, operations, primitives

from jaxdyn import Effect, Points
from jaxdyn.effects import LinearDrag, PairGravity, QuadraticDrag, UniformGravity

RNG = np.random.default_rng(2)
T = jnp.zeros(())
CONSERVATIVE = [UniformGravity(9.81), PairGravity(0.7)]
DRAGS = [LinearDrag(0.3), LinearDrag(0.3, wind=[1.0, -2.0]), QuadraticDrag(0.3)]
DRAGS += [QuadraticDrag(0.3, wind=[1.0, -2.0]), QuadraticDrag(0.3, wind=1.5)]


def _points(n: int, d: int = 2) -> Points:
    r, v = jnp.asarray(RNG.normal(size=(2, n, d)))
    return Points(r, v, jnp.asarray(RNG.uniform(0.5, 2.0, n)))


def _name(effect: Effect) -> str:
    return type(effect).__name__


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("n", [1, 3, 12])
@pytest.mark.parametrize("effect", CONSERVATIVE, ids=_name)
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


@pytest.mark.parametrize("n", [9, 10, 12, 15])
def test_pair_gravity_is_one_law_for_few_and_many_bodies(n):
    gravity, (r, v, m) = PairGravity(0.7), _points(n, 3)
    d = np.asarray(r) - np.asarray(r)[:, None]
    away = np.sqrt(np.sum(np.square(d), -1)) + np.eye(n)
    masses = np.asarray(m)[:, None] * np.asarray(m)
    each = 0.7 * masses / away**3
    assert gap(gravity.force(T, r, v, m), (each[:, :, None] * d).sum(1)) < 100 * EXACT
    assert gap(gravity.force(T, r, v, m), gravity._force_by_pairs(r, m)) < 100 * EXACT
    lost = (0.7 * masses / away)[~np.eye(n, dtype=bool)].sum() / 2
    assert gap(gravity.potential(T, r, m), -lost) < 100 * EXACT * lost


def test_derivatives_of_many_bodies_are_those_of_few():
    gravity, (r, v, m) = PairGravity(0.7), _points(9)
    slope = jax.jacfwd(lambda r: gravity._force_by_pairs(r, m))(r)
    for derivative in (jax.jacfwd, jax.jacrev):
        assert gap(derivative(gravity.force, argnums=1)(T, r, v, m), slope) < 1000 * EXACT


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


@pytest.mark.parametrize("effect", DRAGS, ids=_name)
def test_drag_opposes_the_velocity_through_the_air(effect):
    r, v, m = _points(4)
    u = np.asarray(v) - np.asarray(effect.wind)
    speed = np.linalg.norm(u, axis=1, keepdims=True) if isinstance(effect, QuadraticDrag) else 1.0
    assert gap(effect.force(T, r, v, m), -0.3 * speed * u) < EXACT


@pytest.mark.parametrize("jac", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("effect", [*CONSERVATIVE, *DRAGS[:3]], ids=_name)
def test_derivatives_are_finite_at_rest(effect, jac):
    r, v, m = _points(3)

    def force(effect, r, v, m):
        return effect.force(T, r, v, m)

    at_rest = jac(force, argnums=(0, 1, 2, 3))(effect, r, v * 0, m)
    assert all(jnp.isfinite(x).all() for x in jax.tree.leaves(at_rest))
    # ... and twice, where a reverse sweep meets the forward one.
    twice = jac(jac(force, argnums=2), argnums=2)(effect, r, v * 0, m)
    assert jnp.isfinite(twice).all()


def test_quadratic_drag_has_slope_zero_at_rest():
    r, v, m = _points(2)
    slope = jax.jacrev(QuadraticDrag(0.3).force, argnums=2)(T, r, v * 0, m)
    np.testing.assert_array_equal(slope, np.zeros((2, 2, 2, 2)))


@pytest.mark.parametrize("effect", [*CONSERVATIVE, *DRAGS], ids=_name)
def test_forces_keep_out_what_would_break_a_stepping_loop(effect):
    for n in (3, 12):
        found = set(primitives(effect.force, T, *_points(n)))
        forbidden = {"scatter", "scatter-add", "scatter_add", "sort", "pure_callback", "eigh", "lu"}
        assert not found & forbidden


@pytest.mark.parametrize("effect", CONSERVATIVE, ids=_name)
def test_effects_that_say_so_ignore_velocity(effect):
    r, v, m = _points(3)
    np.testing.assert_array_equal(effect.force(T, r, v, m), effect.force(T, r, v * jnp.nan, m))
    assert not effect.velocity_dependent


def test_an_effect_with_neither_force_nor_potential_is_refused():
    class Nothing(Effect):
        pass

    message = r"^Nothing: expected a `force` or a `potential`, got neither\. Override one\."
    with pytest.raises(ValueError, match=message):
        Nothing().force(T, *_points(2))
    assert Nothing().potential(T, jnp.ones((2, 2)), jnp.ones(2)) is None


def test_a_potential_alone_makes_a_force():
    class Trap(Effect):
        def potential(self, t, r, m):
            return 0.5 * jnp.sum(r * r) + t * 0

    r, v, m = _points(3)
    assert gap(Trap().force(T, r, v, m), -r) < EXACT


def test_two_bodies_at_one_point_are_refused():
    r = jnp.array([[0.0, 1.0], [2.0, 3.0], [0.0, 1.0]])
    message = (
        r"^y0: expected bodies at different points, got bodies 1 and 3 both at \[0\.0, 1\.0\]\. "
        r"Their attraction is infinite there; move one\.$"
    )
    with pytest.raises(ValueError, match=message):
        PairGravity().check(Points(r, 0 * r, jnp.ones(3)))
