"""The orbit near a scene's own motion: after a transient, and without a guess of the period."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits

_MU = 0.05


def _hopf(t, y):
    """The normal form of the Hopf bifurcation: a cycle of radius sqrt(mu) and period 2 pi."""
    del t
    growth = _MU - y @ y
    return jnp.array([growth * y[0] - y[1], growth * y[1] + y[0]])


def test_a_limit_cycle_is_found_after_the_transient():
    # In its own span the motion stays near the state of rest, which every close return leads to.
    scene = jaxdyn.ode(_hopf, jnp.array([1e-3, 0.0]), t1=10.0)
    cycle = orbits.search_near(scene)
    assert cycle.ok
    np.testing.assert_allclose(cycle.period, 2 * np.pi, rtol=1e-12)
    np.testing.assert_allclose(np.hypot(*cycle.y0), _MU**0.5, rtol=1e-12)


def test_without_a_period_the_message_names_the_search():
    scene = jaxdyn.ode(_hopf, jnp.array([1e-3, 0.0]), t1=10.0)
    with pytest.raises(orbits.SearchError, match=r"own span, 10, is a poor guess.*search_near"):
        orbits.find(scene)
    with pytest.raises(orbits.SearchError) as told:
        orbits.find(scene, period=3.0)
    assert "search_near" not in str(told.value)


@pytest.mark.slow
@pytest.mark.parametrize(("current", "period"), [(3.5, 31.743057496), (2.5, 124.106403807)])
def test_bursts_and_spikes_of_a_neuron(current, period):
    """Hindmarsh and Rose's model; its slow variable takes some 170 units of time to settle."""

    def rate(t, y, p):
        del t
        x, recovery, slow = y
        fast = recovery - x**3 + 3 * x**2 - slow + p
        return jnp.array([fast, 1 - 5 * x**2 - recovery, 0.006 * (4 * (x + 1.6) - slow)])

    scene = jaxdyn.ode(rate, jnp.array([-1.0, 0.0, 3.0]), t1=10.0, params=current)
    cycle = orbits.search_near(scene)
    assert orbits.stability(cycle).verdict == "stable"
    assert orbits.recheck(cycle).closure < 1e-11
    np.testing.assert_allclose(cycle.period, period, rtol=1e-9)


def test_a_driven_motion_settles_on_the_response():
    """A linear oscillator with a weak damper: x = Im(F exp(iwt) / (1 - w^2 + icw))."""

    def rate(t, y):
        return jnp.array([y[1], jnp.sin(1.3 * t) - 0.02 * y[1] - y[0]])

    cycle = orbits.search_near(jaxdyn.ode(rate, jnp.zeros(2), t1=10.0))
    response = 1 / (1 - 1.3**2 + 0.02 * 1.3j)
    np.testing.assert_allclose(cycle.y0, [response.imag, 1.3 * response.real], rtol=1e-12)
