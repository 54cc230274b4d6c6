"""Two programs with one file of a continuation: one writes it, the other is told."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers import forge

import jaxdyn
from jaxdyn import scenes
from jaxdyn.continuation import checkpoint, load
from jaxdyn.files.digests import json_text

MEMBERS = 12
LONGEST = 100.0  # [s] that a process may take
_RUN = """
import sys, time, jaxdyn
jaxdyn.configure()
from test_two_programs import followed
followed(sys.argv[1], report=lambda member: time.sleep(float(sys.argv[2])))
"""


def lorenz(rho):
    return scenes.lorenz(rho=rho)


def followed(path=None, **options):
    start = [7.0, 7.0, 19.0]
    return jaxdyn.continue_equilibria(lorenz, 20.0, start, members=MEMBERS, path=path, **options)


def begun(path: Path, pause: float) -> subprocess.Popen:
    where = {"PYTHONPATH": ":".join([os.path.dirname(__file__), *sys.path])}
    command = [sys.executable, "-c", _RUN, str(path), str(pause)]
    return subprocess.Popen(command, env=os.environ | where, stderr=subprocess.PIPE, text=True)


def lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def wait_for_lines(n: int, path: Path, run: subprocess.Popen) -> None:
    until = time.monotonic() + LONGEST
    while lines(path) < n:
        assert run.poll() is None
        assert time.monotonic() < until
        time.sleep(0.01)


def parameters_in(path: Path) -> list[float]:
    (found,) = load(path, lorenz)
    return found.parameters.tolist()


@pytest.mark.slow
def test_the_second_program_is_told_and_goes_on_when_the_first_is_killed(tmp_path):
    path = tmp_path / "run.jsonl"
    whole = followed()
    with begun(path, 1e3) as first:
        wait_for_lines(2, path, first)
        before = path.read_bytes()
        with begun(path, 0.0) as second:
            _, said = second.communicate(timeout=LONGEST)
        assert second.returncode == 1
        assert "expected a file that only this program writes" in said
        assert "Wait until it has ended, or give another path." in said
        with pytest.raises(ValueError, match="which another one writes now"):
            followed(path)
        assert path.read_bytes() == before
        first.send_signal(signal.SIGKILL)
        first.wait(LONGEST)
    with begun(path, 0.2) as third:  # goes on from there, and is killed too
        wait_for_lines(3, path, third)
        third.send_signal(signal.SIGKILL)
        third.wait(LONGEST)
    np.testing.assert_array_equal(followed(path).states, whole.states)
    assert parameters_in(path) == whole.parameters.tolist()


@pytest.mark.slow
def test_two_programs_that_start_together_leave_one_family(tmp_path):
    path = tmp_path / "run.jsonl"
    both = [begun(path, 0.05) for _ in range(2)]
    said = [one.communicate(timeout=LONGEST)[1] for one in both]
    assert 0 in [one.returncode for one in both]
    for one, text in zip(both, said, strict=True):
        assert one.returncode == 0 or "only this program writes" in text
    found = parameters_in(path)
    assert found == followed().parameters.tolist()
    assert len({*found}) == MEMBERS


def records_of(path: Path) -> list[dict]:
    found = [json.loads(line) for line in path.read_text().splitlines()]
    return [{key: x for key, x in record.items() if key != "digest"} for record in found]


def test_steps_of_two_runs_in_one_file_are_refused(tmp_path):
    path = tmp_path / "run.jsonl"
    followed(path)
    header, begin, *steps, end = records_of(path)
    assert [step["number"] for step in steps] == list(range(MEMBERS - 1))
    for mixed, message in (
        ([header, begin, steps[0], steps[0], *steps[1:], end], "steps in order, got number 0 in"),
        ([header, begin, *steps[:2], *steps[:2]], "the place of 2. Two programs wrote it at the"),
        ([header, begin, *steps[1:], end], "steps in order, got number 1 in the place of 0"),
        ([header, begin, begin, *steps, end], "walks in order, got number 0 in the place of 1"),
        ([header, begin, {**steps[0], "number": "0"}], "file: expected int"),
        ([header, begin, {"walk": 0, "step": steps[0]["step"]}], "file: expected int"),
    ):
        path.write_bytes(b"".join(map(json_text, mixed)))
        for read in (lambda: load(path, lorenz), lambda: followed(path)):
            with pytest.raises(ValueError, match=message):
                read()
    forge(path, header)
    with pytest.raises(ValueError, match=r"equilibria or curve, got .*none"):
        load(path, lorenz)


def test_a_walk_writes_its_file_alone(tmp_path):
    path = tmp_path / "run.jsonl"
    log = checkpoint.Log(path)

    def report(member) -> None:
        with pytest.raises(ValueError, match="which another one writes now"):
            followed(path)
        reported.append(member)

    reported = []
    jaxdyn.continue_equilibria(lorenz, 20.0, [7.0, 7.0, 19.0], members=2, path=log, report=report)
    assert len(reported) == 2
    checkpoint.Log(path).note({"by": "another"})
    with pytest.raises(ValueError, match="which another one has changed"):
        log.note({"by": "this"})
