"""The lines in pictures of eigenvalues against those of a damped oscillator."""

import numpy as np
import pytest

import jaxdyn
from jaxdyn import drawing

DAMPING = 0.5


def _oscillator(k):
    """z'' = -2 c z' - k z, with the eigenvalues -c +- sqrt(c^2 - k)."""
    return jaxdyn.ode(lambda t, y, k: [y[1], -2 * DAMPING * y[1] - k * y[0]], [0.0, 0.0], params=k)


@pytest.fixture(scope="module")
def family():
    return jaxdyn.continue_equilibria(_oscillator, 2.0, [0.0, 0.0], within=(-1, 2), down=True)


def test_growth_and_frequency_are_those_of_the_equations(family):
    figure = drawing.eigenvalues(family, parameter="k", hertz=True)
    above, below = figure.axes
    k = above.lines[0].get_xdata()
    assert len(k) > 100
    root = np.sqrt(DAMPING**2 - k + 0j)
    found = np.array([line.get_ydata() for line in above.lines[:2]])
    turning = k > DAMPING**2
    np.testing.assert_allclose(found[:, turning], -DAMPING, atol=1e-7)
    both = -DAMPING + np.stack([-root.real, root.real])[:, ~turning]
    np.testing.assert_allclose(np.sort(found[:, ~turning], axis=0), both, atol=1e-7)
    (line,) = below.lines
    frequency = line.get_ydata()
    np.testing.assert_allclose(2 * np.pi * frequency[turning], root.imag[turning], atol=1e-7)
    assert np.isnan(frequency[~turning]).all()
    assert below.get_xlabel() == "k"
    (mark,) = (line for line in above.lines if line.get_label() == "pitchfork")
    np.testing.assert_allclose(mark.get_xydata(), 0.0, atol=1e-12)


def test_without_oscillations_there_is_no_panel_of_frequencies():
    family = jaxdyn.continue_equilibria(_oscillator, -1.0, [0.0, 0.0], within=(-1, 0.2))
    assert len(drawing.eigenvalues(family).axes) == 1


def test_what_is_refused(family):
    with pytest.raises(ValueError, match="family: expected an EquilibriumFamily"):
        drawing.eigenvalues(family.members)
