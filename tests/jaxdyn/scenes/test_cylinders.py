"""Cylinders that roll, slip, fly and land: what the course asks and the real chain."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap
from scipy.integrate import solve_ivp

from jaxdyn import Scene
from jaxdyn.analysis import energy
from jaxdyn.effects import UniformGravity
from jaxdyn.integrate.phases import simulate_phases
from jaxdyn.scenes.corners import phases_of
from jaxdyn.scenes.cylinders import (
    contact_lost,
    cylinder_on_cylinder,
    cylinder_on_ramp,
    friction_needed,
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
    return simulate_phases(phases_of(BALANCED), "roll", BALANCED.y0, 1.5, samples=9)


@pytest.fixture(scope="module")
def hops():
    return simulate_phases(phases_of(RAMP), "roll", RAMP.y0, 7.0, samples=9)


STARTS = {  # the scene, and the phases it has to go through
    "no friction": (cylinder_on_cylinder(mu=0.0), ("slip_on", "fly")),
    "little friction": (cylinder_on_cylinder(mu=0.02), ("slip_on", "fly")),
    "steep": (cylinder_on_cylinder(theta=1.2), ("slip_on", "fly")),
    "a tube": (cylinder_on_cylinder(inertia_ratio=1.0, mu=0.04), ("slip_on", "fly")),
    "eccentric": (cylinder_on_ramp(slope=0.5, mu=0.1, d=0.3), ("slip_on", "roll")),
}


@pytest.fixture(scope="module", params=STARTS)
def start(request):
    """A start that cannot roll, and what becomes of it."""
    scene, names = STARTS[request.param]
    return (
        scene,
        names,
        simulate_phases(phases_of(scene), None, scene.y0, 1.5, samples=9, rtol=1e-13),
    )


def coulomb(scene, t1):
    """A slide along t by equations of its own: the angle or way, turn, their rates, time at end.

    On a cylinder: theta of the line of centres, m L theta'' = m g sin - mu N, and
    N = m (g cos - L theta'^2). On a ramp: the way s of C, the turn psi of G from straight out, and
    m a_G = (m g sin + F, N - m g cos), I psi'' = N d sin psi - F (r + d cos psi), F = -mu N.
    """
    c = scene.system
    m, r, d, mu, slope = (float(x) for x in (c.m, c.r, c.d, c.mu, c.slope))
    inertia, far = float(c.inertia), float(c.fixed) + r

    def normal(y):
        q, turn, v, w = y
        if not c.flat:
            return m * (G * np.cos(q) - far * v * v)
        # The normal acceleration -d (sin psi psi'' + cos psi psi'^2) with psi'' from N alone.
        lever = d * np.sin(turn) + mu * (r + d * np.cos(turn))
        still = G * np.cos(slope) - d * np.cos(turn) * w * w
        return still / (1 / m + d * np.sin(turn) * lever / inertia)

    def rate(_, y):
        q, turn, v, w = y
        n = normal(y)
        if not c.flat:
            return [v, w, (G * np.sin(q) - mu * n / m) / far, mu * n * r / inertia]
        alpha = n * (d * np.sin(turn) + mu * (r + d * np.cos(turn))) / inertia
        along = G * np.sin(slope) - mu * n / m
        return [v, w, along - d * (np.cos(turn) * alpha - np.sin(turn) * w * w), alpha]

    def slip(y):
        return (1.0 if c.flat else far) * y[2] - r * y[3]

    def lifts(t, y):
        return normal(y)

    def sticks(t, y):
        return slip(y) if t > 1e-3 else 1.0

    for event in (lifts, sticks):
        event.terminal = True
    first = 0.0 if c.flat else np.arctan2(scene.y0[0], scene.y0[1])
    y0 = [first, float(scene.y0[2]) - slope, 0.0, 0.0]
    how = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "events": (lifts, sticks)}
    found = solve_ivp(rate, (0.0, t1), y0, **how)
    assert found.status == 1
    return found.y[:, -1], found.t[-1], slip(found.y[:, -1])


@pytest.mark.slow
def test_a_start_that_cannot_roll_slips_by_coulombs_law(start):
    scene, names, chain = start
    assert chain.names[:2] == names
    (q, turn, v, w), t, slip = coulomb(scene, 1.5)
    end, c = chain.pieces[0].ys[-1], scene.system
    assert abs(chain.times[0] - t) < 1e-9
    assert abs(end[5] - w) < 1e-9
    assert abs(end[2] - float(scene.y0[2]) - turn + 0.0) < 1e-9
    if c.flat:
        assert abs(c.with_contact("slip_on").slip(end)) < SOLVED
        assert abs(slip) < 1e-9
        return
    far = float(c.r + c.fixed)
    assert gap(end[:2], [far * np.sin(q), far * np.cos(q)]) < 1e-9
    assert gap(end[3:5], [far * v * np.cos(q), -far * v * np.sin(q)]) < 1e-9
    # Nothing pushes or holds it any more, and it leaves.
    heights = jax.vmap(c.height)(chain.pieces[1].ys)
    assert (np.diff(heights) > 0).all()


@pytest.mark.slow
def test_without_friction_it_leaves_at_two_thirds(start):
    scene, _, chain = start
    if scene.system.mu == 0:
        assert abs(chain.pieces[0].ys[-1, 1] / FAR - 2 / 3 * np.cos(0.1)) < SOLVED
        assert gap(chain.pieces[0].ys[:, 5], np.zeros(9)) == 0


@pytest.mark.slow
def test_the_first_phase_is_the_one_the_state_fits():
    scene = cylinder_on_ramp(d=0.0, inertia=0.5, slope=0.0, mu=0.3, spin=1.0)
    still = scene.y0
    fits = {
        "roll": still,
        "slip_on": still.at[5].add(-0.1),
        "slip_back": still.at[5].add(0.1),
        "fly": still.at[1].add(0.1),
    }
    phases = phases_of(scene)
    for name, y0 in fits.items():
        chain = simulate_phases(phases, None, y0, 1e-4, samples=2)
        assert chain.names == (name,)
        assert chain.path == ()
    # Coming down on the ground it has an impact first, and rolls or slips on.
    lands = simulate_phases(phases, None, still.at[4].set(-1.0), 1e-4, samples=2)
    assert lands.path == (("fly", 0),)
    assert lands.names == ("roll",)
    assert lands.y[4] == 0
    # Without gravity to press it down a rolling cylinder that is pulled up flies.
    lifted = Scene(scene.system, (UniformGravity(-1.0),), y0=still, t1=scene.t1)
    assert simulate_phases(phases_of(lifted), "roll", still, 1e-4, samples=2).names == ("fly",)
    with pytest.raises(
        ValueError, match=r"y0: expected a cylinder outside the ramp, got one 0\.1 m"
    ):
        simulate_phases(phases, None, still.at[1].add(-0.1), 1e-4)


@pytest.mark.slow
def test_a_velocity_that_is_rounding_of_another_is_no_reason_to_leave():
    # The projection of rolling leaves such a velocity off the surface.
    fly = phases_of(cylinder_on_ramp(d=0.0, slope=0.0))["fly"]
    for off, leaves in ((0.0, False), (-1.5e-33, False), (-1e-16, False), (-1e-12, True)):
        fit = fly.fit(jnp.zeros(()), jnp.array([0.0, 1.0, 0.0, 1.0, off, 1.0]))
        assert fit.leaving.tolist() == [leaves]
        assert not fit.passed.any()


@pytest.mark.slow
def test_friction_that_is_just_enough_goes_either_way():
    """At the limit of the cone rolling and slipping are one motion, and rounding decides."""
    inertia, slope = 0.42, 0.044
    just = np.tan(slope) / (1 + 1 / inertia)
    scene = cylinder_on_ramp(d=0.0, inertia=inertia, slope=slope, mu=just)
    chain = simulate_phases(phases_of(scene), None, scene.y0, 2.0, samples=2)
    assert chain.message == "The span ended."
    assert abs(chain.y[2] - scene.y0[2] - G * np.sin(slope) / (1 + inertia) * 2) < 1e-10
    # On a cylinder it needs more as soon as it moves.
    scene = cylinder_on_cylinder(theta=0.858, mu=np.tan(0.858) / 3)
    chain = simulate_phases(phases_of(scene), "roll", scene.y0, 2.0, samples=2)
    assert chain.names[-2:] == ("slip_on", "fly")
    assert len(chain.names) == 2 or chain.times[0] < 1e-6


@pytest.mark.slow
def test_a_slip_that_no_finite_force_goes_on_with_is_caught_at_once():
    """Painleve's paradox: slipping pulls it into the ground, flying drops it there; it jams."""
    scene = cylinder_on_ramp(d=0.9, inertia=0.01, slope=0.0, mu=3.0, turn=1.0)
    slides = scene.y0.at[3].set(-1.0)
    chain = simulate_phases(phases_of(scene), None, slides, 0.01, samples=2)
    assert chain.path[0] == ("fly", 0)
    caught = chain.names.index("roll")
    roll = chain.pieces[caught]
    # Where rounding starts it above the ground it falls for some 1e-8 s, with its weight acting.
    slides = chain.pieces[caught - 1].ys[-1] if caught else slides
    assert abs(roll.scene.system.slip(roll.ys[0])) < SOLVED
    # The impulse acts where it touches, under the centre: no moment about that point.
    lever = slides[:2] - jnp.array([slides[0] - 0.9 * np.sin(1.0), 0.0])

    def moment(y):
        return lever[0] * y[4] - lever[1] * y[3] - 0.01 * y[5]

    assert abs(moment(roll.ys[0]) - moment(slides)) < SOLVED
    assert energy.energy(roll.scene, 0.0, roll.ys[0]) < energy.energy(scene, 0.0, slides)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.5, 1.0, 0.2])
def test_any_inertia_scales_gravity_and_moves_the_end_of_contact(ratio):
    scene = cylinder_on_cylinder(inertia_ratio=ratio, m=2.0, r=0.3, theta=0.4)
    far = 1.3
    a = scene.rate(0.0, scene.y0)
    theta_2 = a[3] * np.cos(0.4) - a[4] * np.sin(0.4)
    assert abs(theta_2 - G * np.sin(0.4) / (1 + ratio)) < SOLVED
    needed = ratio * np.tan(0.4) / (1 + ratio)  # at rest
    assert abs(friction_needed(scene, scene.y0) - needed) < SOLVED
    stop = contact_lost(scene, 5.0)
    assert abs(stop.y[1] / far - 2 / (3 + ratio) * np.cos(0.4)) < 1e-10


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
            assert (height > -1e-13).all()
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
    after = system.after_landing(y)

    def moment(y):
        return y[0] * y[4] - y[1] * y[3] - 0.4 * y[5]

    assert abs(moment(after) - moment(y)) < 10 * EXACT
    assert abs(system.slip(after)) < 10 * EXACT
    smooth = cylinder_on_ramp(slope=0.0, d=0.5, mu=0.0).system.after_landing(y)
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
    free = scene.system.with_contact("fly")

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
