"""How long does a user wait for a command, cold and warm, and for the import?

Run: ``python -m benchmarks command``. ``orbits figure-eight --json`` in a fresh process, first
with an empty compile cache, then with the cache of the first run; beside it the imports of all that
the command uses. The import of jaxdyn, whose parts are imported at their first use, is compared
with that of diffrax, on which it is built.

Last numbers (2 cores, 2026-11, minima): cold 13.3 s, warm 6.2 s, of which 2.8 s are imports; import
of jaxdyn 0.03 s, of diffrax 2.1 s; on a machine twice as fast warm 2.9 s, of which 1.4 s.
"""

import os
import subprocess
import sys
import tempfile

from benchmarks._timing import Row, Times, interleave, seconds_of

_COMMAND = ("-m", "orbits", "figure-eight", "--json")
#: Runs the command, then prints the modules of ours that it has imported, in order.
_MODULES = f"""
import contextlib, io, runpy, sys
sys.argv = {list(_COMMAND[1:])}
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
    runpy.run_module("orbits", run_name="__main__")
print(*(name for name in sys.modules if name.split(".")[0] in ("jaxdyn", "orbits")))
"""
_IMPORTS = "its imports alone"
_ROUNDS, _QUICK_ROUNDS = 2, 1
_SLOW = 60.0  # [s] timeout


def run(quick: bool = False) -> list[Row]:
    """Wall times of fresh processes."""
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"JAXDYN_CACHE": cache}

        def python(*arguments: str):
            process = [sys.executable, *arguments]
            return lambda: subprocess.run(process, env=environment, check=True, capture_output=True)

        cold = seconds_of(python(*_COMMAND))
        modules = python("-c", _MODULES)().stdout.decode().split()
        runs = {
            "warm": python(*_COMMAND),
            _IMPORTS: python("-c", f"import {', '.join(modules)}"),
            "jaxdyn": python("-c", "import jaxdyn"),
            "diffrax": python("-c", "import diffrax"),
        }
        times = interleave(runs, rounds, slow=_SLOW)
    return [
        Row("command: cold", {"jaxdyn": Times(cold, cold)}),
        Row("command: warm", {"jaxdyn": times.pop("warm"), _IMPORTS: times.pop(_IMPORTS)}),
        Row("import", times),
    ]
