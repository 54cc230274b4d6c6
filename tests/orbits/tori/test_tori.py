"""Invariant tori: a closed form, frequency analysis of long motions, families, failures."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import gap, refusal
from odes import jacobi, restricted
from PIL import Image
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import chaos, scenes
from orbits import drawing
from orbits.discovery.libration import near_libration_point
from orbits.tori import circle
from orbits.tori.torus import TorusOutcome

PERIOD = 2 * math.pi / 60
MOON = scenes.restricted.SYSTEMS["earth-moon"].mu


def two_oscillators(t, y):
    """A harmonic oscillator and a pendulum, which know nothing of each other."""
    del t
    return [y[2], y[3], -y[0], -2 * jnp.sin(y[1])]


def their_energy(t, y):
    del t
    return 0.5 * (y[2] ** 2 + y[3] ** 2 + y[0] ** 2) - 2 * jnp.cos(y[1])


def henon_heiles(t, q, v):
    del t
    well = 0.5 * (q[0] ** 2 + q[1] ** 2) + q[0] ** 2 * q[1] - q[1] ** 3 / 3
    return 0.5 * (v[0] ** 2 + v[1] ** 2) - well


@pytest.fixture(scope="module")
def swing():
    """The upright rest of a stick on a shaken base."""
    return orbits.find(scenes.shaken_pendulum(angle=0.0), period=PERIOD)


@pytest.fixture(scope="module")
def loop():
    """A stable orbit in Henon and Heiles's potential."""
    speed = math.sqrt(2 * 0.1 - 0.3**2 + 2 * 0.3**3 / 3)
    scene = jaxdyn.lagrangian(henon_heiles, [0.0, 0.3], [speed, 0.0])
    return orbits.find(scene, period=6.0, hold=orbits.Energy(0.1))


def test_curves_are_interpolated_rotated_and_differentiated_exactly():
    def curve(x):
        return np.stack([1 + np.cos(x) - 0.3 * np.sin(4 * x), np.sin(2 * x)], axis=1)

    points, x = curve(circle.angles(9)), np.array([0.1, 2.0, -7.0])
    values, slopes = circle.rotation(9, x)
    assert gap(values @ points, curve(x)) < 1e-14
    exact = np.stack([-np.sin(x) - 1.2 * np.cos(4 * x), 2 * np.cos(2 * x)], axis=1)
    assert gap(slopes @ points, exact) < 1e-13
    assert gap(circle.resample(points, 15), curve(circle.angles(15))) < 1e-14
    assert gap(circle.harmonic(points), np.array([1.0, 0.0])) < 1e-15


def test_a_torus_of_two_oscillators_has_the_closed_form_of_its_rotation():
    scene = jaxdyn.ode(two_oscillators, [1.0, 0.0, 0.0, 0.0], energy=their_energy)
    orbit = orbits.find(scene, period=2 * math.pi)
    found = orbits.torus(orbit, 0.8)
    assert found.error < 1e-11
    assert abs(found.time - 2 * math.pi) < 1e-11
    _, q, _, v = found.points.T
    energy = 0.5 * v**2 + 2 - 2 * np.cos(q)
    assert np.ptp(energy) < 1e-11
    own = math.pi / 2 * math.sqrt(2) / ellipk(energy[0] / 4)
    turns = (own * found.time - found.rotation) / (2 * math.pi)
    back = (own * found.time + found.rotation) / (2 * math.pi)
    assert min(abs(x - round(x)) for x in (turns, back)) < 1e-11
    assert abs(found.energy + 1.5) < 1e-12  # that of the orbit


def _compared(found: orbits.tori.Torus, returns: int, entry: int) -> tuple[float, float]:
    """Distance of a simulated motion from the torus, and its own rotation from the torus's."""
    span = returns * found.time
    scene = found.scene.starting(found.points[0])
    motion = np.asarray(jaxdyn.simulate(scene, span, samples=returns + 1, rtol=1e-13).ys)
    theta = found.rotation * np.arange(returns + 1)
    rotation = found.rotation % (2 * math.pi)
    own = chaos.frequencies(motion[:, entry], dt=1.0, count=6).frequencies
    expected = min(rotation, 2 * math.pi - rotation)
    return gap(motion, found.at(theta)), float(np.abs(own - expected).min())


@pytest.mark.slow
def test_a_driven_torus_is_that_of_long_motions(swing):
    found = orbits.torus(swing, 1.0)
    assert found.ok
    assert found.held == "drive"
    assert found.time == swing.period
    assert found.error < 1e-11
    distance, rotation = _compared(found, 1000, 0)
    assert distance < 1e-9
    assert rotation < 1e-10
    assert "TorusOutcome" not in repr(found)
    assert "FOUND" in repr(found)


@pytest.mark.slow
def test_an_autonomous_torus_is_that_of_long_motions(loop):
    found = orbits.torus(loop, 0.05)
    assert found.held == "energy"
    assert abs(found.energy - 0.1) < 1e-12
    assert found.error < 1e-11
    distance, rotation = _compared(found, 1000, 1)
    assert distance < 1e-9
    assert rotation < 1e-9


@pytest.mark.slow
def test_small_tori_have_the_rotation_of_the_multipliers(swing):
    (nu,) = {x for x in orbits.stability(swing).exponents if x is not None}
    found = [orbits.torus(swing, a).rotation for a in (0.05, 0.1)]
    off = [abs(x - 2 * math.pi * nu) for x in found]
    assert off[0] < 1e-4
    assert abs(off[1] / off[0] - 4) < 0.05  # quadratic in the amplitude


@pytest.mark.slow
def test_a_rotation_can_be_asked_for(swing):
    found = orbits.torus(swing, 1.0, rotation=0.53)
    assert found.ok
    assert abs(found.rotation - 0.53) < 1e-14
    again = orbits.torus(swing, found.amplitude)
    assert abs(again.rotation - 0.53) < 1e-3


@pytest.mark.slow
def test_a_family_of_tori_grows_from_the_orbit(loop):
    family = orbits.continue_tori(orbits.torus(loop, 0.05), members=4)
    assert len(family.members) == 4
    assert all(torus.ok and torus.error < 1e-11 for torus in family.members)
    assert (np.diff(family.amplitudes) > 0).all()
    assert gap(np.array([torus.energy for torus in family.members]), np.full(4, 0.1)) < 1e-12
    # A member found from the orbit itself: another route to the same torus.
    other = orbits.torus(loop, 0.1, rotation=float(family.rotations[2]))
    assert abs(other.time - family.times[2]) < 1e-9
    assert "4 tori" in repr(family)
    back = orbits.continue_tori(family.members[1], members=2, step=-0.01)
    assert back.amplitudes[1] < back.amplitudes[0]


def test_an_interrupted_family_of_tori_goes_on_from_its_file(swing, tmp_path, monkeypatch):
    first, path = orbits.torus(swing, 0.1), tmp_path / "tori.jsonl"
    whole = orbits.continue_tori(first, members=4)
    orbits.continue_tori(first, members=3, path=path)
    made = []

    def counted(*args, **options):
        made.append(args)
        return refine(*args, **options)

    refine = orbits.tori.continuation.refine
    monkeypatch.setattr(orbits.tori.continuation, "refine", counted)
    again = orbits.continue_tori(first, members=4, path=path)
    assert len(made) == 1  # what the file has is not computed again
    assert again.end == whole.end
    for a, b in zip(again.members, whole.members, strict=True):
        np.testing.assert_array_equal(a.points, b.points)
        assert (a.rotation, a.error, a.outcome) == (b.rotation, b.error, b.outcome)
    # Another goal is another family.
    orbits.continue_tori(first, members=2, goal=1e-9, path=path)
    assert len(made) == 2


@pytest.mark.slow
def test_a_torus_that_is_not_found_has_an_outcome(swing, loop):
    coarse = orbits.torus(swing, 1.0, max_modes=6, throw=False)
    assert coarse.outcome == TorusOutcome.NOT_SMOOTH
    assert coarse.error > 1e-11
    with pytest.raises(orbits.SearchError, match="more Fourier modes"):
        orbits.torus(swing, 1.0, max_modes=6)
    gone = orbits.torus(loop, 3.0, throw=False)
    assert gone.outcome in (TorusOutcome.MOTION_ENDS, TorusOutcome.NO_CONVERGENCE)
    assert refusal(lambda: orbits.continue_tori(coarse)).startswith("torus: expected one")


@pytest.mark.slow
def test_a_rotation_that_no_torus_has_is_refused(swing):
    found = orbits.torus(swing, 0.05, rotation=0.7, throw=False)
    assert found.outcome == TorusOutcome.NO_CONVERGENCE
    with pytest.raises(orbits.SearchError, match="did not converge"):
        orbits.torus(swing, 0.05, rotation=0.7)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda o: orbits.torus(o, 0.0), "amplitude: expected > 0"),
        (lambda o: orbits.torus(o, 0.1, pair=1), "orbit: expected at least 2 pairs"),
        (lambda o: orbits.torus(o, 0.1, goal=-1.0), "goal: expected > 0"),
        (lambda o: orbits.torus(o, 0.1, max_modes=2), "max_modes: expected a whole number, at"),
        (lambda o: orbits.continue_tori(orbits.torus(o, 0.1), members=1), "members: expected"),
        (lambda o: orbits.continue_tori(orbits.torus(o, 0.1), step=0.0), "step: expected"),
        (
            lambda o: drawing.torus(orbits.torus(o, 0.1), entries=("x", "theta")),
            "entries: expected one of",
        ),
        (lambda o: drawing.torus(orbits.torus(o, 0.1), entries=("theta",)), "entries: expected tw"),
    ],
)
def test_misuse_is_refused(swing, call, message):
    assert refusal(lambda: call(swing)).startswith(message)


@pytest.mark.slow
def test_a_torus_is_drawn(swing, tmp_path):
    path = tmp_path / "torus.png"
    found = orbits.torus(swing, 0.1)
    figure = drawing.torus(found, path)
    assert 'src="data:image/png;base64,' in found._repr_html_()
    assert [figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()] == ["t", "theta [rad]"]
    with Image.open(path) as picture:
        assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 50


def test_a_small_curve_far_from_the_origin_keeps_its_digits():
    def curve(x):
        return 1 + 1e-3 * np.stack([np.cos(x), np.sin(2 * x)], axis=1)

    found = circle.resample(curve(circle.angles(97)), 121)
    assert gap(found, curve(circle.angles(121))) < 5e-16


@pytest.mark.slow
@pytest.mark.parametrize(("family", "point"), [("halo", "L1"), ("vertical", "L2")])
def test_tori_about_unstable_orbits_in_kilometres_and_days(family, point):
    # The flow stretches 1000 times in a return, which alone makes more than the goal of rounding.
    scene = scenes.restricted_three_body_in_space(system="earth-moon")
    seed = near_libration_point(scene, family, point)
    mirror = orbits.closing.mirror(scene)
    orbit = orbits.find(scene, seed.y0, seed.period, closing=mirror, hold="z")
    found = orbits.torus(orbit, 400.0)  # km
    assert found.error < 1e-10
    units, time, mu = (np.asarray(x) for x in (scene.system.units, scene.system.time, MOON))
    rate, theta = jax.jit(restricted), np.array([0.4, 2.0])
    starts, ends = found.at(theta) / units, found.at(theta + found.rotation) / units
    for start, end in zip(starts, ends, strict=True):
        motion = solve_ivp(
            lambda t, y: np.asarray(rate(t, y, mu)),
            (0.0, found.time / float(time)),
            start,
            method="DOP853",
            rtol=1e-13,
            atol=1e-14,
        )
        assert gap(motion.y[:, -1], end) < 3e-11


def _minus_half_jacobi(t, y, mu):
    return -0.5 * jacobi(t, y, mu)


@pytest.mark.slow
def test_tori_of_the_restricted_problem():
    mu = 0.01215  # Earth and Moon
    near = [0.52 - mu, math.sqrt(3) / 2, 0.0, 0.0]  # L4
    scene = jaxdyn.ode(restricted, near, 6.6, params=mu, energy=_minus_half_jacobi)
    orbit = orbits.find(scene)
    found = orbits.torus(orbit, 0.03)
    assert found.error < 1e-11
    distance, rotation = _compared(found, 500, 0)
    assert distance < 1e-9
    assert rotation < 1e-9


@pytest.mark.slow
def test_quasi_halo_orbits_about_an_unstable_halo_orbit():
    # Richardson's halo orbit of Earth and Moon, L1; the flow stretches 2000 times in a return.
    start = [0.823386, 0.0, 0.022285, 0.0, 0.134187, 0.0]
    mu = 0.01215058
    scene = jaxdyn.ode(restricted, start, 2.746, params=mu, energy=_minus_half_jacobi)
    orbit = orbits.find(scene, hold="y1")
    assert np.abs(orbits.stability(orbit).multipliers).max() > 2000
    family = orbits.continue_tori(orbits.torus(orbit, 0.001), members=7, step=0.002, goal=1e-10)
    assert len(family.members) == 7
    assert (np.diff(family.amplitudes) > 1e-4).all()
    assert (np.diff(family.rotations) < 0).all()
    last = family.members[-1]
    assert last.error < 1e-10
    assert np.abs(last.points[:, 2]).max() > 0.02
    assert abs(last.energy - family.members[0].energy) < 1e-12
    # More than any torus has: the orbit itself is invariant with each rotation.
    gone = orbits.torus(orbit, 0.001, rotation=0.15, throw=False)
    assert gone.outcome == TorusOutcome.COLLAPSED
    assert not gone.ok
