"""Components of vectors and tensors in two bases."""

import jax.numpy as jnp
from helpers import EXACT, gap

from jaxdyn.geometry.frames import matrix_between, tensor_in_body, tensor_in_world
from jaxdyn.geometry.indices import evaluate_indices, levi_civita
from jaxdyn.geometry.rotations import matrix_from_axis_angle, rotate
from jaxdyn.geometry.vectors import skew

X, Y, Z = E = jnp.eye(3)

# ---- 42: one vector, one tensor, two bases

R = matrix_from_axis_angle(jnp.array([1.0, -2.0, 0.5]), 1.1)  # in the fixed basis F
BASIS = (R @ E).T  # e'_i = R e_i, one a row
r = jnp.array([0.3, 1.4, -0.8])
r_star = R @ r


def test_problem_42_a_b_c_components_of_vector_and_rotation():
    assert gap(jnp.stack([r @ e for e in E]), r) == 0
    assert (
        gap(jnp.stack([jnp.stack([E[i] @ R @ E[j] for j in range(3)]) for i in range(3)]), R) == 0
    )
    assert gap(matrix_between(E, BASIS), R) == 0
    spun = matrix_from_axis_angle(Y, 0.4)  # the bases need not be the coordinates' own
    assert gap(matrix_between(E @ spun.T, BASIS @ spun.T), R) < EXACT


def test_problem_42_d_to_g_components_of_the_turned_vector_in_both_bases():
    assert gap(r_star, evaluate_indices("s_i = R_ij r_j", R=R, r=r)) < EXACT
    in_turned_basis = jnp.stack([e @ r_star for e in BASIS])
    assert gap(in_turned_basis, r) < EXACT  # e: r*_Bi = r_i, whatever R is
    assert gap(r, evaluate_indices("r_i = R_ji s_j", R=R, s=r_star)) < EXACT  # f
    r_in_turned = jnp.stack([e @ r for e in BASIS])
    by_indices = evaluate_indices("q_i = R_ji R_kj s_k", R=R, s=r_star)
    assert gap(r_in_turned, by_indices) < EXACT  # g


def test_problem_42_h_i_j_the_rotation_in_its_own_basis():
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


def test_problem_42_vector_formula_as_a_tensor():
    n, theta = jnp.array([1.0, -2.0, 0.5]) / jnp.sqrt(5.25), 1.1
    dyads = sum(jnp.outer(BASIS[i], E[i]) for i in range(3))  # R = e'_i e_i
    nn = jnp.outer(n, n)
    tensor = nn + jnp.cos(theta) * (E - nn) + jnp.sin(theta) * skew(n)
    components = nn + jnp.cos(theta) * (E - nn)
    components = components - jnp.sin(theta) * jnp.einsum("ijk,k->ij", levi_civita(), n)
    for way in (dyads, tensor, components):
        assert gap(way, R) < EXACT
