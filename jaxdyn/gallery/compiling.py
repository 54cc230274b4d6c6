"""How the programs of the gallery and of the tests are compiled: quickly, but for timed ones.

Most of the time of a page or a test goes into compiling programs that run once. XLA takes half as
long without its optimisations, and what is left is halved again for small programs (three quarters
for large ones, jaxlib 0.10.2) by its older emitters, which write LLVM's code without a detour by
MLIR. Besides, JAX sets up the whole of MLIR for each program that it
lowers and tears it down again, a third of the processor time where programs are small: all programs
of a process share one context here. Neither is for users' processes: their programs would run
slower, and what a context holds is freed only with it.
"""

import functools
import os

import jax

from jaxdyn._config import add_flags, cache_folder, configure

try:  # Only private names reach the contexts; without them each program has its own again.
    from jax._src.interpreters import mlir
    from jaxlib.mlir import ir

    _make_context = mlir.make_ir_context
except (ImportError, AttributeError):
    mlir = None

_QUICKLY = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    "xla_cpu_use_fusion_emitters": False,
    "xla_cpu_parallel_codegen_split_count": 1,
}
#: For programs that are timed: as they are compiled for users, see `work_precision`.
FULLY = {
    "xla_backend_optimization_level": 3,
    "xla_llvm_disable_expensive_passes": False,
    "xla_cpu_use_fusion_emitters": True,
    "xla_cpu_parallel_codegen_split_count": 32,
}


def share_context() -> None:
    """Lower the programs of this process in one MLIR context, from now on a new one."""
    if mlir is None:
        return
    shared = functools.cache(_make_context)

    def make():
        # What is compiled while another program is lowered would become a part of that one.
        return _make_context() if _is_lowering() else shared()

    mlir.make_ir_context = make
    # Where in the source each operation comes from: nobody reads these programs.
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
