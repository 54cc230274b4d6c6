"""What can be asked of an orbit, asked of chains of legs."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED

import orbits
from jaxdyn import scenes
from jaxdyn.course import eccentric_cylinder as cylinder
from jaxdyn.integrate import events
from orbits.analysis.evidence import growth
from orbits.closing.sizes import sizes


def _found(scene, **options):
    return orbits.find_hybrid(scenes.phases_of(scene), scene.y0, **options)


@pytest.fixture(scope="module")
def gait():
    return _found(scenes.simplest_walker())


@pytest.fixture(scope="module")
def twice():
    return _found(scenes.simplest_walker(), events=2)


def test_another_integrator_confirms_a_gait(gait):
    again = orbits.recheck(gait)
    assert again.closure < 1e-13
    assert again.solver not in (None, "")
    assert again.tolerance < gait.rtol
    assert orbits.analysis.closure(gait) < 1e-13
    assert orbits.analysis.closure(gait, periods=4) < 1e-12  # a stable one: errors do not grow


def test_a_chain_that_was_found_roughly_is_not_confirmed(gait):
    goal = 1e-9
    rough = _found(scenes.simplest_walker(), rtol=1e-7, goal=goal)
    assert rough.residual < goal  # by the integrator that found it
    # A hundred times that of a gait, wherever below its goal the search ended.
    assert orbits.recheck(rough).closure > 1e-11
    assert orbits.digits(rough).y0 < 11


def test_its_digits_are_those_that_are_published(gait):
    known = orbits.digits(gait)
    assert known.y0 > 12
    assert known.period > 12
    off = abs(float(gait.y0[0]) - 0.20031090054424716)
    assert off < 10**-known.y0
    rough = _found(scenes.simplest_walker(), rtol=1e-7, goal=1e-9)
    off = np.abs(np.asarray(rough.y0 - gait.y0) / sizes(gait.legs[0].scene)).max()
    np.testing.assert_allclose(off, 10 ** -orbits.digits(rough).y0, rtol=0.1)


def test_several_periods_count_their_errors_together():
    """A closing that leaves out the position, or counts turns, is that of each period."""
    roll = _found(scenes.ball_on_table(phase=1.2, velocity=3.0))
    off = dataclasses.replace(
        roll, legs=(dataclasses.replace(roll.legs[0], scene=_later(roll.legs[0].scene)),)
    )
    assert orbits.analysis.closure(roll, periods=3) < 1e-12
    assert orbits.analysis.closure(off, periods=3) > 1e-5


def _later(scene):
    return scene.starting(scene.y0 * (1 + 1e-5))


def test_growth_is_that_of_the_return_map(gait):
    m = orbits.stability(gait).monodromy
    np.testing.assert_allclose(growth(gait), np.linalg.norm(m), rtol=1e-9)


def test_a_gait_of_two_equal_steps_is_one_of_one(gait, twice):
    period, times = orbits.minimal_period(twice)
    assert times == 2
    assert abs(period - gait.period) < SOLVED
    assert orbits.minimal_period(gait) == (gait.period, 1)


def test_a_leg_without_an_event_may_repeat_itself():
    spring = scenes.oscillator(k=4.0)
    twice = orbits.find_hybrid([orbits.Leg(spring, ())], [1.0, 0.0], [6.2])
    period, times = orbits.minimal_period(twice)
    assert times == 2
    assert abs(period - math.pi) < 1e-11


def _bounce(t, y):
    return y * jnp.array([1.0, 1.0, 1.0, -1.0])


def _loses(t, y):
    return y * jnp.array([1.0, 1.0, 1.0, -0.5])


def _lifted(t, y):
    return y.at[1].set(5.0)


def _forwards(end, start):
    return (end - start)[1:]


def _ball(x=0.0, floor=0.0, top=5.0, v=0.0, closes=None):
    ball = scenes.cannonball(g=10.0)
    falls = orbits.Leg(ball, (events.Reaches(1, floor),), _bounce)
    rises = orbits.Leg(ball, (events.Reaches(3, 0.0), events.Reaches(1, top)))
    return orbits.find_hybrid([falls, rises], [x, top - 0.2, v, 0.0], [1.0, 1.0], closes=closes)


def test_chains_that_begin_elsewhere_are_the_same(gait, twice):
    assert orbits.same_orbit(gait, twice)
    assert orbits.analysis.same.match(gait, twice).distance < 1e-11
    down = _ball()
    falls, rises = down.legs
    up = orbits.find_hybrid(
        [dataclasses.replace(rises, ends=(events.Reaches(3, 0.0),)), falls],
        [0.0, 0.0, 0.0, 10.0],
        [1.0, 1.0],
    )
    found = orbits.analysis.same.match(down, up)
    assert found.distance < 1e-11
    assert abs(found.shift - 1.0) < 1e-9
    assert orbits.same_orbit(down, up)
    assert not orbits.same_orbit(down, _ball(top=4.0))


def test_what_a_closing_leaves_out_does_not_tell_chains_apart():
    one, other = (_ball(x=x, v=1.0, closes=_forwards) for x in (0.0, 3.0))
    assert orbits.same_orbit(one, other)
    assert not orbits.same_orbit(_ball(x=0.0), _ball(x=3.0))


def test_an_orbit_is_no_chain(gait):
    swing = orbits.find(scenes.pendulum(), period=2.2)
    assert orbits.analysis.same.match(gait, swing) is None
    assert not orbits.same_orbit(gait, _found(scenes.rimless_wheel()))


def test_energy_is_an_invariant_only_if_impacts_keep_it():
    what = orbits.identify(_ball())
    assert abs(what.energy - 50.0) < 1e-10
    assert what.choreography is None
    assert what.scale_free is None
    ball = scenes.cannonball(g=10.0)
    falls = orbits.Leg(ball, (events.Reaches(1, 0.0),), _loses)
    rises = orbits.Leg(ball, (events.Reaches(3, 0.0),), _lifted)
    lossy = orbits.find_hybrid([falls, rises], [0.0, 5.0, 0.0, 0.0], [1.0, 0.5])
    assert orbits.identify(lossy).energy is None


def test_a_report_has_all_of_it(gait):
    known = orbits.report(gait)
    assert known.outcome == "FOUND"
    assert known.verdict == "stable"
    assert known.minimal_period == gait.period
    assert known.recheck.closure < 1e-13
    assert known.return_error < 1e-11  # over five periods
    assert known.word is None
    assert orbits.analysis.report.as_json(known)["choreography"] is None


@pytest.mark.slow
def test_a_grazing_chain_has_a_report_without_multipliers():
    hop = cylinder.hop(scenes.cylinder_on_ramp(slope=0.0))
    known = orbits.report(hop)
    assert math.isnan(known.growth)
    assert known.verdict == "undecided"
    assert np.isnan(np.array(known.multipliers)[:, 0]).all()
    assert abs(known.energy - orbits.identify(hop).energy) < 1e-12
    assert known.recheck.closure < 1e-11
