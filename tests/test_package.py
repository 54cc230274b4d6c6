"""What a package index, a citation and a report of an error take from the project."""

import re
import tomllib
from pathlib import Path

import jaxdyn

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]


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


def test_what_is_imported_is_required():
    imported = re.compile(r"^\s*(?:from|import) (\w+)", re.MULTILINE)
    files = [file for package in ("jaxdyn", "orbits") for file in (ROOT / package).rglob("*.py")]
    found = {name for file in files for name in imported.findall(file.read_text())}
    runtime = {
        extra: v for extra, v in EXTRAS.items() if extra not in ("test", "lint", "benchmark")
    }
    required = {*_bounds(PROJECT["dependencies"])}.union(*map(_bounds, runtime.values()))
    names = {"flint": "python-flint", "PIL": "pillow", "markdown_it": "markdown-it-py"}
    for name in ("jax", "diffrax", "numpy", "scipy", "matplotlib", "dask", "pandas", "flint"):
        assert name in found, "no longer imported"
        assert names.get(name, name) in required


def test_the_templates_of_reports_ask_for_what_jaxdyn_info_prints():
    for template in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"):
        assert "`jaxdyn info`" in template.read_text()


def test_the_scripts_of_both_ends_are_in_the_workflow():
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text()
    for word in ("windows-latest", "macos-latest", "ubuntu-latest", "oldest", "newest", ".ci/try"):
        assert word in workflow
