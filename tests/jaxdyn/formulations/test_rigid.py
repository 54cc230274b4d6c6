"""Rigid bodies: four ways to write one motion, against closed forms and laws of conservation."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import Effect, Scene, simulate
from jaxdyn.analysis import energy
from jaxdyn.analysis.precession import free_attitude
from jaxdyn.effects import LinearDrag, UniformGravity
from jaxdyn.formulations.attitude import Quaternion, RotationMatrix
from jaxdyn.formulations.lagrange import Lagrange
from jaxdyn.formulations.newton_euler import NewtonEuler
from jaxdyn.formulations.rigid import Pose, RigidBody, inertia_matrix, pose, resting
from jaxdyn.geometry.euler import matrix_from_euler
from jaxdyn.geometry.inertia import Body, MaterialPoints, equimomental
from jaxdyn.mechanisms.euler_body import EulerBody
from jaxdyn.scenes.bodies import REPRESENTATIONS, free_body
from jaxdyn.symbolic import parameters, with_parameters

INERTIA = jnp.array([[3.0, 0.4, -0.2], [0.4, 2.5, 0.3], [-0.2, 0.3, 2.0]])
MATTER = equimomental(Body(1.5, [0.2, -0.1, 0.6], INERTIA))
POSE = Pose(
    jnp.array([1.0, -2.0, 0.5]),
    matrix_from_euler(jnp.array([0.4, 1.1, -2.0]), "ZXZ"),
    jnp.array([0.3, 0.1, -0.7]),
    jnp.array([0.5, -1.2, 2.0]),
)
#: Drag at the points is no torque of any simple form, so nothing cancels.
EFFECTS = (UniformGravity(9.81), LinearDrag(0.3, [0.5, 0.0, 0.2]))


def four_ways(pivoted: bool):
    mechanism = EulerBody(MATTER, "ZXZ", pivoted=pivoted)
    bodies = [RigidBody(MATTER, kind, pivoted=pivoted) for kind in (Quaternion(), RotationMatrix())]
    starts = [body.state(POSE) for body in bodies] + [mechanism.state(POSE)] * 2
    systems = [*bodies, NewtonEuler(mechanism), Lagrange(mechanism)]
    return [Scene(system, EFFECTS, y0=y0) for system, y0 in zip(systems, starts, strict=True)]


FREE, PIVOTED = four_ways(False), four_ways(True)


def same(a: Pose, b: Pose) -> float:
    return max(gap(x, y) for x, y in zip(a, b, strict=True))


# ---- one law of motion


@pytest.mark.parametrize("scenes", [FREE, PIVOTED])
@pytest.mark.slow
def test_four_ways_give_one_motion(scenes):
    @jax.jit
    def moving(scene):
        y = scene.y0
        return jax.jvp(lambda y: pose(scene, 0.0, y), (y,), (scene.rate(0.0, y),))

    (place, rate), *others = [moving(scene) for scene in scenes]
    for other_place, other_rate in others:
        assert same(other_place, place) < EXACT * 10
        assert same(other_rate, rate) < SOLVED
    assert gap(place.omega_b, POSE.omega_b) < EXACT
    assert gap(rate.R_wb, np.cross(place.omega_w, place.R_wb.T).T) < SOLVED


def test_a_mass_centre_at_rest_is_not_moved_by_rounding_in_euler_angles():
    body = EulerBody(MATTER)
    for angles in np.random.default_rng(0).uniform(0.3, 2.8, (20, 3)):
        start = Pose(jnp.zeros(3), matrix_from_euler(angles, "ZXZ"), jnp.zeros(3), POSE.omega_b)
        spun = Scene(NewtonEuler(body), (), y0=body.state(start))
        fallen = Scene(spun.system, (UniformGravity(9.81),), y0=spun.y0)
        assert gap(spun.rate(0.0, spun.y0)[6:9], np.zeros(3)) == 0
        assert gap(fallen.rate(0.0, spun.y0)[6:9], [0.0, 0.0, -9.81]) < EXACT * 10
        assert gap(fallen.rate(0.0, spun.y0)[9:], spun.rate(0.0, spun.y0)[9:]) < SOLVED


@pytest.mark.parametrize("scene", [FREE[0], FREE[1], PIVOTED[0], PIVOTED[1]])
def test_momentum_changes_by_the_forces_of_the_effects(scene):
    y = scene.y0
    r, v, m = scene.system.points(0.0, y)
    forces = np.asarray(sum(effect.force(0.0, r, v, m) for effect in EFFECTS))

    def rate_of(quantity):
        return jax.jvp(lambda y: quantity(scene, 0.0, y), (y,), (scene.rate(0.0, y),))[1]

    assert gap(rate_of(energy.angular_momentum), np.cross(r, forces).sum(0)) < SOLVED * 100
    if not scene.system.pivoted:
        assert gap(rate_of(energy.momentum), forces.sum(0)) < SOLVED
    power = np.sum(np.asarray(v) * forces)
    kinetic = rate_of(lambda scene, t, y: scene.system.kinetic(t, y))
    assert gap(kinetic, power) < SOLVED * 100


def test_points_carry_the_inertia_and_the_centre():
    free, top = FREE[0].system, PIVOTED[0].system
    body = Body(1.5, [0.2, -0.1, 0.6], INERTIA)
    assert gap(inertia_matrix(free.matter), INERTIA) < EXACT * 10
    assert gap(inertia_matrix(top.matter), body.about(jnp.zeros(3))) < EXACT * 10
    r, _, m = free.points(0.0, FREE[0].y0)
    assert gap(np.average(r, axis=0, weights=m), POSE.r) < EXACT
    omega = POSE.omega_b
    kinetic = 0.75 * POSE.v @ POSE.v + omega @ INERTIA @ omega / 2
    assert gap(free.kinetic(0.0, FREE[0].y0), kinetic) < EXACT * 100


class Torque(Effect):
    """A torque along the body's first axis, and with it a force on a free body's centre."""

    load: jax.Array

    def generalized(self, t, q, v):
        return self.load


@pytest.mark.parametrize(
    ("scene", "load"), [(FREE[0], [1.0, 2, 3, 4, 5, 6]), (PIVOTED[0], [4.0, 5, 6])]
)
def test_loads_on_the_velocities(scene, load):
    bare = scene.without(LinearDrag).without(UniformGravity)
    change = (bare + Torque(jnp.array(load))).rate(0.0, scene.y0) - bare.rate(0.0, scene.y0)
    torque = jnp.array([4.0, 5.0, 6.0])
    assert gap(inertia_matrix(scene.system.matter) @ change[-3:], torque) < SOLVED
    if not scene.system.pivoted:
        assert gap(change[-6:-3] * 1.5, [1.0, 2.0, 3.0]) < SOLVED


# ---- the state


@pytest.mark.sample("scene4", "scene5", "scene7")
@pytest.mark.parametrize("scene", FREE + PIVOTED)
def test_a_state_has_its_labels_and_is_its_pose(scene):
    assert scene.y0.shape == (len(scene.system.labels()),)
    found = pose(scene, 0.0, scene.y0)
    assert gap(found.R_wb, POSE.R_wb) < EXACT
    assert gap(found.omega_b, POSE.omega_b) < EXACT * 10
    scene.check()


@pytest.mark.parametrize("scene", [FREE[0], FREE[1], PIVOTED[0], PIVOTED[1]])
def test_projection_makes_a_rotation_and_leaves_the_rest(scene):
    system, y = scene.system, scene.y0
    off = y * (1 + 1e-6) + 1e-6 * jnp.sin(jnp.arange(len(y)))
    near = system.project(0.0, off)
    R = system.pose(near).R_wb
    assert gap(R @ R.T, np.eye(3)) < EXACT
    assert gap(system.project(0.0, near), near) < EXACT
    assert gap(near[-3:], off[-3:]) == 0


def test_opposite_quaternions_are_one_state():
    system, y = FREE[0].system, FREE[0].y0
    other = y.at[3:7].multiply(-1)
    assert gap(system.difference(other, y), jnp.zeros(13)) == 0
    assert gap(system.difference(y.at[3].add(1e-3), other)[3], -1e-3) < EXACT
    assert same(system.pose(other), system.pose(y)) == 0
    matrices = FREE[1]
    assert gap(matrices.system.difference(matrices.y0 + 1.0, matrices.y0), jnp.ones(18)) < EXACT


@pytest.mark.sample("scene3")
@pytest.mark.parametrize("scene", [FREE[0], FREE[1], PIVOTED[0], PIVOTED[1]])
def test_space_may_be_moved_about_a_free_motion(scene):
    # The motion commutes with a symmetry if their vector fields do: [f, g] = 0.
    free = Scene(scene.system, (), y0=scene.y0)
    assert len(scene.system.generators(scene.y0)) == (3 if scene.system.pivoted else 6)
    for name, direction in scene.system.generators(scene.y0).items():

        def generator(y, name=name):
            return scene.system.generators(y)[name]

        f = free.rate(0.0, scene.y0)
        _, one = jax.jvp(lambda y: free.rate(0.0, y), (scene.y0,), (direction,))
        _, other = jax.jvp(generator, (scene.y0,), (f,))
        assert gap(one, other) < EXACT * 10, name


def test_points_of_the_body_are_placed_along_a_motion():
    stacked = Pose(*(jnp.stack([x, x]) for x in POSE))
    s = np.array([1.0, 2.0, 3.0])
    for one in stacked.place(s):
        assert gap(one, POSE.r + POSE.R_wb @ s) < EXACT
    assert gap(stacked.omega_w[1], POSE.R_wb @ POSE.omega_b) < EXACT


def test_what_is_refused():
    system, y = FREE[0].system, FREE[0].y0
    with pytest.raises(
        ValueError, match=r"y0: expected a rotation in qw, qx, qy, qz, got .*nearest"
    ):
        Scene(system, (), y0=y.at[3].add(0.1)).check()
    with pytest.raises(ValueError, match="y0: expected a rotation in R11"):
        Scene(FREE[1].system, (), y0=FREE[1].y0.at[3].add(0.1)).check()
    line = MaterialPoints(jnp.array([[0.0, 0, 1], [0, 0, -1]]), jnp.ones(2))
    with pytest.raises(ValueError, match="points that are not all on one line"):
        Scene(RigidBody(line), (), y0=y).check()
    weightless = MaterialPoints(MATTER.r, jnp.zeros(6))
    with pytest.raises(ValueError, match="mass: expected > 0"):
        Scene(RigidBody(weightless), (), y0=y).check()
    with pytest.raises(ValueError, match="mass: expected > 0"):
        Scene(NewtonEuler(EulerBody(weightless)), (), y0=FREE[2].y0).check()
    with pytest.raises(ValueError, match="sequence: expected one of"):
        Scene(NewtonEuler(EulerBody(MATTER, "ZZX")), (), y0=FREE[2].y0).check()
    for scene in (FREE[1], FREE[2]):
        values = parameters(scene)
        other = with_parameters(scene, values.values + 0.1)
        with pytest.raises(ValueError, match="points of a free body about their mass centre"):
            other.check()


# ---- the free body with moments 1, 2, 3


def jacobi(omega0, moments, t):
    """omega_b (s, 3) and the period of a free body whose omega_3 is 0 at the start.

    For H^2 < 2 T I_2, with dn, sn and cn of time: Landau and Lifshitz, Mechanics, section 37.
    """
    I1, I2, I3 = moments
    H2 = sum((i * w) ** 2 for i, w in zip(moments, omega0, strict=True))
    T2 = sum(i * w**2 for i, w in zip(moments, omega0, strict=True))
    speed = mpmath.sqrt((I2 - I1) * (T2 * I3 - H2) / (I1 * I2 * I3))
    k2 = (I3 - I2) * (H2 - T2 * I1) / ((I2 - I1) * (T2 * I3 - H2))
    quarter = mpmath.ellipk(k2)
    sizes = [
        mpmath.sqrt((T2 * I3 - H2) / (I1 * (I3 - I1))),
        mpmath.sqrt((H2 - T2 * I1) / (I2 * (I2 - I1))),
        mpmath.sqrt((H2 - T2 * I1) / (I3 * (I3 - I1))),
    ]
    rows = [
        [
            float(size * mpmath.ellipfun(name, quarter + speed * time, m=k2))
            for size, name in zip(sizes, ("dn", "sn", "cn"), strict=True)
        ]
        for time in map(mpmath.mpf, np.asarray(t).tolist())
    ]
    return np.array(rows), float(4 * quarter / speed)


OMEGA0 = tuple(map(mpmath.mpf, (0.01, 1.0, 0.0)))
PERIOD = jacobi(OMEGA0, (1, 2, 3), [])[1]
#: Evenly, and where the closed form has omega_2 = 0 in two flips, a period apart.
TIMES = np.sort([*np.linspace(0, 60, 120), PERIOD / 4, 5 * PERIOD / 4])


@pytest.fixture(scope="module")
def flips():
    return {
        kind: simulate(free_body(representation=kind), 60.0, samples=TIMES, rtol=1e-14)
        for kind in REPRESENTATIONS
    }


@pytest.fixture(scope="module")
def poses(flips):
    return {kind: energy.along(pose, motion) for kind, motion in flips.items()}


@pytest.mark.slow
def test_the_free_body_moves_as_jacobi_says(poses):
    expected, _ = jacobi(OMEGA0, (1, 2, 3), TIMES)
    assert gap(poses["quaternion"].omega_b, expected) < 1e-10
    # It does flip: the middle axis turns over and back.
    assert expected[:, 1].min() < -0.99


@pytest.mark.slow
def test_the_period_of_the_flips(flips, poses):
    scene, omega = free_body(), poses["quaternion"].omega_b
    crossings = []
    for t in (PERIOD / 4, 5 * PERIOD / 4):
        i = int(np.argmin(abs(TIMES - t)))
        rate = scene.rate(t, flips["quaternion"].ys[i])[-2]
        crossings.append(t - float(omega[i, 1] / rate))
    assert abs(crossings[1] - crossings[0] - PERIOD) < 1e-9
    assert TIMES[-1] == 60  # both crossings are inside the span


@pytest.mark.sample("quaternion", "matrix")
@pytest.mark.parametrize("kind", REPRESENTATIONS)
def test_a_free_body_keeps_energy_and_momentum(flips, kind):
    motion = flips[kind]
    assert energy.drift(motion) < SOLVED
    H = np.asarray(energy.along(energy.angular_momentum, motion))
    assert gap(H, np.broadcast_to([0.01, 2.0, 0.0], H.shape)) < SOLVED


def test_rotations_stay_rotations(flips, poses):
    q = flips["quaternion"].ys[:, 3:7]
    assert gap(np.linalg.norm(q, axis=1), np.ones(len(q))) < EXACT
    R = np.asarray(poses["matrix"].R_wb)
    assert gap(R @ R.transpose(0, 2, 1), np.broadcast_to(np.eye(3), R.shape)) < EXACT


@pytest.mark.parametrize("kind", ["matrix", "euler"])
def test_representations_agree_over_the_span_of_the_course(poses, kind):
    assert gap(poses[kind].R_wb, poses["quaternion"].R_wb) < 1e-10
    assert gap(poses[kind].omega_w, poses["quaternion"].omega_w) < 1e-10


def test_spin_is_stable_about_the_outer_axes_only():
    for axis in range(3):
        omega0 = np.full(3, 1e-3) + np.eye(3)[axis]
        motion = simulate(free_body(omega0), 60.0, samples=TIMES)
        off = np.abs(energy.along(pose, motion).omega_b - np.eye(3)[axis][None]).max()
        assert (off > 1.5) if axis == 1 else (off < 4e-3)


def test_a_free_axisymmetric_body_precesses_steadily_from_any_start():
    I1, I3 = 2.0, 1.2
    omega0 = jnp.array([0.7, -0.4, 1.1])
    scene = free_body(omega0, moments=(I1, I1, I3))
    start = resting(POSE.R_wb, omega0)
    motion = simulate(scene.starting(scene.system.state(start)), 60.0, samples=TIMES, rtol=1e-14)
    closed = jax.vmap(lambda t: free_attitude(POSE.R_wb, omega0, t, I1=I1, I3=I3))(TIMES)
    assert gap(energy.along(pose, motion).R_wb, closed) < 1e-11


# ---- derivatives and compilation


@pytest.mark.slow
def test_derivatives_by_forward_and_reverse_mode_and_differences():
    def end(numbers):
        scene = free_body(numbers[:3], moments=numbers[3:])
        return jnp.sum(
            scene.rate(0.0, scene.y0) ** 2 + jnp.sin(scene.system.points(0.0, scene.y0).v).sum()
        )

    # At moments 1, 2, 3, where the body is flat and is at the edge of what is possible.
    x = jnp.array([0.3, 1.0, -0.5, 1.0, 2.0, 3.0])
    end = jax.jit(end)
    forward, reverse = jax.jit(jax.jacfwd(end))(x), jax.jit(jax.grad(end))(x)
    assert gap(forward, reverse) < EXACT * 100
    h = 1e-6
    up = jnp.array([1.0, 0, 0, 0, 0, 0]) * h
    assert abs((end(x + up) - end(x - up)) / (2 * h) - forward[0]) < 1e-7
    # From inside: the third moment may only shrink.
    down = jnp.array([0, 0, 0, 0, 0, 1.0]) * h
    assert abs((end(x) - end(x - down)) / h - forward[5]) < 1e-4


def test_new_numbers_do_not_recompile():
    traced = []

    @jax.jit
    def rate(scene):
        traced.append(1)
        return scene.rate(0.0, scene.y0)

    for i in range(3):
        rate(free_body((0.1 * i, 1.0, 0.0), moments=(1.0, 2.0, 2.5 + 0.1 * i)))
    assert len(traced) == 1
