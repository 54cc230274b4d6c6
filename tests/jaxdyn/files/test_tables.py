"""A motion as plain data: records and CSV files."""

import copy
import csv
import pickle

import numpy as np
import pytest
from helpers import refusal

import jaxdyn
from jaxdyn import end_error, scenes, simulate
from jaxdyn.files import tables


def test_a_csv_file_holds_all_digits(tmp_path):
    motion = simulate(scenes.cannonball(drag=0.1), 1.0, samples=5)
    path = tables.write_csv(tmp_path / "ball.csv", motion)
    head, *rows = csv.reader(path.read_text().splitlines())
    assert head == ["t [s]", "x [m]", "y [m]", "vx [m/s]", "vy [m/s]"]
    assert np.array_equal(np.array(rows, float), np.c_[motion.ts, motion.ys])
    with pytest.raises(ValueError, match=r"path: expected a file name ending in \.csv"):
        tables.write_csv(tmp_path / "ball.txt", motion)


def test_what_was_not_reached_is_empty(tmp_path):
    lost = simulate(scenes.cannonball(speed=1e200, drag=1.0), samples=3, throw=False)
    lines = tables.write_csv(tmp_path / "lost.csv", lost).read_text().splitlines()
    assert lines[-1].endswith(",,,,")
    assert not lost.ok


def test_units_are_left_out_where_there_are_none(tmp_path):
    motion = simulate(scenes.lorenz(), 0.1, samples=2)
    lines = tables.write_csv(tmp_path / "l.csv", motion).read_text().splitlines()
    assert lines[0] == "t,x,y,z"


@pytest.mark.slow
def test_a_record_carries_the_warning():
    def stiff(scene, rtol):
        return simulate(scene, 1e-3, samples=2, rtol=rtol)

    motion = stiff(scenes.two_springs(c_a=1e6), 1e-8)
    record = tables.record(motion, end_error(motion, stiff, rtol=1e-8))
    assert record["warning"].startswith("The scene is stiff")
    assert record["status"] == "OK"


def test_tables_are_read(tmp_path):
    motion = jaxdyn.simulate(jaxdyn.scenes.pendulum(), 1.0, samples=5)
    tables.write_csv(tmp_path / "swing.csv", motion)
    back = jaxdyn.read_csv(tmp_path / "swing.csv")
    assert list(back) == ["t", "theta", "theta_dot"]
    assert np.array_equal(back["theta"], motion["theta"])  # to the bit
    path = tmp_path / "track.txt"
    path.write_text("# of a video\nTime (ms);angle [deg];x [cm]\n100;90,0;1,5\n200;;2\n")
    back = jaxdyn.read_csv(path)
    assert back["t"].tolist() == [0.1, 0.2]
    assert back["angle"][0] == np.pi / 2
    assert np.isnan(back["angle"][1])
    assert np.allclose(back["x"], [0.015, 0.02], rtol=1e-15)
    path.write_text("mass A\nx,t\n,0\n1,0.5\n")
    back = jaxdyn.read_csv(path)
    assert np.isnan(back["x"][0])
    assert back["t"].tolist() == [0.0, 0.5]
    path.write_text("t x\n,5 ,1\n,75 ,2\n1,0 ,3\n")  # decimal commas
    assert jaxdyn.read_csv(path)["t"].tolist() == [0.5, 0.75, 1.0]
    assert jaxdyn.read_csv(path, names=[]) == {}
    path.write_text("0 1.0 2.0\n1 3.0 4.0\n")
    back = jaxdyn.read_csv(path, names=["t", "x", "vx"])
    assert back["vx"].tolist() == [2.0, 4.0]
    path.write_text('"0,0","1,5"\n"0,5","2,5"\n')
    assert jaxdyn.read_csv(path, names=["t", "x"])["x"].tolist() == [1.5, 2.5]


@pytest.mark.parametrize(
    "text",
    [
        "mass A\nt,x\n0,1\n0.5,\n",  # of Tracker, which follows points in videos
        ",mass A\nt,x\n0,1\n0.5,\n",
        'mass A\nt,x\n"0,0","1,000"\n"0,5",\n',
        "mass A\t\t\nt\tx\n0\t1\n0.5\t\n",
        "sep=;\nt;x\n0;1\n0,5;\n",  # of Excel
        "t,x,\n0,1,\n0.5,,\n",
        "t,x\n0.0D0,1.0d+00\n5.0D-1,nan\n",  # of Fortran
        '\ufeff"t","x"\r\n"0","1"\r\n".5",""\r\n',
    ],
)
def test_tables_as_other_programs_write_them(tmp_path, text):
    path = tmp_path / "track.csv"
    path.write_text(text, encoding="utf-8")
    back = jaxdyn.read_csv(path)
    assert list(back) == ["t", "x"]
    assert back["t"].tolist() == [0.0, 0.5]
    assert back["x"][0] == 1.0
    assert np.isnan(back["x"][1])


@pytest.mark.parametrize(
    "text",
    [
        "name m x [km]\nSun 1 0\nEarth 3e-6 1.5E+08\n",
        "Planets of today\n\nname\tm\tx [km]\nSun\t1\t0\nEarth\t3e-6\t1.5d8\n",
        "# made up\n# name m x (km)\nSun 1 0\n'Earth' 3e-6 1.5E+08\n".replace("'", '"'),
        'name;m;x [km]\nSun;1;0\n"Earth";0,000003;150000000\n',
        "name,m,x [km],\nSun,1,0,\nEarth,3e-6,1.5e8,\n",
    ],
)
def test_columns_of_text_are_read(tmp_path, text):
    path = tmp_path / "bodies.txt"
    path.write_text(text)
    back = jaxdyn.read_csv(path)
    assert back["name"].tolist() == ["Sun", "Earth"]
    assert back["m"].tolist() == [1.0, 3e-6]
    assert back["x"].tolist() == [0.0, 1.5e8]
    assert back.units == {"x": "km"}


def test_text_may_have_spaces_commas_and_gaps(tmp_path):
    path = tmp_path / "bodies.csv"
    path.write_text('x,name,kind\n1,"Moon, the",\n2,Halley\'s comet,ice\n')
    back = jaxdyn.read_csv(path)
    assert back["name"].tolist() == ["Moon, the", "Halley's comet"]
    assert back["kind"].tolist() == ["", "ice"]
    path.write_text('"Halley\'s comet" 1\n"1998 OR2" 2\nEros (A433) 3\n')
    back = jaxdyn.read_csv(path, names=["name", "x"])
    assert back["name"].tolist() == ["Halley's comet", "1998 OR2", "Eros (A433)"]
    # Numbers that cannot be read are no text.
    path.write_text("x;y\n1;1.234.5\n2;1.234.6\n")
    assert "Write one decimal point" in refusal(lambda: jaxdyn.read_csv(path))
    path.write_text("t,x\n0:10,1\n0:20,2\n")
    assert "got '0:10' in line 2, column t." in refusal(lambda: jaxdyn.read_csv(path))
    path.write_text("name x\nSun 1\nHalley's comet 2\n")
    said = refusal(lambda: jaxdyn.read_csv(path))
    assert "got 3 in line 3" in said
    assert "Put text with spaces or separators in quotation marks." in said
    path.write_text("Sun 1 1\nEarth 2 2\n")
    assert "Is a line of names missing?" in refusal(lambda: jaxdyn.read_csv(path))


@pytest.mark.parametrize("times", ["t", "time (s)", "Time"])
def test_a_temperature_is_no_time(tmp_path, times):
    path = tmp_path / "cooling.csv"
    path.write_text(f"{times},T [K]\n0,300\n1,290\n")
    back = jaxdyn.read_csv(path)
    assert list(back) == ["t", "T"]
    assert back["T"].tolist() == [300.0, 290.0]
    path.write_text("T,x\n0,3\n1,2\n")
    assert list(jaxdyn.read_csv(path)) == ["t", "x"]


def test_other_tables_are_refused(tmp_path):
    path = tmp_path / "table.csv"

    def refused(text, **options):
        path.write_text(text)
        return refusal(lambda: jaxdyn.read_csv(path, **options))

    assert "Pass names=" in refused("0,1\n1,2\n")
    assert "2 columns in each line" in refused("t,x\n1,2,3\n")
    assert "expected numbers" in refused("t,x\n1,2\n2,two\n")
    assert "x twice" in refused("t,x,x\n1,2,3\n")
    assert "Pass names=" in refused('"0,0","1,5"\n"0,5","2,5"\n')
    assert "or one between thousands?" in refused('t,x\n0,"1,250"\n1,"2,500"\n')
    for text, cell, name in (
        ("# a\n\nt,x\n0,1\n1,1.234.5\n", "'1.234.5' in line 5", "x"),
        ("t;x [m]\n0;1\n1.234,5;1\n", "'1.234,5' in line 3", "t"),
        ('t,x\n0,"1,5"\n1,"2,5,6"\n', "'2,5,6' in line 3", "x"),
    ):
        said = refused(text)
        assert f"got {cell}, column {name}. Write one decimal point or comma" in said
    assert "line 3, column x [m]. Leave gaps empty." in refused("t,x [m]\n0,1\n1,two\n")
    assert "got 1 in line 4: ['1']" in refused("t,x\n0,1\n\n1\n")
    assert "got 'a'" in refused("t,x\na,1\n0,1\n")  # no title: it has as many columns
    assert "got 's'" in refused("Run 1\nt,x\ns,m\n0,1\n0.5,2\n")  # no names below the names
    assert "got 'NA'" in refused("title\nt,x\nNA,1\n0.5,2\n")
    assert "without lines" in refused("# nothing\n")
    assert "expected lines of numbers below the names" in refused("t,x\n")
    path.write_bytes(b"\xff\xfe\x00")
    assert "a table as text" in refusal(lambda: jaxdyn.read_csv(path))
    assert "readable file" in refusal(lambda: jaxdyn.read_csv(tmp_path / "none.csv"))


def test_copies_and_unions_of_tables_have_their_units(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text("t,x [km],y [km]\n0,1,2\n1,2,3\n")
    table = jaxdyn.read_csv(path)
    assert table.copy().units == table.units == {"x": "km", "y": "km"}
    changed = table | {"x": 1000 * table["x"], "z": table["y"]}
    assert changed.units == {"y": "km"}
    assert list(changed) == ["t", "x", "y", "z"]
    assert (table | table).units == table.units
    table |= {"x": 1000 * table["x"]}
    assert table.units == {"y": "km"}


def test_a_column_that_is_assigned_has_no_unit_until_one_is_stated(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text("t,x [km],y [km]\n0,1,2\n1,2,3\n")
    table = jaxdyn.read_csv(path)
    for again in (copy.copy(table), copy.deepcopy(table), pickle.loads(pickle.dumps(table))):
        assert again.units == {"x": "km", "y": "km"}
        assert list(again) == list(table)
    table["x"] = 1000 * table["x"]
    table["z"] = table["x"]
    assert table.units == {"y": "km"}
    assert table.replaced == {"x": "km"}
    table.units["x"] = "m"
    table["y"] *= 1000
    assert table.units == {"x": "m"}
    changed = jaxdyn.read_csv(path)
    changed.update(x=changed["y"])
    assert changed.units == {"y": "km"}
    assert pickle.loads(pickle.dumps(changed)).replaced == changed.replaced == {"x": "km"}


def test_units_of_columns_are_kept_or_become_si_units(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text(
        "t (min),x (km),v [mm/s^2],omega (rpm),turn (deg/s),u (V),n\n1,2,3,60,180,5,6\n"
    )
    back = jaxdyn.read_csv(path)
    assert {name: float(column[0]) for name, column in back.items()} == pytest.approx(
        {"t": 1, "x": 2, "v": 0.003, "omega": 2 * np.pi, "turn": np.pi, "u": 5, "n": 6}
    )
    units = {"t": "min", "x": "km", "v": "m/s^2", "omega": "rad/s", "turn": "rad/s", "u": "V"}
    assert back.units == units
