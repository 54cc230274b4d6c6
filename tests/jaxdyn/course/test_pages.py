"""Every page of the course runs, its checks hold, and what it says of itself is complete."""

import importlib
import inspect
import re
import sys
from types import SimpleNamespace

import jax
import numpy as np
import pytest
from helpers import BEYOND
from matplotlib.figure import Figure

from jaxdyn.cli import docstrings
from jaxdyn.course.page import TOPICS, Page, displays, problems, run
from jaxdyn.player import export

PROBLEMS = problems()
NAMES = sorted({name for problem in PROBLEMS.values() for name in problem.names})
LONGEST = 45  # lines of a function of a page
FIGURE = re.compile(r"(?<![\w.^/])\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.]*\w)")  # in a text
LITERAL = re.compile(r"\d+(?:\.\d+)?(?:e-?\d+)?")  # in code


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


def unfounded(problem, page):
    """Figures of a page's text that neither round one of its numbers nor are among its inputs.

    Not those of one digit, nor whole numbers of two, which are counts and rounded tolerances.
    """
    numbers = [np.ravel(n.value) for n in page.numbers if not isinstance(n.value, str)]
    values = np.abs(np.concatenate([np.zeros(1), *numbers]).astype(float))
    _, _, code = problem.code.split('"""', 2)
    given = {float(text) for text in LITERAL.findall(code) + FIGURE.findall(problem.statement)}

    def founded(text):
        mantissa, _, exponent = text.partition("e")
        digits = mantissa.replace(".", "").lstrip("0")
        unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
        few = len(digits) < (2 if "." in mantissa else 3)
        return few or float(text) in given or (abs(values - float(text)) <= 0.500001 * unit).any()

    texts = FIGURE.findall(f"{problem.answer}\n{problem.solution}")
    return [text for text in texts if not founded(text)]


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
    assert unfounded(PROBLEMS[number], page) == []
    for check in page.checks:
        assert check.holds, check
    for drawing in page.drawings:
        assert isinstance(drawing.figure, Figure)
        assert drawing.look.endswith(".")
    for played in page.played:
        assert played.look.endswith(".")
        assert export(played.motions, choose=played.choose)["motions"]
    for ask in page.asks:
        assert ask.question.startswith("What happens ")
        assert (ask.question[-1], ask.answer[-1]) == ("?", ".")
    # Questions stand beside a scene that runs.
    assert not page.asks or any(one.runs for one in displays(page))


@pytest.mark.parametrize("number", PROBLEMS)
def test_a_page_says_what_is_asked_and_the_answer(number):
    problem = PROBLEMS[number]
    assert len(problem.title) <= 60
    assert problem.statement.endswith((".", "?"))
    assert problem.answer.endswith(".")
    module = importlib.import_module(f"jaxdyn.course.{problem.name}")
    for function in (module.solve, getattr(module, "check", None)):
        assert function is None or len(inspect.getsource(function).splitlines()) <= LONGEST


def test_a_figure_that_no_number_backs_is_noticed():
    page = Page()
    page.number("height", [2.71828, -31.4])
    code = '"""Title."""\ng = 9.81'
    problem = PROBLEMS[1]._replace(statement="From 5.5 m.", code=code, solution="")
    right = problem._replace(answer="2.72 m, -31.4 m and 9.81 from 5.5 m, 1e-13, 12 times.")
    assert unfounded(right, page) == []
    wrong = problem._replace(answer="2.71 m", solution="Then 6701 steps, 3.5e-3 off.")
    assert unfounded(wrong, page) == ["2.71", "6701", "3.5e-3"]


def test_the_answer_of_each_part_is_read_from_the_docstring():
    parts = re.findall(r"^\((\w)\)", PROBLEMS[31].solution, re.MULTILINE)
    assert parts == list("abcde")
    assert "(4/3) theta1''" in PROBLEMS[31].solution
    assert not PROBLEMS[31].answer.startswith("(a)")


@pytest.mark.slow
def test_checks_that_take_long_run_only_if_asked_for():
    name = PROBLEMS[37].name
    short, whole = (run(name, check=check) for check in (False, True))
    assert short.left
    assert not whole.left
    assert len(short.page.checks) < len(whole.page.checks)
    assert [n.name for n in short.page.numbers] == [n.name for n in whole.page.numbers]


def test_pictures_questions_and_long_checks_are_made_only_if_asked_for(monkeypatch):
    made = []

    def solve(page):
        page.draw(lambda: made.append("picture"), "A curve.")

    def ask(page):
        page.ask("What happens to it?", "Nothing.")

    def check(page):
        page.true("It takes long", True, route="patience")

    module = SimpleNamespace(solve=solve, ask=ask, check=check)
    monkeypatch.setitem(sys.modules, "jaxdyn.course.made_here", module)
    bare = run("made_here", check=False, ask=False).page
    assert (bare.asks, bare.checks, made) == ([], [], [])
    whole = run("made_here").page
    assert (len(whole.asks), len(whole.checks), made) == (1, 1, [])
    _ = whole.drawings[0].figure
    assert made == ["picture"]


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
