"""The command `jaxdyn hard`: what it lists, prints and refuses, and its exit codes."""

import functools
import json

import pytest

from jaxdyn import hard
from jaxdyn.cli import docstrings
from jaxdyn.hard import collection
from jaxdyn.hard.case import absolute_error, relative_error


def _sum(value):
    return hard.Case("sum", "0.1 + 0.2 = 0.3", lambda: (hard.Figure("error", value, 1e-16),))


@pytest.fixture
def jaxdyn(command):
    return functools.partial(command, "jaxdyn", "hard")


@pytest.mark.parametrize(
    ("value", "passed", "code"), [(5e-17, True, 0), (2e-16, False, 1), (float("nan"), False, 1)]
)
def test_a_figure_out_of_its_bound_fails(jaxdyn, monkeypatch, value, passed, code):
    monkeypatch.setitem(collection.CASES, "sum", _sum(value))
    monkeypatch.setattr(docstrings, "hard_cases", lambda: {"sum"})
    done, out, _ = jaxdyn("sum", "--json")
    row, total = (json.loads(line) for line in out.splitlines())
    assert row.pop("seconds") >= 0
    assert total.pop("seconds") >= 0
    failed = int(not passed)
    of = "cases that fail, of 1"
    assert total == {"name": "total", "what": of, "figure": failed, "bound": 0, "pass": passed}
    figure = value if value == value else None
    assert row == {"name": "sum", "what": "error", "figure": figure, "bound": 1e-16, "pass": passed}
    assert done == code
    _, out, _ = jaxdyn("sum")
    assert ("holds" if passed else "too large") in out
    assert f"{int(passed)} of 1 cases hold" in out


def test_every_case_is_listed_with_what_must_hold(jaxdyn):
    code, out, _ = jaxdyn("--list")
    assert code == 0
    assert all(name in out for name in hard.CASES)


def test_an_unknown_case_is_refused_and_the_nearest_suggested(jaxdyn):
    code, _, err = jaxdyn("pythagoras")
    assert code == 2
    assert "expected one that `jaxdyn hard --list` shows" in err
    assert "Did you mean 'pythagorean'?" in err


def test_errors_of_other_shapes_are_within_no_bound():
    assert absolute_error([1.0, 2.0], [1.0, 2.5]) == 0.5
    assert relative_error([1.0, 2.0], [1.0, 2.5]) == pytest.approx(0.2, rel=1e-15)
    for error in (absolute_error, relative_error):
        assert not hard.Figure("times", error([1.0], [1.0, 1.0]), 1e-9).passed


def test_names_are_unique():
    named = [case.name for topic in collection.TOPICS for case in topic.CASES]
    assert len(named) == len(set(named))
