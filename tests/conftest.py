"""Strict modes for every test: float64, no silent promotion, checked shapes; cheap compilation."""

import gc
import importlib.util
import math
import os
import pkgutil
import sys
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("MPLBACKEND", "Agg")

import jax
import pytest
import shapes

try:  # Only a private name reaches the options of every program; without it tests take longer.
    from jax._src import compiler
except ImportError:
    compiler = None

# Loops over numbers of any length, which the checks would make several times slower.
_UNCHECKED = {"jaxdyn.ball_arithmetic", "orbits.proof"}


def _checked_modules(package: str) -> set[str]:
    """The files and folders of a package, found without importing it."""
    spec = importlib.util.find_spec(package)
    assert spec is not None
    inside = pkgutil.iter_modules(spec.submodule_search_locations)
    return {f"{package}.{module.name}" for module in inside} - _UNCHECKED


# Before the packages are imported.
shapes.install(sorted(_checked_modules("jaxdyn") | _checked_modules("orbits")))

import jaxdyn  # noqa: E402
from jaxdyn._config import refusal_of  # noqa: E402
from jaxdyn.gallery.compiling import FULLY, configure_quickly, share_context  # noqa: E402

pytest_plugins = ["costs"]

_MOST_MEMORY = 3e9  # [bytes] that a process keeps from one file to the next

# They make the stored references with packages that the tests do not need.
collect_ignore = ["references"]

if "XLA_FLAGS" in os.environ:  # `XLA_FLAGS=" " pytest` tests the programs that users run
    jaxdyn.configure()
    share_context()
else:
    configure_quickly()
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")

# Compiling makes millions of objects that stay: looking through them all again and again would
# take a fifteenth of the time.
gc.set_threshold(100_000, 20, 50)


def pytest_configure(config):
    """End the run with XLA's own words where it refuses the flags.

    For an unknown flag it ends the process, and pytest would keep those words back: workers die one
    after the other, and nothing says why.
    """
    if not hasattr(config, "workerinput"):
        flags = os.environ["XLA_FLAGS"]
        said = refusal_of(flags)
        if said:
            pytest.exit(f"XLA does not start with XLA_FLAGS={flags!r}: {said}", returncode=3)


def pytest_collection_finish():
    """Leave what was imported out of the garbage collector's search."""
    gc.freeze()


@pytest.fixture(autouse=True)
def _check_shapes_again():
    shapes.begin_test()


@pytest.fixture(scope="module", autouse=True)
def _forget_programs():
    """Keep compiled programs for the next files (a tenth less to compile) while memory allows.

    Those of all files would fill some 8 GB a process.
    """
    yield
    if _memory() < _MOST_MEMORY:
        return
    jax.clear_caches()
    share_context()
    gc.collect()


def _memory() -> float:
    """What this process occupies [bytes]; infinite where it cannot be read."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:  # not Linux
        return math.inf
    return pages * os.sysconf("SC_PAGE_SIZE")


@pytest.fixture(scope="module")
def optimised():
    """The programs of a file as they are compiled for users: where they run for long."""
    if not hasattr(compiler, "get_compile_options"):
        yield
        return
    make = compiler.get_compile_options

    def options(*args, env_options_overrides=None, **others):
        wanted = FULLY | (env_options_overrides or {})
        return make(*args, env_options_overrides=wanted, **others)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiler, "get_compile_options", options)
        yield


class Ran(NamedTuple):
    """What a command line left: its exit code, standard output and standard error."""

    code: int
    out: str
    err: str


@pytest.fixture
def command(capsys, monkeypatch):
    """A function that runs a command line in this process: `command("orbits", "find", ...)`."""

    def run(program: str, *words) -> Ran:
        monkeypatch.setattr(sys, "argv", [program, *map(str, words)])
        app = importlib.import_module(f"{program}.cli.app")
        try:
            app.main()
        except SystemExit as end:
            return Ran(end.code or 0, *capsys.readouterr())
        return Ran(0, *capsys.readouterr())

    return run
