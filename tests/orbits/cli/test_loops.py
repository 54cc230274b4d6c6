"""The command `orbits loops`: the table, one orbit, and what is drawn where there is none."""

import functools
import json

import pytest


@pytest.fixture
def loops(command):
    return functools.partial(command, "orbits", "loops")


def test_the_table_and_its_picture(loops, tmp_path):
    code, out, _ = loops("--plot", tmp_path / "least.png")
    assert code == 0
    assert "least loops" in out
    assert "Every exponent has closed orbits with loops." in out
    assert (tmp_path / "least.png").stat().st_size > 20_000
    code, out, _ = loops("--n=-3.5,-2,-1,1,10", "--json")
    found = json.loads(out)
    assert (code, found["loops"], found["turns"]) == (0, [0, 1, 3, 2, 3], [0, 1, 2, 1, 1])
    assert found["circle"][0] is None
    assert "only circles close" in found["message"]


@pytest.mark.slow
def test_one_orbit(loops, tmp_path):
    words = ("--n=-1", "--turns", 2, "--loops", 3)
    code, out, _ = loops(*words, "--plot", tmp_path / "three.png")
    assert code == 0
    assert out.startswith("3 loops in 2 turns: from r = 1 across at 0.313180433808")
    assert (tmp_path / "three.png").stat().st_size > 10_000
    code, out, err = loops(*words, "--json")
    found = json.loads(out)
    assert (code, found["ok"], found["loops"]) == (0, True, 3)
    assert found["closure"] <= 1e-12
    assert "3 loops in 2 turns" in err


def test_an_orbit_that_does_not_exist_is_a_rosette(loops, tmp_path):
    words = ("--n=-1", "--turns", 1, "--loops", 1)
    code, out, _ = loops(*words, "--plot", tmp_path / "ring.png")
    assert code == 1
    assert "no orbit: Under r^-1 the apsidal angle over pi is monotone" in out
    assert "the actual motion is drawn in" in out
    assert (tmp_path / "ring.png").stat().st_size > 20_000
    code, out, _ = loops(*words, "--json")
    answer = json.loads(out)
    assert (code, answer["ok"]) == (1, False)
    assert "Choose turns / loops between" in answer["message"]
    none = tmp_path / "none.png"
    code, out, _ = loops("--n=-4", "--turns", 1, "--loops", 1, "--plot", none)
    assert code == 1
    assert "there is nothing to draw" in out
    assert not none.exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--n=x",), "--n: expected comma-separated numbers"),
        (("--n=nan",), "n: expected finite numbers"),
        (("--turns", "1"), "--turns and --loops: expected both or neither"),
        (("--turns", "1", "--loops", "3"), "--n: expected one exponent with --turns and --loops"),
        (("--n=-1", "--turns", "2", "--loops", "4"), "turns: expected no common factor"),
        (("--n=-4,2", "--plot", "one.png"), "--n: expected two exponents above -3 for a picture"),
        (("--plot", "a.bmp"), "--plot: expected a file name ending in"),
    ],
)
def test_misuse_is_exit_code_2_and_one_line(loops, words, message):
    code, out, err = loops(*words)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert message in err
