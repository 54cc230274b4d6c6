"""The command `orbits basins`."""

import functools
import json

import pytest

WELLS = '''
import jaxdyn

def wells(load=0.0):
    """A particle in two wells, with friction and a load."""
    def rate(t, y, load):
        return [y[1], load + y[0] - y[0] ** 3 - y[1]]
    return jaxdyn.ode(rate, [0.0, 0.0], 30.0, names=["x", "v"], params=load)
'''


@pytest.fixture
def basins(command, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(WELLS)
    words = ("--grid", "x=-1.9:1.9:8", "--grid", "v=-1.9:1.9:8")
    return functools.partial(command, "orbits", "basins", f"{file}:wells", *words)


@pytest.mark.slow
def test_basins_are_printed_drawn_and_kept(basins, tmp_path):
    picture, kept = tmp_path / "wells.png", tmp_path / "wells.jsonl"
    code, out, _ = basins("--plot", picture, "--save", kept)
    assert code == 0
    assert "50.00 +-" in out
    assert "stable equilibrium at" in out
    assert picture.stat().st_size > 10_000
    size = kept.stat().st_size
    code, out, _ = basins("--save", kept, "--json")
    assert code == 0
    assert kept.stat().st_size == size
    found = json.loads(out)
    assert found["names"] == ["x", "v"]
    assert found["fractions"] == [0.5, 0.5, 0.0]
    assert sorted(round(one["point"][0], 9) for one in found["attractors"]) == [-1.0, 1.0]


@pytest.mark.slow
def test_tipping_points_along_a_parameter(basins, tmp_path):
    picture, kept = tmp_path / "tipping.png", tmp_path / "tipping.jsonl"
    words = ("--along", "load", "0", "0.6", "--values", "4", "--save", kept, "--plot", picture)
    code, out, _ = basins(*words)
    assert code == 0
    assert "ends between 0.2 and 0.4" in out  # 2 / 27^(1/2) = 0.385
    assert picture.stat().st_size > 10_000
    assert len(list(tmp_path.glob("tipping_*.jsonl"))) == 4
    code, out, _ = basins(*words, "--json")
    found = json.loads(out)
    assert found["parameter"] == "load"
    assert [point["begins"] for point in found["tipping"]] == [False]


def test_what_it_refuses(basins, command):
    assert "--along: expected NAME LOW HIGH" in basins("--along", "load", "1", "0")[2]
    assert "--values" in basins("--along", "load", "0", "1", "--values", "1")[2]
    assert "--along: expected one of load" in basins("--along", "mass", "0", "1")[2]
    assert "grid: expected one of" in basins("--grid", "z=1")[2]
    assert (
        "--plot: expected --grid for two"
        in basins("--grid", "x=1", "--grid", "v=1", "--grid", "q=1", "--plot", "a.png")[2]
    )
    assert "NAME=A:B:N" in command("orbits", "basins", "lorenz", "--grid", "x")[2]
    assert "--title" in basins("--title", "wells")[2]
