"""Guesses near libration points lead to the orbits that are meant, and to published ones."""

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose
from odes import restricted
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from jaxdyn import scenes
from orbits.discovery.libration import near_libration_point, resonant

#: The largest Jacobi constants of halo orbits of L1 and L2 in JPL's catalogue.
LARGEST = {"L1": 3.174, "L2": 3.152}


#: Distant retrograde orbits of JPL's catalogue: Jacobi's constant, and the period in its unit of
#: time, a radian of the two bodies. Both are stable.
RETROGRADE = (
    ("saturn-titan", 2.99991417019945, 2.2365274428311821),
    ("mars-phobos", 2.99999004459787, 4.7406333626886079),
)


def space(system="earth-moon"):
    return scenes.restricted_three_body_in_space(system=system)


def found(scene, family, point, hold, **options):
    seed = near_libration_point(scene, family, point, **options)
    mirror = orbits.closing.mirror(scene)
    return seed, orbits.find(scene, seed.y0, seed.period, closing=mirror, hold=hold)


@pytest.mark.slow
@pytest.mark.parametrize("point", ["L1", "L2"])
def test_halo_orbits_are_near_richardsons_series(point):
    scene = space()
    off = []
    for amplitude in (2500.0, 5000.0, 10000.0):  # km
        seed, orbit = found(scene, "halo", point, "z", amplitude=amplitude)
        off.append(abs(seed.period / orbit.period - 1))
        assert scenes.jacobi_constant(orbit.scene) < LARGEST[point]
        start = np.asarray(orbit.y0)
        assert np.linalg.norm(start - seed.y0)[()] < 0.1 * np.linalg.norm(
            start[:3] - place(scene, point)
        )
        assert max(off) < 4e-3
    smallest = scenes.jacobi_constant(found(scene, "halo", point, "z", amplitude=500.0)[1].scene)
    assert_allclose(smallest, LARGEST[point], atol=6e-4)  # of three digits
    _, south = found(scene, "halo", point, "z", southern=True)
    _, north = found(scene, "halo", point, "z")
    z = jaxdyn.simulate(north.scene)["z"]
    assert z.max() > -z.min() > 0
    assert_allclose(south.y0, np.asarray(north.y0) * [1, 1, -1, 1, 1, 1], rtol=1e-9, atol=1e-6)


def place(scene, point):
    return np.asarray(scenes.libration_point(scene, point))[:3]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "point"),
    [
        ("lyapunov", "L1"),
        ("lyapunov", "L2"),
        ("lyapunov", "L3"),
        ("vertical", "L1"),
        ("vertical", "L2"),
    ],
)
def test_small_orbits_are_those_of_the_linear_modes(family, point):
    scene = space()
    modes = jaxdyn.vibration.modes(scene, scenes.libration_point(scene, point))
    turning = [float(w) for w in modes.damped_frequencies if w > 0]
    seed = near_libration_point(scene, family, point, amplitude=50.0)
    assert min(abs(2 * np.pi / seed.period / w - 1) for w in turning) < 1e-9
    hold = "z" if family == "vertical" else "x"
    _, orbit = found(scene, family, point, hold, amplitude=5000.0)
    assert_allclose(orbit.period, seed.period, rtol=2e-2)


@pytest.mark.slow
def test_a_distant_retrograde_orbit_goes_round_the_moon_and_is_stable():
    flat = scenes.restricted_three_body(mu=0.01215)
    for scene in (flat, space("")):
        seed, orbit = found(scene, "distant retrograde", "L1", "x", amplitude=0.08)
        assert orbits.stability(orbit).verdict == "stable"
        assert_allclose(orbit.period, seed.period, rtol=0.1)
    motion = np.asarray(jaxdyn.simulate(orbit.scene).ys) - [0.98785, 0, 0, 0, 0, 0]
    turns = np.unwrap(np.arctan2(motion[:, 1], motion[:, 0]))
    assert_allclose(turns[-1] - turns[0], -2 * np.pi, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("system", "constant", "period"), RETROGRADE)
def test_retrograde_orbits_have_the_constant_of_jpls_catalogue(system, constant, period):
    scene = space(system)
    period = period * float(scene.system.time)
    _, first = found(scene, "distant retrograde", "L1", "x")
    family = orbits.continue_family(first, step=0.1, within=(0.0, period))
    near = min((member.orbit for member in family.members), key=lambda x: abs(x.period - period))
    mirror = orbits.closing.mirror(scene)
    orbit = orbits.find(near.scene, closing=mirror, hold=orbits.Period(period))
    assert_allclose(scenes.jacobi_constant(orbit.scene), constant, rtol=0, atol=1e-13)
    assert orbits.stability(orbit).verdict == "stable"


@pytest.mark.slow
@pytest.mark.parametrize(
    "system", ["earth-moon", "sun-earth", "jupiter-europa", "saturn-enceladus", "mars-phobos"]
)
@pytest.mark.parametrize("point", ["L1", "L2"])
def test_axial_orbits_are_mirrored_at_the_axis_only(system, point):
    scene = space(system)
    seed = near_libration_point(scene, "axial", point)
    mirror = orbits.closing.mirror(scene, "x")
    orbit = orbits.find(scene, seed.y0, seed.period, closing=mirror, hold="vz")
    assert_allclose(orbit.period, seed.period, rtol=1e-3)
    motion = np.asarray(jaxdyn.simulate(orbit.scene, samples=201).ys)
    # Half a turn about the axis and back in time it is itself, after a mirror at xz it is not.
    turned = motion[::-1] * [1, -1, -1, -1, 1, 1]
    assert_allclose(turned, motion, rtol=0, atol=1e-5 * np.abs(motion).max(axis=0).min())
    crosses = np.flatnonzero(np.diff(np.sign(motion[:, 1])))
    assert np.abs(motion[crosses, 5]).min() > 0.1 * np.abs(motion[:, 5]).max()
    other = near_libration_point(scene, "axial", point, southern=True)
    assert_allclose(other.y0, seed.y0 * [1, 1, -1, 1, 1, -1])


def test_the_default_mirror_suits_the_plane_and_space():
    flat = scenes.restricted_three_body()
    assert orbits.closing.mirror(flat) == orbits.closing.mirror(flat, "x")
    assert orbits.closing.mirror(space()) == orbits.closing.mirror(space(), "xz")


#: Frequencies of the short and the long oscillation about L4 of the Earth and the Moon.
TURNS = {"short period": 0.9545, "long period": 0.2982}


@pytest.mark.slow
@pytest.mark.parametrize("family", ["short period", "long period", "vertical"])
@pytest.mark.parametrize("point", ["L4", "L5"])
def test_small_orbits_about_the_triangular_points_are_those_of_the_linear_modes(family, point):
    scene = space("")
    seed = near_libration_point(scene, family, point, amplitude=1e-3)
    modes = jaxdyn.vibration.modes(scene, scenes.libration_point(scene, point))
    turn = TURNS.get(family, 1.0)
    assert_allclose(min(modes.damped_frequencies, key=lambda w: abs(w - turn)), turn, atol=1e-4)
    assert_allclose(2 * np.pi / seed.period, turn, atol=1e-4)
    hold = "z" if family == "vertical" else "x"
    orbit = orbits.find(scene, seed.y0, seed.period, hold=hold)
    assert_allclose(orbit.period, seed.period, rtol=1e-5)
    assert orbit.shift < 1e-5
    motion = np.asarray(jaxdyn.simulate(orbit.scene).ys)
    assert np.abs(motion - np.asarray(scenes.libration_point(scene, point))[None]).max() < 3e-3


@pytest.mark.slow
@pytest.mark.parametrize("system", ["earth-moon", "sun-earth", "saturn-enceladus"])
@pytest.mark.parametrize(("family", "hold"), [("vertical", "z"), ("short period", "x")])
@pytest.mark.parametrize("point", ["L4", "L5"])
def test_orbits_about_the_triangular_points_of_small_bodies_are_found(system, family, hold, point):
    # There the frequency of the short period is nearly the vertical one and that of the two bodies.
    scene = space(system)
    units, time = np.asarray(scene.system.units), float(scene.system.time)
    amplitude = 0.02 * float(units[0])
    seed = near_libration_point(scene, family, point, amplitude=amplitude)
    orbit = orbits.find(scene, seed.y0, seed.period, hold=hold)
    assert np.abs((np.asarray(orbit.y0) - seed.y0) / units).max() < 1e-4
    assert_allclose(orbit.period, seed.period, rtol=1e-4)
    start = np.asarray(orbit.y0) / units
    rate = jax.jit(restricted)
    motion = solve_ivp(
        lambda t, y: np.asarray(rate(t, y, float(scene.system.mu))),
        (0.0, orbit.period / time),
        start,
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    assert_allclose(motion.y[:, -1], start, rtol=0, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize(("family", "hold"), [("vertical", "z"), ("long period", "x")])
def test_guesses_about_the_triangular_points_are_of_second_order(family, hold):
    scene, off = space(""), []
    for amplitude in (0.02, 0.01):
        seed = near_libration_point(scene, family, "L5", amplitude=amplitude)
        orbit = orbits.find(scene, seed.y0, seed.period, hold=hold)
        off.append(np.abs(np.asarray(orbit.y0) - seed.y0).max())
    assert off[0] > 6.5 * off[1]  # of third order: 8


@pytest.mark.slow
@pytest.mark.parametrize(("turns", "per"), [(2, 1), (3, 1), (1, 2), (3, 2)])
@pytest.mark.parametrize("towards", [True, False])
def test_resonant_orbits_turn_as_often_as_they_should(turns, per, towards):
    mu = 1e-5
    flat = scenes.restricted_three_body(mu=mu)
    seed = resonant(flat, turns, per, eccentricity=0.1, towards=towards)
    mirror = orbits.closing.mirror(flat)
    orbit = orbits.find(flat, seed.y0, seed.period, closing=mirror, hold="x")
    assert_allclose(orbit.period, 2 * np.pi * per, rtol=5e-3)
    motion = jaxdyn.simulate(orbit.scene, samples=2001)
    x, y = np.asarray(motion["x"]) + mu, np.asarray(motion["y"])
    turned = np.unwrap(np.arctan2(y, x))
    assert_allclose((turned[-1] - turned[0]) / (2 * np.pi), turns - per, atol=1e-9)
    r = np.hypot(x, y)
    assert_allclose(r[0], r.min(), rtol=1e-3)
    assert_allclose(r.max() / r.min(), 1.1 / 0.9, rtol=0.02)
    assert (x[0] > 0) == towards
    whole = resonant(space(), turns, per, eccentricity=0.1, towards=towards)
    days = float(space().system.time)
    assert_allclose(whole.period, 2 * np.pi * per * days)


@pytest.mark.slow
def test_stability_indices_are_those_of_the_pairs():
    _, orbit = found(space(""), "halo", "L1", "z")
    known = orbits.stability(orbit)
    first, second = known.indices
    values = sorted(known.nontrivial, key=abs)
    assert_allclose(first, 0.5 * (values[-1] + values[0]).real, rtol=1e-9)
    assert abs(second) < 1 < first
    assert_allclose(second, np.cos(2 * np.pi * known.exponents[-1]), rtol=1e-6)
    assert f"\n  indices      {first:.9g}, {second:.9g}" in repr(known)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: near_libration_point(space(), "hallo"), "family: expected one of"),
        (lambda: near_libration_point(space(), point="L6"), "point: expected one of"),
        (
            lambda: near_libration_point(space(), point="L4"),
            r"point: expected one of L1, L2 for halo orbits, got L4\. Near L4 are vertical, short",
        ),
        (lambda: near_libration_point(space(), "short period"), "point: expected one of L4, L5"),
        (
            lambda: near_libration_point(space(), "axial", amplitude=1e3),
            "amplitude: expected none for axial orbits",
        ),
        (
            lambda: near_libration_point(scenes.restricted_three_body(mu=0.1), "long period", "L4"),
            "mu: expected one of less than 0.0385",
        ),
        (lambda: resonant(space(), 2, 2), r"turns, per: expected .* got 2, 2\. Say 1, 1"),
        (lambda: resonant(space(), 2, 1, eccentricity=1.0), "eccentricity: expected at least 0"),
        (lambda: resonant(scenes.pendulum(), 2, 1), "scene: expected a restricted"),
        (lambda: near_libration_point(space(), amplitude=0.0), "amplitude: expected > 0"),
        (
            lambda: near_libration_point(space(), amplitude=1e9),
            "amplitude: expected less than the distance of the two bodies",
        ),
        (
            lambda: near_libration_point(space(""), amplitude=0.9),
            "amplitude: expected one for which the series has a period > 0, got 0.9. Begin with",
        ),
        (
            lambda: near_libration_point(scenes.restricted_three_body(), "vertical"),
            "family: expected a planar one",
        ),
        (lambda: near_libration_point(scenes.pendulum()), "scene: expected a restricted"),
        (lambda: orbits.closing.mirror(space(), "xyz"), "across: expected fewer than all"),
        (lambda: orbits.closing.mirror(space(), "w"), "across: expected fewer than all"),
    ],
)
def test_misuse_is_refused_with_what_to_do(call, said):
    with pytest.raises(ValueError, match=said):
        call()
