"""The table of the course: every problem is there, and every name in it exists."""

import importlib
import inspect

import pytest
from helpers import BEYOND

from jaxdyn.cli import words
from jaxdyn.course.problems import PROBLEMS

NAMES = sorted({name for problem in PROBLEMS.values() for name in problem.names})


def look_up(name: str):
    """The object of a dotted name below jaxdyn."""
    found = importlib.import_module("jaxdyn")
    path = "jaxdyn"
    for part in name.split("."):
        path = f"{path}.{part}"
        if not hasattr(found, part):
            importlib.import_module(path)
        found = getattr(found, part)
    return found


def test_every_problem_is_there_with_an_answer():
    assert list(PROBLEMS) == list(range(1, 62))
    for problem in PROBLEMS.values():
        assert problem.title
        assert problem.names
        assert problem.answer.endswith(".")
        assert len(set(problem.names)) == len(problem.names)


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_public_and_documented(name):
    assert not any(part.startswith("_") for part in name.split("."))
    found = look_up(name)
    if callable(found) or inspect.ismodule(found):
        assert found.__doc__
    else:
        assert isinstance(found, tuple | float)  # printed starts and periods


def test_the_scenes_name_the_problems_they_are_listed_for():
    for name, scene in words.scenes().items():
        listed = {n for n, problem in PROBLEMS.items() if f"scenes.{name}" in problem.names}
        assert bool(listed) != (name in BEYOND), f"{name} is in no problem"
        missing = set(scene.problems) - listed
        assert not missing, f"{name} names problems {missing}, which do not list it"
