"""Curves of folds and Hopf points in two parameters against closed forms and published figures."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import drawing
from jaxdyn.continuation import CodimensionTwo, Curve, Kind
from jaxdyn.continuation.curve import CurvePoint
from jaxdyn.continuation.normal_forms import first_lyapunov, lyapunov_coefficients


def _imperfect(p, q):
    """The imperfect pitchfork: folds at 27 p^2 = 4 q^3, where 3 x^2 = q."""
    return jaxdyn.ode(lambda t, y, c: [c[0] + c[1] * y[0] - y[0] ** 3], [0.0], params=[p, q])


def _bogdanov_takens(p, q):
    """The normal form: folds at 4 p = q^2, Hopf points at p = 0, q < 0."""

    def rate(t, y, c):
        return [y[1], c[0] + c[1] * y[0] + y[0] ** 2 - y[0] * y[1]]

    return jaxdyn.ode(rate, [0.0, 0.0], params=[p, q])


def _bautin(p, q):
    """r' = p r + q r^3 - r^5 at the angular velocity 2: the coefficient is q of |q| = 1, halved."""

    def rate(t, y, c):
        r = y[0] ** 2 + y[1] ** 2
        grows = c[0] + c[1] * r - r**2
        return [grows * y[0] - 2 * y[1], grows * y[1] + 2 * y[0]]

    return jaxdyn.ode(rate, [0.0, 0.0], params=[p, q])


def _imperfect_fold():
    return jaxdyn.continue_equilibria(
        lambda p: _imperfect(p, 1.0), -1.0, [-1.3], within=(-1, 1)
    ).special[0]


def _fold_beside_a_fast_direction(p, q):
    """x' = p - x^2 folds at p = 0 for every q; z follows x at the rate e^q."""

    def rate(t, y, c):
        return [c[0] - y[0] ** 2, jnp.exp(c[1]) * (y[0] - y[1])]

    return jaxdyn.ode(rate, [0.0, 0.0], params=[p, q])


def _pairs(curve):
    return [(str(x.kind), *np.round(x.parameters, 9) + 0.0) for x in curve.special]


def test_a_large_eigenvalue_of_another_direction_makes_no_special_point():
    family = jaxdyn.continue_equilibria(
        lambda p: _fold_beside_a_fast_direction(p, 0.0), 1.0, [1.0, 1.0], down=True, within=(-1, 2)
    )
    curve = jaxdyn.continue_curve(
        _fold_beside_a_fast_direction,
        family.special[0],
        (0.0, 0.0),
        within=((-1, 1), (-1, 60)),
        step=0.5,
    )
    np.testing.assert_allclose(curve.parameters[-1], [0.0, 60.0], atol=1e-12)
    assert not curve.special


def test_cusp_of_the_imperfect_pitchfork():
    fold = _imperfect_fold()
    curve = jaxdyn.continue_curve(
        _imperfect, fold, (fold.parameter, 1.0), down=True, within=((-1, 1), (-1, 1))
    )
    p, q = curve.parameters.T
    np.testing.assert_allclose(27 * p**2, 4 * q**3, atol=1e-12)
    np.testing.assert_allclose(3 * curve.states[:, 0] ** 2, q, atol=1e-12)
    (cusp,) = curve.special
    assert cusp.kind == CodimensionTwo.CUSP
    np.testing.assert_allclose(cusp.x, 0.0, atol=1e-10)
    np.testing.assert_allclose(cusp.normal_form["c"], -1.0, rtol=1e-10)
    assert cusp.residual < 1e-10
    # It passes the cusp, from the fold at p > 0 to that at p < 0.
    assert (p[0] > 0) & (p[-1] < 0)
    assert "cusp at" in repr(curve)
    assert curve.names == ("p", "q")
    assert "svg" in curve._repr_html_() or "img" in curve._repr_html_()


@pytest.mark.slow
def test_bogdanov_takens_point_joins_folds_and_hopf_points():
    family = jaxdyn.continue_equilibria(
        lambda p: _bogdanov_takens(p, -1.0), -0.3, [-0.25, 0.0], within=(-1, 1)
    )
    hopf = next(x for x in family.special if x.kind == Kind.HOPF)
    curve = jaxdyn.continue_curve(_bogdanov_takens, hopf, (hopf.parameter, -1.0))
    np.testing.assert_allclose(curve.parameters[:, 0], 0.0, atol=1e-13)
    (point,) = curve.special
    assert point.kind == CodimensionTwo.BOGDANOV_TAKENS
    np.testing.assert_allclose(point.x, 0.0, atol=1e-10)
    # With a = 1 and b = -1 orbits near it are stable: Kuznetsov (2004), section 8.4.
    np.testing.assert_allclose([*point.normal_form.values()], [1.0, -1.0], rtol=1e-10)
    assert "a Bogdanov-Takens point" in curve.end
    assert {x.criticality for x in curve.members} == {"supercritical"}
    folds = jaxdyn.continue_curve(_bogdanov_takens, point, kind=Kind.FOLD, members=10)
    p, q = folds.parameters.T
    np.testing.assert_allclose(4 * p, q**2, atol=1e-13)
    assert folds.special == ()  # that at the start is known
    back = jaxdyn.continue_curve(_bogdanov_takens, point, members=5, down=False)
    assert (back.parameters[1:, 1] < 0).all()


@pytest.mark.sample("0.0")
@pytest.mark.parametrize("start", [-1.0, 0.0])
def test_bautin_point_of_the_normal_form(start):
    # From 0 the first member is the point itself, which is found once.
    family = jaxdyn.continue_equilibria(
        lambda p: _bautin(p, start), -0.3, [0.0, 0.0], within=(-0.5, 0.5)
    )
    (hopf,) = family.special
    curve = jaxdyn.continue_curve(_bautin, hopf, (0.0, start), members=20)
    assert _pairs(curve) == [("Bautin point", 0.0, 0.0)]
    np.testing.assert_allclose([x.coefficient for x in curve.members], curve.parameters[:, 1])
    # r' = .. - r^5, and r is sqrt(2) |z| for a unit eigenvector.
    assert abs(curve.special[0].normal_form["l2"] + 4.0) < 1e-12
    which = ["supercritical" if q < 0 else "subcritical" for q in curve.parameters[1:, 1]]
    assert [x.criticality for x in curve.members[1:]] == which


@pytest.mark.slow
def test_lyapunov_coefficients_of_a_normal_form_in_bent_coordinates():
    """z' = (2 i + c1 |z|^2 + c2 |z|^4) z beside a line that contracts, in bent coordinates."""
    c2 = -0.7

    def rate(t, big, c1):
        x, y, z = big[0] - 0.5 * big[1] ** 2 + 0.2 * big[1] ** 3, big[1], big[2]
        z = z - 0.4 * x * x + 0.3 * x * y
        r = x * x + y * y
        dx, dy = (c1 * r + c2 * r * r) * x - 2 * y, (c1 * r + c2 * r * r) * y + 2 * x
        dz = -z + 0.8 * x * dx - 0.3 * (x * dy + y * dx)
        return [dx + (y - 0.6 * y * y) * dy, dy, dz]

    def make(c1):
        return jaxdyn.ode(rate, [0.0, 0.0, 0.0], params=c1)

    x = np.array([0.0, 0.0, 0.0, 0.3])
    a = np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    first, _ = lyapunov_coefficients(make, x, a, 2.0)
    assert abs(first - 2 * 0.3 / 2) < 1e-13
    assert abs(first_lyapunov(make, x, a, 2.0) - 2 * 0.3 / 2) < 1e-13
    first, second = lyapunov_coefficients(make, np.zeros(4), a, 2.0)
    assert abs(first) < 1e-13
    assert abs(second - 4 * c2) < 1e-12


def _hung(g):
    return jaxdyn.scenes.pendulum(g=g)


def test_wrong_arguments_are_refused():
    fold = _imperfect_fold()
    with pytest.raises(ValueError, match="the values of both parameters"):
        jaxdyn.continue_curve(_imperfect, fold)
    with pytest.raises(ValueError, match="less than a step away"):
        jaxdyn.continue_curve(_imperfect, fold, (3.0, -1.0))
    with pytest.raises(ValueError, match="two bounds, the lower one first"):
        jaxdyn.continue_curve(_imperfect, fold, (0.4, 1.0), within=((1, 0), (0, 1)))
    family = jaxdyn.continue_equilibria(lambda p: _imperfect(p, 1.0), -1.0, [-1.3], members=2)
    with pytest.raises(ValueError, match="an ordinary member"):
        jaxdyn.continue_curve(_imperfect, family.members[0], (-1.0, 1.0))
    with pytest.raises(ValueError, match="an Equilibrium or a CurvePoint"):
        jaxdyn.continue_curve(_imperfect, [0.0], (-1.0, 1.0))
    with pytest.raises(ValueError, match="families: expected at least one"):
        drawing.equilibria([])
    with pytest.raises(ValueError, match="curves: expected at least one"):
        drawing.bifurcation_curves([])
    with pytest.raises(ValueError, match="entry"):
        drawing.equilibria([family], entry="z")
    one, several = drawing.equilibria(family), drawing.equilibria([family])
    assert len(one.axes[0].lines) == len(several.axes[0].lines) > 0
    family = jaxdyn.continue_equilibria(_hung, 1.0, [0.0, 0.0], members=2)
    labels = [drawing.equilibria(family, entry=x).axes[0].get_ylabel() for x in (None, "theta_dot")]
    assert labels == ["theta [rad]", "theta_dot [rad/s]"]
    with pytest.raises(ValueError, match=r"curves: expected a list .* Write \[curve\]\."):
        drawing.bifurcation_curves(family)


def test_a_curve_ends_where_the_rate_does():
    def make(p, q):
        def rate(t, y, c):
            return [c[0] + c[1] * y[0] - y[0] ** 3 + jnp.sqrt(c[1] - 0.5) - jnp.sqrt(0.5)]

        return jaxdyn.ode(rate, [0.0], params=[p, q])

    fold = _imperfect_fold()
    curve = jaxdyn.continue_curve(make, fold, (fold.parameter, 1.0), down=True)
    assert curve.end == "no point of the curve was found beyond"
    assert np.isfinite(curve.parameters).all()
    assert 0.5 <= curve.parameters[-1, 1] < 0.6


def test_a_drawn_line_follows_the_curve_between_its_points():
    # A circle in the parameters; the tangents have any length and sense.
    at = np.linspace(0.0, 2 * np.pi, 11)
    x = np.stack([0.3 * at, np.cos(at), 1e3 * np.sin(at)], axis=1)
    slopes = np.stack([0.3 + 0 * at, -np.sin(at), 1e3 * np.cos(at)], axis=1)
    slopes *= np.where(np.arange(11) % 2, -2.0, 0.1)[:, None]
    members = tuple(
        CurvePoint(Kind.FOLD, y[:1], y[1:], None, 0.0, 0.0, 0.0, y, along, y, {})
        for y, along in zip(x, slopes, strict=True)
    )
    curve = Curve(Kind.FOLD, members, (), (), "", lambda p, q: None)
    p, q = curve.line(curve.points).T
    assert np.abs(np.hypot(p, 1e-3 * q) - 1).max() < 2e-3  # chords: 0.05
