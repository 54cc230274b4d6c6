"""A ball on a table and an oscillator with a stop, against closed forms."""

import math

import numpy as np
import pytest
from helpers import SOLVED
from scipy.optimize import brentq

import jaxdyn
from jaxdyn import scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.integrate import phases
from jaxdyn.integrate.events import Reaches
from jaxdyn.scenes.corners import check_one_phase
from jaxdyn.status import Status


def _motion(scene, t1, **options):
    return phases.simulate_phases(scenes.phases_of(scene), None, scene.y0, t1, **options)


def test_a_ball_bounces_once_in_a_period_of_the_table():
    e, height, turn = 0.8, 0.1, 10.0
    period = 2 * math.pi / turn
    phase = math.acos(9.81 * period / 2 * (1 - e) / (1 + e) / (height * turn))
    scene = scenes.ball_on_table(
        restitution=e, amplitude=height, frequency=turn, phase=phase, velocity=9.81 * period / 2
    )
    motion = _motion(scene, 10 * period, samples=2, max_phases=3)
    np.testing.assert_allclose(motion.times, period * np.arange(1, 4), rtol=1e-12)
    off = scene.system.difference(motion.y, scene.y0)
    assert np.abs(off).max() < SOLVED


def test_a_ball_on_a_table_at_rest_comes_to_rest():
    e, g, height = 0.5, 9.81, 1.0
    scene = scenes.ball_on_table(amplitude=0.0, restitution=e).starting([height, 0.0, 0.0])
    motion = _motion(scene, 5.0, samples=2)
    fall = math.sqrt(2 * height / g)
    exact = fall * (1 + 2 * e * (1 - e ** np.arange(20)) / (1 - e))
    np.testing.assert_allclose(motion.times[:20], exact, rtol=1e-12)
    assert motion.names == ("fly",) * 27 + ("rest",)
    start = float(motion.pieces[-1].ts[0])
    assert abs(start - fall * (1 + e) / (1 - e)) < 1e-7
    assert (motion.status, motion.t) == (Status.OK, 5.0)
    assert np.abs(motion.y[:2]).max() == 0


def test_a_ball_at_rest_leaves_a_table_that_falls_faster():
    a, w, g = 0.02, 30.0, 9.81
    scene = scenes.ball_on_table(restitution=0.0, amplitude=a, frequency=w, phase=0.1, velocity=0.1)
    motion = _motion(scene, 0.3, samples=2)
    assert motion.names[:3] == ("rest", "fly", "rest")
    lift, lands = motion.pieces[1].ts[np.array([0, -1])]
    leaves = math.asin(g / (a * w**2))
    assert abs(0.1 + w * lift - leaves) < SOLVED
    y, v = a * math.sin(leaves), a * w * math.cos(leaves)

    def above(t):
        return y + v * t - g * t**2 / 2 - a * math.sin(leaves + w * t)

    assert abs(lands - lift - brentq(above, 0.05, 0.2, xtol=1e-15)) < SOLVED


def test_the_least_bounces_before_a_rest_are_not_said_to_be_below_the_table():
    numbers = {"amplitude": 0.0026, "frequency": 62.83185307, "restitution": 0.5}
    motion = _motion(scenes.ball_on_table(velocity=0.49, phase=1.0, **numbers), 0.7, samples=8)
    assert "rest" in motion.names
    assert motion.warning == ""


@pytest.mark.slow
def test_an_oscillator_rests_on_its_stop_while_it_is_pushed_there():
    # The force is F cos(phase): it pulls from phase pi / 2 on.
    w = 0.2
    scene = scenes.impact_oscillator(k=0.0, c=0.0, restitution=0.3, frequency=w, stop=0.1)
    motion = _motion(scene, 10.0, samples=2)
    i = motion.names.index("rest")
    assert motion.names[i:] == ("rest", "swing")
    assert abs(float(motion.pieces[i].ts[-1]) - math.pi / 2 / w) < SOLVED
    after = float(motion.t) - math.pi / 2 / w
    moved = (math.sin(w * after) / w - after) / w  # twice the integral of -sin(w t)
    assert abs(float(motion.y[0]) - 0.1 - moved) < SOLVED * abs(moved)


def test_an_oscillator_with_a_stop_out_of_reach_is_a_linear_one():
    w, c, force = 2.6, 0.1, 1.3
    gain = force / complex(1 - w * w, c * w)
    scene = scenes.impact_oscillator(
        c=c, force=force, frequency=w, stop=1.0, x=gain.real, velocity=-w * gain.imag
    )
    motion = _motion(scene, 20.0, samples=7)
    exact = [(gain * np.exp(1j * w * t)).real for t in np.linspace(0.0, 20.0, 7)]
    np.testing.assert_allclose(motion.pieces[0].ys[:, 0], exact, atol=1e-11)
    assert not motion.path


def test_an_impact_turns_the_velocity_and_keeps_the_phase():
    scene = scenes.impact_oscillator(stop=0.3, restitution=0.7, velocity=1.0)
    motion = _motion(scene, 5.0, samples=2, max_phases=1)
    before, after = motion.pieces[0].ys[-1], motion.y
    assert abs(float(before[0]) - 0.3) < SOLVED
    np.testing.assert_allclose(after, before * np.array([1.0, -0.7, 1.0]), rtol=SOLVED)


def test_their_energies_are_those_of_what_moves():
    ball = simulate(scenes.ball_on_table(phase=0.3), 0.2)
    assert energy.drift(ball) < 1e-12
    spring = scenes.impact_oscillator(c=0.0, force=0.0, x=-0.4)
    assert energy.drift(simulate(spring, 3.0)) < 1e-12


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: scenes.ball_on_table(restitution=1.1).check(), "restitution: expected between 0"),
        (lambda: scenes.impact_oscillator(restitution=-0.1).check(), "restitution: expected bet"),
        (lambda: scenes.impact_oscillator(m=0.0).check(), "m: expected > 0"),
    ],
)
def test_impacts_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_motion_that_leaves_its_phase_is_refused_where_phases_are_not_followed():
    """The first impact against the crossing of the motion without a stop."""
    scene = scenes.impact_oscillator()
    (hit, *_) = jaxdyn.crossings(scene, Reaches(0, 0.0), 5.0).ts
    assert check_one_phase(scene, float(hit) - 1e-3) is scene
    with pytest.raises(ValueError, match=rf"leaves 'swing' at t = {float(hit):.6g}.*22_walkers"):
        check_one_phase(scene, float(hit) + 1e-3)
    assert check_one_phase(scenes.impact_oscillator(stop=10.0)).name == scene.name
    assert check_one_phase(scenes.pendulum()).name == "pendulum"
