"""How the programs of the gallery are compiled: quickly, but for those that are timed.

Most of the time of a page is XLA's compiler, for programs that run once: it takes half as long
without its optimisations.
"""

import os

from jaxdyn._config import configure

_QUICKLY = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    "xla_cpu_use_fusion_emitters": False,
}
#: For programs that are timed: as they are compiled for users, see `work_precision`.
FULLY = {
    "xla_backend_optimization_level": 3,
    "xla_llvm_disable_expensive_passes": False,
    "xla_cpu_use_fusion_emitters": True,
}


def configure_quickly() -> None:
    """`configure` for a process that runs pages; flags that are set already are kept."""
    given = os.environ.get("XLA_FLAGS", "")
    flags = [f"--{name}={str(value).lower()}" for name, value in _QUICKLY.items()]
    added = [flag for flag in flags if flag.partition("=")[0] not in given]
    os.environ["XLA_FLAGS"] = " ".join([given, *added]).strip()
    configure()
