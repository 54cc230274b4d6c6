"""The command `orbits section`: crossings as text, JSON, CSV and a picture, and what is refused."""

import csv
import functools
import json

import numpy as np
import pytest


@pytest.fixture
def section(command):
    return functools.partial(command, "orbits", "section")


HENON = ("henon_heiles", "--event", "x=0")


@pytest.mark.slow
def test_two_energies_are_drawn_and_written(section, tmp_path):
    picture, table = tmp_path / "section.png", tmp_path / "section.csv"
    words = ("--energy", "1/12,1/8", "--starts", "y=-0.3:0.9:3", "--crossings", 20)
    code, out, _ = section(*HENON, *words, "--plot", picture, "--csv", table)
    assert code == 0
    assert out.count("40 crossings of 2 starts") == 2
    assert "largest relative change of energy" in out
    assert "1 start: No state with these section coordinates" in out
    assert picture.stat().st_size > 20_000
    first, *rows = csv.reader(table.read_text().splitlines())
    assert first == ["section", "start", "energy", "t", "direction", "x", "y", "vx", "vy"]
    assert len(rows) == 80
    energies = np.array([float(row[2]) for row in rows])
    assert np.abs(energies - np.repeat([1 / 12, 1 / 8], 40)).max() < 1e-15
    assert all(float(row[7]) > 0 for row in rows)


@pytest.mark.slow
def test_a_stroboscope_as_json(section):
    words = ("shaken_pendulum", "--event", "every=2*pi/60", "--starts", "theta=0.1:0.2:2")
    code, out, err = section(*words, "--crossings", 3, "--json")
    assert (code, err) == (0, "")
    (found,) = json.loads(out)["sections"]
    assert found["labels"] == found["coordinates"] == ["theta", "theta_dot"]
    assert [start["count"] for start in found["starts"]] == [3, 3]
    times = np.array(found["starts"][1]["t"])
    assert np.abs(times - np.arange(1, 4) * 2 * np.pi / 60).max() < 1e-12


def test_a_start_with_fewer_crossings_is_said(section):
    code, out, _ = section(*HENON, "--crossings", 3, "--t1", 10)
    assert code == 1
    assert "1 crossing of 1 start" in out
    assert "Raise t1" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--event", "q=0"), "error: --event: expected one of every, vx, vy, x, y, got 'q'."),
        (("--event", "x"), "error: --event: expected NAME=LEVEL, such as x=0"),
        (("--event", "every=0"), "error: period: expected > 0, got 0.0."),
        (("--starts", "y=1:2"), "error: --starts: expected NAME=VALUE or NAME=A:B:N, got 'y=1:2'."),
        (("--starts", "w=1"), "error: --starts: expected one of vx, vy, x, y, got 'w'."),
        (("--starts", "y=0:1:9999999"), "error: --starts: expected at most 100000"),
        (("--sign", "1"), "error: --sign: expected --energy with it, got none."),
        (("--energy", "1/8", "--unknown", "vz"), "error: --unknown: expected one of"),
        (("--energy", "1/8", "--starts", "x=1"), "error: given: expected starts on the section"),
        (("--energy", "much"), "error: --energy: expected comma-separated numbers, got 'much'."),
        (("--coordinates", "y"), "error: --coordinates: expected two different entries, got y."),
        (("--crossings", "0"), "error: --crossings: expected a whole number, at least 1, got 0."),
        (("--direction", "left"), "error: --direction: expected one of both, down, up"),
        (("--csv", "points.txt"), "error: --csv: expected a file name ending in .csv"),
        (("--title", "a"), "error: --title: expected --plot with it"),
    ],
)
def test_misuse_is_one_line_and_exit_code_2(section, words, message):
    code, out, err = section(*HENON, *words)
    assert (code, out) == (2, "")
    assert err.startswith(message)
    assert err.count("\n") == 1
