"""Every page of the course runs, its checks hold, and what it says of itself is complete."""

import importlib
import inspect

import jax
import pytest
from helpers import BEYOND
from matplotlib.figure import Figure

from jaxdyn.cli import docstrings
from jaxdyn.course.page import TOPICS, problems, run
from jaxdyn.player import export

PROBLEMS = problems()
NAMES = sorted({name for problem in PROBLEMS.values() for name in problem.names})
LONGEST = 45  # lines of a page's code


def look_up(name: str):
    """The object of a dotted name."""
    path, *parts = name.split(".")
    found = importlib.import_module(path)
    for part in parts:
        path = f"{path}.{part}"
        if not hasattr(found, part):
            importlib.import_module(path)
        found = getattr(found, part)
    return found


def test_every_problem_has_a_page():
    assert list(PROBLEMS) == list(range(1, 62))
    assert {problem.topic for problem in PROBLEMS.values()} == set(TOPICS)


@pytest.mark.slow
@pytest.mark.parametrize("number", PROBLEMS)
def test_a_page_runs_and_its_checks_hold(number):
    # A page is a user's code: it may broadcast and promote as NumPy does.
    with jax.numpy_rank_promotion("allow"), jax.numpy_dtype_promotion("standard"):
        page = run(PROBLEMS[number].name).page
    assert page.checks
    for check in page.checks:
        assert check.holds, check
    for drawing in page.drawings:
        assert isinstance(drawing.figure, Figure)
        assert drawing.look.endswith(".")
    for played in page.played:
        assert played.look.endswith(".")
        assert export(played.motions, choose=played.choose)["motions"]


@pytest.mark.parametrize("number", PROBLEMS)
def test_a_page_says_what_is_asked_and_the_answer(number):
    problem = PROBLEMS[number]
    assert len(problem.title) <= 60
    assert problem.statement.endswith((".", "?"))
    assert problem.answer.endswith(".")
    solve = importlib.import_module(f"jaxdyn.course.{problem.name}").solve
    assert len(inspect.getsource(solve).splitlines()) <= LONGEST


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_public_and_documented(name):
    assert not any(part.startswith("_") for part in name.split("."))
    found = look_up(name)
    if callable(found) or inspect.ismodule(found):
        assert found.__doc__


def test_the_scenes_name_the_problems_whose_pages_use_them():
    for name, scene in docstrings.scenes().items():
        shown = {n for n, p in PROBLEMS.items() if f"jaxdyn.scenes.{name}" in p.names}
        assert bool(shown) != (name in BEYOND), f"{name} is in no problem"
        missing = set(scene.problems) - shown
        assert not missing, f"{name} names problems {missing}, whose pages do not use it"
