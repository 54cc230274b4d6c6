"""Derivatives of folds and Hopf points against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import continuation, scenes
from jaxdyn.continuation import Kind


def cubic(q):
    """p + q y - y^3: folds at p = +-2 (q / 3)^(3/2), y = -+(q / 3)^(1/2)."""

    def make(p):
        numbers = jnp.stack([p, jnp.asarray(q)])
        return jaxdyn.ode(lambda t, y, c: [c[0] + c[1] * y[0] - y[0] ** 3], [0.0], params=numbers)

    return make


@pytest.mark.slow
def test_folds_by_a_number_of_their_scenes():
    family = jaxdyn.continue_equilibria(cubic(1.5), -1.0, [-1.4], within=(-2, 2))
    for fold in family.special:
        assert fold.kind == Kind.FOLD
        found, slope = jax.jvp(
            lambda q, fold=fold: continuation.differentiable(cubic(q), fold), (1.5,), (1.0,)
        )
        side = np.sign(fold.parameter)
        assert found.parameter == pytest.approx(side * 2 * 0.5**1.5, abs=1e-12)
        assert slope.parameter == pytest.approx(side * 0.5**0.5, abs=1e-12)
        assert slope.state[0] == pytest.approx(-side / (6 * 0.5**0.5), abs=1e-12)
        assert np.isnan(found.frequency)


def test_a_hopf_point_by_a_number_of_its_scene():
    def lorenz(sigma):
        return lambda rho: scenes.lorenz(sigma=sigma, rho=rho)

    family = jaxdyn.continue_equilibria(lorenz(10.0), 20.0, [7.0, 7.0, 19.0], within=(2, 30))
    (hopf,) = family.special
    by_sigma = jax.jit(jax.jacrev(lambda s: continuation.differentiable(lorenz(s), hopf)))(10.0)
    # rho = s (s + b + 3) / (s - b - 1), and the frequency's square 2 b s (s + 1) / (s - b - 1).
    s, b = 10.0, 8 / 3
    below = s - b - 1
    exact = ((2 * s + b + 3) * below - s * (s + b + 3)) / below**2
    assert by_sigma.parameter == pytest.approx(exact, abs=1e-12)
    square = 2 * b * s * (s + 1) / below
    slope = 2 * b * ((2 * s + 1) * below - s * (s + 1)) / below**2
    assert by_sigma.frequency == pytest.approx(slope / (2 * np.sqrt(square)), abs=1e-11)


def test_a_point_for_other_numbers_is_refused_or_nan():
    family = jaxdyn.continue_equilibria(cubic(1.5), -1.0, [-1.4], within=(-2, 2), members=20)
    fold = family.special[0]

    def at(q):
        return continuation.differentiable(cubic(q), fold).parameter

    with pytest.raises(ValueError, match="make: expected scenes with the numbers of the point"):
        at(1.6)
    values = jax.vmap(jax.value_and_grad(at))(jnp.array([1.5, 1.6]))
    assert np.isfinite(values).all(axis=0).tolist() == [True, False]


def test_points_without_such_derivatives_are_refused():
    def lorenz(rho):
        return scenes.lorenz(rho=rho)

    family = jaxdyn.continue_equilibria(lorenz, 0.5, [0.0, 0.0, 0.0], within=(0, 2))
    with pytest.raises(ValueError, match="point: expected a fold or a Hopf point, got branch"):
        continuation.differentiable(lorenz, family.special[0])
    with pytest.raises(ValueError, match="an ordinary member"):
        continuation.differentiable(lorenz, family.members[0])
    with pytest.raises(ValueError, match=r"point: expected an Equilibrium, got 3\.0"):
        continuation.differentiable(lorenz, 3.0)
