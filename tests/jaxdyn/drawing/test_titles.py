"""Titles: the scene's name and its numbers, or what several scenes share."""

import dataclasses
import re

import jax
import numpy as np
import pytest

import jaxdyn
from jaxdyn import Scene, drawing, scenes, simulate, vibration
from jaxdyn.drawing.titles import describe, readable
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.formulations.xpp import Maker
from jaxdyn.scenes import catalogue


def test_a_title_has_the_name_and_the_numbers():
    assert describe(scenes.box()) == "box (m = 1, moments = (0.4167, 0.8333, 1.083))"
    two = describe(scenes.double_pendulum(g=1.0))
    assert two == "double_pendulum (m = (1, 1), l = (1, 1)), uniform gravity (g = 1)"
    assert describe(scenes.three_body()).endswith("pair gravity (G = 1)")
    unnamed = Scene(FreePoints(2.0), (UniformGravity(),), y0=np.zeros(4))
    assert describe(unnamed) == "Free points (m = 2), uniform gravity (g = 9.81)"


@pytest.mark.parametrize("name", catalogue.entries())
def test_every_scene_has_its_name_and_numbers_in_its_title(name):
    scene = catalogue.entries()[name].make()
    if jax.tree.leaves((scene.system, scene.effects)):
        assert re.match(rf"{name} \(\w+ = ", describe(scene))
    else:  # Hill's problem has none
        assert describe(scene) == name
    assert describe(scene.starting(2 * scene.y0)) == describe(scene)


def test_a_title_of_several_scenes_has_what_they_share():
    slow, fast = scenes.shaken_pendulum(frequency=10.0), scenes.shaken_pendulum(frequency=20.0)
    both = describe(slow, fast)
    assert both.startswith("shaken_pendulum (m = 1, l = 1, amplitude = 0.1), uniform")
    other = describe(scenes.pendulum(), scenes.double_pendulum(g=1.0), scenes.pendulum(m=2.0))
    assert other == "pendulum and double_pendulum, uniform gravity"
    near = describe(scenes.pendulum(length=2.0), scenes.pendulum(length=2.00001))
    assert near == "pendulum (m = 1), uniform gravity (g = 9.81)"


def test_a_name_is_no_formula():
    scene = dataclasses.replace(scenes.cannonball(), name="$_^$")
    drawing.trajectory(simulate(scene, samples=3))._repr_png_()


@pytest.mark.parametrize("title", ["costs 5$ and $\\frac{$", "$x^2$", "plain", None])
def test_dollar_signs_of_a_title_are_drawn_where_they_are_no_formula(title):
    shown = readable(title)
    plain = title or ""
    assert shown == (plain.replace("$", r"\$") if "frac" in plain else plain)
    figure = drawing.time_series(simulate(scenes.oscillator()), title=title).figure
    figure.draw_without_rendering()


def test_parameters_of_a_text_are_named():
    swing = Maker("par k=4, c=0.1; x'=v; v'=-k*x-c*v", name="swing")
    assert describe(swing()) == "swing (k = 4, c = 0.1)"
    assert describe(swing(), swing(k=3.0)) == "swing (c = 0.1)"
    assert "Written(k = 4, c = 0.1)" in repr(swing())


@pytest.mark.parametrize(
    ("given", "signal", "title"),
    [
        ("x", vibration.Harmonic(0.5, 2.0), "harmonic force on x (amplitude = 0.5, omega = 2)"),
        ("x", vibration.Step(0.5, t_on=1.0), "step force on x (height = 0.5, t_on = 1)"),
        (vibration.Base([1.0]), vibration.Step(0.5), "step base (direction = 1, height = 0.5)"),
    ],
)
def test_a_drive_is_named_behind_what_it_drives(given, signal, title):
    scene = vibration.drive(scenes.oscillator(k=4.0, c=0.2), given, signal)
    assert describe(scene) == f"oscillator (m = 1), spring (k = 4), linear drag (c = 0.2), {title}"


def test_numbers_that_are_zero_by_default_are_left_out():
    assert describe(scenes.oscillator(k=0.0)) == "oscillator (m = 1), spring (k = 0)"
    assert "phase = 1" in describe(scenes.shaken_pendulum(phase=1.0))
    assert "phase" not in describe(scenes.shaken_pendulum(phase=0.0))


def test_one_number_of_an_ode_has_the_name_that_its_rate_gives_it():
    def roessler(t, y, c):
        return [-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - c)]

    scene = jaxdyn.ode(roessler, [1.0, 0.0, 0.0], params=5.7)
    assert describe(scene) == "roessler (c = 5.7)"
    assert "c = 5.7" in repr(scene)
    several = jaxdyn.ode(lambda t, y, p: [-p[0] * y[0]], [1.0], params=[1.0, 2.0], name="decay")
    assert describe(several) == "decay"
