"""`jaxdyn.load` reads the files of orbits, families, searches and diagrams, too."""

import json

import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.continuation import checkpoint
from orbits.curves.checkpoint import ORBIT_CURVE
from orbits.discovery import journal as searches
from orbits.families.checkpoint import ORBITS
from orbits.files import family_files, orbit_files
from orbits.orbit import Orbit, Outcome

PENDULUM = Orbit(scenes.pendulum(), orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)


def test_an_orbit_comes_back_with_its_claims(tmp_path):
    path = tmp_path / "orbit.json"
    orbits.save(path, orbits.find(scenes.oscillator(), period=6.0))
    orbit, claims = jaxdyn.load(path)
    again, others = orbits.load(path)
    assert (orbit.period, claims) == (again.period, others)


def test_a_family_and_a_search_come_back(tmp_path):
    entry = family_files.Entry(PENDULUM, 1.0, -9.81, "stable")
    listing = family_files.Listing("length", (entry, entry), (), "its bounds")
    family_files.save(tmp_path / "family.json", listing)
    family = jaxdyn.load(tmp_path / "family.json")
    assert (family.parameter, len(family.members), family.end) == ("length", 2, "its bounds")
    file = searches.File(tmp_path / "search.jsonl", {"what": "nothing"})
    file.add(searches.Chunk(0, {"samples": 2}, ()))
    assert jaxdyn.load(tmp_path / "search.jsonl") == searches.read(tmp_path / "search.jsonl")


def van_der_pol(mu, push=0.0):
    """A scene with a function that captures a number."""

    def rate(t, y, p):
        return [y[1], p * (1 - y[0] ** 2) * y[1] - y[0] + push]

    return jaxdyn.ode(rate, [2.0, 0.0], 6.6, params=mu)


def test_orbits_of_ones_own_equations_come_back_with_the_scene(tmp_path):
    path = tmp_path / "orbit.json"
    found = orbits.find(van_der_pol(1.0), period=6.6)
    orbits.save(path, found)
    orbit, claims = jaxdyn.load(path, scene=van_der_pol(3.0))
    assert np.array_equal(orbit.y0, found.y0)
    assert orbit.period == claims["period"] == found.period
    assert orbits.verify(path, scene=van_der_pol(3.0))[1] == []
    with pytest.raises(
        ValueError, match=r"expected the equations of rate, got others\. Numbers that"
    ):
        orbits.load(path, scene=van_der_pol(1.0, push=0.1))
    family = orbits.continue_family(found, van_der_pol, 1.0, within=(1.0, 1.2))
    orbits.save(path, family)
    again = jaxdyn.load(path, scene=van_der_pol(3.0))
    assert [entry.orbit.period for entry in again.members] == family.periods.tolist()
    with pytest.raises(ValueError, match="expected the scene rate, with any values"):
        jaxdyn.load(path)


@pytest.mark.parametrize("numbers", [[1.0], "several", [[1.0, "x"]], [None] * 3])
def test_damaged_numbers_of_a_scene_are_refused(tmp_path, numbers):
    path = tmp_path / "orbit.json"
    orbits.save(path, orbits.find(van_der_pol(1.0), period=6.6))
    record = json.loads(path.read_text())
    record["scene"]["numbers"] = numbers
    del record["digest"]
    orbit_files.LAYOUT.write(
        path, {k: x for k, x in record.items() if k not in ("format", "version")}
    )
    with pytest.raises(ValueError, match="scene"):
        orbits.load(path, scene=van_der_pol(1.0))


def walk(path, *whats):
    """The file of a continuation with an empty walk of each kind."""
    codec = checkpoint.Codec(encode=lambda x: x, decode=lambda x: x)
    log = checkpoint.Log(path)
    for number, what in enumerate(whats):
        begin = checkpoint.Begin(what, 0.1, np.array([1.0, number]), {"x": [float(number)]})
        with checkpoint.resume(log, begin, codec, lambda _, begin=begin: begin.place):
            pass
    return path


@pytest.mark.parametrize(
    ("whats", "reader"),
    [
        ((checkpoint.EQUILIBRIA,), jaxdyn.continuation),
        ((checkpoint.CURVE,), jaxdyn.continuation),
        ((ORBITS,), orbits.families),
        ((ORBITS, checkpoint.EQUILIBRIA), orbits.families),
        ((ORBIT_CURVE,), orbits.curves),
    ],
)
def test_a_continuation_is_read_by_what_it_is_of(tmp_path, monkeypatch, whats, reader):
    path = walk(tmp_path / "file.jsonl", *whats)
    read = []
    monkeypatch.setattr(reader, "load", lambda *args: read.append(args))
    jaxdyn.load(path, scenes.lorenz)
    assert read == [(path, scenes.lorenz)]
