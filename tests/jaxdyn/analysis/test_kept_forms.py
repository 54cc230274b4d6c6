"""Constant symplectic forms of rates that are given by themselves, against those known."""

import jax.numpy as jnp
import numpy as np
import pytest
from odes import restricted

import jaxdyn
from jaxdyn.analysis.monodromy import kept_by, kept_form


def test_the_form_of_the_restricted_bodies_is_that_of_turning_axes():
    # dx dp_x + dy dp_y with p_x = vx - y and p_y = vy + x
    exact = np.zeros((4, 4))
    exact[0, 2], exact[1, 3], exact[0, 1] = 1.0, 1.0, -2.0
    exact -= exact.T
    found = kept_form(jaxdyn.ode(restricted, [0.5, 0.8, 0.0, 0.1], 1.0, params=0.01))
    assert np.abs(found / found[0, 2] - exact).max() < 1e-9


@pytest.mark.parametrize(
    "rate",
    [
        lambda t, y: [y[1], -y[0] - 0.1 * y[1]],
        # Conservative, with a form that is not constant.
        lambda t, y: [y[0] * (1 - y[1]), y[1] * (y[0] - 1)],
        # That of the first two entries alone is kept, and singular.
        lambda t, y: [y[1], -jnp.sin(y[0]), y[3], -y[2] - y[3]],
    ],
)
def test_other_rates_keep_none(rate):
    start = [0.7, 0.4, 0.2, 0.1][: len(rate(0.0, [1.0] * 4))]
    assert kept_form(jaxdyn.ode(rate, start, 1.0)) is None


def test_an_odd_number_of_entries_has_none():
    assert kept_form(jaxdyn.ode(lambda t, y: [y[1], -y[0], 0.0 * y[2]], jnp.ones(3), 1.0)) is None


def test_every_form_that_a_linear_rate_keeps_is_found():
    one, two = np.array([[0, 1], [-1, 0]]), np.zeros((2, 2))
    # Two oscillators of different frequencies keep the sum of their areas with any weights.
    forms = kept_by([np.block([[one, two], [two, 3.0 * one]])])
    assert len(forms) == 2
    assert np.abs(forms[:, :2, 2:]).max() < 1e-12
