"""No damage of a file goes unseen: any byte that changed, that is missing or that was added."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.continuation import checkpoint
from jaxdyn.files.digests import digest_of_values
from orbits.curves.checkpoint import ORBIT_CURVE
from orbits.discovery import journal as searches
from orbits.families.checkpoint import ORBITS
from orbits.files import family_files
from orbits.orbit import Orbit, Outcome

FIND = searches.Find(0, (1.0, 1e-5), 2.0, 0, 1e-16, 0.0, 1e-15, 2.0, "stable", 1.0, "")


def pendulum() -> Orbit:
    return Orbit(scenes.pendulum(), orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)


def save_orbit(path: Path) -> None:
    orbits.save(path, orbits.find(scenes.oscillator(), period=6.0))


def save_family(path: Path) -> None:
    entry = family_files.Entry(pendulum(), 1.0, -9.81, "stable")
    family_files.save(path, family_files.Listing("length", (entry, entry), (), "its bounds"))


def save_motion(path: Path) -> None:
    jaxdyn.simulate(scenes.pendulum(), 1.0, samples=3).save(path)


def save_search(path: Path) -> None:
    file = searches.File(path, {"what": "nothing"})
    for number in range(4):
        file.add(searches.Chunk(number, {"samples": 2, "orbits": 1}, (FIND,)))


def save_walk(what: str) -> Callable[[Path], None]:
    def save(path: Path) -> None:
        codec = checkpoint.Codec(encode=lambda x: x, decode=lambda x: x)
        log = checkpoint.Log(path)
        begin = checkpoint.Begin(what, 0.1, np.array([1.0, 1e-13]), {"x": [1.0]})
        with checkpoint.resume(log, begin, codec, lambda _: begin.place) as (_, walk):
            assert walk is not None
            for number in range(4):
                walk.add(checkpoint.Advance({"x": [1e-13, number / 3]}, [], 0.1, ""))
            walk.finish("the number of members requested, 5")
        log.note({"scene": "none"})

    return save


def read_walk(what: str) -> Callable[[Path], list]:
    def read(path: Path) -> list:
        (walk,), notes = checkpoint.walks_in(path, (what,))
        return [*walk.steps, *([walk.end] if walk.end else []), *notes]

    return read


class Kind(NamedTuple):
    """A kind of file.

    Attributes:
      save: writes one.
      read: reads one.
      grows: whether it grows line by line; then `read` returns a list, of which a file that was cut
        off has the first ones.
    """

    save: Callable[[Path], None]
    read: Callable[[Path], object]
    grows: bool = False


KINDS = {
    "orbit.json": Kind(save_orbit, orbits.load),
    "family.json": Kind(save_family, family_files.load),
    "motion.npz": Kind(save_motion, jaxdyn.load),
    "search.jsonl": Kind(save_search, lambda path: searches.read(path)[1], True),
    "equilibria.jsonl": Kind(
        save_walk(checkpoint.EQUILIBRIA), read_walk(checkpoint.EQUILIBRIA), True
    ),
    "curve.jsonl": Kind(save_walk(checkpoint.CURVE), read_walk(checkpoint.CURVE), True),
    "orbits.jsonl": Kind(save_walk(ORBITS), read_walk(ORBITS), True),
    "orbit_curve.jsonl": Kind(save_walk(ORBIT_CURVE), read_walk(ORBIT_CURVE), True),
}


@pytest.fixture(scope="module", params=KINDS)
def kind(request, tmp_path_factory):
    """A kind of file, the path of one, and its bytes."""
    path = tmp_path_factory.mktemp("files") / request.param
    found = KINDS[request.param]
    found.save(path)
    found.read(path)
    return found, path, path.read_bytes()


def is_refused(kind: Kind, path: Path, data: bytes) -> bool:
    path.write_bytes(data)
    try:
        kind.read(path)
    except ValueError as refused:
        assert "\n" not in str(refused)  # noqa: PT017
        assert len(str(refused)) < 500  # noqa: PT017
        return True
    return False


@pytest.mark.sample(
    "search.jsonl", "equilibria.jsonl", "curve.jsonl", "orbits.jsonl", "orbit_curve.jsonl"
)
def test_every_flipped_bit_is_seen(kind):
    kind, path, data = kind
    random = np.random.default_rng(143)
    places = random.integers(0, len(data), 600), random.integers(0, 8, 600)
    # All of the end, where the digest is.
    last = np.arange(len(data) - 50, len(data)), random.integers(0, 8, 50)
    for place, bit in zip(*np.concatenate([places, last], axis=1), strict=True):
        flipped = bytes([data[place] ^ (1 << bit)])
        damaged = data[:place] + flipped + data[place + 1 :]
        assert is_refused(kind, path, damaged), (place, bit, data[place : place + 20])


def test_every_other_byte_is_seen(kind):
    kind, path, data = kind
    random = np.random.default_rng(11)
    for place in random.integers(0, len(data), 60):
        for other in {0, 10, 13, 32, *b"eE1", int(random.integers(256))}:
            if other != data[place]:
                damaged = data[:place] + bytes([other]) + data[place + 1 :]
                assert is_refused(kind, path, damaged), (place, other)


def test_every_cut_is_seen(kind):
    kind, path, data = kind
    path.write_bytes(data)
    whole = kind.read(path)
    sizes = {*np.random.default_rng(5).integers(0, len(data), 50).tolist()}
    for size in {0, 1, len(data) - 2, len(data) - 1, *sizes}:
        if is_refused(kind, path, data[:size]):
            continue
        # An interrupted run leaves such a file: what it has is right, and it is not the whole.
        assert kind.grows, size
        part = kind.read(path)
        assert isinstance(part, list)
        assert isinstance(whole, list)
        assert part == whole[: len(part)]
        assert len(part) < len(whole)


@pytest.mark.parametrize("more", [b"\0", b" ", b"\n", b"x", b"}\n", b"\xff" * 30, b'"{}"\n{}'])
def test_everything_that_was_added_is_seen(kind, more):
    kind, path, data = kind
    if kind.grows and not more.strip(b"\0"):
        more += b"x"  # room for a line that a file system made is no damage
    assert is_refused(kind, path, data + more)
    assert is_refused(kind, path, more + data)


def test_a_beginning_that_is_lost_is_seen(kind):
    kind, path, data = kind
    for size in (1, 7, len(data) // 2):
        assert is_refused(kind, path, data[size:])


def test_an_orbit_file_without_a_digest_is_read(tmp_path):
    path = tmp_path / "orbit.json"
    save_orbit(path)
    orbit, claims = orbits.load(path)
    record = json.loads(path.read_text())
    del record["digest"]
    path.write_text(json.dumps(record | {"version": 4}, indent=1) + "\n")
    old, old_claims = orbits.load(path)
    assert (old.period, old_claims) == (orbit.period, claims)
    assert orbits.verify(path)[1] == []
    path.write_text(json.dumps(record))
    with pytest.raises(ValueError, match=r"expected a digest at its end, got none\. The"):
        orbits.load(path)
    path.write_text(json.dumps(record | {"version": 4, "digest": "0" * 16}))
    with pytest.raises(ValueError, match="file: expected data that match its digest"):
        orbits.load(path)


def test_a_family_file_with_a_digest_of_its_values_is_read(tmp_path):
    path = tmp_path / "family.json"
    save_family(path)
    record = json.loads(path.read_text())
    del record["digest"]
    record["version"] = 3
    digest = digest_of_values(record)
    path.write_text(json.dumps(record | {"digest": digest}))
    assert family_files.load(path).members[0].energy == -9.81
    for wrong in ({"digest": digest, "end": "another"}, {}):
        path.write_text(json.dumps(record | wrong))
        with pytest.raises(ValueError, match="file: expected data that match its digest"):
            family_files.load(path)


def test_a_search_and_a_continuation_with_digests_of_their_values_go_on(tmp_path):
    def older(path: Path, version: int) -> None:
        records = [json.loads(line) for line in path.read_text().splitlines()]
        lines = []
        for record in records:
            record.pop("digest")
            record.pop("number", None) if "step" in record else None
            record |= {"version": version} if "format" in record else {}
            lines.append(json.dumps(record | {"digest": digest_of_values(record)}) + "\n")
        path.write_text("".join(lines))

    path = tmp_path / "search.jsonl"
    save_search(path)
    chunks = searches.read(path)
    older(path, searches.LAYOUT.version)
    assert searches.read(path) == chunks
    searches.File(path, {"what": "nothing"}).add(searches.Chunk(9, {"samples": 1}, ()))
    assert len(searches.read(path)[1]) == 5
    path = tmp_path / "walk.jsonl"
    save_walk(ORBITS)(path)
    steps = read_walk(ORBITS)(path)
    older(path, 1)
    assert read_walk(ORBITS)(path) == steps
    save_walk(ORBITS)(path)  # what it adds is read with what was there
    assert len(read_walk(ORBITS)(path)) == len(steps) + 4
