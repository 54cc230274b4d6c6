"""Scenes in files of the user's, on the command line."""

import json

import numpy as np
import pytest

from jaxdyn import _scene_files
from jaxdyn.scenes.catalogue import entry

ROESSLER = '''
import jaxdyn
from shared import CONSTANT


def _rate(t, y, p):
    a, b, c = p
    return [-y[1] - y[2], y[0] + a * y[1], b + y[2] * (y[0] - c)]


def roessler(a=CONSTANT, b=0.2, c=5.7, t1=50):
    """Roessler's system.

    Args:
      c: where it turns chaotic.
    """
    return jaxdyn.ode(_rate, [1.0, 1.0, 0.0], t1, params=(a, b, c))


def _helper(x):
    raise RuntimeError("not asked for")
'''
SEVERAL = """
def one(c=1):
    return c


def two():
    return 2


def three(x):
    return x
"""


SHORT = """
import jaxdyn
scale = lambda x=1.0: x
def fall(k=2.0) -> jaxdyn.Scene:
    return decay(k)
decay = lambda k=1.0: jaxdyn.ode(lambda t, y, p: [-p * y[0]], [1.0], 1.0, params=k)
"""


PLAIN = SHORT.replace(" -> jaxdyn.Scene", "")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(ROESSLER)
    (tmp_path / "shared.py").write_text("CONSTANT = 0.2")
    (tmp_path / "several.py").write_text(SEVERAL)
    (tmp_path / "broken.py").write_text("def f(:")
    (tmp_path / "needy.py").write_text("def f(k, c=1, *, m, n=1): return k")
    (tmp_path / "exits.py").write_text("import sys\ndef f(): return 1\nsys.exit(3)")
    (tmp_path / "short.py").write_text(SHORT)
    (tmp_path / "plain.py").write_text(PLAIN)
    (tmp_path / "empty.py").write_text("raise RuntimeError")
    return tmp_path


def test_a_scene_of_a_file_runs_with_its_numbers_set(folder, command):
    del folder
    ends = []
    for words in (["mine.py"], ["mine.py:roessler", "--set", "c=2.5", "--set", "t1=2"]):
        code, out, err = command("jaxdyn", "run", *words, "--json")
        assert code == 0, err
        ends.append(json.loads(out))
    assert [one["t"][-1] for one in ends] == [50, 2]
    code, out, _ = command("jaxdyn", "run", "mine.py", "--set", "c=2.5", "--t1", "2", "--json")
    assert np.array_equal(json.loads(out)["y"][-1], ends[1]["y"][-1])


@pytest.mark.parametrize(
    ("name", "k"), [("short.py", 2.0), ("plain.py", 2.0), ("short.py:decay", 1.0)]
)
def test_a_lambda_is_a_function_and_an_annotation_or_def_chooses_one(folder, command, name, k):
    del folder
    code, out, err = command("jaxdyn", "run", name, "--json")
    assert code == 0, err
    assert json.loads(out)["y"][-1][0] == pytest.approx(np.exp(-k), abs=1e-9)


def test_an_orbit_of_it_is_found_saved_and_read_with_the_scene(folder, command):
    words = (
        "orbits",
        "find",
        "mine.py",
        "--set",
        "c=2.5",
        "--set",
        "t1=100",
        "--save",
        "cycle.json",
    )
    code, out, err = command(*words, "--json")
    assert code == 0, err
    assert json.loads(out)["period"] == pytest.approx(5.7489911833, abs=1e-9)  # by DOP853 of SciPy
    code, out, err = command("orbits", "verify", "cycle.json", "--scene", "mine.py", "--json")
    assert (code, json.loads(out)["ok"]) == (0, True)
    code, out, err = command("orbits", "show", "cycle.json")
    assert code == 2
    assert "Pass it as --scene: files hold no functions." in err
    code, out, err = command("orbits", "show", "cycle.json", "--set", "c=3")
    assert code == 2
    assert "--set: expected none without --scene, got c=3" in err


def test_its_text_is_listed_without_running_it(folder, command):
    (folder / "shared.py").unlink()
    code, out, _ = command("jaxdyn", "list", "mine.py", "--json")
    assert code == 0
    (text,) = json.loads(out).values()
    assert text["summary"] == "Roessler's system"
    assert text["parameters"]["a"] == {"default": "CONSTANT", "meaning": ""}
    assert text["parameters"]["c"] == {"default": 5.7, "meaning": "where it turns chaotic."}


def test_a_text_of_xppaut_is_read(folder, command):
    text = "# A swing\npar k=4\nx'=v\nv'=-k*x\ninit x=1\n@ total=5\n"
    (folder / "swing.ode").write_text(text)
    code, out, err = command("jaxdyn", "run", "swing.ode", "--set", "k=1", "--json")
    assert code == 0, err
    motion = json.loads(out)
    assert motion["t"][-1] == 5
    assert motion["y"][-1][0] == pytest.approx(np.cos(5.0), abs=1e-9)
    (folder / "capital.ode").write_text(text.upper().replace("# A SWING", "# A swing"))
    again = command("jaxdyn", "run", "capital.ode", "--set", "K=1", "--json")[1]
    assert json.loads(again)["y"] == motion["y"]
    words = ("orbits", "family", "capital.ode", "--within", "1,2", "--parameter")
    assert "--within: expected bounds around k = 4" in command(*words, "K")[2]
    assert "--parameter: expected one of k, total, v, x, got 'm'" in command(*words, "M")[2]
    code, out, _ = command("jaxdyn", "list", "swing.ode", "--json")
    assert json.loads(out)["swing.ode"]["summary"] == "A swing"
    code, _, err = command("jaxdyn", "run", "swing.ode", "--set", "m=1")
    assert code == 2
    assert "parameter of swing.ode: expected one of k, total, v, x, got 'm'" in err
    code, _, err = command("jaxdyn", "run", "sling.ode")
    assert "scene: expected a file of XPPAUT that can be read, got sling.ode (No such file" in err


@pytest.mark.parametrize(
    "data", ["# Rössler\nx'=2\r\n".encode("latin-1"), "\ufeff# Rö\r\nx'=\\\r\n2".encode()]
)
def test_texts_of_xppaut_as_old_files_and_editors_of_windows_have_them(folder, command, data):
    (folder / "old.ode").write_bytes(data)
    code, out, err = command("jaxdyn", "run", "old.ode", "--t1", "3", "--json")
    assert code == 0, err
    assert json.loads(out)["y"][-1] == [6.0]


def test_a_word_finds_scenes(command):
    code, out, _ = command("jaxdyn", "list", "slope", "--json")
    assert code == 0
    assert {"cylinder_on_ramp", "simplest_walker"} <= json.loads(out).keys()
    assert "cannonball" not in json.loads(out)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nine.py"], "scene: expected a Python file that exists, got nine.py"),
        (["broken.py"], "scene: expected a Python file, got broken.py, which cannot be parsed"),
        (["broken.py"], "(broken.py, line 1)"),
        (["empty.py"], "got empty.py. Write a function that returns one."),
        (["several.py"], "got several.py. Name one of several.py:one, several.py:two."),
        (["several.py:tree"], "expected one of one, three, two, got 'tree'. Did you mean 'three'?"),
        (["several.py:three"], "got several.py:three, where x has no default. Give each"),
        (["needy.py"], "got needy.py:f, where k, m has no default"),
        (["exits.py"], "exits.py, which exits. What is only for a program belongs below"),
        (["several.py:two"], "several.py:two: expected a function that returns a Scene, got int"),
        (["mine.py:_helper"], "function of mine.py: expected one of roessler, got '_helper'"),
        (["mine.py", "--set", "d=1"], "parameter of mine.py: expected one of a, b, c, t1, got 'd'"),
        (["mine.py", "--set", "c=x"], "c: expected a number"),
    ],
)
def test_misuse_is_one_line(folder, command, words, message):
    del folder
    code, out, err = command("jaxdyn", "run", *words)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert message in err


FAULTY = """import jaxdyn


def unpacks():
    def rate(t, y):
        x, v, w = y
        return [v, -x]

    return jaxdyn.ode(rate, [1.0, 0.0])


def misspells():
    return jaxdyn.ode(lambda t, y: [y[1], -Y[0]], [1.0, 0.0])


def calls():
    return jaxdyn.ode(lambda t, y: -y, 1.0, labels="x")


def misuses():
    return jaxdyn.ode(lambda t, y: -y, [1.0], names=["x", "x"])
"""


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (
            "unpacks",
            'faulty.py, line 6, in rate: "x, v, w = y" raised ValueError: not enough values to '
            "unpack (expected 3, got 2)",
        ),
        ("misspells", "raised NameError: name 'Y' is not defined"),
        ("calls", "raised TypeError: ode() got an unexpected keyword argument 'labels'"),
        ("misuses", "error: names: expected"),
    ],
)
def test_an_error_of_a_line_of_the_file_names_the_line(folder, command, function, message):
    (folder / "faulty.py").write_text(FAULTY)
    code, out, err = command("jaxdyn", "run", f"faulty.py:{function}")
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert message in err


def test_an_error_of_this_library_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError), _scene_files.locate_errors():
        _ = 1 / 0


TILTED = """
import jaxdyn


def tilted(a=0.5):
    return jaxdyn.ode(lambda t, y, p: [p * y[0] - y[0] ** 3 + 0.05], [0.7], 10.0, params=a)
"""


def test_a_diagram_of_it_is_shown_if_the_scene_is_named(folder, command):
    (folder / "tilted.py").write_text(TILTED)
    words = ("--parameter", "a", "--within", "-1,1", "--save", "tilted.jsonl")
    code, first, err = command("orbits", "diagram", "tilted.py", *words, "--json")
    assert code == 0, err
    code, _, err = command("orbits", "show", "tilted.jsonl")
    assert code == 2
    assert "Name the function that makes it: --scene FILE.py:NAME" in err
    code, out, err = command("orbits", "show", "tilted.jsonl", "--scene", "tilted.py", "--json")
    assert code == 0, err
    assert json.loads(out)["equilibria"] == json.loads(first)["equilibria"]
    code, _, err = command("orbits", "show", "tilted.jsonl", "--scene", "tilted.py", "--set", "a=1")
    assert code == 2
    assert "--set: expected none for this file, got a=1" in err


def test_a_scene_has_the_name_of_its_function_unless_it_has_its_own(folder):
    named = PLAIN.replace("params=k)", "params=k, name='my decay')")
    (folder / "named.py").write_text(named)
    made = [
        entry(f"{file}.py:{maker}").make()
        for file, maker in (("mine", "roessler"), ("plain", "fall"), ("named", "fall"))
    ]
    assert [scene.name for scene in made] == ["roessler", "fall", "my decay"]


@pytest.mark.parametrize("name", ["planets.txt", "vdp.od", "orbits/eight.json"])
def test_a_file_of_another_kind_is_recognised(name):
    with pytest.raises(ValueError, match=r"FILE\.py:NAME or FILE\.ode, got .*read_bodies"):
        entry(name)
