"""Files that cannot be written are refused before the work, by all that write; or in one line."""

import errno
import os
import stat
import tempfile

import pytest

import jaxdyn
from jaxdyn import drawing, scenes
from jaxdyn.files import output_files, tables
from jaxdyn.files.layout import Layout
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


@pytest.fixture
def umask():
    """A function that sets the umask, for this test."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


def mode(path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


#: Everything that writes a file, by what it writes.
WRITERS = {
    "record.json": lambda path: Layout("x", 1, "a test").write(path, {}),
    "motion.npz": lambda path: jaxdyn.simulate(scenes.cannonball(), samples=3).save(path),
    "table.csv": lambda path: tables.write_csv(path, jaxdyn.simulate(scenes.cannonball())),
    "search.jsonl": lambda path: table.File(path, {}),
    "text.txt": lambda path: output_files.replace(path, "text"),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_new_file_has_the_mode_of_any_other_and_an_old_one_its_own(tmp_path, umask, name):
    for mask in (0o022, 0o077, 0o002, 0o027):
        umask(mask)
        path = tmp_path / f"{mask:o}" / name
        path.parent.mkdir(mode=0o777)
        WRITERS[name](path)
        assert mode(path) == 0o666 & ~mask
    for kept in (0o600, 0o664, 0o640, 0o755):
        os.chmod(path, kept)
        if name != "search.jsonl":  # which is not written again
            path.write_bytes(b"old")
        WRITERS[name](path)
        assert mode(path) == kept
        assert name == "search.jsonl" or path.read_bytes() != b"old"


@pytest.mark.parametrize("name", WRITERS)
def test_the_target_of_a_link_is_written_and_the_link_stays(tmp_path, name):
    (tmp_path / "far").mkdir()
    (tmp_path / "near").mkdir()
    target, link = tmp_path / "far" / f"own-{name}", tmp_path / "near" / name
    (tmp_path / "far" / f"second-{name}").symlink_to(target.name)
    link.symlink_to(f"../far/second-{name}")
    for begun in (False, True):
        assert target.exists() == begun
        WRITERS[name](link)
        assert link.is_symlink()
        assert (tmp_path / "far" / f"second-{name}").is_symlink()
        assert target.is_file()
        assert not target.is_symlink()
    assert [path.name for path in (tmp_path / "near").iterdir()] == [name]


def test_links_without_a_target_or_an_end_are_refused(tmp_path):
    link = tmp_path / "a.txt"
    link.symlink_to(tmp_path / "none" / "b.txt")
    with pytest.raises(ValueError, match="path: expected a file in a folder that exists"):
        writable(link)
    loop = tmp_path / "loop.txt"
    loop.symlink_to(loop)
    with pytest.raises(ValueError, match=r"path: expected a file that can be .*levels of symb"):
        writable(loop)
    with pytest.raises(OSError, match="levels of symb"):
        output_files.replace(loop, "text")
    assert loop.is_symlink()


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
        lambda: Layout("x", 1, "a test").write(f"{wrong}.json", {}),
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
