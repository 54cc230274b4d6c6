"""A ball on a table and an oscillator with a stop, against closed forms."""

import math

import numpy as np
import pytest
from helpers import SOLVED

import jaxdyn
from jaxdyn import scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.integrate import phases
from jaxdyn.integrate.events import Reaches
from jaxdyn.scenes.corners import check_one_phase


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
    scene = scenes.ball_on_table(amplitude=0.0, restitution=0.5, velocity=1.0)
    motion = _motion(scene, 5.0, samples=2, max_phases=8)
    spans = np.diff([0.0, *motion.times])
    np.testing.assert_allclose(spans[1:] / spans[:-1], 0.5, rtol=1e-9)
    assert abs(spans[0] - 2 / 9.81) < SOLVED


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
