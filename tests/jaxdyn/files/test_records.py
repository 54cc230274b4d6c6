"""Orbit and scene files: what goes in comes out, and nothing hostile gets in."""

import dataclasses
import json
import os
import pickle
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import forge

from jaxdyn import Effect, Scene, scenes
from jaxdyn.effects import LinearDrag, PairGravity, UniformGravity
from jaxdyn.files import records
from jaxdyn.files.scene_records import KINDS
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scenes import catalogue

KIND, VERSION = "test-record", 3


class Named(Effect):
    """A user's effect with every kind of field."""

    table: jax.Array
    small: jax.Array
    nothing: jax.Array | None
    rest: tuple[Effect, ...]
    pairs: tuple[tuple[int, int], ...] = eqx.field(static=True)
    label: str = eqx.field(static=True)
    flag: bool = eqx.field(static=True)
    velocity_dependent: ClassVar[bool] = False


class WithFunction(Effect):
    shape: object = eqx.field(static=True)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "record.json"


def through_text(scene):
    return records.decode(json.loads(json.dumps(records.encode(scene))))


def written(path, **changed):
    record = {"format": KIND, "version": VERSION, "scene": records.encode(scenes.three_body())}
    return forge(path, record | changed)


@pytest.mark.parametrize(
    "scene",
    [
        scenes.three_body(),
        scenes.cannonball(drag=0.1),
        Scene(FreePoints([1.0], d=3), (), y0=np.zeros(6)),
        Scene(
            FreePoints([0.1, 1 / 3], d=1), (LinearDrag(0.3, [0.7]),), y0=[1e-310, 2, -0.0, 1e300]
        ),
    ],
    ids=["three bodies", "ball", "no effects", "odd numbers"],
)
def test_scenes_come_back_to_the_bit(scene):
    back = through_text(scene)
    assert jax.tree.structure(back) == jax.tree.structure(scene)
    for a, b in zip(jax.tree.leaves(back), jax.tree.leaves(scene), strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_fields_of_every_kind_come_back():
    effect = Named(
        table=jnp.arange(6.0).reshape(2, 3),
        small=jnp.asarray(0.5),
        nothing=None,
        rest=(UniformGravity(9.0), PairGravity(2.0)),
        pairs=((0, 1), (1, 2)),
        label="a name",
        flag=True,
    )
    back = through_text(effect)
    assert jax.tree.structure(back) == jax.tree.structure(effect)
    assert all(map(np.array_equal, jax.tree.leaves(back), jax.tree.leaves(effect)))
    assert (back.pairs, back.label, back.flag) == (effect.pairs, effect.label, effect.flag)
    hash(jax.tree.structure(back))  # as jit does with what is static


def test_what_is_read_is_not_compiled_again():
    traces = []

    @jax.jit
    def energy(scene):
        traces.append(1)
        return scene.rate(jnp.zeros(()), scene.y0)

    scene = scenes.three_body()
    np.testing.assert_array_equal(energy(scene), energy(through_text(scene)))
    assert len(traces) == 1


def test_a_function_cannot_be_written():
    with pytest.raises(ValueError, match=r"record: expected numbers, strings and modules, got "):
        records.encode(WithFunction(np.sin))
    with pytest.raises(ValueError, match=r"got set set.*make a class of it in a module"):
        records.encode(WithFunction(set()))


def test_write_then_read(path):
    record = {"format": KIND, "version": VERSION, "values": [1, 2.5, None, "x", True]}
    records.write(path, record)
    assert records.read(path, KIND, VERSION) == record
    assert path.stat().st_mode & 0o777 == 0o644


def test_write_replaces_the_old_file_and_leaves_no_other(path):
    for value in (1, 2):
        records.write(path, {"format": KIND, "version": VERSION, "value": value})
    assert records.read(path, KIND, VERSION)["value"] == 2
    assert os.listdir(path.parent) == [path.name]


@pytest.mark.parametrize("broken", ["text", "disk"])
def test_a_failed_write_leaves_the_old_file(path, monkeypatch, broken):
    records.write(path, {"old": True})
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
        records.write(path, bad)
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


def test_an_interrupted_write_leaves_the_old_file(path, monkeypatch):
    records.write(path, {"old": True})
    before = path.read_bytes()

    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        records.write(path, {"new": True})
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


def test_where_no_file_can_be_written(tmp_path):
    with pytest.raises(
        ValueError, match=r"file: expected a file in a folder that exists, got .*none"
    ):
        records.write(tmp_path / "none" / "x.json", {})
    with pytest.raises(ValueError, match=r"file: expected a file, got .*, which is none"):
        records.write(tmp_path, {})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "file: expected JSON"),
        (b'{"format": "test-record", "vers', "file: expected JSON"),
        (b"\xff\xfe\x00", "file: expected JSON"),
        (pickle.dumps({"format": KIND}), "file: expected JSON"),
        (b"[" * 100_000 + b"]" * 100_000, "file: expected JSON"),
        (b'{"a":' * 100_000 + b"1" + b"}" * 100_000, "file: expected JSON"),
        (b"[1, 2]", "file: expected format 'test-record', got 'list'"),
        (b"null", "file: expected format 'test-record', got 'NoneType'"),
        (b"{}", "file: expected format 'test-record', got None"),
        (b'{"format": "other"}', "file: expected format 'test-record', got 'other'"),
        (b'{"format": "test-record"}', "file: expected version 3, got None. Make the file again."),
        (b'{"format": "test-record", "version": 4}', "file: expected version 3, got 4"),
        (b'{"format": "test-record", "version": NaN}', "file: expected finite numbers, got NaN"),
        (b'{"a": -Infinity}', "file: expected finite numbers, got -Infinity. The file was edited"),
        (b'{"a": 1' + b"0" * 400 + b"}", "file: expected integers of at most 18 digits, got one"),
        (b'{"a": 1' + b"0" * 9000 + b"}", "file: expected integers of at most 18 digits, got one"),
    ],
)
def test_files_that_are_no_record(path, content, message):
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message) as caught:
        records.read(path, KIND, VERSION)
    assert len(str(caught.value)) < 500


def test_files_that_cannot_be_read(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=r"file: expected a readable file, got .*No such file"):
        records.read(tmp_path / "none.json", KIND, VERSION)
    with pytest.raises(ValueError, match=r"file: expected a readable file, got .*directory"):
        records.read(tmp_path, KIND, VERSION)
    large = written(tmp_path / "large.json")
    monkeypatch.setattr(records, "MAX_BYTES", 100)
    with pytest.raises(ValueError, match=r"file: expected at most 100 bytes, got "):
        records.read(large, KIND, VERSION)


def test_a_field_that_is_newer_than_the_file_has_its_default():
    record = records.encode(scenes.pendulum(formulation="constrained"))
    del record["system"]["mechanism"]["squared"]
    assert records.decode(record, kinds=KINDS).system.mechanism.squared is False


def changed(*keys, to):
    """The record of a three-body scene with one entry replaced."""
    record = json.loads(json.dumps(records.encode(scenes.three_body())))
    at = record
    for key in keys[:-1]:
        at = at[key]
    if to is dataclasses.MISSING:
        del at[keys[-1]]
    else:
        at[keys[-1]] = to
    return record


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (changed("type", to="NoSuchClass"), "record: .* imported, got 'NoSuchClass'. Import"),
        (
            changed("type", to=dataclasses.MISSING),
            "record: expected the name of a class .*, got None",
        ),
        (changed("type", to=["Scene"]), "record: expected the name of a class"),
        (changed("type", to="os.system"), "record: expected the name of a class .*got 'os.system'"),
        (changed("system", "type", to="System"), "record.system: expected the name of a class"),
        (
            changed("system", "extra", to=1),
            r"the fields of FreePoints, got missing or extra \['extra'\]. .*another version",
        ),
        (changed("t1", to=dataclasses.MISSING), r"fields of Scene, got missing or extra \['t1'\]"),
        (
            changed("y0", to=[1.0, "x"]),
            r"record.y0: expected an array of numbers, got \[1.0, 'x'\]",
        ),
        (changed("y0", to=[1.0, None]), r"record.y0: expected an array of numbers, got \[1.0"),
        (changed("y0", to=["1", "2"]), r"expected an array of numbers, got \['1', '2'\]"),
        (changed("y0", to=[True, 2.0]), r"expected an array of numbers, got \[True, 2.0\]"),
        (changed("y0", to=[10**400]), "record.y0: expected an array of numbers"),
        (changed("y0", to="12"), "record.y0"),
        (changed("y0", to=[1.0, [2.0]]), "record.y0: expected an array of numbers"),
        (changed("y0", to=[1e999]), "record.y0: expected finite numbers, got inf"),
        (changed("t1", to=1e999), "record.t1: expected finite numbers, got inf"),
        (changed("effects", 0, "G", to=1e999), "record.effects.G: expected finite numbers"),
    ],
)
def test_records_that_are_no_scene(record, message):
    with pytest.raises(ValueError, match=message):
        records.decode(record)


def test_huge_arrays_are_refused(monkeypatch):
    monkeypatch.setattr(records, "MAX_NUMBERS", 11)
    with pytest.raises(ValueError, match=r"record.y0: expected at most 11 numbers, got 12"):
        records.decode(records.encode(scenes.three_body()))


@pytest.mark.parametrize("depth", [40, 300])
def test_modules_in_modules_without_end_are_refused(depth):
    record = records.encode(scenes.three_body())
    for _ in range(depth):
        record = records.encode(scenes.three_body()) | {"system": record}
    with pytest.raises(ValueError, match=r"expected at most 32 modules in each other, got more"):
        records.decode(record)


def test_reading_runs_nothing_that_a_file_names(path, monkeypatch):
    called = []
    record = records.read(written(path), KIND, VERSION)
    monkeypatch.setattr(FreePoints, "__init__", lambda *args, **kwargs: called.append(args))
    assert isinstance(records.decode(record["scene"]), Scene)
    assert not called


@pytest.mark.parametrize("name", catalogue.entries())
def test_every_scene_comes_back_as_it_was(name):
    scene = catalogue.build(name, {})
    read = records.decode(json.loads(json.dumps(records.encode(scene))), "scene", KINDS)
    assert jax.tree.structure(read) == jax.tree.structure(scene)
    for one, other in zip(jax.tree.leaves(read), jax.tree.leaves(scene), strict=True):
        np.testing.assert_array_equal(one, other)
