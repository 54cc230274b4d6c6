"""Files that were cut off, edited or made to harm are refused, whichever reader gets them."""

import dataclasses
import json
import os
import pickle
import threading

import numpy as np
import pytest

import orbits
from jaxdyn import scenes
from jaxdyn.files import codec, journal
from jaxdyn.files.digests import json_text
from orbits.discovery import journal as table
from orbits.files import encoding, family_files
from orbits.orbit import Orbit, Outcome

FIND = table.Find(0, (1.0, 0.0), 2.0, 0, 1e-16, 0.0, 1e-15, 2.0, "stable", 1.0, "")
CHUNKS = [table.Chunk(i, {"samples": 2, "orbits": 1}, (FIND,)) for i in range(3)]
READERS = {
    "orbit": orbits.load,
    "family": family_files.load,
    "search": table.read,
}


@pytest.fixture
def searched(tmp_path):
    path = tmp_path / "search.jsonl"
    file = table.File(path, {"what": "nothing"})
    for chunk in CHUNKS:
        file.add(chunk)
    return path


def pendulum() -> Orbit:
    return Orbit(scenes.pendulum(), orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
@pytest.mark.parametrize(
    "content",
    [
        b"\n",
        b"\x00" * 1000 + b"\n",
        b"\xff\xfe\n",
        pickle.dumps({"format": "jaxdyn-search"}) + b"\n",
        b"[" * 100_000 + b"\n",
        b'{"a":' * 100_000 + b"1" + b"}" * 100_000 + b"\n",
        b"null\n",
        b"[]\n",
        b"3\n",
        b'"text"\n',
        b'{"format": "jaxdyn-orbit", "version": NaN}\n',
        b'{"format": "jaxdyn-search", "version": 1}\n',
        b'{"a": 1' + b"0" * 9000 + b"}\n",
    ],
    ids=repr,
)
def test_what_is_no_file_of_ours(tmp_path, read, content):
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="expected") as refused:
        read(path)
    assert len(str(refused.value)) < 500


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_device_without_end_and_a_pipe_are_not_read(tmp_path, read):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in ("/dev/zero", pipe):
        refusals = []

        def attempt(path=path, refusals=refusals):
            with pytest.raises(ValueError, match=r"expected a file on a disk, got .*a device or a"):
                read(path)
            refusals.append(path)

        thread = threading.Thread(target=attempt, daemon=True)  # a reader would wait for ever
        thread.start()
        thread.join(20.0)
        assert refusals == [path]


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_folder_is_no_file(tmp_path, read):
    with pytest.raises(ValueError, match=r"expected a readable file, got .*directory"):
        read(tmp_path)


def test_a_file_that_is_too_large_is_not_read_whole(searched, monkeypatch):
    monkeypatch.setattr(journal, "MAX_BYTES", 100)
    with pytest.raises(ValueError, match="expected at most 100 bytes, got more"):
        table.read(searched)


def test_a_table_cut_off_anywhere_keeps_its_whole_lines(searched):
    data = searched.read_bytes()
    header = data.index(b"\n") + 1
    for size in np.random.default_rng(0).integers(0, len(data), 40):
        searched.write_bytes(data[:size])
        file = table.File(searched, {"what": "nothing"})
        kept = data[:size].count(b"\n", header)
        assert list(file.chunks.values()) == CHUNKS[:kept][::-1]
        for chunk in CHUNKS:
            file.add(chunk)
        assert searched.read_bytes() == data


@pytest.mark.parametrize("line", [0, 1, 3])
def test_a_table_with_an_edited_number_is_refused(searched, line):
    lines = searched.read_text().splitlines()
    edited = lines[line].replace('"version": 3', '"version": 2.0').replace("2.0,", "2.5,")
    assert edited != lines[line]
    searched.write_text("\n".join([*lines[:line], edited, *lines[line + 1 :]]) + "\n")
    for read in (table.read, lambda path: table.File(path, {"what": "nothing"})):
        with pytest.raises(
            ValueError, match=r"^path: expected a jaxdyn-search file, got .*was edited"
        ):
            read(searched)


FORGED = [
    ("number", "0"),
    ("number", True),
    ("number", [0]),
    ("counts", []),
    ("counts", {"samples": "2"}),
    ("finds", {"y0": 1}),
    ("finds", [3]),
    ("finds", None),
    *(
        ("finds", [vars(FIND) | {name: value}])
        for name, value in (
            *(("y0", "ab"), ("y0", 3), ("y0", [[1.0]]), ("y0", [None]), ("y0", [True])),
            *(("period", "2"), ("period", None), ("period", [1.0]), ("closing", 2)),
            *(("closing", True), ("closing", -1), ("verdict", 3), ("label", ["x"]), ("more", 1)),
        )
    ),
]


@pytest.mark.parametrize(("key", "value"), FORGED, ids=repr)
def test_a_table_of_wrong_types_is_refused_though_its_digests_are_right(searched, key, value):
    record = dataclasses.asdict(CHUNKS[0]) | {key: value}
    with open(searched, "ab") as file:
        file.write(json_text(record))
    with pytest.raises(ValueError, match=r"^path.*: expected .*edited or damaged"):
        table.read(searched)


def test_a_family_file_with_an_edited_number_is_refused(tmp_path):
    path = tmp_path / "family.json"
    entry = family_files.Entry(pendulum(), 1.0, -9.81, "stable")
    family_files.save(path, family_files.Listing("length", (entry,), (), "its bounds"))
    assert family_files.load(path).members[0].energy == -9.81
    path.write_text(path.read_text().replace("-9.81", "-9.82"))
    with pytest.raises(ValueError, match="file: expected data that match its digest"):
        family_files.load(path)


HOSTILE = [10**17, -1, "x", None, {}, [], [10**17], [[[]]], ["a"], [None], {"type": "Scene"}, 1e308]


def places(record, way=()):
    """Ways to every entry of dictionaries in a record."""
    for key, item in record.items() if isinstance(record, dict) else ():
        yield (*way, key)
        yield from places(item, (*way, key))


@pytest.mark.sample("pendulum", "three_body")
@pytest.mark.parametrize("name", ["pendulum", "three_body", "four_bar"])
def test_whatever_stands_in_an_orbits_record_it_is_read_or_refused(name):
    scene = getattr(scenes, name)()
    orbit = Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)
    text = json.dumps(encoding.encode_orbit(orbit))
    ways = list(places(json.loads(text)))
    random = np.random.default_rng(1)
    for _ in range(60):
        record = json.loads(text)
        *way, last = ways[random.integers(len(ways))]
        at = record
        for key in way:
            at = at[key]
        at[last] = HOSTILE[random.integers(len(HOSTILE))]
        try:
            read = encoding.decode_orbit(record)
        except ValueError as refused:
            assert str(refused)  # noqa: PT017
        else:
            assert np.isfinite(np.asarray(read.y0)).all()


@pytest.mark.parametrize(
    ("scene", "change", "message"),
    [
        (scenes.pendulum(), ("mechanism", "inverted", "x"), "inverted: expected bool, got 'x'"),
        (scenes.pendulum(), ("mechanism", "inverted", 1), "inverted: expected bool, got 1"),
        (scenes.dumbbell(), ("mechanism", "d", 2.0), "d: expected int, got 2.0"),
        (scenes.dumbbell(), ("mechanism", "pairs", [[0, 1, 2]]), "pairs: expected tuple"),
        (scenes.dumbbell(), ("mechanism", "pairs", [[0, "1"]]), "pairs: expected int"),
    ],
)
def test_static_fields_of_a_wrong_type_are_refused(scene, change, message):
    key, inner, value = change
    record = json.loads(json.dumps(codec.encode(scene)))
    system = record["system"]
    system[key][inner] = value
    with pytest.raises(ValueError, match=message):
        codec.decode_scene(record, "")


def test_a_list_in_lists_without_end_is_refused():
    record = codec.encode(scenes.pendulum())
    deep = []
    for _ in range(100_000):
        deep = [deep]
    record["system"]["mechanism"]["inverted"] = deep
    with pytest.raises(ValueError, match="inverted: expected bool"):
        codec.decode_scene(record, "")
