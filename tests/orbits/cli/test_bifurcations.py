"""The commands `orbits diagram` and `orbits curve`: JSON, pictures, and what is refused."""

import functools
import json

import numpy as np
import pytest


@pytest.fixture
def curve(command):
    return functools.partial(command, "orbits", "curve", "lorenz", "--within", "10,40")


WORDS = ("--start", "7,7,19", "--set", "rho=20", "--within2", "8,12")


@pytest.mark.slow
def test_hopf_points_of_lorenz_in_two_parameters(curve, tmp_path):
    picture = tmp_path / "hopf.png"
    words = ("--parameters", "rho,sigma", *WORDS, "--json", "--plot", picture)
    code, out, _ = curve(*words)
    assert code == 0
    found = json.loads(out)["curves"]
    assert [x["kind"] for x in found] == ["Hopf point", "Hopf point"]
    rho, sigma = np.concatenate([x["parameters"] for x in found]).T
    # Sparrow (1982), The Lorenz Equations.
    np.testing.assert_allclose(rho, sigma * (sigma + 17 / 3) / (sigma - 11 / 3), rtol=1e-12)
    assert picture.stat().st_size > 10_000


def test_what_is_refused(curve, command):
    assert "two names" in curve("--parameters", "rho", *WORDS)[2]
    assert "two different numbers" in curve("--parameters", "rho,rho", *WORDS)[2]
    diagram = functools.partial(command, "orbits", "diagram", "lorenz", "--parameter", "rho")
    assert "two bounds, the lower one first" in diagram("--within", "3,1")[2]
