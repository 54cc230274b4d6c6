"""Families of orbits and diagrams in files: resumed after an interruption, loaded, drawn."""

import json

import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn.files.digests import json_text


def _rate(t, y, mu):
    return [y[1], mu * y[1] - y[0] ** 2 * y[1] - y[0]]


def van_der_pol(mu):
    return jaxdyn.ode(_rate, [0.0, 0.0], 10.0, params=mu, names=[("x", "m"), ("v", "m/s")])


def follow(path=None, **options):
    return orbits.diagram(
        van_der_pol, -0.5, [0.0, 0.0], within=(-1, 1), orbit_members=6, path=path, **options
    )


def assert_same(a, b):
    assert (a.depths, len(a.equilibria), len(a.orbits)) == (
        b.depths,
        len(b.equilibria),
        len(b.orbits),
    )
    assert [(str(x.point.kind), x.reason) for x in a.failures] == [
        (str(x.point.kind), x.reason) for x in b.failures
    ]
    for one, two in zip((*a.equilibria, *a.orbits), (*b.equilibria, *b.orbits), strict=True):
        assert one.end == two.end
        np.testing.assert_array_equal(one.parameters, two.parameters)
        assert [x.kind for x in one.special] == [x.kind for x in two.special]
    for one, two in zip(a.orbits, b.orbits, strict=True):
        np.testing.assert_array_equal(one.periods, two.periods)
        for x, y in zip(one.members, two.members, strict=True):
            np.testing.assert_array_equal(x.stability.multipliers, y.stability.multipliers)
            assert x.stability.verdict == y.stability.verdict
            np.testing.assert_array_equal(x.orbit.y0, y.orbit.y0)


@pytest.mark.slow
def test_an_interrupted_diagram_goes_on_to_the_same_result(tmp_path, monkeypatch):
    path, whole = tmp_path / "diagram.jsonl", follow()
    between = orbits.families.continuation.special_points
    taken = []

    def interrupted(*args):  # called at each step
        taken.append(args)
        if len(taken) == 3:
            raise KeyboardInterrupt
        return between(*args)

    monkeypatch.setattr(orbits.families.continuation, "special_points", interrupted)
    with pytest.raises(KeyboardInterrupt):
        follow(path)
    part = orbits.families.load(path, van_der_pol)
    assert [len(family.members) for family in part.orbits] == [3]
    assert part.orbits[0].end == "an interruption"
    assert_same(follow(path), whole)
    assert len(taken) == 3 + 3  # what the file has is not computed again
    found = orbits.families.load(path, van_der_pol)
    assert_same(found, whole)
    figure = orbits.drawing.diagram(found, tmp_path / "diagram.png", parameter="mu")
    assert figure.axes[0].get_ylabel() in ("x [m]", "v [m/s]")
    assert "orbits, stable" in [line.get_label() for line in figure.axes[0].lines]
    # A family that was loaded can be followed from, like a new one.
    member = found.orbits[0].members[-1]
    more = orbits.continue_family(member.orbit, van_der_pol, member.parameter, members=2)
    assert more.members[-1].parameter > member.parameter


@pytest.mark.slow
def test_failures_are_kept_and_other_scenes_refused(tmp_path):
    path = tmp_path / "diagram.jsonl"
    found = follow(path, amplitude=1e6)
    assert len(found.failures) == 1
    assert_same(orbits.families.load(path, van_der_pol), found)
    with pytest.raises(ValueError, match="make: expected the scenes of the file"):
        orbits.families.load(path, lambda mu: jaxdyn.scenes.lorenz(rho=mu))


def _without_units(line, dropped=0):
    """A line of a file as it was when all lengths were in the units of the scene."""
    record = json.loads(line)
    del record["digest"]
    step = record.get("step", {"member": record.get("begin", {}).get("first")})
    for member in (x for x in (step.get("member"), *step.get("special", [])) if x):
        for name in ("sizes", "units"):
            del member["point"][name]
        tangent = np.array(member["tangent"])
        kept = tangent.size - dropped
        tangent = tangent[:kept] / np.linalg.norm(tangent)
        member["tangent"] = {"shape": [kept], "real": tangent.tolist()}
    return json_text(record)


@pytest.mark.slow
def test_files_whose_points_have_no_units_are_read(tmp_path):
    new, old = tmp_path / "new.jsonl", tmp_path / "old.jsonl"
    cycle = orbits.find(van_der_pol(0.5), [2.0, 0.0], 6.4)
    family = orbits.continue_family(cycle, van_der_pol, 0.5, members=3, path=new)
    old.write_bytes(b"".join(map(_without_units, new.read_text().splitlines())))
    assert "sizes" in new.read_text()
    assert "sizes" not in old.read_text()
    (loaded,) = orbits.families.load(old, van_der_pol).orbits
    np.testing.assert_array_equal(loaded.periods, family.periods)
    for one, two in zip(loaded.members, family.members, strict=True):
        # Sizes are those of the largest orbit so far, which an old file does not have.
        np.testing.assert_allclose(one.point.units, two.point.units, rtol=0.1)
        assert abs(np.linalg.norm(one.tangent / one.point.units) - 1) < 1e-12
        across = one.tangent @ two.tangent
        assert across / np.linalg.norm(one.tangent) / np.linalg.norm(two.tangent) > 1 - 1e-12
    lines = new.read_text().splitlines()
    old.write_bytes(b"".join(_without_units(line, dropped=1) for line in lines))
    with pytest.raises(ValueError, match="file: expected directions of the unknowns"):
        orbits.families.load(old, van_der_pol)


@pytest.mark.slow
def test_a_family_alone_is_kept_as_well(tmp_path):
    path = tmp_path / "family.jsonl"
    cycle = orbits.find(van_der_pol(0.5), [2.0, 0.0], 6.4)
    family = orbits.continue_family(cycle, van_der_pol, 0.5, members=3, path=path)
    loaded = orbits.families.load(path, van_der_pol)
    np.testing.assert_array_equal(loaded.orbits[0].periods, family.periods)
    assert loaded.equilibria == ()
    figure = orbits.drawing.diagram(loaded, tmp_path / "family.png")
    assert figure.axes[0].get_ylabel() == "x [m]"
    with pytest.raises(ValueError, match="others, whose orbits do not close"):
        orbits.families.load(path, lambda mu: van_der_pol(mu + 0.1))
    held = orbits.find(jaxdyn.scenes.pendulum(angle=0.5), period=2.0)
    orbits.continue_family(held, members=2, path=tmp_path / "energy.jsonl")
    with pytest.raises(ValueError, match="a family in a parameter, without conditions"):
        orbits.families.load(tmp_path / "energy.jsonl", van_der_pol)
