"""Massless bodies in rotating frames: published orbits, closed forms, and the scenes they limit."""

import jax
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.analysis.energy import energy

#: Howell (1984), Celestial Mechanics 32, 53: halo orbits about L1 for mu = 0.04, to the digits
#: printed; x and z at the start, the velocity along y, half of the period.
HOWELL = [
    (0.723268, 0.040000, 0.198019, 1.300177),
    (0.729988, 0.215589, 0.397259, 1.348532),
    (0.753700, 0.267595, 0.399909, 1.211253),
    (0.777413, 0.284268, 0.361870, 1.101099),
    (0.801125, 0.299382, 0.312474, 1.017241),
    (0.817724, 0.313788, 0.271306, 0.978635),
]


@pytest.mark.slow
@pytest.mark.parametrize(("x", "z", "vy", "half"), HOWELL)
def test_published_halo_orbits_close(x, z, vy, half):
    scene = scenes.restricted_three_body_in_space(mu=0.04, x=x, z=z, vy=vy)
    orbit = orbits.find(scene, period=2 * half, hold=["z", "y"])
    # The period of an unstable orbit has a digit less than its start.
    assert gap(orbit.y0, [x, 0, z, 0, vy, 0]) < 2e-6
    assert abs(orbit.period / 2 - half) < 4e-6


@pytest.mark.slow
def test_the_halo_orbit_of_the_defaults_closes():
    scene = scenes.restricted_three_body_in_space()
    orbit = orbits.find(scene, period=float(scene.t1), hold=["z", "y"])
    assert gap(orbit.y0, scene.y0) < 1e-3
    assert abs(orbit.period - float(scene.t1)) < 5e-3


@pytest.mark.slow
def test_in_the_plane_it_is_the_plane_problem():
    numbers = {"mu": 0.1, "x": 0.5, "y": 0.2, "vx": 0.1, "vy": 0.8}
    flat = scenes.restricted_three_body(**numbers)
    space = scenes.restricted_three_body_in_space(**numbers, z=0.0)
    one, other = (jaxdyn.solve(scene, 3.0, rtol=1e-13).y1 for scene in (flat, space))
    assert gap(np.asarray(other)[[0, 1, 3, 4]], one) < 100 * SOLVED
    assert (np.asarray(other)[[2, 5]] == 0).all()
    assert abs(energy(space, 0.0, space.y0) - energy(flat, 0.0, flat.y0)) < EXACT


def rotating(mu):
    """The rates of the third body in an inertial frame, by Newton's law."""

    def rate(t, y):
        r, v = y[:3], y[3:]
        there = np.array([np.cos(t), np.sin(t), 0.0])
        one, two = r + mu * there, r - (1 - mu) * there
        pull = (1 - mu) * one / np.linalg.norm(one) ** 3 + mu * two / np.linalg.norm(two) ** 3
        return np.concatenate([v, -pull])

    return rate


def test_it_is_newtons_law_in_turning_axes():
    scene = scenes.restricted_three_body_in_space(mu=0.2, y=0.1, z=0.3, vx=0.1, vz=-0.2)
    x, v = np.split(np.asarray(scene.y0), 2)
    spin, t = np.array([0.0, 0.0, 1.0]), 1.5
    start = np.concatenate([x, v + np.cross(spin, x)])
    end = solve_ivp(rotating(0.2), (0, t), start, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    turn = np.array([[np.cos(t), np.sin(t), 0], [-np.sin(t), np.cos(t), 0], [0, 0, 1]])
    r = turn @ end[:3]
    u = turn @ end[3:] - np.cross(spin, r)
    found = jaxdyn.solve(scene, t, rtol=1e-13).y1
    assert gap(found, np.concatenate([r, u])) < 1e-10


@pytest.mark.sample("hill")
@pytest.mark.parametrize("name", ["restricted_three_body_in_space", "hill"])
def test_jacobis_constant_is_kept(name):
    scene = scenes.catalogue.entries()[name].make(t1=5.0)
    motion = jaxdyn.simulate(scene, samples=50, rtol=1e-12)
    values = np.array([energy(scene, t, y) for t, y in zip(motion.ts, motion.ys, strict=True)])
    assert np.ptp(values) < 1e-10


@pytest.mark.parametrize(
    ("name", "d", "masses"),
    [("restricted_three_body", 2, 2), ("hill", 2, 1), ("restricted_three_body_in_space", 3, 0)],
)
def test_the_way_in_space_is_drawn_with_the_masses_in_the_plane(name, d, masses):
    motion = jaxdyn.simulate(scenes.catalogue.entries()[name].make(), samples=9)
    drawn = jaxdyn.drawing.paths(motion)
    assert drawn.labels == ("x", "y", "z")[:d]
    assert gap(drawn.xyz[-1], motion.ys[-1:, :d]) == 0
    assert [kind for kind, _ in drawn.shapes] == ["solid"] * masses
    assert jaxdyn.drawing.trajectory(motion) is not None


def test_a_share_of_mass_is_a_share():
    for mu in (0.0, 1.0, -0.1):
        with pytest.raises(ValueError, match=r"^mu: expected between 0 and 1, got"):
            scenes.restricted_three_body_in_space(mu=mu).check()


def test_hills_libration_points_and_jacobis_constant_there():
    for side in (-1.0, 1.0):
        scene = scenes.hill(x=side * 3 ** (-1 / 3), vy=0.0)
        assert gap(scene.rate(0.0, scene.y0), np.zeros(4)) < EXACT
        assert abs(-2 * energy(scene, 0.0, scene.y0) - 3 ** (4 / 3)) < EXACT
        found = np.linalg.eigvals(jaxdyn.linearize(scene, scene.y0).jacobian)
        # Szebehely (1967), section 10.4: the squares are 1 + 2 sqrt(7) and 1 - 2 sqrt(7).
        squares = np.repeat([1 - 2 * np.sqrt(7), 1 + 2 * np.sqrt(7)], 2)
        assert gap(np.sort((found**2).real), squares) < 1e-12


@pytest.mark.slow
def test_hills_problem_is_the_limit_of_the_restricted_three_bodies():
    hill = scenes.hill()
    end = np.asarray(jaxdyn.solve(hill, 1.0, rtol=1e-13).y1)
    misses = []
    for mu in (1e-6, 1e-9):
        unit = mu ** (1 / 3)
        x, y, vx, vy = unit * np.asarray(hill.y0)
        near = scenes.restricted_three_body(mu=mu, x=1 - mu + x, y=y, vx=vx, vy=vy)
        there = np.asarray(jaxdyn.solve(near, 1.0, rtol=1e-14).y1) - [1 - mu, 0, 0, 0]
        misses.append(np.abs(there / unit - end).max())
    # The next term is of the order of mu^(1/3).
    assert misses[1] < 0.2 * misses[0] < 0.05


#: Earth and Moon in JPL's catalogue: the libration points that it lists.
LISTED = {
    "L1": (0.8369151257723572, 0.0),
    "L2": (1.155682165444884, 0.0),
    "L3": (-1.005062645810278, 0.0),
    "L4": (0.4878494143903759, 0.8660254037844386),
    "L5": (0.4878494143903759, -0.8660254037844386),
}


def test_libration_points_by_name_in_kilometres():
    scene = scenes.restricted_three_body_in_space(system="earth-moon")
    for name, place in LISTED.items():
        found = scenes.libration_point(scene, name)
        assert gap(found[:2] / 389703.264829278, place) < EXACT
        assert (np.asarray(found[2:]) == 0).all()
        rate = np.asarray(scene.rate(0.0, found))
        assert np.abs(rate).max() < 1e-8  # of thousands of km/day^2 that cancel
    flat = scenes.restricted_three_body(mu=0.1)
    assert gap(scenes.libration_point(flat, "L4")[:2], [0.4, np.sqrt(0.75)]) < EXACT
    with pytest.raises(ValueError, match="name: expected one of L1"):
        scenes.libration_point(scene, "L6")
    with pytest.raises(ValueError, match="scene: expected a restricted three-body scene"):
        scenes.libration_point(scenes.pendulum(), "L1")


def test_kilometres_and_days_are_the_same_motion():
    mu, distance, days = 1.215058560962404e-2, 389703.264829278, 382981.289129055 / 86400
    plain = scenes.restricted_three_body_in_space(mu=mu)
    scene = scenes.restricted_three_body_in_space(system="earth-moon")
    units = np.array([distance] * 3 + [distance / days] * 3)
    assert gap(scene.y0 / units, plain.y0) < EXACT
    one, other = (jaxdyn.solve(s, s.t1, rtol=1e-12).y1 for s in (plain, scene))
    assert gap(np.asarray(other) / units, one) < 1e-9
    energies = [float(energy(s, 0.0, s.y0)) for s in (plain, scene)]
    assert abs(energies[1] / (distance / days) ** 2 - energies[0]) < EXACT
    for s in (plain, scene):
        assert abs(scenes.jacobi_constant(s) + 2 * energies[0]) < EXACT
    # Kepler's third law, with the masses of both [km^3/s^2].
    assert abs(distance**3 / 382981.289129055**2 / (398600.44 + 4902.80) - 1) < 1e-6


def test_distance_and_month_may_be_given():
    """Real months, by a rotation in a frame at rest: a month later both bodies are back."""
    listed = scenes.restricted_three_body_in_space(system="earth-moon")
    assert 2 * np.pi * float(listed.system.time) == pytest.approx(27.851, abs=5e-4)
    seconds = 27.321661 * 86400 / (2 * np.pi)
    pair = scenes.restricted.Pair(0.0121505856, 384400.0, seconds)
    scene = scenes.restricted_three_body_in_space(system=pair)
    # Far from both, Kepler's motion about all the mass: beyond the Moon by ten times its distance.
    far, turn = 10 * 384400.0, 2 * np.pi / 27.321661
    speed = turn * 384400.0**1.5 / far**0.5 - turn * far
    away = scene.starting([far, 0, 0, 0, speed, 0], 27.321661)
    angle = (10**-1.5 - 1) * 2 * np.pi
    end = jaxdyn.solve(away, away.t1).y1[:2] / far
    np.testing.assert_allclose(end, [np.cos(angle), np.sin(angle)], atol=1e-3)
    # The distance is a number of the scene, by which it has derivatives.
    slope = jax.grad(
        lambda km: scenes.restricted_three_body_in_space(system=pair._replace(distance=km)).y0[0]
    )(384400.0)
    assert float(slope) == pytest.approx(0.8234)
    with pytest.raises(ValueError, match="distance: expected > 0"):
        scenes.restricted_three_body_in_space(system=pair._replace(distance=-1.0)).check()


@pytest.mark.parametrize("name", scenes.restricted.SYSTEMS)
def test_a_time_in_days_is_refused_and_one_in_seconds_weighs_the_bodies(name):
    pair = scenes.restricted.SYSTEMS[name]
    # G M of the larger body [km^3/s^2], as JPL's planetary ephemeris DE440 has it.
    heavy = {"sun": 1.32712e11, "earth": 3.98600e5, "mars": 4.28284e4}
    heavy |= {"jupiter": 1.266865e8, "saturn": 3.793121e7}
    mass = (1 - pair.mu) * pair.distance**3 / pair.time**2
    assert mass == pytest.approx(heavy[name.partition("-")[0]], rel=2e-2)
    scenes.restricted_three_body_in_space(system=pair)
    days = pair._replace(time=pair.time / 86400)
    said = rf"^time: expected 1 over .*, in seconds, got {days.time:g} at .* Pair is in seconds"
    with pytest.raises(ValueError, match=said):
        scenes.restricted_three_body_in_space(system=days)


def test_units_of_a_scene_are_those_of_its_tables(tmp_path):
    scene = scenes.restricted_three_body_in_space(system="earth-moon")
    motion = jaxdyn.simulate(scene, 1.0, samples=3)
    jaxdyn.files.tables.write_csv(tmp_path / "motion.csv", motion)
    head = (tmp_path / "motion.csv").read_text().splitlines()[0]
    assert head.startswith("t [day],x [km],y [km],z [km],vx [km/day]")
    assert "0 to 1 day" in repr(motion)
    axes = jaxdyn.drawing.time_series(motion).axes
    assert axes[-1].get_xlabel() == "t [day]"
    units = [orbits.analysis.quantities.unit(x, scene) for x in ("period", "energy")]
    assert units == ["day", "km^2/day^2"]
    with pytest.raises(ValueError, match="system: expected one of earth-moon"):
        scenes.restricted_three_body_in_space(system="moon")
    said = "mu: expected none with system=, which has its own"
    with pytest.raises(ValueError, match=said):
        scenes.restricted_three_body_in_space(system="earth-moon", mu=0.1)
    with pytest.raises(ValueError, match=said):  # its derivative would be 0
        jax.grad(
            lambda mu: scenes.restricted_three_body_in_space(mu=mu, system="earth-moon").y0[0]
        )(0.3)
    with pytest.raises(ValueError, match="takes one in km and km/day"):
        scenes.restricted_three_body_in_space(system="earth-moon", x=326149.0)
