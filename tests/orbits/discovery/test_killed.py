"""A search that is killed at any moment goes on from its file and loses nothing."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from two_cycles import two_cycles

import orbits
from jaxdyn.files.layout import Layout
from orbits.discovery import journal as table

SAMPLES = 6
LONGEST = 600  # seconds that a process may take
_SEARCH = """
import sys, jaxdyn
from concurrent.futures import ThreadPoolExecutor
jaxdyn.configure()
from test_killed import searched
searched(path=sys.argv[1], executor=ThreadPoolExecutor(1))
"""


def searched(**options):
    box = orbits.Box((0.6, 0.6), (1.6, 1.6))
    return orbits.search(two_cycles(), box, SAMPLES, longest=3.5, windows=2, chunk=1, **options)


def begun(path, code=_SEARCH):
    where = {"PYTHONPATH": ":".join([os.path.dirname(__file__), *sys.path])}
    command = [sys.executable, "-c", code, str(path)]
    return subprocess.Popen(command, env=os.environ | where)


def wait_for(condition, run) -> None:
    """Wait until a condition holds or the process has ended."""
    until = time.monotonic() + LONGEST
    while not condition() and run.poll() is None:
        assert time.monotonic() < until, "the process does not go on"
        time.sleep(0.005)


def lines(path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


@pytest.mark.slow
def test_a_search_that_is_killed_again_and_again_ends_with_the_same_table(tmp_path):
    path = tmp_path / "search.jsonl"
    random = np.random.default_rng(3)
    before = []
    for wanted in (1, 2, 4):  # its first line, its first chunk, its third
        run = begun(path)
        wait_for(lambda wanted=wanted: lines(path) >= wanted, run)
        time.sleep(0.1 * random.random())
        run.send_signal(signal.SIGKILL)
        run.wait(LONGEST)
        _, chunks = table.read(path)
        assert all(chunk in chunks for chunk in before)
        before = chunks
    run = begun(path)
    assert run.wait(LONGEST) == 0
    whole = searched()
    again = searched(path=path)
    assert again.finds == whole.finds
    assert again.counts == whole.counts
    assert [chunk.number for chunk in table.read(path)[1]] == list(range(SAMPLES))
    assert lines(path) == 1 + SAMPLES


_BASINS = """
import sys, jaxdyn
jaxdyn.configure()
from test_killed import newtons
newtons(sys.argv[1])
"""


def newton(y):
    square = y[0] ** 2 + y[1] ** 2
    return [0.5 * (y[0] + y[0] / square), 0.5 * (y[1] - y[1] / square)]


def newtons(path):
    side = np.linspace(-1.9, 1.9, 400)
    return orbits.map_basins(newton, {"x": side, "y": side}, steps=1000, path=path)


@pytest.mark.slow
def test_basins_that_are_killed_again_and_again_end_with_the_same_labels(tmp_path):
    path = tmp_path / "newton.jsonl"
    for wanted in (1, 3, 6):
        run = begun(path, _BASINS)
        wait_for(lambda wanted=wanted: lines(path) >= wanted, run)
        run.send_signal(signal.SIGKILL)
        run.wait(LONGEST)
    again, whole = newtons(path), newtons(tmp_path / "whole.jsonl")
    assert np.array_equal(again.labels, whole.labels)
    assert path.read_bytes() == (tmp_path / "whole.jsonl").read_bytes()


def test_a_write_that_is_killed_leaves_the_old_file_or_the_new_one(tmp_path):
    path = tmp_path / "record.json"
    code = (
        "import sys\n"
        "from jaxdyn.files.layout import Layout\n"
        "for i in range(10**9):\n"
        "    record = {'number': i, 'rest': [i] * 2000}\n"
        "    Layout('x', 1, 'a test').write(sys.argv[1], record)\n"
    )
    command = [sys.executable, "-c", code, str(path)]
    run = subprocess.Popen(command, env=os.environ | {"PYTHONPATH": ":".join(sys.path)})
    wait_for(path.exists, run)
    time.sleep(0.2)
    run.send_signal(signal.SIGKILL)
    run.wait(LONGEST)
    record = Layout("x", 1, "a test").read(path)
    assert record["rest"] == [record["number"]] * 2000
