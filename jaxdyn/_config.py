"""Opt-in process settings: 64-bit floats, fused loops, a compile cache.

Importing jaxdyn changes nothing. `configure()` makes four settings that suit programs with small
ODEs, appending to the user's settings and never overwriting them:

- ``jax_enable_x64``: trajectories are accurate to 1e-13.
- XLA's loop folding on CPU: a ``while`` whose body touches less memory than a threshold is
  compiled as ONE function instead of one kernel launch per fusion. The default threshold of
  1 KiB is below any useful stepping loop; 1 MiB covers all of ours (a solve gets 2 to 10
  times faster). Larger values also fold wide batched loops, where folding gains nothing.
- Programs run in the calling thread on CPU. By default JAX passes all but the smallest to another
  thread, and waking it takes about as long (40 us) as a whole short trajectory.
- A persistent compile cache, so that a second process starts in a fraction of the time.
"""

import importlib.metadata
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import jax

# ---- Flags of XLA's compiler, some of which a new jaxlib may no longer know
#
# An unknown flag in ``XLA_FLAGS`` ends the process at the first use of a device, with one line on
# standard error that is easily lost.

#: The newest jaxlib with which all flags that are set here were tested; newer ones try each flag.
TESTED = (0, 12)

_START = "import jax; jax.devices('cpu')"  # this reads the flags


def known_flags(flags: Sequence[str], folder: Path | None) -> list[str]:
    """The flags among those given that this jaxlib knows; a warning names the others.

    Args:
      flags: such as ``--xla_backend_optimization_level=0``.
      folder: where the answer for a jaxlib that is newer than those tested is kept, since finding
        it starts a process for each flag; None asks every time.
    """
    version = release()
    if minor_release() <= TESTED:
        return list(flags)
    file = None if folder is None else folder / f"xla_flags_of_jaxlib_{version}.json"
    answers = _stored_answers(file)
    asked = [flag for flag in flags if flag not in answers]
    if asked:
        answers |= {flag: not refusal_of(flag) for flag in asked}
        _store_answers(file, answers)
    lost = [flag for flag in flags if not answers[flag]]
    if lost:
        warnings.warn(
            f"jaxlib {version} does not know {', '.join(lost)}: left out of XLA_FLAGS. "
            "Everything works, perhaps slower.",
            stacklevel=5,  # the caller of configure()
        )
    return [flag for flag in flags if answers[flag]]


def release() -> str:
    """The version of jaxlib."""
    return importlib.metadata.version("jaxlib")


def minor_release() -> tuple[int, int]:
    """The first two numbers of the version of jaxlib."""
    major, minor, *_ = release().split(".")
    return int(major), int(minor)


def refusal_of(flags: str) -> str:
    """The last words of a new process with these ``XLA_FLAGS``; empty if it can use a device."""
    env = os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-c", _START]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    if not done.returncode:
        return ""
    return (done.stderr.splitlines() or [f"It ended with code {done.returncode}."])[-1]


def _stored_answers(file: Path | None) -> dict[str, bool]:
    try:
        found = json.loads(file.read_text()) if file else {}
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _store_answers(file: Path | None, answers: dict[str, bool]) -> None:
    if file:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(answers))
        except OSError:  # a folder that cannot be written to: it costs a second every time
            pass


# ---- Opt-in process settings: 64-bit floats, fused loops, a compile cache

_FOLD_KEY = "xla_cpu_small_while_loop_byte_threshold"
_FOLD_BYTES = 1 << 20  # 1 MiB, see the module docstring
_EXTRA = "--xla_backend_extra_options="
_ASYNC = "jax_cpu_enable_async_dispatch"  # has no attribute of jax.config, only a value


def configure(
    *,
    float64: bool = True,
    fold_loops: bool = True,
    same_thread: bool = True,
    cache: bool = True,
) -> None:
    """Set up JAX for accurate and fast trajectories; call it first in a program.

    Args:
      float64: enable 64-bit floats.
      fold_loops: append XLA's loop-folding option to ``XLA_FLAGS``. It takes effect only before
        the first use of a device; later a warning says that it came too late. Where a future
        version of jaxlib does not know the option any more, it is left out with a warning.
      same_thread: run CPU programs in the calling thread. Like loop folding, it takes effect
        only before the first use of a device.
      cache: keep compiled programs in ``$JAXDYN_CACHE`` or the user's cache folder, unless
        JAX already has a cache folder.
    Example:
      >>> import jaxdyn
      >>> jaxdyn.configure()
    """
    if float64:
        jax.config.update("jax_enable_x64", True)
    if (fold_loops or same_thread) and _backend_is_up():
        _warn_if_too_late(fold_loops, same_thread)
    else:
        if fold_loops:
            _fold_loops(cache_folder() if cache else None)
        if same_thread:
            jax.config.update(_ASYNC, False)
    if cache:
        _persistent_cache()


def _backend_is_up() -> bool:
    # A private name: no public function says whether a device is in use. If it is removed from JAX,
    # settings are made as if none were; only the warning that it is too late is lost.
    try:
        from jax._src import xla_bridge

        return xla_bridge.backends_are_initialized()
    except (ImportError, AttributeError):
        return False


def _warn_if_too_late(fold_loops: bool, same_thread: bool) -> None:
    wanted = {
        "XLA's loop folding": fold_loops and _FOLD_KEY not in os.environ.get("XLA_FLAGS", ""),
        "running in the calling thread": same_thread and jax.config.values[_ASYNC],
    }
    late = [what for what, missing in wanted.items() if missing]
    if late:
        warnings.warn(
            f"configure(): a device is already in use, so {' and '.join(late)} cannot be "
            "enabled any more; everything works, only slower. "
            "Call jaxdyn.configure() before the first computation.",
            stacklevel=3,
        )


def _fold_loops(folder: Path | None) -> None:
    # A value that is set already, perhaps by the user, is kept.
    if _FOLD_KEY not in os.environ.get("XLA_FLAGS", ""):
        # XLA merges repeated occurrences of the option, so appending keeps the user's keys.
        add_flags([f"{_EXTRA}{_FOLD_KEY}={_FOLD_BYTES}"], folder)


def add_flags(flags: list[str], folder: Path | None) -> None:
    """Append those flags to ``XLA_FLAGS`` that this jaxlib knows; see `known_flags`."""
    given = os.environ.get("XLA_FLAGS", "")
    os.environ["XLA_FLAGS"] = " ".join([given, *known_flags(flags, folder)]).strip()


def cache_folder() -> Path:
    """Where compiled programs are kept, unless JAX already has a cache folder."""
    chosen = os.environ.get("JAXDYN_CACHE")
    return Path(
        chosen or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "jaxdyn")
    )


def _persistent_cache() -> None:
    if jax.config.jax_compilation_cache_dir is None:
        jax.config.update("jax_compilation_cache_dir", str(cache_folder()))
        # Our programs compile in tenths of a second; the default of 1 s would skip them.
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
