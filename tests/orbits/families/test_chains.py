"""Families of chains of legs: folds, period doublings and grazing, against closed forms."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

import orbits
from jaxdyn import scenes
from jaxdyn.continuation.kinds import Kind
from jaxdyn.integrate import events
from orbits.families import graph
from orbits.families.chains import margins
from orbits.files import family_files
from orbits.hybrid.equations import ChainEquations

E, G, TURN = 0.8, 9.81, 10.0
PERIOD = 2 * math.pi / TURN


def _walker(slope):
    return scenes.phases_of(scenes.simplest_walker(slope=slope))


def _ball(amplitude):
    return scenes.phases_of(scenes.ball_on_table(amplitude=amplitude))


def _stopped(stop):
    return scenes.phases_of(scenes.impact_oscillator(stop=stop))


def _found(make, value, scene):
    return orbits.find_hybrid(make(value), scene.y0)


@pytest.fixture(scope="module")
def gaits():
    gait = _found(_walker, 0.009, scenes.simplest_walker())
    return orbits.continue_family(gait, _walker, 0.009, within=(0.0, 0.018))


@pytest.fixture(scope="module")
def bounce():
    return _found(_ball, 0.1, scenes.ball_on_table(phase=1.2, velocity=3.0))


def test_the_simplest_walker_doubles_its_period_at_the_published_slope(gaits):
    (point,) = gaits.special
    assert point.kind == Kind.DOUBLING
    assert abs(point.parameter - 0.0150884379) < 1e-10  # to all digits
    known = [m.stability.verdict for m in gaits.members]
    slopes = gaits.parameters
    assert all((v == "stable") == (p < point.parameter) for v, p in zip(known, slopes, strict=True))
    assert gaits.end.startswith("the bounds")
    for member in gaits.members:
        assert orbits.recheck(member.orbit).closure < 1e-12
    assert "period doubling" in repr(gaits)
    assert "simplest_walker" in repr(gaits)


def test_the_branch_of_twice_the_period_is_stable(gaits):
    twice, slope = orbits.switch_branch(gaits, gaits.special[0])
    assert len(twice.legs) == 2
    assert slope > gaits.special[0].parameter  # supercritical
    assert orbits.minimal_period(twice) == (twice.period, 1)
    assert orbits.stability(twice).verdict == "stable"
    again = orbits.continue_family(twice, _walker, slope, within=(0.0, 0.0178))
    (second,) = again.special
    assert second.kind == Kind.DOUBLING
    assert 0.0176 < second.parameter < 0.0178  # the next one of the cascade


def test_a_family_of_bounces_has_the_fold_of_the_closed_form(bounce):
    family = orbits.continue_family(bounce, _ball, 0.1, down=True, within=(0.0, 0.1))
    (fold,) = family.special
    assert fold.kind == Kind.FOLD
    # The table must be as fast, at its fastest, as it has to be at an impact.
    exact = G * PERIOD / 2 * (1 - E) / (1 + E) / TURN
    assert abs(fold.parameter - exact) < 1e-12
    # Beyond the fold it returns, to the bound on which it began.
    assert abs(family.parameters[-1] - 0.1) < 1e-13
    assert family.parameters[1:-1].max() < 0.1


def test_and_the_period_doubling_of_the_closed_form(bounce):
    family = orbits.continue_family(bounce, _ball, 0.1, within=(0.0, 0.15))
    (point,) = family.special
    assert point.kind == Kind.DOUBLING
    # 1 + trace + determinant = 0, with the trace 1 + e^2 + (1 + e)^2 a / g.
    a = 2 * G * (1 + E * E) / (1 + E) ** 2
    speed = G * PERIOD / 2 * (1 - E) / (1 + E)
    assert abs(point.parameter - math.hypot(a / TURN**2, speed / TURN)) < 1e-12


@pytest.mark.slow
def test_a_family_ends_where_its_impact_grazes():
    hit = _found(_stopped, 0.0, scenes.impact_oscillator())
    family = orbits.continue_family(hit, _stopped, 0.0, within=(-0.1, 0.5))
    assert family.end.startswith("a grazed event")
    grazing = family.special[-1]
    assert [x.kind for x in family.special].count(Kind.GRAZING) == 1
    assert grazing.kind == Kind.GRAZING
    # The oscillation without impacts just reaches the stop.
    gain = 1 / complex(1 - 2.6**2, 0.1 * 2.6)
    assert abs(grazing.parameter - abs(gain)) < 1e-10
    assert abs(float(grazing.orbit.y0[1])) < 1e-8
    assert not grazing.stability.ok
    assert all(member.orbit.ok for member in family.members)
    # Near it a multiplier is as large as 1 over the speed of the impact.
    last = family.members[-1]
    assert np.abs(last.stability.nontrivial).max() > 10


@pytest.mark.slow
def test_a_chain_that_touches_a_bound_on_the_way_grazes():
    """A ball that is thrown up below a ceiling, which bounds its leg but does not end it."""

    def make(ceiling):
        ball = scenes.cannonball(g=10.0)
        below = (events.Reaches(1, 5.0), _Below(ceiling))
        return [orbits.Leg(ball, (events.Reaches(1, 0.0),), _thrown, below[1:])]

    toss = orbits.find_hybrid(make(6.0), [0.0, 0.0, 0.0, 10.0], [2.0])
    assert abs(margins(toss)[1] - 1.0) < 1e-9
    family = orbits.continue_family(toss, make, 6.0, down=True, within=(4.0, 7.0))
    assert family.end.startswith("a grazed event")
    (grazing,) = family.special
    assert grazing.kind == Kind.GRAZING
    assert abs(grazing.parameter - 5.0) < 1e-9
    assert grazing.stability.ok


class _Below(events.Event):
    ceiling: jnp.ndarray

    def value(self, t, y):
        return self.ceiling - y[1]


def _thrown(t, y):
    return jnp.array([0.0, 0.0, 0.0, 10.0]) + 0.0 * y


def test_derivatives_by_the_parameter_are_those_of_differences(bounce):
    chain = ChainEquations.of(bounce, _ball)
    x = chain.pack(np.asarray(bounce.y0), bounce.spans, 0.1)
    exact = chain.linearize(x, 1e-13).jacobian
    h = 1e-5
    for i, step in enumerate(h * np.eye(len(x))):
        ends = [chain.linearize(x + sign * step, 1e-13).value for sign in (1, -1)]
        np.testing.assert_allclose(exact[:, i], (ends[0] - ends[1]) / (2 * h), atol=1e-8)
    unknowns = chain.unpack(x)
    np.testing.assert_array_equal(unknowns.start, bounce.y0)
    np.testing.assert_array_equal(unknowns.spans, bounce.spans)
    assert unknowns.parameter == 0.1


def test_a_family_goes_on_from_its_file(tmp_path):
    gait = _found(_walker, 0.009, scenes.simplest_walker())
    options = {"path": tmp_path / "gaits.jsonl", "step": 0.1}
    first = orbits.continue_family(gait, _walker, 0.009, members=3, **options)
    more = orbits.continue_family(gait, _walker, 0.009, members=30, within=(0.0, 0.017), **options)
    # The members of the file, and none of them anew.
    np.testing.assert_array_equal(more.parameters[:3], first.parameters)
    assert more.members[0].orbit.residual == first.members[0].orbit.residual
    seen = []
    again = orbits.continue_family(
        gait, _walker, 0.009, members=30, within=(0.0, 0.017), report=seen.append, **options
    )
    assert len(seen) == len(more.members) > 3
    for a, b in zip(again.members, more.members, strict=True):
        np.testing.assert_array_equal(a.point.x, b.point.x)
        assert a.stability.verdict == b.stability.verdict
        assert orbits.recheck(a.orbit).closure < 1e-12
    (point,) = again.special
    assert point.kind == Kind.DOUBLING
    assert abs(point.parameter - 0.0150884379) < 1e-10
    assert again.end == more.end == "the bounds (0.0, 0.017)"
    with pytest.raises(ValueError, match="path: expected a file of equilibria or orbits"):
        orbits.families.load(options["path"], _walker)


def test_a_family_is_a_picture(gaits, tmp_path):
    listed = family_files.listing(gaits, "slope")
    orbits.drawing.family(listed, tmp_path / "gaits.png")
    assert (tmp_path / "gaits.png").stat().st_size > 10_000
    assert "<img" in gaits._repr_html_()
    assert "<img" in gaits.members[0]._repr_html_()


def _turned(end, start):
    return end - start - jnp.array([0.0, 0.0, 2 * jnp.pi])


def test_a_closing_that_counts_turns_is_not_that_of_two_periods(bounce):
    scene = scenes.ball_on_table(phase=1.2, velocity=3.0)
    counted = orbits.find_hybrid(_ball(0.1), scene.y0, closes=_turned)
    family = orbits.continue_family(counted, _ball, 0.1, within=(0.0, 0.11))
    with pytest.raises(ValueError, match="closes: expected one that holds after 2 periods"):
        orbits.switch_branch(family, family.special[0])


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"make": None, "parameter": None}, "make: expected the legs or phases for each value"),
        ({"hold": ("stance",)}, "hold: expected none for a chain of legs"),
        ({"segments": 4}, "segments: expected none for a chain of legs"),
        ({"energies": (0.0, 1.0)}, "energies: expected none for a chain of legs"),
        pytest.param(
            {"parameter": 3.0},
            "orbit: expected a solution of the closing equations",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_is_not_for_chains_is_refused(gaits, more, message):
    given = {"make": _walker, "parameter": 0.009} | more
    with pytest.raises(ValueError, match=message):
        orbits.continue_family(gaits.members[0].orbit, **given)


@pytest.mark.parametrize(
    "call",
    [
        lambda gaits, path: graph.graph([gaits]),
        lambda gaits, path: orbits.criticality(gaits.special[0]),
        lambda gaits, path: orbits.continue_curve(_walker, gaits.special[0], (0.0, 0.0)),
        lambda gaits, path: family_files.save(path, family_files.listing(gaits, "slope")),
    ],
)
def test_families_of_chains_are_refused_where_orbits_are_meant(gaits, call, tmp_path):
    with pytest.raises(ValueError, match="expected an orbit of one smooth motion, got a chain of"):
        call(gaits, tmp_path / "family.json")
