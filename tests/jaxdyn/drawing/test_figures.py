"""Empty figures and their axes."""

import numpy as np

from jaxdyn.drawing import figures


def test_axes_in_space_can_have_one_scale():
    ax = figures.in_space(5.0, 4.0)
    ax.plot([0.0, 3.0], [0.0, 1.0], [0.0, 0.5])
    ax.set_aspect("equal")
    assert tuple(ax.figure.get_size_inches()) == (5.0, 4.0)
    lengths = np.diff(np.reshape(ax.get_w_lims(), (3, 2)))[:, 0]
    scales = ax.get_box_aspect() / lengths
    np.testing.assert_allclose(scales, scales[0], rtol=1e-12)
