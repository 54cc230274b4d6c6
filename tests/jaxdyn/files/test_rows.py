"""Rows of numbers that are kept in a journal while they are computed."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import run_python

from jaxdyn.files.layout import Layout
from jaxdyn.files.rows import program_text, rows_in

LAYOUT = Layout("jaxdyn-test-rows", 1, "a test")


def squares(xs):
    squares.calls += 1
    return np.stack([xs, np.where(xs > 3, np.nan, xs**2)], axis=1)


def found(path, xs, of=1.0, chunk=2):
    squares.calls = 0
    with rows_in(path, LAYOUT, of, chunk) as rows:
        return rows.compute(xs, squares), rows.compute(xs[:1], squares)


def test_rows_that_a_file_has_are_not_computed_again(tmp_path):
    xs, path = np.linspace(0.1, 5.0, 7), tmp_path / "rows.jsonl"
    plain = found(None, xs)
    assert squares.calls == 2
    first = found(path, xs)
    assert squares.calls == 5
    again = found(path, xs)
    assert squares.calls == 0
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:3]))
    shorter = found(path, xs)
    assert squares.calls == 3
    for one in (first, again, shorter):
        for a, b in zip(one, plain, strict=True):
            np.testing.assert_array_equal(a, b)


def test_files_of_other_inputs_are_refused(tmp_path):
    xs, path = np.linspace(0.1, 5.0, 7), tmp_path / "rows.jsonl"
    found(path, xs)
    for options in ({"of": 2.0}, {"chunk": 3}):
        with pytest.raises(ValueError, match="path: expected the file of this call"):
            found(path, xs, **options)
    with pytest.raises(ValueError, match="path: expected 1 rows in a line"):
        found(path, xs[:3])
    with (
        rows_in(path, LAYOUT, 1.0, 2),
        pytest.raises(ValueError, match="which another one writes now"),
        rows_in(path, LAYOUT, 1.0, 2),
    ):
        pass


@pytest.mark.slow
def test_the_text_of_a_program_is_the_same_in_every_process():
    code = (
        "import jax, jax.numpy as jnp\n"
        "jax.config.update('jax_enable_x64', True)\n"
        "from jaxdyn.files.rows import program_text\n"
        "from jaxdyn._numerics import safe_norm\n"
        "print(program_text(lambda y: safe_norm(y) * jax.nn.relu(y), jnp.ones(3))[0])"
    )
    assert run_python(code) == run_python(code)
    text, constants = program_text(lambda y: y + 1.0, jnp.ones(3))
    assert "add" in text
    assert constants == []
