"""What is known of a scene before an orbit is looked for."""

import math

import jax
import jax.numpy as jnp
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from orbits.closing.given import beside, drive, is_driven


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (scenes.shaken_pendulum(), True),
        (scenes.shaken_pendulum(angle=0.0), True),  # whose rest the drive leaves at rest
        (scenes.pendulum(angle=0.0), False),
        (scenes.three_body(), False),
    ],
)
def test_a_drive_is_seen_at_rest_too(scene, expected):
    assert is_driven(scene) == expected


@pytest.mark.slow
def test_the_rest_of_a_driven_scene_is_an_orbit():
    upright = orbits.find(scenes.shaken_pendulum(angle=0.0), period=2 * math.pi / 60)
    assert upright.ok
    assert orbits.stability(upright).verdict == "stable"


@pytest.mark.parametrize(
    ("hold", "message"),
    [
        (orbits.Energy([]), r"^energy: expected shape \(\), got shape \(0,\)"),
        (orbits.Energy([1.0, 2.0]), r"^energy: expected shape \(\), got shape \(2,\)"),
        (orbits.Period([]), r"^period: expected shape \(\), got shape \(0,\)"),
        (orbits.Period(-1.0), r"^period: expected > 0, got -1"),
        (orbits.Section(0, [1.0, 2.0]), r"^level: expected shape \(\), got shape \(2,\)"),
        (orbits.Section(2, 1.0), r"^entry: expected an entry of the state, 0 to 1, got 2"),
        (orbits.Section("x", 1.0), r"^entry: expected an entry of the state, 0 to 1, got 'x'"),
    ],
)
def test_a_condition_that_is_no_equation_is_refused(hold, message):
    with pytest.raises(ValueError, match=message):
        orbits.find(scenes.oscillator(), period=6.0, hold=hold)


@pytest.mark.parametrize("hold", ["vz", orbits.Section(1, 0.0)])
def test_an_entry_that_the_closing_fixes_cannot_be_held(hold):
    scene = scenes.restricted_three_body_in_space()
    name = "vz" if hold == "vz" else "y"
    message = f"^hold: expected an entry that 'reversal' leaves free: x, z, vy, got '{name}'"
    with pytest.raises(ValueError, match=message):
        orbits.find(scene, closing=orbits.closing.mirror(scene), hold=["z", hold])


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_the_period_of_a_switched_drive_is_seen_between_its_switches(scale):
    def pushed(t, y, p):
        return [y[1], -y[0] + jnp.sign(jnp.sin(p * t + 0.3)) + jnp.where(t > -5.0, 1.0, 0.0)]

    scene = jaxdyn.ode(pushed, [0.0, 0.0], names=["x", "v"], params=2.0 / scale)
    for period, closes in ((math.pi, True), (math.pi * (1 + 1e-6), False), (2 * math.pi, True)):
        off = drive(scene, jnp.asarray(scene.y0), jnp.asarray(scale * period), beside(scene))
        assert (float(jnp.abs(off).max()) < 1e-9) == closes


@pytest.mark.parametrize(("scale", "force"), [(1.0, 1.0), (1e-4, 1e-6)])
def test_a_drive_is_measured_by_how_far_it_varies(scale, force):
    def pushed(t, y):
        return [y[1], -y[0] / scale**2 + force * jnp.cos(t / scale)]

    scene = jaxdyn.ode(pushed, [1e3 * force, 0.0], names=["x", "v"])
    period = jnp.asarray(2 * math.pi * scale)
    away = beside(scene)
    by_radian = scale * jax.jacfwd(lambda period: drive(scene, scene.y0, period, away))(period)
    # The cosine varies by 2, and changes by at most 1 in a radian.
    assert float(jnp.abs(by_radian).max()) == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("start", [[0.0, 0.0], [1e-17, 3e-17], [0.0, 1e-9]])
def test_a_guess_almost_at_rest_is_as_good_as_one_at_rest(start):
    rest = scenes.oscillator(k=9.0, c=0.6, x=0.0).starting(start)
    driven = jaxdyn.vibration.drive(rest, "x", jaxdyn.vibration.Harmonic(1.0, 3.0))
    found = orbits.find(driven, period=2 * math.pi)
    assert found.y0 == pytest.approx([0.0, 1 / 0.6], abs=1e-11)
