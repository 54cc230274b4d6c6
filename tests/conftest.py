"""Strict modes for every test: float64, no silent promotion, checked shapes; the compile cache."""

import gc
import os

os.environ.setdefault("MPLBACKEND", "Agg")

import jax
import jaxtyping
import pytest

# Before the packages are imported.
jaxtyping.install_import_hook(["jaxdyn", "orbits"], "shapes.checked")

import jaxdyn  # noqa: E402

# They make the stored references with packages that the tests do not need.
collect_ignore = ["references"]

jaxdyn.configure()
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")


# Compiling makes millions of objects that stay: looking through them all again and again would
# take a fifteenth of the time.
gc.set_threshold(100_000, 20, 50)


def pytest_collection_finish():
    """Leave what was imported out of the garbage collector's search."""
    gc.freeze()


@pytest.fixture(scope="module", autouse=True)
def _forget_programs():
    """Compiled programs of a file go with it; those of all would fill some 8 GB a process."""
    yield
    jax.clear_caches()
    gc.collect()
