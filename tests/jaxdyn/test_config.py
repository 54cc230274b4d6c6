"""configure() is opt-in, appends, and never overwrites; each case in a fresh Python."""

import pytest
from helpers import run_python

_FLAG = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1048576"
_SHOW = """
import os, warnings, jax, jaxdyn
warnings.simplefilter("error")
{before}
jaxdyn.configure({arguments})
{after}
print(os.environ.get("XLA_FLAGS"))
print(jax.config.jax_enable_x64, jax.config.values["jax_cpu_enable_async_dispatch"])
print(jax.config.jax_compilation_cache_dir)
"""


def _show(before="", arguments="", after="", **env):
    code = _SHOW.format(before=before, arguments=arguments, after=after)
    return run_python(code, **env).splitlines()


def test_import_changes_nothing():
    code = """
import os, jax
from jax._src import xla_bridge
def settings():
    return dict(jax.config.values), dict(os.environ)
import diffrax
before = settings()
import jaxdyn
assert settings() == before, "import jaxdyn changed a setting"
assert not xla_bridge.backends_are_initialized(), "import jaxdyn computed something"
"""
    run_python(code)


def test_without_the_private_names_everything_works():
    code = """
import sys
import jax._src.interpreters.mlir, jax._src.xla_bridge
del jax._src.interpreters.mlir.make_ir_context, jax._src.xla_bridge.backends_are_initialized
import jaxdyn
jaxdyn.configure()
from jaxdyn.gallery import compiling
compiling.share_context()
assert compiling.mlir is None
"""
    run_python(code)


def test_configure_sets_all_four():
    flags, switches, cache = _show(JAXDYN_CACHE="/nonexistent/a")
    assert flags == _FLAG
    assert switches == "True False"
    assert cache == "/nonexistent/a"


def test_each_setting_can_be_left_out():
    off = "float64=False, fold_loops=False, same_thread=False, cache=False"
    assert _show(arguments=off) == ["None", "False True", "None"]


def test_configure_appends_to_the_users_flags_once():
    user = "--xla_cpu_enable_fast_math=false"
    flags, *_ = _show(after="jaxdyn.configure()", XLA_FLAGS=user)
    assert flags == f"{user} {_FLAG}"


_OF_THE_FUTURE = """
import os, subprocess, warnings
from jaxdyn import _config
{before}
_config.release = lambda: "99.1.2"
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    {call}
print(os.environ.get("XLA_FLAGS"), *(w.message for w in caught), sep="|")
"""
_KNOWN, _LOST = "--xla_cpu_enable_fast_math=false", "--xla_nonsense=1"


@pytest.mark.slow
def test_a_new_jaxlib_is_asked_once_for_flags_that_it_may_have_lost(tmp_path):
    call = f"_config.add_flags([{_KNOWN!r}, {_LOST!r}], Path({str(tmp_path)!r}))"
    before = "from pathlib import Path; from jaxdyn import _config"
    expected = (
        f"{_KNOWN}|jaxlib 99.1.2 does not know {_LOST}: left out of XLA_FLAGS. "
        "Everything works, perhaps slower."
    )
    assert run_python(_OF_THE_FUTURE.format(before=before, call=call)) == expected
    # The answers are kept: no other process starts.
    before += "\ndel subprocess.run"
    assert run_python(_OF_THE_FUTURE.format(before=before, call=call)) == expected
    (file,) = tmp_path.iterdir()
    file.write_text("no JSON")
    assert run_python(_OF_THE_FUTURE.format(before=before.splitlines()[0], call=call)) == expected


def test_configure_leaves_out_what_a_new_jaxlib_does_not_know():
    lost = "from jaxdyn import _config; _config._EXTRA = '--xla_nonsense='"
    call = "_config.configure(cache=False)"
    flags, warning = run_python(_OF_THE_FUTURE.format(before=lost, call=call)).split("|")
    assert flags == ""
    assert warning.startswith("jaxlib 99.1.2 does not know --xla_nonsense=xla_cpu_small_while_loop")


def test_this_jaxlib_knows_all_flags_that_are_set_here():
    code = """
from jaxdyn import _config
from jaxdyn.gallery import compiling
assert _config.minor_release() <= _config.TESTED, "test and raise it"
compiling.configure_quickly()
import jax
print(len(jax.devices("cpu")))
"""
    assert run_python(code) == "1"


def test_the_users_settings_stand():
    user = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=7"
    flags, _, cache = _show(
        XLA_FLAGS=user, JAX_COMPILATION_CACHE_DIR="/nonexistent/b", JAXDYN_CACHE="/nonexistent/a"
    )
    assert (flags, cache) == (user, "/nonexistent/b")


def test_the_cache_folder_follows_the_users_choice():
    assert _show(XDG_CACHE_HOME="/nonexistent/c")[2] == "/nonexistent/c/jaxdyn"
    assert _show(HOME="/nonexistent/d")[2] == "/nonexistent/d/.cache/jaxdyn"


def test_the_cache_is_written_and_read(tmp_path):
    code = """
import jax, jaxdyn
jaxdyn.configure()
found = []
jax.monitoring.register_event_listener(lambda name, **_: found.append(name))
jax.jit(lambda x: x * 2 + 1)(3.0)
print(sum("cache_hits" in name for name in found) > 0)
"""
    assert run_python(code, JAXDYN_CACHE=str(tmp_path)) == "False"
    assert list(tmp_path.iterdir())
    assert run_python(code, JAXDYN_CACHE=str(tmp_path)) == "True"


@pytest.mark.slow
def test_loops_fold_with_the_users_other_options_kept():
    # XLA accepts the repeated option and folds: the loop's body becomes one call.
    code = """
import jax, jaxdyn
jaxdyn.configure(cache=False)
step = lambda i, y: jax.numpy.sin(y[::-1]) + jax.numpy.sum(y)
loop = jax.jit(lambda y: jax.lax.fori_loop(0, 100, step, y))
print("small_call" in loop.lower(jax.numpy.ones(300)).compile().as_text())
"""
    user = "--xla_backend_extra_options=xla_cpu_disable_loop_unrolling=true"
    assert run_python(code, XLA_FLAGS=user) == run_python(code) == "True"
    assert run_python(code.replace("cache=", "fold_loops=False, cache=")) == "False"


def test_configure_warns_when_it_comes_too_late():
    code = """
import warnings, jax, jaxdyn
jax.numpy.ones(3) + 1
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    jaxdyn.configure({arguments})
print(len(caught), *(w.message for w in caught), *(w.filename for w in caught))
"""
    said = run_python(code.format(arguments=""))
    assert said.startswith("1 configure(): a device is already in use, so XLA's loop folding and ")
    assert "running in the calling thread cannot be enabled" in said
    assert "Call jaxdyn.configure() before the first computation." in said
    assert said.endswith("<string>")  # the warning points at the caller
    assert "XLA's" not in run_python(code.format(arguments="fold_loops=False"))
    assert run_python(code.format(arguments="fold_loops=False, same_thread=False")) == "0"


def test_a_second_configure_does_not_warn():
    assert _show(after="jax.numpy.ones(3) + 1; jaxdyn.configure()")[0] == _FLAG


def test_without_configure_a_solve_is_refused():
    code = """
from jaxdyn import scenes, simulate
try:
    simulate(scenes.cannonball())
except ValueError as error:
    print(error)
"""
    expected = "floats: expected 64-bit floats, got JAX's default of 32 bits. "
    assert run_python(code).startswith(expected + "Call jaxdyn.configure() first. ")


def test_importing_anything_starts_no_device():
    # A device that is up before configure() makes every solve several times slower.
    code = """
import importlib, pkgutil
import jaxdyn
import orbits
from jax._src import xla_bridge
for package in (jaxdyn, orbits):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
        assert not xla_bridge.backends_are_initialized(), module.name
"""
    run_python(code, MPLCONFIGDIR="/tmp")
