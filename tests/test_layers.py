"""The architecture: which folder may import which, no cycles, imports at the top of files."""

import ast
import functools
import re
from pathlib import Path

import pytest
from helpers import run_python

ROOT = Path(__file__).parents[1]

#: Every folder with the folders that it may import; "jaxdyn" and "orbits" stand for the files
#: beside the folders: the waist (`scene`), statuses and private helpers, and what an orbit is.
#: Within `jaxdyn` a folder may import what its entries may, and `orbits` may import all of it.
BELOW = {
    "jaxdyn": (),
    "jaxdyn/geometry": ("jaxdyn",),
    "jaxdyn/effects": ("jaxdyn",),
    "jaxdyn/solvers": ("jaxdyn",),
    "jaxdyn/ball_arithmetic": ("jaxdyn/solvers",),
    "jaxdyn/formulations": ("jaxdyn/geometry",),
    "jaxdyn/mechanisms": ("jaxdyn/formulations",),
    "jaxdyn/symbolic": ("jaxdyn/solvers", "jaxdyn/mechanisms", "jaxdyn/effects", "jaxdyn/scenes"),
    "jaxdyn/plan": ("jaxdyn",),
    "jaxdyn/integrate": ("jaxdyn/solvers", "jaxdyn/plan"),
    "jaxdyn/ensemble": ("jaxdyn/integrate",),
    "jaxdyn/fitting": ("jaxdyn/integrate",),
    "jaxdyn/analysis": ("jaxdyn/integrate", "jaxdyn/formulations", "jaxdyn/ball_arithmetic"),
    "jaxdyn/vibration": ("jaxdyn/analysis", "jaxdyn/effects"),
    "jaxdyn/accuracy": ("jaxdyn/analysis",),
    "jaxdyn/chaos": ("jaxdyn/analysis", "jaxdyn/ensemble", "jaxdyn/files"),
    "jaxdyn/continuation": ("jaxdyn/analysis", "jaxdyn/files"),
    "jaxdyn/files": ("jaxdyn/accuracy", "jaxdyn/scenes", "jaxdyn/vibration"),
    "jaxdyn/scenes": ("jaxdyn/mechanisms", "jaxdyn/effects", "jaxdyn/integrate"),
    "jaxdyn/drawing": (
        "jaxdyn/files",
        "jaxdyn/scenes",
        "jaxdyn/chaos",
        "jaxdyn/continuation",
        "jaxdyn/fitting",
        "jaxdyn/vibration",
    ),
    "jaxdyn/hard": ("jaxdyn/accuracy", "jaxdyn/scenes", "jaxdyn/ensemble"),
    "jaxdyn/course": ("jaxdyn/hard", "jaxdyn/player", "jaxdyn/drawing", "jaxdyn/symbolic"),
    "jaxdyn/player": ("jaxdyn/drawing", "jaxdyn/symbolic"),
    "jaxdyn/gallery": ("jaxdyn/course", "jaxdyn/player", "jaxdyn/symbolic"),
    "jaxdyn/cli": ("jaxdyn/hard", "jaxdyn/drawing", "jaxdyn/symbolic", "jaxdyn/vibration"),
    "orbits/closing": (),
    "orbits": ("orbits/closing",),
    "orbits/shooting": ("orbits",),
    "orbits/analysis": ("orbits/shooting", "orbits/hybrid"),
    "orbits/proof": ("orbits/analysis",),
    "orbits/families": ("orbits/analysis",),
    "orbits/curves": ("orbits/families",),
    "orbits/manifolds": ("orbits/families",),
    "orbits/responses": ("orbits/families", "orbits/discovery"),
    "orbits/sections": ("orbits/analysis",),
    "orbits/discovery": ("orbits/analysis",),
    "orbits/hybrid": ("orbits/shooting",),
    "orbits/targets": ("orbits/families",),
    "orbits/tori": ("orbits/families",),
    "orbits/files": ("orbits/families", "orbits/proof"),
    "orbits/drawing": (
        "orbits/discovery",
        "orbits/files",
        "orbits/manifolds",
        "orbits/responses",
        "orbits/sections",
        "orbits/targets",
        "orbits/tori",
    ),
    "orbits/cli": ("orbits/drawing", "orbits/discovery", "orbits/hybrid"),
}

#: Folders of `jaxdyn` that show what both packages do.
ABOVE_ORBITS = {"jaxdyn/course", "jaxdyn/gallery"}

#: Folders of many files of one kind, which nobody has to look through.
COLLECTIONS = {"jaxdyn/course", "jaxdyn/scenes"}

#: Imports inside functions: what the private question to JAX needs, and packages that may be
#: missing.
INSIDE = {
    ("jaxdyn/_config.py", "jax._src"),
    ("jaxdyn/_records.py", "cloudpickle"),
    ("orbits/files/verify.py", "orbits.proof.checking"),
    ("jaxdyn/analysis/equilibria.py", "jaxdyn.analysis.equilibrium_search.proving"),
}

#: Methods of results lead to what is above them, where they are saved, exported and drawn. Nothing
#: else imports upwards.
UPWARDS = {
    ("jaxdyn/integrate/trajectory.py", "jaxdyn.files.motion_files"),
    ("jaxdyn/integrate/trajectory.py", "jaxdyn.files.data_frames"),
    ("jaxdyn/integrate/trajectory.py", "jaxdyn.drawing.space"),
    ("jaxdyn/integrate/trajectory.py", "jaxdyn.player.pages"),
    ("jaxdyn/scene.py", "jaxdyn.drawing.space"),
    ("jaxdyn/scene.py", "jaxdyn.player.live"),
    ("jaxdyn/continuation/family.py", "jaxdyn.drawing.bifurcations"),
    ("jaxdyn/fitting/result.py", "jaxdyn.drawing.fits"),
    ("jaxdyn/continuation/curve.py", "jaxdyn.drawing.bifurcations"),
    ("orbits/orbit.py", "orbits.drawing.pages"),
    ("orbits/orbit.py", "orbits.drawing.periodic"),
    ("orbits/hybrid/legs.py", "orbits.drawing.pages"),
    ("orbits/hybrid/legs.py", "orbits.drawing.periodic"),
    ("orbits/families/family.py", "orbits.drawing.families"),
    ("orbits/families/family.py", "orbits.drawing.pages"),
    ("orbits/families/family.py", "orbits.drawing.periodic"),
    ("orbits/discovery/settling.py", "orbits.drawing.basin_maps"),
    ("orbits/discovery/tipping.py", "orbits.drawing.basin_maps"),
    ("orbits/manifolds/manifold.py", "orbits.drawing.manifolds"),
    ("orbits/analysis/stability.py", "orbits.drawing.unit_circle"),
    ("orbits/tori/torus.py", "orbits.drawing.tori"),
    ("orbits/families/diagram.py", "orbits.drawing.diagrams"),
    ("orbits/families/graph.py", "orbits.drawing.graphs"),
    ("orbits/responses/response.py", "orbits.drawing.responses"),
    ("orbits/responses/backbone.py", "orbits.drawing.responses"),
}

FILES = sorted(
    str(path.relative_to(ROOT))
    for package in ("jaxdyn", "orbits")
    for path in (ROOT / package).rglob("*.py")
)
_ALL = frozenset(FILES)
#: They gather names for the outside, or start a command line.
DOORS = {
    f"{package}/{file}.py" for package in ("jaxdyn", "orbits") for file in ("__init__", "__main__")
}
MODULES = [file for file in FILES if file not in DOORS]


def _imports(tree: ast.AST) -> list[tuple[str, ast.AST]]:
    """(dotted name, node) of every import below a node; names taken `from` are appended."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(alias.name, node) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: imports are absolute"
            found += [(f"{node.module}.{alias.name}", node) for alias in node.names]
    return found


@functools.cache
def _file(name: str) -> str | None:
    """The file of ours that a dotted name lies in: `a.b.c` is a/b/c.py, or c of a/b.py."""
    parts = HOMES.get(name, name).split(".")
    for n in range(len(parts), 0, -1):
        for file in ("/".join(parts[:n]) + ".py", "/".join([*parts[:n], "__init__.py"])):
            if file in _ALL:
                return file
    return None


def _folder(file: str) -> str:
    """The folder of the architecture that a file belongs to."""
    return "/".join(file.split("/")[:2]) if file.count("/") > 1 else file.split("/")[0]


@functools.cache
def _parse(file: str) -> ast.Module:
    return ast.parse((ROOT / file).read_text())


@functools.cache
def _targets(file: str) -> list[tuple[str, int]]:
    """(file, line) of what a file imports from its own package."""
    tree = _parse(file)
    upwards = [
        node
        for scope in ast.walk(tree)
        if isinstance(scope, ast.FunctionDef)
        for name, node in _imports(scope)
        if (file, name) in UPWARDS
    ]
    found = [(_file(name), node.lineno) for name, node in _imports(tree) if node not in upwards]
    return [(x, n) for x, n in found if x and x != file and x.split("/")[0] == file.split("/")[0]]


@functools.cache
def _closure(folder: str) -> frozenset[str]:
    """What a folder may import: its entries, and theirs."""
    return frozenset({folder}).union(*(_closure(below) for below in BELOW[folder]))


#: Public names of the packages whose parts wait for their first use, and where they come from.
HOMES = {
    f"{package}.{alias.name}": ".".join(filter(None, (package, node.module, alias.name)))
    for stub in ROOT.glob("**/__init__.pyi")
    for package in [".".join(stub.relative_to(ROOT).parent.parts)]
    for node in ast.parse(stub.read_text()).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}


def test_files_import_only_folders_below_theirs():
    wrong = []
    for file in MODULES:
        folder = _folder(file)
        assert folder in BELOW, f"{folder} is no folder of the architecture: add it to BELOW"
        for target, line in _targets(file):
            # Only command lines, which are above everything, may reach it through the package.
            below = "/cli/" in file if target in DOORS else _folder(target) in _closure(folder)
            wrong += [] if below else [f"{file}, line {line}: {target} is not below it"]
    assert not wrong


def test_no_file_imports_itself_by_way_of_others():
    waiting = {file: {target for target, _ in _targets(file)} for file in MODULES}
    while free := {file for file, targets in waiting.items() if not targets & set(waiting)}:
        waiting = {file: targets for file, targets in waiting.items() if file not in free}
    # A folder that only gathers names of its files is imported by files of other folders.
    assert not waiting, f"a cycle among {sorted(waiting)}"


def test_folders_are_those_of_the_architecture():
    assert set(BELOW) == {_folder(file) for file in FILES}


@pytest.mark.parametrize("folder", sorted(folder for folder in BELOW if "/" in folder))
def test_folders_say_what_they_hold_and_may_import(folder):
    text = ast.get_docstring(_parse(f"{folder}/__init__.py")) or ""
    allowed = {below.removeprefix(f"{folder.split('/')[0]}/") for below in BELOW[folder]}
    if folder.startswith("orbits/"):
        allowed = allowed or {"jaxdyn"}
    said = text[text.index("May import:") :].partition(".")[0]
    if folder in ABOVE_ORBITS:
        said = said.partition(";")[0]
        assert "and `orbits`." in text
    # Folders of `orbits` may import all of `jaxdyn`; it is said where there is nothing else.
    assert set(re.findall(r"`(\w+)`", said)) == allowed
    assert "\nTo add " in text or "\nOne more " in text
    if folder not in COLLECTIONS:
        modules = {Path(file).stem for file in FILES if file.rpartition("/")[0] == folder}
        assert modules - {"__init__"} <= set(re.findall(r"`(\w+)`", text)), folder


#: They use a private name of JAX where no public one serves, and say so.
PRIVATE = {"jaxdyn/_config.py", "jaxdyn/gallery/compiling.py"}


def test_jaxdyn_never_mentions_orbits():
    below = [f for f in FILES if f.startswith("jaxdyn/") and _folder(f) not in ABOVE_ORBITS]
    names = {file: [name.split(".")[0] for name, _ in _imports(_parse(file))] for file in below}
    assert not [file for file in below if "orbits" in names[file]]


def test_private_names_of_jax_stand_in_the_files_that_say_so():
    found = {f for f in FILES if any("._src" in name for name, _ in _imports(_parse(f)))}
    assert found == PRIVATE


def test_imports_stand_at_the_top():
    inside = []
    scopes = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda
    for file in FILES:
        allowed = tuple(start for f, start in INSIDE | UPWARDS if f == file)
        for scope in (node for node in ast.walk(_parse(file)) if isinstance(node, scopes)):
            imports = [(name, node.lineno) for name, node in _imports(scope)]
            inside += [(file, *found) for found in imports if not found[0].startswith(allowed)]
    assert not inside


def test_no_exception_is_left_over():
    for file, name in INSIDE | UPWARDS:
        assert any(found.startswith(name) for found, _ in _imports(_parse(file))), (file, name)


def test_commands_that_draw_nothing_load_no_drawing_library():
    code = "import sys, jaxdyn.cli.app, orbits.cli.app; print('matplotlib' in sys.modules)"
    assert run_python(code) == "False"


def test_a_search_that_does_not_descend_does_not_load_optax():
    code = "import sys, orbits.shooting.finding; print('optax._src' in sys.modules)"
    assert run_python(code) == "False"


def test_a_page_of_the_course_loads_no_drawing_library_before_it_draws():
    code = """
import sys, jaxdyn
jaxdyn.configure()
shown = jaxdyn.course.page.run("cross_product", ask=False)
print(shown.page.holds, len(shown.page.drawings), "matplotlib" in sys.modules)
shown.page.drawings[0].figure
print("matplotlib" in sys.modules)
"""
    assert run_python(code).split() == ["True", "1", "False", "True"]


@pytest.mark.slow
def test_no_page_of_the_course_imports_a_drawing_library():
    code = """
import importlib, sys, jaxdyn
for page in jaxdyn.course.problems().values():
    importlib.import_module(f"jaxdyn.course.{page.name}")
print("matplotlib" in sys.modules, "jaxdyn.symbolic" in sys.modules)
"""
    assert run_python(code) == "False False"
