"""Rotations: group axioms, two routes to each number, samples where it hurts, derivatives."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import DIFFED, EXACT, central_difference, gap, primitives

from jaxdyn.analysis.precession import free_attitude
from jaxdyn.geometry import frames
from jaxdyn.geometry import rotations as ro
from jaxdyn.geometry.euler import (
    SEQUENCES,
    euler_from_matrix,
    euler_rates_from_body,
    euler_rates_from_world,
    matrix_from_euler,
    omega_b_from_euler,
    omega_w_from_euler,
)
from jaxdyn.geometry.inertia import box
from jaxdyn.geometry.vectors import skew, unskew

RNG = np.random.default_rng(42)
PI = math.pi
ANGLES = [0.0, 1e-15, 1e-9, 1e-4, 0.19, 0.21, 0.99, 1.01, 2.0, PI - 1e-4, PI - 1e-9, PI - 1e-15, PI]

# One compilation for all tests and samples.
ROTMAT = jax.jit(ro.matrix_from_axis_angle)
MATRIX = jax.jit(ro.matrix_from_wxyz)
MULTIPLY = jax.jit(ro.multiply_wxyz)
EXP = jax.jit(ro.matrix_from_rotation_vector)
LOG = jax.jit(ro.rotation_vector_from_matrix)
AXIS_ANGLE = jax.jit(ro.axis_angle_from_matrix)


def _unit(n):
    return n / np.linalg.norm(n)


def _axes():
    """Random axes, coordinate axes and axes with ties, in which a choice could go wrong."""
    hard = [[1, 0, 0], [0, -1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 1], [1, 1, 1], [1e-9, 1, 0]]
    return [_unit(np.array(n, dtype=float)) for n in [*hard, *RNG.normal(size=(3, 3))]]


CASES = [(n, theta) for n in _axes() for theta in ANGLES]


def _exp_by_series(phi):
    total = term = np.eye(3)
    matrix = np.cross(np.eye(3), phi)  # rows e_i x phi: skew(phi)
    for k in range(1, 40):
        term = term @ matrix / k
        total = total + term
    return total


def _quaternions(n):
    q = RNG.normal(size=(n, 4))
    return jnp.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


# ---- the representations of one rotation agree


def test_matrix_vector_formula_series_and_quaternion_are_one_rotation():
    rotate, quaternion = jax.jit(ro.rotate), jax.jit(ro.wxyz_from_axis_angle)
    by_quaternion = jax.jit(ro.rotate_by_wxyz)
    r = np.array([0.3, -1.2, 0.7])
    for n, theta in CASES:
        R, q = ROTMAT(n, theta), quaternion(n, theta)
        assert gap(R.T @ R, np.eye(3)) < EXACT
        assert gap(np.linalg.det(R), 1.0) < EXACT
        assert gap(R, _exp_by_series(n * theta)) < EXACT
        assert gap(R, EXP(n * theta)) < EXACT
        assert gap(R, MATRIX(q)) < EXACT
        assert gap(R, MATRIX(-3.7 * q)) < EXACT
        assert gap(R @ r, rotate(2.5 * n, theta, r)) < EXACT
        assert gap(R @ r, by_quaternion(1.7 * q, r)) < EXACT


def test_axis_and_angle_come_back_at_every_angle():
    for n, theta in CASES:
        R = ROTMAT(n, theta)
        axis, angle = AXIS_ANGLE(R)
        assert gap(angle, theta) < 3e-15
        assert gap(jnp.linalg.norm(axis), 1.0) < EXACT
        assert gap(ROTMAT(axis, angle), R) < EXACT
        if 0 < theta:
            sign = np.sign(axis @ n) if PI - theta < 1e-14 else 1.0
            assert gap(sign * axis, n) < 1e-12
            assert gap(sign * LOG(R), n * theta) < 3e-15
    assert gap(AXIS_ANGLE(jnp.eye(3)).axis, [0, 0, 1]) == 0


def test_exp_and_log_are_inverse_and_longer_vectors_come_back_short():
    for phi in RNG.uniform(-1.7, 1.7, (50, 3)):
        assert gap(LOG(EXP(phi)), phi) < EXACT
    phi = np.array([0.6, 0.0, 0.8])
    assert gap(LOG(EXP(4.0 * phi)), (4 - 2 * PI) * phi) < EXACT
    assert gap(LOG(jnp.eye(3)), np.zeros(3)) == 0


def test_quaternions_and_matrices_are_one_group():
    p, q, s = _quaternions(3 * 32).reshape(3, 32, 4)
    multiply, matrix = jax.vmap(ro.multiply_wxyz), jax.vmap(ro.matrix_from_wxyz)
    one = jnp.array([1.0, 0, 0, 0])
    conjugate = jax.vmap(ro.conjugate_wxyz)(q)
    assert gap(multiply(multiply(p, q), s), multiply(p, multiply(q, s))) < EXACT
    assert gap(multiply(q, conjugate), jnp.tile(one, (32, 1))) < EXACT
    assert gap(multiply(q, jnp.tile(one, (32, 1))), q) == 0
    assert gap(matrix(multiply(p, q)), matrix(p) @ matrix(q)) < EXACT
    assert gap(matrix(conjugate), matrix(q).transpose(0, 2, 1)) < EXACT
    back = jax.vmap(ro.wxyz_from_matrix)(matrix(q))
    assert gap(back, q * jnp.sign(q[:, :1])) < EXACT
    assert gap(jax.vmap(ro.normalize_wxyz)(5 * q), q) < EXACT
    # i j = k and the rest of Hamilton's table
    i, j, k = jnp.eye(4)[1:]
    assert gap(MULTIPLY(i, j), k) == 0
    assert gap(MULTIPLY(MULTIPLY(i, j), k), -one) == 0


def test_composition_of_axis_angles():
    first, then = ro.AxisAngle(_axes()[-1], 1.2), ro.AxisAngle(_axes()[-2], 2.9)
    both = ro.compose_axis_angle(first, then)
    assert gap(ROTMAT(*both), ROTMAT(*then) @ ROTMAT(*first)) < EXACT
    back = ro.compose_axis_angle(first, ro.AxisAngle(first.axis, -first.angle))
    assert gap(back.angle, 0.0) < EXACT


def test_nothing_is_returned_for_no_axis_and_no_quaternion():
    assert jnp.isnan(ROTMAT(jnp.zeros(3), 1.0)).all()
    assert jnp.isnan(ro.rotate(jnp.zeros(3), 1.0, jnp.ones(3))).all()
    assert jnp.isnan(MATRIX(jnp.zeros(4))).all()
    assert jnp.isnan(ro.normalize_wxyz(jnp.zeros(4))).all()


# ---- rates


def test_rates_are_derivatives_of_the_rotation():
    q, omega = _quaternions(1)[0], jnp.array([0.4, -1.1, 0.9])
    R = MATRIX(q)

    def in_body(t):  # a steady turn after q in the body's axes, and in the world's
        return ro.multiply_wxyz(q, ro.wxyz_from_rotation_vector(omega * t))

    def in_world(t):
        return ro.multiply_wxyz(ro.wxyz_from_rotation_vector(omega * t), q)

    for turn, rate, matrix_rate in [
        (in_body, ro.wxyz_rate_from_body, ro.matrix_rate_from_body),
        (in_world, ro.wxyz_rate_from_world, ro.matrix_rate_from_world),
    ]:
        slope = jax.jacfwd(turn)(0.0)
        assert gap(slope, rate(q, omega)) < EXACT
        by_matrix = jax.jacfwd(lambda t, turn=turn: ro.matrix_from_wxyz(turn(t)))(0.0)
        assert gap(by_matrix, matrix_rate(R, omega)) < EXACT
    assert gap(ro.wxyz_rate_from_body(q, R.T @ omega), ro.wxyz_rate_from_world(q, omega)) < EXACT
    assert gap(unskew(ro.matrix_rate_from_world(R, omega) @ R.T), omega) < EXACT


# ---- Euler angles


def _elementary(letter, theta):
    return np.asarray(ROTMAT(np.eye(3)["XYZ".index(letter)], theta))


def _sample(sequence):
    proper = sequence[0] == sequence[2]
    middle = RNG.uniform(0.1, PI - 0.1) if proper else RNG.uniform(-1.5, 1.5)
    outer, inner = RNG.uniform(-PI, PI, 2)
    return jnp.array([outer, middle, inner])


@pytest.mark.sample("XZX", "XZY", "YXY", "YXZ", "YZX")
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_euler_angles_of_every_sequence(sequence):
    to = jax.jit(matrix_from_euler, static_argnums=1)
    back = jax.jit(euler_from_matrix, static_argnums=1)
    angles = _sample(sequence)
    turns = [_elementary(c, a) for c, a in zip(sequence.upper(), angles, strict=True)]
    R = to(angles, sequence)
    product = (
        turns[0] @ turns[1] @ turns[2] if sequence.isupper() else turns[2] @ turns[1] @ turns[0]
    )
    assert gap(R, product) < EXACT
    found = back(R, sequence)
    assert not found.locked
    assert gap(found.angles, angles) < 30 * EXACT  # the middle angle is 0.07 from lock at least

    # From gimbal lock to well away from it the angles give the rotation back to rounding.
    proper = sequence[0] == sequence[2]
    for off in [0.0, 1e-15, 1e-12, 1e-9, 1e-5]:
        for lock in [0.0, PI] if proper else [PI / 2, -PI / 2]:
            middle = abs(lock - off) if proper else lock - np.sign(lock) * off
            near = to(angles.at[1].set(middle), sequence)
            found = back(near, sequence)
            assert gap(to(found.angles, sequence), near) < 1e-13 + EXACT
            assert bool(found.locked) == (off < 1e-13)
            if found.locked:
                assert found.angles[0 if sequence.isupper() else 2] == 0


@pytest.mark.parametrize("sequence", ["ZYX", "zxz"])
def test_exact_zeros_do_not_poison_derivatives_of_euler_angles(sequence):
    slope = jax.jit(jax.jacrev(lambda R: euler_from_matrix(R, sequence).angles))
    for plain in (np.eye(3), _elementary(sequence.upper()[1], PI / 2)):
        assert jnp.isfinite(slope(plain)).all()


@pytest.mark.parametrize("sequence", ["ZYX", "ZXZ", "xyz", "yzy"])
def test_angular_velocity_of_euler_angles(sequence):
    angles, rates = _sample(sequence), jnp.array([0.3, -0.8, 1.1])
    R, dR = jax.jvp(lambda a: matrix_from_euler(a, sequence), (angles,), (rates,))
    omega_w, omega_b = unskew(dR @ R.T), unskew(R.T @ dR)
    assert gap(omega_w_from_euler(angles, sequence) @ rates, omega_w) < EXACT
    assert gap(omega_b_from_euler(angles, sequence) @ rates, omega_b) < EXACT
    world = euler_rates_from_world(angles, omega_w, sequence)
    body = euler_rates_from_body(angles, omega_b, sequence)
    for found in (world, body):
        assert not found.locked
        assert gap(found.rates, rates) < 100 * EXACT  # / sin of the distance from lock
    lock = 0.0 if sequence[0] == sequence[2] else PI / 2
    stuck = euler_rates_from_body(angles.at[1].set(lock), omega_b, sequence)
    assert stuck.locked
    assert jnp.isnan(stuck.rates).all()


def test_unknown_sequences_are_refused():
    for wrong in ("XXY", "abc", "Zyx"):
        with pytest.raises(ValueError, match="sequence: expected one of"):
            matrix_from_euler(jnp.zeros(3), wrong)


# ---- nearest rotation


def test_orthonormalise_is_the_polar_factor():
    nearest = jax.jit(frames.orthonormalize)
    for scale in (1e-12, 1e-3, 1.0):
        R = np.asarray(EXP(RNG.normal(size=3)))
        A = R + scale * 0.3 * RNG.normal(size=(3, 3))
        u, _, vt = np.linalg.svd(A)
        if np.linalg.det(A) > 0:
            assert gap(nearest(A), u @ vt) < 10 * EXACT
    stretched = R @ np.diag([1e-3, 1.0, 1e3])
    u, _, vt = np.linalg.svd(stretched)
    assert gap(nearest(stretched), u @ vt) < 1e-12  # condition number 1e6
    drifted = R * (1 + 1e-5)
    assert gap(frames.orthonormalize(drifted, iterations=2), R) < 10 * EXACT
    for bad in (-np.eye(3), np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0])):
        assert jnp.isnan(nearest(bad)).all()


# ---- derivatives


def test_exponential_is_smooth_at_zero():
    # By its quaternion: the matrix is a polynomial in that.
    flat = jax.jit(ro.wxyz_from_rotation_vector)
    second = jax.jit(jax.jacfwd(jax.jacrev(flat)))
    first_fwd, first_rev = jax.jit(jax.jacfwd(flat)), jax.jit(jax.jacrev(flat))
    for scale in (0.0, 1e-9, 1e-3, 0.98, 1.02):  # the series meets the formula at 1
        phi = jnp.array([0.6, 0.0, -0.8]) * scale
        assert gap(first_fwd(phi), first_rev(phi)) < EXACT
        assert gap(first_fwd(phi), central_difference(flat, phi)) < DIFFED
        numeric = central_difference(lambda p: first_fwd(p).ravel(), phi)
        assert gap(second(phi).reshape(12, 3), numeric) < DIFFED
    about_y = jax.jvp(EXP, (jnp.zeros(3),), (jnp.eye(3)[1],))[1]
    assert gap(about_y, skew(jnp.eye(3)[1])) == 0


@pytest.mark.slow
def test_logarithm_and_axis_angle_derivatives():
    # Off the rotations the matrix functions mean nothing: compose with the exponential.
    turn = jnp.array([0.9, -0.3, 1.4])

    def chain(phi):
        R = ro.matrix_from_rotation_vector(phi)
        axis, angle = ro.axis_angle_from_matrix(R)
        euler = euler_from_matrix(R, "ZYX").angles
        return jnp.concatenate([ro.rotation_vector_from_matrix(R), axis, angle[None], euler])

    fn = jax.jit(chain)
    forward, reverse = jax.jit(jax.jacfwd(chain)), jax.jit(jax.jacrev(chain))
    for phi in (turn, 0.1 * turn, turn * (3.0 / jnp.linalg.norm(turn))):
        assert gap(forward(phi), reverse(phi)) < 100 * EXACT
        assert (
            gap(forward(phi), central_difference(fn, phi)) < 300 * DIFFED
        )  # fifth powers of 1/phi
        assert gap(forward(phi)[:3], np.eye(3)) < 1e-12
    for hard in (jnp.zeros(3), jnp.array([0.0, PI, 0.0]), jnp.array([1e-200, 0, 0])):
        assert jnp.isfinite(reverse(hard)).all()
        assert jnp.isfinite(forward(hard)).all()
    assert gap(forward(jnp.zeros(3))[:3], np.eye(3)) < EXACT
    assert gap(forward(jnp.array([1e-9, 0, 2e-9]))[:3], np.eye(3)) < 1e-12


def test_nothing_that_a_rate_may_call_sorts_scatters_or_needs_lapack():
    def rate(q, omega, A):
        R = ro.matrix_from_wxyz(ro.normalize_wxyz(q))
        angles = euler_from_matrix(R, "ZXZ").angles
        rates = euler_rates_from_body(angles, omega, "ZXZ").rates
        turn = ro.rotation_vector_from_wxyz(q)
        return ro.wxyz_rate_from_body(q, omega), rates, turn, frames.orthonormalize(A)

    used = set(primitives(jax.jit(rate), jnp.ones(4), jnp.ones(3), jnp.eye(3)))
    forbidden = {
        "sort",
        "scatter",
        "scatter-add",
        "gather",
        "eigh",
        "svd",
        "lu",
        "triangular_solve",
    }
    assert not used & forbidden


NO_ROTATIONS = {
    "reflection": np.diag([-1.0, 1.0, 1.0]),
    "inversion": -np.eye(3),
    "stretched": np.diag([2.0, 1.0, 1.0]),
    "scaled": 1.001 * np.eye(3),
    "sheared": np.eye(3) + 1e-6 * np.eye(3, k=1),
    "zero": np.zeros((3, 3)),
}
OF_ROTATIONS = {
    "axis_angle_from_matrix": ro.axis_angle_from_matrix,
    "rotation_vector_from_matrix": ro.rotation_vector_from_matrix,
    "wxyz_from_matrix": ro.wxyz_from_matrix,
    "tensor_in_world": lambda R: frames.tensor_in_world(R, jnp.eye(3)),
    "tensor_in_body": lambda R: frames.tensor_in_body(R, jnp.eye(3)),
    "euler_from_matrix": lambda R: euler_from_matrix(R, "ZYX"),
    "free_attitude": lambda R: free_attitude(R, [1.0, 2.0, 3.0], 0.1, I1=1.0, I3=2.0),
    "rotated": lambda R: box(1.0, [1.0, 2.0, 3.0]).rotated(R),
}


@pytest.mark.parametrize("name", OF_ROTATIONS)
def test_a_matrix_that_is_no_rotation_is_refused(name):
    function = OF_ROTATIONS[name]
    traced = jax.jit(function)
    for R in NO_ROTATIONS.values():
        with pytest.raises(ValueError, match=r"^R(_wb|0)?: expected a rotation: .* off by "):
            function(R)
        leaves = [x for x in jax.tree.leaves(traced(R)) if x.dtype == float]
        assert any(np.isnan(x).any() for x in leaves)
    close = _rotated_by_rounding()
    for x in (*jax.tree.leaves(function(close)), *jax.tree.leaves(traced(close))):
        assert np.isfinite(np.asarray(x)).all()


def _rotated_by_rounding():
    """A rotation after a thousand products."""
    R = Q = np.asarray(ROTMAT(jnp.array([1.0, 2.0, 3.0]), 0.7))
    for _ in range(1000):
        R = R @ Q
    return R


def test_no_quaternion_has_no_axis_and_no_rotation_vector():
    assert np.isnan(ro.axis_angle_from_wxyz([0.0, 0.0, 0.0, 0.0]).angle)
    assert np.isnan(ro.axis_angle_from_wxyz([0.0, 0.0, 0.0, 0.0]).axis).all()
    assert np.isnan(ro.rotation_vector_from_wxyz([0.0, 0.0, 0.0, 0.0])).all()


X, Y, Z = E = jnp.eye(3)
QUARTER = np.pi / 2


# ---- problem 45: a quarter turn about y, then one about x


def test_problem_45_two_quarter_turns():
    turned = [ro.rotate(X, QUARTER, ro.rotate(Y, QUARTER, e)) for e in E]
    assert gap(jnp.stack(turned), jnp.stack([Y, Z, X])) < EXACT  # x to y, y to z, z to x
    net = jnp.stack(turned, axis=1)
    v = jnp.array([0.2, -0.5, 3.0])
    assert gap(net @ v, [v[2], v[0], v[1]]) < EXACT
    for axis, angle in (
        ro.axis_angle_from_matrix(net),
        ro.compose_axis_angle(ro.AxisAngle(Y, QUARTER), ro.AxisAngle(X, QUARTER)),
    ):
        assert gap(angle, 2 * np.pi / 3) < EXACT
        assert gap(axis, np.ones(3) / np.sqrt(3)) < EXACT


# ---- problem 46: vecrot, rotmat and back


@pytest.mark.parametrize(
    ("n", "theta", "images"),
    [(X, QUARTER, (X, Z, -Y)), (Z, QUARTER, (Y, -X, Z)), (jnp.ones(3), 2 * np.pi / 3, (Y, Z, X))],
)
def test_problem_46_special_rotations_there_and_back(n, theta, images):
    matrix = ro.matrix_from_axis_angle(n, theta)
    for e, image in zip(E, images, strict=True):
        assert gap(ro.rotate(n, theta, e), image) < EXACT
        assert gap(matrix @ e, image) < EXACT
    axis, angle = ro.axis_angle_from_matrix(matrix)
    assert gap(angle, theta) < EXACT
    assert gap(axis, n / jnp.linalg.norm(n)) < EXACT
    assert gap(ro.matrix_from_axis_angle(axis, angle), matrix) < EXACT


def test_problem_46_odd_examples():
    # More than half a turn comes back as less than half about the other end of the axis.
    axis, angle = ro.axis_angle_from_matrix(
        ro.matrix_from_axis_angle(jnp.array([3.0, 0, 4.0]), 5.0)
    )
    assert gap(axis, [-0.6, 0.0, -0.8]) < EXACT
    assert gap(angle, 2 * np.pi - 5.0) < EXACT
    flip = jnp.diag(jnp.array([-1.0, 1.0, -1.0]))
    assert gap(ro.axis_angle_from_matrix(flip).axis, Y) == 0
    assert gap(ro.axis_angle_from_matrix(flip).angle, np.pi) == 0


# ---- problem 48: R = Rz Ry Rx


def test_problem_48_fixed_xyz_is_body_zyx_and_has_this_matrix():
    x, y, z = angles = jnp.array([0.3, -0.7, 1.9])
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    net = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    product = (
        ro.matrix_from_axis_angle(Z, z)
        @ ro.matrix_from_axis_angle(Y, y)
        @ ro.matrix_from_axis_angle(X, x)
    )
    assert gap(product, np.array(net)) < EXACT
    assert gap(matrix_from_euler(angles, "xyz"), product) < EXACT
    assert gap(matrix_from_euler(angles[::-1], "ZYX"), product) < EXACT
    assert gap(euler_from_matrix(product, "xyz").angles, angles) < EXACT
