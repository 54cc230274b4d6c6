"""`orbits find`: any scene's orbit, what is claimed of it, and what it says where there is none."""

import functools
import json
import re

import numpy as np
import pytest
import typer
from rich.console import Console
from scipy.special import ellipk

from jaxdyn import scenes
from orbits import PLAIN, find, save
from orbits.analysis.identity import identify
from orbits.analysis.report import report
from orbits.cli import figure_eight as figure_eight_module
from orbits.cli import find as find_module
from orbits.cli.app import app
from orbits.cli.bifurcations import family as family_module
from orbits.cli.printed import print_reports
from orbits.families import continuation
from orbits.files import family_files
from orbits.orbit import Orbit, Outcome


def period_of(energy: float, length: float = 1.0) -> float:
    """The period 4 sqrt(l / g) K(sin^2(largest angle / 2)) of a pendulum of mass 1."""
    return 4 * np.sqrt(length / 9.81) * ellipk((1 + energy / (9.81 * length)) / 2)


@pytest.fixture
def orbits(command):
    return functools.partial(command, "orbits")


@pytest.mark.slow
def test_a_pendulum_from_its_own_return_saved_and_verified(orbits, tmp_path):
    path, picture = tmp_path / "swing.json", tmp_path / "swing.png"
    words = ("find", "pendulum", "--set", "angle=2", "--set", "t1=6", "--json")
    code, out, err = orbits(*words, "--save", path, "--plot", picture)
    assert code == 0, err
    found = json.loads(out)
    assert abs(found["period"] - period_of(found["energy"])) < 1e-12
    assert found["minimal_period"] == found["period"]
    # The member of the family that was set, not one beside it.
    assert abs(found["energy"] + 9.81 * np.cos(2.0)) < 1e-12
    assert found["start_moved"] < 1e-12
    nothing = ("choreography", "permutation_error", "word", "scale_free", "normal_form")
    assert [found[key] for key in (*nothing, "angular_momentum")] == [None] * 6
    assert found["closure"] < 1e-12
    assert picture.stat().st_size > 10_000
    code, out, _ = orbits("verify", path)
    assert code == 0
    assert "every claim of the file holds" in out
    assert "choreography" not in out  # rows that say nothing are left out


@pytest.mark.slow
def test_another_orbit_than_that_of_a_file(orbits, tmp_path):
    path = tmp_path / "loop.json"
    words = ("find", "henon_heiles", "--set", "vx=0.4", "--period", "6.5", "--energy", "0.125")
    code, out, err = orbits(*words, "--json", "--save", path)
    assert code == 0, err
    code, other, err = orbits(*words, "--json", "--unlike", path)
    assert code == 0, err
    periods = [round(json.loads(text)["period"], 4) for text in (out, other)]
    assert periods == [6.0756, 7.5433]
    code, _, err = orbits("find", "lorenz", "--period", "2", "--unlike", path)
    assert code == 2
    assert "--unlike: expected known orbits of lorenz, of x, y, z, got henon_heiles" in err


@pytest.mark.slow
@pytest.mark.parametrize("k", [1e24, 1e-24])
def test_a_period_is_found_in_any_units(orbits, k):
    # The scene's own span is of 10^11 periods of the first, and a 10^13th of one of the second.
    code, out, err = orbits("find", "oscillator", "--set", f"k={k}", "--json")
    assert code == 0, err
    assert abs(json.loads(out)["period"] * np.sqrt(k) / (2 * np.pi) - 1) < 1e-13


@pytest.mark.slow
def test_the_period_of_a_drive_is_taken(orbits):
    words = ("shaken_pendulum", "--set", "frequency=50", "--json")
    code, out, err = orbits("find", *words)
    assert code == 0, err
    assert abs(json.loads(out)["period"] - 2 * np.pi / 50) < 1e-15


def test_each_way_to_fail_has_a_remedy_among_the_options():
    assert find_module._REMEDIES.keys() < {x.name for x in Outcome if x != Outcome.FOUND}
    options = {option for command in ("find", "family") for option in _options(command)}
    remedies = [find_module._ELSEWHERE, *find_module._REMEDIES.values(), family_module._REMEDY]
    for remedy in remedies:
        named = set(re.findall(r"--[a-z-]+", remedy))
        assert named <= options, remedy
        assert named or "In Python" in remedy
    assert set(re.findall(r"--[a-z-]+", figure_eight_module._REMEDY)) <= _options("figure-eight")


def _options(command: str) -> set[str]:
    found = typer.main.get_command(app).commands[command]  # pyright: ignore
    return {name for each in found.params for name in (*each.opts, *each.secondary_opts)}


def test_no_orbit_is_exit_code_1_with_the_reason(orbits):
    code, out, err = orbits("find", "cannonball", "--period", "1", "--json")
    assert code == 1
    answer = json.loads(out)
    assert answer["outcome"] != "FOUND"
    assert answer["message"] in err
    assert "--period" in answer["message"]
    assert "max_iterations" not in answer["message"]
    assert answer["best_iterate"]["largest_error"] > 0
    assert "symmetric" not in err


def test_no_orbit_from_a_symmetric_start_suggests_its_closing(orbits):
    code, out, _ = orbits("find", "pendulum", "--period", "1e-3")
    assert code == 1
    said = "The start is symmetric: --closing reversal needs half of the period"
    assert said in " ".join(out.split())
    assert orbits("find", "pendulum", "--period", "1e-3", "--closing", "reversal")[0] == 1


@pytest.mark.slow
def test_the_start_and_how_far_it_moved_are_shown(orbits):
    words = ("pendulum", "--set", "angle=1", "--set", "rate=0.5", "--period", "2.2")
    code, out, err = orbits("find", *words, "--hold", "theta", "--energy", "-5")
    assert code == 0, err
    rate = np.sqrt(2 * (9.81 * np.cos(1.0) - 5.0))
    assert f"start: theta = 1, theta_dot = {rate:.12g}\n" in out
    assert f"moved by {rate - 0.5:.1e} from the start of the search" in out


@pytest.mark.slow
def test_a_rough_guess_is_led_to_an_orbit_by_descent(orbits):
    guess = ("pendulum", "--set", "angle=-2.3", "--set", "rate=1.9", "--period", "6")
    steps = {}
    for rough in ((), ("--rough",)):
        code, out, err = orbits("find", *guess, *rough)
        assert code == 0, err
        steps[rough] = out.count("largest error")
    assert steps["--rough",] > steps[()] + 2


MISUSE = [
    (["pendullum"], "Did you mean"),
    (["pendulum", "--set", "angel=1"], "Did you mean"),
    (["pendulum", "--closing", "plane"], "Did you mean"),
    (["pendulum", "--closing", "choreography"], "Only free points can satisfy it"),
    (["pendulum", "--closing", "relative"], "Its state has no rotation"),
    (["pendulum", "--set", "rate=1", "--closing", "reversal"], "of the time reversal"),
    (["pendulum", "--period", "-1"], "period: expected > 0"),
    (["pendulum", "--period", "2", "--hold", "angle"], "one of theta, theta_dot, got 'angle'"),
    (["two_masses"], "--period: expected one, a multiple of the drive's, got none. The rate dep"),
    (["pendulum", "--rough", "--collocation"], "find: expected one of --rough, --collocation"),
    (["cannonball"], "has no close return"),
    (["pendulum", "--save", "no/such/folder/x.json"], "a file in a folder that exists"),
]


@pytest.mark.parametrize(("words", "message"), MISUSE)
def test_misuse_is_exit_code_2_and_one_line(orbits, words, message):
    code, out, err = orbits("find", *words)
    assert code == 2
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert message in err
    assert out == ""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--within", "5"], "--within: expected two bounds"),
        (["--within", "1,x"], "--within: expected comma-separated numbers"),
        (["--within", "5,1"], "--within: expected two bounds, the lower one first"),
        (["--energies", "nan,1"], "--energies: expected two bounds, the lower one first"),
        (["--step", "0"], "--step: expected > 0"),
        (["--members", "0"], "--members: expected a whole number, at least 1"),
        (["--parameter", "length", "--within", "5,6"], "--within: expected bounds around length"),
    ],
)
def test_a_family_without_sense_is_refused_before_its_orbit_is_sought(orbits, words, message):
    code, out, err = orbits("family", "pendulum", *words)
    assert (code, out) == (2, "")
    assert err.startswith(f"error: {message}")


@pytest.mark.parametrize(
    "words",
    [
        ("find", "impact_oscillator"),
        ("section", "impact_oscillator", "--event", "x=0"),
        ("basins", "impact_oscillator", "--grid", "x=-1:0:2"),
        ("basins", "impact_oscillator", "--grid", "x=-1:0:2", "--along", "force", "1", "2"),
        ("family", "impact_oscillator"),
    ],
)
def test_motions_through_a_stop_are_refused(orbits, words):
    code, out, err = orbits(*words)
    assert (code, out) == (2, "")
    assert "leaves 'swing' at t = 3.24679" in err
    assert "`jaxdyn run` follows it" in err


def test_a_family_of_an_orbit_of_another_scene_is_refused(orbits, tmp_path):
    path = tmp_path / "swing.json"
    save(path, find(scenes.pendulum(angle=2.0), period=2.7, hold="theta"))
    words = ("henon_heiles", "--from-orbit", path)
    code, _, err = orbits("family", *words)
    assert code == 2
    assert "--from-orbit: expected an orbit of henon_heiles, got one of pendulum" in err


@pytest.mark.parametrize(("way", "sign"), [("--up", 1), ("--down", -1)])
def test_a_family_begins_in_the_direction_that_is_asked_for(orbits, way, sign):
    words = ("pendulum", "--set", "angle=2", "--period", "2.7", "--members", "2", "--json", way)
    code, out, err = orbits("family", *words)
    assert code == 0, err
    first, second = json.loads(out)["members"]
    assert sign * (second["energy"] - first["energy"]) > 0  # with which the period grows


@pytest.mark.slow
def test_a_family_shows_each_member_as_it_is_found(orbits, tmp_path):
    path = tmp_path / "family.json"
    words = ("pendulum", "--set", "angle=2", "--period", "2.7", "--members", "2", "--json")
    words += ("--parameter", "length")
    code, out, err = orbits("family", *words, "--save", path)
    assert code == 0, err
    assert len(json.loads(out)["members"]) == 2
    lines = [
        f"  length {member.parameter:.10g}   period {member.orbit.period:.12g}   {member.verdict}"
        for member in family_files.load(path).members
    ]
    assert "\n".join(lines) in err
    assert "largest error" in err  # of the first orbit


@pytest.mark.slow
def test_an_interrupted_family_goes_on_from_its_part(orbits, tmp_path, monkeypatch):
    whole, path = tmp_path / "whole.json", tmp_path / "family.json"
    part = tmp_path / "family.json.part"
    words = ("family", "pendulum", "--set", "angle=2", "--period", "2.7", "--members", "4")
    assert orbits(*words, "--save", whole)[0] == 0
    assert list(tmp_path.iterdir()) == [whole]
    between, found = continuation.special_points, []

    def interrupted(*args):  # called at each step
        found.append(args)
        if len(found) == 3:
            raise KeyboardInterrupt
        return between(*args)

    monkeypatch.setattr(continuation, "special_points", interrupted)
    assert orbits(*words, "--save", path)[0] == 130
    assert not path.exists()
    other = orbits("family", "pendulum", "--set", "angle=1", "--save", path)[2]
    assert f"one with other settings: {part}" in other
    assert orbits(*words, "--save", path)[0] == 0
    assert len(found) == 4  # two members before the interruption, one after it
    assert sorted(tmp_path.iterdir()) == [path, whole]
    assert path.read_text() == whole.read_text()


def test_no_family_is_one_json_object_too(orbits):
    code, out, err = orbits("family", "cannonball", "--period", "1", "--json")
    assert code == 1
    assert json.loads(out)["message"] in err


@pytest.mark.slow
def test_multipliers_that_are_all_1_are_no_afterthought(capsys):
    swing = find(scenes.pendulum(angle=2.0), period=2.7)
    print_reports({"swing": report(swing)}, Console(width=100), swing)
    shown = capsys.readouterr().out
    assert " 2 times 1 " in shown
    assert "and 2 times 1" not in shown


def orbit_of(scene) -> Orbit:
    return Orbit(scene, PLAIN, 0.0, Outcome.FOUND, 0, 1e-12)


@pytest.mark.parametrize(
    ("scene", "energy"),
    [
        (scenes.oscillator(k=4.0), 2.0),  # k x^2 / 2
        (scenes.oscillator(k=4.0, c=0.1), None),
        (scenes.lorenz(t1=2.0), None),  # no material points at all
    ],
    ids=["conserved", "damped", "no points"],
)
def test_an_energy_is_claimed_only_where_it_is_kept(scene, energy):
    what = identify(orbit_of(scene))
    assert what.energy == energy
    assert what.angular_momentum is None
    assert what.choreography is None
