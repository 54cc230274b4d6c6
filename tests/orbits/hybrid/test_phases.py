"""Orbits of the ready-made scenes with corners, found from their phases."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.integrate import events
from jaxdyn.integrate.phase import Exit, Phase
from orbits.hybrid.phases import Inside, legs_of


def _found(scene, **options):
    return orbits.find_hybrid(scenes.phases_of(scene), scene.y0, **options)


def test_the_simplest_walker_has_its_published_gaits():
    gait = _found(scenes.simplest_walker(slope=0.009))
    np.testing.assert_allclose(gait.y0[0], 0.20031090054424716, atol=1e-14)
    np.testing.assert_allclose(gait.y0[2], -0.19983247300495, atol=1e-13)
    assert gait.path == (("swing", 0),)
    known = orbits.stability(gait)
    assert known.verdict == "stable"
    assert np.abs(known.nontrivial[0].real + 0.190) < 1e-3  # as printed
    assert np.abs(np.abs(known.nontrivial[0].imag) - 0.558) < 1e-3
    # The shorter gait of the same slope has the multipliers 4.00 and 0.459.
    short = orbits.stability(_found(scenes.simplest_walker(slope=0.009, stance=0.193)))
    assert short.verdict == "unstable"
    np.testing.assert_allclose(sorted(short.nontrivial.real)[1:], [0.459, 4.00], atol=5e-3)


@pytest.mark.parametrize(
    ("stance", "rate", "exact"), [(0.96, -1.0, 0.970956), (0.94, -1.02, 0.943976)]
)
def test_its_steps_are_proportional_to_the_cube_root_of_a_small_slope(stance, rate, exact):
    """Garcia et al. (1998): by these factors, for the long and the short gait."""
    slope = 1e-6
    small = slope ** (1 / 3)
    scene = scenes.simplest_walker(slope=slope, stance=stance * small, rate=rate * small)
    assert abs(float(_found(scene).y0[0]) / small - exact) < 1e-4  # of order slope^(2/3)


def test_the_rimless_wheel_has_its_published_fixed_point_and_multiplier():
    roll = _found(scenes.rimless_wheel())
    assert abs(float(roll.y0[1]) - 0.3497543674325097) < 1e-14
    known = orbits.stability(roll)
    assert known.verdict == "stable"
    assert abs(known.nontrivial[0] - 0.5) <= known.bars[0] < 1e-9


def test_a_ball_on_a_table_bounces_once_in_a_period_of_it():
    e = 0.8
    bounce = _found(scenes.ball_on_table(restitution=e, phase=1.2, velocity=3.0))
    period = 2 * math.pi / 10.0
    assert abs(bounce.period - period) < SOLVED
    assert abs(math.cos(float(bounce.y0[2])) - 9.81 * period / 2 * (1 - e) / (1 + e)) < SOLVED
    # In the time and the velocity after an impact, with the acceleration a of the table there.
    a = -(0.1 * 100.0) * math.sin(float(bounce.y0[2]))
    trace = 1 + e * e + (1 + e) ** 2 * a / 9.81
    known = orbits.stability(bounce)
    np.testing.assert_allclose(np.prod(known.nontrivial).real, e * e, rtol=1e-9)
    np.testing.assert_allclose(np.sum(known.nontrivial).real, trace, rtol=1e-9)


def test_two_bounces_in_a_period_are_two_legs():
    scene = scenes.ball_on_table(amplitude=0.13, phase=1.2, velocity=3.4)
    twice = _found(scene, events=2)
    assert len(twice.legs) == 2
    assert abs(twice.period - 4 * math.pi / 10.0) < SOLVED
    assert twice.trajectory(5).names == ("fly", "fly")


def test_an_impact_oscillator_hits_once_in_a_period():
    hit = _found(scenes.impact_oscillator())
    assert abs(hit.period - 2 * math.pi / 2.6) < SOLVED
    # The damper and the stop make areas of positions and velocities smaller.
    known = orbits.stability(hit)
    area = 0.8**2 * math.exp(-0.1 * hit.period)
    np.testing.assert_allclose(np.prod(known.nontrivial).real, area, rtol=1e-9)


def test_the_bounds_of_phases_are_those_of_the_legs():
    scene = scenes.ball_on_table()
    (leg,) = legs_of(scenes.phases_of(scene), (("fly", 0),))
    (bound,) = leg.bounds
    assert isinstance(bound, Inside)
    up, down = (jnp.asarray([h, 0.0, 0.0]) for h in (0.1, -0.1))
    assert bound.value(0.0, up) > 0 > bound.value(0.0, down)
    (leg,) = legs_of(scenes.phases_of(scenes.simplest_walker()), (("swing", 0),))
    assert leg.bounds == ()


def _lasts(t, y):
    return 1.0 + 0.0 * t


def _phase(to="a", **more):
    scene = scenes.cannonball(g=10.0)
    return {"a": Phase(scene, (Exit(events.Reaches(1, 0.0, -1), to, **more),))}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: _found(scenes.ball_on_table(), events=0), "events: expected a whole number"),
        (
            lambda: orbits.find_hybrid(_phase(to="end"), [0.0, 0.0, 1.0, 1.0]),
            "events: expected a number after which the motion is in a again, got 1, after .* end",
        ),
        (
            lambda: orbits.find_hybrid(_phase(to="end"), [0.0, 0.0, 1.0, 1.0], events=2),
            r"y0: expected a start from which 2 phases end within \S+ of time, got one with",
        ),
        (
            lambda: orbits.find_hybrid(_phase(lasts=_lasts), [0.0, 0.0, 1.0, 1.0]),
            "exit 0 of a: expected a change that takes no time, got one that lasts. Write what",
        ),
        (lambda: legs_of(_phase(), (("b", 0),)), "phase: expected"),
        (lambda: legs_of(_phase(), (("a", 1),)), "phase a: expected an exit of number 1, got 1"),
        (lambda: legs_of({"a": 1.0}, (("a", 0),)), "phase a: expected a Phase, got float"),
    ],
)
def test_phases_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_orbits_are_the_same_in_other_units():
    unit = math.sqrt(1e-6 / 2e3)
    roll = _found(scenes.rimless_wheel(length=2e3, g=1e-6, omega=0.4 * unit, t1=5 / unit))
    assert abs(float(roll.y0[1]) / unit - 0.3497543674325097) < 1e-13


def test_the_phases_are_searched_and_not_compiled_again_for_other_numbers():
    traced = []

    class Counted(jaxdyn.integrate.events.Event):
        def value(self, t, y):
            traced.append(1)
            return y[1]

        @property
        def direction(self):
            return -1

    def bounce(t, y):
        return y * jnp.array([1.0, 1.0, 1.0, -1.0])

    def found(g):
        phases = {"fly": Phase(scenes.cannonball(g=g), (Exit(Counted(), "fly", bounce),))}
        return orbits.find_hybrid(phases, [0.0, 0.0, 0.0, 1.0])

    found(10.0)
    count = len(traced)
    assert abs(found(5.0).period - 0.4) < SOLVED
    assert len(traced) == count > 0


def test_the_other_gait_is_found_with_the_first_one_deflated():
    walker = scenes.simplest_walker(slope=0.009)
    long = _found(walker)
    short = _found(walker, strategy=orbits.Deflated([long]))
    assert short.outcome == orbits.Outcome.FOUND
    assert not orbits.same_orbit(long, short)
    np.testing.assert_allclose(float(short.y0[0]), 0.1939373698, atol=1e-9)
    third = _found(walker, strategy=orbits.Deflated([long, short]), throw=False)
    assert third.outcome == orbits.Outcome.NO_OTHER


def test_where_there_is_no_other_that_is_said():
    wheel = scenes.rimless_wheel()
    roll = _found(wheel)
    with pytest.raises(orbits.SearchError, match="No orbit unlike the known ones"):
        _found(wheel, strategy=orbits.Deflated([roll]))


def test_a_search_ends_when_its_time_is_up():
    walker = scenes.simplest_walker(slope=0.009)
    ended = _found(walker, seconds=1e-9, throw=False)
    assert ended.outcome == orbits.Outcome.TIME_LIMIT
    assert ended.iterations == 0
    np.testing.assert_array_equal(ended.y0, walker.y0)
    known = orbits.Deflated([_found(walker)])
    assert _found(walker, seconds=1e-9, strategy=known, throw=False).outcome == ended.outcome
    tried = r"raise seconds=\. Tried: Newton's method on 1 leg\. In .* s of compiling\.$"
    with pytest.raises(orbits.SearchError, match=tried):
        _found(walker, seconds=1e-9)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match=r"^seconds: expected > 0, got"):
            _found(walker, seconds=wrong)


@pytest.mark.parametrize(
    ("known", "message"),
    [
        (lambda: 1.0, "Deflated: expected known chains of legs that close, got float"),
        (lambda: _found(scenes.rimless_wheel()), "Deflated: expected known chains of Scene simpl"),
    ],
)
def test_what_is_no_known_chain_is_refused(known, message):
    with pytest.raises(ValueError, match=message):
        _found(scenes.simplest_walker(), strategy=orbits.Deflated([known()]))


def test_the_argument_of_the_version_before_warns_and_others_are_refused():
    wheel = scenes.rimless_wheel()
    roll = _found(wheel)
    with pytest.warns(DeprecationWarning, match="strategy=orbits.Deflated") as warned:
        _found(wheel, unlike=[roll], throw=False)
    assert warned[0].filename == __file__
    with pytest.raises(ValueError, match=r"strategy: expected orbits.Shooting\(\) or orbits.Defl"):
        _found(wheel, strategy=orbits.Descent())


def test_a_walker_in_other_units_has_the_same_gait_and_verdict():
    # Lengths by 1e9 and times by 1e6: closing compares angles and rates, of sizes 1 and 1e-6.
    plain, time = scenes.simplest_walker(), 1e6
    other = scenes.simplest_walker(length=1e9, g=1e9 / time**2, t1=4.0 * time)
    guess = np.asarray(plain.y0) * [1.0, 1.0, 1 / time, 1 / time]
    one = _found(plain)
    two = orbits.find_hybrid(scenes.phases_of(other), guess)
    assert abs(two.y0[0] - one.y0[0]) < 1e-13
    assert abs(two.period / time - one.period) < 1e-12
    known = [orbits.stability(gait) for gait in (one, two)]
    assert known[0].verdict == known[1].verdict == "stable"
    np.testing.assert_allclose(known[0].multipliers, known[1].multipliers, rtol=0, atol=1e-10)

    def phases(slope):
        walker = scenes.simplest_walker(slope=slope, length=1e9, g=1e9 / time**2, t1=4.0 * time)
        return scenes.phases_of(walker)

    family = orbits.continue_family(two, phases, 0.009, within=(0.0, 0.018))
    doubling = family.special[0]
    assert doubling.kind == orbits.Kind.DOUBLING
    assert abs(doubling.parameter - 0.0150884379) < 1e-9


def test_a_block_that_sticks_to_a_belt_and_slips():
    """Friction is 0.5 at rest and 0.3 in motion; the belt has the speed 0.2."""
    slide = jaxdyn.ode(lambda t, y: [y[1], 0.3 - y[0]], [0.0, 0.0])
    stick = jaxdyn.ode(lambda t, y: [0.2, 0.0], [0.0, 0.2])
    slips = events.When(lambda t, y: y[0] - 0.5)
    stops = events.When(lambda t, y: y[1] - 0.2, direction=1)
    phases = {
        "stick": Phase(stick, (Exit(slips, "slide", lambda t, y: y),)),
        "slide": Phase(slide, (Exit(stops, "stick", lambda t, y: y),)),
    }
    with pytest.raises(ValueError, match=r"got 1, after which it is in slide\. Such as 2"):
        orbits.find_hybrid(phases, [0.3, 0.2], events=1)
    found = orbits.find_hybrid(phases, [0.3, 0.2], events=2)
    np.testing.assert_allclose(found.period, 1.5 * np.pi + 2.0, rtol=1e-13)
