"""`jaxdyn course`, `jaxdyn run --play` and `jaxdyn gallery` on the command line."""

import json
import webbrowser
from pathlib import Path

import pytest


@pytest.fixture
def opened(monkeypatch):
    """The addresses that a browser was asked to open."""
    found = []
    monkeypatch.setattr(webbrowser, "open", lambda url: bool(found.append(url)) or True)
    return found


def test_a_problem_is_run_and_said_to_hold(command, tmp_path):
    ran = command("jaxdyn", "course", "54", "--plot", tmp_path / "balance.png")
    assert ran.code == 0
    assert ran.out.startswith("54. ")
    assert "holds" in ran.out
    assert "fails" not in ran.out


def test_a_problem_is_found_by_its_name_and_written_as_json(command):
    ran = command("jaxdyn", "course", "cross_product", "--json")
    found = json.loads(ran.out)
    assert found["number"] == 4
    assert found["holds"]
    assert all(check["holds"] for check in found["checks"])
    assert found["equations"] == []


def test_a_problem_becomes_one_file_on_which_its_scene_runs(command, tmp_path):
    path = tmp_path / "pendulum.html"
    ran = command("jaxdyn", "course", "22", "--live", path)
    assert ran.code == 0
    assert f"shown in {path}" in ran.out
    text = path.read_text()
    assert '<div class="live">' in text
    assert "What happens on the Moon" in text
    assert "<summary>Answer</summary>\n<p>All seven give theta&#x27;&#x27;" in text
    assert len(text) < 200_000
    ran = command("jaxdyn", "course", "22", "--live", tmp_path / "pendulum.png")
    assert ran.code == 2
    assert ".html" in ran.err


@pytest.mark.slow
def test_long_checks_are_named_and_run_where_they_are_asked_for(command):
    words = ("jaxdyn", "course", "37")
    short, whole = command(*words), command(*words, "--check")
    assert (short.code, whole.code) == (0, 0)
    assert "`jaxdyn course 37 --check`" in short.out
    assert "--check`" not in whole.out
    assert short.out.count("holds") < whole.out.count("holds")
    assert "(a) The centre moves" in short.out


@pytest.mark.slow
def test_equations_are_printed_where_the_problem_asks_for_them(command):
    printed = "  (1 + 4 c^2 x^2) x'' + 4 c^2 x x'^2 + 2 c g x = 0\n"
    assert printed in command("jaxdyn", "course", "30").out
    assert "Newton's law\n" not in command("jaxdyn", "course", "16").out  # periods are asked for


def test_code_is_printed_where_it_is_asked_for(command):
    assert "def solve(page: Page)" in command("jaxdyn", "course", "4", "--code").out


@pytest.mark.slow
def test_a_motion_is_played_in_the_browser(command, opened):
    ran = command("jaxdyn", "run", "pendulum", "--t1", "1", "--samples", "20", "--play")
    assert ran.code == 0
    assert "opened " in ran.out
    (url,) = opened
    assert url.endswith("/pendulum.html")
    assert 'class="player"' in Path(url.removeprefix("file://")).read_text()


@pytest.mark.slow
def test_without_a_browser_the_page_is_named(command, monkeypatch):
    monkeypatch.setattr(webbrowser, "open", lambda url: False)
    ran = command("jaxdyn", "run", "pendulum", "--t1", "1", "--samples", "20", "--play")
    assert "no browser: open " in ran.out


@pytest.mark.parametrize(
    "words", [("course", "62"), ("course", "zero"), ("gallery", "--only", "62")]
)
def test_what_is_no_problem_is_refused_in_one_line(command, words):
    ran = command("jaxdyn", *words)
    assert ran.code == 2
    assert ran.err.count("\n") == 1
    assert "jaxdyn list --problems" in ran.err


def test_an_empty_choice_of_pages_is_refused(command):
    assert "--only: expected numbers or names" in command("jaxdyn", "gallery", "--only", " ").err


def test_a_missing_package_is_named(command, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    ran = command("jaxdyn", "gallery")
    assert ran.code == 2
    assert "pip install 'jaxdyn[docs]'" in ran.err
