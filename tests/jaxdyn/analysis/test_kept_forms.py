"""Constant symplectic forms of rates that are given by themselves, against those known."""

import jax.numpy as jnp
import numpy as np
import pytest
from odes import restricted

import jaxdyn
from jaxdyn import effects, scenes
from jaxdyn.analysis.monodromy import form_change, invariant_form, invariant_forms
from orbits.closing.sizes import sizes


def test_the_form_of_the_restricted_bodies_is_that_of_turning_axes():
    # dx dp_x + dy dp_y with p_x = vx - y and p_y = vy + x
    exact = np.zeros((4, 4))
    exact[0, 2], exact[1, 3], exact[0, 1] = 1.0, 1.0, -2.0
    exact -= exact.T
    found = invariant_form(jaxdyn.ode(restricted, [0.5, 0.8, 0.0, 0.1], 1.0, params=0.01))
    assert np.abs(found / found[0, 2] - exact).max() < 1e-9


def test_the_form_of_one_coordinate_is_kept_however_it_is_written():
    def swing(t, y):
        return [2 * y[1], -0.5 * jnp.sin(y[0])]

    found = invariant_form(jaxdyn.ode(swing, [0.7, 0.0], 6.0))
    np.testing.assert_allclose(found / found[0, 1], [[0.0, 1.0], [-1.0, 0.0]], atol=1e-12)


def stretched(t, y, damping):
    """A bond that a transverse oscillation stretches: V = (1 - exp(-x))^2 + (0.85 + 0.3 x) z^2."""
    x, z, u, v = y
    pull = -2 * (1 - jnp.exp(-x)) * jnp.exp(-x) - 0.3 * z * z
    return [u, v, pull - damping * u, -1.7 * z - 0.6 * x * z]


@pytest.mark.parametrize("amplitude", [0.1, 1e-3, 1e-5])
@pytest.mark.parametrize("beside", [0.0, 1e-12])
def test_small_motions_beside_an_axis_have_the_form_of_large_ones(amplitude, beside):
    # Along the mode z, the size of x is the square of the amplitude, and x may be rounding.
    start = np.array([beside, amplitude, 0.0, 0.0])

    def form(damping):
        scene = jaxdyn.ode(stretched, start, 4.8, params=damping)
        each = sizes(scene)
        found = invariant_form(scene, each)
        return found if found is None else found / np.outer(each, each)

    found = form(0.0)
    exact = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    np.testing.assert_allclose(found / found[0, 2], exact, atol=1e-8)
    assert form(1e-9) is None


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


def test_damping_that_acts_late_in_the_span_leaves_no_form():
    def rate(t, y):
        return [y[1], -y[0] - jnp.where(jnp.mod(t, 6.0) > 3.0, 0.1, 0.0) * y[1]]

    assert invariant_form(jaxdyn.ode(rate, [1.0, 0.0], 6.0)) is None
    assert invariant_form(jaxdyn.ode(rate, [1.0, 0.0], 3.0)) is not None
