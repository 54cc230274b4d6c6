"""Inertia of shapes and bodies against integrals, points and each other; balance; satellites."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import DIFFED, EXACT, central_difference, gap

from jaxdyn.geometry import inertia as ine
from jaxdyn.geometry.balance import bearing_forces
from jaxdyn.geometry.inertia import Body, equimomental, point, principal
from jaxdyn.geometry.rotations import matrix_from_axis_angle, matrix_from_rotation_vector
from jaxdyn.scenes.satellites import satellite_a, satellite_b, satellite_c

RNG = np.random.default_rng(54)
PRINCIPAL = jax.jit(principal)
POINTS = jax.jit(equimomental)
TURN = np.asarray(matrix_from_rotation_vector(jnp.array([0.4, -1.0, 0.7])))


def _same(a: Body, b: Body, tol=10 * EXACT) -> bool:
    gaps = gap(a.mass, b.mass), gap(a.centre, b.centre), gap(a.inertia, b.inertia)
    return max(gaps) < tol


def _gauss_points(n=8):
    """Gauss's points and weights in the cube from -1 to 1: exact for polynomials up to 2n - 1."""
    x, w = np.polynomial.legendre.leggauss(n)
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid, np.einsum("i,j,k->ijk", w, w, w).ravel()


def _inertia_of(r, m):
    return sum(mi * (ri @ ri * np.eye(3) - np.outer(ri, ri)) for ri, mi in zip(r, m, strict=True))


# ---- shapes


def test_box_ball_and_cylinder_against_integrals():
    x, w = _gauss_points()
    sides = np.array([1.0, 2.0, 0.5])
    box = ine.box_of_density(3.0, sides)
    assert gap(box.inertia, _inertia_of(x * sides / 2, 3.0 * w * sides.prod() / 8)) < 30 * EXACT
    # Spherical and cylindrical coordinates; the polar angle's cosine and the radius by Gauss.
    radius = 0.5 + 0.25 * (x[:, 0] + 1)  # from 1/2 to 1
    turn = np.pi * (x[:, 2] + 1)  # trigonometric, to rounding with 24 points
    s = np.sqrt(1 - x[:, 1] ** 2)
    r = radius[:, None] * np.stack([s * np.cos(turn), s * np.sin(turn), x[:, 1]], axis=1)
    shell = ine.sphere_of_density(2.0, 1.0, inner=0.5)
    assert gap(shell.mass, np.sum(2.0 * w * radius**2 * 0.25 * np.pi)) < 30 * EXACT
    assert (
        gap(np.trace(shell.inertia), np.trace(_inertia_of(r, 2.0 * w * radius**2 * 0.25 * np.pi)))
        < 1e-12
    )
    pipe = ine.cylinder_of_density(2.0, 1.0, 3.0, inner=0.5)
    r = np.stack([radius * np.cos(turn), radius * np.sin(turn), 1.5 * x[:, 1]], axis=1)
    m = 2.0 * w * radius * 0.25 * np.pi * 1.5
    assert gap(pipe.mass, m.sum()) < 30 * EXACT
    assert gap(np.trace(pipe.inertia), np.trace(_inertia_of(r, m))) < 1e-12
    assert gap(pipe.inertia[2, 2], np.sum(m * radius**2)) < 30 * EXACT


@pytest.mark.parametrize(
    ("body", "moments"),
    [  # the table of every textbook
        (ine.sphere(5.0, 2.0), [8, 8, 8]),
        (ine.sphere(3.0, 2.0, inner=2.0), [8, 8, 8]),
        (ine.rod(12.0, 2.0), [4, 4, 0]),
        (ine.disk(4.0, 2.0), [4, 4, 8]),
        (ine.disk(4.0, 2.0, inner=2.0), [8, 8, 16]),
        (ine.plate(12.0, (3.0, 4.0)), [16, 9, 25]),
        (ine.cylinder(12.0, 2.0, 4.0), [28, 28, 24]),
        (ine.box(12.0, (1.0, 2.0, 3.0)), [13, 10, 5]),
        (ine.point(2.0), [0, 0, 0]),
    ],
)
def test_textbook_moments(body, moments):
    assert gap(body.inertia, np.diag(np.array(moments, dtype=float))) < 10 * EXACT


# ---- composition


def test_bodies_add_like_integrals():
    a = ine.box(2.0, (1.0, 2.0, 3.0)).rotated(TURN).shifted([1.0, 0.0, -2.0])
    b = ine.sphere(3.0, 0.7).shifted([0.0, 4.0, 0.0])
    c = ine.cylinder(1.5, 0.3, 2.0).rotated(TURN.T)
    assert _same(a + b, b + a)
    assert _same((a + b) + c, a + (b + c), 100 * EXACT)
    assert _same(sum([b, c], a), a + b + c)
    p = np.array([0.3, -0.2, 5.0])
    assert gap((a + b).about(p), a.about(p) + b.about(p)) < 300 * EXACT
    assert gap((a + b).about((a + b).centre), (a + b).inertia) < EXACT
    assert _same((a + b).rotated(TURN), a.rotated(TURN) + b.rotated(TURN), 100 * EXACT)
    # Two half boxes are a box; a hole has negative mass.
    half = ine.box(1.0, (1.0, 2.0, 3.0))
    whole = half.shifted([0.5, 0, 0]) + half.shifted([-0.5, 0, 0])
    assert _same(whole, ine.box(2.0, (2.0, 2.0, 3.0)))
    hollow = ine.sphere_of_density(1.0, 1.0) + ine.sphere_of_density(-1.0, 0.5)
    assert _same(hollow, ine.sphere_of_density(1.0, 1.0, inner=0.5))
    with pytest.raises(TypeError):
        _ = a + 1.0


def test_check_refuses_what_no_body_has():
    with pytest.raises(ValueError, match=r"mass: expected > 0, got -1\.0\. Masses are in kg\."):
        ine.box(-1.0, (1.0, 1.0, 1.0)).check()
    with pytest.raises(ValueError, match="centre: expected finite numbers"):
        ine.point(1.0, (0.0, np.nan, 0.0)).check()
    with pytest.raises(ValueError, match="inertia: expected a symmetric matrix"):
        Body(1.0, np.zeros(3), np.eye(3) + np.eye(3, k=1)).check()
    with pytest.raises(ValueError, match="none is larger than the other two together"):
        equimomental(Body(1.0, np.zeros(3), np.diag([1.0, 2.0, 3.001])))
    assert jnp.isnan(POINTS(Body(1.0, np.zeros(3), np.diag([1.0, 2.0, 3.001]))).r).all()
    assert jnp.isnan(POINTS(Body(1.0, np.zeros(3), np.eye(3) - 2 * np.ones((3, 3)))).r).all()


# ---- principal axes

BODIES = {
    "any": ine.box(2.0, (1.0, 2.0, 3.0)).rotated(TURN)
    + ine.sphere(1.0, 0.3).shifted([1.0, 2.0, 0]),
    "flat": ine.plate(2.0, (1.0, 3.0)).rotated(TURN),
    "almost along x": ine.plate(1.0, (1.0, 3.0)).rotated(
        matrix_from_axis_angle(np.array([0.0, 1, 0]), np.pi / 2 + 1e-7)
    ),
    "rod": ine.rod(1.0, 2.0).rotated(TURN),
    "ball": ine.sphere(1.0, 1.0).rotated(TURN),
    "long": ine.cylinder(1.0, 0.1, 3.0).rotated(TURN),
    "coin": ine.disk(1.0, 2.0).rotated(TURN.T),
    "point": ine.point(1.0, (1.0, 2.0, 3.0)),
    "A": satellite_a(),
    "B": satellite_b(),
    "C": satellite_c(),
}


@pytest.mark.parametrize("name", BODIES)
def test_principal_axes_and_equimomental_points(name):
    body = BODIES[name]
    moments, axes = PRINCIPAL(body)
    assert gap(axes.T @ axes, np.eye(3)) < 3 * EXACT
    assert gap(np.linalg.det(axes), 1.0) < 3 * EXACT
    assert gap(axes @ np.diag(moments) @ axes.T, body.inertia) < 30 * EXACT
    assert (np.diff(moments) > -EXACT * (1 + moments[2])).all()
    r, m = POINTS(body)
    assert gap(m.sum(), body.mass) < EXACT
    assert gap(m @ r / m.sum(), body.centre) < EXACT
    # The bound 1e-12 of the mass of a flat body's thickness is dropped.
    assert gap(_inertia_of(np.asarray(r) - np.asarray(body.centre), m), body.inertia) < 30 * EXACT
    for derivative in (_slope_of_points(body), _slope_of_axes(body)):
        assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(derivative))


@jax.jit
def _slope_of_points(body):
    return jax.grad(lambda b: jnp.sum(jnp.cos(equimomental(b).r)))(body)


@jax.jit
def _slope_of_axes(body):
    return jax.grad(lambda b: sum(jnp.sum(jnp.cos(x)) for x in principal(b)))(body)


@pytest.mark.parametrize("name", ["ball", "long", "coin", "B"])
def test_free_axes_do_not_depend_on_rounding(name):
    body = BODIES[name]
    axes = PRINCIPAL(body).axes
    for _ in range(5):
        noise = 1e-15 * RNG.normal(size=(3, 3)) * np.trace(body.inertia)
        shaken = Body(body.mass, body.centre, body.inertia + noise + noise.T)
        assert gap(PRINCIPAL(shaken).axes, axes) < 1e-12
    assert gap(PRINCIPAL(BODIES["ball"]).axes, np.eye(3)) < 3 * EXACT


@pytest.mark.slow
def test_derivatives_of_moments_axes_and_points():
    base = BODIES["any"]

    def fn(x):
        change = jnp.array([[x[0], x[1], 0], [x[1], x[2], 0.1], [0, 0.1, 0]])
        inertia = base.inertia + change / 4  # small beside the gaps of the moments
        body = Body(base.mass, base.centre, inertia)
        moments, axes = principal(body)
        return jnp.concatenate([moments, axes.ravel(), equimomental(body).r.ravel()])

    x = jnp.array([0.1, -0.2, 0.3])
    forward = jax.jit(jax.jacfwd(fn))(x)
    assert gap(forward, jax.jit(jax.jacrev(fn))(x)) < 100 * EXACT
    assert gap(forward, central_difference(jax.jit(fn), x)) < DIFFED


def test_flat_bodies_and_equivalent_boxes():
    assert {name for name in BODIES if ine.is_flat(BODIES[name])} == {
        "flat", "almost along x", "rod", "coin", "point",
    }  # fmt: skip
    # Problem 51: moments 1, 2, 3 are exactly a flat plate's.
    plate = Body(1.0, np.zeros(3), np.diag([1.0, 2.0, 3.0]))
    assert ine.is_flat(plate)
    assert gap(ine.equivalent_box(plate), [np.sqrt(24.0), np.sqrt(12.0), 0.0]) < EXACT
    assert gap(ine.box(1.0, ine.equivalent_box(plate)).inertia, plate.inertia) < EXACT
    sides = ine.equivalent_box(ine.box(2.0, (3.0, 2.0, 1.0)).rotated(TURN))
    assert gap(sides, [3.0, 2.0, 1.0]) < 10 * EXACT
    assert jnp.isnan(ine.equivalent_box(Body(1.0, np.zeros(3), np.diag([1.0, 1, 3])))).any()


# ---- problem 54: balance

AXIS = (jnp.array([-3.0, 0.0, 0.0]), jnp.array([3.0, 0.0, 0.0]))


def _plus_sign():
    """Unit masses at the ends of a plus sign, turned by 30 degrees about z."""
    turn = matrix_from_axis_angle(np.array([0.0, 0.0, 1.0]), np.pi / 6)
    ends = [(1.0, 0, 0), (-1.0, 0, 0), (0, 1.0, 0), (0, -1.0, 0)]
    return [point(1.0, turn @ jnp.array(end)) for end in ends]


def test_plus_sign_is_balanced_by_its_inertia_and_mass_by_mass():
    masses, omega = _plus_sign(), jnp.array([2.0, 0.0, 0.0])
    found = bearing_forces(sum(masses[1:], masses[0]), *AXIS, 2.0)
    assert found.statically
    assert found.dynamically
    assert gap(found.at_a, np.zeros(3)) < 10 * EXACT
    assert gap(found.at_b, np.zeros(3)) < 10 * EXACT
    accelerations = [np.cross(omega, np.cross(omega, p.centre)) for p in masses]
    assert gap(np.sum(accelerations, axis=0), np.zeros(3)) < 10 * EXACT
    moments = [np.cross(p.centre, acc) for p, acc in zip(masses, accelerations, strict=True)]
    assert np.abs(moments).max() > 1  # each alone is not balanced
    assert gap(np.sum(moments, axis=0), np.zeros(3)) < 10 * EXACT


def test_bearings_carry_mass_times_acceleration_of_every_point():
    points = [
        point(m, r) for m, r in zip(RNG.uniform(1, 2, 5), RNG.normal(size=(5, 3)), strict=True)
    ]
    body, spin = sum(points[1:], points[0]), 1.7
    r_a, r_b = jnp.array([-1.0, 0.5, 2.0]), jnp.array([1.0, -1.0, 4.0])
    found = bearing_forces(body, r_a, r_b, spin)
    omega = spin * (r_b - r_a) / jnp.linalg.norm(r_b - r_a)
    ma = [p.mass * np.cross(omega, np.cross(omega, p.centre - r_a)) for p in points]
    moment = sum(np.cross(p.centre - r_a, f) for p, f in zip(points, ma, strict=True))
    assert gap(found.at_a + found.at_b, sum(ma)) < 100 * EXACT
    assert gap(np.cross(r_b - r_a, found.at_b), moment) < 100 * EXACT
    assert gap(found.force, sum(ma)) < 100 * EXACT
    assert gap(found.moment, moment) < 100 * EXACT
    assert not found.statically
    assert not found.dynamically


def test_static_is_not_dynamic_and_principal_axes_are_both():
    body = BODIES["any"].shifted(-BODIES["any"].centre)
    tilted = bearing_forces(body, *AXIS, 3.0)
    assert tilted.statically
    assert not tilted.dynamically
    for n in PRINCIPAL(body).axes.T:
        for direction in (n, -n):
            assert bearing_forces(body, -2 * direction, 3 * direction, 3.0).dynamically
    aside = bearing_forces(body.shifted([0.0, 1e-3, 0.0]), *AXIS, 3.0)
    assert not aside.statically
    assert gap(aside.force, [0.0, -1e-3 * body.mass * 9.0, 0.0]) < 100 * EXACT


def test_one_bearing_can_carry_everything():
    # Problem 54 f: sum m x y = 0 about bearing a at x = 0, yet sum m y = 1; all within 0 < x < 3.
    body = point(1.0, (1.0, 2.0, 0.0)) + point(1.0, (2.0, -1.0, 0.0))
    found = bearing_forces(body, jnp.zeros(3), jnp.array([3.0, 0.0, 0.0]), 2.0)
    assert gap(found.at_b, np.zeros(3)) < 10 * EXACT
    assert gap(found.at_a, [0.0, -4.0, 0.0]) < 10 * EXACT


# ---- problems 55 and 57: satellites


def test_satellite_a_has_three_different_moments():
    # By hand: balls of mass s = pi/6, inertia s/10; the cube's is 1/6; M = 1 + 2 s. About the
    # centre the second moments are s along (1, -1), s - 2 s^2/M along (1, 1), 0 along z.
    s = np.pi / 6
    own, M = 1 / 6 + 2 * s / 10, 1 + 2 * s
    moments, axes = PRINCIPAL(satellite_a())
    expected = [own + s - 2 * s * s / M, own + s, own + 2 * s - 2 * s * s / M]
    assert gap(moments, expected) < 3 * EXACT
    assert np.diff(moments).min() > 0.25
    assert gap(axes[:, 0], np.array([1, -1, 0]) / np.sqrt(2)) < EXACT  # the line of the balls
    assert gap(axes[:, 1], np.array([1, 1, 0]) / np.sqrt(2)) < EXACT
    assert gap(satellite_a().centre, [0.5 + s / M, 0.5 + s / M, 0.5]) < EXACT


def test_satellite_b_is_axisymmetric_and_c_is_dynamically_a_sphere():
    s = np.pi / 6
    moments, axes = PRINCIPAL(satellite_b())
    assert gap(moments[0], moments[1]) < EXACT
    assert moments[2] - moments[1] > 0.3
    assert gap(axes[:, 2], np.ones(3) / np.sqrt(3)) < EXACT
    body = satellite_c()
    assert gap(body.inertia, (1 / 6 + 0.6 * s + 4 * s) * np.eye(3)) < 3 * EXACT
    assert gap(body.centre, np.full(3, 0.5)) < EXACT
