"""A scene that says its units: tables, pictures and files name those, and nothing in m, kg, s."""

import dataclasses
import re

import numpy as np
import pytest
from matplotlib.text import Text
from numpy.testing import assert_allclose

import jaxdyn
import orbits
from jaxdyn import effects, scenes, vibration
from jaxdyn._units import in_base_units, measure
from jaxdyn.drawing.titles import describe
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.symbolic.parameters import parameters, with_parameters
from orbits.families.family import where

#: Gauss's constant squared: G in AU^3 / (Msun day^2).
GAUSS = 0.01720209895**2
UNITS = ("AU", "Msun", "day")
ENERGY = "energy [Msun AU^2/day^2]"


def lines(x):
    return repr(x).splitlines()


def year():
    points = FreePoints([1.0, 0.0], 2, names=["Sun", "Earth"])
    y0 = [0, 0, 1, 0, 0, 0, 0, np.sqrt(GAUSS)]
    pull = effects.PairGravity(GAUSS)
    return jaxdyn.Scene(points, (pull,), y0=y0, t1=365.25, name="year", units=UNITS)


def test_bodies_of_the_solar_system_have_them():
    r, v = [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, np.sqrt(GAUSS), 0]]
    scene = scenes.n_body(r, v, m=[1.0, 0.0], G=GAUSS, t1=365.25, units=UNITS)
    assert scene.labels()[0] == ("x1", "AU")
    assert not {"kg", "m", "s"} & set(repr(scene).replace(",", " ").split())
    assert "365.25 day" in repr(jaxdyn.simulate(scene))
    with pytest.raises(ValueError, match="names of the units of length, mass and time"):
        scenes.n_body(units=("AU", "day")).check()
    with pytest.raises(ValueError, match=r"same kind as m, got 'day'. The order is length, mass"):
        scenes.n_body(units=("day", "Msun", "AU"))


@pytest.mark.parametrize(
    ("units", "expected"),
    [
        ((), 1.0),
        (UNITS, GAUSS),  # Gauss's constant is that of 1938
        (("km", "Mearth", "s"), 398600.4),
        (("km", "kg", "s"), 6.67430e-20),
        (("AU", "Msun", "yr"), 4 * np.pi**2),  # Kepler: a year at 1 AU, to 1e-4
    ],
)
def test_the_gravitational_constant_follows_from_units(units, expected):
    (pull,) = scenes.n_body(units=units).effects
    assert_allclose(pull.G, expected, rtol=1e-4 if "yr" in units else 1e-8)


def test_in_unknown_units_the_gravitational_constant_has_to_be_given():
    with pytest.raises(ValueError, match=r"units: expected known ones, .* got pc, Msun, Myr"):
        scenes.n_body(units=("pc", "Msun", "Myr"))
    (pull,) = scenes.n_body(units=("pc", "Msun", "Myr"), G=4.4985e-3).effects
    assert float(pull.G) == 4.4985e-3


def test_tables_and_pictures_name_them(tmp_path):
    scene = year()
    assert scene.labels()[2] == ("x_Earth", "AU")
    assert scene.labels()[6] == ("vx_Earth", "AU/day")
    assert not {"kg", "m", "s"} & set(repr(scene).replace(",", " ").split())
    motion = jaxdyn.simulate(scene)
    assert "0 to 365.25 day" in repr(motion)
    jaxdyn.files.tables.write_csv(tmp_path / "year.csv", motion)
    assert (tmp_path / "year.csv").read_text().startswith("t [day],x_Sun [AU]")
    axes = jaxdyn.drawing.time_series(motion, names=["x_Earth", "vx_Earth", "total"]).axes
    assert [ax.get_ylabel() for ax in axes] == ["[AU]", "[AU/day]", ENERGY]
    assert axes[-1].get_xlabel() == "t [day]"
    assert jaxdyn.drawing.trajectory(motion).axes[0].get_xlabel() == "x [AU]"
    assert f"energy [{orbits.analysis.quantities.unit('energy', scene)}]" == ENERGY
    pull = repr(scene).partition("PairGravity")[2].partition("\n")[0]
    assert pull == "(G = 0.000295912 AU^3/(Msun day^2))"


def test_they_change_no_number_and_stay_with_the_scene(tmp_path):
    scene = year()
    plain = dataclasses.replace(scene, units=None)
    assert_allclose(jaxdyn.simulate(scene).ys, jaxdyn.simulate(plain).ys, rtol=0, atol=0)
    kept = (scene.starting(scene.y0, 1.0), scene + effects.LinearDrag(0.0))
    assert all(one.units == UNITS for one in kept)
    path = tmp_path / "year.npz"
    motion = jaxdyn.simulate(scene, 10.0, samples=3)
    motion.save(path)
    assert jaxdyn.load(path).scene.units == UNITS
    spring = dataclasses.replace(scenes.oscillator(x=0.0), units=("mm", "g", "ms"))
    driven = vibration.drive(spring, "x", vibration.Step(1.0))
    assert driven.labels() == (("x", "mm"), ("vx", "mm/ms"))
    assert "rad/ms" in repr(vibration.modes(spring))


@pytest.mark.parametrize("units", [("AU", "day"), 3, ("AU", "Msun", 3), ("AU", "Msun", "a day")])
def test_others_are_refused(units):
    with pytest.raises(ValueError, match="units: expected names of the units of length"):
        dataclasses.replace(year(), units=units).check()
    with pytest.raises(ValueError, match="units: expected names of the units of length"):
        dataclasses.replace(year(), units=units).labels()


def test_bodies_are_called_by_their_names_and_measured_in_their_units(tmp_path):
    scene = scenes.n_body(
        [[0.0, 0, 0], [1.0, 0, 0]],
        [[0.0, 0, 0], [0, 0.0172, 0]],
        m=[1.0, 3e-6],
        names=["Sun", "Earth"],
        units=UNITS,
        t1=365.25,
    )
    (ax, *_) = jaxdyn.drawing.trajectory(jaxdyn.simulate(scene)).axes
    assert ax.get_xlabel() == "x [AU]"
    shown = {text.get_text() for legend in ax.figure.legends for text in legend.get_texts()}
    assert {"Sun", "Earth"} <= shown
    scene.live(tmp_path / "year.html")
    page = (tmp_path / "year.html").read_text()
    for said in ('"marks": ["Sun", "Earth"]', '"x [AU]"', '"Msun"', '"AU^3/(Msun day^2)"'):
        assert said in page
    assert '"kg"' not in page


@pytest.mark.parametrize(
    ("names", "unit", "expected"),
    [
        (("m", "kg", "s"), "N m", "N m"),
        (UNITS, "kg m^2/s", "Msun AU^2/day"),
        (UNITS, "N", "Msun AU/day^2"),
        (UNITS, "N/m", "Msun/day^2"),
        (UNITS, "N m/rad", "Msun AU^2/(rad day^2)"),
        (UNITS, "W", "Msun AU^2/day^3"),
        (("m", "Msun", "s"), "J", "Msun m^2/s^2"),  # not a joule
        (("km", "", "day"), "J", "km^2/day^2"),
        (("km", "", "day"), "day", "day"),
        (("km", "", "day"), "1/s", "1/day"),
        (UNITS, "J/K", ""),  # not known: no unit instead of a wrong one
    ],
)
def test_units_are_named_in_others(names, unit, expected):
    assert in_base_units(unit, names) == expected
    here, there = measure(unit), measure(expected)
    if expected and names[1]:
        assert here.powers == there.powers


def test_forces_on_bodies_have_them():
    found = jaxdyn.drawing.free_body(year())
    shown = {text.get_text() for text in found.findobj(Text)}
    assert any("Msun AU/day^2" in text for text in shown)
    bodies = jaxdyn.analysis.free_body.free_body(year())
    assert "Msun AU/day^2 = m a" in repr(bodies)
    assert bodies.units == ("Msun", "AU", "Msun AU/day^2", "Msun AU^2/day^2", "day")
    with pytest.raises(ValueError, match="from 0 day to 1 day"):
        jaxdyn.drawing.free_body(jaxdyn.simulate(year(), 1.0), 2.0)


def test_other_values_of_parameters_keep_them():
    scene = year()
    same = with_parameters(scene, parameters(scene).values)
    assert same.units == UNITS
    assert same.labels() == scene.labels()


@pytest.fixture(scope="module")
def orbit():
    spring = dataclasses.replace(scenes.oscillator(k=4.0), units=("mm", "g", "ms"))
    return orbits.find(spring, period=3.0, hold="x")


def test_orbits_have_them(orbit):
    assert lines(orbits.identify(orbit)) == ["Identity", "  energy  2 g mm^2/ms^2"]


def test_families_have_them(orbit):
    family = orbits.continue_family(orbit, members=2)
    assert re.fullmatch(r" +energy +2 to \S+ g mm\^2/ms\^2", lines(family)[2])
    assert lines(family.members[0])[2] == "  energy     2 g mm^2/ms^2"
    assert family.to_pandas().attrs["units"]["energy"] == "g mm^2/ms^2"
    assert where(family.members[0]) == "energy 2 g mm^2/ms^2"


def test_systems_in_kilometres_and_days_name_their_energy():
    scene = scenes.restricted_three_body_in_space(system="earth-moon")
    assert scene.base_units == ("km", "", "day")
    assert "distance = 389703 km, time = 4.43265 day" in repr(scene)
    assert scene.in_units("J") == "km^2/day^2"
    driven = vibration.drive(scene, vibration.Parameter(lambda mu: scene), vibration.Step(0.0))
    assert driven.in_units("J") == "km^2/day^2"
    # The size of its units is no number of the motion.
    assert describe(scene) == "restricted_three_body_in_space (mu = 0.01215)"
    assert scenes.restricted_three_body_in_space().in_units("J") == ""
    assert scenes.lorenz().base_units is None
