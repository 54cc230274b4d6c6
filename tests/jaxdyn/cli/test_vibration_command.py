"""The command `jaxdyn vibration`: modes, a response, and what is refused."""

import csv
import functools
import json
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose


@pytest.fixture
def vibration(command):
    return functools.partial(command, "jaxdyn", "vibration")


def test_modes_about_the_equilibrium_near_the_start(vibration):
    code, out, _ = vibration("oscillator", "--set", "k=4", "--set", "c=0.4", "--json")
    assert code == 0
    found = json.loads(out)
    assert_allclose(found["equilibrium"], [0.0, 0.0], atol=1e-12)
    assert_allclose(found["frequencies"], [2.0], rtol=1e-12)
    assert_allclose(found["damping_ratios"], [0.1], rtol=1e-12)
    assert_allclose(found["shapes"], [[[1.0, 0.0]]], atol=1e-15)
    code, out, _ = vibration("pendulum", "--start", "3,0")
    assert code == 0
    assert "theta = 3.14159" in out  # it falls: a real eigenvalue of either sign
    assert "growth rate" in out
    assert f"-{np.sqrt(9.81):.5f}" in out
    assert "rad/s" in out.partition("damping")[0]
    assert len(re.findall(r"│ [12] +│ +│ +│ +│ -?3\.13209 +│ 1 +│", out)) == 2


def test_a_response_is_drawn_and_written(vibration, tmp_path):
    picture, table = tmp_path / "bode.png", tmp_path / "response.csv"
    words = ("--input", "x", "--within", "1,3", "--samples", 5, "--plot", picture, "--csv", table)
    code, out, _ = vibration("oscillator", "--set", "k=4", "--set", "c=0.4", *words)
    assert code == 0
    assert "largest receptance, x / force on x: 1.25" in out
    assert picture.stat().st_size > 10_000
    with open(table, encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head == ["omega [rad/s]", "x / force on x [m/N]", "phase [rad]"]
    omega, size, phase = np.array(rows, float).T
    assert_allclose(omega, np.geomspace(1, 3, 5), rtol=1e-12)
    assert_allclose(size * np.exp(1j * phase), 1 / (4 - omega**2 + 0.4j * omega), rtol=1e-12)


def test_hertz_is_the_unit_of_all_frequencies(vibration, tmp_path):
    table = tmp_path / "response.csv"
    words = ("--set", "k=4", "--set", "c=0.4", "--input", "x", "--samples", 2, "--csv", table)
    code, out, _ = vibration("oscillator", *words, "--within", "0.1,0.5", "--hertz")
    assert code == 0
    assert f"at {np.sqrt(4 - 0.4**2 / 2) / (2 * np.pi):.4f}" in out
    assert "0.31831" in out  # beside the 2 rad/s of the mode
    with open(table, encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head[0] == "frequency [Hz]"
    frequency, size, _ = np.array(rows, float).T
    assert_allclose(frequency, [0.1, 0.5], rtol=1e-12)
    w = 2 * np.pi * frequency
    assert_allclose(size, np.abs(1 / (4 - w**2 + 0.4j * w)), rtol=1e-12)


def test_the_largest_response_is_that_of_a_narrow_resonance(vibration):
    words = ("--set", "k=100", "--set", "c=2e-4", "--input", "x", "--samples", 5)
    code, out, _ = vibration("oscillator", *words)
    assert code == 0
    largest = 1 / (2e-4 * np.sqrt(100 - 1e-8))
    assert f"x / force on x: {largest:.6g} m/N at 10 rad/s" in out


def test_what_it_refuses(vibration):
    assert "--input: expected a coordinate" in vibration("oscillator", "--output", "x")[2]
    assert "two frequencies > 0" in vibration("oscillator", "--input", "x", "--within", "2,1")[2]
    assert "error: --input: expected" in vibration("oscillator", "--input", "z")[2]
    assert "a state near an equilibrium" in vibration("cannonball")[2]
    code, _, said = vibration("shaken_pendulum")
    assert code == 2
    assert "scene: expected one that does not depend on time, got shaken_pendulum" in said
