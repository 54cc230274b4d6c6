"""The time to which digits can be trusted: growth in closed form, times against references."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jaxdyn import scenes
from jaxdyn.accuracy import horizon
from jaxdyn.hard.cases import chaos
from jaxdyn.solvers import VERNER9

RTOL = 1e-10


@pytest.mark.slow
def test_growth_is_that_of_an_upright_pendulum():
    # Beside upright differences grow like cosh t; sqrt(g / l) = 1.
    upright = scenes.pendulum(g=1.0, angle=math.pi - 1e-4)
    trust = horizon.trusted_time(upright, 7.0, digits=4, rtol=RTOL)
    assert trust.t == 7.0
    assert abs(trust.growth - 1.0) < 0.05


@pytest.mark.parametrize("digits", [3, 6])
@pytest.mark.slow
def test_the_horizon_of_a_double_pendulum_is_where_its_digits_end(digits):
    ts, _ = chaos.reference("double")
    scene = scenes.double_pendulum()
    trust = horizon.trusted_time(scene, ts[-1], samples=ts, rtol=RTOL, digits=digits)
    true = chaos.true_time(scene, np.asarray(trust.estimate.ys), "double", digits)
    assert 0 < true < ts[-1]
    assert abs(trust.t - true) <= 0.1 * true + ts[1]
    assert trust.most > trust.t
    # The rule of thumb knows nothing of the start, which is slow to part.
    assert 0.4 * true < trust.at(RTOL) < 2 * true


@pytest.mark.slow
def test_what_is_not_chaotic_is_trusted_to_its_end():
    trust = horizon.trusted_time(scenes.oscillator(), digits=6, rtol=RTOL, solver=VERNER9)
    assert trust.t == trust.most == float(scenes.oscillator().t1)
    assert abs(trust.growth) < 0.1
    assert trust.estimate.solver == VERNER9.name


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_growth_is_seen_where_tangents_overflow_later_and_backwards_in_time(way):
    ts = np.linspace(0.0, 1000.0, 1001)
    tangents = np.full((1001, 2, 2), np.inf)
    tangents[:701] = np.exp(ts[:701])[:, None, None] * np.eye(2)
    found: Any = SimpleNamespace(ts=way * ts, scale=np.ones(2))
    assert abs(horizon._growth(found, tangents, way * 30.0) - 1.0) < 1e-12
    assert math.isnan(horizon._growth(found, tangents, math.nan))


@pytest.mark.parametrize("growth", [0.0, -0.1])
def test_where_nearby_motions_do_not_part_no_tolerance_has_a_horizon(growth):
    nothing: Any = None
    assert horizon.Trust(1.0, 1.0, growth, 3.0, nothing).at(1e-8) == math.inf
    assert math.isnan(horizon.Trust(1.0, 1.0, math.nan, 3.0, nothing).at(1e-8))


@pytest.mark.parametrize("digits", [0, 16, -3])
def test_digits_that_no_double_has_are_refused(digits):
    with pytest.raises(ValueError, match=r"^digits: expected above 0, at most 15, got "):
        horizon.trusted_time(scenes.oscillator(), digits=digits)
