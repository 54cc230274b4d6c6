"""Curves of pictures through computed points: smooth, and nowhere beyond them."""

import numpy as np
from helpers import gap

from jaxdyn.drawing.bifurcations import smooth
from jaxdyn.drawing.figures import blank


def axes(**scales):
    ax = blank(4.0, 3.0).add_subplot()
    ax.set(**scales)
    return ax


def test_curves_pass_through_the_points_and_are_nearer_to_a_circle_than_chords():
    turn = np.linspace(0, np.pi, 9)
    points = np.stack([np.cos(turn), np.sin(turn)], 1)
    first, second = smooth(axes(), [points[:5], points[4:]])
    whole = np.concatenate([first, second])
    assert gap(first[-1], points[4]) == gap(second[0], points[4]) == 0
    assert all(np.abs(whole - point).sum(1).min() < 1e-14 for point in points)
    chord = 1 - np.cos(np.pi / 16)
    assert np.abs(np.linalg.norm(whole, axis=1) - 1).max() < 0.5 * chord


def test_no_extreme_is_drawn_that_was_not_computed():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 1.0], [3.0, 1.0], [2.5, 2.0]])
    (line,) = smooth(axes(), [points])
    assert line[:, 0].max() == 3.0
    assert line[:, 1].min() == 0.0
    assert (np.diff(line[:, 1]) >= 0).all()


def test_gaps_stay_and_lines_of_two_points_or_with_nan_are_straight():
    lines = np.array([[[0.0, 0.0], [1.0, 1.0]], [[2.0, 0.0], [np.nan, np.nan]]])
    for line, drawn in zip(lines, smooth(axes(), lines), strict=True):
        np.testing.assert_array_equal(drawn, line)


def test_curves_are_smooth_in_the_scale_of_the_axes():
    x = np.logspace(-6, 2, 5)
    (line,) = smooth(axes(xscale="log"), [np.stack([x, np.log10(x)], 1)])
    assert gap(line[:, 1], np.log10(line[:, 0])) < 1e-12
