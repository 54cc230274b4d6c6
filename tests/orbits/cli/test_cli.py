"""The command line: what it prints where, and with which exit code it ends."""

import functools
import json
import re
import subprocess
import sys
import time

import pytest
from helpers import forge

from jaxdyn import scenes

KEYS = {
    *("period", "y0", "closure", "choreography", "permutation_error", "energy"),
    *("angular_momentum", "scale_free", "multipliers", "exponents", "verdict"),
    *("periods_simulated", "return_error", "recheck", "normal_form"),
}
GUESS = ",".join(map(str, scenes.EIGHT_GUESS))


def joined(shift: float) -> str:
    near = (x + shift for x in (*scenes.EIGHT_GUESS, scenes.EIGHT_GUESS_PERIOD))
    return ",".join(map(str, near))


TOO_NEAR = (f"--lower={joined(-0.01)}", f"--upper={joined(0.01)}")


@pytest.fixture
def orbits(command):
    return functools.partial(command, "orbits")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """What a user's shell sees of one run that does everything but pictures."""
    path = tmp_path_factory.mktemp("cli") / "eight.json"
    words = [sys.executable, "-m", "orbits", "figure-eight", "--json", "--save", str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done, path


@pytest.mark.slow
def test_json_is_one_object_and_nothing_else(finished):
    done, _ = finished
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert done.stdout.count("\n") == 1
    assert KEYS <= found.keys()
    assert KEYS <= found["neighbour"].keys()
    assert found["seconds"].keys() == {"compile", "solve"}
    assert found["recheck"].keys() == {"solver", "tolerance", "closure"}
    assert found["normal_form"].keys() == {"period", "y0"}
    assert len(found["y0"]) == 12
    assert [len(z) for z in found["multipliers"]] == [2] * 12
    assert found["periods_simulated"] >= 5


def test_json_tells_the_eight_from_its_neighbour(finished):
    found = json.loads(finished[0].stdout)
    neighbour = found["neighbour"]
    assert (found["choreography"], neighbour["choreography"]) == (True, False)
    assert (found["verdict"], neighbour["verdict"]) == ("stable", "unstable")
    assert abs(found["scale_free"] - 9.237681250724549) < 1e-12
    assert abs(neighbour["scale_free"] - 9.237682750851262) < 1e-11
    assert found["permutation_error"] < 1e-12
    assert found["exponents"] == pytest.approx([0.008422724708131, 0.298092529004750], abs=1e-10)
    assert neighbour["exponents"][0] is None
    for orbit in (found, neighbour):
        assert orbit["closure"] <= 1e-13
        assert orbit["recheck"]["closure"] <= 1e-12
        assert orbit["return_error"] <= 1e-10


def test_progress_goes_to_standard_error(finished):
    err = finished[0].stderr
    assert "closing plainly" in err
    assert "imposing the choreography" in err
    assert err.count("largest error") > 10


@pytest.mark.slow
def test_a_saved_file_verifies(finished, orbits):
    run = orbits("verify", finished[1])
    assert run.code == 0
    assert "every claim of the file holds" in run.out
    run = orbits("verify", finished[1], "--json")
    assert run.code == 0
    answer = json.loads(run.out)
    assert (answer["ok"], answer["mismatches"]) == (True, [])
    assert KEYS <= answer["derived"].keys()


@pytest.mark.parametrize("as_json", [False, True])
def test_an_edited_file_fails_with_the_claim_named(finished, orbits, tmp_path, as_json):
    record = json.loads(finished[1].read_text())
    record["claims"]["energy"] += 1e-6
    forge(tmp_path / "edited.json", record)
    run = orbits("verify", tmp_path / "edited.json", *(["--json"] if as_json else []))
    assert run.code == 2
    assert len(run.err.strip().splitlines()[-1:]) == 1
    assert "These do not hold: energy." in run.err
    if as_json:
        answer = json.loads(run.out)
        assert not answer["ok"]
        assert [m["name"] for m in answer["mismatches"]] == ["energy"]
    else:
        assert "holds" not in run.out


def test_the_report_for_people(orbits):
    run = orbits("figure-eight")
    assert run.code == 0
    for text in ("closing plainly", "imposing the choreography", "closed plainly", "unstable"):
        assert text in run.out
    for text in ("9.2376812507", "9.2376827508", "6.3259139829", "-0.9700043567"):
        assert text in run.out


@pytest.mark.slow
def test_the_seconds_that_are_printed_are_those_of_the_whole_command(tmp_path):
    words = [sys.executable, "-m", "orbits", "figure-eight", "--plot", str(tmp_path / "eight.png")]
    start = time.perf_counter()
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    wall = time.perf_counter() - start
    total, *parts = map(float, re.findall(r"([\d.]+) s\b", done.stdout.splitlines()[-1]))
    assert len(parts) == 4
    assert abs(total - sum(parts)) < 0.3
    # Python itself starts and ends in a part of a second, on a loaded machine in more.
    assert 0.75 * wall < total < wall


@pytest.mark.parametrize("as_json", [False, True])
def test_no_convergence_is_exit_code_1_with_the_best_iterate(orbits, as_json):
    run = orbits("figure-eight", *TOO_NEAR, *(["--json"] if as_json else []))
    assert run.code == 1
    if not as_json:
        assert "no orbit (plain closing)" in run.out
        assert "The best point lies on the bounds and does not close. Give another" in run.out
        assert "other bounds with --lower and --upper." in run.out
        return
    answer = json.loads(run.out)
    assert answer["outcome"] == "BOUND"
    assert answer["stage"] == "plain closing"
    assert "other bounds with --lower and --upper." in answer["message"]
    best = answer["best_iterate"]
    assert len(best["y0"]) == 12
    assert best["largest_error"] > 1e-6
    # Nothing in it that looks like the result of a search that worked.
    assert not {"period", "y0", "closure", "scale_free", "verdict"} & answer.keys()


def test_a_collision_has_no_number_that_pretends(orbits):
    fall = "-1,0,1,0,0,5,0,0,0,0,0,0"
    run = orbits("figure-eight", "--guess", fall, "--json")
    assert run.code == 1
    answer = json.loads(run.out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert answer["outcome"] == "COLLISION"
    assert answer["best_iterate"]["largest_error"] is None


MISUSE = [
    (["--masses", "1,-1,1"], "mass: expected >= 0, got -1.0"),
    (["--masses", "1,0,1"], "masses: expected equal ones"),
    (["--masses", "1,1"], "--masses: expected 3 numbers, got 2"),
    (["--masses", "1,1,x"], "--masses: expected comma-separated numbers, got '1,1,x'"),
    (["--masses", "1,1,2"], "masses: expected equal ones"),
    (["--masses", "1,1,nan"], "mass: expected finite numbers, got nan"),
    (["--guess", GUESS.replace("0.355", "nan")], "y0: expected finite numbers, got nan at index"),
    (["--guess", "1,2,3"], "--guess: expected 12 numbers, got 3"),
    (["--guess", ""], "--guess: expected comma-separated numbers, got ''"),
    (["--guess", "1,2,1,2,0,0,0,0,0,0,0,0"], "bodies at different points, got bodies 1 and 2"),
    (["--period", "0"], "period: expected > 0, got 0.0"),
    (["--period", "-3"], "period: expected > 0, got -3.0"),
    (["--period", "-2*pi"], "period: expected > 0, got -6.283185307179586"),
    (["--period", "nan"], "period: expected finite numbers, got nan"),
    (["--lower", ",".join(["0"] * 12)], "--lower: expected 13 numbers, got 12"),
    (["--lower", ",".join(["9"] * 13)], "lower: expected <= upper"),
    (["--save", "no/such/folder/x.json"], "--save: expected a file in a folder that exists"),
    (["--plot", "no/such/folder/x.png"], "--plot: expected a file in a folder that exists"),
    (["--save", "."], "--save: expected a file, got '.', which is none"),
    (["--save", "/proc/x.json"], "--save: expected a file that can be written"),
    (["--plot", "/proc/x.png"], "--plot: expected a file that can be written"),
    (["--plot", "picture.bmp"], "--plot: expected a file name ending in .png, .pdf, .svg"),
    (["--animate", "movie.txt"], "--animate: expected a file name ending in .gif, .mp4"),
    (["--title", "A"], "--title: expected --plot with it, got none"),
    (["--perid", "6"], "No such option: --perid"),
]


@pytest.mark.parametrize(("words", "message"), MISUSE)
@pytest.mark.parametrize("as_json", [[], ["--json"]], ids=["text", "json"])
def test_misuse_is_exit_code_2_and_one_line(orbits, words, message, as_json):
    run = orbits("figure-eight", *words, *as_json)
    assert run.code == 2
    assert run.err.count("\n") == 1
    assert run.err.startswith("error: ")
    assert message in run.err
    assert run.out == ""


@pytest.mark.parametrize(
    "words", [["find", "pendulum"], ["family", "pendulum"], ["aim"], ["loops"], ["search"]]
)
def test_files_are_refused_by_their_option(orbits, words):
    option = "--table" if words == ["search"] else "--plot"
    run = orbits(*words, option, "no/such/folder/x.png")
    assert run.code == 2
    assert f"error: {option}: expected a file in a folder that exists" in run.err
    if option == "--plot":
        assert "--title: expected --plot with it" in orbits(*words, "--title", "A").err


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "file: expected a readable file"),
        ("{", "file: expected JSON"),
        ("{}", "file: expected format 'jaxdyn-orbit', got None"),
    ],
)
def test_a_file_that_cannot_be_read_is_exit_code_2_and_one_line(orbits, tmp_path, content, message):
    path = tmp_path / "orbit.json"
    if content is not None:
        path.write_text(content)
    run = orbits("verify", path)
    assert run.code == 2
    assert run.err.count("\n") == 1
    assert message in run.err
    assert run.out == ""
