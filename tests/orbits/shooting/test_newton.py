"""Newton's method on problems whose solutions are known in closed form."""

import numpy as np
import pytest

from orbits.shooting import newton

FREE = {"lower": np.full(2, -np.inf), "upper": np.full(2, np.inf)}
OPTIONS = {"goal": 1e-12, "max_iterations": 50}


def circle(x):
    """x^2 + y^2 = 1: one equation, two unknowns."""
    return np.array([x @ x - 1]), 2 * x[None, :]


def circle_thrice(x):
    """The same with the rank-deficient look of a closing condition: three copies of it."""
    weights = np.array([1.0, -2.0, 0.5])
    value, slope = circle(x)
    return weights * value, weights[:, None] * slope


def parabola(x):
    """No root: x^2 + y^2 + 1 = 0."""
    return np.array([x @ x + 1]), 2 * x[None, :]


def steps_of(equations, start, **options):
    steps = []
    result = newton.solve(equations, np.array(start), report=steps.append, **(OPTIONS | options))
    return result, steps


@pytest.mark.parametrize("equations", [circle, circle_thrice])
def test_rank_deficient_problems_converge_to_the_nearest_solution(equations):
    start = np.array([1.2, -0.9])  # on the ray through the nearest point of the circle
    result, _ = steps_of(equations, start, **FREE)
    assert result.converged
    assert not result.at_bound
    np.testing.assert_allclose(result.x, start / np.linalg.norm(start), atol=1e-15)


def test_convergence_is_quadratic_at_the_end():
    _, steps = steps_of(circle_thrice, [1.5, 0.5], **FREE)
    sizes = np.array([step.residual for step in steps if step.residual > 1e-13])
    # Newton on x^2 - 1: the next error is a quarter of the square; damping adds a part of it.
    assert (sizes[-3:][1:] < sizes[-3:][:-1] ** 2).all()
    assert len(steps) < 10


def test_the_root_does_not_depend_on_redundant_equations():
    once, _ = steps_of(circle, [0.3, 0.2], **FREE)
    thrice, _ = steps_of(circle_thrice, [0.3, 0.2], **FREE)
    np.testing.assert_allclose(once.x, thrice.x, atol=1e-14)


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        ([-1.0, -1.0], [0.6, 1.0]),  # the nearest root (0.8, 0.6) is outside
        ([-1.0, 0.8], [1.0, 1.0]),  # a root is a corner of the feasible part
        ([0.59, -1.0], [0.61, 1.0]),
    ],
)
def test_a_solution_inside_or_on_the_box_is_found(lower, upper):
    lower, upper = np.array(lower), np.array(upper)
    visited = []

    def watched(x):
        visited.append(x)
        return circle(x)

    start = np.clip([1.6, 1.2], lower, upper)
    result, _ = steps_of(watched, start, lower=lower, upper=upper)
    assert result.converged
    assert abs(result.x @ result.x - 1) < 1e-12
    for x in visited:
        assert (lower <= x).all()
        assert (x <= upper).all()


def test_a_fixed_unknown_stays():
    lower, upper = np.array([-np.inf, 0.6]), np.array([np.inf, 0.6])
    result, _ = steps_of(circle, [3.0, 0.6], lower=lower, upper=upper)
    np.testing.assert_allclose(result.x, [0.8, 0.6], atol=1e-14)
    assert result.x[1] == 0.6
    assert result.converged


def test_no_solution_within_bounds_ends_on_them():
    lower, upper = np.full(2, -0.3), np.full(2, 0.3)
    result, _ = steps_of(circle, [0.2, 0.1], lower=lower, upper=upper)
    assert not result.converged
    assert result.at_bound
    np.testing.assert_array_equal(result.x, upper)


def test_no_descent_ends_at_the_least_residual():
    result, _ = steps_of(parabola, [0.4, -0.2], max_iterations=1000, **FREE)
    assert not (result.converged)
    assert not (result.limit)
    assert not result.at_bound
    assert np.linalg.norm(result.x) < 1e-3
    np.testing.assert_allclose(result.residual, 1, atol=1e-6)


def test_a_double_root_is_reached_though_each_step_leaves_a_quarter():
    # Such is a closing error beside a fold.
    def double(x):
        return np.array([(x[0] - 1) ** 2, x[1]]), np.diag([2 * (x[0] - 1), 1.0])

    found = newton.solve(
        double,
        np.array([1.001, 0.0]),
        lower=np.full(2, -9.0),
        upper=np.full(2, 9.0),
        goal=1e-12,
        max_iterations=60,
    )
    assert found.converged
    assert abs(found.x[0] - 1) <= 1e-6


def test_the_residual_falls_from_step_to_step():
    def rosenbrock(x):
        return (
            np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
            np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
        )

    norms = []
    result = newton.solve(
        rosenbrock,
        np.array([-1.2, 1.0]),
        report=lambda step: norms.append(step.residual),
        **(OPTIONS | FREE),
    )
    assert result.converged
    np.testing.assert_allclose(result.x, [1, 1], atol=1e-12)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_the_limit_counts_accepted_steps(n):
    result, steps = steps_of(circle, [30.0, 40.0], max_iterations=n, **FREE)
    assert result.limit
    assert not result.converged
    assert result.iterations == n
    assert len(steps) == n + 1


def test_goal_decides_what_counts_as_solved():
    strict, _ = steps_of(circle, [3.0, 4.0], goal=1e-14, **FREE)
    loose, _ = steps_of(circle, [3.0, 4.0], goal=1e-3, **FREE)
    assert strict.converged
    assert loose.converged
    # Below the goal the iteration goes on to the rounding level.
    assert np.abs(loose.residual).max() < 1e-14
    solved, steps = steps_of(circle, [0.6, 0.8], goal=1e-3, **FREE)
    assert solved.converged
    np.testing.assert_allclose(solved.x, [0.6, 0.8], atol=1e-15)
    assert len(steps) <= 4


def test_steps_into_nan_are_refused():
    def half_plane(x):
        if x[0] <= 0.1:
            return np.full(1, np.nan), np.full((1, 2), np.nan)
        return np.array([np.log(x[0]) + 2]), np.array([[1 / x[0], 0.0]])

    start = np.array([1.0, 5.0])  # the full step leads to x = -1
    result, _ = steps_of(half_plane, start, **FREE)
    assert result.converged
    np.testing.assert_allclose(result.x, [np.exp(-2), 5.0], atol=1e-13)


@pytest.mark.parametrize("what", ["residual", "jacobian"])
def test_nan_at_the_start_ends_at_once(what):
    def broken(x):
        value, slope = circle(x)
        return (value * np.nan, slope) if what == "residual" else (value, slope * np.nan)

    result, _ = steps_of(broken, [1.0, 2.0], **FREE)
    assert not result.converged
    assert result.iterations == 0
    np.testing.assert_array_equal(result.x, [1.0, 2.0])


def test_a_slope_that_is_nan_is_refused_like_a_value():
    def kink(x):
        value, slope = circle(x)
        return value, slope * (np.nan if x[0] < 1.5 else 1.0)

    result, _ = steps_of(kink, [2.0, 0.1], **FREE)
    assert not result.converged
    assert result.x[0] >= 1.5
    assert np.isfinite(result.residual).all()


def test_a_callback_can_end_it():
    seen = []

    def keep_going(x):
        seen.append(x)
        return len(seen) < 2

    result, _ = steps_of(circle, [30.0, 40.0], keep_going=keep_going, **FREE)
    assert result.iterations == 2
    # The point it was stopped at is the one returned.
    np.testing.assert_array_equal(result.x, seen[-1])


def test_a_zero_jacobian_has_no_step():
    def flat(x):
        return np.ones(2), np.zeros((2, 2))

    result, _ = steps_of(flat, [1.0, 2.0], **FREE)
    assert not result.converged
    assert result.iterations == 0


def test_an_exact_start_takes_no_step():
    result, steps = steps_of(circle, [1.0, 0.0], **FREE)
    assert result.converged
    assert len(steps) <= 2
    np.testing.assert_array_equal(result.x, [1.0, 0.0])


def test_a_solution_is_not_lost_to_rounding():
    """Values that rounding makes: the first is below the goal, the others above it."""
    values = iter(1e-12 * np.array([[0.8, 0.8, 0.8, 0.8], [1.6, 1, 1, 1], [1.8, 0, 0, 0]]))

    def equations(x):
        return next(values, np.full(4, 1e-11)), np.eye(4)

    free = {"lower": np.full(4, -np.inf), "upper": np.full(4, np.inf)}
    result, steps = steps_of(equations, [1.0, 0.0, 0.0, 0.0], **free)
    assert len(steps) == 3
    assert result.converged
    assert result.residual.max() == 0.8e-12
