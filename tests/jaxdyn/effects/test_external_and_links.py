"""Springs, dashpots, central, external and friction forces: laws, edges, and problem 15."""

import re
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap, primitives

from jaxdyn import Effect, Points
from jaxdyn.effects import (
    CentralForce,
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

RNG = np.random.default_rng(3)
T = jnp.asarray(0.3)
R, V = (jnp.asarray(x) for x in RNG.normal(size=(2, 2, 3)))
M = jnp.asarray([1.5, 0.5])
POINTS = Points(R, V, M)


class Yukawa(CentralForce):
    """By its energy."""

    def energy(self, r):
        return -jnp.exp(-r) / r


class Gauss(CentralForce):
    """By its force."""

    def attraction(self, r):
        return r * jnp.exp(-r * r / 2)


class AlongX(Effect):
    """Problem 15 i for f(x) = x^3: a force of one's own, by its potential."""

    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        return jnp.sum(r[:, 0] ** 4) / 4


LENGTHS = np.linalg.norm(R, axis=1)
BETWEEN = np.linalg.norm(R[0] - R[1])
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


@pytest.mark.parametrize("part", PROBLEM_15)
def test_problem_15_every_potential_against_its_force(part):
    effect, energy = PROBLEM_15[part]
    assert gap(effect.potential(T, R, M), energy) < 10 * EXACT
    slope = -jax.grad(effect.potential, argnums=1)(T, R, M)
    assert gap(effect.force(T, R, V, M), slope) < 10 * EXACT


def test_an_effect_checks_its_numbers_where_it_acts():
    for effect, _ in PROBLEM_15.values():
        effect.check(POINTS)


def test_problem_15_e_force_is_minus_f_along_the_radius():
    expected = -R * np.exp(-(LENGTHS**2) / 2)[:, None]
    assert gap(Gauss().force(T, R, V, M), expected) < EXACT


@pytest.mark.parametrize("n", [-3.0, -2.0, -1.0, 0.0, 0.5, 1.0, 2.0])
def test_power_law_is_k_r_to_the_n(n):
    force = PowerLaw(2.0, n).force(T, R, V, M)
    assert gap(force, -2.0 * R * LENGTHS[:, None] ** (n - 1)) < 10 * EXACT


def test_energy_by_quadrature_over_the_span_it_promises():
    class Inverse(CentralForce):
        def attraction(self, r):
            return r**-2.0

    for r in (0.02, 0.1, 1.0, 50.0):
        assert abs(float(Inverse().energy(jnp.asarray(r))) - (1 - 1 / r)) < 1e-11 / r


def test_a_spring_of_length_zero_is_linear_through_its_end():
    spring, r, v, m = Spring(3.0), jnp.zeros((1, 2)), jnp.zeros((1, 2)), jnp.ones(1)
    for force in (spring.force, lambda *a: Effect.force(spring, *a), PowerLaw(3.0, 1.0).force):
        for jac in (jax.jacfwd, jax.jacrev):
            slope = jax.jit(jac(force, argnums=1))(T, r, v, m)[0, :, 0]
            assert gap(slope, -3.0 * np.eye(2)) == 0


COINCIDENT = [Spring(2.0, 1.0, i=0, j=1), SpringNetwork(((0, 1),), 2.0, 1.0), Dashpot(2.0, j=1)]
COINCIDENT += [Spring(2.0, 1.0), Dashpot(2.0), PowerLaw(1.0, 2.0), Gauss()]
COINCIDENT += [DryFriction(0.2, 3.0), DryFriction(0.2, 3.0, creep=0.1)]


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


@pytest.mark.parametrize("n", [-2.0, -1.0, 0.0, 0.5, 1.0, 2.0])
def test_a_power_law_has_finite_gradients_beside_its_centre(n):
    for jac in (jax.jacfwd, jax.jacrev):
        slopes = jax.jit(jac(lambda law: law.force(T, R, V, M)))(PowerLaw(2.0, n))
        radial = -np.asarray(R) * LENGTHS[:, None] ** (n - 1)
        assert gap(slopes.k, radial) < 10 * EXACT
        assert gap(slopes.n, 2.0 * radial * np.log(LENGTHS)[:, None]) < 10 * EXACT


def test_a_singular_law_is_not_finite_at_its_centre():
    for n in (-2.0, -1.0, -0.01):
        assert not jnp.isfinite(PowerLaw(1.0, n).force(T, 0 * R, V, M)).any()
    assert not jnp.isfinite(Yukawa().force(T, 0 * R, V, M)).any()
    assert gap(PowerLaw(1.0, 0.0).force(T, 0 * R, V, M), 0 * R) == 0


def test_spring_and_dashpot_pull_along_the_line_of_their_ends():
    r = jnp.array([[0.0, 0.0], [3.0, 4.0]])
    v = jnp.array([[1.0, 0.0], [1.0, 5.0]])
    # stretched by 5 - 3 along (0.6, 0.8); opening at 5 * 0.8
    assert gap(Spring(10.0, 3.0, i=0, j=1).force(T, r, v, M), [[12, 16], [-12, -16]]) < 10 * EXACT
    assert gap(Dashpot(0.5, i=1, j=0).force(T, r, v, M), [[1.2, 1.6], [-1.2, -1.6]]) < EXACT
    anchored = Dashpot(0.5, i=1, anchor=(3.0, 0.0)).force(T, r, v, M)
    assert gap(anchored, [[0, 0], [0, -2.5]]) < EXACT


def test_a_dashpot_never_gives_energy():
    for effect in (Dashpot(0.5, j=1), Dashpot(0.5), DryFriction(0.5, 2.0), LinearDrag(0.5)):
        assert float(jnp.sum(effect.force(T, R, V, M) * V)) < 0


def test_a_network_is_the_sum_of_its_springs():
    r, v = jnp.asarray(RNG.normal(size=(2, 4, 3)))
    m, k, length = jnp.ones(4), [1.0, 2.0, 3.0], [0.5, 0.0, 2.0]
    links = ((0, 1), (3, 1), (2, 0))
    network = SpringNetwork(links, k, length)
    springs = [Spring(a, b, i=i, j=j) for a, b, (i, j) in zip(k, length, links, strict=True)]
    assert gap(network.force(T, r, v, m), sum(s.force(T, r, v, m) for s in springs)) < 10 * EXACT
    energies = [s.potential(T, r, m) for s in springs]
    assert gap(network.potential(T, r, m), sum(energies)) < 10 * EXACT
    assert gap(network.force(T, r, v, m).sum(axis=0), np.zeros(3)) < 10 * EXACT


@pytest.mark.parametrize("effect", [e for e, _ in PROBLEM_15.values()] + COINCIDENT)
def test_forces_keep_out_what_would_break_a_stepping_loop(effect):
    forbidden = {"scatter", "scatter-add", "sort", "pure_callback", "dot_general"}
    assert not set(primitives(effect.force, T, R, V, M)) & forbidden


def test_external_forces_are_functions_of_time_on_chosen_points():
    step, sine = StepForce([1.0, 2.0, 0.0], t_on=0.5, on=(1,)), SinusoidalForce([1.0, 0, 0], 2.0)
    assert gap(step.force(jnp.asarray(0.49), R, V, M), np.zeros((2, 3))) == 0
    assert gap(step.force(jnp.asarray(0.5), R, V, M), [[0, 0, 0], [1, 2, 0]]) == 0
    expected = np.outer([1.0, 1.0], [np.sin(0.6), 0, 0])
    assert gap(sine.force(T, R, V, M), expected) < EXACT
    assert step.potential(T, R, M) is None


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


def test_a_start_in_a_singular_centre_is_refused():
    at_origin = Points(jnp.zeros((1, 2)), jnp.ones((1, 2)), jnp.ones(1))
    message = (
        r"^y0: expected a finite PowerLaw force, got \[nan, nan\] on point 0 at \[0\.0, 0\.0\]"
    )
    with pytest.raises(ValueError, match=message):
        PowerLaw(1.0, -2.0).check(at_origin)
    PowerLaw(1.0, 1.0).check(at_origin)


def test_a_central_force_without_a_law_is_refused():
    class Nothing(CentralForce):
        pass

    message = r"^Nothing: expected an `attraction` or an `energy`, got neither\. Override one\."
    with pytest.raises(ValueError, match=message):
        Nothing().force(T, R, V, M)


def test_large_networks_of_springs_are_as_many_springs():
    n, rng = 30, np.random.default_rng(5)
    links = [(i, (i + 1 + k) % n) for i in range(n) for k in range(3)]  # more than written out
    k, length = rng.uniform(1, 2, (2, len(links)))
    r, v, m = rng.normal(size=(n, 3)), np.zeros((n, 3)), np.ones(n)
    network = SpringNetwork(links, k, length)
    singles = [Spring(k[e], length[e], i=i, j=j) for e, (i, j) in enumerate(links)]
    force, energy = (network.force(T, r, v, m), network.potential(T, r, m))
    assert gap(force, sum(one.force(T, r, v, m) for one in singles)) < 10 * EXACT
    assert gap(energy, sum(one.potential(T, r, m) for one in singles)) < 100 * EXACT
    assert gap(force, -jax.grad(network.potential, argnums=1)(T, r, m)) < 10 * EXACT
