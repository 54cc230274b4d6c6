"""Curves of special orbits in two parameters against closed forms and a second integrator."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import mathieu_a, mathieu_b

import jaxdyn
import orbits
from orbits import PLAIN, Kind, Orbit, Outcome

TURN = 2 * np.pi


def _at(scene, y0, period, closing=PLAIN):
    """An orbit that is known in closed form."""
    scene = scene.starting(jnp.asarray(y0, float), period)
    return Orbit(
        scene=scene, closing=closing, residual=0.0, outcome=Outcome.FOUND, iterations=0, rtol=1e-13
    )


def _shaken(a, q):
    """A pendulum on a shaken pivot; Mathieu's equation at rest."""

    def rate(t, y, c):
        return [y[1], -(c[0] - 2 * c[1] * jnp.cos(2 * t)) * jnp.sin(y[0])]

    return jaxdyn.ode(rate, [0.0, 0.0], np.pi, params=[a, q])


@pytest.mark.parametrize(
    "edge", [mathieu_a, pytest.param(mathieu_b, marks=pytest.mark.slow, id="mathieu_b")]
)
def test_the_shaken_pendulum_doubles_its_period_at_mathieus_characteristic_values(edge):
    start = float(edge(1, 0.3)), 0.3
    rest = _at(_shaken(*start), [0.0, 0.0], np.pi)
    curve = orbits.continue_curve(
        _shaken, rest, start, kind=Kind.DOUBLING, within=((-5, 5), (0, 2)), step=0.2
    )
    a, q = curve.parameters.T
    assert abs(q[-1] - 2) < 1e-12
    assert curve.end == "the bounds ((-5, 5), (0, 2))"
    np.testing.assert_allclose(a, edge(1, q), atol=1e-12)
    # The determinant is 1: both multipliers are -1 all along, no 1:2 resonance.
    assert curve.special == ()
    np.testing.assert_allclose(curve.periods, np.pi, rtol=1e-13)
    assert curve.names == ("a", "q")


def _carried(p, q):
    """The normal form of Bogdanov and Takens, about a point that moves round a circle.

    Its equilibria are orbits of the period 2 pi, and the multipliers of these exp(2 pi lambda).
    """

    def rate(t, y, c):
        u, v = y[0] - jnp.cos(t), y[1] - jnp.sin(t)
        return [v - jnp.sin(t), c[0] + c[1] * u + u**2 - u * v + jnp.cos(t)]

    return jaxdyn.ode(rate, [1.0, 0.0], TURN, params=[p, q])


@pytest.fixture(scope="module")
def torus_curve():
    # At p = 0 the equilibrium 0 has the eigenvalues +-i sqrt(-q).
    orbit = _at(_carried(0.0, -0.2), [1.0, 0.0], TURN)
    return orbits.continue_curve(_carried, orbit, (0.0, -0.2), kind=Kind.TORUS, step=0.02)


@pytest.mark.slow
def test_torus_points_pass_the_strong_resonances(torus_curve):
    p, q = torus_curve.parameters.T
    np.testing.assert_allclose(p, 0.0, atol=1e-12)
    angles = [x.angle for x in torus_curve.members]
    np.testing.assert_allclose(angles, TURN * np.sqrt(-q), rtol=1e-9)
    third, quarter, whole = torus_curve.special
    kinds = ["1:3 resonance", "1:4 resonance", "1:1 resonance"]
    assert [x.kind for x in torus_curve.special] == kinds
    found = [third.parameters[1], quarter.parameters[1], whole.parameters[1]]
    np.testing.assert_allclose(found, [-1 / 9, -1 / 16, 0.0], atol=1e-10)
    assert max(x.residual for x in torus_curve.special) < 1e-10
    assert "a strong resonance" in torus_curve.end
    assert "1:3 resonance at" in repr(torus_curve)


@pytest.mark.slow
def test_folds_pass_a_resonance(torus_curve):
    # They begin at the end of the curve of torus points: 4 p = q^2.
    folds = orbits.continue_curve(
        _carried, torus_curve.special[-1], kind=Kind.FOLD, down=True, members=6, step=0.2
    )
    p, q = folds.parameters.T
    np.testing.assert_allclose(4 * p, q**2, atol=1e-10)
    orbit = _at(_carried(0.04, -0.4), [1.2, 0.0], TURN)
    folds = orbits.continue_curve(
        _carried, orbit, (0.04, -0.4), kind=Kind.FOLD, members=8, step=0.2
    )
    p, q = folds.parameters.T
    np.testing.assert_allclose(4 * p, q**2, atol=1e-11)
    (point,) = folds.special
    assert point.kind == "1:1 resonance"
    np.testing.assert_allclose(point.parameters, 0.0, atol=1e-10)


def _autonomous(p, q):
    """Folds of a cycle at 27 p^2 = 4 q^3: the angular velocity is 1 + z, z' = p + q z - z^3."""

    def rate(t, y, c):
        x, u, z = y
        r = 0.2 * (1 - x**2 - u**2)
        return [r * x - (1 + z) * u, r * u + (1 + z) * x, c[0] + c[1] * z - z**3]

    return jaxdyn.ode(rate, [1.0, 0.0, 0.0], TURN, params=[p, q])


@pytest.mark.slow
def test_folds_of_cycles_meet_in_a_cusp():
    z = 0.3
    q = 3 * z**2
    p = z**3 - q * z
    orbit = _at(_autonomous(p, q), [1.0, 0.0, z], TURN / (1 + z))
    curve = orbits.continue_curve(
        _autonomous, orbit, (p, q), kind=Kind.FOLD, down=True, members=9, step=0.1
    )
    p, q = curve.parameters.T
    np.testing.assert_allclose(27 * p**2, 4 * q**3, atol=1e-12)
    np.testing.assert_allclose(curve.periods, TURN / (1 + np.sign(-p) * np.sqrt(q / 3)), rtol=1e-9)
    (cusp,) = curve.special
    assert cusp.kind == "cusp"
    np.testing.assert_allclose(cusp.parameters, 0.0, atol=1e-10)


def _mirrored(p, q):
    """u' = (p - q^2) u - u^3 beside (cos t, sin t), which is its own mirror image: p = q^2."""

    def rate(t, y, c):
        u, v = y[0] - jnp.cos(t), y[1] - jnp.sin(t)
        return [(c[0] - c[1] ** 2) * u - u**3 - jnp.sin(t), jnp.cos(t) - v]

    return jaxdyn.ode(rate, [1.0, 0.0], TURN, params=[p, q])


def test_the_remedy_for_a_branch_point_names_a_symmetry():
    plain = _at(_mirrored(0.25, 0.5), [1.0, 0.0], TURN)
    with pytest.raises(ValueError, match=r"twice the period.*orbits\.Symmetry\(signs=\(-1, -1\)\)"):
        orbits.continue_curve(_mirrored, plain, (0.25, 0.5), kind=Kind.BRANCH)


@pytest.mark.slow
def test_where_a_shaken_pendulum_becomes_stable_upright():
    half = orbits.Return(orbits.Symmetry(signs=(-1, -1)), parts=2)
    upright = orbits.find(_shaken(-0.04, 0.3), period=2 * jnp.pi, closing=half)
    edge = orbits.continue_curve(_shaken, upright, (-0.04, 0.3), kind=Kind.BRANCH, members=4)
    a, q = edge.parameters.T
    np.testing.assert_allclose(a, mathieu_a(0, q), atol=1e-9)


@pytest.mark.long
def test_branch_points_that_a_symmetry_keeps():
    half = orbits.Return(orbits.Symmetry(signs=(-1, -1)), parts=2)
    orbit = _at(_mirrored(0.25, 0.5), [1.0, 0.0], TURN, half)
    curve = orbits.continue_curve(
        _mirrored, orbit, (0.25, 0.5), kind=Kind.BRANCH, members=6, step=0.2
    )
    p, q = curve.parameters.T
    np.testing.assert_allclose(p, q**2, atol=1e-11)


@pytest.mark.slow
def test_wrong_arguments_are_refused():
    orbit = _at(_carried(0.04, -0.4), [1.2, 0.0], TURN)
    with pytest.raises(ValueError, match="an ordinary orbit"):
        orbits.continue_curve(_carried, orbit, (0.04, -0.4))
    with pytest.raises(ValueError, match="the values of both parameters"):
        orbits.continue_curve(_carried, orbit, kind=Kind.FOLD)
    with pytest.raises(ValueError, match="a Member, an OrbitCurvePoint or an Orbit"):
        orbits.continue_curve(_carried, [1.2, 0.0], (0.04, -0.4))
    with pytest.raises(ValueError, match="two bounds, the lower one first"):
        orbits.continue_curve(
            _carried, orbit, (0.04, -0.4), kind=Kind.FOLD, within=((1, 0), (0, 1))
        )
    with pytest.raises(ValueError, match="a scene with a state of 2 entries"):
        orbits.continue_curve(
            lambda p, q: jaxdyn.scenes.lorenz(rho=p), orbit, (0.04, -0.4), kind=Kind.FOLD
        )
    with pytest.raises(ValueError, match="less than a step away"):
        orbits.continue_curve(_carried, orbit, (1.0, -0.4), kind=Kind.FOLD)
    with pytest.raises(ValueError, match="complex multipliers"):
        orbits.continue_curve(_carried, orbit, (0.04, -0.4), kind=Kind.TORUS)
    swing = orbits.find(jaxdyn.scenes.pendulum(angle=0.5), period=2.0)
    with pytest.raises(ValueError, match="without a first integral"):
        orbits.continue_curve(
            lambda g, m: jaxdyn.scenes.pendulum(g=g, m=m), swing, (9.81, 1.0), kind=Kind.FOLD
        )


def _duffing(w, force):
    def rate(t, y, c):
        return [y[1], -0.2 * y[1] - y[0] - y[0] ** 3 + c[1] * jnp.cos(c[0] * t)]

    return jaxdyn.ode(rate, [0.0, 0.0], TURN / w, params=[w, force])


def _by_scipy(curve_point):
    """The closing error, M w - w, and l M'(w, w) of Duffing's oscillator, by DOP853."""
    w, force = curve_point.parameters
    y0, vector = np.asarray(curve_point.orbit.y0), curve_point.unknowns[2:4]

    def rate(t, z):
        x, v, a, b, c, d, *columns = z
        k = -1 - 3 * x**2
        out = [v, -0.2 * v - x - x**3 + force * np.cos(w * t), b, k * a - 0.2 * b]
        out += [d, k * c - 0.2 * d - 6 * x * a**2]
        for i in (0, 2):
            out += [columns[i + 1], k * columns[i] - 0.2 * columns[i + 1]]
        return out

    z0 = [*y0, *vector, 0, 0, 1, 0, 0, 1]
    end = solve_ivp(rate, (0, TURN / w), z0, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    monodromy = end[6:].reshape(2, 2).T
    left = np.linalg.svd(monodromy - np.eye(2))[0][:, -1]
    return np.abs(end[:2] - y0).max(), np.abs(end[2:4] - vector).max(), left @ end[4:6]


@pytest.fixture(scope="module")
def duffing_folds():
    """From an orbit near the lower fold at a force of 1/2, through the cusp."""
    near = orbits.find(_duffing(1.43, 0.5), y0=[-0.5, 0.1], period=TURN / 1.43)
    return orbits.continue_curve(
        _duffing, near, (1.43, 0.5), kind=Kind.FOLD, down=True, within=((0, 2), (0, 0.5)), step=0.3
    )


@pytest.mark.long
def test_folds_of_duffings_oscillator_meet_in_a_cusp(duffing_folds):
    (cusp,) = duffing_folds.special
    assert cusp.kind == "cusp"
    for point in (duffing_folds.members[0], duffing_folds.members[-1], cusp):
        closing, null, bent = _by_scipy(point)
        assert max(closing, null) < 1e-10
        assert (abs(bent) < 1e-7) == (point is cusp)
    # Beyond the cusp the other fold: both have parameters beyond those of the cusp.
    assert (duffing_folds.parameters[:, 1] > cusp.parameters[1]).all()
