"""The commands `orbits response` and `orbits backbone`."""

import functools
import json

import pytest
from numpy.testing import assert_allclose
from scipy.special import ellipk


@pytest.fixture
def response(command):
    words = ("--drive", "x", "--within", "0.5,2", "--step", "0.3")
    return functools.partial(command, "orbits", "response", "oscillator", *words)


@pytest.mark.slow
def test_a_response_is_printed_drawn_and_written(response, tmp_path):
    picture, table = tmp_path / "curve.png", tmp_path / "curve.csv"
    words = ("--set", "c=0.2", "--levels", "1,2", "--plot", picture, "--csv", table)
    code, out, _ = response(*words)
    assert code == 0
    assert "peak" in out
    assert "level 2:" in out
    assert picture.stat().st_size > 10_000
    lines = table.read_text().splitlines()
    assert lines[0] == "level,frequency [rad/s],amplitude [m],phase [rad],verdict,kind"
    code, out, _ = response("--set", "c=0.2", "--output", "vx", "--json")
    found = json.loads(out)
    omega = found["frequency"][0]
    known = omega / abs(1 - omega**2 + 0.2j * omega)
    assert_allclose(found["amplitude"][0], known, rtol=1e-9)


@pytest.mark.slow
def test_a_backbone_is_printed_drawn_and_written(command, tmp_path):
    picture, table = tmp_path / "curve.png", tmp_path / "curve.csv"
    words = ("pendulum", "--set", "g=1", "--within", "0.8,2", "--plot", picture)
    code, out, _ = command("orbits", "backbone", *words, "--csv", table, "--json")
    assert code == 0
    found = json.loads(out)
    amplitude, frequency = (found[name][-1] for name in ("amplitude theta", "frequency"))
    m = (1 - found["energy"][-1] / 2) - 1  # sin(a / 2)^2 = E / (2 m g l)
    assert_allclose(frequency, 3.141592653589793 / (2 * ellipk(-m)), rtol=1e-9)
    assert abs(frequency - 0.8) < 1e-12  # the family ends on its bound
    assert amplitude > 0.6
    assert picture.stat().st_size > 10_000
    assert table.read_text().startswith(
        "frequency [rad/s],energy [J],verdict,amplitude theta [rad]"
    )


def test_what_they_refuse(response, command):
    assert "one amplitude > 0" in response("--levels", "1,-1")[2]
    assert "--output: expected one of" in response("--output", "z")[2]
    assert "isolas: expected a whole number" in response("--isolas=-1")[2]
    backbone = functools.partial(command, "orbits", "backbone", "pendulum")
    assert "two bounds" in backbone("--within", "2,1")[2]
    assert "mode: expected at most 1" in backbone("--mode", 2)[2]
