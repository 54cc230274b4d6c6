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


def test_a_high_legend_makes_the_figure_grow_and_leaves_the_panel_its_height():
    def panel(names: int) -> float:
        figure = figures.blank(4.0, 4.0)
        ax = figure.add_subplot()
        for i in range(names):
            ax.plot([0.0, 1.0], label=f"a long name with number {i}")
        figures.legend_below(figure, figures.legend_entries(ax))
        figure.draw_without_rendering()
        assert figure.legends[0].get_window_extent().y0 >= 0.0
        return ax.get_window_extent().height / figure.dpi

    assert panel(16) > panel(2) - 0.5


def test_numbers_on_axes_are_written_in_full():
    figure = figures.blank(4.0, 4.0)
    ax = figure.add_subplot()
    ax.plot([0.99991, 1.0], [5e-5, 6e-5])
    figures.style(ax)
    figure.draw_without_rendering()
    places = ax.get_xticks()
    written = [label.get_text() for label in ax.get_xticklabels()]
    np.testing.assert_allclose([float(text) for text in written], places, rtol=1e-12)
    assert ax.xaxis.get_offset_text().get_text() == ""
