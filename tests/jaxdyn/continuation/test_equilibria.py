"""Families of equilibria against closed forms."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import scenes
from jaxdyn.continuation import Kind, switch_branch
from jaxdyn.continuation.family import equilibrium_at
from jaxdyn.continuation.special import EquilibriumChart, special_points
from jaxdyn.continuation.units import Units


def _lorenz(rho):
    return scenes.lorenz(rho=rho)


def _planar(t, y, p):
    """The normal form of a Hopf point at p = 0 with frequency 2, in bent coordinates.

    r' = p r - r^3 / 2, and second = y - x^2 / 3: the coefficient is invariant under this change.
    """
    u, w = y
    v = w - u**2 / 3
    size = u**2 + v**2
    x_rate = p * u - 2.0 * v - 0.5 * u * size
    y_rate = p * v + 2.0 * u - 0.5 * v * size
    return [x_rate, y_rate + 2 * u * x_rate / 3]


def _cubic(t, y, p):
    return [p + 3 * y[0] - y[0] ** 3]


def _brusselator(t, y, p):
    x, z = y
    return [1.5 - (p + 1) * x + x**2 * z, p * x - x**2 * z]


def _transcritical(t, y, p):
    return [p * y[0] - 2.0 * y[0] ** 2, -y[1]]


def _saddle(t, y, p):
    """Eigenvalues 1 and p - 2, opposite at p = 1: a neutral saddle, no Hopf point."""
    return [y[0], (p - 2.0) * y[1]]


def _of(rate, k):
    def make(p):
        return jaxdyn.ode(rate, jnp.zeros(k), params=p)

    return make


BRUSSELATOR, CUBIC, PLANAR = _of(_brusselator, 2), _of(_cubic, 1), _of(_planar, 2)


def test_lorenz_loses_stability_at_its_subcritical_hopf_point():
    # rho = sigma (sigma + beta + 3) / (sigma - beta - 1) = 470 / 19, and
    # omega^2 = 2 sigma beta (sigma + 1) / (sigma - beta - 1): Sparrow (1982), The Lorenz Equations.
    family = jaxdyn.continue_equilibria(_lorenz, 20.0, [7.0, 7.0, 19.0], within=(14, 28))
    (hopf,) = family.special
    assert (hopf.kind, hopf.criticality) == (Kind.HOPF, "subcritical")
    np.testing.assert_allclose(hopf.parameter, 470 / 19, rtol=1e-13)
    np.testing.assert_allclose(hopf.frequency**2, 20 * (8 / 3) * 11 / (9 - 8 / 3), rtol=1e-12)
    assert hopf.residual < 1e-10
    expected = np.where(family.parameters < 470 / 19, "stable", "unstable")
    assert [x.verdict for x in family.members] == expected.tolist()
    x, _y, z = family.states.T
    np.testing.assert_allclose(z, family.parameters - 1, rtol=1e-12)
    np.testing.assert_allclose(x**2, 8 / 3 * z, rtol=1e-12)
    assert "subcritical Hopf point at 24.7368" in repr(family)


@pytest.mark.parametrize("down", [False, True])
def test_lorenz_branches_at_rho_1(down):
    family = jaxdyn.continue_equilibria(_lorenz, 0.5, [0.0, 0.0, 0.0], within=(0, 2))
    (point,) = family.special
    assert point.kind == Kind.BRANCH
    assert abs(point.parameter - 1) < 1e-12
    # No quadratic term, and a negative cubic one, so that the branches are stable.
    assert point.coefficient == 0
    assert point.name == "supercritical pitchfork"
    other = switch_branch(family, point, members=6, down=down)
    x, _, z = other.states.T
    assert ((x < 0) == down).all()
    np.testing.assert_allclose(z, other.parameters - 1, atol=1e-12)
    np.testing.assert_allclose(x**2, 8 / 3 * z, atol=1e-12)
    assert {member.verdict for member in other.members} == {"stable"}


def test_transcritical_branch_is_followed():
    family = jaxdyn.continue_equilibria(_of(_transcritical, 2), -0.5, [0.0, 0.0], within=(-1, 1))
    (point,) = family.special
    assert point.kind == Kind.BRANCH
    np.testing.assert_allclose(point.coefficient, -2.0, rtol=1e-12)
    other = switch_branch(family, point, members=5)
    np.testing.assert_allclose(other.states[:, 0], other.parameters / 2, atol=1e-12)


def _chua(t, y, a):
    x, v, z = y
    return jnp.stack([a * (v + x / 6 - x**3 / 16), x - v + z, -14 * v])


@pytest.mark.parametrize("down", [False, True])
def test_a_branch_at_one_value_of_the_parameter_has_no_folds(down):
    # For a = 0 all states with v = 0 and z = -x are equilibria.
    family = jaxdyn.continue_equilibria(_of(_chua, 3), -2.0, [0.0, 0.0, 0.0], within=(-2, 1))
    (point,) = family.special
    other = switch_branch(family, point, members=12, down=down)
    assert len(other.members) == 12
    assert {special.kind for special in other.special} <= {Kind.BRANCH}
    x, v, z = other.states.T
    assert (np.diff(np.abs(x)) > 0).all()
    np.testing.assert_allclose([other.parameters, v, z + x], 0.0, atol=1e-12)


@pytest.mark.slow
def test_first_lyapunov_coefficient_of_the_normal_form():
    # With |q| = 1, x = sqrt(2) z: the coefficient is 2 (-1/2) / 2.
    family = jaxdyn.continue_equilibria(PLANAR, -0.3, [0.0, 0.0], within=(-0.5, 0.5))
    (hopf,) = family.special
    assert hopf.criticality == "supercritical"
    np.testing.assert_allclose([hopf.parameter, hopf.frequency], [0.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(hopf.coefficient, -0.5, rtol=1e-12)


def test_brusselator_has_its_hopf_point_at_1_plus_a_squared():
    family = jaxdyn.continue_equilibria(BRUSSELATOR, 2.0, [1.5, 1.3], within=(1, 5))
    (hopf,) = family.special
    np.testing.assert_allclose([hopf.parameter, hopf.frequency], [1 + 1.5**2, 1.5], rtol=1e-12)
    assert hopf.criticality == "supercritical"


def test_folds_of_a_cubic():
    # p = x^3 - 3 x turns at x = -1 and 1, where f'' / 2 = -3 x and f''' / 6 = -1.
    family = jaxdyn.continue_equilibria(CUBIC, -5.0, [-2.5], within=(-6, 5))
    assert [x.kind for x in family.special] == [Kind.FOLD, Kind.FOLD]
    found = [(x.state[0], x.parameter, x.coefficient, x.cubic) for x in family.special]
    np.testing.assert_allclose(found, [(-1, 2, 3, -1), (1, -2, -3, -1)], rtol=1e-12)
    assert all(x.residual < 1e-10 for x in family.special)
    stable = [member.verdict == "stable" for member in family.members]
    assert stable == (np.abs(family.states[:, 0]) > 1).tolist()


def test_neutral_saddle_is_no_hopf_point():
    family = jaxdyn.continue_equilibria(_of(_saddle, 2), 0.5, [0.0, 0.0], within=(0, 1.5))
    assert all(point.kind != Kind.HOPF for point in family.special)


def test_driven_scenes_and_wrong_arguments_are_refused():
    def driven(t, y, p):
        return [p - y[0] + jnp.cos(t)]

    with pytest.raises(ValueError, match="an autonomous scene"):
        jaxdyn.continue_equilibria(_of(driven, 1), 0.0, [0.0])

    def shaken(t, y, p):
        return [y[1], (p + jnp.cos(t)) * jnp.sin(y[0])]

    with pytest.raises(ValueError, match="an autonomous scene"):
        jaxdyn.continue_equilibria(_of(shaken, 2), 0.5, [0.0, 0.0])
    with pytest.raises(ValueError, match="1 entries"):
        jaxdyn.continue_equilibria(CUBIC, -5.0, [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="the lower one first"):
        jaxdyn.continue_equilibria(CUBIC, -5.0, [-2.5], within=(1, 0))
    with pytest.raises(ValueError, match="parameter: expected one within the bounds 0 and 1, got"):
        jaxdyn.continue_equilibria(CUBIC, -5.0, [-2.5], within=(0, 1))
    with pytest.raises(ValueError, match="a regular point"):
        jaxdyn.continue_equilibria(_of(_transcritical, 2), 0.0, [0.0, 0.0])
    family = jaxdyn.continue_equilibria(CUBIC, -5.0, [-2.5], members=2)
    with pytest.raises(ValueError, match="a branch point"):
        switch_branch(family, family.members[0])


def _nowhere(t, y, p):
    return [1.0 + p**2 + y[0] ** 2]


def test_a_start_without_equilibrium_is_refused():
    with pytest.raises(ValueError, match="a state near an equilibrium"):
        jaxdyn.continue_equilibria(_of(_nowhere, 1), 0.5, [1.0])


def test_family_ends_where_the_rate_does():
    def root(t, y, p):
        return [jnp.sqrt(p) - y[0]]

    family = jaxdyn.continue_equilibria(_of(root, 1), 1.0, [1.0], down=True, within=(-2, 3))
    assert "no equilibrium was found beyond" in family.end
    assert math.isfinite(family.parameters[-1])
    assert 0 <= family.parameters[-1] < 0.1


@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("start", [0.0, 1e-9, 3e-5])
def test_family_that_begins_at_a_fold(start, down):
    # At p = 0 the equation p = y^2 is singular, and the parameter grows in both directions.
    family = jaxdyn.continue_equilibria(_square, 0.0, [start], members=6, down=down)
    assert [(x.kind, x.parameter) for x in family.special] == [(Kind.FOLD, 0.0)]
    assert np.all(np.diff(family.states[:, 0]) * (-1 if down else 1) > 0)
    np.testing.assert_allclose(family.states[:, 0] ** 2, family.parameters, rtol=1e-13)


def test_state_beside_a_fold_without_equilibrium_is_refused():
    with pytest.raises(ValueError, match="start: expected a state near an equilibrium"):
        jaxdyn.continue_equilibria(_square, -1e-4, [0.0])


def _square(p):
    return jaxdyn.ode(lambda t, y, p: p - y**2, [0.0], 1.0, params=p)


def test_roesslers_fold_is_a_zero_hopf_point_where_a_is_b():
    """At c = 2 a the equilibria meet, and the other eigenvalues are +-i sqrt(2 - a^2)."""
    a = 0.2

    def rate(t, y, c):
        return [-y[1] - y[2], y[0] + a * y[1], a + y[2] * (y[0] - c)]

    family = jaxdyn.continue_equilibria(
        lambda c: jaxdyn.ode(rate, [0.0, 0.0, 0.0], params=c),
        2.0,
        [0.02, -0.1, 0.1],
        down=True,
        within=(0, 3),
    )
    fold, hopf = sorted(family.special, key=lambda point: point.kind != Kind.FOLD)
    assert (fold.name, hopf.name) == ("fold", "zero-Hopf point")
    np.testing.assert_allclose([fold.parameter, hopf.parameter], 2 * a, rtol=1e-12)
    np.testing.assert_allclose(hopf.frequency, math.sqrt(2 - a**2), rtol=1e-12)
    assert math.isnan(hopf.coefficient)  # it has a pole there


def test_pendulum_under_torque_folds_at_the_weight():
    # A second-order scene at rest: sin(theta) = p folds at 1, theta = pi / 2.
    def rate(t, y, p):
        return [y[1], p - jnp.sin(y[0]) - 0.3 * y[1]]

    family = jaxdyn.continue_equilibria(_of(rate, 2), 0.2, [0.2], within=(0, 2), members=30)
    fold = family.special[0]
    assert fold.kind == Kind.FOLD
    np.testing.assert_allclose([fold.parameter, fold.state[0]], [1.0, math.pi / 2], rtol=1e-12)


def test_bead_on_a_turning_hoop_branches_where_the_eigenvalue_0_is_double():
    # Conservative, and the test for the branch point is linear in p, so that it is hit exactly:
    # theta = 0 loses stability at p = 1 to cos(theta) = 1 / p.
    def rate(t, y, p):
        return [y[1], jnp.sin(y[0]) * (p * jnp.cos(y[0]) - 1.0)]

    family = jaxdyn.continue_equilibria(_of(rate, 2), 0.5, [0.0], within=(0, 2))
    (point,) = family.special
    assert point.kind == Kind.BRANCH
    np.testing.assert_allclose(point.x, [0, 0, 1], atol=1e-12)
    # There theta'' = sin(theta) (cos(theta) - 1) = -theta^3 / 2.
    assert point.coefficient == 0
    assert point.cubic == pytest.approx(-0.5, rel=1e-12)
    assert "supercritical pitchfork at 1" in repr(family)
    other = switch_branch(family, point, members=4)
    np.testing.assert_allclose(np.cos(other.states[:, 0]) * other.parameters, 1.0, rtol=1e-12)


def test_the_triangular_points_lose_stability_at_rouths_mass_ratio():
    start = scenes.libration_point(scenes.restricted_three_body(mu=0.01), "L4")
    family = jaxdyn.continue_equilibria(
        lambda mu: scenes.restricted_three_body(mu=mu), 0.01, start, within=(0.01, 0.06)
    )
    (point,) = family.special
    assert point.kind == Kind.KREIN
    assert point.parameter == pytest.approx((1 - math.sqrt(69) / 9) / 2, rel=1e-14)
    assert point.frequency == pytest.approx(math.sqrt(0.5), rel=1e-14)
    assert [x.verdict for x in family.members][-1] == "unstable"


def test_a_rate_in_which_time_cancels_but_for_rounding_has_equilibria():
    def rate(t, y, p):
        nothing = jnp.cos(2 * t) - jnp.cos(t) ** 2 + jnp.sin(t) ** 2
        return [p - y[0] + nothing]

    family = jaxdyn.continue_equilibria(_of(rate, 1), 0.5, [0.5], within=(0.5, 0.6))
    np.testing.assert_allclose(family.states[:, 0], family.parameters, rtol=1e-12)


def test_pairs_that_pass_one_another_or_are_the_same_do_not_collide():
    for square in (lambda p: p, lambda p: 2.0):  # of the second frequency; that of the first is p

        def rate(t, y, p, square=square):
            return [y[2], y[3], -p * y[0], -square(p) * y[1]]

        family = jaxdyn.continue_equilibria(_of(rate, 4), 1.0, np.zeros(4), within=(0.5, 3))
        assert not family.special


@pytest.mark.parametrize("time", [1.0, 1e-3, 5e4])
def test_coefficients_of_conservative_scenes_are_per_time_squared(time):
    # At the fold x = 1, p = 0 of x'' = p - (x - 1)^2 + 3 (x - 1)^3, in units of `time`.
    def rate(t, y, p):
        x = y[0] - 1.0
        return [y[1], (p - x**2 + 3.0 * x**3) / time**2]

    family = jaxdyn.continue_equilibria(_of(rate, 2), 0.01, [1.11, 0.0], within=(-1, 1), down=True)
    fold = family.special[0]
    assert (fold.name, fold.parameter) == ("fold", pytest.approx(0, abs=1e-12))
    wanted = np.array([-1.0, 3.0]) / time**2
    np.testing.assert_allclose([fold.coefficient, fold.cubic], wanted, rtol=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_whether_a_pitchfork_is_supercritical(sign):
    family = jaxdyn.continue_equilibria(
        _of(lambda t, y, p: [p * y[0] - sign * y[0] ** 3], 1), -0.5, [0.0], within=(-1, 1)
    )
    (point,) = family.special
    assert point.criticality == ("supercritical" if sign > 0 else "subcritical")
    transcritical = _of(lambda t, y, p: [p * y[0] - sign * y[0] ** 2], 1)
    (point,) = jaxdyn.continue_equilibria(transcritical, -0.5, [0.0], within=(-1, 1)).special
    assert (point.name, point.criticality) == ("branch point", "")


def test_a_constrained_scene_is_refused_by_name():
    def make(g):
        return scenes.pendulum(g=g, formulation="constrained")

    with pytest.raises(ValueError, match="a scene without constraints"):
        jaxdyn.continue_equilibria(make, 9.81, make(9.81).y0)


@pytest.mark.slow
def test_a_member_that_is_special_itself_is_found_once():
    def rate(t, y, p):
        return [p * y[0] - 2.0 * y[1], p * y[1] + 2.0 * y[0]]

    # The first member,
    family = jaxdyn.continue_equilibria(_of(rate, 2), 0.0, [0.0, 0.0], step=1.0, members=3)
    (hopf,) = family.special
    assert (hopf.kind, hopf.parameter) == (Kind.HOPF, 0.0)
    # and one on the way.
    chart = EquilibriumChart(_of(rate, 2), Units(np.ones(2), np.ones(1), 1.0))
    make = chart.make
    up = np.array([0.0, 0.0, 1.0])
    before, here, after = (equilibrium_at(make, p * up, up, 0.0) for p in (-1.0, 0.0, 1.0))
    (hopf,) = special_points(chart, before, here)
    assert (hopf.kind, hopf.parameter) == (Kind.HOPF, 0.0)
    assert special_points(chart, here, after) == []


def uncoupled(part, apart):
    """Two equal systems of one entry or two, the second one with its parameter shifted."""

    def rate(t, y, p):
        half = len(y) // 2
        return jnp.concatenate([part(y[:half], p, 1.0), part(y[half:], p - apart, 1.7)])

    return lambda p: jaxdyn.ode(rate, jnp.zeros(2 if part is pitchfork else 4), 10.0, params=p)


def pitchfork(x, p, _):
    return (p - 0.5) * x - x**3


def growing_swing(x, p, frequency):
    turned = jnp.stack([-x[1], x[0]])
    return (p - 0.5 - x @ x) * x + frequency * turned


@pytest.mark.parametrize("apart", [0.01, 1e-5, 0.0])
@pytest.mark.parametrize(
    ("part", "kind"), [(pitchfork, Kind.BRANCH), (growing_swing, Kind.HOPF)], ids=["branch", "Hopf"]
)
def test_two_points_of_a_kind_within_a_step(part, kind, apart):
    make = uncoupled(part, apart)
    family = jaxdyn.continue_equilibria(make, 0.0, make(0.0).y0, within=(0, 2))
    wanted = sorted({0.5, 0.5 + apart})
    assert [x.kind for x in family.special] == [kind] * len(wanted)
    assert np.abs([x.parameter for x in family.special] - np.array(wanted)).max() < 1e-14
    if kind == Kind.HOPF:
        assert {x.criticality for x in family.special} <= {"", "supercritical"}
        assert all(min(abs(x.frequency - w) for w in (1, 1.7)) < 1e-12 for x in family.special)
    else:
        assert [math.isnan(x.coefficient) for x in family.special] == [not apart] * len(wanted)


def test_a_pair_that_becomes_real_after_its_hopf_point_is_no_branch_point():
    def rate(t, y, p):
        return [y[1], (p - 0.3) * y[1] - 0.01 * y[0]]

    family = jaxdyn.continue_equilibria(
        lambda p: jaxdyn.ode(rate, [0.0, 0.0], 10.0, params=p), 0.0, [0.0, 0.0], within=(0, 2)
    )
    assert [x.kind for x in family.special] == [Kind.HOPF]
    assert abs(family.special[0].parameter - 0.3) < 1e-14
