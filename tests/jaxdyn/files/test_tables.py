"""A motion as plain data: records and CSV files."""

import csv

import numpy as np
import pytest

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
    assert not tables.arrived(lost)


def test_units_are_left_out_where_there_are_none(tmp_path):
    motion = simulate(scenes.lorenz(), 0.1, samples=2)
    lines = tables.write_csv(tmp_path / "l.csv", motion).read_text().splitlines()
    assert lines[0] == "t,x,y,z"


def test_a_record_carries_the_warning():
    def stiff(scene, rtol):
        return simulate(scene, 1e-3, samples=2, rtol=rtol)

    motion = stiff(scenes.two_springs(c_a=1e6), 1e-8)
    record = tables.record(motion, end_error(motion, stiff, rtol=1e-8))
    assert record["warning"].startswith("The scene is stiff")
    assert record["status"] == "OK"
