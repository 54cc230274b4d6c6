"""What the default run leaves out and reports, seen in small runs of pytest."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import time
import pytest

@pytest.mark.sample("b")
@pytest.mark.parametrize("x", "abc")
def test_letters(x):
    pass

def test_busy():
    end = time.process_time() + 0.1
    while time.process_time() < end:
        pass
"""


@pytest.fixture
def run(tmp_path):
    """A function that runs tests with the plugin, in a process of its own."""

    def run(tests, *options, further=""):
        (tmp_path / "pytest.ini").write_text(
            "[pytest]\ntestpaths = test_it.py\nmarkers =\n  slow\n  sample\n  further\n"
        )
        (tmp_path / "tests").mkdir(exist_ok=True)
        (tmp_path / "tests" / "further.txt").write_text(further)
        (tmp_path / "test_it.py").write_text(tests)
        command = [sys.executable, "-m", "pytest", "-p", "costs", *options]
        settings = {
            "PYTHONPATH": str(Path(__file__).parent),
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
            "PYTEST_ADDOPTS": "",
        }
        return subprocess.run(
            command, cwd=tmp_path, env=os.environ | settings, text=True, capture_output=True
        )

    return run


def test_cases_beside_the_sample_are_slow(run):
    done = run(TESTS, "-m", "not slow", "-v")
    assert "test_letters[b]" in done.stdout
    assert "2 passed, 2 deselected" in done.stdout
    assert "4 passed" in run(TESTS).stdout


def test_a_sample_of_no_case_is_refused(run):
    done = run(TESTS.replace('"b"', '"b", "d"'))
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "test_it.py::test_letters has no cases ['d'] to sample." in done.stderr
    assert "1 passed" in run(TESTS.replace('"b"', '"d"'), "test_it.py::test_letters[a]").stdout


def test_what_costs_more_than_the_limit_is_listed_and_fails_if_asked(run):
    done = run(TESTS, "--cost-limit", "0.05")
    assert done.returncode == pytest.ExitCode.TESTS_FAILED
    assert "more than 0.05 s of processor time, and not marked slow" in done.stdout
    assert "s  test_it.py::test_busy" in done.stdout
    assert "4 passed" in done.stdout
    assert run(TESTS, "--cost-limit", "60").returncode == pytest.ExitCode.OK
    marked = TESTS.replace("def test_busy", "@pytest.mark.slow\ndef test_busy")
    assert run(marked, "--cost-limit", "0.05").returncode == pytest.ExitCode.OK
    assert "processor time" not in run(TESTS).stdout


def test_a_run_of_everything_leaves_further_ones_out(run):
    further = "test_it.py::test_letters[a]\ntest_it.py::test_busy\n"
    assert "2 passed, 2 deselected" in run(TESTS, "-m", "not further", further=further).stdout
    assert "2 passed, 2 deselected" in run(TESTS, "-m", "further", further=further).stdout
    for named in ("test_it.py::test_busy", "."):
        assert "deselected" not in run(TESTS, named, "-m", "not further", further=further).stdout


def test_a_further_one_that_is_not_there_is_refused(run):
    done = run(TESTS, further="test_it.py::test_lazy\n")
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "further.txt: there is no test test_it.py::test_lazy. Correct its line" in done.stderr


def test_costs_are_written(run, tmp_path):
    run(TESTS, "--costs", "costs.json")
    costs = json.loads((tmp_path / "costs.json").read_text())
    assert costs.keys() == {"test_it.py::test_letters[b]", "test_it.py::test_busy"}  # not slow
    assert costs["test_it.py::test_busy"] > 0.05
