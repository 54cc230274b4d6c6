"""Tori of scenes with damping: closed forms, long motions by SciPy, resonances, families, files."""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import gap, refusal
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from orbits.tori import circle
from orbits.tori.torus import HasAmplitude, Torus, TorusOutcome, refine

OWN, SHIFT = math.sqrt(2), 0.3


def cycle_at(u, mu):
    """A limit cycle of radius sqrt(mu) with angular frequency sqrt(2) + 0.3 mu."""
    r, w = u[0] ** 2 + u[1] ** 2, OWN + SHIFT * (u[0] ** 2 + u[1] ** 2)
    return jnp.stack([(mu - r) * u[0] - w * u[1], (mu - r) * u[1] + w * u[0]])


def assert_exact(found, x, v, mu):
    assert np.abs(x * x + v * v - mu).max() < 1e-10
    assert abs(found.time - 2 * math.pi) < 1e-10
    turns = (OWN + SHIFT * mu) * found.time
    off = [(turns - sign * found.rotation) / (2 * math.pi) for sign in (1, -1)]
    assert min(abs(x - round(x)) for x in off) < 1e-11
    assert float(found.scene.system.params) == found.parameter


# ---- This oscillator as seen from a place that moves, in bent coordinates


def to_moving(t, y):
    x = y[0] - jnp.cos(t)
    return x, y[1] - 0.2 * x**2 - jnp.sin(t)


def moving_rate(t, y, mu):
    x, v = to_moving(t, y)
    dx, dv = cycle_at((x, v), mu)
    return [dx - jnp.sin(t), dv + 0.4 * x * dx + jnp.cos(t)]


def seen_from_moving(mu):
    return jaxdyn.ode(moving_rate, [1.0, 0.0], 2 * math.pi, params=mu)


@pytest.fixture(scope="module")
def birth():
    """The torus point at which the oscillator begins to move."""
    rest = orbits.find(seen_from_moving(-0.1), period=2 * math.pi)
    family = orbits.continue_family(
        rest, seen_from_moving, -0.1, members=9, step=0.2, within=(-0.1, 0.1)
    )
    (point,) = family.special
    return point


def own_coordinates(found):
    return to_moving(0.0, found.points.T)


def test_the_parameter_of_a_driven_circle_is_found_with_it():
    n = 13
    turns = 0.2 * np.exp(1j * circle.angles(n))
    points = np.stack([1 + turns.real, turns.imag], axis=1)
    guess = Torus(
        scene=seen_from_moving(0.0),
        points=points,
        time=2 * math.pi,
        rotation=2 * math.pi * OWN,
        amplitude=0.2,
        energy=math.nan,
        error=math.nan,
        outcome=TorusOutcome.NO_CONVERGENCE,
        held="drive",
        rtol=1e-12,
        parameter=0.05,
        make=seen_from_moving,
    )
    w = np.array([1.0, -1j]) / math.sqrt(2)
    found = refine(guess, guess.unknowns, w, HasAmplitude(0.3), goal=1e-10, max_modes=20)
    assert found.ok
    assert found.parameter == pytest.approx(0.045, rel=0.01)
    assert_exact(found, *own_coordinates(found), found.parameter)
    # Radii have the rate (mu - r^2) r, whose slope on the circle is -2 mu.
    assert gap(found.moduli, np.exp([-2 * found.parameter * found.time])) < 1e-10
    lost = dataclasses.replace(found, outcome=TorusOutcome.NO_CONVERGENCE)
    assert np.isnan(lost.moduli).all()


@pytest.mark.slow
def test_a_driven_torus_has_the_closed_form_of_its_parameter_and_rotation(birth):
    found = orbits.torus(birth, 0.2)
    assert found.ok
    assert found.parameter > 0.01
    assert_exact(found, *own_coordinates(found), found.parameter)
    there = orbits.torus(birth, 0.2, parameter=0.04)
    assert there.parameter == pytest.approx(0.04, abs=1e-15)
    assert_exact(there, *own_coordinates(there), 0.04)
    again = orbits.torus(birth, 0.2, rotation=there.rotation)
    assert abs(again.parameter - 0.04) < 1e-11


@pytest.mark.slow
def test_a_family_of_tori_goes_along_the_parameter_to_its_bound(birth, tmp_path):
    first, path = orbits.torus(birth, 0.1), tmp_path / "tori.jsonl"
    family = orbits.continue_tori(first, within=(0.0, 0.02), path=path)
    assert family.end == "the bounds (0.0, 0.02)"
    assert family.parameters[-1] == pytest.approx(0.02, abs=1e-12)
    assert (np.diff(family.parameters) > 0).all()
    for member in family.members:
        assert_exact(member, *own_coordinates(member), member.parameter)
    read = orbits.continue_tori(first, within=(0.0, 0.02), path=path).members[-1]
    np.testing.assert_array_equal(read.points, family.members[-1].points)
    assert float(read.scene.system.params) == read.parameter
    back = orbits.continue_tori(family.members[-1], members=3, step=-0.05)
    assert (np.diff(back.parameters) < 0).all()
    assert_exact(back.members[-1], *own_coordinates(back.members[-1]), back.parameters[-1])


# ---- This oscillator beside one with a limit cycle of radius and frequency 1, in bent coordinates


def bent(u):
    x, v, p, q = u
    x = x + 0.3 * p * v
    return jnp.stack([x, v + 0.2 * x * x + 0.1 * p, p + 0.2 * q * q, q])


def straight(y):
    x, v, p, q = y
    p = p - 0.2 * q * q
    v = v - 0.2 * x * x - 0.1 * p
    return jnp.stack([x - 0.3 * p * v, v, p, q])


def bent_rate(t, y, mu):
    del t
    u = straight(y)
    p, q = u[2:]
    s = p * p + q * q
    rate = jnp.append(cycle_at(u, mu), jnp.stack([(1 - s) * p - q, (1 - s) * q + p]))
    return jax.jvp(bent, (u,), (rate,))[1]


def two_cycles(mu):
    return jaxdyn.ode(bent_rate, [0.0, 0.1, 1.0, 0.0], 6.28, params=mu)


@pytest.mark.slow
def test_a_torus_about_a_cycle_has_the_closed_form_of_its_parameter_and_rotation():
    cycle = orbits.find(two_cycles(-0.1))
    found = orbits.continue_family(cycle, two_cycles, -0.1, members=9, within=(-0.1, 0.1))
    first = orbits.torus(found.special[0], 0.2)
    assert not first.held
    for member in orbits.continue_tori(first, members=4).members:
        x, v, p, q = jax.vmap(straight)(jnp.asarray(member.points)).T
        assert_exact(member, x, v, member.parameter)
        assert np.abs(p * p + q * q - 1).max() < 1e-10
        slopes = np.array([2 * member.parameter, 2.0])
        assert gap(member.moduli, np.exp(-slopes * member.time)) < 1e-10


# ---- A van der Pol oscillator that is driven so strongly that its own vibration just begins

FORCE = 8.0


def driven(t, y, c):
    return [y[1], 0.4 * (1 - y[0] ** 2) * y[1] - y[0] + c[0] * jnp.cos(c[1] * t)]


def at_frequency(w):
    return jaxdyn.ode(driven, [0.0, 0.0], 2 * math.pi / 2.5, params=[FORCE, w])


def sampled(w, start, returns, each):
    """(returns, each, 2) states of a motion at evenly spaced times, by SciPy."""

    def rate(t, y):
        x, v = y
        return [v, 0.4 * (1 - x * x) * v - x + FORCE * math.cos(w * t)]

    ts = 2 * math.pi / w / each * np.arange(returns * each)
    run = solve_ivp(rate, (0.0, ts[-1]), start, method="DOP853", t_eval=ts, rtol=3e-14, atol=1e-14)
    return run.y.T.reshape(returns, each, 2)


def strobed(w, start, returns):
    """(returns + 1, 2) stroboscopic points of a motion, by SciPy."""
    return sampled(w, start, returns + 1, 1)[:, 0]


def average(values):
    """The weighted Birkhoff mean of a sequence."""
    s = (np.arange(len(values)) + 0.5) / len(values)
    weights = np.exp(-1 / (s * (1 - s)))
    return float(weights @ values / weights.sum())


def rotation_number(points, centre):
    """Mean angle between successive points about a centre [turns]."""
    x, y = (points - centre).T
    return average(np.diff(np.unwrap(np.arctan2(y, x)))) / (2 * math.pi)


@functools.cache
def onset():
    """The torus point of the forced response."""
    response = orbits.find(at_frequency(2.5))
    family = orbits.continue_family(response, at_frequency, 2.5, members=20, within=(2.4, 2.7))
    (point,) = family.special
    return point


@pytest.mark.slow
def test_a_torus_of_a_driven_scene_is_that_of_motions_by_scipy():
    found = orbits.torus(onset(), 0.3)
    assert found.held == "drive"
    assert abs(found.time * found.parameter - 2 * math.pi) < 1e-13
    assert found.error < 1e-11
    returns = 40
    motion = strobed(found.parameter, found.points[0], returns)
    assert gap(motion, found.at(found.rotation * np.arange(returns + 1))) < 1e-10


@pytest.mark.slow
def test_the_rotation_of_a_large_torus_is_that_of_a_long_motion():
    found = orbits.torus(onset(), 0.8, parameter=2.65)
    fine = sampled(2.65, found.points[0], 3001, 16)
    motion = fine[:, 0]
    # The motion returns to the torus by itself, with an error of its phase alone.
    assert gap(motion, found.at(found.rotation * np.arange(3001))) < 1e-9
    own = rotation_number(motion, found.points.mean(axis=0)) % 1.0
    turn = found.rotation / (2 * math.pi) % 1.0
    assert min(abs(own - turn), abs(1 - own - turn)) < 1e-11
    # The modulus is that of areas, by the mean divergence of the rate.
    mean = average((0.4 * (1 - fine[..., 0] ** 2)).mean(axis=1))
    assert gap(found.moduli, np.exp([found.time * mean])) < 1e-9
    # It is approached by motions that begin beside it.
    beside = strobed(2.65, found.points[0] + 0.1, 200)[-1]
    angles = 2 * np.pi * np.arange(20000) / 20000
    assert np.linalg.norm(found.at(angles) - beside, axis=1).min() < 1e-3


@pytest.mark.slow
def test_a_family_of_tori_ends_where_motions_lock():
    first = orbits.torus(onset(), 1.4, parameter=2.745, max_modes=80)
    family = orbits.continue_tori(first, members=20, step=0.04, max_modes=80)
    assert family.end.startswith("RESONANT")
    assert family.end.endswith("It is 1:3.")
    last = family.members[-1]
    assert last.resonance == "1:3"
    assert TorusOutcome.RESONANT.message in family.end
    # Near the edge, a fold of orbits of three periods, the distance to 1:3 is a square root.
    before, (p, q) = family.members[-3], (last.parameter, last.rotation / (2 * math.pi) - 1 / 3)
    slope = (q**2 - (before.rotation / (2 * math.pi) - 1 / 3) ** 2) / (p - before.parameter)
    edge = p - q**2 / slope
    locked, free = (strobed(edge + off, last.points[0], 303) for off in (0.005, -0.005))
    assert gap(locked[-1], locked[-4]) < 1e-5
    assert gap(locked[-1], locked[-2]) > 0.1
    assert gap(free[-1], free[-4]) > 1e-3


# ---- Misuse


@pytest.mark.slow
def test_misuse_is_refused(birth):
    cycle = birth.orbit
    family = orbits.continue_family(cycle, seen_from_moving, birth.parameter, members=2)
    ordinary = family.members[1]
    for call, message in [
        (lambda: orbits.torus(ordinary, 0.1), "orbit: expected an orbit, or a torus point"),
        (lambda: orbits.torus(cycle, 0.1, parameter=0.1), "parameter: expected the parameter of"),
        (
            lambda: orbits.torus(birth, 0.1, parameter=0.1, rotation=1.0),
            "parameter: expected the parameter of",
        ),
        (
            lambda: orbits.continue_tori(orbits.torus(birth, 0.1), within=(1.0, 2.0)),
            "within: expected bounds around the parameter",
        ),
    ]:
        assert refusal(call).startswith(message)
