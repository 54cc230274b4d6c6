"""What a package index, a citation and a report of an error take from the project."""

import ast
import re
import sys
import tomllib
from pathlib import Path

import jaxdyn

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
OURS = {"jaxdyn", "orbits"}
#: What a module belongs to, where the names differ.
PACKAGES = {
    "PIL": "pillow",
    "flint": "python-flint",
    "jaxlib": "jax",
    "jinja2": "sphinx",
    "nbformat": "nbclient",
    "mpl_toolkits": "matplotlib",
}


def _bounds(requirements) -> dict[str, str]:
    return {re.split(r"[<>=!\[]", one)[0]: one for one in requirements}


def test_one_version_is_named_everywhere():
    citation = (ROOT / ".github" / "CITATION.cff").read_text()
    assert re.search(r"^version: (.+)$", citation, re.MULTILINE)[1] == jaxdyn.__version__
    assert f"version = {{{jaxdyn.__version__}}}" in re.sub(
        " +", " ", (ROOT / "README.md").read_text()
    )


def test_every_requirement_has_a_lower_bound_and_one_home():
    listed = [*PROJECT["dependencies"], *(one for extra in EXTRAS.values() for one in extra)]
    assert all(">=" in one for one in listed)
    # What the tests need of another extra has the same bounds.
    for extra, requirements in EXTRAS.items():
        if extra != "test":
            for name, bound in _bounds(requirements).items():
                assert _bounds(EXTRAS["test"]).get(name, bound) == bound


def _imported(file: Path) -> set[str]:
    """The packages that a file imports, wherever in it."""
    nodes = [*ast.walk(ast.parse(file.read_text()))]
    names = [one.name for node in nodes if isinstance(node, ast.Import) for one in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    return {name.split(".")[0] for name in names}


def test_what_is_imported_is_required():
    files = [file for package in OURS for file in (ROOT / package).rglob("*.py")]
    assert len(files) > 300
    found = set().union(*map(_imported, files)) - sys.stdlib_module_names - OURS
    runtime = [EXTRAS[extra] for extra in EXTRAS if extra not in ("test", "lint", "benchmark")]
    required = {*_bounds(PROJECT["dependencies"])}.union(*map(_bounds, runtime))
    # The message of a function that needs it names the package itself.
    alone = {"cloudpickle"}
    assert {PACKAGES.get(name, name) for name in found} <= required | alone


def test_the_templates_of_reports_ask_for_what_jaxdyn_info_prints():
    for template in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"):
        assert "`jaxdyn info`" in template.read_text()


def test_the_scripts_of_both_ends_are_in_the_workflow():
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text()
    for word in ("windows-latest", "macos-latest", "ubuntu-latest", "oldest", "newest", ".ci/try"):
        assert word in workflow
