"""The orbit near a scene's own motion: after a transient, and without a guess of the period."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from jaxdyn import scenes

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


def test_a_failed_search_raises_or_says_why():
    """x'' = -x + 0.1 x' has the equilibrium and no orbit: all others spiral outward."""
    scene = jaxdyn.ode(lambda t, y: [y[1], 0.1 * y[1] - y[0]], jnp.array([1.0, 0.0]), t1=20.0)
    with pytest.raises(orbits.SearchError) as raised:
        orbits.search_near(scene, 6.3, hold=["y0"])
    orbit = orbits.search_near(scene, 6.3, hold=["y0"], throw=False)
    assert not orbit.ok
    assert str(raised.value).startswith(orbit.message)


@pytest.mark.slow
def test_a_relaxation_cycle_is_found_in_any_span():
    # An explicit method takes so many steps here that the span was cut to a part of a turn.
    def rate(t, y):
        return [y[1], 100 * (1 - y[0] ** 2) * y[1] - y[0]]

    def rises(t, y):
        return y[0]

    rises.direction = 1
    options = {"method": "Radau", "events": rises, "rtol": 1e-9, "atol": 1e-12}
    passed = solve_ivp(rate, (0, 400), [2.0, 0.0], **options).t_events[0]
    for t1 in (170.0, 400.0):
        cycle = orbits.search_near(jaxdyn.ode(rate, [2.0, 0.0], t1))
        np.testing.assert_allclose(cycle.period, np.diff(passed)[-1], rtol=1e-8)


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


@pytest.mark.slow
@pytest.mark.parametrize("system", ["", "earth-moon"])
def test_the_orbit_near_a_motion_is_the_same_in_any_units(system):
    """A halo orbit, not a planar one as far from the start as that is from the plane."""
    scene = scenes.restricted_three_body_in_space(system=system)
    plain = scenes.restricted_three_body_in_space()
    orbit = orbits.search_near(scene)
    length, time = (float(scene.y0[0] / plain.y0[0]), float(scene.t1 / plain.t1))
    units = np.repeat([length, length / time], 3)
    start, period = np.asarray(orbit.y0) / units, orbit.period / time
    assert np.abs(start - np.asarray(plain.y0)).max() < 0.01
    assert start[2] > 0.02

    def rate(t, y):
        return np.asarray(scene.rate(t * time, y * units)) / units * time

    flow = solve_ivp(rate, (0, period), start, method="DOP853", rtol=1e-12, atol=1e-13)
    assert np.abs(flow.y[:, -1] - start).max() < 1e-8
