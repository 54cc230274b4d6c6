"""Where a motion is cut into segments, and the same motion in other segments."""

import dataclasses
import os

import jax.numpy as jnp
import numpy as np
import odes
import pytest

import jaxdyn
import orbits
from orbits.shooting.equations import Equations, InUnits, pieces
from orbits.shooting.segment import Limits, linearize_end
from orbits.shooting.segmentation import cut_into_segments, recut, with_segments

RTOL = 1e-12
SIZES = np.array([20.0, 20.0, 40.0])


def lorenz(rho):
    params = {"sigma": 10.0, "rho": rho, "beta": 8 / 3}
    return jaxdyn.ode(odes.lorenz, [8.0, 8.0, 24.0], 1.0, params=params)


@pytest.fixture(scope="module")
def cycle():
    """The cycle of Lorenz that turns once about each equilibrium."""
    start, period = [-13.763610682134, -19.578751942452, 27.0], 1.5586522107162
    return orbits.find(lorenz(28.0), start, period)


def in_pieces(cycle, shares):
    equations = dataclasses.replace(Equations.of(cycle), shares=shares)
    return equations, equations.spread(cycle.y0, cycle.period, RTOL)


def test_a_motion_in_other_segments_is_the_same(cycle):
    few, x = in_pieces(cycle, (0.3, 0.7))
    many = dataclasses.replace(few, shares=(0.1, 0.2, 0.25, 0.45))
    there = few.move_to(x, many, RTOL)
    assert few.unpack(x).period == many.unpack(there).period
    starts, before = np.asarray(many.unpack(there).between), np.asarray(few.unpack(x).between)
    np.testing.assert_allclose(starts[1], before[0], rtol=1e-14)  # a joint of both
    assert np.abs(InUnits(many, there, RTOL)(there)[0]).max() < 1e-10
    np.testing.assert_allclose(many.move_to(there, few, RTOL), x, rtol=0, atol=1e-10)


def test_an_orbit_is_cut_again_where_errors_grow(cycle):
    uneven, x = in_pieces(cycle, (0.01, 0.01, 0.01, 0.97))
    growth = np.linalg.norm(uneven(x, RTOL).transitions, axis=(1, 2)).max()
    even = recut(uneven, x, RTOL, SIZES, 1e3 * growth)
    assert even.segments == 4
    assert max(even.shares) < 0.5
    assert recut(uneven, x, RTOL, SIZES, 100.0) is None  # errors grow little
    assert (
        recut(even, uneven.move_to(x, even, RTOL), RTOL, SIZES, 301.0) is None
    )  # nothing is gained


def test_cuts_are_those_of_the_motion_however_it_is_given(cycle):
    whole, x = in_pieces(cycle, (1.0,))
    parts, y = in_pieces(cycle, (0.3, 0.7))
    one, two = (with_segments(*known, RTOL, 8) for known in ((whole, x), (parts, y)))
    np.testing.assert_allclose(one.shares, two.shares, rtol=1e-3)


def test_no_segment_is_integrated_when_the_time_is_up(cycle, monkeypatch):
    whole, guess = Equations.of(cycle), np.append(cycle.y0, cycle.period)
    parts, x = in_pieces(cycle, (0.125,) * 8)
    begun = []

    def counted(*args, **options):
        begun.append(args)
        return linearize_end(*args, **options)

    monkeypatch.setattr("orbits.shooting.equations.linearize_end", counted)
    over = Limits(over=lambda: len(begun) >= 3)
    found = parts(x, RTOL, over)
    assert 3 <= len(begun) <= 2 + os.cpu_count()  # those that had begun
    assert np.isnan(found.residual).any()
    assert found.status == jaxdyn.Status.STEP_LIMIT
    begun.clear()
    unstable = dataclasses.replace(whole, scene=lorenz(28.0))
    assert cut_into_segments(unstable, guess, RTOL, None, least=4).segments == 4
    begun.clear()
    assert cut_into_segments(unstable, guess, RTOL, None, least=4, limits=over).segments == 4
    begun[:] = [None] * 3
    assert cut_into_segments(unstable, guess, RTOL, None, least=4, limits=over).segments == 1
    assert len(begun) == 3


def _driven(t, y):
    return [jnp.cos(2 * jnp.pi * t) - y[0]]


def test_the_first_segment_of_a_driven_motion_begins_at_zero():
    # Not a rounding before, where another branch of a table may hold.
    driven = orbits.find(jaxdyn.ode(_driven, [0.0], 1.0), period=1.0)
    shares = np.random.default_rng(0).dirichlet(np.full(4, 50.0))
    for period in (1.0, 0.9999997, 1.00012):
        equations = dataclasses.replace(Equations.of(driven), shares=tuple(shares))
        x = equations.spread(driven.y0, driven.period, RTOL)
        times = pieces(equations, np.append(x[:-1], period)).t0
        assert times[0] == 0.0
        np.testing.assert_allclose(times[1:] / period, np.cumsum(shares)[:-1], rtol=1e-15)
