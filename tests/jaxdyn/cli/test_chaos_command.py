"""The command `jaxdyn chaos`: spectra, maps, their pictures, and what it refuses."""

import functools
import json

import numpy as np
import pytest
from PIL import Image

from jaxdyn.chaos import lyapunov_exponents, megno
from jaxdyn.scenes import double_pendulum, lorenz


@pytest.fixture
def chaos(command):
    return functools.partial(command, "jaxdyn", "chaos")


def test_a_spectrum_is_printed_with_its_checks(chaos):
    code, out, _ = chaos("lorenz", "--t1", 200)
    assert code == 0
    assert "exponent 3  -14." in out
    assert "trace" in out
    assert "pairing" not in out  # of an odd number
    code, out, _ = chaos("lorenz", "--t1", 200, "--set", "rho=30", "--json")
    assert code == 0
    found = json.loads(out)
    direct = lyapunov_exponents(lorenz(rho=30.0), 200.0)
    assert found["exponents"] == np.asarray(direct.exponents).tolist()
    assert found["pairing_residual"] is None


@pytest.mark.slow
def test_a_map_over_entries_of_the_start_is_printed_and_drawn(chaos, tmp_path):
    path = tmp_path / "map.png"
    words = ["--map", "theta1=0:pi", "--map", "theta2=0.1:1", "--size", 3, "--t1", 30]
    code, out, _ = chaos("double_pendulum", *words, "--plot", path)
    assert code == 0
    assert "9 motions over theta1 [rad] and theta2 [rad]" in out
    with Image.open(path) as picture:
        assert picture.width > 100
    code, out, _ = chaos("double_pendulum", *words, "--json")
    found = json.loads(out)
    one = megno(double_pendulum(), np.array([np.pi, 0.55, 0.0, 0.0]), 30.0)
    assert found["mean"][2][1] == pytest.approx(float(one.mean), rel=1e-9)
    assert found["first"] == pytest.approx([0, np.pi / 2, np.pi])


@pytest.mark.slow
def test_a_map_over_a_parameter_is_that_of_its_scenes(chaos):
    words = ["--map", "rho=10:30", "--map", "x=1:2", "--size", 2, "--t1", 20, "--json"]
    found = json.loads(chaos("lorenz", *words)[1])
    one = megno(lorenz(rho=30.0), np.array([2.0, 1.0, 1.0]), 20.0)
    assert found["mean"][1][1] == pytest.approx(float(one.mean), rel=1e-9)
    assert found["names"] == ["rho", "x"]


MAP = ("--map", "x=0:1", "--map", "rho=20:30")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--plot", "a.png"), "--plot: expected --map with it"),
        (("--map", "x=0:1"), "--map: expected two of them"),
        (("--map", "x=0", "--map", "y=0:1"), "--map: expected NAME=LOW:HIGH"),
        (("--map", "x=1:1", "--map", "y=0:1"), "--map: expected two different ends"),
        (("--map", "z=0:1", "--map", "row=20:30"), "Did you mean 'rho'?"),
        ((*MAP, "--size", "1"), "size: expected a whole number, at least 2"),
        ((*MAP, "--transient", "1"), "--transient: expected none with --map"),
        (("--transient", "30"), "transient: expected between 0 and the time, 20"),
    ],
)
def test_misuse_is_one_line(chaos, words, message):
    code, _, err = chaos("lorenz", *words)
    assert code == 2
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert message in err


@pytest.mark.parametrize("words", [(), ("--map", "force=0.5:1", "--map", "frequency=2:3")])
def test_motions_through_a_stop_are_refused(chaos, words):
    code, out, err = chaos("impact_oscillator", *words)
    assert (code, out) == (2, "")
    assert "leaves 'swing' at t = 3.24679" in err
