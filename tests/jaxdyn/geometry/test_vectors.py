"""Vectors and index notation: identities, second routes, degenerate cases, derivatives."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import DIFFED, EXACT, central_difference, gap

from jaxdyn.geometry.indices import check_indices, evaluate_indices, kronecker, levi_civita
from jaxdyn.geometry.vectors import (
    closest_points,
    cross,
    cross_by_geometry,
    cross_by_indices,
    dot,
    plane_rotation,
    rod_tensions,
    signed_volume,
    skew,
    tetrahedron_volume,
    unskew,
)

RNG = np.random.default_rng(41)
X, Y, Z = jnp.eye(3)
O = jnp.zeros(3)  # noqa: E741

lines = jax.jit(closest_points)
rods = jax.jit(rod_tensions)


def _random(*shape):
    return jnp.asarray(RNG.normal(size=shape))


def _flat(fn, n):
    """fn of n vectors as a function of their 3 n numbers."""
    return lambda x: fn(*x.reshape(n, 3))


# ---- products


@pytest.mark.parametrize("product", [cross, cross_by_indices, cross_by_geometry])
def test_cross_products_agree_and_distribute(product):
    a, b, c = _random(3, 64, 3)
    many = jax.jit(jax.vmap(product))
    assert gap(many(a, b), np.cross(a, b)) < 10 * EXACT
    assert gap(many(a, b + c), many(a, b) + many(a, c)) < 30 * EXACT
    assert gap(many(a, b), -many(b, a)) < 10 * EXACT


def test_cross_by_geometry_where_its_frame_is_hard_to_make():
    down = jnp.array([0.0, 1e-9, -1.0])
    slope = jax.jit(jax.jacrev(cross_by_geometry, argnums=(0, 1)))
    for a, b in [(Z, X), (-Z, X), (X, Y), (Y, Z), (down, X), (1e-200 * X, Y), (O, X), (X, X)]:
        assert gap(cross_by_geometry(a, b), cross(a, b)) < EXACT
        derivative = slope(a, b)
        assert all(jnp.isfinite(d).all() for d in derivative)
    assert gap(slope(-Z, X)[0], jax.jacrev(cross)(-Z, X)) < EXACT


def test_skew_is_the_cross_product_and_minus_epsilon():
    a, b = _random(2, 3)
    assert gap(skew(a) @ b, cross(a, b)) < EXACT
    assert gap(skew(a), -jnp.einsum("ijk,k->ij", levi_civita(), a)) == 0
    assert gap(unskew(skew(a)), a) == 0
    assert gap(unskew(skew(a) + jnp.outer(a, a)), a) < EXACT
    # S(a)^2 = a a^T - |a|^2 1
    assert gap(skew(a) @ skew(a), jnp.outer(a, a) - dot(a, a) * jnp.eye(3)) < 10 * EXACT


def test_levi_civita_is_the_determinant_of_permuted_axes():
    for d in (2, 3, 4):
        symbol = levi_civita(d)
        for index in itertools.product(range(d), repeat=d):
            assert symbol[index] == round(np.linalg.det(kronecker(d)[list(index)]))


def test_plane_rotation_is_multiplication_by_a_complex_phase():
    theta, r = 0.7, np.array([1.5, -0.4])
    turned = np.exp(1j * theta) * complex(*r)
    assert gap(plane_rotation(jnp.asarray(theta)) @ r, [turned.real, turned.imag]) < EXACT


# ---- lines


def test_closest_points_are_on_the_lines_and_their_connection_is_normal_to_both():
    points = _random(4, 256, 3)
    found = jax.vmap(closest_points)(*points)
    a, b, c, d = np.asarray(points)
    apart = np.asarray(found.on_cd - found.on_ab)
    size = 1 + np.abs(apart).max(axis=1) + np.abs(found.on_ab).max(axis=1)
    assert not found.parallel.any()
    assert gap(np.linalg.norm(apart, axis=1) / size, found.distance / size) < 100 * EXACT
    for p, q in [(a, b), (c, d)]:
        on = found.on_ab if p is a else found.on_cd
        assert np.max(np.abs(np.cross(on - p, q - p)).max(axis=1) / size) < 100 * EXACT
        assert np.max(np.abs(np.sum(apart * (q - p), axis=1)) / size) < 300 * EXACT


def test_distance_equals_least_squares():
    for a, b, c, d in np.asarray(_random(20, 4, 3)):
        (s, t), *_ = np.linalg.lstsq(np.stack([b - a, c - d], axis=1), c - a, rcond=None)
        best = np.linalg.norm(a + s * (b - a) - c - t * (d - c))
        assert gap(lines(a, b, c, d).distance, best) < 100 * EXACT


@pytest.mark.parametrize("stretch", [1.0, -3.7, 1e-3])
def test_parallel_lines(stretch):
    a, u, w = _random(3, 3)
    across = w - u * dot(w, u) / dot(u, u)
    found = lines(a, a + u, a + w, a + w + stretch * u)
    assert found.parallel
    assert gap(found.distance, jnp.linalg.norm(across)) < 10 * EXACT
    assert gap(found.on_cd - found.on_ab, across) < 10 * EXACT
    assert gap(cross(found.on_ab - a, u), O) < 10 * EXACT


def test_lines_that_meet_nearly_parallel_lines_and_no_lines():
    meet = lines(X, -X, Y, -Y)
    assert gap(meet.distance, 0.0) == 0
    assert gap(meet.on_ab, O) < EXACT
    assert not meet.parallel
    # The angle 1e-6 is far above rounding: the lines cross one above the other at the origin.
    near = lines(-X, X, Z - X - 1e-6 * Y, Z + X + 1e-6 * Y)
    assert not near.parallel
    assert gap(near.distance, 1.0) < 1e-9  # the angle leaves 10 of 16 digits
    for missing in [lines(X, X, Y, Z), lines(Y, Z, X, X)]:
        assert np.isnan([missing.distance, *missing.on_ab, *missing.on_cd]).all()


@pytest.mark.slow
def test_derivatives_of_lines_by_three_ways_and_where_they_are_hard():
    numbers = _random(12)

    @jax.jit
    def fn(x):
        found = closest_points(*x.reshape(4, 3))
        return jnp.concatenate([found.distance[None], found.on_ab, found.on_cd])

    reverse_mode = jax.jit(jax.jacrev(fn))
    forward, reverse = jax.jit(jax.jacfwd(fn))(numbers), reverse_mode(numbers)
    scale = float(jnp.max(jnp.abs(forward)))
    assert gap(forward / scale, reverse / scale) < 10 * EXACT
    assert gap(forward / scale, central_difference(fn, numbers) / scale) < 10 * DIFFED
    for hard in [(O, X, Z, Z + X), (X, -X, Y, -Y), (O, X, O, X)]:
        assert jnp.isfinite(reverse_mode(jnp.concatenate(hard))).all()


# ---- tetrahedra and rods


def test_volume_is_that_of_a_determinant_and_a_third_of_base_times_height():
    assert gap(signed_volume(O, X, Y, Z), 1 / 6) < EXACT
    a, b, c, d = points = np.asarray(_random(4, 3))
    volume = tetrahedron_volume(*points)
    assert gap(volume, abs(np.linalg.det([b - a, c - a, d - a])) / 6) < EXACT
    normal = np.cross(b - a, c - a)
    base, height = np.linalg.norm(normal) / 2, abs(normal @ (d - a)) / np.linalg.norm(normal)
    assert gap(volume, base * height / 3) < EXACT
    assert gap(signed_volume(b, a, c, d), -signed_volume(*points)) < EXACT
    # Slices parallel to the base shrink with the square of the distance from the tip.
    s = (np.arange(2000) + 0.5) / 2000
    assert gap(volume, np.mean(base * s**2) * height) < 1e-6  # midpoint rule, 1/24 n^2
    assert jnp.isfinite(jax.jacrev(_flat(tetrahedron_volume, 4))(jnp.zeros(12))).all()


def test_rod_tensions_balance_the_load():
    *points, force = _random(5, 3)
    found = rods(*points, force)
    a, b, c, d = points
    arms = np.stack([a - d, b - d, c - d])
    units = arms / np.linalg.norm(arms, axis=1, keepdims=True)
    assert not found.coplanar
    assert gap(found.tensions @ units, -force) < 100 * EXACT
    assert gap(found.tensions, np.linalg.solve(units.T, -force)) < 100 * EXACT
    hanging = rods(X + Z, Z - X + Y, Z - X - Y, O, -9.81 * Z)
    assert (hanging.tensions > 0).all()


@pytest.mark.parametrize("ends", [(X, Y, X + Y), (X, Y, Z * 0), (X, X, Z), (X, -X, Z)])
def test_coplanar_rods_are_reported(ends):
    shift = _random(3)
    found = rods(*(end + shift for end in ends), shift, Z)
    assert found.coplanar
    assert jnp.isnan(found.tensions).all()


@pytest.mark.slow
def test_derivatives_of_tensions():
    numbers = jnp.concatenate([X + 0.1, Y, Z - 0.2, 0.1 * X, jnp.array([1.0, 2.0, -0.5])])

    @jax.jit
    def fn(x):
        return rod_tensions(*x.reshape(5, 3)).tensions

    forward = jax.jit(jax.jacfwd(fn))(numbers)
    assert gap(forward, jax.jit(jax.jacrev(fn))(numbers)) < 10 * EXACT
    assert gap(forward, central_difference(fn, numbers)) < 10 * DIFFED
    batch = jnp.stack([numbers, numbers.at[6:9].set(numbers[3:6])])  # two rods to one point
    assert jnp.isnan(jax.vmap(fn)(batch)).any(axis=1).tolist() == [False, True]


# ---- index notation

A = np.arange(1.0, 10.0).reshape(3, 3)
B = np.array([[1.0, 0, 1], [0, 0, 1], [1, 0, 1]])
a = np.array([1.0, 0, 2])
b = np.ones(3)


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("c = a_i b_i", 3),
        ("c = delta_ll", 3),
        ("c_i = A_ij b_j", [6, 15, 24]),
        ("c_i = b_j A_ij", [6, 15, 24]),
        ("c_i = A_ji b_j", [12, 15, 18]),
        ("c = A_ij B_ij", 1 + 3 + 6 + 7 + 9),
        ("c = A_ij delta_ij", 15),
        ("c_k = B_jk b_k", None),
        ("c_i = A_ij B_jk", None),
        ("C_ik = A_ij B_jk", A @ B),
        ("delta_ij delta_jk delta_ki delta_ll", 9),
        ("c_k = epsilon_ijk a_i b_j", [-2, 1, 1]),
    ],
)
def test_problem_41_a_to_l(expression, value):
    check = check_indices(expression)
    assert check.sensible == (value is not None)
    if value is None:
        assert "in every term" in check.reason
        with pytest.raises(ValueError, match="free indices: expected"):
            evaluate_indices(expression, A=A, B=B, a=a, b=b)
    else:
        used = {n: x for n, x in dict(A=A, B=B, a=a, b=b).items() if n in expression}
        assert gap(evaluate_indices(expression, **used), np.asarray(value, dtype=float)) == 0


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("A_ij b_j + B_ki a_k", "A_lj b_j + B_kl a_k"),  # the four spellings of the course
        ("A_ij b_j + B_ki a_k", "A_ij b_j + B_ji a_j"),
        ("A_ij b_j + B_ki a_k", "A_jk b_k + B_kj a_k"),
        ("a_i delta_ij", "a_j"),
        ("a_i b_j delta_ij", "a_i b_i"),
        ("delta_ik delta_kj", "delta_ij"),
        ("epsilon_ijk epsilon_ilm", "delta_jl delta_km - delta_jm delta_kl"),
        ("epsilon_ijk epsilon_ijl", "2 delta_kl"),
        ("epsilon_ijk epsilon_ijk", "6"),
        ("epsilon_ijk", "epsilon_kij"),
        ("-1 A_ij", "-A_ij"),
    ],
)
def test_identities_of_index_notation(left, right):
    arrays = dict(A=A, B=B, a=a, b=b)
    sides = [
        f"{left} = {s}" if check_indices(f"{left} = {s}").sensible else s for s in (left, right)
    ]
    assert gap(*(evaluate_indices(side, **arrays) for side in sides)) == 0


def test_matrices_and_transposes_by_the_order_of_free_indices():
    M, N = np.asarray(_random(2, 2, 2))  # in the plane, sums run from 1 to 2
    assert gap(evaluate_indices("C_ki = M_ij N_jk", M=M, N=N), (M @ N).T) < EXACT
    assert gap(evaluate_indices("M_ij N_jk", M=M, N=N), M @ N) < EXACT
    assert (
        gap(evaluate_indices("2 M_ij*N_ij - M_ii", M=M, N=N), 2 * (M * N).sum() - M.trace()) < EXACT
    )
    assert gap(evaluate_indices("epsilon_ij M_ij", M=M), M[0, 1] - M[1, 0]) < EXACT
    product = jax.jit(lambda M: evaluate_indices("M_ij M_ij", M=M))
    assert gap(jax.grad(product)(M), 2 * M) < EXACT


def test_the_course_warns_that_an_array_is_no_scalar():
    assert check_indices("A_ii b_j + f_i g_i h_j = B_ii e_j") == (True, "j", "")
    assert check_indices("a_i b_i = 14").sensible


@pytest.mark.parametrize(
    ("expression", "reason"),
    [
        ("a_i = b_j", "free indices: expected i in every term, got j in 'b_j'"),
        (
            "a_i e_i b_i e_j",
            "index i: expected once or twice in a product, got 3 times",
        ),  # misprint
        ("c_i = b_i d_j e_j f_j", "index j: expected once or twice in a product, got 3 times"),
        ("R_ij R_ij = R_ij^2", "term: expected products of names with indices, A_ij, got '^2'"),
        ("c_i = ", "term: expected a product such as A_ij b_j, got nothing"),
        ("c_i = a_i +", "term: expected a product such as A_ij b_j, got nothing"),
        ("a_i = b_i = c_i", "expression: expected at most one '='"),
        ("c_i = a_i + 1", "free indices: expected i in every term, got none in '1'"),
    ],
)
def test_nonsense_is_explained(expression, reason):
    check = check_indices(expression)
    assert not check.sensible
    assert check.reason.startswith(reason)


def test_wrong_arrays_are_refused():
    with pytest.raises(ValueError, match="b: expected an array for each name in 'A_ij b_j'"):
        evaluate_indices("A_ij b_j", A=A)
    with pytest.raises(ValueError, match=r"b: expected shape \(3,\), got shape \(3, 3\)"):
        evaluate_indices("A_ij b_j", A=A, b=B)
    with pytest.raises(ValueError, match=r"b: expected shape \(3,\), got shape \(2,\)"):
        evaluate_indices("A_ij b_j", A=A, b=np.ones(2))


def test_problem_4_geometry_gives_components():
    basis = jnp.eye(3)
    a, b = jnp.asarray(RNG.normal(size=(2, 3)))
    c = cross_by_geometry(a, b)
    angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    length = np.linalg.norm(a) * np.linalg.norm(b) * np.sin(angle)
    assert gap(np.linalg.norm(c), length) < 10 * EXACT
    assert abs(a @ c) < 10 * EXACT
    assert abs(b @ c) < 10 * EXACT
    assert np.linalg.det(np.stack([a, b, c])) > 0  # the right hand
    by_rule = sum(
        a[i] * b[j] * cross_by_geometry(basis[i], basis[j]) for i in range(3) for j in range(3)
    )
    assert gap(by_rule, cross(a, b)) < 10 * EXACT
