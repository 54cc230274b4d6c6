"""The corrector alone: where it settles, and what it does where it does not."""

import numpy as np
import pytest

from jaxdyn.continuation import newton


def root(x):
    """One equation with one unknown, whose roots are sqrt(2) and -sqrt(2)."""
    return x**2 - 2.0, np.diag(2 * x)


def arc(x):
    """One equation with two unknowns: the circle."""
    return np.array([x @ x - 1.0]), 2 * x[None]


def test_it_settles_at_a_root_with_what_the_equations_say_there():
    found = newton.solve(lambda x: (*root(x), "more"), np.array([1.0]))
    assert found.settled
    assert found.x[0] == pytest.approx(np.sqrt(2), rel=1e-15)
    assert found.more == ("more",)
    polished = newton.solve(root, np.array([1.0]), polish=1)
    assert polished.iterations == found.iterations
    assert polished.residual <= 5e-16


def test_more_unknowns_than_equations_take_the_shortest_step():
    found = newton.solve(arc, np.array([1.2, 1.6]), rank=1e-12)
    np.testing.assert_allclose(found.x, [0.6, 0.8], rtol=1e-14)
    # Dependent equations are not solved without a rank.
    twice = np.ones((2, 2))
    assert not newton.solve(lambda x: (twice @ x - 1.0, twice), np.zeros(2)).settled
    found = newton.solve(lambda x: (twice @ x - 1.0, twice), np.zeros(2), rank=1e-12)
    np.testing.assert_allclose(found.x, 0.5, rtol=1e-15)


def test_halved_steps_arrive_where_full_ones_leave():
    def slope(x):
        return np.arctan(x), np.diag(1 / (1 + x**2))

    start = np.array([3.0])
    away = newton.solve(slope, start, steps=4)
    assert not away.settled
    assert away.x == start  # the best iterate
    assert newton.solve(slope, start, halvings=5).x == pytest.approx(0.0, abs=1e-12)


def test_halved_steps_follow_a_curved_valley():
    # Beside the parabola the residual is a million times that along it, and grows with every step.
    def valley(x):
        slopes = np.array([[-2e6 * x[0], 1e6], [-1.0, 0.0]])
        return np.array([1e6 * (x[1] - x[0] ** 2), 1.0 - x[0]]), slopes

    found = newton.solve(valley, np.array([-1.2, 1.44]), halvings=9)
    assert found.settled
    np.testing.assert_allclose(found.x, 1.0, rtol=1e-15)


def test_it_ends_where_the_residual_grows_or_has_no_value():
    calls = []

    def arctan(x):
        calls.append(x)
        return np.arctan(x), np.diag(1 / (1 + x**2))

    newton.solve(arctan, np.array([3.0]), diverged=1.1)
    assert len(calls) == 2
    nowhere = np.array([np.nan])
    found = newton.solve(lambda x: (nowhere, np.ones((1, 1))), np.array([0.0]))
    assert not found.settled
    assert not found.finite
    # No root: the steps do not become small.
    assert not newton.solve(lambda x: (x**2 + 1, np.diag(2 * x)), np.array([0.3])).settled
