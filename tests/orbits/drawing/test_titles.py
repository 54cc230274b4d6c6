"""Titles of the pictures of orbits: the scene and its numbers, or what is wanted instead."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from jaxdyn import scenes
from orbits import drawing
from orbits.files.family_files import Entry, Listing
from orbits.orbit import Orbit, Outcome
from orbits.targets import aim


def _orbit(scene):
    return SimpleNamespace(scene=scene, y0=np.asarray(scene.y0), period=1.0, solver=None)


def _family(**words):
    made = [scenes.lorenz(rho=rho) for rho in (150.0, 160.0)]
    found = [Orbit(scene, None, 0.0, Outcome.FOUND, 0, 1e-10, 0.0, None) for scene in made]
    entries = [
        Entry(orbit, rho, 0.0, "stable") for orbit, rho in zip(found, (1.0, 2.0), strict=True)
    ]
    return drawing.family(Listing("rho", tuple(entries), (), "the end"), **words).axes[0]


def _throws(**words):
    ball = scenes.cannonball()
    return drawing.throws(ball, aim.farthest(ball, 10.0), **words).axes[0]


def _rosette(**words):
    return drawing.rosette(scenes.power_law(n=1.0, t1=1.0), **words).axes[0]


@pytest.mark.sample(
    "_family-lorenz (sigma = 10, beta = 2.667)", "<lambda>-Motions about a centre of force .*"
)
@pytest.mark.parametrize(
    ("axes", "title"),
    [
        (_family, "lorenz (sigma = 10, beta = 2.667)"),
        (_throws, "cannonball (m = 1), uniform gravity (g = 9.81)\nlaunch speed 10 m/s"),
        (_rosette, "power_law (m = 1), power law (k = 1, n = 1)"),
        (lambda **words: drawing.loops(**words).axes[0], "Motions about a centre of force .*"),
    ],
)
def test_a_picture_says_what_it_is_of_or_what_is_wanted(axes, title):
    assert re.fullmatch(title.replace("(", r"\(").replace(")", r"\)"), axes().get_title())
    assert axes(title="A").get_title() == "A"
    assert axes(title="").get_title() == ""


def test_orbits_side_by_side_have_a_title_above_their_own():
    two = [_orbit(scenes.spring_mass(k=k)) for k in (5.0, 10.0)]
    figure = drawing.orbits(two, titles=["soft", "stiff"])
    (above,) = figure.texts
    assert above.get_text().startswith("spring_mass (m = 1), spring (length = 0.5), ")
    assert drawing.orbits(two, title="A").texts[0].get_text() == "A"
    assert [ax.get_title() for ax in figure.axes] == ["soft", "stiff"]


def test_panels_in_space_hide_neither_their_titles_nor_each_other():
    figure = drawing.orbits([_orbit(scenes.hanging_spring())] * 2, titles=["a", "b"])
    figure.draw_without_rendering()
    (above,) = figure.texts
    for ax in figure.axes:
        assert ax.title.get_window_extent().y1 <= above.get_window_extent().y0
        assert not ax.patch.get_visible()
    assert above.get_window_extent().y1 <= figure.bbox.y1


@pytest.mark.parametrize("scene", [scenes.hanging_spring(), scenes.pendulum()])
def test_many_orbits_are_in_rows_of_four(scene):
    figure = drawing.orbits([_orbit(scene)] * 6, titles=[*"abcdef"])
    figure.draw_without_rendering()
    assert [ax.get_title() for ax in figure.axes] == [*"abcdef"]
    x, y = np.array([(box.x0 + box.x1, box.y0 + box.y1) for box in map(_box, figure.axes)]).T / 2
    np.testing.assert_allclose(np.diff(x[:4]), figure.bbox.width / 4, rtol=0.05)
    np.testing.assert_allclose(x[4:], x[:2], atol=2)
    assert y[:4].min() - y[4:].max() > 0.3 * figure.bbox.height
    assert figure.get_figwidth() < 20


def _box(ax):
    return ax.get_tightbbox()


@pytest.mark.parametrize(("rate", "marks"), [(1.0, ["velocity there"]), (-3e-28, []), (0.0, [])])
def test_the_legend_names_velocities_where_they_are_drawn(rate, marks):
    figure = drawing.orbits([_orbit(scenes.pendulum(rate=rate))])
    named = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert named == ["start", *marks]
    assert bool(marks) == any(hasattr(x, "U") for x in figure.axes[0].collections)


def test_one_orbit_needs_no_list():
    one = _orbit(scenes.hanging_spring())
    assert len(drawing.orbits(one).axes) == len(drawing.orbits([one]).axes) == 1
    with pytest.raises(ValueError, match="at least one orbit"):
        drawing.orbits([])
