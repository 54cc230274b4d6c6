"""A file of each kind that version 0.2 wrote is read by every later one, and says the same."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes

FILES = Path(__file__).parents[2] / "references" / "files"


def van_der_pol(p):
    def rate(t, y, p):
        return [y[1], p[0] * (1 - y[0] ** 2) * y[1] - y[0]]

    return jaxdyn.ode(rate, [2.0, 0.0], 6.6, params=[p])


def shaken(a, q):
    def rate(t, y, c):
        return [y[1], -(c[0] - 2 * c[1] * jnp.cos(2 * t)) * jnp.sin(y[0]) - 0.01 * y[1]]

    return jaxdyn.ode(rate, [0.0, 0.0], np.pi, params=[a, q])


def cusp(a, b):
    def rate(t, y, c):
        return [c[0] + c[1] * y[0] - y[0] ** 3]

    return jaxdyn.ode(rate, [0.0], 1.0, params=[a, b])


def test_a_motion():
    motion = jaxdyn.load(FILES / "motion.npz")
    again = jaxdyn.simulate(scenes.pendulum(), 1.0, samples=3)
    np.testing.assert_allclose(motion.ys, again.ys, rtol=1e-12)
    assert motion.scene.name == "pendulum"


@pytest.mark.parametrize("name", ["orbit", "certificate", "refined"])
def test_an_orbit_with_its_claims(name):
    report, wrong = orbits.verify(FILES / f"{name}.json")
    assert wrong == []
    assert report.period == pytest.approx(2 * np.pi, rel=1e-12)


def test_an_orbit_of_a_written_scene():
    orbit, _ = orbits.load(FILES / "written.json")  # whose text has several lines
    assert orbits.verify(FILES / "written.json")[1] == []
    assert orbit.period == pytest.approx(6.66328685932313, rel=1e-13)  # van der Pol's, mu = 1


def test_a_chain():
    walker = scenes.simplest_walker()
    report, wrong = orbits.verify(FILES / "chain.json", scenes.phases_of(walker))
    assert wrong == []
    assert report.verdict == "stable"


def test_a_family_and_a_search():
    family = jaxdyn.load(FILES / "family.json")
    assert (family.parameter, family.end) == ("length", "its bounds")
    assert [(x.parameter, x.energy, x.verdict) for x in family.members] == [
        (1.0, -9.81, "stable")
    ] * 2
    assert [x.kind for x in family.special] == [orbits.Kind.BRANCH]
    header, chunks = jaxdyn.load(FILES / "search.jsonl")
    assert header["what"] == "nothing"
    assert [chunk.number for chunk in chunks] == [0, 1]
    (find,) = chunks[1].finds
    assert (find.y0, find.period, find.verdict) == ((1.0, 1e-5), 2.0, "stable")


def test_equilibria_and_a_curve_of_them():
    (family,) = jaxdyn.load(FILES / "equilibria.jsonl", lambda rho: scenes.lorenz(rho=rho))
    rho = family.parameters
    np.testing.assert_allclose(family.states[:, 0] ** 2, 8 / 3 * (rho - 1), rtol=1e-12)
    (curve,) = jaxdyn.load(FILES / "curve.jsonl", cusp)
    a, b = np.array([point.parameters for point in curve.members]).T
    np.testing.assert_allclose(27 * a**2, 4 * b**3, rtol=1e-9)


def test_families_of_orbits_and_of_special_ones():
    found = jaxdyn.load(FILES / "orbits.jsonl", van_der_pol)
    (family,) = found.orbits
    assert len(family.members) == 3
    assert orbits.analysis.closure(family.members[-1].orbit) < 1e-9
    (curve,) = jaxdyn.load(FILES / "orbit_curve.jsonl", shaken)
    for point in curve.members:
        assert np.abs(point.multipliers.values + 1).min() < 1e-6


@pytest.mark.slow
def test_each_goes_on(tmp_path):
    path = tmp_path / "equilibria.jsonl"
    path.write_bytes((FILES / path.name).read_bytes())

    def lorenz(rho):
        return scenes.lorenz(rho=rho)

    start = [7.0, 7.0, 19.0]
    found = jaxdyn.continue_equilibria(lorenz, 20.0, start, members=5, path=path)
    (again,) = jaxdyn.load(path, lorenz)
    np.testing.assert_array_equal(again.parameters, found.parameters)
    assert len(path.read_bytes().splitlines()) > len((FILES / path.name).read_bytes().splitlines())
    path = tmp_path / "tori.jsonl"
    path.write_bytes((FILES / path.name).read_bytes())
    swing = orbits.find(scenes.shaken_pendulum(angle=0.0), period=2 * np.pi / 60)
    orbits.continue_tori(orbits.torus(swing, 0.1), members=2, path=path)
    assert path.read_bytes() == (FILES / path.name).read_bytes()  # nothing is computed again
