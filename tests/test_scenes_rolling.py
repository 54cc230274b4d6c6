"""Cylinders that roll, slip, fly and land: what the course asks and the real chain."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import energy, simulate
from jaxdyn.phases import run
from jaxdyn.scenes.rolling import (
    contact_lost,
    cylinder_on_cylinder,
    cylinder_on_ramp,
    friction_needed,
    phases_of,
)

G, R, SMALL = 9.81, 1.0, 0.5
FAR = R + SMALL
BALANCED = cylinder_on_cylinder(g=G, r=SMALL, fixed=R, theta=0.3, mu=0.4)
RAMP = cylinder_on_ramp()


def on_top(theta, start):
    """The rolling state at an angle, after a start from rest at another, by energy alone."""
    rate = np.sqrt(4 * G / (3 * FAR) * (np.cos(start) - np.cos(theta)))
    s, c = np.sin(theta), np.cos(theta)
    spin = rate * FAR / SMALL
    return jnp.array([FAR * s, FAR * c, 0.7, FAR * rate * c, -FAR * rate * s, spin])


@pytest.fixture(scope="module")
def fall():
    return run(phases_of(BALANCED), "roll", BALANCED.y0, 1.5, samples=9)


@pytest.fixture(scope="module")
def hops():
    return run(phases_of(RAMP), "roll", RAMP.y0, 7.0, samples=9)


def test_a_cylinder_on_a_cylinder_is_a_pendulum_with_two_thirds_of_gravity():
    for theta in (0.1, 0.5, 0.9):
        y = on_top(theta, 0.1)
        a = BALANCED.rate(0.0, y)[3:]
        theta_2 = (a[0] * np.cos(theta) - a[1] * np.sin(theta)) / FAR
        assert abs(theta_2 - 2 * G * np.sin(theta) / (3 * FAR)) < 10 * EXACT
        assert abs(a[2] * SMALL - theta_2 * FAR) < 10 * EXACT


@pytest.mark.slow
def test_it_loses_contact_where_the_closed_form_says():
    stop = contact_lost(BALANCED, 5.0)
    # From rest at the top cos = 4/7; from another angle 4/7 of its cosine.
    assert abs(stop.y[1] / FAR - 4 / 7 * np.cos(0.3)) < 1e-10
    # A pendulum's time by quadrature, in u = sqrt(cos a - cos b) to lift the root at the start.
    nodes, weights = np.polynomial.legendre.leggauss(60)
    u = 0.5 * np.sqrt(3 / 7 * np.cos(0.3)) * (1 + nodes)
    sine = np.sqrt(1 - (np.cos(0.3) - u * u) ** 2)
    time = np.sum(weights * 0.5 * np.sqrt(3 / 7 * np.cos(0.3)) * 2 / sine)
    assert abs(stop.t - time * np.sqrt(3 * FAR / (4 * G))) < 1e-10


def test_the_friction_that_rolling_needs_grows_without_bound():
    for theta in (0.1, 0.5, 0.9):
        needed = np.sin(theta) / (7 * np.cos(theta) - 4)
        assert abs(friction_needed(BALANCED, on_top(theta, 0.0)) - needed) < 10 * EXACT
    assert friction_needed(BALANCED, on_top(np.arccos(4 / 7) - 1e-9, 0.0)) > 1e7


@pytest.mark.slow
def test_a_real_cylinder_slips_before_it_flies(fall):
    assert fall.names == ("roll", "slip_on", "fly")
    roll, slip, fly = fall.pieces
    # It grips until sin = mu (7 cos - 4 cos(start)).
    x, y = roll.ys[-1, :2] / FAR
    assert abs(x - 0.4 * (7 * y - 4 * np.cos(0.3))) < 1e-9
    # It flies where gravity no longer bends its path enough: v^2 = g (R + r) cos.
    v = slip.ys[-1, 3:5]
    assert abs(jnp.sum(v * v) - G * slip.ys[-1, 1]) < 1e-9
    # Higher up than the ideal one, since slipping spares it some of its spin.
    assert slip.ys[-1, 1] / FAR > 4 / 7 * np.cos(0.3)
    assert (jax.vmap(slip.scene.system.slip)(slip.ys[1:]) > 0).all()
    heights = jax.vmap(fly.scene.system.height)(fly.ys)
    assert (np.diff(heights) > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fall", "hops"])
def test_every_chain_keeps_to_the_laws_of_contact(name, request):
    chain = request.getfixturevalue(name)
    mu = chain.pieces[0].scene.system.mu
    last = np.inf
    for phase, piece in zip(chain.names, chain.pieces, strict=True):
        system, effects = piece.scene.system, piece.scene.effects
        ts, ys = piece.ts, piece.ys
        total = energy.along(energy.energy, piece)
        assert total[0] <= last + 1e-8
        last = total[-1]
        height = jax.vmap(system.height)(ys)
        if phase == "fly":
            assert gap(total, np.full(9, total[0])) < 1e-10
            assert (height > -2e-12).all()  # a landing is seen 1e-12 of the radius deep
            continue
        both = [system.reaction(t, y, effects) for t, y in zip(ts, ys, strict=True)]
        normal, friction = np.asarray(both).T
        assert gap(height, np.zeros(9)) < 1e-12
        assert (normal > -1e-8).all()
        assert (np.abs(friction) <= mu * normal + 1e-7).all()
        if phase == "roll":
            assert gap(total, np.full(9, total[0])) < 1e-8
        else:
            assert (np.diff(total) < 1e-9).all()


@pytest.mark.slow
def test_on_a_ramp_it_slips_flies_lands_and_rolls_on(hops):
    assert hops.names[:6] == ("roll", "slip_on", "roll", "slip_back", "fly", "roll")
    # The landing: from a normal speed to none.
    fly, after = hops.pieces[4:6]
    off = jax.jvp(fly.scene.system.height, (fly.ys[-1],), (fly.scene.rate(0.0, fly.ys[-1]),))[1]
    assert off < -0.1
    assert abs(after.scene.system.slip(after.ys[0])) < 1e-12


def test_a_landing_with_all_friction_keeps_the_moment_about_the_contact():
    system = cylinder_on_ramp(slope=0.0, d=0.5, mu=100.0).system
    y = jnp.array([0.3, 1.0 + 0.5 * np.cos(0.7), 0.7, 1.0, -2.0, 0.4])
    y = y.at[0].set(0.5 * np.sin(0.7))  # centre over the origin, where it touches
    after = system.landed(y)

    def moment(y):
        return y[0] * y[4] - y[1] * y[3] - 0.4 * y[5]

    assert abs(moment(after) - moment(y)) < 10 * EXACT
    assert abs(system.slip(after)) < 10 * EXACT
    smooth = cylinder_on_ramp(slope=0.0, d=0.5, mu=0.0).system.landed(y)
    assert smooth[3] == y[3]  # nothing along the ground


def test_a_balanced_cylinder_on_a_ramp_rolls_uniformly():
    slope = 0.3
    scene = cylinder_on_ramp(d=0.0, m=2.0, r=0.5, inertia=0.25, slope=slope, g=G)
    a = scene.rate(0.0, scene.y0)
    # alpha = g sin / (r (1 + I / m r^2)), friction needed tan / (1 + m r^2 / I).
    assert abs(a[5] - G * np.sin(slope) / (0.5 * 1.5)) < 10 * EXACT
    assert abs(friction_needed(scene, scene.y0) - np.tan(slope) / 3) < EXACT


def test_an_eccentric_one_follows_its_equation():
    d, inertia, slope, m = 0.5, 0.4, 0.2, 1.0
    scene = cylinder_on_ramp(d=d, inertia=inertia, slope=slope, m=m, g=G, turn=0.8, spin=2.0)
    psi, w = 0.8, 2.0
    s, c = np.sin(psi), np.cos(psi)
    # From L = (m (1 + d^2 + 2 d cos psi) + I) w^2 / 2 + m g (sin(slope) (psi + d s) - ...).
    push = m * G * (np.sin(slope) * (1 + d * c) + np.cos(slope) * d * s) + m * d * s * w * w
    alpha = push / (m * (1 + d * d + 2 * d * c) + inertia)
    assert abs(scene.rate(0.0, scene.y0)[5] - alpha) < 10 * EXACT
    normal = m * (G * np.cos(slope) - d * s * alpha - d * c * w * w)
    friction = m * ((1 + d * c) * alpha - d * s * w * w - G * np.sin(slope))
    assert gap(scene.system.reaction(0.0, scene.y0, scene.effects), [normal, friction]) < 1e-13
    assert abs(friction_needed(scene, scene.y0) - abs(friction) / normal) < 1e-13


@pytest.mark.parametrize(
    ("scene", "enters"),
    [(RAMP, True), (cylinder_on_ramp(slope=0.4, d=0.7), False)],
    ids=["past the top", "before the top"],
)
@pytest.mark.slow
def test_where_ideal_rolling_has_no_normal_force_it_still_needs_friction(scene, enters):
    stop = contact_lost(scene, 9.0)
    normal, friction = scene.system.reaction(0.0, stop.y, scene.effects)
    assert abs(normal) < SOLVED
    assert abs(friction) > 0.05
    assert abs(friction_needed(scene, stop.y)) > 1e9
    # How the centre would leave the ramp, once nothing holds the cylinder.
    free = scene.system.touching("fly")

    def rising(y):
        return jax.jvp(free.height, (y,), (free.rate(0.0, y, scene.effects),))[1]

    leaves = jax.jvp(rising, (stop.y,), (free.rate(0.0, stop.y, scene.effects),))[1]
    assert (leaves < -0.01) == enters
    d, slope, psi = scene.system.d, scene.system.slope, stop.y[2] - scene.system.slope
    by_hand = d * jnp.sin(psi) * (1 + d * jnp.cos(psi)) * friction / 0.4
    assert abs(leaves - by_hand) < 1e-10
    assert (jnp.sin(psi) > 0) == enters
    # The way it rolled is the turn times the radius; energy gives the speed there.
    rolled = stop.y[2] - scene.y0[2]
    centre = stop.y[:2] - d * jnp.stack([jnp.sin(stop.y[2]), jnp.cos(stop.y[2])])
    start = jnp.stack([jnp.sin(slope), jnp.cos(slope)])
    assert abs(jnp.linalg.norm(centre - start) - rolled) < 1e-9
    change = energy.energy(scene, 0.0, stop.y) - energy.energy(scene, 0.0, scene.y0)
    assert abs(change) < 1e-9


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"d": 1.0}, r"d: expected from 0 to below the radius, got 1\.0"),
        ({"slope": 1.6}, r"slope: expected below 90 degrees, got 1\.6"),
        ({"mu": -0.1}, r"mu: expected >= 0, got -0\.1"),
        ({"m": 0.0}, r"mass: expected > 0, got 0\.0"),
        ({"inertia": -1.0}, r"inertia: expected > 0, got -1\.0"),
        ({"r": -1.0}, r"r: expected > 0, got -1\.0"),
    ],
)
def test_impossible_cylinders_are_refused(kwargs, message):
    with pytest.raises(ValueError, match=message):
        simulate(cylinder_on_ramp(**kwargs))


def test_an_impossible_support_is_refused():
    with pytest.raises(ValueError, match=r"fixed: expected > 0, got 0\.0"):
        simulate(cylinder_on_cylinder(fixed=0.0))
