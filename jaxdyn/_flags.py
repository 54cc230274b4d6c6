"""Flags of XLA's compiler, of which a new jaxlib may have lost some.

An unknown flag in ``XLA_FLAGS`` ends the process at the first use of a device, with one line on
standard error that is easily lost.
"""

import importlib.metadata
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

#: The newest jaxlib with which all flags that are set here were tested; what is newer is tried.
TESTED = (0, 12)

_START = "import jax; jax.devices('cpu')"  # which reads the flags


def known_flags(flags: Sequence[str], folder: Path | None) -> list[str]:
    """Those of some flags that this jaxlib knows; a warning names the others.

    Args:
      flags: such as ``--xla_backend_optimization_level=0``.
      folder: where the answer for a jaxlib that is newer than those tested is kept, since finding
        it starts a process for each flag; None asks every time.
    """
    version = release()
    if tuple(map(int, version.split(".")[:2])) <= TESTED:
        return list(flags)
    file = None if folder is None else folder / f"xla_flags_of_jaxlib_{version}.json"
    answers = _stored_answers(file)
    asked = [flag for flag in flags if flag not in answers]
    if asked:
        answers |= {flag: _starts_with(flag) for flag in asked}
        _keep(file, answers)
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


def _starts_with(flag: str) -> bool:
    """Whether a new process with this flag alone can use a device."""
    env = os.environ | {"XLA_FLAGS": flag, "JAX_PLATFORMS": "cpu"}
    done = subprocess.run([sys.executable, "-c", _START], env=env, capture_output=True, check=False)
    return done.returncode == 0


def _stored_answers(file: Path | None) -> dict[str, bool]:
    try:
        found = json.loads(file.read_text()) if file else {}
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _keep(file: Path | None, answers: dict[str, bool]) -> None:
    if file:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(answers))
        except OSError:  # a folder that cannot be written costs a second every time
            pass
