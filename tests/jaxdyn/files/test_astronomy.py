"""Tables of Horizons (with made-up numbers) and simulations of REBOUND (by a stand-in)."""

import re
import sys
import types

import numpy as np
import pytest
from helpers import refusal
from numpy.testing import assert_allclose

import jaxdyn
from jaxdyn import scenes, simulate
from jaxdyn.files import astronomy

HEAD = """*******************************************************************************
Target body name: Nowhere (9999)                  {source: made up}
Center body name: Sun (10)                        {source: made up}
Output units    : AU-D
$$SOE
"""
BLOCKS = """2460000.500000000 = A.D. 2023-Feb-25 00:00:00.0000 TDB
 X = 1.000000000000000E+00 Y =-2.500000000000000E-01 Z = 0.000000000000000E+00
 VX=-1.500000000000000E-03 VY= 1.700000000000000E-02 VZ= 1.000000000000000E-05
 LT= 5.9E-03 RG= 1.03E+00 RR=-5.6E-03
2460001.500000000 = A.D. 2023-Feb-26 00:00:00.0000 TDB
 X = 9.980000000000000E-01 Y =-2.330000000000000E-01 Z = 1.000000000000000E-05
 VX=-1.800000000000000E-03 VY= 1.690000000000000E-02 VZ= 1.100000000000000E-05
 LT= 5.9E-03 RG= 1.02E+00 RR=-5.6E-03
"""
COLUMNS = """2460000.500000000, A.D. 2023-Feb-25 00:00:00.0000, 1.0E+00, -2.5E-01, 0.0, -1.5E-03, 1.7E-02, 1.0E-05,
2460001.500000000, A.D. 2023-Feb-26 00:00:00.0000, 9.98E-01, -2.33E-01, 1.0E-05, -1.8E-03, 1.69E-02, 1.1E-05,
"""  # noqa: E501 as Horizons writes them
TAIL = "$$EOE\nX = 3\n"


#: Blocks with "Vector table labels" off.
BARE = re.sub(r"(V?[XYZ]|LT|RG|RR) *= *", " ", BLOCKS)


@pytest.mark.parametrize("body", [BLOCKS, BARE, COLUMNS])
def test_vector_tables_are_read(tmp_path, body):
    path = tmp_path / "horizons.txt"
    path.write_text(HEAD + body + TAIL)
    found = astronomy.read_horizons(path)
    assert (found.name, found.units) == ("Nowhere", "AU-D")
    assert found.ts.tolist() == [2460000.5, 2460001.5]
    assert found.r.tolist() == [[1.0, -0.25, 0.0], [0.998, -0.233, 1e-5]]
    assert found.v.tolist() == [[-0.0015, 0.017, 1e-5], [-0.0018, 0.0169, 1.1e-5]]


def test_columns_are_found_by_their_names(tmp_path):
    # With the option of that name, the difference of the time scales comes before the positions.
    path, start = tmp_path / "horizons.txt", "$$SOE\n"
    names = "JDTDB, Calendar Date (TDB), delta-T, X, Y, Z, VX, VY, VZ,\n"
    lines = COLUMNS.replace(".0000, ", ".0000, 69.184182, ")
    path.write_text(HEAD.replace(start, names + start) + lines + TAIL)
    found = astronomy.read_horizons(path)
    assert found.r.tolist() == [[1.0, -0.25, 0.0], [0.998, -0.233, 1e-5]]
    assert found.v.tolist() == [[-0.0015, 0.017, 1e-5], [-0.0018, 0.0169, 1.1e-5]]


def test_other_texts_are_refused(tmp_path):
    path = tmp_path / "horizons.txt"

    def refused(text):
        path.write_text(text)
        return refusal(lambda: astronomy.read_horizons(path))

    assert "a table between $$SOE" in refused("nothing")
    assert "six numbers" in refused(HEAD + BLOCKS.replace("VZ", "WZ") + TAIL)
    assert "six numbers" in refused(HEAD + TAIL)
    two = refused(2 * (HEAD + BLOCKS + TAIL))
    assert "one table, got 2 in" in two
    assert "each body in a file of its own" in two
    assert "numbers in columns" in refused(HEAD + COLUMNS.replace("1.0E+00", "n.a.") + TAIL)


BODIES = """name m x y z vx vy vz
Sun 1 0 0 0 0 0 0
Jupiter 9.5e-4 5.2 0 0.1 0 7.5e-3 0
Trojan 0 2.6 4.5 0 -6.5e-3 3.75e-3 0
"""
UNITS = ("AU", "Msun", "day")


def bodies(tmp_path, text, **options):
    path = tmp_path / "bodies.txt"
    path.write_text(text)
    return jaxdyn.read_bodies(path, **options)


@pytest.mark.parametrize(
    "text",
    [
        BODIES,
        BODIES.replace("name m x y z", "# Body Mass X Y Z"),
        "made up\n\n" + BODIES.replace(" ", ","),
        re.sub("^(?=[SJT])", "body ", BODIES, flags=re.MULTILINE).replace("name", "kind name"),
    ],
)
def test_bodies_are_read(tmp_path, text):
    scene = bodies(tmp_path, text, units=UNITS, t1=4332.6)
    r = [[0, 0, 0], [5.2, 0, 0.1], [2.6, 4.5, 0]]
    v = [[0, 0, 0], [0, 7.5e-3, 0], [-6.5e-3, 3.75e-3, 0]]
    names = ["Sun", "Jupiter", "Trojan"]
    named = scenes.n_body(r, v, m=[1, 9.5e-4, 0], names=names, t1=4332.6, units=UNITS)
    assert repr(scene) == repr(named)
    assert np.array_equal(scene.y0, named.y0)


def test_bodies_in_other_units_are_converted(tmp_path):
    scene = bodies(tmp_path, BODIES, units=UNITS)
    # The AU and the day of the IAU, and G times the mass of the Sun of its resolution B3 of 2015.
    sizes = np.array([1.3271244e11, *(2 * [149597870.7]), *(2 * [149597870.7 / 86400.0])])
    rows = [[1, 0, 0, 0, 0], [9.5e-4, 5.2, 0, 0, 7.5e-3], [0, 2.6, 4.5, -6.5e-3, 3.75e-3]]
    head = "GM [km^3/s^2],x (km),y (km),vx [km/s],vy [km/s],class"
    lines = [f"{','.join(map(repr, (row * sizes).tolist()))},body" for row in rows]
    flat = bodies(tmp_path, "\n".join([head, *lines]), units=UNITS)
    assert flat.labels()[0] == ("x1", "AU")  # equal texts are no names
    for one, other in zip(flat.points(0, flat.y0), scene.points(0, scene.y0), strict=True):
        assert_allclose(one, other[:, :2] if other.ndim > 1 else other, rtol=1e-15)
    (pull,) = bodies(tmp_path, BODIES, units=UNITS, G=3e-4).effects
    assert float(pull.G) == 3e-4
    heavy = bodies(tmp_path, BODIES.replace(" m ", " m [Mearth] "), units=("km", "kg", "s"))
    # The mass of the Earth, of JPL's table of 2021 [kg].
    assert_allclose(heavy.points(0, heavy.y0).m[0], 5.97217e24, rtol=1e-5)


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (BODIES, {}, "units: expected names of the units of length, mass and time, got none. Pass"),
        (BODIES, {"units": ("AU", "day"), "G": 1.0}, "units: expected names of the units"),
        (BODIES.replace(" m ", " w "), {"G": 1.0}, "vx, vy, vz in {path}. Of these m is missing."),
        (BODIES.replace(" vz", " wz"), {"G": 1.0}, "Of these vz is missing."),
        (BODIES.replace(" x ", " x [km] "), {"G": 1.0}, "units of the scene, got x in km. Pass"),
        (
            BODIES.replace(" x ", " x [kg] "),
            {"units": UNITS},
            "column x: expected values in AU, or",
        ),
        (
            BODIES.replace(" ", ",").replace("n,0", "n,"),
            {"G": 1.0},
            "got a gap for body 3. Write 0",
        ),
        (BODIES.replace(" 9.5e-4", " ?"), {"G": 1.0}, "got '?' in line 3, column m. Leave gaps"),
        (
            "m x y vx vy\n- 1 2 3 4\n",
            {"G": 1.0},
            "column m: expected numbers, got text. Leave gaps",
        ),
    ],
)
def test_other_tables_of_bodies_are_refused(tmp_path, text, options, said):
    refused = refusal(lambda: bodies(tmp_path, text, **options))
    assert said.format(path=tmp_path / "bodies.txt") in refused


class Simulation:
    """What of REBOUND's simulation is read and written."""

    def __init__(self):
        self.G, self.particles = 1.0, []

    def add(self, **numbers):
        self.particles.append(types.SimpleNamespace(**numbers))


def test_simulations_there_and_back(monkeypatch):
    monkeypatch.setitem(sys.modules, "rebound", types.SimpleNamespace(Simulation=Simulation))
    scene = scenes.n_body(G=2.0)
    sim = astronomy.to_rebound(scene)
    assert sim.G == 2.0
    back = astronomy.from_rebound(sim, scene.t1)
    assert np.array_equal(back.y0, scene.y0)
    ends = [simulate(one, 1.0, samples=2).ys[-1] for one in (scene, back)]
    assert np.array_equal(*ends)
    in_au = astronomy.from_rebound(sim, scene.t1, units=("AU", "Msun", "day"))
    assert [unit for _, unit in in_au.labels()][::9] == ["AU", "AU/day"]
    flat = astronomy.from_rebound(astronomy.to_rebound(scenes.three_body()))
    assert flat.points(0.0, flat.y0).r.shape == (3, 3)


def test_variational_particles_of_a_simulation_are_no_bodies():
    sim = Simulation()
    for m, x in ((1.0, 0.0), (1e-3, 1.0), (0.0, 1e-8), (0.0, 1e-8)):
        sim.add(m=m, x=x, y=0.0, z=0.0, vx=0.0, vy=x, vz=0.0)
    sim.N_var = 2
    assert astronomy.from_rebound(sim).system.m.tolist() == [1.0, 1e-3]


def test_what_is_no_simulation_is_refused(monkeypatch):
    assert "rebound.Simulation" in refusal(lambda: astronomy.from_rebound(3))
    assert "with bodies" in refusal(lambda: astronomy.from_rebound(Simulation()))
    for name, value in (
        ("softening", 0.1),
        ("N_active", 1),
        ("gravity", "none"),
        ("boundary", "periodic"),
    ):
        sim = Simulation()
        sim.particles = [
            types.SimpleNamespace(m=1.0, x=x, y=0, z=0, vx=0, vy=0, vz=0) for x in (0, 1)
        ]
        setattr(sim, name, value)
        assert (name if name != "gravity" else "none") in refusal(
            lambda sim=sim: astronomy.from_rebound(sim)
        )
    assert "PairGravity alone" in refusal(lambda: astronomy.to_rebound(scenes.pendulum()))
    monkeypatch.setitem(sys.modules, "rebound", None)
    assert "jaxdyn[rebound]" in refusal(lambda: astronomy.to_rebound(scenes.three_body()))


def test_bodies_of_one_name_are_refused_where_they_are_read(tmp_path):
    path = tmp_path / "twins.txt"
    path.write_text("name m x y vx vy\nSun 1 0 0 0 0\nSun 1 1 0 0 1\n")
    with pytest.raises(ValueError, match="names: expected 2 different ones"):
        jaxdyn.read_bodies(path, G=1.0)
