"""Making a scene and checking it takes few programs, each of which costs a command 10 ms."""

import json

import pytest
from helpers import run_python

MOST = 16
#: Counts what is compiled for each ready-made scene, as in a new process.
COUNTS = """
import json, jax, jaxdyn
from jax import monitoring
from jaxdyn.scenes import catalogue
jaxdyn.configure(cache=False)
programs = []
def count(event, seconds, **about):
    if event == "/jax/core/compile/backend_compile_duration":
        programs.append(about.get("fun_name"))
monitoring.register_event_duration_secs_listener(count)
found = {}
for name, entry in catalogue.entries().items():
    if not NAMES or name in NAMES:
        jax.clear_caches()
        programs.clear()
        entry.make().check()
        found[name] = len(programs)
print(json.dumps(found))
"""


def counts(*names: str) -> dict[str, int]:
    return json.loads(run_python(f"NAMES = {names!r}\n{COUNTS}"))


def test_a_satellite_takes_few():
    found = counts("satellite")
    assert len(found) == 1
    assert all(0 < count <= MOST for count in found.values()), found


@pytest.mark.slow
def test_every_scene_takes_few():
    found = counts()
    assert len(found) > 40
    assert all(0 < count <= MOST for count in found.values()), found
