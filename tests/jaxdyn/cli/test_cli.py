"""The command line of scenes: what it prints, draws and refuses, and its exit codes."""

import functools
import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from helpers import BEYOND

from jaxdyn import drawing, load, scenes, simulate, solvers
from jaxdyn.cli import run
from jaxdyn.files.tables import samples
from jaxdyn.integrate.simulation import RTOL
from jaxdyn.scenes import catalogue

STIFF = scenes.two_springs(c_a=1e6)


@pytest.fixture
def jaxdyn(command):
    return functools.partial(command, "jaxdyn")


def test_every_scene_names_its_problems_and_all_its_numbers(jaxdyn):
    code, out, _ = jaxdyn("list", "--json")
    assert code == 0
    listed = json.loads(out)
    assert listed.keys() == catalogue.entries().keys()
    for name, entry in listed.items():
        assert bool(entry["problems"]) != (name in BEYOND), f"{name} names no course problem"
        for key, number in entry["parameters"].items():
            assert number["meaning"], f"{name} does not say what {key} is"
    assert listed["car"]["parameters"]["speed"]["meaning"].endswith("[m/s].")


def test_the_list_is_a_table(jaxdyn):
    code, out, _ = jaxdyn("list")
    assert code == 0
    assert "bead_on_cycloid" in out
    assert re.search(r"car +│ 32 ", out)


def test_words_of_the_field_find_scenes(jaxdyn):
    found = json.loads(jaxdyn("list", "constraint", "--json")[1])
    assert {"pendulum", "feynman_plate"} & found.keys()
    assert "shaken_pendulum" in json.loads(jaxdyn("list", "forcing", "--json")[1])
    for word in ("damper", "rigid body", "three-body", "constraints"):
        assert json.loads(jaxdyn("list", word, "--json")[1]), word


@pytest.mark.parametrize(
    ("word", "shown"),
    [
        ("halo", "26_libration_points.md"),
        ("basins", "29_basins.md"),
        ("damper", "oscillator"),
        ("boundary condition", "closing"),
        ("cannonballs", "jaxdyn course 27"),
        ("resonance", "23_vibrations.md"),
        ("NNM", "23_vibrations.md"),
        ("limit cycle", "11_orbits.md"),
        ("poincare", "12_families_and_manifolds.md"),
        ("gyroscope", "jaxdyn course 61"),
        ("walking robot", "simplest_walker"),
        ("slingshot", "n_body"),
        ("Kepler", "two_body"),
        ("quasi-periodic", "30_tori.md"),
        ("Neimark-Sacker", "30_tori.md"),
        ("spring pendulum", "spring_mass"),
        ("optax", "28_neural_terms.md"),
        ("machine learning", "28_neural_terms.md"),
        ("vibrations", "spring_chain"),
        ("MDOF", "spring_chain"),
        ("aim", "orbits aim"),
        ("targets", "orbits aim"),
        ("nonlinear normal mode", "orbits backbone"),
        ("suspension", "23_vibrations.md"),
        ("sensitivity", "27_designs.md"),
        ("derivatives", "27_designs.md"),
        ("wind", "QuadraticDrag"),
        ("wind", "orbits aim"),
        ("drag", "orbits aim"),
        ("elastic", "spring_mass"),
        ("imbalance", "23_vibrations.md"),
        ("Hz", "23_vibrations.md"),
        ("matrix", "23_vibrations.md"),
        ("matrices", "linear_system"),
        ("Kapitza", "shaken_pendulum"),
        ("strobe", "orbits section"),
        ("stroboscopic", "orbits section"),
        ("snapshots", "03_scenes.md"),
        ("Foucault", "04_effects.md"),
        ("Coriolis", "restricted_three_body"),
        ("Coriolis", "MatrixDamper"),
        ("spherical", "02_formulations.md"),
        ("shock", "23_vibrations.md"),
        ("earthquakes", "23_vibrations.md"),
        ("bouncing", "ball_on_table"),
        ("solar system", "n_body"),
        ("solar", "09_other_libraries.md"),
        ("transfer orbits", "17_bifurcations.md"),
        ("Arnold tongues", "orbits curve"),
        ("tongue", "17_bifurcations.md"),
        ("Mathieu", "shaken_pendulum"),
        ("Mathieu", "17_bifurcations.md"),
    ],
)
def test_words_of_the_field_find_guides_problems_and_words(jaxdyn, word, shown):
    code, out, _ = jaxdyn("list", word)
    assert code == 0
    assert shown in out
    assert "dumbbell" not in out


def test_a_word_is_not_found_inside_another_one(jaxdyn):
    code, out, _ = jaxdyn("list", "range")
    assert code == 0
    assert "orbits aim" in out
    assert "02_formulations.md" not in out  # which is about "Lagrange"


def test_many_scenes_of_a_word_are_listed_without_their_numbers(jaxdyn):
    code, out, _ = jaxdyn("list", "mass")
    assert code == 0
    assert "jaxdyn list SCENE shows its numbers." in out
    assert "[m/s]" not in out
    # First those that are about it, then those that have a parameter of this name.
    assert out.index("spring_chain") < out.index("cannonball")


def test_a_scene_can_be_listed_alone(jaxdyn):
    code, out, _ = jaxdyn("list", "cannonball", "car")
    assert code == 0
    assert "launch speed [m/s]" in out
    assert "pendulum" not in out
    assert list(json.loads(jaxdyn("list", "cannonball", "--json")[1])) == ["cannonball"]


def test_the_problems_are_listed_with_what_answers_each(jaxdyn):
    code, out, _ = jaxdyn("list", "--problems", "--json")
    assert code == 0
    listed = json.loads(out)
    assert list(listed) == [str(n) for n in range(1, 62)]
    assert "jaxdyn.scenes.free_body" in listed["52"]["names"]
    code, out, _ = jaxdyn("list", "--problems")
    assert code == 0
    assert len(re.findall(r"^│ *\d+ +│", out, re.MULTILINE)) == 61
    assert "[italic]" not in out


def test_the_end_of_a_motion_has_its_units(jaxdyn):
    days = ("restricted_three_body_in_space", "--set", "system=earth-moon", "--t1", "2")
    for words, end in ((days, "2 day"), (("pendulum", "--t1", "2"), "2 s"), (("lorenz",), "20")):
        out = jaxdyn("run", *words, "--samples", "2")[1]
        assert f"at t = {end}:" in out


def test_digits_that_chaos_has_eaten_are_not_printed(jaxdyn):
    code, out, _ = jaxdyn("run", "lorenz", "--t1", "60", "--samples", "2")
    assert code == 0
    assert len(re.findall(r"^ [ xyz]+no digit left \(\+-[1-9]e\+0[01]\)$", out, re.MULTILINE)) == 3
    assert "No digit is certain: rounding alone moves this end by its own size." in out
    code, out, _ = jaxdyn("run", "lorenz", "--t1", "20", "--samples", "2")
    # By Taylor series of order 45 in 60 digits, with mpmath.
    exact_end = [13.79319959513, 12.95180393619, 34.90160868114]
    printed = re.findall(r"^  [xyz] +(\d+\.\d+)$", out, re.MULTILINE)
    # How many digits are left is a matter of rounding, which differs from processor to processor.
    for number, exact in zip(printed, exact_end, strict=True):
        decimals = len(number.split(".")[1])
        assert 6 <= decimals <= 8
        assert abs(float(number) - exact) < 10.0**-decimals
    assert re.search(r"\b(9|10)\.\d digits are right, relative to the size of the motion", out)
    code, out, _ = jaxdyn("run", "lorenz", "--t1", "20", "--samples", "2", "--json")
    found = json.loads(out)
    true = np.abs(np.subtract(found["y"][-1], exact_end))
    written = np.array(found["error"])
    assert (true < 1.1 * written).all()
    assert (written < 10 * true).all()


@pytest.mark.slow
def test_a_car_brakes_to_rest_long_before_the_span_ends(jaxdyn, tmp_path):
    picture = tmp_path / "car.png"
    words = ("--set", "spin=0", "--t1", "60", "--samples", "5", "--plot", picture, "--json")
    code, out, _ = jaxdyn("run", "car", *words)
    assert code == 0
    found = json.loads(out)
    # The rear wheels carry 1.2 / 2.6 of the weight: v^2 / 2a, with what `braking` leaves out.
    a = 0.7 * 9.81 * 1.2 / 2.6
    assert abs(found["t"][-1] - 20.0 / a) < 1e-4
    assert abs(found["y"][-1][0] - 200.0 / a) < 1e-8
    assert found["y"][-1][3:] == [0.0, 0.0, 0.0]
    assert [phase["name"] for phase in found["phases"]] == ["slide"]
    assert found["message"] == "Phase slide led to the end."
    assert abs(found["energy_drift"] - 1) < 1e-9
    assert len(found["t"]) == len(found["y"]) == 6
    assert picture.stat().st_size > 1000


@pytest.mark.slow
def test_a_car_without_friction_is_one_smooth_motion(jaxdyn):
    code, out, _ = jaxdyn("run", "car", "--set", "mu=0", "--samples", "2", "--json")
    assert code == 0
    assert json.loads(out)["phases"] == []


@pytest.mark.slow
def test_a_cylinder_rolls_skids_and_flies(jaxdyn):
    code, out, _ = jaxdyn("run", "cylinder_on_cylinder", "--t1", "2", "--samples", "3")
    assert code == 0
    lines = [line.split() for line in out.splitlines() if " from " in line]
    assert [line[0] for line in lines] == ["roll", "slip_on", "fly"]
    assert lines[0][-2] == lines[1][2]
    assert lines[2][-2:] == ["2", "s"]


@pytest.mark.slow
def test_nothing_is_said_about_the_energy_of_what_has_none(jaxdyn, tmp_path):
    words = ("lorenz", "--t1", "1", "--samples", "30")
    movie = tmp_path / "lorenz.gif"
    code, out, _ = jaxdyn("run", *words, "--animate", movie)
    assert code == 0
    assert "energy" not in out
    assert movie.read_bytes().startswith(b"GIF89a")
    assert json.loads(jaxdyn("run", *words, "--json")[1])["energy_drift"] is None


def test_bodies_are_cut_free_at_a_time(jaxdyn, tmp_path):
    file = tmp_path / "free.png"
    words = ("--t1", "1", "--samples", "3", "--free-body", file, "--at", "0.5")
    code, out, _ = jaxdyn("run", "cannonball", *words)
    assert code == 0
    assert "with its bodies cut free in" in " ".join(out.split())
    assert file.read_bytes().startswith(b"\x89PNG")
    late = (*words[:-1], "2")
    assert "t: expected a time of the motion" in jaxdyn("run", "cannonball", *late)[2]


def test_what_changes_the_energy_is_named(jaxdyn):
    code, out, _ = jaxdyn("run", "cannonball", "--set", "drag=0.1")
    assert code == 0
    wanted = r"; it is not conserved, because of QuadraticDrag \(no potential known, work -.*\)\n"
    assert re.search(wanted, out)
    code, out, _ = jaxdyn("run", "cannonball")
    assert re.search(r"relative to its parts: \d\.\de-1\d\n", out)
    found = json.loads(jaxdyn("run", "cannonball", "--json")[1])
    assert found["energy_changed_by"] == []


def test_a_picture_of_few_samples_leaves_the_output_small(jaxdyn, tmp_path):
    picture = tmp_path / "ball.svg"
    code, out, _ = jaxdyn("run", "cannonball", "--samples", "3", "--json", "--plot", picture)
    assert code == 0
    found = json.loads(out)
    assert len(found["t"]) == 3
    assert abs(found["energy_drift"]) < 1e-12
    assert picture.read_text().count("\nL ") > 1000


MISUSE = [
    (
        ["run", "cannonbal"],
        "error: scene: expected one that `jaxdyn list` shows, got 'cannonbal'. "
        "Did you mean 'cannonball'?",
    ),
    (["run", "cannonball", "--set", "mas=2"], "parameter of cannonball"),
    (["run", "cannonball", "--set", "m=x"], "m: expected a number"),
    (["run", "cannonball", "--t1", "abc"], "'--t1'"),
    (["run", "cannonball", "--rtol", "abc"], "'--rtol'"),
    (["run", "cannonball", "--samples", "1.5"], "'--samples'"),
    (["run", "cannonball", "--period", "abc"], "--period"),
    (["run"], "Missing argument"),
    (["run", "cannonball", "--solver", "radau"], "got 'radau'. Did you mean 'radau9'?"),
    (["run", "cannonball", "--solver", "verlet"], "dt: expected a step, since those of Verlet"),
    (["run", "car", "--dt", "0.1"], "dt: expected none for a motion in phases, got 0.1"),
    (["run", "cannonball", "--title", "A"], "--title: expected --plot, --series, --energies or"),
    (["run", "cannonball", "--at", "2"], "--at: expected --free-body with it"),
    (["accuracy", "cannonball", "--title", "A"], "--title: expected --plot with it"),
    (["run", "cannonball", "--seconds", "2"], "--seconds: expected --animate with it"),
    (["list", "canonball"], "problem mentions, got 'canonball'. Did you mean 'cannonball'?"),
    (
        ["list", "xyzzy"],
        "list: expected a scene, or a word that a scene, effect, guide, command or",
    ),
    (["list", "--problems", "car"], "--problems: expected no scene beside it"),
    (["run", "car", "--solver", "nystrom12"], "solver: expected one for forces that may"),
    (["run", "cannonball", "--samples", "10000000"], "samples: expected at most 1000000"),
    (["run", "cannonball", "--samples", "0"], "got 0. It is at most 1000000 here"),
]


@pytest.mark.parametrize(("words", "message"), MISUSE)
def test_misuse_is_one_line_and_exit_code_2(jaxdyn, words, message):
    code, out, err = jaxdyn(*words)
    assert code == 2
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert message in err


@pytest.mark.parametrize(
    ("option", "file"),
    [
        *(("--plot", "a.bmp"), ("--animate", "a.png"), ("--plot", "no/such/a.png")),
        *(("--plot", "/proc/a.png"), ("--animate", "/proc/a.gif"), ("--series", "/proc/a.svg")),
        *(("--csv", "/proc/a.csv"), ("--csv", "a.txt")),
        *(("--save", "/proc/a.npz"), ("--save", "a.txt")),
    ],
)
def test_files_are_refused_before_anything_is_simulated(jaxdyn, monkeypatch, option, file):
    monkeypatch.setattr(catalogue.Entry, "motion", lambda *_, **__: pytest.fail("simulated"))
    code, _, err = jaxdyn("run", "cannonball", option, file)
    assert code == 2
    assert err.startswith(f"error: {option}: expected a file")


def test_numbers_of_a_scene_may_be_arithmetic(jaxdyn):
    words = ("run", "cannonball", "--samples", "2", "--json", "--set")
    y = [json.loads(jaxdyn(*words, f"angle={angle}")[1])["y"] for angle in ("pi/6", "30*deg")]
    assert y[0] == y[1]
    assert y[0][0][3] == pytest.approx(5.0, rel=1e-15)
    code, _, err = jaxdyn(*words, "angle=__import__('os')")
    assert (code, err.count("\n")) == (2, 1)
    assert "angle: expected a number" in err


@pytest.mark.slow
def test_auto_is_that_of_the_library_and_warnings_are_printed(jaxdyn):
    words = ("run", "two_springs", "--set", "c_a=1e6", "--t1", "1e-2", "--samples", "2")
    code, out, _ = jaxdyn(*words, "--json")
    found, wanted = json.loads(out), simulate(STIFF, 1e-2, samples=2)
    assert (code, found["steps"], found["warning"]) == (0, int(wanted.steps), wanted.warning)
    assert "took over" in wanted.warning
    assert np.array_equal(found["y"][-1], wanted.ys[-1])
    code, out, _ = jaxdyn(*words, "--solver", "verner9")
    assert code == 0
    assert "warning: The scene is stiff" in out


def test_every_solver_has_its_name(jaxdyn):
    for name in solvers.__all__:
        solver = getattr(solvers, name)
        if isinstance(solver, solvers.Method):
            assert run._method(name.lower()) is solver
    assert run._method("auto") is None
    words = ("run", "oscillator", "--t1", "1", "--samples", "2", "--json")
    found = json.loads(jaxdyn(*words, "--solver", "kahan_li8", "--dt", "0.1")[1])
    assert found["steps"] == 10


def test_the_default_tolerance_is_that_of_the_library():
    assert run._RTOL == RTOL


def test_a_scene_becomes_a_page_on_which_it_runs(jaxdyn, tmp_path):
    page = tmp_path / "throw.html"
    code, out, _ = jaxdyn("run", "cannonball", "--samples", "3", "--t1", "3", "--live", page)
    assert code == 0
    assert f"runs in {page}\n" in out
    assert '"span": 3.0' in page.read_text()
    code, _, err = jaxdyn("run", "cannonball", "--live", tmp_path / "throw.png")
    assert code == 2
    assert "--live: expected a file name ending in .html" in err


def test_a_run_becomes_files(jaxdyn, tmp_path):
    picture, series, table = (tmp_path / name for name in ("a.svg", "b.svg", "c.csv"))
    energies = tmp_path / "d.svg"
    words = ("--plot", picture, "--title", "Title of it", "--series", series, "--csv", table)
    words += ("--energies", energies)
    code, out, _ = jaxdyn("run", "cannonball", "--samples", "3", *words)
    assert code == 0
    told = f"drawn in {picture}\ndrawn over time in {series}\nwith its energies in {energies}\n"
    assert f"{told}written to {table}\n" in out
    assert all(name in energies.read_text() for name in ("kinetic", "potential", "total"))
    assert "Title of it" in picture.read_text()
    assert "Title of it" in series.read_text()
    assert table.read_text().startswith("t [s],x [m],")


@pytest.mark.sample("cannonball")
@pytest.mark.parametrize("scene", ["cannonball", "car"])  # a motion, and a chain of phases
def test_a_saved_run_is_loaded_as_it_was_printed(jaxdyn, tmp_path, scene):
    path = tmp_path / "a.npz"
    words = ("run", scene, "--samples", "3", "--save", path)
    code, out, _ = jaxdyn(*words, "--json")
    ts, ys = samples(load(path))
    found = json.loads(out)
    assert (code, ts.tolist(), ys.tolist()) == (0, found["t"], found["y"])
    assert f"saved in {path}\n" in jaxdyn(*words)[1]


def test_pictures_name_the_scene(jaxdyn, tmp_path):
    picture = tmp_path / "a.svg"
    assert jaxdyn("run", "cannonball", "--samples", "3", "--series", picture)[0] == 0
    assert "cannonball (m = 1), uniform gravity (g = 9.81)" in picture.read_text()


@pytest.mark.parametrize("as_json", [(), ("--json",)])
def test_a_disk_that_fills_up_leaves_the_result_and_one_line(
    jaxdyn, monkeypatch, tmp_path, as_json
):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(drawing, "trajectory", full)
    words = ("run", "cannonball", "--samples", "2", "--plot", tmp_path / "a.png", *as_json)
    code, out, err = jaxdyn(*words)
    assert code == 2
    assert ("7.07106781187" if not as_json else '"status": "OK"') in out
    assert err.startswith("error: file: expected a file that can be written, got")
    assert "No space left" in err
    assert err.count("\n") == 1


def test_an_interrupted_run_is_no_traceback(jaxdyn, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(catalogue.Entry, "motion", interrupted)
    code, _, err = jaxdyn("run", "cannonball")
    assert (code, err.strip()) == (130, "")


def finished(*words, stdout=subprocess.PIPE):
    """A run of the command line in a process of its own."""
    words = [sys.executable, "-m", *words]
    return subprocess.run(words, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False)


def test_a_standard_output_that_is_full_is_one_line():
    with open("/dev/full", "w") as full:
        done = finished("jaxdyn", "list", "--json", stdout=full)
    assert done.returncode == 2
    assert done.stderr == "error: standard output: No space left on device.\n"


def test_a_reader_that_leaves_is_no_error():
    read, write = os.pipe()
    os.close(read)
    with open(write, "w") as closed:
        done = finished("jaxdyn", "list", "--json", stdout=closed)
    assert (done.returncode, done.stderr) == (1, "")


def test_a_motion_that_stops_is_exit_code_1(jaxdyn):
    too_fast = ("--set", "speed=1e200", "--set", "drag=1", "--samples", "4")
    code, out, _ = jaxdyn("run", "cannonball", *too_fast)
    assert code == 1
    assert "stopped" in out
    assert "not reached" in out


@pytest.mark.slow
def test_a_chain_of_phases_that_stops_is_exit_code_1(jaxdyn):
    code, out, _ = jaxdyn("run", "ball_on_table", "--t1", "1e3", "--samples", "2")
    assert code == 1
    assert "stopped" in out
    assert "The limit of phases was reached." in " ".join(out.split())


def _shell(command: str, **more: str) -> subprocess.CompletedProcess:
    environment = os.environ | more
    return subprocess.run(["sh", "-c", command], capture_output=True, env=environment, check=False)


def test_a_closed_standard_output_is_one_line():
    done = _shell(f"{sys.executable} -m jaxdyn list oscillator --json >&-")
    assert done.returncode == 2
    assert done.stderr.decode() == (
        "error: standard output is closed. Write to a file, or to /dev/null.\n"
    )
    assert _shell(f"{sys.executable} -m jaxdyn list bogus 2>&-").stdout == b""


def test_a_terminal_that_knows_ascii_only_gets_the_list():
    command = f"{sys.executable} -m jaxdyn list --problems"
    done = _shell(command, PYTHONIOENCODING="ascii", LC_ALL="C")
    assert done.returncode == 0, done.stderr
    assert b"jaxdyn.analysis" in done.stdout
    assert max(done.stdout) < 128
