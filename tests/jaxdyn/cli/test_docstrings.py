"""Words of commands are checked without JAX, and know what the catalogue knows."""

import pytest
from helpers import run_python

from jaxdyn import hard, scenes, solvers
from jaxdyn.cli import docstrings
from jaxdyn.scenes import catalogue


def test_the_text_of_the_scenes_says_what_the_catalogue_says():
    zoo = catalogue.entries()
    found = docstrings.scenes()
    assert found.keys() == zoo.keys()
    for name, known in found.items():
        assert {key: p.default for key, p in known.parameters.items()} == zoo[name].parameters
        assert known.summary
        assert all(p.meaning for p in known.parameters.values())
    assert found["cannonball"].problems == (9, 12, 27)
    assert found["three_body"].parameters["y0"].default == scenes.EIGHT


def test_every_ready_solver_has_its_name():
    ready = {x.lower() for x in solvers.__all__ if isinstance(getattr(solvers, x), solvers.Method)}
    assert set(docstrings.solver_names()) == ready


def test_every_hard_case_has_its_name():
    found = docstrings.hard_cases()
    assert list(found.items()) == [(case.name, case.holds) for case in hard.CASES.values()]


def test_settings_are_read_by_name():
    assert docstrings.scene_settings("pendulum", ["angle = pi/2", "m=2"]) == {
        "angle": "pi/2",
        "m": "2",
    }
    assert docstrings.scene_settings("three_body", None) == {}
    with pytest.raises(ValueError, match=r"^--set: expected NAME=VALUE, got 'm'"):
        docstrings.scene_settings("pendulum", ["m"])


#: Mistakes that are seen before JAX is loaded, and the message of each.
MISTAKES = {
    "jaxdyn run nosuch": "scene: expected one that",
    "jaxdyn run pendulum --set nosuch=1": "parameter of pendulum: expected one of",
    "jaxdyn run pendulum --set m=x": "m: expected a number",
    "jaxdyn run cannonball --set angle=foo": "angle: expected a number",
    "jaxdyn run three_body --set G=1^2": "G: expected a number, or comma-separated numbers, "
    "got '1^2'. Write a power as 1**2.",
    "jaxdyn run particle --set position=[[1,2]]": "position: expected comma-separated numbers, got "
    "'[[1,2]]'. Rows of numbers are given in Python only",
    "jaxdyn run kepler --set m1=1,m2=2": "--set: expected one NAME=VALUE, got 'm1=1,m2=2'. "
    "Repeat it: --set m1=1 --set m2=2.",
    "jaxdyn run kepler --set m=1,2,mu=2": "--set: expected one NAME=VALUE, got 'm=1,2,mu=2'. "
    "Repeat it: --set m=1,2 --set mu=2.",
    "jaxdyn run pendulum --t1 2^3": "Invalid value for '--t1': expected a number, got '2^3'. "
    "Write a power as 2**3.",
    "orbits loops --n=2^2": "--n: expected comma-separated numbers, got '2^2'. Write a power as",
    "jaxdyn run pendulum --solver nosuch": "--solver: expected one of auto",
    "jaxdyn run pendulum --plot a.xyz": "--plot: expected a file name",
    "jaxdyn accuracy nosuch": "scene: expected one that",
    "jaxdyn list nosuch": "list: expected a scene, or a word that a scene, effect, guid",
    "jaxdyn hard nosuch": "case: expected one that `jaxdyn hard --list` shows, got 'nosuch'.",
    "jaxdyn run pendulum --t1 x": "Invalid value for '--t1': expected a number, got 'x'. "
    "It may be arithmetic with pi, e, deg, sqrt, sin, cos. See --help.\n",
    "jaxdyn run pendulum --rtol pi/": "Invalid value for '--rtol': expected a number, got 'pi/'.",
    "orbits find nosuch": "scene: expected one that",
    "orbits find pendulum --closing nosuch": "--closing: expected one of choreography, plain",
    "orbits family pendulum --parameter nosuch": "--parameter: expected one of",
    "orbits family pendulum --from-orbit nosuch.json": "--from-orbit: expected a readable file",
    "orbits verify nosuch.json": "file: expected a readable file",
    "orbits figure-eight --guess 1": "--guess: expected 12 numbers, got 1",
    "orbits loops --n=x": "--n: expected comma-separated numbers",
}


def test_mistakes_are_told_before_jax_is_loaded():
    code = f"""
import contextlib, io, sys
import jaxdyn.cli.app, orbits.cli.app
for words, message in {MISTAKES!r}.items():
    sys.argv = words.split()
    main = (jaxdyn if sys.argv[0] == "jaxdyn" else orbits).cli.app.main
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.suppress(SystemExit):
        main()
    assert said.getvalue().startswith("error: " + message), (words, said.getvalue())
    assert not {{"jax", "numpy"}} & sys.modules.keys(), words
"""
    run_python(code)


#: Commands that only show what there is.
LISTS = [
    *("jaxdyn list", "jaxdyn list three_body", "jaxdyn list --problems", "jaxdyn list friction"),
    "jaxdyn hard --list",
]


def test_lists_are_shown_before_jax_is_loaded():
    code = f"""
import contextlib, io, sys
import jaxdyn.cli.app
for words in {[*LISTS, *(f"{words} --json" for words in LISTS[:3])]!r}:
    sys.argv = words.split()
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):
        jaxdyn.cli.app.main()
    assert said.getvalue().count("\\n") > ("--json" not in words) * 10, words
    assert not {{"jax", "numpy"}} & sys.modules.keys(), words
"""
    run_python(code)
