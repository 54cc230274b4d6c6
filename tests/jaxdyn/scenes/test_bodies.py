"""Scenes of rigid bodies, tops and disks; steady precession against the motions themselves."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, central_difference, gap, refusal
from jax.scipy.linalg import expm
from scipy.integrate import quad

from jaxdyn import Status, scenes, simulate
from jaxdyn.analysis import energy, precession
from jaxdyn.course import spinning_top
from jaxdyn.formulations.rigid import inertia_matrix, pose
from jaxdyn.geometry import inertia
from jaxdyn.geometry.inertia import Body
from jaxdyn.mechanisms.disk import Disk
from jaxdyn.scenes.bodies import (
    JACK_ARMS,
    box,
    box_points,
    feynman_plate,
    free_body,
    jack,
    satellite,
    top,
)
from jaxdyn.scenes.disks import rolling_disk
from jaxdyn.scenes.satellites import (
    ANTENNAS,
    BOX_EDGES,
    antenna_trace,
    satellite_a,
    satellite_b,
    satellite_c,
)

#: The default top, as its formulas want it, and the moment of gravity over sin(theta).
TOP = {"m": 0.1, "d": 0.05, "I1": 1e-4, "I3": 5e-5, "g": 9.81}
PIVOT = TOP["I1"] + TOP["m"] * TOP["d"] ** 2
K = TOP["m"] * TOP["g"] * TOP["d"]
DISK = {"m": 1.0, "radius": 0.5, "I1": 0.0625, "g": 9.81}
THETA = 1.2


# ---- bodies that float


def test_jack_and_box_have_the_inertia_they_should():
    assert gap(inertia_matrix(jack(2.0, [1.0, 2.0, 2.5])), np.diag([1.0, 2.0, 2.5])) < EXACT
    flat = jack(1.0, [1.0, 2.0, 3.0])
    assert gap(inertia_matrix(flat), np.diag([1.0, 2.0, 3.0])) < EXACT
    assert gap(jnp.sum(flat.m), 1.0) < EXACT
    sides = jnp.array([3.0, 2.0, 1.0])
    assert gap(inertia_matrix(box_points(2.0, sides)), inertia.box(2.0, sides).inertia) < EXACT * 10
    moved = jack(2.0, [1.0, 2.0, 2.5], [0.0, 0.0, 0.3])
    about = Body(2.0, [0, 0, 0.3], jnp.diag(jnp.array([1.0, 2.0, 2.5]))).about(jnp.zeros(3))
    assert gap(inertia_matrix(moved), about) < EXACT * 10


def test_moments_one_two_three_are_those_of_a_flat_plate():
    matter = free_body(moments=(1.0, 2.0, 3.0)).system.matter
    massive = np.asarray(matter.r)[np.asarray(matter.m) > 0]
    assert len(massive) == 4
    assert np.abs(massive[:, 2]).max() == 0
    with pytest.raises(ValueError, match=r"moments|inertia"):
        free_body(moments=(1.0, 2.0, 3.1))


def test_drawings_join_the_right_points():
    sides = np.array([3.0, 2.0, 1.0])
    corners = np.asarray(box(sides=sides).system.matter.r)
    lengths = sorted(np.linalg.norm(corners[i] - corners[j]) for i, j in BOX_EDGES)
    assert gap(lengths, np.repeat([1.0, 2.0, 3.0], 4)) < EXACT
    arms = np.asarray(jack(1.0, [1.0, 2.0, 2.5]).r)
    for axis, (i, j) in enumerate(JACK_ARMS):
        assert gap(arms[i], -arms[j]) == 0
        assert arms[i, axis] > 0


@pytest.mark.sample("matrix")
@pytest.mark.parametrize("kind", ["quaternion", "matrix", "euler"])
def test_each_scene_starts_where_it_says(kind):
    omega0 = jnp.array([0.1, 1.0, -0.3])
    scenes = [f(omega0=omega0, representation=kind) for f in (free_body, box, satellite)]
    for scene in scenes:
        scene.check()
        assert gap(pose(scene, 0.0, scene.y0).omega_w, omega0) < EXACT
    for scene in (feynman_plate(representation=kind), top(representation=kind)):
        scene.check()


def test_what_is_refused():
    with pytest.raises(
        ValueError, match=r"representation: expected one of .*Did you mean 'matrix'"
    ):
        free_body(representation="matrices")
    with pytest.raises(ValueError, match="name: expected one of A, B, C"):
        satellite("D")
    with pytest.raises(ValueError, match="radius: expected > 0"):
        rolling_disk(radius=-0.5, I1=0.1).check()
    with pytest.raises(ValueError, match="sides: expected >= 0"):
        box(sides=(-1.0, 2.0, 3.0))


@pytest.mark.parametrize("tilt", [0.02, 0.3])
def test_a_plate_wobbles_twice_while_it_spins_once(tilt):
    spin = 10.0
    motion = simulate(feynman_plate(tilt, spin=spin), 3.0, samples=200, rtol=1e-13)
    seen = precession.wobble_and_spin(motion)
    said = precession.free_precession(tilt, spin, I1=1.0, I3=2.0)
    assert gap(seen.wobble, said.precession) < 1e-10
    assert gap(seen.spin, said.precession + said.spin) < 1e-10
    # 2 : 1 in the limit, and not 1 : 2; in full 1 / (1 - cos / 2).
    assert gap(seen.wobble / seen.spin, 2 / (2 - np.cos(tilt))) < SOLVED * 100
    assert gap(precession.tilts(motion), np.full(200, tilt)) < SOLVED * 10


@pytest.mark.slow
def test_satellite_a_can_flip_b_precesses_and_c_only_spins():
    def axis_moves(name, omega0):
        motion = simulate(satellite(name, omega0), 60.0, samples=200, rtol=1e-12)
        return motion, energy.along(pose, motion)

    # Axes 1 and 3 of A wobble, axis 2 turns over (57 A iii).
    axes = np.asarray(inertia.principal(satellite_a()).axes)
    for i in range(3):
        start = axes[:, i] + 0.01 * axes[:, (i + 1) % 3]
        _, moved = axis_moves("A", start)
        along = np.asarray(moved.omega_b) @ axes[:, i]
        assert (along.min() < -0.9) if i == 1 else (along.min() > 0.99)
    # Angle of the symmetry axis of B to the angular momentum (57 B iii, 58): constant.
    motion, moved = axis_moves("B", jnp.array([0.3, 1.0, 0.2]))
    H = np.asarray(energy.along(energy.angular_momentum, motion))
    symmetry = np.asarray(moved.R_wb) @ np.ones(3)
    angle = np.sum(H * symmetry, axis=1)
    assert np.ptp(angle) < 1e-11
    assert np.ptp(symmetry, axis=0).max() > 0.1
    # C turns about one axis for good (57 C ii), its antenna's tip on a circle.
    _, moved = axis_moves("C", jnp.array([0.3, 1.0, 0.2]))
    assert np.ptp(np.asarray(moved.omega_w), axis=0).max() < 1e-11
    tip = np.asarray(moved.place(jnp.array(ANTENNAS[0]) - satellite_c().centre))
    assert np.ptp(tip @ np.array([0.3, 1.0, 0.2])) < 1e-10
    assert satellite_b().mass > satellite_a().mass


# ---- steady precession: the algebra


@pytest.mark.parametrize("total", [False, True])
@pytest.mark.parametrize(
    ("theta", "spin", "n"),
    [(0.5, 160.0, 2), (0.5, 100.0, 0), (np.pi / 2, 160.0, 1), (2.5, 10.0, 2), (2.5, 0.0, 2)],
)
def test_precession_roots_are_all_there_are(theta, spin, n, total):
    roots = precession.top_roots(theta, spin, **TOP, total=total)
    residual = precession.precession_residual(theta, roots, I1=PIVOT, I3=TOP["I3"], K=K)
    if theta == np.pi / 2 and not total:
        total = True  # the two spins are one there
    found = np.isfinite(roots.precession)
    assert found.sum() == n
    assert np.abs(np.asarray(residual)[found]).max(initial=0) < SOLVED
    a = PIVOT if total else PIVOT - TOP["I3"]
    expected = np.roots([a * np.cos(theta), -TOP["I3"] * spin, K])
    if n == 2:
        assert gap(np.sort(roots.precession), np.sort(expected)) < SOLVED * 100
        assert abs(roots.precession[0]) <= abs(roots.precession[1])
    given = roots.spin + float(total) * roots.precession * np.cos(theta)
    assert np.abs(np.asarray(given)[found] - spin).max(initial=0) < SOLVED * 100


def test_a_linear_relation_and_none_at_all():
    same = {"I1": 2.0, "I3": 2.0, "K": 1.0}
    assert gap(precession.precession_roots(0.5, 4.0, **same).precession[0], 0.125) < EXACT
    assert np.isnan(precession.precession_roots(0.5, 4.0, **same).precession[1])
    assert np.isnan(precession.precession_roots(0.5, 0.0, **same).precession).all()
    assert np.isnan(precession.precession_roots(0.5, 0.0, **same).spin).all()


def test_roots_have_derivatives():
    def roots(x):
        return precession.top_roots(x[0], 160.0 * x[1], **TOP).precession

    x = jnp.array([0.5, 1.0])
    forward = jax.jacfwd(roots)(x)
    assert gap(jax.jacrev(roots)(x), forward) < SOLVED * 100
    assert gap(central_difference(roots, x), forward) < 1e-7


@pytest.mark.parametrize(
    ("slowest", "total"),
    [(precession.slowest_relative_spin, False), (precession.critical_spin, True)],
)
def test_the_slowest_spin_upright_is_two_different_numbers(slowest, total):
    least, theta = slowest(**TOP), 1e-7
    some = precession.top_roots(theta, least * (1 + 1e-9), **TOP, total=total).precession
    none = precession.top_roots(theta, least * (1 - 1e-9), **TOP, total=total).precession
    assert np.isfinite(some).all()
    assert np.isnan(none).all()
    # As a total, the slowest relative spin is faster than the critical total.
    root = precession.top_roots(theta, least * (1 + 1e-12), **TOP, total=total)
    given = (root.spin + root.precession)[0] / precession.critical_spin(**TOP) - 1
    assert (abs(given) < 1e-9) if total else (1e-3 < given < 1e-2)
    stout = TOP | {"I3": 1e-3}
    assert precession.slowest_relative_spin(**stout) == 0


# ---- tops


@pytest.fixture(scope="module")
def steady():
    roots = precession.top_roots(0.5, 160.0, **TOP)
    return {
        (kind, i): simulate(
            top(
                0.5, precession=roots.precession[i], spin=roots.spin[i], representation=kind, **TOP
            ),
            3.0,
            samples=200,
            rtol=1e-13,
        )
        for kind in ("quaternion", "euler")
        for i in (0, 1)
    }


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["quaternion", "euler"])
@pytest.mark.parametrize("i", [0, 1])
def test_steady_precession_stays_steady(steady, kind, i):
    motion = steady[kind, i]
    assert gap(precession.tilts(motion), np.full(200, 0.5)) < 1e-10
    rate = precession.top_roots(0.5, 160.0, **TOP).precession[i]
    assert gap(precession.wobble_and_spin(motion).wobble, rate) < 1e-10


@pytest.mark.slow
def test_a_top_nutates_and_keeps_what_it_should():
    motions = [
        simulate(top(0.5, spin=180.0, representation=kind, **TOP), 3.0, samples=200, rtol=1e-13)
        for kind in ("quaternion", "euler")
    ]
    for motion in motions:
        assert energy.drift(motion) < SOLVED
        H = np.asarray(energy.along(energy.angular_momentum, motion))
        axis = np.asarray(energy.along(pose, motion).R_wb)[:, :, 2]
        assert np.ptp(H[:, 2]) < SOLVED * abs(H[0, 2])
        assert np.ptp(np.sum(H * axis, axis=1)) < SOLVED * abs(H[0, 2])
        # Not a steady precession (59 c).
        assert np.ptp(np.asarray(precession.tilts(motion))) > 0.1
    one, other = (energy.along(pose, motion) for motion in motions)
    assert gap(one.R_wb, other.R_wb) < 1e-10
    # From rest it falls to the lowest u = cos(theta) that energy and momenta leave, not further.
    u = np.cos(np.asarray(precession.tilts(motions[0])))
    s = (TOP["I3"] * 180.0) ** 2 / (2 * PIVOT * K)
    lowest = s / 2 - np.sqrt((s / 2) ** 2 - s * np.cos(0.5) + 1)
    assert -1e-10 < u.min() - lowest < 0.02 * np.ptp(u)


@pytest.mark.slow
def test_critical_spin_three_ways():
    formula = precession.critical_spin(**TOP)
    assert gap(formula**2, 4 * K * PIVOT / TOP["I3"] ** 2) < SOLVED * formula**2
    assert abs(spinning_top.critical_spin_by_linearization(**TOP) / formula - 1) < 1e-10
    assert abs(spinning_top.critical_spin_by_simulation(**TOP) / formula - 1) < 3e-5


def test_too_slow_a_top_falls_as_far_as_energy_lets_it():
    spin = 150.0
    motion = simulate(top(1e-3, spin=spin, **TOP), 3.0, samples=200, rtol=1e-13)
    deepest = 2 * np.arccos(spin / precession.critical_spin(**TOP))
    assert -1e-5 < deepest - np.asarray(precession.tilts(motion)).max() < 3e-3


# ---- disks


def circle(theta=THETA, R=-2.0):
    return precession.rolling_disk_circle(theta, R, **DISK)


def at(motion, **kwargs):
    return rolling_disk(THETA, precession=motion.precession, spin=motion.spin, **kwargs)


@pytest.fixture(scope="module")
def rolls():
    """The circle, the coin that needs no friction, and a disk that wobbles."""
    coin = precession.frictionless_rolling_disk(THETA, **DISK)
    scenes = [at(circle()), at(coin), rolling_disk(THETA, precession=1.0, lean_rate=0.5, spin=3.0)]
    return [simulate(scene, 10.0, samples=200, rtol=1e-13) for scene in scenes]


@pytest.mark.slow
def test_a_disk_keeps_its_energy_and_its_contact(rolls):
    for motion in rolls:
        assert energy.drift(motion) < SOLVED
        place, rates = jax.vmap(motion.scene.system.violation)(motion.ts, motion.ys)
        assert jnp.abs(place).max() < SOLVED
        assert jnp.abs(rates).max() < SOLVED
    assert np.ptp(np.asarray(rolls[2]["theta"])) > 0.5


@pytest.mark.slow
def test_a_rolling_disk_stands_still_where_it_touches(rolls):
    motion = rolls[2]
    disk = motion.scene.system.mechanism
    q, v = jnp.split(motion.ys, 2, axis=1)
    poses = energy.along(pose, motion)
    arm = np.asarray(jax.vmap(disk.contact)(q) - poses.r)
    slip = np.asarray(poses.v) + np.cross(poses.omega_w, arm)
    assert np.abs(slip).max() < SOLVED
    assert np.abs(poses.r[:, 2] + arm[:, 2]).max() < SOLVED
    assert gap(np.linalg.norm(arm, axis=1), np.full(200, 0.5)) < EXACT
    assert gap(poses.v, v[:, :3]) == 0


@pytest.mark.slow
def test_steady_rolling_stays_steady(rolls):
    for motion in rolls[:2]:
        assert gap(motion["theta"], np.full(200, THETA)) < 1e-10
        assert np.ptp(np.asarray(motion["psi_dot"])) < 1e-9
    # The centre goes round a circle of radius 2, whose middle is where the disk leans to.
    assert gap(np.hypot(rolls[0]["x"], rolls[0]["y"] - 2.0), np.full(200, 2.0)) < 1e-10
    assert max(np.abs(rolls[1]["x"]).max(), np.abs(rolls[1]["y"]).max()) < 1e-10


def test_a_disk_on_ice_slides_steadily():
    for rate in precession.sliding_disk_roots(THETA, -4.0, **DISK).precession:
        scene = rolling_disk(THETA, precession=rate, spin=-4.0, rough=False)
        scene.check()
        assert jnp.abs(scene.rate(0.0, scene.y0)[6:]).max() < SOLVED * 100
        forces = scene.system.constraint_forces(0.0, scene.y0, scene.effects)
        assert forces is not None
        (normal,) = forces
        assert gap(normal, 9.81) < SOLVED * 10


@pytest.mark.slow
def test_friction_is_what_the_steady_family_says(rolls):
    for motion, said in ((rolls[0], circle()), (rolls[1], None)):
        system, effects = motion.scene.system, motion.scene.effects
        normal, *friction = system.constraint_forces(0.0, motion.scene.y0, effects)
        assert gap(normal, DISK["m"] * DISK["g"]) < SOLVED * 10
        needed = 0.0 if said is None else precession.disk_residuals(THETA, said, **DISK).friction
        assert gap(jnp.stack(friction), [0.0, needed]) < SOLVED * 10


def test_steady_families_satisfy_the_relations_and_meet():
    lean, R = jnp.array([0.3, 1.2, 2.0]), jnp.array([-1.0, -2.0, 1.0])
    rolling = precession.rolling_disk_circle(lean, R, **DISK)
    found = precession.disk_residuals(lean, rolling, **DISK)
    assert jnp.abs(found.moment).max() < SOLVED * 100
    assert jnp.abs(found.slip).max() < SOLVED
    coin = precession.frictionless_rolling_disk(lean[:2], **DISK)
    for residual in precession.disk_residuals(lean[:2], coin, **DISK):
        assert jnp.abs(residual).max() < SOLVED * 100
    # Rolling on a circle of radius 0 is it. Sliding it is the slowest spin there is: both roots.
    still = precession.rolling_disk_circle(lean[:2], jnp.zeros(2), **DISK)
    assert gap(still.precession, coin.precession) < SOLVED
    slide = precession.sliding_disk_roots(THETA, coin.spin[1] * (1 + 1e-9), **DISK)
    assert gap(jnp.mean(slide.precession), coin.precession[1]) < 1e-7
    assert np.ptp(np.asarray(slide.precession)) < 1e-3 * coin.precession[1]
    none = precession.sliding_disk_roots(THETA, coin.spin[1] * (1 - 1e-9), **DISK)
    assert np.isnan(none.precession).all()
    # For a uniform coin omega_p^2 = 4 g / (r sin(theta)).
    assert gap(coin.precession**2, 4 * 9.81 / (0.5 * np.sin(lean[:2]))) < SOLVED * 100
    assert np.isnan(precession.rolling_disk_circle(THETA, 2.0, **DISK).precession)


def test_upright_a_disk_rolls_straight_or_turns_on_the_spot():
    upright = np.pi / 2
    scene = rolling_disk(upright, precession=0.0, spin=5.0)
    assert jnp.abs(scene.rate(0.0, scene.y0)[6:]).max() < SOLVED
    scene = rolling_disk(upright, precession=3.0, spin=0.0)
    assert jnp.abs(scene.rate(0.0, scene.y0)[6:]).max() < SOLVED
    on_the_spot = precession.SteadyDisk(3.0, 0.0, 0.0)
    for residual in precession.disk_residuals(upright, on_the_spot, **DISK):
        assert abs(residual) < SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("theta", [1.2, 2.0])
def test_a_disk_that_falls_flat_ends_there_above_the_ground(theta):
    scene = rolling_disk(theta, precession=0.0, spin=0.0)
    motion = simulate(scene, 1.0, samples=500, throw=False)
    assert motion.status_code == Status.STEP_COLLAPSED
    assert motion.message.endswith("or start with more precession or spin.")
    assert motion.steps < 100
    z = np.asarray(motion["z"])
    good = np.isfinite(z)
    assert (z[good] > 0).all()
    # It turns about its fixed contact point: J theta'^2 / 2 = m g r (sin start - sin theta). With
    # theta = start - s^2 the integral of the time has no singularity.
    start, J, mgr = min(theta, np.pi - theta), 0.0625 + 0.25, 9.81 * 0.5

    def slowness(s):
        return 2 * s / np.sqrt(2 * mgr / J * (np.sin(start) - np.sin(start - s * s)))

    flat = quad(slowness, 0.0, np.sqrt(start))[0]
    assert 0 < flat - float(motion.ts[good][-1]) < 0.003  # between two samples


def test_a_disk_that_lies_flat_has_no_rate():
    # Its Euler angles lock there; the numbers must say so.
    scene = rolling_disk(0.5)
    lean = [name for name, _ in scene.labels()].index("theta")
    flat = scene.y0.at[lean].set(0.0)
    assert np.isfinite(scene.rate(0.0, scene.y0)).all()
    assert not np.isfinite(scene.rate(0.0, flat)).all()
    with pytest.raises(ValueError, match=r"^theta: expected a disk that does not lie flat"):
        rolling_disk(0.0)


def test_a_hoop_has_its_moments():
    hoop = Disk(2.0, 0.5, 2.0 * 0.25 / 2)
    r = hoop.positions(0.0, jnp.zeros(6))
    assert gap(inertia_matrix((r, hoop.masses())), np.diag([0.25, 0.25, 0.5])) < EXACT


@pytest.mark.parametrize("sides", [(1.0, 2.0), 1.0, ((1.0, 2.0, 3.0),)])
def test_a_box_needs_three_sides(sides):
    with pytest.raises(ValueError, match=r"^sides: expected shape \(3,\), got shape \("):
        box(sides=sides)


@pytest.mark.parametrize("representation", ["quaternion", "matrix"])
@pytest.mark.slow
def test_an_antenna_traces_what_the_closed_form_of_a_steady_precession_says(representation):
    scene = satellite("B", representation=representation)
    motion = simulate(scene, 5.0, samples=7, rtol=1e-13)
    body, tip = satellite_b(), ANTENNAS[1]
    found = antenna_trace(motion, "B", tip)
    start = pose(scene, 0.0, scene.y0)
    # omega = a n + the rest, n = (1, 1, 1) / sqrt(3): R = exp(t H / I_1) R_0 exp(t spin n).
    moments = np.linalg.eigvalsh(body.inertia)  # two equal ones, then that of the axis
    n = np.ones(3) / np.sqrt(3)
    spin = (n @ start.omega_b) * (1 - moments[2] / moments[0])
    H = np.asarray(body.inertia) @ np.asarray(start.omega_b)
    for t, r in zip(np.asarray(motion.ts), np.asarray(found), strict=True):
        turn = [expm(np.cross(np.eye(3), t * w)) for w in (H / moments[0], spin * n)]
        arm = np.asarray(tip) - np.asarray(body.centre)
        np.testing.assert_allclose(r, turn[0] @ turn[1] @ arm, rtol=0, atol=1e-11)
    with pytest.raises(ValueError, match="name: expected one of A, B, C"):
        antenna_trace(motion, "D")


def test_the_ready_made_top_stays_up():
    # From rest but for its spin cos(theta) stays between the roots of the potential of its lean:
    # 2 m g d (c0 - c) I / (I3 spin)^2 = (c0 - c)^2 / (1 - c^2).
    m, d, I3, g, spin = 0.1, 0.05, 5e-5, 9.81, 250.0
    inertia, c0 = 1e-4 + m * d * d, math.cos(0.5)
    k = 2 * m * g * d * inertia / (I3 * spin) ** 2
    lowest = (1 - math.sqrt(1 + 4 * k * (k - c0))) / (2 * k)
    motion = simulate(scenes.top(), samples=2000)
    lean = np.mean(np.asarray(motion.r)[:, 4:, 2], axis=1) / d
    assert lowest > 0.5
    assert lean.min() == pytest.approx(lowest, abs=1e-4)
    assert lean.max() == pytest.approx(c0, abs=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: scenes.top(0.0, representation="euler"),
            "sequence: expected Euler angles that do",
        ),
        (
            lambda: scenes.free_body(representation="euler", sequence="ZXZ"),
            "sequence: expected Euler angles that do not lock in the pose at the start, got 'ZXZ'",
        ),
        (lambda: scenes.top(I1=0.0), "I1: expected > 0, got 0.0"),
        (lambda: scenes.top(I3=0.0), "I3: expected > 0, got 0.0"),
        (
            lambda: scenes.rolling_disk(0.0),
            "theta: expected a disk that does not lie flat, 0 < theta",
        ),
        (lambda: scenes.rolling_disk(math.pi), "theta: expected a disk that does not lie flat"),
    ],
)
def test_an_invalid_start_is_refused_by_name(make, message):
    assert refusal(make).startswith(message)


def test_traced_angles_that_lock_are_nan():
    locked = jax.jit(lambda theta: scenes.top(theta, representation="euler").y0)(0.0)
    assert np.isnan(locked).any()


def test_a_spin_faster_than_the_samples_is_not_a_number():
    top = scenes.top(np.pi / 2, precession=3.924, t1=0.2)  # 8 turns
    seen = [precession.wobble_and_spin(simulate(top, samples=n)) for n in (12, 30)]
    assert np.isnan(seen[0].spin)
    assert gap(seen[0].wobble, 3.924) < 1e-8
    upright = simulate(scenes.satellite("B"), 1.0, samples=20)  # its axis starts along z
    assert np.isnan(precession.wobble_and_spin(upright).wobble)
    assert gap(np.array(seen[1]), np.array([3.924, 253.924])) < 1e-8
