"""The commands `orbits diagram` and `orbits curve`: JSON, pictures, and what is refused."""

import functools
import json

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import mathieu_b

import orbits
from jaxdyn import scenes
from orbits.files import family_files
from orbits.files.family_files import Entry, Listing
from orbits.orbit import Orbit, Outcome


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


@pytest.mark.slow
def test_a_run_is_kept_shown_and_resumed(curve, command, tmp_path):
    path, picture = tmp_path / "hopf.jsonl", tmp_path / "hopf.png"
    words = ("--parameters", "rho,sigma", *WORDS, "--save", path)
    assert curve(*words)[0] == 0
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:4]) + lines[4][:40])  # it was killed in the first curve
    code, out, _ = command("orbits", "show", path, "--json")
    assert code == 0
    (part,) = json.loads(out)["curves"]
    assert part["end"] == "an interruption"
    assert curve(*words)[0] == 0
    assert path.read_text() == "".join(lines)
    code, out, _ = command("orbits", "show", path, "--plot", picture)
    assert "Curve of" in out
    assert picture.stat().st_size > 10_000
    error = curve("--parameters", "rho,beta", *WORDS, "--save", path)[2]
    assert "--save: expected a file of this run, got one with other parameters" in error


PITCHFORK = """
import jaxdyn

def rate(t, y, c):
    return [c["p"] + c["q"] * y[0] - y[0] ** 3]

def pitchfork(p=-0.8, q=1.0):
    return jaxdyn.ode(rate, [-1.3], params={"p": p, "q": q})
"""


def test_a_curve_through_two_special_points_is_followed_once(command, tmp_path):
    """The folds lie on 27 p^2 = 4 q^3, which passes its cusp at 0."""
    file = tmp_path / "scenes.py"
    file.write_text(PITCHFORK)
    bounds = ("--within", "-1,1", "--within2", "-1,2", "--parameters", "p,q")
    code, out, _ = command("orbits", "curve", f"{file}:pitchfork", *bounds)
    assert code == 0
    assert out.count("Curve of") == 2  # in both directions
    assert "the fold at -0.3849 lies on a curve above" in out
    assert "cusp at (0, 0)" in out


#: Effective length and gravity in Mathieu's equation for the upright pendulum.
LENGTH, GRAVITY = 2 / 3, 9.81


@pytest.fixture
def shaken(tmp_path):
    """A family file whose special orbit is the upright pendulum where its period doubles."""
    frequency = 60.0
    wanted = -4 * GRAVITY / (LENGTH * frequency**2)
    q = brentq(lambda q: mathieu_b(1, q) - wanted, 0.5, 1.5)
    scene = scenes.shaken_pendulum(amplitude=q * LENGTH / 2, frequency=frequency)
    scene = scene.starting([0.0, 0.0], 2 * np.pi / frequency)
    orbit = Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)
    entries = [
        Entry(orbit, q * LENGTH / 2, 0.0, "undecided", kind)
        for kind in (None, orbits.Kind.DOUBLING)
    ]
    path = tmp_path / "upright.json"
    family_files.save(path, Listing("amplitude", (entries[0],), (entries[1],), "its bounds"))
    return path


@pytest.mark.slow
def test_special_orbits_of_a_family_file_are_followed(shaken, command):
    words = ("--within", "0,1", "--within2", "50,70", "--members", "4", "--step", "1")
    follow = functools.partial(command, "orbits", "curve", "shaken_pendulum")
    names = ("--parameters", "amplitude,frequency")
    code, out, _ = follow(*names, *words, "--from-orbit", shaken, "--json")
    assert code == 0
    found = json.loads(out)["curves"]
    assert [x["kind"] for x in found] == ["period doubling"] * 2
    amplitude, frequency = np.concatenate([x["parameters"] for x in found]).T
    assert np.ptp(frequency) > 2
    # Upright it is stable up to the characteristic value b_1.
    edge = mathieu_b(1, 2 * amplitude / LENGTH)
    np.testing.assert_allclose(edge, -4 * GRAVITY / (LENGTH * frequency**2), atol=1e-12)


@pytest.mark.slow
def test_orbit_files_that_are_refused(shaken, command, tmp_path):
    words = ("--within", "0,1", "--within2", "50,70")
    follow = functools.partial(command, "orbits", "curve", "shaken_pendulum", *words)
    names = ("--parameters", "amplitude,frequency")
    error = follow(*names, "--from-orbit", shaken, "--kind", "fold")[2]
    assert "--from-orbit: expected a family with a fold, got none" in error
    assert "--kind: expected" in follow(*names, "--from-orbit", shaken, "--kind", "kink")[2]
    assert "none without --from-orbit" in follow(*names, "--kind", "fold")[2]
    error = follow("--parameters", "length,frequency", "--from-orbit", shaken)[2]
    assert "--parameters: expected amplitude, that of the family, as one" in error
    path = tmp_path / "orbit.json"
    orbits.save(path, family_files.load(shaken).members[0].orbit)
    assert "--kind: expected the kind of the orbit" in follow(*names, "--from-orbit", path)[2]
