"""What a bare `import jaxdyn, orbits` offers: every name that is mentioned, whatever came first."""

import ast
import importlib
import inspect
import re
import tomllib
import types
from pathlib import Path

import equinox as eqx
import pytest
from helpers import run_python

import jaxdyn
import orbits
from jaxdyn._doors import renamed
from jaxdyn.formulations.mechanism import Mechanism
from jaxdyn.solvers import Method

ROOT = Path(__file__).parents[1]
#: Public functions with the name of a module beside them, which would take their place.
TWINS = [
    f"{package.__name__}.{name}"
    for package in (jaxdyn, orbits)
    for name in package.__all__
    if (ROOT / package.__name__ / f"{name}.py").exists() and callable(getattr(package, name))
]


def _texts():
    """The README, the guides, and all docstrings and messages of both packages."""
    texts = (ROOT / "README.md", ROOT / ".github" / "CONTRIBUTING.md")
    for file in (*texts, *(ROOT / "jaxdyn" / "gallery" / "guides").glob("*.md")):
        yield file.read_text()
    for package in ("jaxdyn", "orbits"):
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.Constant) and isinstance(node.value, str):
                    yield node.value


def test_every_name_that_is_mentioned_resolves_after_a_bare_import():
    pattern = re.compile(r"(?<![\w./-])(?:jaxdyn|orbits)(?:\.[A-Za-z]\w*)+(?![\w/-])")
    names = sorted({name for text in _texts() for name in pattern.findall(text)})
    # A module's own folder, file endings, and what begins a dotted module that runs.
    names = [name for name in names if not name.endswith((".py", ".json", ".html", ".pdf", ".png"))]
    assert len(names) > 40
    assert {"jaxdyn.solve", "jaxdyn.accuracy.horizon.trusted_time", "orbits.find"} <= set(names)
    code = f"""
import functools, jaxdyn, orbits
for name in {names}:
    package, *path = name.split(".")
    functools.reduce(getattr, path, dict(jaxdyn=jaxdyn, orbits=orbits)[package])
"""
    run_python(code)


def _chains(file: Path):
    """The dotted names of the packages in the code of a file."""
    for node in ast.walk(ast.parse(file.read_text())):
        text = ast.unparse(node) if isinstance(node, ast.Attribute) else ""
        if re.fullmatch(r"(?:jaxdyn|orbits)(?:\.[A-Za-z]\w*)+", text):
            yield text


def test_what_commands_reach_through_folders_is_declared_there():
    """Else it is found only where another import has loaded it."""
    missing = set()
    for file in (*ROOT.glob("jaxdyn/cli/**/*.py"), *ROOT.glob("orbits/cli/**/*.py")):
        for chain in _chains(file):
            found: object = {"jaxdyn": jaxdyn, "orbits": orbits}[chain.partition(".")[0]]
            for name in chain.split(".")[1:]:
                folder = isinstance(found, types.ModuleType) and hasattr(found, "__path__")
                if folder and found not in (jaxdyn, orbits) and name not in dir(found):
                    missing.add(chain)
                    break
                if found is orbits or found is jaxdyn or isinstance(found, types.ModuleType):
                    found = getattr(found, name)
                else:
                    break
    assert not missing


def test_public_names_are_declared_and_nothing_else_is_shown():
    for package in (jaxdyn, orbits):
        for name in package.__all__:
            assert getattr(package, name).__doc__, name
        assert {x for x in dir(package) if not x.startswith("_")} == set(package.__all__)
        with pytest.raises(AttributeError, match="xyzzy"):
            _ = package.xyzzy
    with pytest.raises(AttributeError, match=r"simulat.* Did you mean 'simulate'"):
        _ = jaxdyn.simulat
    with pytest.raises(AttributeError, match="Did you mean 'stability'"):
        _ = orbits.stabilty
    with pytest.raises(AttributeError, match=r"'orbits' has no .* Did you mean 'continue_family'"):
        _ = orbits.family
    with pytest.raises(AttributeError, match="Did you mean 'read_csv'"):
        _ = jaxdyn.csv


@pytest.mark.parametrize(
    "folder",
    sorted(
        f"{package}.{file.parent.name}"
        for package in ("jaxdyn", "orbits")
        for file in (ROOT / package).glob("*/__init__.py")
    ),
)
def test_folders_declare_what_they_export(folder):
    exported = importlib.import_module(folder)
    file = Path(exported.__file__ or "")
    imported = {
        alias.name
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    declared = getattr(exported, "__all__", [])
    assert imported <= set(declared)
    for name in declared:
        found = getattr(exported, name)
        assert not name.startswith("_")
        if callable(found) or inspect.ismodule(found):
            assert (found.__doc__ or "").strip(), name
        else:  # data: ready solvers, printed starts, a type for annotations
            assert isinstance(found, Method | tuple | float | dict | types.UnionType), name


def test_names_that_moved_are_found_at_their_old_places_with_a_warning():
    for package in (jaxdyn, orbits):
        for name, place in package._MOVED.items():
            new = f"{package.__name__}.{place}.{name}"
            with pytest.warns(DeprecationWarning, match=re.escape(f"is now {new}; the old name")):
                found = getattr(package, name)
            assert found is getattr(importlib.import_module(f"{package.__name__}.{place}"), name)
            assert name not in package.__all__


RENAMED = (
    orbits.curves,
    jaxdyn.analysis.regularized,
    jaxdyn.course.page,
    jaxdyn.gallery,
    jaxdyn.geometry.frames,
    jaxdyn.geometry.rotations,
    jaxdyn.mechanisms.bars,
    jaxdyn.player,
    jaxdyn.vibration,
)


@pytest.mark.parametrize("module", RENAMED, ids=lambda module: module.__name__)
def test_names_that_changed_are_found_with_a_warning(module):
    assert module._RENAMED
    for old, new in module._RENAMED.items():
        whole = f"{old} is now {module.__name__}.{new}; the old"
        with pytest.warns(DeprecationWarning, match=whole):
            assert getattr(module, old) is getattr(module, new)
    with pytest.raises(AttributeError, match="Xyzzy"):
        _ = module.Xyzzy


def test_a_field_that_changed_its_name_is_made_by_the_old_one_with_a_warning():
    events = jaxdyn.integrate.events
    falls = events.Reaches(1, 0.5, direction=-1)
    assert falls.direction == -1
    with pytest.warns(DeprecationWarning, match="^way of Reaches is now direction; the") as told:
        assert eqx.tree_equal(events.Reaches(1, 0.5, way=-1), falls)  # pyright: ignore[reportCallIssue]
    assert told[0].filename == __file__
    with pytest.raises(TypeError, match="multiple values for argument 'direction'"):
        events.When(_level, 1, direction=1)  # pyright: ignore[reportCallIssue]


def _level(t, y):
    return y[0]


def test_methods_and_attributes_that_changed_are_found_with_a_warning():
    @renamed(cut="bodies", rests="equilibria")
    class Base:
        equilibria = (1, 2)

        def bodies(self, n):
            return ["base"] * n

    with pytest.warns(DeprecationWarning, match=r"Base\.rests is now equilibria; the old name is"):
        assert Base().rests == (1, 2)
    with pytest.warns(
        DeprecationWarning, match=r"Base\.cut is now bodies; .* next version"
    ) as told:
        assert Base().cut(2) == ["base", "base"]
    assert told[0].filename == __file__
    with pytest.warns(DeprecationWarning, match=r"Mine\.cut is now bodies"):

        class Mine(Base):
            def cut(self, n):
                return ["mine"] * n

    assert Mine().bodies(1) == Mine().cut(1) == ["mine"]
    for cls, old in (
        (jaxdyn.System, "cut"),
        (jaxdyn.System, "held"),
        (Mechanism, "tied"),
        (jaxdyn.integrate.events.Reaches, "way"),
        (orbits.closing.Closing, "miss"),
        (orbits.closing.Closing, "rows"),
    ):
        assert isinstance(getattr(cls, old), property)


def test_folders_that_few_need_are_reached_but_not_listed():
    assert "gallery" not in dir(jaxdyn)
    code = "import jaxdyn, orbits; print(jaxdyn.gallery.__name__, orbits.shooting.__name__)"
    assert run_python(code) == "jaxdyn.gallery orbits.shooting"


def test_no_function_is_shadowed_by_a_module():
    assert TWINS == []


def test_importing_the_packages_loads_nothing():
    code = "import sys, jaxdyn, orbits; print({'jax', 'numpy', 'matplotlib'} & {*sys.modules})"
    assert run_python(code) == "set()"


def test_modules_that_moved_are_found_and_warn():
    for package, old, new in (
        (jaxdyn, "balls", "jaxdyn.ball_arithmetic"),
        (jaxdyn.studies, "upright", "jaxdyn.hard.cases.shaken"),
        (orbits.hybrid, "hopping", "jaxdyn.course.eccentric_cylinder"),
        (jaxdyn.files, "image_files", "jaxdyn.files.output_files"),
    ):
        with pytest.warns(DeprecationWarning, match=f"{old} is now {new}; the old name is removed"):
            assert getattr(package, old).__name__ == new


def test_the_version_is_that_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["hatch"]["version"]["path"] == "jaxdyn/__init__.py"
    assert orbits.__version__ == jaxdyn.__version__
    assert re.fullmatch(r"\d+\.\d+\.\d+", jaxdyn.__version__)


def test_files_name_only_classes_that_are_known_then():
    # Classes are looked up among those that are loaded: with lazy packages too few could be.
    code = """
import importlib, pkgutil
from jaxdyn.files import codec
def known():
    classes = codec._known_classes((codec.Scene, *codec.PARTS)).values()
    return {f"{cls.__module__}.{cls.__name__}" for cls in classes}
before = known()
import jaxdyn
for package in (jaxdyn.scenes, jaxdyn.effects, jaxdyn.formulations, jaxdyn.mechanisms):
    for module in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
        importlib.import_module(module.name)
print(sorted(known() - before))
"""
    assert run_python(code) == "[]"
