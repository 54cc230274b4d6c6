"""What is refused before it is parsed: too many bytes, too many values; numbers beyond floats."""

import tracemalloc

import pytest
from helpers import forge

import jaxdyn
from jaxdyn.files import archives, input_files, journal, layout
from jaxdyn.files.digests import json_text, with_digest
from jaxdyn.files.input_files import MAX_BYTES, parse_json
from jaxdyn.files.layout import Layout

LAYOUT = Layout("x", 1, "a test")
FULL = 64 * 2**20  # bytes, as much as is read


@pytest.mark.parametrize(
    "text", [b"[[],", b"[1,", b"{},", b'"",', b"[[[[", b'{"a":1},', b'{"a":', b",,,,"]
)
def test_a_file_of_brackets_takes_no_memory(tmp_path, text):
    path = tmp_path / "brackets.json"
    data = b"[" + text * (FULL // len(text) - 1)
    path.write_bytes(data)
    del data
    tracemalloc.start()
    with pytest.raises(ValueError, match="file: expected at most 4000000 numbers, texts and list"):
        LAYOUT.read(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2.5 * FULL  # its bytes, and no values


def test_a_file_that_is_larger_is_not_read_whole(tmp_path):
    path = tmp_path / "large.json"
    with open(path, "wb") as file:
        file.truncate(2**36)  # which takes no room on the disk
    tracemalloc.start()
    for read in (lambda: LAYOUT.read(path), lambda: journal.read(path, LAYOUT)):
        with pytest.raises(ValueError, match=r"file: expected at most \d+ bytes, got more"):
            read()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2.5 * 2**30


def test_what_would_not_be_read_is_not_written(tmp_path, monkeypatch):
    path = tmp_path / "record.json"
    for name, most, message in (
        ("MAX_VALUES", 10, "record: expected at most 10 numbers, texts and lists, got some 2"),
        ("MAX_BYTES", 50, "record: expected at most 50 bytes, got .*Save less in one file"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(input_files, name, most)
            patch.setattr(layout, "MAX_BYTES", most if name == "MAX_BYTES" else MAX_BYTES)
            with pytest.raises(ValueError, match=message):
                LAYOUT.write(path, {"values": list(range(20))})
    assert not path.exists()


def test_the_record_of_an_archive_has_the_same_limit(tmp_path, monkeypatch):
    path = tmp_path / "motion.npz"
    jaxdyn.simulate(jaxdyn.scenes.pendulum(), samples=3).save(path)
    monkeypatch.setattr(input_files, "MAX_VALUES", 10)
    with pytest.raises(ValueError, match="file: expected at most 10 numbers, texts and lists"):
        jaxdyn.load(path)
    with pytest.raises(ValueError, match="record: expected at most 10 numbers, texts and lists"):
        archives.write(path, "motion.json", {"values": list(range(20))}, {})


def test_a_line_of_a_journal_has_the_same_limit(tmp_path, monkeypatch):
    path = tmp_path / "run.jsonl"
    path.write_bytes(json_text({"values": list(range(20))}))
    monkeypatch.setattr(input_files, "MAX_VALUES", 10)
    with pytest.raises(ValueError, match=r"was edited .*at most 10 numbers, texts and lists"):
        journal.read(path, LAYOUT)


@pytest.mark.parametrize(("text", "got"), [(b"[1e999]", "1e999"), (b"[-1e400]", "-1e400")])
def test_numbers_beyond_all_floats_are_refused(text, got):
    with pytest.raises(ValueError, match=f"file: expected finite numbers, got {got}. The file"):
        parse_json(text, "a text")


def test_a_digest_is_of_all_other_bytes(tmp_path):
    path = forge(tmp_path / "record.json", {"format": "x", "version": 1, "number": 1e-5})
    assert LAYOUT.read(path) == {"number": 1e-5}
    path.write_bytes(path.read_bytes().replace(b"1e-05", b"1E-05"))  # the same number
    with pytest.raises(ValueError, match="file: expected data that match its digest, got other"):
        LAYOUT.read(path)
    assert with_digest(b"ab", 1)[1:-1] == with_digest(b"ab", 2)[2:]
