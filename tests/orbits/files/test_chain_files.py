"""Chains of legs in files: written, read with their legs given again, and verified."""

import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest

import orbits
from jaxdyn import scenes
from jaxdyn.files import digests
from jaxdyn.integrate import events
from orbits.files import contents

WALKER = scenes.simplest_walker()
PHASES = scenes.phases_of(WALKER)


@pytest.fixture(scope="module")
def gait():
    return orbits.find_hybrid(PHASES, WALKER.y0)


@pytest.fixture
def path(gait, tmp_path):
    path = tmp_path / "gait.json"
    orbits.save(path, gait)
    return path


def test_a_chain_comes_back_to_the_bit(gait, path):
    again, claims = orbits.load(path, PHASES)
    np.testing.assert_array_equal(again.y0, gait.y0)
    np.testing.assert_array_equal(again.spans, gait.spans)
    assert again.path == gait.path
    assert again.rtol == gait.rtol
    assert claims["verdict"] == "stable"
    assert orbits.same_orbit(again, gait)
    np.testing.assert_array_equal(
        orbits.stability(again).multipliers, orbits.stability(gait).multipliers
    )


def test_all_that_a_file_claims_is_true(path):
    report, wrong = orbits.verify(path, PHASES)
    assert wrong == []
    assert report.verdict == "stable"


def test_what_is_not_true_is_told(gait, tmp_path):
    path = tmp_path / "gait.json"
    claims = dataclasses.replace(orbits.report(gait), verdict="unstable", period=3.0)
    orbits.save(path, gait, claims)
    assert {x.name for x in orbits.verify(path, PHASES)[1]} == {"verdict", "period"}


def _bounce(t, y):
    return y * jnp.array([1.0, 1.0, 1.0, -1.0])


def _ball(bounds=()):
    ball = scenes.cannonball(g=10.0)
    falls = orbits.Leg(ball, (events.Reaches(1, 0.0),), _bounce, bounds)
    return [falls, orbits.Leg(ball, (events.Reaches(3, 0.0), events.Reaches(1, 5.0)))]


def _forwards(end, start):
    return (end - start)[1:]


@pytest.mark.slow
def test_legs_and_their_closing_are_given_again(tmp_path):
    path = tmp_path / "ball.json"
    ball = orbits.find_hybrid(_ball(), [0.0, 4.8, 1.0, 0.0], [1.0, 1.0], closes=_forwards)
    orbits.save(path, ball)
    again, _ = orbits.load(path, _ball(), closes=_forwards)
    np.testing.assert_array_equal(again.y0, ball.y0)
    assert orbits.verify(path, _ball(), closes=_forwards)[1] == []
    with pytest.raises(ValueError, match=r"legs: .* legs or phases of .* misses its closing"):
        orbits.load(path, _ball())
    high = _ball(bounds=(events.Reaches(1, 0.5),))
    (wrong,) = orbits.verify(path, high, closes=_forwards)[1]
    assert (wrong.name, wrong.derived) == ("bounds of the legs", "passed")


def test_a_chain_that_closes_roughly_is_not_verified(gait, tmp_path):
    path = tmp_path / "rough.json"
    leg = gait.legs[0]
    off = dataclasses.replace(leg, scene=leg.scene.starting(leg.scene.y0 * (1 + 1e-7)))
    rough = dataclasses.replace(gait, legs=(off,))
    orbits.save(path, rough)
    assert [x.name for x in orbits.verify(path, PHASES)[1]] == ["error of the closing"]


def _edited(path, more):
    record = json.loads(path.read_bytes())
    record.pop("digest")
    path.write_bytes(digests.json_text(record | more))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"spans": [-3.0]}, "file: expected finite starts, spans > 0"),
        ({"rtol": 2.0}, "file: expected finite starts, spans > 0"),
        ({"starts": [[0.2, 0.4, -0.2]]}, r"legs: expected 1 legs of states with \[3\] entries"),
        ({"starts": [["a"]]}, "file.starts: expected"),
        ({"path": [["jump", 0]]}, "phase: expected"),
        ({"more": 1}, "missing or extra"),
    ],
)
def test_files_that_are_damaged_are_refused(path, more, message):
    _edited(path, more)
    with pytest.raises(ValueError, match=message):
        orbits.load(path, PHASES)


def test_a_byte_that_changed_is_noticed(path):
    path.write_bytes(path.read_bytes().replace(b"swing", b"swinG"))
    with pytest.raises(ValueError, match="data that match its digest"):
        orbits.load(path, PHASES)


def test_a_chain_without_its_legs_is_refused(path):
    with pytest.raises(ValueError, match=r"legs: expected the legs .* got none\. Give those of"):
        orbits.load(path)
    with pytest.raises(ValueError, match="legs: expected the legs"):
        orbits.verify(path)
    with pytest.raises(ValueError, match="expected format 'jaxdyn-orbit' or"):
        contents.contents(path)


def test_other_legs_are_refused(path, tmp_path):
    with pytest.raises(ValueError, match="expected the legs or phases of the file"):
        orbits.load(path, scenes.phases_of(scenes.simplest_walker(slope=0.01)))
    with pytest.raises(ValueError, match=r"legs\[0\]: expected a Leg, got float"):
        orbits.load(path, [1.0])
    swing = tmp_path / "swing.json"
    orbits.save(swing, orbits.find(scenes.oscillator(), period=6.0))
    with pytest.raises(ValueError, match="format 'jaxdyn-chain'"):
        orbits.load(swing, PHASES)
