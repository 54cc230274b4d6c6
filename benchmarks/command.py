"""How long does a user wait for a command, cold and warm, for a first motion, and for the import?

Run: ``python -m benchmarks command``. ``orbits figure-eight --json`` in a fresh process, first
with an empty compile cache, then with the cache of the first run; beside it the time to import
everything that the command uses. The import of jaxdyn, whose parts are imported at their first use,
is compared with that of diffrax, on which it is built.

Last numbers (2 cores, 2026-11, minima): cold 13.3 s, warm 6.2 s, of which 2.8 s are imports; import
of jaxdyn 0.03 s, of diffrax 2.1 s; on a machine twice as fast warm 2.9 s, of which 1.4 s. With a
warm cache the first motion took 1.3 s to import, 0.5 to trace, 0.2 to lower, 0.2 to load and 0.03
to run while other work was on the cores, the command 1.5, 1.1, 0.7, 0.6 and 0.5. The processor
takes 1.7 s for the first motion (6 programs, of which one is the solve), of which 0.9 are imports
of JAX and diffrax, 4.4 s for the command (23 programs), 2.4 s for `jaxdyn run cannonball` (14), and
3.8 s for `jaxdyn course 35` (32), for which it took 6.3 s (84) while pages drew pictures that they
did not show. Since `orbits` integrates with four kinds of steps (with tangents, plainly, by another
method, and with many samples), the command cannot take fewer of its long programs.
"""

import json
import os
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable

from benchmarks._timing import Row, Times, interleave, seconds_of

_COMMAND = ("-m", "orbits", "figure-eight", "--json")
#: Runs the command in this process.
_RUN = f"""
import contextlib, runpy, sys
sys.argv = {list(_COMMAND[1:])}
with contextlib.suppress(SystemExit):
    runpy.run_module("orbits", run_name="__main__")
"""
#: Prints, as the last line, the modules of ours that a program has imported, in order.
_LISTED = """
import sys
print(*(name for name in sys.modules if name.split(".")[0] in ("jaxdyn", "orbits")))
"""
#: A first motion, as of a new user.
_MOTION = """
import jaxdyn
jaxdyn.configure()
jaxdyn.simulate(jaxdyn.scenes.pendulum(), 2.0)
"""
#: A page of the course.
_PAGE = """
import jaxdyn
jaxdyn.configure()
jaxdyn.course.page.run("cart_and_pendulum", check=False, ask=False)
"""
#: Imports modules, runs the program that follows, and prints how the time was spent [s].
_SPLIT = """
import contextlib, importlib, io, json, time
begin = time.perf_counter()
for name in {modules}:
    importlib.import_module(name)
imported = time.perf_counter()
from jax import monitoring
spent = dict.fromkeys(("trace", "lower", "compile or load"), 0.0)
parts = {{
    "/jax/core/compile/jaxpr_trace_duration": "trace",
    "/jax/core/compile/jaxpr_to_mlir_module_duration": "lower",
    "/jax/core/compile/backend_compile_duration": "compile or load",
}}
def add(event, seconds, **_):
    if event in parts:
        spent[parts[event]] += seconds
monitoring.register_event_duration_secs_listener(add)
with contextlib.redirect_stdout(io.StringIO()):
{program}
run = time.perf_counter() - imported - sum(spent.values())
print(json.dumps({{"import": imported - begin, **spent, "run": run}}))
"""
#: What is split, by name.
_SPLITS = {
    "first motion, warm": _MOTION,
    "command, warm": _RUN,
    "page of the course, warm": _PAGE,
}
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
        modules = _modules(python, _RUN)
        runs = {
            "warm": python(*_COMMAND),
            _IMPORTS: python("-c", f"import {', '.join(modules)}"),
            "jaxdyn": python("-c", "import jaxdyn"),
            "diffrax": python("-c", "import diffrax"),
        }
        times = interleave(runs, rounds, slow=_SLOW)
        splits = [
            Row(f"{name}: split", _split(python, program)) for name, program in _SPLITS.items()
        ]
    return [
        Row("command: cold", {"jaxdyn": Times(cold, cold)}),
        Row("command: warm", {"jaxdyn": times.pop("warm"), _IMPORTS: times.pop(_IMPORTS)}),
        Row("import", times),
        *splits,
    ]


def _modules(python: Callable, program: str) -> list[str]:
    """The modules of ours that a program imports."""
    return python("-c", program + _LISTED)().stdout.decode().splitlines()[-1].split()


def _split(python: Callable, program: str) -> dict[str, Times]:
    """How a program spends its time once its compiled programs are in the cache."""
    code = _SPLIT.format(
        modules=_modules(python, program), program=textwrap.indent(program.strip(), "    ")
    )
    found = json.loads(python("-c", code)().stdout)
    return {part: Times(seconds, seconds) for part, seconds in found.items()}
