"""Digits of a last state that are certain, against motions known in many digits."""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdyn import energy_change, scenes, simulate
from jaxdyn.accuracy.end_error import EndError, end_error, perturb
from jaxdyn.hard.cases import chaos
from jaxdyn.integrate.errors import gaps
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.scenes import catalogue


def runner(t1, **options):
    def again(scene, rtol):
        return simulate(scene, t1, samples=2, rtol=rtol, throw=False, **options)

    return again


def unwanted(scene, rtol):
    raise AssertionError("nothing more can be learnt by running it again")


def as_entry(name, **numbers):
    """A scene of the zoo, and how `jaxdyn run` makes its motions."""
    entry = catalogue.entries()[name]
    return entry.make(**numbers), lambda scene, rtol: entry.motion(scene, samples=3, rtol=rtol)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
def test_written_digits_of_a_chaotic_motion_are_right(rtol):
    ts, exact = chaos.reference("double")
    again = runner(ts[-1])
    scene, left = scenes.double_pendulum(), []
    for i in range(len(ts) // 8, len(ts), len(ts) // 8):
        again = runner(ts[i])
        found = end_error(again(scene, rtol), again, rtol=rtol)
        true = np.abs(gaps(scene, found.y[None], exact[i][None]))[0]
        known = found.error < 0.01 * found.scale
        assert (true[known] < 5 * found.error[known] + 1e-15).all()
        for text, value in zip(np.array(found.written())[known], exact[i][known], strict=True):
            digits = len(text.strip("-").partition("e")[0].replace(".", "").lstrip("0"))
            assert abs(float(text) - value) <= 1.01 * 10.0 ** (1 - digits) * abs(value)
        left.append(found.least)
    assert left[0] > 5
    assert left[-1] < 1  # after 60 s nothing is left
    assert "no digit left (+-" in found.written()[1]


def test_an_entry_that_agrees_by_chance_with_a_lost_motion_has_no_digit():
    motion = simulate(scenes.lorenz(), 1.0, samples=2, rtol=1e-6)
    tried = []

    def lost(scene, rtol):
        """A motion far away, except for the first entry at a thousandth of the tolerance."""
        tried.append(rtol)
        off = np.array([0.0 if rtol < 1.5e-9 else 3.0, 5.0, -5.0])
        return eqx.tree_at(lambda m: m.ys, motion, motion.ys.at[-1].add(off))

    found = end_error(motion, lost, rtol=1e-6)
    assert found.error[0] == 3.0
    assert found.written()[0].startswith("no digit left")
    np.testing.assert_allclose(tried, 1e-9 * np.array([1.0, 1.0, 2.0, 4.0, 8.0, 16.0]))


def test_motions_that_stay_together_are_compared_with_two():
    tried, again = [], runner(1.0)

    def counted(scene, rtol):
        tried.append(rtol)
        return again(scene, rtol)

    end_error(again(scenes.lorenz(), 1e-6), counted, rtol=1e-6)
    assert len(tried) == 2


def test_no_digit_of_noise_is_written():
    again = runner(60.0)
    found = end_error(again(scenes.lorenz(), 1e-10), again)
    assert all(text.startswith("no digit left (+-") for text in found.written())
    assert found.least == found.most == 0.0
    assert (found.digits == 0).all()
    assert found.message.startswith("No digit is certain: rounding alone moves this end")


def test_a_tighter_tolerance_is_known_to_help_or_not():
    again = runner(20.0)
    found = end_error(again(scenes.lorenz(), 1e-6), again, rtol=1e-6)
    assert found.least < 6 < found.most
    assert found.message.endswith(f"a smaller rtol gives up to {found.most:.1f}.")
    finest = end_error(again(scenes.lorenz(), 1e-15), again, rtol=1e-15)
    assert abs(finest.least - finest.most) < 1
    assert finest.message.endswith("; no tolerance gives more.")
    assert finest.least > found.least + 3


@pytest.mark.slow
def test_a_chain_of_phases_is_judged_at_its_end():
    scene, again = as_entry("car")
    found = end_error(again(scene, 1e-8), again, rtol=1e-8)
    exact = again(scene, 1e-14)
    assert isinstance(exact, HybridTrajectory)
    true = np.abs(found.y - np.asarray(exact.y if exact.ended else exact.pieces[-1].ys[-1]))
    assert (true < 5 * found.error + 1e-14).all()
    assert found.least > 6
    assert true.max() > found.error.max() / 5


@pytest.mark.slow
def test_other_phases_leave_nothing_certain():
    scene, again = as_entry("cylinder_on_cylinder")
    motion = again(scene, 1e-10)
    other = HybridTrajectory(
        ("fly",), motion.pieces[-1:], motion.t, motion.y, motion.ended, motion.status
    )
    found = end_error(motion, lambda scene, rtol: other)
    assert set(found.written()) == {"unknown"}
    assert np.isnan(found.least)
    assert "through other phases" in found.message
    assert np.isnan(found.digits).all()


def test_what_was_not_reached_is_not_written():
    found = end_error(runner(1.0, max_steps=3)(scenes.lorenz(), 1e-10), unwanted)
    assert set(found.written()) == {"not reached"}


@pytest.mark.slow
def test_a_motion_at_rest_has_its_digits():
    # Velocities that are nothing but rounding have no size by which digits could be lost.
    scene, again = as_entry("four_bar", length=(2.0, 2.0, 2.0), angle=0.0)
    found = end_error(again(scene, 1e-10), again)
    labels = [name for name, _ in scene.labels()]
    written = dict(zip(labels, found.written(), strict=True))
    assert re.fullmatch(r"0( \(\+-\d+e-1\d\))?", written["x1_dot"])
    assert found.least > 9


@pytest.mark.slow
def test_what_has_died_away_is_measured_by_what_it_was():
    again = runner(100.0)
    found = end_error(again(scenes.oscillator(c=1.0), 1e-6), again, rtol=1e-6)
    np.testing.assert_allclose(found.scale, [1.0, 0.01], rtol=1e-5)
    assert found.least > 5  # an absolute error of 6e-8, of a rate of 1/100 s
    small = scenes.oscillator(c=1.0).starting([1e-3, 0.0])
    scale = end_error(again(small, 1e-10), again).scale
    np.testing.assert_allclose(scale, [1e-3, 1e-5], rtol=1e-5)


def test_a_batch_is_refused():
    motion = simulate(scenes.oscillator(), samples=3)
    batch = jax.tree.map(lambda x: jnp.stack([x, x]), motion)
    with pytest.raises(ValueError, match="motion: expected one motion"):
        end_error(batch, runner(1.0))


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (123.456789, 1e-4, "123.457"),
        (9.99999, 1e-3, "10"),
        (-1.5, 0.0, "-1.5"),
        (1e-17, 3e-17, "0 (+-3e-17)"),
        (1.5, 40.0, "no digit left (+-4e+01)"),
        (1 / 3, 1e-18, "0.333333333333"),
        (1.5, np.nan, "unknown"),
        (0.0, 2.0, "no digit left (+-2e+00)"),
        (0.0, 0.0, "0"),
    ],
)
def test_digits_are_written_as_long_as_they_are_sure(value, error, text):
    y, one = np.array([value]), np.ones(1)
    assert EndError(y, error * one, error * one, one).written() == (text,)


@pytest.mark.parametrize("name", ["car", "three_body", "cylinder_on_cylinder", "lorenz"])
def test_a_changed_scene_runs_by_the_same_program(name):
    scene = catalogue.entries()[name].make()
    other = perturb(scene, 1e-9, np.random.default_rng(0))
    kinds, others = ([jax.typeof(x) for x in jax.tree.leaves(s.field)] for s in (scene, other))
    assert [(k, k.weak_type) for k in kinds] == [(k, k.weak_type) for k in others]


def test_an_angle_whose_turns_are_lost_has_no_digit():
    y, error, size = np.array([-73.7, -73.7]), np.array([1.1, 1e-3]), np.array([np.pi, np.pi])
    found = EndError(y, error, 0.0 * error, size).written()
    assert found == ("no digit left (+-1e+00)", "-73.7")


def test_the_end_and_the_change_of_the_energy_are_judged_outside_of_traces():
    def motion(k):
        return simulate(scenes.oscillator(k=k), 1.0, samples=3)

    for judge in (lambda motion: end_error(motion, simulate).error, energy_change):
        with pytest.raises(ValueError, match=r"^motion: .*traced by jit.* Call it outside of jit"):
            jax.jit(lambda k, judge=judge: judge(motion(k)))(1.0)
