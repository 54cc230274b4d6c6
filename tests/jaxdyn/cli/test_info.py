"""What a report of an error says of the machine: the function, the command."""

import json

import jax

import jaxdyn
from jaxdyn import _info


def test_the_record_is_what_the_libraries_say(monkeypatch, tmp_path):
    (tmp_path / "a-cache").write_bytes(b"12345")
    (tmp_path / "b-atime").write_bytes(b"1")  # no program
    monkeypatch.setenv("JAX_TRACEBACK_FILTERING", "off")
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    try:
        found = jaxdyn.info()
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
    assert found["packages"]["jax"] == jax.__version__
    assert len(found["devices"]) == len(jax.devices())
    assert found["float64"] is True
    assert found["variables"]["JAX_TRACEBACK_FILTERING"] == "off"
    assert (found["cache"], found["cached"], found["cached_bytes"]) == (str(tmp_path), 1, 5)


def test_the_command_prints_a_table_or_an_object(command, monkeypatch):
    monkeypatch.setattr(_info, "_PACKAGES", ("jax", "no-such-package"))
    done, out, _ = command("jaxdyn", "info")
    assert done == 0
    assert jax.__version__ in out
    assert "not installed" in out
    assert "64 bits" in out
    done, out, _ = command("jaxdyn", "info", "--json")
    assert done == 0
    assert json.loads(out)["packages"] == {"jax": jax.__version__, "no-such-package": None}
