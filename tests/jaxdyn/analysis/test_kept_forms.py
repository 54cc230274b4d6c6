"""Constant symplectic forms of rates that are given by themselves, against those known."""

import jax.numpy as jnp
import numpy as np
import pytest
from odes import restricted

import jaxdyn
from jaxdyn import effects, scenes
from jaxdyn.analysis.monodromy import form_change, invariant_form, invariant_forms


def test_the_form_of_the_restricted_bodies_is_that_of_turning_axes():
    # dx dp_x + dy dp_y with p_x = vx - y and p_y = vy + x
    exact = np.zeros((4, 4))
    exact[0, 2], exact[1, 3], exact[0, 1] = 1.0, 1.0, -2.0
    exact -= exact.T
    found = invariant_form(jaxdyn.ode(restricted, [0.5, 0.8, 0.0, 0.1], 1.0, params=0.01))
    assert np.abs(found / found[0, 2] - exact).max() < 1e-9


@pytest.mark.parametrize(
    "rate",
    [
        lambda t, y: [y[1], -y[0] - 0.1 * y[1]],
        lambda t, y: [y[1], -y[0] + 1e-10 * y[1]],
        # Conservative, with a form that is not constant.
        lambda t, y: [y[0] * (1 - y[1]), y[1] * (y[0] - 1)],
        # That of the first two entries alone is kept, and singular.
        lambda t, y: [y[1], -jnp.sin(y[0]), y[3], -y[2] - y[3]],
    ],
)
def test_other_rates_keep_none(rate):
    start = [0.7, 0.4, 0.2, 0.1][: len(rate(0.0, [1.0] * 4))]
    assert invariant_form(jaxdyn.ode(rate, start, 1.0)) is None


def test_an_odd_number_of_entries_has_none():
    assert (
        invariant_form(jaxdyn.ode(lambda t, y: [y[1], -y[0], 0.0 * y[2]], jnp.ones(3), 1.0)) is None
    )


def test_every_form_that_a_linear_rate_keeps_is_found():
    one, two = np.array([[0, 1], [-1, 0]]), np.zeros((2, 2))
    # Two oscillators of different frequencies keep the sum of their areas with any weights.
    forms = invariant_forms([np.block([[one, two], [two, 3.0 * one]])])
    assert len(forms) == 2
    assert np.abs(forms[:, :2, 2:]).max() < 1e-12


@pytest.mark.sample("newton_euler")
@pytest.mark.parametrize("formulation", ["lagrange", "newton_euler"])
def test_the_form_of_canonical_coordinates_changes_by_damping_alone(formulation):
    scene = scenes.pendulum(angle=1.0, formulation=formulation)
    each = np.ones(len(scene.y0))
    assert form_change(scene, 0.0, scene.y0, each) < 1e-15
    # d/dt J = -c J: a damping of 1e-9 is seen in doubles.
    damped = form_change(scene + effects.LinearDrag(1e-9), 0.0, scene.y0, each)
    assert 1e-11 < damped < 1e-8


def test_rates_without_canonical_coordinates_have_no_form_that_changes():
    scene = jaxdyn.ode(restricted, [0.5, 0.8, 0.0, 0.1], 1.0, params=0.01)
    assert np.isnan(form_change(scene, 0.0, scene.y0, np.ones(4)))
