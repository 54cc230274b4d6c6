"""Files that cannot be written are refused before the work, by all that write; or in one line."""

import errno
import os
import tempfile

import pytest

import jaxdyn
from jaxdyn import drawing, scenes
from jaxdyn.files import output_files, tables
from jaxdyn.files.output_files import writable
from orbits.discovery import journal as table


@pytest.fixture
def motion():
    return jaxdyn.simulate(scenes.cannonball(), samples=3)


@pytest.mark.parametrize(
    ("path", "got"),
    [
        ("no/such/folder/x.txt", r"a file in a folder that exists, got .*Make the folder first"),
        ("file/x.txt", r"a file in a folder that exists"),
        (".", r"a file, got '.*', which is none"),
        ("pipe", r"a file, got '.*pipe', which is none"),
        ("/proc/x.txt", r"a file that can be written, got '/proc/x.txt' \(.*\)"),
        ("x" * 300 + ".txt", r"a file that can be written, got .*File name too long"),
    ],
)
def test_a_path_that_cannot_be_written_is_refused(tmp_path, monkeypatch, path, got):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ValueError, match=rf"where: expected {got}"):
        writable(path, name="where")


def test_asking_leaves_no_trace(tmp_path):
    path = tmp_path / "a.txt"
    assert writable(str(path)) == path
    assert not any(tmp_path.iterdir())
    path.write_text("old")
    before = path.stat().st_mtime_ns
    writable(path)
    assert (path.read_text(), path.stat().st_mtime_ns) == ("old", before)


def test_a_full_disk_is_noticed_before(tmp_path, monkeypatch):
    class Full(tempfile.SpooledTemporaryFile):
        def write(self, data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(tempfile, "TemporaryFile", lambda dir: Full())
    with pytest.raises(ValueError, match="No space left on device"):
        writable(tmp_path / "a.txt")


def test_all_that_write_ask_before_the_work(motion):
    wrong = "/proc/x"
    for write in (
        lambda: drawing.trajectory(motion, f"{wrong}.png"),
        lambda: drawing.animate(motion, f"{wrong}.gif"),
        lambda: tables.write_csv(f"{wrong}.csv", motion),
        lambda: jaxdyn.files.records.write(f"{wrong}.json", {}),
        lambda: table.File(f"{wrong}.jsonl", {}),
    ):
        with pytest.raises(ValueError, match="expected a file that can be written"):
            write()


def test_a_table_whose_disk_fills_up_names_its_file(tmp_path, monkeypatch):
    file = table.File(tmp_path / "t.jsonl", {})

    def full(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ValueError, match=r"t.jsonl' \(No space left on device\)"):
        file.add(table.Chunk(0, {}, ()))


def test_a_file_is_replaced_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    output_files.replace(path, "new")
    assert path.read_text() == "new"
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        output_files.replace(path, "newer")
    assert path.read_text() == "new"
    assert len(list(tmp_path.iterdir())) == 1
