"""Files that grow: written by one program alone or by several in turn; after interruptions."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import filelock
import pytest

from jaxdyn.files import journal
from jaxdyn.files.digests import json_text
from jaxdyn.files.journal import Journal
from jaxdyn.files.layout import Layout

LAYOUT = Layout("x", 1, "a test")
LONGEST = 100.0  # [s] that a process may take
#: Waits for a line on its input with the file to itself.
_HOLDS = """
import sys
from jaxdyn.files.journal import Journal
from jaxdyn.files.layout import Layout
file = Journal(sys.argv[1], Layout("x", 1, "a test"), {}, 60.0)
with file.alone():
    file.add({"number": -1})
    print("alone", flush=True)
    sys.stdin.readline()
"""
_ADDS = """
import sys
from jaxdyn.files.journal import Journal
from jaxdyn.files.layout import Layout
file = Journal(sys.argv[1], Layout("x", 1, "a test"), {}, 60.0)
for number in range(150):
    file.add({"by": sys.argv[2], "number": number, "more": [number] * 2000})
"""


def opened(path: Path, patience: float = 0.2) -> Journal:
    return Journal(path, LAYOUT, {}, patience)


def run(code: str, *args) -> subprocess.Popen:
    where = os.environ | {"PYTHONPATH": ":".join(sys.path)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", code, *map(str, args)], env=where, **pipes)


def test_another_program_is_told_until_the_first_one_is_killed(tmp_path):
    path = tmp_path / "run.jsonl"
    waiting = opened(path)
    with run(_HOLDS, path) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "alone\n"
        for refused in (lambda: opened(path), lambda: waiting.add({}), waiting.alone().__enter__):
            with pytest.raises(ValueError, match=r"path: .* another one writes now. Wait until"):
                refused()
        assert len(journal.read(path, LAYOUT)[1]) == 1  # it can be read meanwhile
        holder.send_signal(signal.SIGKILL)
        holder.wait(LONGEST)
    # What was opened before does not know what the other one added.
    with pytest.raises(ValueError, match=r"path: .* which another one has changed\. Run it again"):
        waiting.alone().__enter__()
    again = opened(path)
    assert again.records == [{"number": -1}]
    with again.alone(), again.alone():
        again.add({"number": 1})
    assert opened(path).records[1:] == [{"number": 1}]


def test_several_programs_add_lines_in_turn(tmp_path):
    path = tmp_path / "run.jsonl"
    both = [run(_ADDS, path, name) for name in "ab"]
    assert [one.wait(LONGEST) for one in both] == [0, 0]
    for one in both:
        one.communicate()
    records = opened(path).records
    for name in "ab":
        assert [x["number"] for x in records if x["by"] == name] == list(range(150))


def test_two_names_of_one_file_have_one_lock(tmp_path):
    path, link = tmp_path / "run.jsonl", tmp_path / "link.jsonl"
    link.symlink_to(path)
    file = opened(path)
    with file.alone(), pytest.raises(ValueError, match="another one writes now"):
        opened(link)
    opened(link).add({"number": 1})
    assert opened(path).records == [{"number": 1}]


def test_a_file_that_is_gone_or_changed_is_not_written_on(tmp_path):
    path = tmp_path / "run.jsonl"
    file = opened(path)
    journal.remove(path)
    assert not any(tmp_path.iterdir())
    with pytest.raises(ValueError, match="another one has changed"):
        file.alone().__enter__()


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (NotImplementedError("no locks here"), "No locks available"),
        (PermissionError(13, "Permission denied"), "Permission denied"),
    ],
)
def test_where_there_are_no_locks_nothing_is_written(tmp_path, monkeypatch, error, said):
    def acquire(self):
        raise error

    monkeypatch.setattr(filelock.BaseFileLock, "acquire", acquire)
    path = tmp_path / "run.jsonl"
    with pytest.raises(ValueError, match=f"path: expected a file that can be written.*{said}"):
        opened(path)
    assert not path.exists()


def test_an_error_of_the_work_is_not_one_of_the_file(tmp_path):
    file = opened(tmp_path / "run.jsonl")
    with pytest.raises(OSError, match="of the work"), file.alone():
        raise OSError("of the work")
    with file.alone():
        file.add({})


def test_what_an_interruption_leaves_is_ignored_and_nothing_else(tmp_path):
    path = tmp_path / "run.jsonl"
    opened(path).add({"number": 1})
    data = path.read_bytes()
    line = json_text({"number": 2})
    for left in (line[:1], line[:9], line[:-1], line[:9] + bytes(100), bytes(100)):
        path.write_bytes(data + left)
        assert opened(path).records == [{"number": 1}]
        assert path.read_bytes() == data  # and a new line begins in its place
    for left in (b"x", b"{}", line[:-1] + b" ", line[:-1] + b"\0", b'["number"'):
        path.write_bytes(data + left)
        with pytest.raises(ValueError, match="path: expected a x file, got"):
            opened(path)
        assert path.read_bytes() == data + left


def test_a_line_whose_digest_is_of_its_values_is_read(tmp_path):
    path = tmp_path / "run.jsonl"
    opened(path)
    old = {"number": 1, "digest": journal.digest_of_values({"number": 1})}
    with open(path, "a") as file:
        file.write(json.dumps(old) + "\n")
    assert opened(path).records == [{"number": 1}]
    with open(path, "a") as file:
        file.write(json.dumps(old | {"number": 2}) + "\n")
    with pytest.raises(ValueError, match=r"was edited .*digest"):
        opened(path)


def test_a_file_of_another_kind_is_left_as_it_is(tmp_path):
    path = tmp_path / "other.jsonl"
    data = json_text({"format": "y", "version": 1}) + b'{"half a li'
    path.write_bytes(data)
    with pytest.raises(
        ValueError, match=r"path: expected format 'x', got 'y'\. Give the path of a"
    ):
        opened(path)
    assert path.read_bytes() == data
