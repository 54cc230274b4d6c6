"""The multipliers of chains of legs against closed forms."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.course import eccentric_cylinder as cylinder
from jaxdyn.integrate import events
from orbits.analysis import chain, stability

_E, _OMEGA = 0.6, 2.9  # restitution; angular frequency of the drive [rad/s]


def _no_offset(end, start):
    """Heights and speeds return; the ball advances."""
    return (end - start)[1:]


def _keeps(t, y):
    return y * jnp.array([1.0, 1.0, 1.0, -1.0])


def _impact_rate(t, y):
    return jnp.stack([y[1], -y[0] + jnp.cos(y[2]), jnp.full((), _OMEGA)])


def _rebounds(t, y):
    return y * jnp.array([1.0, -_E, 1.0])


def _a_turn(end, start):
    return end - start - jnp.array([0.0, 0.0, 2 * jnp.pi])


def _impact_closed_form():
    """(start, span, trace, determinant) of x'' + x = cos(w t), wall at x = 0, one impact a period.

    With T = 2 pi / w, x = A cos t + B sin t + G cos(w t + p), G = 1 / (1 - w^2), speed v after.
    """
    span, gain = 2 * np.pi / _OMEGA, 1 / (1 - _OMEGA**2)
    c, s = np.cos(span), np.sin(span)
    # x(0) = x(T) = 0: A = -G cos p, A c + B s = A.
    # v = B - G w sin p, -v / e = -A s + B c - G w sin p.
    b_of_a = (1 - c) / s
    # with A = 1: u = G w sin p; b - u = -e (-s + b c - u)
    u = (b_of_a + _E * (b_of_a * c - s)) / (1 + _E)
    a = abs(gain) / np.hypot(1.0, u / _OMEGA)
    a = a if b_of_a - u > 0 else -a
    phase = np.arctan2(a * u / (gain * _OMEGA), -a / gain)
    return np.array([0.0, a * (b_of_a - u), phase]), span


def test_an_impact_oscillator_has_the_multipliers_of_its_closed_form():
    start, span = _impact_closed_form()
    scene = jaxdyn.ode(_impact_rate, start, span)
    leg = orbits.Leg(scene, (events.Reaches(0, 0.0),), _rebounds)
    found = orbits.find_hybrid([leg], start, [span], closes=_a_turn)
    np.testing.assert_allclose(found.y0, start, atol=1e-9)
    got = orbits.stability(found)
    # A neighbour ahead by dx meets the wall later, by dt = -dx / v-, and is then faster by
    # -(1 + e) a dt.
    c, s, v = np.cos(span), np.sin(span), -start[1] / _E
    pull = np.cos(start[2])
    salted = np.array([[-_E, 0.0], [(1 + _E) * pull / v, -_E]])
    expected = np.linalg.eigvals(salted @ np.array([[c, s], [-s, c]]))
    nontrivial = got.nontrivial
    assert got.reasons == ("flow",)
    for value in expected:
        i = int(np.argmin(abs(nontrivial - value)))
        assert abs(nontrivial[i] - value) <= got.bars[i] < 1e-6
    np.testing.assert_allclose(np.prod(nontrivial).real, _E**2, rtol=1e-8)


def _ball(closes):
    falls = orbits.Leg(scenes.cannonball(g=10.0), (events.Reaches(1, 0.0),), _keeps)
    rises = orbits.Leg(scenes.cannonball(g=10.0), (events.Reaches(3, 0.0), events.Reaches(1, 5.0)))
    return orbits.find_hybrid([falls, rises], [0.0, 4.0, 0.0, 0.0], [0.8, 0.9], closes=closes)


def test_a_position_left_out_counts_as_a_unit_multiplier():
    got = orbits.stability(_ball(_no_offset))
    assert got.reasons == ("flow", "advance")
    assert got.unit == 2
    assert got.verdict == "undecided"  # a free ball drifts, and keeps its energy
    np.testing.assert_allclose(got.multipliers, 1.0, atol=1e-6)


def test_directions_to_other_orbits_are_refused_for_a_chain():
    with pytest.raises(ValueError, match=r"along.*None for a chain of legs"):
        orbits.stability(_ball(None), along=np.eye(4)[:, :1])


@pytest.mark.slow
def test_a_grazing_chain_is_refused():
    with pytest.raises(ValueError, match="an event that is crossed"):
        orbits.stability(cylinder.hop(scenes.cylinder_on_ramp(slope=0.0)))


def test_a_chain_that_was_not_found_is_refused():
    found = dataclasses.replace(_ball(None), outcome=orbits.Outcome.ITERATION_LIMIT)
    with pytest.raises(ValueError, match=r"a chain that was found.*ITERATION_LIMIT"):
        orbits.stability(found)


def _half(end, start):
    return jnp.stack([start[3], end[3], end[0]])


def test_a_closing_that_is_no_return_is_refused():
    with pytest.raises(ValueError, match="the motion repeats itself"):
        orbits.stability(_ball(_half))


def _walker_rate(t, y, p):
    """The simplest walker: Garcia, Chatterjee, Ruina, Coleman, J. Biomech. Eng. 120 (1998) 281."""
    stance, swing, stance_rate, swing_rate = y
    pull = jnp.sin(stance - p[0])
    fall = stance_rate**2 * jnp.sin(swing) - jnp.cos(stance - p[0]) * jnp.sin(swing)
    return [stance_rate, swing_rate, pull, pull + fall]


class _Strikes(events.Event):
    """The swing foot is on the slope."""

    def value(self, t, y):
        return y[1] - 2 * y[0]


def _changes_feet(t, y):
    stance, _, rate, _ = y
    c = jnp.cos(2 * stance)
    return jnp.stack([-stance, -2 * stance, c * rate, c * (1 - c) * rate])


def _walks(slope, stance, rate):
    c = np.cos(2 * stance)
    start = [stance, 2 * stance, rate, (1 - c) * rate]
    scene = jaxdyn.ode(_walker_rate, start, 3.9, params=[slope])
    return orbits.find_hybrid([orbits.Leg(scene, (_Strikes(),), _changes_feet)], start, [3.85])


def test_the_simplest_walker_has_its_published_gait():
    gait = _walks(0.009, 0.2, -0.2)
    np.testing.assert_allclose(gait.y0[0], 0.20031090054424716, atol=1e-9)
    np.testing.assert_allclose(gait.y0[2], -0.19983247300495, atol=1e-9)
    got = orbits.stability(gait)
    assert got.verdict == "stable"
    assert got.reasons == ("flow",)
    assert abs(got.nontrivial).min() <= 1e-6  # a step forgets the rate of the swing leg


def test_the_simplest_walker_doubles_its_period_at_the_published_slope():
    got = orbits.stability(_walks(0.0150884379, 0.237, -0.23))
    assert abs(got.nontrivial + 1).min() < 1e-6


def test_constrained_states_are_refused():
    chain = dataclasses.replace(_ball(None), legs=(orbits.Leg(scenes.top(), ()),))
    with pytest.raises(ValueError, match="free coordinates, got constrained ones"):
        orbits.stability(chain)


def test_a_chain_whose_functions_have_changed_is_refused():
    pull = [1.0]

    class Fades(events.Event):
        def value(self, t, y):
            return y[1] * pull[0]

    falls, rises = _ball(None).legs
    chain = dataclasses.replace(
        _ball(None), legs=(dataclasses.replace(falls, ends=(Fades(),)), rises)
    )
    pull[0] = 2.0
    with pytest.raises(ValueError, match="pull"):
        orbits.stability(chain)


def test_a_chain_whose_map_is_no_number_has_no_multipliers(monkeypatch):
    def lost(orbit, rtol):
        found = chain.return_map(orbit, rtol)
        return found._replace(m=np.full_like(found.m, np.nan))

    ball = _ball(_no_offset)
    monkeypatch.setattr(stability, "return_map", lost)
    with pytest.raises(jaxdyn.IntegrationError, match="map of the chain is not finite"):
        orbits.stability(ball)
    found = orbits.stability(ball, throw=False)
    assert np.isnan(found.nontrivial).all()
