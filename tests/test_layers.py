"""The import graph: each file imports only files of a lower rank, at its top."""

import ast
from pathlib import Path

import pytest
from helpers import run_python

ROOT = Path(__file__).parents[1]

#: Rank of every file; a file imports only lower ranks of its package, and only orbits imports
#: from the other. Packages' own `__init__.py` gather names for the outside and are not ranked;
#: the two packages themselves gather them lazily, so a name counts as the file it comes from.
#: A new file is one new line here.
RANKS = {
    "jaxdyn/_misuse.py": -1,
    "jaxdyn/_checks.py": 0,
    "jaxdyn/_config.py": 0,
    "jaxdyn/_floats.py": 0,
    "jaxdyn/_lazy.py": 0,
    "jaxdyn/_progress.py": -1,
    "jaxdyn/arithmetic.py": 0,
    "jaxdyn/output_files.py": 0,
    "jaxdyn/_numerics.py": 0,
    "jaxdyn/_arguments.py": 1,
    "jaxdyn/_shapes.py": 1,
    "jaxdyn/rounding.py": 0,
    "jaxdyn/side_by_side.py": 1,
    "jaxdyn/_roots.py": 0,
    "jaxdyn/status.py": 0,
    "jaxdyn/image_files.py": 1,
    "jaxdyn/indices.py": 1,
    "jaxdyn/kinematics.py": 2,
    "jaxdyn/scene.py": 2,
    "jaxdyn/vectors.py": 2,
    "jaxdyn/effects/_parts.py": 3,
    "jaxdyn/ledger.py": 3,
    "jaxdyn/linearize.py": 3,
    "jaxdyn/records.py": 3,
    "jaxdyn/rotations.py": 3,
    "jaxdyn/solvers/compositions.py": 2,
    "jaxdyn/solvers/gauss.py": 2,
    "jaxdyn/solvers/enclosures.py": 2,
    "jaxdyn/solvers/intervals.py": 0,
    "jaxdyn/solvers/formulas.py": 1,
    "jaxdyn/solvers/graph.py": 0,
    "jaxdyn/solvers/method.py": 1,
    "jaxdyn/solvers/ordered.py": 1,
    "jaxdyn/solvers/pairs.py": 2,
    "jaxdyn/solvers/radau.py": 3,
    "jaxdyn/solvers/recurrences.py": 2,
    "jaxdyn/solvers/stepper.py": 2,
    "jaxdyn/solvers/stoermer.py": 3,
    "jaxdyn/solvers/taylor.py": 3,
    "jaxdyn/stretches.py": 1,
    "jaxdyn/stepping.py": 3,
    "jaxdyn/effects/central.py": 4,
    "jaxdyn/effects/drag.py": 4,
    "jaxdyn/effects/external.py": 4,
    "jaxdyn/effects/gravity.py": 4,
    "jaxdyn/effects/links.py": 4,
    "jaxdyn/equilibria.py": 5,
    "jaxdyn/completeness.py": 4,
    "jaxdyn/isolation.py": 3,
    "jaxdyn/rest_search.py": 3,
    "jaxdyn/steady.py": 4,
    "jaxdyn/euler.py": 4,
    "jaxdyn/fixed.py": 3,
    "jaxdyn/spans.py": 4,
    "jaxdyn/flow.py": 4,
    "jaxdyn/inertia.py": 4,
    "jaxdyn/balance.py": 5,
    "jaxdyn/formulations/mechanism.py": 5,
    "jaxdyn/formulations/newton.py": 5,
    "jaxdyn/adjoint.py": 5,
    "jaxdyn/event_values.py": 4,
    "jaxdyn/polish.py": 5,
    "jaxdyn/crossings.py": 6,
    "jaxdyn/ladder.py": 4,
    "jaxdyn/simulate.py": 6,
    "jaxdyn/accuracy.py": 7,
    "jaxdyn/horizon.py": 8,
    "jaxdyn/end_error.py": 10,
    "jaxdyn/timing.py": 0,
    "jaxdyn/work.py": 8,
    "jaxdyn/rod_or_spring.py": 10,
    "jaxdyn/cli/accuracy.py": 13,
    "jaxdyn/lanes.py": 5,
    "jaxdyn/watches.py": 4,
    "jaxdyn/batches.py": 7,
    "jaxdyn/ensemble.py": 8,
    "jaxdyn/energy.py": 7,
    "jaxdyn/events.py": 7,
    "jaxdyn/formulations/bars.py": 7,
    "jaxdyn/formulations/constrained.py": 7,
    "jaxdyn/formulations/guided.py": 7,
    "jaxdyn/formulations/lagrange.py": 7,
    "jaxdyn/formulations/newton_euler.py": 7,
    "jaxdyn/formulations/attitude.py": 5,
    "jaxdyn/formulations/rigid.py": 7,
    "jaxdyn/formulations/euler_body.py": 8,
    "jaxdyn/formulations/rods.py": 7,
    "jaxdyn/formulations/sticks.py": 7,
    "jaxdyn/constraints.py": 8,
    "jaxdyn/momenta.py": 7,
    "jaxdyn/formulations/fourbar.py": 8,
    "jaxdyn/formulations/routes.py": 8,
    "jaxdyn/phase.py": 8,
    "jaxdyn/phases.py": 9,
    "jaxdyn/regularised.py": 8,
    "jaxdyn/approaches.py": 9,
    "jaxdyn/precession.py": 10,
    "jaxdyn/sleeping_top.py": 10,
    "jaxdyn/satellite_claims.py": 11,
    "jaxdyn/scenes/apsidal.py": 7,
    "jaxdyn/scenes/central.py": 8,
    "jaxdyn/scenes/nbody.py": 8,
    "jaxdyn/scenes/particles.py": 7,
    "jaxdyn/scenes/satellites.py": 8,
    "jaxdyn/scenes/springs.py": 8,
    "jaxdyn/scenes/cylinders.py": 8,
    "jaxdyn/scenes/skates.py": 9,
    "jaxdyn/scenes/wheels.py": 10,
    "jaxdyn/scenes/rolling.py": 10,
    "jaxdyn/scenes/disks.py": 9,
    "jaxdyn/course.py": 0,
    "jaxdyn/steps.py": 4,
    "jaxdyn/floquet.py": 7,
    "jaxdyn/formulations/prescribed.py": 7,
    "jaxdyn/scenes/ballistics.py": 1,
    "jaxdyn/scenes/drawings.py": 10,
    "jaxdyn/scenes/sideways.py": 9,
    "jaxdyn/sketch.py": 1,
    "jaxdyn/drawing/figures.py": 2,
    "jaxdyn/drawing/curves.py": 7,
    "jaxdyn/drawing/strokes.py": 11,
    "jaxdyn/drawing/solid.py": 0,
    "jaxdyn/drawing/titles.py": 10,
    "jaxdyn/drawing/artists.py": 12,
    "jaxdyn/drawing/contents.py": 10,
    "jaxdyn/drawing/panels.py": 11,
    "jaxdyn/drawing/space.py": 13,
    "jaxdyn/drawing/series.py": 12,
    "jaxdyn/drawing/projections.py": 12,
    "jaxdyn/drawing/animation.py": 13,
    "jaxdyn/drawing/charts.py": 12,
    "jaxdyn/drawing/accuracy.py": 12,
    "jaxdyn/energy_change.py": 10,
    "jaxdyn/upright.py": 10,
    "jaxdyn/scenes/bodies.py": 9,
    "jaxdyn/scenes/guides.py": 9,
    "jaxdyn/scenes/linkages.py": 9,
    "jaxdyn/scenes/pendula.py": 9,
    "jaxdyn/catalogue.py": 11,
    "jaxdyn/hard/case.py": 0,
    "jaxdyn/hard/elliptic.py": 0,
    "jaxdyn/hard/encounters.py": 11,
    "jaxdyn/hard/collection.py": 12,
    "jaxdyn/cli/hard.py": 13,
    "jaxdyn/hard/singular.py": 11,
    "jaxdyn/hard/bodies.py": 11,
    "jaxdyn/hard/contact.py": 11,
    "jaxdyn/hard/drift.py": 11,
    "jaxdyn/hard/dependent.py": 11,
    "jaxdyn/hard/stiff.py": 11,
    "jaxdyn/hard/centres.py": 11,
    "jaxdyn/hard/long.py": 11,
    "jaxdyn/hard/chaos.py": 11,
    "jaxdyn/hard/separatrix.py": 11,
    "jaxdyn/hard/shaken.py": 11,
    "jaxdyn/hard/friction.py": 11,
    "jaxdyn/hard/rest.py": 11,
    "jaxdyn/hard/coordinates.py": 11,
    "jaxdyn/switching.py": 10,
    "jaxdyn/cli/shared.py": 12,
    "jaxdyn/cli/screen.py": 12,
    "jaxdyn/tables.py": 11,
    "jaxdyn/cli/list.py": 13,
    "jaxdyn/cli/run.py": 13,
    "jaxdyn/cli/app.py": 14,
    "jaxdyn/__main__.py": 15,
    "orbits/newton.py": 11,
    "orbits/symmetry.py": 11,
    "orbits/closing.py": 12,
    "orbits/conditions.py": 12,
    "orbits/given.py": 13,
    "orbits/motion.py": 11,
    "orbits/problem.py": 13,
    "orbits/equations.py": 14,
    "orbits/cuts.py": 15,
    "orbits/retimed.py": 15,
    "orbits/shooting.py": 16,
    "orbits/hybrid.py": 14,
    "orbits/hybrid_search.py": 17,
    "orbits/hopping.py": 18,
    "orbits/evidence.py": 16,
    "orbits/figure_eight.py": 17,
    "orbits/identity.py": 15,
    "orbits/alignment.py": 14,
    "orbits/same.py": 15,
    "orbits/words.py": 15,
    "orbits/monodromy.py": 14,
    "orbits/trivial.py": 14,
    "orbits/surface.py": 17,
    "orbits/stability.py": 15,
    "orbits/family.py": 18,
    "orbits/sensitivity.py": 16,
    "orbits/bifurcations.py": 19,
    "orbits/continuation.py": 20,
    "orbits/report.py": 17,
    "orbits/cli/printed.py": 18,
    "orbits/cli/shared.py": 21,
    "orbits/nearby.py": 18,
    "orbits/parameters.py": 11,
    "orbits/cli/find.py": 22,
    "orbits/files.py": 15,
    "orbits/family_files.py": 19,
    "orbits/cli/family.py": 23,
    "orbits/verify.py": 19,
    "orbits/screen.py": 15,
    "orbits/seeds.py": 16,
    "orbits/table.py": 16,
    "orbits/chunk.py": 17,
    "orbits/search.py": 18,
    "orbits/plane.py": 19,
    "orbits/cli/search.py": 22,
    "orbits/thrown.py": 10,
    "orbits/steady_fall.py": 11,
    "orbits/launch.py": 12,
    "orbits/shapes.py": 14,
    "orbits/loops.py": 17,
    "orbits/ranges.py": 13,
    "orbits/aim.py": 14,
    "orbits/drawing/periodic.py": 20,
    "orbits/drawing/families.py": 20,
    "orbits/drawing/throwing.py": 20,
    "orbits/drawing/about_centres.py": 20,
    "orbits/cli/aim.py": 22,
    "orbits/cli/loops.py": 22,
    "orbits/cli/figure_eight.py": 22,
    "orbits/cli/verify.py": 22,
    "orbits/cli/app.py": 24,
    "orbits/__main__.py": 25,
}

#: Imports inside functions: what the private question to JAX needs.
INSIDE = {("jaxdyn/_config.py", "jax._src")}

FILES = sorted(
    str(path.relative_to(ROOT))
    for package in ("jaxdyn", "orbits")
    for path in (ROOT / package).rglob("*.py")
)
MODULES = [file for file in FILES if not file.endswith("__init__.py")]


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


def _file(name: str) -> str | None:
    """The file of ours that a dotted name lies in: `a.b.c` is a/b/c.py, or c of a/b.py."""
    parts = HOMES.get(name, name).split(".")
    for n in range(len(parts), 0, -1):
        for file in ("/".join(parts[:n]) + ".py", "/".join([*parts[:n], "__init__.py"])):
            if file in FILES:
                return file
    return None


def _parse(file: str) -> ast.Module:
    return ast.parse((ROOT / file).read_text())


#: Public names of the two packages, and the dotted names that they come from.
HOMES = {
    f"{package}.{name.rsplit('.', 1)[1]}": name
    for package in ("jaxdyn", "orbits")
    for name, _ in _imports(_parse(f"{package}/__init__.pyi"))
}


@pytest.mark.parametrize("file", MODULES)
def test_files_import_only_lower_ranks(file):
    assert file in RANKS, f"{file} has no rank: add it to RANKS in tests/test_layers.py"
    for name, node in _imports(_parse(file)):
        target = _file(name)
        if target is None or target.startswith("jaxdyn/") != file.startswith("jaxdyn/"):
            continue
        where = f"{file}, line {node.lineno}: imports {name}"
        # Only command lines, which are above everything, may reach it through the package.
        assert target != "jaxdyn/__init__.py" or "/cli/" in file, where
        if target.endswith("__init__.py"):
            # A name of the package itself: fine where the package only gathers what is below.
            below = [_file(inner) for inner, _ in _imports(_parse(target))]
            ranks = [RANKS[x] for x in below if x in RANKS]
            assert max(ranks, default=-1) < RANKS[file], f"{where}, which gathers higher ranks"
        else:
            assert RANKS.get(target, 99) < RANKS[file], f"{where}, which is not of a lower rank"


@pytest.mark.parametrize("file", FILES)
def test_jaxdyn_never_mentions_orbits(file):
    names = [name.split(".")[0] for name, _ in _imports(_parse(file))]
    if file.startswith("jaxdyn/"):
        assert "orbits" not in names
    private = [name for name, _ in _imports(_parse(file)) if "._src" in name]
    assert not private or file == "jaxdyn/_config.py"


@pytest.mark.parametrize("file", FILES)
def test_imports_stand_at_the_top(file):
    for scope in ast.walk(_parse(file)):
        if isinstance(scope, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda):
            for name, node in _imports(scope):
                allowed = any(f == file and name.startswith(start) for f, start in INSIDE)
                assert allowed, f"{file}, line {node.lineno}: {name} is imported inside"


def test_command_lines_are_put_together_without_what_takes_long_to_load():
    code = """
import sys, jaxdyn.cli.app, orbits.cli.app
print({"jax", "numpy", "matplotlib", "equinox", "diffrax"} & {*sys.modules})
"""
    assert run_python(code) == "set()"


def test_every_rank_belongs_to_a_kept_file():
    gone = set(RANKS) - set(MODULES)
    assert not gone, f"remove from RANKS in tests/test_layers.py: {sorted(gone)}"
