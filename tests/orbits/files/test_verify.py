"""Orbit files: an honest one verifies, and no edit goes unseen."""

import copy
import json
import re

import numpy as np
import pytest
from helpers import forge

import orbits
from jaxdyn import scenes
from orbits.analysis.report import Report, as_json, report
from orbits.files.orbit_files import LAYOUT
from orbits.orbit import Orbit, Outcome


@pytest.fixture(scope="module")
def eight():
    return orbits.find(scenes.three_body(), closing=orbits.choreography(3))


@pytest.fixture(scope="module")
def saved(eight, tmp_path_factory):
    path = tmp_path_factory.mktemp("orbits") / "eight.json"
    orbits.save(path, eight)
    return path


@pytest.fixture
def edited(saved, tmp_path):
    """A function that writes the file with one entry changed."""

    def edit(*keys, to):
        record = json.loads(saved.read_text())
        at = record
        for key in keys[:-1]:
            at = at[key]
        at[keys[-1]] = to(at[keys[-1]]) if callable(to) else to
        return forge(tmp_path / "edited.json", record)

    return edit


def names(path) -> set[str]:
    return {mismatch.name for mismatch in orbits.verify(path)[1]}


@pytest.mark.slow
def test_a_saved_orbit_verifies(saved, eight):
    derived, mismatches = orbits.verify(saved)
    assert mismatches == []
    assert isinstance(derived, Report)
    assert derived.period == eight.period
    assert derived.y0 == list(map(float, eight.y0))
    assert derived.verdict == "stable"
    assert derived.choreography


def test_arguments_in_the_other_order_are_told(tmp_path):
    with pytest.raises(ValueError, match=r"orbit: expected.* The path comes first"):
        orbits.save(scenes.pendulum(), tmp_path / "swing.json")


def test_the_file_is_read_back_to_the_bit(saved, eight):
    orbit, claims = orbits.load(saved)
    np.testing.assert_array_equal(orbit.y0, eight.y0)
    assert (orbit.period, orbit.rtol, orbit.closing) == (eight.period, eight.rtol, eight.closing)
    assert claims == as_json(report(eight))


def test_the_neighbour_with_its_real_pair_verifies(tmp_path):
    start, period = scenes.EIGHT_GUESS, scenes.EIGHT_GUESS_PERIOD
    neighbour = orbits.find(scenes.three_body(), start, period)
    orbits.save(tmp_path / "neighbour.json", neighbour)
    derived, mismatches = orbits.verify(tmp_path / "neighbour.json")
    assert mismatches == []
    assert derived.exponents[0] is None


def nudged(value):
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return value + "?"
    return None if value is None else value + 1e-6


PLAIN_CLAIMS = [
    *("outcome", "period", "closure", "choreography", "permutation_error", "energy"),
    *("angular_momentum", "scale_free", "unit_multipliers", "verdict", "symplectic_defect"),
    *("determinant_defect", "periods_simulated", "return_error", "minimal_period", "word"),
]


def test_every_claim_is_among_the_edited_ones(saved):
    nested = {"y0", "multipliers", "exponents", "recheck", "normal_form"}
    rough = {"growth"}  # compared as errors are, whose size alone means something
    uncompared = {"multiplier_bars"}  # estimates
    claims = json.loads(saved.read_text())["claims"]
    assert {*PLAIN_CLAIMS} | nested | rough | uncompared == claims.keys()


@pytest.mark.parametrize("name", PLAIN_CLAIMS)
def test_an_edited_claim_is_seen(edited, name):
    assert names(edited("claims", name, to=nudged)) == {name}


@pytest.mark.parametrize(
    ("keys", "to"),
    [
        (("y0", 3), nudged),
        (("y0",), lambda y: y[:-1]),
        (("multipliers", 2, 1), nudged),
        (("multipliers",), lambda z: z[::-1]),
        (("exponents", 0), nudged),
        (("exponents", 0), None),
        (("exponents",), []),
        (("recheck", "solver"), "another"),
        (("recheck", "closure"), 1e-9),
        (("normal_form", "period"), nudged),
        (("normal_form", "y0", 11), nudged),
        (("normal_form",), None),
        (("energy",), None),
        (("energy",), "low"),
        (("energy",), True),
        (("energy",), [1.0]),
        (("closure",), 1e-6),
        (("closure",), -1e-16),
        (("closure",), True),
        (("growth",), lambda x: 1e3 * x),
        (("growth",), None),
        (("choreography",), 1),
        (("verdict",), None),
    ],
)
def test_edits_within_claims_and_of_their_kind_are_seen(edited, keys, to):
    found = names(edited("claims", *keys, to=to))
    assert len(found) == 1
    assert found.pop().startswith(keys[0])


@pytest.mark.parametrize("change", ["left out", "added"])
def test_a_claim_too_few_or_too_many_is_seen(edited, change):
    def to(claims):
        claims = copy.copy(claims)
        if change == "added":
            return claims | {"discoverer": "me"}
        del claims["energy"]
        return claims

    assert names(edited("claims", to=to)) == {"claims"}


@pytest.mark.parametrize(
    ("keys", "step"),
    [
        (("scene", "y0", 4), 1e-6),
        (("scene", "t1"), 1e-6),
        (("scene", "effects", 0, "G"), 1e-6),
    ],
)
def test_an_edited_motion_is_seen(edited, keys, step):
    def to(value):
        return [value[0] + step, *value[1:]] if isinstance(value, list) else value + step

    found = names(edited(*keys, to=to))
    assert "closure" in found
    assert any(name.startswith("error of the ") for name in found)


def test_an_edited_closing_is_seen(edited):
    assert names(edited("closing", "symmetry", "places", to=list(range(12)))) == {
        "error of the choreography of 3"
    }


def test_a_file_that_is_honest_about_a_motion_that_is_no_orbit_fails(tmp_path):
    scene = scenes.three_body(t1=6.0)
    no_orbit = Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-14)
    orbits.save(tmp_path / "no.json", no_orbit)
    assert names(tmp_path / "no.json") == {"error of the plain closing"}


def test_rounding_of_another_machine_is_no_edit(edited):
    assert names(edited("claims", "closure", to=lambda x: 7 * x + 1e-16)) == set()
    assert names(edited("claims", "energy", to=lambda x: x + 1e-15)) == set()
    assert names(edited("claims", "multiplier_bars", 0, to=lambda x: 1.5 * x)) == set()


@pytest.mark.parametrize(
    ("keys", "to", "message"),
    [
        (("format",), "other", "file: expected format 'jaxdyn-orbit', got 'other'"),
        (("version",), 99, "file: expected version 5, got 99"),
        (("claims",), [], "file: expected claims by name, got list"),
        (("rtol",), 0.0, "file: expected a period > 0 and 0 < rtol < 1, got others"),
        (("rtol",), 1e-30, "rtol: expected between 1e-16 and 0.01, got 1e-30"),
        (("rtol",), None, "file: expected a period > 0 and 0 < rtol < 1, got others"),
        (("scene", "t1"), -1.0, "file: expected a period > 0"),
        (("scene", "t1"), [6.3], "t1: expected one number, got shape (1,)"),
        (("scene", "y0"), [0.0] * 12, "y0: expected bodies at different points, got bodies 1"),
        (("scene", "y0"), [0.0] * 11, "y0: expected shape"),
        (("scene", "y0"), 1.0, "y0: expected shape"),
        (("scene", "system", "m"), [1.0, 1.0, -1.0], "mass: expected >= 0, got -1.0"),
        (("scene", "system", "m"), [[1.0]] * 3, "expected"),
        (("scene", "system", "d"), "2", "scene.system.d: expected int, got '2'"),
        (("scene", "system", "d"), 3, "y0: expected shape"),
        (("scene", "effects"), [1.0, 2.0], "effects: expected effects"),
        (("scene", "effects", 0, "G"), [1.0, 1.0], "G: expected shape (), got shape (2,)"),
        (("scene", "system"), None, "file: expected a complete orbit"),
        (("scene",), [], "scene: expected a Scene, got"),
        (("scene",), lambda scene: scene["system"], "scene: expected a Scene, got FreePoints"),
        (("scene", "system"), lambda system: {"type": "PairGravity", "G": 1.0}, "complete orbit"),
        (("closing",), None, "closing: expected a Closing, got NoneType"),
        (("scene", "system", "m"), [1.0, 1.0, 1.000001], "closing: expected a symmetry"),
        (("closing", "parts"), 0, "closing: expected at least one part of a period, got 0"),
        (("closing", "parts"), 2.5, "closing.parts: expected int, got 2.5"),
        (("closing", "name"), ["x"], "closing.name: expected str"),
        (("closing", "symmetry", "places"), [0] * 12, "closing: expected a permutation"),
        (("closing", "symmetry", "places"), ["a"], "closing.symmetry.places: expected int"),
        (("closing", "symmetry", "signs"), [2] * 12, "closing: expected 12 signs"),
        (("closing", "symmetry"), None, "file: expected a complete orbit"),
        (("closing", "more"), 1, "closing: expected the fields of Return"),
        (("more",), 1, "file: expected a complete orbit, got missing or extra ['more']"),
    ],
)
def test_files_that_make_no_sense(edited, keys, to, message):
    def put(at):
        return to(at) if callable(to) else to

    record_path = edited(*keys, to=put) if keys[-1] != "more" else _with_more(edited, keys)
    with pytest.raises(ValueError, match=re.escape(message)):
        orbits.verify(record_path)


def _with_more(edited, keys):
    if len(keys) > 1:
        return edited(keys[0], to=lambda at: at | {"more": 1})
    path = edited("version", to=LAYOUT.version)
    forge(path, json.loads(path.read_text()) | {"more": 1})
    return path


def test_a_motion_that_ends_in_a_collision_is_no_orbit(edited):
    fall = [-1.0, 0.0, 1.0, 0.0, 0.0, 9.0, *[0.0] * 6]
    with pytest.raises(ValueError, match="file: expected a motion that lasts for its period"):
        orbits.verify(edited("scene", "y0", to=fall))
