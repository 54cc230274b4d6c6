"""What both commands say of themselves: help with every unit in it, the version, completion."""

import re

import pytest
import typer
from helpers import run_python
from typer.testing import CliRunner

import jaxdyn as library
from jaxdyn.cli.app import app as jaxdyn_app
from jaxdyn.cli.docstrings import scenes
from orbits.cli.app import app as orbits_app

APPS = {"jaxdyn": jaxdyn_app, "orbits": orbits_app}
COMMANDS = [
    (package, command.name) for package, app in APPS.items() for command in app.registered_commands
]
WIDTHS = pytest.mark.parametrize("width", [80, 120])


def called(package: str, *words: str, **environment: str):
    return CliRunner().invoke(APPS[package], words, prog_name=package, env=environment)


def squeezed(text: str) -> str:
    """The text without white space: where lines are broken does not matter."""
    return re.sub(r"\s", "", text)


@pytest.mark.parametrize("package", ["jaxdyn", "orbits"])
def test_help_and_version_load_nothing_that_takes_long(package):
    code = f"""
import runpy, sys
from {package}.cli.app import app
commands = [command.name for command in app.registered_commands]
assert len(commands) > 3
for words in (["--version"], ["--help"], *([name, "--help"] for name in commands)):
    sys.argv = ["{package}", *words]
    try:
        runpy.run_module("{package}", run_name="__main__")
    except SystemExit as end:
        assert end.code == 0, words
    loaded = {{"jax", "numpy", "matplotlib", "diffrax"}} & {{*sys.modules}}
    assert not loaded, (words, loaded)
"""
    out = run_python(code)
    assert out.startswith(library.__version__)
    assert "Examples:" in out
    assert "<bool>" not in out


@WIDTHS
@pytest.mark.parametrize(("package", "name"), COMMANDS)
def test_help_shows_every_text_with_its_units(package, name, width):
    done = called(package, name, "--help", COLUMNS=str(width))
    assert done.exit_code == 0
    command = typer.main.get_command(APPS[package]).commands[name]
    texts = [parameter.help for parameter in command.params]
    assert all(texts), "an option without help"
    for text in (command.help, *texts):
        assert squeezed(text) in squeezed(done.output), text


def test_some_options_have_units():
    orbits = called("orbits", "aim", "--help").output
    assert all(unit in orbits for unit in ("[m/s]", "[m]", "[m/s^2]", "[kg]", "[kg/m]"))
    assert "Step [s]" in called("jaxdyn", "run", "--help").output


@WIDTHS
def test_the_table_of_scenes_shows_every_unit(width):
    done = called("jaxdyn", "list", COLUMNS=str(width))
    assert done.exit_code == 0
    rows = [line.split("│") for line in done.output.splitlines() if line.startswith("│")]
    shown = squeezed("".join(row[3] for row in rows))
    meanings = [p.meaning for scene in scenes().values() for p in scene.parameters.values()]
    assert sum("[" in meaning for meaning in meanings) > 100
    for meaning in meanings:
        assert squeezed(meaning) in shown, meaning


@pytest.mark.parametrize(
    ("package", "words", "completed"),
    [
        ("jaxdyn", "jaxdyn r", ["run"]),
        ("jaxdyn", "jaxdyn run --se", ["--seconds", "--series", "--set"]),
        ("orbits", "orbits fi", ["figure-eight", "find"]),
        ("jaxdyn", "jaxdyn run henon", ["henon_heiles"]),
        ("jaxdyn", "jaxdyn run pendulum --set len", ["length="]),
        ("jaxdyn", "jaxdyn run lorenz --set nothing", []),
        ("jaxdyn", "jaxdyn run nothing --set ", []),
        ("jaxdyn", "jaxdyn run lorenz --solver ra", ["radau5", "radau9"]),
        ("jaxdyn", "jaxdyn course montg", ["montgomerys_eight"]),
        ("jaxdyn", "jaxdyn hard pytha", ["pythagorean"]),
        ("orbits", "orbits find henon", ["henon_heiles"]),
    ],
)
def test_the_shell_completes_words(package, words, completed):
    asked = {"COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    done = called(package, **asked, **{f"_{package.upper()}_COMPLETE": "complete_bash"})
    assert sorted(done.output.split()) == completed


def test_zsh_shows_a_line_with_its_units():
    done = called(
        "jaxdyn",
        _TYPER_COMPLETE_ARGS="jaxdyn run pendulum --set len",
        _JAXDYN_COMPLETE="complete_zsh",
    )
    assert done.output.strip() == """_arguments '*: :(("length=":"length of the rod [m]."))'"""


@pytest.mark.parametrize("package", APPS)
def test_help_names_the_commands_and_completion(package):
    done = called(package, "--help")
    assert done.exit_code == 0
    assert {name for owner, name in COMMANDS if owner == package} <= set(done.output.split())
    assert "--install-completion" in done.output


@pytest.mark.parametrize("package", APPS)
def test_no_command_shows_the_help(package):
    done = called(package)
    assert done.exit_code == 2
    assert done.output == called(package, "--help").output
    assert APPS[package].info.help in done.output
