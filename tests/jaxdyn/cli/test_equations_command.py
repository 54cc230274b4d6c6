"""The command `jaxdyn equations`: text, LaTeX, code, and what it refuses."""

import functools
import json

import pytest

import jaxdyn
from jaxdyn import scenes
from jaxdyn.cli import completion
from jaxdyn.symbolic.code import LANGUAGES


@pytest.fixture
def equations(command):
    return functools.partial(command, "jaxdyn", "equations")


def test_equations_are_printed_as_text_latex_and_an_object(equations):
    found = jaxdyn.equations(scenes.cannonball(drag=0.1))
    code, out, _ = equations("cannonball", "--set", "drag=0.1")
    assert code == 0
    assert out.strip() == found.text()
    assert "m x'' = -c v x'" in out
    code, out, _ = equations("cannonball", "--set", "drag=0.1", "--latex")
    assert code == 0
    assert out.strip() == found.latex()
    code, out, _ = equations("cannonball", "--json")
    assert code == 0
    assert json.loads(out)["motion"]["text"] == ["x'' = 0", "y'' = -g"]


def test_the_rate_is_printed_as_code(equations):
    for language in LANGUAGES:
        code, out, _ = equations("lorenz", "--code", language)
        assert code == 0
        assert out.strip() == jaxdyn.symbolic.code(scenes.lorenz(), language).strip()
    assert set(completion.LANGUAGES) == set(LANGUAGES)
    assert completion.language("ju") == [("julia", "")]


def test_what_it_refuses(equations):
    code, _, error = equations("lorenz", "--code", "fortran")
    assert (code, "--code: expected one of c, javascript" in error) == (2, True)
    code, _, error = equations("lorenz", "--latex", "--json")
    assert (code, "one of --latex, --code and --json" in error) == (2, True)
    code, _, error = equations("pendulun")
    assert (code, "Did you mean 'pendulum'" in error) == (2, True)
