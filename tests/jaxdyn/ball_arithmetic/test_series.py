"""Taylor series in balls, against closed forms, and the formulas that they are made of."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import scenes
from jaxdyn.ball_arithmetic import series
from jaxdyn.ball_arithmetic.arithmetic import arb, arb_mat, precision
from jaxdyn.ball_arithmetic.derivative import gradients
from jaxdyn.ball_arithmetic.field import ball_field, scene_formulas
from jaxdyn.ball_arithmetic.motion import follow

BITS = 200


def _field(rate, y0, **params):
    return ball_field(scene_formulas(jaxdyn.ode(rate, y0, 1.0, params=params or None))[0])


def test_known_numbers_are_not_rounded():
    # In doubles 0.1 * 3 is another number than three times the float 0.1.
    field = _field(lambda t, y, p: [(p["a"] * p["b"]) * y[0]], [1.0], a=0.1, b=3.0)
    with precision(BITS):
        (found,) = field.rate(arb(0), [arb(1)])
        assert found.contains(arb(0.1) * 3)
        assert not found.contains(arb(0.1 * 3.0))


def test_quotients_of_counted_numbers_are_not_rounded():
    field = _field(lambda t, y: [(jnp.arange(1, 3) / jnp.arange(3, 5))[0] * y[0]], [1.0])
    with precision(BITS):
        (found,) = field.rate(arb(0), [arb(1)])
        assert found.overlaps(arb(1) / 3)
        assert not found.contains(arb(1 / 3))


@pytest.mark.parametrize(
    "one",
    [
        lambda x: jnp.sin(x) * jnp.exp(-x),
        lambda x: jnp.log(2 + jnp.cos(x)) / (1 + x * x),
        lambda x: jnp.sqrt(1 + x**2) ** 3 + (2 + x) ** -1.5,
        lambda x: jnp.tanh(x) + jnp.abs(2.0) * (3 + x) ** 0.3,
        lambda x: jnp.tan(x) * jnp.sinh(x) + jnp.cosh(x) / jnp.arctan(x),
        lambda x: jnp.arcsin(x) + jnp.arccos(x / 2) * jnp.arcsinh(x),
        lambda x: jnp.arctan2(x, 0.3) + jnp.arctan2(jnp.sin(x), x - 1.0),
        lambda x: jnp.expm1(x) * jnp.log1p(x) + jax.nn.sigmoid(x),
        lambda x: x**5 + jnp.where(jnp.pi > 3.0, x, -x),
    ],
)
def test_formulas_and_their_derivatives_are_those_of_the_program(one):
    field = _field(lambda t, y: [one(y[0])], [0.4])
    with precision(BITS):
        value, slope = field.slopes(field.inputs(arb(0), [arb(0.4)]))
    assert np.isclose(float(value), one(0.4), rtol=1e-14)
    assert np.isclose(float(slope), jax.grad(one)(0.4), rtol=1e-14)


def test_the_series_of_a_rotation_is_that_of_sine_and_cosine():
    field = _field(lambda t, y: [y[1], -y[0]], [0.0, 1.0])
    with precision(BITS, 30):
        found = series.motion_series(field, arb(0), [arb(0), arb(1)], 30)
        factor = arb(1)
        for j in range(31):
            factor = factor / j if j else factor
            exact = factor * (j % 2) * (-1) ** (j // 2)
            assert found[0][j].overlaps(exact)
            assert float(found[0][j].rad()) < 1e-50


def test_the_derivative_of_a_linear_motion_is_the_exponential():
    a = [[0.1, 0.7, 0.0], [-0.3, 0.2, 0.5], [0.25, -0.5, -0.75]]
    field = _field(lambda t, y: jnp.array(a) @ y, [1.0, 2.0, 3.0])
    with precision(BITS, 50):
        y = [arb(1), arb(2), arb(3)]
        coefficients = series.motion_series(field, arb(0), y, 50)
        slopes = series.slope_series(field, arb(0), coefficients, 50)
        found = series.at(series.transition_series(slopes, 50), arb(0.25))
        exact = (arb_mat(a) * arb(0.25)).exp()
        assert all(abs(float(x)) < 1e-50 for x in (found - exact).entries())


def test_a_motion_has_the_digits_of_another_integrator():
    scene = scenes.double_pendulum()
    field = ball_field(scene_formulas(scene)[0])
    with precision(BITS):
        y = [arb(float(x)) for x in scene.y0]
        found = follow(field, arb(0), y, arb(1), 30, slopes=True)
        again = follow(field, arb(0), y, arb(1), 30, more_order=9)
    exact = np.asarray(jaxdyn.solve(scene, 1.0, rtol=1e-14).y1)
    assert np.allclose([float(x) for x in found.y], exact, rtol=1e-11)
    assert all(abs(float(a - b)) < 1e-28 for a, b in zip(found.y, again.y, strict=True))


def test_slopes_of_unused_inputs_are_zero():
    formulas, _ = scene_formulas(scenes.oscillator())
    (row, other) = gradients(formulas.graph, formulas.rates, formulas.states)
    assert row[0] == 0.0
    assert other[1] == 0.0
