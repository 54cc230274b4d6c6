"""The README: its Python runs, its links exist, its commands are those of CI and packaging."""

import re
import tomllib
from pathlib import Path

import pytest
from helpers import run_blocks

import jaxdyn

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    """All Python blocks as one program, in a process and a folder of their own."""
    folder = tmp_path_factory.mktemp("readme")
    return run_blocks(BLOCKS, folder), folder


def test_the_eight_of_the_readme_is_what_it_says(output):
    text, _ = output
    assert re.search(r"choreography +True", text)
    assert re.search(r"scale_free +9\.23768$", text, re.MULTILINE)
    assert "0.0084227247" in text


def test_the_derivative_of_the_readme_is_that_of_differences(output):
    def reached(c):
        drag = jaxdyn.effects.QuadraticDrag(c)
        return float(jaxdyn.solve(jaxdyn.scenes.cannonball(speed=20.0) + drag, 2.0).y1[0])

    printed = float(output[0].splitlines()[0])
    h = 1e-4
    # The rest of central differences is h^2 times a third derivative, here 1e-6 of the first.
    assert abs(printed - (reached(0.05 + h) - reached(0.05 - h)) / (2 * h)) < 1e-5 * abs(printed)


def test_the_picture_of_the_readme_is_drawn(output):
    assert (output[1] / "cannonball.png").stat().st_size > 10_000


def test_pictures_and_links_of_the_readme_exist_and_every_text_is_linked():
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert all((ROOT / link).exists() for link in links)
    pictures = {link for link in links if link.endswith(".png")}
    assert len(pictures) == 3
    assert all((ROOT / picture).stat().st_size < 200_000 for picture in pictures)
    (moving,) = (link for link in links if link.endswith(".gif"))
    assert (ROOT / moving).stat().st_size < 500_000
    for folder in ("guides", "entrances", "tutorials"):
        texts = (ROOT / "jaxdyn" / "gallery" / folder).glob("*.md")
        assert {str(text.relative_to(ROOT)) for text in texts} <= set(links)


def test_the_output_that_is_shown_is_what_the_eight_lines_print(output):
    shown = README.split("another integrator:\n\n```\n")[1].partition("```")[0]
    # Errors of closing are roundings, which other processors round otherwise: one may be "0".
    number = re.compile(r"-?\b\d+(?:\.\d+)?(?:e-\d+)?")
    assert number.sub("", shown) == number.sub("", output[0])
    for here, there in zip(number.findall(shown), number.findall(output[0]), strict=True):
        assert abs(float(here) - float(there)) <= 1e-8 * abs(float(there)) + 1e-13


def test_eight_lines_are_enough():
    lines = [line for line in BLOCKS[0].splitlines() if line.strip()]
    assert len(lines) <= 8


def test_the_two_commands_are_those_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    commands = re.findall(r"```sh\n(.*?)\n```", README, re.DOTALL)
    assert commands[0].startswith("python -m pip install . && orbits figure-eight")
    assert "orbits" in project["scripts"]
    assert commands[1] == "python -m pip install '.[test]' && python -m pytest"
    assert "test" in project["optional-dependencies"]
    assert "python -m pytest" in (ROOT / ".ci" / "run").read_text()
    assert project["requires-python"] == ">=3.11"


def test_every_file_of_the_map_exists():
    guide = (ROOT / ".github" / "CONTRIBUTING.md").read_text()
    table = guide[guide.index("| question") : guide.index("## How to add")]
    assert table.count("\n") > 30
    for row in table.splitlines()[2:]:
        paths = re.findall(r"`([\w/]+\.py|[\w/]+/)`", row)
        folder = ""
        for path in paths:
            folder = path.rpartition("/")[0] if "/" in path else folder
            assert (ROOT / (path if "/" in path else f"{folder}/{path}")).exists(), path


def test_the_citation_is_of_this_version():
    cited = dict(re.findall(r"^  (\w+) += \{+(.+?)\}+,?$", README, re.MULTILINE))
    assert cited["version"] == jaxdyn.__version__
    assert f"(c) {cited['year']} {cited['author']}" in (ROOT / "LICENSE").read_text()


def test_every_file_that_contributors_are_sent_to_exists():
    guide = (ROOT / ".github" / "CONTRIBUTING.md").read_text()
    paths = {*re.findall(r"`([\w./]+(?:\.\w+|/))`", guide)} - {"jaxdyn/x/", "orbits/x/"}
    paths = {path for path in paths if "/x/" not in path and not path.startswith("jaxdyn.")}
    assert len(paths) > 30
    for path in paths:
        # A file is named from the top, from its package, or in the row of its folder.
        folders = (".", "jaxdyn", "orbits", "jaxdyn/*", "orbits/*")
        assert any([*ROOT.glob(f"{folder}/{path}")] for folder in folders), path


def test_the_packages_are_typed():
    assert all((ROOT / package / "py.typed").exists() for package in ("jaxdyn", "orbits"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert "Typing :: Typed" in project["project"]["classifiers"]
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == ["jaxdyn", "orbits"]
