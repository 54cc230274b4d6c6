"""Values as JSON and back: what goes in comes out, to the bit, and nothing hostile gets in."""

import dataclasses
import enum
import json
import math
from typing import ClassVar, Optional

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdyn import Effect, Scene, scenes
from jaxdyn.effects import LinearDrag, PairGravity, UniformGravity
from jaxdyn.files import codec
from jaxdyn.files.codec import decode, decode_part, encode
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scenes import catalogue


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


class Bare(Effect):
    """A user's effect whose annotations say little."""

    places: tuple = eqx.field(static=True)
    text: Optional[str] = eqx.field(static=True)  # noqa: UP045
    velocity_dependent: ClassVar[bool] = False


class WithFunction(Effect):
    shape: object = eqx.field(static=True)


def through_text(part, cls=Scene):
    return decode_part(json.loads(json.dumps(encode(part))), cls, "record")


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
    back = through_text(effect, Effect)
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
        encode(WithFunction(np.sin))
    with pytest.raises(ValueError, match=r"got set set.*make a class in a module"):
        encode(WithFunction(set()))


def test_a_field_that_is_newer_than_the_file_has_its_default():
    record = encode(scenes.pendulum(formulation="constrained"))
    del record["system"]["mechanism"]["squared"]
    assert decode_part(record, Scene, "record").system.mechanism.squared is False


def test_an_entry_of_a_result_without_a_default_is_needed():
    @dataclasses.dataclass
    class Grown:
        value: float
        newer: bool = True

    assert decode({"value": 2.0}, Grown, "file", "") == Grown(2.0)
    assert decode({"value": 2.0, "newer": False}, Grown, "file", "") == Grown(2.0, newer=False)
    with pytest.raises(ValueError, match=r"entries of Grown, got missing or extra \['value'\]"):
        decode({"newer": False}, Grown, "file", "")
    with pytest.raises(ValueError, match=r"missing or extra \['other', 'value'\]"):
        decode({"other": 1.0}, Grown, "file", "")


def changed(*keys, to):
    """The record of a three-body scene with one entry replaced."""
    record = json.loads(json.dumps(encode(scenes.three_body())))
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
        (changed("y0", to=[1.0, None]), "record.y0: expected finite numbers, got nan"),
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
        decode_part(record, Scene, "record")


def test_huge_arrays_are_refused(monkeypatch):
    monkeypatch.setattr(codec, "MAX_NUMBERS", 11)
    with pytest.raises(ValueError, match=r"record.y0: expected at most 11 numbers, got 12"):
        through_text(scenes.three_body())


@pytest.mark.parametrize("depth", [40, 300])
def test_modules_in_modules_without_end_are_refused(depth):
    record = encode(scenes.three_body())
    for _ in range(depth):
        record = encode(scenes.three_body()) | {"system": record}
    with pytest.raises(ValueError, match=r"expected at most 32 modules in each other, got more"):
        decode_part(record, Scene, "record")


def test_reading_runs_nothing_that_a_file_names(monkeypatch):
    called = []
    record = encode(scenes.three_body())
    monkeypatch.setattr(FreePoints, "__init__", lambda *args, **kwargs: called.append(args))
    assert isinstance(decode_part(record, Scene, "record"), Scene)
    assert not called


@pytest.mark.parametrize("name", catalogue.entries())
def test_every_scene_comes_back_as_it_was(name):
    scene = catalogue.build(name, {})
    read = through_text(scene)
    assert jax.tree.structure(read) == jax.tree.structure(scene)
    for one, other in zip(jax.tree.leaves(read), jax.tree.leaves(scene), strict=True):
        np.testing.assert_array_equal(one, other)


class Colour(enum.StrEnum):
    RED = "red"


@dataclasses.dataclass(frozen=True)
class Result:
    values: np.ndarray
    best: float
    colour: Colour | None
    tests: dict[Colour, float]


def test_results_come_back_to_the_bit():
    values = np.array([[0.1 + 0.2j, -0.0], [np.inf, complex(np.nan, 1e-308)]])
    result = Result(values, -math.inf, Colour.RED, {Colour.RED: math.nan})
    text = json.dumps(encode(result), allow_nan=False)
    found = decode(json.loads(text), Result, "file", "")
    assert found.values.tobytes() == values.tobytes()
    assert (found.best, found.colour) == (-math.inf, Colour.RED)
    assert math.isnan(found.tests[Colour.RED])
    real = np.array([[[0.1, -0.0], [math.nan, math.inf]], [[-math.inf, 5e-324], [2.0, 3.0]]])
    assert encode(real)[0][1] == [None, "inf"]
    assert decode(encode(real), np.ndarray, "file", "").tobytes() == real.tobytes()
    older = {"shape": [2], "real": [1.0, None]}  # as real arrays were in files until 0.2
    np.testing.assert_array_equal(decode(older, np.ndarray, "file", ""), [1.0, math.nan])
    empty = decode(encode(np.zeros((3, 0))), np.ndarray, "file", "")
    assert empty.shape == (3, 0)
    assert empty.dtype == float


WRONG = [
    (np.ndarray, {"real": [1.0]}, "the shape and the numbers"),
    (np.ndarray, [1.0, "x"], "an array of numbers"),
    (np.ndarray, [[1.0], [1.0, 2.0]], "an array of numbers"),
    (np.ndarray, [True], "an array of numbers"),
    (np.ndarray, [[[1.0], [1.0]], [[1.0, 2.0], [1.0]]], "an array of numbers"),
    (int | str, 1.0, "str"),
    (tuple[int, int], [1], "tuple"),
    (np.ndarray, {"shape": [2], "real": [1.0]}, "as many numbers as its shape"),
    (np.ndarray, {"shape": [-1], "real": []}, "as many numbers as its shape"),
    (np.ndarray, {"shape": [1.0], "real": [1.0]}, "int"),
    (np.ndarray, {"shape": [1], "real": ["x"]}, "float"),
    (np.ndarray, {"shape": [1], "real": [1.0], "imag": []}, "as many numbers as its shape"),
    (Colour, "blue", "Colour"),
    (Colour, [], "Colour"),
    (dict[Colour, float], {"blue": 1.0}, "Colour"),
    (dict[Colour, float], [], "dict"),
]


@pytest.mark.parametrize(("hint", "value", "message"), WRONG)
def test_other_values_are_refused(hint, value, message):
    with pytest.raises(ValueError, match=f"file.*: expected .*{message}"):
        decode(value, hint, "file", "")


def test_a_scene_holds_finite_numbers_and_empty_arrays():
    for number in (math.nan, math.inf):
        with pytest.raises(ValueError, match="record: expected finite numbers, got "):
            encode(UniformGravity(number))
    effect = Named(np.zeros((0, 3)), jnp.asarray(0.5), None, (), (), "none", False)
    back = through_text(effect, Effect)
    assert (back.table.shape, back.rest, back.pairs) == ((0, 3), (), ())


def test_static_fields_may_be_plain_tuples_and_texts_of_several_lines():
    for text in ("par k=4\nx'=v\n", None):
        effect = Bare((1, (2.5, "x"), ()), text)
        back = through_text(effect, Effect)
        assert (back.places, back.text) == (effect.places, text)
    record = encode(Bare((1,), None))
    for wrong in ([True], [None], [{}], {}, "x"):
        with pytest.raises(ValueError, match=r"^record\.places: expected"):
            decode_part(record | {"places": wrong}, Effect, "record")
