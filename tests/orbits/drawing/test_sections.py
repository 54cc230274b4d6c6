"""Pictures of sections: a dot for each crossing, a colour for each start, the region's edge."""

import numpy as np
import pytest
from helpers import gap, refusal
from matplotlib.contour import QuadContourSet

import orbits
from jaxdyn import scenes
from jaxdyn.integrate.events import Every, Reaches
from orbits import drawing
from orbits.sections import complete

HENON, PLANE = scenes.henon_heiles(), Reaches(0, 0.0, 1)


@pytest.fixture(scope="module")
def tables():
    """Sections at two energies."""
    return [
        orbits.section(
            HENON,
            PLANE,
            complete(
                HENON, PLANE, {"y": [-0.33, 0.48, 0.0, 0.0], "vy": [0.0, 0.0, 0.4, -0.4]}, energy=e
            ),
            crossings=9,
        )
        for e in (1 / 12, 1 / 8)
    ]


def test_panels_show_all_crossings_and_the_edge_of_the_allowed_region(tables):
    figure = drawing.section(tables)
    assert [ax.get_title() for ax in figure.axes] == ["E = 0.0833333", "E = 0.125"]
    for ax, table, energy in zip(figure.axes, tables, (1 / 12, 1 / 8), strict=True):
        drawn = [line.get_xydata() for line in ax.lines]
        assert gap(np.array(drawn), table.qp) == 0.0
        assert len({line.get_color() for line in ax.lines}) == 4
        (edge,) = (x for x in ax.collections if isinstance(x, QuadContourSet))
        y, vy = np.concatenate([path.vertices for path in edge.get_paths()]).T
        assert y.min() < -0.3 < 0.4 < y.max()
        # A grid of 300 points each way.
        assert gap(vy**2 / 2 + y**2 / 2 - y**3 / 3, np.full_like(y, energy)) < 1e-4
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("y", "vy")


@pytest.mark.slow
def test_a_stroboscopic_section_has_no_edge_and_units_on_its_axes():
    scene = scenes.shaken_pendulum()
    found = orbits.section(scene, Every(2 * np.pi / 60), [[0.2, 0.0]], crossings=3)
    (ax,) = drawing.section(found, titles=["a stroboscope"], title="").axes
    assert not ax.collections
    assert ax.get_title() == "a stroboscope"
    assert ax.get_xlabel() == "theta [rad]"


@pytest.mark.parametrize("centre", [0.0, 0.7])
def test_the_axis_of_a_constant_coordinate_does_not_show_its_rounding(tables, centre):
    noise = 1e-10 * np.random.default_rng(0).standard_normal(tables[0].qp.shape[:2])
    p = centre + noise
    for still in (1, 0):
        qp = tables[0].qp.copy()
        qp[..., still] = p
        (ax,) = drawing.section(tables[0]._replace(qp=qp, event=Every(1.0)), title="").axes
        low, high = (ax.get_xlim, ax.get_ylim)[still]()
        assert low < p.min() < p.max() < high
        assert high - low > 0.1
        moving = (ax.get_xlim, ax.get_ylim)[1 - still]()
        assert np.ptp(moving) < 1.2 * np.ptp(qp[..., 1 - still])
    # A small section of small states is drawn as it is.
    (ax,) = drawing.section(tables[0]._replace(qp=1e-7 * tables[0].qp, ys=1e-7 * tables[0].ys)).axes
    assert np.ptp(ax.get_xlim()) < 2e-7


def test_misuse_is_refused(tables):
    assert "titles: expected 2 of them" in refusal(lambda: drawing.section(tables, titles=["one"]))
    assert "one to 6 sections" in refusal(lambda: drawing.section([]))
    none = orbits.section(HENON, Reaches(0, 9.0), crossings=1)
    assert "points: expected crossings" in refusal(lambda: drawing.section(none))
