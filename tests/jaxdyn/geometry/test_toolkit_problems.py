"""Problems 4, 42, 45, 46, 48 and 57 of the course, part by part (41 is in test_vectors)."""

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import EXACT, gap

from jaxdyn.course.satellite_claims import satellite_claims
from jaxdyn.geometry.euler import euler_from_matrix, matrix_from_euler
from jaxdyn.geometry.frames import matrix_between, tensor_in_body, tensor_in_world
from jaxdyn.geometry.indices import evaluate_indices, levi_civita
from jaxdyn.geometry.inertia import principal
from jaxdyn.geometry.rotations import (
    AxisAngle,
    axis_angle_from_matrix,
    compose_axis_angle,
    matrix_from_axis_angle,
    rotate,
)
from jaxdyn.geometry.vectors import cross, cross_by_geometry, skew
from jaxdyn.scenes.satellites import SATELLITES

RNG = np.random.default_rng(46)
X, Y, Z = E = jnp.eye(3)
QUARTER = np.pi / 2


# ---- 4: cross product


def test_4_geometry_gives_components():
    a, b = jnp.asarray(RNG.normal(size=(2, 3)))
    c = cross_by_geometry(a, b)
    angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    length = np.linalg.norm(a) * np.linalg.norm(b) * np.sin(angle)
    assert gap(np.linalg.norm(c), length) < 10 * EXACT
    assert abs(a @ c) < 10 * EXACT
    assert abs(b @ c) < 10 * EXACT
    assert np.linalg.det(np.stack([a, b, c])) > 0  # the right hand
    by_rule = sum(a[i] * b[j] * cross_by_geometry(E[i], E[j]) for i in range(3) for j in range(3))
    assert gap(by_rule, cross(a, b)) < 10 * EXACT


# ---- 42: one vector, one tensor, two bases

R = matrix_from_axis_angle(jnp.array([1.0, -2.0, 0.5]), 1.1)  # in the fixed basis F
BASIS = (R @ E).T  # e'_i = R e_i, one a row
r = jnp.array([0.3, 1.4, -0.8])
r_star = R @ r


def test_42_a_b_c_components_of_vector_and_rotation():
    assert gap(jnp.stack([r @ e for e in E]), r) == 0
    assert (
        gap(jnp.stack([jnp.stack([E[i] @ R @ E[j] for j in range(3)]) for i in range(3)]), R) == 0
    )
    assert gap(matrix_between(E, BASIS), R) == 0
    spun = matrix_from_axis_angle(Y, 0.4)  # the bases need not be the coordinates' own
    assert gap(matrix_between(E @ spun.T, BASIS @ spun.T), R) < EXACT


def test_42_d_to_g_components_of_the_turned_vector_in_both_bases():
    assert gap(r_star, evaluate_indices("s_i = R_ij r_j", R=R, r=r)) < EXACT
    in_turned_basis = jnp.stack([e @ r_star for e in BASIS])
    assert gap(in_turned_basis, r) < EXACT  # e: r*_Bi = r_i, whatever R is
    assert gap(r, evaluate_indices("r_i = R_ji s_j", R=R, s=r_star)) < EXACT  # f
    r_in_turned = jnp.stack([e @ r for e in BASIS])
    by_indices = evaluate_indices("q_i = R_ji R_kj s_k", R=R, s=r_star)
    assert gap(r_in_turned, by_indices) < EXACT  # g


def test_42_h_i_j_the_rotation_in_its_own_basis():
    R_B = jnp.stack([jnp.stack([a @ R @ b for b in BASIS]) for a in BASIS])
    assert gap(R_B, R) < EXACT  # h: R^T R R = R
    assert gap(tensor_in_body(R, R), R) < EXACT
    ways = [
        rotate(jnp.array([1.0, -2.0, 0.5]), 1.1, r),
        sum(r[i] * BASIS[i] for i in range(3)),  # r_i e'_i
        R @ R @ jnp.stack([e @ r for e in BASIS]),  # R R_B r_B
        evaluate_indices("s_i = R_ij r_j", R=R, r=r),
    ]
    assert max(gap(way, r_star) for way in ways) < EXACT  # i
    A = sum(R[i, j] * jnp.outer(BASIS[i], BASIS[j]) for i in range(3) for j in range(3))
    assert gap(A, R) < EXACT  # j: A_ij = R_ij, since R R R^T = R
    assert gap(tensor_in_world(R, R), R) < EXACT


def test_42_vector_formula_as_a_tensor():
    n, theta = jnp.array([1.0, -2.0, 0.5]) / jnp.sqrt(5.25), 1.1
    dyads = sum(jnp.outer(BASIS[i], E[i]) for i in range(3))  # R = e'_i e_i
    nn = jnp.outer(n, n)
    tensor = nn + jnp.cos(theta) * (E - nn) + jnp.sin(theta) * skew(n)
    components = nn + jnp.cos(theta) * (E - nn)
    components = components - jnp.sin(theta) * jnp.einsum("ijk,k->ij", levi_civita(), n)
    for way in (dyads, tensor, components):
        assert gap(way, R) < EXACT


# ---- 45: a quarter turn about y, then one about x


def test_45_two_quarter_turns():
    turned = [rotate(X, QUARTER, rotate(Y, QUARTER, e)) for e in E]
    assert gap(jnp.stack(turned), jnp.stack([Y, Z, X])) < EXACT  # x to y, y to z, z to x
    net = jnp.stack(turned, axis=1)
    v = jnp.array([0.2, -0.5, 3.0])
    assert gap(net @ v, [v[2], v[0], v[1]]) < EXACT
    for axis, angle in (
        axis_angle_from_matrix(net),
        compose_axis_angle(AxisAngle(Y, QUARTER), AxisAngle(X, QUARTER)),
    ):
        assert gap(angle, 2 * np.pi / 3) < EXACT
        assert gap(axis, np.ones(3) / np.sqrt(3)) < EXACT


# ---- 46: vecrot, rotmat and back


@pytest.mark.parametrize(
    ("n", "theta", "images"),
    [(X, QUARTER, (X, Z, -Y)), (Z, QUARTER, (Y, -X, Z)), (jnp.ones(3), 2 * np.pi / 3, (Y, Z, X))],
)
def test_46_special_rotations_there_and_back(n, theta, images):
    matrix = matrix_from_axis_angle(n, theta)
    for e, image in zip(E, images, strict=True):
        assert gap(rotate(n, theta, e), image) < EXACT
        assert gap(matrix @ e, image) < EXACT
    axis, angle = axis_angle_from_matrix(matrix)
    assert gap(angle, theta) < EXACT
    assert gap(axis, n / jnp.linalg.norm(n)) < EXACT
    assert gap(matrix_from_axis_angle(axis, angle), matrix) < EXACT


def test_46_odd_examples():
    # More than half a turn comes back as less than half about the other end of the axis.
    axis, angle = axis_angle_from_matrix(matrix_from_axis_angle(jnp.array([3.0, 0, 4.0]), 5.0))
    assert gap(axis, [-0.6, 0.0, -0.8]) < EXACT
    assert gap(angle, 2 * np.pi - 5.0) < EXACT
    flip = jnp.diag(jnp.array([-1.0, 1.0, -1.0]))
    assert gap(axis_angle_from_matrix(flip).axis, Y) == 0
    assert gap(axis_angle_from_matrix(flip).angle, np.pi) == 0


# ---- 48: R = Rz Ry Rx


def test_48_fixed_xyz_is_body_zyx_and_has_this_matrix():
    x, y, z = angles = jnp.array([0.3, -0.7, 1.9])
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    net = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    product = (
        matrix_from_axis_angle(Z, z) @ matrix_from_axis_angle(Y, y) @ matrix_from_axis_angle(X, x)
    )
    assert gap(product, np.array(net)) < EXACT
    assert gap(matrix_from_euler(angles, "xyz"), product) < EXACT
    assert gap(matrix_from_euler(angles[::-1], "ZYX"), product) < EXACT
    assert gap(euler_from_matrix(product, "xyz").angles, angles) < EXACT


@pytest.mark.slow
def test_the_claims_of_problem_57():
    claims = {claim.name: claim for claim in satellite_claims()}
    assert [name for name, claim in claims.items() if not claim.holds] == ["A ii", "A iii d"]
    a, b = (principal(SATELLITES[name]()).moments for name in "AB")
    np.testing.assert_allclose(claims["A i"].figure, np.diff(a).min() / a[2], rtol=1e-12)
    # Landau and Lifshitz, Mechanics, section 37: omega_2 is sn, here from its largest on.
    H2 = (np.cos(0.15) * a[1]) ** 2 + (np.sin(0.15) * a[2]) ** 2
    T2 = np.cos(0.15) ** 2 * a[1] + np.sin(0.15) ** 2 * a[2]
    rate = np.sqrt((a[2] - a[1]) * (H2 - T2 * a[0]) / np.prod(a))
    k2 = (a[1] - a[0]) * (T2 * a[2] - H2) / ((a[2] - a[1]) * (H2 - T2 * a[0]))
    half = 2 * float(mpmath.ellipk(float(k2))) / rate
    assert claims["A iii c"].figure == round(60.0 / half)
    assert claims["B i"].figure == abs(b[1] - b[0]) / b[2]
