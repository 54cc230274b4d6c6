"""The benchmarks run, and read the right number off a work-precision curve. No time is asserted."""

import numpy as np
import pytest

from benchmarks import __main__ as command_line
from benchmarks import figure_eight
from benchmarks._timing import Row, Times, at_error, interleaved, work_precision

EXACT = 1e-14  # relative, two formulas for one number


def _same(seconds):
    return Times(seconds, seconds)


def test_time_at_an_error_is_linear_in_the_logarithms():
    # time = error^(-1/11): what a method of order 11 does.
    errors = [1e-6, 1e-9, 1e-13]
    times = [_same(e ** (-1 / 11)) for e in errors]
    assert at_error(errors, times, 1e-12).median == pytest.approx(1e12 ** (1 / 11), rel=EXACT)


def test_a_run_that_another_beats_in_both_does_not_count():
    best = at_error([1e-6, 1e-12], [_same(1.0), _same(4.0)], 1e-9)
    more = at_error([1e-6, 1e-8, 1e-12], [_same(1.0), _same(5.0), _same(4.0)], 1e-9)
    assert best == more
    assert best.minimum == pytest.approx(2.0, rel=EXACT)


def test_an_error_that_no_run_reaches_has_no_time():
    runs = [1e-6, 1e-9], [_same(1.0), _same(2.0)]
    assert np.isnan(at_error(*runs, 1e-10)).all()
    assert at_error(*runs, 1e-3) == _same(1.0)


def test_slow_runs_take_part_in_fewer_rounds():
    calls = {"slow": 0, "quick": 0}

    def run(name):
        calls[name] += 1

    interleaved({name: lambda name=name: run(name) for name in calls}, rounds=8, slow=1e9)
    assert calls["slow"] == calls["quick"]
    before = calls["slow"]
    interleaved({"slow": lambda: run("slow")}, rounds=8, slow=1e-12)
    assert calls["slow"] - before < 8


def test_our_three_ways_reach_the_true_end_and_give_rows():
    methods = figure_eight.ours((1e-7, 1e-13))
    for method in methods.values():
        end = method.build(1e-13)()
        assert np.max(np.abs(end - np.array(figure_eight.END))) < 1e-12
    truth = np.array(figure_eight.END)
    rows = work_precision("eight", methods, truth, (1e-6, 1e-12), rounds=1)
    assert [row.name.split(": ")[1] for row in rows] == [
        "build and first run",
        "error 1e-06",
        "error 1e-12",
    ]
    assert all(np.isfinite(list(row.times.values())).all() for row in rows)


def test_what_got_slower_is_said():
    now = command_line.as_json([Row("a", {"x": _same(1.4), "y": _same(1.2)})])
    before = command_line.as_json([Row("a", {"x": _same(1.0), "y": _same(1.0)})])
    assert command_line.slower(now, before) == ["a, x: 1.40 times as long"]
    assert command_line.slower(before, now) == []
