"""Pictures of multipliers: each is where it belongs, or an arrow towards it with its size."""

import dataclasses

import numpy as np
import pytest
from helpers import refusal

import orbits
from jaxdyn import scenes
from orbits import drawing
from orbits.analysis.stability import Stability


@pytest.fixture(scope="module")
def found():
    """The stability of a swing of a pendulum: two multipliers, both forced to be 1."""
    return orbits.stability(orbits.find(scenes.pendulum(angle=0.5), period=2.1))


def with_values(found: Stability, *values: complex) -> Stability:
    return dataclasses.replace(found, nontrivial=np.array(values), verdict="unstable")


def test_multipliers_are_drawn_where_they_are(found):
    pair = np.exp(np.array([0.7j, -0.7j]))
    figure = drawing.multipliers(with_values(found, *pair))
    (ax,) = figure.axes
    circle, dots, ring = (line.get_xydata() for line in ax.lines)
    assert np.allclose(np.hypot(*circle.T), 1.0, rtol=0, atol=1e-15)
    assert np.array_equal(dots, np.stack([pair.real, pair.imag], axis=1))
    assert ring.tolist() == [[1.0, 0.0]]
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["multiplier", "2 equal to 1"]
    assert ax.get_title() == "unstable"


def test_a_large_multiplier_is_an_arrow_with_its_size(found):
    (ax,) = drawing.multipliers(with_values(found, -2000.0, -1 / 2000)).axes
    _, dots, _ = (line.get_xydata() for line in ax.lines)
    assert dots.tolist() == [[-1 / 2000, 0.0]]
    (head,) = [text for text in ax.texts if hasattr(text, "arrow_patch")]
    assert head.xy[0] < -1.0
    assert head.xy[1] == 0.0
    assert "2e+03" in [text.get_text() for text in ax.texts]


def test_failed_and_unwritable_ones(found, tmp_path):
    blank = with_values(found, complex(np.nan, np.nan))
    assert len(drawing.multipliers(blank).axes[0].lines[1].get_xdata()) == 0
    assert "path: expected a file" in refusal(lambda: drawing.multipliers(found, tmp_path / "a.x"))


def test_a_notebook_shows_the_table_and_the_picture(found):
    text = found._repr_html_()
    assert "<table" in text
    assert 'src="data:image/png;base64,' in text


def test_what_is_given_in_place_of_a_stability_leads_to_one():
    swing = orbits.find(scenes.pendulum(angle=1.0), period=6.7)
    said = refusal(lambda: drawing.multipliers(swing))
    assert "Pass orbits.stability(orbit)." in said
    family = orbits.continue_family(swing, members=2)
    said = refusal(lambda: drawing.multipliers(family))
    assert "family.members" in said
    assert 'orbits.drawing.family(family, quantity="multiplier")' in said
