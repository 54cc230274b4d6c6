"""Interval bounds: they hold at every point of a box, and for mpmath; bisection misses nothing."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import formulas_of

from jaxdyn import scenes
from jaxdyn.analysis.equilibrium_search.completeness import isolate
from jaxdyn.intervals import Interval
from jaxdyn.solvers.enclosures import Dual, enclosures
from jaxdyn.solvers.formulas.graph import NotElementary


def _bounds(field, lows, highs):
    """Bounds (k, cells) and (k, n, cells) of a field over boxes (n, cells)."""
    n, cells = lows.shape
    found = formulas_of(lambda _, y: field(y), jnp.zeros(()), jnp.asarray(lows[:, 0]))
    slopes = np.repeat(np.eye(n)[:, :, None], cells, axis=2)
    inputs = {
        node: Dual(Interval(lows[i], highs[i]), Interval(slopes[i], slopes[i]))
        for i, node in enumerate(found.states)
    }
    return enclosures(found.rates, inputs, cells)


def _functions(y):
    a, b = y
    steep = jnp.where(a == 0, 0.0, jnp.sqrt(jnp.where(a == 0, 1.0, a * a)))
    return jnp.stack(
        [
            jnp.sin(a) * jnp.cos(b),
            jnp.exp(a) / (2.5 + b),
            jnp.log(3 + a) - b**3,
            jnp.tanh(a * b),
            (4 + a + b) ** 1.7,
            steep * b,
            jnp.where((a != 0) & ~(b == 0), a * b, 1.0),
            (a * a + b * b) ** -1.5,
        ]
    )


SCENES = {
    "two_springs": scenes.two_springs(c_a=0.1),
    "cart_pendulum": scenes.cart_pendulum(),
    "lorenz": scenes.lorenz(),
}


def _field(name):
    return _functions if name == "functions" else lambda y: SCENES[name].rate(0.0, y)


@pytest.mark.parametrize("name", ["functions", *SCENES])
def test_bounds_hold_at_points_of_the_box(name):
    field = _field(name)
    rng = np.random.default_rng(1)
    n = 2 if name == "functions" else len(SCENES[name].y0)
    sizes = 10.0 ** rng.uniform(-3, 0, size=(n, 200))
    lows = rng.uniform(-1, 1, size=(n, 200)) * 1.2
    lows[:, :20] = np.round(lows[:, :20])  # some boxes begin at whole numbers, at 0 too
    found = _bounds(field, lows, lows + sizes)
    points = lows + sizes * rng.uniform(size=(n, 200))
    look = jax.jit(jax.vmap(lambda y: (field(y), jax.jacfwd(field)(y))))
    values, slopes = look(jnp.asarray(points.T))
    finite = 0
    for i, (value, slope) in enumerate(found):
        for bound, at in ((value, values[:, i]), (slope, slopes[:, i].T)):
            off = 1e-12 * np.abs(at)  # rounding of the values that are compared
            assert (bound.low <= at + off).all()
            assert (at - off <= bound.high).all()
            finite += np.isfinite(bound.high - bound.low).sum()
    assert finite > 100


def test_bounds_of_a_point_hold_for_mpmath_and_are_tight():
    rng = np.random.default_rng(2)
    points = rng.uniform(0.1, 1, size=(2, 50))
    found = _bounds(_functions, points, points)
    with mpmath.workdps(40):
        for cell in range(50):
            a, b = (mpmath.mpf(float(x)) for x in points[:, cell])
            exact = [
                mpmath.sin(a) * mpmath.cos(b),
                mpmath.exp(a) / (2.5 + b),
                mpmath.log(3 + a) - b**3,
                mpmath.tanh(a * b),
                (4 + a + b) ** mpmath.mpf(1.7),
                a * b,
                a * b,
                (a * a + b * b) ** mpmath.mpf(-1.5),
            ]
            for wanted, (value, _) in zip(exact, found, strict=True):
                low, high = float(value.low[cell]), float(value.high[cell])
                assert low <= wanted <= high
                assert high - low < 1e-13 * (1 + abs(float(wanted)))


def test_what_has_no_bounds_is_refused():
    with pytest.raises(NotElementary, match="power"):
        _bounds(
            lambda y: y ** (1.0 + jnp.where(y[::-1] == 0, 1.0, 0.0)),
            np.ones((2, 1)),
            2 * np.ones((2, 1)),
        )


def test_bisection_finds_all_zeros_of_a_product_of_sines():
    def field(_, y):
        return jnp.stack([jnp.sin(3 * y[0]), jnp.sin(2 * y[1] + y[0])])

    found = isolate(
        formulas_of(field, jnp.zeros(()), jnp.zeros(2)),
        np.array([-2.0, -2.0]),
        np.array([2.0, 2.0]),
    )
    assert not len(found.open)
    # 3 x = i pi and 2 y + x = j pi.
    wanted = [
        (i * np.pi / 3, (j - i / 3) * np.pi / 2)
        for i in range(-1, 2)
        for j in range(-3, 4)
        if abs((j - i / 3) * np.pi / 2) < 2
    ]
    boxes = found.single
    margin = boxes[:, :, 1] - boxes[:, :, 0]
    held = [
        np.all((y >= boxes[:, :, 0] - margin) & (y <= boxes[:, :, 1] + margin), axis=1)
        for y in np.array(wanted)
    ]
    assert np.any(held, axis=1).all()  # each zero is in a box
    assert np.any(held, axis=0).all()  # and each box holds one of them
