"""Families that close upon themselves, with closed forms: they end at their first orbit."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED

import jaxdyn
import orbits
from orbits import Kind


def circles(t, y, a):
    """Cycles of radius r with a^2 + (r^2 - 1)^2 = 1/4; they turn faster where they are larger."""
    square = y[0] ** 2 + y[1] ** 2
    grows, turns = 0.3 * (0.25 - a**2 - (square - 1) ** 2), 1 + 0.2 * square
    return [grows * y[0] - turns * y[1], turns * y[0] + grows * y[1]]


def circles_at(a):
    return jaxdyn.ode(circles, [1.2, 0.0], 6.0, params=a)


def follows(t, y, a):
    """Solutions y = w + cos t with a^2 + w^2 = 1/4."""
    w = y[0] - jnp.cos(t)
    return [a**2 + w**2 - 0.25 - jnp.sin(t)]


def follows_at(a):
    return jaxdyn.ode(follows, [1.3], 2 * np.pi, params=a)


def heights(family):
    return np.array([np.linalg.norm(member.orbit.y0) for member in family.members])


@pytest.mark.sample("False")
@pytest.mark.parametrize("down", [False, True])
def test_a_family_of_cycles_ends_where_it_began(down):
    first = orbits.find(circles_at(0.2), [1.2, 0.0], 5.0)
    family = orbits.continue_family(first, circles_at, 0.2, step=0.1, members=200, down=down)
    assert family.end == "the first one again: it is closed"
    squares, a = heights(family) ** 2, family.parameters
    assert np.abs(a**2 + (squares - 1) ** 2 - 0.25).max() < SOLVED
    # Once round: angles on the ellipse are in order, and the last is less than one step away.
    angles = np.unwrap(np.arctan2(squares - 1, a))
    turned = np.diff(angles)
    assert (turned < 0).all() if not down else (turned > 0).all()
    assert 0 < 2 * np.pi - abs(angles[-1] - angles[0]) < 1.5 * np.abs(turned).max()
    assert [x.kind for x in family.special] == [Kind.FOLD] * 2
    folds = sorted(x.parameter for x in family.special)
    np.testing.assert_allclose(folds, [-0.5, 0.5], atol=SOLVED)


@pytest.mark.slow
def test_so_does_one_of_a_drive_and_its_file_says_so(tmp_path):
    first = orbits.find(follows_at(0.3), [1.4], 2 * np.pi)
    options = {"step": 0.1, "path": tmp_path / "isola.jsonl"}
    family = orbits.continue_family(first, follows_at, 0.3, members=4, **options)
    assert family.end == "the number of members requested, 4"
    # Goes on from the file, and knows where it began.
    family = orbits.continue_family(first, follows_at, 0.3, members=200, **options)
    assert family.end == "the first one again: it is closed"
    offsets = np.array([float(member.orbit.y0[0]) - 1 for member in family.members])
    assert np.abs(family.parameters**2 + offsets**2 - 0.25).max() < SOLVED
    assert [x.kind for x in family.special] == [Kind.FOLD] * 2
    (again,) = orbits.families.load(options["path"], follows_at).orbits
    assert again.end == family.end
    assert len(again.members) == len(family.members)


@pytest.mark.slow
def test_one_that_passes_the_same_parameter_and_period_elsewhere_goes_on():
    """Cycles of two radii have one parameter: the ellipse is met there twice, on both sides."""
    first = orbits.find(circles_at(0.0), [np.sqrt(1.5), 0.0], 5.0)
    family = orbits.continue_family(first, circles_at, 0.0, step=0.1, members=200)
    assert family.end == "the first one again: it is closed"
    squares = heights(family) ** 2
    assert squares.min() < 0.52
    assert squares.max() == pytest.approx(1.5, abs=1e-3)
