"""What holds for every effect: potentials against forces, finite slopes, refused numbers."""

import re
from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, Gauss, Yukawa, gap, primitives

from jaxdyn import Effect, effects, scenes, simulate
from jaxdyn.effects import (
    ConstantForce,
    Dashpot,
    DryFriction,
    LinearDrag,
    PairGravity,
    PowerLaw,
    QuadraticDrag,
    SinusoidalForce,
    Spring,
    SpringNetwork,
    StepForce,
    UniformGravity,
    unless_zero,
)
from jaxdyn.scene import Points

RNG = np.random.default_rng(3)
T = jnp.asarray(0.3)
R, V = (jnp.asarray(x) for x in RNG.normal(size=(2, 2, 3)))
M = jnp.asarray([1.5, 0.5])
POINTS = Points(R, V, M)
LENGTHS = np.linalg.norm(R, axis=1)
BETWEEN = np.linalg.norm(R[0] - R[1])


class AlongX(Effect):
    """Problem 15 i for f(x) = x^3: a force of one's own, by its potential."""

    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        return jnp.sum(r[:, 0] ** 4) / 4


# Each force of problem 15 with the energy given there, up to its constant.
PROBLEM_15 = {
    "a": (UniformGravity(2.0), 2.0 * np.sum(M * R[:, 2])),
    "b": (Spring(3.0), 1.5 * LENGTHS[0] ** 2),
    "c": (Spring(3.0, 0.7), 1.5 * (LENGTHS[0] - 0.7) ** 2),
    "d": (PowerLaw(2.0, -2.0), -2.0 * np.sum(1 / LENGTHS)),
    "e by force": (Gauss(), np.sum(np.exp(-0.5) - np.exp(-(LENGTHS**2) / 2))),
    "e by energy": (Yukawa(), -np.sum(np.exp(-LENGTHS) / LENGTHS)),
    "e log": (PowerLaw(2.0, -1.0), 2.0 * np.sum(np.log(LENGTHS))),
    "f": (Spring(3.0, 0.7, i=0, j=1), 1.5 * (BETWEEN - 0.7) ** 2),
    "f network": (SpringNetwork(((1, 0),), 3.0, 0.7), 1.5 * (BETWEEN - 0.7) ** 2),
    "g": (PairGravity(2.0), -2.0 * M[0] * M[1] / BETWEEN),
    "h": (ConstantForce([0.0, -2.0, 1.0]), np.sum(R @ np.array([0.0, 2.0, -1.0]))),
    "i": (AlongX(), np.sum(R[:, 0] ** 4) / 4),
}


@pytest.mark.sample("a", "c", "e log", "f", "h", "i")
@pytest.mark.parametrize("part", PROBLEM_15)
def test_problem_15_every_potential_against_its_force(part):
    effect, energy = PROBLEM_15[part]
    assert gap(effect.potential(T, R, M), energy) < 10 * EXACT
    slope = -jax.grad(effect.potential, argnums=1)(T, R, M)
    assert gap(effect.force(T, R, V, M), slope) < 10 * EXACT


def test_an_effect_checks_its_numbers_where_it_acts():
    for effect, _ in PROBLEM_15.values():
        effect.check(POINTS)


COINCIDENT = [Spring(2.0, 1.0, i=0, j=1), SpringNetwork(((0, 1),), 2.0, 1.0), Dashpot(2.0, j=1)]
COINCIDENT += [Spring(2.0, 1.0), Dashpot(2.0), PowerLaw(1.0, 2.0), Gauss()]
COINCIDENT += [DryFriction(0.2, 3.0), DryFriction(0.2, 3.0, creep=0.1)]


@pytest.mark.sample("Spring1", "Gauss", "DryFriction1")
@pytest.mark.parametrize("effect", COINCIDENT, ids=lambda e: type(e).__name__)
def test_forces_and_slopes_are_finite_where_ends_meet_at_rest(effect):
    r = jnp.zeros((2, 2))

    def force(effect, r, v):
        return effect.force(T, r, v, M)

    @jax.jit
    def slopes(*args):
        return [jac(force, argnums=(0, 1, 2))(*args) for jac in (jax.jacfwd, jax.jacrev)]

    assert gap(force(effect, r, r), r) == 0
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes(effect, r, r)))


AT_REST = [UniformGravity(9.81), PairGravity(0.7), LinearDrag(0.3), QuadraticDrag(0.3)]
AT_REST += [LinearDrag(0.3, wind=[1.0, -2.0, 0.5])]


@pytest.mark.sample("LinearDrag1-jacfwd", "LinearDrag1-jacrev")
@pytest.mark.parametrize("jac", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("effect", AT_REST, ids=lambda e: type(e).__name__)
def test_derivatives_are_finite_at_rest(effect, jac):
    def force(effect, r, v, m):
        return effect.force(T, r, v, m)

    at_rest = jac(force, argnums=(0, 1, 2, 3))(effect, R, 0 * V, M)
    assert all(jnp.isfinite(x).all() for x in jax.tree.leaves(at_rest))
    # So are second derivatives, where a reverse sweep meets the forward one.
    twice = jac(jac(force, argnums=2), argnums=2)(effect, R, 0 * V, M)
    assert jnp.isfinite(twice).all()


def test_dampers_never_give_energy():
    for effect in (Dashpot(0.5, j=1), Dashpot(0.5), DryFriction(0.5, 2.0), LinearDrag(0.5)):
        assert float(jnp.sum(effect.force(T, R, V, M) * V)) < 0


@pytest.mark.parametrize("n", [2, 3, 12])
@pytest.mark.parametrize("effect", [e for e, _ in PROBLEM_15.values()] + COINCIDENT + AT_REST)
def test_forces_keep_out_what_would_break_a_stepping_loop(effect, n):
    r, v = jnp.asarray(RNG.normal(size=(2, n, 3)))
    if isinstance(effect, DryFriction) and n != 2:
        effect = DryFriction(effect.mu, 3.0, creep=effect.creep)
    found = set(primitives(effect.force, T, r, v, jnp.ones(n)))
    forbidden = {"scatter", "scatter-add", "scatter_add", "sort", "pure_callback", "eigh", "lu"}
    assert not found & (forbidden | {"dot_general"})


@pytest.mark.parametrize("effect", [e for e, _ in PROBLEM_15.values() if not e.velocity_dependent])
def test_effects_that_say_so_ignore_velocity(effect):
    np.testing.assert_array_equal(effect.force(T, R, V, M), effect.force(T, R, V * jnp.nan, M))


def test_external_forces_are_functions_of_time_on_chosen_points():
    step, sine = StepForce([1.0, 2.0, 0.0], t_on=0.5, on=(1,)), SinusoidalForce([1.0, 0, 0], 2.0)
    assert gap(step.force(jnp.asarray(0.49), R, V, M), np.zeros((2, 3))) == 0
    assert gap(step.force(jnp.asarray(0.5), R, V, M), [[0, 0, 0], [1, 2, 0]]) == 0
    expected = np.outer([1.0, 1.0], [np.sin(0.6), 0, 0])
    assert gap(sine.force(T, R, V, M), expected) < EXACT
    assert step.potential(T, R, M) is None


def test_a_coefficient_of_exactly_zero_leaves_an_effect_out():
    assert unless_zero(0, LinearDrag(0)) == ()
    assert len(unless_zero(1e-300, LinearDrag(1e-300))) == 1
    # A traced coefficient keeps it: its value is not known.
    assert jax.jit(lambda c: len(unless_zero(c, LinearDrag(c))) + 0 * c)(0.0) == 1


REFUSED = [
    (Spring(1.0, -1.0), "length: expected >= 0, got -1.0. A rest length is in m."),
    (Spring(np.nan), "k: expected finite numbers, got nan. A stiffness is in N/m."),
    (Spring(1.0, i=2), "i: expected a point from 0 to 1, got 2. Points count from 0."),
    (Spring(1.0, j=-3), "j: expected a point from 0 to 1, got -3."),
    (Dashpot(1.0, i=1, j=-1), "j: expected another point than i = 1, got -1. Leave j out"),
    (Dashpot(np.inf), "c: expected finite numbers, got inf. A damping coefficient"),
    (SpringNetwork(((0, 5),), 1.0), "j: expected a point from 0 to 1, got 5."),
    (SpringNetwork(((0, 1),), 1.0, [-2.0]), "length: expected >= 0, got -2.0."),
    (SpringNetwork(((0, 1),), np.nan), "k: expected finite numbers, got nan."),
    (Spring([1.0, 2.0, 3.0]), "k: expected shape (), got shape (3,). A stiffness is in N/m."),
    (Spring(1.0, [1.0, 2.0]), "length: expected shape (), got shape (2,)."),
    (Spring(1.0, anchor=[1.0]), "anchor: expected shape (3,), got shape (1,). One component"),
    (Dashpot([1.0]), "c: expected shape (), got shape (1,). A damping coefficient"),
    (SpringNetwork(((0, 1),), [1.0, 2.0]), "k: expected shape (1,), got shape (2,)."),
    (SpringNetwork(((0, 1),), 1.0, [1.0, 2.0]), "length: expected shape (1,), got shape (2,)."),
    (UniformGravity([9.8, 9.8, 9.8]), "g: expected shape (), got shape (3,). In m/s^2, against"),
    (LinearDrag([0.1, 0.2, 0.3]), "c: expected shape (), got shape (3,). A negative drag"),
    (QuadraticDrag(0.1, wind=[1.0]), "wind: expected shape (3,), got shape (1,). One component"),
    (DryFriction([0.1, 0.2], 1.0), "mu: expected shape (), got shape (2,). The surface only"),
    (DryFriction(0.1, [1.0, 1.0, 1.0]), "normal: expected shape (2,), got shape (3,)."),
    (DryFriction(0.1, 1.0, belt=[1.0]), "belt: expected shape (3,), got shape (1,)."),
    (ConstantForce([1.0]), "F: expected shape (3,), got shape (1,). One component for each axis."),
    (StepForce([1.0, 2.0, 3.0], on=(7,)), "on: expected a point from 0 to 1, got 7."),
    (SinusoidalForce([1.0, 2.0], 1.0), "F: expected shape (3,), got shape (2,)."),
    (DryFriction(-0.1, 1.0), "mu: expected >= 0, got -0.1. The surface only pushes."),
]


@pytest.mark.parametrize(("effect", "message"), REFUSED)
def test_numbers_without_sense_are_refused(effect, message):
    with pytest.raises(ValueError, match="^" + re.escape(message)):
        effect.check(POINTS)


def test_an_effect_with_neither_force_nor_potential_is_refused():
    class Nothing(Effect):
        pass

    message = r"^Nothing: expected a `force` or a `potential`, got neither\. Override one\."
    with pytest.raises(ValueError, match=message):
        Nothing().force(T, R, V, M)
    assert Nothing().potential(T, jnp.ones((2, 2)), jnp.ones(2)) is None


def test_a_potential_alone_makes_a_force():
    class Trap(Effect):
        def potential(self, t, r, m):
            return 0.5 * jnp.sum(r * r) + t * 0

    assert gap(Trap().force(T, R, V, M), -R) < EXACT


@pytest.mark.parametrize(
    "make",
    [effects.ConstantForce, effects.StepForce, partial(effects.SinusoidalForce, omega=1.0)],
)
def test_a_force_of_another_shape_is_refused_by_name(make):
    for force, got in ((5.0, r"\(\)"), ([1.0, 2.0, 3.0], r"\(3,\)")):
        message = rf"^(\w+Force: )?F: expected shape \(2,\), got shape {got}\. One component"
        for use in (simulate, lambda scene: scene.rate(0.0, scene.y0)):
            with pytest.raises(ValueError, match=message):
                use(scenes.cannonball() + make(force))
    with pytest.raises(ValueError, match=r"on: expected None for all points, or a tuple, got ''"):
        simulate(scenes.cannonball() + make([1.0, 2.0], on=""))
