"""`orbits show`: what files claim, without anything recomputed, and what is refused."""

import dataclasses
import json
import math

import numpy as np
import pytest
from helpers import forge, refusal

import orbits
from jaxdyn import scenes
from orbits.analysis.evidence import Recheck
from orbits.analysis.report import NormalForm, Report, as_json, from_json
from orbits.files import contents, family_files
from orbits.orbit import Orbit, Outcome
from orbits.proof.certificate import Certificate, Enclosed
from orbits.proof.refined import Refined

SWING = Orbit(scenes.oscillator(k=4.0), orbits.PLAIN, 1e-16, Outcome.FOUND, 3, 1e-13)
#: Nobody computed them: `show` prints what stands there.
CLAIMS = Report(
    outcome="FOUND",
    period=3.14,
    y0=[1.0, 0.0],
    closure=1.5e-15,
    growth=2.0,
    minimal_period=3.14,
    choreography=None,
    permutation_error=None,
    word=None,
    energy=2.0,
    angular_momentum=None,
    scale_free=None,
    multipliers=[[0.25, 0.5], [1.0, 0.0]],
    multiplier_bars=[1e-9],
    exponents=[0.125, None],
    unit_multipliers=1,
    verdict="undecided",
    symplectic_defect=None,
    determinant_defect=math.nan,
    periods_simulated=5,
    return_error=1e-14,
    recheck=Recheck("Verner 9(8)", 1e-14, 2.5e-15),
    normal_form=NormalForm(6.28, [1.0, 0.0]),
)
REFINED = Refined(
    orbit=SWING,
    digits=20,
    period="3.1415926535897932385",
    y0=("1.0", "0"),
    held=("x",),
    residual="1e-22",
    multipliers=(("0.25", "0.5"),),
    exponents=("0.125", None),
    energy="2",
)
BALL = Enclosed("3.14159", "1e-30")
CERTIFICATE = Certificate(
    orbit=SWING,
    proved=True,
    reason="Krawczyk's test",
    bits=128,
    digits=30.5,
    radius="1e-10",
    centre=("1*2^0",),
    units=(1.0,),
    names=("T",),
    held=(("x", 1.0),),
    period=BALL,
    y0=(BALL, BALL),
    multipliers=((BALL, BALL),),
    exponents=(BALL,),
    verdict="stable",
    verdict_proved=True,
)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "swing.json"
    orbits.save(path, SWING, CLAIMS)
    return path


@pytest.fixture
def family(tmp_path):
    path = tmp_path / "family.json"
    entries = [
        family_files.Entry(SWING, 4.0, 2.0, "stable"),
        family_files.Entry(SWING, 4.5, 2.25, "unstable"),
    ]
    special = family_files.Entry(SWING, 4.25, 2.1, "undecided", orbits.Kind.FOLD)
    found = family_files.Listing("k", tuple(entries), (special,), "its bounds [were] reached")
    family_files.save(path, found)
    return path


def edited(path, **claims):
    record = json.loads(path.read_text())
    record["claims"] |= claims
    forge(path, record)
    return path


def test_an_orbit_becomes_a_page_on_which_it_runs_beside_another_motion(command, file, tmp_path):
    page = tmp_path / "swing.html"
    ran = command("orbits", "show", file, "--live", page)
    assert ran.code == 0
    assert f"runs in {page}" in ran.out
    assert "<h1>Orbit of oscillator</h1>" in page.read_text()
    assert '"motions": 2' in page.read_text()


def test_a_family_becomes_a_page_on_which_its_orbits_run(command, family, tmp_path):
    page = tmp_path / "swings.html"
    ran = command("orbits", "show", family, "--live", page)
    assert ran.code == 0
    assert "<h1>Family of 2 orbits of oscillator</h1>" in page.read_text()
    assert '"name": "2, k = 4.5", "note": "period 10 s, unstable"' in page.read_text()


def test_what_is_no_orbit_becomes_no_page():
    lost = dataclasses.replace(SWING, outcome=Outcome.COLLISION)
    assert "orbit: expected one that was found, got COLLISION" in refusal(lambda: lost.live())


def test_an_orbit_is_shown_as_its_file_claims(command, file):
    ran = command("orbits", "show", file)
    assert (ran.code, ran.err) == (0, "")
    text = " ".join(ran.out.split())
    for said in (
        f"Orbit of oscillator file {file} closing plain closing found integrated at",
        "Scene oscillator",
        "Spring(k = 4 N/m",
        "start x = 1 m, vx = 0 m/s",
        "undecided",
        "period T [s] │ 3.14 │",
        "1.5e-15",
        "2.5e-15 (Verner 9(8))",
        "0.25+0.5j",
        "rotation numbers │ 0.125 │",
        f"`orbits verify {file}` recomputes them",
    ):
        assert said in text, said
    assert "proved" not in text.lower()


@pytest.mark.parametrize(
    ("claims", "shown"),
    [
        # The Earth and the Moon in SI units: no digits of binary fractions.
        ({"energy": -7.625012345678901e28}, "energy E [J] │ -7.6250123456789e+28 │"),
        ({"energy": -2.5e-9}, "energy E [J] │ -2.5e-09 │"),
        ({"period": 2.7012345678901e-6}, "period T [s] │ 2.7012345678901e-06 │"),
        ({"angular_momentum": 2.875e34}, "angular momentum [kg m^2/s] │ 2.875e+34 │"),
        ({"multipliers": [[2.5e5, 0.0], [1.0, 0.0]]}, "multipliers │ 250000 │"),
        ({"multipliers": [[4e-9, 0.0], [1.0, 0.0]]}, "multipliers │ 4e-09 │"),
    ],
)
def test_numbers_have_their_digits_in_any_units(command, file, claims, shown):
    assert shown in " ".join(command("orbits", "show", edited(file, **claims)).out.split())


def test_digits_and_a_proof_are_shown(command, tmp_path):
    path = tmp_path / "more.json"
    orbits.save(path, REFINED, CLAIMS)
    text = " ".join(command("orbits", "show", path).out.split())
    assert "Orbit of oscillator to 20 digits period 3.1415926535897932385" in text
    orbits.save(path, CERTIFICATE, CLAIMS)
    text = " ".join(command("orbits", "show", path).out.split())
    assert "Proved: a periodic orbit of oscillator" in text
    assert "multiplier (3.14159 +- 1e-30) + (3.14159 +- 1e-30) i" in text


def test_a_family_is_shown_with_its_special_points(command, family):
    ran = command("orbits", "show", family)
    assert (ran.code, ran.err) == (0, "")
    text = " ".join(ran.out.split())
    assert f"Family of orbits of oscillator file {family} along k" in text
    for said in (
        "period [s] ┃ energy [J]",
        "4.25",
        "fold",
        "unstable",
        "2 orbits; the end: its bounds [were] reached",
    ):
        assert said in text, said


def test_pictures_are_drawn(command, file, family, tmp_path):
    for path in (file, family):
        picture = tmp_path / f"{path.stem}.png"
        ran = command("orbits", "show", path, "--plot", picture, "--title", "A swing")
        assert (ran.code, ran.err) == (0, "")
        assert f"drawn in {picture}" in ran.out
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_json_is_what_stands_in_the_file(command, file, family):
    for path in (file, family):
        ran = command("orbits", "show", path, "--json")
        assert json.loads(ran.out) == json.loads(path.read_text())
        assert ran.err == ""


def test_what_is_shown_is_what_was_claimed(tmp_path):
    for one in (REFINED, CERTIFICATE):
        orbits.save(tmp_path / "more.json", one, CLAIMS)
        found = contents.contents(tmp_path / "more.json")
        assert as_json(found.report) == as_json(CLAIMS)
        again = found.refined or found.certificate
        assert again.as_json() == one.as_json()
        assert type(again) is type(one)
        assert str(again) == str(one)


def test_null_is_a_number_that_was_not_finite():
    assert np.isnan(from_json(as_json(CLAIMS) | {"closure": None}, "").closure)


@pytest.mark.parametrize(
    ("claims", "message"),
    [
        ({"period": "3"}, "claims.period: expected float, got '3'"),
        ({"verdict": "sta\x1b[31mble"}, "claims.verdict: expected str"),
        ({"verdict": "stable\nno"}, "claims.verdict: expected str"),
        ({"multipliers": [[1.0]]}, "claims: expected multipliers as pairs, and a start"),
        ({"multipliers": [1.0]}, "claims.multipliers: expected list[float], got 1.0"),
        ({"multiplier_bars": {}}, "claims.multiplier_bars: expected list[float]"),
        ({"unit_multipliers": True}, "claims.unit_multipliers: expected int, got True"),
        ({"choreography": 1}, "claims.choreography: expected bool, got 1"),
        ({"recheck": {"solver": "x"}}, "claims.recheck: expected the entries of Recheck"),
        ({"recheck": None}, "claims.recheck: expected Recheck, got None"),
        ({"normal_form": {"period": 1.0, "y0": []}}, "claims: expected multipliers as pairs"),
        ({"more": 1}, "claims: expected the entries of Report, got missing or extra ['more']"),
        ({"refined": {}}, "refined: expected the entries of Refined"),
        ({"refined": 3}, "refined: expected the entries of Refined, got missing or extra int"),
        ({"refined": REFINED.as_json() | {"y0": ["1"]}}, "refined: expected 2 numbers of the st"),
        ({"certificate": []}, "certificate: expected multipliers and held numbers"),
        ({"certificate": CERTIFICATE.as_json() | {"period": None}}, "certificate: expected enclos"),
        ({"certificate": CERTIFICATE.as_json() | {"bits": "x"}}, "certificate.bits: expected int"),
        *(
            ({"certificate": CERTIFICATE.as_json() | edit}, message)
            for edit, message in (
                ({"bits": 10**9}, "bits: expected 2 to 40000, got 1000000000"),
                ({"bits": 0}, "bits: expected 2 to 40000, got 0"),
                ({"digits": 1e6}, "digits: expected 0 to 1200.0, got 1000000.0"),
                ({"digits": 0.0}, "digits: expected 0 to 1200.0, got 0.0"),
                ({"radius": "-1e-9"}, "radius: expected a positive number, got '-1e-9'"),
                ({"radius": "1e999"}, "radius: expected a positive number, got '1e999'"),
                ({"radius": "1.2.3"}, "radius: expected a positive number, got '1.2.3'"),
                ({"centre": ["1"]}, "centre: expected numbers like 3*2^-1, got '1'"),
                ({"centre": ["1*2^99999999"]}, "centre: expected numbers like 3*2^-1, got '1*2^9"),
                ({"proved": False}, "certificate: expected no claims without a proof, got some"),
            )
        ),
    ],
)
def test_claims_of_another_kind_are_refused_in_one_line(command, file, claims, message):
    ran = command("orbits", "show", edited(file, **claims))
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("\n") == 1
    assert ran.err.startswith(f"error: {message}")
    assert "\x1b" not in ran.err


def test_names_of_a_file_are_neither_markup_nor_escapes(command, file):
    assert "[bold]" in command("orbits", "show", edited(file, verdict="[bold]stable[/x]")).out
    record = json.loads(file.read_text())
    record["scene"]["name"] = "\x1b[31mred"
    forge(file, record)
    ran = command("orbits", "show", file)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith(r"error: name: expected a printable text, got '\x1b[31mred'")


def test_other_files_are_refused_in_one_line(command, tmp_path, file):
    other = tmp_path / "other.json"
    for text, said in (
        ("[]", "file: expected format 'jaxdyn-orbit' or 'jaxdyn-family', got None."),
        ('{"format": "jaxdyn-motion"}', "got 'jaxdyn-motion'."),
        ('{"format": "jaxdyn-orbit", "version": 99}', "file: expected version 5, got 99."),
        ("{", "file: expected JSON"),
    ):
        other.write_text(text)
        ran = command("orbits", "show", other)
        assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1)
        assert said in ran.err
    for words, said in (
        ((tmp_path / "none.json",), "No such file"),
        ((file, "--title", "x"), "--title: expected --plot with it"),
        ((file, "--plot", tmp_path / "x.txt"), "--plot: expected a file name ending in .png"),
    ):
        ran = command("orbits", "show", *words)
        assert (ran.code, ran.out) == (2, "")
        assert said in ran.err
