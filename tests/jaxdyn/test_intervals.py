"""Interval arithmetic: bounds hold for mpmath's values, and both kinds have the same rules."""

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from jaxdyn.intervals import COMPILED, RIGOROUS, Interval

FUNCTIONS = {
    "inverse": (lambda ia, a: ia.inverse(a), lambda x: 1 / x),
    "square": (lambda ia, a: ia.whole_power(a, 2), lambda x: x**2),
    "cube": (lambda ia, a: ia.whole_power(a, 3), lambda x: x**3),
    "minus two": (lambda ia, a: ia.whole_power(a, -2), lambda x: x**-2),
    "magnitude": (lambda ia, a: ia.magnitude(a), abs),
    "sine": (lambda ia, a: ia.cosine(a, 0.5), mpmath.sin),
    "cosine": (lambda ia, a: ia.cosine(a, 0.0), mpmath.cos),
    "tangent": (lambda ia, a: ia.tangent(a), mpmath.tan),
    "exponential": (lambda ia, a: ia.rising(ia.xp.exp, a), mpmath.exp),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_bounds_hold_for_mpmath_and_are_narrow(name):
    bound, exact = FUNCTIONS[name]
    rng = np.random.default_rng(3)
    low = np.append(rng.uniform(-4, 4, 60), [0.0, -1.0, 0.5])
    high = low + np.append(10.0 ** rng.uniform(-8, 0, 60), [0.25, 1.0, 0.0])
    with np.errstate(all="ignore"):
        found = bound(RIGOROUS, Interval(low, high))
    compiled = bound(COMPILED, Interval(jnp.asarray(low), jnp.asarray(high)))
    for own, other in zip(found, compiled, strict=True):
        np.testing.assert_allclose(own, other, rtol=1e-13, atol=1e-14)
    with mpmath.workdps(40):
        for share in (0, 0.3, 1):
            xs = [mpmath.mpf(float(a)) for a in low + share * (high - low)]
            for i, x in enumerate(xs):
                if x != 0 or name not in ("inverse", "minus two"):
                    assert float(found.low[i]) <= exact(x) <= float(found.high[i])
    assert found.high[-1] - found.low[-1] <= 1e-14 * abs(found.high[-1])  # of a point


def test_an_inverse_has_one_bound_where_zero_is_an_end_and_none_around_it():
    low, high = np.array([0.0, -2.0, -1.0, 0.0]), np.array([0.5, 0.0, 1.0, 0.0])
    found = RIGOROUS.inverse(Interval(low, high))
    assert np.isfinite(found.low).tolist() == [True, False, False, False]
    assert np.isfinite(found.high).tolist() == [False, True, False, False]
    np.testing.assert_allclose([found.low[0], found.high[1]], [2.0, -0.5], rtol=1e-15)


def test_conditions_hold_surely_perhaps_or_not():
    a, b = Interval(np.zeros(3), np.ones(3)), Interval(np.r_[2.0, 0.5, -2], np.r_[3.0, 2, -1])
    less, equal = RIGOROUS.less(a, b), RIGOROUS.equal(a, b)
    assert (less.low.tolist(), less.high.tolist()) == ([1, 0, 0], [1, 1, 0])
    assert (equal.low.tolist(), equal.high.tolist()) == ([0, 0, 0], [0, 1, 0])
    chosen = RIGOROUS.choose(less, Interval(np.full(3, 5.0), np.full(3, 6.0)), a)
    assert (chosen.low.tolist(), chosen.high.tolist()) == ([0, 0, 5], [1, 6, 6])
