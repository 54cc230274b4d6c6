"""Families as lists: kept in files to the bit, drawn, and made on the command line."""

import dataclasses
import inspect
import json
import math

import numpy as np
import pytest
from helpers import forge
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import scenes
from orbits import PLAIN, Kind, drawing
from orbits.families.parameters import maker, maker_of_two
from orbits.files import family_files
from orbits.files.family_files import Entry, Listing
from orbits.orbit import Orbit, Outcome


def entry(length: float, verdict: str, kind: Kind | None = None) -> Entry:
    scene = scenes.pendulum(length=length, t1=2.0 * length)
    orbit = Orbit(scene, PLAIN, math.nan, Outcome.FOUND, 0, 1e-13)
    return Entry(orbit, length, -length, verdict, kind)


VERDICTS = ("stable", "stable", "unstable", "unstable", "undecided")
LISTED = Listing(
    "length",
    tuple(entry(1.0 + 0.1 * i, verdict) for i, verdict in enumerate(VERDICTS)),
    (entry(1.15, "undecided", Kind.FOLD), entry(1.35, "undecided", Kind.DOUBLING)),
    "the number of members requested, 5",
)


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "family.json"
    family_files.save(path, LISTED)
    return path


def test_a_family_is_read_back_to_the_bit(saved):
    found = family_files.load(saved)
    assert (found.parameter, found.end) == (LISTED.parameter, LISTED.end)
    for one, two in ((found.members, LISTED.members), (found.special, LISTED.special)):
        for a, b in zip(one, two, strict=True):
            assert (a.parameter, a.energy, a.verdict, a.kind) == (
                *(b.parameter, b.energy, b.verdict),
                b.kind,
            )
            assert (a.orbit.period, a.orbit.rtol) == (b.orbit.period, b.orbit.rtol)
            np.testing.assert_array_equal(a.orbit.y0, b.orbit.y0)


def test_a_family_that_was_followed_is_saved_like_an_orbit(tmp_path):
    found = orbits.continue_family(orbits.find(scenes.pendulum(angle=1.0), period=6.0), members=2)
    said = repr(found).splitlines()
    assert [line.split()[-1] for line in said[1:3]] == ["s", "J"]  # period, energy
    orbits.save(tmp_path / "family.json", found)
    read = jaxdyn.load(tmp_path / "family.json")
    assert read.end == found.end
    for one, other in zip(read.members, found.members, strict=True):
        assert np.array_equal(one.orbit.y0, other.orbit.y0)
        assert one.verdict == other.stability.verdict


def test_how_to_write_a_table_is_told(tmp_path):
    table = orbits.responses.FrequencyResponse
    message = "orbit: expected an orbit, .*or family, got FrequencyResponse. Write its table: "
    with pytest.raises(ValueError, match=message):
        orbits.save(tmp_path / "response.json", object.__new__(table))


def test_a_family_without_a_parameter_has_none_in_its_file(tmp_path):
    one = Entry(LISTED.members[0].orbit, math.nan, -1.0, "stable")
    family_files.save(tmp_path / "f.json", Listing(None, (one,), (), "its bounds"))
    assert json.loads((tmp_path / "f.json").read_text())["members"][0]["parameter"] is None
    assert math.isnan(family_files.load(tmp_path / "f.json").members[0].parameter)


@pytest.mark.parametrize("written", [None, 0.0])  # 0 is what older files hold
def test_a_scene_without_an_energy_has_none_in_its_file(tmp_path, written):
    path = tmp_path / "family.json"
    orbit = Orbit(scenes.lorenz(), PLAIN, math.nan, Outcome.FOUND, 0, 1e-13)
    family_files.save(path, Listing("rho", (Entry(orbit, 28.0, math.nan, "stable"),), (), "end"))
    record = json.loads(path.read_text())
    assert record["members"][0]["energy"] is None
    record["members"][0]["energy"] = written
    forge(path, record)
    assert math.isnan(family_files.load(path).members[0].energy)


HOSTILE = [
    ((), lambda record: [], "expected format 'jaxdyn-family', got 'list'"),
    (("format",), lambda name: "jaxdyn-orbit", "expected format 'jaxdyn-family'"),
    (("version",), lambda version: 99, "expected version 4, got 99"),
    (("more",), lambda _: 1, "expected the entries"),
    (("parameter",), lambda _: 3, "file.parameter: expected str"),
    (("end",), lambda _: None, "file.end: expected str"),
    (("members",), lambda _: [], "at least one member"),
    (("members",), lambda _: {}, "file.members: expected list"),
    (("members", 0), lambda _: 7, "file.members: expected dict"),
    (("members", 0, "parameter"), lambda _: None, "numbers for energy and parameter"),
    (("members", 0, "energy"), lambda _: True, "file.energy: expected float"),
    (("members", 0, "energy"), lambda _: "0", "file.energy: expected float"),
    (("members", 0, "verdict"), lambda _: "fine", "one of stable, unstable, undecided"),
    (("members", 0, "verdict"), lambda _: ["stable"], "file.verdict: expected str"),
    (("special", 0, "kind"), lambda _: "kink", "file.kind: expected Kind"),
    (("special", 0, "kind"), lambda _: {}, "file.kind: expected Kind"),
    (("members", 1, "orbit"), lambda _: [], "a complete orbit"),
    (("members", 1, "orbit", "rtol"), lambda _: 2.0, "0 < rtol < 1"),
    (("members", 1, "orbit", "angle"), lambda _: "nan", "file.angle: expected float"),
    (("members", 1, "orbit", "scene"), lambda _: {"type": "os"}, "expected the name of a class"),
    (("members", 1, "orbit", "scene", "y0"), lambda y: y[:1], "y0"),
]


@pytest.mark.parametrize(("keys", "to", "message"), HOSTILE)
def test_a_file_that_makes_no_sense_is_refused(saved, keys, to, message):
    record = {"root": json.loads(saved.read_text())}
    *way, last = ("root", *keys)
    at = record
    for key in way:
        at = at[key]
    at[last] = to(at[last] if not isinstance(at, dict) or last in at else None)
    if isinstance(record["root"], dict):
        forge(saved, record["root"])
    else:
        saved.write_text(json.dumps(record["root"]))
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        family_files.load(saved)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_a_truncated_file_is_refused(saved, share):
    text = saved.read_text()
    saved.write_text(text[: int(share * len(text))])
    with pytest.raises(ValueError, match="file: expected JSON"):
        family_files.load(saved)


def test_a_picture_shows_stability_and_what_is_special(tmp_path):
    figure = drawing.family(LISTED, tmp_path / "family.png")
    assert (tmp_path / "family.png").stat().st_size > 10_000
    (ax,) = figure.axes
    lines = {line.get_label(): line for line in ax.lines}
    assert lines["stable"].get_linestyle() == "-"
    assert lines["unstable"].get_linestyle() == "--"
    assert lines["undecided"].get_linestyle() == ":"
    x, period = lines["stable"].get_data()
    np.testing.assert_allclose([x[0], x[-1]], [1.0, 1.15])  # as far as the fold
    np.testing.assert_allclose(period, 2 * np.asarray(x), rtol=1e-14)
    np.testing.assert_array_equal(lines["fold"].get_xdata(), [1.15])
    np.testing.assert_array_equal(lines["period doubling"].get_xdata(), [1.35])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("length", "period [s]")


def test_several_families_are_drawn_together(tmp_path):
    def shifted(entry):
        return dataclasses.replace(entry, parameter=entry.parameter + 0.1)

    members, special = (tuple(map(shifted, x)) for x in (LISTED.members, LISTED.special))
    other = dataclasses.replace(LISTED, members=members, special=special)
    figure = drawing.family([LISTED, other], tmp_path / "both.png", names=["one", "other"])
    (ax,) = figure.axes
    dots = [line for line in ax.lines if line.get_marker() == "."]
    for line, listed in zip(dots, (LISTED, other), strict=True):
        np.testing.assert_array_equal(line.get_xdata(), [x.parameter for x in listed.members])
    named = dict(zip(*_legend(figure), strict=True))
    assert [named[x].get_color() for x in ("one", "other")] == [x.get_color() for x in dots]
    assert {"stable", "unstable", "fold", "first"} <= named.keys()
    with pytest.raises(ValueError, match="names: expected 2, one for each family, got 1"):
        drawing.family([LISTED, other], names=["one"])
    energy = dataclasses.replace(other, parameter=None)
    with pytest.raises(ValueError, match="one parameter, or in energy, got length and energy"):
        drawing.family([LISTED, energy])
    with pytest.raises(ValueError, match="listed: expected at least one family"):
        drawing.family([])


def _legend(figure):
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()], legend.get_lines()


@pytest.mark.slow
def test_the_command_continues_a_pendulum_in_its_length(tmp_path, command):
    path = tmp_path / "family.json"
    words = ["--parameter", "length", "--period", "2.1", "--members", "3", "--step", "0.2"]
    code, out, _ = command("orbits", "family", "pendulum", *words, "--save", path)
    assert code == 0
    assert "3 orbits" in out
    family = family_files.load(path)
    assert family.parameter == "length"
    assert np.diff([one.parameter for one in family.members]).min() > 0.05
    for one in family.members:
        length = one.parameter
        squared = (1 + one.energy / (9.81 * length)) / 2  # sin^2 of half the largest angle
        period = 4 * np.sqrt(length / 9.81) * ellipk(squared)
        assert abs(one.orbit.period - period) < 1e-11
        assert one.verdict == "stable"


@pytest.mark.slow  # a chaotic scene is searched for a return, then eight orbits
def test_the_symmetric_orbit_of_lorenz_loses_its_stability_at_a_branch_point(tmp_path, command):
    # Sparrow (1982), The Lorenz Equations: a symmetric orbit above rho = 154.4, two below it.
    picture = tmp_path / "lorenz.png"
    words = ["--set", "rho=160", "--set", "t1=10", "--parameter", "rho", "--down", "--step", "1"]
    words += ["--within", "150,161", "--json", "--plot", str(picture)]
    code, out, _ = command("orbits", "family", "lorenz", *words)
    assert code == 0
    found = json.loads(out)
    (point,) = found["special"]
    assert point["kind"] == Kind.BRANCH
    assert 154.4 < point["parameter"] < 154.5
    verdicts = {one["parameter"] > 154.5: one["verdict"] for one in found["members"]}
    assert verdicts == {True: "stable", False: "unstable"}
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("name", "parameter", "message"),
    [
        ("pendulum", "lenght", "Did you mean"),
        ("pendulum", "formulation", "one number"),
        ("spring_mass", "position", "expected one of position.0, position.1, got position"),
        ("pendulum", "angle", "one that changes the rate of the state, got angle, which changes"),
        ("ball_on_table", "amplitude", "22_walkers.md has periodic motions with impacts, by find_"),
        ("three_body", "m", "parameter: expected one of m.0, m.1, m.2, got m"),
        ("three_body", "m.3", "parameter: expected one of m.0, m.1, m.2, got m.3"),
        ("pendulum", "m.0", "one number, got m.0"),
        ("cylinder_on_ramp", "slope", "one that only changes numbers"),
    ],
)
def test_a_number_that_cannot_be_continued_in_is_refused(name, parameter, message):
    with pytest.raises(ValueError, match=message):
        maker(name, {}, parameter)


def test_a_parameter_may_be_an_entry_of_an_array():
    make, value = maker("three_body", {"m": (1.0, 2.0, 3.0)}, "m.1")
    assert value == 2.0
    assert make(5.0).system.m.tolist() == [1.0, 5.0, 3.0]
    of_two, values = maker_of_two("three_body", {}, ("m.0", "m.2"))
    assert values == (1.0, 1.0)
    assert of_two(4.0, 6.0).system.m.tolist() == [4.0, 1.0, 6.0]
    assert list(inspect.signature(of_two).parameters) == ["m0", "m2"]
