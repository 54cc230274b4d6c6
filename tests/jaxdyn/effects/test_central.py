"""Central forces: power laws, laws of one's own, and their centres."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, Gauss, Yukawa, gap

from jaxdyn.effects import CentralForce, PowerLaw
from jaxdyn.scene import Points

RNG = np.random.default_rng(3)
T = jnp.asarray(0.3)
R, V = (jnp.asarray(x) for x in RNG.normal(size=(2, 2, 3)))
M = jnp.asarray([1.5, 0.5])
LENGTHS = np.linalg.norm(R, axis=1)


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
