"""The Lorenz-84 model in two parameters: published points, and the equations that define them."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import drawing
from jaxdyn.continuation import CodimensionTwo, Kind

#: Largest residual of each defining equation, evaluated independently.
HOLDS = 1e-10


def _lorenz84(F, T):
    """Shil'nikov, Nicolis, Nicolis (1995), Int. J. Bifurc. Chaos 5, 1701."""

    def rate(t, y, c):
        x, u, v, w = y
        force, heat = c
        return [
            -(u**2) - v**2 - 0.25 * x + 0.25 * force - 0.987 * w**2,
            x * u - x * v - u + 0.25,
            x * u + x * v - v,
            -1.04 * w + 0.987 * w * x + heat,
        ]

    return jaxdyn.ode(rate, jnp.zeros(4), params=[F, T])


def _slow(F):
    return _lorenz84(F, 0.04)


@pytest.fixture(scope="module")
def atmosphere():
    """Folds and Hopf points of the Lorenz-84 model with a fourth equation."""
    start = [2.9787004394953343, -0.03868302503393752, 0.058232737694740085, -0.02105288273117459]
    return jaxdyn.continue_equilibria(
        _slow, 3.0, start, within=(-1.5, 3.01), down=True, step=0.02, members=60
    )


#: The points of codimension two that curves of equilibria have.
ALL = tuple(CodimensionTwo)[:5]

BOUNDS = ((-1.0, 4.0), (-1.0, 1.0))


@pytest.fixture(scope="module")
def curves(atmosphere):
    """The curves of the folds, and of two of the Hopf points."""
    fold, _, *hopfs = atmosphere.special
    return [
        jaxdyn.continue_curve(
            _lorenz84, point, (point.parameter, 0.04), within=BOUNDS, down=down, step=0.02
        )
        for point, down in ((fold, True), (hopfs[0], False), (hopfs[1], True))
    ]


@pytest.mark.slow
def test_published_points_of_lorenz84(atmosphere, curves, tmp_path):
    # BifurcationKit.jl, test/hopf_codim_2/lorenz84.jl at 4e79b698: the places of the fold and the
    # three Hopf points, and the Bogdanov-Takens point's a and b.
    fold, *hopfs = atmosphere.special
    np.testing.assert_allclose(fold.parameter, 1.5466483726, atol=2e-10)
    found = [x.parameter for x in hopfs]
    np.testing.assert_allclose(found, [1.61966147, 2.46722900, 2.85988059], atol=2e-5)
    folds, first, second = curves
    kinds = ["Bogdanov-Takens point", "zero-Hopf point", "cusp"]
    assert [x.kind for x in folds.special] == [*kinds, *kinds[1::-1]]
    form = folds.special[0].normal_form
    np.testing.assert_allclose(form["a"], 0.2144233509273467, rtol=1e-9)
    np.testing.assert_allclose(form["b"], 0.6065145518280868, rtol=1e-9)
    # The scene is symmetric in (w, T).
    places = np.array([x.parameters for x in folds.special])
    np.testing.assert_allclose(places, places[::-1] * [1, -1], atol=1e-10)
    assert max(x.residual for x in folds.special) < 1e-10
    bautin, end = first.special
    assert (bautin.kind, end.kind) == ("Bautin point", "Bogdanov-Takens point")
    np.testing.assert_allclose(bautin.frequency, 0.6903636672622595, atol=1e-5)
    # Its real part of G32, over 12; the point itself is known there to 1e-5.
    np.testing.assert_allclose(bautin.normal_form["l2"], 1.8694569030805148 / 12, atol=5e-5)
    np.testing.assert_allclose(end.parameters, places[0], atol=1e-10)
    assert [x.kind for x in second.special][:2] == ["double Hopf point", "zero-Hopf point"]
    np.testing.assert_allclose(second.special[0].parameters[1], 0.026274, atol=1e-6)
    np.testing.assert_allclose(second.special[1].parameters, places[1], atol=1e-10)
    # The other pair of eigenvalues of the double Hopf point, whose curve has the Bautin point.
    other = jaxdyn.continue_curve(_lorenz84, second.special[0], within=BOUNDS, step=0.02)
    assert bautin.kind in [x.kind for x in other.special]
    drawing.bifurcation_curves([folds, first, second], tmp_path / "curves.png")
    drawing.equilibria([atmosphere], tmp_path / "rests.png", entry="y0", parameter="F")


def _rate(state, F, T):
    """The model in NumPy."""
    x, u, v, w = state
    return np.array(
        [
            -(u**2) - v**2 - 0.25 * x + 0.25 * F - 0.987 * w**2,
            x * u - x * v - u + 0.25,
            x * u + x * v - v,
            -1.04 * w + 0.987 * w * x + T,
        ]
    )


def _free(state):
    return _rate(state, 0.0, 0.0)


def _bent(a, b):
    """The second derivative of the rate, which is quadratic, in two directions."""
    return _free(a + b) - _free(a) - _free(b) + _free(np.zeros(4))


def _jacobian(state):
    """By differences, which are exact for a quadratic rate."""
    return np.array([_free(state + h) - _free(state - h) for h in np.eye(4)]).T / 2


def _null(a):
    """Unit left and right null vectors."""
    u, _, vt = np.linalg.svd(a)
    return u[:, -1].conj(), vt[-1].conj()


def _lyapunov(a, frequency):
    """Kuznetsov (2004), Elements of Applied Bifurcation Theory, (5.39)."""
    one = np.eye(4)
    p, q = _null(a - 1j * frequency * one)
    p = p / (p @ q)
    mean = np.linalg.solve(a, _bent(q, q.conj()))
    double = np.linalg.solve(2j * frequency * one - a, _bent(q, q))
    return (p @ (-2 * _bent(q, mean) + _bent(q.conj(), double))).real / (2 * frequency)


def _defining(kind, a):
    """What vanishes at a special point, of the Jacobian and the quadratic terms."""
    values = np.linalg.eigvals(a)
    zero, turning = abs(values).min(), values[np.argsort(abs(values.real))]
    pairs = turning[turning.imag > 1e-3].real
    match kind:
        case Kind.FOLD:
            return [zero]
        case Kind.HOPF:
            return [pairs[0]]
        case CodimensionTwo.CUSP:
            p, q = _null(a)
            return [zero, p @ _bent(q, q)]
        case CodimensionTwo.BOGDANOV_TAKENS:
            return np.poly(a)[-2:]  # a double eigenvalue has half the digits of these
        case CodimensionTwo.ZERO_HOPF:
            return [zero, pairs[0]]
        case CodimensionTwo.DOUBLE_HOPF:
            return pairs[:2]
        case CodimensionTwo.BAUTIN:
            frequency = turning[turning.imag > 1e-3][0].imag
            return [pairs[0], _lyapunov(a, frequency)]
    raise ValueError(kind)


@pytest.mark.slow
def test_special_points_satisfy_their_defining_equations(atmosphere, curves):
    points = [(x, (x.parameter, 0.04)) for x in atmosphere.special]
    points += [(x, x.parameters) for curve in curves for x in curve.special]
    assert {x.kind for x, _ in points} == {Kind.FOLD, Kind.HOPF, *ALL}
    for point, (F, T) in points:
        wrong = [*_rate(point.state, F, T), *_defining(point.kind, _jacobian(point.state))]
        assert np.abs(wrong).max() < HOLDS, point
