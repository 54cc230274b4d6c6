"""One `load` for files of every kind."""

import numpy as np
import pytest

import jaxdyn
from jaxdyn import scenes
from jaxdyn.files import astronomy, layout, loading
from jaxdyn.files.digests import json_text


def lorenz(rho):
    return scenes.lorenz(rho=rho)


def test_a_motion_comes_back(tmp_path):
    motion = jaxdyn.simulate(scenes.pendulum(), 1.0, samples=3)
    motion.save(tmp_path / "swing.npz")
    np.testing.assert_array_equal(jaxdyn.load(tmp_path / "swing.npz").ys, motion.ys)


def test_families_of_equilibria_come_back_with_their_scenes(tmp_path):
    path = tmp_path / "lorenz.jsonl"
    family = jaxdyn.continue_equilibria(lorenz, 20.0, [7.0, 7.0, 19.0], members=3, path=path)
    (again,) = jaxdyn.load(path, lorenz)
    np.testing.assert_array_equal(again.parameters, family.parameters)
    path.write_bytes(path.read_bytes().replace(b"equilibria", b"equilibriA"))
    with pytest.raises(ValueError, match=r"^path: expected a jaxdyn-continuation file, got .*edit"):
        jaxdyn.load(path, lorenz)


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "file"
    for record, said in [
        ({"format": "jaxdyn-dream"}, r"file of 'jaxdyn-dream'\. .* import it first\.$"),
        ({"format": 3}, r"file without a format\. "),
        ({"ys": [1.0]}, r"file without a format\. "),
    ]:
        path.write_bytes(json_text(record))
        with pytest.raises(ValueError, match=rf"^path: expected a file of a kind .*{said}"):
            jaxdyn.load(path)
    path.write_text("x,y\n1,2\n")
    with pytest.raises(ValueError, match=r"^path: expected an archive \(\.npz\)"):
        jaxdyn.load(path)
    path.write_bytes(b"{\n" + b" " * layout.MAX_BYTES)
    with pytest.raises(ValueError, match=r"^path: expected at most \d+ bytes, got more\. Give the"):
        jaxdyn.load(path)
    with pytest.raises(ValueError, match=r"^path: expected a readable file, got .*none"):
        jaxdyn.load(tmp_path / "none")
    for read in (jaxdyn.load, jaxdyn.read_csv, astronomy.read_horizons):
        with pytest.raises(ValueError, match=r"^path: expected the path of a file, got None"):
            read(None)


def test_a_package_registers_its_readers(tmp_path, monkeypatch):
    monkeypatch.setattr(loading, "_READERS", dict(loading._READERS))
    path = tmp_path / "file.json"
    path.write_bytes(json_text({"format": "kept-elsewhere"}))
    loading.register({"kept-elsewhere": "pathlib:Path"})
    assert jaxdyn.load(path) == path
