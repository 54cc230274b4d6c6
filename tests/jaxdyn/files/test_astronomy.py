"""Tables of Horizons (with made-up numbers) and simulations of REBOUND (by a stand-in)."""

import re
import sys
import types

import numpy as np
import pytest
from helpers import refusal

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
