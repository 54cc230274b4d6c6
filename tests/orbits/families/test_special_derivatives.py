"""Derivatives of special orbits' parameters against closed forms and special orbits found again."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cycles import Bautin, Moebius, Pitchfork, Torus, cycle
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

import jaxdyn
import orbits
from jaxdyn.continuation import Kind
from orbits.families import SpecialOrbit
from orbits.families.relocation import find_again
from orbits.families.surface import OrbitSurface

#: Cycles whose special point lies at -c^2 - 1/4, or at -c^2, where their parameter is a - c^2.
SPECIAL = {
    Kind.FOLD: (Bautin, -0.2, (0.85, 0.0), {"step": 0.05, "members": 10, "down": True}),
    Kind.BRANCH: (Pitchfork, -0.2, (1.0, 0.0, 0.0), {"step": 0.08, "members": 6}),
    Kind.DOUBLING: (Moebius, -0.2, (1.0, 0.0, 0.0, 0.0), {"step": 0.08, "members": 6}),
    Kind.TORUS: (Torus, -0.1, (1.0, 0.0, 0.0, 0.0), {"step": 0.06, "members": 6}),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SPECIAL)
def test_special_orbits_by_a_number_of_their_scenes(kind):
    system, a, start, options = SPECIAL[kind]

    def make(c):
        return lambda a: cycle(system, a + c * c - 0.09, start)

    known = make(jnp.asarray(0.3))
    family = orbits.continue_family(orbits.find(known(jnp.asarray(a))), known, a, **options)
    (point,) = family.special
    by_c = jax.value_and_grad(lambda c: orbits.differentiable(make(c), point).parameter)
    for value, slope in (by_c(0.3), jax.jit(by_c)(0.3)):
        assert value == point.parameter
        assert slope == pytest.approx(-0.6, abs=1e-8)
    # Found again with another number.
    known, other = SpecialOrbit.of(point), jnp.asarray(0.4)
    guess = np.asarray(known.orbit.y0), known.orbit.period
    again = find_again(known, make(other), known.parameter - 0.06, guess)
    assert again.parameter == pytest.approx(known.parameter - 0.07, abs=1e-11)
    assert again.orbit.ok
    if kind == Kind.FOLD:  # the others have their cycle everywhere
        with pytest.raises(orbits.SearchError, match="not found again"):
            find_again(known, make(other), known.parameter + 50.0, guess)


def bent(t, y, n):
    """Cycles of radius r with r^4 - b r^2 = a that turn at the rate 1 + r^2."""
    del t
    r2 = y[0] ** 2 + y[1] ** 2
    grow, turn = n[0] + n[1] * r2 - r2**2, 1 + r2
    return [grow * y[0] - turn * y[1], grow * y[1] + turn * y[0]]


@pytest.mark.slow
def test_the_orbit_at_a_fold_by_a_number_of_its_scene():
    def make(b):
        return lambda a: jaxdyn.ode(bent, [0.85, 0.0], 3.7, params=jnp.stack([jnp.asarray(a), b]))

    known, b = make(jnp.asarray(1.0)), jnp.asarray(1.0)
    family = orbits.continue_family(
        orbits.find(known(jnp.asarray(-0.2))), known, -0.2, down=True, members=8
    )
    (fold,) = family.special

    def numbers(b):
        point = orbits.differentiable(make(b), fold)
        orbit = point.orbit
        found = [point.parameter, orbit.period, orbit.amplitude("y0")]
        return jnp.stack(found)

    # At the fold r^2 = b / 2, a = -b^2 / 4.
    period = 2 * np.pi / 1.5
    np.testing.assert_allclose(numbers(b), [-0.25, period, np.sqrt(0.5)], rtol=1e-8)
    exact = [-0.5, -period / 3, np.sqrt(0.5) / 2]
    np.testing.assert_allclose(jax.jacfwd(numbers)(b), exact, rtol=1e-8)
    np.testing.assert_allclose(jax.jacrev(numbers)(b), exact, rtol=1e-8)


def rate(t, y, n):
    del t
    return [-y[1] - y[2], y[0] + n[0] * y[1], 0.2 + y[2] * (y[0] - n[1])]


def roessler(a):
    def make(c):
        numbers = jnp.stack([jnp.asarray(a, float), jnp.asarray(c, float)])
        return jaxdyn.ode(rate, [-3.76877, 0.627253, 0.0348004], 5.76, params=numbers)

    return make


def doubling(a):
    make = roessler(a)
    family = orbits.continue_family(orbits.find(make(2.6)), make, 2.6, within=(2.6, 3.0))
    return next(x for x in family.special if x.kind == Kind.DOUBLING)


@pytest.mark.slow
def test_the_first_doubling_of_roesslers_cycle_by_its_other_number():
    point = doubling(0.2)
    slope = jax.grad(lambda a: orbits.differentiable(roessler(a), point).parameter)(0.2)
    h = 2e-3
    p = {i: doubling(0.2 + i * h).parameter for i in (-2, -1, 1, 2)}
    differences = (8 * (p[1] - p[-1]) - (p[2] - p[-2])) / (12 * h)
    assert slope == pytest.approx(differences, rel=1e-7)
    # The orbit at the doubling, by the same number.
    orbit = orbits.differentiable(roessler(0.2)(point.parameter), point.orbit)
    assert np.isfinite(orbit.period)


def mathieu(t, y, n):
    return [y[1], -(n[0] - 2 * n[1] * jnp.cos(2 * t)) * y[0] - y[0] ** 3]


def stiffened(q):
    def make(a):
        numbers = jnp.stack([jnp.asarray(a, float), jnp.asarray(q, float)])
        return jaxdyn.ode(mathieu, [0.0, 0.0], np.pi, params=numbers)

    return make


@pytest.mark.slow
def test_a_doubling_of_a_conservative_scene_is_on_mathieus_curve():
    # At rest the two multipliers over the drive's period meet at -1 where a = b_1(q) or a_1(q).
    q = 0.5
    make = stiffened(q)
    family = orbits.continue_family(orbits.find(make(0.3)), make, 0.3, within=(0.3, 2.0))
    points = [x for x in family.special if x.kind == Kind.DOUBLING]
    exact = {-1: lambda q: mathieu_b(1, q), 1: lambda q: mathieu_a(1, q)}
    assert len(points) == 2
    for point, curve in zip(points, exact.values(), strict=True):
        assert point.parameter == pytest.approx(curve(q), abs=1e-9)
        slope = jax.grad(
            lambda q, point=point: orbits.differentiable(stiffened(q), point).parameter
        )(q)
        h = 1e-3
        differences = (8 * (curve(q + h) - curve(q - h)) - curve(q + 2 * h) + curve(q - 2 * h)) / (
            12 * h
        )
        assert slope == pytest.approx(differences, abs=1e-8)


def coupled(t, y, p):
    """x'' = -x, and beside it y'' = -(w^2 + k x^2) y, as a conservative scene."""
    del t
    x, u, v, w = y
    return [v, w, -x - p[1] * x * u**2, -p[0] * u - p[1] * x**2 * u]


def coupled_energy(t, y, p):
    del t
    x, u, v, w = y
    return 0.5 * (v**2 + w**2 + x**2 + p[0] * u**2 + p[1] * x**2 * u**2)


def beside(k):
    numbers = jnp.stack([jnp.asarray(0.8), jnp.asarray(k, float)])
    return jaxdyn.ode(coupled, [0.5, 0.0, 0.0, 0.0], 6.2, params=numbers, energy=coupled_energy)


@pytest.mark.slow
def test_the_energy_of_a_branch_point_of_a_conservative_scene_is_on_mathieus_curve():
    # With x = A cos t, y obeys Mathieu's equation: a = w^2 + k E, q = k E / 2 to its sign.
    def exact(k):
        return brentq(lambda e: 0.8 + k * e - mathieu_b(1, 0.5 * k * e), 0.01, 2.0, xtol=1e-15)

    scene = beside(0.5)
    family = orbits.continue_family(orbits.find(scene), energies=(0.0, 0.4), step=0.1, down=True)
    point = next(x for x in family.special if x.kind == Kind.BRANCH)
    assert point.energy == pytest.approx(exact(0.5), abs=1e-9)
    slope = jax.grad(lambda k: orbits.differentiable(beside(k), point).parameter)(0.5)
    h = 1e-3
    ends = {i: exact(0.5 + i * h) for i in (-2, -1, 1, 2)}
    differences = (8 * (ends[1] - ends[-1]) - ends[2] + ends[-2]) / (12 * h)
    assert slope == pytest.approx(differences, abs=1e-8)


def test_points_without_such_derivatives_are_refused(monkeypatch):
    def make(a):
        return cycle(Bautin, a, (1.1, 0.0))

    family = orbits.continue_family(orbits.find(make(jnp.asarray(0.3))), make, 0.3, members=1)
    with pytest.raises(ValueError, match=r"point: expected a fold, branch point, period.*\.orbit"):
        orbits.differentiable(make, family.members[0])
    orbit = family.members[0].orbit
    guess = np.asarray(orbit.y0), orbit.period
    fold = SpecialOrbit(Kind.FOLD, orbit, 0.3)
    with pytest.raises(ValueError, match="at which one direction leads along the family, got 0"):
        find_again(fold, make, 0.3, guess)
    with pytest.raises(ValueError, match=r"one direction .* got 0 directions. See hold="):
        find_again(fold, make, 0.3, guess, hold=orbits.Period(2 * orbit.period))
    monkeypatch.setattr(OrbitSurface, "nearest", lambda self, x: None)
    with pytest.raises(ValueError, match="point: expected an orbit that closes"):
        find_again(fold, make, 0.3, guess)


@pytest.mark.slow
def test_a_point_whose_multiplier_is_double_is_refused():
    def rate(t, y, c):
        return [y[1], -0.25 * y[0] + c * jnp.cos(t)]

    def make(c):
        return jaxdyn.ode(rate, [0.0, 0.0], 2 * jnp.pi, params=c)

    point = SpecialOrbit(Kind.TORUS, orbits.find(make(0.3)), 0.3)  # both are -1
    with pytest.raises(
        ValueError, match="point: expected a generic torus point, got one whose test"
    ):
        orbits.differentiable(make, point)


@pytest.mark.slow
def test_a_branch_point_with_an_integral_that_the_scene_does_not_name_is_refused():
    def make(k):
        numbers = jnp.stack([jnp.asarray(0.8), jnp.asarray(k, float)])
        return jaxdyn.ode(coupled, [0.5, 0.0, 0.0, 0.0], 6.2, params=numbers)

    orbit = orbits.find(make(0.5))
    with pytest.raises(ValueError, match="point: expected a branch point without symmetries"):
        orbits.differentiable(make, SpecialOrbit(Kind.BRANCH, orbit, 0.5))


@pytest.mark.slow
def test_other_numbers_than_those_of_the_point_give_an_error_or_nan():
    def rate(t, y, p):  # upright on a shaken pivot: rest is an orbit whatever the numbers are
        amplitude, lift = p
        return [y[1], (lift + amplitude * jnp.cos(t)) * jnp.sin(y[0]) - 0.1 * y[1]]

    def make(lift):
        return lambda amplitude: jaxdyn.ode(
            rate, [0.0, 0.0], 2 * jnp.pi, params=jnp.stack([jnp.asarray(amplitude, float), lift])
        )

    lift = jnp.asarray(0.1)
    rest = orbits.find(make(lift)(0.6))
    family = orbits.continue_family(rest, make(lift), 0.6, within=(0.45, 0.72))
    doubling = family.special[0]
    assert doubling.kind is Kind.DOUBLING
    right = jax.grad(lambda lift: orbits.differentiable(make(lift), doubling).parameter)
    assert np.isfinite(right(lift))
    assert np.isnan(right(1.01 * lift))
    with pytest.raises(
        ValueError, match=r"make: expected .* numbers with which the point was found"
    ):
        orbits.differentiable(make(1.01 * lift), doubling)

    def multiplier(lift):
        return orbits.differentiable(make(lift)(0.6), rest).multipliers()[0].real

    assert np.isfinite(jax.grad(multiplier)(lift))
    assert np.isnan(jax.grad(multiplier)(1.01 * lift))
    assert np.isnan(jax.vmap(multiplier)(1.01 * lift[None])).all()


def test_what_has_no_derivatives_is_refused_with_a_message():
    family = jaxdyn.continue_equilibria(
        lambda p: jaxdyn.ode(lambda t, y, p: [p - y[0] ** 2], [1.0], 1.0, params=p),
        1.0,
        [1.0],
        within=(-1.0, 2.0),
        down=True,
    )
    (fold,) = family.special
    with pytest.raises(ValueError, match="scene: expected a function parameter -> scene"):
        orbits.differentiable(jaxdyn.scenes.lorenz(), fold)
    with pytest.raises(ValueError, match="hold: expected none for an equilibrium"):
        orbits.differentiable(lambda p: jaxdyn.scenes.lorenz(), fold, hold="y0")
    with pytest.raises(ValueError, match=r"orbit: expected .*Member.* got 1.0"):
        orbits.differentiable(jaxdyn.scenes.lorenz(), 1.0)
