"""Documents: a header, a digest, written as a whole or not at all, and what is refused."""

import json
import os
import pickle

import pytest
from helpers import forge

from jaxdyn.files import layout
from jaxdyn.files.layout import Layout

LAYOUT = Layout("test-record", 3, "a test")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "record.json"


def written(path, **changed):
    return forge(path, LAYOUT.header | {"scene": [1.0] * 40} | changed)


def test_write_then_read(path):
    record = {"values": [1, 2.5, None, "x", True]}
    LAYOUT.write(path, record)
    assert LAYOUT.read(path) == record
    assert json.loads(path.read_text()).items() >= LAYOUT.header.items()
    assert path.stat().st_mode & 0o777 == 0o644


def test_write_replaces_the_old_file_and_leaves_no_other(path):
    for value in (1, 2):
        LAYOUT.write(path, {"value": value})
    assert LAYOUT.read(path)["value"] == 2
    assert os.listdir(path.parent) == [path.name]


@pytest.mark.parametrize("broken", ["text", "disk"])
def test_a_failed_write_leaves_the_old_file(path, monkeypatch, broken):
    LAYOUT.write(path, {"old": True})
    before = path.read_bytes()
    if broken == "text":
        bad = {"value": float("nan")}
        message = "record: expected finite numbers, got others .*nan"
    else:
        bad = {"new": True}
        message = "file: expected a file that can be written, got .*record.json. .No space"

        def full(handle):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ValueError, match=message):
        LAYOUT.write(path, bad)
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


def test_an_interrupted_write_leaves_the_old_file(path, monkeypatch):
    LAYOUT.write(path, {"old": True})
    before = path.read_bytes()

    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        LAYOUT.write(path, {"new": True})
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


def test_where_no_file_can_be_written(tmp_path):
    with pytest.raises(
        ValueError, match=r"file: expected a file in a folder that exists, got .*none"
    ):
        LAYOUT.write(tmp_path / "none" / "x.json", {})
    with pytest.raises(ValueError, match=r"file: expected a file, got .*, which is none"):
        LAYOUT.write(tmp_path, {})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "file: expected JSON"),
        (b'{"format": "test-record", "vers', "file: expected JSON"),
        (b"\xff\xfe\x00", "file: expected JSON"),
        (pickle.dumps(LAYOUT.header), "file: expected JSON"),
        (b"[" * 100_000 + b"]" * 100_000, "file: expected JSON"),
        (b'{"a":' * 100_000 + b"1" + b"}" * 100_000, "file: expected JSON"),
        (b"[1, 2]", "file: expected format 'test-record', got 'list'"),
        (b"null", "file: expected format 'test-record', got 'NoneType'"),
        (b"{}", "file: expected format 'test-record', got None"),
        (b'{"format": "other"}', "file: expected format 'test-record', got 'other'"),
        (b'{"format": "test-record"}', "file: expected version 3, got None. Make the file again."),
        (b'{"format": "test-record", "version": 4}', "version 3, got 4. Update this program."),
        (b'{"format": "test-record", "version": NaN}', "file: expected finite numbers, got NaN"),
        (b'{"a": -Infinity}', "file: expected finite numbers, got -Infinity. The file was edited"),
        (b'{"a": 1' + b"0" * 400 + b"}", "file: expected integers of at most 18 digits, got one"),
        (b'{"a": 1' + b"0" * 9000 + b"}", "file: expected integers of at most 18 digits, got one"),
    ],
)
def test_files_that_are_no_record(path, content, message):
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message) as caught:
        LAYOUT.read(path)
    assert len(str(caught.value)) < 500


def test_files_that_cannot_be_read(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=r"file: expected a readable file, got .*No such file"):
        LAYOUT.read(tmp_path / "none.json")
    with pytest.raises(ValueError, match=r"file: expected a readable file, got .*directory"):
        LAYOUT.read(tmp_path)
    large = written(tmp_path / "large.json")
    monkeypatch.setattr(layout, "MAX_BYTES", 100)
    with pytest.raises(ValueError, match=r"file: expected at most 100 bytes, got "):
        LAYOUT.read(large)
