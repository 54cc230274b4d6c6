"""Fast compilation for the programs of the gallery and of the tests, except those that are timed.

Most of the time of a page or a test is spent on compiling programs that run once. XLA takes half as
long without its optimisations, and half of that again for small programs (seven tenths for large
ones, jaxlib 0.10.2) with its older emitters, which write LLVM's code directly instead of through
MLIR; not splitting a program into parts saves another tenth. In addition, JAX creates and destroys
an MLIR context for each program that it lowers, which takes a third of the processor time if
programs are small; here all programs of a process share one context. Neither suits users'
processes: their programs would run more slowly, and the memory of a context is freed only with the
context.
"""

import functools
import os

import jax

from jaxdyn._config import add_flags, cache_folder, configure, minor_release

try:  # Contexts are reached only by private names; without these each program has its own again.
    from jax._src.interpreters import mlir
    from jaxlib.mlir import ir

    _make_context = mlir.make_ir_context
except (ImportError, AttributeError):
    mlir = None

_QUICKLY = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    "xla_cpu_parallel_codegen_split_count": 1,
}
#: For programs that are timed: the same options as for users, see `work_precision`.
FULLY = {
    "xla_backend_optimization_level": 3,
    "xla_llvm_disable_expensive_passes": False,
    "xla_cpu_parallel_codegen_split_count": 32,
}
if minor_release() < (0, 11):  # later ones have only the emitters that use MLIR, and no such flag
    _QUICKLY["xla_cpu_use_fusion_emitters"] = False
    FULLY["xla_cpu_use_fusion_emitters"] = True


def share_context() -> None:
    """From now on, lower all programs of this process in a single, new MLIR context."""
    if mlir is None:
        return
    shared = functools.cache(_make_context)

    def make():
        # A program that is compiled while another is lowered would become a part of that one.
        return _make_context() if _is_lowering() else shared()

    mlir.make_ir_context = make
    # Omit the source locations of operations, since nobody reads these programs.
    jax.config.update("jax_traceback_in_locations_limit", 0)


def _is_lowering() -> bool:
    try:
        return ir.InsertionPoint.current is not None
    except ValueError:  # there is none
        return False


def configure_quickly() -> None:
    """`configure` for a process that runs pages; flags that are set already are kept."""
    share_context()
    given = os.environ.get("XLA_FLAGS", "")
    flags = [f"--{name}={str(value).lower()}" for name, value in _QUICKLY.items()]
    added = [flag for flag in flags if flag.partition("=")[0] not in given]
    add_flags(added, cache_folder())
    configure()
