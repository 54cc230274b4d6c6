"""The guides, entrances and tutorials of the site: what their Python prints, their commands, links.

Each page is one program, in a process and a folder of its own. A comment behind a `print` at the
start of a line is what it prints. Blocks that import what is not installed are left out.
"""

import ast
import functools
import importlib.util
import re
import shlex
import tempfile
from pathlib import Path

import pytest
import typer
from helpers import run_blocks

from jaxdyn.cli.app import app as jaxdyn_app
from orbits.cli.app import app as orbits_app

ROOT = Path(__file__).parent.parent
GALLERY = ROOT / "jaxdyn" / "gallery"
GUIDES, ENTRANCES, TUTORIALS = (
    {path.name: path for path in sorted((GALLERY / folder).glob("*"))}
    for folder in ("guides", "entrances", "tutorials")
)
PAGES = GUIDES | ENTRANCES | TUTORIALS
SHORTEST, LONGEST = 40, 125  # lines
SUMMARY = 110  # characters that the table of contents has room for


def blocks(name):
    """The Python blocks of a page."""
    return re.findall(r"```python\n(.*?)```", PAGES[name].read_text(), re.DOTALL)


def missing(block):
    """The packages that a block imports and that are not installed."""
    imports = [node for node in ast.walk(ast.parse(block)) if isinstance(node, ast.Import)]
    froms = [node for node in ast.walk(ast.parse(block)) if isinstance(node, ast.ImportFrom)]
    names = [alias.name for node in imports for alias in node.names]
    names += [node.module for node in froms]
    packages = {name.partition(".")[0] for name in names}
    return {package for package in packages if importlib.util.find_spec(package) is None}


@functools.cache
def output(name):
    """What the blocks of a page print, except those for packages that are missing."""
    run = [block for block in blocks(name) if not missing(block)]
    with tempfile.TemporaryDirectory() as folder:
        return run_blocks(run, Path(folder), "-W", "error")


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_the_python_of_a_page_runs_and_prints_what_it_says(name):
    printed = output(name)
    for block in blocks(name):
        if not missing(block):
            for said in re.findall(r"^print\(.*\)  # (.+)$", block, re.MULTILINE):
                assert said in printed.splitlines(), said
    without = set().union(*map(missing, blocks(name)))
    if without:
        pytest.skip(f"{name} runs, except blocks that need {', '.join(sorted(without))}")


def test_a_guide_has_a_title_a_summary_python_and_the_right_length():
    assert len(GUIDES) >= 10
    assert len(PAGES) == len(GUIDES) + len(ENTRANCES) + len(TUTORIALS)
    for number, (name, path) in enumerate(GUIDES.items()):
        assert re.fullmatch(rf"{number:02}_[a-z_]+\.md", name), name
        title, empty, text = path.read_text().split("\n", 2)
        assert title.startswith("# ")
        assert empty == ""
        summary = " ".join(text.split()).partition(". ")[0]
        assert len(summary) <= SUMMARY, (name, summary)
        if "changes" not in name:  # a table that grows
            assert SHORTEST <= text.count("\n") <= LONGEST, (name, text.count("\n"))
        assert blocks(name), name


def test_an_entrance_and_a_tutorial_say_what_they_show_and_where_to_read_on():
    for pages, least in ((ENTRANCES, 9), (TUTORIALS, 9)):
        assert len(pages) >= least
        for number, (name, path) in enumerate(pages.items(), start=1):
            assert re.fullmatch(rf"{number:02}_[a-z_]+\.md", name), name
            title, empty, text = path.read_text().split("\n", 2)
            assert title.startswith("# ")
            assert empty == ""
            assert len(" ".join(text.split()).partition(". ")[0]) <= SUMMARY, name
            assert blocks(name), name
            assert "\n\nGo on with [" in text


def test_the_commands_of_the_guides_and_their_options_exist():
    text = "\n".join(path.read_text() for path in PAGES.values())
    lines = "\n".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL)).splitlines()
    commands = [shlex.split(one) for line in lines if line for one in line.split(" && ")]
    commands = [words for words in commands if words[0] != "python"]
    assert len(commands) >= 9
    for package, name, *words in commands:
        app = {"jaxdyn": jaxdyn_app, "orbits": orbits_app}[package]
        known = typer.main.get_command(app).commands[name].params
        options = {option for parameter in known for option in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= options, (package, name)


def test_links_between_guides_lead_to_guides():
    links = [
        link for path in GUIDES.values() for link in re.findall(r"\]\(([^)]+)\)", path.read_text())
    ]
    assert len(links) > 10
    assert {link for link in links if not link.startswith("https://")} <= GUIDES.keys()
    for path in (*ENTRANCES.values(), *TUTORIALS.values()):
        for link in re.findall(r"\]\(([^)]+)\)", path.read_text()):
            assert (path.parent / link).exists(), link


@pytest.mark.slow
def test_the_neighbour_and_the_eight_are_what_the_guide_says():
    _, neighbour, eight = re.split(r"^Identity$", output("11_orbits.md"), flags=re.MULTILINE)[:3]
    assert re.search(r"choreography +False", neighbour)
    assert "unstable" in neighbour.split()
    assert re.search(r"choreography +True", eight)
    assert re.search(r"scale_free +9\.23768$", eight, re.MULTILINE)
    assert "0.0084227247" in eight
