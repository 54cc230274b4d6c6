"""Orbital elements against published examples, mpmath, and closed forms of their derivatives."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

import jaxdyn
from jaxdyn import scenes
from jaxdyn.analysis import orbital_elements
from jaxdyn.analysis.elements import OrbitalElements, position_and_velocity

#: (km, km/s, km^3/s^2), then a [km], e, and angles [degrees], to the digits printed there.
CURTIS = ([-6045, -3490, 2500], [-3.457, 6.618, 2.533], 398600.0)  # example 4.3
CURTIS_FOUND = (8788, 0.1712, 153.2, 255.3, 20.07, 28.45)
VALLADO = ([6524.834, 6862.875, 6448.296], [4.901327, 5.533756, -1.976341], 398600.4418)  # 2-5
VALLADO_FOUND = (36127.343, 0.832853, 87.870, 227.898, 53.38, 92.335)


@pytest.mark.parametrize(
    ("given", "found", "digits"),
    [(CURTIS, CURTIS_FOUND, 4e-4), (VALLADO, VALLADO_FOUND, 1e-4)],
)
def test_elements_of_textbooks(given, found, digits):
    elements = jax.jit(orbital_elements)(*map(jnp.asarray, given))
    angles = np.degrees(np.array(elements[2:]))
    assert_allclose([*elements[:2], *angles], found, rtol=digits)


def by_cosines(r, v, mu):
    """The elements to 40 digits by the inverse cosines of Curtis' algorithm 4.2."""
    with mpmath.workdps(40):
        r, v = (mpmath.matrix([mpmath.mpf(float(x)) for x in u]) for u in (r, v))

        def dot(a, b):
            return sum(x * y for x, y in zip(a, b, strict=True))

        def turned(cosine, back):
            angle = mpmath.acos(cosine)
            return float(2 * mpmath.pi - angle if back else angle)

        h = mpmath.matrix(
            [r[1] * v[2] - r[2] * v[1], r[2] * v[0] - r[0] * v[2], r[0] * v[1] - r[1] * v[0]]
        )
        size, away = mpmath.norm(r), dot(r, v)
        n, square = mpmath.matrix([-h[1], h[0], 0]), dot(h, h)
        ecc = ((dot(v, v) - mu / size) * r - away * v) / mu
        e, length = mpmath.norm(ecc), mpmath.norm(n)
        return (
            float(square / mu / (1 - e**2)),
            float(e),
            float(mpmath.acos(h[2] / mpmath.sqrt(square))),
            turned(n[0] / length, n[1] < 0),
            turned(dot(n, ecc) / length / e, ecc[2] < 0),
            turned(dot(ecc, r) / e / size, away < 0),
        )


def test_ellipses_and_hyperbolas_in_all_directions():
    rng = np.random.default_rng(0)
    r, v = rng.normal(size=(2, 40, 3))
    found = jax.vmap(orbital_elements, (0, 0, None))(r, v, 1.5)
    wanted = np.array([by_cosines(*pair, 1.5) for pair in zip(r, v, strict=True)])
    assert (wanted[:, 0] < 0).any()
    assert_allclose(np.stack(found, axis=1), wanted, rtol=1e-10, atol=1e-10)
    again = position_and_velocity(found, 1.5)
    assert_allclose(again, (r, v), rtol=0, atol=1e-10)


def test_derivatives():
    r, v, mu = (jnp.asarray(x, float) for x in VALLADO)
    a = orbital_elements(r, v, mu).a
    slope = jax.grad(lambda v: orbital_elements(r, v, mu).a)(v)
    assert_allclose(slope, 2 * a**2 * v / mu, rtol=1e-12)  # vis viva
    there = jax.jacfwd(lambda y: jnp.stack(orbital_elements(y[:3], y[3:], mu)))
    back = jax.jacfwd(lambda x: jnp.concatenate(position_and_velocity(OrbitalElements(*x), mu)))
    y = jnp.concatenate([r, v])
    one = there(y) @ back(jnp.stack(orbital_elements(r, v, mu)))
    scale = jnp.stack(orbital_elements(r, v, mu))
    assert_allclose(one * scale[None] / scale[:, None], np.eye(6), rtol=0, atol=1e-9)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_orbits_in_the_plane_and_circles(way):
    # In the plane the pericentre is counted from x; on a circle the anomaly from the node.
    turn = 0.7
    ellipse = orbital_elements(
        [np.cos(turn), np.sin(turn)], [-1.1 * way * np.sin(turn), 1.1 * way * np.cos(turn)], 1.0
    )
    assert_allclose(ellipse.inclination, 0.0 if way > 0 else np.pi)
    assert_allclose((ellipse.node, ellipse.pericentre), (0, turn * way % (2 * np.pi)), atol=1e-12)
    circle = orbital_elements([0.0, 1.0, 0.0], [0.0, 0.0, way], 1.0)
    assert_allclose(circle[:4], (1.0, 0.0, np.pi / 2, np.pi / 2 if way > 0 else 3 * np.pi / 2))
    assert circle.pericentre == 0
    for found, place in ((ellipse, [np.cos(turn), np.sin(turn), 0]), (circle, [0.0, 1.0, 0.0])):
        assert_allclose(position_and_velocity(found, 1.0)[0], place, atol=1e-12)


def test_elements_of_two_bodies_are_constant():
    pair = scenes.two_body(m1=0.3, m2=0.7).starting([-0.7, 0.0, 0.3, 0.0, 0.0, -0.5, 0.0, 0.2])
    motion = jaxdyn.simulate(pair, 5.0, rtol=1e-13)
    relative = [motion.ys[:, i + 2 : i + 4] - motion.ys[:, i : i + 2] for i in (0, 4)]
    found = orbital_elements(*relative, 1.0)
    assert_allclose(found.a, 1 / (2 - 0.49), rtol=1e-11)
    assert_allclose(found.e, 1 - 0.49, rtol=1e-11)


def test_misuse_is_refused():
    with pytest.raises(ValueError, match="r: expected shape"):
        orbital_elements([1.0], [1.0], 1.0)
    with pytest.raises(ValueError, match="v: expected shape"):
        orbital_elements([1.0, 0.0, 0.0], [1.0, 0.0], 1.0)
    with pytest.raises(ValueError, match="mu: expected > 0"):
        orbital_elements([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.0)


def test_a_length_is_printed_without_a_unit_since_any_may_be_given():
    in_km = orbital_elements([7000.0, 0.0, 0.0], [0.0, 7.5, 1.0], 398600.4418)
    assert "a            7037.95\n" in str(in_km)
    assert "inclination  0.132552 rad" in str(in_km)
