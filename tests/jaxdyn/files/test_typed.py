"""Results as plain JSON and back: arrays to the bit, and what is refused."""

import dataclasses
import enum
import json
import math

import numpy as np
import pytest

from jaxdyn.files.typed import plain, typed


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
    text = json.dumps(plain(result), allow_nan=False)
    found = typed(json.loads(text), Result, "file", "")
    assert found.values.tobytes() == values.tobytes()
    assert (found.best, found.colour) == (-math.inf, Colour.RED)
    assert math.isnan(found.tests[Colour.RED])
    empty = typed(plain(np.zeros((3, 0))), np.ndarray, "file", "")
    assert empty.shape == (3, 0)
    assert empty.dtype == float


WRONG = [
    (np.ndarray, [1.0], "the shape and the numbers"),
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
        typed(value, hint, "file", "")
