"""Springs, dashpots and networks of springs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import Effect, scenes, simulate
from jaxdyn.effects import (
    ConstantForce,
    CubicSpring,
    Damper,
    Dashpot,
    HingeDamper,
    PowerLaw,
    Spring,
    SpringNetwork,
)

RNG = np.random.default_rng(3)
T = jnp.asarray(0.3)
R, V = (jnp.asarray(x) for x in RNG.normal(size=(2, 2, 3)))
M = jnp.asarray([1.5, 0.5])


def test_a_spring_of_length_zero_is_linear_through_its_end():
    spring, r, v, m = Spring(3.0), jnp.zeros((1, 2)), jnp.zeros((1, 2)), jnp.ones(1)
    for force in (spring.force, lambda *a: Effect.force(spring, *a), PowerLaw(3.0, 1.0).force):
        for jac in (jax.jacfwd, jax.jacrev):
            slope = jax.jit(jac(force, argnums=1))(T, r, v, m)[0, :, 0]
            assert gap(slope, -3.0 * np.eye(2)) == 0


def test_spring_and_dashpot_pull_along_the_line_of_their_ends():
    r = jnp.array([[0.0, 0.0], [3.0, 4.0]])
    v = jnp.array([[1.0, 0.0], [1.0, 5.0]])
    # stretched by 5 - 3 along (0.6, 0.8); opening at 5 * 0.8
    assert gap(Spring(10.0, 3.0, i=0, j=1).force(T, r, v, M), [[12, 16], [-12, -16]]) < 10 * EXACT
    assert gap(Dashpot(0.5, i=1, j=0).force(T, r, v, M), [[1.2, 1.6], [-1.2, -1.6]]) < EXACT
    anchored = Dashpot(0.5, i=1, anchor=(3.0, 0.0)).force(T, r, v, M)
    assert gap(anchored, [[0, 0], [0, -2.5]]) < EXACT


def test_a_cubic_spring_pulls_with_the_cube_of_its_length():
    r, spring = jnp.array([[0.0, 0.0], [3.0, 4.0]]), CubicSpring(0.1, i=0, j=1)
    assert gap(spring.force(T, r, V, M), [[7.5, 10.0], [-7.5, -10.0]]) < 10 * EXACT
    anchored = CubicSpring(0.1, i=1, anchor=(3.0, 0.0))
    for one in (spring, anchored):
        slope = jax.grad(one.potential, argnums=1)(T, r, M)
        assert gap(one.force(T, r, V, M), -slope) < 10 * EXACT
    assert gap(anchored.potential(T, r, M), 0.1 * 4.0**4 / 4) < 10 * EXACT


def test_a_damper_opposes_the_relative_velocity_of_its_ends():
    r = jnp.zeros((2, 2))  # also where the ends coincide
    v = jnp.array([[1.0, 0.0], [1.0, 5.0]])
    assert gap(Damper(0.5, i=1, j=0).force(T, r, v, M), [[0, 2.5], [0, -2.5]]) < EXACT
    carried = Damper(0.5, i=1, velocity=(3.0, 0.0)).force(T, r, v, M)
    assert gap(carried, [[0, 0], [1.0, -2.5]]) < EXACT


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


@pytest.mark.slow
def test_large_networks_of_springs_are_as_many_springs():
    n, rng = 30, np.random.default_rng(5)
    links = [(i, (i + 1 + k) % n) for i in range(n) for k in range(3)]  # more than written out
    k, length = rng.uniform(1, 2, (2, len(links)))
    r, v, m = jnp.asarray(rng.normal(size=(n, 3))), jnp.zeros((n, 3)), jnp.ones(n)
    network = SpringNetwork(links, k, length)
    singles = [Spring(k[e], length[e], i=i, j=j) for e, (i, j) in enumerate(links)]
    force, energy = (network.force(T, r, v, m), network.potential(T, r, m))
    assert gap(force, sum(one.force(T, r, v, m) for one in singles)) < 10 * EXACT
    assert gap(energy, sum(one.potential(T, r, m) for one in singles)) < 100 * EXACT
    assert gap(force, -jax.grad(network.potential, argnums=1)(T, r, m)) < 10 * EXACT


@pytest.mark.sample("70")
@pytest.mark.parametrize("n", [70, 300, 700])
def test_a_point_may_hold_most_springs_of_a_network(n):
    # More than a point sums at once, or than its parts do; one spring counts its end from behind.
    r = jnp.asarray(np.random.default_rng(n).normal(size=(n, 3)))
    links = [(0, i) for i in range(1, n)] + [(-1, 1)]
    network = SpringNetwork(links, 2.0, 0.5)
    force = network.force(T, r, 0 * r, jnp.ones(n))
    energy = network.potential
    assert gap(force, -jax.grad(energy, argnums=1)(T, r, jnp.ones(n))) < 1e-12 * n
    assert gap(force.sum(axis=0), np.zeros(3)) < 1e-12 * n


def test_a_damper_in_a_hinge_takes_the_power_of_its_torque():
    v = jnp.array([2.0, 5.0])
    one, two = HingeDamper(0.5, i=1), HingeDamper(0.5, i=1, j=0)
    assert one.generalized(T, jnp.zeros(2), v).tolist() == [0.0, -2.5]
    assert two.generalized(T, jnp.zeros(2), v).tolist() == [1.5, -1.5]
    # Where gravity is absent the rate of a pendulum decays by c / (m l^2).
    swing = scenes.pendulum(g=0.0, rate=1.0, damping=0.3, m=2.0, length=0.5)
    end = simulate(swing, 2.0, samples=2, rtol=1e-13).ys[-1, 1]
    assert gap(end, jnp.exp(-0.3 / 0.5 * 2.0)) < SOLVED
    assert scenes.pendulum(damping=0.0).effects == scenes.pendulum().effects
    # On a body in space it acts on components of the angular velocity.
    assert one.generalized(T, jnp.zeros(4), jnp.ones(3)).tolist() == [0.0, -0.5, 0.0]
    with pytest.raises(ValueError, match="N m s"):
        scenes.pendulum(damping=float("nan")).check()
    with pytest.raises(ValueError, match="damping: expected 0 for formulation='constrained'"):
        scenes.pendulum(formulation="constrained", damping=0.1)


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        (Spring(2.0, i=9), "Spring: i: expected a point from 0 to 4, got 9"),
        (Spring(2.0, i="a"), "Spring: i: expected a point from 0 to 4, got a"),
        (Dashpot(2.0, j=9), "Dashpot: j: expected a point from 0 to 4, got 9"),
        (CubicSpring(2.0, i=9), "CubicSpring: i: expected a point from 0 to 4, got 9"),
        (Damper(2.0, j=9), "Damper: j: expected a point from 0 to 4, got 9"),
        (SpringNetwork(((0, 9),), 2.0), "SpringNetwork: j: expected a point from 0 to 4, got 9"),
        (HingeDamper(2.0, i=5), "i: expected a coordinate from 0 to 1, got 5"),
        (HingeDamper(2.0, i=1, j=-1), "j: expected another angle than i = 1, got -1"),
        (ConstantForce([1.0, 0.0], on=(9,)), "ConstantForce: on: expected a point from 0 to 4"),
        (ConstantForce([1.0, 0.0], on=1), "ConstantForce: on: expected None for all points, or"),
    ],
)
def test_an_index_that_does_not_exist_is_refused_by_name(effect, said):
    with pytest.raises(ValueError, match=said):
        (scenes.double_pendulum() + effect).check()
